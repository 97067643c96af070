"""glTF: read by its specification, and by trimesh."""

from __future__ import annotations

import base64
import json
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
import shapely

from opendrive import OpenDriveError, load_map, write_mesh
from tests.opendrive.formats.conftest import OWN_MAPS

PEER = Path(__file__).parent / "peers" / "trimesh_peer.py"


def read_gltf(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray, str]]:
    """Vertices in the map frame, faces and material of each mesh."""
    data = path.read_bytes()
    if path.suffix == ".glb":
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        content = json.loads(data[20 : 20 + size])
        binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0"
        buffer = data[28 + size : 28 + size + binary_size]
    else:
        content = json.loads(data)
        buffer = base64.b64decode(content["buffers"][0]["uri"].split(",", 1)[1])
    assert content["buffers"][0]["byteLength"] == len(buffer)

    def array(number: int, kind: str, width: int) -> np.ndarray:
        accessor = content["accessors"][number]
        view = content["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        values = np.frombuffer(buffer, kind, accessor["count"] * width, view["byteOffset"])
        return values.reshape(-1, width) if width > 1 else values

    (root,) = content["scenes"][content["scene"]]["nodes"]
    moved = np.array(content["nodes"][root]["translation"])
    meshes = {}
    for child in content["nodes"][root]["children"]:
        mesh = content["meshes"][content["nodes"][child]["mesh"]]
        (primitive,) = mesh["primitives"]
        points = array(primitive["attributes"]["POSITION"], "<f4", 3)
        accessor = content["accessors"][primitive["attributes"]["POSITION"]]
        assert points.min(axis=0).tolist() == accessor["min"]
        assert points.max(axis=0).tolist() == accessor["max"]
        faces = array(primitive["indices"], "<u4", 1).reshape(-1, 3)
        x, y, z = (points + moved).T
        material = content["materials"][primitive["material"]]["name"]
        meshes[mesh["name"]] = np.stack([x, -z, y], axis=1), faces, material
    return meshes


def areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Signed areas of triangles in plan."""
    a, b, c = (vertices[faces[:, k], :2] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return 0.5 * (ux * vy - uy * vx)


@pytest.mark.parametrize("ending", ["glb", "gltf"])
@pytest.mark.parametrize("file", [file for file in OWN_MAPS if file.stem != "opening_lane_polygon"], ids=str)
def test_gltf_holds_the_surface_of_every_lane(file, ending, tmp_path):
    network = load_map(file)
    path = tmp_path / f"map.{ending}"
    count = write_mesh(network, path)
    meshes = read_gltf(path)
    assert sum(len(faces) for _, faces, _ in meshes.values()) == count > 0
    assert len(meshes) == len(network.lanes)
    for polygon, key, lane_type in zip(
        network.lane_polygons(0.002), network.lanes.key, network.lanes.lane_type, strict=True
    ):
        vertices, faces, material = meshes[f"{key.road_id}/{key.section}/{key.lane_id} {lane_type}"]
        assert material == lane_type
        assert areas(vertices, faces).min() > 0.0
        off = shapely.distance(polygon.boundary, shapely.points(vertices[:, :2]))
        assert off.max() < 0.003
        # Chords over at most 1 m; the tightest border here has a radius of over 6 m.
        assert areas(vertices, faces).sum() == pytest.approx(polygon.area, rel=0.01)
    heights = np.concatenate([vertices[:, 2] for vertices, _, _ in meshes.values()])
    expected = network.sampled_borders().left_m[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx((expected.min(), expected.max()), abs=1e-3)


@pytest.mark.parametrize("peer", ["trimesh"], indirect=True)
@pytest.mark.parametrize("ending", ["glb", "gltf", "obj"])
def test_trimesh_reads_the_same(map_file, ending, peer, tmp_path):
    network = load_map(map_file)
    path = tmp_path / f"map.{ending}"
    write_mesh(network, path)
    out = tmp_path / "read.json"
    done = subprocess.run([peer, PEER, path, out], capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr[-2000:]
    read = json.loads(out.read_text(encoding="utf-8"))
    assert read
    if ending == "obj":
        if map_file.stem == "opening_lane_polygon":
            return  # its bounds are those of a lane without width, too
        bounds = np.array([mesh["bounds"] for mesh in read.values()])
        x_min, y_min, x_max, y_max = network.bounds
        assert bounds[:, 0].min(axis=0)[:2] == pytest.approx([x_min, y_min], abs=0.05)
        assert bounds[:, 1].max(axis=0)[:2] == pytest.approx([x_max, y_max], abs=0.05)
        return
    own = read_gltf(path)
    assert read.keys() == own.keys()
    for name, mesh in read.items():
        x, y, z = np.array(mesh["vertices"]).T
        vertices = np.stack([x, -z, y], axis=1)
        assert vertices.min(axis=0) == pytest.approx(own[name][0].min(axis=0), abs=2e-3)
        assert vertices.max(axis=0) == pytest.approx(own[name][0].max(axis=0), abs=2e-3)
        assert mesh["material"] == own[name][2]


def test_a_map_far_from_its_origin_keeps_its_millimetres(load, text, tmp_path):
    far = '<geometry s="0" x="691000.125" y="5334000.25" hdg="0" length="100"><line/></geometry>'
    network = load(text.road(plan=far))
    write_mesh(network, tmp_path / "far.glb")
    vertices, _, _ = read_gltf(tmp_path / "far.glb")["r/0/-1 driving"]
    assert vertices.min(axis=0) == pytest.approx([691000.125, 5334000.25 - 3.5, 0.0], abs=1e-4)
    assert vertices.max(axis=0) == pytest.approx([691100.125, 5334000.25, 0.0], abs=1e-4)


def test_an_unknown_ending_is_refused(load, text, tmp_path):
    with pytest.raises(OpenDriveError, match="ends in none of"):
        write_mesh(load(text.road()), tmp_path / "map.stl")
