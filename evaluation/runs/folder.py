"""A folder of results, and what its configuration says about map, route and monitored area of each run."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.results.files import COMPARE_JSON, RUNS_CSV, RUNS_JSON, ResultsError, log_path
from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from evaluation.runs.configuration import (
    Stored,
    StoredRun,
    changed_file,
    files_of,
    in_light_of_run,
    read_configuration,
)
from opendrive import OpenDriveError, RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.motion.roads import load_roads
from scenarios.places import MapView
from scenarios.presets import Preset
from scenarios.simulation.simulation import Simulation
from scenarios.spec import RunSpec, definition_of, load_named_map, perception_map
from scenarios.strategies import STRATEGIES, make_strategy
from smartmot.area import (
    AdaptiveArea,
    EverythingArea,
    MapArea,
    MonitoredArea,
    MonitoredAreaStrategy,
    PathArea,
    RectangularArea,
)
from smartmot.errors import PluginError, SmartMotError
from smartmot.maps.route import Route
from smartmot.plugins import failure, is_plugin, require, source_digest
from smartmot.types import EgoState

if TYPE_CHECKING:
    import pandas as pd

Run = Mapping[Hashable, Any]
"""A row of `runs.csv`."""


@dataclass(frozen=True, slots=True, eq=False)
class RunSetup:
    """Where a run took place and how it was set up, as far as that is known; of a log alone nothing is.

    Args:
        map_name: file or shipped map.
        network: map of perception.
        route: the ego's way on it.
        preset: conditions, with areas, brakes and decision as `runs.json` has them.
        strategy: what made the monitored area; None for one that this program does not know by name.
        must: what the ego must do, brake or nothing, where that is known.
    """

    map_name: str = ""
    network: RoadNetwork | None = None
    route: Route | None = None
    preset: Preset | None = None
    strategy: MonitoredAreaStrategy | None = None
    must: str = ""


UNKNOWN_SETUP = RunSetup()


@dataclass(frozen=True, slots=True, eq=False)
class RunFolder:
    """A folder of results.

    Args:
        path: the folder.
        runs: its table of runs.
        setups: by name of the log; empty where map and areas cannot be had again.
        published: whether the paper printed results for these conditions.
        version: of the program that made them, if known.
        notes: what the reader has to know about what is missing, one line each.
    """

    path: Path
    runs: pd.DataFrame
    setups: Mapping[str, RunSetup]
    published: bool
    version: str
    notes: tuple[str, ...]

    def log(self, name: str) -> pd.DataFrame:
        """The log of one run.

        Raises:
            ResultsError: it is missing or broken, or has no ego that can be shown.
        """
        return read_shown_log(log_path(self.path, name))

    def row(self, name: str) -> Run:
        """The row of a run by the name of its log.

        Raises:
            ArgumentError: there is none.
        """
        match = self.runs[self.runs["log"] == name]
        if match.empty:
            known = self.runs["log"].dropna().tolist()
            more = f" and {len(known) - 3} more" if len(known) > 3 else ""
            raise ArgumentError(f"RUN: no run {name!r} in {self.path}; it has: {', '.join(known[:3])}{more}")
        return match.to_dict("records")[0]

    @property
    def settings(self) -> Mapping[str, RunSetup]:
        """Old name of `setups`, for one version."""
        warnings.warn("RunFolder.settings is now setups", DeprecationWarning, stacklevel=2)
        return self.setups

    def setup(self, name: str) -> RunSetup:
        """How the run of a log was set up; `UNKNOWN_SETUP` where that is not known."""
        return self.setups.get(name, UNKNOWN_SETUP)


@dataclass(slots=True, eq=False)
class OwnArea:
    """A monitored area of the user's own, whose errors are told as such.

    Args:
        name: its own name if it has one, else that of the plug-in.
        plugin: `package.module:name`.
        own: what that made.
    """

    name: str
    plugin: str
    own: MonitoredAreaStrategy

    @property
    def route(self) -> Route:
        """Its route, if it has one, along which the ego's forecast can be made."""
        return self.own.route  # type: ignore[attr-defined, no-any-return]

    def at(self, ego: EgoState) -> MonitoredArea:
        """The monitored area around `ego`.

        Raises:
            PluginError: the user's code fails, or returns something else.
        """
        try:
            area = self.own.at(ego)
        except SmartMotError:
            raise
        except (Exception, SystemExit) as error:
            raise failure(self.plugin, error) from error
        for method in ("relevance", "polygons"):
            require(area, method, self.plugin)
        return area


