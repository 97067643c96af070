"""Lanes of a network for geographic tools: columns of a table, and GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from opendrive.arrays import FloatArray
from opendrive.lanes.table import LaneTable

_DEGREE_DECIMALS = 9
"""A tenth of a millimetre on the equator."""

LOCAL_FRAME = "local: metres in the map's inertial frame, x east, y north; the map has no geoReference"


def lane_table(
    lanes: LaneTable,
    speed_limit: Callable[[int, float], float | None],
    successors: Sequence[tuple[int, ...]],
    polygons: NDArray[np.object_],
) -> dict[str, Any]:
    """Return all lanes as columns of equal length, with outlines as shapely geometries in the map frame.

    ``geopandas.GeoDataFrame(network.lane_table(), geometry="geometry")`` makes a table of it.

    Args:
        lanes: all lanes, L of them.
        speed_limit: gives the limit of a lane at s, m/s, or None.
        successors: (L,) the lanes that follow each.
        polygons: (L,) their outlines.
    """
    middle_m = (0.5 * (lanes.s_start_m + lanes.s_end_m)).tolist()
    limits = [speed_limit(lane, s_m) for lane, s_m in enumerate(middle_m)]
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
        "successors": [list(following) for following in successors],
        "geometry": polygons,
    }


def to_geojson(
    name: str,
    columns: dict[str, Any],
    to_geographic: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None,
    path: str | PathLike[str] | None,
) -> dict[str, Any]:
    """Return all lanes as a GeoJSON feature collection, and write it to `path` if that is not None.

    Coordinates are longitude and latitude where the map has a geoReference. Otherwise they are metres of the
    map frame, which RFC 7946 does not allow: the member ``coordinateFrame`` of the collection says so.

    Args:
        name: of the map.
        columns: the lanes, as from `lane_table`.
        to_geographic: gives latitude and longitude of points (N, 2); None: the map has no geoReference.
        path: file to write.

    Raises:
        GeoReferenceError: the geoReference is not understood, or pyproj is not installed.
        OSError: the file cannot be written.
    """
    outlines: NDArray[np.object_] = columns["geometry"]
    collection: dict[str, Any] = {"type": "FeatureCollection", "name": name}
    if to_geographic is not None:
        xy_m = shapely.get_coordinates(outlines)
        latitude, longitude = to_geographic(xy_m) if len(xy_m) else (xy_m, xy_m)
        degrees = np.stack([longitude, latitude], axis=-1).reshape(-1, 2)
        exact = shapely.set_coordinates(outlines.copy(), degrees)
        outlines = shapely.set_coordinates(outlines.copy(), degrees.round(_DEGREE_DECIMALS))
        # Rounding may fold slivers; snapping them to the same grid is slower, but keeps them valid.
        folded = ~shapely.is_valid(outlines)
        outlines[folded] = shapely.orient_polygons(
            shapely.set_precision(exact[folded], 10.0**-_DEGREE_DECIMALS)
        )
    else:
        collection["coordinateFrame"] = LOCAL_FRAME
    plain = {key: _plain(values) for key, values in columns.items() if key != "geometry"}
    collection["features"] = [
        {
            "type": "Feature",
            "id": lane,
            "properties": {key: values[lane] for key, values in plain.items()},
            "geometry": geometry,
        }
        for lane, geometry in enumerate(map(json.loads, shapely.to_geojson(outlines).tolist()))
    ]
    if path is not None:
        Path(path).write_text(json.dumps(collection, allow_nan=False), encoding="utf-8")
    return collection


def _plain(values: Any) -> list[Any]:
    """Return a column as JSON knows it: None in place of NaN."""
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return [None if isinstance(value, float) and np.isnan(value) else value for value in plain]
