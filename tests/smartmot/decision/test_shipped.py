"""The shipped rules against trigger points computed by hand from their published formulas."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmot import ConfigError
from smartmot.decision.autoware import AUTOWARE_README, Autoware
from smartmot.decision.cascade import CASCADE_GENTLE, Cascade
from smartmot.decision.r157 import R157
from smartmot.decision.required_deceleration import LAST_POINT_TO_BRAKE, RequiredDeceleration
from smartmot.decision.rss import Rss
from smartmot.decision.shipped import PAPER_RULE, RULES
from tests.smartmot.decision.frames import KMH, approach, decided, frame, free, scene

PEDESTRIAN: dict[str, Any] = {"size_m": (0.5, 0.5), "category": "pedestrian"}
WALK_MPS = 5 * KMH
STAGED = "staged"
"""It brakes by forecasts, as the paper's rule does: tests/smartmot/decision/test_staged.py."""
ALONG_PATH = [rule for name, rule in RULES.items() if name not in (PAPER_RULE, STAGED)]


def names(rule: Any) -> str:
    return str(rule.name)


def first_gap_m(rule: Any, speed_mps: float, above_m: float, what: str, **kwargs: Any) -> float:
    """Greatest gap to a standing car at which a rule brakes, warns, or asks for so much; bisected."""

    def fires(gap_m: float) -> bool:
        _, command, _ = rule.decide(None, frame(speed_mps, gap_m, **kwargs))
        if what == "warn":
            return bool(command.warning)
        decel = command.decel_mps2 or math.inf
        return bool(command.emergency) and decel >= float(what or 0.0)

    low, high = 0.0, above_m
    assert fires(low)
    assert not fires(high)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if fires(middle) else (low, middle)
    return low


# --- trigger points ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "what", "ttc_s"),
    [
        (Autoware(), "", (2.51, 3.39, 3.84)),
        (Rss(), "", (3.31, 3.85, 4.16)),
        (Cascade(), "warn", (3.28, 4.67, 5.37)),
        (Cascade(), "3.8", (2.19, 3.65, 4.39)),
        (Cascade(), "5.3", (1.57, 2.62, 3.14)),
        (Cascade(), "9.8", (0.85, 1.42, 1.70)),
        (RequiredDeceleration(), "", (0.69, 1.16, 1.39)),
        (RequiredDeceleration(9.0), "", (0.46, 0.77, 0.93)),
        (R157(), "", (1.5, 1.5, 1.5)),
        # 2.0 / 4.0 m/s2 with 0.25 s, warning 1.25 s: v/2 + 0.25, v/4 + 1.25
        (CASCADE_GENTLE, "2.0", (4.42, 7.19, 8.58)),
        (CASCADE_GENTLE, "warn", (4.42, 7.19, 8.58)),
        # delay 0.2 s, build-up 0.4 s, 8.8 m/s2: 0.4 s + v / 17.6 - 8.8 0.16 / (24 v)
        (LAST_POINT_TO_BRAKE, "", (0.87, 1.19, 1.34)),
        # v + v^2/6 + 2 is 21.9 m at 30 km/h, but the path reaches 1.5 s
        (AUTOWARE_README, "", (1.5, 1.5, 1.5)),
    ],
    ids=lambda value: value.name if hasattr(value, "name") else "",
)
def test_time_to_collision_at_which_each_fires_for_a_standing_car(
    rule: Any, what: str, ttc_s: tuple[float, ...]
) -> None:
    """Two decimals, worked out by hand from the published formulas, at 30, 50 and 60 km/h."""
    for speed_kmh, ttc in zip((30, 50, 60), ttc_s, strict=True):
        speed = speed_kmh * KMH
        gap = first_gap_m(rule, speed, 300.0, what)
        assert gap / speed == pytest.approx(ttc, abs=0.0051)


