"""The shipped scenarios against closed forms of the protocol's geometry, and how the library lists them."""

import math
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from scenarios.catalogue.library import (
    DEFINITIONS,
    SHIPPED_SCENARIOS,
    describe,
    scenario_name,
    scenario_path,
    shipped_scenario,
)
from scenarios.catalogue.parameters import INTERNAL, MEANINGS
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.distributions import Variation, expand
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Run

KMH = 1 / 3.6
LEAD_S = 2.0
EGO_WIDTH_M = 1.8
ADULT = {"width": 0.5, "ahead": -0.06}
CHILD = {"width": 0.298, "ahead": 0.711 / 2 - 0.396}
CYCLIST = {"width": 0.5, "ahead": 0.62}

CROSSING = {
    # speed km/h, start of the reference point beside the lane centre m, run-up m, from the left, target
    "cpna": (5, 4.0, 1.0, False, ADULT),
    "cpfa": (8, 6.0, 1.5, True, ADULT),
    "cpnco": (5, 4.0, 1.0, False, CHILD),
    "cbna": (15, 24.62, 7.0, False, CYCLIST),
}
ALONG = {
    # speed km/h, run-up m, steady m
    "cpla": (5, 1.0, 10.0),
    "cpla_fcw": (5, 1.0, 10.0),
    "cbla": (15, 3.5, 28.0),
    "cbla_fcw": (20, 6.2, 28.0),
}
GRID = {
    # speeds km/h and impact locations % of Euro NCAP 2023
    "cpna": (range(10, 61, 5), (25, 75)),
    "cpfa": (range(10, 61, 5), (50,)),
    "cpnco": (range(10, 61, 5), (50,)),
    "cbna": (range(10, 61, 5), (50,)),
    "cpla": (range(20, 61, 5), (50,)),
    "cpla_fcw": (range(50, 81, 5), (25,)),
    "cbla": (range(25, 61, 5), (50,)),
    "cbla_fcw": (range(50, 81, 5), (25,)),
}


def runs(name: str) -> list[tuple[Variation, float, float]]:
    """Variations of a test with their test speed in km/h and impact location in %."""
    found = []
    for variation in expand(shipped_scenario(name)):
        values = load(variation.path, variation.parameters).parameters
        found.append((variation, float(values["Ego_speed_kmh"]), float(values["Impact_percent"])))
    return found


def unbraked(variation: Variation, **values: float | str) -> Run:
    return Engine(load(variation.path, {**variation.parameters, **values})).run()


@pytest.mark.parametrize("name", GRID)
def test_grids_are_those_of_the_protocol(name: str) -> None:
    speeds, percents = GRID[name]
    assert sorted((v, p) for _, v, p in runs(name)) == sorted(
        product(map(float, speeds), map(float, percents))
    )


@pytest.mark.parametrize("name", CROSSING)
def test_crossing_targets_meet_the_front_at_the_impact_location(name: str) -> None:
    speed_kmh, offset, run_up, from_left, body = CROSSING[name]
    speed = speed_kmh * KMH
    for variation, ego_kmh, percent in runs(name):
        run = unbraked(variation)
        across = EGO_WIDTH_M * (percent / 100 - 0.5)  # of the counting point at the contact, to the left
        walk = offset + (-across if from_left else across) - body["ahead"]
        assert run.contact_entity == "Target"
        assert run.contact_time_s == pytest.approx(LEAD_S + (walk + run_up) / speed, abs=1e-3)
        assert run.ego_speed_at_contact_kmh == pytest.approx(ego_kmh)
        assert run.target_speed_at_contact_kmh == pytest.approx(speed_kmh)
        assert run.target_start_time_s == pytest.approx(LEAD_S, abs=1e-3)
        # constant acceleration from standstill: twice the time of the distance at full speed
        assert run.target_steady_time_s == pytest.approx(LEAD_S + 2 * run_up / speed, abs=1e-3)
        ego, target = (run.names.tolist().index(n) for n in ("Ego", "Target"))
        k = int(np.searchsorted(run.time_s, run.contact_time_s or 0.0))
        beside = run.y_m[k, target] - run.y_m[k, ego]
        point = beside + body["ahead"] * math.sin(run.yaw_rad[k, target])
        late = (run.time_s[k] - (run.contact_time_s or 0.0)) * speed
        assert point == pytest.approx(across + (-late if from_left else late), abs=1e-3)


