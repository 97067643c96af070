"""A localisation error moves the map against the world, by exactly what it is; nothing else moves."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opendrive import load_map
from smartmot import (
    Assessment,
    Boxes,
    Command,
    Detections,
    EgoState,
    Event,
    EverythingArea,
    ForecastConfig,
    MapArea,
    MapAreaConfig,
    MonitoredAreaStrategy,
    PathArea,
    Pipeline,
    PipelineConfig,
    PlannedPath,
    RectangularArea,
    RectangularConfig,
    route_ahead,
)
from smartmot.area import MonitoredArea, with_way
from smartmot.area.localised import Alignment, LocalisedArea
from smartmot.decision.braking import BrakingDistance
from smartmot.geometry import from_frame
from tests.smartmot.area.corridor import CorridorArea

NETWORK = load_map(Path(__file__).parents[3] / "scenarios" / "maps" / "urban_street.xodr")
EGO = EgoState(0.0, 100.0, -1.75, 0.0, 10.0)
"""In the middle of a lane of 3.5 m along x, whose sidewalk begins at its right border."""
(LANE,) = NETWORK.locate([[EGO.x_m, EGO.y_m]]).lane.tolist()
MAP = MapArea(NETWORK, route_ahead(NETWORK, LANE, 50.0, ahead_m=200.0), MapAreaConfig())

pose = st.builds(
    lambda x, y, yaw: EgoState(0.0, x, y, yaw, 10.0),
    st.floats(-500, 500), st.floats(-500, 500), st.floats(-math.pi, math.pi),
)  # fmt: skip


def believed(ahead_m: float = 0.0, left_m: float = 0.0, turn_rad: float = 0.0) -> EgoState:
    x, y = from_frame(np.array([ahead_m, left_m]), EGO.x_m, EGO.y_m, EGO.yaw_rad).tolist()
    return replace(EGO, x_m=x, y_m=y, yaw_rad=EGO.yaw_rad + turn_rad)


def localised(ego: EgoState) -> LocalisedArea:
    return LocalisedArea(MAP.at(ego), Alignment(EGO, ego))


@given(st.floats(-1.5, 1.5))
def test_a_lateral_bias_moves_the_lane_by_exactly_that(bias_m: float) -> None:
    """Who believes to be farther left sees the lane, from y = -3.5 to 0 m in truth, farther right."""
    area = localised(believed(left_m=bias_m))
    right_m, left_m = -3.5 - bias_m, -bias_m
    points = np.array([(120.0, y) for y in (right_m - 1e-6, right_m + 1e-6, left_m - 1e-6, left_m + 1e-6)])
    assert area.on_lane(points).tolist() == [False, True, True, False]


@given(st.floats(-math.pi, math.pi))
def test_a_bias_of_the_heading_moves_what_is_ahead_aside_by_its_sine(bias_rad: float) -> None:
    (moved,) = Alignment(EGO, believed(turn_rad=bias_rad)).points(np.array([[EGO.x_m + 40.0, EGO.y_m]]))
    assert moved[0] - EGO.x_m == pytest.approx(40.0 * math.cos(bias_rad), abs=1e-9)
    assert moved[1] - EGO.y_m == pytest.approx(40.0 * math.sin(bias_rad), abs=1e-9)


@given(pose, pose, st.floats(-100, 100), st.floats(-100, 100))
def test_there_and_back_is_where_it_was(src: EgoState, dst: EgoState, x_m: float, y_m: float) -> None:
    over = Alignment(src, dst)
    boxes = Boxes(np.array([[x_m, y_m]]), np.array([[4.0, 2.0]]), np.array([0.3]))
    back = over.inverse.boxes(over.boxes(boxes))
    assert back.center_m == pytest.approx(boxes.center_m, abs=1e-9)
    assert back.yaw_rad == pytest.approx(boxes.yaw_rad)
    assert over.points(np.array([src.x_m, src.y_m])) == pytest.approx([dst.x_m, dst.y_m])


def test_outlines_are_drawn_where_the_ego_believes_them() -> None:
    ring = dict(localised(believed(left_m=0.5)).polygons())["current"]
    assert (ring[:, 1].min(), ring[:, 1].max()) == pytest.approx((-4.0, -0.5))


@pytest.mark.parametrize(
    "strategy",
    [EverythingArea(), PathArea(), RectangularArea(RectangularConfig(), BrakingDistance())],
    ids=lambda strategy: strategy.name,
)
def test_what_takes_nothing_from_the_map_does_not_care(strategy: MonitoredAreaStrategy) -> None:
    pipeline = Pipeline(strategy, PipelineConfig(forecast=ForecastConfig(ego="path")))
    path = PlannedPath.through([[0.0, -1.75], [130.0, -1.75], [160.0, 20.0]])
    frames = []
    for wrong in (None, believed(2.0, 1.5, 0.1)):
        state = pipeline.initial()
        for k in range(4):
            ego, where = replace(EGO, stamp_s=0.05 * k), np.array([[115.0, -1.0 - 0.1 * k], [118.0, 3.0]])
            boxes = Boxes(where, np.full((2, 2), 0.5), np.zeros(2))
            seen = Detections(0.05 * k, boxes, np.ones(2), np.array(["pedestrian", "car"]))
            state, frame = pipeline.step(state, seen, ego, path, wrong)
        frames.append(frame)
    assert frames[0].command == frames[1].command
    assert frames[0].threats.track_id.tolist() == frames[1].threats.track_id.tolist()
    assert np.array_equal(frames[0].ego_forecast.center_m, frames[1].ego_forecast.center_m)


def test_a_path_of_the_map_lies_as_wrong_as_the_ego_is_localised() -> None:
    """A car stands on the lane's middle. Who believes to be 1 m left of it looks for the lane 1 m right."""
    seen = Boxes(np.array([[120.0, -1.75 + 1.0]]), np.array([[4.0, 1.8]]), np.zeros(1))
    config = PipelineConfig(way="path")
    for left_m, in_way in ((0.0, True), (0.5, True), (1.0, False)):
        pipeline = Pipeline(EverythingArea(), config, map_path=MAP.route)
        state = pipeline.initial()
        for k in range(4):
            ego = replace(EGO, stamp_s=0.05 * k)
            detections = Detections(0.05 * k, seen, np.ones(1), np.array(["car"]))
            wrong = replace(believed(left_m=left_m), stamp_s=ego.stamp_s)
            state, frame = pipeline.step(state, detections, ego, None, wrong)
        assert (frame.lead is not None) == in_way


