"""SUMO networks: the plain XML by its specification, and what netconvert and sumolib make of it."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree

from opendrive import OpenDriveError, RoadNetwork, load_map
from opendrive.formats import sumo
from opendrive.formats.slices import slices_of
from opendrive.formats.sumo_plain import PlainNetwork, plain_network
from scenarios.catalogue.maps import shipped_map
from tests.opendrive.formats.conftest import PEERS

PEER = Path(__file__).parent / "peers" / "sumo_peer.py"
USERS = {"driving": "passenger", "bidirectional": "passenger", "biking": "bicycle", "sidewalk": "pedestrian"}
LEAST_EDGE_M = 1.0
NEAR_NODE_M = 2.5
"""netconvert cuts lanes by at most this where two roads overlap at a node."""


def points(text: str) -> np.ndarray:
    return np.array([[float(value) for value in point.split(",")] for point in text.split()])


def read_plain(plain: PlainNetwork) -> dict:
    """Plain XML as `peers/sumo_peer.py` gives a network."""
    lanes = []
    outgoing: dict[tuple[str, int], list[list]] = {}
    for connection in etree.fromstring(plain.connections):
        if connection.get("to") is not None:
            start = (connection.get("from"), int(connection.get("fromLane")))
            outgoing.setdefault(start, []).append([connection.get("to"), int(connection.get("toLane"))])
    nodes = {node.get("id"): node for node in etree.fromstring(plain.nodes)}
    for edge in etree.fromstring(plain.edges):
        assert edge.get("from") in nodes
        assert edge.get("to") in nodes
        assert [int(lane.get("index")) for lane in edge] == list(range(int(edge.get("numLanes"))))
        for lane in edge:
            allowed = lane.get("allow", "").split()
            banned = lane.get("disallow", "").split()
            lanes.append(
                {
                    "edge": edge.get("id"),
                    "index": int(lane.get("index")),
                    "name": lane.find("param").get("value"),
                    "shape": points(lane.get("shape")).tolist(),
                    "speed_mps": float(lane.get("speed")),
                    "width_m": float(lane.get("width")),
                    "users": [
                        user
                        for user in ("passenger", "bicycle", "pedestrian", "bus")
                        if user in allowed or (not allowed and user not in banned)
                    ],
                    "outgoing": sorted(outgoing.get((edge.get("id"), int(lane.get("index"))), [])),
                }
            )
    lights = sorted(name for name, node in nodes.items() if node.get("type") == "traffic_light")
    return {"lanes": lanes, "lights": lights}


def lane_of(network: RoadNetwork, name: str) -> int:
    road_id, section, lane_id = name.rsplit("/", 2)
    return network.lane_index_of((road_id, int(section), int(lane_id)))


def s_at(network: RoadNetwork, lane: int, point: np.ndarray) -> float:
    """The s at which the middle of a lane is nearest to a point."""
    s_m = np.linspace(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane], 500)
    for _ in range(5):
        x, y, _, _ = network.center_line(lane, s_m)
        k = int(np.argmin(np.hypot(x - point[0], y - point[1])))
        s_m = np.linspace(s_m[max(k - 1, 0)], s_m[min(k + 1, len(s_m) - 1)], 9)
    return float(s_m[4])


def assert_lanes(network: RoadNetwork, content: dict, within_m: float, cut_m: float) -> None:
    """Lanes lie on the middles of the network's, in travel direction, and all of those are there."""
    covered: dict[int, float] = {}
    for entry in content["lanes"]:
        lane = lane_of(network, entry["name"])
        shape = np.array(entry["shape"])
        ends = [s_at(network, lane, shape[k]) for k in (0, -1)]
        way = int(network.lanes.direction[lane])
        whole = s_range(network, lane)[::way]
        if (ends[1] - ends[0]) * way <= 0.0:
            # A road that ends where it begins has two places there.
            at_joint = [min(abs(end - limit) for limit in whole) < 0.5 for end in ends]
            ends = [limit if joint else end for limit, end, joint in zip(whole, ends, at_joint, strict=True)]
        assert (ends[1] - ends[0]) * way > 0.0, entry["name"]
        low, high = sorted(ends)
        covered[lane] = covered.get(lane, 0.0) + high - low
        # With the knots: a kink of the middle lies between no two points.
        knots = network.lane_knots(lane)
        s_m = np.union1d(
            np.linspace(low, high, max(int((high - low) / 0.1), 2)),
            knots[(knots > low) & (knots < high)],
        )
        x, y, _, _ = network.center_line(lane, s_m)
        true = shapely.LineString(np.stack([x, y], axis=1))
        read = shapely.LineString(shape[:, :2])
        assert shapely.distance(true, shapely.points(shape[:, :2])).max() < within_m, entry["name"]
        assert shapely.distance(read, shapely.points(np.stack([x, y], axis=1))).max() < within_m, entry[
            "name"
        ]
        limit = network.speed_limit(lane, 0.5 * (low + high))
        assert entry["speed_mps"] == pytest.approx(50 / 3.6 if limit is None else limit, abs=0.01)
        kind = USERS.get(str(network.lanes.lane_type[lane]))
        assert kind is None or kind in entry["users"]
        assert (kind != "pedestrian") or entry["users"] == ["pedestrian"]
        assert entry["width_m"] == pytest.approx(network.lane_width(lane, s_m).mean(), rel=0.05, abs=0.05)
    # Shorter pieces are connections, and there may be several one after the other.
    short_m = np.zeros(len(network.lanes))
    for piece in slices_of(network, Counter()):
        if piece.end_m - piece.start_m < LEAST_EDGE_M:
            short_m[piece.lanes] += piece.end_m - piece.start_m
    for lane, kind in enumerate(network.lanes.lane_type.tolist()):
        length = network.lanes.s_end_m[lane] - network.lanes.s_start_m[lane]
        wide = np.mean(network.lane_width(lane, np.linspace(*s_range(network, lane), 200)) > 1e-3)
        if kind in USERS and network.lanes.junction_id[lane] is None and length * wide > 3 * LEAST_EDGE_M:
            least_m = length * wide - 2 * (cut_m + LEAST_EDGE_M) - short_m[lane]
            assert covered.get(lane, 0.0) > least_m, network.lanes.key[lane]


