"""A monitored area of one file, with the planned path as an input of its own."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.presets import PAPER
from scenarios.strategies import make_strategy
from smartmot import (
    Boxes,
    Detections,
    EgoState,
    EverythingArea,
    ForecastConfig,
    FrameResult,
    MonitoredAreaStrategy,
    Pipeline,
    PipelineConfig,
    PlannedPath,
)
from smartmot.area import known_path, uses_path
from tests.smartmot.area.corridor import CorridorArea

BEND = PlannedPath.through([[0.0, 0.0], [30.0, 0.0], [62.0, 24.0]])
"""Straight on, then along (0.8, 0.6)."""
STANDS_M = ((30.0 + 8.0, 6.0), (38.0, 0.0))
"""What stands 10 m round the bend, and what straight on."""


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch) -> Iterator[MonitoredAreaStrategy]:
    """The same area by its name, as the command line has it."""
    monkeypatch.chdir(Path(__file__).parent)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield make_strategy("corridor:make", PAPER, SimpleNamespace(network=None, route=None))  # type: ignore[arg-type]
    sys.modules.pop("corridor", None)


def last_frame(
    strategy: MonitoredAreaStrategy, path: PlannedPath | None, ego_forecast: str = "ctrv"
) -> FrameResult:
    """After 1 s at 10 m/s, at x = 10 m."""
    config = PipelineConfig(forecast=ForecastConfig(ego=ego_forecast))
    pipeline = Pipeline(strategy, config)
    state = pipeline.initial()
    for k in range(21):
        t = 0.05 * k
        boxes = Boxes(np.array(STANDS_M), np.full((2, 2), 0.5), np.zeros(2))
        seen = Detections(t, boxes, np.ones(2), np.array(["car"] * 2))
        state, frame = pipeline.step(state, seen, EgoState(t, 10.0 * t, 0.0, 0.0, 10.0), path)
    return frame


def test_the_corridor_bends_with_the_planned_path(named: MonitoredAreaStrategy) -> None:
    for strategy in (CorridorArea(), named):
        round_the_bend, straight_on = last_frame(strategy, BEND).lead, last_frame(strategy, None).lead
        assert round_the_bend is not None
        assert round_the_bend.track_id == 1
        assert straight_on is not None
        assert straight_on.track_id == 2


def test_an_area_that_was_made_for_a_route_says_so_by_that_alone() -> None:
    """As strategies written for version 0.1.0 do; the ego is forecast along it, whatever the area uses."""
    area = EverythingArea()
    area.route = BEND  # type: ignore[attr-defined]
    assert (uses_path(area), known_path(area)) == (True, BEND)
    for old_or_new in ("route", "path"):
        frame = last_frame(area, None, old_or_new)
        assert frame.ego_forecast.center_m[0, 30] == pytest.approx((38.0, 6.0))
    area.uses_path = False  # type: ignore[attr-defined]
    assert not uses_path(area)
    assert last_frame(area, None, "path").ego_forecast.center_m[0, 30] == pytest.approx((38.0, 6.0))


@pytest.mark.parametrize("make", [CorridorArea, EverythingArea])
def test_the_ego_is_forecast_along_the_path_whatever_the_area(
    make: Callable[[], MonitoredAreaStrategy],
) -> None:
    """3 s after x = 10 the ego is 10 m round the bend, or straight on at x = 40."""
    along, straight = (30.0 + 0.8 * 10.0, 0.6 * 10.0), (40.0, 0.0)
    assert last_frame(make(), BEND, "path").ego_forecast.center_m[0, 30] == pytest.approx(along)
    assert last_frame(make(), BEND, "ctrv").ego_forecast.center_m[0, 30] == pytest.approx(straight)
