"""What a finished run is known by: a hash of everything that determines it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import cache
from importlib import metadata
from pathlib import Path

import evaluation
import opendrive
import scenarios
import smartmot
from scenarios.catalogue.library import scenario_path
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.reader import load
from scenarios.presets import named_preset
from scenarios.sensors.lidar.chain import NetworkFile
from scenarios.settings import Settings, preset_with
from scenarios.spec import NCAP_MAP, RunSpec
from scenarios.traffic.session import library_versions as sumo_versions
from smartmot.plugins import is_plugin, plugin

OF_EVALUATION = (
    "metrics/criticality.py", "metrics/detection/counts.py", "metrics/detection/from_above.py",
    "metrics/rear_end.py", "protocols/bands.py", "protocols/paper.py", "results/logs.py", "results/rows.py",
    "results/seal.py", "runs/execution.py", "studies/answers/lidar/runs.py", "studies/answers/measures.py",
    "studies/answers/severity/behind.py", "studies/answers/severity/runs.py",
    "studies/compare/measures.py", "studies/detectors/clouds.py",
    "studies/detectors/comparison.py",
    "studies/drive/drive.py", "studies/drive/exposure.py", "studies/drive/measures.py",
    "studies/drive/verdicts.py", "studies/growth.py", "studies/reference/mechanisms.py",
)  # fmt: skip
"""Modules of this package that what is kept of a run depends on. A test finds them from the studies' jobs."""

VERSIONED = (".py", ".json", ".toml")
"""Files of the floors below that runs depend on."""

HASHED_BY_RUNS = (".xosc", ".xodr", ".onnx")
"""Their other files: scenarios, maps and networks are hashed by the runs that use them."""

LIBRARIES = (
    "filterpy", "highway-env", "lxml", "matplotlib", "numpy", "pandas", "pyarrow", "scipy", "shapely",
)  # fmt: skip
"""Distributions whose versions are told with the results."""


@cache
def version() -> str:
    """Version of the distribution with a digest of the code and the tables that runs depend on."""
    digest = hashlib.sha256()
    for package in (opendrive, smartmot, scenarios):
        root = Path(str(package.__file__)).parent
        for path in sorted(path for path in root.rglob("*") if path.suffix in VERSIONED):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    root = Path(str(evaluation.__file__)).parent
    for name in OF_EVALUATION:
        digest.update((root / name).read_bytes())
    return f"{metadata.version('smartmot')}+{digest.hexdigest()[:12]}"


@cache
def library_versions() -> dict[str, str]:
    """Versions of the libraries that runs depend on."""
    return {name: metadata.version(name) for name in LIBRARIES}


def network_versions() -> dict[str, str]:
    """Versions of the libraries that networks are run by."""
    return {"onnxruntime": metadata.version("onnxruntime")}


def fingerprint(spec: RunSpec, *more: object) -> str:
    """Hash of a run's values, its files, its preset with its settings, the code, and whatever else is told.

    The code is this distribution's, and that of the libraries by their versions. A network is known by the
    hash of its file. A setting that says what the
    preset has anyway makes no other run. The files are all that reading the scenario touches (itself, its
    catalogs, its map) and the map of perception; where they lie is no matter.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scenario cannot be read.
        ScenarioError: a file cannot be read.
    """
    path = scenario_path(spec.file)
    files = [file_digest(file) for file in (*scenario_files(spec), map_of_perception(spec))]
    parameters = dict(spec.parameters)
    parameters.pop("Map", None)
    told_map = None if spec.map_name is None else Path(spec.map_name).name
    values = asdict(replace(spec, file=path.name, parameters=(), settings=(), map_name=told_map))
    code = [version(), library_versions()]
    networks = tuple(file_digest(path) for path in spec.networks)
    hashed = [values, parameters, _preset_text(spec.preset, spec.settings, networks), files, code, *more]
    if networks:
        hashed.append(network_versions())
    if spec.traffic is not None:
        hashed.append(sumo_versions())
    if is_plugin(spec.strategy):
        hashed.append(plugin(spec.strategy).digest)
    return digest_of(hashed)


def scenario_files(spec: RunSpec) -> tuple[Path, ...]:
    """All files that reading a run's scenario touches; see `fingerprint` for what it raises."""
    return load(scenario_path(spec.file), dict(spec.parameters), spec.map_name).files


def map_of_perception(spec: RunSpec) -> Path:
    """File of the map that perception uses: without a name that of the scenario, or this one in its place."""
    return map_file(spec.map_name or NCAP_MAP)


def map_file(name: str) -> Path:
    """File of a shipped map by its name, or of any map."""
    return shipped_map(name) if name in SHIPPED_MAPS else Path(name)


def digest_of(values: object) -> str:
    """Hash of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:24]


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal digits; an unchanged file is read once.

    Raises:
        ScenarioError: it cannot be read.
    """
    try:
        stat = path.stat()
        return _digest(path, stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        raise ScenarioError(f"{path}: {error.strerror}") from None


def file_digests(paths: Iterable[Path]) -> dict[Path, str]:
    """Digests of files by their resolved paths; see `file_digest`."""
    return {path: file_digest(path) for path in dict.fromkeys(path.resolve() for path in paths)}


@cache
def _preset_text(name: str, settings: Settings, networks: tuple[str, ...]) -> str:
    """The values of a preset; a network is its content, whatever its file is called.

    Args:
        name: of the preset.
        settings: put into it.
        networks: SHA-256 of the networks that the settings name, so that a changed file is read again.
    """
    preset = preset_with(named_preset(name), settings)
    lidar = preset.lidar
    if lidar is not None and isinstance(lidar.perception, NetworkFile):
        preset = replace(preset, lidar=replace(lidar, perception=replace(lidar.perception, path="")))
    return json.dumps(asdict(preset), sort_keys=True)


@cache
def _digest(path: Path, mtime_ns: int, size: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
