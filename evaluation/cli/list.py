"""`smartmot-eval list`: the shipped scenarios and their parameters; rules, protocols, perceptions."""

from __future__ import annotations

from typing import Annotated

import typer

from evaluation.cli.call.effects import Without, refuse_idle

EFFECTS = (
    Without(("scenario", "protocols", "perceptions"), "rules"),
    Without(("scenario", "perceptions"), "protocols"),
    Without(("scenario",), "perceptions"),
)


def command(
    context: typer.Context,
    scenario: Annotated[
        str | None,
        typer.Argument(help="Only this one, with its parameters.", metavar="[FILE.xosc|NAME]"),
    ] = None,
    rules: Annotated[bool, typer.Option("--rules", help="The shipped brake rules in their place.")] = False,
    protocols: Annotated[
        bool, typer.Option("--protocols", help="The shipped test protocols in their place.")
    ] = False,
    perceptions: Annotated[
        bool, typer.Option("--perceptions", help="What makes detections of a LiDAR's clouds in their place.")
    ] = False,
) -> None:
    """List the shipped scenarios: name, number of runs, description; or one with its parameters.

    Of the parameters: declared value with its unit, and what it is.
    """
    refuse_idle(context, EFFECTS)
    from scenarios.catalogue.library import describe, describe_all

    if rules:
        _list_rules()
        return
    if protocols:
        _list_protocols()
        return
    if perceptions:
        _list_perceptions()
        return
    for described in describe_all() if scenario is None else (describe(scenario),):
        runs = f"{described.runs} run{'s' if described.runs > 1 else ''}"
        typer.echo(f"{described.name:<20} {runs:>8}  {described.text}")
        if scenario is None:
            typer.echo(f"{'':<31}{', '.join(parameter.name for parameter in described.parameters)}")
        for parameter in described.parameters if scenario is not None else ():
            typer.echo(f"  {parameter}")


def _list_protocols() -> None:
    """Name of each protocol, how many cells its grid has, and its title."""
    from evaluation.protocols.registry import ALIASES, PROTOCOLS, named_protocol

    for name in PROTOCOLS:
        rules = named_protocol(name)
        typer.echo(f"{name:<20} {len(rules.cells()):>4} cells  {rules.title}")
    for alias, name in ALIASES.items():
        typer.echo(f"{alias:<20} {'':>10}  the same as {name}")


def _list_perceptions() -> None:
    """Name of each perception of a LiDAR, and what it does."""
    from scenarios.sensors.lidar.chain import MONITORED, NETWORK_FORM, OF_TRUTH, PERCEPTIONS, UNSCORED
    from smartmot.lidar.learned import SHIPPED

    texts = {
        "classical": "Local ground, clusters, calibrated scores; fitted to simulated streets.",
        "plain": "The thesis' chain: voxels, one plane, clusters, rules of size; all scores 1.",
    }
    texts |= {name: f"{of} with all scores 1." for name, of in UNSCORED.items()}
    texts |= {name: f"{of}, given the points on the monitored area alone." for name, of in MONITORED.items()}
    texts |= {name: (kind.__doc__ or "").splitlines()[0] for name, kind in OF_TRUTH.items()}
    lines = [(name, texts[name]) for name in PERCEPTIONS]
    lines += [
        (name, f"A shipped network, trained on simulated streets{of}: docs/learned.md.")
        for name, of in zip(SHIPPED, ("", ", of 8-bit integers and quicker"), strict=True)
    ]
    lines += [
        (NETWORK_FORM, "A network that lidar train made, known by the hash of its file: docs/learned.md."),
        (f"{NETWORK_FORM}_monitored", "Either of them, given the points on the monitored area alone."),
        ("package.module:name", "A detector of your own: docs/lidar.md, In the loop."),
    ]
    for name, text in lines:
        typer.echo(f"{name:<22} {text}")


def _list_rules() -> None:
    """Name of each brake rule, its trigger parameter with the published value, and what it does."""
    from scenarios.settings import TRIGGERS, setting_text
    from smartmot.decision.rules import PaperRule
    from smartmot.decision.shipped import PAPER_RULE, RULES

    for name, rule in RULES.items():
        described = (PaperRule if name == PAPER_RULE else type(rule)).__doc__ or ""
        trigger = setting_text(TRIGGERS[name], float(getattr(rule, TRIGGERS[name])))
        typer.echo(f"{name:<22} {trigger:<25} {described.splitlines()[0]}")
