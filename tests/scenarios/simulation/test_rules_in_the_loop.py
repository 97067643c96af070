"""Shipped brake rules in the closed loop, with perfect detections, against closed forms."""

import dataclasses
import math

import numpy as np
import pytest

from scenarios.brakes import BrakeConfig
from scenarios.presets import PHYSICAL
from scenarios.settings import preset_with
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from smartmot import EverythingArea
from smartmot.types import Boxes, Detections
from tests.scenarios.simulation.test_simulation import LANE_Y_M, Other, definition

KMH = 1 / 3.6
FRAME_S = 0.05
PERFECT = dataclasses.replace(
    PHYSICAL, sensor=dataclasses.replace(PHYSICAL.sensor, range_m=150.0, position_sigma_m=0.0)
)
SPEED_MPS = 50 * KMH


def driven(rule: str, other: Other, speed_kmh: float = 50.0, **settings: float) -> Outcome:
    """The ego's front begins at 100 m; it holds its speed until it brakes."""
    preset = preset_with(PERFECT, (*settings.items(), ("rule", rule)))
    return Simulation(
        definition(speed_kmh, [other]), preset, lambda view: EverythingArea(), adapts=False
    ).run()


def standing_car(gap_m: float) -> Other:
    return Other("car", 100.0 + gap_m + 2.2, LANE_Y_M)


@pytest.mark.parametrize(
    ("rule", "ttc_s"),
    [
        ("cascade", 3.65),
        ("required_deceleration", 1.16),
        ("rss", 3.85),
        ("autoware", 3.39),
        ("r157", 1.5),
        # 0.45 s + v / 17.6 - 8.8 0.16 / (24 v): with a frame before it
        ("last_point_to_brake", 1.235),
        # 0.25 s + 0.4 s 3.8 / 17.6 + 1 m / v + v / 7.6
        ("staged", 2.236),
    ],
)
def test_for_a_standing_car_each_brakes_at_its_published_time_to_collision(rule: str, ttc_s: float) -> None:
    """50 km/h; the first frame after that time, of frames 0.05 s apart."""
    outcome = driven(rule, standing_car(90.0))
    assert outcome.flag_ttc_s is not None
    assert ttc_s - FRAME_S - 0.006 <= outcome.flag_ttc_s <= ttc_s + 0.006
    if rule == "cascade":
        assert outcome.warning_ttc_s == pytest.approx(4.67 - FRAME_S / 2, abs=FRAME_S / 2 + 0.006)
    elif rule == "staged":  # 1.2 s + 1 m / v + v / 8 are 3.01 s; forecasts reach 3 s, in steps of 0.1 s
        assert outcome.warning_ttc_s == pytest.approx(3.0, abs=0.1 + FRAME_S)
    else:
        assert outcome.warning_time_s is None


def test_the_first_stage_of_the_cascade_suffices_for_a_standing_car() -> None:
    """3.8 m/s2 from v^2 / 3.8 on stop in half of that; how far from the car is a closed form."""
    outcome = driven("cascade", standing_car(90.0))
    assert outcome.avoided
    assert outcome.peak_decel_mps2 == pytest.approx(3.8)
    assert outcome.flag_distance_m is not None
    brakes = PHYSICAL.brakes
    way_m = brakes.travel(SPEED_MPS, 0.0, 60.0, brakes.requested(3.8))[0]
    assert outcome.stop_gap_m == pytest.approx(outcome.flag_distance_m - way_m, abs=1e-3)


def test_the_required_deceleration_of_6_is_too_late_for_brakes_with_build_up() -> None:
    """v^2 / 12 is 16.1 m at 50 km/h; these brakes need 16.5 m, and up to a frame is lost."""
    late, last = (
        driven(rule, standing_car(90.0)) for rule in ("required_deceleration", "last_point_to_brake")
    )
    assert not late.avoided
    assert late.flag_distance_m is not None
    over_m = PHYSICAL.brakes.travel(SPEED_MPS, 0.0, 60.0)[0] - late.flag_distance_m
    assert late.impact_speed_mps == pytest.approx(math.sqrt(2 * 8.8 * over_m), abs=0.02)
    assert last.avoided
    assert last.stop_gap_m is not None
    assert 0.0 <= last.stop_gap_m <= SPEED_MPS * FRAME_S
    assert last.peak_decel_mps2 == pytest.approx(8.8)


def test_behind_a_slower_car() -> None:
    """At 50 behind 20 km/h: the cascade at dv v / 3.8 = 30.5 m, the required deceleration at dv^2 / 12."""
    closing = 30 * KMH
    for rule, gap in (("cascade", closing * SPEED_MPS / 3.8), ("required_deceleration", closing**2 / 12)):
        lead = dataclasses.replace(standing_car(60.0), speed_mps=20 * KMH)
        outcome = driven(rule, lead)
        assert outcome.flag_distance_m is not None
        assert gap - closing * FRAME_S - 0.1 <= outcome.flag_distance_m <= gap + 0.1


