"""The lanes that the ego means to drive, as one path with stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from smartmot.errors import ShapeError, SmartMotError
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.strips import LaneStrip, lane_strip
from smartmot.maps.walks import extend
from smartmot.path import PlannedPath
from smartmot.types import FloatArray, frozen


class RouteError(SmartMotError):
    """A route cannot be built or a point is not on it."""


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Route(PlannedPath):
    """Lanes in driving order, each a successor of the one before or, after a lane change, its neighbour.

    Args:
        strips: the stretch of each lane that belongs to the route. Over a lane change both lanes do.
        entry_m: (K,) station of the beginning of each strip along the route.
        center_m: (P, 2) the path, map frame: the joined centre lines, over a lane change the way from one to
            the other.
        station_m: (P,) distance along it, ascending from point to point.
        height_m: see `PlannedPath`; lanes tell it, so that it is None.

    Raises:
        ShapeError: shapes disagree, a value is not finite, or the stations do not ascend.
    """

    _noun: ClassVar[str] = "route"

    strips: tuple[LaneStrip, ...]
    entry_m: FloatArray

    def __init__(
        self,
        strips: tuple[LaneStrip, ...],
        entry_m: FloatArray,
        center_m: FloatArray,
        station_m: FloatArray,
        height_m: FloatArray | None = None,
    ) -> None:
        object.__setattr__(self, "strips", strips)
        entry = frozen(entry_m, np.float64, (len(strips),), "entry_m")
        if not np.isfinite(entry).all():
            raise ShapeError("route: every point and station must be finite")
        object.__setattr__(self, "entry_m", entry)
        PlannedPath.__init__(self, center_m, station_m, height_m=height_m)

    @property
    def lanes(self) -> tuple[int, ...]:
        """Indices of the lanes in driving order."""
        return tuple(strip.lane for strip in self.strips)

    def station_of(self, lane: int, s_m: float) -> float:
        """Station of a place on one of its lanes, metres.

        Args:
            lane: index of the lane.
            s_m: road coordinate.

        Raises:
            ValueError: the lane does not belong to the route.
        """
        index = self.lanes.index(lane)
        return float(self.entry_m[index]) + self.strips[index].station_at(s_m)


def route_from_lanes(network: LaneMap, lanes: Sequence[int], vru_margin_m: float = 0.0) -> Route:
    """Join lanes, each a successor of the one before, into a route.

    Raises:
        RouteError: no lanes, or two neighbours in the list do not follow each other.
    """
    if not lanes:
        raise RouteError("route: no lanes given")
    for a, b in pairwise(lanes):
        if b not in network.successors(a):
            raise RouteError(
                f"route: lane {tuple(network.lanes.key[b])} does not follow "
                f"lane {tuple(network.lanes.key[a])}"
            )
    strips = tuple(lane_strip(network, lane, vru_margin_m) for lane in lanes)
    entry = np.concatenate(([0.0], np.cumsum([s.length_m for s in strips])))[:-1]
    center = np.concatenate([s.center_m for s in strips])
    station = np.concatenate([s.station_m + e for s, e in zip(strips, entry, strict=True)])
    return joined(strips, entry, center, station)


def joined(
    strips: tuple[LaneStrip, ...], entry_m: FloatArray, center_m: FloatArray, station_m: FloatArray
) -> Route:
    """A route without the points that lie twice where its parts meet; see `Route`."""
    keep = np.concatenate(([True], np.diff(station_m) > 1e-6))
    return Route(strips, entry_m, center_m[keep], station_m[keep])


def route_ahead(
    network: LaneMap,
    lane: int,
    s_m: float,
    ahead_m: float,
    behind_m: float = 0.0,
    vru_margin_m: float = 0.0,
) -> Route:
    """Route straight on: at every fork the successor that turns least, until `ahead_m` are covered.

    Args:
        network: the map.
        lane: index of the lane to start on.
        s_m: road coordinate on that lane.
        ahead_m: wanted length in front of that point; the route ends earlier where the map does.
        behind_m: wanted length behind it, along the straightest predecessors.
        vru_margin_m: VRU margin kept with the strips.
    """
    strip = lane_strip(network, lane, vru_margin_m)
    station = strip.station_at(s_m)
    lanes = [lane]
    extend(network, lanes, strip.length_m - station, ahead_m, forward=True)
    extend(network, lanes, station, behind_m, forward=False)
    return route_from_lanes(network, lanes, vru_margin_m)
