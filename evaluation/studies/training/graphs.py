"""Networks as ONNX graphs: one that runs faster and says the same, and one with integers of 8 bits.

Neither needs PyTorch: both take the bytes of any network that `smartmot.lidar.learned` runs.
"""

from __future__ import annotations

import hashlib
import logging
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.results.files import write_bytes
from smartmot.arrays import FloatArray
from smartmot.lidar.learned.network_file import INPUTS, OUTPUT
from smartmot.lidar.learned.pillars import Pillars

INTEGERS = ("Conv", "Concat", "Resize", "Relu")
"""Operators on integers: the convolutions, which take most of the time, and what stands between them, so
that values are not turned into floats and back."""


def streamlined(content: bytes) -> bytes:
    """A network that says the same, to rounding, in less time; the same bytes where it has another form.

    Linear layers of points become matrix products with their bias inside, and the maximum over a pillar is
    taken before the last rectifier. A convolution over enlarged pictures becomes four over the pictures as
    they are, one for each place in a cell (Shi et al., "Is the deconvolution layer the same as a
    convolutional layer?", 2016), and what follows point by point is done for each of the four.
    """
    import onnx

    model = onnx.load_from_string(content)
    graph = _Graph(model.graph)
    changes = [_matrix_products(graph), _places_of_a_cell(graph)]
    if not any(changes):
        return content
    graph.write()
    streamlined_content: bytes = model.SerializeToString(deterministic=True)
    return streamlined_content


