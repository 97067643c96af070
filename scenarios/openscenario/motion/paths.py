"""Curves that entities move along, by arc length.

Every curve (lane, route, trajectory) is a chain of points with headings, the denser the more it bends.
Between points position and heading change linearly; beyond its ends it goes on straight. A chord of 0.05 m
departs from an arc of 8 m radius by 0.04 mm.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenarios.openscenario.elements import Immutable
from smartmot.path import chord_stations
from smartmot.types import BoolArray, FloatArray, IntArray

SPACING_M = 0.05
"""Distance of points where a curve bends."""

ON_PATH_M = 1e-3
"""Who is further from its path is looked up on the map."""

CHORD_ERROR_M = SPACING_M**2 / 64.0
"""How far a chord departs from an arc of 8 m radius; wider bends have fewer points for the same departure."""

CHUNK = 64
"""Chords that share a circle: a look at the circles of 5 km costs as much as one at 100 m of chords."""


@dataclass(frozen=True, slots=True)
class Pose(Immutable):
    """Point and heading, map frame; the height of the ground there where it is known."""

    x_m: float
    y_m: float
    yaw_rad: float
    z_m: float | None = None

    def moved(self, ahead_m: float, left_m: float, turn_rad: float = 0.0) -> Pose:
        """A pose given in this one's frame."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x_m, y_m = self.x_m + c * ahead_m - s * left_m, self.y_m + s * ahead_m + c * left_m
        return Pose(x_m, y_m, self.yaw_rad + turn_rad, self.z_m)

    def raised(self, up_m: float) -> Pose:
        """The same so much higher, where its height is known."""
        return self if self.z_m is None else Pose(self.x_m, self.y_m, self.yaw_rad, self.z_m + up_m)


@dataclass(frozen=True, slots=True)
class Track(Immutable):
    """Lanes below the points of a path.

    Args:
        s_m: (K,) road s at each point.
        leg: (K,) which leg each point is of.
        lane: lane of each leg.
        start_m: road s where each leg begins.
        along_s: +1 where s grows along a leg, -1 where it falls.
    """

    s_m: list[float]
    leg: list[int]
    lane: list[int]
    start_m: list[float]
    along_s: list[int]


def _circles(points_m: FloatArray) -> FloatArray:
    """(C, 3) centre x, y and radius of circles around the chords of each chunk of a curve."""
    starts = np.arange(0, len(points_m) - 1, CHUNK)
    ends = np.minimum(starts + CHUNK, len(points_m) - 1)
    boxes = [
        (points_m[a : b + 1].min(axis=0), points_m[a : b + 1].max(axis=0))
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
    ]
    low, high = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
    return np.column_stack((0.5 * (low + high), 0.5 * np.hypot(*(high - low).T)))


