"""Maps built in code: laws of their geometry, findings of the checks, and the example of the docs."""

from __future__ import annotations

import math
import re
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import (
    OpenDriveError,
    PositionError,
    RoadNetwork,
    RoadNotFoundError,
    building,
    load_map,
    write_commonroad,
    write_map,
)
from opendrive.building.reference_line import bridge, end_of
from tests.opendrive.formats.conftest import PEERS

ROOT = Path(__file__).parents[3]
STREET = [building.Lane("driving", 3.5, "solid"), building.Lane("sidewalk", 2.0, height_m=0.1)]


def example() -> str:
    """The code of the section on building in the docs."""
    page = (ROOT / "docs" / "maps.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"## Build it in code\n.*?```python\n(.*?)```", page, re.S)
    return code


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("town")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(compile(example(), "docs/maps.md", "exec"), {})
    return folder / "town.xodr"


def test_the_example_of_the_docs_is_a_map_without_findings(town):
    network = load_map(town, strict=True)
    assert network.findings == ()
    assert (len(network.roads), len(network.crosswalks), len(network.signals_of("1"))) == (9, 1, 1)
    turning = network.lane_index_of(("1", 1, -2))
    # The cubic between two level places: 3/4 of the way, 27/32 of the width.
    assert network.lane_width(turning, [40.0, 60.0, 75.0, 82.5, 90.0, 108.0]) == pytest.approx(
        [0.0, 0.0, 1.5, 3.0 * 27 / 32, 3.0, 3.0]
    )
    approach = network.lane_index_of(("1", 0, -1))
    (ahead,) = network.successors(approach)
    assert {network.lanes.key[network.successors(k)[0]] for k in network.successors(ahead)} == {("2", 0, -1)}
    assert {network.lanes.key[network.successors(k)[0]] for k in network.successors(turning)} == {
        ("3", 0, -1)
    }
    # The sidewalk goes on behind the lane that opens.
    assert network.successors(network.lane_index_of(("1", 0, -2))) == (network.lane_index_of(("1", 1, -3)),)
    x, y, z, _ = network.center_line(network.lane_index_of(("2", 0, -1)), [0.0, 50.0])
    assert (x[0], y[0], z[0]) == pytest.approx((12.0, -1.75, 0.0), abs=0.2)
    assert z[1] == pytest.approx(1.25)


@pytest.mark.skipif(PEERS is None, reason="netconvert is not here: .ci/exports installs it")
def test_netconvert_imports_what_is_built(town, tmp_path):
    assert PEERS is not None
    netconvert = Path(PEERS) / "sumo" / "bin" / "netconvert"
    done = subprocess.run(
        [netconvert, "--opendrive-files", town, "--output-file", tmp_path / "net.xml"],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0
    assert "Error" not in done.stderr


# ------------------------------------------------------------------------------------------ reference lines


coordinates = st.floats(-200.0, 200.0).map(lambda value: round(value, 3))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=6, unique=True))
def test_a_line_through_points_passes_them_without_kinks(points):
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if chords.min() < 1.0:
        return
    start, pieces = building.through(points)
    ends = [start]
    for piece in pieces:
        ends.append(end_of(ends[-1], piece))
    assert np.array([(pose.x_m, pose.y_m) for pose in ends]) == pytest.approx(np.array(points), abs=1e-6)
    for before, after in pairwise(pieces):
        (u1, u2, u3), (v2, v3) = before.u, before.v
        speed, turn = (u1 + 2 * u2 + 3 * u3, 2 * v2 + 3 * v3), (2 * u2 + 6 * u3, 2 * v2 + 6 * v3)
        length = math.hypot(*speed)
        bend = (speed[0] * turn[1] - speed[1] * turn[0]) / length**3
        next_bend = 2 * after.v[0] / after.u[0] ** 2
        assert bend == pytest.approx(next_bend, abs=1e-6, rel=1e-6)


def test_an_arc_of_a_circle_through_its_points_has_its_length():
    angle = np.linspace(0.0, 1.0, 9)
    points = 50.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    _, pieces = building.through(points)
    assert sum(piece.length_m for piece in pieces) == pytest.approx(50.0, abs=0.01)


@pytest.mark.parametrize(
    "points", [[(0.0, 0.0)], [(0.0, 0.0), (0.0, 0.0)], [(0.0, math.nan), (1.0, 0.0)], []]
)
def test_points_that_give_no_line_are_refused(points):
    with pytest.raises(PositionError):
        building.through(points)


