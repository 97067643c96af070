"""Verdicts on made-up drives whose answers are closed forms."""

import math

import numpy as np
import pytest

from evaluation.studies.drive.exposure import exposure_of
from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED, Verdict, judge
from scenarios.brakes import BrakeConfig, stop_time_s
from scenarios.recorded.dataset import Objects
from scenarios.recorded.motion import EgoMotion, LabelMotion, RecordedMotion

BRAKES = BrakeConfig(delay_s=0.2, build_up_s=0.4, max_decel_mps2=8.0)
SPEED_MPS, HORIZON_S = 10.0, 3.0
LENGTH_M, WIDTH_M, PERSON_M = 4.0, 2.0, 0.5
STOP_S = 0.2 + 0.4 + (SPEED_MPS - 1.6) / 8.0
"""The build-up takes 1.6 m/s."""
STOP_M = 2.0 + (4.0 - 8.0 / 0.4 * 0.4**3 / 6.0) + 8.4**2 / 16.0

Track = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Times, x and y of one object."""


def stamps(first_s: float, last_s: float) -> np.ndarray:
    return np.arange(round(first_s * 10), round(last_s * 10) + 1) / 10.0


def drive(
    *tracks: Track, until_s: float = 10.0, category: str = "pedestrian", x_m: np.ndarray | None = None
) -> RecordedMotion:
    """An ego along x at 10 m/s, or as given, and labelled objects; frames 0.1 s apart."""
    time_s = stamps(0.0, until_s)
    x = SPEED_MPS * time_s if x_m is None else x_m
    ego = EgoMotion(time_s, np.column_stack((x, np.zeros((len(x), 2)))), LENGTH_M, WIDTH_M)
    rows = [
        (round(10 * t), k, x, y) for k, track in enumerate(tracks) for t, x, y in zip(*track, strict=True)
    ]
    table = np.array(rows, dtype=np.float64).reshape(-1, 4)
    size = (PERSON_M, PERSON_M) if category == "pedestrian" else (4.0, 2.0)
    labels = Objects.of(
        table[:, 0].astype(np.int64),
        table[:, 2:],
        object_id=table[:, 1].astype(np.int64),
        size_m=np.tile(size, (len(table), 1)),
        yaw_rad=np.zeros(len(table)),
        category=np.full(len(table), category),
    )
    return RecordedMotion(ego, LabelMotion(labels, time_s))


def standing(x_m: float, y_m: float, first_s: float = 0.0, last_s: float = 10.0) -> Track:
    times = stamps(first_s, last_s)
    return times, np.full(len(times), x_m), np.full(len(times), y_m)


def crossing(x_m: float, enters_s: float) -> Track:
    """A person at 1.5 m/s to the right, whose outline meets the ego's way at a time."""
    times = stamps(0.0, 10.0)
    edge = WIDTH_M / 2 + PERSON_M / 2
    return times, np.full(len(times), x_m), edge - 1.5 * (times - enters_s)


def following(gap_m: float) -> Track:
    """A car at the ego's speed, its front so far behind the ego's rear; negative: ahead of its front."""
    times = stamps(0.0, 10.0)
    return times, SPEED_MPS * times - math.copysign(abs(gap_m) + LENGTH_M, gap_m), np.zeros(len(times))


def at_3_s(motion: RecordedMotion, speed_mps: float = SPEED_MPS) -> Verdict:
    return judge(motion, 3.0, speed_mps, HORIZON_S, BRAKES)


def test_a_person_who_stands_aside_makes_it_a_false_activation() -> None:
    verdict = at_3_s(drive(standing(60.0, 5.0)))
    assert (verdict.verdict, verdict.reason, verdict.object_id) == (FALSE, "", None)
    # passed at the horizon's end, 6 s; braked, the ego's front would stand before
    assert verdict.gap_recorded_m == pytest.approx(5.0 - (WIDTH_M + PERSON_M) / 2)
    ahead = 60.0 - PERSON_M / 2 - (30.0 + STOP_M + LENGTH_M / 2)
    assert verdict.gap_braked_m == pytest.approx(math.hypot(ahead, 3.75), abs=1e-6)
    assert verdict.stop_s == pytest.approx(STOP_S)
    assert verdict.covers_stop
    assert verdict.decel_mps2 == pytest.approx(0.0, abs=1e-9)


