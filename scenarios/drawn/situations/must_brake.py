"""Situations in which the ego must brake: unbraked it hits the target first, with its front."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scenarios.drawn.actors import OUTLINES, Actor, Motion, standing
from scenarios.drawn.situations.motions import EARLIEST_S, crossing, merging
from scenarios.drawn.situations.situation import Situation
from scenarios.drawn.situations.vehicles import CAR_GAP_M, crossing_car, parked_row
from scenarios.drawn.stage import Stage
from scenarios.drawn.values import Draw, RejectedDraw
from smartmot.maps.walks import SIDEWALK_TYPES

Made = tuple[Stage, list[Actor]]


def _side(stage: Stage, draw: Draw) -> int:
    """From which side: 1 left, -1 right."""
    return stage.near * (1 if draw.text("side") == "near" else -1)


def _on_foot(draw: Draw) -> tuple[str, float]:
    """Outline and speed of a pedestrian that walks or runs."""
    outline = draw.text("pedestrian")
    gait = draw.text("gait")
    return outline, draw.number("walking_speed_mps" if gait == "walks" else "running_speed_mps")


def crosses(stage: Stage, draw: Draw) -> Made:
    """A pedestrian sets off from beside the kerb and crosses at a right angle, walking or running."""
    sign = _side(stage, draw)
    outline, speed = _on_foot(draw)
    from_m = stage.side(stage.line_m, sign).kerb_m + draw.number("beyond_kerb_m")
    share, ramp = draw.number("share_percent"), draw.number("sets_off_over_m")
    return stage, [crossing(stage, outline, sign, share, speed, from_m=from_m, accelerates_m=ramp)]


def crosses_diagonally(stage: Stage, draw: Draw) -> Made:
    """A pedestrian that has walked since the start crosses at a slant, with or against the ego's way."""
    sign = _side(stage, draw)
    outline, speed = _on_foot(draw)
    share = draw.number("share_percent")
    angle = draw.sign() * draw.number("slant_deg")
    draw.values["slant_deg"] = angle
    return stage, [crossing(stage, outline, sign, share, speed, from_m=None, angle_deg=angle)]


def steps_from_the_middle(stage: Stage, draw: Draw) -> Made:
    """A pedestrian stands in the middle of the road, beside the ego's lane, and goes on."""
    sign = -stage.near
    half_width = stage.side(stage.line_m, sign).half_width_m
    outline, speed = _on_foot(draw)
    from_m = half_width + draw.number("beyond_lane_m")
    share, ramp = draw.number("share_percent"), draw.number("sets_off_over_m")
    return stage, [crossing(stage, outline, sign, share, speed, from_m=from_m, accelerates_m=ramp)]


def runs_from_far_aside(stage: Stage, draw: Draw) -> Made:
    """A runner that comes from outside every area around the road, at the same speed since the start."""
    sign = _side(stage, draw)
    outline, speed = draw.text("pedestrian"), draw.number("running_speed_mps")
    target = crossing(stage, outline, sign, draw.number("share_percent"), speed, from_m=None)
    return stage, [target]


def crosses_from_behind_parked_cars(stage: Stage, draw: Draw) -> Made:
    """A pedestrian steps out in front of a row of parked cars on the near side, which hides it."""
    sign = stage.near
    outline, speed = _on_foot(draw)
    before_m = draw.number("behind_car_m") + OUTLINES[outline].width_m / 2
    share, ramp = draw.number("share_percent"), draw.number("sets_off_over_m")
    row = parked_row(stage, draw, sign, stage.line_m - before_m, backwards=True, name="Parked")
    beside = abs(stage.route.project(row[0].start.x_m, row[0].start.y_m)[1])
    from_m = beside + draw.number("behind_row_m")
    target = crossing(stage, outline, sign, share, speed, from_m=from_m, accelerates_m=ramp)
    return stage, [target, *row]


def cyclist_crosses(stage: Stage, draw: Draw) -> Made:
    """A cyclist crosses at the same speed since the start, from 8 m aside or more."""
    sign = _side(stage, draw)
    speed = draw.number("cyclist_speed_mps")
    angle = draw.sign() * draw.number("cyclist_slant_deg")
    share = draw.number("share_percent")
    return stage, [crossing(stage, "bicyclist", sign, share, speed, from_m=None, angle_deg=angle)]


def cyclist_moves_into_the_lane(stage: Stage, draw: Draw) -> Made:
    """A cyclist on the cycle lane, or at the edge, moves over into the ego's lane."""
    sign = stage.near
    side = stage.side(stage.line_m, sign)
    strip = side.nearest("biking")
    edge = strip.middle_m if strip else side.half_width_m + draw.number("cyclist_beyond_edge_m")
    if edge > side.paved_m - 0.25 or not (strip or side.is_outermost):
        raise RejectedDraw("a cyclist has no room beside the ego's lane")
    speed = draw.number("cyclist_speed_mps")
    if speed > 0.8 * stage.speed_mps:
        raise RejectedDraw("the cyclist is as fast as the ego")
    share, over = draw.number("overlap_percent"), draw.number("moves_over_s") * speed
    return stage, [merging(stage, "bicyclist", sign, share, speed, edge, over, from_standstill=False)]