@given(coordinates, coordinates, st.floats(-3.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_a_bridge_ends_at_its_pose(x, y, yaw):
    start = building.Pose(3.0, -2.0, 0.4)
    if math.hypot(x - 3.0, y + 2.0) < 1.0:
        return
    end = end_of(start, bridge(start, building.Pose(x, y, yaw)))
    assert (end.x_m, end.y_m) == pytest.approx((x, y), abs=1e-6)
    assert math.remainder(end.yaw_rad - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


# ----------------------------------------------------------------------------------------- widths and lanes


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=5), st.booleans())
@settings(max_examples=40, deadline=None)
def test_profiles_pass_their_places(values, smooth):
    places = [(10.0 * k, value) for k, value in enumerate(values)]
    cubics = building.profile(places, smooth)
    for s_m, a, b, c, d in cubics:
        assert dict(places)[s_m] == pytest.approx(a)
        following = dict(places).get(s_m + 10.0)
        if following is not None:
            assert a + 10.0 * (b + 10.0 * (c + 10.0 * d)) == pytest.approx(following, abs=1e-9)
            slope = b + 10.0 * (2.0 * c + 30.0 * d)
            assert slope == pytest.approx(0.0 if smooth else (following - a) / 10.0, abs=1e-9)


def test_profiles_ascend():
    with pytest.raises(PositionError, match="ascend"):
        building.profile([(1.0, 2.0), (1.0, 3.0)])
    with pytest.raises(PositionError, match="ascend"):
        building.profile([])


def test_roads_are_joined_at_any_ends():
    """Two roads that meet with their starts: lanes of opposite ids are one lane."""
    section = building.section(STREET, STREET)
    roads = [
        building.road("a", building.Pose(0.0, 0.0, 0.0), [building.line(50.0)], [section]),
        building.road("b", building.Pose(0.0, 0.0, math.pi), [building.line(50.0)], [section]),
        building.road("c", building.Pose(50.0, 0.0, 0.0), [building.arc(40.0, -80.0)], [section]),
    ]
    roads = building.joined(roads, ("a", "start"), ("b", "start"))
    roads = building.joined(roads, ("a", "end"), ("c", "start"))
    network = RoadNetwork(building.road_map("m", roads))
    assert network.findings == ()
    way = [
        network.lanes.key[lane]
        for lane in network.shortest_route(
            network.lane_index_of(("b", 0, 1)), network.lane_index_of(("c", 0, -1))
        )
    ]
    assert way == [("b", 0, 1), ("a", 0, -1), ("c", 0, -1)]
    with pytest.raises(RoadNotFoundError):
        building.joined(roads, ("a", "end"), ("d", "start"))


def arms(rule: str, bearings: list[float], grade: float, width_m: float) -> list:
    lanes = [building.Lane("driving", width_m, "solid")]
    return [
        building.road(
            str(number),
            building.Pose(20.0 * math.cos(bearing), 20.0 * math.sin(bearing), bearing),
            [building.line(60.0)],
            [building.section(lanes, lanes)],
            elevation=np.array([[0.0, 0.3, grade * number, 0.0, 0.0]]),
            rule=rule,
        )
        for number, bearing in enumerate(bearings, start=1)
    ]


def lane_end(network: RoadNetwork, lane: int, at_end: bool) -> list[float]:
    """x, y, z and heading of a lane where traffic leaves it, or enters it."""
    forward = network.lanes.direction[lane] > 0
    s_m = network.lanes.s_end_m[lane] if forward == at_end else network.lanes.s_start_m[lane]
    return [float(value) for value in network.center_line(lane, s_m)]


@pytest.mark.parametrize(
    ("rule", "skew", "grade", "width_m"),
    [("RHT", 0.0, 0.0, 3.0), ("LHT", 0.25, 0.01, 3.5), ("RHT", -0.3, -0.01, 2.75)],
)
def test_junctions_continue_lanes_headings_and_heights(rule, skew, grade, width_m):
    """Every way of a crossing with skewed arms: no gap, kink or step, and traffic goes where it should."""
    bearings = [skew, math.pi / 2, math.pi - skew, -math.pi / 2 + skew]
    roads = arms(rule, bearings, grade, width_m)
    inbound, outbound = (1, -1) if rule == "RHT" else (-1, 1)
    ways = [
        (building.LaneEnd(a, "start", inbound), building.LaneEnd(b, "start", outbound))
        for a in "1234"
        for b in "1234"
        if a != b
    ]
    roads, junction = building.junction(roads, "9", ways)
    network = RoadNetwork(building.road_map("crossing", roads, [junction]))
    assert network.findings == ()
    assert len(network.roads) == 4 + len(ways)
    for a in "1234":
        inside = network.successors(network.lane_index_of((a, 0, inbound)))
        reached = {network.lanes.key[after].road_id for lane in inside for after in network.successors(lane)}
        assert reached == set("1234") - {a}
        for lane in inside:
            (before,), (after,) = network.predecessors(lane), network.successors(lane)
            for first, last in ((before, lane), (lane, after)):
                leaves, enters = (
                    lane_end(network, k, at_end) for k, at_end in ((first, True), (last, False))
                )
                assert leaves[:3] == pytest.approx(enters[:3], abs=1e-4)
                assert math.remainder(leaves[3] - enters[3], 2 * math.pi) == pytest.approx(0.0, abs=1e-4)


def test_what_cannot_be_connected_is_refused():
    roads = arms("RHT", [0.0, math.pi], 0.0, 3.0)
    at = building.LaneEnd
    with pytest.raises(OpenDriveError, match="traffic leaves lane -1 of road '1'"):
        building.junction(roads, "9", [(at("1", "start", -1), at("2", "start", -1))])
    with pytest.raises(OpenDriveError, match="no lane 7"):
        building.junction(roads, "9", [(at("1", "start", 7), at("2", "start", -1))])
    with pytest.raises(RoadNotFoundError):
        building.junction(roads, "9", [(at("3", "start", 1), at("2", "start", -1))])
    left_hand = arms("LHT", [0.0, math.pi], 0.0, 3.0)[1]
    with pytest.raises(OpenDriveError, match="different sides"):
        building.junction([roads[0], left_hand], "9", [(at("1", "start", 1), at("2", "start", 1))])


def test_what_is_built_is_read_again_the_same(town, tmp_path):
    network = load_map(town)
    write_map(network, tmp_path / "again.xodr")
    assert (tmp_path / "again.xodr").read_bytes() == town.read_bytes()


# ------------------------------------------------------------------------------------ what is no map


@pytest.mark.parametrize(
    ("length_m", "curvature"),
    [(0.0, 0.0), (-1.0, 0.0), (math.nan, 0.0), (math.inf, 0.0), (1.0, math.nan), (1.0, math.inf)],
)
def test_pieces_have_a_length_and_finite_curvature(length_m, curvature):
    with pytest.raises(PositionError):
        building.spiral(length_m, 0.0, curvature)


def test_arcs_and_roads_of_nothing_are_refused():
    section = building.section(STREET, STREET)
    with pytest.raises(PositionError, match="radius_m"):
        building.arc(10.0, 0.0)
    with pytest.raises(PositionError, match="road 'a': its reference line has no pieces"):
        building.road("a", building.Pose(0.0, 0.0, 0.0), [], [section])
    with pytest.raises(OpenDriveError, match="no lane sections"):
        building.road("a", building.Pose(0.0, 0.0, 0.0), [building.line(5.0)], [])


def test_two_roads_of_one_id_are_refused():
    road = building.road(
        "a", building.Pose(0.0, 0.0, 0.0), [building.line(5.0)], [building.section(STREET, STREET)]
    )
    with pytest.raises(OpenDriveError, match="road 'a': 2 have this id"):
        building.road_map("m", iter([road, road]))


def test_a_road_with_hyphens_in_its_id_is_written_as_commonroad(tmp_path):
    """No comment of XML may hold two hyphens in a row."""
    road = building.road(
        "a---b-", building.Pose(0.0, 0.0, 0.0), [building.line(50.0)], [building.section(STREET, STREET)]
    )
    network = RoadNetwork(building.road_map("m", [road]))
    write_commonroad(network, tmp_path / "m.xml")
    assert "OpenDRIVE a- - -b-/0/" in (tmp_path / "m.xml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("starts_m", "start_x_m", "message"),
    [
        ((0.0, 50.0), 0.0, "start at s = 0, 50 m, expected 0 first, then ascending, before .* at 10 m"),
        ((5.0,), 0.0, "start at s = 5 m"),
        ((0.0, 5.0, 2.0), 0.0, "start at s = 0, 5, 2 m"),
        ((0.0,), float("nan"), "road 'a': start: expected finite numbers"),
    ],
)
def test_what_the_reader_would_refuse_or_leave_out_is_refused(starts_m, start_x_m, message):
    sections = [building.section(STREET, STREET, s_m=s_m) for s_m in starts_m]
    with pytest.raises(PositionError, match=message):
        building.road("a", building.Pose(start_x_m, 0.0, 0.0), [building.line(10.0)], sections)


def test_a_width_is_a_number():
    with pytest.raises(PositionError, match="expected finite numbers"):
        building.section([building.Lane("driving", float("nan"))], STREET)
