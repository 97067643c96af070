"""Plane geometry of oriented rectangles: frames, corners, overlap and free distance.

Every function broadcasts over leading dimensions, so one call serves aligned pairs (P,) as well as all
pairs (N, 1) against (1, M). A rectangle is the triple (center_m (..., 2), size_m (..., 2) as length along
the heading and width across it, yaw_rad (...)), map frame, metres and radians.
"""

from __future__ import annotations

import math

import numpy as np

from smartmot.types import BoolArray, Boxes, FloatArray

_CORNER_SIGNS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
"""Half lengths and half widths from the centre to the corners: front left, then counter-clockwise."""

_EDGES = np.zeros((8, 3))
_EDGES[:4, 0] = 1.0
_EDGES[:4, 1:] = _CORNER_SIGNS
_EDGES[4:, 1:] = np.roll(_CORNER_SIGNS, -1, axis=0) - _CORNER_SIGNS
"""Start points (rows 0 to 3) and vectors (4 to 7) of the edges out of the centre and the two half axes."""

_BORDER_SIGNS = np.array([[1.0, 1.0], [-1.0, -1.0]])
"""Upper and lower borders along x and y, in half lengths and half widths."""

_NEGLIGIBLE_RUN_M = 1e-12
"""An edge that changes less than this along an axis does not cross a border of that axis: the area it could
add, its length times this, is far under the rounding error of map coordinates (1e-9 m at 1,000 km)."""


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

    Clamping both coordinates, in b's frame, to b's extent moves every point outside b onto its border and
    leaves the inside as it is. The image of a's outline therefore winds once around the points of a that lie
    in b and around no others, and its signed area is the common area. Per edge of a the image has at most
    four breakpoints. The outline stays closed whatever is rounded, so touching and coincident edges need no
    special case.

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
    # Plane vectors as complex numbers: a turn is a product. Centre of a and its half axes, in b's frame.
    offset = a_center_m - b_center_m
    center = (offset[..., 0] + 1j * offset[..., 1]) * np.exp(-1j * b_yaw_rad)
    along = np.exp(1j * (a_yaw_rad - b_yaw_rad)) * (0.5 * a_size_m[..., 0])
    shape = np.broadcast(center, along, b_size_m[..., 0]).shape
    frame = np.empty((*shape, 3), dtype=np.complex128)
    frame[..., 0], frame[..., 1] = center, along
    frame[..., 2] = along * (1j * a_size_m[..., 1] / a_size_m[..., 0])
    edge = _EDGES @ frame.view(np.float64).reshape(*shape, 3, 2)
    start, run = edge[..., :4, None, :], edge[..., 4:, None, :]
    border = 0.5 * b_size_m[..., None, None, :] * _BORDER_SIGNS
    # Fractions along each edge, in order: its start, where it crosses the four borders of b, its end.
    fraction = np.empty((*shape, 4, 6))
    fraction[..., 0], fraction[..., 5] = 0.0, 1.0
    crossing = (border - start) / np.where(np.abs(run) > _NEGLIGIBLE_RUN_M, run, np.inf)
    fraction[..., 1:5] = np.minimum(np.maximum(crossing, 0.0), 1.0).reshape(*shape, 4, 4)
    fraction.sort(axis=-1)
    point = start + fraction[..., None] * run
    limit = border[..., :1, :]
    point = np.minimum(np.maximum(point, -limit), limit)
    px, py = point[..., 0], point[..., 1]
    twice = (px[..., :-1] * py[..., 1:] - px[..., 1:] * py[..., :-1]).sum(axis=(-1, -2))
    area: FloatArray = np.maximum(0.5 * twice, 0.0)
    return area


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
        (...) values in [0, 1], shape of the broadcast inputs.
    """
    common = intersection_area(a_center_m, a_size_m, a_yaw_rad, b_center_m, b_size_m, b_yaw_rad)
    union = a_size_m[..., 0] * a_size_m[..., 1] + b_size_m[..., 0] * b_size_m[..., 1] - common
    iou: FloatArray = np.minimum(common / union, 1.0)
    return iou


def iou_matrix(a: Boxes, b: Boxes) -> FloatArray:
    """Intersection over union of every box of a with every box of b.

    Args:
        a: N boxes.
        b: M boxes.

    Returns:
        (N, M) values in [0, 1].
    """
    iou = np.zeros((len(a), len(b)))
    i, j = circles_touch(a.center_m[:, None], a.size_m[:, None], b.center_m, b.size_m).nonzero()
    if len(i):
        iou[i, j] = iou_exact(
            a.center_m[i], a.size_m[i], a.yaw_rad[i], b.center_m[j], b.size_m[j], b.yaw_rad[j]
        )
    return iou


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
