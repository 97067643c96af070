"""Where a test can take place: straight stretches, what lies beside them, and places that users name."""

import math
from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, building, load_map, write_map
from scenarios.catalogue.cpna import LEAD_S, CpnaTest, build
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.motion.paths import Pose
from scenarios.places import (
    RUN_OUT_M,
    STRAIGHT_M,
    Place,
    Site,
    find_site,
    kerb_m,
    lane_at,
    lane_under,
    near_side,
    site_at,
    site_stretches,
    straight_around,
)
from scenarios.presets import PAPER

PUBLIC_MAPS = Path(__file__).parents[3] / "shared" / "opendrive" / "maps"
NEEDED_M = 115.0


def street(name: str = "urban_street") -> RoadNetwork:
    return load_map(shipped_map(name))


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_every_shipped_map_has_a_place(name: str) -> None:
    check_site(find_site(street(name), NEEDED_M), NEEDED_M)


@pytest.mark.parametrize("name", ["Town01", "Town04", "CampusUAH_v1_7"])
def test_public_maps_have_a_place(name: str) -> None:
    path = PUBLIC_MAPS / f"{name}.xodr"
    if not path.is_file():
        pytest.skip(f"map {name}.xodr is not in ../shared/opendrive/maps")
    found = find_site(load_map(path), NEEDED_M)
    check_site(found, NEEDED_M)
    outcome = build(CpnaTest(60.0), found, PAPER, None).run()
    expected = LEAD_S + 4.0 / (5 / 3.6) - 0.25 / (60 / 3.6)
    assert outcome.contact_time_s == pytest.approx(expected, abs=1e-3)


def check_site(site: Site, needed_m: float) -> None:
    """Driving lanes, straight as far as needed on the network's own centre line, room for the pedestrian."""
    before, after = straight_around(site.route, site.line_m)
    assert before >= needed_m
    assert after >= RUN_OUT_M
    assert all(site.network.lanes.lane_type[lane] == "driving" for lane in site.route.lanes)
    stations = np.linspace(site.line_m - needed_m + 0.1, site.line_m + RUN_OUT_M - 0.1, 50)
    x, y, yaw = site.route.pose(site.line_m)
    points = np.array([site.route.pose(float(s))[:2] for s in stations]) - (x, y)
    assert np.abs(points @ (-math.sin(yaw), math.cos(yaw))).max() <= STRAIGHT_M + 1e-6
    assert (site.line.x_m, site.line.y_m, site.line.yaw_rad) == (x, y, yaw)


@pytest.mark.parametrize("s_m", [205.0, 240.0, 280.0])
def test_a_bend_is_refused(s_m: float) -> None:
    network = street("urban_bend")
    with pytest.raises(ScenarioError, match=r"no straight stretch: .* the test needs 115 m"):
        site_at(network, network.lane_index_of(("1", 0, -1)), s_m, NEEDED_M)


def test_the_end_of_the_road_is_refused() -> None:
    network = street()
    lane = network.lane_index_of(("1", 0, -1))
    for s in (50.0, 590.0):
        with pytest.raises(ScenarioError, match="no straight stretch"):
            site_at(network, lane, s, NEEDED_M)
    site_at(network, lane, 300.0, NEEDED_M)


def test_a_sidewalk_is_refused() -> None:
    network = street()
    with pytest.raises(ScenarioError, match="is of type sidewalk; choose a driving lane"):
        site_at(network, network.lane_index_of(("1", 0, -2)), 300.0, NEEDED_M)


def test_a_map_without_a_straight_stretch_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "short.xodr"
    text = shipped_map("urban_street").read_text()
    path.write_text(text.replace('"600.0"', '"80.0"'))
    network = load_map(path)
    assert network.lanes.s_end_m.max() < 100
    with pytest.raises(ScenarioError, match=r"no straight stretch of 115 m .* --at ROAD,LANE,S"):
        find_site(network, NEEDED_M)


