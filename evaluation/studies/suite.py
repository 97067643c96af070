"""Runs with a progress bar, their files, their table, their pictures: what `cpna`, `run` and `plot` share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rich.console

from evaluation.progress import progress_bar
from evaluation.protocols.paper import PUBLISHED
from evaluation.results.by_speed import Published, comparison_table, impact_table
from evaluation.results.criteria import Judged, criteria_table, write_criteria
from evaluation.results.files import TABLE_MD, ResultsError, log_path, write_bytes
from evaluation.results.logs import read_logs
from evaluation.results.notes import told_notes, told_runs
from evaluation.results.rows import RunRow, read_runs, write_runs
from evaluation.results.tables import Table, markdown_table, rich_table
from evaluation.runs.configuration import configuration_of, read_configuration
from evaluation.runs.conflict import conflicts, scored, told_without_conflict, unbraked
from evaluation.runs.cpna import CpnaSuite, is_published, load_site
from evaluation.runs.logged import logged_runs
from evaluation.runs.specs import lidar_notes, perception_notes
from evaluation.runs.workers import Workers
from scenarios.places import Site
from scenarios.presets import named_preset
from scenarios.settings import preset_with, settings_text
from scenarios.spec import NO_AEB, RunSpec, definition_of, preset_of, simulation_of
from scenarios.strategies import make_strategy
from smartmot.maps.route import RouteError

if TYPE_CHECKING:
    import pandas as pd


def compare_cpna(
    suite: CpnaSuite,
    out: Path,
    pictures: str | None,
    workers: Workers = 1,
    quiet: bool = False,
    console: rich.console.Console | None = None,
) -> Judged:
    """Run a CPNA comparison.

    Args:
        suite: what to run.
        out: folder for everything.
        pictures: their format; None: no pictures.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.
        console: where to print; None: the terminal.

    Returns:
        Every run with the pass criteria of its file.
    """
    site = load_site(suite)
    specs = suite.specs(site)
    console = console or rich.console.Console(quiet=quiet)
    judged = _compare(
        specs,
        suite_configuration(suite, site, out),
        out,
        pictures,
        workers,
        console,
        title=_title(specs),
        published=PUBLISHED if is_published(suite) else None,
    )
    for line in (placement(site), *_sensing(suite)):
        console.print(line, highlight=False)
    return judged


def placement(site: Site) -> str:
    """Where a test stands, as `--at` takes it, and whether there is a sidewalk for its pedestrian."""
    place, has_sidewalk = site.place, site.has_sidewalk
    sidewalk = "a sidewalk begins" if has_sidewalk else "no sidewalk begins"
    at = f"{place.road_id},{place.lane_id},{place.s_m:.1f}"
    return f"placed at --at {at} (x {site.line.x_m:.1f} m, y {site.line.y_m:.1f} m); {sidewalk} at its kerb"


def _sensing(suite: CpnaSuite) -> list[str]:
    """What the reader has to know about the LiDAR of a suite; nothing of the shipped sensor."""
    conditions = suite.conditions
    return lidar_notes(preset_with(named_preset(conditions.preset), conditions.settings))


def suite_configuration(suite: CpnaSuite, site: Site, out: Path) -> dict[str, object]:
    """Everything that determines the results of a suite, as plain values.

    Args:
        suite: what is run.
        site: its place.
        out: folder of the results.
    """
    key = site.network.lanes.key[site.route.lanes[0]]
    lanes = {
        "site": {
            "first_lane": list(key),
            "lanes": [list(site.network.lanes.key[i]) for i in site.route.lanes],
            "line_m": site.line_m,
            "line_xy_m": list(site.route.pose(site.line_m)[:2]),
        }
    }
    specs = suite.specs(site)
    return configuration_of(specs, out, _sensing(suite), is_published(suite), lanes)


def compare_files(
    specs: Sequence[RunSpec],
    out: Path,
    pictures: str | None,
    workers: Workers = 1,
    quiet: bool = False,
    console: rich.console.Console | None = None,
    through: bool = False,
) -> Judged:
    """Run scenario files; see `compare_cpna`, and `evaluation.runs.execution.execute` for `through`."""
    console = console or rich.console.Console(quiet=quiet)
    notes = perception_notes(specs)
    configuration = configuration_of(specs, out, notes)
    judged = _compare(
        specs, configuration, out, pictures, workers, console, title=_title(specs), through=through
    )
    silent = sum(row.avoided and row.flag_time_s is None for row, _ in judged)
    if silent and specs[0].adapts and specs[0].strategy != NO_AEB:
        notes.append(
            f"{silent} of {len(judged)} runs needed no emergency brake: the ACC kept clear, or the way "
            "was free; --hold-speed drives as Euro NCAP does, without ACC"
        )
    for line in notes:
        console.print(line, highlight=False)
    return judged


def _title(specs: Sequence[RunSpec]) -> str:
    """What runs of one preset and one group of settings have in common."""
    names = list(dict.fromkeys(spec.scenario for spec in specs))
    scenario = names[0] if len(names) == 1 else f"{len(names)} scenarios"
    return ", ".join(filter(None, (scenario, f"preset {specs[0].preset}", settings_text(specs[0].settings))))


def _compare(
    specs: Sequence[RunSpec],
    configuration: Mapping[str, object],
    out: Path,
    pictures: str | None,
    workers: Workers,
    console: rich.console.Console,
    title: str,
    published: Mapping[str, Published] | None = None,
    through: bool = False,
) -> Judged:
    """Run, write, show; every run with the pass criteria of its file."""
    if len({spec.log for spec in specs}) < len(specs):
        raise ResultsError("two runs have the same name; give them different values of Scenario_ID")
    with progress_bar(console) as progress:
        task = progress.add_task("running", total=len(specs))
        known = conflicts(specs, workers)
        records = list(logged_runs(specs, out, workers, lambda: progress.advance(task), through=through))
        rows = [scored(record.row, known[unbraked(record.spec)]) for record in records]
        runs, table = _write_tables(out, rows, configuration, published)
    console.print(rich_table(table, title))
    judged = list(zip(rows, [record.criteria for record in records], strict=True))
    criteria = criteria_table(judged)
    if criteria is not None:
        write_criteria(out, judged)
        write_bytes(out / TABLE_MD, f"{markdown_table(table)}\n{markdown_table(criteria)}".encode())
        console.print(rich_table(criteria, "pass criteria of the file"))
    with progress_bar(console) as progress:  # tables do not wait for pictures
        progress.add_task("drawing", total=None)
        drawn = _draw(out, runs, specs, pictures)
    also = ", pictures" if drawn else ""
    console.print(f"{len(rows)} runs in {out}: runs.csv, runs.json, table.md, logs/{also}")
    notes = told_notes([record.notes for record in records])
    for line in (*told_runs(rows), *notes, *told_without_conflict(specs, known)):
        console.print(line, highlight=False)
    return judged


def write_folder(
    out: Path,
    specs: Sequence[RunSpec],
    rows: Sequence[RunRow],
    configuration: Mapping[str, object],
    pictures: str | None,
    published: Mapping[str, Published] | None = None,
) -> tuple[Table, list[Path]]:
    """Write tables and pictures of finished runs whose logs lie in the folder.

    Args:
        out: the folder.
        specs: what was run.
        rows: what it came to, in the same order.
        configuration: everything that determines the runs.
        pictures: their format; None: no pictures.
        published: values to show beside.

    Returns:
        The comparison and the pictures.

    Raises:
        ResultsError: the folder cannot be written.
    """
    runs, table = _write_tables(out, rows, configuration, published)
    return table, _draw(out, runs, specs, pictures)


def _write_tables(
    out: Path,
    rows: Sequence[RunRow],
    configuration: Mapping[str, object],
    published: Mapping[str, Published] | None,
) -> tuple[pd.DataFrame, Table]:
    """Write the tables of finished runs: the runs as they are read again, and the comparison."""
    write_runs(out, rows, configuration)
    runs = read_runs(out)
    scored = bool(runs["score"].notna().any())
    table = comparison_table(runs, published) if scored else impact_table(runs)
    write_bytes(out / TABLE_MD, markdown_table(table).encode())
    return runs, table


def draw_again(
    directory: Path, shown: str | None, form: str, allow_plugins: bool = False
) -> tuple[list[Path], list[str]]:
    """Draw the pictures of a folder of results, with the conditions that it has stored.

    Args:
        directory: the folder.
        shown: log of the run in the temporal diagram and from above; None: see `pictures.run_to_show`.
        form: png, svg or pdf.
        allow_plugins: whether code of the user's own may make the monitored area again.

    Returns:
        Files written, and what the reader has to know about what is missing, one line each.

    Raises:
        ResultsError: the folder cannot be read.
        ArgumentError: it has no such run, or a picture cannot be written.
    """
    from evaluation.runs.folder import UNKNOWN_SETUP, read_setups, read_shown_log, refuse_comparison
    from evaluation.views.pictures import run_to_show, save_pictures

    refuse_comparison(directory)
    runs = read_runs(directory)
    if runs["log"].isna().all():
        raise ResultsError(f"{directory}: without logs nothing can be drawn; run the evaluation again")
    runs = runs[runs["log"].notna()]
    name = shown or run_to_show(runs)
    if name not in set(runs["log"]):
        raise ResultsError(f"--run: no run {name!r}; the folder has: {', '.join(runs['log'])}")
    stored = read_configuration(directory)
    setups, notes = read_setups(directory, stored, runs[runs["log"] == name], allow_plugins)
    setup = setups.get(name, UNKNOWN_SETUP)
    logs = {str(log): read_shown_log(log_path(directory, str(log))) for log in runs["log"]}
    return save_pictures(directory, runs, logs, setup.network, setup.strategy, shown=name, suffix=form), notes


def _draw(directory: Path, runs: pd.DataFrame, specs: Sequence[RunSpec], form: str | None) -> list[Path]:
    """Draw the pictures of finished runs in a format; None: no pictures."""
    if form is None:
        return []
    from evaluation.views.pictures import run_to_show, save_pictures

    name = run_to_show(runs)
    spec = next(spec for spec in specs if spec.log == name)
    simulation = simulation_of(spec)
    strategy = None
    try:
        view = simulation.map_view()
        if spec.strategy != NO_AEB:  # else nobody perceives
            strategy = make_strategy(spec.strategy, preset_of(spec, definition_of(spec)), view)
    except RouteError:  # a car that drives on no lane, as in reverse: no place to draw
        return []
    logs = read_logs(directory, runs)
    return save_pictures(directory, runs, logs, simulation.network, strategy, shown=name, suffix=form)
