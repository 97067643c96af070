"""A map in words."""

import math

import pytest

from evaluation.studies.map_description import describe_map, pose_site
from scenarios.errors import ScenarioError
from scenarios.places import Place, lane_at
from scenarios.spec import load_named_map


def test_a_pose_to_look_at_need_not_be_straight() -> None:
    network = load_named_map("urban_bend")
    site = pose_site(network, Place("1", -1, 250.0))
    x, y = (float(v[0]) for v in network.center_line(lane_at(network, Place("1", -1, 250.0)), [250.0])[:2])
    assert math.dist(site.route.pose(site.line_m)[:2], (x, y)) < 0.05
    with pytest.raises(ScenarioError, match="sidewalk; choose a driving lane"):
        pose_site(network, Place("1", -2, 250.0))


def test_a_map_is_described() -> None:
    lines = describe_map(load_named_map("urban_intersection"), None, 50.0)
    assert lines == [
        "map: urban_intersection, 16 roads, 32 lanes: 20 driving, 12 sidewalk",
        "crosswalks: 4, warnings: 0",
    ]


@pytest.mark.parametrize(("road", "kind"), [("1", "traffic_light"), ("2", "stop"), ("4", "give_way")])
def test_the_law_ahead_is_told_with_its_distance(road: str, kind: str) -> None:
    """The stop line is 7 m before the end of the 200 m long arm."""
    network = load_named_map("urban_intersection")
    entering = 1 if road == "4" else -1
    s_m = 100.0
    lines = describe_map(network, pose_site(network, Place(road, entering, s_m)), 50.0)
    assert f"  {kind} in 93.0 m (road {road})" in lines
    assert any(line.startswith("  crosswalk in ") for line in lines)
    assert any(line.startswith("  speed_limit 50 in ") for line in lines)


def test_nothing_to_obey_is_told_too() -> None:
    network = load_named_map("urban_intersection")
    lines = describe_map(network, pose_site(network, Place("1", 1, 100.0)), 50.0)
    assert lines[-1] == "  no regulatory element within 200 m"