def test_a_person_who_crosses_ahead_leaves_it_undecided() -> None:
    # on the way from 4.5 s to 6.2 s; the ego is there from 6.8 s on, beyond the horizon of a request at 3 s
    motion = drive(crossing(70.0, enters_s=4.5))
    assert at_3_s(motion).verdict == FALSE
    verdict = judge(motion, 4.0, SPEED_MPS, HORIZON_S, BRAKES)
    assert (verdict.verdict, verdict.reason) == (UNDECIDED, "entered")
    assert (verdict.object_id, verdict.category) == (0, "pedestrian")


def test_a_person_who_crosses_behind_does_not_enter() -> None:
    # the ego's rear passes 35.25 m at 3.725 s
    assert judge(drive(crossing(35.0, enters_s=4.5)), 3.8, SPEED_MPS, HORIZON_S, BRAKES).verdict == FALSE


def test_a_vehicle_ahead_in_the_lane_leaves_it_undecided() -> None:
    verdict = at_3_s(drive(following(-15.0), category="car"))
    assert (verdict.verdict, verdict.reason) == (UNDECIDED, "entered")
    assert verdict.gap_recorded_m == pytest.approx(15.0)


def test_a_vehicle_behind_does_not_enter_but_its_gap_is_known() -> None:
    verdict = at_3_s(drive(following(12.0), category="car"))
    assert verdict.verdict == FALSE
    assert verdict.gap_braked_m is None
    # the follower drives on as recorded until the ego stands
    assert verdict.gap_behind_m == pytest.approx(12.0 - (SPEED_MPS * STOP_S - STOP_M), abs=1e-6)


@pytest.mark.parametrize(("until_s", "covers_stop"), [(5.0, True), (4.0, False)])
def test_a_recording_that_ends_leaves_it_undecided(until_s: float, covers_stop: bool) -> None:
    verdict = at_3_s(drive(standing(60.0, 5.0, last_s=until_s), until_s=until_s))
    assert (verdict.verdict, verdict.reason, verdict.covers_stop) == (
        UNDECIDED,
        "recording ends",
        covers_stop,
    )


@pytest.mark.parametrize(
    ("y_m", "expected"),
    [
        # 1.75 m beside the way: there after 1.25 s of walking, when the ego is just passing
        (3.0, (UNDECIDED, "labels end")),
        # 6.75 m: not within the 2 s that are left
        (8.0, (FALSE, "")),
    ],
)
def test_a_person_whose_labels_end_may_set_off(y_m: float, expected: tuple[str, str]) -> None:
    verdict = at_3_s(drive(standing(55.0, y_m, last_s=4.0)))
    assert (verdict.verdict, verdict.reason) == expected


def test_a_parked_car_whose_labels_end_stays_parked() -> None:
    assert at_3_s(drive(standing(45.0, 3.0, last_s=4.0), category="car")).verdict == FALSE


def test_a_car_whose_labels_end_keeps_its_velocity() -> None:
    times = stamps(0.0, 4.0)
    oncoming = times, np.full(len(times), 55.0), 11.0 - 2.0 * times  # at 3 m when its labels end
    assert at_3_s(drive(oncoming, category="car")).reason == "labels end"


@pytest.mark.parametrize(
    ("decel_mps2", "expected"), [(2.5, (FALSE, "")), (3.5, (UNDECIDED, "driver braked"))]
)
def test_a_driver_who_braked_hard_leaves_it_undecided(decel_mps2: float, expected: tuple[str, str]) -> None:
    time_s = stamps(0.0, 10.0)
    speed = 40.0
    verdict = at_3_s(drive(x_m=speed * time_s - decel_mps2 * time_s**2 / 2), speed - 3.0 * decel_mps2)
    assert (verdict.verdict, verdict.reason) == expected
    assert verdict.decel_mps2 == pytest.approx(decel_mps2)