AREAS = (
    MAP,
    EverythingArea(),
    PathArea(),
    RectangularArea(RectangularConfig(), BrakingDistance()),
    CorridorArea(),
)
"""The shipped ones and one of a user's own."""


def assessed(strategy: MonitoredAreaStrategy, wrong: EgoState, *cars: tuple[float, float]) -> Assessment:
    """What a rule is told of cars that have stood for 0.15 s, with everything along the path of the map."""
    told: list[Assessment] = []

    class Listens:
        def decide(self, state: object, now: Assessment) -> tuple[object, Command, tuple[Event, ...]]:
            told.append(now)
            return None, Command(False), ()

    along: dict[str, Any] = {"forecast": ForecastConfig(ego="path"), "way": "path", "standing": "path"}
    config = PipelineConfig(aeb=Listens, filter_detections=False, filter_tracks=False, **along)
    pipeline = Pipeline(strategy, config, map_path=MAP.route)
    state = pipeline.initial()
    boxes = Boxes(np.array(cars), np.tile((4.0, 1.8), (len(cars), 1)), np.zeros(len(cars)))
    for k in range(4):
        t = 0.05 * k
        seen = Detections(t, boxes, np.ones(len(cars)), np.full(len(cars), "car"))
        exact = PlannedPath.through([[0.0, -1.75], [300.0, -1.75]])
        state, _ = pipeline.step(state, seen, replace(EGO, stamp_s=t), exact, replace(wrong, stamp_s=t))
    return told[-1]