def s_range(network: RoadNetwork, lane: int) -> tuple[float, float]:
    return float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])


def reached(network: RoadNetwork, lane: int, present: set[int]) -> set[int]:
    """Lanes of edges that a lane leads to, through lanes that are no edges."""
    stack, seen, ends = list(network.successors(lane)), set(), set()
    while stack:
        following = stack.pop()
        if following in present:
            ends.add(following)
        elif following not in seen and str(network.lanes.lane_type[following]) in USERS:
            seen.add(following)
            stack += network.successors(following)
    return ends


def assert_connections(network: RoadNetwork, content: dict) -> None:
    """Lanes are connected as those of the network are, through its junctions."""
    by_id = {(entry["edge"], entry["index"]): lane_of(network, entry["name"]) for entry in content["lanes"]}
    present = set(by_id.values())
    read: dict[int, set[int]] = {lane: set() for lane in present}
    for entry in content["lanes"]:
        lane = lane_of(network, entry["name"])
        read[lane] |= {by_id[edge, index] for edge, index in entry["outgoing"]} - {lane}
    for lane in present:
        assert read[lane] == reached(network, lane, present) - {lane}, network.lanes.key[lane]


def test_plain_xml_has_the_lanes_and_connections_of_the_map(map_file):
    network = load_map(map_file)
    plain = plain_network(network)
    content = read_plain(plain)
    assert content["lanes"]
    assert_lanes(network, content, 0.005, 0.0)
    assert_connections(network, content)
    assert plain.is_left_hand == (map_file.stem.startswith("left_hand") or map_file.stem.endswith("-lht"))
    if map_file.stem == "urban_intersection":
        assert content["lights"] == ["junction_100"]


def test_without_netconvert_the_extra_is_named(monkeypatch, load, text, tmp_path):
    monkeypatch.setattr(sumo, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OpenDriveError, match=r"pip install 'smartmot\[sumo\]'"):
        sumo.write_sumo(load(text.road()), tmp_path / "map.net.xml")


def test_a_map_without_traffic_is_refused(monkeypatch, load, text, tmp_path):
    monkeypatch.setattr(sumo, "find_netconvert", lambda: tmp_path / "netconvert")
    lanes = text.section(right=text.lane(-1, text.record("width", 3.0), "shoulder"))
    with pytest.raises(OpenDriveError, match="no lane with traffic"):
        sumo.write_sumo(load(text.road(sections=lanes)), tmp_path / "map.net.xml")


def test_what_netconvert_refuses_is_said(monkeypatch, load, text, tmp_path):
    refuses = tmp_path / "netconvert"
    refuses.write_text("#!/bin/sh\necho 'Error: no edges.' >&2\nexit 1\n")
    refuses.chmod(0o755)
    monkeypatch.setattr(sumo, "find_netconvert", lambda: refuses)
    with pytest.raises(OpenDriveError, match=r"^netconvert: Error: no edges\.$"):
        sumo.write_sumo(load(text.road()), tmp_path / "map.net.xml")
    assert not (tmp_path / "map.net.xml").exists()


@pytest.mark.parametrize("peer", ["sumo"], indirect=True)
def test_netconvert_and_sumolib_make_the_same_of_it(map_file, peer, monkeypatch, tmp_path):
    assert PEERS is not None
    network = load_map(map_file)
    monkeypatch.setattr(sumo, "find_netconvert", lambda: peer.parent / "netconvert")
    path = tmp_path / "map.net.xml"
    sumo.write_sumo(network, path)
    out = tmp_path / "read.json"
    done = subprocess.run([peer, PEER, path, out], capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr[-2000:]
    read = json.loads(out.read_text(encoding="utf-8"))
    plain = read_plain(plain_network(network))
    own = {(entry["edge"], entry["index"]): entry for entry in plain["lanes"]}
    assert {(entry["edge"], entry["index"]) for entry in read["lanes"]} == own.keys()
    for entry in read["lanes"]:
        assert sorted(entry["outgoing"]) == own[entry["edge"], entry["index"]]["outgoing"]
        assert entry["users"] == own[entry["edge"], entry["index"]]["users"]
    assert read["lights"] == plain["lights"]
    assert_lanes(network, read, 0.1, NEAR_NODE_M)
    assert_connections(network, read)
    header = network.model.header
    assert (read["projection"] != "!") == bool(header.geo_reference.strip())


def test_a_netconvert_that_does_not_end_is_one_line(tmp_path, monkeypatch):
    def never(arguments, **options):
        raise subprocess.TimeoutExpired(arguments, options["timeout"])

    monkeypatch.setattr(sumo, "find_netconvert", lambda: Path("netconvert"))
    monkeypatch.setattr(sumo.subprocess, "run", never)
    network = load_map(shipped_map("urban_street"))
    with pytest.raises(OpenDriveError, match="netconvert: not ready after 600 s"):
        sumo.write_sumo(network, tmp_path / "m.net.xml")
