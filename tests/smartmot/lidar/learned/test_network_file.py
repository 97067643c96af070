"""Networks as files: what is read of them, what is refused, what comes out of a cloud."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from smartmot.errors import ConfigError
from smartmot.lidar import LearnedConfig, detect
from smartmot.lidar.detections import GROUND, OFF_AREA, OUT_OF_REACH
from smartmot.lidar.learned import FEATURES, Decoder, PillarGrid
from smartmot.lidar.learned.network_file import INPUTS, METADATA, OUTPUT, metadata
from smartmot.pointcloud import PointCloud

DECODER = Decoder(PillarGrid((0.0, 16.0), (-8.0, 8.0), 0.5, 4), ("car", "pedestrian", "cyclist"))


def network(
    described: str | None,
    inputs: tuple[str, ...] = INPUTS,
    row: int = 7,
    points: int | str = 4,
    frames: int = 1,
) -> bytes:
    """A network that says the same of every cloud: a pedestrian of score 0.8 at (7.5, -4.5)."""
    value = np.full((frames, *DECODER.shape), -12.0, dtype=np.float32)
    value[0, 1, row, 3] = np.log(4.0)
    value[0, 3:, row, 3] = (0.0, 0.0, 0.9, *np.log((0.6, 0.5, 1.8)), 0.0, 1.0, 0.0, 1.0)
    nodes = [
        helper.make_node("ReduceMax", [inputs[0]], ["most"], keepdims=0),
        helper.make_node("Mul", ["most", "zero"], ["nothing"]),
        helper.make_node("Add", ["nothing", "value"], [OUTPUT]),
    ]
    kept = [numpy_helper.from_array(value, "value"), numpy_helper.from_array(np.float32(0.0), "zero")]
    features = helper.make_tensor_value_info(inputs[0], TensorProto.FLOAT, ["n", points, len(FEATURES)])
    cell = helper.make_tensor_value_info(inputs[1], TensorProto.INT64, ["n"])
    result = helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, value.shape)
    graph = helper.make_graph(nodes, "constant", [features, cell], [result], kept)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if described is not None:
        helper.set_model_props(model, {METADATA: described})
    content: bytes = model.SerializeToString()
    return content


def described(**other: Any) -> str:
    content = json.loads(metadata(DECODER, [1.0] * 3, [0.0] * 3, [0.3] * 3, {"seed": 1}))
    return json.dumps(content | other)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "network.onnx"
    file.write_bytes(network(described()))
    return file


def street() -> PointCloud:
    """Level ground 1.7 m under the sensor, and a post."""
    x, y = (column.ravel() for column in np.meshgrid(np.arange(1.0, 40.0, 0.7), np.arange(-12.0, 12.0, 0.7)))
    ground = np.column_stack((x, y, np.full(len(x), -1.7)))
    post = np.column_stack((np.full(20, 7.5), np.full(20, -4.5), np.linspace(-1.6, 0.1, 20)))
    return PointCloud(np.concatenate((ground, post)).astype(np.float32))


def test_boxes_stand_on_the_ground_of_the_cloud(path: Path) -> None:
    found = detect(street(), LearnedConfig(path))
    assert found.category.tolist() == ["pedestrian"]
    assert found.score == pytest.approx([0.8])
    np.testing.assert_allclose(found.boxes.center_m, [[7.5, -4.5, -0.8]], atol=0.01)
    assert [stage.name for stage in found.stages] == ["ground", "pillars", "network", "boxes"]
    assert set(found.point_cluster.tolist()) == {GROUND, OUT_OF_REACH}
    assert len(detect(street(), LearnedConfig(path, least_score=0.81))) == 0


def test_points_off_the_area_are_not_seen(path: Path) -> None:
    cloud = street()
    monitored = cloud.xyz_m[:, 1] > 0.0
    found = detect(cloud, LearnedConfig(path), monitored=monitored)
    assert (found.point_cluster[~monitored] != GROUND).all()
    assert (found.point_cluster == OFF_AREA).any()


@pytest.mark.parametrize("points", [[], [[-5.0, 0.0, 0.0]], [[5.0, 0.0, 30.0]]])
def test_a_cloud_without_pillars_has_no_boxes(path: Path, points: list[list[float]]) -> None:
    found = detect(PointCloud(np.array(points).reshape(-1, 3)), LearnedConfig(path))
    assert len(found) == 0
    assert len(found.point_cluster) == len(points)


def test_scores_are_calibrated_by_scale_and_offset(tmp_path: Path) -> None:
    file = tmp_path / "calibrated.onnx"
    file.write_bytes(network(described(score_scale=[1.0, 0.5, 1.0], score_offset=[0.0, -0.2, 0.0])))
    (score,) = detect(street(), LearnedConfig(file, least_score=0.1)).score
    assert score == pytest.approx(1.0 / (1.0 + np.exp(-(0.5 * np.log(4.0) - 0.2))))


def test_each_class_has_a_least_score_of_its_own(tmp_path: Path) -> None:
    """The post is a pedestrian with score 0.8."""
    file = tmp_path / "own.onnx"
    for least, boxes in (([0.9, 0.8, 0.9], 1), ([0.1, 0.81, 0.1], 0), (None, 1)):
        content = json.loads(described(least_score=least))
        if least is None:  # as files of earlier versions: 0.3
            del content["least_score"]
        file.write_bytes(network(json.dumps(content)))
        config = LearnedConfig(file)
        assert config.network.least_score.tolist() == (least or [0.3] * 3)
        assert len(detect(street(), config)) == boxes
        assert len(detect(street(), LearnedConfig(file, least_score=0.5))) == 1


def test_a_file_is_known_by_its_hash(path: Path) -> None:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    config = LearnedConfig(path)
    assert config.digest == digest
    assert LearnedConfig(path, digest) == config
    assert hash(replace(config, least_score=0.2)) != hash(config)
    with pytest.raises(ConfigError, match="is not the network with SHA-256 00, but"):
        LearnedConfig(path, "00")
    path.write_bytes(network(described(), row=9))
    with pytest.raises(ConfigError, match="has changed while it was used"):
        _ = config.network


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no network", "is no network that onnxruntime can run"),
        (network(None), "says nothing of grid and classes; another detector's network needs an adapter"),
        (network(described(), ("voxels", "coordinates")), "says nothing of grid and classes"),
        (network(described(version=2)), "is of version 2, this program reads 1"),
        (network(described(classes=["car", "dragon", "cyclist"])), "its classes must be some of"),
        (network(described(classes=["car"])), "its classes must be some of"),
        (network(described(grid={"cell_m": 0.3})), "its metadata is damaged|is no whole number"),
        (network(described(score_scale="much")), "its metadata is damaged"),
        (network(described(least_score=[0.3, 0.3])), "least_score must be a number in \\[0, 1\\] for each"),
        (network(described(least_score=[0.3, 0.3, 1.1])), "least_score must be a number"),
        (network(described(least_score="much")), "its metadata is damaged"),
        (network(described(score_scale=[1.0, float("nan"), 1.0])), "with a finite scale"),
        (network(described(overlap=float("nan"))), "overlap lie in"),
        (network(described(classes=["car", "car", "cyclist"])), "each once"),
        (network(described(classes=[["car"], "pedestrian", "cyclist"])), "its metadata is damaged"),
        (network(described(grid=asdict(replace(DECODER.grid, most_points=4.5)))), "a whole number"),  # type: ignore[arg-type]
        (network(described(), points=8), r"features: expected tensor\(float\) of shape \(N, 4, 8\)"),
        (network(described(), frames=2), r"output: expected tensor\(float\) of shape \(1, 13, 16, 16\)"),
        (network("[1]"), "its metadata is damaged"),
        (network("{"), "its metadata is damaged"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "other.onnx"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=message) as refused:
        _ = LearnedConfig(file).network
    assert "\n" not in str(refused.value)


def test_weights_in_another_file_are_refused_wherever_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = onnx.load_from_string(network(described()))
    file = tmp_path / "split.onnx"
    onnx.save(model, file, save_as_external_data=True, location="weights.bin", size_threshold=0)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="has its weights in another file"):
        _ = LearnedConfig(file).network


def test_a_network_that_cannot_run_says_so_in_one_line(tmp_path: Path) -> None:
    model = onnx.load_from_string(network(described()))
    model.graph.node[0].CopyFrom(helper.make_node("Reshape", [INPUTS[0], "to"], ["most"]))
    model.graph.initializer.append(numpy_helper.from_array(np.array([7, 1, 11, 13]), "to"))
    file = tmp_path / "broken.onnx"
    file.write_bytes(model.SerializeToString())
    with pytest.raises(ConfigError, match=r"network: cannot run|is no network") as refused:
        detect(street(), LearnedConfig(file))
    assert "\n" not in str(refused.value)


def test_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    for file in (tmp_path / "none.onnx", tmp_path):
        with pytest.raises(ConfigError, match="cannot be read"):
            LearnedConfig(file)
    with pytest.raises(ConfigError, match="least_score"):
        LearnedConfig(tmp_path, least_score=1.5)


def test_the_file_of_the_test_is_sound(path: Path) -> None:
    onnx.checker.check_model(onnx.load(path))
