"""The command `smartmot-eval compare`: runs with progress and a journal, tables, figures, the answer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rich.console

from evaluation.errors import ArgumentError
from evaluation.results.tables import rich_table
from evaluation.runs.workers import Workers
from evaluation.studies.compare.grid import Point, shown_settings, study_runs
from evaluation.studies.compare.study import SceneStudy, compared
from evaluation.studies.compare.table import Summary, short_table
from evaluation.studies.compare.valid_scenes import told_invalid_scenes, valid_scenes
from evaluation.studies.logged import LOGGED, folder_name, log_runs
from evaluation.studies.study import done_line
from scenarios.scenes.scenes import SceneRun, left_out
from scenarios.spec import RunSpec


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
        log_runs(logged_groups(study, scenes), out, workers)
        console.print(
            f"logs: {out / LOGGED}*; smartmot-eval report {out} makes a page with replays", highlight=False
        )
    for line in [*invalid, *left_out(study.scenes, full=study.full, maps=study.maps)]:
        console.print(line, highlight=False, soft_wrap=True)
    return result.rows


def logged_groups(study: SceneStudy, scenes: Sequence[SceneRun]) -> dict[str, list[RunSpec]]:
    """The runs of the first seed by folder: strategies as the preset has them in `runs`, others beside it."""
    by_settings: dict[str, list[Point]] = {"": [Point(strategy) for strategy in study.strategies]}
    for point in study.points:
        if point.settings:
            by_settings.setdefault(point.text, []).append(point)
    return {
        folder_name(k, shown_settings(text)): [
            item.spec for item in study_runs(points, scenes, study.preset, study.weather, 1, study.common)
        ]
        for k, (text, points) in enumerate(by_settings.items())
    }