class _Graph:
    """Nodes and constants of a graph, which are changed and written back.

    Args:
        proto: the graph.
    """

    def __init__(self, proto: Any) -> None:
        from onnx import numpy_helper

        self.proto = proto
        self.nodes: list[Any] = list(proto.node)
        self.constants = {entry.name: numpy_helper.to_array(entry) for entry in proto.initializer}

    def maker(self, name: str) -> Any:
        """The node with an output of that name; None: there is none."""
        return next((node for node in self.nodes if name in node.output), None)

    def user(self, name: str, kind: str) -> Any | None:
        """The only node that takes a value, if it is of a kind."""
        users = [node for node in self.nodes if name in node.input]
        return users[0] if len(users) == 1 and users[0].op_type == kind else None

    def add(self, before: Any, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """A node before another; its output."""
        from onnx import helper

        node = helper.make_node(kind, inputs, [output], name=output, **attributes)
        self.nodes.insert(self.nodes.index(before), node)
        return output

    def keep(self, name: str, value: FloatArray) -> str:
        """A constant of the graph; its name."""
        self.constants[name] = np.ascontiguousarray(value)
        return name

    def write(self) -> None:
        """Put nodes and the constants that they use into the graph."""
        from onnx import numpy_helper

        used = {name for node in self.nodes for name in node.input}
        for field in (self.proto.node, self.proto.initializer, self.proto.value_info):
            del field[:]
        self.proto.node.extend(self.nodes)
        self.proto.initializer.extend(
            numpy_helper.from_array(value, name) for name, value in self.constants.items() if name in used
        )


def _attributes(node: Any) -> dict[str, Any]:
    from onnx import helper

    return {entry.name: helper.get_attribute_value(entry) for entry in node.attribute}


def _matrix_products(graph: _Graph) -> bool:
    """Turn linear layers of (N, M, F) points and the maximum over M into products of (N M, F) matrices."""
    layers, value, old = [], INPUTS[0], []
    while (product := graph.user(value, "MatMul")) is not None:
        bias = graph.user(product.output[0], "Add")
        rectifier = None if bias is None else graph.user(bias.output[0], "Relu")
        if bias is None or rectifier is None:
            return False
        names = (product.input[1], next(name for name in bias.input if name != product.output[0]))
        if not set(names) <= set(graph.constants):
            return False
        layers.append(names)
        old += [product, bias, rectifier]
        value = rectifier.output[0]
    most = graph.user(value, "ReduceMax")
    if not layers or most is None or _axes(graph, most) != [1] or _attributes(most).get("keepdims", 1):
        return False
    (features, _), (_, last) = (graph.constants[layers[k][0]].shape for k in (0, -1))
    points = _points_of(graph)
    flat = graph.keep("flat", np.array([-1, features]))
    value = graph.add(old[0], "Reshape", [INPUTS[0], flat], "points")
    for number, (weight, bias_name) in enumerate(layers):
        if number:
            value = graph.add(old[0], "Relu", [value], f"rectified_{number}")
        value = graph.add(old[0], "Gemm", [value, weight, bias_name], f"layer_{number}")
    value = graph.add(old[0], "Reshape", [value, graph.keep("by_pillar", np.array([-1, points, last]))], "of")
    # the greatest of rectified values is the rectified greatest
    value = graph.add(old[0], "ReduceMax", [value, *most.input[1:]], "most", keepdims=0)
    graph.add(old[0], "Relu", [value], most.output[0])
    for node in (*old, most):
        graph.nodes.remove(node)
    return True


def _axes(graph: _Graph, node: Any) -> list[int] | None:
    """Axes of a reduction, which are an attribute or a constant input; None: not known."""
    if len(node.input) > 1:
        axes = graph.constants.get(node.input[1])
        return None if axes is None else axes.tolist()
    return None


def _points_of(graph: _Graph) -> int:
    """Points of a pillar, as the input says it."""
    (shape,) = (entry.type.tensor_type.shape for entry in graph.proto.input if entry.name == INPUTS[0])
    points: int = shape.dim[1].dim_value
    return points


_KERNEL = {0: ((0,), (1, 2)), 1: ((0, 1), (2,))}
"""Of a convolution 3 wide over a picture whose cells are doubled: by place in a cell, which weights fall on
each of the two cells under it."""


def _places_of_a_cell(graph: _Graph) -> bool:
    """Turn a convolution over pictures, some of them enlarged, into four over half the cells.

    What comes of it goes through a rectifier and convolutions of one cell into the output.
    """
    last = graph.maker(OUTPUT)
    parts = [graph.maker(name) for name in (last.input if last is not None else ())]
    if last is None or last.op_type != "Concat" or not parts or not all(map(_is_of_one_cell, parts)):
        return False
    sources = {part.input[0] for part in parts}
    rectifier = graph.maker(sources.pop())
    wide = None if sources or rectifier is None else graph.maker(rectifier.input[0])
    if wide is None or rectifier.op_type != "Relu" or not _is_three_wide(wide):
        return False
    joined = graph.maker(wide.input[0])
    constants = {name for node in (wide, *parts) for name in node.input[1:]}
    if joined is None or joined.op_type != "Concat" or not constants <= set(graph.constants):
        return False
    weight = graph.constants[wide.input[1]]
    channels = _channels(graph, list(joined.input))
    if channels is None or sum(channels) != weight.shape[1]:
        return False
    split = np.split(weight, np.cumsum(channels)[:-1], axis=1)
    fine, coarse = [], []
    for name, part in zip(joined.input, split, strict=True):
        factor = _enlargement(graph, name)
        if factor == 1:
            fine.append((name, part))
        elif factor % 2:
            return False
        else:
            coarse.append((_less_enlarged(graph, wide, name, factor), part))
    if not fine or not coarse:
        return False
    fine_weight = graph.keep("fine_weight", np.concatenate([part for _, part in fine], axis=1))
    halves = np.concatenate([part for _, part in coarse], axis=1)
    picture = _joined(graph, wide, [name for name, _ in fine], "fine")
    half_picture = _joined(graph, wide, [name for name, _ in coarse], "coarse")
    values = [graph.constants[part.input[1]] for part in parts]
    offsets = [
        graph.constants[part.input[2]] if len(part.input) > 2 else np.zeros(len(value), np.float32)
        for part, value in zip(parts, values, strict=True)
    ]
    value_weight = graph.keep("value_weight", np.concatenate(values))
    value_bias = graph.keep("value_bias", np.concatenate(offsets))
    outputs = []
    for row in (0, 1):
        for column in (0, 1):
            at, pads = f"{row}{column}", [1 - row, 1 - column, row, column]
            kernel = np.stack(
                [
                    np.stack([halves[:, :, i][:, :, :, j].sum(axis=(2, 3)) for j in _KERNEL[column]], axis=-1)
                    for i in _KERNEL[row]
                ],
                axis=-2,
            )
            inputs = [picture, fine_weight, *wide.input[2:]]
            fine_sum = graph.add(
                wide, "Conv", inputs, f"fine_{at}", kernel_shape=[3, 3], pads=pads, strides=[2, 2]
            )
            inputs = [half_picture, graph.keep(f"coarse_weight_{at}", kernel)]
            around = graph.add(wide, "Conv", inputs, f"coarse_{at}", kernel_shape=[2, 2], pads=pads)
            total = graph.add(wide, "Add", [around, fine_sum], f"sum_{at}")
            head = graph.add(wide, "Relu", [total], f"head_{at}")
            inputs = [head, value_weight, value_bias]
            outputs.append(graph.add(wide, "Conv", inputs, f"values_{at}", kernel_shape=[1, 1]))
    places = graph.add(wide, "Concat", outputs, "places", axis=1)
    for node in (wide, rectifier, *parts, last):
        if node is not wide:
            graph.nodes.remove(node)
    graph.add(wide, "DepthToSpace", [places], OUTPUT, blocksize=2, mode="DCR")
    graph.nodes.remove(wide)
    _drop_unused(graph)
    return True


def _is_of_one_cell(node: Any | None) -> bool:
    """Whether a node is a convolution of single cells."""
    if node is None or node.op_type != "Conv":
        return False
    held = _attributes(node)
    return (
        held.get("kernel_shape") == [1, 1]
        and held.get("group", 1) == 1
        and set(held.get("strides", [1])) == {1}
        and set(held.get("pads", [0])) == {0}
    )


def _is_three_wide(node: Any) -> bool:
    """Whether a node is a convolution of 3 x 3 cells that keeps their number."""
    held = _attributes(node) if node.op_type == "Conv" else {}
    return (
        held.get("kernel_shape") == [3, 3]
        and held.get("group", 1) == 1
        and set(held.get("strides", [1])) == {1}
        and set(held.get("dilations", [1])) == {1}
        and held.get("pads") == [1, 1, 1, 1]
    )


def _channels(graph: _Graph, names: list[str]) -> list[int] | None:
    """Channels of pictures that come from convolutions; None: one does not."""
    counts = []
    for name in names:
        node = graph.maker(name)
        while node is not None and node.op_type in ("Relu", "Resize"):
            node = graph.maker(node.input[0])
        if node is None or node.op_type != "Conv" or node.input[1] not in graph.constants:
            return None
        counts.append(len(graph.constants[node.input[1]]))
    return counts


def _enlargement(graph: _Graph, name: str) -> int:
    """By how much a picture is enlarged, cell by cell; 1: not, or in another way."""
    node = graph.maker(name)
    if node is None or node.op_type != "Resize" or len(node.input) != 3:
        return 1
    held, scales = _attributes(node), graph.constants.get(node.input[2])
    plain = held.get("mode", b"nearest") == b"nearest" and (
        held.get("coordinate_transformation_mode") == b"asymmetric" and held.get("nearest_mode") == b"floor"
    )
    if not plain or scales is None or scales.shape != (4,) or scales[2] != scales[3]:
        return 1
    factor = float(scales[2])
    is_whole = factor.is_integer() and scales[:2].tolist() == [1.0, 1.0]
    return int(factor) if is_whole else 1


def _less_enlarged(graph: _Graph, before: Any, name: str, factor: int) -> str:
    """A picture enlarged half as much."""
    node = graph.maker(name)
    assert node is not None
    if factor == 2:
        source: str = node.input[0]
        return source
    scales = graph.keep(f"scales_{factor // 2}", np.array([1, 1, factor // 2, factor // 2], np.float32))
    inputs = [node.input[0], "", scales]
    return graph.add(before, "Resize", inputs, f"{name}_half", **_attributes(node))


def _joined(graph: _Graph, before: Any, names: list[str], output: str) -> str:
    return names[0] if len(names) == 1 else graph.add(before, "Concat", names, output, axis=1)


def _drop_unused(graph: _Graph) -> None:
    """Leave out nodes whose outputs nothing takes."""
    while True:
        used = {OUTPUT, *(name for node in graph.nodes for name in node.input)}
        kept = [node for node in graph.nodes if used & set(node.output)]
        if len(kept) == len(graph.nodes):
            return
        graph.nodes = kept


def is_quantised(content: bytes) -> bool:
    """Whether a network has integers already."""
    import onnx

    nodes = onnx.load_from_string(content).graph.node
    return any(node.op_type in ("QuantizeLinear", "QLinearConv", "ConvInteger") for node in nodes)


def quantised(content: bytes, clouds: Iterable[Pillars]) -> bytes:
    """A network with convolutions on integers of 8 bits.

    Weights have 7 bits: processors without instructions for sums of such products (AVX2) add pairs of them
    in 16 bits, where two of 8 bits do not fit (onnxruntime, "Quantize ONNX models").

    Args:
        content: of an ONNX file.
        clouds: by which the ranges of values are found.

    Raises:
        ArgumentError: there is no cloud.
    """
    import onnx
    from onnxruntime import quantization

    seen: Iterator[Pillars] = iter(clouds)
    first = next(seen, None)
    if first is None:
        raise ArgumentError(
            "--int8: no cloud with points in the cells of the network to find ranges of values by"
        )

    class Reader(quantization.CalibrationDataReader):  # type: ignore[misc]
        """Pillars of the clouds, one after another."""

        def __init__(self) -> None:
            self.waiting: Pillars | None = first

        def get_next(self) -> dict[str, Any] | None:
            """The inputs of the next cloud."""
            now, self.waiting = self.waiting, next(seen, None)
            return None if now is None else dict(zip(INPUTS, (now.features, now.cell), strict=True))

    root = logging.getLogger()
    level = root.level
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "float.onnx", Path(folder) / "int8.onnx"
        source.write_bytes(streamlined(content))
        try:
            root.setLevel(logging.ERROR)  # its advice on how to prepare a graph
            quantization.quantize_static(
                source, made, Reader(), quant_format=quantization.QuantFormat.QDQ, per_channel=True,
                activation_type=quantization.QuantType.QUInt8, weight_type=quantization.QuantType.QInt8,
                reduce_range=True, op_types_to_quantize=list(INTEGERS),
                calibrate_method=quantization.CalibrationMethod.MinMax,
                # the mean range of a cloud: that of all of them grows with their number, and steps with it
                extra_options={"CalibMovingAverage": True},
            )  # fmt: skip
        finally:
            root.setLevel(level)
        model = onnx.load(made)
    held = {entry.key: entry.value for entry in onnx.load_from_string(content).metadata_props}
    onnx.helper.set_model_props(model, held)
    result: bytes = model.SerializeToString(deterministic=True)
    return result


def write_network(path: Path, content: bytes) -> str:
    """Write a network's file; the SHA-256 of it in hexadecimal digits."""
    write_bytes(path, content)
    return hashlib.sha256(content).hexdigest()
