"""The ego's drive: exact under constant acceleration, within comfort when it adapts, braked when asked."""

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.brakes import BrakeConfig
from scenarios.openscenario.motion.paths import Pose, straight
from scenarios.simulation.drive import Asked, EgoDrive
from scenarios.simulation.follower import ACCEL_MPS2, HARDEST_MPS2, STANDSTILL_GAP_M, Follower
from smartmot.decision.rules import LeadObject

KMH = 1 / 3.6
WAY = straight(Pose(0.0, 0.0, 0.0))
IDEAL = BrakeConfig(0.0, 0.0, 8.0)
LENGTH_M = 4.4


class Drive(EgoDrive):
    """In command, and always asked for the speed that it begins with."""

    def __init__(self, speed_mps: float, brakes: BrakeConfig, adapts: bool) -> None:
        super().__init__(brakes, LENGTH_M, adapts)
        self.asked = Asked(speed_mps)
        self.take_over(0.0, WAY, 0.0, speed_mps)

    def decide(self, time_s: float, emergency: bool, lead: LeadObject | None) -> None:
        self.control(time_s, emergency, lead, self.speed_mps, self.asked)


def at_speed(speed_mps: float, brakes: BrakeConfig = IDEAL, adapts: bool = True) -> Drive:
    return Drive(speed_mps, brakes, adapts)


@given(speed=st.just(0.0) | st.floats(0.1, 40.0), duration=st.floats(0.0, 5.0))
def test_on_a_free_road_the_speed_is_kept(speed: float, duration: float) -> None:
    drive = at_speed(speed)
    drive.decide(0.0, False, None)
    motion = drive.motion(0.0, duration)
    assert motion.speed_mps == pytest.approx(speed, abs=1e-9)
    assert motion.distance_m == pytest.approx(speed * duration, abs=1e-9)


@given(speed=st.floats(0.0, 40.0), split=st.floats(0.0, 1.0), duration=st.floats(0.0, 6.0))
def test_braking_is_the_same_in_one_step_and_in_two(speed: float, split: float, duration: float) -> None:
    once, twice = (at_speed(speed, BrakeConfig(0.2, 0.4, 8.8)) for _ in range(2))
    for drive in (once, twice):
        drive.decide(0.0, True, None)
    whole = once.motion(0.0, duration)
    first = twice.motion(0.0, split * duration)
    twice.advance(0.0, split * duration)
    second = twice.motion(split * duration, (1 - split) * duration)
    assert first.distance_m + second.distance_m == pytest.approx(whole.distance_m, abs=1e-6)
    assert second.speed_mps == pytest.approx(whole.speed_mps, abs=1e-6)


@given(speed=st.floats(0.1, 40.0))
def test_an_ideal_brake_stops_within_the_energy_equation(speed: float) -> None:
    drive = at_speed(speed)
    drive.decide(0.0, True, None)
    assert drive.motion(0.0, 10.0).distance_m == pytest.approx(speed**2 / 16.0)
    assert drive.motion(0.0, 10.0).speed_mps == 0.0
    drive.advance(0.0, 0.05)
    assert drive.accel_mps2 == pytest.approx(-min(8.0, speed / 0.05))


def test_a_brake_that_is_released_and_requested_again_begins_anew() -> None:
    drive = at_speed(20.0, BrakeConfig(0.2, 0.0, 8.0))
    for time_s, emergency in ((0.0, True), (0.1, True), (0.3, False), (0.4, True)):
        drive.decide(time_s, emergency, None)
    assert drive.braking_since_s == 0.4
    assert drive.motion(0.4, 0.2).speed_mps == pytest.approx(20.0)  # the delay, again
    assert drive.motion(0.4, 0.3).speed_mps == pytest.approx(20.0 - 0.1 * 8.0)


