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
