"""Options that the commands for recorded drives share, and what becomes of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from evaluation.studies.drive.recordings import Source
    from scenarios.recorded.formats import Reading
    from scenarios.recorded.vehicles import Vehicle
    from scenarios.settings import Setting

DRIVES = "Recorded drives"
"""Heading of the options that only drives have."""

Sees = Annotated[
    str | None,
    typer.Option(
        "--detections",
        help="detections: what was recorded; labels: they stand in, with the sensor's errors. Default: "
        "detections where there are any.",
        metavar="labels|detections",
        rich_help_panel=DRIVES,
    ),
]
DriveMap = Annotated[
    Path | None,
    typer.Option(
        "--map",
        help="OpenDRIVE file, Argoverse 2 map or log, in the frame of the ego poses. Default: the log's own.",
        metavar="FILE",
        rich_help_panel=DRIVES,
    ),
]
SequenceNames = Annotated[
    str | None,
    typer.Option(
        "--sequence",
        help="Only these sequences, comma-separated.",
        metavar="NAMES",
        rich_help_panel=DRIVES,
    ),
]
EgoOutline = Annotated[
    str | None,
    typer.Option(
        "--ego",
        help="Vehicle: length, width, and how far its middle is ahead of the recorded point (m). Default: "
        "that of the data set, else a car of 4.4 m x 1.8 m.",
        metavar="L,W[,AHEAD]",
        rich_help_panel=DRIVES,
    ),
]


def drive_source(
    folder: Path,
    sequence: str | None,
    sees: str | None,
    map_file: Path | None,
    ego: str | None,
    reading: Reading | None,
    form: str | None = None,
) -> Source:
    """Recorded drives as they are asked for.

    Raises:
        ArgumentError: an unknown name, or no road vehicle.
    """
    from evaluation.studies.drive.drive import SEES
    from evaluation.studies.drive.recordings import Source
    from scenarios.recorded.formats import FORMATS

    return Source(
        folder=folder,
        form=options.parse_name(form, FORMATS, "--format") if form else None,
        sequences=sequence,
        sees=options.parse_name(sees, SEES, "--detections") if sees else None,
        map_file=map_file,
        vehicle=None if ego is None else parse_vehicle(ego),
        columns=reading,
    )


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
