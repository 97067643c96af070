"""OpenDRIVE maps: geometry, lanes, topology and spatial queries.

    >>> from opendrive import load_map
    >>> network = load_map("town.xodr")          # doctest: +SKIP
    >>> hits = network.locate([[12.0, 3.5]])     # doctest: +SKIP

Positions are metres in the map's right-handed frame, angles radians.
"""

import _smartmot

_smartmot.check(__name__)

from opendrive.errors import (
    LaneNotFoundError,
    MapContentError,
    MapReadError,
    MapWarning,
    OpenDriveError,
    PositionError,
    RoadNotFoundError,
    RouteNotFoundError,
    WarningKind,
)
from opendrive.formats import write_commonroad, write_lanelet2, write_mesh, write_sumo
from opendrive.geo import GeoReferenceError
from opendrive.lanes.table import LaneKey, LaneTable
from opendrive.lanes.travel import LanePlaces, LaneRoute
from opendrive.loading import load_map
from opendrive.network import RoadNetwork
from opendrive.roads.borders import SampledBorders, SampledCenters
from opendrive.roads.geometry import SurfacePoints
from opendrive.roads.lane_index import LaneHits, NearestLanes
from opendrive.roads.objects import Crosswalk, PlacedObject, RoadSignal
from opendrive.roads.road import RoadGeometry, SurfaceAttitudes
from opendrive.xml.reader import read_map
from opendrive.xml.writer import write_map

__all__ = [
    "Crosswalk",
    "GeoReferenceError",
    "LaneHits",
    "LaneKey",
    "LaneNotFoundError",
    "LanePlaces",
    "LaneRoute",
    "LaneTable",
    "MapContentError",
    "MapReadError",
    "MapWarning",
    "NearestLanes",
    "OpenDriveError",
    "PlacedObject",
    "PositionError",
    "RoadGeometry",
    "RoadNetwork",
    "RoadNotFoundError",
    "RoadSignal",
    "RouteNotFoundError",
    "SampledBorders",
    "SampledCenters",
    "SurfaceAttitudes",
    "SurfacePoints",
    "WarningKind",
    "load_map",
    "read_map",
    "write_commonroad",
    "write_lanelet2",
    "write_map",
    "write_mesh",
    "write_sumo",
]
