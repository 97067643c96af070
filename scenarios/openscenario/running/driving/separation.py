"""How far entities are ahead of and beside one another, in the coordinate systems of the standard.

*entity*: along and across the x axis of the first entity. *road*: by s and t of the road's reference line.
*lane*: along the middle line of the first entity's lane, and across it. *trajectory*: along and across the
trajectory that the first entity follows. On a bend of radius R to the left, two that drive on a circle of
radius r at an angle phi are r sin(phi), R phi, and r phi apart (entity, road, lane and trajectory).
"""

from __future__ import annotations

import math
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.motion.paths import Path
from scenarios.openscenario.motion.road_distances import NO_DISTANCE_M
from scenarios.openscenario.running.actors import Actor, State, state_of
from scenarios.openscenario.running.world import World

LITTLE_M, LITTLE_S = 1e-3, 1e-4
"""Over which a gap is differentiated: along the way, and in time."""

SLOWEST = 0.2
"""A gap that hardly changes with the way, as along an axis across it, is taken to change by this."""

SOLVED_M, MOST_STEPS = 1e-9, 50
"""A place at a gap is found this exactly, or there is none after so many steps."""

Axes: TypeAlias = tuple[float, float, float, float]
"""How far another is ahead and to the left, and the directions of the coordinates at both, rad."""

NOWHERE: Axes = (NO_DISTANCE_M, NO_DISTANCE_M, 0.0, 0.0)


class Separation:
    """Distances of two entities in a coordinate system.

    Args:
        world: where they are.
        actor: whose coordinates they are.
        other: how far that one is away.
        system: which coordinates.
    """

    def __init__(self, world: World, actor: Actor, other: Actor, system: model.System) -> None:
        self._world, self._actor, self.other, self._system = world, actor, other, system

    def between_m(self, a: State, b: State, lateral: bool, freespace: bool) -> float:
        """Distance along the axis, or across it; between outlines negative by how far these overlap."""
        ahead, left, axis, other_axis = self.axes(a, b, lateral, freespace)
        apart = left if lateral else ahead
        if not freespace or math.isnan(apart):
            return abs(apart)
        return abs(apart) - self._overhangs_m(a.yaw_rad - axis, b.yaw_rad - other_axis, apart, lateral)

    def gap_m(self, a: State, b: State, leads: bool, freespace: bool) -> float:
        """Distance along the axis, negative for who is not on the side where it leads, or trails."""
        ahead, _, axis, other_axis = self.axes(a, b, False, freespace)
        gap = -ahead if leads else ahead
        if not freespace or math.isnan(ahead):
            return gap
        side = -1.0 if leads else 1.0
        return gap - self._overhangs_m(a.yaw_rad - axis, b.yaw_rad - other_axis, side, lateral=False)

    def _overhangs_m(self, turn: float, other_turn: float, side: float, lateral: bool) -> float:
        """From reference points to where the outlines meet, the other being on the positive side or not."""
        own, seen = overhang_m(self._actor, turn, lateral), overhang_m(self.other, other_turn, lateral)
        return own[1] + seen[0] if side >= 0.0 else own[0] + seen[1]

    def axes(self, a: State, b: State, lateral: bool, directions: bool) -> Axes:
        """How far the other is ahead and to the left, NaN if no way leads there; directions at both.

        On roads the way to the left and the directions cost another look at the map: only if they are wanted.
        """
        if not (math.isfinite(a.x_m) and math.isfinite(b.x_m)):  # a place that is nowhere
            return NOWHERE
        if self._system == "entity":
            c, s = math.cos(a.yaw_rad), math.sin(a.yaw_rad)
            dx, dy = b.x_m - a.x_m, b.y_m - a.y_m
            return c * dx + s * dy, c * dy - s * dx, a.yaw_rad, a.yaw_rad
        if self._system == "trajectory":
            return self._on_trajectory(a, b)
        distances, actor, other = self._world.road_distances, self._actor, self.other
        pose, other_pose = actor.pose_in(a), other.pose_in(b)
        place = distances.place_on(actor.path, a.station_m, pose)
        beside = distances.place_on(other.path, b.station_m, other_pose)
        if place is None or beside is None:
            return NOWHERE
        if self._system == "lane":
            return distances.along_lane(place, pose, beside, other_pose) or NOWHERE
        if lateral:
            place, beside = distances.with_t(place, pose), distances.with_t(beside, other_pose)
        hit = distances.relate(place, beside)
        if hit is None:
            return NOWHERE
        if not directions:
            return hit[0], hit[1], 0.0, 0.0
        axis, other_axis = distances.direction(place), distances.direction(beside)
        # seen from the first, whichever way the other one heads
        facing = place.along_s * beside.along_s * hit[2]
        return hit[0], hit[1], axis, other_axis if facing > 0 else other_axis + math.pi

    def _on_trajectory(self, a: State, b: State) -> Axes:
        actor = self._actor
        if not actor.on_trajectory:
            self._world.note(
                f"a distance of '{actor.name}' along its trajectory is asked for while it follows none: "
                "there is no such distance then"
            )
            return NOWHERE
        path: Path = actor.path
        station, left = path.project(b.x_m, b.y_m)
        axis, other_axis = path.pose(a.station_m)[2], path.pose(station)[2]
        own_left = math.cos(axis) * (a.y_m - path.pose(a.station_m)[1])
        own_left -= math.sin(axis) * (a.x_m - path.pose(a.station_m)[0])
        return station - a.station_m, left - own_left, axis, other_axis


