"""Values of libcarla for maps of this project, by a program that is none of ours.

    pip install carla==0.9.16
    python tests/data/opendrive/make_values.py

Writes NAME.json.gz for each map. Right-handed frame, as in the file: libcarla's y and yaw are negated here.
Kept apart from the tests: the library weighs 60 MB and comes for few versions of Python.
"""

import gzip
import hashlib
import json
import math
import random
import sys
from pathlib import Path
from xml.etree import ElementTree

import carla

HERE = Path(__file__).parent
PACKAGE = HERE.parents[2] / "scenarios"
MAPS = [
    *sorted(HERE.glob("*.xodr")),
    *sorted((PACKAGE / "maps").glob("*.xodr")),
    *sorted((PACKAGE / "scenes" / "maps").glob("*.xodr")),
]
PLACES_PER_LANE = 3
AHEAD_M = 5.0


def pose(waypoint):
    place, turn = waypoint.transform.location, waypoint.transform.rotation
    return [round(place.x, 5), round(-place.y, 5), round(place.z, 5), round(math.radians(-turn.yaw), 6)]


def key(waypoint):
    return [waypoint.road_id, waypoint.lane_id]


def mark(marking):
    return None if marking is None else [str(marking.type), str(marking.lane_change)]


def values(path):
    text = path.read_text(encoding="utf-8")
    world, numbers = carla.Map(path.stem, text), random.Random(1)
    lanes, neighbours = [], []
    for road in ElementTree.fromstring(text).iter("road"):
        sections = road.findall("lanes/laneSection")
        ends = [float(s.get("s")) for s in sections[1:]] + [float(road.get("length"))]
        for index, (section, end) in enumerate(zip(sections, ends, strict=True)):
            start = float(section.get("s"))
            for lane in section.iter("lane"):
                number = int(lane.get("id"))
                if not number:
                    continue
                for _ in range(PLACES_PER_LANE):
                    s = round(numbers.uniform(start + 0.01 * (end - start), end - 0.01 * (end - start)), 4)
                    there = world.get_waypoint_xodr(int(road.get("id")), number, s)
                    if there is None:
                        raise SystemExit(f"{path.name}: no lane {number} on road {road.get('id')} at {s}")
                    lanes.append(
                        [
                            int(road.get("id")),
                            index,
                            number,
                            s,
                            *pose(there),
                            round(there.lane_width, 6),
                            lane.get("type"),
                        ]
                    )
                    if lane.get("type") != "driving":
                        continue
                    left, right = there.get_left_lane(), there.get_right_lane()
                    neighbours.append(
                        [int(road.get("id")), number, s]
                        + [
                            [[*key(w), round(w.s, 4)] for w in walk(AHEAD_M)]
                            for walk in (there.next, there.previous)
                        ]
                        + [None if w is None else key(w) for w in (left, right)]
                        + [
                            str(there.lane_change),
                            mark(there.left_lane_marking),
                            mark(there.right_lane_marking),
                        ]
                    )
    edges = sorted(
        [w.road_id, round(w.s, 4), w.lane_id, v.road_id, round(v.s, 4), v.lane_id]
        for w, v in world.get_topology()
    )
    return {
        "map": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "source": "libcarla 0.9.16 (PyPI: carla), computed offline by make_values.py",
        "lanes_columns": [
            "road",
            "section",
            "lane",
            "s_m",
            "x_m",
            "y_m",
            "z_m",
            "travel_yaw_rad",
            "width_m",
            "type",
        ],
        "lanes": lanes,
        "neighbours_columns": [
            "road",
            "lane",
            "s_m",
            "5 m ahead: [road, lane, s_m]",
            "5 m back",
            "left lane",
            "right lane",
            "lane change",
            "left mark",
            "right mark",
        ],
        "neighbours": neighbours,
        "edges_columns": ["road", "s_m", "lane", "road", "s_m", "lane"],
        "edges": edges,
    }


for path in MAPS:
    if len(sys.argv) > 1 and path.stem not in sys.argv[1:]:
        continue
    content = json.dumps(values(path), separators=(",", ":")).encode()
    (HERE / f"{path.stem}.json.gz").write_bytes(gzip.compress(content, mtime=0))
    print(path.stem, len(content))
