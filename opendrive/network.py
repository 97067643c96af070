"""The road network: what users of the package hold."""

from collections.abc import Collection, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import FloatArray, finite, points_xy, wrapped
from opendrive.checks import curve_warnings, refuse_impossible_lanes
from opendrive.errors import LaneNotFoundError, MapContentError, MapWarning, PositionError, RoadNotFoundError
from opendrive.lane_graph import LaneGraph, Side, may_cross, neighbour_key
from opendrive.lane_index import LaneHits, LaneIndex, NearestLanes
from opendrive.lanes import LaneKey, LaneTable
from opendrive.model import MapModel, Signal
from opendrive.objects import Crosswalk, RoadSignal, crosswalks_on, signals_on
from opendrive.reader import read_map
from opendrive.road_geometry import NetworkGeometry, RoadGeometry, SurfacePoints, within


class RoadNetwork:
    """A road network made from an OpenDRIVE map; `load_map` makes one from a file.

    Lanes are numbered 0 .. L-1 over the whole network (`lanes`); the centre lanes are not counted. Positions
    are in the map frame: OpenDRIVE's inertial frame, right-handed, x east, y north, z up, metres; headings in
    radians, counter-clockwise from x, wrapped to (-pi, pi]. `s_m` always is the s of the lane's road. Nothing
    can be changed after loading; the spatial index, the graph and other derived tables are made when first
    needed.
    """

    def __init__(self, model: MapModel) -> None:
        self._model = model
        self._records = tuple(model.roads.values())
        self._geometry = NetworkGeometry.collect(self._records)
        refuse_impossible_lanes(self._geometry)

    def __reduce__(self) -> tuple[type["RoadNetwork"], tuple[MapModel]]:
        """Pickle the map alone; derived tables are made anew where it is loaded."""
        return RoadNetwork, (self._model,)

    def __repr__(self) -> str:
        return f"<RoadNetwork {self.name!r}: {len(self._records)} roads, {len(self.lanes)} lanes>"

    # Content

    @property
    def model(self) -> MapModel:
        """The map as read."""
        return self._model

    @property
    def name(self) -> str:
        """Name in the header of the file."""
        return self._model.header.name

    @property
    def lanes(self) -> LaneTable:
        """All lanes, as a struct of arrays."""
        return self._geometry.lanes

    @cached_property
    def roads(self) -> Mapping[str, RoadGeometry]:
        """Roads by id."""
        return MappingProxyType(
            {road.id: RoadGeometry(road, r, self._geometry) for r, road in enumerate(self._records)}
        )

    @cached_property
    def warnings(self) -> tuple[MapWarning, ...]:
        """Defects of the map that are tolerated."""
        return (
            *self._model.warnings,
            *curve_warnings(self._geometry.curves, self._records),
            *self._graph.warnings,
        )

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least and greatest coordinates of all lanes: xmin, ymin, xmax, ymax, metres."""
        return self._index.bounds

    @cached_property
    def _index(self) -> LaneIndex:
        return LaneIndex.build(self._geometry)

    @cached_property
    def _graph(self) -> LaneGraph:
        return LaneGraph.build(self._model, self.lanes)

    # Lanes

    def lane_index_of(self, key: LaneKey | tuple[str, int, int]) -> int:
        """Return the index of a lane.

        Raises:
            LaneNotFoundError: the network has no such lane.
        """
        road_id, section, lane_id = key
        lane = self.lanes.lane_of_key.get(LaneKey(road_id, section, lane_id))
        if lane is None:
            raise LaneNotFoundError(f"no lane {lane_id} in section {section} of road {road_id!r}")
        return lane

    def center_line(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return points of the middle of a lane.

        Args:
            lane: index of the lane.
            s_m: road s, of any shape.

        Returns:
            x, y, z and heading in travel direction, all of the shape of `s_m`.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        s = self._on_lane(lane, s_m)
        flat = s.ravel()
        many = np.full(flat.size, lane)
        inner, outer, d_inner, d_outer = self.lanes.offsets_and_slopes(many, flat)
        points = self._geometry.surface(
            self.lanes.road[many], flat, 0.5 * (inner + outer), 0.5 * (d_inner + d_outer)
        )
        heading = (
            points.heading_rad if self.lanes.direction[lane] > 0 else wrapped(points.heading_rad + np.pi)
        )
        z = points.z_m + self._height(lane, flat)
        return (
            points.x_m.reshape(s.shape),
            points.y_m.reshape(s.shape),
            z.reshape(s.shape),
            heading.reshape(s.shape),
        )

    def _height(self, lane: int, s_m: FloatArray) -> FloatArray:
        """Return the height of the middle of a lane above the road (chapter "Lanes").

        Between two records the height changes linearly, as maps with ramped kerbs expect.
        """
        rows = self.lanes.records[lane].height
        if not len(rows):
            return np.zeros_like(s_m)
        middle = 0.5 * (rows[:, 1] + rows[:, 2])
        height: FloatArray = np.interp(s_m - self.lanes.s_start_m[lane], rows[:, 0], middle, left=0.0)
        return height

    def lane_offsets(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return t of a lane's inner border (the one towards the centre lane) and of its outer border.

        Both have the shape of `s_m`.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        s = self._on_lane(lane, s_m)
        inner, outer, _, _ = self.lanes.offsets_and_slopes(np.full(s.size, lane), s.ravel())
        return inner.reshape(s.shape), outer.reshape(s.shape)

    def lane_width(self, lane: int, s_m: ArrayLike) -> FloatArray:
        """Return a lane's width along t, of the shape of `s_m`.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        inner, outer = self.lane_offsets(lane, s_m)
        width: FloatArray = (outer - inner) * self.lanes.side[lane]
        return width

    def borders(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the left and the right border of a lane as seen in travel direction, (N, 2) each.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        s = self._on_lane(lane, s_m).ravel()
        inner, outer = self._geometry.border_points(np.full(s.size, lane), s)
        return (outer, inner) if self.lanes.side[lane] == self.lanes.direction[lane] else (inner, outer)

    def lane_polygon(
        self,
        lane: int,
        s0_m: float,
        s1_m: float,
        margin_left_m: float = 0.0,
        margin_right_m: float = 0.0,
        tolerance_m: float = 0.05,
    ) -> FloatArray:
        """Return the outline of a stretch of a lane.

        The outline follows the curve of the road and the change of width within `tolerance_m`. Margins that
        reach beyond the centre of a tight bend make it cross itself, as the border moved there does.

        Args:
            lane: index of the lane.
            s0_m: one end of the stretch, road s.
            s1_m: the other end.
            margin_left_m: by how much the left border (in travel direction) is moved outwards, along t.
            margin_right_m: the same for the right border.
            tolerance_m: greatest distance between border and outline.

        Returns:
            (P, 2) corners, map frame, without repetition of the first; along the right border and back along
            the left.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, a margin is not finite, or the tolerance is not
            positive.
        """
        s0, s1 = np.sort(self._on_lane(lane, [s0_m, s1_m])).tolist()
        finite([margin_left_m, margin_right_m], "margin")
        if not tolerance_m > 0.0:
            raise PositionError(f"tolerance_m: expected a positive number, got {tolerance_m}")
        outer_is_left = self.lanes.side[lane] == self.lanes.direction[lane]
        margins = np.array(
            [margin_right_m, margin_left_m] if outer_is_left else [margin_left_m, margin_right_m]
        )
        many, low, high = self._geometry.knots(np.array([lane]))
        low, high = np.maximum(low, s0), np.minimum(high, s1)
        kept = high > low
        _, low, high = self._geometry.refine(many[kept], low[kept], high[kept], margins, tolerance_m)
        s = np.append(low, high[-1]) if low.size else np.array([s0, s1])
        inner, outer = self._geometry.border_points(np.full(s.size, lane), s, margins)
        left, right = (outer, inner) if outer_is_left else (inner, outer)
        if self.lanes.direction[lane] < 0:
            left, right = left[::-1], right[::-1]
        return np.concatenate([right, left[::-1]])

    def speed_limit(self, lane: int, s_m: float) -> float | None:
        """Return the speed limit of a lane at `s_m`, m/s, or None.

        A limit of the lane prevails over that of the road type (chapter "Lanes").

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        s = float(self._on_lane(lane, s_m))
        start = float(self.lanes.s_start_m[lane])
        speeds = [speed for speed in self.lanes.records[lane].speeds if start + speed.s_offset_m <= s]
        if speeds:
            return speeds[-1].speed_mps
        types = [kind for kind in self._records[int(self.lanes.road[lane])].types if kind.s_m <= s]
        return types[-1].speed_mps if types else None

    # Roads

    def road_point(self, road_id: str, s_m: ArrayLike, t_m: ArrayLike) -> SurfacePoints:
        """Return x, y, z and heading along s at (s, t) of a road, broadcast against each other.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: s or t is not finite, or s is off the road.
        """
        return self._road(road_id).point(s_m, t_m)

    def road_coordinates(self, road_id: str, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return (s, t) of points (N, 2) relative to a road; see `RoadGeometry.coordinates`.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        return self._road(road_id).coordinates(xy_m)

    # Queries

    def locate(self, xy_m: ArrayLike) -> LaneHits:
        """Return every lane that contains each point.

        Args:
            xy_m: (N, 2) points, map frame.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        return self._index.containing(points_xy(xy_m))

    def nearest_lane(self, xy_m: ArrayLike, lane_types: Collection[str] = ("driving",)) -> NearestLanes:
        """Return the nearest lane of the given types for each point.

        Of several lanes that contain a point, the one whose centre line is nearest is taken.

        Args:
            xy_m: (N, 2) points, map frame.
            lane_types: OpenDRIVE lane types.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        types = (lane_types,) if isinstance(lane_types, str) else tuple(lane_types)
        return self._index.nearest(points_xy(xy_m), types)

    # Topology

    def successors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that traffic reaches next from a lane, across sections, roads and junctions.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._graph.successors[self._checked(lane)]

    def predecessors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that traffic reaches a lane from.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._graph.predecessors[self._checked(lane)]

    def left_neighbour(self, lane: int) -> int | None:
        """Return the lane on the left as seen in travel direction, of whatever type and direction, or None.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._neighbour(lane, "left")

    def right_neighbour(self, lane: int) -> int | None:
        """Return the lane on the right as seen in travel direction, of whatever type and direction, or None.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._neighbour(lane, "right")

    def lane_change(self, lane: int, s_m: float, side: Side) -> bool:
        """Return whether the road mark at `s_m` allows changing to the neighbour on a side (chapter "Lanes").

        A mark without the attribute laneChange allows it, and so does a border without mark; false if there
        is no neighbour. Type and direction of the neighbour are not looked at.

        Args:
            lane: index of the lane.
            s_m: road s.
            side: ``left`` or ``right``, in travel direction.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or the side is neither.
        """
        if side not in ("left", "right"):
            raise PositionError(f"side: expected 'left' or 'right', got {side!r}")
        s = float(self._on_lane(lane, s_m))
        other = self._neighbour(lane, side)
        return other is not None and may_cross(self._model, self.lanes.key[lane], self.lanes.key[other], s)

    def shortest_route(self, from_lane: int, to_lane: int) -> tuple[int, ...]:
        """Return the lanes of the shortest way between two lanes, both included, without lane changes.

        Raises:
            LaneNotFoundError: no such lane.
            RouteNotFoundError: no chain of successors leads there.
        """
        return self._graph.shortest_route(self.lanes, self._checked(from_lane), self._checked(to_lane))

    # Objects and signals

    @cached_property
    def crosswalks(self) -> tuple[Crosswalk, ...]:
        """All crosswalks that have an outline or a size."""
        return tuple(crosswalk for road in self.roads.values() for crosswalk in crosswalks_on(road))

    @cached_property
    def _signals(self) -> Mapping[str, Signal]:
        return {signal.id: signal for road in self._records for signal in road.signals}

    def signals_of(self, road_id: str) -> tuple[RoadSignal, ...]:
        """Return the signals placed on a road and those referenced from it, by s.

        Raises:
            RoadNotFoundError: no such road.
        """
        return signals_on(self._road(road_id).record, self._signals)

    # Checks

    def _checked(self, lane: int) -> int:
        if not 0 <= lane < len(self.lanes):
            raise LaneNotFoundError(f"no lane {lane}: the network has lanes 0 to {len(self.lanes) - 1}")
        return int(lane)

    def _on_lane(self, lane: int, s_m: ArrayLike) -> FloatArray:
        i = self._checked(lane)
        s = finite(s_m, "s_m")
        low, high = float(self.lanes.s_start_m[i]), float(self.lanes.s_end_m[i])
        return within(s, low, high, f"lane {tuple(self.lanes.key[i])}")

    def _road(self, road_id: str) -> RoadGeometry:
        road = self.roads.get(road_id)
        if road is None:
            raise RoadNotFoundError(f"no road {road_id!r} in the network; ids are strings")
        return road

    def _neighbour(self, lane: int, side: Side) -> int | None:
        i = self._checked(lane)
        return self.lanes.lane_of_key.get(
            neighbour_key(self.lanes.key[i], int(self.lanes.direction[i]), side)
        )


def load_map(path: str | PathLike[str]) -> RoadNetwork:
    """Load an OpenDRIVE map.

    Args:
        path: the ``.xodr`` file (ASAM OpenDRIVE 1.4 to 1.8).

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value.
    """
    model = read_map(path)
    try:
        return RoadNetwork(model)
    except MapContentError as error:
        raise MapContentError(f"{Path(path)}: {error}") from None
