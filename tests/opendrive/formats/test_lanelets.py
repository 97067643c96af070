"""CommonRoad and Lanelet2, read back and compared with the network."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
import shapely

from opendrive import RoadNetwork, load_map
from opendrive.formats import Export, write_commonroad, write_lanelet2
from tests.opendrive.formats import comparison
from tests.opendrive.formats.readers import of_commonroad, of_lanelet2, read_commonroad, read_lanelet2

PEER = Path(__file__).parent / "peers"
ENDING = {"commonroad": "xml", "lanelet2": "osm"}


def written(form: str, network: RoadNetwork, folder: Path) -> tuple[Path, Export, dict]:
    """A map in a format, and what our reader makes of it."""
    path = folder / f"map.{ENDING[form]}"
    if form == "commonroad":
        return path, write_commonroad(network, path), read_commonroad(path)
    return path, write_lanelet2(network, path), read_lanelet2(path)


def names(content: dict) -> dict[int, str]:
    return {
        entry["id"]: entry["name"] if "name" in entry else entry["tags"]["opendrive"]
        for entry in content["lanelets"]
    }


def assert_links(network: RoadNetwork, lanes: list, export: Export) -> None:
    """Links are those of the network but for those that the export named."""
    expected = comparison.expected_links(network, {item.lane for item in lanes})
    read = comparison.read_links(network, lanes)
    missing = sum(count for what, count in export.left_out.items() if what.startswith("links of lanes"))
    implied = sum(int(note.split()[0]) for note in export.notes if "links more" in note)
    assert len(expected - read) <= missing, [network.lanes.key[a] for a, _ in expected - read]
    assert len(read - expected) <= implied, [network.lanes.key[a] for a, _ in read - expected]


def assert_crossings(network: RoadNetwork, crossings: list) -> None:
    """Crosswalks have the outline of the map's."""
    assert len(crossings) == len(network.crosswalks)
    for item, crosswalk in zip(crossings, network.crosswalks, strict=True):
        ring = np.concatenate([item.right[:, :2], item.left[::-1, :2]])
        outline, read_outline = shapely.Polygon(crosswalk.polygon), shapely.Polygon(ring)
        assert outline.symmetric_difference(read_outline).area < 0.001 * outline.length


def assert_same(network: RoadNetwork, form: str, content: dict, export: Export) -> list:
    lanes, crossings = of_commonroad(content) if form == "commonroad" else of_lanelet2(content)
    comparison.place(network, lanes, names(content))
    comparison.assert_geometry(network, lanes)
    comparison.assert_speeds(network, lanes)
    comparison.assert_neighbours(network, lanes)
    comparison.assert_chains(network, lanes)
    assert_links(network, lanes, export)
    assert_crossings(network, crossings)
    return lanes


@pytest.mark.parametrize("form", ENDING)
def test_a_map_is_the_same_when_read_back(map_file, form, tmp_path):
    network = load_map(map_file)
    _, export, content = written(form, network, tmp_path)
    assert_same(network, form, content, export)


@pytest.mark.parametrize("peer", ["commonroad"], indirect=True)
def test_commonroad_io_reads_the_same(map_file, peer, tmp_path):
    network = load_map(map_file)
    path, export, content = written("commonroad", network, tmp_path)
    read = run_peer(peer, "commonroad_peer.py", path)
    assert [text for text in read["messages"] if "format" not in text] == []
    folded = sum(int(note.split()[0]) for note in export.notes if "cross themselves" in note)
    assert sum(not entry["is_valid"] for entry in read["lanelets"]) <= folded
    lane_names = names(content)
    for entry in read["lanelets"]:
        entry["name"] = lane_names[entry["id"]]
    for own, entry in zip(content["lanelets"], read["lanelets"], strict=True):
        for name in ("types", "one_way", "both_ways", "left_mark", "right_mark", "lights", "predecessors"):
            assert own[name] == entry[name]
        assert sorted(code for code, _ in own["signs"]) == sorted(code for code, _ in entry["signs"])
    assert read["intersections"] == content["intersections"]
    assert read["geo_reference"] == content["geo_reference"]
    assert_same(network, "commonroad", read, export)


@pytest.mark.parametrize("peer", ["lanelet2"], indirect=True)
def test_lanelet2_reads_the_same(map_file, peer, tmp_path):
    network = load_map(map_file)
    path, export, content = written("lanelet2", network, tmp_path)
    is_placed = bool(network.model.header.geo_reference.strip())
    place = [repr(value) for value in content["lanelets"][0]["geographic"][0][0]] if is_placed else []
    read = run_peer(peer, "lanelet2_peer.py", path, *place)
    assert read["errors"] == []
    for entry in read["lanelets"]:
        for side in ("left", "right"):
            points = np.array(entry[side])
            if is_placed:
                points[:, :2] = network.from_geographic(points[:, 0], points[:, 1])
            entry[side] = points
    own = {entry["id"]: entry for entry in content["lanelets"]}
    following = {entry["id"]: set(entry["following"].get("vehicle", ())) for entry in read["lanelets"]}
    begins: dict[tuple, set[int]] = {}
    for entry in read["lanelets"]:
        begins.setdefault(tuple(entry["ends"][:2]), set()).add(entry["id"])
    passable = {entry["id"] for entry in read["lanelets"] if "vehicle" in entry["users"]}
    for entry in read["lanelets"]:
        assert entry["borders"] == own[entry["id"]]["borders"]
        assert entry["tags"] == own[entry["id"]]["tags"]
        assert (len(entry["lights"]), len(entry["signs"])) == (
            own[entry["id"]]["lights"],
            len(own[entry["id"]]["signs"]),
        )
        if entry["id"] in passable and entry["one_way"]:
            # The library's routing goes where our reader says that ends are shared.
            assert following[entry["id"]] <= begins.get(tuple(entry["ends"][2:]), set())
            one_way = {
                i
                for i in begins.get(tuple(entry["ends"][2:]), set()) & passable
                if own[i]["tags"]["one_way"] == "yes"
            }
            assert one_way <= following[entry["id"]]
        if entry["users"] and "speed_limit" in entry["tags"]:
            assert entry["speed_mps"] == pytest.approx(
                float(entry["tags"]["speed_limit"].split()[0]), abs=1e-3
            )
    lanes = assert_same(network, "lanelet2", read, export)
    by_id = {item.id: item for item in lanes}
    middle = {item.id: 0.5 * sum(item.s_m) for item in lanes}
    for entry in read["lanelets"]:
        if entry["id"] not in by_id:
            continue
        for side in ("left", "right"):
            number = entry[f"{side}_change"]
            if number is not None:
                item = by_id[entry["id"]]
                assert network.lane_change(item.lane, middle[item.id], side)


def run_peer(python: Path, script: str, path: Path, *more: str) -> dict:
    out = path.with_suffix(".json")
    done = subprocess.run(
        [python, PEER / script, path, out, *more], capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(out.read_text(encoding="utf-8"))
