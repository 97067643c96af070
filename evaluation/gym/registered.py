"""The registered environments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evaluation.gym.environment import BrakingEnv
from evaluation.runs.cpna import CpnaSuite, load_site
from evaluation.runs.specs import Conditions, scenario_specs
from evaluation.studies.compare.grid import Point, study_runs
from scenarios.scenes.scenes import choose_scenes

SPEEDS_KMH = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Of the paper's test."""


def cpna(
    speeds_kmh: Sequence[float] = SPEEDS_KMH,
    strategies: Sequence[str] = ("rectangular", "map"),
    preset: str = "paper",
    weather: str = "dry",
    **options: Any,
) -> BrakingEnv:
    """`smartmot/CPNA-v0`: the runs of `smartmot-eval cpna`.

    Args:
        speeds_kmh: test speeds.
        strategies: monitored areas.
        preset: conditions.
        weather: conditions.
        options: see `BrakingEnv`.
    """
    conditions = Conditions(tuple(strategies), preset, weather=(weather,))
    suite = CpnaSuite(tuple(map(float, speeds_kmh)), conditions)
    return BrakingEnv(suite.specs(load_site(suite)), **options)


def scenario(
    scenario: str | Path,
    parameters: Mapping[str, object] | None = None,
    strategy: str = "map",
    preset: str = "physical",
    weather: str = "dry",
    **options: Any,
) -> BrakingEnv:
    """`smartmot/Scenario-v0`: a shipped scenario by its name, or an OpenSCENARIO file; all its variations.

    Args:
        scenario: name or file.
        parameters: values in place of the declared ones.
        strategy: monitored area.
        preset: conditions.
        weather: conditions.
        options: see `BrakingEnv`.
    """
    values = {name: str(value) for name, value in (parameters or {}).items()}
    conditions = Conditions((strategy,), preset, weather=(weather,))
    return BrakingEnv(scenario_specs(str(scenario), values, conditions), **options)


def scenes(
    names: Sequence[str] = (),
    strategy: str = "path",
    preset: str = "physical",
    weather: str = "dry",
    **options: Any,
) -> BrakingEnv:
    """`smartmot/Scenes-v0`: the scenes of `smartmot-eval compare`, some of which ask for no brake.

    Args:
        names: of scenes; none: all.
        strategy: monitored area.
        preset: conditions.
        weather: conditions.
        options: see `BrakingEnv`.
    """
    chosen = choose_scenes(tuple(names))
    items = study_runs([Point(strategy)], chosen, preset, (weather,), 1)
    return BrakingEnv([item.spec for item in items], **options)
