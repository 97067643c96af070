"""One run as a plain value, and the simulation that it asks for."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import _smartmot
from opendrive import RoadNetwork, load_map
from scenarios.catalogue.bystanders import with_bystanders
from scenarios.catalogue.library import scenario_path
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    EnvironmentAction,
    NamedAction,
    ScenarioDefinition,
    SpeedAction,
)
from scenarios.openscenario.motion.roads import load_roads
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.places import MapView
from scenarios.presets import Preset, named_preset, preset_at_night, preset_in_weather
from scenarios.sensors.lidar.chain import is_network, network_path
from scenarios.settings import Settings, preset_with
from scenarios.simulation.driver import DriverBrake
from scenarios.simulation.ends import StopRule
from scenarios.simulation.motion_actions import ego_actions, ego_of, is_motion
from scenarios.simulation.simulation import Simulation
from scenarios.strategies import NamedStrategy
from scenarios.traffic import SumoTraffic, Traffic, with_traffic
from scenarios.weather import initial_environment, is_night, named_light, named_weather, weather_of
from smartmot.plugins import is_plugin

NO_AEB = "none"
"""Stands for the strategy in runs without perception and emergency brake."""

NCAP_MAP = "euro_ncap_street"
TEST_TRACK_LANE_M = 8.0
"""A driving lane wider than this is a test track, not a lane of a street: no HD map would show it."""
SCENARIO_WEATHER = "dry"
"""With this weather, a run's unless another is asked for, rain, fog and friction of the scenario hold."""


@dataclass(frozen=True, slots=True)
class RunSpec:
    """Everything that determines one run.

    Args:
        scenario: name in tables.
        file: name of a shipped scenario, or path of a file.
        parameters: values in place of the declared ones.
        strategy: monitored area, or `NO_AEB`.
        preset, weather: names.
        v_test_kmh: test speed, for tables.
        map_name: OpenDRIVE file or shipped map that perception uses; None: see `perception_map`.
        adversaries: none or static.
        seed: of the sensor noise.
        phase_s: time of the first sensor frame.
        night: how the sensor takes the night (`scenarios.weather.NIGHT`), where the scenario is at night.
        paper_points: whether the paper's score applies.
        adapts: whether the ego adapts its speed to who is ahead, as ACC does; else, as in tests of Euro NCAP,
            it holds it until it brakes, and the run ends when it stands.
        settings: parameters of perception that depart from the preset; see `scenarios.settings`.
        must: what the ego must do, where that is known: brake, or nothing; then every emergency request is
            a false activation.
        apply_performance: whether vehicles stay within the Performance of their catalog, as in esmini.
        driver: who brakes as well, as some tests ask for; None: nobody does.
        to_standstill: whether the run goes on when the ego has braked to the speed of a target ahead.
        traffic: vehicles and pedestrians of SUMO around the ego; None: nobody but the scenario's own.
    """

    scenario: str
    file: str
    parameters: tuple[tuple[str, Value], ...]
    strategy: str
    preset: str
    weather: str
    v_test_kmh: float
    map_name: str | None = None
    adversaries: str = "none"
    seed: int = 0
    phase_s: float = 0.0
    night: str = "lidar"
    paper_points: bool = False
    adapts: bool = True
    settings: Settings = ()
    must: str = ""
    apply_performance: bool = False
    driver: DriverBrake | None = None
    to_standstill: bool = False
    traffic: Traffic | None = None

    @property
    def plugins(self) -> tuple[str, ...]:
        """What of the user's own takes part, as `package.module:name`."""
        names = (self.strategy, *(value for _, value in self.settings if isinstance(value, str)))
        return tuple(name for name in names if is_plugin(name))

    @property
    def networks(self) -> tuple[Path, ...]:
        """Files of the networks that take part."""
        named = [str(value) for name, value in self.settings if name == "perception"]
        return tuple(network_path(name) for name in named if is_network(name))

    @property
    def log(self) -> str:
        """Name of the run's log."""
        conditions = f"{self.weather}_{self.adversaries}_{self.v_test_kmh:.10g}kmh_seed{self.seed}"
        return re.sub(r"[^\w.=+-]+", "-", f"{self.scenario}_{self.strategy}_{conditions}")


def load_named_map(name: str, layer: str = "permanent") -> RoadNetwork:
    """Load a shipped map by its name, or any OpenDRIVE file; an unchanged file is loaded once.

    Raises:
        opendrive.OpenDriveError: the file cannot be opened.
        scenarios.openscenario.errors.RunError: it cannot be read.
    """
    path = shipped_map(name) if name in SHIPPED_MAPS else Path(name)
    if layer != "permanent" or not path.is_file():
        return load_map(path, layer=layer)
    return load_roads(path).network


def perception_map(definition: ScenarioDefinition, map_name: str | None) -> str | None:
    """Name of the map that perception uses; None for the scenario's own.

    The test tracks of Euro NCAP's pedestrian scenarios are one wide lane without marks, on which a map tells
    nothing. Unless another map is asked for, a street is laid over them, in whose lane the ego drives.
    """
    if map_name is not None or definition.map_path is None:
        return map_name
    network = load_named_map(str(definition.map_path))
    lanes = network.lanes
    driving = np.flatnonzero(np.asarray(lanes.lane_type) == "driving")
    # a street's first lane tells that it is one
    wide = (network.lane_width(k, lanes.s_start_m[k]) > TEST_TRACK_LANE_M for k in driving.tolist())
    return NCAP_MAP if len(driving) and all(wide) else None