def test_both_directions_of_a_street_have_their_near_side_right() -> None:
    network = street()
    for lane_id in (-1, 1):
        lane = network.lane_index_of(("1", 0, lane_id))
        assert near_side(network, lane) == -1
        outer = network.lane_index_of(("1", 0, 2 * lane_id))
        x, y = (float(v[0]) for v in network.center_line(outer, [300.0])[:2])
        assert site_at(network, lane, 300.0, 60.0).route.project(x, y)[1] < 0


def test_distance_to_the_kerb_counts_every_lane_of_the_carriageway() -> None:
    network = street("urban_street_parking")
    lane = network.lane_index_of(("1", 0, -1))
    x, y, _, yaw = (float(v[0]) for v in network.center_line(lane, [300.0]))
    for side in (-1, 1):
        distance, sidewalk = kerb_m(network, lane, 300.0, side)
        assert sidewalk
        for beyond, kinds in ((-0.05, {"driving", "parking"}), (0.05, {"sidewalk"})):
            across = side * (distance + beyond)
            hits = network.locate([[x - across * math.sin(yaw), y + across * math.cos(yaw)]])
            assert set(network.lanes.lane_type[hits.lane].tolist()) <= kinds


@pytest.mark.parametrize("heading", [0.0, math.pi])
def test_the_lane_under_a_pose_runs_along_its_heading(heading: float) -> None:
    network = street()
    side = -1 if heading == 0.0 else 1
    lane, s_m = lane_under(network, Pose(300.0, side * 1.75, heading + 0.1))
    assert tuple(network.lanes.key[lane]) == ("1", 0, side)
    assert s_m == pytest.approx(300.0)
    with pytest.raises(ScenarioError, match="no driving lane runs at x = 300 m, y = 4 m"):
        lane_under(network, Pose(300.0, 4.0, heading))  # a sidewalk
    with pytest.raises(ScenarioError, match="no driving lane runs at"):
        lane_under(network, Pose(300.0, side * 1.75, heading + math.pi / 2))


