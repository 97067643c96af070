"""Runs with a progress bar, their files, their table, their pictures: what `cpna`, `run` and `plot` share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rich.console
import rich.progress

from evaluation import results, runner
from evaluation.protocols.paper import PUBLISHED
from evaluation.results import Published, ResultsError, RunRow
from evaluation.runs import NO_AEB, RunSpec, execute_all, scene_of

if TYPE_CHECKING:
    import pandas as pd

PICTURE_COUNT = 3


def compare_cpna(
    suite: runner.CpnaSuite, out: Path, pictures: str | None, workers: int = 1, quiet: bool = False
) -> None:
    """Run a CPNA comparison.

    Args:
        suite: what to run.
        out: folder for everything.
        pictures: their format; None: no pictures.
        workers: processes.
        quiet: print nothing.
    """
    site = runner.load_site(suite)
    specs = suite.specs(site)
    _compare(
        specs,
        runner.suite_configuration(suite, site),
        out,
        pictures,
        workers,
        rich.console.Console(quiet=quiet),
        title=f"{specs[0].scenario}, preset {suite.preset}",
        published=PUBLISHED if runner.is_published(suite) else None,
    )


def compare_files(
    specs: Sequence[RunSpec], out: Path, pictures: str | None, workers: int = 1, quiet: bool = False
) -> None:
    """Run scenario files; see `compare_cpna`."""
    console = rich.console.Console(quiet=quiet)
    configuration = runner.scenario_configuration(specs)
    names = list(dict.fromkeys(spec.scenario for spec in specs))
    title = f"{names[0] if len(names) == 1 else f'{len(names)} scenarios'}, preset {specs[0].preset}"
    _compare(specs, configuration, out, pictures, workers, console, title=title)
    for line in runner.notes(specs):
        console.print(line, highlight=False)


def _compare(
    specs: Sequence[RunSpec],
    configuration: Mapping[str, object],
    out: Path,
    pictures: str | None,
    workers: int,
    console: rich.console.Console,
    title: str,
    published: Mapping[str, Published] | None = None,
) -> None:
    if len({spec.log for spec in specs}) < len(specs):
        raise ResultsError("two runs have the same name; give them different values of Scenario_ID")
    shows = pictures is not None and any(spec.strategy != NO_AEB for spec in specs)
    total = len(specs) + (PICTURE_COUNT if shows else 0)
    with rich.progress.Progress(console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task("running", total=total)
        rows: list[RunRow] = []
        for record in execute_all(specs, workers):
            assert record.log is not None
            results.write_log(results.log_path(out, record.spec.log), record.log)
            rows.append(record.row)
            progress.advance(task)
        results.write_runs(out, rows, configuration)
        runs = results.read_runs(out)
        if shows and pictures is not None:
            progress.update(task, description="drawing")
            _draw(out, runs, specs, None, pictures)
            progress.advance(task, PICTURE_COUNT)
    scored = bool(runs["score"].notna().any())
    table = results.comparison_table(runs, published) if scored else results.impact_table(runs)
    results.write_table(out, table)
    console.print(results.rich_table(table, title))
    drawn = ", pictures" if shows else ""
    console.print(f"{len(rows)} runs in {out}: runs.csv, runs.json, table.md, logs/{drawn}")


def draw_again(directory: Path, shown: str | None, form: str) -> list[Path]:
    """Draw the pictures of a folder of results.

    Args:
        directory: the folder.
        shown: log of the run in the temporal diagram and from above; None: see `run_to_show`.
        form: png, svg or pdf.

    Returns:
        Files written.
    """
    runs = results.read_runs(directory)
    return _draw(directory, runs, runner.read_specs(directory), shown, form)


def _draw(
    directory: Path, runs: pd.DataFrame, specs: Sequence[RunSpec], shown: str | None, form: str
) -> list[Path]:
    from evaluation.pictures import save_pictures

    name = shown or run_to_show(runs)
    scene = next((scene_of(spec) for spec in specs if spec.log == name and spec.strategy != NO_AEB), None)
    if scene is None:
        seen = [str(log) for log in runs.loc[runs["strategy"] != NO_AEB, "log"]]
        raise ResultsError(f"--run: no run {name!r} with perception; the folder has: {', '.join(seen)}")
    logs = results.read_logs(directory, runs)
    return save_pictures(directory, runs, logs, scene, shown=name, suffix=form)  # type: ignore[arg-type]


def run_to_show(runs: pd.DataFrame) -> str:
    """Log of the run that pictures show: of the last strategy the one at 50 km/h, or else the fastest.

    50 km/h is the usual speed in town. A run in which the brake was requested goes before one without.
    """
    last = runs[runs["strategy"] == runs["strategy"].iloc[-1]]
    flagged = last[last["flag_time_s"].notna()]
    town = flagged[flagged["v_test_kmh"] == 50]
    chosen = town if len(town) else flagged if len(flagged) else last
    return str(chosen["log"].iloc[-1])
