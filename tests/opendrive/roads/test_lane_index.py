import numpy as np
import pytest

from opendrive import LaneKey, LaneNotFoundError, PositionError, load_map

BANKED = "esut_straight_500_superelevation_elevation_curve"


def test_containment(network_of, oracle, map_name):
    """Every point lies in exactly the lanes that the exact reference lists, at the same s and t."""
    if map_name == BANKED:
        pytest.skip("the reference measures t in plan; see test_containment_on_a_banked_road")
    network = network_of(map_name)
    points = np.array([row[:2] for row in oracle(map_name, "points")["rows"]])
    expected = {
        (p, str(hit[0]), hit[1]): hit[2:5]
        for p, hits in enumerate(oracle(map_name, "second")["contain"])
        for hit in hits
    }
    hits = network.locate(points)
    keys = [network.lanes.key[lane] for lane in hits.lane]
    found = {
        (int(p), key.road_id, key.lane_id): k for k, (p, key) in enumerate(zip(hits.point, keys, strict=True))
    }
    assert expected.keys() <= found.keys()
    for name in found.keys() - expected.keys():
        # The reference gives a point on a border, or on a kink between two pieces, to one lane only; where
        # the pieces of a reference line overlap by less than a millimetre, to none.
        k = found[name]
        record = network.roads[name[1]].record
        joints = [section.s_m for section in record.sections] + [piece.s_m for piece in record.geometries]
        on_joint = np.abs(np.array([*joints, record.length_m]) - hits.s_m[k]).min() < 1e-3
        assert hits.margin_m[k] < 1e-9 or on_joint, name
    # Reference values are rounded to 1e-4; its s on paramPoly3 is good to 2 mm.
    rows = [found[name] for name in expected]
    got = np.stack([hits.s_m[rows], hits.t_m[rows], hits.margin_m[rows]], axis=1)
    if expected:
        error = np.abs(got - np.array(list(expected.values())))
        assert error[:, 0].max() < 2e-3
        assert error[:, 1:].max() < 1e-4


def test_containment_on_a_banked_road(network_of, oracle):
    """The reference takes the lateral distance in plan for t; the roll makes the true t longer."""
    network = network_of(BANKED)
    points = np.array([row[:2] for row in oracle(BANKED, "points")["rows"]])
    contain = oracle(BANKED, "second")["contain"]
    some = np.array([p for p, hits in enumerate(contain) if hits])
    s, t = network.road_coordinates("1", points[some])
    roll = network.model.roads["1"].superelevation
    k = np.searchsorted(roll[:, 0], s, side="right") - 1
    ds = s - roll[k, 0]
    angle = roll[k, 1] + ds * (roll[k, 2] + ds * (roll[k, 3] + ds * roll[k, 4]))
    assert np.abs(angle).max() > 0.1
    in_plan = np.array([contain[p][0][2:4] for p in some])
    flat = np.abs(angle) < 1e-9
    np.testing.assert_allclose(s[flat], in_plan[flat, 0], atol=1e-4)
    np.testing.assert_allclose(t * np.cos(angle), in_plan[:, 1], atol=0.05)
    np.testing.assert_allclose(t[flat], in_plan[flat, 1], atol=1e-4)


def test_points_of_the_centre_lines_are_found_in_their_lanes(network_of, map_name):
    """Whatever the shape: a point made from a lane is located in it, also on banked roads."""
    network = network_of(map_name)
    lanes = network.lanes
    rng = np.random.default_rng(7)
    chosen = rng.choice(len(lanes), size=min(150, len(lanes)), replace=False)
    points, expected = [], []
    for lane in chosen.tolist():
        start, end = lanes.s_start_m[lane], lanes.s_end_m[lane]
        s = start + (end - start) * rng.uniform(0.02, 0.98, 4)
        x, y, _, _ = network.center_line(lane, s)
        wide = network.lane_width(lane, s) > 1e-3
        points.append(np.stack([x, y], axis=1)[wide])
        expected += [(lane, at) for at in s[wide]]
    hits = network.locate(np.concatenate(points))
    found = {(int(p), int(lane)): s for p, lane, s in zip(hits.point, hits.lane, hits.s_m, strict=True)}
    for p, (lane, s) in enumerate(expected):
        assert (p, lane) in found, (lanes.key[lane], s)
        # A lane that crosses itself would be found elsewhere; none of these does.
        assert found[p, lane] == pytest.approx(s, abs=1e-5), lanes.key[lane]


