"""Paths of trajectories: polyline, clothoid spline, NURBS."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from opendrive.geometry.curves import clothoid
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import ClothoidSpline, Nurbs, Polyline, Position, Shape, Trajectory
from scenarios.openscenario.motion.paths import SPACING_M, Path, Pose
from smartmot.path import chord_stations
from smartmot.types import FloatArray

MAX_POINTS = 200_000
"""A trajectory that needs more points is refused."""

SAME_PLACE_M = 1e-6
"""Vertices in a row that are nearer are at the same place."""

JOINED_M, JOINED_RAD = 0.05, 0.01
"""Pieces that meet within this are one curve: files give starts with two decimals."""

MAX_TURN_RAD = 1000.0
"""A piece that turns further is refused."""


def starts_at_entity(trajectory: Trajectory) -> bool:
    """Whether a trajectory has no start of its own."""
    return isinstance(trajectory.shape, ClothoidSpline) and trajectory.shape.segments[0].start is None


def build(trajectory: Trajectory, pose_of: Callable[[Position], Pose], entity_pose: Pose | None) -> Path:
    """Path of a trajectory.

    Args:
        trajectory: as read.
        pose_of: pose of a position.
        entity_pose: the entity's pose, at which a spline without start begins.

    Raises:
        RunError: it has no length, or no start.
    """
    try:
        path = _build(trajectory.shape, pose_of, entity_pose)
        if trajectory.closed:
            path = laps(path)[0]
        start = _start_of(trajectory.shape)
        if start is not None:
            path.first_z_m = pose_of(start).z_m
        return path
    except RunError as error:
        raise RunError(f"trajectory '{trajectory.name}': {error}") from None


def _start_of(shape: Shape) -> Position | None:
    """Where a shape begins; None at the entity."""
    match shape:
        case Polyline():
            return shape.vertices[0].position
        case ClothoidSpline():
            return shape.segments[0].start
        case Nurbs():
            return shape.control_points[0]


LAPS_M, MOST_LAPS = 10_000.0, 1000
"""A closed trajectory is followed for so long a way, or so often."""

CLOSED_M = 0.05
"""The ends of a closed curve may be this far apart; those of a polyline are joined by a straight line."""


def laps(path: Path) -> tuple[Path, int]:
    """A closed curve, followed again and again, and how often.

    Raises:
        RunError: it is curved, and its ends are apart.
    """
    points, yaw = path.points_m, path.yaw_at_points()
    gap_m = float(np.hypot(*(points[-1] - points[0])))
    if yaw is not None and gap_m > CLOSED_M:
        raise RunError(f"it is closed, and its ends are {gap_m:.3g} m apart")
    ring = points if gap_m > CLOSED_M else points[:-1]
    count = max(2, min(MOST_LAPS, MAX_POINTS // len(ring), math.ceil(LAPS_M / path.length_m)))
    points = np.concatenate((np.tile(ring, (count, 1)), points[:1]))
    if yaw is None:
        return Path(points[:, 0], points[:, 1]), count
    headings = np.unwrap(np.concatenate((np.tile(yaw[: len(ring)], count), yaw[:1])))
    again = Path(points[:, 0], points[:, 1], headings)
    again.reverse = _reverse(points, headings) if path.reverse is not None else None
    return again, count


def returns(path: Path) -> bool:
    """Whether a curve ends where it begins."""
    return float(np.hypot(*(path.points_m[-1] - path.points_m[0]))) <= CLOSED_M


def _build(shape: Shape, pose_of: Callable[[Position], Pose], entity_pose: Pose | None) -> Path:
    match shape:
        case Polyline():
            if shape.headed:
                return _headed(shape)
            poses = [pose_of(vertex.position) for vertex in shape.vertices]
            return _chain(np.array([(pose.x_m, pose.y_m, 0.0) for pose in poses]), headed=False)
        case ClothoidSpline():
            return _spline(shape, pose_of, entity_pose)
        case Nurbs():
            return _nurbs(shape, pose_of)


def _headed(shape: Polyline) -> Path:
    rows = [(v.position.x_m, v.position.y_m, v.position.heading_rad) for v in shape.vertices]  # type: ignore[union-attr]
    return _chain(np.array(rows), headed=True)


SIDEWAYS = 1e-6
"""Share of a chord by which headings across it may point backwards by rounding."""


def _reverse(points_m: FloatArray, yaw_rad: FloatArray) -> list[bool] | None:
    """Of each chord of (K, 2) points, whether the headings at its ends point backwards; None: of none."""
    chord, middle = np.diff(points_m, axis=0), 0.5 * (yaw_rad[1:] + yaw_rad[:-1])
    along = chord[:, 0] * np.cos(middle) + chord[:, 1] * np.sin(middle)
    reverse = along < -SIDEWAYS * np.hypot(*chord.T)
    return reverse.tolist() if reverse.any() else None


def _chain(rows: FloatArray, headed: bool) -> Path:
    """Path through vertices; an entity stands between those that are at the same place.

    Where it stands, its last heading there counts.

    Args:
        rows: (V, 3) x, y and heading.
        headed: whether the headings hold; else those of the chords do.
    """
    moves = np.hypot(*np.diff(rows[:, :2], axis=0).T) >= SAME_PLACE_M
    last = np.flatnonzero(np.append(moves, True))
    if len(last) < 2:
        raise RunError("all its vertices are at the same place")
    yaw = np.unwrap(rows[:, 2])[last] if headed else None
    path = Path(rows[last, 0], rows[last, 1], yaw)
    if yaw is not None:
        path.reverse = _reverse(path.points_m, yaw)
    if len(last) < len(rows):
        path.vertex_places = np.concatenate(([0], np.cumsum(moves))).tolist()
    return path


def _spline(shape: ClothoidSpline, pose_of: Callable[[Position], Pose], entity_pose: Pose | None) -> Path:
    start = shape.segments[0].start
    if start is None and entity_pose is None:
        raise RunError("it has no PositionStart and no entity to begin at")
    pose = entity_pose if start is None else pose_of(start)
    assert pose is not None
    rows: list[FloatArray] = []
    stations: list[FloatArray] = []
    station = 0.0
    for number, segment in enumerate(shape.segments):
        offset_rad = segment.heading_offset_rad
        if segment.start is not None:
            begin = pose_of(segment.start)
            if number and math.dist(_xy(pose), _xy(begin)) > JOINED_M:
                raise RunError(f"piece {number + 1} does not start where the one before ends")
            # an offset counts from the end of the piece before, and the position says the same in another way
            turn = math.remainder(pose.yaw_rad + offset_rad - begin.yaw_rad, 2 * math.pi)
            if offset_rad and abs(turn) > JOINED_RAD:
                raise RunError(
                    f"piece {number + 1}: hOffset and PositionStart give headings {turn:.3g} rad apart"
                )
            pose = begin
        else:
            pose = pose.moved(0.0, 0.0, offset_rad)
        rate = (segment.curvature_end_per_m - segment.curvature_start_per_m) / segment.length_m
        turn = max(abs(segment.curvature_start_per_m), abs(segment.curvature_end_per_m)) * segment.length_m
        if turn > MAX_TURN_RAD:
            raise RunError(f"piece {number + 1} turns by {turn:.3g} rad, expected up to {MAX_TURN_RAD:g}")
        bends = segment.curvature_start_per_m != 0.0 or rate != 0.0
        count = max(2, math.ceil(segment.length_m / SPACING_M) + 1) if bends else 2
        if count > MAX_POINTS:
            raise RunError(f"piece {number + 1} is longer than {MAX_POINTS * SPACING_M:g} m")
        ds = np.linspace(0.0, segment.length_m, count)
        u, v = clothoid(ds, np.full(count, segment.curvature_start_per_m), np.full(count, rate))
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        yaw = pose.yaw_rad + ds * (segment.curvature_start_per_m + 0.5 * rate * ds)
        rows.append(np.column_stack((pose.x_m + c * u - s * v, pose.y_m + s * u + c * v, yaw)))
        stations.append(station + ds)
        pose = Pose(*rows[-1][-1].tolist())
        station += segment.length_m
    table, at = np.concatenate(rows), np.concatenate(stations)
    keep = np.concatenate(([True], np.diff(at) > 0.0))
    # where pieces meet, the later heading counts: a bend in the heading belongs to the piece that follows
    return Path(table[keep, 0], table[keep, 1], table[keep, 2], at[keep])


def _xy(pose: Pose) -> tuple[float, float]:
    return pose.x_m, pose.y_m


def _nurbs(shape: Nurbs, pose_of: Callable[[Position], Pose]) -> Path:
    curve = _curve(shape, pose_of)[:, :2]
    keep = np.concatenate(([True], np.hypot(*np.diff(curve, axis=0).T) > 1e-9))
    curve = curve[keep]
    if len(curve) < 2:
        raise RunError("it has no length")
    slope = np.gradient(curve, axis=0)
    return Path(curve[:, 0], curve[:, 1], np.unwrap(np.arctan2(slope[:, 1], slope[:, 0])))


def schedule(shape: Nurbs, pose_of: Callable[[Position], Pose]) -> FloatArray:
    """(K, 2) time and arc length at points of a curve whose control points have times.

    The time is a dimension of the curve, with weights and knots like x and y.

    Raises:
        RunError: the time falls along the curve.
    """
    curve = _curve(shape, pose_of)
    if np.any(np.diff(curve[:, 2]) <= 0.0):
        raise RunError("its times do not grow all along the curve")
    return np.column_stack((curve[:, 2], chord_stations(curve[:, :2])))


def _curve(shape: Nurbs, pose_of: Callable[[Position], Pose]) -> FloatArray:
    """(K, 2 or 3) x, y and, if there are times, time by de Boor's algorithm in homogeneous coordinates."""
    points = np.array([_xy(pose_of(position)) for position in shape.control_points])
    weights = np.array(shape.weights)
    columns = np.column_stack((points, shape.times_s)) if shape.times_s else points
    homogeneous = np.column_stack((columns * weights[:, None], weights))
    knots, degree = np.array(shape.knots), shape.order - 1
    hull_m = float(np.hypot(*np.diff(points, axis=0).T).sum())
    count = max(50, math.ceil(hull_m / SPACING_M))
    if count > MAX_POINTS:
        raise RunError(f"its control points span more than {MAX_POINTS * SPACING_M:g} m")
    u = np.linspace(knots[degree], knots[len(points)], count)
    span = np.clip(np.searchsorted(knots, u, side="right") - 1, degree, len(points) - 1)
    # all points of the curve at once: row k has the control points that count in the span of u[k]
    d = homogeneous[span[:, None] - degree + np.arange(degree + 1)]
    for level in range(1, degree + 1):
        for j in range(degree, level - 1, -1):
            low = knots[span - degree + j]
            high = knots[span + 1 + j - level]
            alpha = np.divide(u - low, high - low, out=np.zeros_like(u), where=high > low)[:, None]
            d[:, j] = (1.0 - alpha) * d[:, j - 1] + alpha * d[:, j]
    curve: FloatArray = d[:, degree, :-1] / d[:, degree, -1:]
    return curve
