"""Ways and times of road users, solved so that they meet the unbraked ego where it is drawn, or do not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scenarios.drawn.actors import EGO, OUTLINES, Actor, Motion, Stays, straight
from scenarios.drawn.stage import Stage
from scenarios.drawn.values import RejectedDraw
from scenarios.openscenario.motion.paths import Pose
from smartmot.types import FloatArray

EARLIEST_S = 0.2
"""Who sets off does so no earlier after the start."""


def hit_left_m(sign: int, share_percent: float) -> float:
    """Place on the ego's width, to the left of its middle, from the side that the other comes from.

    Args:
        sign: 1 comes from the left, -1 from the right.
        share_percent: 0 at the near edge, 100 at the far one.
    """
    return sign * EGO.width_m * (0.5 - share_percent / 100.0)


def crossing(
    stage: Stage,
    outline: str,
    sign: int,
    share_percent: float,
    speed_mps: float,
    *,
    from_m: float | None,
    accelerates_m: float = 0.5,
    angle_deg: float = 0.0,
    later_s: float = 0.0,
    name: str = "Target",
) -> Actor:
    """A road user that crosses the ego's way in a straight line through a place on its front.

    When the ego's front reaches the near face of its box its middle is at that place: with the ego's speed v,
    the way D to the line, half the ego's length L/2 and half the depth e of the box along the way, at
    t = (D - L/2 - e) / v. Who sets off over the distance a to the speed u needs (S + a) / u for the way S.

    Args:
        stage: where.
        outline: of the road user.
        sign: 1 comes from the left, -1 from the right.
        share_percent: place on the ego's width, from that side.
        speed_mps: steady speed.
        from_m: distance of its start from the ego's way; None: it has moved since the scene's start.
        accelerates_m: over which it sets off.
        angle_deg: of its way to the perpendicular; positive: along with the ego.
        later_s: how much later than the ego it is there.
        name: of the actor.

    Raises:
        RejectedDraw: it would have to set off before the start.
    """
    box, angle = OUTLINES[outline], math.radians(angle_deg)
    left = hit_left_m(sign, share_percent)
    place = stage.pose(stage.line_m, left)
    pose = Pose(place.x_m, place.y_m, place.yaw_rad - sign * (math.pi / 2 - angle))
    depth_m = (box.length_m * abs(math.sin(angle)) + box.width_m * math.cos(angle)) / 2
    hit_s = stage.hit_s - depth_m / stage.speed_mps + later_s
    if from_m is None:
        way_m, motion = speed_mps * hit_s, Motion(speed_mps)
    else:
        way_m = (from_m - sign * left) / math.cos(angle)
        if way_m <= 0.0:
            raise RejectedDraw("it would start beyond the place of the contact")
        motion = Motion(speed_mps, 0.0, accelerates_m)
        sets_off_s = hit_s - motion.time_to_s(way_m)
        if sets_off_s < EARLIEST_S:
            raise RejectedDraw("it would have to set off before the start")
        motion = replace(motion, sets_off_s=round(sets_off_s, 3))
    if way_m <= 0.0:
        raise RejectedDraw("it would have to set off before the start")
    return straight(name, outline, pose.moved(-way_m, 0.0), motion, way_m + 40.0)


def merging(
    stage: Stage,
    outline: str,
    sign: int,
    share_percent: float,
    speed_mps: float,
    from_m: float,
    over_m: float,
    *,
    from_standstill: bool,
    accelerates_m: float = 6.0,
) -> Actor:
    """A road user beside the ego's lane that moves into it, and is reached from behind.

    When the ego's front reaches its rear, its near side covers the drawn share of the ego's width. Its way
    goes over by 3 p^2 - 2 p^3 from the offset beside to the middle of the ego's lane.

    Args:
        stage: where; the line is where the ego's front is then.
        outline: of the road user.
        sign: 1 it is to the left, -1 to the right.
        share_percent: of the ego's width that it covers then.
        speed_mps: steady speed.
        from_m: distance of its middle from that of the ego's lane at first.
        over_m: length over which it moves over.
        from_standstill: whether it sets off; else it has moved since the scene's start.
        accelerates_m: over which it sets off.

    Raises:
        RejectedDraw: it is in the lane from the start, or would have to set off before.
    """
    box = OUTLINES[outline]
    # offset of its middle at that instant
    then_m = EGO.width_m * (0.5 - share_percent / 100.0) + box.width_m / 2
    if then_m >= from_m - 0.1 or then_m < 0.0:
        raise RejectedDraw("it covers the drawn share of the ego's width from the start, or never")
    part = float(np.interp(1.0 - then_m / from_m, *_s_curve()))
    middle_m = stage.line_m + box.length_m / 2
    begins_m = middle_m - part * over_m

    def points(station_m: FloatArray) -> FloatArray:
        p = np.clip((station_m - begins_m) / over_m, 0.0, 1.0)
        return stage.route.poses(station_m, sign * from_m * (1.0 - p**2 * (3.0 - 2.0 * p)))[0]

    swerve = points(np.linspace(begins_m, middle_m, 50))
    swerve_m = float(np.hypot(*np.diff(swerve, axis=0).T).sum())
    if from_standstill:
        motion, start_m = Motion(speed_mps, 0.0, accelerates_m), begins_m
        sets_off_s = stage.hit_s - motion.time_to_s(swerve_m)
        if sets_off_s < EARLIEST_S:
            raise RejectedDraw("it would have to set off before the start")
        motion = replace(motion, sets_off_s=round(sets_off_s, 3))
    else:
        motion, start_m = Motion(speed_mps), begins_m - (speed_mps * stage.hit_s - swerve_m)
        if start_m > begins_m:
            raise RejectedDraw("it would move over before the start")
    way = points(np.arange(start_m, begins_m + over_m + 30.0, 1.0))
    return Actor("Target", outline, way, motion, smooth=True)


def _s_curve() -> tuple[FloatArray, FloatArray]:
    """Values of 3 p^2 - 2 p^3 and p, for its inverse."""
    p = np.linspace(0.0, 1.0, 1001)
    return p**2 * (3.0 - 2.0 * p), p


def along(
    name: str,
    outline: str,
    stage: Stage,
    station_m: float,
    left_m: float,
    speed_mps: float,
    end_s: float,
    stays: Stays,
) -> Actor:
    """A road user that moves along the ego's way at an offset: with it, or against it with a negative speed.

    Args:
        name: of the actor.
        outline: of the road user.
        stage: where.
        station_m: at the start.
        left_m: to the left of the ego's way.
        speed_mps: along the way.
        end_s: until when its way has to reach.
        stays: where it keeps to.
    """
    to_m = station_m + speed_mps * (end_s + 3.0) + math.copysign(5.0, speed_mps)
    points = stage.beside(station_m, to_m, left_m)
    return Actor(name, outline, points, Motion(abs(speed_mps)), True, stays)
