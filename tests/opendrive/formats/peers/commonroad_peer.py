"""What the library commonroad-io makes of a map: python commonroad_peer.py MAP.xml OUT.json."""

import json
import logging
import sys
from pathlib import Path

from commonroad.common.file_reader import CommonRoadFileReader

path, out = sys.argv[1:]
messages = []


class Keep(logging.Handler):
    def emit(self, record):
        messages.append(record.getMessage())


logging.getLogger().addHandler(Keep())
scenario, _ = CommonRoadFileReader(path).open()
network = scenario.lanelet_network
signs = {sign.traffic_sign_id: sign for sign in network.traffic_signs}
lanelets = [
    {
        "id": item.lanelet_id,
        "left": item.left_vertices.tolist(),
        "right": item.right_vertices.tolist(),
        "center": item.center_vertices.tolist(),
        "successors": sorted(item.successor),
        "predecessors": sorted(item.predecessor),
        "adjacent_left": item.adj_left,
        "adjacent_right": item.adj_right,
        "left_same": item.adj_left_same_direction,
        "right_same": item.adj_right_same_direction,
        "types": sorted(kind.value for kind in item.lanelet_type),
        "one_way": sorted(user.value for user in item.user_one_way),
        "both_ways": sorted(user.value for user in item.user_bidirectional),
        "left_mark": item.line_marking_left_vertices.value,
        "right_mark": item.line_marking_right_vertices.value,
        "signs": [
            [element.traffic_sign_element_id.value, element.additional_values]
            for number in sorted(item.traffic_signs)
            for element in signs[number].traffic_sign_elements
        ],
        "lights": len(item.traffic_lights),
        "is_valid": bool(item.polygon.shapely_object.is_valid),
    }
    for item in network.lanelets
]
intersections = [
    {
        "incomings": [
            {
                "lanelets": sorted(incoming.incoming_lanelets),
                "right": sorted(incoming.outgoing_right),
                "straight": sorted(incoming.outgoing_straight),
                "left": sorted(incoming.outgoing_left),
            }
            for incoming in item.incomings
        ],
        "crossings": sorted(number for group in item.crossings for number in group.crossing_lanelets),
    }
    for item in network.intersections
]
location = network.location
transformation = None if location is None else location.geo_transformation
content = {
    "lanelets": lanelets,
    "intersections": intersections,
    "messages": messages,
    "geo_reference": None if transformation is None else transformation.geo_reference,
    "translation": None
    if transformation is None
    else [transformation.x_translation, transformation.y_translation, transformation.z_rotation],
}
Path(out).write_text(json.dumps(content))
