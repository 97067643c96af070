"""Scripted road users against the equations of uniformly accelerated motion."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from scenarios.actors import KMH, Actor, Actors

WALK_MPS = 5 * KMH


def walker(**changes: float) -> Actor:
    values = {"speed_mps": WALK_MPS, "accel_distance_m": 1.0, "path_m": 8.0, **changes}
    return Actor("pedestrian", "target", 10.0, -4.0, math.pi / 2, 0.6, 0.5, **values)


def speed_after(actor: Actor, time_s: float) -> float:
    """v = a t with a = v^2 / 2 G until the run-up is over, then constant."""
    accel = actor.speed_mps**2 / (2 * actor.accel_distance_m)
    return min(accel * time_s, actor.speed_mps)


@pytest.mark.parametrize("time_s", [0.2, 1.0, 1.44, 2.5, 4.0])
def test_run_up_is_a_constant_acceleration(time_s: float) -> None:
    actor = walker()
    distance, speed = Actors([actor]).motion(time_s)
    assert speed[0] == pytest.approx(speed_after(actor, time_s))
    expected, _ = quad(lambda t: speed_after(actor, t), 0, time_s, points=[1.44], limit=200)
    assert distance[0] == pytest.approx(expected, abs=1e-9)


def test_run_up_takes_twice_the_time_of_driving_it_at_speed() -> None:
    distance, speed = Actors([walker()]).motion(2 * 1.0 / WALK_MPS)
    assert distance[0] == pytest.approx(1.0)
    assert speed[0] == pytest.approx(WALK_MPS)


def test_without_a_run_up_the_speed_is_there_at_once() -> None:
    distance, speed = Actors([walker(accel_distance_m=0.0)]).motion(1e-6)
    assert speed[0] == WALK_MPS
    assert distance[0] == pytest.approx(WALK_MPS * 1e-6)


@given(st.floats(0.001, 8.0), st.sampled_from([0.0, 0.5, 1.0, 3.0]))
def test_time_to_a_distance_inverts_the_motion(distance_m: float, accel_distance_m: float) -> None:
    actor = walker(accel_distance_m=accel_distance_m)
    gone, _ = Actors([actor]).motion(actor.time_to(distance_m))
    assert gone[0] == pytest.approx(distance_m, abs=1e-9)


def test_time_to_a_place_it_never_reaches_is_infinite() -> None:
    assert walker().time_to(8.001) == math.inf
    assert walker(speed_mps=0.0).time_to(0.5) == math.inf


def test_nobody_moves_before_the_trigger() -> None:
    actors = Actors([walker()])
    for since in (None, -1.0, 0.0):
        distance, speed = actors.motion(since)
        assert distance[0] == speed[0] == 0.0
        assert actors.centers(since).tolist() == [[10.0, -4.0]]


def test_walks_along_its_heading_and_stands_at_the_end_of_its_path() -> None:
    boxes = Actors([walker()]).boxes(60.0)
    assert boxes.center_m[0] == pytest.approx([10.0, 4.0])
    assert boxes.size_m[0].tolist() == [0.6, 0.5]
    assert Actors([walker()]).motion(60.0)[1][0] == 0.0


def test_several_actors_keep_their_order_and_do_not_touch_each_other() -> None:
    standing = Actor("car", "adversary", 1.0, 2.0, 0.3, 4.4, 1.8)
    both = Actors([standing, walker()])
    assert both.category.tolist() == ["car", "pedestrian"]
    distance, speed = both.motion(3.0)
    assert distance[0] == speed[0] == 0.0
    assert distance[1] == Actors([walker()]).motion(3.0)[0][0]


def test_a_world_without_actors() -> None:
    nobody = Actors([])
    assert len(nobody) == len(nobody.boxes(1.0)) == 0
    assert nobody.centers(None).shape == (0, 2)
    assert np.isfinite(nobody.motion(1.0)[0]).all()
