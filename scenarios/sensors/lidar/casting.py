"""Rays against bodies and the ground: where each meets something first.

Everything is in the frame of the stamp: level, axes of the sensor's vehicle at the stamp, z of the map. A
ray that is shot t after the stamp starts where the sensor is then, turned by as much as the vehicle turns
in t, and meets bodies where they are then.

A body is tried only with the rays inside the sector of azimuths that it can reach while the cloud is
measured, and its parts only with the rays that meet the block around them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec

import numpy as np

import _smartmot
from scenarios.errors import ScenarioError
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, ROLLER, Bodies
from scenarios.sensors.lidar.terrain import Relief
from smartmot.arrays import FloatArray, IntArray
from smartmot.geometry import wrap_angle

NO_BODY, GROUND = -2, -1
"""What a ray meets that meets no body: nothing, or the ground."""

TINY = 1e-300
"""Stands for a component of a direction that is 0, so that nothing is divided by 0."""

SMALLEST_SQUARE = 1e-200
"""Square of a direction along the axis of a cylinder: inside it, the side is far away."""


@dataclass(frozen=True)
class RayTable:
    """N rays by ascending azimuth, in the level frame of the moving sensor.

    Args:
        direction: (N, 3) unit vectors.
        time_s: (N,) when each is shot, after the stamp.
    """

    direction: FloatArray
    time_s: FloatArray

    @classmethod
    def of(cls, direction: FloatArray, time_s: FloatArray) -> tuple[RayTable, IntArray]:
        """Rays in any order as a table, and (N,) which of the given each of the table is."""
        order = np.argsort(np.arctan2(direction[:, 1], direction[:, 0]), kind="stable")
        return cls(np.ascontiguousarray(direction[order]), time_s[order]), order

    @cached_property
    def azimuth_rad(self) -> FloatArray:
        """(N,) ascending, from -pi to pi."""
        azimuth: FloatArray = np.arctan2(self.direction[:, 1], self.direction[:, 0])
        return azimuth

    @cached_property
    def slope(self) -> FloatArray:
        """(N,) rise over horizontal distance."""
        x, y, z = self.direction.T
        with np.errstate(divide="ignore"):
            slope: FloatArray = z / np.hypot(x, y)
        return slope

    @cached_property
    def moments(self) -> tuple[FloatArray, IntArray]:
        """(M,) times at which something is shot, ascending, and (N,) which of them is a ray's."""
        times, which = np.unique(self.time_s, return_inverse=True)
        return times, which.astype(np.int64)

    @property
    def earliest_s(self) -> float:
        """Time of the first shot."""
        return float(min(self.moments[0][0], 0.0)) if len(self.time_s) else 0.0


@dataclass(frozen=True, slots=True)
class Motion:
    """How the sensor moves while a cloud is measured: speed and turn rate of its vehicle are constant.

    Args:
        height_m: of the sensor, in the frame of the stamp.
        speed_mps: of the centre of the vehicle, along its heading.
        yaw_rate_radps: turn rate.
        forward_m: of the sensor, ahead of that centre.
    """

    height_m: float
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    forward_m: float = 0.0

    def pose(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, 2) horizontal places of the sensor and (N,) its turns since the stamp, at (N,) times."""
        turn = self.yaw_rate_radps * time_s
        place = np.empty((len(time_s), 2))
        # sin(w t) / w and (1 - cos(w t)) / w, also where w is 0
        half = np.sinc(0.5 * turn / math.pi)
        chord = self.speed_mps * time_s * half
        place[:, 0] = chord * np.cos(0.5 * turn) + self.forward_m * (np.cos(turn) - 1.0)
        place[:, 1] = chord * np.sin(0.5 * turn) + self.forward_m * np.sin(turn)
        return place, turn

    @property
    def stands(self) -> bool:
        """Whether it neither drives nor turns."""
        return self.speed_mps == 0.0 and self.yaw_rate_radps == 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What N rays meet first.

    Args:
        range_m: (N,) infinite where a ray meets nothing.
        body: (N,) row of the body, `GROUND` or `NO_BODY`.
        part: (N,) row of the part, or -1.
        cosine: (N,) of the angle of incidence; 0 where a ray meets nothing.
    """

    range_m: FloatArray
    body: IntArray
    part: IntArray
    cosine: FloatArray