@pytest.mark.parametrize(
    ("rule", "ttc_s"),
    [(Cascade(), 3.65), (RequiredDeceleration(), 1.16), (Rss(), 3.85), (Autoware(), 3.39), (R157(), 1.5)],
    ids=lambda value: value.name if hasattr(value, "name") else "",
)
def test_in_a_sweep_of_frames_it_fires_there_and_brakes_on(rule: Any, ttc_s: float) -> None:
    speed = 50 * KMH
    frames = approach(speed, 60.0, step_s=0.01)
    out = decided(rule, frames)
    braked = [command.emergency for command, _ in out]
    first = braked.index(True)
    assert float(frames[first].path_gap_m[0]) / speed == pytest.approx(ttc_s, abs=0.016)
    assert all(braked[first:])
    names_of = [event.name for _, events in out for event in events if event.name != "warning"]
    assert names_of == ["run_start", "follow_path", "unexpected", "collision", "predicted_collision"]


@pytest.mark.parametrize("lead_mps", [5.0, 10.0])
def test_behind_a_moving_car(lead_mps: float) -> None:
    """At 15 m/s; dv is the closing speed.

    Cascade: gap < dv v / 3.8. Required deceleration: dv^2 / 12. RSS: 15 + 1.75 + 18.5^2 / 8 - vf^2 / 16.
    Autoware: 15 + 37.5 + 1 - vo^2 / 2. R157: 1.5 dv.
    """
    closing = 15.0 - lead_mps
    expected = {
        Cascade(): closing * 15.0 / 3.8,
        RequiredDeceleration(): closing**2 / 12,
        Rss(): 15.0 + 1.75 + 18.5**2 / 8 - lead_mps**2 / 16,
        Autoware(): 53.5 - lead_mps**2 / 2,
        R157(): 1.5 * closing,
    }
    for rule, gap in expected.items():
        found_m = first_gap_m(rule, 15.0, 200.0, "", velocity_mps=(lead_mps, 0.0))
        assert found_m == pytest.approx(gap, abs=1e-6), rule.name


@pytest.mark.parametrize("rule", [Cascade(), RequiredDeceleration(), R157()], ids=names)
def test_who_drives_away_is_no_reason_to_brake(rule: Any) -> None:
    for gap in (0.5, 2.0, 5.0):
        assert not rule.decide(None, frame(10.0, gap, velocity_mps=(11.0, 0.0)))[1].emergency


@pytest.mark.parametrize("rule", ALONG_PATH, ids=names)
def test_what_does_not_count_or_is_beside_or_behind_is_no_target(rule: Any) -> None:
    for now in (
        frame(15.0, 3.0, counts=False),
        frame(15.0, 3.0, offset_m=3.5),  # a lane aside, 1.7 m free
        frame(15.0, 3.0, offset_m=-3.5),
        frame(15.0, -12.0),
    ):
        _, command, _ = rule.decide(None, now)
        assert (command.emergency, command.warning) == (False, False)
    assert rule.decide(None, frame(15.0, 3.0))[1].emergency


# --- braking on, holding, letting go ----------------------------------------------------------------------


@pytest.mark.parametrize("rule", ALONG_PATH, ids=names)
def test_it_holds_at_standstill_until_the_path_is_free(rule: Any) -> None:
    """Held as long as the object is within 12 m, then let go after 0.15 s; Autoware keeps on for 3 s."""
    keep_s = 3.0 if isinstance(rule, Autoware) else 0.0
    moving = [frame(3.0, 0.5, stamp_s=0.0)]
    standing = [frame(0.0, 0.4, stamp_s=0.05 * k) for k in range(1, 100)]
    gone = [free(0.0, 0.05 * k) for k in range(100, 200)]
    out = decided(rule, [*moving, *standing, *gone])
    braked = [command.emergency for command, _ in out]
    released_s = max(5.0, keep_s + 0.05) + 0.15
    assert braked.index(False) == pytest.approx(released_s / 0.05, abs=1)
    assert not any(braked[braked.index(False) :])
    tail = [event.name for _, events in out for event in events][-3:]
    assert tail == ["free_lane", "end_unexpected", "follow_path"]


