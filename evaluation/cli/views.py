"""`smartmot-eval plot`, `report` and `replay`: runs that are finished, looked at again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, print_written

PLOT_EXAMPLES = options.examples(
    "`smartmot-eval plot results`",
    "`smartmot-eval plot results --run CPNA_map_dry_none_60kmh_seed0 --format svg`",
)
REPORT_EXAMPLES = options.examples(
    "`smartmot-eval report results`",
    "`smartmot-eval report results --out comparison.html`",
)
REPLAY_EXAMPLES = options.examples(
    "`smartmot-eval replay results/CPNA_map_dry_none_60kmh_seed0 --gif map60.gif`",
    "`smartmot-eval replay results/logs/CPNA_map_dry_none_60kmh_seed0.parquet --mp4 map60.mp4 --speed 0.5`",
    "`smartmot-eval replay results/CPNA_map_dry_none_60kmh_seed0 --mcap map60.mcap`",
)


def plot(
    directory: Annotated[Path, typer.Argument(help="Folder that `cpna` or `run` wrote.", metavar="DIR")],
    run: Annotated[
        str | None,
        typer.Option(help="Log name (column log of runs.csv) for temporal diagram and bird's-eye view."),
    ] = None,
    form: options.PictureFormat = "png",
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Draw the pictures of a folder of results again, for any of its runs."""
    from evaluation.studies.drive.folder import is_drive_folder

    if is_drive_folder(directory):
        from evaluation.studies.drive.views import draw_drive

        written, notes = draw_drive(directory, run, options.parse_format(form))
    else:
        from evaluation.studies.suite import draw_again

        written, notes = draw_again(directory, run, options.parse_format(form), allow_plugins)
    print_written(written, notes, quiet)


def report(
    directory: Annotated[Path, typer.Argument(help="Folder that a run wrote.", metavar="DIR")],
    out: Annotated[
        Path | None,
        typer.Option(help="Page to write; default: report.html in the folder.", metavar="FILE.html"),
    ] = None,
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a folder of results as one HTML page: findings, scores, diagrams, a replay of every run."""
    from evaluation.studies.drive.folder import is_drive_folder
    from evaluation.studies.drive.page import write_drive_page
    from evaluation.views.page.page import write_page

    with counting("reading runs", quiet) as done:
        if is_drive_folder(directory):
            page, notes = write_drive_page(directory, out, done)
        else:
            page, notes = write_page(directory, out, done, allow_plugins)
    print_written([page], notes, quiet)


def replay(
    run: Annotated[Path, typer.Argument(help="DIR/NAME of a run, or the path of its log.", metavar="RUN")],
    gif: Annotated[
        Path | None,
        typer.Option(help="Animated GIF to write; default: NAME.gif in DIR.", metavar="FILE.gif"),
    ] = None,
    mp4: Annotated[
        Path | None,
        typer.Option(help="H.264 film to write; needs ffmpeg.", metavar="FILE.mp4"),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(help="MCAP to write, for Foxglove, Lichtblick and rerun.", metavar="FILE.mcap"),
    ] = None,
    fps: Annotated[float, typer.Option(help="Pictures per second, 1 to 50.")] = 20.0,
    speed: Annotated[float, typer.Option(help="1: real time, 0.5: half as fast.")] = 1.0,
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Film a run from above, with what happens in words, or write it as a file of other tools."""
    from evaluation.runs.recordings import split_run
    from evaluation.studies.drive.folder import is_drive_folder, read_drive_folder
    from evaluation.studies.drive.views import replay_drive
    from evaluation.views.film import replay as film
    from evaluation.views.traces.folders import logged_run
    from evaluation.views.traces.mcap import write_mcap

    directory, name = split_run(run)
    of_drive = is_drive_folder(directory)
    written: list[Path] = []
    notes: tuple[str, ...] = ()
    if mcap is not None:
        if of_drive:
            folder = read_drive_folder(directory)
            shown, notes = folder.logged_run(name), folder.notes
        else:
            shown, notes = logged_run(run, allow_plugins)
        notes += write_mcap(mcap, shown)
        written.append(mcap)
    films = film.asked_files(gif, mp4)
    if films or not written:
        with counting("drawing", quiet) as done:
            if of_drive:
                drawn, film_notes = replay_drive(directory, name, films, fps, speed, done)
            else:
                drawn, film_notes = film.replay(run, gif, mp4, fps, speed, done, allow_plugins)
        written, notes = written + drawn, tuple(dict.fromkeys(notes + film_notes))
    print_written(written, notes, quiet)
