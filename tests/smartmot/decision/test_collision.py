import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.area import ego_extent
from smartmot.decision.collision import IOU_THRESHOLD, collision_times, threats
from smartmot.geometry import corners
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, Forecast, Tracks

CAR = (4.4, 1.8)
PERSON = (0.5, 0.5)
TIMES = np.arange(31) * 0.1
WALK_MPS = 5 / 3.6


def _moving(
    start: FloatArray | list[list[float]],
    velocity: FloatArray | list[list[float]],
    size: tuple[float, float] | FloatArray,
    yaw: FloatArray | float = 0.0,
    times: FloatArray = TIMES,
    valid: BoolArray | None = None,
) -> Forecast:
    """M boxes that move in straight lines."""
    start, velocity = np.array(start, dtype=float), np.array(velocity, dtype=float)
    m, t = len(start), len(times)
    center = start[:, None] + velocity[:, None] * times[:, None]
    heading = np.broadcast_to(np.reshape(yaw, (-1, 1)), (m, t))
    return Forecast(
        times,
        center,
        heading,
        np.broadcast_to(size, (m, 2)),
        np.ones((m, t), dtype=bool) if valid is None else valid,
    )


def _ego(speed: float, times: FloatArray = TIMES) -> Forecast:
    return _moving([[0.0, 0.0]], [[speed, 0.0]], CAR, times=times)


def _ungated(ego: Forecast, others: Forecast, threshold: float) -> FloatArray:
    """The definition, one polygon pair after the other."""
    found = np.full(len(others), np.inf)
    for k, time in enumerate(ego.time_s):
        mine = shapely.Polygon(corners(ego.center_m[0, k], ego.size_m[0], ego.yaw_rad[0, k]))
        for m in range(len(others)):
            shape = corners(others.center_m[m, k], others.size_m[m], others.yaw_rad[m, k])
            other = shapely.Polygon(shape)
            common = mine.intersection(other).area
            iou = common / (mine.area + other.area - common)
            if iou > max(threshold, 1e-9) and others.valid[m, k] and found[m] == np.inf:
                found[m] = time
    return found


# --- times --------------------------------------------------------------------------------------------


def test_crossing_boxes_meet_at_the_time_computed_by_hand() -> None:
    """A car to the east at 10 m/s, one to the north at 8 m/s; both centres are at (20, 0) at t = 2 s.

    Side by side they close at 10 and 8 m/s. Along x they touch when the first front reaches 20 - 0.9 m:
    10 t = 20 - 0.9 - 2.2, t = 1.69 s; along y when the second front reaches -0.9 m: 8 t = 16 - 2.2 - 0.9,
    t = 1.6125 s. Both hold from 1.69 s on; an overlap of 1 % of the union, 0.157 m2, needs some cm more.
    """
    fine = np.arange(301) * 0.01
    for times, step in ((TIMES, 0.1), (fine, 0.01)):
        other = _moving([[20.0, -16.0]], [[0.0, 8.0]], CAR, np.pi / 2, times)
        (found,) = collision_times(_ego(10.0, times), other)
        assert 1.69 <= found <= 1.69 + 0.03 + step


def test_head_on_by_hand() -> None:
    """Gap 30.6 m closed at 15 m/s: 2.04 s, and 0.16 m of overlap are 0.01 s more."""
    other = _moving([[35.0, 0.0]], [[-5.0, 0.0]], CAR, np.pi)
    assert collision_times(_ego(10.0), other)[0] == pytest.approx(2.1)


def test_a_pedestrian_half_a_second_earlier_or_later_is_no_collision() -> None:
    """He is in the ego's path of 1.8 m for 1.66 s, the car passes his line within 0.35 s at 50 km/h. With
    the meeting of the centres shifted by more than half the sum, (1.66 + 0.35) / 2 = 1.0 s, they miss.
    A person 0.5 s beyond that is safe, 0.5 s before it is hit."""
    speed = 50 / 3.6
    meet_s = 2.0
    limit = 0.5 * ((1.8 + 0.5) / WALK_MPS + (4.4 + 0.5) / speed)
    shift = np.array([-limit - 0.5, -limit + 0.5, 0.0, limit - 0.5, limit + 0.5])
    start = np.column_stack((np.full(5, speed * meet_s), -WALK_MPS * (meet_s + shift)))
    found = collision_times(_ego(speed), _moving(start, np.tile([0.0, WALK_MPS], (5, 1)), PERSON))
    assert np.isfinite(found).tolist() == [False, True, True, True, False]
    assert (np.abs(found[1:4] - meet_s) < 0.5).all()


