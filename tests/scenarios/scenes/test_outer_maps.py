"""Scenes of the full comparison on maps of towns and of a campus, where these lie beside the project."""

import math
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.library import scenario_path
from scenarios.errors import ScenarioError
from scenarios.openscenario import Engine, load
from scenarios.places import Place
from scenarios.scenes.placement import Street, read_place
from scenarios.scenes.scenes import DATA, SceneRun, all_scenes, choose_scenes

OUTER_MAPS = (Path(__file__).parents[3].parent / "shared" / "opendrive" / "maps").resolve()
PLACES = {
    key: entry
    for key, entry in tomllib.loads(DATA.read_text(encoding="utf-8"))["places"].items()
    if "outer" in entry and "at" in entry and "beside" not in entry
}
"""Stretches and turns."""
FILES = {OUTER_MAPS / entry["outer"] for entry in PLACES.values()}

if not all(path.is_file() for path in FILES):
    pytest.skip(f"no maps of towns in {OUTER_MAPS}", allow_module_level=True)

OUTER = [run for run in all_scenes(OUTER_MAPS) if Path(str(dict(run.parameters).get("Map", ""))) in FILES]


def street(key: str) -> Street:
    """A place of the data file."""
    place = read_place(key, PLACES[key], str(OUTER_MAPS / PLACES[key]["outer"]))
    assert isinstance(place, Street)
    return place


TURNS = [street(key) for key, entry in PLACES.items() if "come_from" in entry]


def unbraked(run: SceneRun) -> Engine:
    engine = Engine(load(scenario_path(run.file), dict(run.parameters)))
    engine.run(60.0)
    return engine


@pytest.mark.parametrize("run", OUTER[::4], ids=lambda run: run.name)
def test_the_unbraked_run_shows_what_must_happen(run: SceneRun) -> None:
    engine = unbraked(run)
    assert (engine.contact is not None) == (run.must == "brake")
    assert engine.over


@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.name)
def test_the_ego_turns_by_a_right_angle_before_the_people(turn: Street) -> None:
    run = next(r for r in OUTER if r.scene == "people around a turn" and r.variant.startswith(turn.name))
    values = dict(run.parameters)
    engine = unbraked(run)
    turned = math.remainder(float(engine.entities.boxes.yaw_rad[0]) - float(values["Start_yaw"]), 2 * math.pi)
    assert math.degrees(turned) == pytest.approx(90.0 if "left" in turn.name else -90.0, abs=3.0)


@pytest.mark.parametrize(
    "run", [r for r in OUTER if r.scene == "turn past waiting cars"], ids=lambda run: run.name
)
def test_the_ego_turns_past_cars_that_wait(run: SceneRun) -> None:
    engine = Engine(load(scenario_path(run.file), dict(run.parameters)))
    entities = engine.entities
    at_start, least_m = float(entities.boxes.yaw_rad[0]), np.inf
    cars_m = entities.boxes.center_m[1:].copy()
    while not engine.over:
        engine.advance(0.1)
        entities = engine.entities
        least_m = min(
            least_m, float(np.hypot(*(entities.boxes.center_m[1:] - entities.boxes.center_m[0]).T).min())
        )
    assert engine.contact is None
    turned = math.remainder(float(entities.boxes.yaw_rad[0]) - at_start, 2 * math.pi)
    assert math.degrees(turned) == pytest.approx(90.0 if "left" in run.variant else -90.0, abs=3.0)
    assert entities.boxes.center_m[1:] == pytest.approx(cars_m)
    # the lanes of Town01 are 4 m wide: the ego passes one of them in the lane beside its own
    assert least_m == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    "run", [r for r in OUTER if r.scene == "car ahead turns off"], ids=lambda run: run.name
)
def test_the_car_ahead_leaves_the_way_of_the_ego(run: SceneRun) -> None:
    engine = Engine(load(scenario_path(run.file), dict(run.parameters)))
    at_start = engine.entities.boxes.yaw_rad.copy()
    engine.run(60.0)
    assert engine.over
    assert engine.contact is None
    turned = np.degrees(engine.entities.boxes.yaw_rad - at_start + np.pi) % 360.0 - 180.0
    assert turned == pytest.approx([0.0, 90.0 if "left" in run.variant else -90.0], abs=3.0)


@pytest.mark.parametrize(
    "run", [r for r in OUTER if r.scene == "lane change at road works"], ids=lambda run: run.name
)
def test_the_ego_changes_lanes_where_the_road_marks_let_it(run: SceneRun) -> None:
    values = dict(run.parameters)
    network = load_map(str(values["Map"]))
    engine = Engine(load(scenario_path(run.file), values))
    road, line_m = str(values["Road"]), float(values["Line_s"])
    ways = []
    while not engine.over:
        s, t = network.road_coordinates(road, engine.entities.boxes.center_m[:1])
        ways.append((float(s[0]), float(t[0])))
        engine.advance(0.1)
    assert engine.contact is None
    s_m, t_m = np.array([way for way in ways if way[0] < line_m + 30.0]).T
    # both roads have one lane section
    closed, open_ = (network.lane_index_of((road, 0, lane)) for lane in (-2, -1))
    ((first_m, last_m),) = network.lane_change_ranges(closed, "left")
    from_m, to_m = (float(np.mean(network.lane_offsets(lane, line_m))) for lane in (closed, open_))
    assert (t_m[0], t_m[-1]) == pytest.approx((from_m, to_m), abs=0.15)
    changes = s_m[(np.abs(t_m - from_m) > 0.15) & (np.abs(t_m - to_m) > 0.15)]
    assert first_m < changes.min() < changes.max() < min(last_m, line_m - 10.0)


def test_every_stretch_has_scenes_of_both_kinds() -> None:
    count = Counter((dict(run.parameters)["Map"], run.must) for run in OUTER)
    for path in FILES:
        assert count[str(path), "brake"] >= 1
        assert count[str(path), "nothing"] >= 2


def test_people_stand_on_the_side_they_are_said_to() -> None:
    near, far = (street("Town01 straight").values(side, 50.0) for side in ("near", "far"))
    # Town01, road 8: lanes of 4 m and a gutter of 0.3 m on either side; the ego keeps right
    assert (near["Kerb"], far["Kerb"]) == pytest.approx((-4.3, 4.3))
    assert (near["Out"], far["Out"]) == (-1.0, 1.0)


def test_a_line_that_the_ego_does_not_come_to_is_refused() -> None:
    left, right = TURNS[:2]
    with pytest.raises(ScenarioError, match="from road 24 the ego comes to other roads"):
        Street("wrong", left.map_file, right.place, left.come_from).values("near", 20.0)
    with pytest.raises(ScenarioError, match="no lane 9"):
        Street("wrong", left.map_file, Place("6", 9, 12.0), left.come_from).values("near", 20.0)


def test_the_full_comparison_has_them() -> None:
    chosen = choose_scenes(("crosses",), full=True, maps=OUTER_MAPS)
    assert {run.scene for run in chosen} == {"crosses"}
    assert len(chosen) == 7
