"""One run as a value: what determines it, on which map and in which light, and its row."""

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

from evaluation.runs.execution import execute
from evaluation.runs.specs import perception_notes
from evaluation.runs.workers import execute_all
from scenarios.catalogue.library import DEFINITIONS
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import (
    Act,
    Action,
    Event,
    Maneuver,
    ManeuverGroup,
    NamedAction,
    RelativeSpeed,
    ScenarioDefinition,
    SpeedAction,
    Story,
    TeleportAction,
)
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.presets import PHYSICAL
from scenarios.spec import (
    NO_AEB,
    RunSpec,
    definition_of,
    environment_notes,
    initial_speed_kmh,
    map_view_of,
    perception_map,
    preset_of,
)
from scenarios.weather import NIGHT, WEATHER, is_night

NCAP = Path(__file__).parents[4] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"
CPNA = RunSpec("CPNA", "crossing", (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)


def with_values(**values: float | str) -> RunSpec:
    return dataclasses.replace(CPNA, parameters=tuple(values.items()))


@pytest.fixture(scope="module")
def track() -> RunSpec:
    """A scenario on a lane 28 m wide."""
    file = NCAP / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc"
    if not file.is_file():
        pytest.skip(f"no reference scenarios at {NCAP}")
    return dataclasses.replace(CPNA, file=str(file), parameters=(("Ego_speed_kph", 50.0),))


def test_the_map_is_laid_over_a_test_track_alone(track: RunSpec) -> None:
    assert perception_map(definition_of(track), None) == "euro_ncap_street"
    assert perception_map(definition_of(track), "urban_street") == "urban_street"
    assert perception_map(definition_of(CPNA), None) is None


def test_the_ego_of_a_test_track_drives_in_a_lane_of_the_street(track: RunSpec) -> None:
    scene = map_view_of(track)
    assert scene.network.name == "euro_ncap_street"
    (lane,) = scene.route.lanes
    assert float(scene.network.lane_width(lane, 100.0)) == pytest.approx(3.5)
    # the test path: middle of a lane of 28 m to the right of the reference line
    assert scene.route.project(100.0, -14.0)[1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("lux", "night"), [(100_000, False), (2000, False), (0.1, True), (0, True)])
def test_dark_is_night(lux: float, night: bool) -> None:
    assert is_night(definition_of(with_values(Illuminance=lux))) == night


def test_night_limits_the_sensor_that_needs_light() -> None:
    dark = dataclasses.replace(with_values(Illuminance=0.1), night="camera")
    assert preset_of(dark, definition_of(dark)).sensor.range_m == NIGHT["camera"].range_m == 46.0
    for same in (dataclasses.replace(dark, night="lidar"), dataclasses.replace(CPNA, night="camera")):
        assert preset_of(same, definition_of(same)).sensor == PHYSICAL.sensor
    with pytest.raises(ScenarioError, match="unknown night sensor 'owl'; use one of: lidar, camera"):
        preset_of(dataclasses.replace(dark, night="owl"), definition_of(dark))


def crossing_in(folder: Path, weather: str, event: str = "") -> RunSpec:
    """The shipped crossing with other elements in its initial Weather, and an environment event."""
    text = (DEFINITIONS / "crossing.xosc").read_text()
    text = text.replace("</Weather>", f"{weather}", 1)
    if event:
        group = f"""<ManeuverGroup name="sky" maximumExecutionCount="1">
          <Actors selectTriggeringEntities="false"/>
          <Maneuver name="sky"><Event name="{event}" priority="parallel"><Action name="sky">
          <GlobalAction><EnvironmentAction><Environment name="e"/></EnvironmentAction></GlobalAction>
          </Action></Event></Maneuver></ManeuverGroup></Act>"""
        text = text.replace("</Act>", group, 1)
    file = folder / "crossing_weather.xosc"
    for name in ("maps", "catalogs"):
        there = DEFINITIONS.parent / "maps" if name == "maps" else DEFINITIONS / "catalogs"
        text = text.replace(f'"../{name}/', f'"{there}/').replace(f'"{name}/', f'"{there}/')
    file.write_text(text)
    return dataclasses.replace(CPNA, file=str(file))


def test_rain_and_friction_of_the_scenario_reach_brakes_and_sensor(tmp_path: Path) -> None:
    rain = '<Precipitation precipitationType="rain" precipitationIntensity="25"/></Weather>'
    spec = crossing_in(tmp_path, f'{rain}<RoadCondition frictionScaleFactor="0.5"/>', "clears up")
    preset = preset_of(spec, definition_of(spec))
    assert preset.brakes.max_decel_mps2 == pytest.approx(0.5 * PHYSICAL.brakes.max_decel_mps2)
    assert preset.sensor.range_m == WEATHER["rain"].range_m(PHYSICAL.sensor.range_m)
    told = "rain of 25 mm/h, friction factor 0.5 in place of the friction of rain"
    assert environment_notes(spec, definition_of(spec)) == [
        f"weather of the scenario: {told}",
        "not used: the change of weather or light by event 'clears up'; those of Init hold",
    ]
    assert f"weather of the scenario: {told}" in perception_notes([spec])
    # on half the friction the car that stops at 50 km/h does not
    assert execute(CPNA).row.avoided
    assert execute(spec).row.collided
    # a weather that was asked for holds
    snow = dataclasses.replace(spec, weather="snow")
    assert (
        preset_of(snow, definition_of(snow)).brakes
        == preset_of(dataclasses.replace(CPNA, weather="snow"), definition_of(CPNA)).brakes
    )
    assert environment_notes(snow, definition_of(snow))[0] == (
        f"not used: {told} of the scenario; --weather snow holds"
    )


def test_a_share_of_sunlight_is_no_night(tmp_path: Path) -> None:
    """Files of 1.0 often give 0.85 of full sunlight; a sun 20 degrees under the horizon is night."""
    sun = '<Sun elevation="1" azimuth="3" illuminance="$Illuminance"/>'
    for other, night in (
        ('<Sun intensity="0.85" azimuth="0" elevation="1.31"/>', False),
        ('<Sun illuminance="0.1" azimuth="0" elevation="1.31"/>', True),
        ('<Sun intensity="1000" azimuth="0" elevation="-0.35"/>', True),
    ):
        spec = crossing_in(tmp_path, "</Weather>")
        text = Path(spec.file).read_text()
        assert sun in text
        Path(spec.file).write_text(text.replace(sun, other))
        assert is_night(definition_of(spec)) == night


@pytest.mark.parametrize("speed_kmh", [10.0, 33.3, 55.0])
def test_test_speed_is_the_speed_at_the_start(speed_kmh: float, track: RunSpec) -> None:
    assert initial_speed_kmh(definition_of(with_values(Ego_speed_kmh=speed_kmh))) == pytest.approx(speed_kmh)
    faster = dataclasses.replace(track, parameters=(("Ego_speed_kph", speed_kmh),))
    assert initial_speed_kmh(definition_of(faster)) == pytest.approx(speed_kmh)


STEP = '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
LINEAR = '<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="1.0"/>'


@pytest.mark.parametrize("lane", ["none", "map"])
def test_an_initial_speed_that_takes_time_is_carried_out(tmp_path: Path, lane: str) -> None:
    """The ego reaches 40 km/h within 1 s of the initial actions, and meets the pedestrian at 5.357 s."""
    text = (DEFINITIONS / "cpna_paper.xosc").read_text()
    first = text.index(STEP)  # that of the ego, in Init
    text = text[:first] + LINEAR + text[first + len(STEP) :]
    file = tmp_path / "linear.xosc"
    file.write_text(
        text.replace('"../maps/', f'"{DEFINITIONS.parent / "maps"}/').replace(
            '"catalogs/', f'"{DEFINITIONS / "catalogs"}/'
        )
    )
    alone = Engine(load(file, {"Ego_speed_kmh": 40.0})).run(30.0)
    assert alone.contact_time_s == pytest.approx(5.357, abs=0.01)
    spec = RunSpec("x", str(file), (("Ego_speed_kmh", 40.0),), lane, "physical", "dry", 40.0)
    record = execute(spec)
    if lane == NO_AEB:
        assert record.row.contact_time_s == pytest.approx(alone.contact_time_s, abs=1e-3)
        assert record.row.end_reason == "contact"
    else:
        assert (record.row.collided, record.row.end_reason) == (False, "stopped")
        assert record.log is not None
        own = record.log["kind"] == "ego"
        # half of the second that it takes
        speed = np.interp(0.5, record.log["time_s"][own], record.log["speed_mps"][own])
        assert speed == pytest.approx(20.0 / 3.6, abs=1e-6)
    assert initial_speed_kmh(definition_of(spec)) == pytest.approx(40.0)


def test_a_run_that_is_cut_off_has_no_score_and_is_not_avoided() -> None:
    """Unbraked at 30 km/h the pedestrian is hit 2.85 s after the lead, which takes 70 s here."""
    parameters = (("Ego_speed_kmh", 30.0), ("Lead_s", 70.0))
    spec = RunSpec("x", "cpna_paper", parameters, NO_AEB, "paper", "dry", 30.0, paper_points=True)
    row = execute(spec).row
    assert (row.end_reason, row.end_time_s) == ("time_limit", pytest.approx(60.0))
    assert row.v_impact_kmh is None  # what it would have come to is not known
    assert (row.collided, row.avoided, row.score) == (False, False, None)


def with_ego_actions(initial: list[Action], later: list[Action]) -> ScenarioDefinition:
    """The shipped crossing with other actions of the ego."""
    made = definition_of(CPNA)
    others = [(n, a) for n, a in made.init if n != "Ego" or isinstance(a, TeleportAction)]
    events = tuple(
        Event(f"e{k}", "parallel", 1, (NamedAction("a", action, ("Ego",)),), None)
        for k, action in enumerate(later)
    )
    group = ManeuverGroup("ego", 1, (Maneuver("ego", events),))
    story = Story("ego", (Act("ego", (group,), None, None),))
    init = (*others, *(("Ego", action) for action in initial))
    return dataclasses.replace(made, init=init, stories=(*made.stories, *([story] if later else [])))


def to_speed(speed: float | RelativeSpeed, shape: str = "linear") -> SpeedAction:
    return SpeedAction(shape, "time", 1.0 if shape == "linear" else 0.0, speed)  # type: ignore[arg-type]


def test_the_test_speed_is_what_the_initial_actions_ask_for() -> None:
    walking = SpeedAction("step", "time", 0.0, 2.0)
    cases: list[tuple[list[Action], list[Action], float]] = [
        ([to_speed(10.0)], [], 10.0),
        ([to_speed(5.0, "step"), to_speed(10.0)], [to_speed(3.0)], 10.0),
        ([to_speed(0.0, "step")], [to_speed(8.0), to_speed(3.0)], 8.0),
        ([], [to_speed(8.0)], 8.0),
        ([to_speed(-2.0, "step")], [], 2.0),
        ([], [], 0.0),
    ]
    for initial, later, speed in cases:
        assert initial_speed_kmh(with_ego_actions(initial, later)) == pytest.approx(3.6 * speed)
    relative = with_ego_actions([to_speed(RelativeSpeed("Target", 3.0, False))], [])
    first = [("Target", walking), *[pair for pair in relative.init if pair[0] is None]]
    rest = [pair for pair in relative.init if pair[0] is not None]
    ordered = [pair for pair in rest if pair[0] == "Target"] + first[:1]
    ordered += [pair for pair in rest if pair[0] == "Ego"]
    made = dataclasses.replace(relative, init=(*first[1:], *ordered))
    assert initial_speed_kmh(made) == pytest.approx(3.6 * 5.0)


def test_a_row_tells_the_contact() -> None:
    """Unbraked, 5 km/h: 4.06 m of walking and 1 m of run-up after 2 s."""
    record = execute(dataclasses.replace(CPNA, strategy=NO_AEB))
    row = record.row
    assert row.contact_time_s == pytest.approx(2.0 + 5.06 * 3.6 / 5, abs=1e-3)
    assert row.v_impact_kmh == row.ego_speed_at_contact_kmh == pytest.approx(50.0)
    assert row.target_speed_at_contact_kmh == pytest.approx(5.0)
    assert row.target_start_time_s == pytest.approx(2.0)
    assert row.target_steady_time_s == pytest.approx(2.0 + 2 * 3.6 / 5)
    assert row.impact_location_percent == pytest.approx(50 + 100 * 0.06 / 1.8, abs=0.01)
    assert row.score is row.flag_time_s is record.warning_ttc_s is None


def test_as_in_tests_of_euro_ncap_a_run_ends_when_the_ego_stands() -> None:
    driven, held = (execute(dataclasses.replace(CPNA, adapts=adapts)) for adapts in (True, False))
    assert driven.log is not None
    assert held.log is not None
    assert held.row.t0_s is not None
    assert held.row.flag_time_s == driven.row.flag_time_s
    assert held.log["time_s"].max() < held.row.t0_s + 1e-9 < driven.log["time_s"].max()
    assert held.warning_ttc_s == pytest.approx((held.row.flag_distance_m or 0.0) / (50 / 3.6))


def test_the_log_is_left_out_where_nobody_wants_it() -> None:
    record = execute(dataclasses.replace(CPNA, strategy=NO_AEB), keep_log=False)
    assert record.log is None
    assert record.row.log is None


def test_records_come_in_order_and_alike_from_any_number_of_processes() -> None:
    specs = [
        dataclasses.replace(with_values(Ego_speed_kmh=v), v_test_kmh=v, seed=seed)
        for v in (60.0, 20.0)
        for seed in (0, 1)
    ]
    alone, together = (list(execute_all(execute, specs, workers)) for workers in (1, 3))
    assert [r.spec for r in together] == specs
    for one, other in zip(alone, together, strict=True):
        assert pickle.dumps(one.row) == pickle.dumps(other.row)
        assert one.log is not None
        assert other.log is not None
        for name, column in one.log.items():
            assert np.asarray(column).tobytes() == np.asarray(other.log[name]).tobytes()


def test_a_mistake_in_another_process_is_the_same_named_error() -> None:
    wrong = [with_values(Impact_percent=120.0), with_values(Impact_percent=130.0)]
    with pytest.raises(ScenarioError, match="Impact_percent"):
        list(execute_all(execute, wrong, 2))


def test_names_of_logs_are_names_of_files() -> None:
    spec = dataclasses.replace(CPNA, scenario="a b/c %=1")
    assert spec.log == "a-b-c-=1_map_dry_none_50kmh_seed0"


def test_performance_is_noted_or_applied(tmp_path: Path) -> None:
    """From 10 m/s by 2.5 m/s2 until the act ends at 2 s; a car that may do 1 m/s2 has 12 m/s then."""
    folder = Path(__file__).parents[2] / "data" / "field" / "openscenario"
    text = (folder / "act_stop_speed.xosc").read_text(encoding="utf-8")
    file = tmp_path / "slow.xosc"
    file.write_text(
        text.replace('maxAcceleration="10"', 'maxAcceleration="1"').replace(
            "road.xodr", str(folder / "road.xodr")
        ),
        encoding="utf-8",
    )
    spec = RunSpec("slow", str(file), (), NO_AEB, "physical", "dry", 36.0)
    asked = "the file asks for 2.5 m/s2 of 'Ego' (car), whose Performance allows an acceleration of 1"
    for applied, speed_mps, note in ((False, 15.0, asked), (True, 12.0, f"{asked}: limited to that")):
        record = execute(dataclasses.replace(spec, apply_performance=applied))
        assert record.notes == (note,)
        assert record.log is not None
        speeds = record.log["speed_mps"][record.log["kind"] == "ego"]
        assert speeds[-1] == pytest.approx(speed_mps)


def test_the_function_is_found_under_its_old_name_whatever_was_imported_before() -> None:
    """`evaluation.runs` was a module with a function `execute`: no module may take that name."""
    import evaluation.runs

    with pytest.warns(DeprecationWarning, match="has moved to evaluation.runs.execution.execute"):
        assert evaluation.runs.execute is execute
