"""The runs that a user asks for: scenario files, and the conditions that any run is made in."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

from scenarios.catalogue.library import scenario_name, scenario_path
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.distributions import Variation, admissible, expand
from scenarios.presets import Preset, named_preset
from scenarios.sensors.lidar.chain import NetworkFile, lidar_of
from scenarios.settings import Settings, preset_with, settings_text
from scenarios.spec import (
    NO_AEB,
    RunSpec,
    definition_of,
    environment_notes,
    initial_speed_kmh,
    perception_map,
    preset_of,
)
from scenarios.traffic import Traffic
from scenarios.weather import is_night, named_light, named_weather
from smartmot.plugins import is_plugin, plugin


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the user adds to a scenario: several strategies and weathers, and what all runs have in common.

    Args:
        strategies: names of monitored areas, or `NO_AEB`.
        preset: name of the preset.
        weather: names of weather conditions.
        map_name, adversaries, seed, phase_s, night, adapts, settings, apply_performance, traffic: see
            `RunSpec`.

    Raises:
        ScenarioError: an unknown name.
        smartmot.errors.SmartMotError: a setting is out of range, or an object of the user's own is missing.
    """

    strategies: tuple[str, ...]
    preset: str = "physical"
    weather: tuple[str, ...] = ("dry",)
    map_name: str | None = None
    adversaries: str = "none"
    seed: int = 0
    phase_s: float = 0.0
    night: str = "lidar"
    adapts: bool = True
    settings: Settings = ()
    apply_performance: bool = False
    traffic: Traffic | None = None

    def __post_init__(self) -> None:
        # every name is looked up and what is the user's own is loaded here, before the first run starts
        preset_with(named_preset(self.preset), self.settings)
        for name in self.weather:
            named_weather(name)
        for strategy in filter(is_plugin, self.strategies):
            plugin(strategy)
        named_light(self.night)

    def specs(self, runs: Iterable[RunSpec]) -> list[RunSpec]:
        """Runs in all conditions: by weather, then strategy, then as they come."""
        common = {each.name: getattr(self, each.name) for each in fields(self)}
        del common["strategies"], common["weather"]
        return [
            replace(run, strategy=strategy, weather=weather, **common)
            for weather, strategy, run in itertools.product(self.weather, self.strategies, runs)
        ]


def bare_run(
    file: str, parameters: Mapping[str, Value], scenario: str = "", v_test_kmh: float = 0.0, must: str = ""
) -> RunSpec:
    """A run that has no conditions yet; see `RunSpec`."""
    return RunSpec(scenario, file, tuple(sorted(parameters.items())), "", "", "", v_test_kmh, must=must)


def preset_text(spec: RunSpec) -> str:
    """Preset, weather and settings of a run in words, by which `runs.json` names the preset."""
    return " ".join(filter(None, (spec.preset, spec.weather, settings_text(spec.settings))))


def scenario_specs(
    name: str,
    parameters: Mapping[str, Value],
    conditions: Conditions,
    notes: list[str] | None = None,
) -> list[RunSpec]:
    """The runs of a scenario or distribution file, by weather, strategy and then as the file has them.

    Args:
        name: of a shipped scenario, or path of a file.
        parameters: values in place of the declared and the distributed ones.
        conditions: see `Conditions`.
        notes: takes a line about variations that are left out, because they break constraints.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the file cannot be read, or a parameter does not fit.
    """
    distinct: dict[frozenset[tuple[str, Value]], Variation] = {}
    for variation in expand(scenario_path(name)):
        values = {**variation.parameters, **parameters}
        distinct.setdefault(frozenset(values.items()), replace(variation, parameters=values))
    variations, left_out = admissible(list(distinct.values()))
    if left_out and notes is not None:
        notes.append(left_out)
    bare = [
        replace(bare_run(scenario_name(v.path), v.parameters), map_name=conditions.map_name)
        for v in variations
    ]
    speeds = [initial_speed_kmh(definition_of(run)) for run in bare]
    names = _names(scenario_path(name).stem, variations, speeds)
    return conditions.specs(
        replace(run, scenario=label, v_test_kmh=speed)
        for run, label, speed in zip(bare, names, speeds, strict=True)
    )


def _names(stem: str, variations: Sequence[Variation], speeds_kmh: Sequence[float]) -> list[str]:
    """A name for each run, the same for those that differ by the test speed alone.

    The scenario's own name, if the parameter Scenario_ID has it, and what else distinguishes runs of one
    speed; paths are left out.
    """
    varied: dict[str, set[Value]] = {}
    by_speed: dict[tuple[str, float], set[Value]] = {}
    for variation, speed in zip(variations, speeds_kmh, strict=True):
        for name, value in variation.parameters.items():
            varied.setdefault(name, set()).add(value)
            by_speed.setdefault((name, speed), set()).add(value)
    distinguishing = [
        name
        for name, values in varied.items()
        if name != "Scenario_ID"
        and any(len(by_speed.get((name, speed), ())) > 1 for speed in speeds_kmh)
        and not any("/" in str(value) for value in values)
    ]
    return [
        " ".join(
            [
                str(variation.parameters.get("Scenario_ID", stem)),
                *(f"{name}={variation.parameters[name]}" for name in distinguishing),
            ]
        )
        for variation in variations
    ]


def lidar_notes(preset: Preset, own_streets: bool = False) -> list[str]:
    """What the reader has to know about the LiDAR of a preset, one line each; none of the shipped sensor.

    Args:
        preset: the conditions.
        own_streets: whether each scene has a street of its own.
    """
    lidar, street = preset.lidar, preset.street
    if lidar is None:
        return []
    config = lidar_of(lidar, preset.sensor)
    along = "on a bare street"
    if street is not None:
        seed = "one of its own in each scene" if own_streets else f"seed {street.seed}"
        along = (
            f"on a street with {street.density_per_100_m:g} pieces of furniture per 100 m and side, {seed}, "
            "but for those in the way of road users"
        )
    line = (
        f"{lidar.sensor}: {config.pattern.rate_hz:g} clouds and frames of perception per second, echoes up "
        f"to {config.range_m:g} m, {along}; detections by {lidar.perception_name}"
    )
    unseen = lidar.perception.unseen(config) if isinstance(lidar.perception, NetworkFile) else ""
    return [f"{line}: {unseen}" if unseen else line, UPPER_BOUND]


UPPER_BOUND = (
    "an upper bound: simulated bodies are simpler and smoother than people and vehicles, and every echo "
    "comes back (docs/lidar.md)"
)
"""Stands beside every result from simulated clouds."""


def perception_notes(specs: Sequence[RunSpec]) -> list[str]:
    """What the reader has to know about maps and light of runs in which somebody perceives, one line each."""
    lines: dict[str, list[str]] = {}
    seen: set[tuple[object, ...]] = set()
    for spec in specs:
        same = (spec.file, spec.parameters, spec.map_name, spec.night, spec.weather, spec.settings)
        if same in seen or spec.strategy == NO_AEB:
            continue
        seen.add(same)
        definition = definition_of(spec)
        used = perception_map(definition, spec.map_name)
        if used is not None:
            tracks = lines.setdefault(f"perception uses the map {used}", [])
            track = definition.map_path
            if spec.map_name is None and track is not None and track.name not in tracks:
                tracks.append(track.name)
        if is_night(definition):
            lines.setdefault(named_light(spec.night).source, [])
        for line in (*environment_notes(spec, definition), *lidar_notes(preset_of(spec, definition))):
            lines.setdefault(line, [])
    return [f"{line}, laid over {', '.join(tracks)}" if tracks else line for line, tracks in lines.items()]
