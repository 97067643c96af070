from pathlib import Path

import pytest

from opendrive import RoadNetwork, load_map
from smartmot.maps.regulatory import RegulatoryElement, regulatory_elements
from smartmot.maps.route import Route, route_ahead, route_from_lanes

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"
CAMPUS = Path(__file__).parents[4] / "shared" / "opendrive" / "maps" / "CampusUAH_v1_7.xodr"


def _brief(elements: tuple[RegulatoryElement, ...]) -> list[tuple[str, float, float | None]]:
    return [(e.kind, pytest.approx(e.distance_m, abs=1e-6), e.value) for e in elements]


def _street(lane_id: int) -> tuple[RoadNetwork, Route]:
    network = load_map(MAPS / "urban_street.xodr")
    lane = network.lane_index_of(("1", 0, lane_id))
    return network, route_ahead(network, lane, float(network.lanes.s_start_m[lane]), 0.0)


def _across(arm: str, lane_id: int) -> tuple[RoadNetwork, Route]:
    network = load_map(MAPS / "urban_intersection.xodr")
    s = 0.0 if lane_id < 0 else 200.0
    return network, route_ahead(network, network.lane_index_of((arm, 0, lane_id)), s, 400.0)


def test_street_in_both_directions() -> None:
    """Sign at s = 20 m eastwards, at 580 m westwards; the crosswalk's middle is at 560 m."""
    assert _brief(regulatory_elements(*_street(-1), 5.0, 595.0)) == [
        ("speed_limit", 15.0, 50.0),
        ("crosswalk", 555.0, None),
    ]
    assert _brief(regulatory_elements(*_street(1), 5.0, 595.0)) == [
        ("speed_limit", 15.0, 50.0),
        ("crosswalk", 35.0, None),
    ]


def test_only_what_lies_ahead_and_in_sight() -> None:
    network, route = _street(-1)
    assert regulatory_elements(network, route, 20.1, 500.0) == ()
    assert _brief(regulatory_elements(network, route, 20.0, 10.0)) == [("speed_limit", 0.0, 50.0)]
    assert regulatory_elements(network, route, 500.0, 59.9) == ()
    assert _brief(regulatory_elements(network, route, 500.0, 60.1)) == [("crosswalk", 60.0, None)]


@pytest.mark.parametrize(
    ("arm", "lane_id", "sign"), [("1", -1, None), ("2", -1, "stop"), ("3", 1, None), ("4", 1, "give_way")]
)
def test_intersection_from_every_arm(arm: str, lane_id: int, sign: str | None) -> None:
    """From 150 m on the arm: light and sign 7 m and crosswalk 4 m before the junction of 24 m; after it the
    crosswalk 4 m and the speed sign 20 m further on. What faces the other direction is left out."""
    network, route = _across(arm, lane_id)
    found = _brief(regulatory_elements(network, route, 150.0, 200.0))
    rules = [("traffic_light", 43.0, None)] + ([(sign, 43.0, None)] if sign else [])
    assert sorted(found[: len(rules)], key=lambda e: e[0]) == sorted(rules, key=lambda e: e[0])
    assert found[len(rules) :] == [
        ("crosswalk", 46.0, None),
        ("crosswalk", 50.0 + 24.0 + 4.0, None),
        ("speed_limit", 50.0 + 24.0 + 20.0, 50.0),
    ]


def test_a_sign_where_two_sections_meet_counts_once(tmp_path: Path) -> None:
    lane = '<lane id="-1" type="driving"><link>{}</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    section = '<laneSection s="{}"><center><lane id="0" type="none"/></center><right>{}</right></laneSection>'
    file = tmp_path / "sections.xodr"
    file.write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="100" junction="-1"><planView>'
        '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes>'
        + section.format(0, lane.format('<successor id="-1"/>'))
        + section.format(40, lane.format('<predecessor id="-1"/>'))
        + "</lanes><signals>"
        '<signal id="7" s="40" t="-4" orientation="+" dynamic="no" type="206" subtype="-1"/>'
        '<signal id="8" s="40" t="-4" orientation="none" dynamic="no" type="274" value="30" subtype="-1"/>'
        '<signal id="9" s="40" t="-4" orientation="-" dynamic="no" type="205" subtype="-1"/>'
        "</signals></road></OpenDRIVE>",
        encoding="utf-8",
    )
    network = load_map(file)
    route = route_from_lanes(network, [network.lane_index_of(("1", k, -1)) for k in (0, 1)])
    assert sorted(_brief(regulatory_elements(network, route, 10.0, 50.0)), key=lambda e: e[0]) == [
        ("speed_limit", 30.0, 30.0),
        ("stop", 30.0, None),
    ]


def test_campus_has_crosswalks_and_traffic_lights() -> None:
    if not CAMPUS.is_file():
        pytest.skip(f"reference map is absent: {CAMPUS}")
    network = load_map(CAMPUS)
    kinds: set[str] = set()
    for lane in range(len(network.lanes)):
        if network.lanes.lane_type[lane] != "driving":
            continue
        start = "s_start_m" if network.lanes.direction[lane] > 0 else "s_end_m"
        route = route_ahead(network, lane, float(getattr(network.lanes, start)[lane]), 0.0)
        elements = regulatory_elements(network, route, 0.0, route.length_m)
        distances = [e.distance_m for e in elements]
        assert distances == sorted(distances)
        assert len(elements) == len(set(elements))
        kinds |= {e.kind for e in elements}
        for element in elements:
            x, y, _ = route.pose(element.distance_m)
            cx, cy, _, _ = network.center_line(lane, element.s_m)
            assert (x, y) == pytest.approx((float(cx), float(cy)), abs=0.05)
    assert {"crosswalk", "traffic_light"} <= kinds
