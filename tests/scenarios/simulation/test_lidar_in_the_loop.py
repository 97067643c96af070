"""Runs in which detections come from the clouds of a LiDAR."""

import copy
import functools
import pickle
from dataclasses import replace

import numpy as np
import pytest

from scenarios.catalogue.library import shipped_scenario
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import SpeedAction
from scenarios.openscenario.reading.reader import load
from scenarios.presets import PHYSICAL, pipeline_of, sensors_of
from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.lidar import HDL32, LidarMeasurement, LidarSensor, Mount
from scenarios.sensors.lidar.chain import PERCEPTIONS, LidarPerception, _kept, lidar_of
from scenarios.sensors.lidar.cutout import CutoutDetector, LabelledCloud, fit_boxes
from scenarios.sensors.lidar.street import Furnished
from scenarios.settings import preset_with
from scenarios.simulation.ends import StopRule
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.simulation.street import RunStreet, swept_outlines
from scenarios.spec import RunSpec, simulation_of
from smartmot.errors import PluginError
from smartmot.filters.motion_models import PerCategory
from smartmot.overlap import intersection_area
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import Detections, EgoState

from ..sensors.lidar.test_lidar_sensor import people


def spec(seed: int = 0, **settings: float | str) -> RunSpec:
    return RunSpec(
        "test", "crossing", (("Ego_speed_kmh", 30.0),), "map", "physical", "dry", 30.0,
        seed=seed, settings=tuple(settings.items()),
    )  # fmt: skip


@functools.cache
def outcome(seed: int = 0, **settings: float | str) -> Outcome:
    return simulation_of(spec(seed=seed, **settings)).run()


def seen(run: Outcome) -> np.ndarray:
    log = run.log.table()
    return np.unique(log["time_s"][log["kind"] == "detection"])


@pytest.mark.parametrize(("sensor", "rate_hz"), [("hdl32", 20.0), ("mid70", 10.0)])
def test_a_lidar_has_its_own_rate_and_what_it_sees_is_braked_for(sensor: str, rate_hz: float) -> None:
    run = outcome(sensor=sensor, perception="cutout")
    np.testing.assert_allclose(np.diff(seen(run)), 1.0 / rate_hz, atol=1e-9)
    truth = outcome()
    assert run.contact is None
    assert truth.contact is None
    assert run.flag_time_s is not None
    assert truth.flag_time_s is not None
    assert run.flag_time_s == pytest.approx(truth.flag_time_s, abs=0.3)


def test_true_boxes_of_those_with_points_are_exact() -> None:
    """Without the errors of the shipped sensor nothing is left but what a cloud misses."""
    log = outcome(sensor="hdl32", perception="labels").log.table()
    found, true = (log["kind"] == kind for kind in ("detection", "actor"))
    at_time = dict(zip(log["time_s"][true], np.flatnonzero(true), strict=True))
    rows = [at_time[t] for t in log["time_s"][found]]
    for name in ("x_m", "y_m", "yaw_rad", "length_m", "width_m"):
        np.testing.assert_allclose(log[name][found], log[name][rows], atol=1e-12)


def test_the_same_seed_gives_the_same_bytes_and_another_other_noise() -> None:
    logs = [outcome(seed, sensor="mid70", perception="cutout").log.table() for seed in (0, 1)]
    again = simulation_of(spec(sensor="mid70", perception="cutout")).run().log.table()
    assert all(again[name].tobytes() == column.tobytes() for name, column in logs[0].items())
    assert logs[0]["x_m"].tobytes() != logs[1]["x_m"].tobytes()


@pytest.mark.parametrize("perception", ["cutout", "classical_monitored"])
def test_a_copied_and_a_pickled_run_go_on_with_the_same_bytes(perception: str) -> None:
    given = spec(sensor="mid70", perception=perception, street="furnished")
    simulation = simulation_of(given)
    perception, step = simulation.perception(), simulation.start()
    for _ in range(5):
        assert step.frame is not None
        result = perception.step(step.frame)
        simulation.record(result)
        step = simulation.step(result.command)
    for other in (copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))):
        steps = [run.step(None) for run in (copy.deepcopy(simulation), other)]
        frames = [one.frame for one in steps]
        assert frames[0] is not None
        assert frames[1] is not None
        assert frames[0].detections.boxes.center_m.tobytes() == frames[1].detections.boxes.center_m.tobytes()


