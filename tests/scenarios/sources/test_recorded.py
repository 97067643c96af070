"""Recorded drives as a source of frames: odometry by differences, and the closed loop's parts on them."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from scenarios.errors import DatasetError, ScenarioError
from scenarios.presets import PHYSICAL
from scenarios.recorded.csv_files import read_csv
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.maps.drive_map import notes_on_levels
from scenarios.recorded.poses import rigid, turned_about
from scenarios.simulation.log import RunLog
from scenarios.sources import Frame, FrameSource, StepResult, frames
from scenarios.sources.perception import AreaPipelines, Perception, map_view
from scenarios.sources.recorded import END_OF_RECORDING, RecordedSource, pose_rates, spaced
from scenarios.strategies import STRATEGIES, NamedStrategy
from smartmot.area import EverythingArea, MapArea, MapAreaConfig, MonitoredAreaStrategy
from smartmot.decision.braking import BrakingDistance
from smartmot.decision.rules import Command
from smartmot.detection_input import detections_from_arrays
from smartmot.forecast import ForecastConfig
from smartmot.maps.follow import route_along
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig
from smartmot.types import Boxes, EgoState

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"
FIELD_MAPS = Path(__file__).parents[2] / "data" / "field" / "opendrive"
FRAME_S = 0.1
SPEED_MPS = 10.0
PEDESTRIAN_X_M, SIDE_M = 150.03, 0.5
LANE_Y_M = -1.75
HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,category,score"


def poses(stamp_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray, yaw_rad: np.ndarray) -> np.ndarray:
    return rigid(turned_about(2, yaw_rad), np.column_stack((x_m, y_m, np.zeros(len(stamp_s)))))


def recording(stamp_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray, yaw_rad: np.ndarray) -> Sequence:
    """A drive on which nothing is seen."""
    names = tuple(map(str, range(len(stamp_s))))
    return Sequence("a", stamp_s, names, Objects.empty(), None, poses(stamp_s, x_m, y_m, yaw_rad))


@pytest.fixture
def towards_a_pedestrian(tmp_path: Path) -> Sequence:
    """CSV files of an ego at 10 m/s that drives over where a pedestrian stands, 50 m ahead."""
    times = [FRAME_S * k for k in range(60)]
    person = f"{PEDESTRIAN_X_M},{LANE_Y_M},{SIDE_M},{SIDE_M},0,pedestrian,0.9"
    (tmp_path / "detections.csv").write_text(
        "\n".join([HEADER, *(f"{t:.1f},{person}" for t in times)]) + "\n"
    )
    ego = [f"{t:.1f},{100 + SPEED_MPS * t:.1f},{LANE_Y_M},0" for t in times]
    (tmp_path / "ego.csv").write_text("\n".join(["stamp_s,x_m,y_m,yaw_rad", *ego]) + "\n")
    [sequence] = read_csv(tmp_path).sequences
    return sequence


def drive(source: FrameSource, pipeline: Pipeline) -> list[tuple[Frame, FrameResult]]:
    """What perception and decision make of a source, which is given every command."""
    state, decided = pipeline.initial(), []
    at = source.start()
    while at.frame is not None:
        state, result = pipeline.step(state, at.frame.detections, at.frame.ego, at.frame.path)
        decided.append((at.frame, result))
        at = source.step(result.command)
    return decided


# --- odometry -----------------------------------------------------------------------------------------------


def test_speed_and_turn_rate_are_differences_of_the_poses() -> None:
    """A circle of 20 m at 0.25 rad/s: the chord over one frame, and the turn rate itself."""
    stamp_s = np.arange(40) * FRAME_S
    angle = 0.25 * stamp_s + 3.0  # the heading passes 180 degrees
    source = RecordedSource(recording(stamp_s, 20.0 * np.sin(angle), -20.0 * np.cos(angle), angle))
    states = [frame.ego for frame in frames(source)]
    chord_mps = 2.0 * 20.0 * math.sin(0.25 * FRAME_S / 2.0) / FRAME_S
    assert [s.speed_mps for s in states] == pytest.approx([chord_mps] * 40)
    assert [s.yaw_rate_radps for s in states] == pytest.approx([0.25] * 40)


def test_the_first_frame_has_the_motion_of_the_second() -> None:
    speed, turn = pose_rates(np.array([0.0, 0.5, 1.0]), np.array([[0, 0, 0], [1, 0, 0.1], [4, 0, 0.1]]))
    assert speed == pytest.approx([2.0, 2.0, 6.0])
    assert turn == pytest.approx([0.2, 0.2, 0.0])


def test_a_vehicle_that_backs_has_a_negative_speed() -> None:
    stamp_s = np.arange(5) * 0.2
    source = RecordedSource(recording(stamp_s, np.zeros(5), -3.0 * stamp_s, np.full(5, np.pi / 2)))
    assert [frame.ego.speed_mps for frame in frames(source)] == pytest.approx([-3.0] * 5)


@pytest.mark.parametrize("count", [0, 1])
def test_a_recording_too_short_for_a_difference_stands(count: int) -> None:
    nothing = np.zeros(count)
    assert [frame.ego.speed_mps for frame in frames(RecordedSource(recording(*[nothing] * 4)))] == [
        0.0
    ] * count


def test_the_outline_lies_ahead_of_the_recorded_point() -> None:
    stamp_s = np.arange(3) * FRAME_S
    still = np.zeros(3)
    source = RecordedSource(
        recording(stamp_s, still, still, np.full(3, np.pi / 2)),
        *(None,),
        length_m=5.0,
        width_m=2.0,
        center_ahead_m=1.4,
    )
    ego = next(frames(source)).ego
    assert (ego.x_m, ego.y_m) == pytest.approx((0.0, 1.4))
    assert (ego.length_m, ego.width_m) == (5.0, 2.0)


def test_without_odometry_only_tracking_gets_frames() -> None:
    blind = Sequence("b", np.arange(3) * FRAME_S, ("0", "1", "2"), Objects.empty())
    with pytest.raises(DatasetError, match="sequence b has no ego poses"):
        RecordedSource(blind)
    states = [frame.ego for frame in frames(RecordedSource(blind, needs_odometry=False))]
    assert [(s.x_m, s.y_m, s.yaw_rad, s.speed_mps) for s in states] == [(0.0, 0.0, 0.0, 0.0)] * 3


def test_impossible_poses_are_refused() -> None:
    stamp_s = np.arange(2) * FRAME_S
    with pytest.raises(DatasetError, match=r"sequence a: ego poses must be within 1e\+08 m"):
        RecordedSource(recording(stamp_s, np.array([0.0, 1e300]), np.zeros(2), np.zeros(2)))


# --- the protocol -------------------------------------------------------------------------------------------


def test_each_frame_once_then_the_end(towards_a_pedestrian: Sequence) -> None:
    source: FrameSource = RecordedSource(towards_a_pedestrian)
    with pytest.raises(ScenarioError, match="not started"):
        source.step(None)
    at, stamps = source.start(), []
    while at.frame is not None:
        stamps.append(at.frame.stamp_s)
        at = source.step(Command(emergency=True))
    assert stamps == towards_a_pedestrian.stamp_s.tolist()
    assert at.end_reason == END_OF_RECORDING
    with pytest.raises(ScenarioError, match="at its end"):
        source.step(None)
    with pytest.raises(ScenarioError, match="already started"):
        source.start()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda source: pickle.loads(pickle.dumps(source))])
def test_a_copy_goes_on_from_the_same_frame(
    towards_a_pedestrian: Sequence, copied: Callable[[RecordedSource], RecordedSource]
) -> None:
    source = RecordedSource(towards_a_pedestrian, hindsight_s=2.0)
    source.start()
    for _ in range(24):
        source.step(None)
    pair = [each.step(None).frame for each in (copied(source), source)]
    assert [frame.stamp_s for frame in pair if frame is not None] == [2.5, 2.5]
    again, frame = pair
    assert again is not None
    assert frame is not None
    assert again.ego == frame.ego
    assert again.detections.boxes.center_m.tolist() == frame.detections.boxes.center_m.tolist()


def test_the_path_is_known_only_in_hindsight_and_up_to_its_horizon(towards_a_pedestrian: Sequence) -> None:
    assert all(frame.path is None for frame in frames(RecordedSource(towards_a_pedestrian)))
    known = list(frames(RecordedSource(towards_a_pedestrian, hindsight_s=2.0)))
    assert len({id(frame.path) for frame in known}) == 3
    for frame in known[:30]:
        assert frame.path is not None
        station_m, offset_m = frame.path.project(frame.ego.x_m, frame.ego.y_m)
        assert offset_m == pytest.approx(0.0)
        # as far as the horizon, at most twice as far; the last point is up to a frame before that
        assert 2.0 * SPEED_MPS - 1.0 <= frame.path.length_m - station_m <= 4.0 * SPEED_MPS


def test_the_path_of_a_vehicle_that_stands_is_straight_ahead() -> None:
    standing = recording(np.arange(5) * FRAME_S, *[np.zeros(5)] * 2, np.full(5, 0.5))
    paths = [frame.path for frame in frames(RecordedSource(standing, hindsight_s=1.0))]
    assert paths[0] is not None
    assert paths == [paths[0]] * 5
    assert paths[0].pose(0.0) == pytest.approx((0.0, 0.0, 0.5))
    with pytest.raises(ScenarioError, match="hindsight_s must be positive"):
        RecordedSource(standing, hindsight_s=0.0)


def test_points_of_a_path_keep_their_distance() -> None:
    points = np.column_stack((np.array([0.0, 0.1, 0.4, 0.6, 0.7, 1.3]), np.zeros(6)))
    assert points[spaced(points, 0.5), 0].tolist() == [0.0, 0.6, 1.3]


@pytest.mark.parametrize(("height_m", "road"), [(6.2, "2"), (0.2, "1")])
def test_recorded_heights_choose_the_level(height_m: float, road: str) -> None:
    """Road 2 crosses road 1 on a bridge, 6 m above it; the drive comes to where both are."""
    network = load_map(FIELD_MAPS / "bridge_two_levels.xodr")
    lane = next(i for i, key in enumerate(network.lanes.key) if key.road_id == road)
    middle_m = 0.5 * float(network.lanes.s_start_m[lane] + network.lanes.s_end_m[lane])
    time_s = np.arange(11) * FRAME_S
    along = middle_m - 5.0 + SPEED_MPS * time_s
    x, y, _, heading = network.center_line(lane, along)
    forwards = int(network.lanes.direction[lane]) > 0
    order = slice(None) if forwards else slice(None, None, -1)
    drive = recording(time_s, x[order], y[order], heading[order])
    assert drive.ego_heights_m() is None
    assert [n.split(" (")[0] for n in notes_on_levels(network, drive)] == [
        "roads of the map lie above each other"
    ]
    assert drive.world_SE3_ego is not None
    drive.world_SE3_ego[:, 2, 3] = height_m
    assert notes_on_levels(network, drive) == []
    [first, *_] = frames(RecordedSource(drive, network, hindsight_s=1.0))
    assert first.path is not None
    assert first.path.height_m is not None
    assert first.path.height_m.tolist() == [height_m] * len(first.path.center_m)
    route = map_view(network, first.path).route
    assert {network.lanes.key[lane].road_id for lane in route.lanes} == {road}


# --- area, tracker, forecast, decision and log --------------------------------------------------------------


def map_area(sequence: Sequence) -> MapArea:
    network = load_map(MAPS / "urban_street.xodr")
    route = route_along(network, sequence.ego_xy_yaw()[:, :2], 60.0, 30.0)
    return MapArea(network, route, MapAreaConfig(min_front_m=60.0))  # the forecast is what limits the view


@pytest.mark.parametrize("area", ["all", "map"])
def test_threat_and_emergency_come_when_the_closed_form_says(
    towards_a_pedestrian: Sequence, area: str
) -> None:
    """The forecasts meet within 3 s, boxes of 0.1 s; the brake waits for the braking distance of 36 km/h."""
    strategy: MonitoredAreaStrategy = EverythingArea() if area == "all" else map_area(towards_a_pedestrian)
    decided = drive(
        RecordedSource(towards_a_pedestrian, hindsight_s=3.0), Pipeline(strategy, PipelineConfig())
    )
    edge_m = PEDESTRIAN_X_M - 100.0 - SIDE_M / 2.0
    front_m = EgoState(0.0, 0.0, 0.0, 0.0, 0.0).length_m / 2.0
    # 1 % of the union of both boxes must overlap
    union_m2 = 4.4 * 1.8 + SIDE_M**2
    overlap_m = 0.01 * union_m2 / 1.01 / SIDE_M
    touch_s = (edge_m - front_m + overlap_m) / SPEED_MPS
    threat_s = math.ceil((touch_s - ForecastConfig().min_horizon_s) / FRAME_S) * FRAME_S
    brake_s = math.ceil((edge_m - BrakingDistance().at(SPEED_MPS)) / SPEED_MPS / FRAME_S) * FRAME_S
    threats = [frame.stamp_s for frame, result in decided if len(result.threats.track_id)]
    braked = [frame.stamp_s for frame, result in decided if result.command.emergency]
    assert threats[0] == pytest.approx(threat_s)
    assert braked[0] == pytest.approx(brake_s)
    [first] = [result for frame, result in decided if frame.stamp_s == braked[0]]
    assert [event.name for event in first.events] == ["unexpected", "collision", "predicted_collision"]
    # the frame's forecast: the first box, 0.1 s apart, that overlaps
    [ttc_s] = first.threats.time_to_collision_s.tolist()
    assert ttc_s == pytest.approx(math.ceil((touch_s - brake_s) / 0.1) * 0.1)


@pytest.mark.parametrize("name", STRATEGIES)
def test_perception_goes_on_where_the_recorded_vehicle_stands(name: str) -> None:
    """It stands, drives off and stands again, each for longer than the path is known."""
    stamp_s = np.arange(60) * FRAME_S
    x_m = 100.0 + SPEED_MPS * np.clip(stamp_s - 2.0, 0.0, 2.0)
    drive = recording(stamp_s, x_m, np.full(60, LANE_Y_M), np.zeros(60))
    network = load_map(MAPS / "urban_street.xodr")
    perception = Perception(AreaPipelines(NamedStrategy(name, PHYSICAL), PHYSICAL.pipeline))
    for frame in frames(RecordedSource(drive, network, hindsight_s=0.5)):
        assert not perception.step(frame).command.emergency
    assert len(perception.frame_time_ms) == 60


@pytest.mark.parametrize("name", STRATEGIES)
def test_the_perception_of_simulations_runs_on_recordings(towards_a_pedestrian: Sequence, name: str) -> None:
    """The pedestrian stands in the lane: whatever the strategy, the brake comes at the braking distance."""
    network = load_map(MAPS / "urban_street.xodr")
    pipelines = AreaPipelines(NamedStrategy(name, PHYSICAL), PHYSICAL.pipeline)
    perception = Perception(pipelines)
    source = RecordedSource(towards_a_pedestrian, network, hindsight_s=2.0)
    at, braked = source.start(), []
    while at.frame is not None:
        command = perception.step(at.frame).command
        if command.emergency:
            braked.append(at.frame.stamp_s)
        at = source.step(command)
    edge_m = PEDESTRIAN_X_M - 100.0 - SIDE_M / 2.0
    needed_m = PHYSICAL.pipeline.braking_distance.at(SPEED_MPS)
    assert braked[0] == pytest.approx(math.ceil((edge_m - needed_m) / SPEED_MPS / FRAME_S) * FRAME_S)
    assert len(perception.frame_time_ms) == len(towards_a_pedestrian)


@pytest.mark.parametrize("name", [name for name in STRATEGIES if name != "map"])
@pytest.mark.parametrize("lane_map", [None, load_map(MAPS / "urban_street.xodr")], ids=["no map", "off it"])
def test_areas_without_a_route_need_no_map(name: str, lane_map: RoadNetwork | None) -> None:
    """In reverse, 500 m beside the road."""
    stamp_s = np.arange(20) * FRAME_S
    drive = recording(stamp_s, 100.0 - SPEED_MPS * stamp_s, np.full(20, 500.0), np.zeros(20))
    perception = Perception(AreaPipelines(NamedStrategy(name, PHYSICAL), PHYSICAL.pipeline))
    for frame in frames(RecordedSource(drive, lane_map, hindsight_s=0.5)):
        assert not perception.step(frame).command.emergency
    assert len(perception.frame_time_ms) == 20


def test_a_recorded_drive_is_logged_as_a_run_is(towards_a_pedestrian: Sequence) -> None:
    log = RunLog(np.zeros(0, dtype=np.str_), np.zeros(0, dtype=np.str_))
    none = Boxes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    for frame, result in drive(
        RecordedSource(towards_a_pedestrian), Pipeline(EverythingArea(), PipelineConfig())
    ):
        log.frame(frame.ego, none, np.zeros(0), np.zeros(0, dtype=np.int64))
        log.perception(frame.ego, result)
    table = log.table()
    ego = table["kind"] == "ego"
    assert table["speed_mps"][ego] == pytest.approx([SPEED_MPS] * 60)
    assert np.unique(table["label"][table["kind"] == "track"]).tolist() == ["static", "threat"]
    assert "predicted_collision" in table["label"][table["kind"] == "event"]


# --- another source -----------------------------------------------------------------------------------------


class Playback:
    """A third source in one class: a pedestrian ahead, made up frame by frame, as a live topic would give."""

    def __init__(self, count: int) -> None:
        self._frames = iter([self._seen(FRAME_S * k) for k in range(count)])

    @staticmethod
    def _seen(now: float) -> Frame:
        detections, _ = detections_from_arrays(now, [[50.0, 0.0]], [[0.5, 0.5]], [0.0], [0.9], ["pedestrian"])
        return Frame(now, EgoState(now, SPEED_MPS * now, 0.0, 0.0, SPEED_MPS), detections)

    def start(self) -> StepResult:
        return self.step(None)

    def step(self, command: Command | None) -> StepResult:
        frame = next(self._frames, None)
        return StepResult(frame, None if frame else "topic closed")


def test_another_source_needs_nothing_but_frames() -> None:
    decided = drive(Playback(60), Pipeline(EverythingArea(), PipelineConfig()))
    assert len(decided) == 60
    assert not decided[0][1].command.emergency
    assert decided[-20][1].command.emergency
