"""`smartmot-eval reference`: the reference results, made again or checked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import Without, refuse_idle
from evaluation.cli.output import SchedulerAddress, parse_workers

EXAMPLES = options.examples(
    "`smartmot-eval reference`",
    "`smartmot-eval reference --only paper,static`",
    "`smartmot-eval reference --check`",
    "`smartmot-eval reference --only drives,towns --outside data_of_others`",
    "`smartmot-eval reference --only gain --tables`",
    "`smartmot-eval reference --tables --pdf`",
    "Started again after it was stopped, it goes on where it was.",
)
EFFECTS = (
    Without(("tables", "pdf", "workers", "scheduler"), "check"),
    Without(("outside", "workers", "scheduler"), "tables"),
)


def command(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="Folder of the reference results.")] = Path("reports"),
    only: Annotated[
        str | None,
        typer.Option(help="Only these parts, comma-separated; default: all.", metavar="NAME,..."),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Make a few runs of each part again; exit status 1 on drift.")
    ] = False,
    outside: Annotated[
        Path | None,
        typer.Option(
            help="Folder of data of others, from which some parts are made: kitti, argoverse2/logs, "
            "opendrive/maps. Without it these are left as they are.",
            metavar="DIR",
        ),
    ] = None,
    tables: Annotated[
        bool,
        typer.Option(
            "--tables", help="Questions over drawn scenes: tables and figures again, from the kept runs."
        ),
    ] = False,
    pdf: Annotated[
        bool,
        typer.Option("--pdf", help="Also print the article, OUT/article.html, as PDF; needs Chromium."),
    ] = False,
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    quiet: options.Quiet = False,
) -> None:
    """Make all reference results: the paper's table and figures, scenes, ablations, growth.

    They lie in the folder reports/ of the project.
    """
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.reference.command import (
        check_reports,
        choose_parts,
        make_reports,
        print_article,
        with_data,
        write_again,
    )

    refuse_idle(context, EFFECTS)
    if outside is not None and not outside.is_dir():
        raise ArgumentError(f"--outside: {outside} is no folder; give the one with kitti and the others")
    names = [name.strip() for name in only.split(",")] if only else []
    if tables:
        with locked(writable_folder(out)):
            write_again(out, names, quiet)
            if pdf:
                print_article(out)
        return
    if not check:
        who = parse_workers(workers, scheduler)
        if scheduler is not None and outside is not None:
            raise ArgumentError("--outside: recordings do not travel; leave --scheduler out for their parts")
        with locked(writable_folder(out)):
            make_reports(out, names, who, quiet, outside)
            if pdf:
                print_article(out)
        return
    _, lacks = with_data(choose_parts(names), outside)
    for name, lack in lacks.items():
        typer.echo(f"{name} is not checked: {lack}")
    lines = check_reports(out, names, outside=outside)
    for line in lines:
        typer.echo(line, err=True)
    raise typer.Exit(1 if lines else 0)
