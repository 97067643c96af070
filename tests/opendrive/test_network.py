import dataclasses
import pickle
import time

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import (
    LaneKey,
    LaneNotFoundError,
    MapContentError,
    PositionError,
    RoadNetwork,
    RoadNotFoundError,
    load_map,
)

BANKED = "esut_straight_500_superelevation_elevation_curve"
# On paramPoly3 both references are good to 2 mm; on line, arc and spiral they are exact.
CUBIC_XY_M = 2e-3


def angle_between(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


def has_cubics(network):
    shapes = {type(g.shape).__name__ for road in network.model.roads.values() for g in road.geometries}
    return bool(shapes & {"ParamPoly3", "Poly3"})


def poses_of(network, rows):
    """Return lanes, and x, y, z, travel heading and width (N, 5) for oracle rows."""
    lane = np.array([network.lane_index_of(LaneKey(str(row[0]), row[2], row[3])) for row in rows])
    s = np.array([row[4] for row in rows])
    return lane, np.stack([*network.center_line(lane, s), network.lane_width(lane, s)], axis=1)


def test_poses_against_libopendrive(network_of, oracle, map_name):
    """x, y, z, heading and width of up to 3000 places per map; rows are rounded to 1e-6."""
    network = network_of(map_name)
    lane, poses = poses_of(network, oracle(map_name, "lanes")["rows"])
    values = [
        [np.nan if v in (None, "nan") else v for v in row[:7]] for row in oracle(map_name, "second")["libodr"]
    ]
    expected = np.array(values, dtype=float)
    assert np.isfinite(expected).all()
    along = poses[:, 3] + np.where(network.lanes.direction[lane] > 0, 0.0, np.pi)
    cubic = has_cubics(network)
    assert np.hypot(*(poses - expected[:, :5])[:, :2].T).max() < (CUBIC_XY_M if cubic else 1e-6)
    assert np.abs(poses[:, 2] - expected[:, 2]).max() < 1e-6
    assert angle_between(along, expected[:, 3]).max() < 1e-4
    assert np.abs(poses[:, 4] - expected[:, 4]).max() < 1e-6


def test_poses_against_libcarla(network_of, oracle, map_name):
    """The second opinion, float32: positions, widths, travel direction."""
    if map_name == BANKED:
        pytest.skip("libcarla ignores superelevation")
    network = network_of(map_name)
    rows = oracle(map_name, "lanes")["rows"]
    lane, poses = poses_of(network, rows)
    expected = np.array([row[5:10] for row in rows], dtype=float)
    assert np.hypot(*(poses - expected)[:, :2].T).max() < CUBIC_XY_M
    # Widths come from a float32 s: a steep width record makes an error of 1e-5 out of it.
    assert np.abs(poses[:, 4] - expected[:, 4]).max() < 2e-5
    raised = np.diff(network.lanes.inner_height.first)[lane] > 0
    assert np.abs(poses[:, 2] - expected[:, 2])[~raised].max(initial=0.0) < 1e-3
    # libcarla's heading is only right where the lane is parallel to the road.
    turned = angle_between(poses[:, 3], expected[:, 3])
    road_heading = np.array([row[10] for row in oracle(map_name, "second")["libodr"]], dtype=float)
    slanted = angle_between(poses[:, 3] + (network.lanes.direction[lane] < 0) * np.pi, road_heading)
    assert turned.max() < 0.5
    assert turned[slanted < 1e-6].max(initial=0.0) < (1e-3 if has_cubics(network) else 1e-4)
    kinds = network.lanes.lane_type[lane].tolist()
    assert kinds == [row[10] for row in rows]


def test_borders_against_libopendrive(network_of, oracle, map_name):
    network = network_of(map_name)
    rows = oracle(map_name, "lanes")["rows"]
    lane = np.array([network.lane_index_of(LaneKey(str(row[0]), row[2], row[3])) for row in rows])
    s = np.array([row[4] for row in rows])
    expected = np.array([row[5:9] for row in oracle(map_name, "second")["libodr"]], dtype=float)
    t_inner, t_outer = network.lane_offsets(lane, s)
    assert np.abs(np.stack([t_inner, t_outer], axis=1) - expected[:, :2]).max() < 2e-6
    left, right = network.borders(lane, s)
    inner_is_right = network.lanes.side[lane] == network.lanes.direction[lane]
    inner = np.where(inner_is_right[:, None], right, left)
    bound = CUBIC_XY_M if has_cubics(network) else 2e-6
    assert np.hypot(*(inner - expected[:, 2:]).T).max() < bound


def test_many_lanes_are_asked_at_once(network_of):
    network = network_of("Town01")
    lane = np.arange(len(network.lanes))
    middle = 0.5 * (network.lanes.s_start_m + network.lanes.s_end_m)
    together = np.stack([*network.center_line(lane, middle), network.lane_width(lane, middle)])
    left, right = network.borders(lane, middle)
    for i in range(0, len(lane), 29):
        one = [*network.center_line(i, middle[i]), network.lane_width(i, middle[i])]
        np.testing.assert_allclose(together[:, i], np.array(one), atol=1e-12)
        np.testing.assert_allclose(
            [left[i], right[i]], np.concatenate(network.borders(i, middle[i])), atol=1e-12
        )
    assert network.lane_width(lane[:3, None], [[1.0, 2.0]]).shape == (3, 2)
    assert network.center_line([], [])[0].shape == (0,)
    with pytest.raises(LaneNotFoundError, match="expected indices"):
        network.center_line([0.5], 1.0)
    with pytest.raises(PositionError, match=r"within \[0, "):
        network.center_line([0, 1], [0.0, 1e6])


def test_borders_are_left_and_right_in_travel_direction(network_of, map_name):
    network = network_of(map_name)
    lanes = network.lanes
    for lane in range(0, len(lanes), max(1, len(lanes) // 60)):
        s = 0.5 * (lanes.s_start_m[lane] + lanes.s_end_m[lane])
        if float(network.lane_width(lane, s)) < 0.01:
            continue
        x, y, _, heading = (float(value) for value in network.center_line(lane, s))
        left, right = network.borders(lane, s)
        across = left[0] - right[0]
        ahead = np.array([np.cos(heading), np.sin(heading)])
        assert ahead[0] * across[1] - ahead[1] * across[0] > 0.0
        np.testing.assert_allclose(0.5 * (left[0] + right[0]), [x, y], atol=1e-9)


def test_lane_polygons_contain_their_centre_lines(network_of, map_name):
    network = network_of(map_name)
    lanes = network.lanes
    checked = 0
    for lane in range(0, len(lanes), max(1, len(lanes) // 60)):
        start, end = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        if network.lane_width(lane, np.linspace(start, end, 50)).min() < 0.3:
            start, end = 0.6 * start + 0.4 * end, 0.4 * start + 0.6 * end
        s = np.linspace(start, end, 50)
        if end - start < 0.3 or network.lane_width(lane, s).min() < 0.3:
            continue
        ring = network.lane_polygon(lane, start, end)
        polygon = shapely.Polygon(ring)
        x, y, _, _ = network.center_line(lane, s)
        assert polygon.is_valid, lanes.key[lane]
        assert polygon.exterior.is_ccw, lanes.key[lane]
        assert shapely.distance(polygon, shapely.points(x, y)).max() < 1e-6, lanes.key[lane]
        for border in network.borders(lane, s):
            distance = shapely.distance(polygon.exterior, shapely.points(border))
            assert distance.max() <= 0.05 + 1e-6, lanes.key[lane]
        checked += 1
    assert checked


@settings(max_examples=40, deadline=None)
@given(
    curvature=st.floats(-0.05, 0.05),
    growth=st.floats(-0.02, 0.05),
    margins=st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 3.0)),
    ends=st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 100.0)),
    tolerance=st.floats(0.005, 0.2),
    lane_id=st.sampled_from([1, -1]),
)
def test_lane_polygon_follows_the_widened_borders(
    tmp_path_factory, text, curvature, growth, margins, ends, tolerance, lane_id
):
    plan = f'<geometry s="0" x="0" y="0" hdg="1" length="100"><arc curvature="{curvature!r}"/></geometry>'
    width = text.record("width", 3.0, growth)
    sections = text.section(left=text.lane(1, width), right=text.lane(-1, width))
    file = tmp_path_factory.getbasetemp() / "polygon.xodr"
    file.write_text(text.document(text.road(plan, sections=sections)), encoding="utf-8")
    network = load_map(file)
    lane = network.lane_index_of(LaneKey("r", 0, lane_id))
    left_m, right_m = margins
    low, high = sorted(ends)
    ring = network.lane_polygon(
        lane, *ends, margin_left_m=left_m, margin_right_m=right_m, tolerance_m=tolerance
    )
    s = np.linspace(low, high, 60)
    _, outer = network.lane_offsets(lane, s)
    direction = network.lanes.direction[lane]
    # The inner border is the left one in right-hand traffic.
    inner = network.road_point("r", s, direction * left_m)
    outer = network.road_point("r", s, outer - direction * right_m)
    outline = shapely.LinearRing(ring) if high > low else shapely.LineString(ring)
    for border in (inner, outer):
        distance = shapely.distance(outline, shapely.points(border.x_m, border.y_m))
        assert distance.max() <= tolerance + 1e-6


def test_polygon_of_a_straight_lane_has_four_corners(load, text):
    network = load(text.road('<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'))
    ring = network.lane_polygon(network.lane_index_of(LaneKey("r", 0, -1)), 10.0, 30.0, 0.5, 1.0)
    np.testing.assert_allclose(ring, [[10, -4.5], [30, -4.5], [30, 0.5], [10, 0.5]], atol=1e-12)
    ring = network.lane_polygon(network.lane_index_of(LaneKey("r", 0, 1)), 30.0, 10.0, 0.5, 1.0)
    np.testing.assert_allclose(ring, [[30, 4.5], [10, 4.5], [10, -0.5], [30, -0.5]], atol=1e-12)


def test_the_end_of_a_lane_keeps_its_own_offset(load, text):
    """The lane offset jumps between two sections; each section sees its own side of the jump."""
    offsets = text.record("laneOffset", 0.0) + text.record("laneOffset", 2.0, s=50.0)
    width = text.record("width", 3.0)
    sections = text.section(right=text.lane(-1, width)) + text.section(50.0, right=text.lane(-1, width))
    network = load(text.road(sections=sections, offsets=offsets))
    before, after = (network.lane_index_of(LaneKey("r", k, -1)) for k in (0, 1))
    assert [float(t) for t in network.lane_offsets(before, 50.0)] == [0.0, -3.0]
    assert [float(t) for t in network.lane_offsets(after, 50.0)] == [2.0, -1.0]


def test_a_border_lane_inside_width_lanes(load, text):
    """Lane -2 is given by its border; lane -3 adds its width to that."""
    right = (
        text.lane(-1, text.record("width", 3.0))
        + text.lane(-2, text.record("border", -7.0, -0.01))
        + text.lane(-3, text.record("width", 2.0))
    )
    network = load(text.road(sections=text.section(right=right), offsets=text.record("laneOffset", 0.5)))
    offsets = [
        [float(t) for t in network.lane_offsets(network.lane_index_of(LaneKey("r", 0, i)), 10.0)]
        for i in (-1, -2, -3)
    ]
    np.testing.assert_allclose(offsets, [[0.5, -2.5], [-2.5, -6.6], [-6.6, -8.6]])


def test_speed_limits_prefer_the_lane_and_are_converted(load, text):
    width = text.record("width", 3.0)
    speeds = '<speed sOffset="20" max="30" unit="mph"/><speed sOffset="40" max="no limit"/>'
    extra = (
        '<type s="0" type="town"><speed max="50" unit="km/h"/></type>'
        '<type s="60" type="rural"><speed max="25"/></type>'
    )
    sections = text.section(right=text.lane(-1, width + speeds) + text.lane(-2, width))
    network = load(text.road(sections=sections, extra=extra))
    with_own, without = (network.lane_index_of(LaneKey("r", 0, i)) for i in (-1, -2))
    assert network.speed_limit(with_own, 10.0) == pytest.approx(50 / 3.6)
    assert network.speed_limit(with_own, 20.0) == pytest.approx(30 * 0.44704)
    assert network.speed_limit(with_own, 50.0) is None
    assert network.speed_limit(without, 59.0) == pytest.approx(50 / 3.6)
    assert network.speed_limit(without, 60.0) == 25.0


def test_a_road_without_limits_has_none(load, text):
    network = load(text.road())
    assert network.speed_limit(0, 10.0) is None


def test_lane_table(load, text):
    network = load(text.road(attributes='rule="LHT"'), text.road(road_id="s", junction="4"))
    lanes = network.lanes
    assert len(lanes) == 4
    assert lanes.key == (("r", 0, 1), ("r", 0, -1), ("s", 0, 1), ("s", 0, -1))
    assert lanes.direction.tolist() == [1, -1, -1, 1]
    assert lanes.junction_id == (None, None, "4", "4")
    assert lanes.lane_type.tolist() == ["driving"] * 4
    assert lanes.s_end_m.tolist() == [100.0] * 4


def test_unknown_lanes_and_roads_are_refused(load, text):
    network = load(text.road())
    with pytest.raises(LaneNotFoundError, match="no lane 7 in section 0 of road 'r'"):
        network.lane_index_of(LaneKey("r", 0, 7))
    for lane in (-1, 2):
        with pytest.raises(LaneNotFoundError, match=f"no lane {lane}: the network has lanes 0 to 1"):
            network.center_line(lane, 0.0)
        with pytest.raises(LaneNotFoundError):
            network.successors(lane)
    with pytest.raises(RoadNotFoundError, match="no road 'x'"):
        network.road_point("x", 0.0, 0.0)
    with pytest.raises(RoadNotFoundError, match="no road 'x'"):
        network.signals_of("x")


def test_positions_off_a_lane_are_refused(load, text):
    network = load(text.road())
    for s in (-0.01, 100.01, np.nan, np.inf, "a"):
        with pytest.raises(PositionError):
            network.center_line(0, s)
    with pytest.raises(PositionError, match="tolerance"):
        network.lane_polygon(0, 0.0, 10.0, tolerance_m=0.0)
    with pytest.raises(PositionError, match="margin"):
        network.lane_polygon(0, 0.0, 10.0, margin_left_m=np.nan)
    with pytest.raises(PositionError, match="'left' or 'right'"):
        network.lane_change(0, 0.0, "up")


def test_loading_is_quick(shared):
    """A guard against accidents: an order of magnitude above what it takes."""
    start = time.perf_counter()
    network = load_map(shared / "maps" / "Town04.xodr")
    network.locate([[0.0, 0.0]])
    assert time.perf_counter() - start < 5.0


def test_a_network_survives_pickling(network_of):
    network = network_of("esmini_fabriksgatan")
    copied = pickle.loads(pickle.dumps(network))
    assert copied.lanes.key == network.lanes.key
    np.testing.assert_array_equal(copied.center_line(3, 5.0), network.center_line(3, 5.0))
    assert repr(copied) == "<RoadNetwork '': 16 roads, 44 lanes>"


def test_nothing_can_be_changed(load, text):
    network = load(text.road())
    with pytest.raises(ValueError, match="read-only"):
        network.lanes.direction[0] = 1
    with pytest.raises(TypeError):
        network.model.roads["x"] = None
    with pytest.raises(TypeError):
        network.roads["x"] = None
    with pytest.raises(dataclasses.FrozenInstanceError):
        network.model.roads["r"].name = "other"


def test_a_map_with_centre_lanes_only(load, text):
    network = load(text.road(sections=text.section()))
    assert len(network.lanes) == 0
    assert network.bounds == (0.0, 0.0, 0.0, 0.0)
    assert network.locate([[10.0, 5.0]]).lane.size == 0
    assert not network.nearest_lane([[10.0, 5.0]]).found.any()
    s, t = network.road_coordinates("r", [[10.0, 5.0]])
    assert (float(s[0]), float(t[0])) == pytest.approx((0.0, 0.0))


def test_reversed_lanes_run_the_other_way(load, text):
    lane = text.lane(-1, text.record("width", 3.0)).replace("<lane ", '<lane direction="reversed" ')
    network = load(text.road(sections=text.section(right=lane)))
    assert network.lanes.direction.tolist() == [-1]
    assert float(network.center_line(0, 1.0)[3]) == pytest.approx(0.3 - np.pi)


def test_lanes_with_too_many_records_are_refused(load, text, monkeypatch):
    """Each record of one lane cuts all lanes of its section: their product bounds time and memory."""
    monkeypatch.setattr("opendrive.geometry.borders.MAX_ROWS", 5)
    width = "".join(text.record("width", 3.0, s=10.0 * k) for k in range(3))
    sections = text.section(left=text.lane(1, width), right=text.lane(-1, width))
    with pytest.raises(MapContentError, match="6 border curves, expected at most 5"):
        load(text.road(sections=sections))


def test_bounds_of_straight_lanes_are_exact(load, text):
    plan = '<geometry s="0" x="10" y="5" hdg="0" length="100"><line/></geometry>'
    widths = text.record("width", 3.0) + text.record("width", 4.0, 0.05, s=40.0)
    lanes = text.section(left=text.lane(1, widths), right=text.lane(-1, text.record("width", 3.5)))
    network = load(text.road(plan, sections=lanes))
    np.testing.assert_allclose(network.bounds, [10.0, 1.5, 110.0, 12.0], atol=1e-9)


def test_bounds_of_a_bend_are_those_of_its_outer_border(load, text):
    """Half a circle of radius 20 m to the left, with a lane of 3 m outside and one of 2 m inside."""
    length = 20.0 * np.pi
    plan = f'<geometry s="0" x="0" y="0" hdg="0" length="{length!r}"><arc curvature="0.05"/></geometry>'
    lanes = text.section(
        left=text.lane(1, text.record("width", 2.0)), right=text.lane(-1, text.record("width", 3.0))
    )
    network = load(text.road(plan, sections=lanes, length=length))
    np.testing.assert_allclose(network.bounds, [0.0, -3.0, 23.0, 43.0], atol=6e-3)


def test_bounds_of_a_very_long_road_take_no_time(load, text):
    plan = '<geometry s="0" x="0" y="0" hdg="0" length="1e6"><line/></geometry>'
    network = load(text.road(plan, length=1e6))
    start = time.process_time()
    np.testing.assert_allclose(network.bounds, [0.0, -3.5, 1e6, 3.5], atol=1e-9)
    assert time.process_time() - start < 1.0


def test_a_point_off_every_lane_is_said_to_be_so(load, text):
    """A road of 100 m with lanes of 3.5 m on either side of y = 0."""
    network = load(text.road('<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'))
    points = [[50.0, -1.0], [50.0, -3.5], [50.0, -4.0], [50.0, -499.5]]
    nearest = network.nearest_lane(points)
    assert nearest.inside.tolist() == [True, True, False, False]
    np.testing.assert_allclose(nearest.distance_m, [0.0, 0.0, 0.5, 496.0], atol=1e-9)
    near = network.nearest_lane(points, within_m=3.0)
    assert near.found.tolist() == [True, True, True, False]
    assert (near.lane[3], near.s_m[3], near.distance_m[3]) == (0, 0.0, 0.0)
    assert not near.inside[3]


def test_methods_are_three_groups_whose_help_lists_them():
    groups = [RoadNetwork, *RoadNetwork.__mro__[1:3]]
    assert [group.__name__ for group in groups] == ["RoadNetwork", "NetworkTopology", "NetworkLanes"]
    methods = [{name for name in vars(group) if not name.startswith("_")} for group in groups]
    assert not set.intersection(methods[0] | methods[1], methods[2])
    assert {"route", "successors", "lane_change", "places_ahead"} <= methods[1]
    assert {"locate", "nearest_lane", "center_line", "road_point"} <= methods[2]
    assert {"warnings", "objects", "to_geojson", "signals_of"} <= methods[0]
