"""Readers of exported maps that know the formats, and nothing of this project's writers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from tests.opendrive.formats.comparison import ReadLanelet


def _points(parent: etree._Element) -> np.ndarray:
    return np.array([[float(value.text) for value in point] for point in parent.findall("point")])


def read_commonroad(path: Path) -> dict[str, Any]:
    """A CommonRoad file as plain values, as `peers/commonroad_peer.py` gives them."""
    root = etree.parse(path).getroot()
    assert (root.tag, root.get("commonRoadVersion")) == ("commonRoad", "2020a")
    signs = {
        int(sign.get("id")): [
            [element.findtext("trafficSignID"), [value.text for value in element.findall("additionalValue")]]
            for element in sign.findall("trafficSignElement")
        ]
        for sign in root.findall("trafficSign")
    }
    lights = {int(light.get("id")) for light in root.findall("trafficLight")}
    lanelets = []
    for item in root.findall("lanelet"):
        adjacent = {side: item.find(f"adjacent{side}") for side in ("Left", "Right")}
        entry = {
            "id": int(item.get("id")),
            "left": _points(item.find("leftBound")).tolist(),
            "right": _points(item.find("rightBound")).tolist(),
            "successors": sorted(int(e.get("ref")) for e in item.findall("successor")),
            "predecessors": sorted(int(e.get("ref")) for e in item.findall("predecessor")),
            "types": sorted(e.text for e in item.findall("laneletType")),
            "one_way": sorted(e.text for e in item.findall("userOneWay")),
            "both_ways": sorted(e.text for e in item.findall("userBidirectional")),
            "left_mark": item.findtext("leftBound/lineMarking"),
            "right_mark": item.findtext("rightBound/lineMarking"),
            "signs": [s for e in item.findall("trafficSignRef") for s in signs[int(e.get("ref"))]],
            "lights": sum(int(e.get("ref")) in lights for e in item.findall("trafficLightRef")),
            "name": "".join(c.text.split()[-1] for c in item if isinstance(c, etree._Comment)),
        }
        for side, element in adjacent.items():
            entry[f"adjacent_{side.lower()}"] = None if element is None else int(element.get("ref"))
            same = None if element is None else element.get("drivingDir") == "same"
            entry[f"{side.lower()}_same"] = same
        lanelets.append(entry)

    def refs(parent: etree._Element, tag: str) -> list[int]:
        return sorted(int(element.get("ref")) for element in parent.findall(tag))

    intersections = [
        {
            "incomings": [
                {
                    "lanelets": refs(incoming, "incomingLanelet"),
                    "right": refs(incoming, "successorsRight"),
                    "straight": refs(incoming, "successorsStraight"),
                    "left": refs(incoming, "successorsLeft"),
                }
                for incoming in item.findall("incoming")
            ],
            "crossings": refs(item, "crossing/crossingLanelet"),
        }
        for item in root.findall("intersection")
    ]
    transformation = root.find("location/geoTransformation")
    moved = None if transformation is None else transformation.find("additionalTransformation")
    return {
        "lanelets": lanelets,
        "intersections": intersections,
        "geo_reference": None if transformation is None else transformation.findtext("geoReference"),
        "translation": None
        if moved is None
        else [float(moved.findtext(tag)) for tag in ("xTranslation", "yTranslation", "zRotation")],
        "ids": [int(e.get("id")) for e in root if e.get("id")],
    }


def of_commonroad(content: dict[str, Any]) -> tuple[list[ReadLanelet], list[ReadLanelet]]:
    """Lanelets of lanes, and those of crosswalks."""
    lanes, crossings = [], []
    for entry in content["lanelets"]:
        limits = [float(values[0]) for code, values in entry["signs"] if code == "274"]
        assert len(limits) <= 1
        item = ReadLanelet(
            entry["id"],
            np.array(entry["left"]),
            np.array(entry["right"]),
            set(entry["successors"]),
            entry["adjacent_left"],
            entry["adjacent_right"],
            entry["left_same"],
            entry["right_same"],
            limits[0] if limits else None,
            entry,
        )
        (crossings if entry["types"] == ["crosswalk"] else lanes).append(item)
    return lanes, crossings


def _tags(element: etree._Element) -> dict[str, str]:
    tags = {tag.get("k"): tag.get("v") for tag in element.findall("tag")}
    assert len(tags) == len(element.findall("tag"))
    return tags


def read_lanelet2(path: Path) -> dict[str, Any]:
    """An OSM file of Lanelet2 as plain values; borders in travel direction, by the side they lie on."""
    root = etree.parse(path).getroot()
    nodes = {}
    for node in root.findall("node"):
        tags = _tags(node)
        nodes[int(node.get("id"))] = {
            "geographic": (float(node.get("lat")), float(node.get("lon"))),
            "local": [float(tags[name]) for name in ("local_x", "local_y", "ele")],
        }
    ways = {
        int(way.get("id")): ([int(nd.get("ref")) for nd in way.findall("nd")], _tags(way))
        for way in root.findall("way")
    }
    relations = {
        int(relation.get("id")): (
            [(m.get("type"), m.get("role"), int(m.get("ref"))) for m in relation.findall("member")],
            _tags(relation),
        )
        for relation in root.findall("relation")
    }
    every = [*nodes, *ways, *relations]
    assert len(set(every)) == len(every)
    lanelets = []
    for number, (members, tags) in relations.items():
        if tags["type"] != "lanelet":
            continue
        (left,) = (ref for _, role, ref in members if role == "left")
        (right,) = (ref for _, role, ref in members if role == "right")
        sides = [ways[left][0], ways[right][0]]
        xyz = [np.array([nodes[ref]["local"] for ref in side]) for side in sides]
        # The left border lies left of the direction of travel.
        forth = xyz[0][-1] - xyz[0][0] + xyz[1][-1] - xyz[1][0]
        aside = sum((side.mean(axis=0) * sign for side, sign in zip(xyz, (1, -1), strict=True)), np.zeros(3))
        k = len(xyz[0]) // 2
        if len(xyz[0]) == len(xyz[1]):
            aside = xyz[0][k] - xyz[1][k] + xyz[0][k - 1] - xyz[1][k - 1]
            forth = xyz[0][k] - xyz[0][k - 1] + xyz[1][k] - xyz[1][k - 1]
        reverse = forth[0] * aside[1] - forth[1] * aside[0] < 0
        step = -1 if reverse else 1
        sides = [side[::step] for side in sides]
        regulatory = [relations[ref] for kind, role, ref in members if role == "regulatory_element"]
        lanelets.append(
            {
                "id": number,
                "tags": tags,
                "left": [nodes[ref]["local"] for ref in sides[0]],
                "right": [nodes[ref]["local"] for ref in sides[1]],
                "geographic": [[nodes[ref]["geographic"] for ref in side] for side in sides],
                "ends": [sides[0][0], sides[1][0], sides[0][-1], sides[1][-1]],
                "borders": [left, right],
                "reverse": bool(reverse),
                "left_tags": ways[left][1],
                "right_tags": ways[right][1],
                "lights": sum(r[1]["subtype"] == "traffic_light" for r in regulatory),
                "signs": [
                    ways[ref][1]["subtype"]
                    for parts, t in regulatory
                    if t["subtype"] == "traffic_sign"
                    for _, _, ref in parts
                ],
            }
        )
    return {"lanelets": lanelets}


def of_lanelet2(content: dict[str, Any]) -> tuple[list[ReadLanelet], list[ReadLanelet]]:
    """Lanelets of lanes, and those of crosswalks; shared points and borders make links and neighbours."""
    begins: dict[tuple[int, int], set[int]] = {}
    for entry in content["lanelets"]:
        begins.setdefault(tuple(entry["ends"][:2]), set()).add(entry["id"])
    users: dict[int, list[dict[str, Any]]] = {}
    for entry in content["lanelets"]:
        for border in entry["borders"]:
            users.setdefault(border, []).append(entry)
    lanes, crossings = [], []
    for entry in content["lanelets"]:
        item = ReadLanelet(
            entry["id"],
            np.array(entry["left"]),
            np.array(entry["right"]),
            begins.get(tuple(entry["ends"][2:]), set()),
            more=entry | {"lone": True},
        )
        for side, border in zip(("left", "right"), entry["borders"], strict=True):
            others = [other for other in users[border] if other["id"] != entry["id"]]
            assert len(others) <= 1
            if others:
                setattr(item, f"{side}_neighbour", others[0]["id"])
                # The same line on the other's other side: the same direction.
                same = others[0]["borders"].index(border) != entry["borders"].index(border)
                setattr(item, f"{side}_same", same)
        limit = entry["tags"].get("speed_limit")
        if limit is not None:
            value, unit = limit.split()
            assert unit == "km/h"
            item.speed_mps = float(value) / 3.6
        (crossings if entry["tags"]["subtype"] == "crosswalk" else lanes).append(item)
    return lanes, crossings
