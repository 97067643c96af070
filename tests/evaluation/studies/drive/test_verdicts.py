"""Verdicts on made-up drives whose answers are closed forms."""

import math

import numpy as np
import pytest

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
