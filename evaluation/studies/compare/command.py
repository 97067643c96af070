"""The command `smartmot-eval compare`: runs with progress and a journal, tables, figures, the answer."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import rich.console

from evaluation.errors import ArgumentError
from evaluation.metrics.criticality import criticality, criticality_csv
from evaluation.progress import progress_bar
from evaluation.results.files import SCHEMA, json_bytes, log_path, write_bytes, write_files
from evaluation.results.logs import read_log
from evaluation.results.tables import Table, markdown_table, rich_table
from evaluation.runs.configuration import digests_of_files, versions
from evaluation.runs.execution import FrameTime
from evaluation.runs.fingerprint import version
from evaluation.runs.folder_lock import writable_folder
from evaluation.runs.journal import Journal
from evaluation.studies.compare import figures
from evaluation.studies.compare.answer import answer, told_intervals
from evaluation.studies.compare.differences import (
    Difference,
    difference_table,
    differences,
    differences_csv,
    pairs_with,
    pairs_with_bases,
    told_differences,
)
from evaluation.studies.compare.grid import (
    FRONTIER,
    Point,
    StudyRun,
    ablation_points,
    points_of,
    study_runs,
)
from evaluation.studies.compare.measures import RunMeasures, measure, told_measures
from evaluation.studies.compare.table import (
    Summary,
    runs_csv,
    scene_table,
    seed_table,
    short_table,
    summaries,
    summary_csv,
    summary_table,
)
from evaluation.studies.compare.valid_scenes import told_invalid_scenes, valid_scenes
from evaluation.studies.suite import compare_files
from scenarios.catalogue.library import scenario_path
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.reader import load
from scenarios.presets import named_preset, named_weather, preset_in_weather
from scenarios.scenes.scenes import SceneRun, choose_scenes, left_out
from scenarios.settings import PARAMETERS, Setting, preset_with, setting_text, settings_text
from scenarios.spec import definition_of, preset_of
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class CompareOptions:
    """What the user asked for; the command's help says what each option means."""

    strategies: tuple[str, ...]
    vary: dict[str, tuple[Setting, ...]]
    preset: str
    weather: tuple[str, ...]
    scenes: tuple[str, ...]
    full: bool
    seeds: int
    workers: int
    out: Path
    ablation: bool
    quiet: bool
    formats: tuple[str, ...] = figures.FORMATS
    logs: bool = False
    maps: Path | None = None


def compare(options: CompareOptions) -> list[Summary]:
    """Carry a comparison out, or go on with it.

    Returns:
        The summaries, in the order of the table.

    Raises:
        ScenarioError: an unknown scene, preset or weather.
        ArgumentError: a setting is out of range.
        ResultsError: the folder cannot be written.
    """
    chosen = choose_scenes(options.scenes, full=options.full, maps=options.maps)
    points = points_for(options)
    scenes, reasons = valid_scenes(chosen, options.workers)
    invalid = told_invalid_scenes(reasons, sum(scene.must == "brake" for scene in chosen))
    if not scenes:
        raise ArgumentError(f"no valid scene is left: {' '.join(invalid)}; choose other --scenes")
    runs = study_runs(points, scenes, options.preset, options.weather, options.seeds)
    console = rich.console.Console(quiet=options.quiet)
    measures, spent, before = carry_out(runs, options.out, options.workers, console)
    rows = summaries(measures)
    found = compared(options, points, measures)
    written = write(options, scenes, points, measures, rows, found, spent)
    console.print(rich_table(short_table(rows), _title(options, scenes)))
    for line in [*told(options, points, rows, found), *told_measures(measures)]:
        console.print(line, highlight=False)
    done = f"{len(runs)} runs" + (f", {before} of them from before" if before else "")
    console.print(f"{done}; in {options.out}: {', '.join(path.name for path in written)}", highlight=False)
    if options.logs:
        folder = log_runs(options, scenes)
        console.print(f"logs: {folder}; smartmot-eval report {folder} makes a page of them", highlight=False)
    for line in [*invalid, *left_out(options.scenes, full=options.full, maps=options.maps)]:
        console.print(line, highlight=False, soft_wrap=True)
    return rows


