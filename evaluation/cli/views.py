"""`smartmot-eval plot`, `report`, `replay`, `diff` and `rows`: runs that are finished, looked at again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import is_typed
from evaluation.cli.output import counting, parse_gate, print_written, results_folder

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
    "`smartmot-eval replay results/CPNA_map_dry_none_60kmh_seed0 --osi map60.osi`",
)
DIFF_EXAMPLES = options.examples(
    "`smartmot-eval diff results/before results/after`",
    "`smartmot-eval diff main/cpna branch/cpna --fail-on 'worse>0,only_first>0' --junit diff.xml`",
    "What is compared, and how runs are matched: docs/gates.md.",
)
ROWS_EXAMPLES = options.examples(
    "`smartmot-eval rows results/compare --parquet rows`",
    "`smartmot-eval rows results/seed_*/ --parquet rows --by strategy,scene`",
    "Queries with DuckDB and pandas: docs/queries.md.",
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
    from evaluation.results.calls import go_on
    from evaluation.studies.drive.folder import is_drive_folder

    go_on(directory)
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
    from evaluation.results.calls import go_on
    from evaluation.studies.comparison_page.page import is_comparison_folder, write_comparison_page
    from evaluation.studies.drive.folder import is_drive_folder
    from evaluation.studies.drive.page import write_drive_page
    from evaluation.views.page.page import write_page

    go_on(directory)
    with counting("reading runs", quiet) as done:
        if is_drive_folder(directory):
            page, notes = write_drive_page(directory, out, done)
        elif is_comparison_folder(directory):
            page, notes = write_comparison_page(directory, out, done, allow_plugins)
        else:
            page, notes = write_page(directory, out, done, allow_plugins)
    print_written([page], notes, quiet)


def replay(
    context: typer.Context,
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
    osi: Annotated[
        Path | None,
        typer.Option(
            help="Trace of ASAM OSI ground truth to write; in a folder it is named by OSI's convention.",
            metavar="FILE.osi|DIR",
        ),
    ] = None,
    fps: Annotated[float, typer.Option(help="Pictures per second, 1 to 50.")] = 20.0,
    speed: Annotated[float, typer.Option(help="1: real time, 0.5: half as fast.")] = 1.0,
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Film a run from above, with what happens in words, or write it as a file of other tools."""
    from evaluation.errors import ArgumentError
    from evaluation.results.calls import go_on
    from evaluation.runs.recordings import split_run
    from evaluation.studies.drive.folder import is_drive_folder, read_drive_folder
    from evaluation.studies.drive.views import replay_drive
    from evaluation.views.film import replay as film
    from evaluation.views.traces.folders import logged_run, truth_of_run
    from evaluation.views.traces.mcap import require_foxglove, write_mcap
    from evaluation.views.traces.osi import require_osi, write_osi

    for name in ("fps", "speed"):
        if is_typed(context, name) and (mcap or osi) and not (gif or mp4):
            raise ArgumentError(f"--{name}: has no effect without a film; add --gif or --mp4")
    directory, name = split_run(run)
    go_on(directory)
    of_drive = is_drive_folder(directory)
    written: list[Path] = []
    notes: tuple[str, ...] = ()
    drives = read_drive_folder(directory) if of_drive and (mcap or osi) else None
    if mcap is not None:
        require_foxglove()
        shown, missing = (
            logged_run(run, allow_plugins) if drives is None else (drives.logged_run(name), drives.notes)
        )
        notes += missing + write_mcap(mcap, shown)
        written.append(mcap)
    if osi is not None:
        require_osi()
        truth, missing = truth_of_run(run) if drives is None else (drives.logged_run(name), drives.notes)
        trace, left_out = write_osi(osi, truth)
        notes += missing + left_out
        written.append(trace)
    films = film.asked_files(gif, mp4)
    if films or not written:
        with counting("drawing", quiet) as done:
            if of_drive:
                drawn, film_notes = replay_drive(directory, name, films, fps, speed, done)
            else:
                drawn, film_notes = film.replay(run, gif, mp4, fps, speed, done, allow_plugins)
        written, notes = written + drawn, notes + tuple(film_notes)
    print_written(written, dict.fromkeys(notes), quiet)


def diff(
    context: typer.Context,
    first: Annotated[
        Path,
        typer.Argument(help="Folder that cpna, run, ncap, compare or drive wrote.", metavar="FIRST"),
    ],
    second: Annotated[Path, typer.Argument(help="Another of the same command.", metavar="SECOND")],
    out: Annotated[Path, typer.Option(help="Folder for page and tables.")] = Path("results/diff"),
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Compare two folders of results: what determined their runs, and which outcomes and numbers differ."""
    import rich.console

    from evaluation.results.tables import rich_table
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.diff.difference import DIFF_MEASURES, difference, sides_of_difference
    from evaluation.studies.diff.report import summary, tables, write_report
    from evaluation.studies.diff.results import read_results

    gate = parse_gate("diff", fail_on, junit, lambda: DIFF_MEASURES)
    folders = difference(read_results(first), read_results(second))
    console = rich.console.Console(quiet=quiet)
    out = results_folder(context, out)
    with locked(writable_folder(out)):
        written = write_report(folders, out)
    for title, table in tables(folders):
        console.print(rich_table(table, title, texts=len(table.header)), "")
    console.print(f"{summary(folders)}.", highlight=False, soft_wrap=True)
    names = ", ".join(path.name for path in written)
    console.print(f"written to {out}: {names}", highlight=False, soft_wrap=True, markup=False)
    gate.close(lambda: sides_of_difference(folders))


def rows(
    directories: Annotated[
        list[Path],
        typer.Argument(
            help="Folders with runs.csv, or with the journal of a comparison that is not finished.",
            metavar="DIR...",
        ),
    ],
    parquet: Annotated[Path, typer.Option(help="Folder for the rows; it must not exist.", metavar="OUT")],
    by: Annotated[
        str | None,
        typer.Option(
            help="Columns whose values part the rows into folders, comma-separated. Default: strategy, where "
            "there is one.",
            metavar="COLUMN,...",
        ),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write the rows of runs as partitioned Parquet, however many there are."""
    from evaluation.studies.rows import write_parquet

    names = None if by is None else [name.strip() for name in by.split(",") if name.strip()]
    count = write_parquet(list(dict.fromkeys(directories)), parquet, names)
    if not quiet:
        typer.echo(f"{count} rows in {parquet}")
