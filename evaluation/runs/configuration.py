"""The configuration in `runs.json`: everything that determined each run, written by one command for the next.

Files are named relative to the folder of results, so that both can be moved together, and with the hash of
their content; those of this package by `smartmot:` and their place in it. Reading imports nothing: objects of
the user's own are names and hashes. docs/run-log.md has the format.
"""

from __future__ import annotations

import dataclasses
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import scenarios
from evaluation.results.files import RUNS_JSON, SCHEMA, ResultsError
from evaluation.runs.decoding import decode
from evaluation.runs.fingerprint import file_digest, file_digests, library_versions, map_file, version
from scenarios.catalogue.cpna import CpnaTest, approach_m, scenario_parameters
from scenarios.catalogue.library import SHIPPED_SCENARIOS
from scenarios.catalogue.maps import DEFAULT_MAP, SHIPPED_MAPS
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.places import Place, find_site, lane_at, site_at
from scenarios.presets import Preset, named_light, named_preset, named_weather, preset_at_night
from scenarios.reading import ReadError, read_json, shown
from scenarios.settings import settings_text
from scenarios.spec import RunSpec, definition_of, is_night, load_named_map, perception_map, preset_of
from smartmot.plugins import plugin

SHIPPED = "smartmot:"
"""Begins the name of a file of this package."""

_NO_LIMIT = "inf"
"""An infinite setting, which JSON has no number for."""

_ROOT = Path(str(scenarios.__file__)).resolve().parent


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run as its folder has it.

    Args:
        spec: the run; its files are where the folder says.
        preset: the whole of its conditions, in its weather and light, with its settings.
        files: hash of each file that it used, by path; None in a folder of version 0.1.0, which has none.
    """

    spec: RunSpec
    preset: Preset
    files: Mapping[Path, str] | None


@dataclass(frozen=True, slots=True)
class Stored:
    """The configuration of a folder.

    Args:
        version: of the program that wrote it.
        runs: in the order in which they were made.
        plugins: hash of what was of the user's own, by name.
        published: whether the paper printed results for these conditions.
    """

    version: str
    runs: tuple[StoredRun, ...]
    plugins: Mapping[str, str]
    published: bool


# ---- writing -----------------------------------------------------------------------------------------------


def configuration_of(
    specs: Sequence[RunSpec],
    out: Path,
    perception: Sequence[str] = (),
    published: bool = False,
    more: Mapping[str, object] | None = None,
) -> dict[str, object]:
    """Everything that determines runs, as plain values.

    Args:
        specs: the runs.
        out: folder that the configuration is written into.
        perception: what the reader has to know about maps and light, one line each.
        published: whether the paper printed results for these conditions.
        more: further entries, which later commands do not read.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: a scenario cannot be read.
        opendrive.OpenDriveError: a map cannot be read.
        ScenarioError: a file cannot be read.
    """
    folder = out.resolve()
    definitions: dict[object, tuple[ScenarioDefinition, dict[str, str]]] = {}
    presets: dict[str, Preset] = {}
    digests: dict[str, str] = {}
    runs: list[dict[str, object]] = []
    for spec in specs:
        same = (spec.file, spec.parameters, spec.map_name, spec.adversaries)
        if same not in definitions:
            definition = definition_of(spec)
            definitions[same] = (definition, digests_of_files(files_of(spec, definition), folder))
        definition, files = definitions[same]
        digests |= files
        name = _named(presets, spec, preset_of(spec, definition))
        runs.append(_spec_values(spec, folder) | {"resolved_preset": name, "files": sorted(files)})
    plugins = {name: plugin(name).digest for spec in specs for name in spec.plugins}
    weathers, nights = {spec.weather for spec in specs}, {spec.night for spec in specs}
    return {
        **(more or {}),
        "specs": runs,
        "presets": presets,
        "weather": {name: named_weather(name) for name in weathers},
        "light": {name: named_light(name) for name in nights},
        "files": digests,
        "plugins": plugins,
        "perception": list(perception),
        "published": published,
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Versions of this program, with a digest of its code, of Python and of the libraries."""
    return {"smartmot": version(), "python": platform.python_version(), **library_versions()}


def digests_of_files(paths: Iterable[Path], folder: Path) -> dict[str, str]:
    """Hash of each file, by its name as seen from a resolved folder.

    Raises:
        ScenarioError: a file cannot be read.
    """
    return {_name_of(path, folder): digest for path, digest in file_digests(paths).items()}


