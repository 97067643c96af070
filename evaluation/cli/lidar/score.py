"""`smartmot-eval lidar score`: detected boxes against labels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import For, refuse_idle
from evaluation.cli.output import one_line, parse_gate, replace_results
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from evaluation.studies.lidar.score import Scores

EXAMPLES = options.examples(
    "`smartmot-eval lidar score training/label_2 results`",
    "`smartmot-eval lidar score label_02/0012.txt detections --protocol thesis --score 2 --by range`",
    "`smartmot-eval lidar score training/label_2 results --protocol nuscenes --by points "
    "--clouds training/velodyne --calib training/calib`",
    "`smartmot-eval lidar score label_2 results --protocol thesis --fail-on 'pedestrian/f1<0.7'`",
    "Layouts of the files and rules of the protocols: docs/lidar.md.",
)


EFFECTS = (For(("iou",), "protocol", ("kitti", "thesis")),)


def command(
    context: typer.Context,
    labels: Annotated[
        Path, typer.Argument(help="KITTI labels: file or folder, by frame or sequence.", metavar="LABELS")
    ],
    detections: Annotated[
        Path, typer.Argument(help="KITTI results, likewise, or AB3DMOT's.", metavar="DETECTIONS")
    ],
    protocol: Annotated[
        str, typer.Option(help="kitti: AP; thesis: TP, FP, misses; nuscenes: mAP and errors.")
    ] = "kitti",
    classes: Annotated[
        str | None,
        typer.Option(help="Types, comma-separated. Default: Car, Pedestrian, Cyclist where labelled."),
    ] = None,
    iou: Annotated[
        float | None, typer.Option(help="Overlap of a match. Default: the protocol's.", min=0.0, max=1.0)
    ] = None,
    score: Annotated[float | None, typer.Option(help="Leave out detections with a lower score.")] = None,
    by: Annotated[
        str | None, typer.Option(help="Counts by range, points, occlusion; comma-separated.")
    ] = None,
    clouds: Annotated[
        Path | None, typer.Option(help="Folder of clouds, for --by points.", metavar="DIR")
    ] = None,
    calib: Annotated[
        Path | None, typer.Option(help="KITTI calibration, file or folder, for --by points.", metavar="PATH")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the tables as CSV and Markdown.", metavar="DIR")
    ] = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Score boxes in space: KITTI's AP, the thesis' counts, nuScenes' mAP."""
    import rich.console

    from evaluation.metrics.detection.groups import GROUPINGS
    from evaluation.results.gates import measures_of_table, sides_of_table
    from evaluation.results.tables import rich_table
    from evaluation.studies.lidar.score import PROTOCOLS, ScoreOptions, score_files

    names = tuple(name.strip() for name in (classes or "").split(",") if name.strip())
    if classes is not None and not names:
        raise ArgumentError("--classes: nothing given; use types of the labels, such as Car,Pedestrian")
    asked = ScoreOptions(
        options.parse_name(protocol, PROTOCOLS, "--protocol"),
        tuple(dict.fromkeys(names)),
        iou,
        score,
        options.parse_names(by, GROUPINGS, "--by") if by else (),
        clouds,
        calib,
    )
    refuse_idle(context, EFFECTS)
    if "points" not in asked.by:
        for name, value in (("--clouds", clouds), ("--calib", calib)):
            if value is not None:
                raise ArgumentError(f"{name}: has no effect without --by points; add it")
    scores = score_files(labels, detections, asked)
    of_all = scores.tables[0][1]
    gate = parse_gate("lidar score", fail_on, junit, lambda: measures_of_table(of_all))
    console = rich.console.Console(quiet=quiet)
    for note in scores.notes:
        console.print(one_line(note), highlight=False, soft_wrap=True, markup=False)
    for title, table in scores.tables:
        console.print(rich_table(table, title, texts=2 if table.header[1] in ("view", *GROUPINGS) else 1), "")
    if out is not None:
        replace_results(context, out)
        _write(out, scores, asked.protocol, asked.by)
        console.print(f"written to {out}", highlight=False, soft_wrap=True, markup=False)
    gate.close(lambda: sides_of_table(of_all, texts=3 if asked.protocol == "kitti" else 1))


def _write(out: Path, scores: Scores, protocol: str, by: tuple[str, ...]) -> None:
    """Write every table as CSV, all of them as Markdown."""
    from evaluation.results.files import write_files
    from evaluation.results.tables import csv_bytes, markdown_table

    named = zip((protocol, *(f"by_{name}" for name in by)), scores.tables, strict=True)
    contents = {
        f"{name}.csv": csv_bytes(table.header, (*table.rows, *table.totals)) for name, (_, table) in named
    }
    pages = (f"## {title}\n\n{markdown_table(table)}" for title, table in scores.tables)
    notes = "".join(f"- {note}\n" for note in scores.notes)
    contents["scores.md"] = "\n".join((notes, *pages)).encode()
    write_files(out, contents)