def test_batch_and_single_queries_agree(network_of):
    network = network_of("Town04")
    rng = np.random.default_rng(3)
    x_min, y_min, x_max, y_max = network.bounds
    points = rng.uniform((x_min, y_min), (x_max, y_max), (300, 2))
    batch = network.locate(points)
    single = [network.locate(point) for point in points]
    assert batch.lane.tolist() == [lane for hits in single for lane in hits.lane.tolist()]
    near = network.nearest_lane(points)
    assert near.lane.tolist() == [int(network.nearest_lane(point).lane[0]) for point in points]


def test_straight_road(load, text):
    network = load(text.road('<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'))
    left, right = (network.lane_index_of(LaneKey("r", 0, i)) for i in (1, -1))
    hits = network.locate([[10.0, 1.0], [10.0, 0.0], [10.0, -3.5], [10.0, -3.6], [-0.1, 1.0], [100.0, -1.0]])
    assert hits.point.tolist() == [0, 1, 1, 2, 5]
    assert hits.lane.tolist() == [left, *sorted([left, right]), right, right]
    np.testing.assert_allclose(hits.s_m, [10, 10, 10, 10, 100])
    np.testing.assert_allclose(hits.t_m, [1, 0, 0, -3.5, -1], atol=1e-12)
    np.testing.assert_allclose(hits.margin_m, [1, 0, 0, 0, 1], atol=1e-12)