def test_a_cyclist_half_a_second_off_is_no_collision() -> None:
    """At 20 km/h and across at 36 km/h the windows are 0.65 + 0.50 s long: half a second apart just hits no
    more once the centres miss each other by 0.58 s."""
    speed, ride = 10.0, 20 / 3.6
    half = 0.5 * ((1.8 + 1.8) / ride + (4.4 + 0.6) / speed)
    shift = np.array([-half - 0.05, -half + 0.15, half - 0.15, half + 0.05])
    start = np.column_stack((np.full(4, 15.0), -ride * (1.5 + shift)))
    other = _moving(start, np.tile([0.0, ride], (4, 1)), (1.8, 0.6), np.pi / 2)
    assert np.isfinite(collision_times(_ego(speed), other)).tolist() == [False, True, True, False]


def test_same_place_at_another_time_is_no_collision() -> None:
    """The path of a car ahead is the ego's own path."""
    assert collision_times(_ego(10.0), _moving([[12.0, 0.0]], [[10.0, 0.0]], CAR))[0] == np.inf


def test_overlap_now_is_time_zero() -> None:
    assert collision_times(_ego(0.0), _moving([[2.0, 0.5]], [[0.0, 0.0]], PERSON))[0] == 0.0


def test_threshold_is_of_the_union_and_exclusive() -> None:
    """A car shifted by d along itself has IoU (4.4 - d) / (4.4 + d): 0.01 at d = 4.4 x 0.99 / 1.01."""
    d = 4.4 * 0.99 / 1.01
    standing = _moving([[d - 1e-6, 0.0], [d + 1e-6, 0.0]], np.zeros((2, 2)), CAR)
    assert collision_times(_ego(0.0), standing).tolist() == [0.0, np.inf]
    touching = _moving([[4.4, 0.0]], [[0.0, 0.0]], CAR)
    assert collision_times(_ego(0.0), touching, 0.0).tolist() == [np.inf]
    assert collision_times(_ego(0.0), standing, 0.05).tolist() == [np.inf, np.inf]
    assert IOU_THRESHOLD == 0.01


def test_a_bus_meets_a_pedestrian_too() -> None:
    """0.5 m x 0.5 m are 0.8 % of the union with 12 m x 2.55 m: under 0.01 they could never collide."""
    bus, walker = (12.0, 2.55), (0.5, 0.5)
    ego = _moving([[0.0, 0.0]], [[10.0, 0.0]], bus)
    standing = _moving([[26.0, 0.0], [26.0, 1.6]], np.zeros((2, 2)), walker)
    assert collision_times(ego, standing).tolist() == pytest.approx([2.0, np.inf])
    # the least common area is that of a car: a hundredth of the car and the pedestrian together
    least = (
        0.01 * (4.4 * 1.8) / (12.0 * 2.55) * (12.0 * 2.55 + 0.25) / (1 + 0.01 * (4.4 * 1.8) / (12.0 * 2.55))
    )
    edge = 6.0 + 0.25 - least / 0.5
    resting = _moving([[0.0, 0.0]], [[0.0, 0.0]], bus)
    beside = _moving([[edge - 1e-6, 0.0], [edge + 1e-6, 0.0]], np.zeros((2, 2)), walker)
    assert collision_times(resting, beside).tolist() == [0.0, np.inf]
    assert least == pytest.approx(0.01 * (4.4 * 1.8 + 0.25), rel=0.03)