@pytest.mark.parametrize("duration", [0.01, 1.0])
def test_in_reverse_the_speed_is_kept_until_the_emergency(duration: float) -> None:
    drive = at_speed(-4 * KMH)
    drive.decide(0.0, False, LeadObject(1, 1.0, 0.0))
    assert drive.motion(0.0, duration).distance_m == pytest.approx(-4 * KMH * duration)
    assert drive.motion(0.0, duration).speed_mps == pytest.approx(-4 * KMH)


def test_in_reverse_it_brakes_as_forward_and_stays() -> None:
    """2 m/s with 8 m/s2 after 0.2 s: 0.4 m of delay and 0.25 m of braking."""
    drive = at_speed(-2.0, BrakeConfig(0.2, 0.0, 8.0))
    drive.decide(0.0, True, None)
    half = drive.motion(0.0, 0.3)
    assert (half.distance_m, half.speed_mps) == pytest.approx((-(0.4 + 0.2 - 0.04), -1.2))
    drive.advance(0.0, 1.0)
    assert drive.motion(0.0, 1.0).distance_m == 0.0
    drive.decide(1.0, False, None)  # nobody drives it on
    assert drive.motion(1.0, 1.0).distance_m == 0.0


@pytest.fixture(scope="module")
def peer() -> Any:
    """highway-env's vehicle, with the length of the ego and without its limits of comfort."""
    from highway_env.road.lane import StraightLane
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle

    network = RoadNetwork()
    network.add_lane("start", "end", StraightLane([0.0, 0.0], [1.0, 0.0], speed_limit=None))
    vehicle = IDMVehicle(Road(network), [0.0, 0.0], target_lane_index=("start", "end", 0))
    vehicle.DISTANCE_WANTED = LENGTH_M + STANDSTILL_GAP_M
    return vehicle


@given(
    speed=st.floats(0.0, 40.0),
    gap=st.floats(-5.0, 100.0) | st.none(),
    lead=st.floats(-10.0, 40.0),
    desired=st.floats(0.001, 40.0),
)
def test_speed_adaptation_is_the_model_of_highway_env_within_comfort(
    peer: Any, speed: float, gap: float | None, lead: float, desired: float
) -> None:
    """Its desired gap is measured between the fronts."""
    from highway_env.vehicle.kinematics import Vehicle

    peer.speed, peer.target_speed, front = speed, desired, None
    if gap is not None:
        front = Vehicle(None, np.array([gap + LENGTH_M, 0.0]), 0.0)
        front.speed = lead
    expected = min(max(float(peer.acceleration(peer, front)), -HARDEST_MPS2), ACCEL_MPS2)
    ahead = None if gap is None else LeadObject(1, gap, lead)
    assert Follower(LENGTH_M).accel_mps2(speed, ahead, desired) == pytest.approx(expected, abs=1e-9)


def test_it_comes_to_rest_behind_a_standing_car() -> None:
    drive, gap = at_speed(50 * KMH), 120.0
    gaps = [gap]
    for k in range(800):
        drive.decide(0.05 * k, False, LeadObject(1, gap, 0.0))
        gap -= drive.motion(0.05 * k, 0.05).distance_m
        drive.advance(0.05 * k, 0.05)
        gaps.append(gap)
    assert drive.speed_mps < 0.3
    assert 0.5 < gap < 4.0
    assert (np.diff(gaps) <= 1e-9).all()


def test_held_speed_is_not_adapted_but_brakes() -> None:
    drive = at_speed(15.0, adapts=False)
    drive.decide(0.0, False, LeadObject(1, 5.0, 0.0))
    assert drive.motion(0.0, 1.0).speed_mps == pytest.approx(15.0)
    drive.decide(0.0, True, LeadObject(1, 5.0, 0.0))
    assert drive.motion(0.0, 1.0).speed_mps == pytest.approx(7.0)


