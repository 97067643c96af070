"""Labelled clouds as a network learns from them: changed at random, as pillars, with what it should say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmot.arrays import FloatArray, IntArray, StrArray
from smartmot.geometry import wrap_angle
from smartmot.lidar.ground import ground_under
from smartmot.lidar.learned.decoding import CHANNELS, STRIDE, Decoder
from smartmot.lidar.learned.pillars import Pillars, pillars_of
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.pointcloud.cloud import RealArray

SPREAD = {"car": 2.0, "cyclist": 1.0, "pedestrian": 0.5}
"""Standard deviation of a centre's peak in cells of the output, 0.4 m: about a quarter of a body's length, so
that a centre that is off by it still overlaps the body; that of people ends before the next one of a group,
0.6 m away."""

LEAST_POINTS = 5
"""Labels with fewer are neither learned nor scored, as a rule."""


@dataclass(frozen=True, slots=True)
class Changes:
    """How much a sample is changed at random.

    Args:
        turn_rad: greatest turn around the sensor.
        scale: greatest change of all lengths, as a share.
        height_m: standard deviation of an error of the ground.
        jitter_m: standard deviation of each coordinate.
        dropped: greatest share of points that are left out.
        lines_dropped: greatest share of lines of the sensor that are left out.
        mirrored: whether left and right are exchanged in half of them.
    """

    turn_rad: float = math.radians(12.0)
    scale: float = 0.05
    height_m: float = 0.03
    jitter_m: float = 0.01
    dropped: float = 0.3
    lines_dropped: float = 0.5
    mirrored: bool = True


NO_CHANGES = Changes(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, mirrored=False)


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrame:
    """Points and boxes with heights over the ground.

    Args:
        name: of the frame, for messages.
        points: (P, 3) float32: ahead, left, height over the ground, metres.
        line: (P,) of the sensor.
        boxes: T boxes; heights of their centres are over the ground.
        category: (T,) classes.
        counts: (T,) points in each box.
    """

    name: str
    points: NDArray[np.float32]
    line: NDArray[np.integer[Any]]
    boxes: Boxes3D
    category: StrArray
    counts: IntArray


def labelled_frame(
    name: str, cloud: PointCloud, boxes: Boxes3D, category: StrArray, reach_m: float
) -> LabelledFrame:
    """A frame from a cloud and its labels, sensor's frame."""
    xyz = cloud.xyz_m.astype(np.float64)
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    near = np.flatnonzero((distance <= reach_m) & (xyz[:, 0] >= 0.0))
    xyz = xyz[near]
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    ground, height = ground_under(xyz, azimuth, distance[near], reach_m)
    center = boxes.center_m.copy()
    center[:, 2] -= ground.level_m(center[:, :2])
    points = np.column_stack((xyz[:, :2], height)).astype(np.float32)
    line = (lines_of(cloud.xyz_m) if cloud.ring is None else cloud.ring)[near]
    counts = boxes.point_counts(cloud.xyz_m, 0.05)
    return LabelledFrame(name, points, line, replace(boxes, center_m=center), category, counts)


WINDOW_M = 19.2
"""Edge of the part of a cloud that is learned from at a time, a seventh of the grid: most of the others hold
no road user, and a step takes as long for them. The network looks across 18 m."""

AT_LABELS = 0.8
"""Share of the windows that are put around a road user of a class, each class as often; the others are put
around an echo."""

OFF_CENTER_M = 6.0
"""How far the middle of a window may be from there, ahead and to the left."""

BACKWARDS_RAD = math.radians(3.0)
"""Azimuths of one line go back by less, where its beams meet something near."""

LINE_COUNTS = (4, 256)
"""Of a spinning sensor; what seems to have fewer or more has none that can be told."""

CUTS_RAD = tuple(math.radians(5.0 * k) for k in range(72))
CUT_POINTS = 20_000
"""Where a line may begin, and how many points are asked for it."""

LEAST_GAP_RAD = math.radians(0.05)
"""Between elevations of two lines: half of the finest spacing of spinning sensors, 0.1 degrees."""