@pytest.mark.parametrize("strategy", AREAS, ids=lambda strategy: strategy.name)
@pytest.mark.parametrize(
    ("left_m", "turn_rad"), [(0.0, 0.0), (1.0, 0.0), (-0.7, 0.0), (0.5, 0.03), (0.0, -0.02)]
)
def test_with_a_path_of_the_map_everybody_looks_along_the_same_wrong_path(
    strategy: MonitoredAreaStrategy, left_m: float, turn_rad: float
) -> None:
    """The map turns about the ego against the error of the heading, and is moved against that to the side.

    Forecast, gap beside the path, and what is in the way follow the same line; the exact path is not used.
    """
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    driven = EGO.speed_mps * np.arange(31) * 0.1
    line = np.column_stack((EGO.x_m + c * driven - s * left_m, EGO.y_m - s * driven - c * left_m))
    # 20 m along that path, 1.7 and 1.8 m beside its middle, of which half a lane is 1.75 m
    cars = [(*(line[20] + aside * np.array([s, c])),) for aside in (1.7, 1.8, -1.7, -1.8)]
    now = assessed(strategy, believed(left_m=left_m, turn_rad=turn_rad), *cars)
    assert now.ego_forecast.center_m[0] == pytest.approx(line)
    assert now.ego_forecast.yaw_rad[0] == pytest.approx(np.full(31, -turn_rad))
    beside_m = np.array([1.7, 1.8, 1.7, 1.8]) - (2.0 * abs(s) + 0.9 * c) - 0.9
    assert now.path_aside_m == pytest.approx(beside_m)
    reached = now.counts | (strategy.name not in ("rectangular", "corridor"))
    assert (now.on_way == np.array([True, False, True, False]) & reached).all()


@given(
    pose, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi), st.integers(0, 2**32 - 1)
)
def test_everything_along_the_path_is_the_path_area(
    ego: EgoState, ahead_m: float, left_m: float, turn_rad: float, seed: int
) -> None:
    """Object by object, wherever the ego is and believes to be."""
    rng = np.random.default_rng(seed)
    path = PlannedPath.through(
        np.cumsum(rng.uniform(1.0, 9.0, (9, 2)), axis=0) + np.array([ego.x_m, ego.y_m])
    )
    x, y = from_frame(np.array([ahead_m, left_m]), ego.x_m, ego.y_m, ego.yaw_rad).tolist()
    over = Alignment(ego, replace(ego, x_m=x, y_m=y, yaw_rad=ego.yaw_rad + turn_rad))
    place = rng.uniform(-40.0, 40.0, (50, 2)) + np.array([ego.x_m, ego.y_m])
    boxes = Boxes(place, rng.uniform(0.4, 5.0, (50, 2)), rng.uniform(-3.0, 3.0, 50))
    category = rng.choice(["car", "pedestrian"], 50)
    everything = with_way(LocalisedArea(EverythingArea().at(over.dst), over), ego, path, "path", "path")
    corridor = LocalisedArea(PathArea().at(over.dst, over.path(path)), over)
    for one, other in zip(
        (everything.kept(boxes, category), everything.on_lane(place), *_flags(everything, boxes, category)),
        (corridor.kept(boxes, category), corridor.on_lane(place), *_flags(corridor, boxes, category)),
        strict=True,
    ):
        assert one.tolist() == other.tolist()


def _flags(area: MonitoredArea, boxes: Boxes, category: np.ndarray) -> tuple[np.ndarray, ...]:
    relevance = area.relevance(boxes, category)
    return relevance.in_route, relevance.on_way, relevance.within_reach
