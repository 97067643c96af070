"""What SUMO's library sumolib makes of a network: python sumo_peer.py NET.net.xml OUT.json."""

import json
import sys
from pathlib import Path

import sumo

sys.path.append(str(Path(sumo.SUMO_HOME) / "tools"))
import sumolib

path, out = sys.argv[1:]
net = sumolib.net.readNet(path)
lanes = [
    {
        "edge": edge.getID(),
        "index": lane.getIndex(),
        "name": lane.getParam("opendrive"),
        "shape": [list(point) for point in lane.getShape3D()],
        "speed_mps": lane.getSpeed(),
        "width_m": lane.getWidth(),
        "users": [user for user in ("passenger", "bicycle", "pedestrian", "bus") if lane.allows(user)],
        "outgoing": [[c.getToLane().getEdge().getID(), c.getToLane().getIndex()] for c in lane.getOutgoing()],
    }
    for edge in net.getEdges()
    for lane in edge.getLanes()
]
content = {
    "lanes": lanes,
    "offset": list(net.getLocationOffset()),
    "projection": net._location["projParameter"],
    "lights": sorted(node.getID() for node in net.getNodes() if node.getType().startswith("traffic_light")),
}
Path(out).write_text(json.dumps(content))