def lines_of(xyz_m: RealArray) -> IntArray:
    """(P,) line of the sensor of each point, as the order of the points or their elevations tell it.

    KITTI's clouds, and CARLA's, hold line after line: each turn of the azimuth is one. Clouds that hold
    column after column, as ours do, have elevations with gaps between the lines.

    Args:
        xyz_m: (P, 3) points, sensor's frame.

    Returns:
        Numbers from 0 on; all 0 where no lines can be told, as of a rosette.
    """
    xyz = xyz_m.astype(np.float64)
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    for line in (_turns(np.arctan2(xyz[:, 1], xyz[:, 0]), elevation), _levels(elevation)):
        alike = _spread(line, elevation) < _spread(np.zeros_like(line), elevation) / LINE_COUNTS[0]
        if alike and LINE_COUNTS[0] <= len(np.unique(line)) <= LINE_COUNTS[1]:
            return line
    return np.zeros(len(xyz), dtype=np.int64)


def _turns(azimuth: FloatArray, elevation: FloatArray) -> IntArray:
    """Turns of the azimuth, from where the elevations of each are most alike."""
    step = wrap_angle(np.diff(azimuth, prepend=azimuth[:1]))
    sign = -1.0 if np.clip(step, -BACKWARDS_RAD, BACKWARDS_RAD).sum() < 0.0 else 1.0
    # a step far back is one forwards over what the cloud leaves out
    forwards = np.mod(sign * step + BACKWARDS_RAD, 2.0 * np.pi) - BACKWARDS_RAD
    turned = sign * azimuth[:1] + np.cumsum(forwards)
    if not len(turned) or np.ptp(turned) > 2.0 * np.pi * LINE_COUNTS[1]:
        return np.zeros(len(azimuth), dtype=np.int64)

    def line_of(cut: float) -> IntArray:
        turn = np.floor((turned - cut) / (2.0 * np.pi)).astype(np.int64)
        line: IntArray = turn - turn.min()
        return line

    # a part of the points tells where the turns begin
    some = slice(None, None, max(len(turned) // CUT_POINTS, 1))
    spread = [_spread(line_of(cut)[some], elevation[some]) for cut in CUTS_RAD]
    return line_of(CUTS_RAD[int(np.argmin(spread))])


def _levels(elevation: FloatArray) -> IntArray:
    """Groups of elevations with gaps between them; one group where they are wider than the gaps."""
    order = np.argsort(elevation, kind="stable")
    line = np.empty(len(elevation), dtype=np.int64)
    line[order] = np.cumsum(np.diff(elevation[order], prepend=elevation[order[:1]]) > LEAST_GAP_RAD)
    return line if _spread(line, elevation) < LEAST_GAP_RAD else np.zeros_like(line)


def _spread(line: IntArray, elevation: FloatArray) -> float:
    """Root mean square of elevations from the mean of their line."""
    mean = np.bincount(line, elevation) / np.maximum(np.bincount(line), 1)
    return float(np.sqrt(np.square(elevation - mean[line]).mean())) if len(line) else 0.0


def changed(frame: LabelledFrame, changes: Changes, rng: np.random.Generator) -> LabelledFrame:
    """A frame as another sensor might have seen another street."""
    return _changed(frame, changes, rng, np.zeros(2))[0]


def changed_window(
    frame: LabelledFrame, changes: Changes, rng: np.random.Generator, decoder: Decoder, least_points: int
) -> tuple[LabelledFrame, Decoder]:
    """A part of a changed frame, and the decoder of its cells, which are `WINDOW_M` wide."""
    grid = decoder.grid
    middle = _looked_at(frame, rng, decoder.classes, least_points)
    reach = 0.5 * math.sqrt(2.0) * WINDOW_M * (1.0 + changes.scale) + 8 * grid.cell_m
    near = np.flatnonzero(np.hypot(*(frame.points[:, :2] - middle).T) <= reach)
    boxes = np.flatnonzero(np.hypot(*(frame.boxes.center_m[:, :2] - middle).T) <= reach)
    part = LabelledFrame(
        frame.name,
        frame.points[near],
        frame.line[near],
        frame.boxes[boxes],
        frame.category[boxes],
        frame.counts[boxes],
    )
    made, at = _changed(part, changes, rng, middle)
    # whole numbers of 8 cells from the edges of the grid, within it
    step = 8 * grid.cell_m
    spans = []
    for value, (low, high) in zip(at.tolist(), (grid.ahead_m, grid.left_m), strict=True):
        edge = min(step * round(WINDOW_M / step), high - low)
        start = low + step * round((min(max(value - 0.5 * edge, low), high - edge) - low) / step)
        spans.append((start, start + edge))
    window = replace(decoder, grid=replace(grid, ahead_m=spans[0], left_m=spans[1]))
    x, y = made.points[:, 0], made.points[:, 1]
    inside = np.flatnonzero((x >= spans[0][0]) & (x < spans[0][1]) & (y >= spans[1][0]) & (y < spans[1][1]))
    points = made.points[inside]
    counts = made.boxes.point_counts(points, 0.05)
    return replace(made, points=points, line=made.line[inside], counts=counts), window


def _looked_at(
    frame: LabelledFrame, rng: np.random.Generator, classes: tuple[str, ...], least_points: int
) -> FloatArray:
    """(2,) middle of a window."""
    off = rng.uniform(-OFF_CENTER_M, OFF_CENTER_M, 2)
    rows = np.flatnonzero(np.isin(frame.category, classes) & (frame.counts >= least_points))
    if len(rows) and rng.random() < AT_LABELS:
        name = rng.choice(np.unique(frame.category[rows]))
        place = frame.boxes.center_m[int(rng.choice(rows[frame.category[rows] == name])), :2]
    elif len(frame.points):
        place = frame.points[int(rng.integers(len(frame.points))), :2].astype(np.float64)
    else:
        place = np.zeros(2)
    middle: FloatArray = place + off
    return middle


def _changed(
    frame: LabelledFrame, changes: Changes, rng: np.random.Generator, place_m: FloatArray
) -> tuple[LabelledFrame, FloatArray]:
    """A frame as another sensor might have seen another street, and where a (2,) place has gone."""
    points, line = frame.points.astype(np.float64), frame.line
    kept = rng.random(len(points)) >= rng.uniform(0.0, changes.dropped)
    lines = np.unique(line)
    if len(lines) > 1 and changes.lines_dropped > 0.0 and rng.random() < 0.5:
        gone = lines[rng.random(len(lines)) < rng.uniform(0.0, changes.lines_dropped)]
        kept &= ~np.isin(line, gone)
    points, line = points[kept], line[kept]
    turn = rng.uniform(-1.0, 1.0) * changes.turn_rad
    scale = 1.0 + rng.uniform(-1.0, 1.0) * changes.scale
    c, s = scale * math.cos(turn), scale * math.sin(turn)
    mirror = -1.0 if changes.mirrored and rng.random() < 0.5 else 1.0

    def moved(place: FloatArray) -> FloatArray:
        x, y = place[:, 0], mirror * place[:, 1]
        return np.column_stack((c * x - s * y, s * x + c * y, scale * place[:, 2]))

    points = moved(points) + rng.normal(0.0, 1.0, points.shape) * changes.jitter_m
    points[:, 2] += rng.normal() * changes.height_m
    boxes = Boxes3D(
        moved(frame.boxes.center_m),
        scale * frame.boxes.size_m,
        wrap_angle(mirror * frame.boxes.yaw_rad + turn),
    )
    counts = boxes.point_counts(points, 0.05)
    made = LabelledFrame(frame.name, points.astype(np.float32), line, boxes, frame.category, counts)
    return made, moved(np.array([[*place_m, 0.0]]))[0, :2]


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """What a network should say of a frame.

    Args:
        heat: (C, R, L) 1 at a centre and falling around it.
        ignored: (C, R, L) where nothing is learned: bodies of which too few points are seen.
        cell: (K,) number of the output's cell of each centre.
        values: (K, V) `CHANNELS` there.
    """

    heat: NDArray[np.float32]
    ignored: NDArray[np.bool_]
    cell: IntArray
    values: NDArray[np.float32]


def targets(frame: LabelledFrame, decoder: Decoder, least_points: int) -> Targets:
    """The maps of a frame; bodies with fewer points are ignored."""
    _, rows, columns = decoder.shape
    heat = np.zeros((len(decoder.classes), rows, columns), dtype=np.float32)
    ignored = np.zeros(heat.shape, dtype=np.bool_)
    edge = STRIDE * decoder.grid.cell_m
    place = (frame.boxes.center_m[:, :2] - (decoder.grid.ahead_m[0], decoder.grid.left_m[0])) / edge
    cell, values = [], []
    for row in range(len(frame.boxes)):
        name = str(frame.category[row])
        if name not in decoder.classes:
            continue
        x, y = (float(v) for v in place[row])
        if not (0.0 <= x < rows and 0.0 <= y < columns):
            continue
        i, j, which = int(x), int(y), decoder.classes.index(name)
        spread = SPREAD[name]
        reach = math.ceil(3.0 * spread)
        a, b = slice(max(i - reach, 0), i + reach + 1), slice(max(j - reach, 0), j + reach + 1)
        di = np.arange(rows)[a][:, None] - i
        dj = np.arange(columns)[b] - j
        peak = np.exp(-0.5 * (di**2 + dj**2) / spread**2).astype(np.float32)
        if frame.counts[row] < least_points:
            ignored[:, a, b] |= peak > 0.1
            continue
        np.maximum(heat[which, a, b], peak, out=heat[which, a, b])
        size, yaw = frame.boxes.size_m[row], float(frame.boxes.yaw_rad[row])
        cell.append(i * columns + j)
        values.append(
            (x - i - 0.5, y - j - 0.5, float(frame.boxes.center_m[row, 2]), *np.log(size),
             math.sin(2.0 * yaw), math.cos(2.0 * yaw), math.sin(yaw), math.cos(yaw))
        )  # fmt: skip
    ignored &= heat < 1.0
    table = np.array(values, dtype=np.float32).reshape(-1, len(CHANNELS))
    return Targets(heat, ignored, np.array(cell, dtype=np.int64), table)


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Several frames put together; pillars and centres have the cells of the frames one after another.

    Args:
        names: of the frames.
        shape: cells ahead and to the left of each.
        seen: pillars of all.
        targets: of all.
    """

    names: tuple[str, ...]
    shape: tuple[int, int]
    seen: Pillars
    targets: Targets


def batch(frames: Sequence[LabelledFrame], decoders: Sequence[Decoder], least_points: int) -> Batch:
    """Pillars and targets of frames as one.

    Args:
        frames: some.
        decoders: of each; their grids have as many cells.
        least_points: see `targets`.
    """
    grid_cells = math.prod(decoders[0].grid.shape)
    _, rows, columns = decoders[0].shape
    seen, wanted = [], []
    for frame, decoder in zip(frames, decoders, strict=True):
        seen.append(pillars_of(frame.points[:, :2], frame.points[:, 2], decoder.grid))
        wanted.append(targets(frame, decoder, least_points))
    return Batch(
        tuple(frame.name for frame in frames),
        decoders[0].grid.shape,
        Pillars(
            np.concatenate([each.features for each in seen]),
            np.concatenate([each.cell + k * grid_cells for k, each in enumerate(seen)]),
            np.zeros(0, dtype=np.int64),
        ),
        Targets(
            np.stack([each.heat for each in wanted]),
            np.stack([each.ignored for each in wanted]),
            np.concatenate([each.cell + k * rows * columns for k, each in enumerate(wanted)]),
            np.concatenate([each.values for each in wanted]),
        ),
    )