def test_nearest_lane_measures_to_the_border(load, text):
    network = load(text.road('<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'))
    left, right = (network.lane_index_of(LaneKey("r", 0, i)) for i in (1, -1))
    near = network.nearest_lane([[10.0, 5.5], [10.0, -1.0], [103.0, -7.5], [-3.0, 1.0]])
    assert near.found.all()
    assert near.lane.tolist() == [left, right, right, left]
    np.testing.assert_allclose(near.distance_m, [2.0, 0.0, 5.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(near.s_m, [10, 10, 100, 0], atol=1e-9)
    np.testing.assert_allclose(near.t_m, [5.5, -1.0, -7.5, 1.0], atol=1e-9)


def test_the_distance_to_a_slanting_border_is_that_to_the_line(load, text):
    """A lane that widens by 0.4 m per metre: its border is a straight line at an angle to the road."""
    width = text.record("width", 3.0, 0.4)
    plan = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
    network = load(text.road(plan, sections=text.section(right=text.lane(-1, width))))
    x = np.array([20.0, 50.0, 77.0])
    below = np.array([4.0, 0.3, 11.0])
    near = network.nearest_lane(np.stack([x, -(3.0 + 0.4 * x) - below], axis=1))
    np.testing.assert_allclose(near.distance_m, below / np.hypot(1.0, 0.4), atol=1e-9)


def test_nearest_lane_looks_at_the_wanted_types_only(load, text):
    width = text.record("width", 3.0)
    network = load(
        text.road(
            '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>',
            sections=text.section(right=text.lane(-1, width) + text.lane(-2, width, "sidewalk")),
        )
    )
    point = [[50.0, -4.0]]
    assert network.nearest_lane(point).distance_m[0] == pytest.approx(1.0)
    assert network.nearest_lane(point, ("sidewalk",)).distance_m[0] == 0.0
    assert network.nearest_lane(point, "sidewalk").distance_m[0] == 0.0
    assert not network.nearest_lane(point, ("biking",)).found.any()


def test_nearest_lane_is_the_nearest_of_all(network_of):
    """Against a dense sampling of every driving lane."""
    network = network_of("esmini_fabriksgatan")
    lanes = network.lanes
    driving = np.flatnonzero(lanes.lane_type == "driving").tolist()
    samples = []
    for lane in driving:
        s = np.linspace(lanes.s_start_m[lane], lanes.s_end_m[lane], 800)
        left, right = network.borders(lane, s)
        samples.append(np.concatenate([left, right]))
    borders = np.concatenate(samples)
    rng = np.random.default_rng(5)
    x_min, y_min, x_max, y_max = network.bounds
    points = rng.uniform((x_min - 20, y_min - 20), (x_max + 20, y_max + 20), (200, 2))
    near = network.nearest_lane(points)
    to_border = np.array([np.hypot(*(borders - point).T).min() for point in points])
    outside = near.distance_m > 0.0
    assert outside.sum() > 50
    # The ends of the lanes are not sampled: a lane can only be nearer than its borders.
    np.testing.assert_allclose(near.distance_m[outside], to_border[outside], atol=0.15)
    assert (near.distance_m <= to_border + 1e-9).all()


@pytest.mark.parametrize("xy", [[[np.nan, 0.0]], [[np.inf, 0.0]], [1.0, 2.0, 3.0], [[1.0, 2.0, 3.0]], "here"])
def test_bad_points_are_refused(load, text, xy):
    network = load(text.road())
    with pytest.raises(PositionError, match="xy: expected"):
        network.locate(xy)
    with pytest.raises(PositionError, match="xy: expected"):
        network.nearest_lane(xy)


def test_no_points_give_no_hits(load, text):
    network = load(text.road())
    assert network.locate(np.empty((0, 2))).lane.shape == (0,)
    assert network.nearest_lane(np.empty((0, 2))).found.shape == (0,)


HEIGHTS = {"ground": (0.0, "1"), "bridge": (6.0, "2"), "near the ground": (2.5, "1"), "above": (9.0, "2")}


@pytest.mark.parametrize("name", list(HEIGHTS))
def test_heights_tell_a_bridge_from_the_road_below(field_map, name):
    """Road 1 lies at z = 0, road 2 crosses it at z = 6 m."""
    network = field_map("bridge_two_levels")
    z, road = HEIGHTS[name]
    point = [[48.5, -1.5]]
    both = network.locate(point)
    assert {network.lanes.key[lane].road_id for lane in both.lane} == {"1", "2"}
    hits = network.locate(point, z_m=z)
    assert [network.lanes.key[lane].road_id for lane in hits.lane] == [road]
    for options in ({}, {"heading_rad": 0.0}, {"heading_rad": [-np.pi / 2]}):
        nearest = network.nearest_lane(point, z_m=[z], **options)
        assert network.lanes.key[nearest.lane[0]].road_id == road
        assert nearest.distance_m[0] == 0.0


def test_a_point_beside_the_ground_road_is_nearer_to_it_than_to_the_bridge_above(field_map):
    """1.5 m beside the lane of road 1, 0.1 m beside that of the bridge: nearest in space."""
    network = field_map("bridge_two_levels")
    point = [[50.1, 1.5]]
    assert network.lanes.key[network.nearest_lane(point).lane[0]].road_id == "2"
    nearest = network.nearest_lane(point, z_m=0.0)
    assert network.lanes.key[nearest.lane[0]].road_id == "1"
    assert nearest.distance_m[0] == pytest.approx(1.5)


def test_overlapping_roads_are_said(field_map, network_of):
    assert field_map("bridge_two_levels").overlapping_roads == (("1", "2"),)
    assert network_of("Town01").overlapping_roads == ()
    assert network_of("Town04").overlapping_roads


def test_heights_find_the_lane_that_a_point_is_taken_from(network_of):
    """Middles of lanes of a town with bridges, with their own heights: each lies in its lane."""
    network = network_of("Town04")
    borders = network.sampled_borders(20.0)
    middle = 0.5 * (borders.left_m + borders.right_m)
    lane = np.repeat(np.arange(len(network.lanes)), np.diff(borders.first))
    driving = np.flatnonzero(network.lanes.lane_type[lane] == "driving")
    nearest = network.nearest_lane(middle[driving, :2], z_m=middle[driving, 2])
    s, t_inner = nearest.s_m, nearest.t_m
    height = network._geometry.lane_surface(nearest.lane, s, t_inner).z_m
    assert np.abs(height - middle[driving, 2]).max() < 0.05


@pytest.mark.parametrize("z", [[0.0, 1.0], np.nan])
def test_heights_that_do_not_fit_are_refused(field_map, z):
    network = field_map("bridge_two_levels")
    for query in (network.locate, network.nearest_lane):
        with pytest.raises(PositionError, match="z_m"):
            query([[1.0, 1.0]], z_m=z)


def single_points(network, count, seed=3):
    rng = np.random.default_rng(seed)
    low, high = np.reshape(network.bounds, (2, 2))
    anywhere = rng.uniform(low - 20.0, high + 20.0, (count, 2))
    borders = network.sampled_borders(3.0)
    row = rng.integers(0, len(borders.s_m), count)
    share = rng.uniform(-0.3, 1.3, (count, 1))
    beside = borders.left_m[row, :2] + share * (borders.right_m - borders.left_m)[row, :2]
    return np.concatenate([anywhere, beside])


def test_single_queries_say_what_batches_say(network_of, map_name):
    """Anywhere, and on and beside lanes; the first few are answered by arrays in any case."""
    network = network_of(map_name)
    points = single_points(network, 40)
    types = ("driving", "sidewalk", "shoulder")
    many, nearest = network.locate(points), network.nearest_lane(points, types)
    for k, point in enumerate(points.tolist()):
        of_point = many.point == k
        hits = network.locate([point])
        assert hits.lane.tolist() == many.lane[of_point].tolist()
        for name in ("s_m", "t_m", "margin_m"):
            expected = getattr(many, name)[of_point]
            np.testing.assert_allclose(getattr(hits, name), expected, atol=1e-9, err_msg=name)
        single = network.nearest_lane([point], types)
        assert bool(single.found[0]) == bool(nearest.found[k])
        assert single.distance_m[0] == pytest.approx(nearest.distance_m[k], abs=1e-9)
        if single.lane[0] == nearest.lane[k]:
            assert single.s_m[0] == pytest.approx(nearest.s_m[k], abs=1e-9)
            assert single.t_m[0] == pytest.approx(nearest.t_m[k], abs=1e-9)
        else:
            # On the border of two lanes of equal width either may come first.
            keys = [
                network.lanes.key[lane[0 if lane is single.lane else k]]
                for lane in (single.lane, nearest.lane)
            ]
            assert keys[0] != keys[1]


def test_single_poses_are_those_of_batches(network_of, map_name):
    network = network_of(map_name)
    lanes = network.lanes
    rng = np.random.default_rng(5)
    lane = rng.integers(0, len(lanes), 60)
    s = lanes.s_start_m[lane] + rng.uniform(0.0, 1.0, 60) * (lanes.s_end_m - lanes.s_start_m)[lane]
    s[:10] = lanes.s_end_m[lane[:10]]
    expected = np.stack(network.center_line(lane, s))
    # The first few are answered by arrays; numbers of NumPy are numbers.
    places = zip([*lane.tolist(), *lane], [*s.tolist(), *s], strict=True)
    single = np.array([network.center_line(i, at) for i, at in places])
    np.testing.assert_array_equal(single[20:60], single[80:])
    single = single[60:]
    turn = single[:, 3] - expected[3]
    np.testing.assert_allclose(single[:, :3], expected[:3].T, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sin(0.5 * turn)), 0.0, atol=1e-9)
    with pytest.raises(PositionError):
        network.center_line(0, float(lanes.s_end_m[0]) + 1.0)
    with pytest.raises(LaneNotFoundError):
        network.center_line(True, 0.0)


MIXED = """<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="1" length="100" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="100">
 <arc curvature="0.01"/></geometry></planView>
 <lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>
 <lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
 <lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
 </right></laneSection></lanes></road>
<road id="2" length="100" junction="-1"><planView><geometry s="0" x="0" y="-40" hdg="0" length="100">
 <arc curvature="0.005"/></geometry></planView>
 <elevationProfile><elevation s="0" a="1" b="0.02" c="0" d="0"/></elevationProfile>
 <lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
 <lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
 <lane id="-2" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/>
 <height sOffset="0" inner="0.1" outer="0.12"/></lane></right></laneSection></lanes></road></OpenDRIVE>"""


def test_a_banked_road_and_a_kerb_leave_the_others_as_they_are(tmp_path):
    """One road is banked and one lane raised; single queries anywhere say what arrays say."""
    path = tmp_path / "mixed.xodr"
    path.write_text(MIXED, encoding="utf-8")
    network = load_map(path)
    rng = np.random.default_rng(3)
    lane, s_m = rng.integers(0, 3, 60), rng.uniform(0.0, 100.0, 60)
    expected = np.stack(network.center_line(lane, s_m), axis=1)
    single = np.array([network.center_line(i, at) for i, at in zip(lane.tolist(), s_m.tolist(), strict=True)])
    np.testing.assert_allclose(single, expected, atol=1e-9)
    _, numbers = network._lane_poses.stretches[network.lane_index_of(("2", 0, -1))]
    assert numbers
    points = rng.uniform((-10.0, -60.0), (110.0, 60.0), (300, 2))
    points[:60] = expected[:, :2] + rng.normal(0.0, 1.0, (60, 2))
    many, nearest = network.locate(points), network.nearest_lane(points)
    for k, point in enumerate(points.tolist()):
        hits, single_lane = network.locate([point]), network.nearest_lane([point])
        assert hits.lane.tolist() == many.lane[many.point == k].tolist()
        np.testing.assert_allclose(hits.s_m, many.s_m[many.point == k], atol=1e-9)
        assert single_lane.lane[0] == nearest.lane[k]
        assert single_lane.distance_m[0] == pytest.approx(nearest.distance_m[k], abs=1e-9)
