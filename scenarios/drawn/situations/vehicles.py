"""Cars of drawn scenes: parked rows, queues, and cars on other ways through a junction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scenarios.drawn.actors import EGO, OUTLINES, Actor, Motion, standing
from scenarios.drawn.stage import RUN_OUT_M, Stage, way_over
from scenarios.drawn.values import Draw, RejectedDraw, weighted
from scenarios.openscenario.motion.paths import Pose
from smartmot.maps.route import Route
from smartmot.maps.walks import lane_ends
from smartmot.types import FloatArray

CAR_GAP_M = (0.6, 2.5)
"""Free length between parked or queueing cars (assumed)."""
AT_KERB_M = 0.25
"""From a parked car to the kerb (assumed; German law asks to draw up to the edge, StVO section 12 (4))."""
FROM_CROSSWALK_M = 6.0
"""From a parked car's middle to a crosswalk's, in town (assumed; StVO, sign 293, asks for 5 m before it)."""
PASSING_M = 0.4
"""Least free width between a parked car and the ego's."""


def parking_middle_m(stage: Stage, station_m: float, sign: int) -> float:
    """Distance of a parked car's middle from the ego's way: in the parking lane, or else at the kerb.

    Raises:
        RejectedDraw: there is no room for it beside the ego.
    """
    lane, s = stage.lane_at(station_m)
    lanes = stage.network.lanes
    if lanes.junction_id[lane] is not None:
        raise RejectedDraw("no car is parked in a junction")
    road = lanes.key[lane].road_id
    if any(c.road_id == road and abs(c.s_m - s) < FROM_CROSSWALK_M for c in stage.network.crosswalks):
        raise RejectedDraw("no car is parked at a crosswalk")
    side, width = stage.side(station_m, sign), OUTLINES["large car"].width_m
    strip = side.nearest("parking")
    middle = strip.middle_m if strip else side.paved_m - AT_KERB_M - width / 2
    if middle - width / 2 < EGO.width_m / 2 + PASSING_M:
        raise RejectedDraw("no room for a parked car")
    return middle


def parked_row(
    stage: Stage, draw: Draw, sign: int, from_m: float, *, backwards: bool, name: str, count: int = 0
) -> list[Actor]:
    """Cars parked one behind the other beside the ego's lane, headed as its traffic or against it.

    Args:
        stage: where.
        draw: of the scene.
        sign: side.
        from_m: station where the first one ends (backwards) or begins.
        backwards: whether the row goes on against the ego's way.
        name: of the actors, with a number where there are several.
        count: how many; 0: drawn.
    """
    count = count or 1 + int(draw.uniform() * 4)
    along, station, row = -1 if backwards else 1, from_m, []
    for number in range(1, count + 1):
        outline = draw.text("car", "parked_car")
        length = OUTLINES[outline].length_m
        station += along * length / 2
        if not 0.0 < station < stage.route.length_m:
            break
        middle = parking_middle_m(stage, station, sign)
        turn = 0.0 if sign == stage.near or draw.uniform() < 0.2 else math.pi
        pose = stage.pose(station, sign * middle, turn)
        row.append(standing(name if count == 1 else f"{name} {number}", outline, pose))
        station += along * (length / 2 + draw.between(*CAR_GAP_M))
    if not row:
        raise RejectedDraw("no room for a parked car")
    return row


# ---------------------------------------------------------------------------------------------- junctions


def ways_across(stage: Stage) -> list[tuple[Route, float, float, float]]:
    """Other ways through the junction that cross or join the ego's.

    Returns:
        The way, the stations of the crossing on it and on the ego's way, and the angle between them.
    """
    network = stage.network
    lane, _ = stage.lane_at(stage.line_m)
    own_before = network.predecessors(lane)
    crossings = []
    for way, _ in stage.ground.ways_through:
        if network.lanes.junction_id[way] != network.lanes.junction_id[lane] or way == lane:
            continue
        before = network.predecessors(way)[0]
        if before in own_before:
            continue
        route, _ = way_over(network, [before, way], lane_ends(network, way)[1], 60.0)
        crossings += [(route, *meeting) for meeting in _meeting(route, stage)]
    return crossings


