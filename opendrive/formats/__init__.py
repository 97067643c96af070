"""Road networks in the formats of other tools; `EXPORTS` names them."""

from collections.abc import Callable, Mapping
from pathlib import Path

from opendrive.formats.commonroad import write_commonroad
from opendrive.formats.contents import Export
from opendrive.formats.lanelet2 import write_lanelet2
from opendrive.formats.mesh import write_mesh
from opendrive.formats.sumo import write_sumo
from opendrive.network import RoadNetwork

__all__ = ["EXPORTS", "Export", "write_commonroad", "write_lanelet2", "write_mesh", "write_sumo"]


def _mesh(network: RoadNetwork, path: Path) -> Export:
    return Export({"lanes": len(network.lanes), "triangles": write_mesh(network, path)})


EXPORTS: Mapping[str, tuple[tuple[str, ...], Callable[[RoadNetwork, Path], Export]]] = {
    "commonroad": ((".xml",), write_commonroad),
    "lanelet2": ((".osm",), write_lanelet2),
    "sumo": ((".xml",), write_sumo),
    "gltf": ((".glb", ".gltf"), _mesh),
    "obj": ((".obj",), _mesh),
}
"""Endings of the files, and what writes them, by format."""
