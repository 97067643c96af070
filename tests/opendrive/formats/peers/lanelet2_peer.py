"""What the library lanelet2 makes of a map: python lanelet2_peer.py MAP.osm OUT.json [LATITUDE LONGITUDE].

With latitude and longitude points are given as those again, without as metres about 49 N, 9 E.
"""

import json
import sys
from pathlib import Path

import lanelet2
from lanelet2.core import BasicPoint3d
from lanelet2.projection import UtmProjector

path, out, *place = sys.argv[1:]
origin = lanelet2.io.Origin(*map(float, place)) if place else lanelet2.io.Origin(49.0, 9.0)
projector = UtmProjector(origin)
lanelet_map, errors = lanelet2.io.loadRobust(path, projector)
rules = {
    name: lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, participant)
    for name, participant in (
        ("vehicle", lanelet2.traffic_rules.Participants.Vehicle),
        ("bicycle", lanelet2.traffic_rules.Participants.Bicycle),
        ("pedestrian", lanelet2.traffic_rules.Participants.Pedestrian),
    )
}
graphs = {name: lanelet2.routing.RoutingGraph(lanelet_map, rule) for name, rule in rules.items()}


def points(line):
    if not place:
        return [[p.x, p.y, p.z] for p in line]
    back = [(projector.reverse(BasicPoint3d(p.x, p.y, p.z)), p.z) for p in line]
    return [[gps.lat, gps.lon, z] for gps, z in back]


lanelets = []
for item in lanelet_map.laneletLayer:
    passable = [name for name, rule in rules.items() if rule.canPass(item)]
    limit = rules[passable[0]].speedLimit(item).speedLimit if passable else None
    graph = graphs["vehicle"]
    entry = {
        "id": item.id,
        "tags": dict(item.attributes.items()),
        "left": points(item.leftBound),
        "right": points(item.rightBound),
        "ends": [item.leftBound[0].id, item.rightBound[0].id, item.leftBound[-1].id, item.rightBound[-1].id],
        "borders": [item.leftBound.id, item.rightBound.id],
        "following": {name: [o.id for o in graphs[name].following(item)] for name in passable},
        "users": passable,
        "one_way": rules[passable[0]].isOneWay(item) if passable else None,
        "speed_mps": limit,
        "left_change": getattr(graph.left(item), "id", None),
        "right_change": getattr(graph.right(item), "id", None),
        "adjacent_left": getattr(graph.adjacentLeft(item), "id", None),
        "adjacent_right": getattr(graph.adjacentRight(item), "id", None),
        "lights": [len(light.trafficLights) for light in item.trafficLights()],
        "signs": [sign.type() for sign in item.trafficSigns()],
    }
    lanelets.append(entry)
Path(out).write_text(json.dumps({"errors": list(errors), "lanelets": lanelets}))