def log_runs(options: CompareOptions, scenes: Sequence[SceneRun]) -> Path:
    """Carry the scenes out once more with each strategy as the preset has it, and keep the logs.

    They lie in a folder of runs of its own, as `report` and `replay` want it, with the criticality of each
    run over time in `criticality/`.

    Raises:
        ResultsError: the folder cannot be written.
    """
    points = [Point(strategy) for strategy in options.strategies]
    runs = study_runs(points, scenes, options.preset, options.weather, seeds=1)
    folder = options.out / "runs"
    specs = [run.spec for run in runs]
    compare_files(specs, folder, None, options.workers, quiet=True)
    critical = writable_folder(folder / "criticality")
    for spec in specs:
        log = read_log(log_path(folder, spec.log))
        columns = {str(name): log[name].to_numpy() for name in log.columns}
        brakes = preset_of(spec, definition_of(spec)).brakes
        content = criticality_csv(criticality(columns, brakes.max_decel_mps2))
        write_bytes(critical / f"{spec.log}.csv", content)
    return folder


def points_for(options: CompareOptions) -> tuple[Point, ...]:
    """Strategies and settings of a comparison.

    Raises:
        ScenarioError: an unknown preset.
        ArgumentError: a value is out of range.
    """
    if options.ablation:
        return ablation_points(options.strategies, options.preset)
    preset = named_preset(options.preset)
    for name, values in options.vary.items():
        for value in values:
            try:
                preset_with(preset, ((name, value),))
            except (ConfigError, ScenarioError) as error:
                raise ArgumentError(f"--vary {setting_text(name, value)}: {error}") from None
    return points_of(options.strategies, options.vary or FRONTIER)


def carry_out(
    runs: Sequence[StudyRun], out: Path, workers: int, console: rich.console.Console
) -> tuple[list[RunMeasures], list[FrameTime], int]:
    """Carry out the runs that the folder's journal does not have.

    Returns:
        Measures and processor times in the order of the runs, and how many were there before.
    """
    items = {run.key: run for run in runs}
    with Journal(out, RunMeasures) as journal, progress_bar(console) as progress:
        task = progress.add_task("comparing", total=len(items))
        found, before = journal.carry_out(
            measure, items, workers, lambda count: progress.advance(task, count)
        )
    measures, spent = kept_measures(runs, found)
    return measures, spent, before


def kept_measures(
    runs: Sequence[StudyRun], found: Mapping[str, tuple[RunMeasures, FrameTime]]
) -> tuple[list[RunMeasures], list[FrameTime]]:
    """Measures and processor times in the order of the runs.

    A run is kept once, whether the preset's own values were asked for by name or not; here it is called as
    it was asked for.
    """
    measures = [
        dataclasses.replace(found[run.key][0], settings=settings_text(run.spec.settings)) for run in runs
    ]
    return measures, [found[run.key][1] for run in runs]


def compared(
    options: CompareOptions, points: Sequence[Point], measures: Sequence[RunMeasures]
) -> list[Difference]:
    """Differences between the points: of an ablation against the preset, else against the usual points."""
    if options.ablation:
        return differences(measures, pairs_with_bases(points))
    return differences(measures, pairs_with(points, usual_points(points, options.preset)))


def told(
    options: CompareOptions,
    points: Sequence[Point],
    rows: Sequence[Summary],
    found: Sequence[Difference],
) -> list[str]:
    """The answer in sentences: widths, what the intervals mean, which differences are clear."""
    lines = [] if options.ablation else answer(rows, points)
    shown = between_usual(options, points, found)
    return [*lines, told_intervals(rows), *([told_differences(shown)] if shown else [])]


def between_usual(
    options: CompareOptions, points: Sequence[Point], found: Sequence[Difference]
) -> list[Difference]:
    """Differences that are shown as text: of an ablation all, else those between usual points."""
    usual = points if options.ablation else usual_points(points, options.preset)
    return [one for one in found if one.point in usual]


