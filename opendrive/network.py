"""The road network: what users of the package hold."""

from collections.abc import Collection, Mapping
from functools import cached_property
from os import PathLike
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import FloatArray, finite, per_point, points_xy
from opendrive.checks import (
    content_warnings,
    curve_warnings,
    link_warnings,
    profile_warnings,
    refuse_impossible_lanes,
    rule_warnings,
)
from opendrive.errors import LaneNotFoundError, MapWarning, PositionError, RoadNotFoundError
from opendrive.export import lane_table, to_geojson
from opendrive.geo import GeoReference
from opendrive.lanes.graph import LaneGraph, Side, crossing_ranges, may_cross, neighbour_key
from opendrive.lanes.table import LaneKey
from opendrive.lanes.travel import (
    LANE_CHANGE_COST_M,
    ROUTE_LANE_TYPES,
    LanePlaces,
    LaneRoute,
    lane_route,
    travelled,
)
from opendrive.model import MapModel, Signal
from opendrive.roads.borders import bounds_of
from opendrive.roads.geometry import NetworkGeometry, SurfacePoints
from opendrive.roads.lane_index import LaneHits, LaneIndex, NearestLanes
from opendrive.roads.levels import overlapping_roads
from opendrive.roads.network_lanes import NetworkLanes
from opendrive.roads.objects import (
    Crosswalk,
    PlacedObject,
    RoadSignal,
    crosswalks_of,
    objects_on,
    signals_on,
)
from opendrive.roads.road import RoadGeometry, SurfaceAttitudes
from opendrive.roads.road_records import RoadRecords


