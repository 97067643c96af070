"""Common area of oriented rectangles, exact and without clipping polygons; IoU of pairs and of all pairs.

Every function broadcasts over leading dimensions. A rectangle is a triple as in
`smartmot.geometry`: centre (..., 2), length and width (..., 2), heading (...), map frame, metres and radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.geometry import circles_touch, corners, near_pairs
from smartmot.types import Boxes, FloatArray

# Constants are arrays of no dimension: NumPy would make them of numbers anew in every call.
_ZERO, _ONE, _MINUS_ONE, _EIGHTH = np.array(0.0), np.array(1.0), np.array(-1.0), np.array(0.125)
_HALF = np.array(0.5)

_CORNERS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0]])
"""Centre and half axes along and across the heading, as often as they enter the corners: front left, then
counter-clockwise, closed."""

_LEAST_AREA_M2 = 1e-300
"""Stands for a union of 0 in a division."""

_CHUNK = 1024
"""Most pairs treated at once: their intermediate arrays stay in the cache, and none is so large (128 KiB)
that the allocator maps it anew each time."""

_LEAST_HALF_M = np.array(1e-30)
"""Stands for a size of 0 in a division."""

_LEAST_STEP = np.array(1e-100)
"""Added to what is divided by: rounds off unless it is 0, and then the quotient counts for nothing."""

_LEAST_RISE = 1e-12
"""An edge that rises less than this, in half widths of the other rectangle, counts as rising so much: what
this could add to the area is far under the rounding error of map coordinates (1e-9 m at 1,000 km)."""


def intersection_area(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """Exact common area of rectangles a and b.

    Returns:
        (...) areas in square metres, shape of the broadcast inputs.
    """
    # Around b's centre: far from the map's origin the products would lose digits.
    offset = a_center_m - b_center_m
    x, y = offset[..., 0], offset[..., 1]
    a, b = _half_axes(_HALF * a_size_m, a_yaw_rad), _half_axes(_stretch(_HALF * b_size_m), b_yaw_rad)
    shape = np.broadcast(x, a[0, 0], b[0, 0]).shape
    vectors, frame = np.empty((3, 2, *shape)), np.empty((2, 2, *shape))
    vectors[0, 0], vectors[0, 1] = x, y
    vectors[1:], frame[:] = _spread(a, len(shape)), _spread(b, len(shape))
    vectors, frame = vectors.reshape(3, 2, -1), frame.reshape(2, 2, -1)
    count = vectors.shape[2]
    if count <= _CHUNK:
        share = _common_share(vectors, frame)
    else:
        share = np.empty(count)
        for part in _chunks(count):
            share[part] = _common_share(vectors[..., part], frame[..., part])
    area: FloatArray = share.reshape(shape) * (b_size_m[..., 0] * b_size_m[..., 1])
    return area


def _half_axes(half_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """(2, 2, ...) half axes along and across the heading, x and y of each; half sizes (..., 2)."""
    c, s, length, width = np.cos(yaw_rad), np.sin(yaw_rad), half_m[..., 0], half_m[..., 1]
    axes = np.empty((2, 2, *np.broadcast(c, length).shape))
    across_x = axes[1, 0, ...]
    np.multiply(c, length, out=axes[0, 0, ...])
    np.multiply(s, length, out=axes[0, 1, ...])
    np.multiply(s, width, out=across_x)
    np.negative(across_x, out=across_x)
    np.multiply(c, width, out=axes[1, 1, ...])
    return axes


def _stretch(half_m: FloatArray) -> FloatArray:
    """(..., 2) what makes half sizes 1."""
    stretch: FloatArray = _ONE / np.maximum(half_m, _LEAST_HALF_M)
    return stretch


def _spread(axes: FloatArray, dimensions: int) -> FloatArray:
    """The same axes with `dimensions` dimensions after the first two."""
    missing = dimensions - (axes.ndim - 2)
    return axes.reshape(2, 2, *(1,) * missing, *axes.shape[2:]) if missing else axes


def _chunks(count: int) -> Iterator[slice]:
    """Pieces of nearly one size: a small rest would cost nearly as much as a full one."""
    step = math.ceil(count / math.ceil(count / _CHUNK))
    return (slice(start, start + step) for start in range(0, count, step))


def _common_share(vectors: FloatArray, frame: FloatArray) -> FloatArray:
    """Common areas of rectangles a, given around the centres of b, and of b, over the areas of b.

    Clamping both coordinates, in b's frame, to b's extent moves every point outside b onto its border and
    leaves the inside as it is. The image of a's outline therefore winds once around the points of a that lie
    in b and around no others, and its signed area, the integral of x dy, is the common area. Along an edge y
    changes only between the borders, and there the mean of the clamped x has a closed form. Touching and
    coincident edges need no special case. The frame is stretched so that b spans -1 to 1 both ways.

    Args:
        vectors: (3, 2, P) a's centres and half axes along and across, x and y of each.
        frame: (2, 2, P) rows of the matrices that take x and y into b's stretched frame.

    Returns:
        (P,) values in [0, 1].
    """
    turned = frame[:, 0, None] * vectors[:, 0]
    turned += frame[:, 1, None] * vectors[:, 1]
    x, y = _CORNERS @ turned
    inside = np.minimum(y, _ONE)
    np.maximum(inside, _MINUS_ONE, out=inside)
    # Where each edge enters and leaves the strip between b's borders: from its ends along the edge. An edge
    # that does not rise has no part in the integral, wherever its quotient puts these points.
    rise = y[1:] - y[:4]
    rise += _LEAST_STEP
    slope = x[1:] - x[:4]
    slope /= rise
    np.subtract(inside, y, out=y)
    end = np.empty((2, *slope.shape))
    start, stop = end
    np.multiply(y[:4], slope, out=start)
    np.multiply(y[1:], slope, out=stop)
    start += x[:4]
    stop += x[1:]
    # The mean of clamp(x) over an edge is the mean of x less that of the excess over the border. The excess
    # grows linearly from 0 at the border: its mean is half its sum, times the share of the edge outside.
    excess = np.minimum(end, _ONE)
    np.maximum(excess, _MINUS_ONE, out=excess)
    np.subtract(end, excess, out=excess)
    run = stop - start
    np.abs(run, out=run)
    run += _LEAST_STEP
    twice_mean = start
    twice_mean += stop
    outside = excess[0] + excess[1]
    np.abs(excess, out=excess)
    share = excess[0]
    share += excess[1]
    share /= run
    np.minimum(share, _ONE, out=share)
    outside *= share
    twice_mean -= outside
    twice_mean *= inside[1:] - inside[:4]
    # Half of it is the area, a quarter of b's is 1.
    common: FloatArray = np.add.reduce(twice_mean, axis=0)
    common *= _EIGHTH
    np.maximum(common, _ZERO, out=common)
    return common


def iou_pairs(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """Intersection over union on the ground of rectangles a and b.

    Returns:
        (...) values in [0, 1], shape of the broadcast inputs.
    """
    shape = np.broadcast_shapes(
        a_center_m.shape[:-1], a_size_m.shape[:-1], a_yaw_rad.shape,
        b_center_m.shape[:-1], b_size_m.shape[:-1], b_yaw_rad.shape,
    )  # fmt: skip
    near = np.broadcast_to(circles_touch(a_center_m, a_size_m, b_center_m, b_size_m), shape)
    iou = np.zeros(shape)
    if near.any():
        vectors = (*shape, 2)
        iou[near] = iou_exact(
            np.broadcast_to(a_center_m, vectors)[near],
            np.broadcast_to(a_size_m, vectors)[near],
            np.broadcast_to(a_yaw_rad, shape)[near],
            np.broadcast_to(b_center_m, vectors)[near],
            np.broadcast_to(b_size_m, vectors)[near],
            np.broadcast_to(b_yaw_rad, shape)[near],
        )
    return iou


def iou_exact(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """`iou_pairs` without the circle test, for pairs known to be near.

    Returns:
        (...) values in [0, 1], shape of the broadcast inputs; 0 where both rectangles have no area.
    """
    common = intersection_area(a_center_m, a_size_m, a_yaw_rad, b_center_m, b_size_m, b_yaw_rad)
    return _iou(common, a_size_m[..., 0] * a_size_m[..., 1], b_size_m[..., 0] * b_size_m[..., 1])


def _iou(common_m2: FloatArray, a_area_m2: FloatArray, b_area_m2: FloatArray) -> FloatArray:
    """(...) intersection over union, from areas."""
    union_m2 = np.maximum(a_area_m2 + b_area_m2 - common_m2, _LEAST_AREA_M2)
    iou: FloatArray = np.minimum(common_m2 / union_m2, _ONE)
    return iou


def iou_scalar(
    a: tuple[float, float, float, float, float], b: tuple[float, float, float, float, float]
) -> float:
    """`iou_exact` of one pair without arrays, some twenty times faster: for the few pairs of a small frame.

    Args:
        a: Centre x, centre y, length, width in metres and yaw in radians, map frame.
        b: The same of the other rectangle.

    Returns:
        Value in [0, 1].
    """
    ax, ay, la, wa, ya = a
    bx, by, lb, wb, yb = b
    la, wa, lb, wb = 0.5 * la, 0.5 * wa, 0.5 * lb, 0.5 * wb
    dx, dy, turn = ax - bx, ay - by, ya - yb
    cb, sb, turn_c, turn_s = math.cos(yb), math.sin(yb), math.cos(turn), math.sin(turn)
    x, y = dx * cb + dy * sb, dy * cb - dx * sb
    c, s = abs(turn_c), abs(turn_s)
    # Apart along an axis of b or of a; two rectangles without area overlap nothing.
    if (
        abs(x) >= lb + la * c + wa * s
        or abs(y) >= wb + la * s + wa * c
        or abs(x * turn_c + y * turn_s) >= la + lb * c + wb * s
        or abs(y * turn_c - x * turn_s) >= wa + lb * s + wb * c
    ):
        return 0.0
    lx, ly, wx, wy = turn_c * la, turn_s * la, -turn_s * wa, turn_c * wa
    # The integral of `_common_share`, edge after edge; low and high are y of the edge's ends clamped to b.
    twice = 0.0
    x0, y0 = x + lx - wx, y + ly - wy
    low = y0 if -wb < y0 < wb else wb if y0 > 0.0 else -wb
    for x1, y1 in (
        (x + lx + wx, y + ly + wy),
        (x - lx + wx, y - ly + wy),
        (x - lx - wx, y - ly - wy),
        (x0, y0),
    ):
        high = y1 if -wb < y1 < wb else wb if y1 > 0.0 else -wb
        if low != high:
            rise = y1 - y0
            slope = (x1 - x0) / rise if rise > _LEAST_RISE or rise < -_LEAST_RISE else 0.0
            start, end = x0 + (low - y0) * slope, x1 + (high - y1) * slope
            twice_mean = start + end
            over_start = start - lb if start > lb else start + lb if start < -lb else 0.0
            over_end = end - lb if end > lb else end + lb if end < -lb else 0.0
            if over_start or over_end:
                outside, run = abs(over_start) + abs(over_end), abs(end - start)
                twice_mean -= (over_start + over_end) * (outside / run if outside < run else 1.0)
            twice += (high - low) * twice_mean
        x0, y0, low = x1, y1, high
    common = max(0.5 * twice, 0.0)
    return min(common / max(4.0 * (la * wa + lb * wb) - common, _LEAST_AREA_M2), 1.0)


def bev_iou(a: Boxes | ArrayLike, b: Boxes | ArrayLike) -> FloatArray:
    """Intersection over union on the ground of every box of a with every box of b.

    Exact; pairs whose circumscribed circles are apart cost no more than the distance.

    Args:
        a: N boxes, or (N, 5) rows of x, y, length, width in metres and yaw in radians.
        b: M boxes, likewise. Degenerate rectangles (length or width 0) overlap nothing.

    Returns:
        (N, M) values in [0, 1].

    Raises:
        ShapeError: Rows have another length, or a value is not finite or a size negative.
    """
    (a_center, a_size, a_yaw), (b_center, b_size, b_yaw) = _rectangles(a), _rectangles(b)
    n, m = len(a_yaw), len(b_yaw)
    iou = np.zeros((n, m))
    # Everything that belongs to one box is computed once, not once for each of its pairs, and of all boxes
    # in one call: columns of centre, half axes and area; those of b have stretched axes, see `_common_share`.
    size = np.concatenate((a_size, b_size))
    half = _HALF * size
    radius = np.hypot(half[:, 0], half[:, 1])
    i, j = near_pairs(a_center, b_center, radius[:n], radius[n:])
    if len(i) == 0:
        return iou
    half[n:] = _stretch(half[n:])
    columns = np.empty((7, n + m))
    columns[:2, :n], columns[:2, n:] = a_center.T, b_center.T
    columns[2:6] = _half_axes(half, np.concatenate((a_yaw, b_yaw))).reshape(4, -1)
    np.multiply(size[:, 0], size[:, 1], out=columns[6])
    of_a, of_b, cells = columns[:, :n], columns[:, n:], iou.reshape(-1)
    for part in _chunks(len(i)):
        k, of = i[part], j[part]
        left, right = of_a.take(k, axis=1), of_b.take(of, axis=1)
        left[:2] -= right[:2]
        common = _common_share(left[:6].reshape(3, 2, -1), right[2:6].reshape(2, 2, -1))
        common *= right[6]
        k *= m
        k += of
        cells[k] = _iou(common, left[6], right[6])
    return iou


def _rectangles(boxes: Boxes | ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, sizes and headings of boxes or of (N, 5) rows."""
    if isinstance(boxes, Boxes):
        return boxes.center_m, boxes.size_m, boxes.yaw_rad
    rows = np.asarray(boxes, dtype=np.float64)
    if rows.size == 0:
        rows = rows.reshape(0, 5)
    if rows.ndim != 2 or rows.shape[1] != 5:
        raise ShapeError(f"boxes: expected rows of x, y, length, width and yaw, got shape {rows.shape}")
    if not np.isfinite(rows).all() or (rows[:, 2:4] < 0.0).any():
        raise ShapeError("boxes: every value must be finite and no size negative; drop such rows first")
    return rows[:, :2], rows[:, 2:4], rows[:, 4]


def bev_giou(a: Boxes, b: Boxes) -> FloatArray:
    """Generalised intersection over union of aligned pairs: IoU less the share of the hull that is empty.

    Args:
        a: P boxes.
        b: P boxes.

    Returns:
        (P,) values in (-1, 1].
    """
    import shapely

    if len(a) == 0:
        return np.zeros(0)
    common = intersection_area(a.center_m, a.size_m, a.yaw_rad, b.center_m, b.size_m, b.yaw_rad)
    union = a.size_m.prod(axis=1) + b.size_m.prod(axis=1) - common
    # Corners around a's centre: far from the map's origin the hull would lose digits.
    both = np.concatenate(
        (
            corners(np.zeros_like(a.center_m), a.size_m, a.yaw_rad),
            corners(b.center_m - a.center_m, b.size_m, b.yaw_rad),
        ),
        axis=1,
    )
    hull = shapely.area(shapely.convex_hull(shapely.multipoints(both)))
    giou: FloatArray = np.minimum(common / union, 1.0) - np.maximum(1.0 - union / hull, 0.0)
    return giou
