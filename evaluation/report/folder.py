"""A folder of runs, and what its configuration says about map, route and monitored areas."""

from __future__ import annotations

import json
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation import results, runner
from evaluation.results import ResultsError
from evaluation.runs import NO_AEB, definition_of, preset_of, scene_of
from opendrive import OpenDriveError, RoadNetwork
from scenarios.brakes import BrakeConfig
from scenarios.errors import ScenarioError
from scenarios.openscenario.errors import OpenScenarioError
from scenarios.places import Scene
from scenarios.presets import Preset
from scenarios.strategies import make_strategy
from smartmot.aeb import AebConfig
from smartmot.braking import BrakingDistance
from smartmot.errors import SmartMotError
from smartmot.monitored_area import MapAreaConfig, MonitoredAreaStrategy, RectangularConfig
from smartmot.route import Route

if TYPE_CHECKING:
    import pandas as pd

Run = Mapping[Hashable, Any]
"""A row of `runs.csv`."""


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """Where a run took place and how it was set up.

    Args:
        map_name: file or shipped map.
        network: map of perception.
        route: the ego's way on it.
        preset: conditions, with areas, brakes and decision as `runs.json` has them.
        strategy: what made the monitored area; None for one that this program does not know by name.
        must: what the ego must do, brake or nothing, where that is known.
    """

    map_name: str
    network: RoadNetwork
    route: Route
    preset: Preset
    strategy: MonitoredAreaStrategy | None
    must: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class RunFolder:
    """A folder of results.

    Args:
        path: the folder.
        runs: its table of runs.
        settings: by name of the log; empty where map and areas cannot be had again.
        published: whether the paper printed results for these conditions.
        version: of the program that made them, if known.
        notes: what the reader has to know about what is missing, one line each.
    """

    path: Path
    runs: pd.DataFrame
    settings: Mapping[str, Setting]
    published: bool
    version: str
    notes: tuple[str, ...]

    def log(self, name: str) -> pd.DataFrame:
        """The log of one run.

        Raises:
            ResultsError: it is missing or broken.
        """
        return results.read_log(results.log_path(self.path, name))


def read_folder(path: Path) -> RunFolder:
    """Read a folder of results; logs are read when asked for.

    Raises:
        ResultsError: the folder, its table or its logs are missing or not understood.
    """
    _refuse_comparison(path)
    runs = results.read_runs(path)
    if runs.empty:
        raise ResultsError(f"{path / results.RUNS_CSV}: no runs; run at least one test into this folder")
    missing = [n for n in runs["log"].dropna() if not results.log_path(path, str(n)).is_file()]
    if missing or runs["log"].isna().all():
        some = f"{len(missing)} of {len(runs)} logs, first {missing[0]}" if missing else "all logs"
        raise ResultsError(f"{path}: without {some}, nothing can be replayed; run the evaluation again")
    notes = []
    if runs["log"].isna().any():
        notes.append(f"{int(runs['log'].isna().sum())} runs have no log and cannot be replayed.")
    settings: dict[str, Setting] = {}
    published = False
    try:
        settings = read_settings(path, runs)
        published = _is_published(path)
    except (ResultsError, OpenDriveError, OpenScenarioError, ScenarioError, SmartMotError) as error:
        notes.append(f"Lanes and monitored areas are not drawn: {error}")
    return RunFolder(path, runs, settings, published, _version(path), tuple(notes))


def _refuse_comparison(path: Path) -> None:
    """A comparison has measures of many runs, and logs only in a folder within it, if asked for.

    Raises:
        ResultsError: the folder is one.
    """
    if not (path / "compare.json").is_file():
        return
    inside = path / "runs"
    if (inside / results.RUNS_CSV).is_file():
        raise ResultsError(f"{path}: a comparison over scenes; its logged runs are in {inside}")
    raise ResultsError(f"{path}: a comparison over scenes without logs; make them with compare --logs")


def _is_published(path: Path) -> bool:
    """Whether the paper printed results for these runs; scenario files have none."""
    try:
        return runner.is_published(runner.read_suite(path))
    except ResultsError:
        return False


def _version(path: Path) -> str:
    """Version that `runs.json` names; nothing where it cannot be read."""
    try:
        return str(json.loads((path / results.RUNS_JSON).read_text())["version"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def read_settings(path: Path, runs: pd.DataFrame) -> dict[str, Setting]:
    """Map, route and conditions of the runs of a folder, by the names of their logs, from `runs.json`.

    Raises:
        ResultsError: the configuration is missing or not of this program.
        opendrive.OpenDriveError: a map cannot be read.
        OpenScenarioError: a scenario cannot be read.
        ScenarioError: the place does not exist on the map.
        SmartMotError: a setting of an area is impossible.
    """
    stored = json.loads((path / results.RUNS_JSON).read_text())["configuration"].get("presets", {})
    named = set(runs["log"].dropna())
    scenes: dict[object, Scene] = {}
    settings = {}
    for spec in runner.read_specs(path):
        if spec.log not in named:
            continue
        preset = preset_of(spec, definition_of(spec))
        if spec.weather in stored:
            preset = _as_stored(preset, stored[spec.weather], path)
        # the place does not depend on what perceives there
        place = replace(spec, strategy=NO_AEB, weather="dry", seed=0, phase_s=0.0)
        scene = scenes.get(place)
        if scene is None:
            scene = scenes[place] = scene_of(place)
        try:
            strategy = make_strategy(spec.strategy, preset, scene)
        except ScenarioError:
            strategy = None
        name = spec.map_name or scene.network.name or str(dict(spec.parameters).get("Map", ""))
        settings[spec.log] = Setting(Path(name).name, scene.network, scene.route, preset, strategy, spec.must)
    return settings


def _as_stored(preset: Preset, values: Mapping[str, Any], path: Path) -> Preset:
    """The preset that the runs were made with, which need not be that of its name today."""
    try:
        return replace(
            preset,
            rectangular=RectangularConfig(**values["rectangular"]),
            map_area=MapAreaConfig(**values["map_area"]),
            brakes=BrakeConfig(**values["brakes"]),
            pipeline=replace(
                preset.pipeline,
                aeb=AebConfig(**values["pipeline"]["aeb"]),
                braking_distance=BrakingDistance(**values["pipeline"]["braking_distance"]),
            ),
        )
    except (KeyError, TypeError) as error:
        raise ResultsError(
            f"{path / results.RUNS_JSON}: preset not understood ({error!r}); run the test again"
        ) from None
