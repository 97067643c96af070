"""Plane geometry of oriented rectangles: frames, corners, overlap and free distance.

Every function broadcasts over leading dimensions, so one call serves aligned pairs (P,) as well as all
pairs (N, 1) against (1, M). A rectangle is the triple (center_m (..., 2), size_m (..., 2) as length along
the heading and width across it, yaw_rad (...)), map frame, metres and radians.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.types import BoolArray, Boxes, ComplexArray, FloatArray, IntArray

_CORNER_SIGNS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
"""Half lengths and half widths from the centre to the corners: front left, then counter-clockwise."""

_LEAST_AREA_M2 = 1e-300
"""Stands for a union of 0 in a division."""

_CHUNK = 1024
"""Most pairs treated at once: their intermediate arrays stay in the cache, and none is so large (128 KiB)
that the allocator maps it anew each time."""

_DENSE_PAIRS = 20_000
"""Up to this many pairs a table of all distances is faster than a tree."""

_FEW_CELLS = 1000
"""Tables up to this size are searched for pairs as they are."""

_LEAST_SIZE_M = 1e-100
"""Stands for a size of 0 in a division."""

_LEAST_RUN = 1e-100
"""Stands for a run of 0 in a division."""

_LEAST_RISE = 1e-12
"""An edge that rises less than this, in half widths of the other rectangle, counts as rising so much: what
this could add to the area is far under the rounding error of map coordinates (1e-9 m at 1,000 km)."""


def wrap_angle(angle_rad: FloatArray) -> FloatArray:
    """Same direction within [-pi, pi).

    Args:
        angle_rad: (...) angles.

    Returns:
        (...) angles in radians.
    """
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi


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


def intersection_area(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """Exact common area of rectangles a and b.

    Args:
        a_center_m: (..., 2) centres, map frame.
        a_size_m: (..., 2) length and width.
        a_yaw_rad: (...) headings.
        b_center_m: (..., 2) centres, map frame.
        b_size_m: (..., 2) length and width.
        b_yaw_rad: (...) headings.

    Returns:
        (...) areas in square metres, shape of the broadcast inputs.
    """
    # Around b's centre: far from the map's origin the products would lose digits.
    subject = _subject(a_center_m - b_center_m, a_size_m, a_yaw_rad)
    share = _common_share(subject, *_clip(b_size_m, b_yaw_rad))
    share *= b_size_m[..., 0] * b_size_m[..., 1]
    return share


def _subject(center_m: FloatArray, size_m: FloatArray, yaw_rad: FloatArray) -> ComplexArray:
    """(4, ...) centres, half axes along and across the heading, and the first reversed, as x + iy."""
    heading = _heading(yaw_rad)
    half = 0.5 * size_m
    x, y = center_m[..., 0], center_m[..., 1]
    subject = np.empty((4, *np.broadcast(x, half[..., 0], heading).shape), dtype=np.complex128)
    subject.real[0], subject.imag[0] = x, y
    subject[1] = heading * half[..., 0]
    subject[2] = heading * (1j * half[..., 1])
    subject[3] = -subject[1]
    return subject


def _clip(size_m: FloatArray, yaw_rad: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """(...) what turns a vector x + iy into a rectangle's frame, (..., 2) what makes it 2 long and 2 wide."""
    return _heading(-yaw_rad), 2.0 / np.maximum(size_m, _LEAST_SIZE_M)


def _heading(yaw_rad: FloatArray) -> ComplexArray:
    """(...) unit vectors x + iy."""
    heading = np.empty(yaw_rad.shape, dtype=np.complex128)
    np.cos(yaw_rad, out=heading.real)
    np.sin(yaw_rad, out=heading.imag)
    return heading


