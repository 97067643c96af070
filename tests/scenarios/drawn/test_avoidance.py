"""What can be avoided at best, against stopping distances by hand."""

from __future__ import annotations

import math

import pytest

from scenarios.drawn.actors import Motion, standing, straight
from scenarios.drawn.avoidance import avoidance
from scenarios.drawn.map_set import MAPS
from scenarios.drawn.situations.motions import crossing
from scenarios.drawn.stage import Ground, Stage, way_over

LEAD = 5.0


def stage_at(speed_mps: float) -> Stage:
    """The ego drives eastwards at y = -1.625 and would be at x = 300 after 5 s."""
    ground = Ground(MAPS / "straight_street.xodr")
    lane = ground.network.lane_index_of(("1", 0, -1))
    route, line = way_over(ground.network, [lane], 300.0, speed_mps * LEAD)
    return Stage(ground, route, line, speed_mps, LEAD, "straight")


def test_notice_begins_when_the_target_sets_off() -> None:
    stage = stage_at(10.0)
    target = crossing(stage, "adult", -1, 50.0, 1.5, from_m=3.0)
    # 3 m to the ego's middle, the first 0.5 m of them in twice the time
    assert avoidance(stage, [target], LEAD - 0.245).notice_s == pytest.approx(3.5 / 1.5, abs=0.01)


@pytest.mark.parametrize(("from_m", "avoidable"), [(1.0, False), (2.5, True)])
def test_who_steps_out_close_by_cannot_be_avoided(from_m: float, avoidable: bool) -> None:
    """Delay, half of the build-up and v / (2 x 8.8 m/s2) are 1.35 s at 60 km/h; it is there in 1 and 2 s."""
    stage = stage_at(60.0 / 3.6)
    target = crossing(stage, "adult", -1, 50.0, 1.5, from_m=from_m)
    left = avoidance(stage, [target], LEAD - 2.45 / stage.speed_mps)
    assert left.notice_s == pytest.approx((from_m + 0.5) / 1.5, abs=0.01)
    assert left.avoidable == avoidable


def test_who_stands_behind_a_parked_car_is_noticed_when_it_comes_out() -> None:
    stage = stage_at(10.0)
    target = crossing(stage, "child", -1, 50.0, 1.5, from_m=4.0)
    alone = avoidance(stage, [target], LEAD - 0.235)
    car = standing("Parked", "large car", stage.pose(stage.line_m - 3.0, -3.0))
    hidden = avoidance(stage, [target, car], LEAD - 0.235)
    assert alone.notice_s == pytest.approx(4.5 / 1.5, abs=0.01)
    assert hidden.notice_s < alone.notice_s - 1.0
    # its middle is seen beyond the car's corner, 2.09 m aside, at (d - 5.2) / d of its own distance
    ahead_m = 10.0 * hidden.notice_s + 2.3
    aside_m = 1.5 * hidden.notice_s
    assert aside_m / ahead_m == pytest.approx(2.09 / (ahead_m - 5.2), rel=0.3)
    assert math.isfinite(aside_m)


def test_who_walks_into_a_standing_ego_cannot_be_avoided_by_braking() -> None:
    """Noticed 16 m before the line, the ego stops 6.3 m before it, its front 4.1 m."""
    stage = stage_at(10.0)
    motion = Motion(1.5, sets_off_s=3.4)
    towards = straight("Target", "adult", stage.pose(stage.line_m, 0.0, math.pi), motion)
    away = straight("Target", "adult", stage.pose(stage.line_m), motion)
    assert not avoidance(stage, [towards], LEAD - 0.25).avoidable
    assert avoidance(stage, [away], LEAD - 0.25).avoidable
