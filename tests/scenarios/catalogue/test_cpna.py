"""CPNA: the paper's table, the Euro NCAP impact points, and where a test can take place."""

import math
from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from scenarios.catalogue.cpna import LEAD_S, CpnaTest, build, find_site
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import ScenarioError
from scenarios.places import Site
from scenarios.presets import PAPER, PHYSICAL, preset_in_weather
from scenarios.simulation.ends import StopRule
from scenarios.simulation.outcome import Outcome
from scenarios.strategies import make_strategy
from scenarios.weather import WEATHER
from smartmot.geometry import signed_gap
from smartmot.types import Boxes

PUBLIC_MAPS = Path(__file__).parents[4] / "shared" / "opendrive" / "maps"
KMH = 1 / 3.6
WALK_MPS = 5 * KMH
ADULT_REFERENCE_M = -0.06
"""The H-point of the Euro NCAP adult, in front of its box centre."""
EGO_LENGTH_M, EGO_WIDTH_M = 4.4, 1.8


def street(name: str = "urban_street") -> RoadNetwork:
    return load_map(shipped_map(name))


@pytest.fixture(scope="module")
def site() -> Site:
    return find_site(street(), 80.0)


@pytest.fixture(scope="module")
def left_hand_site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """The same street where traffic keeps left."""
    text = shipped_map("urban_street").read_text()
    count = text.count("<road ")
    turned = text.replace('rule="RHT"', 'rule="LHT"')
    assert turned.count('rule="LHT"') == count > 0
    path = tmp_path_factory.mktemp("maps") / "left_hand.xodr"
    path.write_text(turned)
    return find_site(load_map(path), 60.0)


# ---- the paper's table -------------------------------------------------------------------------------------

PUBLISHED_IMPACT_KMH = {("rectangular", 50): 23.82, ("rectangular", 60): 44.23, ("map", 80): 39.78}
DECISIVE = [("rectangular", 40), ("rectangular", 50), ("rectangular", 60), ("map", 70), ("map", 80)]
"""The last speed without contact and those with one; the whole table is in evaluation/test_runner.py."""


@pytest.mark.parametrize("seed", range(5))
def test_first_contact_and_impact_speeds_are_those_published(site: Site, seed: int) -> None:
    rule = StopRule(time_limit_s=5.8)  # then the pedestrian has left the ego's path
    for name, speed in DECISIVE if seed == 0 else DECISIVE[1:]:
        test = CpnaTest(speed, seed=seed)
        outcome = build(test, site, PAPER, make_strategy(name, PAPER, site), rule).run()
        published = PUBLISHED_IMPACT_KMH.get((name, speed))
        if published is None:
            assert outcome.contact_time_s is None, f"{name}: contact at {speed} km/h"
        else:
            tolerance = 3.0 if name == "rectangular" else 4.0
            assert outcome.impact_speed_mps / KMH == pytest.approx(published, abs=tolerance)


# ---- Euro NCAP impact points -------------------------------------------------------------------------------


def at_contact(outcome: Outcome) -> tuple[float, float, float]:
    """Where the H-point met the front, in % of the width from the right edge, from the log's ground truth.

    Also the box's near face ahead of the front, metres, and the walking direction across (left positive).
    """
    table = outcome.log.table()
    last = table["time_s"] == outcome.contact_time_s
    ego = {k: float(table[k][last & (table["kind"] == "ego")][0]) for k in ("x_m", "y_m", "yaw_rad")}
    person = {k: float(table[k][last & (table["label"] == "target")][0]) for k in ("x_m", "y_m", "yaw_rad")}
    x = person["x_m"] + ADULT_REFERENCE_M * math.cos(person["yaw_rad"])
    y = person["y_m"] + ADULT_REFERENCE_M * math.sin(person["yaw_rad"])
    c, s = math.cos(ego["yaw_rad"]), math.sin(ego["yaw_rad"])
    ahead = c * (x - ego["x_m"]) + s * (y - ego["y_m"])
    left = -s * (x - ego["x_m"]) + c * (y - ego["y_m"])
    across = math.sin(person["yaw_rad"] - ego["yaw_rad"])
    return 100 * (left / EGO_WIDTH_M + 0.5), ahead - 0.25 - EGO_LENGTH_M / 2, across


