"""Followers behind a vehicle that brakes, against closed forms of constant decelerations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.metrics.rear_end import Exposure, Followers, closing_speeds, exposure
from smartmot.errors import ShapeError
from smartmot.types import FloatArray


def braking(speed: float, decel: float, to: float = 0.0, after: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """A vehicle that drives on for a while, brakes to a speed, and keeps that."""
    ends = after + (speed - to) / decel
    return np.array([0.0, after, ends, ends + 1.0]), np.array([speed, speed, to, to])


def closing(curve: tuple[FloatArray, FloatArray], gap_s: float, dead_s: float, decel: float) -> float:
    return float(closing_speeds(*curve, np.array([gap_s]), np.array([dead_s]), decel)[0])


def stop_gap_m(speed: float, dead: float, own: float, ahead: float) -> float:
    """Gap that is just enough behind a full stop: v dead + v^2 / 2b - v^2 / 2a."""
    return speed * dead + speed**2 / (2 * own) - speed**2 / (2 * ahead)


@pytest.mark.parametrize(("own", "ahead"), [(7.6, 8.8), (5.0, 9.0), (4.0, 4.0)])
def test_a_full_stop_needs_a_gap_of_dead_time_and_stopping_distances(own: float, ahead: float) -> None:
    """At 15 m/s after 1.2 s: both come to a stop, and touch if the gap is less."""
    gap_s = stop_gap_m(15.0, 1.2, own, ahead) / 15.0
    assert math.isnan(closing(braking(15.0, ahead), gap_s + 0.005, 1.2, own))
    assert closing(braking(15.0, ahead), gap_s - 0.005, 1.2, own) >= 0.0


@pytest.mark.parametrize("gap_s", [0.3, 0.6, 0.9])
def test_the_closing_speed_of_a_follower_who_has_not_braked_yet(gap_s: float) -> None:
    """Within the dead time only the vehicle ahead brakes: gap = a t^2 / 2, closing speed a t."""
    meets_s = math.sqrt(2 * gap_s * 15.0 / 9.0)
    assert meets_s < 2.0
    stopped_s = 15.0 / 9.0  # after that the vehicle ahead stands
    expected = 9.0 * meets_s if meets_s <= stopped_s else 15.0
    assert closing(braking(15.0, 9.0), gap_s, 5.0, 7.6) == pytest.approx(expected, abs=0.3)


def test_the_closing_speed_at_a_vehicle_that_has_stopped() -> None:
    """It stops in 12.8 m and 1.7 s; the follower has 26.8 m, 15 m of them without braking, for 2.1 s."""
    speed, dead, own, ahead, gap = 15.0, 1.0, 7.6, 8.8, 14.0
    way = gap + speed**2 / (2 * ahead)
    expected = math.sqrt(speed**2 - 2 * own * (way - speed * dead))
    assert closing(braking(speed, ahead), gap / speed, dead, own) == pytest.approx(expected, abs=0.25)


@given(st.floats(2.0, 30.0), st.floats(0.0, 0.9), st.floats(0.1, 2.0), st.floats(1.0, 9.0))
def test_who_brakes_as_hard_needs_only_the_way_of_the_dead_time(
    speed: float, share: float, dead: float, decel: float
) -> None:
    """A copy of the speed ahead, so much later: in all dead times the speed that was lost."""
    curve, needed_s = braking(speed, decel, share * speed), dead * (1.0 - share)
    assert math.isnan(closing(curve, needed_s * 1.02 + 0.02, dead, decel))
    if needed_s > 0.1:
        assert not math.isnan(closing(curve, needed_s * 0.98 - 0.02, dead, decel))


@given(
    st.floats(2.0, 30.0), st.floats(0.0, 1.0), st.floats(0.2, 3.0), st.floats(0.1, 2.5), st.floats(2.0, 9.0)
)
def test_longer_gaps_and_shorter_reactions_never_hit_harder_or_more(
    speed: float, share: float, gap: float, dead: float, own: float
) -> None:
    curve = braking(speed, 8.8, share * speed)
    hits = [not math.isnan(closing(curve, gap + k * 0.2, dead, own)) for k in range(4)]
    assert hits == sorted(hits, reverse=True)
    hits = [not math.isnan(closing(curve, gap, dead + k * 0.2, own)) for k in range(4)]
    assert hits == sorted(hits)


def test_a_constant_speed_or_a_faster_one_costs_nobody_anything() -> None:
    constant = np.array([0.0, 3.0]), np.array([10.0, 10.0])
    faster = np.array([0.0, 3.0]), np.array([10.0, 14.0])
    for curve in (constant, faster):
        assert exposure(*curve, Followers()) == Exposure(0.0, 0.0)


def test_the_distribution_is_the_one_that_is_written() -> None:
    """Median 1.45 s, never below the shift; reactions 1.25 s on average, and 0.3 s of build-up."""
    many = Followers(count=401)
    assert np.median(many.gap_s) == pytest.approx(1.45)
    assert many.gap_s.min() > 0.26
    assert np.std(np.log(many.gap_s - 0.26)) == pytest.approx(0.4, abs=0.01)
    assert many.dead_s.mean() == pytest.approx(1.55, abs=0.01)
    # so few stand for it: the share changes by less than a tenth
    stop = braking(50 / 3.6, 8.8)
    assert exposure(*stop, Followers()).share == pytest.approx(
        exposure(*stop, Followers(count=60)).share, abs=0.05
    )


def test_a_short_braking_is_worth_less_than_a_stop() -> None:
    """From 50 km/h with 8.8 m/s2: a stop is touched by half of the followers, a loss of 3 m/s by none."""
    stop, brief = braking(50 / 3.6, 8.8), braking(50 / 3.6, 8.8, 50 / 3.6 - 3.0)
    assert 0.4 < exposure(*stop, Followers()).share < 0.7
    assert exposure(*brief, Followers()).share < 0.05


def test_mistakes_are_named() -> None:
    one, two = np.array([1.0]), np.array([1.0, 2.0])
    for wrong in (
        lambda: closing_speeds(two, one, one, one, 5.0),
        lambda: closing_speeds(two[::-1], two, one, one, 5.0),
        lambda: closing_speeds(two, -two, one, one, 5.0),
        lambda: closing_speeds(two, two, one, two, 5.0),
        lambda: closing_speeds(np.zeros(0), np.zeros(0), one, one, 5.0),
        lambda: Followers(median_s=0.2),
        lambda: Followers(decel_mps2=0.0),
        lambda: Followers(count=0),
        lambda: Followers(reaction_s=math.nan),
    ):
        with pytest.raises(ShapeError, match="followers"):
            wrong()
