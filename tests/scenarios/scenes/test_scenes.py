"""Scenes: what must happen in them happens when nobody brakes; places; maps."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.library import scenario_path
from scenarios.errors import ScenarioError
from scenarios.openscenario import Engine, load
from scenarios.places import Place
from scenarios.scenes import scenes
from scenarios.scenes.placement import Street, read_place
from scenarios.scenes.scene_maps import MAPS, SPIRAL_M, STRAIGHT_M, bend_length_m, build_maps
from scenarios.scenes.scenes import SceneRun, all_scenes, choose_scenes, left_out
from scenarios.scenes.traffic import TRAFFIC, TrafficScene, build_scene

OUTER_MAPS = Path(__file__).parents[3].parent / "shared" / "opendrive" / "maps"
SHORT = choose_scenes()
REST = [run for run in all_scenes() if not run.default]


def unbraked(run: SceneRun) -> Engine:
    engine = Engine(load(scenario_path(run.file), dict(run.parameters)))
    engine.run(60.0)
    return engine


@pytest.mark.parametrize("run", [*SHORT, *REST[::7]], ids=lambda run: run.name)
def test_the_unbraked_run_shows_what_must_happen(run: SceneRun) -> None:
    engine = unbraked(run)
    assert (engine.contact is not None) == (run.must == "brake")
    assert engine.over  # by its own stop trigger, not the time limit
    assert max(abs(engine.entities.speed_mps[0] * 3.6 - run.speed_kmh), 0.0) < 1e-6


def test_names_are_unique_and_both_kinds_are_there() -> None:
    names = [run.name for run in all_scenes()]
    assert len(set(names)) == len(names)
    assert {run.must for run in SHORT} == {"brake", "nothing"}


def test_a_crossing_meets_the_middle_of_the_ego() -> None:
    # the pedestrian is at the lane's centre when the ego's front is at the line; its box is touched half its
    # width earlier, and in a bend the ego's front is beside the lane's centre
    for run in choose_scenes(("crosses in a bend",), full=True):
        contact = unbraked(run).contact
        assert contact is not None
        assert 35.0 < contact.impact_location_percent < 65.0


@pytest.mark.parametrize("gap", [0.3, 1.5])
def test_who_stops_before_the_road_stands_that_far_from_the_kerb(gap: float) -> None:
    run = next(
        r
        for r in all_scenes()
        if r.scene == "stops before the road" and dict(r.parameters)["Stop_gap"] == gap
    )
    engine = unbraked(run)
    values = dict(run.parameters)
    y_m = float(engine.entities.reference_m[1, 1])
    # the urban street runs along x, so that y is t
    assert y_m == pytest.approx(float(values["Kerb"]) + float(values["Out"]) * gap, abs=1e-6)
    assert engine.entities.speed_mps[1] == 0.0


@pytest.mark.parametrize("radius", sorted(SPIRAL_M))
def test_a_bend_turns_by_a_right_angle_with_its_radius(radius: float) -> None:
    network = load_map(MAPS / f"bend_{radius:.0f}.xodr")
    s = np.array([0.0, STRAIGHT_M + bend_length_m(radius) / 2, 2 * STRAIGHT_M + bend_length_m(radius)])
    heading = network.road_point("1", s, np.zeros(3)).heading_rad
    assert math.remainder(float(heading[-1] - heading[0]) - math.pi / 2, 2 * math.pi) == pytest.approx(
        0.0, abs=1e-9
    )
    # the curvature in the middle of the arc, from the circle through three points 2 m apart
    near = s[1] + np.array([-2.0, 0.0, 2.0])
    points = network.road_point("1", near, np.zeros(3))
    x, y = np.asarray(points.x_m), np.asarray(points.y_m)
    sides = [math.dist((x[i], y[i]), (x[j], y[j])) for i, j in ((0, 1), (1, 2), (0, 2))]
    area = abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])) / 2
    assert math.prod(sides) / (4 * area) == pytest.approx(radius, rel=1e-6)


def test_shipped_maps_are_what_the_builder_writes() -> None:
    built = build_maps()
    assert {path.stem for path in MAPS.glob("*.xodr")} == set(built)
    for name, content in built.items():
        assert (MAPS / f"{name}.xodr").read_bytes() == content


def test_place_values_of_the_straight_street() -> None:
    # lane -1 of the urban street: centre at y = -1.75, kerbs at -3.5 and 3.5
    street = Street("straight", "../maps/urban_street.xodr", Place("1", -1, 400.0))
    near, far = (street.values(side, 70.0) for side in ("near", "far"))
    assert (near["Kerb"], near["Out"], near["Lane_to_kerb"]) == (-3.5, -1.0, 1.75)
    assert (far["Kerb"], far["Out"], far["Lane_to_kerb"]) == (3.5, 1.0, 5.25)
    assert (near["Start_x"], near["Start_y"], near["Along"]) == (330.0, -1.75, 1.0)
    assert street.computed("near") == {"lane_t": -1.75, "other_kerb": 3.5, "other_to_kerb": 5.25}


def test_place_values_against_s() -> None:
    street = Street("back", "../maps/urban_street.xodr", Place("1", 1, 400.0))
    values = street.values("near", 70.0)
    assert (values["Along"], values["Kerb"], values["Out"]) == (-1.0, 3.5, 1.0)
    assert (values["Start_x"], values["Start_y"]) == (470.0, 1.75)


def test_a_way_that_does_not_fit_is_refused() -> None:
    street = Street("short", "../maps/urban_street.xodr", Place("1", -1, 50.0))
    with pytest.raises(ScenarioError, match="begins 50 m before the line; the scene needs 70"):
        street.values("near", 70.0)


def recording(name: str) -> tuple[TrafficScene, Path]:
    """A scene with its map."""
    (scene,) = (scene for scene in TRAFFIC if scene.name == name)
    path = scene.map_path(OUTER_MAPS)
    if path is None:
        pytest.skip(f"no {scene.map_name} in {OUTER_MAPS}")
    return scene, path


@pytest.mark.parametrize("name", ["traffic_bend_1", "traffic_town_1", "traffic_campus_1"])
def test_recorded_traffic_is_what_the_recorder_writes(name: str) -> None:
    assert build_scene(*recording(name)) == (MAPS.parent / f"{name}.xosc").read_bytes()


@pytest.mark.parametrize(
    "name", ["traffic_two_lanes_1", "traffic_bend_2", "traffic_town_1", "traffic_campus_1"]
)
def test_recorded_traffic_moves_and_keeps_clear_of_the_ego(name: str) -> None:
    scene, path = recording(name)
    values = {"Map": str(path.resolve())} if scene.outer else {}
    engine = Engine(load(MAPS.parent / f"{name}.xosc", values))
    start = engine.entities.boxes.center_m.copy()
    length = engine.entities.boxes.size_m[0, 0]
    while not engine.over:
        engine.advance(0.5)
        entities = engine.entities
        heading = entities.boxes.yaw_rad[0]
        offset = entities.boxes.center_m[1:] - entities.boxes.center_m[0]
        ahead = offset @ np.array([np.cos(heading), np.sin(heading)])
        aside = offset @ np.array([-np.sin(heading), np.cos(heading)])
        near = (np.abs(aside) < 1.8) & (np.abs(ahead) < 30.0)
        # 1.2 s at the speed of the one behind, 36 km/h and more
        assert (np.abs(ahead[near]) - length > 10.0).all()
    assert engine.contact is None
    moved = np.hypot(*(engine.entities.boxes.center_m - start).T)
    # at no less than half the ego's speed, slowed down by who is ahead
    assert moved[0] > 100.0
    assert (moved > 0.5 * moved[0]).all()


def test_unknown_scene() -> None:
    with pytest.raises(ScenarioError, match="no scene 'nowhere'"):
        choose_scenes(("nowhere",))


def test_every_scene_file_is_used() -> None:
    files = {Path(run.file).stem for run in all_scenes()}
    shipped = {path.stem for path in MAPS.parent.glob("*.xosc")}
    outer = {scene.name for scene in TRAFFIC if scene.outer}
    assert shipped - outer == {name for name in files if name in shipped}


# ---- the data file -----------------------------------------------------------------------------------------


def test_without_outer_maps_it_is_said_what_is_left_out(tmp_path: Path) -> None:
    lines = left_out(full=True)
    assert [line.split(" (")[0] for line in lines] == [
        "left out: 36 variants on Town01.xodr",
        "left out: 30 variants on Town03.xodr",
        "left out: 11 variants on c0910_Town10HD.xodr",
        "left out: 25 variants on CampusUAH_v1_7.xodr",
    ]
    assert all(line.endswith("; give its folder with --maps") for line in lines)
    (tmp_path / "Town01.xodr").touch()
    assert [line.split(" (")[0] for line in left_out(full=True, maps=tmp_path)] == [
        line.split(" (")[0] for line in lines[1:]
    ]
    assert left_out(("crosses",), full=True, maps=tmp_path)[0] == (
        f"left out: 2 variants on Town03.xodr (crosses); it is not in {tmp_path}"
    )
    assert left_out() == []


def test_scenes_of_outer_maps_alone_are_refused_without_them() -> None:
    with pytest.raises(ScenarioError, match="only the full comparison has crosses: add --full"):
        choose_scenes(("crosses", "two at once"))
    with pytest.raises(ScenarioError, match="only outer maps have crosses: give their folder with --maps"):
        choose_scenes(("crosses", "two at once"), full=True)


ROW = """
[places]
"here" = { map = "../maps/urban_street.xodr", at = ["1", -1, 400] }
[[table]]
scene = "a"
must = "nothing"
file = "standing.xosc"
columns = ["place", "side", "Ego_speed_kmh"]
rows = [["here", "near", 50]]
"""


@pytest.mark.parametrize(
    ("text", "instead", "message"),
    [
        ('must = "nothing"', 'must = "wait"', "must is 'wait'; write one of: brake, nothing"),
        ('"near", 50', '"left", 50', "side is 'left'; write near or far"),
        ('[["here"', '[["there"', "there is no place 'there'"),
        ("standing.xosc", "sitting.xosc", "there is no file sitting.xosc"),
        ('"near", 50', '"near"', "zip"),
        ('scene = "a"', 'scene = "a"\nlead = 5', "lead is not understood"),
        ('scene = "a"', "", "scene"),
        ('"near", 50', '"near", true', "expected a number or a text, got True"),
    ],
)
def test_mistakes_in_the_data_file_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, instead: str, message: str
) -> None:
    path = tmp_path / "scenes.toml"
    path.write_text(ROW.replace(text, instead))
    monkeypatch.setattr(scenes, "DATA", path)
    scenes._data.cache_clear()
    scenes._rows.cache_clear()
    try:
        with pytest.raises(ScenarioError, match=rf"table 1, row 1: .*{re.escape(message)}"):
            choose_scenes()
    finally:
        scenes._data.cache_clear()
        scenes._rows.cache_clear()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"at": ["1", -1, 400], "speed": 3}, "place 'x': speed is not understood"),
        ({"at": ["1", -1]}, "place 'x': not enough values"),
        ({"bend_m": 45, "turn": "left", "into_m": 20}, "place 'x': 45"),
    ],
)
def test_mistakes_in_a_place_are_named(entry: dict[str, object], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        read_place("x", entry, "maps/street_cycle.xodr")
