"""The example of docs/learned.md: a network of another form behind a small class, in the loop too."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from scenarios.sensors.lidar import HDL32, LidarMeasurement, Mount
from scenarios.spec import RunSpec, simulation_of
from smartmot.plugins import plugin
from smartmot.pointcloud import PointCloud
from smartmot.types import EgoState

DOCS = Path(__file__).parents[3] / "docs" / "learned.md"

SIZE_M = (0.6, 0.5, 1.8)


def nearest_upright() -> bytes:
    """(P, 4) points to one pedestrian around the nearest point between -1.2 and 0 m up."""
    constants = {
        "x": np.array([0]), "z": np.array([2]), "end": np.array([3]), "axis": np.array([1]),
        "columns": np.array([1]), "low": np.float32(-1.2), "high": np.float32(0.0),
        "far": np.float32(1e9), "rest": np.array([[*SIZE_M, 0.0]], dtype=np.float32),
        "score": np.array([0.9], dtype=np.float32), "number": np.array([1]),
    }  # fmt: skip
    node = helper.make_node
    nodes = [
        node("Slice", ["points", "x", "end", "axis"], ["place"]),
        node("Slice", ["points", "z", "end", "axis"], ["up"]),
        node("Greater", ["up", "low"], ["over"]),
        node("Less", ["up", "high"], ["under"]),
        node("And", ["over", "under"], ["upright"]),
        node("ReduceSumSquare", ["place", "columns"], ["square"], keepdims=1),
        node("Where", ["upright", "square", "far"], ["distance"]),
        node("ArgMin", ["distance"], ["row"], axis=0, keepdims=0),
        node("Gather", ["place", "row"], ["nearest"], axis=0),
        node("Concat", ["nearest", "rest"], ["boxes"], axis=1),
        node("Identity", ["score"], ["scores"]),
        node("Identity", ["number"], ["numbers"]),
    ]
    value = helper.make_tensor_value_info
    graph = helper.make_graph(
        nodes,
        "nearest",
        [value("points", TensorProto.FLOAT, ["points", 4])],
        [
            value("boxes", TensorProto.FLOAT, [1, 7]),
            value("scores", TensorProto.FLOAT, [1]),
            value("numbers", TensorProto.INT64, [1]),
        ],
        [numpy_helper.from_array(values, name) for name, values in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content


@pytest.fixture
def name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The example as a module of the current folder, beside its network."""
    (example,) = re.findall(r"## Another network.*?```python\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("mine.py").write_text(example, "utf-8")
    Path("mine.onnx").write_bytes(nearest_upright())
    yield "mine:Mine"
    sys.modules.pop("mine", None)


def test_inputs_outputs_and_frame_are_as_the_docs_say(name: str) -> None:
    """The vehicle looks north at (10, 20), with the sensor 1 m ahead of its middle."""
    xyz = np.array([[3.0, 0.0, -1.7], [9.0, 2.0, -0.5], [5.0, -3.0, -0.4], [2.0, 0.0, 1.0]])
    cloud = PointCloud(xyz, np.zeros(4))
    ego = EgoState(1.0, 10.0, 20.0, 0.5 * np.pi, 0.0)
    found = plugin(name)(HDL32, 0).detect(LidarMeasurement(1.0, 0, cloud, ego, Mount(1.7, 1.0)))
    np.testing.assert_allclose(found.boxes.center_m, [[13.0, 26.0]], atol=1e-6)
    np.testing.assert_allclose(found.boxes.size_m, [SIZE_M[:2]], atol=1e-6)
    np.testing.assert_allclose(found.boxes.yaw_rad, [0.5 * np.pi])
    assert found.category.tolist() == ["pedestrian"]
    assert found.score == pytest.approx([0.9])


def test_the_ego_brakes_for_what_it_says(name: str) -> None:
    settings = (("sensor", "mid70"), ("perception", name))
    speed = (("Ego_speed_kmh", 40.0),)
    run = simulation_of(
        RunSpec("test", "crossing", speed, "map", "physical", "dry", 40.0, settings=settings)
    ).run()
    assert run.contact is None
    assert run.flag_time_s is not None