@pytest.mark.parametrize("name", ALONG)
def test_targets_ahead_are_reached_after_their_steady_distance(name: str) -> None:
    speed_kmh, run_up, steady = ALONG[name]
    speed = speed_kmh * KMH
    for variation, _, percent in runs(name):
        run = unbraked(variation)
        assert run.contact_time_s == pytest.approx(LEAD_S + (2 * run_up + steady) / speed, abs=1e-3)
        assert run.target_steady_time_s == pytest.approx(LEAD_S + 2 * run_up / speed, abs=1e-3)
        assert run.impact_location_percent == pytest.approx(percent, abs=1e-6)
        assert run.target_speed_at_contact_kmh == pytest.approx(speed_kmh)
        target = run.names.tolist().index("Target")
        walked = run.x_m[-1, target] - run.x_m[0, target]
        assert walked == pytest.approx(
            run_up + speed * (run.end_time_s - LEAD_S - 2 * run_up / speed), abs=1e-3
        )


@pytest.mark.parametrize("ego_kmh", [10, 60])
@pytest.mark.parametrize(("side", "yaw"), [(-1, 0.0), (1, math.pi), (-1, math.pi / 3)])
def test_tests_can_be_moved_turned_and_mirrored(ego_kmh: float, side: int, yaw: float) -> None:
    """Any place, on the road or across a field: the contact is the same, mirrored in left-hand traffic."""
    here = expand(shipped_scenario("crossing"))[0]
    place = {"Line_x": 200.0, "Line_y": 1.75 if yaw > 3 else -1.75, "Line_yaw": yaw, "Side": side}
    moved = unbraked(here, Ego_speed_kmh=ego_kmh, Impact_percent=50 - side * 25, **place)
    usual = unbraked(here, Ego_speed_kmh=ego_kmh, Impact_percent=75)
    assert moved.contact_time_s == pytest.approx(usual.contact_time_s, abs=1e-6)
    shown = usual.impact_location_percent or 0.0
    expected = shown if side < 0 else 100 - shown
    assert moved.impact_location_percent == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("heading_deg", [-10, 20])
def test_the_targets_way_turns_about_the_point_of_impact(side: int, heading_deg: int) -> None:
    """Counter-clockwise where the target comes from the right, mirrored where it comes from the left."""
    here = expand(shipped_scenario("crossing"))[0]
    run = unbraked(here, Ego_speed_kmh=40, Impact_percent=50, Side=side, Target_heading_deg=heading_deg)
    ego, target = (run.names.tolist().index(n) for n in ("Ego", "Target"))
    turn, line_x = math.radians(heading_deg), 450.0
    # 4 m beside the middle of the front before the turn
    assert run.x_m[0, target] - line_x == pytest.approx(4.0 * math.sin(turn))
    assert run.y_m[0, target] - run.y_m[0, ego] == pytest.approx(side * 4.0 * math.cos(turn))
    assert run.yaw_rad[0, target] == pytest.approx(-side * (math.pi / 2 + turn))
    # the corner of the turned box sticks out of its straight half width, so the front meets it earlier
    length, width, ahead = 0.6, 0.5, 0.06
    sticks_out = (
        width / 2 * math.cos(turn) + length / 2 * abs(math.sin(turn)) + ahead * math.sin(turn) - width / 2
    )
    closing = 40 * KMH + 5 * KMH * math.sin(turn)
    straight = LEAD_S + (4.0 + ahead + 1.0) / (5 * KMH)
    assert run.contact_time_s == pytest.approx(straight - sticks_out / closing, abs=1e-3)


