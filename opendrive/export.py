"""Lanes of a network for geographic tools: columns of a table, and GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from opendrive.arrays import FloatArray
from opendrive.lanes.table import LaneTable
from opendrive.model import MapModel

_DEGREE_DECIMALS = 9
"""A tenth of a millimetre on the equator."""

LOCAL_FRAME = "local: metres in the map's inertial frame, x east, y north; the map has no geoReference"


class ExportedNetwork(Protocol):
    """What a table of lanes needs of a network; see `RoadNetwork`."""

    @property
    def model(self) -> MapModel:
        """The map as read."""

    @property
    def name(self) -> str:
        """Name of the map."""

    @property
    def lanes(self) -> LaneTable:
        """All lanes."""

    def speed_limit(self, lane: int, s_m: float) -> float | None:
        """Return the limit, m/s, or None."""

    def successors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that follow."""

    def lane_polygons(self, tolerance_m: float) -> NDArray[np.object_]:
        """Return the outlines of all lanes."""

    def to_geographic(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude, degrees."""


def lane_table(network: ExportedNetwork, tolerance_m: float) -> dict[str, Any]:
    """Return all lanes as columns of equal length, with outlines as shapely polygons in the map frame.

    ``geopandas.GeoDataFrame(network.lane_table(), geometry="geometry")`` makes a table of it.
    """
    lanes = network.lanes
    limits = [
        network.speed_limit(lane, s)
        for lane, s in enumerate((0.5 * (lanes.s_start_m + lanes.s_end_m)).tolist())
    ]
    return {
        "road_id": [key.road_id for key in lanes.key],
        "section": [key.section for key in lanes.key],
        "lane_id": [key.lane_id for key in lanes.key],
        "lane_type": lanes.lane_type.tolist(),
        "direction": lanes.direction.astype(np.int64),
        "junction_id": list(lanes.junction_id),
        "s_start_m": lanes.s_start_m,
        "s_end_m": lanes.s_end_m,
        "speed_limit_mps": np.array(
            [np.nan if limit is None else limit for limit in limits], dtype=np.float64
        ),
        "successors": [list(network.successors(lane)) for lane in range(len(lanes))],
        "geometry": network.lane_polygons(tolerance_m),
    }


def to_geojson(
    network: ExportedNetwork, path: str | PathLike[str] | None, tolerance_m: float
) -> dict[str, Any]:
    """Return all lanes as a GeoJSON feature collection, and write it to `path` if that is not None.

    Coordinates are longitude and latitude where the map has a geoReference. Otherwise they are metres of the
    map frame, which RFC 7946 does not allow: the member ``coordinateFrame`` of the collection says so.

    Raises:
        GeoReferenceError: the geoReference is not understood, or pyproj is not installed.
        OSError: the file cannot be written.
    """
    columns = lane_table(network, tolerance_m)
    rings = shapely.get_exterior_ring(columns.pop("geometry"))
    xy_m, owner = shapely.get_coordinates(rings, return_index=True)
    collection: dict[str, Any] = {"type": "FeatureCollection", "name": network.name}
    if network.model.header.geo_reference.strip():
        latitude, longitude = network.to_geographic(xy_m)
        coordinates = np.stack([longitude, latitude], axis=1).round(_DEGREE_DECIMALS).tolist()
    else:
        collection["coordinateFrame"] = LOCAL_FRAME
        coordinates = xy_m.tolist()
    first = np.searchsorted(owner, np.arange(len(rings) + 1)).tolist()
    columns = {name: _plain(values) for name, values in columns.items()}
    collection["features"] = [
        {
            "type": "Feature",
            "id": lane,
            "properties": {name: values[lane] for name, values in columns.items()},
            "geometry": {"type": "Polygon", "coordinates": [coordinates[first[lane] : first[lane + 1]]]},
        }
        for lane in range(len(rings))
    ]
    if path is not None:
        Path(path).write_text(json.dumps(collection, allow_nan=False), encoding="utf-8")
    return collection


def _plain(values: Any) -> list[Any]:
    """Return a column as JSON knows it: None in place of NaN."""
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return [None if isinstance(value, float) and np.isnan(value) else value for value in plain]
