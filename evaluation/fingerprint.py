"""What a finished run is known by: a hash of everything that determines it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from functools import cache
from importlib import metadata
from pathlib import Path

import evaluation
import opendrive
import scenarios
import smartmot
from evaluation.runs import RunSpec
from evaluation.settings import Settings, preset_with
from scenarios.library import scenario_path
from scenarios.presets import named_preset
from smartmot.plugins import is_plugin, plugin

OF_EVALUATION = (
    "protocols/bands.py", "protocols/paper.py", "results.py", "runs.py", "study/criticality.py",
    "settings.py", "study/growth.py", "study/measures.py",
)  # fmt: skip
"""Modules of this package that what is kept of a run depends on."""


@cache
def version() -> str:
    """Version of the distribution with a digest of the code that runs depend on."""
    digest = hashlib.sha256()
    for package in (opendrive, smartmot, scenarios):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    root = Path(str(evaluation.__file__)).parent
    for name in OF_EVALUATION:
        digest.update((root / name).read_bytes())
    return f"{metadata.version('smartmot')}+{digest.hexdigest()[:12]}"


def fingerprint(spec: RunSpec, *more: object) -> str:
    """Hash of a run's values, its files, its preset with its settings, the code, and whatever else is told.

    A setting that says what the preset has anyway makes no other run.
    """
    parameters = dict(spec.parameters)
    path = scenario_path(spec.file)
    files = [_digest(path)]
    if "Map" in parameters:
        files.append(_digest(path.parent / str(parameters.pop("Map"))))
    values = asdict(replace(spec, file=path.name, parameters=(), settings=()))
    told = [values, parameters, _preset_text(spec.preset, spec.settings), files, version(), *more]
    if is_plugin(spec.strategy):
        told.append(plugin(spec.strategy).digest)
    return digest_of(told)


def digest_of(values: object) -> str:
    """Hash of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:24]


@cache
def _preset_text(name: str, settings: Settings) -> str:
    return json.dumps(asdict(preset_with(named_preset(name), settings)), sort_keys=True)


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
