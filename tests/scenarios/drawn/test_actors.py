"""Ways covered by road users against closed forms."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from scenarios.drawn.actors import Motion


def test_a_steady_walker_covers_speed_times_time() -> None:
    assert Motion(1.5).way_m(np.array([0.0, 2.0])) == pytest.approx([0.0, 3.0])


def test_setting_off_takes_twice_as_long_as_the_same_way_at_full_speed() -> None:
    motion = Motion(2.0, sets_off_s=1.0, accelerates_m=1.0)
    # constant acceleration over 1 m to 2 m/s lasts 1 s: half way after 0.5 s is a quarter of it
    assert motion.way_m(np.array([1.0, 1.5, 2.0, 3.0])) == pytest.approx([0.0, 0.25, 1.0, 3.0])
    assert motion.time_to_s(3.0) == pytest.approx(2.0)
    assert motion.time_to_s(0.25) == pytest.approx(0.5)


def test_braking_ends_after_its_distance() -> None:
    motion = Motion(2.0, brakes_after_m=4.0, brakes_m=1.0)
    time = np.linspace(0.0, 5.0, 50_001)
    # 2 s steady, then from 2 m/s to 0 over 1 m, which takes 1 s
    speed = np.clip(2.0 - 2.0 * (time - 2.0), 0.0, 2.0)
    expected = cumulative_trapezoid(speed, time, initial=0.0)
    assert motion.way_m(time) == pytest.approx(expected, abs=1e-7)
    assert motion.way_m(np.array([5.0])) == pytest.approx([5.0])