def queue_behind_a_bend(stage: Stage, draw: Draw) -> Made:
    """Cars stand in the ego's lane behind a bend; the last one is the target."""
    count = 1 + int(draw.uniform() * 3)
    draw.values["cars"] = float(count)
    room = stage.side(stage.line_m, 1).half_width_m - OUTLINES["large car"].width_m / 2
    actors: list[Actor] = []
    station = stage.line_m
    for number in range(count):
        outline = draw.text("car")
        length = OUTLINES[outline].length_m
        left = round((2.0 * draw.uniform() - 1.0) * max(room, 0.0) * 0.7, 3)
        station += length / 2
        if station > stage.route.length_m - 3.0:
            break
        name = "Target" if number == 0 else f"Queue {number}"
        actors.append(standing(name, outline, stage.pose(station, left)))
        station += length / 2 + draw.between(*CAR_GAP_M)
    return stage, actors


def car_pulls_out(stage: Stage, draw: Draw) -> Made:
    """A car parked on the near side pulls out into the ego's lane."""
    sign = stage.near
    outline = draw.text("car")
    parked = parked_row(stage, draw, sign, stage.line_m, backwards=False, name="Target", count=1)[0]
    beside = abs(stage.route.project(parked.start.x_m, parked.start.y_m)[1])
    speed, over = draw.number("pulls_out_mps"), draw.number("pulls_out_over_m")
    if speed > 0.7 * stage.speed_mps:
        raise RejectedDraw("the car that pulls out is as fast as the ego")
    share, ramp = draw.number("overlap_percent"), draw.number("pulls_out_ramp_m")
    target = merging(
        stage, outline, sign, share, speed, beside, over, from_standstill=True, accelerates_m=ramp
    )
    return stage, [target]


def on_a_crosswalk(stage: Stage, draw: Draw) -> Made:
    """A pedestrian crosses on a crosswalk, from standstill at the kerb or walking since the start."""
    sign = _side(stage, draw)
    outline, speed = _on_foot(draw)
    aside = round((2.0 * draw.uniform() - 1.0) * 1.2, 3)
    share = draw.number("share_percent")
    moved = replace(stage, line_m=stage.line_m + aside)
    if draw.text("begins") == "walking":
        return moved, [crossing(moved, outline, sign, share, speed, from_m=None)]
    from_m = stage.side(stage.line_m, sign).kerb_m + draw.number("beyond_kerb_m")
    ramp = draw.number("sets_off_over_m")
    return moved, [crossing(moved, outline, sign, share, speed, from_m=from_m, accelerates_m=ramp)]


def after_a_turn(stage: Stage, draw: Draw) -> Made:
    """A pedestrian crosses the road that the ego turns into."""
    if draw.text("begins") == "walking":
        sign = _side(stage, draw)
        outline, speed = _on_foot(draw)
        share = draw.number("share_percent")
        return stage, [crossing(stage, outline, sign, share, speed, from_m=None)]
    return crosses(stage, draw)


def car_crosses_at_a_junction(stage: Stage, draw: Draw) -> Made:
    """A car on another way through the junction turns or drives across the ego's way."""
    return crossing_car(stage, draw)


def walks_along_the_lane(stage: Stage, draw: Draw) -> Made:
    """A pedestrian walks in the ego's lane, the ego's way, where the road has no sidewalk.

    One who came the other way would walk into an ego that has stopped.
    """
    side = stage.side(stage.line_m, stage.near)
    if any(strip.kind in SIDEWALK_TYPES for strip in side.strips):
        raise RejectedDraw("the road has a sidewalk")
    outline, speed = draw.text("pedestrian"), draw.number("walking_speed_mps")
    share = draw.number("share_percent")
    left = stage.near * EGO_HALF_M * (1.0 - share / 50.0)
    hit_s = stage.hit_s
    start_m = stage.line_m + OUTLINES[outline].length_m / 2 - speed * hit_s
    to_m = start_m + speed * (stage.lead_s + 8.0) + 5.0
    if hit_s < EARLIEST_S or not math.isfinite(start_m):
        raise RejectedDraw("it would have to set off before the start")
    points = stage.beside(start_m, to_m, left)
    return stage, [Actor("Target", outline, np.asarray(points), Motion(speed), smooth=True)]


EGO_HALF_M = 0.9

MUST_BRAKE = (
    Situation("pedestrian crosses", "brake", "any", crosses),
    Situation("pedestrian crosses diagonally", "brake", "any", crosses_diagonally),
    Situation("pedestrian steps from the middle of the road", "brake", "any", steps_from_the_middle),
    Situation("runner from far aside", "brake", "any", runs_from_far_aside),
    Situation("pedestrian from behind parked cars", "brake", "any", crosses_from_behind_parked_cars),
    Situation("pedestrian on a crosswalk", "brake", "crosswalk", on_a_crosswalk),
    Situation("pedestrian after a turn", "brake", "turn", after_a_turn),
    Situation("pedestrian walks in the lane", "brake", "any", walks_along_the_lane),
    Situation("cyclist crosses", "brake", "any", cyclist_crosses),
    Situation("cyclist moves into the lane", "brake", "any", cyclist_moves_into_the_lane),
    Situation("queue behind a bend", "brake", "bend", queue_behind_a_bend),
    Situation("car pulls out of parking", "brake", "any", car_pulls_out),
    Situation("car crosses at a junction", "brake", "crossing", car_crosses_at_a_junction),
)
