from pathlib import Path

import numpy as np
import pytest
import shapely

from opendrive import RoadNetwork, load_map
from smartmot.maps.strips import LaneStrip, StripSet, lane_strip, ring
from smartmot.types import BoolArray, FloatArray

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"
TOWNS = Path(__file__).parents[4] / "shared" / "opendrive" / "maps"
MARGIN = 1.8
BORDER_M = 0.02


def _driving(network: RoadNetwork) -> list[int]:
    lanes = network.lanes
    long = lanes.s_end_m - lanes.s_start_m > 5.0
    return np.flatnonzero((lanes.lane_type == "driving") & long).tolist()


def _points_beside(network: RoadNetwork, lanes: list[int], count: int, reach_m: float) -> FloatArray:
    """Random points up to `reach_m` to both sides of the lanes' centre lines."""
    rng = np.random.default_rng(5)
    made = []
    for lane, n in zip(lanes, rng.multinomial(count, np.full(len(lanes), 1 / len(lanes))), strict=True):
        s = rng.uniform(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane], n)
        x, y, _, heading = network.center_line(lane, s)
        aside = rng.uniform(-reach_m, reach_m, n)
        made.append(np.column_stack((x - np.sin(heading) * aside, y + np.cos(heading) * aside)))
    return np.concatenate(made)


def _members(strips: StripSet, points: FloatArray) -> tuple[BoolArray, BoolArray]:
    """(N, number of strips) in the lane, and in the lane with margins, away from the strips' ends."""
    shape = (len(points), len(strips.strips))
    in_lane, in_margin = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    length = np.array([s.length_m for s in strips.strips])[strips.strip]
    for start in range(0, len(points), 500):
        station, lane, margin = strips.place(points[start : start + 500])
        inner = (station > 1.0) & (station < length - 1.0)
        for where, found in ((in_lane, lane), (in_margin, margin)):
            point, segment = np.nonzero(found & inner)
            where[start + point, strips.strip[segment]] = True
    return in_lane, in_margin


def _doubtful(polygon: shapely.Polygon, strip: LaneStrip, points: FloatArray) -> BoolArray:
    """Points too near the outline, or near the ends, which a strip cuts at right angles to its centre."""
    sites = shapely.points(points)
    ends = shapely.points(strip.center_m[[0, -1]])
    near_end = np.min([shapely.distance(e, sites) for e in ends], axis=0) < 6.0
    return np.asarray((shapely.distance(polygon.boundary, sites) < BORDER_M) | near_end)


@pytest.mark.parametrize("name", ["urban_street", "urban_street_parking", "urban_bend", "urban_intersection"])
def test_membership_against_polygons(name: str) -> None:
    network = load_map(MAPS / f"{name}.xodr")
    lanes = _driving(network)
    strips = StripSet([lane_strip(network, lane, MARGIN) for lane in lanes])
    points = _points_beside(network, lanes, 6000, 7.0)
    in_lane, in_margin = _members(strips, points)
    compared = 0
    for k, lane in enumerate(lanes):
        strip, ends = strips.strips[k], (network.lanes.s_start_m[lane], network.lanes.s_end_m[lane])
        # the shipped maps have parallel borders, so that the margins are constant along a lane
        margins = (strip.vru_left_m[0], strip.vru_right_m[0])
        for found, widened in ((in_lane, (0.0, 0.0)), (in_margin, margins)):
            outline = network.lane_polygon(lane, *ends, *widened, tolerance_m=1e-3)
            polygon = shapely.Polygon(outline)
            sure = ~_doubtful(polygon, strip, points)
            truth = shapely.contains_xy(polygon, points)
            np.testing.assert_array_equal(found[sure, k], truth[sure])
            compared += int(truth[sure].sum())
    assert compared > 4000