def files_of(spec: RunSpec, definition: ScenarioDefinition) -> list[Path]:
    """Every file that a run reads: scenario, catalogs, its map, the map of perception."""
    name = perception_map(definition, spec.map_name)
    return [*definition.files, *([map_file(name)] if name is not None else [])]


def _named(presets: dict[str, Preset], spec: RunSpec, preset: Preset) -> str:
    """Name of a run's preset in the table of presets, where equal ones stand once."""
    text = " ".join(filter(None, (spec.preset, spec.weather, settings_text(spec.settings))))
    name, number = text, 1
    while presets.setdefault(name, preset) != preset:
        number += 1
        name = f"{text} ({number})"
    return name


def _name_of(path: Path, folder: Path) -> str:
    """A file as the configuration names it: relative to the folder, or in this package."""
    path = path.resolve()
    if path.is_relative_to(_ROOT):
        return SHIPPED + path.relative_to(_ROOT).as_posix()
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


def _spec_values(spec: RunSpec, folder: Path) -> dict[str, Any]:
    """A run as JSON can hold it."""
    shipped_scenario, shipped_map = spec.file in SHIPPED_SCENARIOS, spec.map_name in SHIPPED_MAPS
    named = spec.map_name is None or shipped_map
    return dataclasses.asdict(spec) | {
        "file": spec.file if shipped_scenario else _name_of(Path(spec.file), folder),
        "map_name": spec.map_name if named else _name_of(Path(str(spec.map_name)), folder),
        "parameters": {name: _parameter(value, folder) for name, value in spec.parameters},
        "settings": {name: _NO_LIMIT if value == math.inf else value for name, value in spec.settings},
    }


def _parameter(value: object, folder: Path) -> object:
    """The value of a parameter; one that is the path of a file as an object with the file's name."""
    if isinstance(value, str) and Path(value).is_absolute() and Path(value).is_file():
        return {"file": _name_of(Path(value), folder)}
    return value


# ---- reading -----------------------------------------------------------------------------------------------


def read_configuration(directory: Path) -> Stored:
    """The configuration of a folder of results, of this version or of 0.1.0; imports nothing of the user's.

    Raises:
        ResultsError: `runs.json` is missing or not understood.
    """
    path = directory / RUNS_JSON
    if not path.is_file():
        raise ResultsError(f"{path}: no such file; run the test first")
    try:
        content = _object(read_json(path), "the file")
        configuration = _object(content.get("configuration"), "configuration")
        if "schema" not in content:
            return _read_first(directory, content, configuration)
        if content["schema"] != SCHEMA:
            raise ReadError(f"schema {shown(content['schema'])} is not {SCHEMA}, which this version reads")
        return _read(directory.resolve(), content, configuration)
    except ReadError as error:
        raise ResultsError(f"{path}: {error}; run the test again") from None


def read_specs(directory: Path) -> list[RunSpec]:
    """The runs that a folder of results holds; see `read_configuration`."""
    return [run.spec for run in read_configuration(directory).runs]


def _read(folder: Path, content: Mapping[str, Any], configuration: Mapping[str, Any]) -> Stored:
    table = _object(configuration.get("presets"), "presets")
    presets = {name: decode(Preset, values, f"preset {shown(name)}") for name, values in table.items()}
    digests = _texts(configuration.get("files"), "files")
    runs = []
    for k, values in enumerate(_list(configuration.get("specs"), "specs")):
        where = f"specs[{k}]"
        values = dict(_object(values, where))
        name, files = values.pop("resolved_preset", None), _list(values.pop("files", None), f"{where}.files")
        if not isinstance(name, str) or name not in presets:
            raise ReadError(f"{where}.resolved_preset must be one of presets, got {shown(name)}")
        for file in files:
            if not isinstance(file, str) or file not in digests:
                raise ReadError(f"{where}.files must be of files, got {shown(file)}")
        used = {_path_of(file, folder): digests[file] for file in files}
        runs.append(StoredRun(_spec_of(values, folder, where), presets[name], used))
    published = configuration.get("published")
    if not isinstance(published, bool):
        raise ReadError(f"published must be true or false, got {shown(published)}")
    plugins = _texts(configuration.get("plugins"), "plugins")
    return Stored(_version(content), tuple(runs), plugins, published)


