"""Lanes at a single point, without arrays: for callers that ask point by point.

A query over arrays costs some hundred microseconds however few the points are. Here the same cells stand in a
grid as plain numbers. Whatever is rare (cubic reference lines, kinks, borders that slant towards a point
outside) is left to the arrays, so that both always say the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, floor, hypot, sin
from typing import TypeAlias

import numpy as np

from opendrive.arrays import BoolArray, FloatArray, IntArray, concatenated_ranges
from opendrive.geometry.borders import BorderTable
from opendrive.geometry.cells import NEWTON_STEPS, RoadCells

PIXEL_M = 16.0
"""Side of the squares of the grid: about half a cell."""

WIDE_M = 64.0
"""Side of the squares for points off every lane of their own square."""

LISTED_M = 192.0
"""How much further than the nearest of all cells those around a wide square are listed."""

MAX_WIDE = 4096
"""Wide squares whose cells are kept."""

_OPEN = 3
"""How bent cells are that are left to the arrays: cubics have this number."""

BORDER_M = 1e-9
FOOT_M = 1e-6
_BOUND_M = 1e-6
"""By how much the bounds of t are wider: beyond `BORDER_M` and rounding."""

_CONVERGED_M = 1e-11
_NODES, _WEIGHTS = (tuple(v.tolist()) for v in np.polynomial.legendre.leggauss(5))
_GAUSS = tuple((0.5 * (node + 1.0), 0.5 * weight) for node, weight in zip(_NODES, _WEIGHTS, strict=True))

Numbers: TypeAlias = tuple[float, ...]
Offer: TypeAlias = tuple[float, float, int, int, float, float, float, float, float, float, float, float, bool]
"""A lane beside a cell: bounds of t, lane, side, both borders as cubics, whether one of them slants."""

Hit: TypeAlias = tuple[int, float, float, float]
"""A lane that contains a point, or the nearest one: lane, s, t, and its margin or distance."""


@dataclass(frozen=True, slots=True, eq=False)
class SingleLookup:
    """Cells of a network in a grid of squares.

    Attributes:
        pixels: cells whose box meets each square, by its column and row.
        shapes: x, y, cos, sin of the heading, length, curvature, its rate, and s at the start of each cell,
            and its s minus that of its stretch.
        bent: 0 for lines, 1 for arcs, 2 for clothoids, 3 for what is left to the arrays.
        boxes: frame (x, y, cos, sin) and sides (u and v) of the box around each cell.
        overhang_m: how far beyond its start and end a point may belong to a cell.
        first_row: first of the lanes beside each cell, in `offers`; and one after the last.
        offers: lanes beside stretches of road.
        circles: x, y and radius of circles around the boxes.
        circle_of: the same for each cell, as numbers.
        wide: cells around wide squares, made when asked for.
        is_banked: whether any road is: then distances are left to the arrays.
    """

    pixels: dict[tuple[int, int], list[int]]
    shapes: list[Numbers]
    bent: list[int]
    boxes: list[Numbers]
    overhang_m: list[Numbers]
    first_row: list[tuple[int, int]]
    offers: list[Offer]
    circles: tuple[FloatArray, FloatArray, FloatArray]
    circle_of: list[tuple[float, float, float]]
    wide: dict[tuple[int, int], tuple[list[tuple[float, int]], float]]
    is_banked: bool

    @classmethod
    def build(
        cls,
        cells: RoadCells,
        borders: BorderTable,
        side: Sequence[int],
        banked: BoolArray,
        rows: tuple[IntArray, FloatArray, FloatArray],
        circles: tuple[FloatArray, FloatArray, FloatArray],
        overhang_m: FloatArray,
    ) -> "SingleLookup":
        """Put cells into a grid.

        Args:
            cells: all cells.
            borders: borders of the lanes.
            side: side of each lane.
            banked: (R,) roads that are left to the arrays.
            rows: the cells that have lanes, frames (C, 4) and sides (C, 4) of the boxes around these.
            circles: x, y and radius of circles around the boxes, (C,) each.
            overhang_m: (N, 2) overhang of all cells.
        """
        cell, frame, box = rows
        x, y, cos_, sin_ = frame.T[:, :, None]
        u, v = box[:, [0, 1, 1, 0]], box[:, [2, 2, 3, 3]]
        corners = np.stack([x + cos_ * u - sin_ * v, y + sin_ * u + cos_ * v])
        low = np.floor(corners.min(axis=2) / PIXEL_M).astype(np.int64)
        size = np.floor(corners.max(axis=2) / PIXEL_M).astype(np.int64) - low + 1
        count = size[0] * size[1]
        owner = np.repeat(np.arange(len(cell)), count)
        k = concatenated_ranges(np.zeros(len(cell), dtype=np.int64), count)
        column, row = low[0][owner] + k % size[0][owner], low[1][owner] + k // size[0][owner]
        pixels: dict[tuple[int, int], list[int]] = {}
        for name, member in zip(zip(column.tolist(), row.tolist(), strict=True), owner.tolist(), strict=True):
            pixels.setdefault(name, []).append(member)
        stretch = cells.stretch[cell]
        low_m = cells.low_m[cell]
        shapes = np.column_stack(
            [
                cells.start[cell][:, :4],
                cells.high_m[cell] - low_m,
                cells.start[cell][:, 4:],
                low_m,
                low_m - borders.low_m[stretch],
            ]
        )
        lane = concatenated_ranges(borders.first_lane, borders.lane_count)
        inner, outer = borders.coefficients
        columns = [column.tolist() for column in (*inner, *outer)]
        lane_side = [side[i] for i in lane.tolist()]
        t_low, t_high = borders.extremes()
        return cls(
            pixels,
            list(map(tuple, shapes.tolist())),
            np.where(banked[cells.road[cell]], _OPEN, cells.bent[cell]).tolist(),
            list(map(tuple, np.concatenate([frame, box], axis=1).tolist())),
            list(map(tuple, overhang_m[cell].tolist())),
            list(
                zip(borders.first_row[stretch].tolist(), borders.first_row[stretch + 1].tolist(), strict=True)
            ),
            list(
                zip(
                    (t_low - _BOUND_M).tolist(),
                    (t_high + _BOUND_M).tolist(),
                    lane.tolist(),
                    lane_side,
                    *columns,
                    borders.is_slanted.tolist(),
                    strict=True,
                )
            ),
            circles,
            list(zip(*(column.tolist() for column in circles), strict=True)),
            {},
            bool(banked.any()),
        )

    def containing(self, x_m: float, y_m: float) -> list[Hit] | None:
        """Return the lanes that contain a point, by lane; None if the arrays have to tell."""
        hits: dict[int, tuple[float, float, Hit]] = {}
        for cell in self.pixels.get((floor(x_m / PIXEL_M), floor(y_m / PIXEL_M)), ()):
            fx, fy, fc, fs, u_low, u_high, v_low, v_high = self.boxes[cell]
            dx, dy = x_m - fx, y_m - fy
            if not (u_low <= fc * dx + fs * dy <= u_high and v_low <= fc * dy - fs * dx <= v_high):
                continue
            foot = self.foot(cell, x_m, y_m)
            if foot is None:
                return None
            s, t, left_over, ds = foot
            before, after = self.overhang_m[cell]
            if not -before <= left_over <= after:
                continue
            low, high = self.first_row[cell]
            for t_low, t_high, lane, side, a, b, c, d, e, f, g, h, _ in self.offers[low:high]:
                if t < t_low or t > t_high:
                    continue
                inner = a + ds * (b + ds * (c + ds * d))
                outer = e + ds * (f + ds * (g + ds * h))
                margin = min((t - inner) * side, (outer - t) * side)
                if margin < -BORDER_M:
                    continue
                off_m = abs(left_over)
                if off_m > FOOT_M:
                    return None
                known = hits.get(lane)
                if known is None or (off_m, -margin) < known[:2]:
                    hits[lane] = off_m, -margin, (lane, s, t, margin if margin > 0.0 else 0.0)
        return [hits[lane][2] for lane in sorted(hits)]

    def nearest(self, x_m: float, y_m: float, wanted: Sequence[bool]) -> Hit | None:
        """Return the nearest of the wanted lanes; None if the arrays have to tell."""
        column, row = floor(x_m / PIXEL_M), floor(y_m / PIXEL_M)
        search = _Search(self, x_m, y_m, wanted)
        for cell in self.pixels.get((column, row), ()):
            search.look_at(cell)
        edges = (x_m - column * PIXEL_M, y_m - row * PIXEL_M)
        if search.best[0] > min(*edges, PIXEL_M - edges[0], PIXEL_M - edges[1]):
            off_m, cells, complete_m = self._around(x_m, y_m)
            for bound_m, cell in cells:
                if bound_m - off_m > search.best[0]:
                    break
                middle_x, middle_y, radius = self.circle_of[cell]
                if hypot(x_m - middle_x, y_m - middle_y) - radius <= search.best[0]:
                    search.look_at(cell)
            else:
                if search.best[0] > complete_m - off_m:
                    return None
        # The nearest point of a border that slants is not abreast of the foot.
        slants = search.best[0] >= search.slanted_m or self.is_banked
        return None if search.is_open or (slants and search.best[0] > 0.0) else search.hit

    def _around(self, x_m: float, y_m: float) -> tuple[float, list[tuple[float, int]], float]:
        """Return how far a point is from the middle of its wide square, and the cells around that.

        Each cell comes with a lower bound of its distance from the middle, the nearest first; then, within
        which distance all are listed.
        """
        name = (floor(x_m / WIDE_M), floor(y_m / WIDE_M))
        middle = (name[0] + 0.5) * WIDE_M, (name[1] + 0.5) * WIDE_M
        known = self.wide.get(name)
        if known is None:
            if len(self.wide) >= MAX_WIDE:
                self.wide.clear()
            centre_x, centre_y, radius = self.circles
            bound = np.hypot(centre_x - middle[0], centre_y - middle[1]) - radius
            complete_m = float((bound + 2.0 * radius).min(initial=np.inf)) + LISTED_M
            near = np.flatnonzero(bound <= complete_m)
            near = near[np.argsort(bound[near])]
            known = self.wide[name] = list(zip(bound[near].tolist(), near.tolist(), strict=True)), complete_m
        return hypot(x_m - middle[0], y_m - middle[1]), *known

    def foot(self, cell: int, x_m: float, y_m: float) -> tuple[float, float, float, float] | None:
        """Return s, t, what is left over along the road, s on the stretch; None if arrays have to tell."""
        x, y, c, s, length, curvature, rate, low_m, on_stretch = self.shapes[cell]
        dx, dy = x_m - x, y_m - y
        u, v = c * dx + s * dy, c * dy - s * dx
        bent = self.bent[cell]
        if bent == 0:
            ds = 0.0 if u < 0.0 else (length if u > length else u)
            return low_m + ds, v, u - ds, on_stretch + ds
        if bent == _OPEN:
            return None
        ds = _clipped(_arc_step(u, v, curvature), length)
        for _ in range(NEWTON_STEPS):
            if bent == 1:
                half = 0.5 * curvature * ds
                chord = ds * (sin(half) / half if half else 1.0)
                foot_u, foot_v = chord * cos(half), chord * sin(half)
            else:
                foot_u = foot_v = 0.0
                for node, weight in _GAUSS:
                    at = ds * node
                    heading = at * (curvature + 0.5 * rate * at)
                    foot_u += weight * cos(heading)
                    foot_v += weight * sin(heading)
                foot_u, foot_v = ds * foot_u, ds * foot_v
            heading = ds * (curvature + 0.5 * rate * ds)
            c, s = cos(heading), sin(heading)
            du, dv = u - foot_u, v - foot_v
            along, across = c * du + s * dv, c * dv - s * du
            if bent == 1:
                break
            moved = _clipped(ds + _arc_step(along, across, curvature + rate * ds), length)
            done = abs(moved - ds) <= _CONVERGED_M
            ds = moved
            if done:
                break
        return low_m + ds, across, along, on_stretch + ds


def _arc_step(along: float, t_m: float, curvature: float) -> float:
    """Return the arc length to the foot on the osculating circle; see `cells.arc_step`."""
    if abs(curvature) > 1e-9:
        return atan2(curvature * along, 1.0 - curvature * t_m) / curvature
    return along


def _clipped(value: float, high: float) -> float:
    return 0.0 if value < 0.0 else (high if value > high else value)


class _Search:
    """The search for the nearest lane to one point."""

    __slots__ = ("best", "hit", "is_open", "lookup", "seen", "slanted_m", "wanted", "x_m", "y_m")

    def __init__(self, lookup: SingleLookup, x_m: float, y_m: float, wanted: Sequence[bool]) -> None:
        self.lookup, self.x_m, self.y_m, self.wanted = lookup, x_m, y_m, wanted
        self.best = (float("inf"), 0.0)
        self.hit: Hit | None = None
        self.slanted_m = float("inf")
        self.is_open = False
        self.seen: set[int] = set()

    def look_at(self, cell: int) -> None:
        """Take a lane of a cell if it is nearer than the best so far; the nearest middle among equals."""
        if cell in self.seen:
            return
        self.seen.add(cell)
        lookup = self.lookup
        fx, fy, fc, fs, u_low, u_high, v_low, v_high = lookup.boxes[cell]
        dx, dy = self.x_m - fx, self.y_m - fy
        u, v = fc * dx + fs * dy, fc * dy - fs * dx
        off_u = u_low - u if u < u_low else (u - u_high if u > u_high else 0.0)
        off_v = v_low - v if v < v_low else (v - v_high if v > v_high else 0.0)
        off_box = hypot(off_u, off_v) if off_u or off_v else 0.0
        if off_box > self.best[0]:
            return
        low, high = lookup.first_row[cell]
        wanted = self.wanted
        offers = [offer for offer in lookup.offers[low:high] if wanted[offer[2]]]
        if not offers:
            return
        foot = lookup.foot(cell, self.x_m, self.y_m)
        if foot is None:
            self.is_open = True
            return
        s, t, left_over, ds = foot
        for _, _, lane, _, a, b, c, d, e, f, g, h, slanted in offers:
            inner = a + ds * (b + ds * (c + ds * d))
            outer = e + ds * (f + ds * (g + ds * h))
            if inner > outer:
                inner, outer = outer, inner
            aside = inner - t if t < inner else (t - outer if t > outer else 0.0)
            distance = hypot(left_over, aside)
            if aside <= BORDER_M and -FOOT_M <= left_over <= FOOT_M:
                distance = 0.0
            elif slanted and off_box < self.slanted_m:
                self.slanted_m = off_box
            rank = (distance, abs(t - 0.5 * (inner + outer)))
            if rank < self.best:
                self.best, self.hit = rank, (lane, s, t, distance)
