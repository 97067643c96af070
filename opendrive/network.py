"""The road network: what users of the package hold."""

from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import FloatArray, finite, points_xy
from opendrive.checks import (
    Joints,
    content_warnings,
    curve_warnings,
    link_warnings,
    profile_warnings,
    refuse_impossible_lanes,
    rule_warnings,
)
from opendrive.errors import MapWarning
from opendrive.export import lane_table, to_geojson
from opendrive.geo import GeoReference
from opendrive.lanes.table import LaneKey
from opendrive.model import MapModel, Signal
from opendrive.roads.network_topology import NetworkTopology
from opendrive.roads.objects import (
    Crosswalk,
    PlacedObject,
    RoadSignal,
    crosswalks_of,
    objects_on,
    signals_on,
)


class RoadNetwork(NetworkTopology):
    """A road network made from an OpenDRIVE map; `load_map` makes one from a file.

    Its methods are three groups, each a class whose help lists it: where lanes and roads lie, and which are
    at a point (`NetworkLanes`); how lanes are joined (`NetworkTopology`); what else the map holds, its
    warnings and exports (here).

    Lanes are numbered 0 .. L-1 over the whole network (`lanes`); the centre lanes are not counted. Positions
    are in the map frame: OpenDRIVE's inertial frame, right-handed, x east, y north, z up, metres; headings in
    radians, counter-clockwise from x, wrapped to (-pi, pi]. `s_m` always is the s of the lane's road. Nothing
    can be changed after loading; the spatial index, the graph and other derived tables are made when first
    needed.
    """

    def __init__(self, model: MapModel) -> None:
        super().__init__(model)
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
    def warnings(self) -> tuple[MapWarning, ...]:
        """Defects of the map that are tolerated."""
        return (
            *self._model.warnings,
            *curve_warnings(self._geometry),
            *self._graph.warnings,
            *link_warnings(self._geometry, self._joints, self._model.junctions),
            *profile_warnings(self._geometry, self._joints),
            *content_warnings(self._geometry, self._model),
        )

    @cached_property
    def findings(self) -> tuple[MapWarning, ...]:
        """The warnings, and where the map breaks rules of the standard that do no harm here."""
        return (*self.warnings, *rule_warnings(self._geometry, self._joints, self._model))

    @cached_property
    def _joints(self) -> Joints:
        return Joints.of(self._geometry, self._graph.touching)

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
    def _geo(self) -> GeoReference:
        return GeoReference.of(self._model.header)

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

    @cached_property
    def _road_of_signal(self) -> Mapping[str, str]:
        return {signal.id: road.id for road in self._model.roads.values() for signal in road.signals}

    def signals_of(self, road_id: str) -> tuple[RoadSignal, ...]:
        """Return the signals placed on a road and those referenced from it, by s.

        Raises:
            RoadNotFoundError: no such road.
        """
        return signals_on(self._road(road_id).record, self._signals)

    def place_of_signal(self, signal_id: str) -> tuple[float, float, float] | None:
        """Return x, y, z where a signal stands, map frame; None if there is no signal of that id."""
        signal = self._signals.get(signal_id)
        if signal is None:
            return None
        road_id, (s_m, t_m, up_m) = (
            self._road_of_signal[signal_id],
            (signal.s_m, signal.t_m, signal.z_offset_m),
        )
        if signal.position is not None:
            road_id, (s_m, t_m, up_m) = signal.position.road_id, signal.position.position_m
            if not road_id:
                return s_m, t_m, up_m
        road = self.roads.get(road_id)
        if road is None:
            return None
        point = road.point(min(max(s_m, 0.0), road.length_m), t_m)
        return float(point.x_m), float(point.y_m), float(point.z_m) + up_m
