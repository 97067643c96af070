import json

import geopandas
import numpy as np
import pytest
import shapely

from opendrive import LaneKey, PositionError

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
        distance = shapely.distance(polygons[lane].exterior, shapely.points(points))
        assert distance.max() <= TOLERANCE_M * 1.01, network.lanes.key[lane]


def test_polygons_contain_the_middle_of_their_lanes(network_of, map_name):
    network = network_of(map_name)
    lanes, polygons = network.lanes, network.lane_polygons()
    borders = network.sampled_borders(5.0)
    middle = 0.5 * (borders.left_m + borders.right_m)[:, :2]
    width = np.linalg.norm((borders.left_m - borders.right_m)[:, :2], axis=1)
    lane = np.repeat(np.arange(len(lanes)), np.diff(borders.first))
    distance = shapely.distance(polygons[lane], shapely.points(middle))
    assert distance[width > 0.2].max() < 1e-6


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
    assert frame.geometry.is_valid.mean() > 0.95
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
        ring = feature["geometry"]["coordinates"][0]
        assert feature["type"] == "Feature"
        assert len(ring) >= 4
        assert ring[0] == ring[-1]
        assert all(7.9 < longitude < 8.1 and 48.9 < latitude < 49.1 for longitude, latitude in ring)
        shape = shapely.LinearRing(ring)
        assert shape.is_ccw or shapely.Polygon(shape).area < 1e-12
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
