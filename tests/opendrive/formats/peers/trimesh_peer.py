"""What the library trimesh makes of a mesh: python trimesh_peer.py MESH OUT.json."""

import json
import sys
from pathlib import Path

import trimesh

path, out = sys.argv[1:]
scene = trimesh.load(path, force="scene")
meshes = {}
for name in scene.graph.nodes_geometry:
    transform, geometry = scene.graph[name]
    mesh = scene.geometry[geometry].copy()
    mesh.apply_transform(transform)
    meshes[geometry] = {
        "area": float(mesh.area),
        "bounds": mesh.bounds.tolist(),
        "faces": len(mesh.faces),
        "material": getattr(getattr(mesh.visual, "material", None), "name", None),
        "vertices": mesh.vertices.tolist(),
    }
Path(out).write_text(json.dumps(meshes))
