"""The option `--traffic`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from scenarios.traffic import Traffic

TrafficText = Annotated[
    str | None,
    typer.Option(
        "--traffic",
        help="Vehicles and pedestrians of SUMO, who react to the ego: followers, vehicles, walkers, and how "
        "they drive (docs/traffic.md). Needs the extra sumo.",
        metavar="NAME=VALUE,...",
    ),
]


def parse_traffic(text: str | None) -> Traffic | None:
    """Traffic as it was typed; None: nobody.

    Raises:
        ArgumentError: an unknown name, or a value out of range.
        ScenarioError: SUMO is not installed.
    """
    if text is None:
        return None
    from scenarios.errors import ScenarioError
    from scenarios.traffic import Traffic
    from scenarios.traffic.session import library

    library()
    try:
        return Traffic.parsed(text)
    except ScenarioError as error:
        raise ArgumentError(f"--{error}") from None
