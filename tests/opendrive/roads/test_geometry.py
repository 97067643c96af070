from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import LaneKey, PositionError, RoadNetwork
from opendrive.model import (
    Arc,
    Geometry,
    Header,
    Lane,
    LaneSection,
    Line,
    MapModel,
    ParamPoly3,
    Poly3,
    Road,
    Spiral,
)

EMPTY = np.empty((0, 5))


def made_network(*shapes, length_m=60.0, superelevation=EMPTY, elevation=EMPTY, width_m=3.0):
    """Build a network of one road from shapes laid end to end."""
    pieces, x, y, heading = [], 0.0, 0.0, 0.4
    for k, shape in enumerate(shapes):
        piece = Geometry(k * length_m, x, y, heading, length_m, shape)
        pieces.append(piece)
        at = network_from([*pieces], EMPTY, EMPTY, width_m).roads["r"].reference_line((k + 1) * length_m)
        x, y, heading = float(at.x_m), float(at.y_m), float(at.heading_rad)
    return network_from(pieces, superelevation, elevation, width_m)


def network_from(pieces, superelevation, elevation, width_m):
    width = np.array([[0.0, width_m, 0.0, 0.0, 0.0]])
    lanes = tuple(Lane(i, "driving", False, (), (), width if i else EMPTY, EMPTY) for i in (1, 0, -1))
    road = Road(
        id="r",
        name="",
        length_m=pieces[-1].s_m + pieces[-1].length_m,
        junction_id=None,
        rule="RHT",
        predecessor=None,
        successor=None,
        geometries=tuple(pieces),
        elevation=elevation,
        superelevation=superelevation,
        crossfall_left=EMPTY,
        crossfall_right=EMPTY,
        shape=np.empty((0, 6)),
        lane_offset=EMPTY,
        types=(),
        sections=(LaneSection(0.0, False, lanes),),
    )
    header = Header(1, 8, "", "", "", "", None, None, None, None, "", None)
    return RoadNetwork(MapModel(header, {"r": road}, {}, ()))


@settings(max_examples=60, deadline=None)
@given(
    curvatures=st.lists(st.floats(-0.04, 0.04), min_size=2, max_size=4),
    where=st.lists(st.tuples(st.floats(0.001, 0.999), st.floats(-4.0, 4.0)), min_size=1, max_size=20),
    roll_rad=st.floats(-0.2, 0.2),
)
def test_st_to_xy_and_back_is_the_identity(curvatures, where, roll_rad):
    shapes = [Spiral(a, b) for a, b in pairwise(curvatures)]
    banked = np.array([[0.0, roll_rad, 0.0, 0.0, 0.0]])
    sloping = np.array([[0.0, 1.0, 0.05, 0.0, 0.0]])
    # 20 m pieces turn by less than a radian each, so that no part of the road comes near another.
    network = made_network(*shapes, length_m=20.0, superelevation=banked, elevation=sloping)
    s, t = np.array(where).T
    s = s * network.roads["r"].length_m
    points = network.road_point("r", s, t)
    back_s, back_t = network.road_coordinates("r", np.stack([points.x_m, points.y_m], axis=1))
    np.testing.assert_allclose(back_s, s, atol=1e-7)
    np.testing.assert_allclose(back_t, t, atol=1e-7)


def test_shapes_are_broadcast():
    network = made_network(Line())
    points = network.road_point("r", np.linspace(0, 60, 5)[:, None], np.array([-1.0, 0.0, 1.0]))
    assert points.x_m.shape == (5, 3)
    assert network.road_point("r", 3.0, 1.0).heading_rad.shape == ()
    assert network.road_coordinates("r", np.empty((0, 2)))[0].shape == (0,)


def test_left_is_positive_t():
    points = made_network(Line()).road_point("r", 10.0, 2.0)
    np.testing.assert_allclose(
        [points.x_m, points.y_m],
        [10 * np.cos(0.4) - 2 * np.sin(0.4), 10 * np.sin(0.4) + 2 * np.cos(0.4)],
    )


