"""The staged rule against closed forms, and laws that hold for whatever it sees."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.presets import PHYSICAL
from scenarios.simulation.drive import Asked, EgoDrive
from smartmot import Assessment, ConfigError
from smartmot.decision.collision import collision_times
from smartmot.decision.staged import Staged
from tests.smartmot.decision.frames import KMH, decided, frame, free, scene

FRAME_S = 0.05
RULE = Staged(delay_s=0.25)
"""With a frame for deciding, as in a run with the preset `physical`: 0.2 + 0.05 s, 0.4 s, 8.8 m/s2."""
WALK_MPS = 5 * KMH
PEDESTRIAN: dict[str, Any] = {"size_m": (0.5, 0.5), "category": "pedestrian"}


def seen(now: Assessment) -> Assessment:
    """The frame with its threats: who counts, and whose forecast meets the ego's."""
    time = collision_times(now.ego_forecast, now.forecast)
    return replace(now, threatening=np.isfinite(time) & now.counts)


def asked(rule: Staged, now: Assessment) -> tuple[bool, float]:
    """Warning, and deceleration that is asked for in a first frame; full: infinite."""
    _, command, _ = rule.decide(None, now)
    decel = (command.decel_mps2 or math.inf) if command.emergency else 0.0
    return command.warning, decel


def first_gap_m(fires: Callable[[float], bool], above_m: float = 200.0) -> float:
    """Greatest gap at which something is so; bisected."""
    low, high = 0.0, above_m
    assert fires(low)
    assert not fires(high)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if fires(middle) else (low, middle)
    return low


# --- where the stages begin -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("speed_kmh", "warn_s", "partial_s", "full_s"),
    [
        # 1.2 + 1 / v + v / 8; 0.25 + 0.4 3.8 / 17.6 + 1 / v + v / 7.6; 0.25 + 0.4 6 / 17.6 + v / 12
        (20, 2.07, 1.25, 0.85),
        (30, 2.36, 1.55, 1.08),
        (50, 3.01, 2.24, 1.54),
    ],
)
def test_times_at_which_the_stages_begin_for_a_standing_car(
    speed_kmh: float, warn_s: float, partial_s: float, full_s: float
) -> None:
    """Two decimals, by hand."""
    speed = speed_kmh * KMH
    # a car 3 s ahead or farther is on no forecast yet
    threat = replace(frame(speed, 1.0), threatening=np.array([True]))

    def at(gap_m: float) -> tuple[bool, float]:
        return asked(RULE, replace(frame(speed, gap_m), threatening=threat.threatening))

    assert first_gap_m(lambda gap: at(gap)[0]) / speed == pytest.approx(warn_s, abs=0.0051)
    assert first_gap_m(lambda gap: at(gap)[1] >= 3.8) / speed == pytest.approx(partial_s, abs=0.0051)
    assert first_gap_m(lambda gap: at(gap)[1] > 3.8) / speed == pytest.approx(full_s, abs=0.0051)
    # UN R152: a warning 0.8 s before the brakes ask for 5 m/s2
    assert warn_s - full_s >= 0.8


@pytest.mark.parametrize("object_mps", [-3.0, -0.5, 0.0, 4.0])
def test_a_needed_gap_is_what_is_just_enough(object_mps: float) -> None:
    """Integrated: after the dead time the ego brakes until it is as slow, or stands before who comes."""
    ego, dead, decel = 12.0, 0.3, 3.8
    [gap] = Staged().needed_m(ego, np.array([object_mps]), decel, dead)
    times = np.arange(0.0, 8.0, 1e-4)
    speed = np.maximum(ego - decel * np.maximum(times - dead, 0.0), 0.0)
    moves = speed > max(object_mps, 0.0)
    closed = float(((speed - object_mps)[moves]).sum()) * 1e-4
    assert gap == pytest.approx(closed, abs=0.01)


