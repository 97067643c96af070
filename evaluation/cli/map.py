"""`smartmot-eval map`: what a map holds, its defects, and the monitored area on it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options

EXAMPLES = options.examples(
    "`smartmot-eval map town.xodr --png town.png`",
    "`smartmot-eval map town.xodr --at 12,-1,140 --speed 50 --png here.png`",
    "`smartmot-eval map town.xodr --check --strict`",
)


def command(
    file: Annotated[
        str, typer.Argument(help="OpenDRIVE file, or the name of a shipped map.", metavar="FILE.xodr")
    ],
    at: options.At = None,
    strategy: Annotated[
        str, typer.Option(help="Monitored area to draw: rectangular, map, all or path.")
    ] = "map",
    speed: Annotated[float, typer.Option(min=0, help="Ego speed for the monitored area, km/h.")] = 50.0,
    preset: options.PresetName = "physical",
    png: Annotated[
        Path | None,
        typer.Option(help="Picture to write; the ending may also be svg or pdf.", metavar="FILE"),
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="List the defects of the map, and stop.")] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="With --check: exit status 1 if there are any defects.")
    ] = False,
) -> None:
    """Describe a map, and draw it with the monitored area at a pose."""
    from evaluation.studies.map_description import describe_map, pose_site
    from scenarios.spec import load_named_map
    from scenarios.strategies import STRATEGIES

    strategy = options.parse_name(strategy, STRATEGIES, "--strategy")
    preset = options.parse_preset(preset)
    place = options.parse_place(at)
    network = load_named_map(file)
    if check:
        from opendrive.checks import warning_table

        for line in warning_table(network.warnings):
            typer.echo(line)
        raise typer.Exit(1 if strict and network.warnings else 0)
    site = pose_site(network, place) if place else None
    for line in describe_map(network, site, speed):
        typer.echo(line)
    if png is not None:
        from evaluation.views.pictures import save_map
        from scenarios.presets import named_preset
        from scenarios.strategies import make_strategy
        from smartmot.types import EgoState

        if site is None:
            save_map(network, png)
        else:
            ego = EgoState(0.0, *site.route.pose(site.line_m), speed / 3.6)
            save_map(network, png, make_strategy(strategy, named_preset(preset), site), ego)
        typer.echo(f"picture: {png}")
