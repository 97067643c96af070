"""Rays against bodies in loops that numba compiles: the same hits and ranges as `casting.cast_arrays`.

Imported where numba is installed (extra `fast`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

from scenarios.sensors.lidar.casting import (
    GROUND,
    NO_BODY,
    SMALLEST_SQUARE,
    TINY,
    Hits,
    Motion,
    RayTable,
    Sectors,
)
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, Bodies
from smartmot.arrays import FloatArray, IntArray

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(function: F) -> F:
    loops: F = njit(cache=True, error_model="numpy")(function)
    return loops


def cast_loops(rays: RayTable, motion: Motion, bodies: Bodies, ground_m: float, tried: Sectors) -> Hits:
    """See `casting.cast_arrays`."""
    moments, which = rays.moments
    place, turn = motion.pose(moments)
    heading = np.column_stack((np.cos(turn), np.sin(turn)))
    count = len(rays.time_s)
    turns = motion.yaw_rate_radps != 0.0
    ahead = np.empty((count, 3)) if turns else rays.direction
    range_m, cosine = np.empty(count), np.empty(count)
    body, part = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    low, high = bodies.bounds
    bounds = np.column_stack((low - 1e-9, high + 1e-9))
    parts = bodies.parts
    over_m = motion.height_m - ground_m
    _start(rays.direction, which, heading, over_m, turns, ahead, range_m, body, part, cosine)
    _try_bodies(
        ahead, place, which, moments, rays.slope, motion.height_m, bodies.position_m, bodies.turned,
        bodies.velocity_mps, bounds, bodies.first, parts.kind, parts.center_m, parts.half_m,
        tried.first, tried.last, tried.low_slope, tried.high_slope, range_m, body, part,
    )  # fmt: skip
    _incidence(
        ahead, place, which, moments, motion.height_m, bodies.position_m, bodies.turned, bodies.velocity_mps,
        parts.kind, parts.center_m, parts.half_m, range_m, body, part, cosine,
    )  # fmt: skip
    return Hits(range_m, body, part, cosine)


@_compiled
def _start(
    direction: FloatArray, which: IntArray, heading: FloatArray, over_ground_m: float, turns: bool,
    ahead: FloatArray, range_m: FloatArray, body: IntArray, part: IntArray, cosine: FloatArray,
) -> None:  # fmt: skip
    """Turn rays as the vehicle turns, and let them meet the ground."""
    for ray in range(len(direction)):
        z = direction[ray, 2]
        if turns:
            c, s = heading[which[ray], 0], heading[which[ray], 1]
            x, y = direction[ray, 0], direction[ray, 1]
            ahead[ray, 0], ahead[ray, 1], ahead[ray, 2] = c * x - s * y, s * x + c * y, z
        range_m[ray], body[ray], part[ray], cosine[ray] = math.inf, NO_BODY, -1, 0.0
        if z < 0.0 < over_ground_m < math.inf:
            range_m[ray], body[ray], cosine[ray] = -over_ground_m / z, GROUND, -z


@_compiled
def _slab(low: float, high: float, slowness: float) -> tuple[float, float]:
    at_low, at_high = low * slowness, high * slowness
    return (at_low, at_high) if at_low < at_high else (at_high, at_low)


@_compiled
def _round(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> tuple[float, float]:
    square = max(dx * dx + dy * dy + dz * dz, SMALLEST_SQUARE)
    closest = -(x * dx + y * dy + z * dz) / square
    x, y, z = x + closest * dx, y + closest * dy, z + closest * dz
    inside = 1.0 - (x * x + y * y + z * z)
    if not inside > 0.0:
        return math.inf, closest
    chord = math.sqrt(inside / square)
    return closest - chord, closest + chord


@_compiled
def _entered(
    kind: int, x: float, y: float, z: float, dx: float, dy: float, dz: float,
    sx: float, sy: float, sz: float, hx: float, hy: float, hz: float,
) -> tuple[float, float]:  # fmt: skip
    """Where a ray from x, y, z enters and leaves a part; s are the inverses of d, h half of its extents."""
    if kind == ELLIPSOID:
        return _round(x / hx, y / hy, z / hz, dx / hx, dy / hy, dz / hz)
    if kind == BLOCK:
        near, far = _slab(-hx - x, hx - x, sx)
        enter, leave = _slab(-hy - y, hy - y, sy)
        near, far = max(near, enter), min(far, leave)
        enter, leave = _slab(-hz - z, hz - z, sz)
    elif kind == COLUMN:
        enter, leave = _slab(-hz - z, hz - z, sz)
        near, far = _round(x / hx, y / hy, 0.0, dx / hx, dy / hy, 0.0)
    else:
        enter, leave = _slab(-hy - y, hy - y, sy)
        near, far = _round(x / hx, z / hz, 0.0, dx / hx, dz / hz, 0.0)
    return max(near, enter), min(far, leave)


@_compiled
def _try_bodies(
    ahead: FloatArray, place: FloatArray, which: IntArray, moments: FloatArray, slope: FloatArray,
    height_m: float, position: FloatArray, turned: FloatArray, velocity: FloatArray, bounds: FloatArray,
    part_of: IntArray, kind: IntArray, center: FloatArray, half: FloatArray, first: IntArray, last: IntArray,
    low_slope: FloatArray, high_slope: FloatArray, range_m: FloatArray, body: IntArray, part: IntArray,
) -> None:  # fmt: skip
    for b in range(len(position)):
        c, s = turned[b, 0], turned[b, 1]
        oz = height_m - position[b, 2]
        for span in range(2):
            for ray in range(first[b, span], last[b, span]):
                if slope[ray] < low_slope[b] or slope[ray] > high_slope[b]:
                    continue
                t = which[ray]
                rx = place[t, 0] - (position[b, 0] + velocity[b, 0] * moments[t])
                ry = place[t, 1] - (position[b, 1] + velocity[b, 1] * moments[t])
                ox, oy = c * rx + s * ry, c * ry - s * rx
                gx, gy, dz = ahead[ray, 0], ahead[ray, 1], ahead[ray, 2]
                dx, dy = c * gx + s * gy, c * gy - s * gx
                dx = TINY if dx == 0.0 else dx
                dy = TINY if dy == 0.0 else dy
                dz = TINY if dz == 0.0 else dz
                sx, sy, sz = 1.0 / dx, 1.0 / dy, 1.0 / dz
                near, far = _slab(bounds[b, 0] - ox, bounds[b, 3] - ox, sx)
                enter, leave = _slab(bounds[b, 1] - oy, bounds[b, 4] - oy, sy)
                near, far = max(near, enter), min(far, leave)
                enter, leave = _slab(bounds[b, 2] - oz, bounds[b, 5] - oz, sz)
                near, far = max(near, enter), min(far, leave)
                if near > far or not far > 0.0 or near >= range_m[ray]:
                    continue
                for p in range(part_of[b], part_of[b + 1]):
                    near, far = _entered(
                        kind[p], ox - center[p, 0], oy - center[p, 1], oz - center[p, 2], dx, dy, dz,
                        sx, sy, sz, half[p, 0], half[p, 1], half[p, 2],
                    )  # fmt: skip
                    if near <= far and 0.0 < near < range_m[ray]:
                        range_m[ray], body[ray], part[ray] = near, b, p


@_compiled
def _incidence(
    ahead: FloatArray, place: FloatArray, which: IntArray, moments: FloatArray, height_m: float,
    position: FloatArray, turned: FloatArray, velocity: FloatArray,
    kind: IntArray, center: FloatArray, half: FloatArray,
    range_m: FloatArray, body: IntArray, part: IntArray, cosine: FloatArray,
) -> None:  # fmt: skip
    """Cosines of the angles of incidence on bodies."""
    for ray in range(len(range_m)):
        p = part[ray]
        if p < 0:
            continue
        b, t = body[ray], which[ray]
        c, s = turned[b, 0], turned[b, 1]
        rx = place[t, 0] - (position[b, 0] + velocity[b, 0] * moments[t])
        ry = place[t, 1] - (position[b, 1] + velocity[b, 1] * moments[t])
        dx, dy = c * ahead[ray, 0] + s * ahead[ray, 1], c * ahead[ray, 1] - s * ahead[ray, 0]
        dz = ahead[ray, 2]
        x = (c * rx + s * ry + range_m[ray] * dx - center[p, 0]) / half[p, 0]
        y = (c * ry - s * rx + range_m[ray] * dy - center[p, 1]) / half[p, 1]
        z = (height_m - position[b, 2] + range_m[ray] * dz - center[p, 2]) / half[p, 2]
        nx, ny, nz = x, y, z
        if kind[p] == BLOCK:
            ax, ay, az = abs(x), abs(y), abs(z)
            nx, ny, nz = 0.0, 0.0, 0.0
            if ax >= ay and ax >= az:
                nx = 1.0
            elif ay >= az:
                ny = 1.0
            else:
                nz = 1.0
        elif kind[p] == COLUMN:
            if z * z > x * x + y * y:
                nx, ny = 0.0, 0.0
            else:
                nz = 0.0
        elif kind[p] != ELLIPSOID:
            if y * y > x * x + z * z:
                nx, nz = 0.0, 0.0
            else:
                ny = 0.0
        nx, ny, nz = nx / half[p, 0], ny / half[p, 1], nz / half[p, 2]
        dot = nx * dx + ny * dy + nz * dz
        cosine[ray] = min(abs(dot) / math.sqrt(nx * nx + ny * ny + nz * nz), 1.0)
