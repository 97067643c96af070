"""Situations in which the ego must do nothing: unbraked it touches no road user and keeps its distance."""

from __future__ import annotations

import math

from scenarios.drawn.actors import EGO, OUTLINES, Actor, Motion, standing, straight
from scenarios.drawn.situations.motions import along, crossing
from scenarios.drawn.situations.situation import Situation
from scenarios.drawn.situations.vehicles import CAR_GAP_M, parked_row, waiting_cars
from scenarios.drawn.stage import Stage
from scenarios.drawn.timeline import RUN_OUT_M
from scenarios.drawn.values import Draw, RejectedDraw

Made = tuple[Stage, list[Actor]]

OVERTAKES_MPS = 10.0 / 3.6
"""By how much a car is faster that overtakes: substantially (StVO section 5 (2)), 10 km/h as courts read it
for lorries on motorways (OLG Hamm, 29 October 2008, 4 Ss OWi 629/08: 45 s, 80 against 70 km/h). A driver who
is slower stays behind."""


def _end_s(stage: Stage) -> float:
    return stage.lead_s + RUN_OUT_M / stage.speed_mps


def _side(stage: Stage, draw: Draw) -> int:
    return stage.near * (1 if draw.text("side") == "near" else -1)


def people_beside_the_road(stage: Stage, draw: Draw) -> Made:
    """One to five people stand or walk beyond the kerb, on the sidewalk or the verge, at drawn distances."""
    actors: list[Actor] = []
    for number in range(1, 2 + int(draw.uniform() * 5)):
        sign = stage.near * (1 if draw.uniform() < 0.7 else -1)
        station = stage.line_m + draw.between(-12.0, 8.0)
        from_kerb = draw.number("stands_from_kerb_m", f"from_kerb_m_{number}")
        left = sign * (stage.side(station, sign).kerb_m + from_kerb)
        outline, name = draw.text("pedestrian"), f"Person {number}"
        if draw.uniform() < 0.5:
            pose = stage.pose(station, left, draw.between(-math.pi, math.pi))
            actors.append(standing(name, outline, pose, "off"))
        else:
            speed = draw.sign() * draw.number("walking_speed_mps")
            actors.append(along(name, outline, stage, station, left, speed, _end_s(stage), "off"))
    return stage, actors


def walks_to_the_kerb(stage: Stage, draw: Draw) -> Made:
    """A pedestrian walks or runs straight to the road and stops before the kerb."""
    sign = _side(stage, draw)
    outline, gait = draw.text("pedestrian"), draw.text("gait")
    speed = draw.number("walking_speed_mps" if gait == "walks" else "running_speed_mps")
    kerb = stage.side(stage.line_m, sign).kerb_m
    box = OUTLINES[outline]
    stop = kerb + draw.number("stops_before_kerb_m") + box.length_m / 2
    brakes = speed**2 / (2.0 * draw.number("stops_mps2"))
    # it stands that long before the ego's front is beside it
    stands_s = stage.hit_s - draw.number("stands_before_s")
    steady_m = speed * (stands_s - 2.0 * brakes / speed)
    if steady_m < 0.3:
        raise RejectedDraw("it would have to stop before the start")
    place = stage.pose(stage.line_m, sign * (stop + brakes + steady_m))
    pose_in = place.moved(0.0, 0.0, -sign * math.pi / 2)
    motion = Motion(speed, brakes_after_m=round(steady_m, 3), brakes_m=round(brakes, 3))
    return stage, [straight("Target", outline, pose_in, motion, steady_m + brakes + 2.0)]


def waits_at_a_crosswalk(stage: Stage, draw: Draw) -> Made:
    """One to three pedestrians stand at the kerb beside a crosswalk and let the ego pass."""
    sign = _side(stage, draw)
    actors = []
    for number in range(1, 2 + int(draw.uniform() * 3)):
        from_kerb = draw.number("waits_from_kerb_m", f"from_kerb_m_{number}")
        station = stage.line_m + draw.between(-1.5, 1.5)
        left = sign * (stage.side(station, sign).kerb_m + from_kerb + 0.3)
        pose = stage.pose(station, left, -sign * math.pi / 2 + draw.between(-0.5, 0.5))
        actors.append(standing(f"Person {number}", draw.text("pedestrian"), pose, "off"))
    return stage, actors


def parked_on_both_sides(stage: Stage, draw: Draw) -> Made:
    """Rows of parked cars on both sides of the road, or on one where only that has room."""
    actors: list[Actor] = []
    for sign in (stage.near, -stage.near):
        try:
            first_m = stage.line_m - draw.between(10.0, 20.0)
            count = 3 + int(draw.uniform() * 3)
            name = "Near" if sign == stage.near else "Far"
            actors += parked_row(stage, draw, sign, first_m, backwards=False, name=name, count=count)
        except RejectedDraw:
            if sign == stage.near:
                raise
    return stage, actors


def oncoming_traffic(stage: Stage, draw: Draw) -> Made:
    """One to three cars come the other way in the next lane."""
    return stage, _oncoming(stage, draw)


def _oncoming(stage: Stage, draw: Draw) -> list[Actor]:
    strip = stage.side(stage.line_m, -stage.near).nearest("driving", same_way=False)
    if strip is None:
        raise RejectedDraw("no oncoming lane")
    actors: list[Actor] = []
    speed = draw.number("oncoming_speed_kmh") / 3.6
    # the first meets the ego before the line, the others follow
    meets_s = stage.lead_s * draw.between(0.3, 0.9)
    station = stage.start_m + (stage.speed_mps + speed) * meets_s
    for number in range(1, 2 + int(draw.uniform() * 3)):
        left = -stage.near * strip.middle_m + draw.between(-0.2, 0.2)
        actors.append(
            along(f"Oncoming {number}", draw.text("car"), stage, station, left, -speed, _end_s(stage), "on")
        )
        station += 5.0 + speed * draw.between(1.0, 3.0)
    return actors