def test_the_dead_time_is_as_long_as_what_delay_and_build_up_lose() -> None:
    """Against the vehicle's brakes, which are tested against an integration: 3.8 m/s2 from 15 m/s."""
    brakes, rule = PHYSICAL.brakes, Staged()
    way = brakes.travel(15.0, 0.0, 60.0, brakes.requested(3.8))[0]
    [needed] = rule.needed_m(15.0, np.zeros(1), 3.8, rule.dead_s(3.8))
    ramp_s = 0.4 * 3.8 / 8.8
    assert needed - way == pytest.approx(3.8 * ramp_s**2 / 24, abs=1e-9)  # all that is left out
    assert rule.dead_s(3.8, 0.1) == pytest.approx(rule.dead_s(3.8) - 0.1)
    assert rule.dead_s(3.8, 1.0) == 0.0


def test_a_pedestrian_who_crosses_is_braked_for_before_entering_the_way() -> None:
    """At 40 km/h, to be hit in the middle: 2.0 s before, still 2.6 m beside the middle of the path."""
    speed = 40 * KMH

    def crossing(gap_m: float) -> Assessment:
        beside = -WALK_MPS * (gap_m + 2.2 + 0.25 - 2.2) / speed
        return seen(frame(speed, gap_m, offset_m=beside, velocity_mps=(0.0, WALK_MPS), **PEDESTRIAN))

    gap = first_gap_m(lambda gap_m: asked(RULE, crossing(gap_m))[1] >= 3.8)
    dead = 0.25 + 0.4 * 3.8 / 8.8 / 2
    assert gap == pytest.approx(1.0 + speed * dead + speed**2 / 7.6, abs=1e-6)
    assert WALK_MPS * gap / speed > 0.9 + 0.25 + 1.0
    # whose forecast passes behind the ego, or who does not count, is none
    behind = frame(speed, gap / 2, offset_m=-6.0, velocity_mps=(0.0, WALK_MPS), **PEDESTRIAN)
    assert asked(RULE, seen(behind)) == (False, 0.0)
    assert asked(RULE, seen(replace(crossing(gap / 2), counts=np.array([False])))) == (False, 0.0)


def test_the_margin_begins_every_stage_earlier() -> None:
    """By so much time."""
    later, speed = replace(RULE, staged_margin_s=0.25), 30 * KMH

    def gaps_m(rule: Staged) -> list[float]:
        def at(gap_m: float) -> tuple[bool, float]:
            return asked(rule, seen(frame(speed, gap_m)))

        return [
            first_gap_m(lambda gap: at(gap)[0], 24.0),
            first_gap_m(lambda gap: at(gap)[1] >= 3.8, 24.0),
            first_gap_m(lambda gap: at(gap)[1] > 3.8, 24.0),
        ]

    assert np.subtract(gaps_m(later), gaps_m(RULE)) == pytest.approx([0.25 * speed] * 3)


# --- in a closed loop with the brakes of the preset -------------------------------------------------------

Motion = Callable[[float], tuple[float, float]]
"""Place of an object's rear and its speed along the path, at a time."""


def driven(
    rule: Staged, speed_mps: float, motion: Motion, duration_s: float, seen_s: tuple[float, float] = (0, 99)
) -> dict[str, np.ndarray]:
    """The ego's front begins at 0; it keeps its speed but for the rule's brake.

    Returns:
        Per frame: time_s, speed_mps, gap_m, decel_mps2 that is asked for (full: 8.8).
    """
    drive = EgoDrive(PHYSICAL.brakes, 4.4, adapts=False, driver=None)
    drive.speed_mps = speed_mps
    state, place, rows = None, 0.0, []
    for k in range(round(duration_s / FRAME_S)):
        now_s = k * FRAME_S
        rear, along = motion(now_s)
        visible = seen_s[0] <= now_s < seen_s[1]
        current = frame(
            drive.speed_mps, rear - place, stamp_s=now_s, velocity_mps=(along, 0.0), counts=visible
        )
        state, command, _ = rule.decide(state, seen(current))
        decel = (command.decel_mps2 or 8.8) if command.emergency else 0.0
        rows.append((now_s, drive.speed_mps, rear - place, decel))
        drive.control(
            now_s, command.emergency, None, drive.speed_mps, Asked(drive.speed_mps), command.decel_mps2
        )
        place += drive.motion(now_s, FRAME_S).distance_m
        drive.advance(now_s, FRAME_S)
    columns = np.array(rows).T
    return dict(zip(("time_s", "speed_mps", "gap_m", "decel_mps2"), columns, strict=True))


