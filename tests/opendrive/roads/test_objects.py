import numpy as np
import pytest
import shapely

from opendrive import LaneKey

PLAN = '<geometry s="0" x="0" y="0" hdg="0.5" length="100"><line/></geometry>'


def on_road(s, t):
    s, t = np.asarray(s, dtype=float), np.asarray(t, dtype=float)
    return np.stack([s * np.cos(0.5) - t * np.sin(0.5), s * np.sin(0.5) + t * np.cos(0.5)], axis=-1)


def crosswalk(body="", attributes=""):
    return f'<objects><object id="c" type="crosswalk" s="40" t="1" {attributes}>{body}</object></objects>'


def test_outline_in_road_coordinates(load, text):
    corners = "".join(
        f'<cornerRoad s="{s}" t="{t}" dz="0"/>' for s, t in ((38, -4), (42, -4), (42, 4), (38, 4))
    )
    network = load(text.road(PLAN, extra=crosswalk(f"<outlines><outline>{corners}</outline></outlines>")))
    (found,) = network.crosswalks
    assert (found.road_id, found.s_m, found.t_m) == ("r", 40.0, 1.0)
    np.testing.assert_allclose(found.polygon, on_road([38, 42, 42, 38], [-4, -4, 4, 4]), atol=1e-12)


def test_outline_in_local_coordinates_is_turned_and_moved(load, text):
    corners = "".join(
        f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in ((5, 1), (-5, 1), (-5, -1), (5, -1), (5, 1))
    )
    quarter = f'hdg="{np.pi / 2!r}"'
    (found,) = load(text.road(PLAN, extra=crosswalk(f"<outline>{corners}</outline>", quarter))).crosswalks
    # A quarter turn takes u to +t and v to -s; the repeated corner is dropped.
    np.testing.assert_allclose(found.polygon, on_road([39, 39, 41, 41], [6, -4, -4, 6]), atol=1e-12)


def test_without_outline_length_and_width_make_a_rectangle(load, text):
    (found,) = load(text.road(PLAN, extra=crosswalk(attributes='length="4" width="2"'))).crosswalks
    assert shapely.Polygon(found.polygon).equals(
        shapely.Polygon(on_road([42, 38, 38, 42], [2, 2, 0, 0]))
    ) or shapely.Polygon(found.polygon).area == pytest.approx(8.0)
    np.testing.assert_allclose(found.polygon.mean(axis=0), on_road(40, 1), atol=1e-12)
    assert not found.polygon.flags.writeable


def test_a_radius_makes_a_circle_and_nothing_makes_no_crosswalk(load, text):
    (found,) = load(text.road(PLAN, extra=crosswalk(attributes='radius="2"'))).crosswalks
    np.testing.assert_allclose(np.hypot(*(found.polygon - on_road(40, 1)).T), 2.0)
    assert load(text.road(PLAN, extra=crosswalk())).crosswalks == ()


def test_crosswalks_of_a_town_lie_on_its_roads(network_of):
    network = network_of("c0910_Town10HD")
    assert len(network.crosswalks) == 16
    for crosswalk in network.crosswalks:
        polygon = shapely.Polygon(crosswalk.polygon)
        assert polygon.is_valid
        assert 10.0 < polygon.area < 120.0
        x_min, y_min, x_max, y_max = polygon.bounds
        grid = np.stack(np.meshgrid(np.linspace(x_min, x_max, 30), np.linspace(y_min, y_max, 30)), axis=-1)
        inside = grid.reshape(-1, 2)[shapely.contains_xy(polygon, grid.reshape(-1, 2))]
        assert (network.nearest_lane(inside).distance_m == 0.0).mean() > 0.4


SIGNAL = (
    '<signals><signal id="7" s="30" t="-5" name="limit" dynamic="no" orientation="+" zOffset="2" country="DE"'
    ' type="274" subtype="50" value="50" unit="km/h"><validity fromLane="-2" toLane="-1"/></signal></signals>'
)
REFERENCE = (
    '<signals><signalReference id="7" s="10" t="3" orientation="-"/>'
    '<signalReference id="8" s="0" t="0"/></signals>'
)