@pytest.mark.parametrize("rule", ALONG_PATH, ids=names)
def test_what_goes_away_while_the_ego_moves(rule: Any) -> None:
    """RSS lets go once it is safe, Autoware 3.0 s after the last prediction, the others at standstill."""
    frames = [frame(10.0, 2.0), *(free(10.0, 0.05 * k) for k in range(1, 101))]
    braked = [command.emergency for command, _ in decided(rule, frames)]
    released = {"rss": 0.05 + 0.15, "autoware": 3.05 + 0.15, "autoware_readme": 3.05 + 0.15}.get(rule.name)
    if released is None:
        assert all(braked)
    else:
        assert braked.index(False) == pytest.approx(released / 0.05, abs=1)


def test_the_cascade_goes_through_its_stages_and_never_back() -> None:
    """At 50 km/h: warning at 4.67 s, then 3.8, 5.3 and 9.8 m/s2; with the gap opening again it stays."""
    speed = 50 * KMH
    frames = approach(speed, 70.0, step_s=0.01)
    out = decided(Cascade(), frames)
    asked = [command.decel_mps2 for command, _ in out]
    stages = [a for a, b in zip(asked, [0.0, *asked], strict=False) if a != b]
    assert stages == [None, 3.8, 5.3, 9.8]
    warned = [command.warning for command, _ in out]
    assert all(warned[warned.index(True) :])
    assert sum(event.name == "warning" for _, events in out for event in events) == 1
    again = decided(Cascade(), [frame(speed, 1.2 * speed), frame(speed, 3.0 * speed, stamp_s=0.05)])
    assert [command.decel_mps2 for command, _ in again] == [9.8, 9.8]


def test_a_warning_alone_ends_with_its_reason() -> None:
    out = decided(Cascade(), [frame(10.0, 30.0), free(10.0, 0.05), frame(10.0, 30.0, stamp_s=0.1)])
    assert [(c.warning, c.emergency) for c, _ in out] == [(True, False), (False, False), (True, False)]


# --- a pedestrian who crosses -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "beside_m"),
    [
        # in the width of 1.8 m once the centre is 0.9 + 0.25 m beside the middle
        (RequiredDeceleration(), 1.15),
        (LAST_POINT_TO_BRAKE, 1.15),
        (Autoware(expand_width_m=0.0), 1.15),
        # the centre in a lane of 3.6 m
        (Cascade(), 1.8),
        (CASCADE_GENTLE, 1.8),
    ],
    ids=lambda value: value.name if hasattr(value, "name") else "",
)
def test_a_pedestrian_who_crosses_is_a_target_on_entering_the_swept_width_or_lane(
    rule: Any, beside_m: float
) -> None:
    """At 5 km/h from the right."""
    step_s = 0.01
    frames = [
        frame(
            10.0, 2.0, stamp_s=step_s * k, offset_m=-4.0 + WALK_MPS * step_s * k,
            velocity_mps=(0.0, WALK_MPS), **PEDESTRIAN,
        )
        for k in range(400)
    ]  # fmt: skip
    braked = [command.emergency for command, _ in decided(rule, frames)]
    enters = (4.0 - beside_m) / WALK_MPS / step_s
    assert braked.index(True) == pytest.approx(enters, abs=1)


def test_the_cascade_takes_the_nearest_object_of_its_lane() -> None:
    """A car that drives as fast as the ego hides the standing one behind it, until it leaves the lane."""
    near, far = {"gap_m": 10.0, "velocity_mps": (10.0, 0.0)}, {"gap_m": 14.5}
    assert not Cascade().decide(None, scene(10.0, [near, far]))[1].emergency
    assert Cascade().decide(None, scene(10.0, [{**near, "offset_m": 1.81}, far]))[1].emergency
    assert not Cascade().decide(None, scene(10.0, [near, {**far, "counts": False}]))[1].emergency