def test_points_beyond_the_ends_are_held_there():
    network = made_network(Line())
    ahead = np.array([np.cos(0.4), np.sin(0.4)])
    left = np.array([-ahead[1], ahead[0]])
    s, t = network.road_coordinates("r", [-7.0 * ahead + 2.0 * left, 90.0 * ahead - 3.0 * left])
    np.testing.assert_allclose(s, [0.0, 60.0])
    np.testing.assert_allclose(t, [2.0, -3.0])


def test_a_road_that_bends_back_is_searched_as_a_whole():
    network = made_network(Line(), Arc(np.pi / 60.0), Line())
    line = network.roads["r"].reference_line(np.array([5.0, 175.0]))
    s, t = network.road_coordinates("r", np.stack([line.x_m, line.y_m], axis=1))
    np.testing.assert_allclose(s, [5.0, 175.0], atol=1e-9)
    np.testing.assert_allclose(t, 0.0, atol=1e-9)


def test_points_near_the_centre_of_an_arc_find_their_foot():
    network = made_network(Arc(0.1), length_m=30.0)
    points = network.road_point("r", np.linspace(0.5, 29.5, 30), 9.9)
    s, t = network.road_coordinates("r", np.stack([points.x_m, points.y_m], axis=1))
    np.testing.assert_allclose(s, np.linspace(0.5, 29.5, 30), atol=1e-9)
    np.testing.assert_allclose(t, 9.9, atol=1e-9)


def test_superelevation_rolls_the_surface_about_the_reference_line():
    network = made_network(Line(), superelevation=np.array([[0.0, 0.2, 0.0, 0.0, 0.0]]))
    flat = made_network(Line())
    a, b = network.road_point("r", 10.0, 3.0), flat.road_point("r", 10.0, 3.0 * np.cos(0.2))
    np.testing.assert_allclose([a.x_m, a.y_m], [b.x_m, b.y_m])
    assert float(a.z_m) == pytest.approx(3.0 * np.sin(0.2))


def test_positions_off_the_road_are_refused():
    network = made_network(Line())
    with pytest.raises(PositionError, match=r"road 'r': s from 61 .* within \[0, 60\]"):
        network.road_point("r", 61.0, 0.0)
    with pytest.raises(PositionError, match="NaN"):
        network.road_point("r", np.nan, 0.0)
    with pytest.raises(PositionError, match="numbers"):
        network.road_point("r", "ten", 0.0)
    with pytest.raises(PositionError, match=r"shape \(N, 2\), got \(3,\)"):
        network.road_coordinates("r", [1.0, 2.0, 3.0])
    assert float(network.road_point("r", 60.0005, 0.0).x_m) == pytest.approx(60 * np.cos(0.4))


@settings(max_examples=60, deadline=None)
@given(
    curvature=st.floats(0.02, 0.2),
    side=st.sampled_from([-1.0, 1.0]),
    closeness=st.floats(0.9, 0.999),
    share=st.floats(0.01, 0.99),
)
def test_the_inside_of_tight_bends_is_found_too(curvature, side, closeness, share):
    """Up to a thousandth of the radius from the centre, where s hardly moves the point."""
    network = made_network(Arc(side * curvature), length_m=2.0 / curvature)
    s, t = share * 2.0 / curvature, side * closeness / curvature
    point = network.road_point("r", s, t)
    back_s, back_t = network.road_coordinates("r", [[float(point.x_m), float(point.y_m)]])
    assert back_t[0] == pytest.approx(t, abs=1e-9)
    # A rounding error of 1e-14 m beside the centre turns the foot by that over the distance to the centre.
    assert back_s[0] == pytest.approx(s, abs=1e-8)


SHAPES = [
    Line(),
    Arc(0.03),
    Arc(-0.2),
    Spiral(-0.02, 0.06),
    Spiral(0.0, 0.15),
    Poly3((0.0, 0.0, 0.004, -0.0001)),
    ParamPoly3((0.0, 28.0, 1.0, -2.0), (0.0, 0.0, 9.0, -4.0), True),
    ParamPoly3((0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.01, 0.0002), False),
]


