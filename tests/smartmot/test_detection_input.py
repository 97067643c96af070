from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.detection_input import detections_from_arrays, to_map
from smartmot.errors import ShapeError
from smartmot.tracking.tracker import Tracker
from smartmot.types import Boxes, Detections, Dropped

GOOD: dict[str, Any] = {
    "center_m": [[1.0, 2.0]],
    "size_m": [[4.0, 2.0]],
    "yaw_rad": [0.1],
    "score": [0.5],
    "category": ["car"],
}


def test_good_rows_come_through_as_they_are() -> None:
    detections, rejected = detections_from_arrays(3.0, **GOOD, velocity_mps=[[1.0, -1.0]])
    assert rejected == 0
    assert detections.stamp_s == 3.0
    np.testing.assert_allclose(detections.boxes.center_m, [[1.0, 2.0]])
    np.testing.assert_allclose(detections.boxes.size_m, [[4.0, 2.0]])
    assert detections.boxes.yaw_rad[0] == pytest.approx(0.1)
    assert (detections.score.tolist(), detections.category.tolist()) == ([0.5], ["car"])
    assert detections.velocity_mps is not None
    np.testing.assert_allclose(detections.velocity_mps, [[1.0, -1.0]])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("center_m", [np.nan, 0.0]),
        ("center_m", [np.inf, 0.0]),
        ("center_m", [1e12, 0.0]),
        ("size_m", [0.0, 2.0]),
        ("size_m", [-4.0, 2.0]),
        ("size_m", [4.0, np.nan]),
        ("size_m", [400.0, 2.0]),
        ("size_m", [1e-320, 2.0]),
        ("size_m", [4.0, 1e-9]),
        ("yaw_rad", 1e300),
        ("yaw_rad", np.inf),
        ("yaw_rad", np.nan),
        ("score", 1.2),
        ("score", np.nan),
        ("category", "spaceship"),
    ],
)
def test_impossible_rows_are_dropped_and_counted(name: str, value: Any) -> None:
    rows = {key: [*values, values[0], values[0]] for key, values in GOOD.items()}
    rows[name][1] = value
    detections, rejected = detections_from_arrays(0.0, **rows)
    assert (len(detections), rejected) == (2, 1)
    reason = name if name in ("score", "category") else "box"
    assert detections.dropped == Dropped(**{reason: 1})
    # the count goes with the frame, whatever is chosen or moved
    assert detections[:0].dropped == to_map(detections, 1.0, 2.0, 0.3).dropped == detections.dropped


@pytest.mark.parametrize("velocity", [[np.nan, 1.0], [np.inf, 1.0], [1.0, -1e200]])
def test_impossible_velocities_are_not_measured(velocity: list[float]) -> None:
    detections, rejected = detections_from_arrays(0.0, **GOOD, velocity_mps=[velocity])
    assert rejected == 0
    assert detections.velocity_mps is not None
    assert np.isnan(detections.velocity_mps).all()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 8),
        max_size=6,
    )
)
def test_whatever_comes_in_the_tracks_stay_finite(rows: list[tuple[float, ...]]) -> None:
    array = np.array(rows).reshape(-1, 8)
    tracker = Tracker()
    for k in range(3):
        tracks = tracker.update_arrays(
            0.1 * k, array[:, :2], array[:, 2:4], array[:, 4], array[:, 5], velocity_mps=array[:, 6:]
        )
        for part in (tracks.mean, tracks.covariance, tracks.velocity_mps, tracks.boxes.size_m):
            assert np.isfinite(part).all()
    assert 0 <= tracker.rejected <= 3 * len(rows)


def test_the_tracker_counts_what_it_drops() -> None:
    tracker = Tracker()
    tracker.update_arrays(0.0, [[0.0, 0.0], [np.nan, 0.0]], [[4.0, 2.0]] * 2, [0.0, 0.0])
    tracks = tracker.update_arrays(0.1, [[0.0, 0.0]], [[4.0, -2.0]], [0.0])
    assert tracker.rejected == 2
    assert tracks.coasted_s.tolist() == [0.1]
    tracker.reset()
    assert tracker.rejected == 0


def test_scores_and_names_may_be_left_out() -> None:
    detections, _ = detections_from_arrays(0.0, [[0, 0]], [[1, 1]], [0])
    assert (detections.score.tolist(), detections.category.tolist()) == ([1.0], ["unknown"])
    nothing, rejected = detections_from_arrays(0.0, [], [], [])
    assert len(nothing) == rejected == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"yaw_rad": [0.1, 0.2]}, "expected 1 rows in every array"),
        ({"center_m": [1.0, 2.0]}, "center_m: expected one row of shape"),
        ({"size_m": "big"}, "size_m: expected numbers"),
    ],
)
def test_arrays_of_another_shape_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        detections_from_arrays(0.0, **(GOOD | change))


def test_vehicle_frame_to_map_by_hand() -> None:
    # The vehicle stands at (10, 5) and faces north: 2 m ahead is (10, 7), 3 m to the left is (7, 5).
    boxes = Boxes(np.array([[2.0, 0.0], [0.0, 3.0]]), np.ones((2, 2)), np.array([0.0, np.pi / 2]))
    velocity = np.array([[1.0, 0.0], [np.nan, np.nan]])
    seen = Detections(0.0, boxes, np.ones(2), np.array(["car", "car"]), velocity)
    moved = to_map(seen, 10.0, 5.0, np.pi / 2)
    np.testing.assert_allclose(moved.boxes.center_m, [[10.0, 7.0], [7.0, 5.0]], atol=1e-12)
    np.testing.assert_allclose(np.cos(moved.boxes.yaw_rad), [0.0, -1.0], atol=1e-12)
    assert moved.velocity_mps is not None
    np.testing.assert_allclose(moved.velocity_mps[0], [0.0, 1.0], atol=1e-12)
    assert np.isnan(moved.velocity_mps[1]).all()


def test_ego_motion_leaves_a_standing_object_at_rest() -> None:
    with_pose, without = Tracker(), Tracker()
    for k in range(20):
        boxes = Boxes(np.array([[30.0 - 1.0 * k, 2.0]]), np.array([[4.0, 2.0]]), np.zeros(1))
        seen = Detections(0.1 * k, boxes, np.ones(1), np.array(["car"]))
        there = with_pose.update(to_map(seen, 1.0 * k, 0.0, 0.0))
        here = without.update(seen)
    np.testing.assert_allclose(there.velocity_mps, [[0.0, 0.0]], atol=1e-6)
    assert not there.dynamic[0]
    # Without poses the same object is tracked relative to the vehicle, which drives at 10 m/s.
    assert here.track_id.tolist() == [1]
    np.testing.assert_allclose(here.velocity_mps, [[-10.0, 0.0]], atol=0.05)
