"""A driver who brakes beside the emergency brake: the greater deceleration holds, in closed form."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.brakes import BrakeConfig
from scenarios.errors import ScenarioError
from scenarios.openscenario.motion.paths import Pose, straight
from scenarios.simulation.drive import ONSET_MPS2, Asked, EgoDrive
from scenarios.simulation.driver import DriverBrake
from scenarios.simulation.ends import EndReason
from scenarios.spec import RunSpec, simulation_of

WAY = straight(Pose(0.0, 0.0, 0.0))
STEPS = BrakeConfig(0.0, 0.0, 9.0)
G_MPS2 = 9.81


def driven(driver: DriverBrake | None, brakes: BrakeConfig = STEPS, speed_mps: float = 20.0) -> EgoDrive:
    drive = EgoDrive(brakes, 4.4, adapts=False, driver=driver)
    drive.take_over(0.0, WAY, 0.0, speed_mps)
    return drive


def decide(drive: EgoDrive, time_s: float, emergency: bool, decel_mps2: float | None = None) -> None:
    drive.control(time_s, emergency, None, drive.speed_mps, Asked(20.0), decel_mps2)


def pedal(from_s: float, decel_mps2: float = 4.0, ramp_s: float = 0.0) -> tuple[EgoDrive, DriverBrake]:
    """A drive whose driver has been warned, so that the pedal is pressed at a time."""
    driver = DriverBrake(decel_mps2, ramp_s, after_warning_s=from_s)
    drive = driven(driver)
    drive.heed(0.0, 0.0, None)
    return drive, driver


def test_the_pedal_alone() -> None:
    """Over the ramp the deceleration is on average half of what follows; the distance has its third power."""
    drive, _ = pedal(0.0, 4.0, 0.25)
    decide(drive, 0.0, False)
    assert drive.commands_from_s == 0.0
    motion = drive.motion(0.0, 1.25)
    at_ramp_mps = 20.0 - 4.0 * 0.125
    assert motion.speed_mps == pytest.approx(at_ramp_mps - 4.0)
    ramp_m = 20.0 * 0.25 - (4.0 / 0.25) * 0.25**3 / 6
    assert motion.distance_m == pytest.approx(ramp_m + at_ramp_mps - 2.0)
    assert drive.motion(0.0, 60.0).speed_mps == 0.0


def test_the_greater_deceleration_holds() -> None:
    drive, _ = pedal(0.5)
    decide(drive, 0.0, False)
    assert drive.commands_from_s == 0.5  # until then the scenario drives
    drive.take_over(0.5, WAY, 10.0, 20.0)
    decide(drive, 0.5, False)
    drive.advance(0.5, 0.5)
    assert drive.speed_mps == pytest.approx(18.0)
    decide(drive, 1.0, True)
    drive.advance(1.0, 1.0)
    assert drive.speed_mps == pytest.approx(18.0 - 9.0)
    assert drive.added_decel_mps2 == pytest.approx(9.0 - 4.0)


def test_a_partial_brake_that_the_pedal_overtakes() -> None:
    """3 m/s2 until the pedal gives more, in the middle of its ramp: 0.75 s of 1 s."""
    drive, _ = pedal(1.0, 4.0, 1.0)
    decide(drive, 0.0, True, 3.0)
    drive.advance(0.0, 1.75)
    assert drive.speed_mps == pytest.approx(20.0 - 3.0 * 1.75)
    drive.advance(1.75, 0.25)
    assert drive.speed_mps == pytest.approx(20.0 - 3.0 * 1.75 - 3.5 * 0.25)
    assert drive.added_decel_mps2 == pytest.approx(3.0)


def test_nothing_is_added_below_the_pedal() -> None:
    drive, _ = pedal(0.0)
    decide(drive, 0.0, False)
    drive.advance(0.0, 0.5)
    decide(drive, 0.5, True, 3.0)
    drive.advance(0.5, 0.5)
    assert drive.speed_mps == pytest.approx(16.0)
    assert drive.added_decel_mps2 == 0.0


@given(
    press_s=st.floats(0.0, 2.0),
    request_s=st.floats(0.0, 2.0),
    asked=st.floats(0.5, 9.0),
    split=st.floats(0.0, 1.0),
)
def test_one_step_and_two_and_the_bounds(
    press_s: float, request_s: float, asked: float, split: float
) -> None:
    """No more speed is lost than by both together, no less than by each alone."""
    brakes = BrakeConfig(0.1, 0.4, 9.0)
    driver = DriverBrake(4.0, 0.25, after_warning_s=0.0)

    def left_mps(pressed: bool, requested: bool, split: float = 0.0) -> float:
        drive = driven(driver if pressed else None, brakes, 30.0)
        drive.heed(press_s, press_s, None)
        if requested:
            decide(drive, request_s, True, asked)
        begin = max(press_s, request_s)
        drive.advance(begin, split)
        return drive.motion(begin + split, 1.0 - split).speed_mps

    both, alone = left_mps(True, True), (left_mps(True, False), left_mps(False, True))
    assert left_mps(True, True, split) == pytest.approx(both, abs=1e-9)
    assert sum(alone) - 30.0 - 1e-9 <= both <= min(alone) + 1e-9


def test_the_onset_of_automatic_braking() -> None:
    """0.15 g on the ramp to the full deceleration, to a step of the simulation."""
    drive = driven(None, BrakeConfig(0.1, 0.3, 9.0))
    decide(drive, 0.0, True)
    for k in range(50):
        drive.advance(k * 0.01, 0.01)
    onset_s = 0.1 + 0.3 * 0.15 * G_MPS2 / 9.0
    assert pytest.approx(0.15 * G_MPS2) == ONSET_MPS2
    assert drive.braking_time_s is not None
    assert onset_s <= drive.braking_time_s <= onset_s + 0.01


def test_when_the_pedal_is_pressed() -> None:
    after = DriverBrake(4.0, 0.25, after_warning_s=1.0)
    assert after.onset_s(2.0, None, 0.1) is None
    assert after.onset_s(2.0, 1.95, None) == pytest.approx(2.95)
    near = DriverBrake(4.0, 0.25, at_ttc_s=1.1)
    assert near.onset_s(2.0, 1.0, None) is None
    assert near.onset_s(2.0, 1.0, 1.3) is None
    assert near.onset_s(2.0, None, 1.13) == pytest.approx(2.03)
    assert near.onset_s(2.0, None, 0.9) == 2.0


@pytest.mark.parametrize(
    "values",
    [
        {"decel_mps2": 0.0, "ramp_s": 0.1, "at_ttc_s": 1.0},
        {"decel_mps2": math.inf, "ramp_s": 0.1, "at_ttc_s": 1.0},
        {"decel_mps2": 4.0, "ramp_s": -0.1, "at_ttc_s": 1.0},
        {"decel_mps2": 4.0, "ramp_s": 0.1},
        {"decel_mps2": 4.0, "ramp_s": 0.1, "at_ttc_s": 1.0, "after_warning_s": 1.0},
        {"decel_mps2": 4.0, "ramp_s": 0.1, "at_ttc_s": -1.0},
    ],
)
def test_a_driver_that_cannot_be(values: dict[str, float]) -> None:
    with pytest.raises(ScenarioError, match="driver: "):
        DriverBrake(**values)


def test_a_plate_that_nobody_sees_is_crossed_under_the_pedal() -> None:
    """80 km/h, 0.4 g from 1.1 s before the leading edge: nothing is added, and the speed there is known."""
    decel = 0.4 * G_MPS2
    driver = DriverBrake(decel, 0.25, at_ttc_s=1.1)
    spec = RunSpec(
        *("plate", "steel_plate", (("Ego_speed_kmh", 80.0),), "map", "physical", "dry", 80.0), adapts=False
    )
    simulation = simulation_of(spec)
    assert simulation.run().end_time_s == pytest.approx(5.0, abs=1e-6)
    simulation = simulation_of(replace(spec, driver=driver))
    outcome = simulation.run()
    speed = 80 / 3.6
    ramp_m, ramp_mps = speed * 0.25 - decel * 0.25**2 / 6, speed - decel * 0.125
    crossing_mps = math.sqrt(ramp_mps**2 - 2 * decel * (1.1 * speed - ramp_m))
    assert simulation.engine.ego_speed_mps == pytest.approx(crossing_mps, abs=1e-3)
    assert (outcome.contact, outcome.flag_time_s, outcome.added_decel_mps2) == (None, None, 0.0)


def test_a_run_to_the_standstill_goes_on_when_the_car_ahead_is_level() -> None:
    """The car ahead brakes with 0.3 g, the ego fully: it is as slow long before both stand."""
    values = {"Ego_speed_kmh": 50.0, "Headway": 12.0, "Target_deceleration": 0.3 * G_MPS2}
    spec = RunSpec(
        *("lead", "lead_braking", tuple(sorted(values.items())), "map", "physical", "dry", 50.0), adapts=False
    )
    level = simulation_of(spec).run()
    assert level.end_reason is EndReason.FOLLOWED
    simulation = simulation_of(replace(spec, to_standstill=True))
    stood = simulation.run()
    assert stood.end_reason is EndReason.STOPPED
    assert simulation.engine.ego_speed_mps == 0.0
    assert stood.end_time_s > level.end_time_s
    assert stood.flag_time_s == level.flag_time_s
