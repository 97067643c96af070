"""What a user asks for, as runs: the CPNA comparison on one place of one map, and scenario files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evaluation.runs.configuration import configuration_of
from evaluation.runs.execution import RunRecord, execute
from evaluation.runs.workers import execute_all
from opendrive import RoadNetwork
from scenarios.catalogue.cpna import CpnaTest, approach_m, scenario_parameters
from scenarios.catalogue.library import scenario_name, scenario_path
from scenarios.catalogue.maps import DEFAULT_MAP, SHIPPED_MAPS
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.distributions import Variation, expand
from scenarios.places import Place, Site, find_site, lane_at, near_side, site_at
from scenarios.presets import Preset, named_light, named_preset, named_weather, preset_in_weather
from scenarios.settings import Settings, preset_with
from scenarios.spec import (
    NO_AEB,
    RunSpec,
    definition_of,
    initial_speed_kmh,
    is_night,
    load_named_map,
    perception_map,
    told_environment,
)
from smartmot.maps.regulatory import regulatory_elements
from smartmot.maps.route import route_ahead
from smartmot.plugins import is_plugin, plugin

# ---- CPNA --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CpnaSuite:
    """A comparison: every strategy at every speed, in every weather.

    Args:
        speeds_kmh: test speeds.
        strategies: names of monitored-area strategies.
        preset: name of the preset.
        weather: names of weather conditions.
        map_name: OpenDRIVE file, or name of a shipped map.
        place: where the pedestrian's line is; None: chosen by itself.
        impact_point_percent: see `CpnaTest`.
        adversaries: see `CpnaTest`.
        seed: of the sensor noise; the same for every strategy.
        phase_s: time of the first sensor frame.
        settings: see `RunSpec`.
    """

    speeds_kmh: tuple[float, ...]
    strategies: tuple[str, ...]
    preset: str
    weather: tuple[str, ...]
    map_name: str
    place: Place | None = None
    impact_point_percent: float | None = None
    adversaries: str = "none"
    seed: int = 0
    phase_s: float = 0.0
    settings: Settings = ()

    def __post_init__(self) -> None:
        if not self.speeds_kmh or not self.strategies or not self.weather:
            raise ScenarioError("nothing to run: give at least one speed, one strategy and one weather")
        # every name and value is checked here, before the first run starts
        _check(self.preset, self.weather, self.strategies, self.settings)
        for speed in self.speeds_kmh:
            self.test(speed)

    def preset_in(self, weather: str) -> Preset:
        """The preset as it is in one weather."""
        preset = preset_in_weather(named_preset(self.preset), named_weather(weather))
        preset = replace(preset, sensor=replace(preset.sensor, phase_s=self.phase_s))
        return preset_with(preset, self.settings)

    def test(self, speed_kmh: float) -> CpnaTest:
        """The test at one speed."""
        return CpnaTest(speed_kmh, self.impact_point_percent, self.adversaries, self.seed)

    def specs(self, site: Site) -> list[RunSpec]:
        """The runs: by weather, then strategy, then speed.

        Args:
            site: the suite's place.
        """
        # from the folder of the shipped scenarios
        shipped = self.map_name in SHIPPED_MAPS
        map_file = f"../maps/{self.map_name}.xodr" if shipped else str(Path(self.map_name).resolve())
        preset = named_preset(self.preset)
        specs = []
        for weather in self.weather:
            for strategy in self.strategies:
                for speed in self.speeds_kmh:
                    test = self.test(speed)
                    values = {"Map": map_file, **scenario_parameters(test, site, preset)}
                    specs.append(
                        RunSpec(
                            scenario=test.name,
                            file=test.scenario,
                            parameters=tuple(sorted(values.items())),
                            strategy=strategy,
                            preset=self.preset,
                            weather=weather,
                            v_test_kmh=speed,
                            map_name=self.map_name,
                            adversaries=self.adversaries,
                            seed=self.seed,
                            phase_s=self.phase_s,
                            paper_points=True,
                            settings=self.settings,
                        )
                    )
        return specs


def _check(preset: str, weather: Sequence[str], strategies: Sequence[str], settings: Settings) -> None:
    """Look up every name, and load what is the user's own."""
    preset_with(named_preset(preset), settings)
    for name in weather:
        named_weather(name)
    for strategy in filter(is_plugin, strategies):
        plugin(strategy)


