"""`smartmot-eval scenes`: scenes drawn at random on any map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, print_written, results_folder

EXAMPLES = options.examples(
    "`smartmot-eval scenes --split test --count 300 --seed 0 --out results/scenes`",
    "`smartmot-eval scenes --count 50 --maps towns --out results/towns`",
    "`smartmot-eval run results/scenes/test-0-brake-0000.xosc --strategy all`",
    "Situations, distributions and their sources: docs/scenes.md.",
)


def command(
    context: typer.Context,
    split: Annotated[str, typer.Option(help="train or test: their maps differ.")] = "test",
    count: Annotated[
        int, typer.Option(min=1, max=10_000, help="Scenes of each kind: must brake, must do nothing.")
    ] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Another seed draws other scenes.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder for the scenes and their manifest.")] = Path(
        "results/scenes"
    ),
    maps: Annotated[
        Path | None,
        typer.Option(help="Folder of OpenDRIVE files, in place of the shipped maps.", metavar="DIR"),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Draw scenes at random, each an OpenSCENARIO file that is proved without brakes."""
    from evaluation.results.calls import note
    from scenarios.drawn.draw import drawn_scenes
    from scenarios.drawn.manifest import MANIFEST, REJECTED, draw_notes

    out = results_folder(context, out)
    with counting("drawing", quiet) as done:
        drawn = drawn_scenes(split, count, seed, out, maps, done)
    for file in (*(Path(scene.file) for scene in drawn), *(out / "maps").glob("*.xodr")):
        note(file)
    for name in (MANIFEST, REJECTED):
        note(out / name)
    notes = draw_notes(out, len(drawn))
    print_written([out / MANIFEST, out / REJECTED], notes, quiet)