def overhang_m(actor: Actor, turn_rad: float, lateral: bool) -> tuple[float, float]:
    """How far an outline reaches against an axis, and along it, from the reference point.

    Args:
        actor: whose outline.
        turn_rad: its heading less the direction of the axis.
        lateral: for the axis to the left of that one.
    """
    if turn_rad == 0.0 and not lateral:  # as along its own axis
        return actor.rear_m, actor.front_m
    d = actor.definition
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    if lateral:
        c, s = s, -c
    middle = d.center_x_m * c - d.center_y_m * s
    half = 0.5 * (d.length_m * abs(c) + d.width_m * abs(s))
    return half - middle, half + middle


class Station:
    """Where on its way an entity has a gap to another, and how fast that place moves.

    Args:
        separation: of the two.
        distance_m: the gap.
        leads: whether the entity is ahead of the other.
        freespace: whether it is between outlines.
    """

    def __init__(self, separation: Separation, distance_m: float, leads: bool, freespace: bool) -> None:
        self._separation, self.distance_m, self.leads = separation, distance_m, leads
        self._freespace = freespace
        self.gap_s: float | None = None
        """The gap in place of the distance, as time at the other's speed."""

    def left_m(self, own: State, seen: State) -> float:
        """How far the place is ahead, along the axis; NaN if there is none."""
        distance_m = self.distance_m if self.gap_s is None else self.gap_s * abs(seen.speed_mps)
        over = self._separation.gap_m(own, seen, self.leads, self._freespace) - distance_m
        return -over if self.leads else over

    def rates(self, path: Path, own: State, seen: State, left_m: float) -> tuple[float, float]:
        """By how much what is left shrinks per metre of way, and the speed at which the place moves.

        From one side where no way leads to the other one; the speed is NaN where none leads to either.

        Args:
            path: of the entity.
            own: its state.
            seen: that of the other.
            left_m: what is left there, see `left_m`.
        """
        before = self.left_m(_at(path, own, own.station_m - LITTLE_M), seen)
        further = self.left_m(_at(path, own, own.station_m + LITTLE_M), seen)
        shrinks = -_slope(before, left_m, further, LITTLE_M)
        other = self._separation.other
        earlier = self.left_m(own, moved(other, seen, -LITTLE_S))
        later = self.left_m(own, moved(other, seen, LITTLE_S))
        shrinks = max(SLOWEST, shrinks)
        return shrinks, _slope(earlier, left_m, later, LITTLE_S) / shrinks

    def on(self, path: Path, own: State, seen: State) -> State | None:
        """The state of an entity at the place on a path, near where it is; None if there is no such place."""
        state, slope = own, 1.0
        left = self.left_m(state, seen)
        for _ in range(MOST_STEPS):
            if math.isnan(left):
                return None
            if abs(left) <= SOLVED_M:
                return state
            after = _at(path, state, state.station_m + left / slope)
            left_after = self.left_m(after, seen)
            gone = after.station_m - state.station_m
            slope = max((left - left_after) / gone, SLOWEST) if gone else slope
            state, left = after, left_after
        return None


def _slope(before: float, middle: float, after: float, step: float) -> float:
    """How a quantity grows, from its values a step apart; NaN if it has one only in the middle."""
    if math.isnan(before):
        return (after - middle) / step
    return (middle - before) / step if math.isnan(after) else (after - before) / (2 * step)


def _at(path: Path, state: State, station_m: float) -> State:
    x, y, yaw = path.pose(station_m)
    return state_of((x, y, yaw, state.speed_mps, station_m, state.travelled_m))


def moved(actor: Actor, state: State, time_s: float) -> State:
    """Where an entity would be that goes straight on at its speed."""
    way_m = state.speed_mps * time_s
    x, y, yaw, speed_mps, station_m, travelled_m = state
    station_m += actor.progress_mps(state) * time_s
    x, y = x + way_m * math.cos(yaw), y + way_m * math.sin(yaw)
    return state_of((x, y, yaw, speed_mps, station_m, travelled_m))
