"""`smartmot-eval drive`: recorded drives, seen and judged as simulated runs are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, print_written
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from scenarios.recorded.vehicles import Vehicle
    from scenarios.settings import Setting

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
    "`smartmot-eval drive my_csv_folder --ego 12.0,2.55,3.1 --gif drive.gif`",
    "Formats: docs/mot.md. Verdicts, exposure and the files written: docs/drives.md.",
)


def command(
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
            help="Monitored areas, comma-separated: rectangular, map, all, path, or your own, "
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
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="OpenDRIVE file, Argoverse 2 map or log, in the frame of the ego poses. "
            "Default: the log's own.",
            metavar="FILE",
        ),
    ] = None,
    sees: Annotated[
        str | None,
        typer.Option(
            "--detections",
            help="detections: what was recorded; labels: they stand in, with the sensor's errors. Default: "
            "detections where there are any.",
            metavar="labels|detections",
        ),
    ] = None,
    sequence: Annotated[str | None, typer.Option(help="Only these sequences, comma-separated.")] = None,
    ego: Annotated[
        str | None,
        typer.Option(
            help="Recording vehicle: length, width, and how far its middle is ahead of the recorded point "
            "(m). Default: that of the data set, else a car of 4.4 m x 1.8 m.",
            metavar="L,W[,AHEAD]",
        ),
    ] = None,
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
    quiet: options.Quiet = False,
) -> None:
    """See and judge recorded drives: emergency requests, false activations among them, and exposure."""
    import rich.console

    from evaluation.progress import study_progress
    from evaluation.results.tables import rich_table
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.drive.drive import SEES
    from evaluation.studies.drive.page import write_drive_page
    from evaluation.studies.drive.recordings import Source
    from evaluation.studies.drive.study import Options, drive_all, prepare
    from evaluation.studies.drive.views import replay_drive, write_drive_mcaps
    from evaluation.views.page.page import PAGE_NAME
    from evaluation.views.traces.folders import MCAP_FOLDER
    from evaluation.views.traces.mcap import require_foxglove
    from scenarios.recorded.formats import FORMATS

    varied = options.parse_vary(vary or [])
    source = Source(
        folder=path,
        form=options.parse_name(form, FORMATS, "--format") if form else None,
        sequences=sequence,
        sees=options.parse_name(sees, SEES, "--detections") if sees else None,
        map_file=map_file,
        vehicle=None if ego is None else parse_vehicle(ego),
        columns=options.source_reading(columns, frame_rate, topic, odometry, velocity_frame),
    )
    asked = Options(
        source,
        strategies=() if strategy is None else options.parse_strategies(strategy),
        rules=parse_rules(rule, varied),
        preset=options.parse_preset(preset),
        seed=seed,
        vary=varied,
    )
    if mcap:
        require_foxglove()
    out = writable_folder(out)
    console = rich.console.Console(quiet=quiet)
    with locked(out):
        study = prepare(asked)
        for note in study.notes:
            console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)
        with study_progress(console) as progress:
            result = drive_all(study, out, progress)
        for note in result.notes:
            console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)
        console.print(rich_table(result.table, texts=2))
        faster = study.recorded_s / max(result.spent_s, 1e-9)
        console.print(
            f"{faster:.0f} times faster than real time, without reading and writing", highlight=False
        )
        console.print(
            f"written to {out}: {', '.join(p.name for p in result.written if p.parent == out)}, logs/",
            highlight=False,
            soft_wrap=True,
        )
        files = [(file, option) for file, option in ((gif, "--gif"), (film, "--film")) if file is not None]
        if files:
            with counting("drawing", quiet) as drawn:
                replay_drive(out, str(result.rows[0].log), files, fps=FILM_FPS, progress=drawn)
        for file, _ in files:
            console.print(f"film: {file}", highlight=False, soft_wrap=True)
        if mcap:
            with counting("writing MCAP", quiet) as done:
                notes = write_drive_mcaps(out, done)
            print_written([out / MCAP_FOLDER], notes, quiet)
        if page and len(result.drives) <= MOST_ON_PAGE:
            with counting("writing the page", quiet) as read:
                write_drive_page(out, progress=read)
            console.print(f"page: {out / PAGE_NAME}", highlight=False, soft_wrap=True)
        elif page:
            console.print(f"no page of {len(result.drives)} drives; smartmot-eval report {out} writes it")


def parse_rules(text: str | None, varied: dict[str, tuple[Setting, ...]]) -> tuple[str, ...]:
    """Brake rules, from `--rule` or from `--vary rule=`, which is taken out of what is varied.

    Raises:
        ArgumentError: an unknown name, or both options.
    """
    from scenarios.settings import PARAMETERS

    named = varied.pop("rule", None)
    if named is None:
        return options.parse_names(text or "paper", PARAMETERS["rule"].choices, "--rule", own=True)
    if text is not None:
        raise ArgumentError("--rule and --vary rule say the same; give one of them")
    return tuple(map(str, named))


def parse_vehicle(text: str) -> Vehicle:
    """`LENGTH,WIDTH` or `LENGTH,WIDTH,AHEAD` in metres.

    Raises:
        ArgumentError: not of that form, or no road vehicle.
    """
    from scenarios.errors import DatasetError
    from scenarios.recorded.vehicles import Vehicle

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise ArgumentError(f"--ego: expected LENGTH,WIDTH or LENGTH,WIDTH,AHEAD in m, got {text!r}")
    try:
        return Vehicle(*numbers)
    except DatasetError as error:
        raise ArgumentError(f"--ego: {error}") from None