def choose_site(network: RoadNetwork, place: Place | None, max_speed_kmh: float) -> Site:
    """The place of the test, given or found."""
    needed = approach_m(max_speed_kmh)
    if place is None:
        return find_site(network, needed)
    return site_at(network, lane_at(network, place), place.s_m, needed)


def load_site(suite: CpnaSuite) -> Site:
    """Load the suite's map and take its place.

    Raises:
        ScenarioError: the place does not exist or is not straight.
        opendrive.OpenDriveError: the file cannot be read.
    """
    return choose_site(load_named_map(suite.map_name), suite.place, max(suite.speeds_kmh))


def is_published(suite: CpnaSuite) -> bool:
    """Whether the paper printed results for these conditions."""
    return (
        suite.preset == "paper"
        and suite.impact_point_percent is None
        and suite.adversaries == "none"
        and suite.weather == ("dry",)
        and suite.map_name == DEFAULT_MAP
        and suite.place is None
        and not suite.settings
    )


def run_suite(suite: CpnaSuite, site: Site | None = None, workers: int = 1) -> Iterator[RunRecord]:
    """Run a suite, one record after the other: by weather, then strategy, then speed.

    Args:
        suite: what to run.
        site: the place, when the caller has loaded the map already.
        workers: processes.

    Raises:
        ScenarioError: a test cannot be set up.
        opendrive.OpenDriveError: the map cannot be read.
    """
    return execute_all(execute, suite.specs(load_site(suite) if site is None else site), workers)


def suite_configuration(suite: CpnaSuite, site: Site, out: Path) -> dict[str, object]:
    """Everything that determines the results of a suite, as plain values.

    Args:
        suite: what is run.
        site: its place.
        out: folder of the results.
    """
    key = site.network.lanes.key[site.route.lanes[0]]
    told = {
        "site": {
            "first_lane": list(key),
            "lanes": [list(site.network.lanes.key[i]) for i in site.route.lanes],
            "line_m": site.line_m,
            "line_xy_m": list(site.route.pose(site.line_m)[:2]),
        }
    }
    return configuration_of(suite.specs(site), out, published=is_published(suite), more=told)