class Path(Immutable):
    """A curve by arc length.

    Args:
        x_m, y_m: (K,) points, K >= 2, no two neighbours equal.
        yaw_rad: (K,) headings at the points, unwrapped; None: those of the chords.
        station_m: (K,) arc length at the points; None: measured along the chords.
    """

    __slots__ = (
        "_chord_yaw",
        "_chords",
        "_circles",
        "_ends",
        "_station",
        "_table",
        "_yaw",
        "_yaw_table",
        "both_ways",
        "first_z_m",
        "length_m",
        "on_road",
        "points_m",
        "reverse",
        "track",
        "vertex_places",
    )

    def __init__(
        self,
        x_m: FloatArray | Sequence[float],
        y_m: FloatArray | Sequence[float],
        yaw_rad: FloatArray | Sequence[float] | None = None,
        station_m: FloatArray | None = None,
    ) -> None:
        points = np.column_stack((np.asarray(x_m, float), np.asarray(y_m, float)))
        chord = np.diff(points, axis=0)
        if station_m is None:
            station_m = chord_stations(points)
        self.points_m = points
        self._station: list[float] = station_m.tolist()
        begins = np.column_stack((points, station_m))
        # x, y and arc length at which each chord begins, and by how much they grow along it
        self._table: FloatArray = np.column_stack((begins[:-1], np.diff(begins, axis=0)))
        self._chords: list[tuple[float, ...]] = list(zip(*self._table.T.tolist(), strict=True))
        self._ends = points[0].tolist(), points[-1].tolist()
        self._chord_yaw: list[float] = []
        self._yaw: list[float] | None = None
        if yaw_rad is None:
            self._yaw_table: FloatArray = np.arctan2(chord[:, 1], chord[:, 0])
            self._chord_yaw = self._yaw_table.tolist()
        else:
            self._yaw_table = np.asarray(yaw_rad, float)
            self._yaw = self._yaw_table.tolist()
        self.reverse: list[bool] | None = None
        """Of each chord, whether the headings that a file gives it point backwards; None: of none."""
        self.length_m: float = self._station[-1]
        self.first_z_m: float | None = None
        """Height of its beginning, if the file gives one."""
        self._circles: FloatArray | None = None
        self.on_road = False
        """Whether it follows lanes."""
        self.both_ways = False
        """Whether it also follows the lanes behind its arc length 0, as far as there are any."""
        self.track: Track | None = None
        """Roads below it, if it follows lanes all along."""
        self.vertex_places: list[int] | None = None
        """Which point each vertex of a polyline is, where some are at the same place; None: each its own."""

    def pose(self, station_m: float) -> tuple[float, float, float]:
        """x, y and heading at an arc length, which may lie beyond the ends."""
        stations, yaw = self._station, self._yaw
        # the last point begins no chord; before the first one the first chord goes on
        i = bisect_right(stations, station_m, 1, len(stations) - 1) - 1
        x0, y0, s0, dx, dy, ds = self._chords[i]
        part = (station_m - s0) / ds
        if yaw is None:
            heading = self._chord_yaw[i]
        elif part < 0.0 or part > 1.0:
            end = 0 if part < 0.0 else -1
            (x, y), heading = self._ends[end], yaw[end]
            beyond = station_m - stations[end]
            return x + beyond * math.cos(heading), y + beyond * math.sin(heading), heading
        else:
            heading = yaw[i] + part * (yaw[i + 1] - yaw[i])
        return x0 + part * dx, y0 + part * dy, heading

    def reverse_at(self, station_m: float) -> bool:
        """Whether the headings at an arc length point backwards, as those of who drives in reverse."""
        if self.reverse is None:
            return False
        return self.reverse[bisect_right(self._station, station_m, 1, len(self._station) - 1) - 1]

    def lane_at(self, station_m: float) -> tuple[int, float, int] | None:
        """Lane below an arc length, road s, and +1 if s grows along the path, else -1; None if unknown."""
        track, stations = self.track, self._station
        if track is None or not 0.0 <= station_m <= stations[-1]:
            return None
        i = bisect_right(stations, station_m, 1, len(stations) - 1) - 1
        leg = track.leg[i + 1]
        s0 = track.s_m[i] if track.leg[i] == leg else track.start_m[leg]
        part = (station_m - stations[i]) / (stations[i + 1] - stations[i])
        return track.lane[leg], s0 + part * (track.s_m[i + 1] - s0), track.along_s[leg]

    def poses(self, station_m: FloatArray) -> FloatArray:
        """(K, 3) x, y and heading at (K,) arc lengths, which may lie beyond the ends."""
        table = self._table
        i = np.clip(np.searchsorted(table[:, 2], station_m, side="right") - 1, 0, len(table) - 1)
        x0, y0, s0, dx, dy, ds = table[i].T
        part = (station_m - s0) / ds
        if self._yaw is None:
            return np.column_stack((x0 + part * dx, y0 + part * dy, self._yaw_table[i]))
        yaw, inside = self._yaw_table, np.clip(part, 0.0, 1.0)
        heading = yaw[i] + inside * (yaw[i + 1] - yaw[i])
        beyond = (part - inside) * ds
        x, y = x0 + inside * dx + beyond * np.cos(heading), y0 + inside * dy + beyond * np.sin(heading)
        return np.column_stack((x, y, heading))

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Arc length of the nearest point, also beyond the ends, and the offset to the left of it."""
        count = len(self._station) - 1
        if count <= 4 * CHUNK:
            return self._project(x_m, y_m, np.arange(count))
        if self._circles is None:
            self._circles = _circles(self.points_m)
        # no chord of a chunk is nearer than its circle, and one is no further away than the far side of that
        away = np.hypot(x_m - self._circles[:, 0], y_m - self._circles[:, 1])
        nearest = away - self._circles[:, 2] <= (away + self._circles[:, 2]).min() + 1e-6
        nearest[[0, -1]] = True  # the curve goes on beyond its ends
        chords = (np.flatnonzero(nearest)[:, None] * CHUNK + np.arange(CHUNK)).ravel()
        return self._project(x_m, y_m, chords[chords < count])

    def project_from(self, x_m: float, y_m: float, station_m: float) -> tuple[float, float]:
        """As `project`, but the point that is reached from an arc length by going nearer and nearer.

        Its cost grows with the way to that point, not with the length of the curve.
        """
        chords, last, came = self._chords, len(self._chords) - 1, 0
        i = bisect_right(self._station, station_m, 1, last + 1) - 1
        while True:
            x0, y0, s0, dx, dy, ds = chords[i]
            part = ((x_m - x0) * dx + (y_m - y0) * dy) / (dx * dx + dy * dy)
            onward = 1 if part > 1.0 and i < last else -1 if part < 0.0 and i > 0 else 0
            if onward == 0 or onward == -came:  # on the chord, or at the corner between two
                break
            i, came = i + onward, onward
        if onward:
            part = 1.0 if onward > 0 else 0.0
        station = s0 + part * ds
        foot_x, foot_y, heading = self.pose(station)
        return station, (y_m - foot_y) * math.cos(heading) - (x_m - foot_x) * math.sin(heading)

    def _project(self, x_m: float, y_m: float, chords: IntArray) -> tuple[float, float]:
        """Onto the nearest of some chords, in growing order."""
        begin = self.points_m[chords]
        step = self.points_m[chords + 1] - begin
        squared = (step**2).sum(axis=1)
        offset = np.array([x_m, y_m]) - begin
        part = (offset * step).sum(axis=1) / squared
        # the first chord of the curve goes on before it, the last one after it
        low, high = np.zeros(len(part)), np.ones(len(part))
        if chords[0] == 0:
            low[0] = -np.inf
        if chords[-1] == len(self._station) - 2:
            high[-1] = np.inf
        part = np.clip(part, low, high)
        miss = offset - part[:, None] * step
        nearest = int(((miss**2).sum(axis=1)).argmin())
        i = int(chords[nearest])
        station = self._station[i] + float(part[nearest]) * (self._station[i + 1] - self._station[i])
        foot_x, foot_y, heading = self.pose(station)
        return station, (y_m - foot_y) * math.cos(heading) - (x_m - foot_x) * math.sin(heading)

    def joined_from(self, station_m: float, left_m: float, within_m: float) -> Path:
        """The same curve by the same arc lengths, joined smoothly from a place to the left of it.

        Args:
            station_m: arc length of that place, which may lie before the beginning.
            left_m: how far it is to the left.
            within_m: arc length after which the curve is joined.
        """
        end = station_m + within_m
        along = np.linspace(station_m, end, max(2, math.ceil(within_m / SPACING_M) + 1))
        frames = np.array([self.pose(s) for s in along.tolist()])
        part = (along - station_m) / within_m
        left = left_m * (1.0 - part**2 * (3.0 - 2.0 * part))
        slope = -left_m * 6.0 * part * (1.0 - part) / within_m
        x = frames[:, 0] - np.sin(frames[:, 2]) * left
        y = frames[:, 1] + np.cos(frames[:, 2]) * left
        yaw = frames[:, 2] + np.arctan(slope)
        # both headings of a corner, so that the heading stays that of the line up to it
        corners = [s for s in self._station if s > end + 2e-6] or [end + 1.0]
        more = np.array([(at, *self.pose(at)) for s in corners for at in (s - 1e-6, s)])
        joined = Path(
            np.concatenate((x, more[:, 1])),
            np.concatenate((y, more[:, 2])),
            np.unwrap(np.concatenate((yaw, more[:, 3]))),
            np.concatenate((along, more[:, 0])),
        )
        joined.length_m = self.length_m
        return joined

    def turn_rad(self, station_m: float, other_m: float) -> float:
        """How much the heading turns between two arc lengths at most, whichever way."""
        stations, last = self._station, len(self._station) - 2
        i, j = bisect_right(stations, station_m) - 1, bisect_right(stations, other_m) - 1
        i, j = min(i, j), max(i, j)
        if j < 0 or i > last or (i == j and self._yaw is None):
            return 0.0
        i, j = max(i, 0), min(j, last)
        yaw = self._yaw
        if yaw is not None:
            turn = 0.0
            for k in range(i, j + 1):
                turn += abs(yaw[k + 1] - yaw[k])
            return turn
        headings = self._chord_yaw[i : j + 1]
        return sum(abs(math.remainder(b - a, 2 * math.pi)) for a, b in pairwise(headings))

    def yaw_at_points(self) -> FloatArray | None:
        """(K,) headings at the points; None where those of the chords hold."""
        return None if self._yaw is None else self._yaw_table

    @property
    def first_m(self) -> float:
        """Arc length at the first point: 0, or less where the way also follows the lanes behind."""
        return self._station[0]

    def station_of_vertices(self) -> list[float]:
        """Arc length at every point, or at every vertex of a polyline."""
        if self.vertex_places is None:
            return list(self._station)
        return [self._station[place] for place in self.vertex_places]


def straight(pose: Pose, length_m: float = 1000.0) -> Path:
    """A straight path from a pose."""
    end = pose.moved(length_m, 0.0)
    return Path([pose.x_m, end.x_m], [pose.y_m, end.y_m])


def backwards(path: Path) -> Path:
    """The same curve from its end to its beginning; arc length s becomes -s."""
    yaw = path.yaw_at_points()
    points, stations = path.points_m[::-1], -np.array(path.station_of_vertices())[::-1]
    turned = Path(points[:, 0], points[:, 1], None if yaw is None else yaw[::-1] - math.pi, stations)
    turned.on_road, turned.both_ways = path.on_road, path.both_ways
    return turned


def joined(pieces: Sequence[FloatArray]) -> tuple[Path, BoolArray]:
    """Path through rows (x, y, yaw, ...) of pieces without points that repeat; and which rows it has.

    Args:
        pieces: (K, 3 or more) each.
    """
    rows = np.concatenate([piece[:, :3] for piece in pieces])
    keep = np.concatenate(([True], np.hypot(*np.diff(rows[:, :2], axis=0).T) > 1e-9))
    rows = rows[keep]
    return Path(rows[:, 0], rows[:, 1], np.unwrap(rows[:, 2])), keep
