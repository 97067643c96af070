"""Curves that entities move along, by arc length.

Every curve (lane, route, trajectory) is a chain of points with headings, the denser the more it bends.
Between points position and heading change linearly; beyond its ends it goes on straight. A chord of 0.05 m
departs from an arc of 8 m radius by 0.04 mm.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

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

Chord: TypeAlias = tuple[float, float, float, float, float, float, float, float, float, float | None, int]
"""Arc lengths from which on and up to which a chord counts, infinite at the ends of a curve; x, y and arc
length at its beginning, and by how much they grow along it; heading there, and by how much that grows (None:
it stays); number."""

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

    s_m: array[float]
    leg: array[int]
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

    Its numbers are columns, not objects of Python: with many entities those of all ways are more than a
    processor has at hand. The chords that were looked at last are kept, as what moves along a curve mostly
    stays on them from one look to the next; what comes out does not depend on them.

    Args:
        x_m, y_m: (K,) points, K >= 2, no two neighbours equal.
        yaw_rad: (K,) headings at the points, unwrapped; None: those of the chords.
        station_m: (K,) arc length at the points; None: measured along the chords.
    """

    __slots__ = (
        "_circles",
        "_ends",
        "_here",
        "_rows",
        "_smooth",
        "_station",
        "_there",
        "both_ways",
        "first_z_m",
        "length_m",
        "on_road",
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
        station = chord_stations(points) if station_m is None else np.asarray(station_m, float)
        self._smooth = yaw_rad is not None
        if yaw_rad is None:
            heads = np.arctan2(*np.diff(points, axis=0).T[::-1])
            yaw_rad = np.append(heads, heads[-1])
        self._rows: FloatArray = np.column_stack((points, station, np.asarray(yaw_rad, float)))
        """(K, 4) x, y, arc length and heading at the points; without headings there those of their chords."""
        self._station = array("d", station.tobytes())
        self._ends = self._rows[0].tolist(), self._rows[-1].tolist()
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
        self._here = self._there = self._chord(0)

    @property
    def points_m(self) -> FloatArray:
        """(K, 2) its points."""
        return self._rows[:, :2]

    def _index(self, station_m: float) -> int:
        """Which chord an arc length is on; the first and the last one go on beyond the ends."""
        return bisect_right(self._station, station_m, 1, len(self._station) - 1) - 1

    def _chord(self, i: int) -> Chord:
        """The numbers of a chord."""
        (x, y, s, yaw), (next_x, next_y, next_s, next_yaw) = self._rows[i : i + 2].tolist()
        low = s if i > 0 else -math.inf
        high = next_s if i < len(self._station) - 2 else math.inf
        turn = next_yaw - yaw if self._smooth else None
        return low, high, x, y, s, next_x - x, next_y - y, next_s - s, yaw, turn, i

    def pose(self, station_m: float) -> tuple[float, float, float]:
        """x, y and heading at an arc length, which may lie beyond the ends."""
        chord = self._here
        if not chord[0] <= station_m < chord[1]:
            chord = self._there
            if not chord[0] <= station_m < chord[1]:
                chord = self._here = self._chord(self._index(station_m))
        _, _, x0, y0, s0, dx, dy, ds, yaw, turn, _ = chord
        part = (station_m - s0) / ds
        if turn is None:
            heading = yaw
        elif part < 0.0 or part > 1.0:
            end = 0 if part < 0.0 else -1
            x, y, s, heading = self._ends[end]
            beyond = station_m - s
            return x + beyond * math.cos(heading), y + beyond * math.sin(heading), heading
        else:
            heading = yaw + part * turn
        return x0 + part * dx, y0 + part * dy, heading

    def reverse_at(self, station_m: float) -> bool:
        """Whether the headings at an arc length point backwards, as those of who drives in reverse."""
        if self.reverse is None:
            return False
        return self.reverse[self._index(station_m)]

    def lane_at(self, station_m: float) -> tuple[int, float, int] | None:
        """Lane below an arc length, road s, and +1 if s grows along the path, else -1; None if unknown."""
        track, stations = self.track, self._station
        if track is None or not 0.0 <= station_m <= stations[-1]:
            return None
        i = self._index(station_m)
        leg = track.leg[i + 1]
        s0 = track.s_m[i] if track.leg[i] == leg else track.start_m[leg]
        part = (station_m - stations[i]) / (stations[i + 1] - stations[i])
        return track.lane[leg], s0 + part * (track.s_m[i + 1] - s0), track.along_s[leg]

    def poses(self, station_m: FloatArray) -> FloatArray:
        """(K, 3) x, y and heading at (K,) arc lengths, which may lie beyond the ends."""
        rows = self._rows
        i = np.clip(np.searchsorted(rows[:, 2], station_m, side="right") - 1, 0, len(rows) - 2)
        begin = rows[i]
        x0, y0, s0, yaw = begin.T
        dx, dy, ds, turn = (rows[i + 1] - begin).T
        part = (station_m - s0) / ds
        if not self._smooth:
            return np.column_stack((x0 + part * dx, y0 + part * dy, yaw))
        inside = np.clip(part, 0.0, 1.0)
        heading = yaw + inside * turn
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
        last, came, chord = len(self._station) - 2, 0, self._there
        if not chord[0] <= station_m < chord[1]:
            chord = self._chord(self._index(station_m))
        while True:
            _, _, x0, y0, s0, dx, dy, ds, _, _, i = chord
            part = ((x_m - x0) * dx + (y_m - y0) * dy) / (dx * dx + dy * dy)
            onward = 1 if part > 1.0 and i < last else -1 if part < 0.0 and i > 0 else 0
            if onward == 0 or onward == -came:  # on the chord, or at the corner between two
                break
            came, chord = onward, self._chord(i + onward)
        self._there = chord
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
        low, high, *_, turn, i = self._here
        stations, last = self._station, len(self._station) - 2
        if 0 < i < last and low <= station_m < high and low <= other_m < high:
            return 0.0 if turn is None else abs(turn)
        i, j = bisect_right(stations, station_m) - 1, bisect_right(stations, other_m) - 1
        i, j = min(i, j), max(i, j)
        if j < 0 or i > last or (i == j and not self._smooth):
            return 0.0
        i, j = max(i, 0), min(j, last)
        headings: list[float] = self._rows[i : j + (2 if self._smooth else 1), 3].tolist()
        if self._smooth:
            return sum(abs(b - a) for a, b in pairwise(headings))
        return sum(abs(math.remainder(b - a, 2 * math.pi)) for a, b in pairwise(headings))

    def yaw_at_points(self) -> FloatArray | None:
        """(K,) headings at the points; None where those of the chords hold."""
        return self._rows[:, 3] if self._smooth else None

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
