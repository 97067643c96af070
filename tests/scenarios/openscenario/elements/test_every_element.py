"""Each element of the standard that is carried out: a small file of our own, and what it must come to.

One row of `ROWS` is one file on the map of conftest: the ego at x = 10 + 10 t in lane -1 (y = -1.75), a car
that stands at x = 60. What is expected follows by hand from the standard: when the run ends (conditions
stand in its stop trigger), or where entities are. The page docs/openscenario.md lists the same elements.
"""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from scenarios.openscenario import Engine, load
from tests.scenarios.openscenario.conftest import at
from tests.scenarios.openscenario.elements.actions import ACTIONS
from tests.scenarios.openscenario.elements.conditions import CONDITIONS_ON_ENTITIES, CONDITIONS_ON_VALUES
from tests.scenarios.openscenario.elements.places import ENTITIES, POSITIONS, SHAPES
from tests.scenarios.openscenario.elements.row import Row
from tests.scenarios.openscenario.test_refused import DOCUMENT, SCHEMA
from tests.scenarios.openscenario.test_refused import documented as refused

ROWS = [*CONDITIONS_ON_ENTITIES, *CONDITIONS_ON_VALUES, *ACTIONS, *POSITIONS, *SHAPES, *ENTITIES]

ALSO = {
    # beside those of SCHEMA: parents whose children are listed on the page as well
    "LateralAction": "LaneChangeAction LaneOffsetAction LateralDistanceAction",
    "LaneChangeTarget": "AbsoluteTargetLane RelativeTargetLane",
    "LaneOffsetTarget": "AbsoluteTargetLaneOffset RelativeTargetLaneOffset",
    "TrailerAction": "ConnectTrailerAction DisconnectTrailerAction",
    "ControllerAction": "AssignControllerAction OverrideControllerValueAction ActivateControllerAction",
    "TrafficSignalAction": "TrafficSignalStateAction TrafficSignalControllerAction",
    "VariableAction": "SetAction ModifyAction",
    "ParameterAction": "SetAction ModifyAction",
    "ManeuverGroup": "Actors CatalogReference Maneuver",
    "Act": "ManeuverGroup StartTrigger StopTrigger",
}

FIELD = {
    # what other people's files use beyond these elements, by how many of 378 files needed it first: the test
    # that has a small file of it
    "hitch without a trailer": "reading/test_other_tools.py::test_hitches_without_a_trailer_are_noted",
    "controller that is never activated": "running/driving/test_controllers.py::"
    "test_one_that_is_not_activated_changes_nothing",
    "controllers of the ego": "running/driving/test_controllers.py::test_controllers_of_the_ego_are_noted",
    "driver": "running/driving/test_controllers.py::test_a_driver_keeps_the_distance_of_the_model",
    "lane change by time": "running/driving/test_lateral.py::"
    "test_a_change_over_a_time_follows_its_shape_at_the_speed_of_the_entity",
    "lane change by rate": "running/driving/test_lateral.py::"
    "test_a_change_by_rate_has_that_greatest_lateral_speed",
    "lane change by distance": "running/driving/test_lateral.py::"
    "test_a_change_over_a_way_follows_its_shape_along_the_lane",
    "road network without a file": "test_plane.py::test_everybody_goes_straight_on",
    "no entities": "test_bad_files.py::test_a_scenario_without_anybody_takes_place_and_has_nobody_under_test",
    "speed that stays relative": "running/driving/test_speeds.py::"
    "test_a_speed_stays_relative_to_one_that_changes",
    "alongRoute": "running/test_on_road.py::test_a_distance_along_two_roads",
    "coordinate systems of distances": "running/driving/test_separation.py::test_distances_on_a_bend",
    "coordinate systems of angles": "running/driving/test_separation.py::test_angles",
    "triggering entities as actors": "running/test_on_road.py::test_who_triggers_acts",
    "dynamic constraints": "running/driving/test_speeds.py::"
    "test_a_distance_is_reached_within_limits_and_kept",
    "stochastic distributions": "reading/test_distributions.py::"
    "test_drawn_values_have_the_moments_of_their_distribution",
    "deterministic distributions": "reading/test_distributions.py::test_the_last_distribution_varies_fastest",
    "trailer on a bend": "running/driving/test_trailers.py::"
    "test_on_a_circle_the_axle_comes_to_the_circle_of_the_closed_form",
    "closed trajectory": "motion/test_trajectories.py::test_a_closed_polyline_is_followed_round_and_round",
    "negative rate": "test_field.py::test_a_rate_is_an_amount",
    "missing catalog directory": "reading/test_other_tools.py::"
    "test_a_missing_catalog_directory_matters_only_where_it_is_needed",
    "route that begins ahead": "test_field.py::test_a_route_that_begins_ahead_is_driven_to",
    "criteria of CARLA": "running/test_on_road.py::test_criteria_judge_and_do_not_stop",
    "route with a lane change": "motion/test_route_changes.py::"
    "test_a_change_begins_at_once_and_follows_a_cubic",
    "order of initial actions": "running/test_initial.py::test_every_order_gives_the_same_start",
    "parameter declared twice": "reading/test_other_tools.py::"
    "test_a_parameter_declared_twice_with_the_same_value_is_noted",
    "standstill on a timed trajectory": "test_field.py::test_an_entity_waits_on_a_trajectory_with_times",
    "name of a level": "running/test_on_road.py::test_a_road_by_the_name_of_a_level",
    "lane after a trajectory": "motion/test_trajectories.py::"
    "test_after_a_trajectory_the_entity_follows_its_lane",
    "steering to a trajectory": "motion/test_trajectories.py::test_steering_to_a_trajectory_does_not_jump",
}