@pytest.mark.parametrize("speed_kmh", [10, 40, 60])
@pytest.mark.parametrize("percent", [10, 25, 50, 75, 90])
def test_reference_point_meets_the_front_at_the_impact_location(
    site: Site, percent: float, speed_kmh: float
) -> None:
    outcome = build(CpnaTest(speed_kmh, percent), site, PHYSICAL, None).run()
    assert outcome.contact_time_s is not None
    share, gap, across = at_contact(outcome)
    assert share == pytest.approx(percent, abs=1.0)
    assert gap == pytest.approx(0.0, abs=1e-4)
    assert across == pytest.approx(1.0)  # from the right to the left
    # box centre starts 4 m beside, its reference 0.06 m behind; 1 m of run-up costs the time of another metre
    walk = 4.0 + 0.06 + EGO_WIDTH_M * (percent / 100 - 0.5)
    assert outcome.contact_time_s == pytest.approx(LEAD_S + (walk + 1.0) / WALK_MPS, abs=1e-3)


@pytest.mark.parametrize("percent", [10, 25, 50, 75, 90])
def test_impact_location_is_from_the_right_where_traffic_keeps_left(
    left_hand_site: Site, percent: float
) -> None:
    assert left_hand_site.near_side == 1
    outcome = build(CpnaTest(40, percent), left_hand_site, PHYSICAL, None).run()
    share, gap, across = at_contact(outcome)
    assert share == pytest.approx(percent, abs=1.0)
    assert gap == pytest.approx(0.0, abs=1e-4)
    assert across == pytest.approx(-1.0)  # from the left to the right


def test_left_hand_traffic_gives_the_paper_test_mirrored(site: Site, left_hand_site: Site) -> None:
    one, other = (
        build(CpnaTest(60), place, PAPER, make_strategy("map", PAPER, place), StopRule(6.0)).run()
        for place in (site, left_hand_site)
    )
    assert one.contact_time_s is other.contact_time_s is None
    assert other.flag_time_s == pytest.approx(one.flag_time_s, abs=0.11)


def test_the_pedestrian_starts_four_metres_beside_the_lane_centre_and_walks_across(site: Site) -> None:
    table = build(CpnaTest(30), site, PAPER, None).run().log.table()
    rows = table["label"] == "target"
    path = [site.route.project(*p) for p in zip(table["x_m"][rows], table["y_m"][rows], strict=True)]
    station, offset = np.array(path).T
    assert station == pytest.approx(site.line_m)
    assert offset[0] == pytest.approx(-4.0)
    assert (np.diff(offset) >= 0).all()
    assert set(zip(table["length_m"][rows], table["width_m"][rows], strict=True)) == {(0.6, 0.5)}
    walking = table["speed_mps"][rows][table["time_s"][rows] > LEAD_S + 0.05]
    assert walking == pytest.approx(WALK_MPS)


# ---- bystanders, weather, names ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["urban_street", "urban_street_parking", "urban_intersection"])
def test_bystanders_stand_off_the_lane_and_not_in_each_other(name: str) -> None:
    place = find_site(street(name), 60.0)
    table = build(CpnaTest(60.0, adversaries="static"), place, PAPER, None).run().log.table()
    rows = (table["label"] == "other") & (table["time_s"] == 0.0)
    assert set(table["category"][rows].tolist()) == {"car", "pedestrian"}
    boxes = Boxes(
        np.column_stack((table["x_m"], table["y_m"]))[rows],
        np.column_stack((table["length_m"], table["width_m"]))[rows],
        table["yaw_rad"][rows],
    )
    offset = np.array([place.route.project(*p)[1] for p in boxes.center_m])
    lane_half_m = 1.75
    assert (np.abs(offset) - boxes.size_m[:, 1] / 2 > lane_half_m).all()
    assert (offset < 0).any()
    assert (offset > 0).any()
    for i in range(len(boxes)):
        for j in range(i):
            one, other = ((b.center_m, b.size_m, b.yaw_rad) for b in (boxes[[i]], boxes[[j]]))
            assert signed_gap(*one, *other).item() > 0.0


