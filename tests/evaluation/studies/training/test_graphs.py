"""Networks as graphs that run faster: they say the same, with integers nearly; no PyTorch is needed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")

import onnxruntime  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

from evaluation.errors import ArgumentError  # noqa: E402
from evaluation.studies.training.graphs import is_quantised, quantised, streamlined  # noqa: E402
from smartmot.lidar.learned import CHANNELS, FEATURES, Decoder, PillarGrid, Pillars, pillars_of  # noqa: E402
from smartmot.lidar.learned.network_file import INPUTS, METADATA, OUTPUT, metadata  # noqa: E402
from smartmot.lidar.learned.shipped import shipped_path  # noqa: E402
from tests.networks import upright_network  # noqa: E402

GRID = PillarGrid((0.0, 12.8), (-6.4, 6.4), 0.4, 6)
DECODER = Decoder(GRID, ("car", "pedestrian"))


def seen(seed: int, grid: PillarGrid = GRID, count: int = 900) -> Pillars:
    rng = np.random.default_rng(seed)
    low, high = zip(grid.ahead_m, grid.left_m, (0.0, 2.0), strict=True)
    xyz = rng.uniform(low, high, (count, 3))
    return pillars_of(xyz, xyz[:, 2], grid)


def output_of(content: bytes, pillars: Pillars) -> NDArray[np.float32]:
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    given = dict(zip(INPUTS, (pillars.features, pillars.cell), strict=True))
    output: NDArray[np.float32] = session.run([OUTPUT], given)[0]
    return output


class Drawn:
    """A network of the form of ours, with random weights, written without PyTorch.

    Args:
        enlarged: by how much each picture is enlarged before they are joined.
        seed: of the weights.
    """

    def __init__(self, enlarged: tuple[int, ...] = (1, 2, 4), seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.nodes: list[onnx.NodeProto] = []
        self.constants: dict[str, NDArray[np.generic]] = {}
        self.enlarged = enlarged

    def put(self, kind: str, inputs: list[str], output: str, **attributes: object) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def drawn(self, name: str, *shape: int) -> str:
        self.constants[name] = (self.rng.normal(0.0, 0.4, shape)).astype(np.float32)
        return name

    def convolution(self, at: str, name: str, before: int, after: int, wide: int = 3, stride: int = 1) -> str:
        inputs = [at, self.drawn(f"{name}_weight", after, before, wide, wide), self.drawn(f"{name}_b", after)]
        pads = [wide // 2] * 4
        return self.put("Conv", inputs, name, kernel_shape=[wide, wide], pads=pads, strides=[stride, stride])

    def content(self) -> bytes:
        (rows, columns), points = GRID.shape, GRID.most_points
        self.constants |= {
            "axis": np.array([1]), "last": np.array([-1]), "cells": np.array([rows * columns, 5]),
            "picture": np.array([1, rows, columns, 5]),
        }  # fmt: skip
        at = INPUTS[0]
        for k, (before, after) in enumerate(((len(FEATURES), 7), (7, 5))):
            at = self.put("MatMul", [at, self.drawn(f"m{k}", before, after)], f"product_{k}")
            at = self.put("Add", [at, self.drawn(f"b{k}", after)], f"with_bias_{k}")
            at = self.put("Relu", [at], f"positive_{k}")
        at = self.put("ReduceMax", [at, "axis"], "greatest", keepdims=0)
        empty = self.put("ConstantOfShape", ["cells"], "empty")
        where = self.put("Unsqueeze", [INPUTS[1], "last"], "where")
        at = self.put("ScatterND", [empty, where, at], "scattered")
        at = self.put("Reshape", [at, "picture"], "rows")
        at = self.put("Transpose", [at], "channels", perm=[0, 3, 1, 2])
        joined, before = [], 5
        for k, factor in enumerate(self.enlarged):
            at = self.put("Relu", [self.convolution(at, f"block_{k}", before, 6 + k, stride=2)], f"level_{k}")
            before = 6 + k
            side = self.put("Relu", [self.convolution(at, f"side_{k}", before, 4, wide=1)], f"beside_{k}")
            if factor > 1:
                self.constants[f"scale_{k}"] = np.array([1, 1, factor, factor], dtype=np.float32)
                side = self.put(
                    "Resize", [side, "", f"scale_{k}"], f"large_{k}", mode="nearest",
                    coordinate_transformation_mode="asymmetric", nearest_mode="floor",
                )  # fmt: skip
            joined.append(side)
        at = self.put("Concat", joined, "joined", axis=1)
        at = self.put("Relu", [self.convolution(at, "wide", 4 * len(joined), 9)], "head")
        classes = len(DECODER.classes)
        parts = [
            self.convolution(at, "scores", 9, classes, wide=1),
            self.convolution(at, "values", 9, len(CHANNELS), wide=1),
        ]
        self.put("Concat", parts, OUTPUT, axis=1)
        value = helper.make_tensor_value_info
        graph = helper.make_graph(
            self.nodes, "drawn",
            [
                value(INPUTS[0], TensorProto.FLOAT, ["pillars", points, len(FEATURES)]),
                value(INPUTS[1], TensorProto.INT64, ["pillars"]),
            ],
            [value(OUTPUT, TensorProto.FLOAT, [1, *DECODER.shape])],
            [numpy_helper.from_array(array, name) for name, array in self.constants.items()],
        )  # fmt: skip
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
        pairs = [1.0] * classes, [0.0] * classes, [0.3] * classes
        helper.set_model_props(model, {METADATA: metadata(DECODER, *pairs, {"made": "by a test"})})
        onnx.checker.check_model(model)
        written: bytes = model.SerializeToString()
        return written


def kinds(content: bytes) -> list[str]:
    return [node.op_type for node in onnx.load_from_string(content).graph.node]


@pytest.mark.parametrize("enlarged", [(1, 2), (1, 2, 4), (1, 2, 4, 8)])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_faster_graph_says_the_same(enlarged: tuple[int, ...], seed: int) -> None:
    content = Drawn(enlarged, seed).content()
    faster = streamlined(content)
    assert "DepthToSpace" in kinds(faster)
    assert "MatMul" not in kinds(faster)
    onnx.checker.check_model(onnx.load_from_string(faster), full_check=True)
    for k in range(3):
        pillars = seen(k, count=(5, 300, 4000)[k])
        wanted = output_of(content, pillars)
        assert np.abs(wanted).max() > 1.0
        np.testing.assert_allclose(output_of(faster, pillars), wanted, rtol=1e-4, atol=1e-4)


def test_metadata_stay_and_a_second_time_changes_nothing() -> None:
    content = Drawn().content()
    faster = streamlined(content)
    before, after = (onnx.load_from_string(each).metadata_props for each in (content, faster))
    assert [(entry.key, entry.value) for entry in after] == [(entry.key, entry.value) for entry in before]
    assert streamlined(faster) == faster


def test_networks_of_another_form_stay_as_they_are() -> None:
    content = upright_network(DECODER)
    assert streamlined(content) == content
    # nothing is enlarged: there is nothing to be saved
    model = onnx.load_from_string(Drawn().content())
    for node in model.graph.node:
        if node.op_type == "Resize":
            node.attribute[[entry.name for entry in node.attribute].index("mode")].s = b"linear"
    smooth = model.SerializeToString()
    pillars = seen(1)
    assert "Resize" in kinds(streamlined(smooth))
    np.testing.assert_allclose(
        output_of(streamlined(smooth), pillars), output_of(smooth, pillars), rtol=1e-4, atol=1e-4
    )


def test_the_shipped_network_says_the_same_as_a_faster_graph() -> None:
    content, grid = shipped_path("pillars").read_bytes(), PillarGrid()
    pillars = seen(3, grid, 20_000)
    np.testing.assert_allclose(
        output_of(streamlined(content), pillars), output_of(content, pillars), rtol=0.0, atol=1e-4
    )


def test_integers_are_close_small_and_the_same_each_time() -> None:
    content = Drawn((1, 2, 4), 3).content()
    clouds = [seen(k) for k in range(6)]
    made = [quantised(content, iter(clouds)) for _ in range(2)]
    assert made[0] == made[1]
    assert is_quantised(made[0])
    assert not is_quantised(content)
    assert not set(kinds(made[0])) & {"MatMul"}
    wanted, got = output_of(content, clouds[0]), output_of(made[0], clouds[0])
    # 7 bits of weights and 8 of values through six layers; values beyond the mean range of a cloud are cut
    assert 0.0 < np.abs(got - wanted).mean() < 0.1 * np.abs(wanted).mean()
    held = {entry.key: entry.value for entry in onnx.load_from_string(made[0]).metadata_props}
    assert METADATA in held


def test_without_a_cloud_there_are_no_integers() -> None:
    nothing: Iterator[Pillars] = iter(())
    with pytest.raises(ArgumentError, match="no cloud with points in the cells of the network"):
        quantised(Drawn().content(), nothing)


def test_no_pytorch_is_needed(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import evaluation.studies.training.calibration, evaluation.studies.training.graphs\n"
        "assert not any(name.startswith('torch.') for name in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