def _common_share(subject: ComplexArray, axis: ComplexArray, stretch: FloatArray) -> FloatArray:
    """Common areas of rectangles a, given around the centres of b, and of b, over the areas of b.

    Clamping both coordinates, in b's frame, to b's extent moves every point outside b onto its border and
    leaves the inside as it is. The image of a's outline therefore winds once around the points of a that lie
    in b and around no others, and its signed area, the integral of x dy, is the common area. Along an edge y
    changes only between the borders, and there the mean of the clamped x has a closed form. Touching and
    coincident edges need no special case. The frame is stretched so that b spans -1 to 1 both ways.

    Args:
        subject: (4, ...) see `_subject`.
        axis: (...) see `_clip`.
        stretch: (..., 2) see `_clip`.

    Returns:
        (...) values in [0, 1].
    """
    turned = subject * axis
    x, y = turned.real * stretch[..., 0], turned.imag * stretch[..., 1]
    shape = x.shape[1:]
    # Corners from front left counter-clockwise, closed: y clamped to b's borders.
    ring = np.empty((5, *shape))
    to_left = y[1::2] + y[2]
    np.add(y[0], to_left, out=ring[:2])
    np.subtract(y[0], to_left, out=ring[2:4])
    ring[4] = ring[0]
    np.minimum(ring, 1.0, out=ring)
    np.maximum(ring, -1.0, out=ring)
    # The lines that carry the edges, x = base + slope * y: two directions, each on two sides.
    along_y = y[1:3]
    rise = np.abs(along_y)
    np.maximum(rise, _LEAST_RISE, out=rise)
    np.copysign(rise, along_y, out=rise)
    slope = x[1:3] / rise
    middle, beside = x[0] - y[0] * slope, x[2:] - y[2:] * slope
    base = np.empty((2, 2, *shape))
    np.add(middle, beside, out=base[0])
    np.subtract(middle, beside, out=base[1])
    # Where each edge enters and leaves the strip between b's borders.
    end = np.empty((2, 2, 2, *shape))
    np.multiply(ring[:4].reshape(2, 2, *shape), slope, out=end[0])
    np.multiply(ring[1:].reshape(2, 2, *shape), slope, out=end[1])
    end += base
    # The mean of clamp(x) over an edge is the mean of x less that of the excess over the border. The excess
    # grows linearly from 0 at the border: its mean is half its sum, times the share of the edge outside.
    excess = np.minimum(end, 1.0)
    np.maximum(excess, -1.0, out=excess)
    np.subtract(end, excess, out=excess)
    run = end[1] - end[0]
    np.abs(run, out=run)
    np.maximum(run, _LEAST_RUN, out=run)
    twice_mean = end[0] + end[1]
    outside = excess[0] + excess[1]
    np.abs(excess, out=excess)
    share = excess[0] + excess[1]
    share /= run
    np.minimum(share, 1.0, out=share)
    outside *= share
    twice_mean -= outside
    twice_mean *= (ring[1:] - ring[:4]).reshape(2, 2, *shape)
    # Half of it is the area, a quarter of b's is 1.
    common: FloatArray = 0.125 * np.add.reduce(twice_mean.reshape(4, *shape), axis=0)
    return np.maximum(common, 0.0)


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


def iou_pairs(
    a_center_m: FloatArray,
    a_size_m: FloatArray,
    a_yaw_rad: FloatArray,
    b_center_m: FloatArray,
    b_size_m: FloatArray,
    b_yaw_rad: FloatArray,
) -> FloatArray:
    """Intersection over union on the ground of rectangles a and b.

    Args:
        a_center_m: (..., 2) centres, map frame.
        a_size_m: (..., 2) length and width.
        a_yaw_rad: (...) headings.
        b_center_m: (..., 2) centres, map frame.
        b_size_m: (..., 2) length and width.
        b_yaw_rad: (...) headings.

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

    Args:
        a_center_m: (..., 2) centres, map frame.
        a_size_m: (..., 2) length and width.
        a_yaw_rad: (...) headings.
        b_center_m: (..., 2) centres, map frame.
        b_size_m: (..., 2) length and width.
        b_yaw_rad: (...) headings.

    Returns:
        (...) values in [0, 1], shape of the broadcast inputs; 0 where both rectangles have no area.
    """
    common = intersection_area(a_center_m, a_size_m, a_yaw_rad, b_center_m, b_size_m, b_yaw_rad)
    return _iou(common, a_size_m[..., 0] * a_size_m[..., 1], b_size_m[..., 0] * b_size_m[..., 1])