@pytest.mark.parametrize("name", ["Town01", "Town04", "Town07"])
def test_membership_against_locate_in_towns(name: str) -> None:
    path = TOWNS / f"{name}.xodr"
    if not path.is_file():
        pytest.skip(f"reference map is absent: {path}")
    network = load_map(path)
    lanes = np.random.default_rng(3).permutation(_driving(network))[:150].tolist()
    strips = StripSet([lane_strip(network, lane, 0.0) for lane in lanes])
    points = _points_beside(network, lanes, 4000, 6.0)
    in_lane = np.zeros((len(points), len(network.lanes)), dtype=np.bool_)
    in_lane[:, lanes] = _members(strips, points)[0]
    hits = network.locate(points)
    start, end = network.lanes.s_start_m[hits.lane], network.lanes.s_end_m[hits.lane]
    inner = (hits.s_m > start + 3.0) & (hits.s_m < end - 3.0) & np.isin(hits.lane, lanes)
    sure = inner & (hits.margin_m > BORDER_M)
    assert sure.sum() > 1000
    assert in_lane[hits.point[sure], hits.lane[sure]].all()
    truth = np.zeros_like(in_lane)
    truth[hits.point, hits.lane] = True
    for point, lane in np.argwhere(in_lane & ~truth):
        outline = network.lane_polygon(lane, network.lanes.s_start_m[lane], network.lanes.s_end_m[lane])
        apart = shapely.Polygon(outline).buffer(0).distance(shapely.Point(points[point]))
        assert apart < 0.05 + BORDER_M, tuple(network.lanes.key[lane])


def test_no_gap_at_joints_on_the_outside_of_a_tight_turn() -> None:
    """Right turn of 10.25 m radius: points along the outer border, densely."""
    network = load_map(MAPS / "urban_intersection.xodr")
    lane = network.lane_index_of(("12", 0, -1))
    angle = np.linspace(0.02, np.pi / 2 - 0.02, 4001)
    outer = np.array([-12.0, -12.0]) + 11.98 * np.column_stack((np.sin(angle), np.cos(angle)))
    strips = StripSet([lane_strip(network, lane, MARGIN)])
    assert strips.place(outer)[1].any(axis=1).all()
    beyond = np.array([-12.0, -12.0]) + 13.75 * np.column_stack((np.sin(angle), np.cos(angle)))
    assert strips.place(beyond)[2].any(axis=1).all()


def test_chords_stay_on_the_centre_line_of_the_bend() -> None:
    network = load_map(MAPS / "urban_bend.xodr")
    for key in (("1", 0, 1), ("1", 0, -1)):
        strip = lane_strip(network, network.lane_index_of(key), 0.0)
        s = np.linspace(0.0, network.roads["1"].length_m, 5001)
        x, y, _, _ = network.center_line(strip.lane, s)
        off = shapely.distance(shapely.LineString(strip.center_m), shapely.points(x, y))
        assert off.max() < 0.012
        assert strip.length_m == pytest.approx(shapely.LineString(np.column_stack((x, y))).length, abs=0.02)


def test_station_and_road_coordinate_in_both_directions() -> None:
    network = load_map(MAPS / "urban_street.xodr")
    along = lane_strip(network, network.lane_index_of(("1", 0, -1)), 0.0)
    against = lane_strip(network, network.lane_index_of(("1", 0, 1)), 0.0)
    assert along.length_m == pytest.approx(600.0)
    assert along.station_at(130.0) == pytest.approx(130.0)
    assert against.station_at(130.0) == pytest.approx(470.0)
    assert against.s_at(470.0) == pytest.approx(130.0)
    np.testing.assert_allclose(against.center_m[0], [600.0, 1.75], atol=1e-9)


def test_margins_are_measured_from_the_sidewalk() -> None:
    for name, right in (("urban_street", 1.8), ("urban_street_parking", 2.0 + 1.8)):
        network = load_map(MAPS / f"{name}.xodr")
        for lane_id in (-1, 1):
            strip = lane_strip(network, network.lane_index_of(("1", 0, lane_id)), MARGIN)
            np.testing.assert_allclose(strip.vru_right_m, right)
            np.testing.assert_allclose(strip.vru_left_m, 1.8)  # the oncoming lane: from the own border


def test_stations_and_borders_by_hand() -> None:
    network = load_map(MAPS / "urban_street.xodr")
    strips = StripSet([lane_strip(network, network.lane_index_of(("1", 0, -1)), MARGIN)])
    points = np.array([[105.3, -1.75], [105.3, -0.01], [105.3, 0.01], [105.3, -3.51], [105.3, -5.29]])
    station, in_lane, in_margin = strips.place(points)
    hit = in_margin.argmax(axis=1)
    np.testing.assert_allclose(station[np.arange(5), hit], 105.3)
    assert in_lane.any(axis=1).tolist() == [True, True, False, False, False]
    assert in_margin.any(axis=1).all()
    assert not strips.place(np.array([[105.3, -5.31], [-0.1, -1.75], [600.1, -1.75]]))[2].any()


