"""Brake rules of one's own: called, checked, remembered. The second one is the example of docs/plugins.md."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from smartmot import (
    AebConfig,
    Assessment,
    Boxes,
    Command,
    ConfigError,
    Detections,
    EgoState,
    Event,
    EverythingArea,
    FrameResult,
    PaperRule,
    Pipeline,
    PipelineConfig,
    PluginError,
    ShapeError,
)
from smartmot.decision.rules import LeadObject

DOCS = Path(__file__).parents[3] / "docs" / "plugins.md"
FRAME_S = 0.05


def documented_rule() -> Callable[[], Any]:
    [source] = [
        block for block in re.findall(r"```python\n(.*?)```", DOCS.read_text(), re.S) if "def decide" in block
    ]
    names: dict[str, Any] = {}
    exec(source, names)
    return names["TimeToCollision"]


def drive(
    rule: Any, speed_mps: float, gap_m: float, frames: int, target_mps: float = 0.0
) -> list[FrameResult]:
    """Towards a car of 4 m ahead on the ego's way, at constant speeds and without noise."""
    pipeline = Pipeline(EverythingArea(), PipelineConfig(aeb=rule))
    state, results = pipeline.initial(), []
    for k in range(frames):
        t = k * FRAME_S
        center = np.array([[2.2 + gap_m + 2.0 + target_mps * t, 0.0]])
        boxes = Boxes(center, np.array([[4.0, 1.8]]), np.zeros(1))
        detections = Detections(t, boxes, np.ones(1), np.array(["car"]))
        state, result = pipeline.step(state, detections, EgoState(t, speed_mps * t, 0.0, 0.0, speed_mps))
        results.append(result)
    return results


@pytest.mark.parametrize(
    ("speed", "gap", "target"), [(10.0, 20.3, 0.0), (15.0, 33.3, 0.0), (15.0, 20.3, 5.0)]
)
def test_time_to_collision_brakes_when_the_closed_form_says(speed: float, gap: float, target: float) -> None:
    """(gap - dv t) / dv <= 1.2 s from t = gap / dv - 1.2 on: the first frame after that. A moving target's
    speed is an estimate of the filter, exact without noise once it has settled."""
    results = drive(documented_rule(), speed, gap, 60, target)
    flagged = [k for k, result in enumerate(results) if result.command.emergency]
    expected_s = gap / (speed - target) - 1.2
    assert flagged[0] == pytest.approx(np.ceil(expected_s / FRAME_S), abs=0 if target == 0.0 else 1)
    assert flagged == list(range(flagged[0], 60))
    assert [event.name for result in results for event in result.events] == ["collision"]
    assert results[flagged[0]].events[0].stamp_s == pytest.approx(flagged[0] * FRAME_S)


def test_the_papers_rule_plugged_in_decides_as_from_within() -> None:
    inside = drive(AebConfig(), 12.0, 40.0, 60)
    outside = drive(lambda: PaperRule(AebConfig()), 12.0, 40.0, 60)
    assert [r.command for r in inside] == [r.command for r in outside]
    assert [r.events for r in inside] == [r.events for r in outside]
    assert any(r.command.emergency for r in inside)


def test_a_rule_may_let_go_of_the_lead() -> None:
    """The paper's rule passes the object ahead on; another need not."""

    class Alone:
        def decide(self, state: None, now: Assessment) -> tuple[None, Command, tuple[Event, ...]]:
            return None, Command(False), ()

    assert drive(AebConfig(), 10.0, 30.0, 10)[-1].lead is not None
    assert drive(Alone, 10.0, 30.0, 10)[-1].lead is None


def test_the_state_is_what_the_rule_returned_before() -> None:
    seen: list[object] = []

    class Counts:
        def decide(self, state: int | None, now: Assessment) -> tuple[int, Command, list[Event]]:
            seen.append(state)
            return (state or 0) + 1, Command(False), []

    drive(Counts, 10.0, 50.0, 4)
    assert seen == [None, 1, 2, 3]


def test_what_a_rule_knows() -> None:
    """A standing car 10 m ahead at 10 m/s: on the way, not a VRU, its forecast met after 1 s."""
    given: list[Assessment] = []

    class Looks:
        def decide(self, state: None, now: Assessment) -> tuple[None, Command, tuple[Event, ...]]:
            given.append(now)
            return None, Command(False), ()

    drive(Looks, 10.0, 30.0, 41)
    now = given[-1]
    assert now.ego.stamp_s == pytest.approx(2.0)
    assert now.ahead_m == pytest.approx([12.2], abs=0.01)
    assert now.time_to_collision_s == pytest.approx([1.1])  # forecast boxes are 0.1 s apart
    assert (now.on_way.tolist(), now.threatening.tolist()) == ([True], [True])
    assert (now.vulnerable.tolist(), now.entering.tolist()) == ([False], [False])
    assert now.threats.gap_m == pytest.approx([10.0], abs=0.01)
    assert now.lead is not None
    assert now.lead.gap_m == pytest.approx(10.0, abs=0.01)
    assert now.braking_distance_m == pytest.approx(0.00645 * 36**2 + 0.2065 * 36 + 0.04)