def written(row: Row, write: Any, folder: Path) -> Path:
    """The file of a row."""
    parts = dict(row.parts)
    acts = parts.pop("acts", ())
    extra = {name: parts.pop(name, "") for name in ("network", "entities", "top", "geo")}
    for name, text in parts.pop("files", {}).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    path: Path = write(*acts, **parts)
    text = path.read_text(encoding="utf-8")
    for mark, inner in (
        ("</RoadNetwork>", extra["network"]),
        ("</Entities>", extra["entities"]),
        ("<CatalogLocations>", extra["top"]),
    ):
        text = text.replace(mark, inner + mark, 1)
    path.write_text(text, encoding="utf-8")
    if extra["geo"]:
        roads = folder / "two_roads.xodr"
        header = '<header revMajor="1" revMinor="6" name="two roads"'
        changed = roads.read_text(encoding="utf-8").replace(
            f"{header}/>", f"{header}>{extra['geo']}</header>"
        )
        roads.write_text(changed, encoding="utf-8")
    return path


def test_the_page_lists_what_is_carried_out_and_each_has_a_row() -> None:
    text = DOCUMENT.read_text(encoding="utf-8").split("### Elements", 1)[1].split("\n## ", 1)[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*) \|$", text, re.MULTILINE)
    listed = {f"{parent}/{child}" for parent, cell in rows for child in re.findall(r"`(\w+)`", cell)}
    standard = {f"{parent}/{child}" for parent, row in (SCHEMA | ALSO).items() for child in row.split()}
    assert listed == standard - {f"{parent}/{child}" for parent, row in refused().items() for child in row}
    covered = {pair for row in ROWS for pair in row.covers.split()}
    assert listed - covered == set()


@pytest.mark.parametrize("what", FIELD)
def test_what_other_files_use_has_a_test_of_its_own(what: str) -> None:
    file, _, name = FIELD[what].partition("::")
    text = (Path(__file__).parents[1] / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {name}\(", text, re.MULTILINE)


@pytest.mark.parametrize("row", ROWS, ids=str)
def test_a_file_comes_to_what_its_row_says(row: Row, write: Any, tmp_path: Path) -> None:
    if "Position/GeoPosition" in row.covers:
        pytest.importorskip("pyproj")
    path = written(row, write, tmp_path)
    tree = etree.parse(path)
    for pair in row.covers.split():
        parent, child = pair.split("/")
        catalog = tmp_path / "shelf" / "things.xosc"
        trees = [tree, *([etree.parse(catalog)] if catalog.is_file() else [])]
        assert any(t.xpath(f"//{parent}/{child}") for t in trees), f"{pair} is not in the file"
    engine = Engine(load(path))
    run = engine.run(12.0)
    assert row.then is None or row.then(engine)
    if row.end_s is not None:
        assert run.stopped
        assert run.end_time_s == pytest.approx(row.end_s, abs=1e-6)
    for (entity, time_s), expected in row.places.items():
        x, y, yaw, v = at(run, entity, time_s)
        for got, value in zip((x, y, v), (expected[0], expected[1], expected[3]), strict=True):
            assert math.isnan(value) or got == pytest.approx(value, abs=2e-3)
        if not math.isnan(expected[2]):
            assert math.remainder(yaw - expected[2], 2 * math.pi) == pytest.approx(0.0, abs=2e-3)