def _spec_of(values: Mapping[str, Any], folder: Path, where: str) -> RunSpec:
    """The run that `_spec_values` wrote."""
    spec = _decoded_spec(values, where)
    parameters = {name: _path_value(value, folder, where) for name, value in spec.parameters}
    named = spec.map_name is None or spec.map_name in SHIPPED_MAPS
    return replace(
        spec,
        file=spec.file if spec.file in SHIPPED_SCENARIOS else str(_path_of(spec.file, folder)),
        map_name=spec.map_name if named else str(_path_of(str(spec.map_name), folder)),
        parameters=tuple(sorted(parameters.items())),
    )


def _decoded_spec(values: Mapping[str, Any], where: str, defaults: bool = False) -> RunSpec:
    """A run whose files are still named as in the configuration."""
    plain = {name: value for name, value in values.items() if name not in ("parameters", "settings")}
    spec = decode(RunSpec, plain | {"parameters": [], "settings": []}, where, defaults)
    parameters = _object(values.get("parameters"), f"{where}.parameters")
    settings = _object(values.get("settings", {}), f"{where}.settings")
    for name, value in settings.items():
        if not _is_scalar(value) or isinstance(value, bool):
            raise ReadError(f"{where}.settings.{name} must be a number or a text, got {shown(value)}")
    known = tuple((name, math.inf if value == _NO_LIMIT else value) for name, value in settings.items())
    return replace(spec, parameters=tuple(sorted(parameters.items())), settings=known)


def _path_value(value: object, folder: Path, where: str) -> float | bool | str:
    if isinstance(value, Mapping) and set(value) == {"file"} and isinstance(value["file"], str):
        return str(_path_of(value["file"], folder))
    if _is_scalar(value):
        return value  # type: ignore[return-value]
    raise ReadError(f"{where}.parameters must be numbers, texts and truth values, got {shown(value)}")


def _is_scalar(value: object) -> bool:
    return isinstance(value, (bool, str)) or (isinstance(value, (int, float)) and math.isfinite(value))


def _path_of(name: str, folder: Path) -> Path:
    """The file that `_name_of` named."""
    if "\0" in name:
        raise ReadError(f"no name of a file: {shown(name)}")
    if not name.startswith(SHIPPED):
        return Path(os.path.normpath(folder / name))
    path = Path(os.path.normpath(_ROOT / name.removeprefix(SHIPPED)))
    if not path.is_relative_to(_ROOT):
        raise ReadError(f"no file of this package: {shown(name)}")
    return path


def changed_file(run: StoredRun) -> str | None:
    """What is wrong with the files of a run: one that is not there, or has changed since; None: nothing."""
    for path, digest in (run.files or {}).items():
        if not path.is_file():
            return f"{path} is not there; move the files of a run together with its folder"
        if file_digest(path) != digest:
            return f"{path} has changed since the run"
    return None


def _version(content: Mapping[str, Any]) -> str:
    text = content.get("version")
    if not isinstance(text, str):
        raise ReadError(f"version must be a text, got {shown(text)}")
    return text


