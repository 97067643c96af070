"""A map with errors: kerbs and lanes in other places, lanes missing, types wrong."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ConfigError
from smartmot.maps.follow import route_along
from smartmot.maps.lane_map import (
    LaneColumns,
    LaneMap,
    MapCrosswalk,
    MapSignal,
    NearestLanes,
    PlacedPoints,
    Side,
)
from smartmot.maps.route import Route, route_from_lanes
from smartmot.maps.strips import lane_strip
from smartmot.maps.walks import SIDEWALK_TYPES
from smartmot.path import PlannedPath
from smartmot.types import FloatArray, IntArray

SIDEWALKS, LANES, TYPES = ("there", "missing"), ("there", "missing"), ("right", "strips_drive", "no_sidewalk")
_STRIPS = frozenset({"parking", "shoulder", "biking"})
"""Types that a map may take for driving lanes."""


@dataclass(frozen=True, slots=True)
class MapErrors:
    """What is wrong with a map.

    Args:
        kerb_m: the inner border of every sidewalk lies so much farther out than in truth; negative: in.
        lane_m: all lanes lie so much farther to the left, as seen along the ego's route.
        sidewalk: `there`, or `missing` on the map.
        lanes: `there`, or `missing`: an old map, with no other driving lanes than those of the route.
        types: `right`; `strips_drive`: parking lanes, shoulders and cycle lanes are given as driving lanes;
            `no_sidewalk`: sidewalks are given as shoulders.

    Raises:
        ConfigError: a length is not finite, or a name is none of these.
    """

    kerb_m: float = 0.0
    lane_m: float = 0.0
    sidewalk: str = "there"
    lanes: str = "there"
    types: str = "right"

    def __post_init__(self) -> None:
        if not math.isfinite(self.kerb_m + self.lane_m):
            raise ConfigError(f"map errors: lengths must be finite, got {self}")
        names = (("sidewalk", SIDEWALKS), ("lanes", LANES), ("types", TYPES))
        for name, allowed in names:
            if getattr(self, name) not in allowed:
                raise ConfigError(f"map errors: {name} must be one of {', '.join(allowed)}")


NO_MAP_ERRORS = MapErrors()


class FaultyMap:
    """A lane map with errors about a route, as perception has it; the lanes of the route stay right.

    A displaced kerb is a strip of its own between the sidewalk and what is beside it, as wide as the
    displacement; where the sidewalk lies too far in, its width is negative.

    Args:
        exact: the map without errors.
        route: on that map, which the navigation has chosen.
        way_m: (P, 2) way that the route was laid along.
        errors: what is wrong.
        ahead_m, behind_m: by how much the route goes beyond the way.
    """

    def __init__(
        self,
        exact: LaneMap,
        route: Route,
        way_m: FloatArray,
        errors: MapErrors,
        ahead_m: float = 0.0,
        behind_m: float = 0.0,
    ) -> None:
        self._exact, self._errors, self._exact_route = exact, errors, route
        kinds = np.array(exact.lanes.lane_type, dtype="<U24")
        sidewalk = np.isin(kinds, list(SIDEWALK_TYPES))
        self._hidden = np.zeros(len(kinds), dtype=np.bool_)
        if errors.lanes == "missing":
            on_route = np.isin(np.arange(len(kinds)), route.lanes)
            self._hidden |= (kinds == "driving") & ~on_route
        if errors.sidewalk == "missing":
            self._hidden |= sidewalk
        if errors.types == "strips_drive":
            kinds[np.isin(kinds, list(_STRIPS))] = "driving"
        if errors.types == "no_sidewalk":
            kinds[sidewalk] = "shoulder"
        kinds[self._hidden] = "none"
        self._strips: list[tuple[int, int]] = []  # (inner lane, sidewalk) of each displaced kerb
        self._beside: dict[tuple[int, Side], int] = {}
        if errors.kerb_m:
            self._displace_kerbs(sidewalk)
        self.lanes: LaneColumns = self._columns(kinds)
        if all(b in exact.successors(a) for a, b in pairwise(route.lanes)):
            self.route = route_from_lanes(self, route.lanes)
        else:
            self.route = route_along(self, self._displaced(way_m, 1.0), ahead_m, behind_m)

    def _displace_kerbs(self, sidewalk: np.ndarray) -> None:
        first = len(sidewalk)
        sides: tuple[Side, Side] = ("left", "right")
        for lane in np.flatnonzero(~sidewalk & ~self._hidden).tolist():
            for side in sides:
                outer = self._exact_neighbour(lane, side)
                if outer is not None and sidewalk[outer]:
                    self._beside[lane, side] = first + len(self._strips)
                    self._beside[first + len(self._strips), side] = outer
                    self._strips.append((lane, outer))

    def _columns(self, kinds: np.ndarray) -> LaneColumns:
        lanes, inner = self._exact.lanes, [lane for lane, _ in self._strips]
        keys, junctions = list(lanes.key), list(lanes.junction_id)
        columns = {
            "key": [*keys, *((keys[k][0], keys[k][1], keys[k][2]) for k in inner)],
            "lane_type": np.concatenate((kinds, np.full(len(inner), "curb"))),
            "s_start_m": np.concatenate((lanes.s_start_m, lanes.s_start_m[inner])),
            "s_end_m": np.concatenate((lanes.s_end_m, lanes.s_end_m[inner])),
            "direction": np.concatenate((lanes.direction, lanes.direction[inner])),
            "junction_id": [
                None if k < len(kinds) and self._hidden[k] else junction
                for k, junction in enumerate([*junctions, *(junctions[k] for k in inner)])
            ],
        }
        made: LaneColumns = SimpleNamespace(**columns)
        return made

    def _displaced(self, points_m: FloatArray, share: float) -> FloatArray:
        """(N, 2) points moved to the left of the route where it is nearest, by a share of the error."""
        if not self._errors.lane_m:
            return points_m
        station, _ = self._exact_route.place(points_m)
        _, yaw = self._exact_route.poses(station)
        left = np.column_stack((-np.sin(yaw), np.cos(yaw)))
        return points_m + share * self._errors.lane_m * left

    def _lane(self, lane: int) -> int:
        """The lane of the exact map on which a strip lies."""
        first = len(self._hidden)
        return lane if lane < first else self._strips[lane - first][0]

    def _shown(self, lanes: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(lane for lane in lanes if not self._hidden[lane])

    def center_line(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """See `LaneMap`."""
        x, y, z, heading = self._exact.center_line(self._lane(lane), s_m)
        if not self._errors.lane_m:
            return x, y, z, heading
        moved = self._displaced(np.column_stack((np.ravel(x), np.ravel(y))), 1.0)
        return moved[:, 0].reshape(np.shape(x)), moved[:, 1].reshape(np.shape(y)), z, heading

    def lane_width(self, lane: int, s_m: ArrayLike) -> FloatArray:
        """See `LaneMap`; negative where a kerb lies too far in."""
        if lane >= len(self._hidden):
            return np.full(np.shape(s_m), self._errors.kerb_m)
        return self._exact.lane_width(lane, s_m)

    def successors(self, lane: int) -> tuple[int, ...]:
        """See `LaneMap`."""
        return self._shown(self._exact.successors(lane)) if lane < len(self._hidden) else ()

    def predecessors(self, lane: int) -> tuple[int, ...]:
        """See `LaneMap`."""
        return self._shown(self._exact.predecessors(lane)) if lane < len(self._hidden) else ()

    def left_neighbour(self, lane: int) -> int | None:
        """See `LaneMap`."""
        return self._neighbour(lane, "left")

    def right_neighbour(self, lane: int) -> int | None:
        """See `LaneMap`."""
        return self._neighbour(lane, "right")

    def _neighbour(self, lane: int, side: Side) -> int | None:
        beside = self._beside.get((lane, side))
        if beside is None:
            if lane >= len(self._hidden):
                return self._lane(lane)  # back from the kerb
            beside = self._exact_neighbour(lane, side)
        if beside is not None and beside < len(self._hidden) and self._hidden[beside]:
            return None
        return beside

    def _exact_neighbour(self, lane: int, side: Side) -> int | None:
        exact = self._exact
        return exact.left_neighbour(lane) if side == "left" else exact.right_neighbour(lane)

    def lane_change_ranges(self, lane: int, side: Side) -> FloatArray:
        """See `LaneMap`."""
        return self._exact.lane_change_ranges(self._lane(lane), side)

    def locate(self, xy_m: ArrayLike, z_m: ArrayLike | None = None) -> PlacedPoints:
        """See `LaneMap`."""
        hits = self._exact.locate(self._displaced(np.asarray(xy_m, dtype=np.float64), -1.0), z_m)
        shown = ~self._hidden[hits.lane]
        columns = {name: getattr(hits, name)[shown] for name in ("point", "lane", "s_m", "margin_m")}
        placed: PlacedPoints = SimpleNamespace(**columns)
        return placed

    def nearest_lane(
        self, xy_m: ArrayLike, lane_types: Collection[str] = ("driving",), *, z_m: ArrayLike | None = None
    ) -> NearestLanes:
        """See `LaneMap`; among the lanes that are shown, by the types that they are shown with.

        Heights count where those are all lanes of some types.
        """
        points = self._displaced(np.asarray(xy_m, dtype=np.float64), -1.0)
        wanted = np.isin(self.lanes.lane_type[: len(self._hidden)], list(lane_types)) & ~self._hidden
        exact_types = np.asarray(self._exact.lanes.lane_type)
        types = set(exact_types[wanted].tolist())
        if np.array_equal(np.isin(exact_types, list(types)), wanted):
            return self._exact.nearest_lane(points, tuple(types), z_m=z_m)
        return self._nearest_of(np.flatnonzero(wanted), points)

    def _nearest_of(self, lanes: IntArray, points_m: FloatArray) -> NearestLanes:
        """The nearest of some lanes for each of (N, 2) points of the map without errors."""
        distance, aside = np.full(len(points_m), np.inf), np.full(len(points_m), np.inf)
        nearest, s_m = np.zeros(len(points_m), dtype=np.int64), np.zeros(len(points_m))
        for lane in lanes.tolist():
            strip = lane_strip(self._exact, lane, 0.0)
            station, offset = PlannedPath(strip.center_m, strip.station_m).place(points_m)
            beyond = station - np.clip(station, 0.0, strip.length_m)  # a lane ends, a path goes on
            half = np.interp(station, strip.station_m, strip.half_width_m)
            off = np.hypot(beyond, np.maximum(np.abs(offset) - half, 0.0))
            # of several lanes that contain a point it is the one whose middle is nearest
            nearer = (off < distance) | ((off == distance) & (np.abs(offset) < aside))
            distance[nearer], aside[nearer], nearest[nearer] = off[nearer], np.abs(offset[nearer]), lane
            s_m[nearer] = np.interp(station[nearer], strip.station_m, strip.s_m)
        made: NearestLanes = SimpleNamespace(
            found=np.isfinite(distance), lane=nearest, s_m=s_m, distance_m=distance
        )
        return made

    def signals_of(self, road_id: str) -> Sequence[MapSignal]:
        """See `LaneMap`."""
        return self._exact.signals_of(road_id)

    @property
    def crosswalks(self) -> Sequence[MapCrosswalk]:
        """See `LaneMap`."""
        return self._exact.crosswalks
