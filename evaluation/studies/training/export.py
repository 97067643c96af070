"""A trained network as an ONNX file for `smartmot.lidar.learned`."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from evaluation.studies.training.graphs import streamlined
from evaluation.studies.training.network import PillarNetwork
from evaluation.studies.training.samples import LabelledFrame
from smartmot.lidar.learned import Decoder
from smartmot.lidar.learned.network_file import INPUTS, METADATA, OUTPUT, metadata
from smartmot.lidar.learned.pillars import Pillars, pillars_of

OPSET = 18

EXAMPLE_PILLARS = 64
"""Of the cloud with which the network is recorded; clouds may have any number."""


def onnx_bytes(
    network: PillarNetwork,
    decoder: Decoder,
    scale: Sequence[float],
    offset: Sequence[float],
    least_score: Sequence[float],
    origin: dict[str, Any],
) -> bytes:
    """A network as the bytes of an ONNX file.

    Args:
        network: with its weights.
        decoder: its grid and classes.
        scale: factor of the logits of each class's scores.
        offset: added to them.
        least_score: of boxes of each class that count.
        origin: how it was made, for the file's metadata.
    """
    import onnx

    network.eval()
    features = torch.zeros(EXAMPLE_PILLARS, decoder.grid.most_points, network.of_points[0].in_features)
    cell = torch.arange(EXAMPLE_PILLARS)
    number = torch.export.Dim("pillars_of", min=2)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's own
        path = Path(folder) / "network.onnx"
        torch.onnx.export(
            network, (features, cell), path, input_names=list(INPUTS), output_names=[OUTPUT],
            opset_version=OPSET, dynamo=True, dynamic_shapes={"features": {0: number}, "cell": {0: number}},
            external_data=False, verbose=False, optimize=True,
        )  # fmt: skip
        model = onnx.load(path)
    # what the exporter notes of its own lines of code: folders of this machine among it
    graph = model.graph
    noted = (*graph.node, *graph.value_info, *graph.input, *graph.output, *graph.initializer)
    for entry in (model, graph, *noted):
        del entry.metadata_props[:]
    said = metadata(decoder, list(scale), list(offset), list(least_score), origin)
    onnx.helper.set_model_props(model, {METADATA: said})
    return streamlined(model.SerializeToString(deterministic=True))


def greatest_difference(
    network: PillarNetwork, content: bytes, frames: Sequence[LabelledFrame], decoder: Decoder
) -> float:
    """Greatest difference of any output of an ONNX file's bytes and of its network, over some frames."""
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    network.eval()
    greatest = 0.0
    for seen in _seen(frames, decoder):
        with torch.no_grad():
            ours = network(torch.from_numpy(seen.features), torch.from_numpy(seen.cell)).numpy()
        theirs = session.run([OUTPUT], dict(zip(INPUTS, (seen.features, seen.cell), strict=True)))[0]
        greatest = max(greatest, float(np.abs(ours - theirs).max()))
    return greatest


def _seen(frames: Sequence[LabelledFrame], decoder: Decoder) -> Iterator[Pillars]:
    for frame in frames:
        yield pillars_of(frame.points[:, :2], frame.points[:, 2], decoder.grid)
