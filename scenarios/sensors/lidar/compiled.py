"""Rays against bodies in loops that numba compiles: the same arithmetic as `casting.nearest_parts`.

Imported where numba is installed (extra `fast`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

from scenarios.sensors.lidar.casting import SMALLEST_SQUARE, TINY
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, Bodies
from smartmot.arrays import FloatArray, IntArray

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(function: F) -> F:
    loops: F = njit(cache=True, error_model="numpy")(function)
    return loops


def nearest_parts(
    direction: FloatArray,
    place: FloatArray,
    height_m: float,
    time_s: FloatArray,
    bodies: Bodies,
    first: IntArray,
    last: IntArray,
) -> tuple[FloatArray, IntArray]:
    """See `casting.nearest_parts`."""
    range_m, part = np.full(len(direction), np.inf), np.full(len(direction), -1, dtype=np.int64)
    low, high = bodies.bounds()
    turned = np.column_stack((np.cos(bodies.yaw_rad), np.sin(bodies.yaw_rad)))
    _try_all(
        direction, place, height_m, time_s, bodies.position_m, turned, bodies.velocity_mps,
        0.5 * (low + high), 0.5 * (high - low) + 1e-9, bodies.first,
        bodies.parts.kind, bodies.parts.center_m, bodies.parts.half_m, first, last, range_m, part,
    )  # fmt: skip
    return range_m, part


@_compiled
def _slab(origin: float, ahead: float) -> tuple[float, float]:
    one, other = (-1.0 - origin) / ahead, (1.0 - origin) / ahead
    return min(one, other), max(one, other)


@_compiled
def _block(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> tuple[float, float]:
    near, far = _slab(x, dx)
    enter, leave = _slab(y, dy)
    near, far = max(near, enter), min(far, leave)
    enter, leave = _slab(z, dz)
    return max(near, enter), min(far, leave)


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
def _entered(kind: int, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> tuple[float, float]:
    if kind == BLOCK:
        return _block(x, y, z, dx, dy, dz)
    if kind == ELLIPSOID:
        return _round(x, y, z, dx, dy, dz)
    if kind == COLUMN:
        enter, leave = _slab(z, dz)
        near, far = _round(x, y, 0.0, dx, dy, 0.0)
    else:
        enter, leave = _slab(y, dy)
        near, far = _round(x, z, 0.0, dx, dz, 0.0)
    return max(near, enter), min(far, leave)


@_compiled
def _try_all(
    direction: FloatArray, place: FloatArray, height_m: float, time_s: FloatArray,
    position: FloatArray, turned: FloatArray, velocity: FloatArray, middle: FloatArray, reach: FloatArray,
    part_of: IntArray, kind: IntArray, center: FloatArray, half: FloatArray,
    first: IntArray, last: IntArray, range_m: FloatArray, part: IntArray,
) -> None:  # fmt: skip
    for body in range(len(position)):
        c, s = turned[body, 0], turned[body, 1]
        oz = height_m - position[body, 2]
        for span in range(2):
            for ray in range(first[body, span], last[body, span]):
                rx = place[ray, 0] - (position[body, 0] + velocity[body, 0] * time_s[ray])
                ry = place[ray, 1] - (position[body, 1] + velocity[body, 1] * time_s[ray])
                ox, oy = c * rx + s * ry, c * ry - s * rx
                gx, gy, dz = direction[ray, 0], direction[ray, 1], direction[ray, 2]
                dx, dy = c * gx + s * gy, c * gy - s * gx
                dx = TINY if dx == 0.0 else dx
                dy = TINY if dy == 0.0 else dy
                dz = TINY if dz == 0.0 else dz
                hx, hy, hz = reach[body, 0], reach[body, 1], reach[body, 2]
                near, far = _block(
                    (ox - middle[body, 0]) / hx, (oy - middle[body, 1]) / hy, (oz - middle[body, 2]) / hz,
                    dx / hx, dy / hy, dz / hz,
                )  # fmt: skip
                if not (near <= far and far > 0.0) or near >= range_m[ray]:
                    continue
                for p in range(part_of[body], part_of[body + 1]):
                    hx, hy, hz = half[p, 0], half[p, 1], half[p, 2]
                    near, far = _entered(
                        kind[p],
                        (ox - center[p, 0]) / hx, (oy - center[p, 1]) / hy, (oz - center[p, 2]) / hz,
                        dx / hx, dy / hy, dz / hz,
                    )  # fmt: skip
                    if near <= far and 0.0 < near < range_m[ray]:
                        range_m[ray], part[ray] = near, p
