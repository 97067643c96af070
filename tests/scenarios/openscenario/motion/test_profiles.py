import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scenarios.openscenario.motion.profiles import Piece, SpeedProfile, transition
from scenarios.openscenario.running.synchronize import MOST_MPS2, approach, final_speed_without_wish


@pytest.mark.parametrize("shape", ["linear", "cubic", "sinusoidal"])
def test_distance_is_the_integral_of_speed(shape):
    profile = SpeedProfile(
        2.0, 3.0, [Piece(4.0, 3.0, 9.0, shape), Piece(1.0, 9.0, 9.0), Piece(2.0, 9.0, 0.0, shape)]
    )
    time = np.linspace(2.0, 12.0, 20_001)
    distance, speed = np.array([profile.at(t) for t in time]).T
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    np.testing.assert_allclose(distance, integral, atol=1e-6)
    assert distance[-1] == pytest.approx(24.0 + 9.0 + 9.0)
    assert speed[-1] == 0.0


@pytest.mark.parametrize(
    ("shape", "dimension", "value", "duration"),
    [
        ("step", "time", 3.0, 0.0),
        ("linear", "time", 3.0, 3.0),
        ("linear", "rate", 2.0, 4.0),  # 8 m/s at 2 m/s2
        ("linear", "distance", 36.0, 6.0),  # mean speed 6 m/s
        ("cubic", "rate", 2.0, 6.0),  # steepest slope is 1.5 times the mean
        ("sinusoidal", "rate", 2.0, 2.0 * math.pi),  # and pi / 2 times
    ],
)
def test_transitions_from_2_to_10_mps(shape, dimension, value, duration):
    pieces = transition(shape, dimension, value, 2.0, 10.0)
    assert sum(piece.duration_s for piece in pieces) == pytest.approx(duration)
    if pieces and dimension == "rate":
        profile = SpeedProfile(0.0, 2.0, pieces)
        step = 1e-5
        slopes = [
            (profile.at(t + step)[1] - profile.at(t)[1]) / step
            for t in np.linspace(0.0, duration - step, 1001)
        ]
        assert max(slopes) == pytest.approx(2.0, rel=1e-3)


def test_sets_off():
    assert SpeedProfile(1.0, 0.0).sets_off_s() == math.inf
    assert SpeedProfile(1.0, 2.0).sets_off_s() == 1.0
    assert SpeedProfile(1.0, 0.0, [Piece(3.0, 0.0, 0.0), Piece(1.0, 0.0, 2.0)]).sets_off_s() == 4.0


SPEED = st.floats(0.0, 40.0)


@given(SPEED, st.floats(0.1, 40.0), st.floats(0.1, 500.0), st.floats(0.1, 200.0))
def test_an_approach_arrives_in_time_with_the_final_speed(v0, v1, distance, time):
    pieces = approach(v0, v1, distance, time)
    assert pieces is not None
    profile = SpeedProfile(0.0, v0, pieces)
    assert profile.end_s == pytest.approx(time)
    assert profile.length_m == pytest.approx(distance, rel=1e-6, abs=1e-6)
    assert profile.final_mps == v1
    assert pieces[0].start_mps == v0
    for piece in pieces:
        assert piece.duration_s >= -1e-9
        assert min(piece.start_mps, piece.end_mps) >= 0.0
    moving = [p for p in pieces if p.start_mps != p.end_mps and p.duration_s > 1e-6]
    rates = [abs(p.end_mps - p.start_mps) / p.duration_s for p in moving]
    assume(len(rates) == 2)
    assert rates[0] == pytest.approx(rates[1], rel=1e-3, abs=1e-6)  # accelerations of one size


@given(SPEED, st.floats(0.1, 40.0), st.floats(0.1, 500.0), st.floats(0.1, 200.0), st.floats(0.1, 0.9))
def test_an_approach_goes_beyond_the_final_speed_only_if_it_must(v0, v1, distance, time, share):
    """It must if even the final speed from now on does not cover the way, or covers too much of it.

    Or if it would have to change its speed by more than 1 g, which nobody can.
    """
    pieces = approach(v0, v1, distance, time)
    assert pieces is not None
    beyond = [p for p in pieces if (p.end_mps - v1) * (v1 - v0) > 1e-9]
    must = (distance - v1 * time) * (v1 - v0) >= -1e-6
    must = must or (v1 - v0) ** 2 >= 0.999 * MOST_MPS2 * 2.0 * abs(v1 * time - distance)
    assert must or not beyond
    # the plan is the same when it is made again on the way, as long as the master keeps its own
    profile = SpeedProfile(0.0, v0, pieces)
    if beyond or len(pieces) != 2:
        return
    done_m, speed = profile.at(share * time)
    later = approach(speed, v1, distance - done_m, time - share * time)
    assert later is not None
    again = SpeedProfile(share * time, speed, later)
    assert again.at((1.0 + share) / 2 * time)[1] == pytest.approx(
        profile.at((1.0 + share) / 2 * time)[1], rel=1e-3, abs=1e-3
    )


def test_approach_by_hand():
    # at rest, 3 m to go in 10 s, 2 m/s at the end: wait 7 s, then 3 s at 2/3 m/s2
    pieces = approach(0.0, 2.0, 3.0, 10.0)
    assert pieces is not None
    assert [p.duration_s for p in pieces] == pytest.approx([0.0, 7.0, 3.0])
    # at rest, 3 m in 2 s, 2 m/s at the end: 1 m in 1 s while it sets off, then 2 m in 1 s
    assert approach(0.0, 2.0, 3.0, 2.0) == (Piece(1.0, 0.0, 2.0), Piece(1.0, 2.0, 2.0))
    # from 6 m/s, 5 m in 2 s, 1 m/s at the end: 3.5 m/s on average while it brakes, then 1 m/s
    assert approach(6.0, 1.0, 5.0, 2.0) == (Piece(1.2, 6.0, 1.0), Piece(0.8, 1.0, 1.0))
    # from rest, 9.9 m in 5 s, 2 m/s at the end: 2 m/s after 0.1 s would be 20 m/s2, so faster in between:
    # vx = (19.8 + sqrt(2 (2 x 9.9^2 - 20 x 9.9 + 4 x 25))) / 10, at (2 vx - 2) / 5 m/s2
    fast = (19.8 + math.sqrt(2.0 * (2.0 * 9.9**2 - 20.0 * 9.9 + 100.0))) / 10.0
    pieces = approach(0.0, 2.0, 9.9, 5.0)
    assert pieces is not None
    assert pieces[0].end_mps == pytest.approx(fast)
    assert fast / pieces[0].duration_s == pytest.approx((2.0 * fast - 2.0) / 5.0)
    # 5 m in 2 s: 2 m/s do not do, so faster in between: vx = (10 + sqrt(52)) / 4
    fast = approach(0.0, 2.0, 5.0, 2.0)
    assert fast is not None
    assert fast[0].end_mps == pytest.approx((10.0 + math.sqrt(52.0)) / 4.0)
    assert approach(5.0, 5.0, 50.0, 10.0) == (Piece(10.0, 5.0, 5.0),)
    assert approach(1.0, 1.0, 0.0, 1.0) is None
    assert approach(1.0, 1.0, 1.0, 0.0) is None
    assert final_speed_without_wish(2.0, 30.0, 10.0) == 4.0
    assert final_speed_without_wish(9.0, 30.0, 10.0) == 0.0