def test_a_place_is_found_by_road_lane_and_s() -> None:
    network = street()
    assert tuple(network.lanes.key[lane_at(network, Place("1", 1, 10.0))]) == ("1", 0, 1)


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (Place("9", -1, 10.0), r"the map has no road '9'; it has 1 roads: 1"),
        (Place("1", -7, 10.0), r"road 1 has no lane -7 at s = 10 m; it has: .*driving, s 0\.\.600"),
        (Place("1", -1, 601.0), r"no lane -1 at s = 601 m"),
        (Place("1", -1, -1.0), r"no lane -1 at s = -1 m"),
    ],
)
def test_a_wrong_place_is_answered_with_what_there_is(place: Place, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        lane_at(street(), place)


def short_straight(start_m: float) -> str:
    """A road of 1,000 m that winds but for 200 m from a place on: two bends to the left, one road."""
    winding = []
    x = y = heading = 0.0
    s = 0.0
    while s < 1000.0:
        straight = abs(s - start_m) < 1e-6
        length = 200.0 if straight else 20.0
        curvature = 0.0 if straight else (0.01 if len(winding) % 2 else -0.01)
        shape = "<line/>" if straight else f'<arc curvature="{curvature}"/>'
        length = min(length, 1000.0 - s)
        pose = f's="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}"'
        winding.append(f"<geometry {pose}>{shape}</geometry>")
        half = 0.5 * curvature * length
        chord = length * float(np.sinc(half / np.pi))
        x, y = x + chord * float(np.cos(heading + half)), y + chord * float(np.sin(heading + half))
        heading, s = heading + 2.0 * half, s + length
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    lane = f'<right><lane id="-1" type="driving">{width}</lane></right>'
    lanes = f'<laneSection s="0"><center><lane id="0" type="none"/></center>{lane}</laneSection>'
    return (
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="1000" junction="-1">'
        f"<planView>{''.join(winding)}</planView><lanes>{lanes}</lanes></road></OpenDRIVE>"
    )


@pytest.mark.parametrize("start_m", [60.0, 100.0, 300.0, 620.0])
def test_every_straight_stretch_is_found(tmp_path: Path, start_m: float) -> None:
    """200 m of a winding road: the line lies after the approach and before the run-out."""
    file = tmp_path / "winding.xodr"
    file.write_text(short_straight(start_m), encoding="utf-8")
    network = load_map(file)
    (stretch,) = site_stretches(network, 100.0)
    # On the arcs of 100 m radius the tangent is left by 5 cm after 3.2 m.
    assert stretch.s_low_m == pytest.approx(start_m + 100.0, abs=4.5)
    assert stretch.s_high_m == pytest.approx(start_m + 200.0 - RUN_OUT_M, abs=4.5)
    assert not stretch.has_sidewalk
    site = find_site(network, 100.0)
    before, after = straight_around(site.route, site.line_m)
    assert before >= 100.0
    assert after >= RUN_OUT_M


def test_stretches_with_a_sidewalk_come_first() -> None:
    stretches = site_stretches(load_map(shipped_map("urban_street")), 60.0)
    assert {(s.place.road_id, s.place.lane_id) for s in stretches} == {("1", -1), ("1", 1)}
    assert all(s.has_sidewalk for s in stretches)


@pytest.mark.parametrize("length_m", [0.0, 1e-7])
def test_a_road_without_length_is_passed_over(tmp_path: Path, length_m: float) -> None:
    """Nothing stands on it, and the other roads keep their stretches."""
    lanes = building.section([], [building.Lane("driving", 3.5)])
    street = building.road("1", building.Pose(0.0, 0.0, 0.0), [building.line(200.0)], [lanes])
    write_map(building.road_map("m", [street]), tmp_path / "m.xodr")
    alone = site_stretches(load_map(tmp_path / "m.xodr"), 60.0)
    text = (tmp_path / "m.xodr").read_text(encoding="utf-8")
    again = text[text.index("<road") : text.index("</road>") + len("</road>")]
    again = again.replace('id="1"', 'id="2"', 1).replace('length="200.0"', f'length="{length_m}"')
    text = text.replace("</OpenDRIVE>", f"{again}</OpenDRIVE>")
    (tmp_path / "m.xodr").write_text(text, encoding="utf-8")
    network = load_map(tmp_path / "m.xodr")
    assert network.roads["2"].length_m == length_m
    assert len(alone) == 1
    assert site_stretches(network, 60.0) == alone


def test_a_stretch_of_a_few_metres_is_found(tmp_path: Path) -> None:
    """Straight for 2.5 m more than a test needs; before, places were tried every 5 m."""
    file = tmp_path / "winding.xodr"
    file.write_text(short_straight(300.0), encoding="utf-8")
    (stretch,) = site_stretches(load_map(file), 200.0 - RUN_OUT_M - 2.5)
    assert stretch.s_high_m - stretch.s_low_m < 10.0


@pytest.mark.parametrize("has_sidewalk", [True, False])
def test_a_site_says_its_place_and_whether_there_is_a_sidewalk(tmp_path: Path, has_sidewalk: bool) -> None:
    text = shipped_map("urban_street").read_text(encoding="utf-8")
    assert 'type="sidewalk"' in text
    file = tmp_path / "street.xodr"
    file.write_text(
        text if has_sidewalk else text.replace('type="sidewalk"', 'type="none"'), encoding="utf-8"
    )
    network = load_map(file)
    site = find_site(network, 60.0)
    assert site.has_sidewalk is has_sidewalk
    again = site_at(network, lane_at(network, site.place), site.place.s_m, 60.0)
    assert (again.line.x_m, again.line.y_m) == pytest.approx((site.line.x_m, site.line.y_m), abs=1e-6)
