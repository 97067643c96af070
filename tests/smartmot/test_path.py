"""Places beside a planned path."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmot import PlannedPath

CORNER = PlannedPath.through([[0.0, 0.0], [30.0, 0.0], [30.0, 50.0]])


@given(st.floats(30.0, 90.0), st.floats(-90.0, -1e-6))
def test_outside_a_corner_the_distance_is_that_from_the_corner(x_m: float, y_m: float) -> None:
    station, offset = CORNER.project(x_m, y_m)
    assert station == pytest.approx(30.0)
    assert offset == pytest.approx(-np.hypot(x_m - 30.0, y_m))


PATHS = st.lists(st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)), min_size=2, max_size=30).filter(
    lambda points: (np.hypot(*np.diff(points, axis=0).T) > 0.1).all()
)
"""Points of polylines, with any corners: few, which a loop goes through, and more."""


@given(PATHS, st.lists(st.tuples(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)), min_size=1, max_size=5))
def test_one_point_is_projected_as_among_many(
    points: list[tuple[float, float]], where: list[tuple[float, float]]
) -> None:
    path = PlannedPath.through(points)
    station, offset = path.place(np.array(where))
    for k, (x_m, y_m) in enumerate(where):
        for _ in range(2):  # asked again, it is remembered
            assert path.project(x_m, y_m) == pytest.approx((station[k], offset[k]), abs=1e-9)


@given(PATHS, st.lists(st.floats(-30.0, 300.0), min_size=1, max_size=9), st.floats(-5.0, 5.0))
def test_poses_lie_beside_the_last_joint_that_was_passed(
    points: list[tuple[float, float]], stations: list[float], offset_m: float
) -> None:
    """By hand, one at a time: the segment is the last that begins there or before, else the first."""
    path = PlannedPath.through(points)
    center, yaw = path.poses(np.array(stations), offset_m)
    for station, where, heading in zip(stations, center, yaw, strict=True):
        begun = [k for k in range(len(points) - 1) if path.station_m[k] <= station]
        k = begun[-1] if begun else 0
        (x0, y0), (x1, y1) = points[k], points[k + 1]
        expected_rad = np.arctan2(y1 - y0, x1 - x0)
        along = station - path.station_m[k]
        c, s = np.cos(expected_rad), np.sin(expected_rad)
        expected = np.array([x0 + c * along - s * offset_m, y0 + s * along + c * offset_m])
        np.testing.assert_allclose(where, expected, atol=1e-9)
        assert np.cos(heading - expected_rad) == pytest.approx(1.0)