def test_without_labels_nothing_is_decided() -> None:
    verdict = at_3_s(RecordedMotion(drive().ego, None))
    assert (verdict.verdict, verdict.reason) == (UNDECIDED, "no labels")
    assert verdict.gap_braked_m is None


@pytest.mark.parametrize("speed_mps", [0.05, -3.0])
def test_an_ego_that_stands_or_reverses_is_asked_nothing(speed_mps: float) -> None:
    assert at_3_s(drive(), speed_mps).verdict == STANDING


@pytest.mark.parametrize(
    ("speed_mps", "decel_mps2", "expected_s"),
    [
        (10.0, None, STOP_S),
        (1.0, None, 0.2 + math.sqrt(2.0 * 1.0 * 0.4 / 8.0)),  # within the build-up
        (10.0, 4.0, 0.2 + 0.2 + (10.0 - 0.4) / 4.0),  # half the deceleration, built up in half the time
        (0.0, None, 0.2),
    ],
)
def test_time_to_standstill(speed_mps: float, decel_mps2: float | None, expected_s: float) -> None:
    assert stop_time_s(BRAKES, speed_mps, decel_mps2) == pytest.approx(expected_s)
    if speed_mps:
        stage = BRAKES.requested(decel_mps2)
        assert BRAKES.travel(speed_mps, 0.0, expected_s - 1e-3, stage)[1] > 0.0
        assert BRAKES.travel(speed_mps, 0.0, expected_s + 1e-3, stage)[1] == 0.0


# --- edges --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("last_s", "reason"), [(5.9, "labels end"), (6.0, ""), (6.1, "")])
def test_labels_that_end_with_the_horizon_end_late_enough(last_s: float, reason: str) -> None:
    # beside the ego's front at the horizon's end, 1 cm from the way: 0.1 s of walking would do
    verdict = at_3_s(drive(standing(61.0, WIDTH_M / 2 + PERSON_M / 2 + 0.01, last_s=last_s)))
    assert verdict.reason == reason


@pytest.mark.parametrize(("until_s", "reason"), [(5.9, "recording ends"), (6.0, ""), (6.1, "")])
def test_a_recording_that_ends_with_the_horizon_ends_late_enough(until_s: float, reason: str) -> None:
    assert at_3_s(drive(standing(60.0, 5.0, last_s=until_s), until_s=until_s)).reason == reason


@pytest.mark.parametrize(
    ("y_m", "last_s", "reason"),
    [
        (1.5, 2.8, "labels end"),  # 0.25 m beside the way: the request comes after the sensor's latency
        (1.5, 2.1, "labels end"),
        (1.5, 1.9, ""),  # nothing is tracked so long without being seen
        (8.0, 2.8, ""),  # 6.75 m beside it: 4.8 s of walking
    ],
)
def test_labels_that_ended_just_before_the_request(y_m: float, last_s: float, reason: str) -> None:
    assert at_3_s(drive(standing(45.0, y_m, last_s=last_s))).reason == reason


@pytest.mark.parametrize(
    ("decel_mps2", "reason"), [(2.99, ""), (3.0, "driver braked"), (3.01, "driver braked")]
)
@pytest.mark.parametrize("speed_mps", [30.0, 33.3, 41.7])
def test_three_is_hard_braking(decel_mps2: float, reason: str, speed_mps: float) -> None:
    time_s = stamps(0.0, 10.0)
    motion = drive(x_m=speed_mps * time_s - decel_mps2 * time_s**2 / 2)
    assert at_3_s(motion, speed_mps - 3.0 * decel_mps2).reason == reason


def test_an_object_from_behind_that_overtakes_and_cuts_in_has_entered() -> None:
    times = stamps(0.0, 10.0)
    x = 22.0 + 16.0 * (times - 3.0)  # 8 m behind the ego's middle at 3 s, beside it at 4.3 s
    passing = times, x, np.full(len(times), 3.5)
    assert at_3_s(drive(passing, category="car")).verdict == FALSE
    y = np.clip(3.5 - 3.5 * (times - 5.3), 0.0, 3.5)
    verdict = judge(drive((times, x, y), category="car"), 3.0, SPEED_MPS, 4.0, BRAKES)
    assert (verdict.verdict, verdict.reason) == (UNDECIDED, "entered")


