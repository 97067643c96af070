"""The truth of a logged run as a recording: where the ego and all others were."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evaluation.results.files import LOGS_FOLDER, RUNS_CSV, RUNS_JSON, ResultsError, log_path
from evaluation.results.logs import LOG_COLUMNS
from evaluation.runs.configuration import StoredRun, changed_file, read_configuration
from evaluation.runs.folder import read_shown_log
from scenarios.openscenario.model import EntityDefinition, ScenarioDefinition
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.poses import rigid, turned_about
from scenarios.recorded.tables.parquet import SUFFIX, column_names
from scenarios.simulation.motion_actions import ego_of
from scenarios.spec import definition_of
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, eq=False)
class RunRecording:
    """A run as it was.

    Args:
        sequence: the frames of its log, with the others as labels and poses of the middle of the ego's box.
        ego_size_m: length and width of the ego.
        target: identity of the target in the labels; None: there is none.
        map_path: the scenario's road network; None: it has none, or is not known.
        ego_speed_mps: (F,) speeds of the ego, negative in reverse.
        others: the scenario's entities but the ego, by identity; empty where they are not known.
        notes: what is not known, one line each.
        setup: the run and its scenario; None: they are not known.
    """

    sequence: Sequence
    ego_size_m: tuple[float, float]
    target: int | None
    ego_speed_mps: FloatArray
    map_path: Path | None = None
    others: tuple[EntityDefinition, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    setup: tuple[StoredRun, ScenarioDefinition] | None = None


def is_run(path: Path) -> bool:
    """Whether a path names a run of a folder of results, `DIR/NAME`, or a log."""
    if path.is_file():
        return path.suffix == SUFFIX and set(LOG_COLUMNS) <= set(column_names(path))
    return log_path(*split_run(path)).is_file()


def is_log_alone(run: Path) -> bool:
    """Whether a path is a log without a folder of runs, as a recorded drive's."""
    return run.suffix == SUFFIX and run.is_file() and not (split_run(run)[0] / RUNS_CSV).exists()


def split_run(run: Path) -> tuple[Path, str]:
    """Folder of results and name of the log, from `DIR/NAME` or `DIR/logs/NAME.parquet`."""
    name = run.name.removesuffix(SUFFIX)
    folder = run.parent
    return (folder.parent if folder.name == LOGS_FOLDER else folder), name


def recording_of_run(run: Path) -> RunRecording:
    """The run of a log, with its scenario's map and names where its folder still has them.

    Args:
        run: `DIR/NAME` with a name from column `log` of `runs.csv`, or the path of a log.

    Raises:
        ResultsError: the log cannot be read.
    """
    folder, name = split_run(run)
    return _recording(run, folder, name, _StoredRuns(folder))


def recordings_of_runs(folder: Path, names: Iterable[str]) -> Iterator[RunRecording]:
    """Runs of a folder of results by the names of their logs; see `recording_of_run`."""
    stored = _StoredRuns(folder)
    for name in names:
        yield _recording(folder / name, folder, name, stored)


class _StoredRuns:
    """What a folder says of its runs, read once for all of them.

    Args:
        folder: of results.
    """

    def __init__(self, folder: Path) -> None:
        self._path, self.note, self._runs = folder / RUNS_JSON, "", {}
        if not self._path.is_file():
            self.note = "Only the log is known: neither the scenario's map nor its names are."
            return
        try:
            self._runs = {each.spec.log: each for each in read_configuration(folder).runs}
        except (ValueError, OSError) as error:  # all errors of files are ValueErrors
            self.note = f"Map and names are not known: {error}"

    def __getitem__(self, name: str) -> StoredRun:
        """The run of a log.

        Raises:
            ResultsError: the folder does not have it.
        """
        if name not in self._runs:
            raise ResultsError(f"{self._path} does not have the run {name}")
        return self._runs[name]


def _recording(run: Path, folder: Path, name: str, stored_runs: _StoredRuns) -> RunRecording:
    """See `recording_of_run`."""
    log = read_shown_log(run if run.is_file() else log_path(folder, name))
    if stored_runs.note:
        return recording_of_log(log, name, notes=(stored_runs.note,))
    try:
        stored = stored_runs[name]
        if (changed := changed_file(stored)) is not None:
            raise ResultsError(changed)
        definition = definition_of(stored.spec)
    except (ValueError, OSError) as error:  # all errors of files and scenarios are ValueErrors
        return recording_of_log(log, name, notes=(f"Map and names are not known: {error}",))
    ego = ego_of(definition)
    others = tuple(entity for entity in definition.entities if entity.name != ego.name)
    return replace(recording_of_log(log, name, definition.map_path, others), setup=(stored, definition))


def recording_of_log(
    log: pd.DataFrame,
    name: str,
    map_path: Path | None = None,
    others: tuple[EntityDefinition, ...] = (),
    notes: tuple[str, ...] = (),
) -> RunRecording:
    """The rows of ego and actors in a log, as a recording; see `RunRecording`."""
    ego = log[log["kind"] == "ego"].sort_values("time_s").drop_duplicates("time_s", keep="last")
    stamp_s = ego["time_s"].to_numpy(np.float64)
    actors = log[log["kind"] == "actor"].drop_duplicates(["time_s", "id"], keep="last")
    actors = actors[actors["time_s"].isin(stamp_s)]
    identity = actors["id"].to_numpy(np.int64)
    strangers = identity[(identity < 0) | (identity >= len(others))] if others else identity[:0]
    if len(strangers):
        raise ResultsError(f"log {name}: actor {strangers[0]} is none of the scenario's {len(others)} others")
    yaw, speed = (actors[name].to_numpy(np.float64) for name in ("yaw_rad", "speed_mps"))
    columns = {"height_m": np.array([others[i].height_m for i in identity.tolist()])} if others else {}
    labels = Objects.of(
        np.searchsorted(stamp_s, actors["time_s"].to_numpy(np.float64)),
        actors[["x_m", "y_m"]].to_numpy(np.float64),
        object_id=identity,
        category=actors["category"].to_numpy(np.str_),
        size_m=actors[["length_m", "width_m"]].to_numpy(np.float64),
        yaw_rad=yaw,
        velocity_mps=speed[:, None] * np.column_stack((np.cos(yaw), np.sin(yaw))),
        **columns,
    )
    place = np.column_stack((ego[["x_m", "y_m"]].to_numpy(np.float64), np.zeros(len(ego))))
    targets = actors.loc[actors["label"] == "target", "id"]
    return RunRecording(
        Sequence(
            name=name,
            stamp_s=stamp_s,
            frame_name=tuple(f"{t:.3f} s" for t in stamp_s.tolist()),
            detections=Objects.empty(),
            labels=labels,
            world_SE3_ego=rigid(turned_about(2, ego["yaw_rad"].to_numpy(np.float64)), place),
        ),
        (float(ego["length_m"].iloc[0]), float(ego["width_m"].iloc[0])),
        None if targets.empty else int(targets.iloc[0]),
        ego["speed_mps"].to_numpy(np.float64),
        map_path,
        others,
        notes,
    )