@dataclass
class Returns:
    value: Any

    def decide(self, state: object, now: Assessment) -> Any:
        if isinstance(self.value, Exception):
            raise self.value
        return self.value


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (Command(True), r"decide\(\) returned Command; return its state, a smartmot.Command and a tuple of"),
        ((None, True, ()), r"decide\(\) returned bool as command"),
        ((None, Command(True), ["collision"]), r"decide\(\) returned events that are none"),
        ((None, Command(True)), r"decide\(\) returned tuple"),
        ((None, Command(True), [Event(math.nan, "monitors", "collision")]), "expected a finite stamp"),
        ((None, Command(True), [Event(0.0, "monitors", "x" * 25)]), "texts of at most 24 characters"),
        (RuntimeError("not today"), r"RuntimeError: not today \(.*test_rules.py, line"),
        (ShapeError("two rows"), r"Returns, frame at 0 s: two rows"),
    ],
)
def test_mistakes_are_told_with_the_time_of_the_frame(value: Any, message: str) -> None:
    with pytest.raises(PluginError, match=message) as raised:
        drive(lambda: Returns(value), 10.0, 30.0, 1)
    assert "\n" not in str(raised.value)
    assert "frame at 0 s" in str(raised.value)


class Hesitates(PaperRule):
    """Derived from the paper's rule, and returns nothing."""

    def decide(self, state: object, now: Assessment) -> Any:
        return None


def test_a_rule_derived_from_the_papers_is_checked_too() -> None:
    with pytest.raises(PluginError, match=r"Hesitates, frame at 0 s: decide\(\) returned NoneType"):
        drive(Hesitates, 10.0, 30.0, 1)


@pytest.mark.parametrize("emergency", ["no", None, 1, np.array([True, False]), Command])
def test_an_emergency_is_a_truth_value(emergency: Any) -> None:
    with pytest.raises(ShapeError, match="command: emergency must be true or false"):
        Command(emergency)
    assert Command(np.bool_(True)).emergency  # type: ignore[arg-type]  # a comparison of arrays gives it


def test_a_lead_object_is_a_finite_one() -> None:
    with pytest.raises(ShapeError, match="lead object: gap and speed must be finite"):
        LeadObject(1, math.nan, 0.0)
    with pytest.raises(ShapeError, match="command: lead must be a LeadObject or None"):
        Command(False, "car")  # type: ignore[arg-type]


def test_what_has_no_decide_is_no_rule() -> None:
    with pytest.raises(PluginError, match=r"made list, which has no decide\(\); see docs/plugins.md"):
        Pipeline(EverythingArea(), PipelineConfig(aeb=list))  # type: ignore[arg-type]


def test_columns_have_one_row_per_track() -> None:
    given: list[Assessment] = []

    class Looks:
        def decide(self, state: None, now: Assessment) -> tuple[None, Command, tuple[Event, ...]]:
            given.append(now)
            return None, Command(False), ()

    drive(Looks, 10.0, 30.0, 3)
    from dataclasses import replace

    assert replace(given[-1], ahead_m=[3.0]).ahead_m.tolist() == [3.0]  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="ahead_m"):
        replace(given[-1], ahead_m=np.zeros(2))


@pytest.mark.parametrize("decel", [0.0, -3.0, math.nan, math.inf, "hard"])
def test_a_partial_brake_is_a_positive_deceleration(decel: Any) -> None:
    with pytest.raises(ShapeError, match="command: decel_mps2 must be a positive number, and only with"):
        Command(True, decel_mps2=decel)
    with pytest.raises(ShapeError, match="only with emergency"):
        Command(False, decel_mps2=3.0)
    with pytest.raises(ShapeError, match="command: warning must be true or false"):
        Command(False, warning=decel)
    assert Command(True, None, True, 3.8).decel_mps2 == 3.8


def test_a_rule_may_be_given_itself() -> None:
    """It remembers nothing, so that it may decide for several pipelines."""
    rule = documented_rule()()
    made = [result.command.emergency for result in drive(lambda: rule, 10.0, 20.3, 60)]
    assert [result.command.emergency for result in drive(rule, 10.0, 20.3, 60)] == made
    assert [result.command.emergency for result in drive(rule, 10.0, 20.3, 60)] == made
    assert any(made)


def test_what_is_neither_a_rule_nor_makes_one_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"aeb: expected settings .* or what makes one, got 3"):
        PipelineConfig(aeb=3)  # type: ignore[arg-type]