def test_signals_and_references(load, text):
    network = load(text.road(extra=SIGNAL), text.road(road_id="other", extra=REFERENCE))
    (placed,) = network.signals_of("r")
    assert (placed.id, placed.name, placed.type, placed.subtype) == ("7", "limit", "274", "50")
    assert (placed.value, placed.unit, placed.dynamic, placed.orientation) == (50.0, "km/h", False, "+")
    assert (placed.s_m, placed.t_m, placed.is_reference) == (30.0, -5.0, False)
    assert [placed.applies_to(i) for i in (-3, -2, -1, 1)] == [False, True, True, False]
    (referenced,) = network.signals_of("other")
    assert (referenced.id, referenced.s_m, referenced.t_m, referenced.orientation) == ("7", 10.0, 3.0, "-")
    assert referenced.is_reference
    assert referenced.applies_to(5)
    assert network.lane_index_of(LaneKey("other", 0, -1)) >= 0


def test_traffic_lights_of_a_town(network_of):
    network = network_of("c0910_Town10HD")
    signals = [signal for road in network.roads for signal in network.signals_of(road)]
    assert any(signal.dynamic for signal in signals)
    assert any(signal.is_reference for signal in signals)


def test_a_repeated_crosswalk_is_several(field_map):
    crosswalks = field_map("crosswalk_repeat").crosswalks
    assert [crosswalk.s_m for crosswalk in crosswalks] == [20.0, 50.0, 80.0]
    for crosswalk in crosswalks:
        np.testing.assert_allclose(crosswalk.polygon.mean(axis=0), (crosswalk.s_m, 0.0), atol=1e-9)
        assert shapely.Polygon(crosswalk.polygon).area == pytest.approx(40.0)


def test_repeats_change_sizes_and_sides_linearly(load, text):
    """Ten poles that move from t = 2 m to t = 11 m and grow from 1 m to 10 m."""
    repeat = (
        '<repeat s="10" length="90" distance="10" tStart="2" tEnd="11" lengthStart="1" lengthEnd="10"'
        ' widthStart="2" widthEnd="2" zOffsetStart="1" zOffsetEnd="1"/>'
    )
    item = f'<object id="p" type="pole" s="0" t="0">{repeat}</object>'
    network = load(text.road(PLAN, extra=f"<objects>{item}</objects>"))
    assert [item.s_m for item in network.objects] == list(range(10, 101, 10))
    for k, item in enumerate(network.objects):
        assert item.t_m == pytest.approx(2.0 + k)
        assert shapely.Polygon(item.polygon).area == pytest.approx(2.0 * (1.0 + k))
        np.testing.assert_allclose(item.xyz_m, [*on_road(item.s_m, item.t_m), 1.0], atol=1e-9)
        assert item.heading_rad == pytest.approx(0.5)


def test_a_repeat_without_distance_is_one_strip(load, text):
    repeat = '<repeat s="10" length="50" distance="0" tStart="3" tEnd="3" widthStart="0.5" widthEnd="0.5"/>'
    item = f'<object id="b" type="barrier" s="0" t="0">{repeat}</object>'
    network = load(text.road(PLAN, extra=f"<objects>{item}</objects>"))
    (barrier,) = network.objects
    assert shapely.Polygon(barrier.polygon).area == pytest.approx(25.0)
    np.testing.assert_allclose(barrier.polygon.mean(axis=0), on_road(35.0, 3.0), atol=1e-9)


def test_every_outline_counts_and_follows_its_copies(load, text):
    def outline(s):
        corners = ((s, -1), (s + 2, -1), (s + 2, 1), (s, 1))
        return "<outline>" + "".join(f'<cornerRoad s="{a}" t="{b}"/>' for a, b in corners) + "</outline>"

    body = f'<repeat s="40" length="20" distance="20"/><outlines>{outline(39)}{outline(44)}</outlines>'
    network = load(text.road(PLAN, extra=crosswalk(body)))
    centres = [crosswalk.polygon.mean(axis=0) for crosswalk in network.crosswalks]
    np.testing.assert_allclose(centres, on_road([40, 45, 60, 65], [0, 0, 0, 0]), atol=1e-9)


@pytest.mark.parametrize(
    ("repeat", "count", "kinds"),
    [
        ('length="80" distance="0.01"', 8001, []),
        ('length="90" distance="0.001"', 10_000, ["left out"]),
        ('length="1e6" distance="1e-320"', 10_000, ["beyond the road", "left out"]),
        ('length="-3" distance="30"', 1, ["unknown value"]),
        ('length="0" distance="30"', 1, []),
    ],
)
def test_a_repeat_has_as_many_copies_as_it_asks_for_or_says_so(load, text, repeat, count, kinds):
    item = f'<object id="p" type="pole" s="5" t="0"><repeat s="5" {repeat}/></object>'
    network = load(text.road(PLAN, extra=f"<objects>{item}</objects>"))
    assert len(network.objects) == count
    assert sorted(warning.kind.value for warning in network.warnings) == kinds