@pytest.mark.parametrize("rule", ["cascade", "required_deceleration", "last_point_to_brake", "autoware"])
def test_a_pedestrian_who_crosses_sets_it_off_on_entering_the_swept_width(rule: str) -> None:
    """5 km/h from 4 m aside, to be hit in the middle at 40 km/h: the width is entered at a distance of
    0.9 + 0.25 m from the middle, 0.83 s before the contact; Autoware's is narrower by 0.2 m per side, and the
    cascade's is a lane of 3.6 m, in which the middle of the pedestrian must be."""
    walk, speed = 5 * KMH, 40 * KMH
    walk_s = 4.0 / walk
    line_m = 100.0 + 60.0
    other = Other(
        "pedestrian", line_m + 0.25, LANE_Y_M - 4.0, math.pi / 2, 0.5, 0.5, walk, 60.0 - speed * walk_s
    )
    outcome = driven(rule, other, 40.0)
    entered_m = {"autoware": 0.9 + 0.25 - 0.2, "cascade": 1.8}.get(rule, 0.9 + 0.25)
    enters_s = 60.0 / speed - entered_m / walk
    least_s = 60.0 / speed - 40 * KMH / 12  # when 6 m/s2 are needed
    if rule == "required_deceleration":
        enters_s = max(enters_s, least_s)
    assert outcome.flag_time_s == pytest.approx(enters_s + FRAME_S / 2, abs=FRAME_S + 0.03)


def test_the_staged_rule_brakes_for_a_pedestrian_long_before_the_swept_width_is_entered() -> None:
    """The same pedestrian: at 1 m + v (0.25 + 0.086 s) + v^2 / 7.6 before the line, 1.9 s before the contact;
    the partial brake lets the pedestrian pass, and the ego drives on without having stood."""
    walk, speed = 5 * KMH, 40 * KMH
    walk_s = 4.0 / walk
    other = Other("pedestrian", 160.25, LANE_Y_M - 4.0, math.pi / 2, 0.5, 0.5, walk, 60.0 - speed * walk_s)
    outcome = driven("staged", other, 40.0)
    needed_m = 1.0 + speed * (0.25 + 0.4 * 3.8 / 17.6) + speed**2 / 7.6
    begins_s = (60.0 - needed_m) / speed
    assert outcome.flag_time_s == pytest.approx(begins_s + FRAME_S / 2, abs=FRAME_S / 2 + 0.03)
    assert outcome.avoided
    assert outcome.peak_decel_mps2 == pytest.approx(3.8)
    table = outcome.log.table()
    speed_mps = table["speed_mps"][table["kind"] == "ego"]
    assert speed_mps.min() > 0.1


def test_the_staged_rule_lets_go_of_a_ghost_and_the_papers_rule_stands() -> None:
    """A pedestrian on the path who is detected for 0.3 s, 15 m ahead at 50 km/h, and then never again."""
    slowest = {}
    for rule in ("paper", "staged"):
        preset = preset_with(PERFECT, (("rule", rule),))
        run = Simulation(definition(50.0, []), preset, lambda view: EverythingArea(), adapts=False)
        perception, step, last_threat_s, braked = run.perception(), run.start(), -math.inf, []
        while step.frame is not None and step.frame.stamp_s < 6.0:
            frame = step.frame
            if 1.0 <= frame.detections.stamp_s < 1.3:
                boxes = Boxes(
                    np.array([[100.0 + SPEED_MPS + 15.25, LANE_Y_M]]), np.full((1, 2), 0.5), np.zeros(1)
                )
                ghost = Detections(frame.detections.stamp_s, boxes, np.ones(1), np.array(["pedestrian"]))
                frame = dataclasses.replace(frame, detections=ghost)
            result = perception.step(frame)
            if len(result.threats):
                last_threat_s = frame.stamp_s
            braked += [frame.stamp_s] * result.command.emergency
            run.record(result)
            slowest[rule] = min(slowest.get(rule, math.inf), frame.ego.speed_mps)
            step = run.step(result.command)
        if rule == "staged":
            assert braked[-1] <= last_threat_s + 0.4 + FRAME_S
    assert slowest["paper"] == 0.0
    assert slowest["staged"] > 0.5 * SPEED_MPS


def test_the_trigger_parameter_brakes_earlier() -> None:
    usual = driven("cascade", standing_car(90.0))
    earlier = driven("cascade", standing_car(90.0), cascade_margin_s=0.5)
    assert usual.flag_ttc_s is not None
    assert earlier.flag_ttc_s == pytest.approx(usual.flag_ttc_s + 0.5, abs=1e-6)


def test_the_papers_rule_with_a_braking_factor() -> None:
    """Its planned braking distance at 50 km/h is 26.49 m from the centre; one and a half of it is 39.7 m."""
    for factor, distance in ((1.0, 26.49), (1.5, 39.73)):
        outcome = driven("paper", standing_car(90.0), braking_factor=factor)
        assert outcome.flag_distance_m is not None
        assert -SPEED_MPS * FRAME_S <= outcome.flag_distance_m + 2.2 - distance <= 0.01


def test_brakes_that_give_less_than_is_asked_give_what_they_can() -> None:
    weak = dataclasses.replace(PERFECT, brakes=BrakeConfig(0.2, 0.4, 3.0))
    preset = preset_with(weak, (("rule", "cascade"),))
    outcome = Simulation(
        definition(50.0, [standing_car(90.0)]), preset, lambda view: EverythingArea(), adapts=False
    ).run()
    assert outcome.avoided
    assert outcome.peak_decel_mps2 == pytest.approx(3.0)