@pytest.mark.parametrize("speed_kmh", [10, 20, 30, 40, 50, 60])
def test_the_partial_brake_stops_before_a_standing_car(speed_kmh: float) -> None:
    """A metre before it, and at most what a frame drives more; never harder than the first stage."""
    speed = speed_kmh * KMH
    run = driven(RULE, speed, lambda time: (55.0, 0.0), 55.0 / speed + 6.0)
    assert run["speed_mps"][-1] == 0.0
    assert 1.0 <= run["gap_m"][-1] <= 1.0 + speed * FRAME_S + 0.02
    assert set(run["decel_mps2"].tolist()) == {0.0, 3.8}
    braked = run["decel_mps2"] > 0.0
    assert braked[braked.argmax() :].all()  # held at standstill


def test_it_is_let_go_when_the_lead_accelerates_away() -> None:
    """At 50 km/h, 12 m behind a car at 20 km/h that accelerates with 3 m/s2 to 60 km/h."""

    def lead(time_s: float) -> tuple[float, float]:
        along = min(20 * KMH + 3.0 * time_s, 60 * KMH)
        return 12.0 + along * time_s - 1.5 * min(time_s, 40 * KMH / 3.0) ** 2, along

    run = driven(RULE, 50 * KMH, lead, 8.0)
    assert run["gap_m"].min() > 0.0
    braked = run["decel_mps2"] > 0.0
    assert braked.any()
    last = run["time_s"][braked].max()
    assert run["speed_mps"].min() > 20 * KMH  # long before standstill
    # the ego has become slower than the lead before; then the time without a reason runs
    level = next(time for time, v in zip(run["time_s"], run["speed_mps"], strict=True) if v <= lead(time)[1])
    assert last <= level + RULE.clear_s + 2 * FRAME_S
    assert not braked[run["time_s"] > last].any()


def test_a_ghost_of_a_third_of_a_second_costs_what_its_brakes_give_in_that_time() -> None:
    """Seen for 0.3 s at 50 km/h 25 m ahead: a partial brake for 0.3 s and the time without a reason."""
    speed = 50 * KMH
    run = driven(RULE, speed, lambda time: (39.0, 0.0), 4.0, (1.0, 1.3))
    braked = run["time_s"][run["decel_mps2"] > 0.0]
    assert braked[0] == pytest.approx(1.0)
    assert braked[-1] + FRAME_S == pytest.approx(1.3 + RULE.clear_s, abs=FRAME_S + 1e-9)
    lasted = braked[-1] + FRAME_S - braked[0]
    left = PHYSICAL.brakes.travel(speed, 0.0, lasted, PHYSICAL.brakes.requested(3.8))[1]
    assert run["speed_mps"][-1] == pytest.approx(left, abs=1e-6)
    assert speed - left < 2.0  # m/s
    assert set(run["decel_mps2"].tolist()) == {0.0, 3.8}


# --- braking on, holding, letting go ----------------------------------------------------------------------


def test_a_threat_that_is_near_is_braked_for_until_it_is_half_as_far_again() -> None:
    """1.5 times the gap at which the partial brake begins, at the same speed."""
    speed = 10.0
    gap = 1.0 + speed * RULE.dead_s(3.8) + speed**2 / 7.6
    state, command, _ = RULE.decide(None, seen(frame(speed, gap - 0.01)))
    assert command.emergency
    for factor, released in ((1.49, False), (1.51, True)):
        after, out = state, []
        for k in range(1, 12):
            after, command, _ = RULE.decide(after, seen(frame(speed, factor * gap, stamp_s=FRAME_S * k)))
            out.append(command.emergency)
        assert (not out[-1]) is released