@pytest.mark.parametrize(("beside_m", "reason"), [(-0.05, "entered"), (0.05, "")])
def test_the_swept_way_of_a_turning_ego_has_its_outer_corner(beside_m: float, reason: str) -> None:
    # in a left turn of radius R about the ego's middle its right corners are farthest from the turn's centre
    radius_m, time_s = 12.0, stamps(0.0, 8.0)
    angle = SPEED_MPS * time_s / radius_m
    pose = np.column_stack((radius_m * np.sin(angle), radius_m * (1.0 - np.cos(angle)), angle))
    outer_m = math.hypot(radius_m + WIDTH_M / 2, LENGTH_M / 2)
    # a box along the radius, half way through the horizon
    at = SPEED_MPS * 4.5 / radius_m
    away_m = outer_m + PERSON_M / 2 + beside_m
    rows = len(time_s)
    labels = Objects.of(
        np.arange(rows),
        np.tile((away_m * math.sin(at), radius_m - away_m * math.cos(at)), (rows, 1)),
        object_id=np.zeros(rows, dtype=np.int64),
        size_m=np.full((rows, 2), PERSON_M),
        yaw_rad=np.full(rows, at),
        category=np.full(rows, "pedestrian"),
    )
    motion = RecordedMotion(EgoMotion(time_s, pose, LENGTH_M, WIDTH_M), LabelMotion(labels, time_s))
    assert at_3_s(motion).reason == reason


def test_an_ego_that_reverses_later_sweeps_its_way_back() -> None:
    # stops at 45 m, 5 s, then comes back: a person who stands behind it at 3 s is in its way at 8 s
    time_s = stamps(0.0, 12.0)
    x_m = np.where(
        time_s <= 3.0, SPEED_MPS * time_s, 30.0 + 10.0 * (time_s - 3.0) - 2.5 * (time_s - 3.0) ** 2
    )
    motion = drive(standing(25.0, 0.0, last_s=12.0), until_s=12.0, x_m=x_m)
    assert judge(motion, 3.0, SPEED_MPS, 3.0, BRAKES).reason == "driver braked"
    assert judge(motion, 3.0, SPEED_MPS, 4.9, BRAKES).reason == "entered"


# --- exposure -----------------------------------------------------------------------------------------------


def test_a_person_is_met_once() -> None:
    # walks at the ego's speed 10 m ahead, labelled in two stretches, and another who is passed
    first, second = stamps(0.0, 2.0), stamps(6.0, 9.0)
    times = np.concatenate((first, second))
    person = times, SPEED_MPS * times + 10.0, np.full(len(times), 2.0)
    assert exposure_of(drive(person, standing(60.0, 2.0))).pedestrians == 2


def test_a_car_is_no_pedestrian() -> None:
    assert exposure_of(drive(standing(60.0, 2.0), category="car")).pedestrians == 0


def test_standing_counts_as_time_and_not_as_way() -> None:
    time_s = stamps(0.0, 600.0)
    x_m = np.minimum(SPEED_MPS * time_s, 100.0)
    exposure = exposure_of(drive(until_s=600.0, x_m=x_m))
    assert exposure.km == pytest.approx(0.1)
    assert exposure.hours == pytest.approx(600.0 / 3600.0)
    assert exposure.at_most_per_km == pytest.approx(30.0)
    # poses of a vehicle that stands jitter: 1 cm from frame to frame would add 60 m, and halve the bound
    jitter = 0.005 * (-1.0) ** np.arange(len(time_s))
    assert exposure_of(drive(until_s=600.0, x_m=x_m + jitter)).km == pytest.approx(0.1, abs=0.002)


def test_reverse_is_way_as_well() -> None:
    time_s = stamps(0.0, 10.0)
    x_m = 20.0 - 4.0 * np.abs(time_s - 5.0)
    assert exposure_of(drive(x_m=x_m)).km == pytest.approx(0.04)


def test_no_way_gives_no_bound() -> None:
    exposure = exposure_of(drive(x_m=np.zeros(101)))
    assert (exposure.km, exposure.at_most_per_km) == (0.0, None)