def cast(
    rays: RayTable,
    motion: Motion,
    bodies: Bodies,
    ground: float | Relief | None = 0.0,
    *,
    compiled: bool | None = None,
) -> Hits:
    """What each ray meets first. Rays that start inside a part do not meet it.

    Args:
        rays: N rays.
        motion: of the sensor, which is at the origin at the stamp.
        bodies: frame of the stamp.
        ground: height of the ground, or its relief; None: there is none.
        compiled: with the compiled loops of the extra `fast`; None: where numba is installed.

    Raises:
        ScenarioError: compiled loops are asked for and numba is missing.
    """
    level = ground if isinstance(ground, float | int) else -math.inf
    hits = caster(compiled)(rays, motion, bodies, level, sectors(rays, motion, bodies))
    return _on_relief(hits, rays, motion, ground) if isinstance(ground, Relief) else hits


def _on_relief(hits: Hits, rays: RayTable, motion: Motion, relief: Relief) -> Hits:
    """The hits, where the ground is nearer on it."""
    place, direction = moved(rays, motion)
    below, cosine = relief.meet(place, motion.height_m, direction)
    nearer = below < hits.range_m
    return Hits(
        np.where(nearer, below, hits.range_m),
        np.where(nearer, GROUND, hits.body),
        np.where(nearer, -1, hits.part),
        np.where(nearer, cosine, hits.cosine),
    )