def test_at_standstill_it_is_held_while_the_way_is_not_free() -> None:
    stopping = [seen(frame(3.0, 0.5))]
    standing = [frame(0.0, 0.4, stamp_s=FRAME_S * k) for k in range(1, 60)]
    entering = [replace(free(0.0, FRAME_S * k), entering=np.array([True])) for k in range(60, 80)]
    gone = [free(0.0, FRAME_S * k) for k in range(80, 100)]
    out = decided(RULE, [*stopping, *standing, *entering, *gone])
    braked = [command.emergency for command, _ in out]
    assert braked.index(False) == pytest.approx(80 + RULE.clear_s / FRAME_S, abs=1)
    tail = [event.name for _, events in out for event in events][-3:]
    assert tail == ["free_lane", "end_unexpected", "follow_path"]


def test_a_warning_alone_ends_with_its_reason() -> None:
    out = decided(RULE, [seen(frame(10.0, 23.0)), free(10.0, 0.05)])
    assert [(c.warning, c.emergency) for c, _ in out] == [(True, False), (False, False)]


objects = st.lists(
    st.fixed_dictionaries(
        {
            "gap_m": st.floats(-6.0, 60.0),
            "offset_m": st.floats(-8.0, 8.0),
            "velocity_mps": st.tuples(st.floats(-15.0, 15.0), st.floats(-3.0, 3.0)),
            "counts": st.booleans(),
        }
    ),
    min_size=1,
    max_size=3,
)
histories = st.lists(st.tuples(st.floats(0.0, 20.0), objects), min_size=1, max_size=12)


def frames_of(history: Sequence[tuple[float, list[dict[str, Any]]]]) -> list[Assessment]:
    return [seen(scene(speed, others, stamp_s=FRAME_S * k)) for k, (speed, others) in enumerate(history)]


@given(histories)
def test_no_weaker_brake_is_asked_for_while_more_is_needed(history: Any) -> None:
    """Whatever came before: as hard at least as a rule that begins to look in this frame with its brakes on.

    Between two frames without release the stage never falls, and whoever brakes warns.
    """
    state, before = None, 0.0
    for now in frames_of(history):
        begun = None if state is None else state.begun_s
        state, command, events = RULE.decide(state, now)
        decel = (command.decel_mps2 or math.inf) if command.emergency else 0.0
        fresh = RULE if begun is None else replace(RULE, delay_s=0.0, build_up_s=0.0)
        assert decel >= asked(fresh, now)[1]
        if not any(event.name == "free_lane" for event in events):
            assert decel >= before
        assert command.warning or not command.emergency
        before = decel


@given(histories, st.floats(1.0, 20.0))
def test_it_is_let_go_in_time_once_nothing_threatens(history: Any, speed: float) -> None:
    seen_frames = frames_of(history)
    last = FRAME_S * (len(seen_frames) - 1)
    quiet = [free(speed, last + FRAME_S * k) for k in range(1, 12)]
    commands = [command for command, _ in decided(RULE, [*seen_frames, *quiet])]
    after = commands[len(seen_frames) :]
    count = round(RULE.clear_s / FRAME_S)  # the first quiet frame begins the time
    assert not any(command.emergency or command.warning for command in after[count:])


@pytest.mark.parametrize(
    "change",
    [
        {"partial_mps2": 6.0}, {"partial_mps2": 0.0}, {"full_from_mps2": math.inf}, {"driver_mps2": 0.0},
        {"staged_margin_s": -0.1}, {"clear_s": math.nan}, {"release_factor": 0.9}, {"full_mps2": 0.0},
        {"stop_m": -1.0},
    ],
)  # fmt: skip
def test_impossible_parameters_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="staged: "):
        Staged(**change)