def test_the_scenario_drives_until_there_is_a_reason_to_depart_from_it() -> None:
    drive = at_speed(15.0)
    assert drive.commands_from_s == math.inf
    drive.decide(0.1, False, None)
    assert drive.commands_from_s == math.inf
    drive.decide(0.2, False, LeadObject(1, 50.0, 10.0))
    drive.decide(0.3, False, LeadObject(1, 50.0, 10.0))
    assert drive.commands_from_s == 0.2
    drive.speed_mps = 14.0
    drive.decide(0.4, False, None)  # back to the speed that is asked for, in command
    assert drive.commands_from_s == 0.2
    assert 0.0 < drive.motion(0.4, 1.0).speed_mps - 14.0 < 1.0
    drive.speed_mps = 15.0
    drive.decide(0.5, False, None)
    assert drive.commands_from_s == math.inf
    held = at_speed(15.0, adapts=False)
    held.decide(0.2, False, LeadObject(1, 5.0, 0.0))
    assert held.commands_from_s == math.inf
    held.decide(0.3, True, None)
    assert held.commands_from_s == 0.3


def test_speed_adaptation_keeps_up_with_a_desired_speed_that_changes() -> None:
    """On a free road, at the desired speed, the change of that speed is the acceleration; 6 m/s2 down too."""
    follower = Follower(LENGTH_M)
    for change in (-6.0, -1.0, 1.0):
        assert follower.accel_mps2(10.0, None, 10.0, change) == pytest.approx(change)
    assert follower.accel_mps2(10.0, None, 10.0, 9.0) == ACCEL_MPS2
    # behind somebody the distance counts as before
    lead = LeadObject(1, 20.0, 10.0)
    apart = follower.accel_mps2(10.0, lead, 10.0)
    assert follower.accel_mps2(10.0, lead, 10.0, 1.0) == pytest.approx(apart + 1.0)


def test_a_run_does_not_import_highway_env() -> None:
    """Importing it takes longer than most runs."""
    program = """
import sys
from scenarios.brakes import BrakeConfig
from scenarios.simulation.drive import Asked, EgoDrive
from smartmot.decision.rules import LeadObject
import scenarios.simulation.simulation
drive = EgoDrive(BrakeConfig(0.0, 0.0, 8.0), 4.4)
drive.take_over(0.0, None, 0.0, 15.0)
drive.control(0.0, False, LeadObject(1, 5.0, 0.0), 15.0, Asked(15.0))
print(drive.motion(0.0, 1.0).speed_mps, "highway_env" in sys.modules, "scipy" in sys.modules)
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["11.0", "False", "False"]


def test_a_partial_brake_that_becomes_a_full_one() -> None:
    """Without build-up the stages are steps: 0.5 s at 3 m/s2, then 8 m/s2, which the brakes give at most."""
    drive = at_speed(20.0, BrakeConfig(0.2, 0.0, 8.0))
    drive.control(0.0, True, None, 20.0, Asked(20.0), 3.0)
    drive.advance(0.0, 0.7)
    assert drive.speed_mps == pytest.approx(18.5)
    drive.control(0.7, True, None, 18.5, Asked(20.0), 3.0)  # asked again, nothing changes
    drive.control(0.7, True, None, 18.5, Asked(20.0), 9.8)
    assert drive.motion(0.7, 0.5).speed_mps == pytest.approx(18.5 - 4.0)  # no second delay
    drive.advance(0.7, 0.5)
    assert drive.peak_decel_mps2 == pytest.approx(8.0)
    drive.control(1.2, False, None, 14.5, Asked(20.0))
    drive.advance(1.2, 0.5)
    drive.control(1.7, True, None, drive.speed_mps, Asked(20.0))  # begins anew, with the delay
    before = drive.speed_mps
    assert drive.motion(1.7, 0.2).speed_mps == pytest.approx(before)


def test_the_peak_is_that_of_the_emergency_brake_alone() -> None:
    drive = at_speed(20.0)
    drive.decide(0.0, False, LeadObject(1, 3.0, 0.0))
    drive.advance(0.0, 0.1)
    assert drive.accel_mps2 < -1.0
    assert drive.peak_decel_mps2 == 0.0
