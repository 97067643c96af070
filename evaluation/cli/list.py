"""`smartmot-eval list`: the shipped scenarios and their parameters."""

from __future__ import annotations

from typing import Annotated

import typer


def command(
    scenario: Annotated[
        str | None,
        typer.Argument(help="Only this one, with its parameters.", metavar="[FILE.xosc|NAME]"),
    ] = None,
) -> None:
    """List the shipped scenarios: name, number of runs, description; or one with its parameters."""
    from scenarios.catalogue.library import SHIPPED_SCENARIOS, describe

    for name in SHIPPED_SCENARIOS if scenario is None else (scenario,):
        described = describe(name)
        runs = f"{described.runs} run{'s' if described.runs > 1 else ''}"
        typer.echo(f"{described.name:<20} {runs:>8}  {described.text}")
        if scenario is None:
            typer.echo(f"{'':<31}{', '.join(key for key, _ in described.parameters)}")
        for key, value in described.parameters if scenario is not None else ():
            typer.echo(f"  {key} = {value}")