@pytest.mark.parametrize(("from_m", "braked"), [(0.89, True), (0.91, False)])
def test_the_cascade_takes_a_vehicle_that_crosses_once_its_front_is_in_the_swept_width(
    from_m: float, braked: bool
) -> None:
    """4.5 m long: its centre is 2.25 m farther, outside of the lane."""
    crossing_car = {
        "gap_m": 5.0,
        "size_m": (1.8, 4.5),
        "offset_m": from_m + 2.25,
        "velocity_mps": (0.0, -5.0),
    }
    assert Cascade().decide(None, scene(10.0, [crossing_car]))[1].emergency is braked


def test_autoware_waits_until_the_narrower_published_width_is_entered() -> None:
    aside = (-0.9 - 0.25 + 0.2) + 0.01
    now = [
        frame(5.0, 3.0, offset_m=o, velocity_mps=(0.0, WALK_MPS), **PEDESTRIAN) for o in (aside - 0.02, aside)
    ]
    assert [Autoware().decide(None, n)[1].emergency for n in now] == [False, True]


def test_autoware_takes_the_median_speed_of_the_last_second() -> None:
    """Four frames at 10 m/s outvote one at 0: 13.5 - 50 m; a second later the standing car counts as such."""
    lead = [frame(10.0, 20.0, stamp_s=0.1 * k, velocity_mps=(10.0, 0.0)) for k in range(4)]
    stopped = [frame(10.0, 20.0, stamp_s=0.4 + 0.1 * k) for k in range(12)]
    braked = [command.emergency for command, _ in decided(Autoware(), [*lead, *stopped])]
    # 0.4 to 0.7 s: of 5 to 8 speeds at least half are 10 m/s; (0 + 10) / 2 at 0.7 s: 27.7 - 12.5 = 15.2 m
    assert braked.index(True) == 8
    assert Autoware().distance_m(10.0, 0.0) == pytest.approx(10 + 100 / 6 + 1)
    assert Autoware().distance_m(10.0, -2.0) == pytest.approx(10 + 100 / 6 + 1 + 2)


def test_autoware_is_off_below_a_tenth_of_a_metre_per_second() -> None:
    assert not Autoware().decide(None, frame(0.05, 0.1))[1].emergency
    assert Autoware().decide(None, frame(0.15, 0.1))[1].emergency


# --- RSS --------------------------------------------------------------------------------------------------


def test_safe_distances_by_hand() -> None:
    """Ego at 10 m/s: 10 + 1.75 + 13.5^2 / 8 = 34.53125 m to what stands; behind 8 m/s 64 / 16 = 4 m less.

    Oncoming at 8 m/s: own lane 10 + 1.75 + 13.5^2 / 6 = 42.125 m; the other 16 + 7 + 15^2 / 8 = 51.125 m.
    """
    rss, no, yes = Rss(), np.array([False]), np.array([True])
    assert rss.along_m(10.0, np.zeros(1), no) == pytest.approx([34.53125])
    assert rss.along_m(10.0, np.array([8.0]), no) == pytest.approx([30.53125])
    assert rss.along_m(10.0, np.array([-8.0]), yes) == pytest.approx([42.125 + 51.125])
    assert rss.along_m(1.0, np.array([30.0]), no) == pytest.approx([0.0])
    # across: ego 0.1 + 0.04 / 1.6 = 0.125; standing 0.4 + 0.16 / 1.6 = 0.5; margin 0.1
    assert rss.aside_m(np.zeros(1)) == pytest.approx([0.725])
    # at 1.4 m/s: 2.8 + 0.4 + 1.8^2 / 1.6 = 5.225; away at 1.4: -2.8 + 0.4, less than none
    assert rss.aside_m(np.array([1.4, -1.4])) == pytest.approx([0.1 + 0.125 + 5.225, 0.1])


