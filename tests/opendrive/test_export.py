import itertools
import json

import geopandas
import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from opendrive import LaneKey, PositionError, load_map, write_mesh

TOLERANCE_M = 0.02


def test_polygons_keep_to_the_tolerance(network_of, map_name):
    """The chords depart from the borders by the tolerance at most; checked at every half metre."""
    network = network_of(map_name)
    polygons = network.lane_polygons(TOLERANCE_M)
    assert len(polygons) == len(network.lanes)
    borders = network.sampled_borders(0.5)
    first = borders.first
    for lane in range(0, len(polygons), max(1, len(polygons) // 80)):
        rows = slice(first[lane], first[lane + 1])
        points = np.concatenate([borders.left_m[rows, :2], borders.right_m[rows, :2]])
        wide = np.linalg.norm((borders.left_m - borders.right_m)[rows, :2], axis=1) > TOLERANCE_M
        if not wide.any() or polygons[lane].is_empty:
            continue
        points = points[np.tile(wide, 2)]
        distance = shapely.distance(polygons[lane].boundary, shapely.points(points))
        assert distance.max() <= TOLERANCE_M * 1.01, network.lanes.key[lane]


def test_polygons_contain_the_middle_of_their_lanes(network_of, map_name):
    network = network_of(map_name)
    lanes, polygons = network.lanes, network.lane_polygons()
    borders = network.sampled_borders(5.0)
    middle = 0.5 * (borders.left_m + borders.right_m)[:, :2]
    width = np.linalg.norm((borders.left_m - borders.right_m)[:, :2], axis=1)
    lane = np.repeat(np.arange(len(lanes)), np.diff(borders.first))
    # Town04 has roads of micrometres.
    width[(lanes.s_end_m - lanes.s_start_m)[lane] < 1e-3] = 0.0
    distance = shapely.distance(polygons[lane], shapely.points(middle))
    assert distance[width > 0.2].max() < 2e-6


def rings_of(geometry):
    """Outer rings of a GeoJSON polygon or multi-polygon."""
    one = geometry["type"] == "Polygon"
    return [rings[0] for rings in ([geometry["coordinates"]] if one else geometry["coordinates"])]


def areas(network):
    """Areas of lanes in closed form, (1 - kappa t) dt ds by quadrature; and which lanes fold in a bend."""
    geometry, lanes = network._geometry, network.lanes
    lane, low, high = geometry.knots(np.arange(len(lanes)))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    area, folds = np.zeros(len(lanes)), np.zeros(len(lanes), dtype=bool)
    for node, weight in zip(nodes, weights, strict=True):
        s = 0.5 * (low + high) + 0.5 * (high - low) * node
        inner, outer = network.lane_offsets(lane, s)
        bend = geometry.curves.evaluate(lanes.road[lane], s).curvature_per_m
        per_m = lanes.side[lane] * (outer - inner - 0.5 * bend * (outer**2 - inner**2))
        np.add.at(area, lane, 0.5 * (high - low) * weight * per_m)
        folds[lane[(bend * outer >= 1.0) | (bend * inner >= 1.0)]] = True
    return area, folds


def ring_areas(network):
    """Areas between the borders of lanes, from points every 5 cm; and where borders run back or cross."""
    borders = network.sampled_borders(0.05)
    area, runs_back = np.zeros(len(network.lanes)), np.zeros(len(network.lanes), dtype=bool)
    for lane, (start, end) in enumerate(itertools.pairwise(borders.first.tolist())):
        left, right = borders.left_m[start:end, :2], borders.right_m[start:end, :2]
        x, y = np.concatenate([right, left[::-1]]).T
        area[lane] = abs(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
        along = np.einsum("ij,ij->i", np.diff(left, axis=0), np.diff(right, axis=0))
        runs_back[lane] = (along < 0.0).any()
    return area, runs_back | (least_widths(network) < 0.0)


def least_widths(network):
    lanes = network.lanes
    share = np.linspace(0.0, 1.0, 33)
    s_m = lanes.s_start_m[:, None] + share * (lanes.s_end_m - lanes.s_start_m)[:, None]
    lane = np.broadcast_to(np.arange(len(lanes))[:, None], s_m.shape)
    return network.lane_width(lane, s_m).min(axis=1)


@settings(max_examples=40, deadline=None)
@given(
    start=st.floats(-0.05, 0.05),
    end=st.floats(-0.05, 0.05),
    inner=st.floats(0.0, 3.0),
    width=st.floats(0.5, 4.0),
    more=st.floats(-0.4, 3.0),
    side=st.sampled_from([-1, 1]),
)
@example(start=0.0, end=-2.3e-313, inner=0.0, width=1.0, more=0.0, side=-1)  # no radius of that curvature
def test_areas_of_lanes_beside_clothoids(text, tmp_path_factory, start, end, inner, width, more, side):
    """In closed form: a cubic from one width to the other, and curvature linear in s; nothing folds."""
    length = 60.0
    shape = f'<spiral curvStart="{start!r}" curvEnd="{end!r}"/>'
    plan = f'<geometry s="0" x="0" y="0" hdg="0.7" length="{length}">{shape}</geometry>'
    opening = text.record("width", width, 0.0, 3.0 * more / length**2, -2.0 * more / length**3)
    lanes = text.lane(side, text.record("width", inner)) + text.lane(2 * side, opening)
    lanes = text.section(**{"left" if side > 0 else "right": lanes})
    path = tmp_path_factory.getbasetemp() / "clothoid.xodr"
    path.write_text(text.document(text.road(plan, lanes, length=length)), encoding="utf-8")
    network = load_map(path)
    lane = network.lane_index_of(("r", 0, 2 * side))
    polygon = network.lane_polygons()[lane]
    share = np.linspace(0.0, 1.0, 20_001)
    across = width + more * (3.0 * share**2 - 2.0 * share**3)
    near, far = inner * side, (inner + across) * side
    bend = start + (end - start) * share
    per_m = side * (far - near - 0.5 * bend * (far**2 - near**2))
    assert polygon.is_valid
    assert polygon.area == pytest.approx(np.trapezoid(per_m, share) * length, rel=1e-3)


def test_every_outline_is_valid_and_as_large_as_its_lane(network_of, map_name):
    network = network_of(map_name)
    polygons = network.lane_polygons()
    assert shapely.is_valid(polygons).all()
    own, runs_back = ring_areas(network)
    # Town04 has lanes of micrometres.
    long = (network.lanes.s_end_m - network.lanes.s_start_m > 1e-3) & ~runs_back
    np.testing.assert_allclose(shapely.area(polygons)[long], own[long], rtol=1e-3, atol=1e-4)
    if not network._geometry.is_banked:
        area, folds = areas(network)
        # Single pieces of a few millimetres stand at an angle to each other in CARLA's towns.
        wide = (area > 0.01) & ~folds
        np.testing.assert_allclose(shapely.area(polygons)[wide], area[wide], rtol=1e-3, atol=0.01)
    assert geopandas.GeoDataFrame(network.lane_table(), geometry="geometry").union_all().is_valid


def test_a_lane_that_opens_is_as_wide_as_it_is(field_map):
    """40 m without width, a wedge of 10 m, 50 m of 3 m."""
    network = field_map("opening_lane_polygon")
    (outline,) = network.lane_polygons()
    assert outline.is_valid
    assert outline.area == pytest.approx(0.5 * 10.0 * 3.0 + 50.0 * 3.0)
    (feature,) = network.to_geojson()["features"]
    assert shapely.geometry.shape(feature["geometry"]).equals(outline)


def test_a_bend_tighter_than_the_lane_clips_it_at_its_centre(field_map):
    """Two straights of 5 m with 1.7 m, and a quarter of a disc of 4 m - 2.5 m radius; the rest overlaps."""
    network = field_map("tight_corner_polygon")
    shoulder, sidewalk = network.lane_polygons(1e-3)
    assert shoulder.is_valid
    assert sidewalk.is_valid
    assert shoulder.area == pytest.approx(2 * 5.0 * 2.5 + 0.25 * np.pi * (4.0**2 - 1.5**2), rel=1e-3)
    assert sidewalk.area == pytest.approx(2 * 5.0 * 1.7 + 0.25 * np.pi * 1.5**2 - 0.2 * 0.2, rel=1e-3)


@pytest.mark.parametrize(
    ("records", "parts", "area_m2"),
    [
        (((0.0, 0.0),), 0, 0.0),
        (((-1.0, 0.0),), 0, 0.0),
        (((1.0, -0.02),), 1, 25.0),  # 1 m to -1 m: half of the road has a lane
        (((1.0, -0.02), (1.0, 0.0, 90.0)), 2, 35.0),
        (((2.0, -0.02, 0.0), (0.0, 0.02, 50.0)), 2, 100.0),
    ],
)
def test_lanes_of_little_width(load, text, records, parts, area_m2):
    widths = "".join(text.record("width", a, b, s=where[0] if where else 0.0) for a, b, *where in records)
    network = load(text.road(sections=text.section(right=text.lane(-1, widths))))
    (outline,) = network.lane_polygons()
    assert outline.is_valid
    assert len([part for part in shapely.get_parts(outline) if not part.is_empty]) == parts
    assert outline.area == pytest.approx(area_m2, abs=1e-2)


def test_a_road_that_ends_where_it_starts(load, text):
    """A road that ends where it starts, as the only road of a roundabout."""
    radius, width = 20.0, 4.0
    length = 2 * np.pi * radius
    plan = f'<geometry s="0" x="0" y="0" hdg="0" length="{length!r}"><arc curvature="0.05"/></geometry>'
    lanes = text.section(right=text.lane(-1, text.record("width", width)))
    (outline,) = load(text.road(plan, lanes, length=length)).lane_polygons()
    assert outline.is_valid
    assert outline.area == pytest.approx(np.pi * ((radius + width) ** 2 - radius**2), rel=1e-3)


def test_polygons_and_single_outlines_agree(network_of):
    network = network_of("Town01")
    polygons = network.lane_polygons(0.05)
    for lane in range(0, len(network.lanes), 17):
        start, end = network.lanes.s_start_m[lane], network.lanes.s_end_m[lane]
        ring = shapely.Polygon(network.lane_polygon(lane, start, end))
        assert shapely.hausdorff_distance(polygons[lane].exterior, ring.exterior) < 0.06


def test_sampled_borders_are_those_of_single_queries(network_of, map_name):
    network = network_of(map_name)
    borders = network.sampled_borders(1.0)
    lanes = network.lanes
    assert borders.first[-1] == len(borders.s_m) == len(borders.left_m) == len(borders.right_m)
    for lane in range(0, len(lanes), max(1, len(lanes) // 50)):
        rows = slice(borders.first[lane], borders.first[lane + 1])
        s = borders.s_m[rows]
        assert (s[0], s[-1]) == (lanes.s_start_m[lane], lanes.s_end_m[lane])
        assert np.diff(s).max() <= 1.0 + 1e-9
        left, right = network.borders(lane, s)
        np.testing.assert_allclose(borders.left_m[rows, :2], left, atol=1e-9)
        np.testing.assert_allclose(borders.right_m[rows, :2], right, atol=1e-9)
        z = network.center_line(lane, s)[2]
        # On a crowned or banked road the middle is not half-way up; none of the maps is crowned.
        np.testing.assert_allclose(0.5 * (borders.left_m[rows, 2] + borders.right_m[rows, 2]), z, atol=1e-9)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_bad_steps_are_refused(load, text, value):
    network = load(text.road())
    with pytest.raises(PositionError, match="step_m"):
        network.sampled_borders(value)
    with pytest.raises(PositionError, match="tolerance_m"):
        network.lane_polygons(value)


def test_columns_make_a_geopandas_frame(network_of):
    network = network_of("Town01")
    frame = geopandas.GeoDataFrame(network.lane_table(), geometry="geometry")
    assert len(frame) == len(network.lanes)
    row = frame.iloc[7]
    assert LaneKey(row.road_id, row.section, row.lane_id) == network.lanes.key[7]
    assert frame.geometry.is_valid.all()
    straight = frame[(frame.lane_type == "driving") & (frame.area > 100.0)]
    length = straight.s_end_m - straight.s_start_m
    assert ((straight.area / length) < 6.0).all()
    assert frame.successors[7] == list(network.successors(7))


def test_geojson_is_valid(network_of, tmp_path):
    """RFC 7946: closed rings, counter-clockwise, longitude before latitude; the file says the same."""
    network = network_of("Town01")
    collection = network.to_geojson(tmp_path / "map.geojson")
    assert json.loads((tmp_path / "map.geojson").read_text(encoding="utf-8")) == collection
    assert collection["type"] == "FeatureCollection"
    assert "coordinateFrame" not in collection
    for feature in collection["features"]:
        assert feature["type"] == "Feature"
        for ring in rings_of(feature["geometry"]):
            assert len(ring) >= 4
            assert ring[0] == ring[-1]
            assert all(7.9 < longitude < 8.1 and 48.9 < latitude < 49.1 for longitude, latitude in ring)
            assert shapely.LinearRing(ring).is_ccw
    x, y, _, _ = network.center_line(3, network.lanes.s_start_m[3])
    latitude, longitude = network.to_geographic([[float(x), float(y)]])
    outline = shapely.Polygon(collection["features"][3]["geometry"]["coordinates"][0])
    assert outline.distance(shapely.Point(longitude[0], latitude[0])) < 1e-7
    frame = geopandas.GeoDataFrame.from_features(collection, crs="EPSG:4326")
    assert len(frame) == len(network.lanes)


def test_geojson_without_a_reference_is_local_and_says_so(load, text):
    collection = load(text.road()).to_geojson()
    assert "metres" in collection["coordinateFrame"]
    assert collection["features"][0]["properties"]["speed_limit_mps"] is None
    assert collection["features"][0]["geometry"]["coordinates"][0][0] == pytest.approx([10.0, 5.0], abs=4.0)


def test_a_map_without_lanes_exports_nothing(load, text):
    network = load(text.road(sections=text.section()))
    assert network.to_geojson()["features"] == []
    assert len(network.sampled_borders().s_m) == 0


def read_obj(path):
    """Vertices, and triangles by group, of an OBJ file."""
    vertices, groups = [], {}
    for line in path.read_text(encoding="utf-8").splitlines():
        word, _, values = line.partition(" ")
        if word == "v":
            vertices.append([float(value) for value in values.split()])
        elif word == "g":
            name = values
        elif word == "f":
            groups.setdefault(name, []).append([int(value) - 1 for value in values.split()])
    return np.array(vertices), {name: np.array(faces) for name, faces in groups.items()}


def test_a_mesh_is_the_surface_of_the_lanes(load, text, tmp_path):
    """A road that climbs by 10 % and is banked by 0.1 rad on a bend; z and areas in closed form."""
    profile = f"<elevationProfile>{text.record('elevation', 1.0, 0.1)}</elevationProfile>"
    plan = '<geometry s="0" x="0" y="0" hdg="0" length="100"><arc curvature="0.01"/></geometry>'
    network = load(text.road(plan, extra=profile))
    count = write_mesh(network, tmp_path / "road.obj", 0.5)
    vertices, groups = read_obj(tmp_path / "road.obj")
    assert sum(map(len, groups.values())) == count
    assert sorted(groups) == ["r/0/-1 driving", "r/0/1 driving"]
    for name, side in (("r/0/1 driving", 1.0), ("r/0/-1 driving", -1.0)):
        a, b, c = np.moveaxis(vertices[groups[name]], 1, 0)
        normal = np.cross(b - a, c - a)
        assert (normal[:, 2] > 0.0).all()
        in_plan = 3.5 * 100.0 - 0.01 * side * 0.5 * 3.5**2 * 100.0
        assert 0.5 * normal[:, 2].sum() == pytest.approx(in_plan, rel=1e-4)
        s = np.arctan2(a[:, 0], 100.0 - a[:, 1]) * 100.0
        np.testing.assert_allclose(a[:, 2], 1.0 + 0.1 * s, atol=1e-3)


def test_a_mesh_of_a_town_covers_its_lanes(network_of, tmp_path):
    network = network_of("Town01")
    write_mesh(network, tmp_path / "town.obj")
    vertices, groups = read_obj(tmp_path / "town.obj")
    a, b, c = np.moveaxis(vertices[np.concatenate(list(groups.values()))][..., :2], 1, 0)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
    assert area == pytest.approx(shapely.area(network.lane_polygons()).sum(), rel=2e-3)


def test_center_lines_run_the_way_of_the_traffic(network_of):
    network = network_of("Town01")
    lines = network.center_lines(2.0)
    for lane in range(0, len(network.lanes), 23):
        rows = slice(lines.first[lane], lines.first[lane + 1])
        x, y, z, heading = network.center_line(lane, lines.s_m[rows])
        np.testing.assert_allclose(lines.xyz_m[rows], np.stack([x, y, z], axis=1), atol=1e-9)
        np.testing.assert_allclose(lines.heading_rad[rows], heading, atol=1e-9)
        np.testing.assert_allclose(lines.width_m[rows], network.lane_width(lane, lines.s_m[rows]))
        steps = np.diff(lines.xyz_m[rows, :2], axis=0)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)[:-1]
        assert ((steps * ahead).sum(axis=1) > 0.0).all()