def test_parked_cars_stand_as_the_protocol_wants() -> None:
    """1.0 m beside the ego's way, 1.0 m before the child's box and before each other."""
    (variation, *_) = expand(shipped_scenario("cpnco"))
    definition = load(variation.path, variation.parameters)
    boxes = Engine(definition).entities
    at = dict(zip(boxes.name.tolist(), range(len(boxes.name)), strict=True))
    low = boxes.boxes.center_m - boxes.boxes.size_m / 2
    high = boxes.boxes.center_m + boxes.boxes.size_m / 2
    line_x = float(definition.parameters["Line_x"])
    for name in ("Small car", "Large car"):
        assert low[at["Ego"], 1] - high[at[name], 1] == pytest.approx(1.0)
    child_low_x = line_x - CHILD["width"] / 2
    assert child_low_x - high[at["Small car"], 0] == pytest.approx(1.0)
    assert low[at["Small car"], 0] - high[at["Large car"], 0] == pytest.approx(1.0)


def test_every_file_is_listed_and_described() -> None:
    assert {p.stem for p in DEFINITIONS.glob("*.xosc")} == set(SHIPPED_SCENARIOS)
    for name in SHIPPED_SCENARIOS:
        found = describe(name)
        assert found.name == name
        assert found.runs == len(expand(shipped_scenario(name)))
        assert found.text
        names = [parameter.name for parameter in found.parameters]
        assert names[0] == "Ego_speed_kmh"
        assert {"Map", "Line_x", "Line_y", "Line_yaw"} <= set(names)
        assert not any(key.startswith("_") or key in INTERNAL for key in names)
    by_name = {parameter.name: parameter for parameter in describe("cpfa").parameters}
    speed = by_name["Target_speed_kmh"]
    assert (speed.value, speed.unit, speed.text) == ("8", "km/h", "speed of the target")


def test_every_declared_parameter_is_explained_or_follows_from_others() -> None:
    """Names with a unit in them have that unit."""
    declared = {
        node.get("name", "")
        for path in DEFINITIONS.glob("*.xosc")
        for node in ElementTree.parse(path).iter("ParameterDeclaration")
        if not node.get("name", "").startswith("_")
    }
    assert declared == set(MEANINGS) | INTERNAL
    assert not set(MEANINGS) & INTERNAL
    ends = {"_kmh": "km/h", "_deg": "degrees", "_percent": "%", "_s": "s"}
    for name, meaning in MEANINGS.items():
        assert meaning.text
        for end, unit in ends.items():
            assert not name.endswith(end) or meaning.unit == unit, name


def test_parameters_of_a_users_file_have_their_type(tmp_path: Path) -> None:
    (tmp_path / "other.xosc").write_text((DEFINITIONS / "pass_through.xosc").read_text("utf-8"), "utf-8")
    by_name = {parameter.name: parameter for parameter in describe(str(tmp_path / "other.xosc")).parameters}
    gap = by_name["Gap"]
    assert (gap.value, gap.kind, gap.unit, gap.text) == ("4.5", "double", "", "")


def test_names_and_paths_find_each_other(tmp_path: Path) -> None:
    for name in SHIPPED_SCENARIOS:
        assert scenario_name(scenario_path(name)) == name
    other = tmp_path / "cpna.xosc"
    assert scenario_name(other) == str(other)
    assert scenario_path(str(other)) == other
    with pytest.raises(ScenarioError, match="no shipped scenario 'x'; there are: cpna_paper, cpna"):
        shipped_scenario("x")


def test_what_a_scenario_cannot_be_is_refused() -> None:
    for values in (
        {"Impact_percent": 101},
        {"Ego_speed_kmh": 0},
        {"From_near_side": 2},
        {"Target_offset": -1},
    ):
        with pytest.raises(ScenarioError, match=next(iter(values))):
            load(shipped_scenario("crossing"), values)