def _iou(common_m2: FloatArray, a_area_m2: FloatArray, b_area_m2: FloatArray) -> FloatArray:
    """(...) intersection over union, from areas."""
    union_m2 = np.maximum(a_area_m2 + b_area_m2 - common_m2, _LEAST_AREA_M2)
    return np.minimum(common_m2 / union_m2, 1.0)


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
    iou = np.zeros((len(a_yaw), len(b_yaw)))
    i, j = _near_pairs(a_center, a_size, b_center, b_size)
    if len(i) == 0:
        return iou
    # Everything that belongs to one box is computed once, not once for each of its pairs.
    subject, (axis, stretch) = _subject(a_center, a_size, a_yaw), _clip(b_size, b_yaw)
    b_place = b_center[:, 0] + 1j * b_center[:, 1]
    a_area, b_area = a_size[:, 0] * a_size[:, 1], b_size[:, 0] * b_size[:, 1]
    cells = iou.reshape(-1)
    # pieces of one size: a small rest would cost nearly as much as a whole one
    step = math.ceil(len(i) / math.ceil(len(i) / _CHUNK))
    for start in range(0, len(i), step):
        k, m = i[start : start + step], j[start : start + step]
        near = subject.take(k, axis=1)
        near[0] -= b_place.take(m)
        size_b = b_area.take(m)
        common = _common_share(near, axis.take(m), stretch.take(m, axis=0)) * size_b
        cells[k * len(b_yaw) + m] = _iou(common, a_area.take(k), size_b)
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


def _near_pairs(
    a_center_m: FloatArray, a_size_m: FloatArray, b_center_m: FloatArray, b_size_m: FloatArray
) -> tuple[IntArray, IntArray]:
    """Index pairs (P,), (P,) of the boxes whose circumscribed circles meet."""
    radius_a = 0.5 * np.hypot(a_size_m[:, 0], a_size_m[:, 1])
    radius_b = 0.5 * np.hypot(b_size_m[:, 0], b_size_m[:, 1])
    i, j = near_pairs(a_center_m, b_center_m, radius_a, radius_b)
    return i, j


def near_pairs(
    a_center_m: FloatArray,
    b_center_m: FloatArray,
    a_reach_m: FloatArray,
    b_reach_m: FloatArray,
    least_m: FloatArray | None = None,
) -> tuple[IntArray, IntArray]:
    """Pairs of points no farther apart than the sum of their reaches.

    Few points are compared with each other; many go through a k-d tree, so that the time grows with the
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
    from scipy.spatial import KDTree

    # The widest reach would make every search wide: each power of two is searched on its own.
    least_m = np.zeros(n) if least_m is None else least_m
    widest_b = float(b_reach_m.max())
    farthest = np.maximum(a_reach_m + widest_b, least_m)
    octave = np.frexp(farthest)[1]
    tree = KDTree(b_center_m)
    found: list[tuple[IntArray, IntArray]] = []
    for power in np.unique(octave).tolist():
        rows = np.flatnonzero(octave == power)
        widest = float(farthest[rows].max())
        near = KDTree(a_center_m[rows]).sparse_distance_matrix(tree, widest, output_type="ndarray")
        i, j, distance = rows[near["i"]], near["j"].astype(np.int64), near["v"]
        inside = distance <= np.maximum(a_reach_m[i] + b_reach_m[j], least_m[i])
        found.append((i[inside], j[inside]))
    i, j = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(i * m + j)
    return i[order], j[order]


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

    Args:
        a_center_m: (..., 2) centres, map frame.
        a_size_m: (..., 2) length and width.
        a_yaw_rad: (...) headings.
        b_center_m: (..., 2) centres, map frame.
        b_size_m: (..., 2) length and width.
        b_yaw_rad: (...) headings.

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