@given(st.floats(0.0, 40.0), st.floats(0.0, 40.0), st.floats(0.0, 3.0))
def test_at_the_safe_distance_the_stated_braking_ends_behind_the_lead(
    ego_mps: float, lead_mps: float, response_s: float
) -> None:
    """The definition: the one ahead brakes with 8 m/s2; the ego accelerates, then brakes with 4 m/s2."""
    rss = Rss(rss_response_s=response_s)
    [safe] = rss.along_m(ego_mps, np.array([lead_mps]), np.array([False]))
    after = ego_mps + 3.5 * response_s
    ego_m = (ego_mps + after) / 2 * response_s + after**2 / 8
    assert safe == pytest.approx(max(ego_m - lead_mps**2 / 16, 0.0), abs=1e-9)


def test_rss_needs_both_distances_to_be_unsafe() -> None:
    beside = {"velocity_mps": (0.0, WALK_MPS), **PEDESTRIAN}
    free_m = float(Rss().aside_m(np.array([WALK_MPS]))[0])
    at = 0.9 + 0.25 + free_m
    assert Rss().decide(None, frame(10.0, 30.0, offset_m=-at + 0.01, **beside))[1].emergency
    assert not Rss().decide(None, frame(10.0, 30.0, offset_m=-at - 0.01, **beside))[1].emergency
    assert not Rss().decide(None, frame(10.0, 35.0, offset_m=-at + 0.01, **beside))[1].emergency
    assert Rss().decide(None, frame(10.0, 30.0))[1].decel_mps2 == 8.0


def test_oncoming_traffic_is_that_of_vehicles() -> None:
    oncoming = {"velocity_mps": (-8.0, 0.0)}
    assert Rss().decide(None, frame(10.0, 93.0, **oncoming))[1].emergency
    assert not Rss().decide(None, frame(10.0, 93.5, **oncoming))[1].emergency
    assert not Rss().decide(None, frame(10.0, 35.0, velocity_mps=(-1.4, 0.0), **PEDESTRIAN))[1].emergency


# --- UN R157 ----------------------------------------------------------------------------------------------


def crossing(first_m: float, speed_mps: float, gap_m: float, **kwargs: Any) -> list[Any]:
    """Someone who comes from the right to the path at walking speed while the ego closes in, 50 ms apart."""
    return [
        frame(
            speed_mps, gap_m - speed_mps * 0.05 * k, stamp_s=0.05 * k, offset_m=first_m + WALK_MPS * 0.05 * k,
            velocity_mps=(0.0, WALK_MPS), **kwargs,
        )
        for k in range(int(gap_m / speed_mps / 0.05))
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("gap_m", "brakes_s"),
    [
        (23.0, 1.15),  # 1.9 s after 0.4 s: a risk; 0.75 s later the foot is on the brake
        (25.0, 1.55),  # 2.1 s after 0.4 s: none; 1.7 s after 0.8 s
        (39.0, 2.75),  # 2.3 s after 1.6 s: none; 1.9 s after 2.0 s
    ],
)
def test_the_driver_brakes_for_a_pedestrian_after_evaluation_and_delay(gap_m: float, brakes_s: float) -> None:
    """At 10 m/s; evaluated every 0.4 s until the time to collision is below 2 s, then 0.75 s."""
    out = [c for c, _ in decided(R157(), crossing(-9.0, 10.0, gap_m, **PEDESTRIAN))]
    at = [c.emergency for c in out].index(True)
    assert at == round(brakes_s / 0.05)
    assert out[at].decel_mps2 == pytest.approx(0.774 * 9.81)