@pytest.mark.parametrize("name", ["Town01", "Town03", "Town04", "CampusUAH_v1_7", "esmini_soderleden"])
@pytest.mark.parametrize("strategy", ["rectangular", "map"])
def test_nobody_is_braked_for_before_the_pedestrian_starts_on_public_maps(name: str, strategy: str) -> None:
    file = PUBLIC_MAPS / f"{name}.xodr"
    if not file.is_file():
        pytest.skip(f"map {name}.xodr is not in ../shared/opendrive/maps")
    place = find_site(load_map(file), 40.0)
    area = make_strategy(strategy, PAPER, place)
    outcome = build(CpnaTest(40.0, adversaries="static"), place, PAPER, area).run()
    assert outcome.target_start_time_s is not None
    assert outcome.flag_time_s is not None
    assert outcome.flag_time_s > outcome.target_start_time_s
    assert outcome.contact_time_s is None


def test_bystanders_do_not_change_the_contact(site: Site) -> None:
    plain, full = (build(CpnaTest(50, adversaries=a), site, PAPER, None).run() for a in ("none", "static"))
    assert full.contact_time_s == plain.contact_time_s
    assert full.contact is not None
    assert full.contact.entity == "Target"


@pytest.mark.parametrize("weather", ["wet", "snow"])
def test_weather_reduces_the_deceleration_of_the_run(site: Site, weather: str) -> None:
    preset = preset_in_weather(PHYSICAL, WEATHER[weather])
    outcome = build(CpnaTest(60.0), site, preset, make_strategy("map", preset, site)).run()
    table = outcome.log.table()
    hardest = -np.nanmin(table["accel_mps2"][table["kind"] == "ego"])
    assert hardest == pytest.approx(8.8 * WEATHER[weather].friction / 0.9, rel=1e-6)


def test_worse_friction_means_a_harder_impact(site: Site) -> None:
    impacts = []
    for name in ("dry", "snow"):
        preset = preset_in_weather(PHYSICAL, WEATHER[name])
        impacts.append(
            build(CpnaTest(60.0), site, preset, make_strategy("map", preset, site)).run().impact_speed_mps
        )
    assert impacts[0] < impacts[1]


def test_too_little_road_for_the_run_in_is_refused(site: Site) -> None:
    near = Site(site.network, site.route, 40.0, -1)
    with pytest.raises(ScenarioError, match=r"80 km/h needs .* of road .* offers 40 m"):
        build(CpnaTest(80.0), near, PAPER, None)


def test_names() -> None:
    assert CpnaTest(50.0).name == "CPNA"
    assert CpnaTest(50.0, 25.0).name == "CPNA-25"


def test_unknown_strategy_is_refused(site: Site) -> None:
    with pytest.raises(ScenarioError, match="unknown strategy 'circle'; use one of: rectangular, map, all"):
        make_strategy("circle", PAPER, site)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"speed_kmh": 0.0}, "test speed"),
        ({"speed_kmh": -10.0}, "test speed"),
        ({"speed_kmh": 140.5}, "test speed"),
        ({"speed_kmh": math.nan}, "test speed"),
        ({"speed_kmh": 50.0, "impact_point_percent": 101.0}, "impact point"),
        ({"speed_kmh": 50.0, "impact_point_percent": -1.0}, "impact point"),
        (
            {"speed_kmh": 50.0, "adversaries": "moving"},
            "unknown adversaries 'moving'; use one of: none",
        ),
    ],
)
def test_impossible_tests_are_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        CpnaTest(**values)
