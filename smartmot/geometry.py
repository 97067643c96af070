"""Plane geometry of oriented rectangles: frames, corners, overlap and free distance.

Every function broadcasts over leading dimensions, so one call serves aligned pairs (P,) as well as all
pairs (N, 1) against (1, M). A rectangle is the triple (center_m (..., 2), size_m (..., 2) as length along
the heading and width across it, yaw_rad (...)), map frame, metres and radians.
"""

from __future__ import annotations

import math

import numpy as np

import _smartmot
from smartmot.types import BoolArray, ComplexArray, FloatArray, IntArray

_CORNER_SIGNS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
"""Half lengths and half widths from the centre to the corners: front left, then counter-clockwise."""

# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_HALF_TURN, _TURN = np.array(np.pi), np.array(2.0 * np.pi)

_DENSE_PAIRS = 20_000
"""Up to this many pairs a table of all distances is faster than a search."""

_ROUNDING_M = 1e-6
"""Searches reach so much farther than the pairs: coordinates of 1e8 m carry 1.5e-8 m of rounding."""

_MOST_STRIPS = 1_000_000
"""Strips are no thinner than this share of the points' extent, so that their numbers stay exact."""

_FEW_CELLS = 1000
"""Tables up to this size are searched for pairs as they are."""


def wrap_angle(angle_rad: FloatArray) -> FloatArray:
    """Same direction within [-pi, pi).

    Args:
        angle_rad: (...) angles.

    Returns:
        (...) angles in radians.
    """
    wrapped: FloatArray = angle_rad + _HALF_TURN
    wrapped %= _TURN
    wrapped -= _HALF_TURN
    return wrapped


def to_frame(points_m: FloatArray, x_m: float, y_m: float, yaw_rad: float) -> FloatArray:
    """Map points seen from a pose: `local_SE2_map` applied to them.

    Args:
        points_m: (..., 2) points, map frame.
        x_m: Origin of the local frame, map frame.
        y_m: Origin of the local frame, map frame.
        yaw_rad: Direction of the local x axis.

    Returns:
        (..., 2) points, local frame: ahead of the pose and to its left, metres.
    """
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    local: FloatArray = (points_m - np.array([x_m, y_m])) @ np.array([[c, -s], [s, c]])
    return local


def from_frame(points_m: FloatArray, x_m: float, y_m: float, yaw_rad: float) -> FloatArray:
    """Inverse of `to_frame`: local points to the map frame.

    Args:
        points_m: (..., 2) points, local frame.
        x_m: Origin of the local frame, map frame.
        y_m: Origin of the local frame, map frame.
        yaw_rad: Direction of the local x axis.

    Returns:
        (..., 2) points, map frame, metres.
    """
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    points: FloatArray = points_m @ np.array([[c, s], [-s, c]]) + np.array([x_m, y_m])
    return points