def environment_notes(spec: RunSpec, definition: ScenarioDefinition) -> list[str]:
    """What becomes of the scenario's weather and of changes to it in a run, one line each."""
    weather = weather_of(initial_environment(definition))
    lines = []
    if weather.used and spec.weather == SCENARIO_WEATHER:
        lines.append(f"weather of the scenario: {', '.join(weather.used)}")
    elif weather.used:
        lines.append(f"not used: {', '.join(weather.used)} of the scenario; --weather {spec.weather} holds")
    lines += [f"not used: {what}" for what in weather.unused]
    changes = [e.name for e in definition.events() if any(_is_environment(a) for a in e.actions)]
    if changes:
        named = ", ".join(f"'{name}'" for name in dict.fromkeys(changes))
        lines.append(f"not used: the change of weather or light by event {named}; those of Init hold")
    return lines


def _is_environment(named: NamedAction) -> bool:
    return isinstance(named.action, EnvironmentAction)


def initial_speed_kmh(definition: ScenarioDefinition) -> float:
    """The test speed: that which the initial actions ask of the ego, whether or not it takes time.

    If they leave it standing, it is that of the first event that asks for another. What later events ask for
    does not change it.
    """
    ego = ego_of(definition).name
    initial, later = ego_actions(definition, ego)
    speeds = [action.target for action in initial if isinstance(action, SpeedAction)]
    asked = speeds[-1] if speeds else 0.0
    if not isinstance(asked, float):  # relative to another entity
        asked = Engine(definition).ego.profile.final_mps
    elif not asked and any(is_motion(a) for a in initial):  # by a distance, synchronisation or trajectory
        asked = Engine(definition).ego.asked_mps(0.0)
    if not asked:
        targets = [a.target for a in later if isinstance(a, SpeedAction) and isinstance(a.target, float)]
        asked = next((target for target in targets if target), 0.0)
    return round(abs(asked) * 3.6, 6)


def preset_of(spec: RunSpec, definition: ScenarioDefinition) -> Preset:
    """Preset in the run's weather and light, with the run's settings.

    In dry weather, which is that of a run unless another is asked for, it is the scenario's own.

    Raises:
        ScenarioError: unknown preset, weather or light.
        smartmot.errors.ConfigError: a setting is out of range.
    """
    weather = named_weather(spec.weather)
    if spec.weather == SCENARIO_WEATHER:
        weather = weather_of(initial_environment(definition)).weather or weather
    preset = preset_in_weather(named_preset(spec.preset), weather)
    if is_night(definition):
        preset = preset_at_night(preset, named_light(spec.night))
    preset = replace(preset, sensor=replace(preset.sensor, phase_s=spec.phase_s))
    return preset_with(preset, spec.settings)


def definition_of(spec: RunSpec) -> ScenarioDefinition:
    """The scenario with the run's parameters, and with its bystanders.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the file cannot be read or run.
    """
    # a scenario that names a level in place of a file takes place on the map that the run is given
    definition = load(scenario_path(spec.file), dict(spec.parameters), spec.map_name)
    if spec.adversaries == "static":
        if definition.map_path is None:
            raise ScenarioError(
                f"{definition.path}: static adversaries stand beside a road, and there is none"
            )
        return with_bystanders(definition, load_named_map(str(definition.map_path)))
    return definition


def simulation_of(spec: RunSpec, rule: StopRule | None = None) -> Simulation:
    """A run, ready to start.

    Args:
        spec: what to run.
        rule: when it ends; None: after a contact, a stop or a pass.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scenario cannot begin.
        opendrive.OpenDriveError: a map cannot be read.
        ScenarioError: unknown preset, weather or strategy.
        smartmot.errors.ConfigError: a setting is out of range.
    """
    definition, background = definition_of(spec), None
    if spec.traffic is not None:
        definition = with_traffic(definition, spec.traffic)
        assert definition.map_path is not None  # else there is no traffic
        background = SumoTraffic(spec.traffic, definition.map_path, spec.seed)
    preset = preset_of(spec, definition)
    name = perception_map(definition, spec.map_name)
    return Simulation(
        definition,
        preset,
        None if spec.strategy == NO_AEB else NamedStrategy(spec.strategy, preset),
        spec.seed,
        load_named_map(name) if name else None,
        rule=rule or StopRule(at_standstill=not spec.adapts, at_level=not spec.to_standstill),
        adapts=spec.adapts,
        apply_performance=spec.apply_performance,
        driver=spec.driver,
        background=background,
    )


def map_view_of(spec: RunSpec) -> MapView:
    """Map and route of a run, without running it; see `simulation_of` for what it raises."""
    return simulation_of(spec).map_view()


__getattr__ = _smartmot.renamed(
    __name__,
    {
        "scene_of": "scenarios.spec.map_view_of",
        "told_environment": "scenarios.spec.environment_notes",
        "initial_environment": "scenarios.weather.initial_environment",
        "is_night": "scenarios.weather.is_night",
        "CIVIL_TWILIGHT_RAD": "scenarios.weather.CIVIL_TWILIGHT_RAD",
        "NIGHT_LX": "scenarios.weather.NIGHT_LX",
    },
)
