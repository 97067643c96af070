"""`smartmot-eval lidar train` and `lidar export`: learned detectors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import _smartmot
from evaluation.cli import options
from evaluation.cli.call.effects import With, Without, refuse_idle
from evaluation.cli.lidar.detect import NETWORK_ENDING
from evaluation.cli.output import counting, one_line
from evaluation.errors import ArgumentError

EXAMPLES = options.examples(
    "`smartmot-eval lidar train data --minutes 20 --out results/network`",
    "`smartmot-eval lidar train data --steps 2000 --seed 7 --out results/network`",
    "Stopped, the same command goes on where the last validation was. Data sets: `lidar dataset make`. "
    "What is learned, and how well: docs/learned.md.",
)

EXPORT_EXAMPLES = options.examples(
    "`smartmot-eval lidar export pillars --int8 --calibrate 300 --out pillars_int8.onnx`",
    "`smartmot-eval lidar export results/network --int8 --data data --out network_int8.onnx`",
    "`smartmot-eval lidar detect clouds --method network_int8.onnx`",
)

Data = Annotated[
    Path, typer.Argument(help="Data set with clouds in KITTI's, nuScenes' or SimBEV's layout.", metavar="DIR")
]


EFFECTS = (Without(("minutes",), "steps"),)


def command(
    context: typer.Context,
    data: Data,
    minutes: Annotated[float, typer.Option(help="Wall time of the training.", min=0.01)] = 20.0,
    steps: Annotated[
        int | None,
        typer.Option(
            help="Steps instead of minutes: then the network is the same each time with as many threads.",
            min=1,
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Greatest rate of learning.")] = 3e-3,
    seed: Annotated[int, typer.Option(help="Of weights, order and changes of the frames.", min=0)] = 1,
    out: Annotated[Path, typer.Option(help="Folder for checkpoint, curves, network and card.")] = Path(
        "results/network"
    ),
    quiet: options.Quiet = False,
) -> None:
    """Train a pillar network on this machine's processor."""
    refuse_idle(context, EFFECTS)
    require_torch()
    import rich.console

    from evaluation.results.tables import rich_table
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.training import NETWORK
    from evaluation.studies.training.fit import Progress, TrainingOptions
    from evaluation.studies.training.study import CLASSES, quality_table, read_labelled, train
    from evaluation.views.pictures import save_picture
    from evaluation.views.plots.training import training_figure
    from smartmot.lidar.learned import Decoder, PillarGrid

    asked = TrainingOptions(steps=steps, minutes=minutes, rate=rate, seed=seed)
    console = rich.console.Console(quiet=quiet)
    out = writable_folder(out)
    with locked(out):
        with counting("reading", quiet) as done:
            frames = read_labelled(data, Decoder(PillarGrid(), CLASSES), done)
        for note in frames.notes:
            console.print(one_line(note), highlight=False, soft_wrap=True, markup=False)
        with counting("training", quiet) as done:

            def report(progress: Progress, share: float) -> None:
                done(round(1000 * share), 1000)
                row = progress.rows[-1]
                if "loss_held_out" in row:
                    scores = ", ".join(f"{name} {row[f'f1_{name}']:.2f}" for name in CLASSES)
                    console.print(
                        f"step {progress.step}: loss {row['loss_scores'] + row['loss_boxes']:.2f}, held out "
                        f"{row['loss_held_out']:.2f}; F1 {scores}",
                        highlight=False,
                        soft_wrap=True,
                    )

            training, boxes = train(out, frames, asked, report)
        save_picture(training_figure(training.progress.rows, CLASSES), out / "training.png", "training")
        console.print(rich_table(quality_table(boxes), texts=1), "")
        console.print(
            f"written to {out}: {NETWORK} and others", highlight=False, soft_wrap=True, markup=False
        )


EXPORT_EFFECTS = (With(("data", "calibrate"), ("int8",)),)


def export_command(
    context: typer.Context,
    network: Annotated[
        Path,
        typer.Argument(help="Folder of a training, FILE.onnx, or pillars.", metavar="DIR|FILE.onnx|NAME"),
    ],
    out: Annotated[Path, typer.Option(help="The file.", metavar="FILE.onnx")],
    int8: Annotated[bool, typer.Option("--int8", help="Convolutions on integers of 8 bits.")] = False,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Data set whose split train shows the ranges of values, for --int8. Default: simulated "
            "streets.",
            metavar="DIR",
        ),
    ] = None,
    calibrate: Annotated[
        int | None, typer.Option(help="Clouds that are looked at, for --int8. Default: 300.", min=1)
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a trained network as an ONNX file."""
    from evaluation.results.files import write_bytes
    from evaluation.studies.training import CALIBRATION_CLOUDS, NETWORK
    from smartmot.lidar.learned import SHIPPED, LearnedConfig, shipped_path

    refuse_idle(context, EXPORT_EFFECTS)
    if out.suffix != NETWORK_ENDING:
        raise ArgumentError(f"--out: a name that ends in {NETWORK_ENDING}, got {str(out)!r}")
    source = shipped_path(str(network)) if str(network) in SHIPPED else network
    if source.suffix != NETWORK_ENDING:
        source /= NETWORK
        if not source.is_file():
            raise ArgumentError(f"{source}: no network; finish the training first (lidar train)")
    if source.resolve() == out.resolve():
        raise ArgumentError(f"--out {out}: is the network itself")
    config = LearnedConfig(source)
    if int8:
        require(("onnx", "onnxruntime"), "networks of 8 bits (--int8)")
        from evaluation.studies.training.calibration import dataset_clouds, drawn_clouds, export_integers

        count = calibrate or CALIBRATION_CLOUDS
        clouds = drawn_clouds(count) if data is None else dataset_clouds(data, count)
        with counting("calibrating", quiet) as done:
            export_integers(config, clouds, out, lambda number: done(number, count))
    else:
        write_bytes(out, source.read_bytes())
    if not quiet:
        typer.echo(f"written to {out}")


def require_torch() -> None:
    """Say in one line what is missing.

    Raises:
        ArgumentError: PyTorch or what writes networks is not installed.
    """
    require(("torch", "onnx", "onnxscript", "onnxruntime"), "networks to be trained")


def require(names: tuple[str, ...], purpose: str) -> None:
    """See that packages are installed.

    Raises:
        ArgumentError: one is not.
    """
    import importlib.util

    missing = [name for name in names if importlib.util.find_spec(name) is None]
    if missing:
        raise ArgumentError(_smartmot.missing_extra(purpose, "training", f"no {', '.join(missing)}"))
