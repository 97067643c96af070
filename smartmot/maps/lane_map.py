"""What perception asks of a map with lanes: the twelve queries of monitored area, route and regulation.

`opendrive.RoadNetwork` answers them; a reader of another format writes one class. Nothing in this package
imports a map format.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmot.types import BoolArray, FloatArray, IntArray

Side = Literal["left", "right"]

LEVEL_M = 2.0
"""Roads that lie further above one another are two levels: no vehicle passes between nearer ones."""


class LaneColumns(Protocol):
    """The L lanes of a map, one row each; a lane is named by its row, 0 .. L-1.

    Every lane runs along a road with a coordinate s, and is a stretch of it. The coordinate is the map's own:
    it need only ascend or fall along the lane, with slopes near 1.
    """

    @property
    def key(self) -> Sequence[tuple[str, int, int]]:
        """(L,) road, number of the stretch of the road, number of the lane on the road."""

    @property
    def lane_type(self) -> NDArray[np.str_]:
        """(L,) OpenDRIVE type names: driving, sidewalk, parking, ..."""

    @property
    def s_start_m(self) -> FloatArray:
        """(L,) least s of the lane."""

    @property
    def s_end_m(self) -> FloatArray:
        """(L,) greatest s of the lane."""

    @property
    def direction(self) -> NDArray[np.signedinteger]:
        """(L,) +1 where traffic runs along s, -1 where it runs against it."""

    @property
    def junction_id(self) -> Sequence[str | None]:
        """(L,) junction that the lane is part of, or None."""


class PlacedPoints(Protocol):
    """K pairs of a point and a lane that contains it, by point and then lane."""

    @property
    def point(self) -> IntArray:
        """(K,) index of the point."""

    @property
    def lane(self) -> IntArray:
        """(K,) index of the lane."""

    @property
    def s_m(self) -> FloatArray:
        """(K,) s of the point."""

    @property
    def margin_m(self) -> FloatArray:
        """(K,) distance from the nearer border of the lane."""


class NearestLanes(Protocol):
    """The nearest lane of each of N points."""

    @property
    def found(self) -> BoolArray:
        """(N,) false where the map has no lane of the wanted types."""

    @property
    def lane(self) -> IntArray:
        """(N,) index of the lane."""

    @property
    def s_m(self) -> FloatArray:
        """(N,) s of the foot of the point on the lane."""

    @property
    def distance_m(self) -> FloatArray:
        """(N,) distance from the lane, 0 inside it."""


class MapSignal(Protocol):
    """A sign, traffic light or mark that applies to a road."""

    @property
    def id(self) -> str:
        """Its name in the map."""

    @property
    def name(self) -> str:
        """Free name."""

    @property
    def type(self) -> str:
        """Code; see `smartmot.maps.regulatory.SIGNAL_KINDS`."""

    @property
    def value(self) -> float | None:
        """Number on the sign."""

    @property
    def s_m(self) -> float:
        """Where it applies."""

    @property
    def orientation(self) -> str:
        """``+`` for traffic along s, ``-`` against s, ``none`` for both."""

    def applies_to(self, lane_id: int) -> bool:
        """Whether it is meant for a lane, by its number on the road."""


class MapCrosswalk(Protocol):
    """A crosswalk on a road."""

    @property
    def id(self) -> str:
        """Its name in the map."""

    @property
    def road_id(self) -> str:
        """The road."""

    @property
    def s_m(self) -> float:
        """Where it is."""


class LaneMap(Protocol):
    """A map with lanes, map frame, metres and radians; it never changes, and is hashed by identity."""

    @property
    def lanes(self) -> LaneColumns:
        """All lanes."""

    def center_line(
        self, lane: int, s_m: ArrayLike, /
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """x, y, z and heading in travel direction of the middle of a lane, each of the shape of s."""

    def lane_width(self, lane: int, s_m: ArrayLike, /) -> FloatArray:
        """Widths of a lane, of the shape of s."""

    def successors(self, lane: int, /) -> tuple[int, ...]:
        """Lanes that traffic reaches next."""

    def predecessors(self, lane: int, /) -> tuple[int, ...]:
        """Lanes that traffic comes from."""

    def left_neighbour(self, lane: int, /) -> int | None:
        """The lane on the left in travel direction, of whatever type and direction, or None."""

    def right_neighbour(self, lane: int, /) -> int | None:
        """The lane on the right in travel direction, of whatever type and direction, or None."""

    def lane_change_ranges(self, lane: int, side: Side, /) -> FloatArray:
        """(K, 2) stretches of s on which the road mark allows changing to the neighbour on a side."""

    def locate(self, xy_m: ArrayLike, /, z_m: ArrayLike | None = None) -> PlacedPoints:
        """Every lane that contains each of (N, 2) points.

        With heights, (N,) or one, only lanes of the level nearest to each: a bridge or the street below it.
        """

    def nearest_lane(
        self, xy_m: ArrayLike, lane_types: Collection[str] = ("driving",), /, *, z_m: ArrayLike | None = None
    ) -> NearestLanes:
        """The nearest lane of the given types for each of (N, 2) points; with heights the nearest in space.

        Of several lanes that contain a point it is the one whose middle is nearest.
        """

    def signals_of(self, road_id: str, /) -> Sequence[MapSignal]:
        """Signals that apply to a road."""

    @property
    def crosswalks(self) -> Sequence[MapCrosswalk]:
        """All crosswalks."""