def _object(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ReadError(f"{where} must be an object, got {shown(value)}")
    return value


def _list(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise ReadError(f"{where} must be a list, got {shown(value)}")
    return value


def _texts(value: object, where: str) -> Mapping[str, str]:
    for name, text in _object(value, where).items():
        if not isinstance(text, str):
            raise ReadError(f"{where}.{name} must be a text, got {shown(text)}")
    return _object(value, where)


# ---- version 0.1.0 -----------------------------------------------------------------------------------------


def _read_first(directory: Path, content: Mapping[str, Any], configuration: Mapping[str, Any]) -> Stored:
    """A folder of 0.1.0, which had two formats, no hashes, and paths relative to where it was made.

    Fields that a preset has got since have the values that they replaced, which are their defaults.
    """
    table = _object(configuration.get("presets"), "presets")
    presets = {name: decode(Preset, values, f"preset {shown(name)}", True) for name, values in table.items()}
    if "suite" in configuration:
        suite = _object(configuration["suite"], "suite")
        specs = _suite_specs(suite, directory)
        published = _is_published(suite)
    else:
        specs = [
            _found_beside(_decoded_spec(_object(values, "specs"), f"specs[{k}]", True), directory)
            for k, values in enumerate(_list(configuration.get("specs"), "specs"))
        ]
        published = False
    runs = []
    for spec in specs:
        name = spec.weather
        if "suite" not in configuration:
            name = " ".join(filter(None, (spec.preset, spec.weather, settings_text(spec.settings))))
        if name not in presets:
            raise ReadError(f"presets has no {shown(name)}")
        runs.append(StoredRun(spec, presets[name], None))
    return Stored(_version(content), tuple(runs), {}, published)


def in_light_of_run(run: StoredRun, definition: ScenarioDefinition) -> Preset:
    """The preset of a run; 0.1.0 wrote that of runs of files without night and phase."""
    if run.files is not None:
        return run.preset
    preset = run.preset
    if is_night(definition):
        preset = preset_at_night(preset, named_light(run.spec.night))
    return replace(preset, sensor=replace(preset.sensor, phase_s=run.spec.phase_s))


def _found_beside(spec: RunSpec, directory: Path) -> RunSpec:
    """A run whose files are in its folder, else where the path leads from here."""

    def beside(name: str) -> str:
        if "\0" in name:
            raise ReadError(f"no name of a file: {shown(name)}")
        return str(directory / name) if (directory / name).is_file() else name

    map_name = (
        spec.map_name if spec.map_name is None or spec.map_name in SHIPPED_MAPS else beside(spec.map_name)
    )
    file = spec.file if spec.file in SHIPPED_SCENARIOS else beside(spec.file)
    for name, value in spec.parameters:
        if not _is_scalar(value):
            raise ReadError(
                f"parameter {shown(name)} must be a number, text or truth value, got {shown(value)}"
            )
    return replace(spec, file=file, map_name=map_name)


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


def _first_suite(
    values: Mapping[str, Any],
) -> tuple[_FirstSuite, tuple[str, ...], Place | None, dict[str, Any]]:
    """The suite, names of its weathers, its place and its settings."""
    apart = ("weather", "place", "settings")
    suite = decode(_FirstSuite, {k: v for k, v in values.items() if k not in apart}, "suite")
    conditions = _list(values.get("weather"), "suite.weather")
    weather = tuple(str(_object(one, "suite.weather").get("name")) for one in conditions)
    place = None if values.get("place") is None else decode(Place, values["place"], "suite.place")
    return suite, weather, place, dict(_object(values.get("settings", {}), "suite.settings"))


def _suite_specs(values: Mapping[str, Any], directory: Path) -> list[RunSpec]:
    """The runs of a comparison that `cpna` of 0.1.0 made."""
    suite, weather, place, settings = _first_suite(values)
    if not suite.speeds_kmh:
        raise ReadError("suite.speeds_kmh is empty")
    beside = directory / suite.map
    map_name = str(beside) if suite.map not in SHIPPED_MAPS and beside.is_file() else suite.map
    network = load_named_map(map_name)
    needed = approach_m(max(suite.speeds_kmh))
    site = (
        find_site(network, needed)
        if place is None
        else site_at(network, lane_at(network, place), place.s_m, needed)
    )
    file = f"../maps/{map_name}.xodr" if map_name in SHIPPED_MAPS else str(Path(map_name).resolve())
    preset = named_preset(suite.preset)
    specs = []
    for speed in suite.speeds_kmh:
        test = CpnaTest(speed, suite.impact_point_percent, suite.adversaries, suite.seed)
        parameters = tuple(sorted({"Map": file, **scenario_parameters(test, site, preset)}.items()))
        specs += [
            RunSpec(
                scenario=test.name,
                file=test.scenario,
                parameters=parameters,
                strategy=strategy,
                preset=suite.preset,
                weather=name,
                v_test_kmh=speed,
                map_name=map_name,
                adversaries=suite.adversaries,
                seed=suite.seed,
                phase_s=suite.phase_s,
                paper_points=True,
                settings=tuple(settings.items()),
            )
            for name in weather
            for strategy in suite.strategies
        ]
    return specs


def _is_published(values: Mapping[str, Any]) -> bool:
    """Whether the paper printed results for a comparison of 0.1.0."""
    suite, weather, place, settings = _first_suite(values)
    usual = suite.preset == "paper" and suite.map == DEFAULT_MAP and suite.adversaries == "none"
    return usual and weather == ("dry",) and not (suite.impact_point_percent or place or settings)
