"""CommonRoad and Lanelet2, read back and compared with the network."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pyproj
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
    rings = [np.concatenate([item.right[:, :2], item.left[::-1, :2]]) for item in crossings]
    outlines = [shapely.Polygon(ring) for ring in rings]
    for crosswalk in network.crosswalks:
        true = shapely.Polygon(crosswalk.polygon)
        # Readers keep no order.
        assert min(true.symmetric_difference(other).area for other in outlines) < 0.001 * true.length


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
    # The library sees by one point of each border on which side it lies, and turns it if it has to; where a
    # border runs back in a bend that is tighter than the lane, it is wrong.
    turned = {entry["id"] for entry in read["lanelets"] if entry["ends"] != own[entry["id"]]["ends"]}
    noted = ", ".join(note for note in export.notes if "runs back" in note)
    for entry in read["lanelets"]:
        if entry["id"] in turned:
            left, right = (
                np.diff(np.array(own[entry["id"]][side])[:, :2], axis=0) for side in ("left", "right")
            )
            assert ((left * right).sum(axis=1) < 0.0).any()
            assert entry["tags"]["opendrive"] in noted
            for k, side in enumerate(("left", "right")):
                if entry["ends"][k] != own[entry["id"]]["ends"][k]:
                    entry[side] = entry[side][::-1]
            entry["ends"] = own[entry["id"]]["ends"]
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
            assert entry["id"] in turned or one_way - turned <= following[entry["id"]]
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


PLACED = (
    "<OpenDRIVE><header revMajor='1' revMinor='6'><geoReference>+proj=utm +zone=32 +datum=WGS84"
    "</geoReference><offset x='500000' y='5400000' z='0' hdg='0.5'/></header>{}</OpenDRIVE>"
)


def test_places_on_earth_are_those_of_the_map(load, text, tmp_path):
    """The header's offset turns and moves the map frame before it is projected."""
    network = load(PLACED.format(text.road()), whole=True)
    _, _, content = written("lanelet2", network, tmp_path)
    for entry in content["lanelets"]:
        for side, geographic in zip(("left", "right"), entry["geographic"], strict=True):
            latitude, longitude = np.array(geographic).T
            xy_m = network.from_geographic(latitude, longitude)
            assert xy_m == pytest.approx(np.array(entry[side])[:, :2], abs=1e-3)
    # The first point of the road by hand: (10, 5) m turned by 0.5 rad, 500 km and 5,400 km added.
    east, north = 500000 + 10 * np.cos(0.5) - 5 * np.sin(0.5), 5400000 + 10 * np.sin(0.5) + 5 * np.cos(0.5)
    transformer = pyproj.Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    longitude, latitude = transformer.transform(east, north)
    (entry,) = (e for e in content["lanelets"] if e["tags"]["opendrive"] == "r/0/-1")
    assert entry["geographic"][0][0] == pytest.approx((latitude, longitude), abs=1e-9)
    _, _, content = written("commonroad", network, tmp_path)
    assert content["geo_reference"] == "+proj=utm +zone=32 +datum=WGS84"
    assert content["translation"] == [500000.0, 5400000.0, 0.5]


def test_a_map_far_from_its_origin_is_moved_and_says_so(load, text, tmp_path):
    far = '<geometry s="0" x="691000.5" y="5334000.25" hdg="0" length="100"><line/></geometry>'
    network = load(text.road(plan=far))
    _, export, content = written("lanelet2", network, tmp_path)
    assert "(691000, 5334000) m of the map frame lie at the origin" in export.notes
    assert content["lanelets"][0]["left"][-1][:2] == pytest.approx([691000.5, 5334000.25], abs=1e-3)
    (latitude, longitude) = content["lanelets"][0]["geographic"][0][-1]
    assert (latitude, longitude) == pytest.approx((49.0, 9.0), abs=1e-4)


@pytest.mark.parametrize("form", ENDING)
def test_a_map_without_width_has_no_lanelet_and_says_so(load, text, form, tmp_path):
    lanes = text.section(right=text.lane(-1, text.record("width", 0.0)))
    _, export, content = written(form, load(text.road(sections=lanes)), tmp_path)
    assert content["lanelets"] == []
    assert export.left_out == {"lanes without width": 1}


@pytest.mark.parametrize("form", ENDING)
def test_lanelets_begin_and_end_where_lanes_have_width_limits_and_marks(load, text, form, tmp_path):
    """A lane from 30 m on, a limit from 50 m on, a mark from 70 m on."""
    marks = '<roadMark sOffset="0" type="solid" laneChange="none"/><roadMark sOffset="70" type="broken"/>'
    limit = '<speed sOffset="50" max="10" unit="m/s"/>'
    opens = (
        text.record("width", 0.0) + text.record("width", 0.0, 0.3, s=30.0) + text.record("width", 3.0, s=40.0)
    )
    lanes = text.section(
        left=text.lane(1, text.record("width", 3.0), "sidewalk"),
        right=text.lane(-1, text.record("width", 3.5) + marks + limit) + text.lane(-2, opens),
    )
    network = load(text.road(sections=lanes))
    _, export, content = written(form, network, tmp_path)
    items = assert_same(network, form, content, export)
    pieces = comparison.pieces_of(items)
    spans = {
        network.lanes.key[lane].lane_id: [tuple(round(s) for s in item.s_m) for item in of_lane]
        for lane, of_lane in pieces.items()
    }
    cuts = [(0, 30), (30, 50), (50, 70), (70, 100)]
    assert spans == {1: cuts, -1: cuts, -2: cuts[1:]}
    inner = pieces[network.lane_index_of(("r", 0, -1))]
    assert [item.speed_mps for item in inner] == [None, None, 10.0, 10.0]
    if form == "commonroad":
        assert [item.more["right_mark"] for item in inner] == ["solid", "solid", "solid", "dashed"]
    else:
        changes = [item.more["right_tags"].get("lane_change:right") for item in inner]
        assert changes == [None, "no", "no", "yes"]


def run_peer(python: Path, script: str, path: Path, *more: str) -> dict:
    out = path.with_suffix(".json")
    done = subprocess.run(
        [python, PEER / script, path, out, *more], capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(out.read_text(encoding="utf-8"))
