"""Runs in which detections come from a network as an ONNX file."""

from __future__ import annotations

import hashlib
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.presets import PHYSICAL, sensors_of
from scenarios.sensors.lidar import LidarMeasurement, Mount
from scenarios.sensors.lidar.chain import (
    LEAST_NETWORK_SCORE,
    CloudDetector,
    LidarPerception,
    NetworkFile,
    is_network,
    network_file,
    network_path,
)
from scenarios.sensors.lidar.config import HDL32, MID70
from scenarios.settings import PARAMETERS, preset_with
from scenarios.simulation.ends import StopRule
from scenarios.spec import RunSpec, simulation_of
from smartmot.errors import ConfigError
from smartmot.lidar.learned import Decoder, PillarGrid, shipped_card
from smartmot.pointcloud import PointCloud
from smartmot.types import EgoState
from tests.networks import SIZE_M, score_of, upright_network

CLASSES = ("car", "pedestrian", "cyclist")
FULL = Decoder(PillarGrid(), CLASSES)
SMALL = Decoder(PillarGrid((0.0, 16.0), (-8.0, 8.0), 0.5, 64), CLASSES)


@pytest.fixture
def path(tmp_path: Path) -> str:
    file = tmp_path / "upright.onnx"
    file.write_bytes(upright_network(FULL))
    return str(file)


@pytest.fixture
def small(tmp_path: Path) -> str:
    file = tmp_path / "small.onnx"
    file.write_bytes(upright_network(SMALL))
    return str(file)


def spec(perception: str, sensor: str = "mid70", **settings: float | str) -> RunSpec:
    own = {"sensor": sensor, "perception": perception, **settings}
    return RunSpec(
        "test", "crossing", (("Ego_speed_kmh", 30.0),), "map", "physical", "dry", 30.0,
        settings=tuple(own.items()),
    )  # fmt: skip


def post(height_m: float = 1.8) -> LidarMeasurement:
    """Level ground 1.7 m under a sensor whose vehicle looks north at (10, 20), and a post."""
    x, y = (column.ravel() for column in np.meshgrid(np.arange(1.0, 40.0, 0.7), np.arange(-12.0, 12.0, 0.7)))
    ground = np.column_stack((x, y, np.full(len(x), -1.7)))
    up = np.linspace(-1.6, height_m - 1.7, 20)
    body = np.column_stack((np.full(20, 7.5), np.full(20, -4.5), up))
    cloud = PointCloud(np.concatenate((ground, body)))
    return LidarMeasurement(1.0, 0, cloud, EgoState(1.0, 10.0, 20.0, 0.5 * np.pi, 0.0), Mount(1.7, 1.0))


@pytest.mark.parametrize("height_m", [1.8, 1.0])
def test_boxes_of_a_network_lie_on_the_map_with_its_scores(small: str, height_m: float) -> None:
    """The post is in the middle of a cell, 7.5 m ahead and 4.5 m to the right of a sensor at (10, 21)."""
    detections = CloudDetector(network_file(small)).detect(post(height_m))
    np.testing.assert_allclose(detections.boxes.center_m, [[14.5, 28.5]], atol=1e-6)
    np.testing.assert_allclose(detections.boxes.size_m, [SIZE_M[:2]], rtol=1e-6)
    assert detections.category.tolist() == ["pedestrian"]
    assert detections.score == pytest.approx([score_of(height_m)], abs=0.02)
    assert score_of(1.0) < 0.35
    assert score_of(1.8) > 0.9


def test_peaks_of_noise_are_no_boxes(small: str) -> None:
    low_m = 0.6
    assert score_of(low_m) < LEAST_NETWORK_SCORE
    assert len(CloudDetector(network_file(small)).detect(post(low_m))) == 0


@pytest.mark.parametrize("sensor", ["hdl32", "hdl64"])
def test_every_lidar_has_its_clouds_looked_at(path: str, sensor: str) -> None:
    run = simulation_of(spec(path, sensor, street="furnished"), StopRule(time_limit_s=0.3)).run()
    assert run.detections > 0