def write(
    options: CompareOptions,
    scenes: Sequence[SceneRun],
    points: Sequence[Point],
    measures: Sequence[RunMeasures],
    rows: Sequence[Summary],
    found: Sequence[Difference],
    spent: Sequence[FrameTime],
) -> list[Path]:
    """Write tables and figures; all but `times.md` are the same bytes for the same comparison."""
    out = options.out
    title = _title(options, scenes)
    usual = usual_points(points, options.preset)
    lines = [
        markdown_table(summary_table(rows)),
        *(f"{line}\n" for line in [*told(options, points, rows, found), *told_measures(measures)]),
    ]
    if options.seeds > 1:
        lines += ["## Over the seeds\n", markdown_table(seed_table(rows))]
    different = difference_table(between_usual(options, points, found))
    if different.rows:
        lines += ["## Differences\n", markdown_table(different)]
    lines += ["## By scene\n", markdown_table(scene_table(measures, usual))]
    files = {
        "runs.csv": runs_csv(measures),
        "table.csv": summary_csv(rows),
        "differences.csv": differences_csv(found),
        "table.md": "\n".join(lines).encode(),
        "compare.json": _configuration(options, scenes, points),
        "times.md": markdown_table(time_table(measures, spent)).encode(),
    }
    written = write_files(out, files)
    for weather in options.weather if options.formats else ():
        of_weather = [row for row in rows if row.weather == weather]
        several = f"_{weather}" if len(options.weather) > 1 else ""
        if options.ablation:
            figure = figures.ablation(of_weather, f"One choice changed: {title}, {weather}")
            written += figures.save(figure, out / f"ablation{several}", options.formats)
        elif any(row.avoided.count for row in of_weather) and any(
            row.false_activations.count for row in of_weather
        ):
            figure = figures.frontier(of_weather, points, f"{title}, {weather}")
            written += figures.save(figure, out / f"frontier{several}", options.formats)
    return written


def usual_points(points: Sequence[Point], preset: str) -> list[Point]:
    """Points whose numbers are as the preset has them, names apart; of a strategy without one its first."""
    usual = [
        point
        for point in points
        if all(
            PARAMETERS[k].choices or PARAMETERS[k].of(named_preset(preset)) == v for k, v in point.settings
        )
    ]
    has = {point.strategy for point in usual}
    first = {point.strategy: point for point in reversed(points) if point.strategy not in has}
    return [point for point in points if point in usual or first.get(point.strategy) == point]


def _title(options: CompareOptions, scenes: Sequence[SceneRun]) -> str:
    seeds = f"{options.seeds} seed{'s' if options.seeds > 1 else ''}"
    return f"{len(scenes)} scene variants, {seeds}, preset {options.preset}"


def time_table(measures: Sequence[RunMeasures], spent: Sequence[FrameTime]) -> Table:
    """Processor time per frame of each strategy and settings: medians over its runs."""
    import numpy as np

    groups: dict[tuple[str, str], list[FrameTime]] = {}
    for run, time in zip(measures, spent, strict=True):
        if time.frames:
            groups.setdefault((run.strategy, run.settings), []).append(time)
    lines = []
    for (strategy, settings), mine in groups.items():
        median, high = (
            float(np.median([getattr(t, name) for t in mine])) for name in ("median_ms", "p95_ms")
        )
        name = settings or "as the preset has it"
        lines.append((strategy, name, str(len(mine)), f"{median:.2f}", f"{high:.2f}"))
    header = ("strategy", "settings", "runs", "median per frame (ms)", "95th percentile (ms)")
    return Table(
        header, tuple(lines), (), "Processor time of perception and decision; medians over the runs."
    )


def _configuration(options: CompareOptions, scenes: Sequence[SceneRun], points: Sequence[Point]) -> bytes:
    """Everything that determines the results, as JSON."""
    presets = {
        name: preset_in_weather(named_preset(options.preset), named_weather(name)) for name in options.weather
    }
    folder = options.out.resolve()
    digests = {
        run: digests_of_files(load(scenario_path(run.file), dict(run.parameters)).files, folder)
        for run in scenes
    }
    values = {
        "schema": SCHEMA,
        "version": version(),
        "versions": versions(),
        "preset": options.preset,
        "seeds": options.seeds,
        "points": [{"strategy": point.strategy, "settings": dict(point.settings)} for point in points],
        "scenes": [
            {"scene": run.scene, "variant": run.variant, "must": run.must, "file": Path(run.file).name}
            | {"parameters": {k: v for k, v in run.parameters if k != "Map"}}
            | {"files": sorted(digests[run])}
            for run in scenes
        ],
        "presets": {
            f"{point.strategy} {point.text} {name}": dataclasses.asdict(preset_with(preset, point.settings))
            for name, preset in presets.items()
            for point in points
        },
        "files": {name: digest for found in digests.values() for name, digest in found.items()},
    }
    return json_bytes(values, indent=1)