@settings(max_examples=80, deadline=None)
@given(
    shapes=st.lists(st.sampled_from(SHAPES), min_size=1, max_size=3),
    where=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-0.95, 0.95)), min_size=1, max_size=12),
    roll_rad=st.sampled_from([0.0, 0.15]),
)
def test_points_of_a_lane_are_located_in_it(shapes, where, roll_rad):
    """Whatever the curve: at the s and t that they were made from."""
    banked = np.array([[0.0, roll_rad, 0.0, 0.0, 0.0]])
    sloping = np.array([[0.0, 1.0, 0.08, 0.0, 0.0]])
    # Cubics end where their arc length does: 25 m are within all of them.
    network = made_network(*shapes, length_m=25.0, superelevation=banked, elevation=sloping)
    s, share = np.array(where).T
    s, t = s * network.roads["r"].length_m, 3.0 * share
    points = network.road_point("r", s, t)
    hits = network.locate(np.stack([points.x_m, points.y_m], axis=1))
    for k in range(len(s)):
        lane = network.lane_index_of(LaneKey("r", 0, 1 if t[k] > 0.0 else -1))
        found = np.flatnonzero((hits.point == k) & (hits.lane == lane))
        # A road that comes round again may cover the point twice; one of the answers is the one asked for.
        assert found.size, (s[k], t[k])
        near = network.road_point("r", hits.s_m[found], hits.t_m[found])
        np.testing.assert_allclose(near.x_m, points.x_m[k], atol=1e-6)
        np.testing.assert_allclose(near.y_m, points.y_m[k], atol=1e-6)
        nearest = network.nearest_lane([[points.x_m[k], points.y_m[k]]])
        assert nearest.distance_m[0] == 0.0


def profiled(load, text, profile, lanes=""):
    lane = text.lane(-1, text.record("width", 3.0))
    plan = '<geometry s="0" x="0" y="0" hdg="0.5" length="100"><line/></geometry>'
    return load(text.road(plan, sections=text.section(right=lane + lanes), extra=profile))


def test_attitude_of_a_plain_slope(load, text):
    network = profiled(
        load, text, '<elevationProfile><elevation s="0" a="2" b="0.1" c="0" d="0"/></elevationProfile>'
    )
    at = network.attitude("r", [0.0, 40.0, 100.0], -1.0)
    np.testing.assert_allclose(at.z_m, [2.0, 6.0, 12.0])
    np.testing.assert_allclose(at.pitch_rad, -np.arctan(0.1), atol=1e-9)
    np.testing.assert_allclose(at.roll_rad, 0.0, atol=1e-9)
    normal = np.array([-0.1 * np.cos(0.5), -0.1 * np.sin(0.5), 1.0]) / np.hypot(1.0, 0.1)
    np.testing.assert_allclose(at.normal, np.tile(normal, (3, 1)), atol=1e-9)


def test_attitude_of_a_banked_and_of_a_crowned_road(load, text):
    lateral = '<lateralProfile><superelevation s="0" a="0.12" b="0" c="0" d="0"/></lateralProfile>'
    at = profiled(load, text, lateral).attitude("r", 50.0, -2.0)
    assert float(at.roll_rad) == pytest.approx(0.12, abs=1e-9)
    assert float(at.z_m) == pytest.approx(-2.0 * np.sin(0.12))
    left = np.array([-np.sin(0.5), np.cos(0.5)])
    np.testing.assert_allclose(at.normal, [*(-np.sin(0.12) * left), np.cos(0.12)], atol=1e-9)
    lateral = '<lateralProfile><crossfall side="both" s="0" a="0.03" b="0" c="0" d="0"/></lateralProfile>'
    at = profiled(load, text, lateral).attitude("r", 50.0, [-2.0, 2.0])
    np.testing.assert_allclose(at.z_m, -2.0 * np.tan(0.03))
    np.testing.assert_allclose(at.roll_rad, [0.03, -0.03], atol=1e-9)
    assert at.normal.shape == (2, 3)