@pytest.mark.parametrize("kind", [{}, {**PEDESTRIAN, "category": "cyclist"}], ids=["car", "cyclist"])
def test_the_driver_sees_who_is_no_pedestrian_once_it_has_wandered_in_the_next_lane(kind: Any) -> None:
    """0.375 m at 5 km/h take 0.27 s, 0.3 s in frames: so much later than for a pedestrian."""
    near = [c.emergency for c, _ in decided(R157(), crossing(-5.0, 10.0, 23.0, **kind))]
    assert near.index(True) == round((0.3 + 1.15) / 0.05)
    # from 9 m aside 5.25 m are reached after 2.7 s, the contact would be after 2.3 s
    assert not any(c.emergency for c, _ in decided(R157(), crossing(-9.0, 10.0, 23.0, **kind)))


def test_the_emergency_brake_of_r157() -> None:
    command = R157().decide(None, frame(10.0, 14.9))[1]
    assert (command.emergency, command.decel_mps2) == (True, pytest.approx(0.85 * 9.81))
    assert not R157().decide(None, frame(10.0, 15.1))[1].emergency
    # a walker who has not come into the width yet is the driver's alone
    beside = frame(10.0, 10.0, offset_m=-2.0, velocity_mps=(0.0, WALK_MPS), **PEDESTRIAN)
    assert not R157().decide(None, beside)[1].emergency


# --- parameters -------------------------------------------------------------------------------------------


@given(st.floats(0.5, 40.0), st.floats(0.0, 0.5), st.floats(0.0, 1.0), st.floats(1.0, 12.0))
def test_the_last_point_to_brake_is_the_way_of_the_brakes(
    speed: float, delay: float, build_up: float, decel: float
) -> None:
    """The same closed form as the vehicle's brakes, which are tested against an integration."""
    from scenarios.brakes import BrakeConfig

    rule = RequiredDeceleration(decel, delay, build_up)
    way = BrakeConfig(delay, build_up, decel).travel(speed, 0.0, 200.0)[0]
    assert rule.needed_m(np.array([speed, -speed])) == pytest.approx([way, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    "change",
    [
        lambda: Cascade(partial1_mps2=6.0),
        lambda: Cascade(cascade_margin_s=-0.1),
        lambda: Cascade(lane_width_m=0.0),
        lambda: RequiredDeceleration(0.0),
        lambda: RequiredDeceleration(6.0, -0.1),
        lambda: Rss(rss_response_s=-1.0),
        lambda: Rss(brake_min_mps2=0.0),
        lambda: Autoware(ego_brake_mps2=-3.0),
        lambda: Autoware(keep_s=-1.0),
        lambda: R157(r157_ttc_s=math.nan),
        lambda: R157(driver_mps2=9.0),
    ],
)
def test_impossible_parameters_are_refused(change: Any) -> None:
    with pytest.raises(ConfigError):
        change()


@pytest.mark.parametrize(
    ("rule", "earlier"),
    [
        (Cascade(), {"cascade_margin_s": 0.5}),
        (RequiredDeceleration(), {"required_decel_mps2": 4.0}),
        (Rss(), {"rss_response_s": 1.5}),
        (Autoware(), {"autoware_response_s": 1.1}),
        (R157(), {"r157_ttc_s": 2.0}),
    ],
)
def test_the_trigger_parameter_moves_the_trigger(rule: Any, earlier: dict[str, float]) -> None:
    usual = first_gap_m(rule, 15.0, 200.0, "")
    assert first_gap_m(replace(rule, **earlier), 15.0, 200.0, "") > usual + 1.0


def test_names_are_unique_and_those_of_the_table() -> None:
    named = {name: rule for name, rule in RULES.items() if name != PAPER_RULE}
    assert [str(getattr(rule, "name", "")) for rule in named.values()] == list(named)


def test_the_page_of_rules_names_them_all_and_its_code_runs() -> None:
    page = (Path(__file__).parents[3] / "docs" / "rules.md").read_text()
    for name in RULES:
        assert f"| `{name}` |" in page
    [source] = re.findall(r"```python\n(.*?)```", page, re.S)
    made: dict[str, Any] = {}
    exec(source, made)
    assert made["late"] == Cascade(full_mps2=7.0)