def _meeting(route: Route, stage: Stage) -> list[tuple[float, float, float]]:
    """Where a way first comes onto the ego's near the line: stations of both, and the angle between them."""
    own_s = np.arange(max(stage.line_m - 20.0, 0.0), stage.line_m + 20.0, 0.5)
    other_s = np.arange(0.0, route.length_m, 0.5)
    own, own_yaw = stage.route.poses(own_s)
    other, other_yaw = route.poses(other_s)
    distance = np.hypot(*(own[:, None] - other[None]).transpose(2, 0, 1))
    near = np.argwhere(distance < 0.36)
    if not len(near):
        return []
    i, j = near[np.argmin(near[:, 1])]
    angle = math.remainder(float(other_yaw[j] - own_yaw[i]), 2.0 * math.pi)
    return [(float(other_s[j]), float(own_s[i]), angle)]


def crossing_car(stage: Stage, draw: Draw) -> tuple[Stage, list[Actor]]:
    """A car on another way through the junction, so timed that the ego's front meets its drawn part.

    The ego's front is where the ways meet when the car has driven beyond it by the drawn part of its length.

    Raises:
        RejectedDraw: no other way meets the ego's, or the start would lie off the map.
    """
    ways = ways_across(stage)
    if not ways:
        raise RejectedDraw("no other way through the junction meets the ego's")
    route, other_m, own_m, angle = ways[weighted([1.0] * len(ways), draw.uniform())]
    if abs(angle) < math.radians(25.0):
        raise RejectedDraw("the other way joins the ego's too slowly")
    moved = replace(stage, line_m=round(own_m, 3))
    if moved.start_m < 0.5:
        raise RejectedDraw("the ego's lane begins too near before the line")
    speed, outline = draw.number("crossing_car_mps"), draw.text("car")
    part = draw.number("car_part_percent") / 100.0 - 0.5
    draw.values["crossing_angle_deg"] = round(math.degrees(angle), 1)
    start_m = other_m + part * OUTLINES[outline].length_m - speed * moved.hit_s
    if start_m < 0.2:
        raise RejectedDraw("the other car's lane begins too near before the junction")
    points = _way_points(route, start_m, min(other_m + RUN_OUT_M, route.length_m))
    return moved, [Actor("Target", outline, points, Motion(speed), smooth=True)]


def _way_points(route: Route, from_m: float, to_m: float) -> FloatArray:
    """(P, 2) points of a way, each metre."""
    count = max(2, math.ceil(to_m - from_m) + 1)
    return route.poses(np.linspace(from_m, to_m, count))[0]


def waiting_cars(stage: Stage, draw: Draw) -> list[Actor]:
    """Cars that wait before the junction on the other ways into it, one on some or all of them.

    Raises:
        RejectedDraw: there is no other way into it.
    """
    network = stage.network
    lane, _ = stage.lane_at(stage.line_m)
    junction = network.lanes.junction_id[lane]
    own = {network.lanes.key[k].road_id for k in stage.route.lanes}
    arms = {
        network.predecessors(way)[0]: way
        for way, _ in stage.ground.ways_through
        if network.lanes.junction_id[way] == junction
        and network.lanes.key[network.predecessors(way)[0]].road_id not in own
    }
    if not arms:
        raise RejectedDraw("no other way leads into the junction")
    actors: list[Actor] = []
    chosen = [arm for arm in arms if draw.uniform() < 0.6] or [next(iter(arms))]
    for arm in chosen:
        low, high = lane_ends(network, arm)
        outline = draw.text("car")
        back_m = draw.number("waits_before_m") + OUTLINES[outline].length_m / 2
        if back_m > abs(high - low):
            continue
        s = high - math.copysign(back_m, high - low)
        x, y, _, heading = network.center_line(arm, np.array([s]))
        pose = Pose(float(x[0]), float(y[0]), float(heading[0]))
        actors.append(standing(f"Waits {len(actors) + 1}", outline, pose))
    if not actors:
        raise RejectedDraw("no room for a car that waits")
    return actors