def test_lateral_shapes_are_interpolated_along_the_road(load, text):
    """Flat at the start, a parabola of 0.2 m at t = -2 m at the end."""
    shape = (
        '<shape s="0" t="-5" a="0" b="0" c="0" d="0"/>'
        '<shape s="100" t="-4" a="0.8" b="-0.4" c="0.05" d="0"/>'
        '<shape s="100" t="0" a="0" b="0" c="0" d="0"/>'
    )
    network = profiled(load, text, f"<lateralProfile>{shape}</lateralProfile>")
    z = network.road_point("r", [0.0, 25.0, 50.0, 100.0], -2.0).z_m
    np.testing.assert_allclose(z, np.array([0.0, 0.25, 0.5, 1.0]) * 0.2, atol=1e-12)
    np.testing.assert_allclose(network.road_point("r", 100.0, [1.0, -4.0, -9.0]).z_m, [0.0, 0.8, 0.8])


def test_level_lanes_keep_the_height_of_their_inner_border(load, text):
    level = "".join(
        text.lane(i, text.record("width", 2.0), "sidewalk").replace('level="false"', 'level="true"')
        for i in (-2, -3)
    )
    lateral = '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    network = profiled(load, text, lateral, level)
    z = [float(network.center_line(lane, 50.0)[2]) for lane in range(3)]
    np.testing.assert_allclose(z, [-1.5 * np.sin(0.1), -3.0 * np.sin(0.1), -3.0 * np.sin(0.1)])
    borders = network.sampled_borders()
    np.testing.assert_allclose(borders.right_m[borders.first[1] :, 2], -3.0 * np.sin(0.1))