def read_shown_log(path: Path) -> pd.DataFrame:
    """A log that has an ego that can be shown.

    Raises:
        ResultsError: it is missing or broken, or has no such ego.
    """
    log = read_log(path)
    ego = log[log["kind"] == "ego"]
    if ego.empty:
        raise ResultsError(f"{path}: no rows of kind 'ego', nothing to show; see docs/run-log.md")
    if not (ego[["length_m", "width_m"]] > 0.0).to_numpy().all():
        raise ResultsError(f"{path}: the ego's length and width must be positive; see docs/run-log.md")
    return log


def read_folder(path: Path, allow_plugins: bool = False) -> RunFolder:
    """Read a folder of results; logs are read when asked for.

    Args:
        path: the folder.
        allow_plugins: whether code of the user's own may make monitored areas again.

    Raises:
        ResultsError: the folder, its table or its logs are missing or not understood.
    """
    refuse_comparison(path)
    runs = read_runs(path)
    if runs.empty:
        raise ResultsError(f"{path / RUNS_CSV}: no runs; run at least one test into this folder")
    missing = [n for n in runs["log"].dropna() if not log_path(path, str(n)).is_file()]
    if missing or runs["log"].isna().all():
        some = f"{len(missing)} of {len(runs)} logs, first {missing[0]}" if missing else "all logs"
        raise ResultsError(f"{path}: without {some}, nothing can be replayed; run the evaluation again")
    notes = []
    if runs["log"].isna().any():
        notes.append(f"{int(runs['log'].isna().sum())} runs have no log and cannot be replayed.")
    setups: dict[str, RunSetup] = {}
    published, version = False, ""
    try:
        stored = read_configuration(path)
        published, version = stored.published, stored.version
        setups, missing_notes = read_setups(path, stored, runs, allow_plugins)
        notes += missing_notes
    except (ResultsError, OpenDriveError, ScenarioError, SmartMotError) as error:
        notes.append(f"Lanes and monitored areas are not drawn: {error}")
    return RunFolder(path, runs, setups, published, version, tuple(notes))


def refuse_comparison(path: Path) -> None:
    """A comparison has measures of many runs, and logs only in a folder within it, if asked for.

    Raises:
        ResultsError: the folder is one.
    """
    if not (path / COMPARE_JSON).is_file():
        return
    inside = path / "runs"
    if (inside / RUNS_CSV).is_file():
        raise ResultsError(f"{path}: a comparison over scenes; its logged runs are in {inside}")
    if (path / "occasions.csv").is_file():
        raise ResultsError(f"{path}: a comparison on recorded drives, which has no logs; drive writes them")
    raise ResultsError(f"{path}: a comparison over scenes without logs; make them with compare --logs")


def read_setups(
    path: Path, stored: Stored, runs: pd.DataFrame, allow_plugins: bool = False
) -> tuple[dict[str, RunSetup], list[str]]:
    """Map, route and conditions of runs of a folder, by the names of their logs, from `runs.json`.

    A run whose files are missing or have changed has none, nor has one whose map cannot be read.

    Args:
        path: the folder.
        stored: its configuration.
        runs: rows of its table.
        allow_plugins: whether code of the user's own may make monitored areas again.

    Returns:
        The setups, and why others are missing, one line each.
    """
    named = set(runs["log"].dropna())
    views: dict[object, MapView] = {}
    setups: dict[str, RunSetup] = {}
    missing: Counter[str] = Counter()
    notes: dict[str, None] = {}
    for run in stored.runs:
        if run.spec.log not in named:
            continue
        try:
            setup, note = _setup(run, stored.plugins, views, allow_plugins)
        except (ResultsError, OpenDriveError, ScenarioError, SmartMotError, OSError, RecursionError) as error:
            missing[" ".join(str(error).split())] += 1
            continue
        setups[run.spec.log] = setup
        notes |= {note: None} if note else {}
    unlisted = len(named - {run.spec.log for run in stored.runs})
    if unlisted:
        missing[f"{path / RUNS_JSON} does not have them; run the test again"] = unlisted
    reasons = [
        f"Lanes and monitored areas are not drawn{_share(count, len(named))}: {reason}"
        for reason, count in missing.items()
    ]
    if setups and any(run.files is None for run in stored.runs):
        reasons.append(
            "Made by version 0.1.0, which wrote no hashes: scenario and map may have changed since."
        )
    return setups, [*reasons, *notes]