class RoadNetwork(NetworkLanes):
    """A road network made from an OpenDRIVE map; `load_map` makes one from a file.

    Lanes are numbered 0 .. L-1 over the whole network (`lanes`); the centre lanes are not counted. Positions
    are in the map frame: OpenDRIVE's inertial frame, right-handed, x east, y north, z up, metres; headings in
    radians, counter-clockwise from x, wrapped to (-pi, pi]. `s_m` always is the s of the lane's road. Nothing
    can be changed after loading; the spatial index, the graph and other derived tables are made when first
    needed.
    """

    def __init__(self, model: MapModel) -> None:
        self._model = model
        geometry = model.roads.geometry if isinstance(model.roads, RoadRecords) else None
        super().__init__(geometry or NetworkGeometry.collect(tuple(model.roads.values())))
        refuse_impossible_lanes(self._geometry)

    def __reduce__(self) -> tuple[type["RoadNetwork"], tuple[MapModel]]:
        """Pickle the map alone; derived tables are made anew where it is loaded."""
        return RoadNetwork, (self._model,)

    def __repr__(self) -> str:
        return f"<RoadNetwork {self.name!r}: {len(self._model.roads)} roads, {len(self.lanes)} lanes>"

    # Content

    @property
    def model(self) -> MapModel:
        """The map as read."""
        return self._model

    @property
    def name(self) -> str:
        """Name in the header of the file."""
        return self._model.header.name

    @cached_property
    def roads(self) -> Mapping[str, RoadGeometry]:
        """Roads by id."""
        return MappingProxyType(
            {
                road_id: RoadGeometry(road_id, r, self._geometry, self._model.roads)
                for r, road_id in enumerate(self._geometry.roads.id)
            }
        )

    @cached_property
    def warnings(self) -> tuple[MapWarning, ...]:
        """Defects of the map that are tolerated."""
        return (
            *self._model.warnings,
            *curve_warnings(self._geometry.curves, tuple(self._model.roads.values())),
            *self._graph.warnings,
            *link_warnings(self._geometry, self._model.junctions),
            *profile_warnings(self._geometry),
            *content_warnings(self._model),
        )

    @cached_property
    def findings(self) -> tuple[MapWarning, ...]:
        """The warnings, and where the map breaks rules of the standard that do no harm here."""
        return (*self.warnings, *rule_warnings(self._geometry, self._model))

    def place_of(self, finding: MapWarning) -> tuple[float, float, float] | None:
        """Return x, y, z of a finding, map frame: on its lane or reference line; None if it has no s."""
        road = self.roads.get(finding.road_id)
        if road is None or finding.s_m is None:
            return None
        s_m = min(max(finding.s_m, 0.0), road.length_m)
        t_m = 0.0
        if finding.lane_id:
            of_road = [section.s_m for section in road.record.sections]
            section = max(int(np.searchsorted(of_road, s_m, side="right")) - 1, 0)
            # At the end of a lane section its lanes are meant where the next one has none of that id.
            for k in (section, section - 1):
                lane = self.lanes.lane_of_key.get(LaneKey(finding.road_id, k, finding.lane_id))
                if lane is not None and self.lanes.s_start_m[lane] <= s_m <= self.lanes.s_end_m[lane]:
                    t_m = float(np.mean(self.lane_offsets(lane, s_m)))
                    break
        point = road.point(s_m, t_m)
        return float(point.x_m), float(point.y_m), float(point.z_m)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least and greatest coordinates of all lanes: xmin, ymin, xmax, ymax, metres.

        Exact where the borders are straight, within 5 mm where they bend; 0 without lanes.
        """
        return bounds_of(self._geometry)

    @cached_property
    def _index(self) -> LaneIndex:
        return LaneIndex.build(self._geometry)

    @cached_property
    def _geo(self) -> GeoReference:
        return GeoReference.of(self._model.header)

    @cached_property
    def _graph(self) -> LaneGraph:
        return LaneGraph.build(self._geometry.roads, self.lanes, self._model.junctions.values())

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

    def speed_limit(self, lane: int, s_m: float) -> float | None:
        """Return the speed limit of a lane at `s_m`, m/s, or None.

        A limit of the lane prevails over that of the road type (chapter "Lanes").

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        s = float(self._on_lane(lane, s_m))
        start = float(self.lanes.s_start_m[lane])
        key = self.lanes.key[lane]
        road = self._model.roads[key.road_id]
        lanes = road.sections[key.section].lanes
        limits = next(record.speeds for record in lanes if record.id == key.lane_id)
        speeds = [speed for speed in limits if start + speed.s_offset_m <= s]
        if speeds:
            return speeds[-1].speed_mps
        types = [kind for kind in road.types if kind.s_m <= s]
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

    def attitude(self, road_id: str, s_m: ArrayLike, t_m: ArrayLike) -> SurfaceAttitudes:
        """Return height, heading, pitch, roll and normal of a road's surface; see `RoadGeometry.attitude`.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: s or t is not finite, or s is off the road.
        """
        return self._road(road_id).attitude(s_m, t_m)

    # Queries

    def locate(self, xy_m: ArrayLike, z_m: ArrayLike | None = None) -> LaneHits:
        """Return every lane that contains each point.

        Without heights, lanes of all levels count, such as those under a bridge; see `overlapping_roads`.

        Args:
            xy_m: (N, 2) points, map frame.
            z_m: (N,) heights of the points, or one for all: only the lanes of the nearest level count, which
                are those within 2 m in height of the lane nearest in height.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        points = points_xy(xy_m)
        return self._index.containing(points, None if z_m is None else per_point(z_m, "z_m", points))

    def nearest_lane(
        self,
        xy_m: ArrayLike,
        lane_types: Collection[str] = ("driving",),
        heading_rad: ArrayLike | None = None,
        z_m: ArrayLike | None = None,
    ) -> NearestLanes:
        """Return the nearest lane of the given types for each point.

        Of several lanes that contain a point, the one whose centre line is nearest is taken; if headings are
        given, the one whose travel direction is nearest to the heading.

        Args:
            xy_m: (N, 2) points, map frame.
            lane_types: OpenDRIVE lane types.
            heading_rad: (N,) headings of what stands at the points, or one for all.
            z_m: (N,) heights of the points, or one for all: the nearest lane in space is taken; its distance
                stays that in plan.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        types = (lane_types,) if isinstance(lane_types, str) else tuple(lane_types)
        points = points_xy(xy_m)
        height_m = None if z_m is None else per_point(z_m, "z_m", points)
        if heading_rad is None:
            return self._index.nearest(points, types, height_m)
        return self._index.nearest_along(
            points, types, per_point(heading_rad, "heading_rad", points), height_m
        )

    @cached_property
    def overlapping_roads(self) -> tuple[tuple[str, str], ...]:
        """Pairs of roads above each other, as bridges lie: queries there need a height."""
        return overlapping_roads(self._geometry, self._index)

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

    def lane_change_ranges(self, lane: int, side: Side) -> FloatArray:
        """Return the stretches of s (K, 2) on which `lane_change` is true.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: the side is neither left nor right.
        """
        if side not in ("left", "right"):
            raise PositionError(f"side: expected 'left' or 'right', got {side!r}")
        other = self._neighbour(lane, side)
        if other is None:
            return np.empty((0, 2))
        start, end = float(self.lanes.s_start_m[lane]), float(self.lanes.s_end_m[lane])
        ranges = crossing_ranges(self._model, self.lanes.key[lane], self.lanes.key[other], start, end)
        return np.array(ranges, dtype=np.float64).reshape(-1, 2)

    def places_ahead(
        self, lane: ArrayLike, s_m: ArrayLike, distance_m: ArrayLike, backward: bool = False
    ) -> LanePlaces:
        """Return all places that are some metres further on in travel direction, on every branch.

        The distance is measured along the reference lines, as s is. Ways that end before it are left out.

        Args:
            lane: (N,) lanes, or one.
            s_m: (N,) road s where to start, broadcast against `lane`.
            distance_m: (N,) how far to go, broadcast as well.
            backward: go against travel direction instead.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or a distance is negative or has too many
                branches.
        """
        lanes, s = self._on_lanes(lane, s_m)
        lanes, s, distance = np.broadcast_arrays(lanes, s, finite(distance_m, "distance_m"))
        if distance.size and distance.min() < 0.0:
            raise PositionError(f"distance_m: expected no negative value, got {distance.min()}")
        return travelled(self.lanes, self._graph, lanes.ravel(), s.ravel(), distance.ravel(), backward)

    def shortest_route(self, from_lane: int, to_lane: int) -> tuple[int, ...]:
        """Return the lanes of the shortest way between two lanes, both included, without lane changes.

        Raises:
            LaneNotFoundError: no such lane.
            RouteNotFoundError: no chain of successors leads there.
        """
        start, goal = self._checked(from_lane), self._checked(to_lane)
        forward = self.lanes.direction > 0
        entry = float(np.where(forward, self.lanes.s_start_m, self.lanes.s_end_m)[start])
        leave = float(np.where(forward, self.lanes.s_end_m, self.lanes.s_start_m)[goal])
        route = lane_route(self._model, self.lanes, self._graph, (start, entry), (goal, leave), np.inf)
        return tuple(route.lane.tolist())

    def route(
        self,
        from_lane: int,
        from_s_m: float,
        to_lane: int,
        to_s_m: float,
        lane_change_cost_m: float = LANE_CHANGE_COST_M,
        lane_types: Collection[str] = ROUTE_LANE_TYPES,
    ) -> LaneRoute:
        """Return the cheapest way between two places on lanes, with lane changes where the marks allow them.

        The cost is the length along the reference lines plus `lane_change_cost_m` for each lane change.
        Changes lead to lanes of the same direction and of the given types. `nearest_lane` finds the place of
        a pose.

        Args:
            from_lane: lane of the start.
            from_s_m: road s of the start.
            to_lane: lane of the goal.
            to_s_m: road s of the goal.
            lane_change_cost_m: detour that a lane change is worth; infinite for none.
            lane_types: OpenDRIVE lane types that may be changed into.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or the cost is not positive.
            RouteNotFoundError: no way leads there.
        """
        if not lane_change_cost_m > 0.0:
            raise PositionError(f"lane_change_cost_m: expected a positive number, got {lane_change_cost_m}")
        start = (self._checked(from_lane), float(self._on_lane(from_lane, from_s_m)))
        goal = (self._checked(to_lane), float(self._on_lane(to_lane, to_s_m)))
        return lane_route(self._model, self.lanes, self._graph, start, goal, lane_change_cost_m, lane_types)

    # Geographic positions and exports

    def to_geographic(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude (N,) of points (N, 2) of the map frame: WGS 84, degrees.

        The header's offset is applied here and nowhere else.

        Raises:
            GeoReferenceError: pyproj is not installed, or the map's geoReference is absent or not understood.
            PositionError: the shape is not (N, 2), a value is not finite, or a point is outside the
                projection.
        """
        return self._geo.to_geographic(points_xy(xy_m))

    def from_geographic(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> FloatArray:
        """Return points (N, 2) of the map frame at latitude and longitude (N,): WGS 84, degrees.

        Raises:
            GeoReferenceError: pyproj is not installed, or the map's geoReference is absent or not understood.
            PositionError: a value is not finite, or a point is outside the projection.
        """
        latitude, longitude = np.broadcast_arrays(
            finite(latitude_deg, "latitude_deg"), finite(longitude_deg, "longitude_deg")
        )
        return self._geo.from_geographic(latitude.ravel(), longitude.ravel())

    def lane_table(self, tolerance_m: float = 0.05) -> dict[str, Any]:
        """Return all lanes as columns of a table; see `opendrive.export.lane_table`.

        Raises:
            PositionError: the tolerance is not positive.
        """
        return lane_table(
            self.lanes, self.speed_limit, self._graph.successors, self.lane_polygons(tolerance_m)
        )

    def to_geojson(
        self, path: str | PathLike[str] | None = None, tolerance_m: float = 0.05
    ) -> dict[str, Any]:
        """Return all lanes as a GeoJSON feature collection, and write it to a file if one is given.

        Raises:
            GeoReferenceError: the map has a geoReference, but it is not understood or pyproj is not
                installed.
            PositionError: the tolerance is not positive.
            OSError: the file cannot be written.
        """
        to_geographic = self.to_geographic if self._model.header.geo_reference.strip() else None
        return to_geojson(self.name, self.lane_table(tolerance_m), to_geographic, path)

    # Objects and signals

    @cached_property
    def objects(self) -> tuple[PlacedObject, ...]:
        """All objects where they stand, one for every copy of a repeated one and for every outline."""
        return tuple(item for road in self.roads.values() for item in objects_on(road))

    @cached_property
    def crosswalks(self) -> tuple[Crosswalk, ...]:
        """All crosswalks that have an outline or a size, one for every copy and outline."""
        return tuple(crosswalks_of(self.objects))

    @cached_property
    def _signals(self) -> Mapping[str, Signal]:
        return {signal.id: signal for road in self._model.roads.values() for signal in road.signals}

    def signals_of(self, road_id: str) -> tuple[RoadSignal, ...]:
        """Return the signals placed on a road and those referenced from it, by s.

        Raises:
            RoadNotFoundError: no such road.
        """
        return signals_on(self._road(road_id).record, self._signals)

    # Checks

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