def test_rate_range_latency_and_phase_are_those_of_the_preset_as_far_as_the_lidar_goes() -> None:
    preset = preset_with(
        replace(PHYSICAL, sensor=replace(PHYSICAL.sensor, phase_s=0.02)),
        (("sensor", "hdl32"), ("latency_s", 0.05), ("range_m", 40.0)),
    )
    assert preset.lidar is not None
    config = lidar_of(preset.lidar, preset.sensor)
    assert (config.pattern.rate_hz, config.latency_s, config.phase_s) == (20.0, 0.05, 0.02)
    assert config.range_m == 40.0
    slower = preset_with(PHYSICAL, (("rate_hz", 10.0), ("sensor", "hdl32")))
    assert slower.lidar is not None
    assert lidar_of(slower.lidar, slower.sensor).pattern.rate_hz == 10.0
    assert lidar_of(LidarPerception("hdl64"), SensorConfig(range_m=500.0)).range_m == 120.0


def test_in_reverse_the_lidar_looks_back() -> None:
    definition = load(shipped_scenario("ahead"), {})
    init = tuple(
        (name, replace(action, target=-3.0) if name == "Ego" and isinstance(action, SpeedAction) else action)
        for name, action in definition.init
    )
    preset = preset_with(PHYSICAL, (("sensor", "mid70"), ("perception", "labels")))
    simulation = Simulation(replace(definition, init=init), preset, None)
    step = simulation.start()
    assert step.frame is not None
    # the other road user stands in front of a car that goes back
    assert len(step.frame.detections) == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"perception": "cutout"}, "perception is for a LiDAR, sensor=hdl32, hdl64, mid70"),
        ({"street": "furnished"}, "street is for a LiDAR"),
        ({"sensor": "hdl32", "street_seed": 1.0}, "street_seed is for street=furnished"),
        (
            {"sensor": "hdl32", "street": "furnished", "street_seed": 0.5},
            "street_seed must be a whole number",
        ),
        ({"sensor": "hdl32", "position_sigma_m": 0.1}, "position_sigma_m is for sensor=truth"),
        ({"sensor": "hdl32", "detector": "a:b"}, "its detector is set by perception"),
    ],
)
def test_what_means_nothing_beside_the_sensor_is_refused(
    settings: dict[str, float | str], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        preset_with(PHYSICAL, tuple(settings.items()))


def test_a_street_out_of_range_is_refused() -> None:
    with pytest.raises(ScenarioError, match="density must lie in"):
        Furnished(-1.0)
    with pytest.raises(ScenarioError, match="whole number from 0 on"):
        Furnished(8.0, -1)
    with pytest.raises(ScenarioError, match=r"unknown 'nets'; use one of: .*cutout"):
        LidarPerception("hdl32", "nets")


def test_the_tracker_expects_the_noise_of_boxes_around_points() -> None:
    for name in PERCEPTIONS:
        tracker = pipeline_of(preset_with(PHYSICAL, (("sensor", "hdl32"), ("perception", name)))).tracker
        noise = tracker.filter.position_sigma_m  # type: ignore[union-attr]
        assert isinstance(noise, PerCategory)
        assert noise.pedestrian < noise.car


# ---- the street --------------------------------------------------------------------------------------------


def test_nothing_stands_where_road_users_go_and_all_else_stays() -> None:
    definition = load(shipped_scenario("crossing"), {"Ego_speed_kmh": 30.0})
    simulation = Simulation(definition, PHYSICAL, None)
    roads = simulation.engine.world.locator.roads
    swept = swept_outlines(definition, roads)
    whole = RunStreet(Furnished(80.0, 1), simulation.network, definition, roads)()
    pieces = whole.footprint
    a, b = (np.repeat(np.arange(len(pieces)), len(swept)), np.tile(np.arange(len(swept)), len(pieces)))
    one, other = pieces[a], swept[b]
    area = intersection_area(
        one.center_m, one.size_m, one.yaw_rad, other.center_m, other.size_m, other.yaw_rad
    )
    assert area.max() < 1e-9
    assert len(whole.kind) == len(pieces) == len(whole.bodies) - whole.sidewalk_blocks
    # within 2 m of where the pedestrian goes there is furniture all the same
    gap = np.hypot(*np.moveaxis(pieces.center_m[:, None] - swept.center_m, -1, 0)).min()
    assert 0.0 < gap < 2.0


def test_a_path_past_the_contact_is_kept_clear() -> None:
    """The pedestrian goes on to the other side; the ego does not stop for it."""
    definition = load(shipped_scenario("crossing"), {"Ego_speed_kmh": 30.0})
    roads = Simulation(definition, PHYSICAL, None).engine.world.locator.roads
    swept = swept_outlines(definition, roads)
    walker = swept.center_m[swept.size_m[:, 0] < 1.5]
    assert np.ptp(walker, axis=0).max() > 5.0


def test_a_street_needs_a_map() -> None:
    definition = replace(load(shipped_scenario("crossing"), {}), map_path=None)
    roads = Simulation(definition, PHYSICAL, None).engine.world.locator.roads
    with pytest.raises(ScenarioError, match="street=furnished needs a map"):
        RunStreet(Furnished(), roads.network, definition, roads)()


def test_the_shipped_sensor_takes_no_street() -> None:
    assert preset_with(PHYSICAL, (("sensor", "hdl32"), ("street", "furnished"))).street == Furnished()


# ---- boxes around points -----------------------------------------------------------------------------------


def turned(pitch_rad: float = 0.0) -> LidarMeasurement:
    ego = EgoState(1.0, 10.0, 20.0, 0.5 * np.pi, 0.0)
    return LidarMeasurement(1.0, 0, PointCloud(np.zeros((0, 3))), ego, Mount(1.73, 1.0, pitch_rad))


def test_boxes_of_the_sensor_lie_on_the_map() -> None:
    """The ego looks north; the sensor is 1 m ahead of its middle."""
    boxes = Boxes3D(np.array([[5.0, 2.0, -0.8]]), np.array([[4.0, 2.0, 1.5]]), np.array([0.25]))
    found = turned().detections(boxes, np.array([0.7]), np.array(["car"]))
    np.testing.assert_allclose(found.boxes.center_m, [[8.0, 26.0]])
    np.testing.assert_allclose(found.boxes.yaw_rad, [0.25 + 0.5 * np.pi])
    assert (found.stamp_s, found.score.tolist(), found.category.tolist()) == (1.0, [0.7], ["car"])


def test_a_pitched_mount_is_levelled() -> None:
    """What the sensor sees straight ahead at 10 m is cos(pitch) 10 m away and lower."""
    boxes = Boxes3D(np.array([[10.0, 0.0, 0.0]]), np.ones((1, 3)), np.zeros(1))
    found = turned(0.1).detections(boxes, np.ones(1), np.array(["car"]))
    np.testing.assert_allclose(found.boxes.center_m, [[10.0, 21.0 + 10.0 * np.cos(0.1)]])


def test_cut_out_boxes_are_near_the_true_ones_whoever_else_is_there() -> None:
    world = people((12.0, 3.0), (20.0, -4.0))
    measurement, row = LidarSensor(HDL32, seed=1, compiled=False).label(world, EgoState(1.0, 0, 0, 0, 0))
    found = CutoutDetector().detect(LabelledCloud(measurement, row, world))
    np.testing.assert_allclose(found.boxes.center_m, world.boxes.center_m, atol=0.25)
    assert found.category.tolist() == ["pedestrian", "pedestrian"]
    alone = CutoutDetector().detect(LabelledCloud(measurement, np.where(row == 1, 1, -1), world))
    np.testing.assert_array_equal(alone.boxes.center_m, found.boxes.center_m[1:])
    none = CutoutDetector().detect(LabelledCloud(measurement, np.full_like(row, -1), world))
    assert len(none) == 0


@pytest.mark.parametrize("category", ["car", "pedestrian", "cyclist", "truck", "motorcycle", "unknown"])
def test_a_single_point_has_a_box_that_holds_it(category: str) -> None:
    point = np.array([[10.0, 2.0, -1.0]])
    boxes = fit_boxes(point, np.array([0]), np.array([1]), np.array([category]))
    assert boxes.point_counts(point, 1e-6).tolist() == [1]


def test_a_box_grows_away_from_the_sensor() -> None:
    """The rear of a car ahead: its near side stays where the points are."""
    rear = np.column_stack((np.full(9, 10.0), np.linspace(-0.85, 0.85, 9), np.linspace(-1.5, -0.3, 9)))
    boxes = fit_boxes(rear, np.array([0]), np.array([9]), np.array(["car"]))
    ((x, y, z),), (length, width, height) = boxes.center_m.tolist(), boxes.size_m[0]
    assert abs(np.sin(boxes.yaw_rad[0])) < 0.05
    assert (x - 0.5 * length, y) == pytest.approx((10.0, 0.0), abs=0.1)
    assert length > width >= 1.7
    assert (z, height) == pytest.approx((-0.9, 1.2))


# ---- points on the monitored area --------------------------------------------------------------------------


def detections_of(perception: str, strategy: str, **settings: float | str) -> np.ndarray:
    """Time and place of the detections of the first second."""
    given = replace(
        spec(sensor="mid70", street="furnished", perception=perception, **settings), strategy=strategy
    )
    log = simulation_of(given, StopRule(time_limit_s=1.0)).run().log.table()
    rows = log["kind"] == "detection"
    return np.column_stack([log[name][rows] for name in ("time_s", "x_m", "y_m", "yaw_rad")])


def test_with_an_area_that_keeps_everybody_nothing_is_dropped() -> None:
    everything = detections_of("classical_monitored", "all")
    assert len(everything) > 0
    np.testing.assert_array_equal(everything, detections_of("classical", "all"))


def test_off_the_lanes_of_the_map_nothing_is_detected_however_wrong_the_localisation_is() -> None:
    """Areas are where perception has them: what it keeps of the boxes is about what it lets be found."""
    for lateral_m in (0.0, 6.0):
        cut, whole = (
            detections_of(name, "map", localisation_lateral_m=lateral_m)
            for name in ("classical_monitored", "classical")
        )
        assert 0 < len(cut) < 0.8 * len(whole)


def test_an_area_is_asked_for_only_where_there_is_one() -> None:
    with pytest.raises(ScenarioError, match="needs a monitored area, and there is none; use classical"):
        sensors_of(preset_with(PHYSICAL, (("sensor", "hdl32"), ("perception", "classical_monitored"))), 0)


# ---- the user's own ----------------------------------------------------------------------------------------


class Nearest:
    """A detector of clouds: one pedestrian around the nearest point that is neither ground nor high up."""

    def __init__(self, config: object, seed: int) -> None:
        self.config, self.seed = config, seed

    def detect(self, measurement: LidarMeasurement) -> Detections:
        xyz = measurement.cloud.xyz_m.astype(np.float64)
        up = xyz[np.abs(xyz[:, 2] + 0.8) < 0.4]
        near = up[np.argsort(np.hypot(up[:, 0], up[:, 1]))[:1]]
        boxes = Boxes3D(near, np.tile((0.5, 0.5, 1.7), (len(near), 1)), np.zeros(len(near)))
        return measurement.detections(boxes, np.ones(len(near)), np.full(len(near), "pedestrian"))


class Blind:
    """No detector."""

    def __init__(self, config: object, seed: int) -> None:
        pass


class Wordy(Nearest):
    """A latency that is none."""

    latency_s = "soon"


HERE = __name__


def test_a_detector_of_ones_own_takes_clouds_and_the_ego_brakes_for_what_it_says() -> None:
    run = outcome(sensor="hdl32", perception=f"{HERE}:Nearest")
    assert run.contact is None
    assert run.flag_time_s is not None


@pytest.mark.parametrize(
    ("name", "message"), [("Blind", "has no detect"), ("Wordy", "must be numbers"), ("Absent", "has no")]
)
def test_a_detector_that_cannot_be_one_is_refused(name: str, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        simulation_of(spec(sensor="hdl32", perception=f"{HERE}:{name}"))


class Unsure(Nearest):
    """Every other detection has a score under that of the tracker."""

    def detect(self, measurement: LidarMeasurement) -> Detections:
        found = super().detect(measurement)
        return replace(found, score=np.full(len(found), 0.1 if measurement.number % 2 else 0.9))


def test_what_the_tracker_drops_for_its_score_is_counted() -> None:
    run = outcome(sensor="mid70", perception=f"{HERE}:Unsure")
    assert run.dropped.score == pytest.approx(run.detections / 2, abs=1)
    assert run.dropped.total == run.dropped.score


def test_frames_that_several_runs_share_are_detected_once_and_are_the_same() -> None:
    """A run by itself, after another of its scene, and stepped with its clouds."""
    given = spec(seed=5, sensor="mid70", perception="cutout", street="furnished")
    logs = []
    for before in ((), (replace(given, strategy="rectangular"),)):
        _kept.clear()
        for other in before:
            simulation_of(other).run()
        known = len(_kept)
        logs.append(simulation_of(given).run().log.table())
        made = len(_kept) - known
    assert made < len(np.unique(logs[0]["time_s"])) - 10
    stepped = simulation_of(given)
    perception, step = stepped.perception(), stepped.start()
    while step.frame is not None:
        result = perception.step(step.frame)
        stepped.record(result)
        step = stepped.step(result.command)
    logs.append(stepped.outcome().log.table())
    for log in logs[1:]:
        assert all(log[name].tobytes() == column.tobytes() for name, column in logs[0].items())


def test_a_stepped_run_has_the_clouds_and_no_truth() -> None:
    stepped = simulation_of(spec(sensor="mid70", perception=f"{HERE}:Nearest")).start()
    labelled = simulation_of(spec(sensor="mid70", perception="cutout")).start()
    assert stepped.frame is not None
    assert labelled.frame is not None
    assert isinstance(stepped.frame.measurement, LidarMeasurement)
    assert labelled.frame.measurement is None


def test_the_shipped_detector_keeps_no_box_back_for_its_score() -> None:
    """What the tracker drops is in the outcome, and none is missing beside it."""
    run = outcome(sensor="mid70", perception="classical", street="furnished")
    low = outcome(sensor="mid70", perception="classical_unscored", street="furnished")
    assert run.dropped.score > 0
    assert low.dropped.total == 0
