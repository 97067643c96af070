"""The command `smartmot-eval compare`: runs with progress and a journal, tables, figures, the answer."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import rich.console

from evaluation.errors import ArgumentError
from evaluation.metrics.criticality import criticality, criticality_csv
from evaluation.results.files import log_path, write_bytes
from evaluation.results.logs import read_log
from evaluation.results.tables import rich_table
from evaluation.runs.folder_lock import writable_folder
from evaluation.runs.workers import Workers
from evaluation.studies.compare.grid import Point, shown_settings, study_runs
from evaluation.studies.compare.study import SceneStudy, compared
from evaluation.studies.compare.table import Summary, short_table
from evaluation.studies.compare.valid_scenes import told_invalid_scenes, valid_scenes
from evaluation.studies.study import done_line
from evaluation.studies.suite import compare_files
from scenarios.scenes.scenes import SceneRun, left_out
from scenarios.spec import definition_of, preset_of

LOGGED = "runs"
"""Folder of logged runs, and beginning of the names of those of further settings."""
_LONGEST_SLUG = 80


def compare(
    study: SceneStudy,
    out: Path,
    workers: Workers = 1,
    quiet: bool = False,
    logs: bool = False,
    console: rich.console.Console | None = None,
) -> list[Summary]:
    """Carry a comparison out, or go on with it.

    Args:
        study: what is compared.
        out: folder for everything.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.
        logs: whether to log a run per scene and strategy as well.
        console: where to print; None: the terminal.

    Returns:
        The summaries, in the order of the table.

    Raises:
        ScenarioError: an unknown scene, preset or weather.
        ArgumentError: a setting is out of range.
        ResultsError: the folder cannot be written.
    """
    chosen = study.chosen_scenes()
    study.points  # noqa: B018 - a value out of range is told before the first run
    scenes, reasons = valid_scenes(chosen, workers)
    invalid = told_invalid_scenes(reasons, sum(scene.must == "brake" for scene in chosen))
    if not scenes:
        raise ArgumentError(f"no valid scene is left: {' '.join(invalid)}; choose other --scenes")
    items = study.items_of(scenes)
    console = console or rich.console.Console(quiet=quiet)
    finished, before = study.carry_out_behind_bar(items, out, "", workers, console, "comparing")
    result = compared(study, items, finished)
    written = result.write(out)
    console.print(rich_table(short_table(result.rows), result.title))
    for line in result.told():
        console.print(line, highlight=False)
    console.print(done_line(len(items), before, out, [path.name for path in written]), highlight=False)
    if logs:
        folder = log_runs(study, scenes, out, workers)
        console.print(
            f"logs: {folder}*; smartmot-eval report {out} makes a page with replays", highlight=False
        )
    for line in [*invalid, *left_out(study.scenes, full=study.full, maps=study.maps)]:
        console.print(line, highlight=False, soft_wrap=True)
    return result.rows


def log_runs(study: SceneStudy, scenes: Sequence[SceneRun], out: Path, workers: Workers = 1) -> Path:
    """Carry the scenes out once more, with the first seed, and keep the logs.

    Each strategy as the preset has it is in `runs`; other settings are in folders of their own beside it.
    They are folders of runs, as `report` and `replay` want them, with the criticality of each run over time
    in `criticality/`.

    Returns:
        The first of them.

    Raises:
        ResultsError: a folder cannot be written.
    """
    by_settings: dict[str, list[Point]] = {"": [Point(strategy) for strategy in study.strategies]}
    for point in study.points:
        if point.settings:
            by_settings.setdefault(point.text, []).append(point)
    for k, (text, points) in enumerate(by_settings.items()):
        items = study_runs(points, scenes, study.preset, study.weather, 1, study.common)
        slug = re.sub(r"[^\w.=+-]+", "-", shown_settings(text))[:_LONGEST_SLUG]
        folder = out / (f"{LOGGED}_{k}_{slug}" if text else LOGGED)
        specs = [item.spec for item in items]
        compare_files(specs, folder, None, workers, quiet=True)
        critical = writable_folder(folder / "criticality")
        for spec in specs:
            log = read_log(log_path(folder, spec.log))
            columns = {str(name): log[name].to_numpy() for name in log.columns}
            brakes = preset_of(spec, definition_of(spec)).brakes
            content = criticality_csv(criticality(columns, brakes.max_decel_mps2))
            write_bytes(critical / f"{spec.log}.csv", content)
    return out / LOGGED
