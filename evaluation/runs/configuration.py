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
from evaluation.runs.decoding import NO_LIMIT, decode, decoded_spec, is_scalar, list_of, object_of, texts_of
from evaluation.runs.fingerprint import (
    file_digest,
    file_digests,
    library_versions,
    map_file,
    network_versions,
    version,
)
from evaluation.runs.first_version import read_first
from evaluation.runs.specs import preset_text
from scenarios.catalogue.library import SHIPPED_SCENARIOS
from scenarios.catalogue.maps import SHIPPED_MAPS
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.presets import Preset, preset_at_night
from scenarios.reading import ReadError, read_json, shown
from scenarios.spec import RunSpec, definition_of, perception_map, preset_of
from scenarios.weather import is_night, named_light, named_weather
from smartmot.plugins import plugin

SHIPPED = "smartmot:"
"""Begins the name of a file of this package."""

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
        "versions": versions() | (network_versions() if any(spec.networks for spec in specs) else {}),
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
    text = preset_text(spec)
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
        "settings": {name: NO_LIMIT if value == math.inf else value for name, value in spec.settings},
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
        content = object_of(read_json(path), "the file")
        configuration = object_of(content.get("configuration"), "configuration")
        if "schema" not in content:
            runs, published = read_first(directory, configuration)
            stored = tuple(StoredRun(spec, preset, None) for spec, preset in runs)
            return Stored(_version(content), stored, {}, published)
        if content["schema"] != SCHEMA:
            raise ReadError(f"schema {shown(content['schema'])} is not {SCHEMA}, which this version reads")
        return _read(directory.resolve(), content, configuration)
    except ReadError as error:
        raise ResultsError(f"{path}: {error}; run the test again") from None


def _read(folder: Path, content: Mapping[str, Any], configuration: Mapping[str, Any]) -> Stored:
    table = object_of(configuration.get("presets"), "presets")
    presets = {name: decode(Preset, values, f"preset {shown(name)}") for name, values in table.items()}
    digests = texts_of(configuration.get("files"), "files")
    runs = []
    for k, values in enumerate(list_of(configuration.get("specs"), "specs")):
        where = f"specs[{k}]"
        values = dict(object_of(values, where))
        name, files = (
            values.pop("resolved_preset", None),
            list_of(values.pop("files", None), f"{where}.files"),
        )
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
    plugins = texts_of(configuration.get("plugins"), "plugins")
    return Stored(_version(content), tuple(runs), plugins, published)


def _spec_of(values: Mapping[str, Any], folder: Path, where: str) -> RunSpec:
    """The run that `_spec_values` wrote."""
    spec = decoded_spec(values, where)
    parameters = {name: _path_value(value, folder, where) for name, value in spec.parameters}
    named = spec.map_name is None or spec.map_name in SHIPPED_MAPS
    return replace(
        spec,
        file=spec.file if spec.file in SHIPPED_SCENARIOS else str(_path_of(spec.file, folder)),
        map_name=spec.map_name if named else str(_path_of(str(spec.map_name), folder)),
        parameters=tuple(sorted(parameters.items())),
    )


def _path_value(value: object, folder: Path, where: str) -> float | bool | str:
    if isinstance(value, Mapping) and set(value) == {"file"} and isinstance(value["file"], str):
        return str(_path_of(value["file"], folder))
    if is_scalar(value):
        return value  # type: ignore[return-value]
    raise ReadError(f"{where}.parameters must be numbers, texts and truth values, got {shown(value)}")


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


def in_light_of_run(run: StoredRun, definition: ScenarioDefinition) -> Preset:
    """The preset of a run; 0.1.0 wrote that of runs of files without night and phase."""
    if run.files is not None:
        return run.preset
    preset = run.preset
    if is_night(definition):
        preset = preset_at_night(preset, named_light(run.spec.night))
    return replace(preset, sensor=replace(preset.sensor, phase_s=run.spec.phase_s))