def moved(rays: RayTable, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """(N, 2) places where rays start and their (N, 3) directions, frame of the stamp."""
    moments, which = rays.moments
    place, turn = motion.pose(moments)
    place, direction = place[which], rays.direction
    if motion.yaw_rate_radps != 0.0:
        c, s = np.cos(turn)[which], np.sin(turn)[which]
        x, y, z = direction.T
        direction = np.column_stack((c * x - s * y, s * x + c * y, z))
    return place, direction


@dataclass(frozen=True, slots=True, eq=False)
class Sectors:
    """Which rays can reach each of B bodies.

    Args:
        first: (B, 2) first rows of two ranges; the second is what lies beyond an azimuth of pi.
        last: (B, 2) rows before which they end.
        low_slope: (B,) least slope of a ray that can reach it.
        high_slope: (B,) greatest.
    """

    first: IntArray
    last: IntArray
    low_slope: FloatArray
    high_slope: FloatArray


def sectors(rays: RayTable, motion: Motion, bodies: Bodies) -> Sectors:
    """Which rays can reach each body.

    The rectangle around a body is seen from the sensor in the middle of the cloud's time. Relative to the
    sensor it moves until first and last shot by no more than `reach`, which widens it all round.
    """
    count = len(bodies)
    first, last = np.zeros((count, 2), dtype=np.int64), np.zeros((count, 2), dtype=np.int64)
    if not count or not len(rays.time_s):
        return Sectors(first, last, np.zeros(count), np.zeros(count))
    half_s = -0.5 * rays.earliest_s
    low, high = bodies.bounds
    place, turn = motion.pose(np.array([-half_s]))
    c, s = bodies.turned[:, :1], bodies.turned[:, 1:]
    along = np.column_stack((low[:, 0], high[:, 0], high[:, 0], low[:, 0]))
    across = np.column_stack((low[:, 1], low[:, 1], high[:, 1], high[:, 1]))
    middle = bodies.position_m[:, :2] - half_s * bodies.velocity_mps - place
    x = middle[:, :1] + c * along - s * across
    y = middle[:, 1:] + s * along + c * across
    distance = np.hypot(x, y)
    farthest = distance.max(axis=1)
    reach = _reach(motion, bodies, float(turn[0]), half_s, farthest)
    # from the sensor to the nearest point of the rectangle, in the body's axes
    own_x = -(c[:, 0] * middle[:, 0] + s[:, 0] * middle[:, 1])
    own_y = s[:, 0] * middle[:, 0] - c[:, 0] * middle[:, 1]
    gap_x = np.maximum(np.maximum(low[:, 0] - own_x, own_x - high[:, 0]), 0.0)
    gap_y = np.maximum(np.maximum(low[:, 1] - own_y, own_y - high[:, 1]), 0.0)
    gap = np.hypot(gap_x, gap_y) - reach
    bearing = np.arctan2(y.mean(axis=1), x.mean(axis=1))
    corner = wrap_angle(np.arctan2(y, x) - bearing[:, None])
    spread = np.arcsin(np.minimum(reach[:, None] / np.maximum(distance, reach[:, None]), 1.0))
    right, left = (corner - spread).min(axis=1), (corner + spread).max(axis=1)
    start = wrap_angle(bearing + right - turn[0])
    end = start + (left - right)
    azimuth = rays.azimuth_rad
    first[:, 0] = np.searchsorted(azimuth, start, side="left")
    last[:, 0] = np.searchsorted(azimuth, end, side="right")
    last[:, 1] = np.searchsorted(azimuth, end - 2.0 * math.pi, side="right")
    around = (gap <= 0.0) | (left - right >= 2.0 * math.pi)
    first[around, 0], last[around, 0], last[around, 1] = 0, len(azimuth), 0
    under = bodies.position_m[:, 2] + low[:, 2] - motion.height_m
    over = bodies.position_m[:, 2] + high[:, 2] - motion.height_m
    near, far = np.maximum(gap, 1e-12), farthest + reach
    low_slope = np.where(under < 0.0, under / near, under / far) - 1e-9
    high_slope = np.where(over > 0.0, over / near, over / far) + 1e-9
    low_slope[around], high_slope[around] = -np.inf, np.inf
    return Sectors(first, last, low_slope, high_slope)


def _reach(motion: Motion, bodies: Bodies, turn: float, half_s: float, farthest: FloatArray) -> FloatArray:
    """(B,) how far bodies move in the sensor's axes from the middle of the cloud's time to its ends."""
    rate, swing = abs(motion.yaw_rate_radps), motion.yaw_rate_radps * motion.forward_m
    sensor = motion.speed_mps * np.array([math.cos(turn), math.sin(turn)])
    sensor += swing * np.array([-math.sin(turn), math.cos(turn)])
    relative = np.hypot(*(bodies.velocity_mps - sensor).T)
    relative += math.hypot(motion.speed_mps, swing) * rate * half_s  # its own velocity turns
    reach: FloatArray = half_s * (relative * (1.0 + rate * half_s) + rate * farthest) + 1e-6
    return reach


Caster = Callable[[RayTable, Motion, Bodies, float, Sectors], Hits]
"""See `cast_arrays`."""


def caster(compiled: bool | None) -> Caster:
    """Compiled loops or array operations, see `cast`; both try a body with the rays of its sector alone."""
    if compiled is None:
        compiled = find_spec("numba") is not None
    if not compiled:
        return cast_arrays
    try:
        from scenarios.sensors.lidar.compiled import cast_loops
    except ModuleNotFoundError as error:
        raise ScenarioError(_smartmot.missing_extra("compiled loops of rays", "lidar", error)) from error
    return cast_loops


def cast_arrays(rays: RayTable, motion: Motion, bodies: Bodies, ground_m: float, tried: Sectors) -> Hits:
    """What each ray meets first, by array operations; see `cast`."""
    place, direction = moved(rays, motion)
    below = np.full(len(direction), np.inf)
    if motion.height_m > ground_m:
        down = np.flatnonzero(direction[:, 2] < 0.0)
        below[down] = (ground_m - motion.height_m) / direction[down, 2]
    range_m, part = nearest_parts(direction, place, motion.height_m, rays, bodies, tried, below)
    return _hits(direction, place, motion.height_m, rays.time_s, bodies, range_m, part, below)


def nearest_parts(
    direction: FloatArray,
    place: FloatArray,
    height_m: float,
    rays: RayTable,
    bodies: Bodies,
    tried: Sectors,
    below: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """(N,) ranges to the first part that each ray meets, infinite for none, and (N,) that part, or -1.

    Args:
        direction: (N, 3) unit vectors, frame of the stamp.
        place: (N, 2) where each ray starts, at one height.
        height_m: that height.
        rays: their times and slopes.
        bodies: what they may meet.
        tried: which rays are tried with each body.
        below: (N,) ranges to the ground; parts behind it may be left out.
    """
    time_s = rays.time_s
    range_m, part = np.full(len(direction), np.inf), np.full(len(direction), -1, dtype=np.int64)
    ray, owner = _spans(tried.first.ravel(), tried.last.ravel())
    owner //= 2
    slope = rays.slope[ray]
    steep = np.flatnonzero((slope >= tried.low_slope[owner]) & (slope <= tried.high_slope[owner]))
    ray, owner = ray[steep], owner[steep]
    low, high = bodies.bounds
    origin, ahead = _in_body(direction, place, height_m, time_s, bodies, ray, owner)
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + 1e-9
    near, far = _block((origin - middle[owner]) / half[owner], ahead / half[owner])
    met = np.flatnonzero((near <= far) & (far > 0.0) & (near < below[ray]))
    if not len(met):
        return range_m, part
    number, pair = _spans(bodies.first[owner[met]], bodies.first[owner[met] + 1])
    chosen = met[pair]
    scale = bodies.parts.half_m[number]
    near, far = _entered(
        bodies.parts.kind[number],
        (origin[chosen] - bodies.parts.center_m[number]) / scale,
        ahead[chosen] / scale,
    )
    hit = np.flatnonzero((near <= far) & (near > 0.0))
    # the last one written counts: the nearest, of equal ones the first part
    order = hit[::-1][np.argsort(-near[hit[::-1]], kind="stable")]
    rows = ray[chosen[order]]
    range_m[rows], part[rows] = near[order], number[order]
    return range_m, part


def _spans(first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """All numbers of several ranges in sequence, and which range each is of."""
    length = np.maximum(last - first, 0)
    owner = np.repeat(np.arange(len(first)), length)
    before = np.cumsum(length) - length
    return np.arange(len(owner)) - before[owner] + first[owner], owner


def _in_body(
    direction: FloatArray,
    place: FloatArray,
    height_m: float,
    time_s: FloatArray,
    bodies: Bodies,
    ray: IntArray,
    owner: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """(M, 3) starts and (M, 3) directions of rays in the frames of bodies."""
    c, s = bodies.turned[owner].T
    rel = place[ray] - (bodies.position_m[owner, :2] + bodies.velocity_mps[owner] * time_s[ray, None])
    given = direction[ray]
    origin, ahead = np.empty((len(ray), 3)), np.empty((len(ray), 3))
    origin[:, 0] = c * rel[:, 0] + s * rel[:, 1]
    origin[:, 1] = c * rel[:, 1] - s * rel[:, 0]
    origin[:, 2] = height_m - bodies.position_m[owner, 2]
    ahead[:, 0] = c * given[:, 0] + s * given[:, 1]
    ahead[:, 1] = c * given[:, 1] - s * given[:, 0]
    ahead[:, 2] = given[:, 2]
    ahead[ahead == 0.0] = TINY
    return origin, ahead


def _slab(origin: FloatArray, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where rays enter and leave the space from -1 to 1 along an axis."""
    with np.errstate(over="ignore"):
        at_low, at_high = (-1.0 - origin) / ahead, (1.0 - origin) / ahead
    return np.minimum(at_low, at_high), np.maximum(at_low, at_high)


def _block(origin: FloatArray, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where rays enter and leave the cube from -1 to 1; they miss it where they leave before they enter."""
    near, far = _slab(origin[:, 0], ahead[:, 0])
    for axis in (1, 2):
        enter, leave = _slab(origin[:, axis], ahead[:, axis])
        near, far = np.maximum(near, enter), np.minimum(far, leave)
    return near, far


def _round(origin: FloatArray, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where rays enter and leave the unit circle or sphere of as many axes as there are columns.

    From the point nearest to the centre, which loses no digits far away.
    """
    square = np.maximum((ahead * ahead).sum(axis=1), SMALLEST_SQUARE)
    closest = -(origin * ahead).sum(axis=1) / square
    point = origin + closest[:, None] * ahead
    inside = 1.0 - (point * point).sum(axis=1)
    chord = np.sqrt(np.maximum(inside, 0.0) / square)
    return np.where(inside > 0.0, closest - chord, np.inf), closest + chord


def _entered(kind: IntArray, origin: FloatArray, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where rays enter and leave parts, in the coordinates in which these reach from -1 to 1."""
    near, far = np.full(len(kind), np.inf), np.full(len(kind), -np.inf)
    rows = np.flatnonzero(kind == BLOCK)
    near[rows], far[rows] = _block(origin[rows], ahead[rows])
    rows = np.flatnonzero(kind == ELLIPSOID)
    near[rows], far[rows] = _round(origin[rows], ahead[rows])
    for of, axis, across in ((COLUMN, 2, [0, 1]), (ROLLER, 1, [0, 2])):
        rows = np.flatnonzero(kind == of)
        enter, leave = _slab(origin[rows, axis], ahead[rows, axis])
        start, end = _round(origin[rows][:, across], ahead[rows][:, across])
        near[rows], far[rows] = np.maximum(enter, start), np.minimum(leave, end)
    return near, far


def _hits(
    direction: FloatArray,
    place: FloatArray,
    height_m: float,
    time_s: FloatArray,
    bodies: Bodies,
    range_m: FloatArray,
    part: IntArray,
    below: FloatArray,
) -> Hits:
    """Parts and ground together, with angles of incidence."""
    ground = below < range_m
    range_m, part = np.where(ground, below, range_m), np.where(ground, -1, part)
    body = np.where(ground, GROUND, NO_BODY)
    cosine = np.where(ground, np.abs(direction[:, 2]), 0.0)
    met = np.flatnonzero(part >= 0)
    if not len(met):
        return Hits(range_m, body, part, cosine)
    number = part[met]
    owner = np.searchsorted(bodies.first, number, side="right") - 1
    body[met] = owner
    origin, ahead = _in_body(direction, place, height_m, time_s, bodies, met, owner)
    scale, kind = bodies.parts.half_m[number], bodies.parts.kind[number]
    point = (origin + range_m[met, None] * ahead - bodies.parts.center_m[number]) / scale
    normal = _normals(kind, point) / scale
    dot, length = (normal * ahead).sum(axis=1), np.sqrt((normal * normal).sum(axis=1))
    cosine[met] = np.minimum(np.abs(dot) / length, 1.0)
    return Hits(range_m, body, part, cosine)


def _normals(kind: IntArray, point: FloatArray) -> FloatArray:
    """(M, 3) normals of unit parts at points of their surfaces, not of unit length."""
    size = np.abs(point)
    normal = point.copy()
    rows = np.flatnonzero(kind == BLOCK)
    axis = size[rows].argmax(axis=1)
    normal[rows] = 0.0
    normal[rows, axis] = 1.0
    for of, axis_of, across in ((COLUMN, 2, [0, 1]), (ROLLER, 1, [0, 2])):
        rows = np.flatnonzero(kind == of)
        on_cap = size[rows, axis_of] > np.hypot(*size[rows][:, across].T)
        normal[rows[~on_cap], axis_of] = 0.0
        normal[np.ix_(rows[on_cap], across)] = 0.0
    return normal