def _axes(yaw_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of a heading."""
    return np.cos(yaw_rad), np.sin(yaw_rad)


def _rotate(x: FloatArray, y: FloatArray, c: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vector turned by the angle of cosine c and sine s."""
    return c * x - s * y, s * x + c * y


def corners(center_m: FloatArray, size_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """Corner points of rectangles.

    Args:
        center_m: (..., 2) centres, map frame.
        size_m: (..., 2) length and width.
        yaw_rad: (...) headings.

    Returns:
        (..., 4, 2) front left, rear left, rear right, front right (counter-clockwise), map frame, metres.
    """
    yaw = np.asarray(yaw_rad)[..., None]
    half = 0.5 * np.asarray(size_m)[..., None, :] * _CORNER_SIGNS
    x, y = _rotate(half[..., 0], half[..., 1], *_axes(yaw))
    return np.stack((x, y), axis=-1) + np.asarray(center_m)[..., None, :]


def circles_touch(
    a_center_m: FloatArray, a_size_m: FloatArray, b_center_m: FloatArray, b_size_m: FloatArray
) -> BoolArray:
    """Whether the circumscribed circles of rectangles a and b meet: the cheap test before exact work.

    Args:
        a_center_m: (..., 2) centres, map frame.
        a_size_m: (..., 2) length and width.
        b_center_m: (..., 2) centres, map frame.
        b_size_m: (..., 2) length and width.

    Returns:
        (...) flags; False means that the rectangles are apart.
    """
    dx = a_center_m[..., 0] - b_center_m[..., 0]
    dy = a_center_m[..., 1] - b_center_m[..., 1]
    diagonals = np.hypot(a_size_m[..., 0], a_size_m[..., 1]) + np.hypot(b_size_m[..., 0], b_size_m[..., 1])
    touch: BoolArray = dx * dx + dy * dy <= 0.25 * diagonals * diagonals
    return touch


def near_pairs(
    a_center_m: FloatArray,
    b_center_m: FloatArray,
    a_reach_m: FloatArray,
    b_reach_m: FloatArray,
    least_m: FloatArray | None = None,
) -> tuple[IntArray, IntArray]:
    """Pairs of points no farther apart than the sum of their reaches.

    Few points are compared with each other; many are sorted into strips, so that the time grows with the
    number of pairs found.

    Args:
        a_center_m: (N, 2) points, map frame.
        b_center_m: (M, 2) points, map frame.
        a_reach_m: (N,) reaches.
        b_reach_m: (M,) reaches.
        least_m: (N,) distance within which a point of a takes every point of b, whatever that one's reach.

    Returns:
        (P,) indices into a and (P,) into b, sorted by the first, then by the second.
    """
    n, m = len(a_center_m), len(b_center_m)
    if n * m <= _DENSE_PAIRS:
        squared = a_center_m[:, 0, None] - b_center_m[:, 0]
        dy = a_center_m[:, 1, None] - b_center_m[:, 1]
        limit = a_reach_m[:, None] + b_reach_m
        if least_m is not None:
            np.maximum(limit, least_m[:, None], out=limit)
        squared *= squared
        dy *= dy
        squared += dy
        limit *= limit
        inside = squared <= limit
        if inside.size <= _FEW_CELLS:
            i, j = inside.nonzero()
        else:  # searched as one row, which takes a fifth of the time
            i, j = np.divmod(inside.reshape(-1).nonzero()[0], m)
        return i, j
    return _swept_pairs(a_center_m, b_center_m, a_reach_m, b_reach_m, least_m)


def _swept_pairs(
    a_center_m: FloatArray,
    b_center_m: FloatArray,
    a_reach_m: FloatArray,
    b_reach_m: FloatArray,
    least_m: FloatArray | None,
) -> tuple[IntArray, IntArray]:
    """`near_pairs` by strips along x: in each strip that a point of a reaches, b is a range of sorted x."""
    m = len(b_center_m)
    far = a_reach_m + b_reach_m.max()
    if least_m is not None:
        np.maximum(far, least_m, out=far)
    far += _ROUNDING_M
    a_place, b_place = _as_complex(a_center_m), _as_complex(b_center_m)
    a_x, a_y, b_x, b_y = a_place.real, a_place.imag, b_place.real, b_place.imag
    low = float(b_y.min())
    height = max(float(far.mean()), (float(b_y.max()) - low) / _MOST_STRIPS)
    strip = ((b_y - low) / height).astype(np.int64)
    # b by strip and, within it, by x; the key counts both, so that one search finds x in a strip
    by_x = b_x.argsort()
    strip = strip.take(by_x)
    order = strip.argsort(kind="stable")
    key = strip.take(order) * (m + 1) + order
    order = by_x.take(order)
    sorted_x = b_x.take(by_x)
    left, right = sorted_x.searchsorted(a_x - far), sorted_x.searchsorted(a_x + far, side="right")
    # strips that a reaches, and for each the range of b
    first = np.maximum(np.floor((a_y - low - far) / height), 0.0)
    last = np.minimum(np.floor((a_y - low + far) / height), float(strip.max()))
    strips = np.maximum(last - first + 1.0, 0.0).astype(np.int64)
    row = np.arange(len(a_x)).repeat(strips)
    strip = _ranges(np.minimum(first, m * _MOST_STRIPS).astype(np.int64), strips) * (m + 1)
    start = key.searchsorted(strip + left.take(row))
    count = key.searchsorted(strip + right.take(row)) - start
    i, j = row.repeat(count), order.take(_ranges(start, count))
    offset = a_place.take(i)
    offset -= b_place.take(j)
    dx, dy, limit = offset.real, offset.imag, a_reach_m.take(i)
    limit += b_reach_m.take(j)
    if least_m is not None:
        np.maximum(limit, least_m.take(i), out=limit)
    dx *= dx
    dy *= dy
    squared = dx + dy
    limit *= limit
    pair: IntArray = (i * m + j)[squared <= limit]
    pair.sort()
    return np.divmod(pair, m)


def _as_complex(points_m: FloatArray) -> ComplexArray:
    """(N,) points (N, 2) as x + iy, so that both are taken at once."""
    places: ComplexArray = np.ascontiguousarray(points_m).view(np.complex128)[:, 0]
    return places


def _ranges(start: IntArray, count: IntArray) -> IntArray:
    """start, start + 1, ... for each of the starts, `count` numbers each, one after the other."""
    end = count.cumsum()
    ranges: IntArray = np.arange(end[-1] if len(end) else 0)
    ranges -= (end - count - start).repeat(count)
    return ranges


def signed_gap(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """Free distance between rectangles a and b, negative where they overlap.

    Apart: the Euclidean distance, reached at a corner of one of them. Overlapping: minus the shortest shift
    that separates them, which for convex shapes runs along a normal of an edge (separating axis theorem).
    The value is continuous, so its root is the contact.

    Returns:
        (...) metres, shape of the broadcast inputs.
    """
    offset = b_center_m - a_center_m
    half_a, half_b = 0.5 * a_size_m, 0.5 * b_size_m
    turn_c, turn_s = _axes(b_yaw_rad - a_yaw_rad)
    ca, sa = _axes(a_yaw_rad)
    cb, sb = _axes(b_yaw_rad)
    b_in_a = _rotate(offset[..., 0], offset[..., 1], ca, -sa)
    a_in_b = _rotate(-offset[..., 0], -offset[..., 1], cb, -sb)
    c, s = np.abs(turn_c), np.abs(turn_s)
    (la, wa), (lb, wb) = (half_a[..., 0], half_a[..., 1]), (half_b[..., 0], half_b[..., 1])
    apart = np.maximum(
        np.maximum(np.abs(b_in_a[0]) - la - lb * c - wb * s, np.abs(b_in_a[1]) - wa - lb * s - wb * c),
        np.maximum(np.abs(a_in_b[0]) - lb - la * c - wa * s, np.abs(a_in_b[1]) - wb - la * s - wa * c),
    )
    to_a = _corner_distance(b_in_a, half_b, turn_c, turn_s, half_a)
    to_b = _corner_distance(a_in_b, half_a, turn_c, -turn_s, half_b)
    gap: FloatArray = np.where(apart > 0.0, np.minimum(to_a, to_b), apart)
    return gap


def _corner_distance(
    center: tuple[FloatArray, FloatArray],
    half_m: FloatArray,
    c: FloatArray,
    s: FloatArray,
    target_half_m: FloatArray,
) -> FloatArray:
    """Least distance of a rectangle's corners from the axis-aligned rectangle at the origin, metres."""
    along = half_m[..., None, :] * _CORNER_SIGNS
    x, y = _rotate(along[..., 0], along[..., 1], c[..., None], s[..., None])
    dx = np.maximum(np.abs(center[0][..., None] + x) - target_half_m[..., 0, None], 0.0)
    dy = np.maximum(np.abs(center[1][..., None] + y) - target_half_m[..., 1, None], 0.0)
    least: FloatArray = np.hypot(dx, dy).min(axis=-1)
    return least


def signed_gap_scalar(
    a: tuple[float, float, float, float, float], b: tuple[float, float, float, float, float]
) -> float:
    """`signed_gap` of one pair without arrays, some twenty times faster: for root finding inside a step.

    Args:
        a: Centre x, centre y, length, width in metres and yaw in radians, map frame.
        b: The same of the other rectangle.

    Returns:
        Metres; negative when the rectangles overlap.
    """
    ax, ay, la, wa, ya = a
    bx, by, lb, wb, yb = b
    la, wa, lb, wb = 0.5 * la, 0.5 * wa, 0.5 * lb, 0.5 * wb
    dx, dy = bx - ax, by - ay
    ca, sa, cb, sb = math.cos(ya), math.sin(ya), math.cos(yb), math.sin(yb)
    turn_c, turn_s = math.cos(yb - ya), math.sin(yb - ya)
    c, s = abs(turn_c), abs(turn_s)
    b_x, b_y = ca * dx + sa * dy, ca * dy - sa * dx
    a_x, a_y = -cb * dx - sb * dy, sb * dx - cb * dy
    apart = max(
        abs(b_x) - la - lb * c - wb * s,
        abs(b_y) - wa - lb * s - wb * c,
        abs(a_x) - lb - la * c - wa * s,
        abs(a_y) - wb - la * s - wa * c,
    )
    if apart <= 0.0:
        return apart
    least = math.inf
    for x, y, half_l, half_w, sine, to_l, to_w in (
        (b_x, b_y, lb, wb, turn_s, la, wa),
        (a_x, a_y, la, wa, -turn_s, lb, wb),
    ):
        lx, ly, wx, wy = turn_c * half_l, sine * half_l, -sine * half_w, turn_c * half_w
        for cx, cy in (
            (x + lx + wx, y + ly + wy),
            (x - lx + wx, y - ly + wy),
            (x - lx - wx, y - ly - wy),
            (x + lx - wx, y + ly - wy),
        ):
            out_x, out_y = max(abs(cx) - to_l, 0.0), max(abs(cy) - to_w, 0.0)
            least = min(least, math.hypot(out_x, out_y))
    return least


__getattr__ = _smartmot.renamed(
    __name__,
    {
        "bev_giou": "smartmot.overlap.bev_giou",
        "bev_iou": "smartmot.overlap.bev_iou",
        "intersection_area": "smartmot.overlap.intersection_area",
        "iou_exact": "smartmot.overlap.iou_exact",
        "iou_pairs": "smartmot.overlap.iou_pairs",
        "iou_scalar": "smartmot.overlap.iou_scalar",
    },
)
