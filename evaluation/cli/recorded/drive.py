"""`smartmot-eval drive`: recorded drives, seen and judged as simulated runs are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, parse_gate, print_written, results_folder
from evaluation.cli.recorded import options as recorded

if TYPE_CHECKING:
    from collections.abc import Iterable

    import rich.console

    from evaluation.studies.drive.study import DriveResult

MOST_ON_PAGE = 40
"""Drives of which a page is written without being asked: each frame adds about 1 kB to it."""
FILM_FPS = 10.0
"""Of films: the rate of most recordings."""

EXAMPLES = options.examples(
    "`smartmot-eval drive kitti/training --out results/drive`",
    "`smartmot-eval drive kitti/training --sequence 0011 --strategy rectangular,path --rule paper,cascade`",
    "`smartmot-eval drive my_csv_folder --map town.xodr --strategy map --detections labels`",
    "`smartmot-eval drive argoverse_logs --strategy map,path --vary margin_m=0,1.8`",
    "`smartmot-eval drive kitti/training --vary ego_forecast=ctrv --vary way=area --vary standing=area`",
    "`smartmot-eval drive kitti/training --strategy path --fail-on 'false_activations>0'`",
    "`smartmot-eval drive my_csv_folder --ego 12.0,2.55,3.1 --gif drive.gif`",
    "Formats: docs/formats.md. Verdicts, exposure and the files written: docs/drives.md.",
)


def command(
    context: typer.Context,
    path: Annotated[
        Path,
        typer.Argument(
            help="Recorded drives with ego poses: a data set or a folder of them.", metavar="PATH"
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option("--format", help="Format of the data; default: what the files look like."),
    ] = None,
    columns: options.ColumnPairs = None,
    frame_rate: options.FrameRate = None,
    topic: options.BagTopic = None,
    odometry: options.BagOdometry = None,
    velocity_frame: options.VelocityFrame = None,
    strategy: Annotated[
        str | None,
        typer.Option(
            help="Monitored areas, comma-separated: rectangular, map, all, path, adaptive, or your own, "
            "package.module:name. Default: all that the data allow."
        ),
    ] = None,
    rule: Annotated[
        str | None,
        typer.Option(
            help="Brake rules, comma-separated: paper, cascade, cascade_gentle, required_deceleration, "
            "last_point_to_brake, rss, autoware, autoware_readme, r157, or your own, package.module:name. "
            "Default: paper."
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Values of a parameter; may be repeated. Unless varied, all strategies have "
            "ego_forecast=path, way=path and standing=path.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(help="paper, physical or real: brakes, areas and tracker; with labels also the sensor."),
    ] = "real",
    map_file: recorded.DriveMap = None,
    sees: recorded.Sees = None,
    sequence: recorded.SequenceNames = None,
    ego: recorded.EgoOutline = None,
    seed: options.Seed = 0,
    gif: Annotated[
        Path | None,
        typer.Option(help="Film of the first sequence, strategy and rule, as GIF.", metavar="FILE.gif"),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(help="The same as MP4; needs ffmpeg.", metavar="FILE.mp4"),
    ] = None,
    page: Annotated[
        bool, typer.Option(help=f"Write report.html, unless there are over {MOST_ON_PAGE} drives.")
    ] = True,
    out: Annotated[Path, typer.Option(help="Folder for tables and logs.")] = Path("results/drive"),
    mcap: options.Mcap = False,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """See and judge recorded drives: emergency requests, false activations among them, and exposure."""
    import rich.console

    from evaluation.progress import study_progress
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.drive.study import Options, drive_all, prepare
    from evaluation.studies.drive.tables import DRIVE_MEASURES, sides_of_drives, totals_of
    from evaluation.views.traces.mcap import require_foxglove

    gate = parse_gate("drive", fail_on, junit, lambda: DRIVE_MEASURES)
    varied = options.parse_vary(vary or [])
    reading = options.source_reading(columns, frame_rate, topic, odometry, velocity_frame)
    asked = Options(
        recorded.drive_source(path, sequence, sees, map_file, ego, reading, form),
        strategies=() if strategy is None else options.parse_strategies(strategy),
        rules=recorded.parse_rules(rule, varied),
        preset=options.parse_preset(preset),
        seed=seed,
        vary=varied,
    )
    if mcap:
        require_foxglove()
    out = writable_folder(results_folder(context, out))
    console = rich.console.Console(quiet=quiet)
    with locked(out):
        study = prepare(asked)
        _print_notes(study.notes, console)
        with study_progress(console) as progress:
            result = drive_all(study, out, progress)
        _print_result(result, study.recorded_s, out, console)
        films = [(file, option) for file, option in ((gif, "--gif"), (film, "--film")) if file is not None]
        _draw(films, str(result.rows[0].log), out, console)
        if mcap:
            _write_mcaps(out, quiet)
        if page:
            _write_page(out, len(result.drives), console)
    gate.close(lambda: sides_of_drives(totals_of(result.rows)))


def _print_notes(notes: Iterable[str], console: rich.console.Console) -> None:
    for note in notes:
        console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)


def _print_result(result: DriveResult, recorded_s: float, out: Path, console: rich.console.Console) -> None:
    """Print the table of a study, its speed and its files."""
    from evaluation.results.tables import rich_table

    _print_notes(result.notes, console)
    console.print(rich_table(result.table, texts=2))
    faster = recorded_s / max(result.spent_s, 1e-9)
    console.print(f"{faster:.0f} times faster than real time, without reading and writing", highlight=False)
    files = ", ".join(path.name for path in result.written if path.parent == out)
    console.print(f"written to {out}: {files}, logs/", highlight=False, soft_wrap=True)


def _draw(films: list[tuple[Path, str]], log: str, out: Path, console: rich.console.Console) -> None:
    """Draw films of a run."""
    from evaluation.studies.drive.views import replay_drive

    if not films:
        return
    with counting("drawing", console.quiet) as drawn:
        replay_drive(out, log, films, fps=FILM_FPS, progress=drawn)
    for file, _ in films:
        console.print(f"film: {file}", highlight=False, soft_wrap=True)


def _write_mcaps(out: Path, quiet: bool) -> None:
    from evaluation.studies.drive.views import write_drive_mcaps
    from evaluation.views.traces.folders import MCAP_FOLDER

    with counting("writing MCAP", quiet) as done:
        notes = write_drive_mcaps(out, done)
    print_written([out / MCAP_FOLDER], notes, quiet)


def _write_page(out: Path, drive_count: int, console: rich.console.Console) -> None:
    """Write the page, unless it would be too long."""
    from evaluation.studies.drive.page import write_drive_page
    from evaluation.views.page.page import PAGE_NAME

    if drive_count > MOST_ON_PAGE:
        console.print(f"no page of {drive_count} drives; smartmot-eval report {out} writes it")
        return
    with counting("writing the page", console.quiet) as read:
        write_drive_page(out, progress=read)
    console.print(f"page: {out / PAGE_NAME}", highlight=False, soft_wrap=True)
