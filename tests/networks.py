"""A network made by hand, whose boxes are known: it finds what stands upright."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from smartmot.lidar.learned import CHANNELS, FEATURES, Decoder
from smartmot.lidar.learned.network_file import INPUTS, METADATA, OUTPUT, metadata

SIZE_M = (0.5, 0.5, 1.8)
"""Of its pedestrians."""

HALF_M = 1.2
"""Height over the ground of a pillar's highest point at which its score is 0.5."""


def score_of(height_m: float, slope: float = 4.0) -> float:
    """Score of a pillar by its highest point."""
    return float(1.0 / (1.0 + np.exp(-slope * (height_m - HALF_M))))


def upright_network(decoder: Decoder, slope: float = 4.0) -> bytes:
    """A pedestrian in the middle of each cell of the output, as likely as its highest point is high.

    Args:
        decoder: grid and classes; "pedestrian" is one of them.
        slope: of the logit, per metre over `HALF_M`.
    """
    (rows, columns), classes = decoder.grid.shape, decoder.classes
    channels, *cells = decoder.shape
    before = classes.index("pedestrian")
    box = (0.0, 0.0, 0.5 * SIZE_M[2], *np.log(SIZE_M), 0.0, 1.0, 0.0, 1.0)
    never = np.full((1, len(classes), *cells), -12.0, dtype=np.float32)
    fixed = np.tile(np.array(box, dtype=np.float32)[None, :, None, None], (1, 1, *cells))
    assert channels == len(classes) + len(CHANNELS)
    constants = {
        "from": np.array([FEATURES.index("height")]),
        "to": np.array([FEATURES.index("height") + 1]),
        "last": np.array([2]),
        "points": np.array([1]),
        "flat": np.array([-1]),
        "nothing": np.full(rows * columns, -2.0, dtype=np.float32),
        "grid": np.array([1, 1, rows, columns]),
        "half": np.float32(HALF_M),
        "slope": np.float32(slope),
        "earlier": never[:, :before],
        "later": never[:, before + 1 :],
        "box": fixed,
    }
    node = helper.make_node
    nodes = [
        node("Slice", [INPUTS[0], "from", "to", "last"], ["heights"]),
        node("ReduceMax", ["heights", "points"], ["most"], keepdims=0),
        node("Reshape", ["most", "flat"], ["height"]),
        node("ScatterElements", ["nothing", INPUTS[1], "height"], ["scattered"], axis=0, reduction="max"),
        node("Reshape", ["scattered", "grid"], ["image"]),
        node("MaxPool", ["image"], ["pooled"], kernel_shape=[2, 2], strides=[2, 2]),
        node("Sub", ["pooled", "half"], ["over"]),
        node("Mul", ["over", "slope"], ["logit"]),
        node("Concat", ["earlier", "logit", "later", "box"], [OUTPUT], axis=1),
    ]
    number, points = "pillars", decoder.grid.most_points
    graph = helper.make_graph(
        nodes,
        "upright",
        [
            helper.make_tensor_value_info(INPUTS[0], TensorProto.FLOAT, [number, points, len(FEATURES)]),
            helper.make_tensor_value_info(INPUTS[1], TensorProto.INT64, [number]),
        ],
        [helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, [1, *decoder.shape])],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    plain = [1.0] * len(classes), [0.0] * len(classes), [0.3] * len(classes)
    helper.set_model_props(model, {METADATA: metadata(decoder, *plain, {"made": "by hand"})})
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content