def test_invalid_times_do_not_count() -> None:
    valid = np.ones((1, 31), dtype=bool)
    valid[0, 10:] = False
    there = _moving([[20.0, 0.0]], [[0.0, 0.0]], CAR, valid=valid)
    assert collision_times(_ego(10.0), there)[0] == np.inf


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), speed=st.floats(0.0, 20.0), threshold=st.sampled_from([0.0, 0.01, 0.1]))
def test_gate_never_changes_the_answer(seed: int, speed: float, threshold: float) -> None:
    rng = np.random.default_rng(seed)
    m, times = 8, np.arange(11) * 0.3
    others = _moving(
        rng.uniform((-10, -15), (50, 15), (m, 2)),
        rng.uniform(-10, 10, (m, 2)),
        rng.uniform(0.3, 12.0, (m, 2)),
        rng.uniform(-7, 7, m),
        times,
        rng.random((m, 11)) < 0.9,
    )
    ego = _ego(speed, times)
    np.testing.assert_array_equal(collision_times(ego, others, threshold), _ungated(ego, others, threshold))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_objects_meet_the_ego_at_the_same_time_whatever_others_do(seed: int) -> None:
    """A pipeline asks for those that count alone."""
    rng = np.random.default_rng(seed)
    places, velocities = rng.uniform((-10, -15), (50, 15), (8, 2)), rng.uniform(-10, 10, (8, 2))
    chosen = np.flatnonzero(rng.random(8) < 0.4)
    together = collision_times(_ego(12.0), _moving(places, velocities, CAR))
    alone = collision_times(_ego(12.0), _moving(places[chosen], velocities[chosen], CAR))
    np.testing.assert_array_equal(alone, together[chosen])


def test_nobody_to_meet() -> None:
    none = _moving(np.zeros((0, 2)), np.zeros((0, 2)), CAR)
    assert collision_times(_ego(10.0), none).shape == (0,)


# --- threats ------------------------------------------------------------------------------------------


def _tracks(boxes: Boxes) -> Tracks:
    m = len(boxes)
    flags = np.ones(m, dtype=bool)
    zeros = np.zeros(m)
    return Tracks(
        0.0, np.arange(m) + 10, boxes, np.full(m, "car"), zeros, np.zeros((m, 9)), np.zeros((m, 9, 9)),
        np.zeros((m, 2)), zeros, zeros, zeros, flags, flags,
    )  # fmt: skip


def test_threats_are_ordered_and_measured_by_hand() -> None:
    """Ego's front is 2.2 m before its centre; gaps to the near sides of cars at 20 and 12.2 m, heading 90
    degrees: 20 - 2.2 - 2.2 = 15.6 m and 12.2 - 0.9 - 2.2 = 9.1 m."""
    center = np.array([[20.0, 0.0], [12.2, 3.0], [30.0, 0.0], [5.0, 0.0], [4.0, 0.5]])
    boxes = Boxes(center, np.tile(CAR, (5, 1)), np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0]))
    ttc = np.array([2.0, 1.0, np.inf, 0.5, 3.0])
    counts = np.array([True, True, False, False, True])
    gap = ego_extent(boxes, EgoState(0.0, 0.0, 0.0, 0.0, 10.0))[0] - 2.2
    found = threats(_tracks(boxes), ttc, counts, gap, 10.0)
    assert found.track_id.tolist() == [11, 10, 14]
    np.testing.assert_array_equal(found.time_to_collision_s, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(found.gap_m, [9.1, 15.6, 0.0])
    np.testing.assert_allclose(found.required_decel_mps2, [100 / 18.2, 100 / 31.2, np.inf])


def test_a_standing_ego_needs_no_deceleration() -> None:
    boxes = Boxes(np.array([[4.0, 0.0], [9.0, 0.0]]), np.tile(CAR, (2, 1)), np.zeros(2))
    found = threats(_tracks(boxes), np.zeros(2), np.ones(2, dtype=bool), np.array([-0.2, 4.8]), 0.0)
    assert found.required_decel_mps2.tolist() == [0.0, 0.0]


def test_gap_is_seen_along_the_egos_heading() -> None:
    boxes = Boxes(np.array([[3.0, 17.0]]), np.array([PERSON]), np.zeros(1))
    ego = EgoState(0.0, 3.0, 5.0, np.pi / 2, 5.0)
    assert ego_extent(boxes, ego)[0][0] == pytest.approx(12.0 - 0.25)


def test_no_threats() -> None:
    found = threats(_tracks(Boxes.empty()), np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0), 1.0)
    assert len(found) == 0
