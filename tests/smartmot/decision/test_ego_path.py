"""How objects lie to the ego's path, against lengths and angles worked out by hand."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from smartmot import (
    Assessment,
    Boxes,
    Command,
    Detections,
    EgoState,
    Event,
    EverythingArea,
    ForecastConfig,
    Pipeline,
    PipelineConfig,
    PlannedPath,
)
from smartmot.decision.ego_path import PathRelation, path_of_forecast, relation
from smartmot.forecast import forecast_ego, forecast_times, forecast_tracks
from smartmot.tracking.own import tracks_from_arrays
from smartmot.types import Tracks

TIMES = forecast_times(3.0, 0.1)
STRAIGHT = PlannedPath.through([[0.0, 0.0], [100.0, 0.0]])


def placed(
    center: list[list[float]], size: list[list[float]], yaw: list[float], velocity: list[list[float]]
) -> Tracks:
    return tracks_from_arrays(
        0.0,
        np.arange(len(center)),
        np.array(center),
        np.array(size),
        np.array(yaw),
        np.array(["car"] * len(center)),
        np.array(velocity),
    )


def related(ego: EgoState, path: PlannedPath, tracks: Tracks, delay_s: float = 0.0) -> PathRelation:
    forecast = forecast_tracks(tracks, TIMES, ForecastConfig(), delay_s)
    return relation(ego, path, tracks, forecast, forecast_ego(ego, TIMES))


def test_on_a_straight_path() -> None:
    """A car ahead in the path, one beside it that comes nearer, a crosser, one behind."""
    ego = EgoState(0.0, 10.0, 0.5, 0.0, 10.0)  # 4.4 m x 1.8 m: front at 12.2, from -0.4 to 1.4
    tracks = placed(
        [[30.0, 0.5], [30.0, -3.0], [25.0, 4.0], [2.0, 0.5]],
        [[4.0, 1.8], [4.0, 2.0], [0.5, 0.5], [4.0, 1.8]],
        [0.0, 0.0, -math.pi / 2, 0.0],
        [[5.0, 0.0], [8.0, 0.6], [0.2, -1.5], [9.0, 0.0]],
    )
    on_path = related(ego, STRAIGHT, tracks)
    assert on_path.gap_m == pytest.approx([15.8, 15.8, 12.55, -12.2])
    assert on_path.aside_m == pytest.approx([-1.8, 1.6, 2.35, -1.8])
    assert on_path.offset_m == pytest.approx([0.0, -3.5, 3.5, 0.0])
    assert on_path.speed_mps == pytest.approx([5.0, 8.0, 0.2, 9.0])
    assert on_path.aside_mps[1:3] == pytest.approx([-0.6, -1.5])


def test_latency_is_made_up_for() -> None:
    """A car at 10 m/s, seen 0.2 s ago, is 2 m farther."""
    ego = EgoState(0.2, 0.0, 0.0, 0.0, 10.0)
    tracks = placed([[30.0, 0.0]], [[4.0, 1.8]], [0.0], [[10.0, 0.0]])
    assert related(ego, STRAIGHT, tracks, 0.2).gap_m == pytest.approx([30.0 - 2.0 - 2.2 + 2.0])


def test_along_the_arc_of_the_turn_rate() -> None:
    """At 8 m/s and 0.4 rad/s the ego is on a circle of 20 m around (0, 20).

    A small box at an angle of 60 degrees is 20.94 m along the arc; 1.5 m outside of the arc it is 1.5 m to
    the right of it. It moves along the circle at 3 m/s.
    """
    ego = EgoState(0.0, 0.0, 0.0, 0.0, 8.0, yaw_rate_radps=0.4)
    path = path_of_forecast(ego, forecast_ego(ego, TIMES))
    angle = math.pi / 3
    radius = 20.0 + 1.5
    center = [[radius * math.sin(angle), 20.0 - radius * math.cos(angle)]]
    velocity = [[3.0 * math.cos(angle), 3.0 * math.sin(angle)]]
    on_path = related(ego, path, placed(center, [[0.02, 0.02]], [angle], velocity))
    # chords of 0.8 m turn by 0.04 rad at each joint: 1.5 m beside it half of that is 0.03 m along it
    assert on_path.gap_m == pytest.approx([20.0 * angle - 2.2], abs=0.04)
    assert on_path.aside_m == pytest.approx([1.5 - 0.9], abs=0.03)
    assert on_path.speed_mps == pytest.approx([3.0], abs=0.01)
    assert abs(on_path.aside_mps[0]) < 0.1


def test_round_a_planned_bend() -> None:
    """The path turns left at (20, 0); what stands 10 m up the other road is 30 m ahead, not beside."""
    ego = EgoState(0.0, 0.0, 0.0, 0.0, 8.0)
    bend = PlannedPath.through([[0.0, 0.0], [20.0, 0.0], [20.0, 60.0]])
    tracks = placed([[20.0, 10.0]], [[4.0, 1.8]], [math.pi / 2], [[0.0, 2.0]])
    bent, arc = related(ego, bend, tracks), related(ego, STRAIGHT, tracks)
    assert (bent.gap_m, bent.aside_m, bent.speed_mps) == (
        pytest.approx([30.0 - 2.0 - 2.2]), pytest.approx([-1.8]), pytest.approx([2.0])
    )  # fmt: skip
    assert arc.aside_m == pytest.approx([10.0 - 2.0 - 0.9])
    assert arc.aside_mps == pytest.approx([2.0])


@pytest.mark.parametrize("speed", [0.0, 1e-5])
def test_who_stands_looks_straight_ahead(speed: float) -> None:
    ego = EgoState(0.0, 5.0, 5.0, math.pi / 2, speed)
    path = path_of_forecast(ego, forecast_ego(ego, TIMES))
    tracks = placed([[5.0, 15.0]], [[4.0, 1.8]], [math.pi / 2], [[0.0, 0.0]])
    on_path = related(ego, path, tracks)
    assert on_path.gap_m == pytest.approx([10.0 - 2.0 - 2.2])
    assert on_path.aside_m == pytest.approx([-1.8])


class Looks:
    """Keeps what it is given."""

    def __init__(self, seen: list[Assessment], ask: Callable[[Assessment], Any]) -> None:
        self.seen, self.ask = seen, ask

    def decide(self, state: None, now: Assessment) -> tuple[None, Command, tuple[Event, ...]]:
        self.seen.append(now)
        self.ask(now)
        return None, Command(False), ()


def assessed(forecast: str, path: PlannedPath | None, ask: Callable[[Assessment], Any]) -> list[Assessment]:
    """Towards a standing car 30 m up the road behind a bend, at 5 m/s."""

    class Along(EverythingArea):
        uses_path = True

    seen: list[Assessment] = []
    config = PipelineConfig(aeb=Looks(seen, ask), forecast=ForecastConfig(ego=forecast))
    pipeline = Pipeline(Along(), config)
    state = pipeline.initial()
    for k in range(3):
        boxes = Boxes(np.array([[20.0, 10.0]]), np.array([[4.0, 1.8]]), np.array([math.pi / 2]))
        detections = Detections(0.05 * k, boxes, np.ones(1), np.array(["car"]))
        state, _ = pipeline.step(state, detections, EgoState(0.05 * k, 0.25 * k, 0.0, 0.0, 5.0), path)
    return seen


def test_the_path_is_that_of_the_egos_forecast() -> None:
    bend = PlannedPath.through([[0.0, 0.0], [20.0, 0.0], [20.0, 60.0]])
    along, turning = assessed("route", bend, repr)[-1], assessed("ctrv", bend, repr)[-1]
    assert along.path_gap_m == pytest.approx([25.8 - 0.5], abs=0.01)
    assert along.path_aside_m[0] < 0.0
    assert turning.path_aside_m == pytest.approx([7.1], abs=0.01)
    assert along.counts.tolist() == turning.counts.tolist() == [True]


def test_it_is_computed_when_a_rule_asks_and_only_once() -> None:
    """The paper's rule does not ask."""
    assert all(now._on_path is None for now in assessed("ctrv", None, repr))
    kept: list[Any] = []
    seen = assessed("ctrv", None, lambda now: kept.append((now.path_gap_m, now.path_gap_m)))
    assert all(now._on_path is not None for now in seen)
    assert all(first is second for first, second in kept)


def test_of_no_tracks_nothing_is_known() -> None:
    pipeline_seen: list[Assessment] = []
    pipeline = Pipeline(EverythingArea(), PipelineConfig(aeb=Looks(pipeline_seen, repr)))
    nothing = Boxes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    detections = Detections(0.0, nothing, np.zeros(0), np.zeros(0, dtype=np.str_))
    pipeline.step(pipeline.initial(), detections, EgoState(0.0, 0.0, 0.0, 0.0, 5.0))
    [now] = pipeline_seen
    for column in (now.path_gap_m, now.path_aside_m, now.path_speed_mps, now.path_aside_mps, now.counts):
        assert column.shape == (0,)