def test_heights_of_lanes_rise_between_their_borders(load, text):
    height = '<height sOffset="0" inner="0.1" outer="0.3"/><height sOffset="100" inner="0.3" outer="0.3"/>'
    network = profiled(load, text, "", text.lane(-2, text.record("width", 2.0) + height, "sidewalk"))
    assert float(network.center_line(1, 0.0)[2]) == pytest.approx(0.2)
    assert float(network.center_line(1, 50.0)[2]) == pytest.approx(0.25)
    borders = network.sampled_borders(50.0)
    np.testing.assert_allclose(borders.left_m[borders.first[1] :, 2], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(borders.right_m[borders.first[1] :, 2], 0.3)


@settings(max_examples=60, deadline=None)
@given(
    curvature=st.floats(0.02, 0.2),
    side=st.sampled_from([-1, 1]),
    closeness=st.floats(0.9, 0.999),
    where=st.lists(st.tuples(st.floats(0.01, 0.99), st.floats(0.05, 0.999)), min_size=1, max_size=8),
)
def test_lanes_that_reach_almost_to_the_centre_of_a_bend_contain_their_points(
    curvature, side, closeness, where
):
    network = made_network(
        Arc(side * curvature), length_m=2.0 / curvature, width_m=float(closeness / curvature)
    )
    s, share = np.array(where).T
    s, t = s * network.roads["r"].length_m, side * share * closeness / curvature
    points = network.road_point("r", s, t)
    xy = np.stack([points.x_m, points.y_m], axis=1)
    hits = network.locate(xy)
    np.testing.assert_array_equal(hits.point, np.arange(len(s)))
    np.testing.assert_allclose(hits.s_m, s, atol=1e-8)
    np.testing.assert_allclose(hits.t_m, t, atol=1e-9)
    np.testing.assert_array_equal(network.nearest_lane(xy).distance_m, 0.0)


RAISED = (
    '<elevationProfile><elevation s="0" a="2" b="0.1" c="0" d="0"/></elevationProfile><lateralProfile>'
    '<superelevation s="0" a="0.12" b="0" c="0" d="0"/>'
    '<shape s="0" t="-3" a="0.4" b="-0.1" c="0.02" d="0"/></lateralProfile>'
)


def test_the_shape_of_a_banked_road_rises_along_the_rolled_normal(load, text):
    """Turned by roll and grade as one body; a height of 0.4 m at t = -3 m, falling to the left."""
    network = profiled(load, text, RAISED)
    s, t = np.array([0.0, 40.0, 99.0]), np.array([-0.5, -2.0, -2.9])
    height = 0.4 - 0.1 * (t + 3.0) + 0.02 * (t + 3.0) ** 2
    ahead = np.array([1.0, 0.0, 0.1]) / np.hypot(1.0, 0.1)
    level = np.array([0.0, 1.0, 0.0])
    upright = np.cross(ahead, level)
    left = np.cos(0.12) * level + np.sin(0.12) * upright
    normal = np.cos(0.12) * upright - np.sin(0.12) * level
    along, across, up = (t[:, None] * left + height[:, None] * normal).T
    along = along + s
    points = network.road_point("r", s, t)
    cos, sin = np.cos(0.5), np.sin(0.5)
    np.testing.assert_allclose(points.x_m, cos * along - sin * across, atol=1e-12)
    np.testing.assert_allclose(points.y_m, sin * along + cos * across, atol=1e-12)
    np.testing.assert_allclose(points.z_m, 2.0 + 0.1 * s + up, atol=1e-12)
    # The surface's own slope across: dh/dt = -0.1 + 0.04 (t + 3) turns the normal further.
    slope = -0.1 + 0.04 * (t + 3.0)
    tilted = normal - slope[:, None] * left
    tilted /= np.linalg.norm(tilted, axis=1)[:, None]
    expected = np.stack(
        [cos * tilted[:, 0] - sin * tilted[:, 1], sin * tilted[:, 0] + cos * tilted[:, 1], tilted[:, 2]],
        axis=1,
    )
    np.testing.assert_allclose(network.attitude("r", s, t).normal, expected, atol=1e-6)


def test_a_raised_and_banked_road_is_found_again_from_above(load, text):
    network = profiled(load, text, RAISED)
    s, t = (grid.ravel() for grid in np.meshgrid(np.linspace(2.0, 98.0, 9), np.linspace(-2.99, -0.01, 9)))
    points = network.road_point("r", s, t)
    xy = np.stack([points.x_m, points.y_m], axis=1)
    back_s, back_t = network.road_coordinates("r", xy)
    np.testing.assert_allclose(back_s, s, atol=1e-9)
    np.testing.assert_allclose(back_t, t, atol=1e-9)
    hits = network.locate(xy)
    np.testing.assert_array_equal(hits.point, np.arange(len(s)))
    np.testing.assert_allclose(hits.t_m, t, atol=1e-9)


def test_the_nearest_of_many_chords_is_found_far_off_too():
    """A road of 60 straight pieces in a zigzag: shapely projects points onto the same line."""
    corners = np.stack([25.0 * np.arange(61.0), 12.0 * (np.arange(61) % 2)], axis=1)
    steps = np.diff(corners, axis=0)
    length_m = float(np.hypot(25.0, 12.0))
    pieces = [
        Geometry(k * length_m, *corners[k].tolist(), float(np.arctan2(dy, dx)), length_m, Line())
        for k, (dx, dy) in enumerate(steps.tolist())
    ]
    network = network_from(pieces, EMPTY, EMPTY, 3.0)
    rng = np.random.default_rng(0)
    xy = rng.uniform((-50.0, -400.0), (1550.0, 400.0), (200, 2))
    line = shapely.LineString(corners)
    s, _ = network.road_coordinates("r", xy)
    at = network.roads["r"].reference_line(s)
    off_m = np.hypot(at.x_m - xy[:, 0], at.y_m - xy[:, 1])
    np.testing.assert_allclose(off_m, shapely.distance(line, shapely.points(xy)), atol=1e-6)
    # Far off, the lane's outer border is the nearest.
    far = xy + np.array([0.0, 5000.0])
    nearest = network.nearest_lane(far)
    borders = network.sampled_borders(0.1)
    points = np.concatenate([borders.left_m, borders.right_m])[:, :2]
    least = np.array([np.hypot(*(points - point).T).min() for point in far])
    np.testing.assert_allclose(nearest.distance_m, least, atol=0.03)