def test_the_ego_brakes_for_what_a_network_finds(path: str) -> None:
    run = simulation_of(spec(path)).run()
    assert run.contact is None
    assert run.flag_time_s is not None
    log = run.log.table()
    found, true = (log["kind"] == kind for kind in ("detection", "actor"))
    walker = true & (log["category"] == "pedestrian")
    at_time = dict(zip(log["time_s"][walker], np.flatnonzero(walker), strict=True))
    # the box is in the middle of a cell of 0.4 m, the points on the near side of somebody 0.6 m deep
    near = [
        np.hypot(log["x_m"][row] - log["x_m"][of], log["y_m"][row] - log["y_m"][of]) < 0.75
        for row, of in ((row, at_time[log["time_s"][row]]) for row in np.flatnonzero(found))
    ]
    assert np.mean(near) > 0.5


def test_the_same_file_gives_the_same_bytes_in_another_process(path: str) -> None:
    from evaluation.runs.execution import execute
    from evaluation.runs.workers import execute_all

    given = spec(network_file(path).name)
    given = replace(given, parameters=(("Ego_speed_kmh", 50.0),))
    (here,) = execute_all(execute, [given])
    there, other = execute_all(execute, [given, replace(given, seed=1)], workers=2)
    assert here.log is not None
    assert there.log is not None
    assert other.log is not None
    assert all(there.log[name].tobytes() == column.tobytes() for name, column in here.log.items())
    assert other.log["x_m"].tobytes() != here.log["x_m"].tobytes()


def test_the_shipped_network_has_a_name_and_its_hash() -> None:
    digest = shipped_card("pillars")["sha256"]
    for name, monitored in (("pillars", False), ("pillars_monitored", True)):
        known = PARAMETERS["perception"].known_as(name)
        assert known == f"{name}@{digest[:12]}"
        network = network_file(known)
        assert (network.digest, network.monitored) == (digest, monitored)
        assert network_path(known).name == "pillars.onnx"
    with pytest.raises(ConfigError, match="is not the network with SHA-256 000000000000"):
        network_file("pillars@000000000000")
    # wherever the file is, it is the same network, and the same run
    copy = replace(network_file("pillars"), path="elsewhere.onnx")
    assert copy.digest == network_file("pillars").digest


def test_a_run_with_the_shipped_network_detects_who_crosses() -> None:
    simulation = simulation_of(spec("pillars", "hdl64"))
    outcome = simulation.run()
    assert outcome.detections > 0


def test_a_pickled_run_goes_on_with_the_same_bytes(path: str) -> None:
    """The session is no part of a run: it is made again where it is needed."""
    simulation = simulation_of(spec(path, street="furnished"), StopRule(time_limit_s=0.3))
    simulation.start()
    other = pickle.loads(pickle.dumps(simulation))
    frames = [run.step(None).frame for run in (simulation, other)]
    assert frames[0] is not None
    assert frames[1] is not None
    assert len(frames[0].detections) > 0
    assert frames[0].detections.boxes.center_m.tobytes() == frames[1].detections.boxes.center_m.tobytes()


def test_points_off_the_monitored_area_are_not_given_to_it(path: str) -> None:
    def detections(perception: str, strategy: str) -> np.ndarray:
        given = replace(spec(perception, street="furnished"), strategy=strategy)
        log = simulation_of(given, StopRule(time_limit_s=1.0)).run().log.table()
        rows = log["kind"] == "detection"
        return np.column_stack([log[name][rows] for name in ("time_s", "x_m", "y_m")])

    everything = detections(path, "map")
    assert 0 < len(detections(f"{path}_monitored", "map")) < 0.8 * len(everything)
    np.testing.assert_array_equal(detections(f"{path}_monitored", "all"), detections(path, "all"))
    preset = preset_with(PHYSICAL, (("sensor", "hdl32"), ("perception", f"{path}_monitored")))
    with pytest.raises(ScenarioError, match=r"a monitored area, and there is none; use .*upright.onnx$"):
        sensors_of(preset, 0)


def test_a_network_is_known_by_its_hash(path: str) -> None:
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    network = network_file(path)
    assert network == NetworkFile(path, digest, CLASSES, (0.0, 44.8), (-28.8, 28.8))
    assert network.name == f"{path}@{digest[:12]}"
    assert network_file(network.name) == network
    assert network_file(f"{path}_monitored@{digest}") == replace(network, monitored=True)
    parameter = PARAMETERS["perception"]
    assert parameter.known_as(path) == network.name
    assert parameter.of(preset_with(PHYSICAL, (("sensor", "hdl32"), ("perception", path)))) == network.name