def cyclist_beside(stage: Stage, draw: Draw) -> Made:
    """The ego overtakes a cyclist on the cycle lane, or beside its lane at a safe distance."""
    sign = stage.near
    side = stage.side(stage.line_m, sign)
    strip = side.nearest("biking")
    if strip:
        beside = strip.middle_m + draw.between(-0.4, 0.4)
    else:
        beside = EGO.width_m / 2 + draw.number("passing_m") + OUTLINES["bicyclist"].width_m / 2
        if beside > side.paved_m - 0.3 or not side.is_outermost:
            raise RejectedDraw("no room to pass a cyclist")
    speed = min(draw.number("cyclist_speed_mps"), 0.8 * stage.speed_mps)
    if strip is None and stage.speed_mps - speed < OVERTAKES_MPS:
        raise RejectedDraw("the ego is too slow to overtake")
    # the fronts are level when the ego is at the line
    station = stage.line_m - speed * stage.lead_s
    return stage, [along("Target", "bicyclist", stage, station, sign * beside, speed, _end_s(stage), "")]


def queue_in_the_next_lane(stage: Stage, draw: Draw) -> Made:
    """Cars stand in the lane beside the ego's, the same way or the other."""
    side = stage.side(stage.line_m, -stage.near)
    strip = side.nearest("driving")
    sign = -stage.near
    if strip is None:
        side, sign = stage.side(stage.line_m, stage.near), stage.near
        strip = side.nearest("driving")
    if strip is None:
        raise RejectedDraw("no lane beside the ego's")
    station, actors = stage.line_m - draw.between(4.0, 15.0), []
    for number in range(1, 3 + int(draw.uniform() * 4)):
        outline = draw.text("car")
        length = OUTLINES[outline].length_m
        station += length / 2
        if station > stage.route.length_m:
            break
        left = sign * strip.middle_m + draw.between(-0.2, 0.2)
        pose = stage.pose(station, left, 0.0 if strip.same_way else math.pi)
        actors.append(standing(f"Queue {number}", outline, pose, "on"))
        station += length / 2 + draw.between(*CAR_GAP_M)
    return stage, actors


def passes_long_before_or_after(stage: Stage, draw: Draw) -> Made:
    """A pedestrian or cyclist crosses the ego's way with a gap of time, before it or behind it: a near miss.

    Before: it leaves the ego's width that long before the ego's front would be there. Behind: it comes into
    the ego's width that long after the ego's rear has been there.
    """
    sign = _side(stage, draw)
    order, gap_s = draw.text("passes"), draw.number("passing_gap_s")
    if draw.text("crosser") == "cyclist":
        outline, speed = "bicyclist", draw.number("cyclist_speed_mps")
    else:
        outline = draw.text("pedestrian")
        gait = draw.text("gait")
        speed = draw.number("walking_speed_mps" if gait == "walks" else "running_speed_mps")
    half_m = (EGO.width_m + OUTLINES[outline].length_m) / 2
    if order == "before":
        later_s = -gap_s - half_m / speed
    else:
        later_s = gap_s + half_m / speed + EGO.length_m / stage.speed_mps
    return stage, [crossing(stage, outline, sign, 50.0, speed, from_m=None, later_s=later_s)]


def people_around_a_turn(stage: Stage, draw: Draw) -> Made:
    """People stand and walk on both sidewalks of the road that the ego turns into, and at the corner."""
    actors: list[Actor] = []
    for number in range(1, 3 + int(draw.uniform() * 4)):
        sign = draw.sign()
        station = stage.line_m + draw.between(-14.0, 10.0)
        side = stage.side(station, sign)
        if side.sidewalk is None:
            station = stage.line_m
            side = stage.side(station, sign)
        from_kerb = draw.number("stands_from_kerb_m", f"from_kerb_m_{number}")
        pose = stage.pose(station, sign * (side.kerb_m + from_kerb), draw.between(-math.pi, math.pi))
        actors.append(standing(f"Person {number}", draw.text("pedestrian"), pose, "off"))
    return stage, actors


def cars_wait_at_a_junction(stage: Stage, draw: Draw) -> Made:
    """Cars stand before the junction that the ego drives straight over."""
    return stage, waiting_cars(stage, draw)


NOTHING = (
    Situation("people beside the road", "nothing", "any", people_beside_the_road),
    Situation("pedestrian stops at the kerb", "nothing", "any", walks_to_the_kerb),
    Situation("pedestrians wait at a crosswalk", "nothing", "crosswalk", waits_at_a_crosswalk),
    Situation("parked cars on both sides", "nothing", "any", parked_on_both_sides),
    Situation("oncoming traffic", "nothing", "straight", oncoming_traffic),
    Situation("oncoming traffic in a bend", "nothing", "bend", oncoming_traffic),
    Situation("cyclist beside", "nothing", "any", cyclist_beside),
    Situation("queue in the next lane", "nothing", "any", queue_in_the_next_lane),
    Situation("people around a turn", "nothing", "turn", people_around_a_turn),
    Situation("crosses before or behind", "nothing", "any", passes_long_before_or_after),
    Situation("cars wait at a junction", "nothing", "crossing", cars_wait_at_a_junction),
)
