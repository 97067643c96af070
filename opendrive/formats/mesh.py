"""Surfaces of all lanes as triangles: Wavefront OBJ, and glTF 2.0 (https://registry.khronos.org/glTF)."""

import base64
import json
import struct
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from opendrive.arrays import FloatArray, IntArray
from opendrive.errors import OpenDriveError
from opendrive.roads.network_lanes import NetworkLanes

_LEAST_AREA_M2 = 1e-9
"""Twice the area of the smallest triangle that is written."""

_COLORS = {
    "driving": (0.24, 0.25, 0.27),
    "biking": (0.55, 0.26, 0.22),
    "sidewalk": (0.62, 0.60, 0.56),
    "walking": (0.62, 0.60, 0.56),
    "parking": (0.33, 0.36, 0.42),
    "shoulder": (0.42, 0.42, 0.38),
    "median": (0.36, 0.48, 0.30),
    "border": (0.45, 0.44, 0.40),
}
_OTHER_COLOR = (0.40, 0.42, 0.38)
_GLB_MAGIC = 0x46546C67
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_FLOAT, _UNSIGNED_INT = 5126, 5125


class _LaneSurface(NamedTuple):
    """The surface of a lane: its name and type, points (K, 3) of the map frame, triangles (T, 3) of them."""

    name: str
    lane_type: str
    vertices: FloatArray
    faces: IntArray


def write_mesh(network: NetworkLanes, path: str | PathLike[str], step_m: float = 1.0) -> int:
    """Write the surfaces of all lanes, and return the number of triangles.

    The ending of the file decides: Wavefront OBJ (``.obj``) or glTF 2.0 (``.glb``, or ``.gltf`` with its data
    inside). Each lane is a group, or a mesh, named ``ROAD/SECTION/LANE TYPE``. Triangles run
    counter-clockwise as seen from above; those without area are left out. OBJ holds x, y, z of the map frame
    (z up), metres. glTF has its y axis up: its x, y, z are x, z, -y of the map frame; a node moves the lanes
    from the middle of the map, since its numbers have 7 digits.

    Args:
        network: the map.
        path: file to write.
        step_m: distance of the vertices along the road at most.

    Raises:
        OpenDriveError: the file's ending is none of these.
        PositionError: the step is not positive.
        OSError: the file cannot be written.
    """
    path = Path(path)
    surfaces = list(_surfaces(network, step_m))
    if path.suffix == ".obj":
        path.write_text(_obj(surfaces, len(network.lanes)), encoding="utf-8")
    elif path.suffix in (".glb", ".gltf"):
        content, data = _gltf(surfaces)
        path.write_bytes(_binary(content, data) if path.suffix == ".glb" else _embedded(content, data))
    else:
        raise OpenDriveError(f"{path.name!r} ends in none of .obj, .gltf and .glb")
    return sum(len(surface.faces) for surface in surfaces)


def _surfaces(network: NetworkLanes, step_m: float) -> Iterator[_LaneSurface]:
    borders = network.sampled_borders(step_m)
    lanes = network.lanes
    for lane, key in enumerate(lanes.key):
        rows = slice(borders.first[lane], borders.first[lane + 1])
        left, right = borders.left_m[rows], borders.right_m[rows]
        if lanes.direction[lane] < 0:
            # Left and right as seen along s, whatever the direction of travel.
            left, right = right, left
        vertices = np.stack([left, right], axis=1).reshape(-1, 3)
        at = 2 * np.arange(len(left) - 1)
        faces = np.concatenate(
            [np.stack([at + 1, at + 3, at + 2], axis=1), np.stack([at + 1, at + 2, at], axis=1)]
        )
        corners = vertices[faces, :2]
        (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
        name = f"{key.road_id}/{key.section}/{key.lane_id} {lanes.lane_type[lane]!s}"
        yield _LaneSurface(
            name, str(lanes.lane_type[lane]), vertices, faces[ax * by - ay * bx > _LEAST_AREA_M2]
        )


def _obj(surfaces: list[_LaneSurface], lanes: int) -> str:
    lines = [f"# {lanes} lanes, metres, z up"]
    lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for surface in surfaces for x, y, z in surface.vertices.tolist()]
    first = 1
    for surface in surfaces:
        if len(surface.faces):
            lines.append("g " + surface.name.replace("\n", " ").replace("\r", " "))
            lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + first).tolist()]
        first += len(surface.vertices)
    return "\n".join(lines) + "\n"


def _gltf(surfaces: list[_LaneSurface]) -> tuple[dict[str, Any], bytes]:
    """Return the description of the scene, and the data that it refers to."""
    shown = [surface for surface in surfaces if len(surface.faces)]
    middle_m = np.zeros(3)
    if shown:
        every = np.concatenate([surface.vertices for surface in shown])
        middle_m = np.round(0.5 * (every.min(axis=0) + every.max(axis=0)))
    types = sorted({surface.lane_type for surface in shown})
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []
    parts: list[bytes] = []
    length = 0

    def add(data: bytes, target: int, accessor: dict[str, Any]) -> int:
        nonlocal length
        views.append({"buffer": 0, "byteOffset": length, "byteLength": len(data), "target": target})
        accessors.append({"bufferView": len(views) - 1, **accessor})
        parts.append(data)
        length += len(data)
        return len(accessors) - 1

    meshes = []
    for surface in shown:
        used, faces = np.unique(surface.faces, return_inverse=True)
        x, y, z = (surface.vertices[used] - middle_m).T
        points = np.stack([x, z, -y], axis=1).astype("<f4")
        position = add(
            points.tobytes(),
            _ARRAY_BUFFER,
            {
                "componentType": _FLOAT,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
        )
        corners = faces.astype("<u4").ravel()
        indices = add(
            corners.tobytes(),
            _ELEMENT_ARRAY_BUFFER,
            {"componentType": _UNSIGNED_INT, "count": len(corners), "type": "SCALAR"},
        )
        primitive = {
            "attributes": {"POSITION": position},
            "indices": indices,
            "material": types.index(surface.lane_type),
        }
        meshes.append({"name": surface.name, "primitives": [primitive]})
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "smartmot"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
    }
    moved = {"name": "map", "translation": [middle_m[0], middle_m[2], -middle_m[1]]}
    if shown:
        content["nodes"] = [
            {**moved, "children": list(range(1, len(meshes) + 1))},
            *({"name": mesh["name"], "mesh": k} for k, mesh in enumerate(meshes)),
        ]
        content["meshes"] = meshes
        content["materials"] = [
            {
                "name": kind,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*_COLORS.get(kind, _OTHER_COLOR), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 1.0,
                },
            }
            for kind in types
        ]
        content["accessors"], content["bufferViews"] = accessors, views
        content["buffers"] = [{"byteLength": length}]
    else:
        content["nodes"] = [moved]
    return content, b"".join(parts)


def _embedded(content: dict[str, Any], data: bytes) -> bytes:
    if data:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode("ascii")
        content["buffers"][0]["uri"] = uri
    return json.dumps(content, allow_nan=False).encode("utf-8")


def _binary(content: dict[str, Any], data: bytes) -> bytes:
    text = json.dumps(content, allow_nan=False).encode("utf-8")
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON_CHUNK) + text
    if data:
        chunks += struct.pack("<II", len(data), _BINARY_CHUNK) + data
    return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(chunks)) + chunks