# ---- scenario files ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the user adds to a scenario file.

    Args:
        strategies: names of monitored areas, or `NO_AEB`.
        preset: name of the preset.
        weather: names of weather conditions.
        map_name: map that perception uses; None: see `runs.perception_map`.
        seed: of the sensor noise.
        phase_s: time of the first sensor frame.
        night: how the sensor takes the night.
        adapts: see `RunSpec`.
        settings: see `RunSpec`.
        apply_performance: see `RunSpec`.

    Raises:
        ScenarioError: an unknown name.
        smartmot.errors.SmartMotError: a setting is out of range, or an object of the user's own is missing.
    """

    strategies: tuple[str, ...]
    preset: str = "physical"
    weather: tuple[str, ...] = ("dry",)
    map_name: str | None = None
    seed: int = 0
    phase_s: float = 0.0
    night: str = "lidar"
    adapts: bool = True
    settings: Settings = ()
    apply_performance: bool = False

    def __post_init__(self) -> None:
        _check(self.preset, self.weather, self.strategies, self.settings)
        named_light(self.night)

    def specs(self, run: RunSpec) -> list[RunSpec]:
        """One run in all its conditions."""
        return [
            replace(
                run,
                strategy=strategy,
                preset=self.preset,
                weather=weather,
                map_name=self.map_name,
                seed=self.seed,
                phase_s=self.phase_s,
                night=self.night,
                adapts=self.adapts,
                settings=self.settings,
                apply_performance=self.apply_performance,
            )
            for weather in self.weather
            for strategy in self.strategies
        ]


def scenario_specs(name: str, parameters: Mapping[str, Value], conditions: Conditions) -> list[RunSpec]:
    """The runs of a scenario or distribution file, by weather, strategy and then as the file has them.

    Args:
        name: of a shipped scenario, or path of a file.
        parameters: values in place of the declared and the distributed ones.
        conditions: see `Conditions`.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the file cannot be read, or a parameter does not fit.
    """
    variations: list[Variation] = []
    for variation in expand(scenario_path(name)):
        values = {**variation.parameters, **parameters}
        if all(values != dict(other.parameters) for other in variations):
            variations.append(replace(variation, parameters=values))
    bare = [
        RunSpec("", scenario_name(v.path), tuple(sorted(v.parameters.items())), "", "", "", 0.0)
        for v in variations
    ]
    speeds = [initial_speed_kmh(definition_of(run)) for run in bare]
    names = _names(scenario_path(name).stem, variations, speeds)
    runs = [
        replace(run, scenario=label, v_test_kmh=speed)
        for run, label, speed in zip(bare, names, speeds, strict=True)
    ]
    every = [conditions.specs(run) for run in runs]
    return [specs[k] for k in range(len(every[0])) for specs in every]


def _names(stem: str, variations: Sequence[Variation], speeds_kmh: Sequence[float]) -> list[str]:
    """A name for each run, the same for those that differ by the test speed alone.

    The scenario's own name, if the parameter Scenario_ID has it, and what else distinguishes runs of one
    speed; paths are left out.
    """
    told: list[str] = []
    varied: dict[str, set[Value]] = {}
    by_speed: dict[tuple[str, float], set[Value]] = {}
    for variation, speed in zip(variations, speeds_kmh, strict=True):
        for name, value in variation.parameters.items():
            varied.setdefault(name, set()).add(value)
            by_speed.setdefault((name, speed), set()).add(value)
    for name, values in varied.items():
        several = any(len(by_speed.get((name, speed), ())) > 1 for speed in speeds_kmh)
        if several and name != "Scenario_ID" and not any("/" in str(value) for value in values):
            told.append(name)
    return [
        " ".join(
            [
                str(variation.parameters.get("Scenario_ID", stem)),
                *(f"{name}={variation.parameters[name]}" for name in told),
            ]
        )
        for variation in variations
    ]


def notes(specs: Sequence[RunSpec]) -> list[str]:
    """What the reader has to know about maps and light of runs in which somebody perceives, one line each."""
    lines: dict[str, list[str]] = {}
    seen: set[tuple[object, ...]] = set()
    for spec in specs:
        same = (spec.file, spec.parameters, spec.map_name, spec.night, spec.weather)
        if same in seen or spec.strategy == NO_AEB:
            continue
        seen.add(same)
        definition = definition_of(spec)
        used = perception_map(definition, spec.map_name)
        if used is not None:
            tracks = lines.setdefault(f"perception uses the map {used}", [])
            if spec.map_name is None and definition.map_path.name not in tracks:
                tracks.append(definition.map_path.name)
        if is_night(definition):
            lines.setdefault(named_light(spec.night).source, [])
        for line in told_environment(spec, definition):
            lines.setdefault(line, [])
    return [f"{line}, laid over {', '.join(tracks)}" if tracks else line for line, tracks in lines.items()]


# ---- maps --------------------------------------------------------------------------------------------------


def pose_site(network: RoadNetwork, place: Place) -> Site:
    """A place to look at, which need not be straight."""
    lane = lane_at(network, place)
    if network.lanes.lane_type[lane] != "driving":
        raise ScenarioError(
            f"lane {place.lane_id} of road {place.road_id} is of type {network.lanes.lane_type[lane]!s}; "
            "choose a driving lane"
        )
    route = route_ahead(network, lane, place.s_m, ahead_m=200.0, behind_m=100.0)
    return Site(network, route, route.station_of(lane, place.s_m), near_side(network, lane))


def describe_map(network: RoadNetwork, site: Site | None, speed_kmh: float) -> list[str]:
    """What a map holds, and what the law says on the route ahead of a place, line by line."""
    types, counts = np.unique(network.lanes.lane_type, return_counts=True)
    lines = [
        f"map: {network.name or '(unnamed)'}, {len(network.roads)} roads, {len(network.lanes.key)} lanes: "
        + ", ".join(f"{n} {t}" for t, n in zip(types, counts, strict=True)),
        f"crosswalks: {len(network.crosswalks)}, warnings: {len(network.warnings)}",
    ]
    lines += [f"  warning: {warning}" for warning in network.warnings[:20]]
    if site is not None:
        lines.append(
            f"route: {len(site.route.strips)} lanes, {site.route.length_m - site.line_m:.0f} m ahead"
        )
        elements = regulatory_elements(network, site.route, site.line_m, 200.0)
        for element in elements:
            value = "" if element.value is None else f" {element.value:g}"
            lines.append(f"  {element.kind}{value} in {element.distance_m:.1f} m (road {element.road_id})")
        if not elements:
            lines.append("  no regulatory element within 200 m")
    return lines
