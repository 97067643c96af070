"""Folders of version 0.1.0, which had two formats, no hashes, and paths relative to where they were made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evaluation.runs.cpna import cpna_runs
from evaluation.runs.decoding import decode, decoded_spec, is_scalar, list_of, object_of
from evaluation.runs.specs import preset_text
from scenarios.catalogue.cpna import CpnaTest, find_site
from scenarios.catalogue.library import SHIPPED_SCENARIOS
from scenarios.catalogue.maps import DEFAULT_MAP, SHIPPED_MAPS
from scenarios.places import Place
from scenarios.presets import Preset
from scenarios.reading import ReadError, shown
from scenarios.spec import RunSpec, load_named_map


def read_first(
    directory: Path, configuration: Mapping[str, Any]
) -> tuple[list[tuple[RunSpec, Preset]], bool]:
    """The runs of a folder with their presets, and whether the paper printed results for them.

    Fields that a preset has got since have the values that they replaced, which are their defaults.

    Args:
        directory: the folder.
        configuration: as its `runs.json` has it.

    Raises:
        ReadError: it is not understood.
    """
    table = object_of(configuration.get("presets"), "presets")
    presets = {name: decode(Preset, values, f"preset {shown(name)}", True) for name, values in table.items()}
    if "suite" in configuration:
        specs, published = _suite_specs(object_of(configuration["suite"], "suite"), directory)
        runs = [(spec, spec.weather) for spec in specs]
    else:
        listed = enumerate(list_of(configuration.get("specs"), "specs"))
        specs = [decoded_spec(object_of(values, "specs"), f"specs[{k}]", True) for k, values in listed]
        runs = [(_beside_folder(spec, directory), preset_text(spec)) for spec in specs]
        published = False
    for _, name in runs:
        if name not in presets:
            raise ReadError(f"presets has no {shown(name)}")
    return [(spec, presets[name]) for spec, name in runs], published


def _beside_folder(spec: RunSpec, directory: Path) -> RunSpec:
    """A run whose files are in its folder, else where the path leads from the current one."""

    def beside(name: str) -> str:
        if "\0" in name:
            raise ReadError(f"no name of a file: {shown(name)}")
        return str(directory / name) if (directory / name).is_file() else name

    is_named = spec.map_name is None or spec.map_name in SHIPPED_MAPS
    for name, value in spec.parameters:
        if not is_scalar(value):
            raise ReadError(
                f"parameter {shown(name)} must be a number, text or truth value, got {shown(value)}"
            )
    return replace(
        spec,
        file=spec.file if spec.file in SHIPPED_SCENARIOS else beside(spec.file),
        map_name=spec.map_name if is_named else beside(str(spec.map_name)),
    )


@dataclass(frozen=True, slots=True)
class _FirstSuite:
    """What `cpna` of 0.1.0 wrote of a comparison; weather, place and settings are read apart."""

    speeds_kmh: tuple[float, ...]
    strategies: tuple[str, ...]
    preset: str
    map: str
    adversaries: str
    seed: int
    phase_s: float
    impact_point_percent: float | None


def _suite_specs(values: Mapping[str, Any], directory: Path) -> tuple[list[RunSpec], bool]:
    """The runs of a comparison that `cpna` of 0.1.0 made, and whether the paper printed results for them.

    Nothing of the user's own is imported.
    """
    apart = ("weather", "place", "settings")
    suite = decode(_FirstSuite, {k: v for k, v in values.items() if k not in apart}, "suite")
    conditions = list_of(values.get("weather"), "suite.weather")
    weather = tuple(str(object_of(entry, "suite.weather").get("name")) for entry in conditions)
    place = None if values.get("place") is None else decode(Place, values["place"], "suite.place")
    settings = tuple(object_of(values.get("settings", {}), "suite.settings").items())
    if not suite.speeds_kmh:
        raise ReadError("suite.speeds_kmh is empty")
    usual = suite.preset == "paper" and suite.map == DEFAULT_MAP and suite.adversaries == "none"
    changed = suite.impact_point_percent or place or settings
    beside = directory / suite.map
    map_name = str(beside) if suite.map not in SHIPPED_MAPS and beside.is_file() else suite.map
    site = find_site(load_named_map(map_name), max(suite.speeds_kmh), place)
    tests = [CpnaTest(v, suite.impact_point_percent, suite.adversaries, suite.seed) for v in suite.speeds_kmh]
    specs = [
        replace(
            run,
            strategy=strategy,
            preset=suite.preset,
            weather=name,
            map_name=map_name,
            adversaries=suite.adversaries,
            seed=suite.seed,
            phase_s=suite.phase_s,
            settings=settings,
        )
        for run in cpna_runs(tests, site, map_name, suite.preset)
        for name in weather
        for strategy in suite.strategies
    ]
    return specs, usual and weather == ("dry",) and not changed