@pytest.mark.parametrize("name", ["urban_street", "urban_intersection"])
def test_lanes_and_margins_asked_for_alone_are_those_asked_for_together(name: str) -> None:
    network = load_map(MAPS / f"{name}.xodr")
    strips = StripSet([lane_strip(network, lane, MARGIN) for lane in _driving(network)])
    points = _points_beside(network, _driving(network), 300, 8.0)
    station, in_lane, in_margin = strips.place(points)
    assert 0 < np.count_nonzero(in_lane.any(axis=1)) < np.count_nonzero(in_margin.any(axis=1)) < len(points)
    every = strips.segments()
    for alone, together in ((every.in_lanes, in_lane), (every.in_margins, in_margin)):
        at, inside = alone(points[:, None])
        np.testing.assert_array_equal(at, station)
        np.testing.assert_array_equal(inside, together)


@pytest.mark.parametrize("name", ["urban_street_parking", "urban_intersection", "urban_bend"])
def test_no_circle_that_reaches_into_a_lane_is_left_out(name: str) -> None:
    network = load_map(MAPS / f"{name}.xodr")
    strips = StripSet([lane_strip(network, lane, MARGIN) for lane in _driving(network)])
    rng = np.random.default_rng(3)
    points = _points_beside(network, _driving(network), 200, 8.0)
    radius = rng.uniform(0.0, 6.0, len(points))
    turn = np.pi / 4 * np.arange(8)
    rim = points[:, None] + radius[:, None, None] * np.column_stack((np.cos(turn), np.sin(turn)))
    _, in_lane = strips.segments().in_lanes(rim.reshape(-1, 1, 2))
    reaches = in_lane.reshape(len(points), 8, -1).any(axis=1)
    segments = rng.permutation(reaches.shape[1])
    chosen = strips.segments(segments)
    circle, column = chosen.near(points, radius)
    segment = segments[column]
    near = np.zeros_like(reaches)
    near[circle, segment] = True
    assert len(circle) == near.sum() < near.size
    assert reaches.any()
    assert not (reaches & ~near).any()
    station, inside = chosen.pairs(column).in_lanes(rim[circle])
    expected_m, expected = (
        array.reshape(len(points), 8, -1) for array in strips.segments().in_lanes(rim.reshape(-1, 1, 2))
    )
    np.testing.assert_array_equal(inside, expected[circle, :, segment])
    np.testing.assert_array_equal(station, expected_m[circle, :, segment])


def test_a_width_that_jumps_at_a_corner_does_not_grow_beyond_it() -> None:
    """A lane of 2 m that is 8 m wide after a corner: widths beyond the corner are those at it.

    Carried on along the segment, half the width would grow by 6 m per metre, and on the outside of the corner
    more than the wedge: whatever is aside would be in the lane, however far away.
    """
    center = np.array([[0.0, 0.0], [0.5, 0.0], [10.5, -10.0]])
    half, none = np.array([1.0, 4.0, 4.0]), np.zeros(3)
    station = np.append(0.0, np.cumsum(np.hypot(*np.diff(center, axis=0).T)))
    strips = StripSet([LaneStrip(0, station, center, station, half, none, none)])
    along = np.array([np.cos(3 * np.pi / 8), np.sin(3 * np.pi / 8)])  # halves the outer angle
    points = center[1] + along * np.array([[3.9], [4.5], [30.0], [300.0]])
    for inside in (*strips.place(points)[1:], strips.segments().in_lanes(points[:, None])[1]):
        assert inside.any(axis=1).tolist() == [True, False, False, False]


def test_a_lane_is_sampled_once_per_network_and_margin() -> None:
    first, second = (load_map(MAPS / "urban_street.xodr") for _ in range(2))
    lane = first.lane_index_of(("1", 0, -1))
    assert lane_strip(first, lane, MARGIN) is lane_strip(first, lane, MARGIN)
    assert lane_strip(first, lane, MARGIN) is not lane_strip(second, lane, MARGIN)
    assert lane_strip(first, lane, 0.0).vru_left_m.max() < lane_strip(first, lane, MARGIN).vru_left_m.min()


