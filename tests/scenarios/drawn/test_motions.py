"""Times solved for a contact, against the geometry on a straight street."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarios.drawn.actors import OUTLINES, Motion, straight
from scenarios.drawn.map_set import MAPS
from scenarios.drawn.situations.motions import along, crossing, hit_left_m, merging
from scenarios.drawn.stage import Ground, Stage, way_over
from scenarios.drawn.timeline import Timeline
from scenarios.drawn.values import RejectedDraw

SPEED, LEAD = 10.0, 5.0
LINE_X = 300.0


@pytest.fixture(scope="module")
def stage() -> Stage:
    """The ego drives eastwards at y = -1.625 and would be at x = 300 after 5 s."""
    ground = Ground(MAPS / "straight_street.xodr")
    lane = ground.network.lane_index_of(("1", 0, -1))
    route, line = way_over(ground.network, [lane], LINE_X, SPEED * LEAD)
    return Stage(ground, route, line, SPEED, LEAD, "straight")


def test_sides_of_a_straight_street(stage: Stage) -> None:
    near, far = stage.side(stage.line_m, stage.near), stage.side(stage.line_m, -stage.near)
    assert stage.near == -1
    assert (near.kerb_m, far.kerb_m) == pytest.approx((1.625, 1.625 + 3.25))
    assert near.sidewalk is not None
    assert near.sidewalk.width_m == pytest.approx(2.5)
    oncoming = far.nearest("driving", same_way=False)
    assert oncoming is not None
    assert oncoming.middle_m == pytest.approx(3.25)


def test_the_inner_lane_of_two_is_not_at_the_edge() -> None:
    """Cyclists ride at the edge, not between two lanes."""
    ground = Ground(MAPS / "one_way_street.xodr")
    for lane, outermost in ((-1, False), (-2, True)):
        route, line = way_over(ground.network, [ground.network.lane_index_of(("1", 0, lane))], LINE_X, 50.0)
        stage = Stage(ground, route, line, SPEED, LEAD, "straight")
        assert stage.side(stage.line_m, stage.near).is_outermost == outermost


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("share", [10.0, 50.0, 90.0])
@pytest.mark.parametrize("from_m", [4.0, None])
def test_a_pedestrian_is_at_its_place_on_the_front_when_the_front_is_there(
    stage: Stage, sign: int, share: float, from_m: float | None
) -> None:
    actor = crossing(stage, "adult", sign, share, 1.5, from_m=from_m)
    # the front reaches the near face of the 0.5 m wide box 2.2 + 0.25 m before the line
    hit_s = (LEAD * SPEED - 2.2 - 0.25) / SPEED
    (at,), (heading,) = actor.poses(np.array([hit_s]))
    assert at == pytest.approx([LINE_X, -1.625 + hit_left_m(sign, share)], abs=2e-3)
    assert math.sin(heading) == pytest.approx(-sign)
    if from_m is not None:
        assert abs(actor.start.y_m + 1.625) == pytest.approx(from_m, abs=1e-6)


def test_shares_count_from_the_side_of_the_other() -> None:
    assert hit_left_m(1, 0.0) == pytest.approx(0.9)
    assert hit_left_m(1, 100.0) == pytest.approx(-0.9)
    assert hit_left_m(-1, 25.0) == pytest.approx(-0.45)


def test_a_slant_moves_the_start_along_the_road(stage: Stage) -> None:
    actor = crossing(stage, "adult", 1, 50.0, 2.0, from_m=None, angle_deg=30.0)
    start = actor.start
    aside = start.y_m + 1.625
    assert (LINE_X - start.x_m) / aside == pytest.approx(math.tan(math.radians(30.0)), abs=1e-6)


def test_who_is_too_far_away_to_set_off_is_rejected(stage: Stage) -> None:
    with pytest.raises(RejectedDraw, match="set off before the start"):
        crossing(stage, "adult", 1, 50.0, 1.0, from_m=6.0)


def test_a_gap_of_time_is_a_gap_of_way(stage: Stage) -> None:
    """Who comes 2 s later at 1.5 m/s is 3 m before its place when the front is there."""
    actor = crossing(stage, "adult", 1, 50.0, 1.5, from_m=None, later_s=2.0)
    (at,), _ = actor.poses(np.array([LEAD - 0.245]))
    assert at[1] + 1.625 == pytest.approx(3.0, abs=1e-6)
    assert float(Timeline(stage).gap_m(actor).min()) > 0.5


@pytest.mark.parametrize("share", [20.0, 60.0])
@pytest.mark.parametrize("from_standstill", [True, False])
def test_who_moves_over_covers_the_drawn_share_when_reached(
    stage: Stage, share: float, from_standstill: bool
) -> None:
    actor = merging(
        stage, "bicyclist", -1, share, 3.0, 2.6, 12.0, from_standstill=from_standstill, accelerates_m=1.0
    )
    (at,), _ = actor.poses(np.array([(LEAD * SPEED - 2.2) / SPEED]))
    box = OUTLINES["bicyclist"]
    # it stands to the right: its left side is that share of 1.8 m to the left of the ego's right one
    assert at[1] + box.width_m / 2 == pytest.approx(-1.625 - 0.9 + share / 100 * 1.8, abs=0.03)
    assert at[0] - box.length_m / 2 == pytest.approx(LINE_X, abs=0.03)


def test_a_driver_brakes_for_who_would_be_hit_within_the_time_to_stop(stage: Stage) -> None:
    """At 10 m/s and 3.4 m/s2 that are 1.47 s: who stands by then is not braked for."""
    timeline = Timeline(stage)
    for stops_before_s, braked_for in ((2.0, False), (1.0, True)):
        # walks at 2 m/s to 1.5 m before the ego's way, so that it would be hit in going on
        walks_s = LEAD - 0.22 - stops_before_s
        pose = stage.pose(stage.line_m, -1.5 - 2.0 * walks_s, math.pi / 2)
        motion = Motion(2.0, brakes_after_m=2.0 * walks_s - 0.05, brakes_m=0.05)
        assert timeline.is_braked_for(straight("Target", "adult", pose, motion)) == braked_for


def test_no_driver_brakes_for_who_walks_along_the_road(stage: Stage) -> None:
    timeline = Timeline(stage)
    actor = along("Target", "adult", stage, stage.line_m - 5.0, -2.5, 1.3, 6.0, "off")
    assert not timeline.is_braked_for(actor)