def _share(count: int, total: int) -> str:
    return "" if count == total else f" for {count} of {total} runs"


def _setup(
    run: StoredRun, plugins: Mapping[str, str], views: dict[object, MapView], allow_plugins: bool
) -> tuple[RunSetup, str]:
    """How a run was set up, and what is to be said of its monitored area."""
    spec = run.spec
    changed = changed_file(run)
    if changed is not None:
        raise ResultsError(changed)
    definition = definition_of(spec)
    added = {file.resolve() for file in files_of(spec, definition)} - set(run.files or ())
    if run.files is not None and added:
        raise ResultsError(f"{min(added)} was not there when the run took place")
    preset = in_light_of_run(run, definition)
    if definition.map_path is None and spec.map_name is None:  # a plane
        return RunSetup(preset=preset, strategy=_mapless_area(spec.strategy, preset), must=spec.must), ""
    # map and route do not depend on what perceives there
    place = (spec.file, spec.parameters, spec.map_name, spec.adversaries)
    view = views.get(place)
    if view is None:
        view = views[place] = _map_view(spec, definition, preset)
    strategy, note = _strategy(spec.strategy, preset, view, plugins, allow_plugins)
    network = view.network
    assert isinstance(network, RoadNetwork)  # as of every simulation
    name = spec.map_name or network.name or str(dict(spec.parameters).get("Map", ""))
    return RunSetup(Path(name).name, network, view.route, preset, strategy, spec.must), note


def _map_view(spec: RunSpec, definition: ScenarioDefinition, preset: Preset) -> MapView:
    """Map and route of a run; nothing of the user's own is made."""
    name = perception_map(definition, spec.map_name)
    network = load_named_map(name) if name else None
    unseen = replace(preset, detector=None, lidar=None)  # code of the user's own is not run for a map
    return Simulation(definition, unseen, None, network=network).map_view()


def _mapless_area(name: str, preset: Preset) -> MonitoredAreaStrategy | None:
    """What made the monitored area of a run without map; None if it is not known by name."""
    if name not in STRATEGIES or name == MapArea.name:
        return None
    plane = MapView(load_roads(None).network, cast(Route, None))  # of which these areas ask nothing
    return make_strategy(name, preset, plane)


def _strategy(
    name: str, preset: Preset, view: MapView, plugins: Mapping[str, str], allow_plugins: bool
) -> tuple[MonitoredAreaStrategy | None, str]:
    """What made the monitored area, and what is to be said of it."""
    if name not in STRATEGIES and not is_plugin(name):
        return None, ""
    note = ""
    if is_plugin(name):
        if not allow_plugins:
            return None, (
                f"The monitored area of {name} is not drawn: it is code of your own, which is run with "
                "--allow-plugins only."
            )
        if name not in plugins:
            note = f"The folder has no hash of {name}: its monitored area may be another than in the run."
        elif source_digest(name) != plugins[name]:
            return None, f"The monitored area of {name} is not drawn: its code has changed since the run."
    try:
        made = make_strategy(name, preset, view)
        shipped = type(made) in (RectangularArea, MapArea, EverythingArea, PathArea, AdaptiveArea)
        return made if shipped else OwnArea(str(getattr(made, "name", name)), name, made), note
    except PluginError as error:
        return None, f"The monitored area of {name} is not drawn: {error}"


__getattr__ = _smartmot.renamed(
    __name__,
    {
        "Setting": "evaluation.runs.folder.RunSetup",
        "read_settings": "evaluation.runs.folder.read_setups",
    },
)
