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
from opendrive.roads.network_lanes import NetworkLanes

_DEGREE_DECIMALS = 9
"""A tenth of a millimetre on the equator."""

_LEAST_AREA_M2 = 1e-9
"""Twice the area of the smallest triangle that is written."""

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


def write_mesh(network: NetworkLanes, path: str | PathLike[str], step_m: float = 1.0) -> int:
    """Write the surfaces of all lanes as a Wavefront OBJ file, and return the number of triangles.

    Vertices are x, y, z of the map frame (z up), metres; each lane is a group named
    ``ROAD/SECTION/LANE TYPE``. Triangles are counter-clockwise from above; those without area are left out.

    Args:
        network: the map.
        path: file to write.
        step_m: distance of the vertices along the road at most.

    Raises:
        PositionError: the step is not positive.
        OSError: the file cannot be written.
    """
    borders = network.sampled_borders(step_m)
    lanes = network.lanes
    vertices = np.empty((2 * len(borders.s_m), 3))
    # Left and right as seen along s, whatever the direction of travel.
    along = (lanes.direction > 0)[np.repeat(np.arange(len(lanes)), np.diff(borders.first))][:, None]
    vertices[0::2] = np.where(along, borders.left_m, borders.right_m)
    vertices[1::2] = np.where(along, borders.right_m, borders.left_m)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in vertices.tolist()]
    triangles = 0
    for lane, key in enumerate(lanes.key):
        rows = np.arange(borders.first[lane], borders.first[lane + 1] - 1)
        left, right, next_left, next_right = 2 * rows, 2 * rows + 1, 2 * rows + 2, 2 * rows + 3
        faces = np.concatenate(
            [np.stack([right, next_right, next_left], axis=1), np.stack([right, next_left, left], axis=1)]
        )
        corners = vertices[faces, :2]
        (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
        faces = faces[ax * by - ay * bx > _LEAST_AREA_M2]
        if len(faces):
            name = f"{key.road_id}/{key.section}/{key.lane_id} {lanes.lane_type[lane]!s}"
            lines.append("g " + name.replace("\n", " ").replace("\r", " "))
            lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
            triangles += len(faces)
    Path(path).write_text("\n".join([f"# {len(lanes)} lanes, metres, z up", *lines]) + "\n", encoding="utf-8")
    return triangles
