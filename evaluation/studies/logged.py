"""Runs of a comparison carried out once more, with their logs: what the points of its page open."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from evaluation.metrics.criticality import criticality, criticality_csv
from evaluation.results.files import log_path, write_bytes
from evaluation.results.logs import read_log
from evaluation.runs.folder_lock import writable_folder
from evaluation.runs.workers import Workers
from evaluation.studies.suite import compare_files
from scenarios.spec import RunSpec, definition_of, preset_of

LOGGED = "runs"
"""Folder of logged runs, and beginning of the names of those of further settings."""
MOST_REPLAYS = 300
"""In a page, which then has about 10 MB, and kept by commands that do not log all runs; `most_telling` says
which."""
GOOD = ("avoided", "no activation", "no request")
"""Outcomes that are as they should be."""
_LONGEST_SLUG = 80

Key = TypeVar("Key")


def folder_name(number: int, text: str) -> str:
    """Name of the folder for logs of one kind: `runs`, or with a number and a text `runs_3_way=path`."""
    slug = re.sub(r"[^\w.=+-]+", "-", text)[:_LONGEST_SLUG]
    return f"{LOGGED}_{number}_{slug}" if text else LOGGED


def most_telling(
    sides: Sequence[Mapping[Key, Sequence[str]]], most: int = MOST_REPLAYS
) -> list[tuple[int, Key]]:
    """Which runs a reader wants to see, where not all can be shown; every side has its share.

    Args:
        sides: how each of them ended in each scene.
        most: how many are chosen.

    Returns:
        Number of the side and scene, in the order of the sides: of each those that ended badly first, then
        those in which the sides differ, then the others.
    """
    endings: dict[Key, set[str]] = {}
    for side in sides:
        for scene, outcomes in side.items():
            endings.setdefault(scene, set()).update(outcomes)
    ranked = [
        sorted(
            side, key=lambda scene: 0 if set(side[scene]) - set(GOOD) else 1 if len(endings[scene]) > 1 else 2
        )
        for side in sides
    ]
    chosen: Counter[int] = Counter()
    for turn in range(max(map(len, ranked), default=0)):
        for number, scenes in enumerate(ranked):
            if turn < len(scenes) and chosen.total() < most:
                chosen[number] += 1
    return [(number, scene) for number, scenes in enumerate(ranked) for scene in scenes[: chosen[number]]]


def log_runs(groups: Mapping[str, Sequence[RunSpec]], out: Path, workers: Workers = 1) -> None:
    """Carry runs out and keep their logs, in folders as `report` and `replay` want them.

    Each has the criticality of its runs over time in `criticality/`.

    Args:
        groups: runs by name of their folder.
        out: folder of these.
        workers: processes, or a scheduler.

    Raises:
        ResultsError: a folder cannot be written.
    """
    for name, specs in groups.items():
        folder = out / name
        compare_files(specs, folder, None, workers, quiet=True, through=True)
        critical = writable_folder(folder / "criticality")
        for spec in specs:
            log = read_log(log_path(folder, spec.log))
            columns = {str(column): log[column].to_numpy() for column in log.columns}
            brakes = preset_of(spec, definition_of(spec)).brakes
            write_bytes(
                critical / f"{spec.log}.csv", criticality_csv(criticality(columns, brakes.max_decel_mps2))
            )