def test_width_of_a_parking_bay_is_followed(tmp_path: Path) -> None:
    """A bay opens from nothing to 2 m between s = 45 and 48 m; before it the margin starts at the kerb."""
    lane = '<lane id="{}" type="{}" level="false">{}</lane>'
    width = '<width sOffset="{}" a="{}" b="{}" c="0" d="0"/>'.format
    bay = width(0, 0, 0) + width(45, 0, 2 / 3) + width(48, 2, 0)
    right = (
        lane.format(-1, "driving", width(0, 3.5, 0))
        + lane.format(-2, "parking", bay)
        + lane.format(-3, "sidewalk", width(0, 2.5, 0))
    )
    file = tmp_path / "bay.xodr"
    file.write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="100" junction="-1"><planView>'
        '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes>'
        '<laneSection s="0"><center><lane id="0" type="none"/></center>'
        f"<right>{right}</right></laneSection></lanes></road></OpenDRIVE>",
        encoding="utf-8",
    )
    network = load_map(file)
    strips = StripSet([lane_strip(network, network.lane_index_of(("1", 0, -1)), MARGIN)])
    x = np.array([30.0, 44.0, 46.5, 49.0, 70.0])
    edge = 3.5 + np.array([0.0, 0.0, 1.0, 2.0, 2.0]) + MARGIN
    assert strips.place(np.column_stack((x, -edge + 0.02)))[2].any(axis=1).all()
    assert not strips.place(np.column_stack((x, -edge - 0.02)))[2].any()


def test_ring_is_the_lanes_outline() -> None:
    network = load_map(MAPS / "urban_bend.xodr")
    lane = network.lane_index_of(("1", 0, -1))
    strip = lane_strip(network, lane, MARGIN)
    # stations run ahead of s on the outside of the bend
    from_m, to_m = strip.station_at(190.0), strip.station_at(300.0)
    for vru, margins in ((False, (0.0, 0.0)), (True, (1.8, 1.8))):
        mine = shapely.Polygon(ring(strip, from_m, to_m, vru=vru))
        truth = shapely.Polygon(network.lane_polygon(lane, 190.0, 300.0, *margins, tolerance_m=1e-3))
        assert mine.is_valid
        assert mine.symmetric_difference(truth).area < 0.005 * truth.area


def test_empty_set_places_nothing() -> None:
    station, in_lane, in_margin = StripSet([]).place(np.zeros((3, 2)))
    assert station.shape == in_lane.shape == in_margin.shape == (3, 0)


@pytest.mark.parametrize("lane_id", [-1, 1])
@pytest.mark.parametrize("name", ["urban_street", "urban_bend"])
def test_a_part_of_a_strip_holds_what_the_strip_holds_there(name: str, lane_id: int) -> None:
    network = load_map(MAPS / f"{name}.xodr")
    whole = lane_strip(network, network.lane_index_of(("1", 0, lane_id)), MARGIN)
    low, high = 0.31 * whole.length_m, 0.74 * whole.length_m
    part = whole.part(low, high)
    assert part.length_m == pytest.approx(high - low, abs=1e-9)
    assert part.s_m[[0, -1]] == pytest.approx([whole.s_at(low), whole.s_at(high)])
    rng = np.random.default_rng(5)
    points = whole.center_m[rng.integers(0, len(whole.center_m), 400)] + rng.uniform(-6.0, 6.0, (400, 2))
    station, in_lane, in_margin = StripSet([whole]).place(points)
    inside = (station > low + 0.5) & (station < high - 0.5)
    part_station, part_lane, part_margin = StripSet([part]).place(points)
    for mine, theirs in ((part_lane, in_lane), (part_margin, in_margin)):
        clear = (theirs & inside).any(axis=1)
        assert clear.any()
        assert (mine & (part_station > 0.5) & (part_station < part.length_m - 0.5)).any(axis=1)[
            clear
        ].mean() > 0.98
    assert whole.part(-1.0, whole.length_m + 1.0) is whole