def test_a_file_that_changes_while_runs_are_made_is_refused(path: str) -> None:
    given = spec(PARAMETERS["perception"].known_as(path))
    simulation = simulation_of(given)
    Path(path).write_bytes(upright_network(FULL, slope=5.0))
    with pytest.raises(ConfigError, match=r"is not the network with SHA-256 \w{12}\.\.\., but \w{12}"):
        simulation_of(given)
    # what is loaded stays what it was
    assert simulation.run().flag_time_s is not None


def test_two_networks_in_one_process_do_not_share_frames(path: str) -> None:
    runs = []
    for slope in (4.0, 0.1):
        Path(path).write_bytes(upright_network(FULL, slope))
        runs.append(simulation_of(spec(path, street="furnished"), StopRule(time_limit_s=0.5)).run())
    assert runs[0].detections > 0
    assert runs[1].detections > runs[0].detections


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        ("net.onnx", True), ("a b/net.onnx_monitored", True), ("net.onnx@0123456789ab", True),
        ("C:\\nets\\net.onnx", True), ("net.onnx_unscored", False), ("net.onnx@0123", True),
        ("net.pt", False), ("module:net.onnx", False), ("classical", False), (".onnx", False),
    ],
)  # fmt: skip
def test_names_of_networks(name: str, is_one: bool) -> None:
    assert is_network(name) is is_one


def test_digits_of_a_hash_are_read_in_either_case_and_need_their_form(path: str) -> None:
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    assert network_file(f"{path}@{digest[:20].upper()}").name == f"{path}@{digest[:12]}"
    for typed in ("123", "", "0123456789ag", digest + "0", f"{digest[:12]} "):
        with pytest.raises(ConfigError, match=r"expected the first 12 to 64 hexadecimal digits .* after @"):
            preset_with(PHYSICAL, (("sensor", "hdl64"), ("perception", f"{path}@{typed}")))


def test_names_may_have_umlauts_spaces_and_signs(tmp_path: Path) -> None:
    folder = tmp_path / "Größe @ Maß, 2"
    folder.mkdir()
    file = folder / "müde straße.onnx"
    file.write_bytes(upright_network(SMALL))
    network = network_file(str(file))
    assert network.path == str(file)
    assert network_path(network.name) == file
    assert network_file(network.name) == network
    detections = CloudDetector(network).detect(post())
    assert detections.category.tolist() == ["pedestrian"]


def test_a_run_whose_network_is_gone_says_so(path: str) -> None:
    given = spec(PARAMETERS["perception"].known_as(path))
    Path(path).unlink()
    with pytest.raises(ConfigError, match=r"upright.onnx: cannot be read: No such file"):
        simulation_of(given)


def test_what_is_no_network_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "net.onnx"
    messages = []
    for content in (None, b"damaged", upright_network(FULL).replace(b"pedestrian", b"pedestrien")):
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(ConfigError) as refused:
            preset_with(PHYSICAL, (("sensor", "hdl64"), ("perception", str(file))))
        messages.append(str(refused.value))
    assert all(str(file) in message and "\n" not in message for message in messages)
    parts = ("cannot be read", "is no network", "its classes must be")
    assert all(part in message for part, message in zip(parts, messages, strict=True))
    file.write_bytes(upright_network(SMALL, slope=3.0))
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ConfigError, match=r"need the extra lidar .*pip install 'smartmot\[lidar\]'"):
        preset_with(PHYSICAL, (("sensor", "hdl64"), ("perception", str(file))))


def test_where_the_sensor_sees_more_than_the_network_is_said() -> None:
    network = NetworkFile("net.onnx", "0" * 64, ("car", "pedestrian"), (0.0, 44.8), (-28.8, 28.8))
    said = network.unseen(replace(HDL32, range_m=70.0))
    assert said.startswith("it knows car, pedestrian from 0 to 44.8 m ahead, 28.8 m to the left and 28.8 m")
    assert network.unseen(replace(HDL32, range_m=20.0)) == said  # nothing behind
    assert network.unseen(replace(MID70, range_m=20.0)) == ""
    all_round = replace(network, ahead_m=(-80.0, 80.0), left_m=(-80.0, 80.0))
    assert all_round.unseen(replace(HDL32, range_m=70.0)) == ""
    with pytest.raises(ScenarioError, match="from one place to another"):
        replace(network, ahead_m=(1.0,))
    assert LidarPerception("hdl32", network).perception_name == "net.onnx@000000000000"
