"""`smartmot-eval map`: what a map holds, its defects, and the monitored area on it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import With, Without, refuse_idle

if TYPE_CHECKING:
    from opendrive import RoadNetwork

EXAMPLES = options.examples(
    "`smartmot-eval map town.xodr --png town.png`",
    "`smartmot-eval map town.xodr --at 12,-1,140 --speed 50 --png here.png`",
    "`smartmot-eval map town.xodr --view town.html`",
    "`smartmot-eval map town.xodr --sites --speed 40`",
    "`smartmot-eval map town.xodr --export lanelet2 town.osm`",
    "`smartmot-eval map town.xodr --check --strict --findings town.xqar`",
    "`smartmot-eval map folder_of_maps --check`",
)
EFFECTS = (
    With(("strict", "findings"), ("check",)),
    Without(("at", "strategy", "speed", "preset", "png", "export", "sites", "view"), "check"),
    Without(("at", "strategy", "preset", "png", "export", "view"), "sites"),
    With(("strategy",), ("at",)),
    With(("strategy",), ("png", "view")),
    With(("preset",), ("at", "view")),
    With(("preset",), ("png", "view")),
)


def command(
    context: typer.Context,
    file: Annotated[
        str,
        typer.Argument(
            help="OpenDRIVE file, or the name of a shipped map; with --check also a folder of files.",
            metavar="FILE.xodr",
        ),
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
    export: Annotated[
        tuple[str, Path] | None,
        typer.Option(
            help="Write the map for another tool: commonroad (.xml), lanelet2 (.osm), sumo (.xml; needs the "
            "extra sumo), gltf (.glb, .gltf) or obj (.obj). What the format cannot hold is listed.",
            metavar="FORMAT FILE",
        ),
    ] = None,
    sites: Annotated[
        bool,
        typer.Option(
            "--sites",
            help="List every stretch where a pedestrian test at --speed can stand, as ROAD,LANE,S "
            "for --at, and stop.",
        ),
    ] = False,
    view: Annotated[
        Path | None,
        typer.Option(
            help="Page to write: pan, zoom, search, hover; ids, links, signals, objects and findings; "
            "a click shows the monitored lanes there; with --at also the area of --strategy.",
            metavar="FILE.html",
        ),
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="List what is wrong with the map, across its links too, and stop."),
    ] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="With --check: exit status 1 if there are any defects.")
    ] = False,
    findings: Annotated[
        Path | None,
        typer.Option(
            help="With --check: also write what was found, as .json or as .xqar, the result file of "
            "ASAM's quality checkers.",
            metavar="FILE",
        ),
    ] = None,
    layer: Annotated[
        str, typer.Option(help="Lane layer to read where a road has lanes of it (OpenDRIVE 1.9).")
    ] = "permanent",
) -> None:
    """Describe a map, and draw it with the monitored area at a pose."""
    from evaluation.studies.map_description import describe_map, pose_site
    from scenarios.spec import load_named_map
    from scenarios.strategies import STRATEGIES

    refuse_idle(context, EFFECTS)
    strategy = options.parse_name(strategy, STRATEGIES, "--strategy")
    preset = options.parse_preset(preset)
    place = options.parse_place(at)
    if check:
        raise typer.Exit(_check(file, strict, findings, layer))
    network = load_named_map(file, layer)
    if sites:
        from evaluation.studies.map_description import describe_sites

        for line in describe_sites(network, speed):
            typer.echo(line)
        raise typer.Exit
    site = pose_site(network, place) if place else None
    for line in describe_map(network, site, speed):
        typer.echo(line)
    if export is not None:
        for line in _export(network, *export):
            typer.echo(line)
    monitored, ego = None, None
    if site is not None and (png is not None or view is not None):
        from scenarios.presets import named_preset
        from scenarios.strategies import make_strategy
        from smartmot.types import EgoState

        monitored = make_strategy(strategy, named_preset(preset), site)
        ego = EgoState(0.0, *site.route.pose(site.line_m), speed / 3.6)
    if png is not None:
        from evaluation.views.pictures import save_map

        save_map(network, png, monitored, ego)
        typer.echo(f"picture: {png}")
    if view is not None:
        from evaluation.views.map_page import save_map_page
        from scenarios.presets import named_preset

        area = [] if monitored is None or ego is None else monitored.at(ego).polygons()
        title = network.name or Path(file).stem
        outlines = [outline for _, outline in area]
        save_map_page(network, view, title, outlines, named_preset(preset).map_area, speed)
        typer.echo(f"page: {view}")


def _export(network: RoadNetwork, form: str, path: Path) -> Iterator[str]:
    """Write a map for another tool; the lines that say what was written and what was not."""
    from evaluation.views.pictures import told_of_writing
    from opendrive.formats import EXPORTS

    form = options.parse_name(form, tuple(EXPORTS), "--export")
    endings, write = EXPORTS[form]
    if path.suffix not in endings:
        raise typer.BadParameter(
            f"{path.name!r} does not end in {' or '.join(endings)}, as {form} does", param_hint="--export"
        )
    with told_of_writing("--export", path):
        export = write(network, path)
    yield f"{form}: {path}, " + ", ".join(f"{count} {what}" for what, count in export.counts.items())
    for what, count in sorted(export.left_out.items()):
        yield f"  not carried over: {count} x {what}"
    for note in export.notes:
        yield f"  {note}"


def _check(file: str, strict: bool, findings: Path | None, layer: str) -> int:
    """List what is wrong with a map, or with all maps of a folder; the exit status."""
    from opendrive import MapWarning, load_map
    from opendrive.checks import findings_json, findings_xqar, warning_table
    from opendrive.errors import MapReadError, WarningKind
    from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map

    if findings is not None and findings.suffix not in (".json", ".xqar"):
        raise typer.BadParameter(
            f"{findings.name!r} ends in neither .json nor .xqar", param_hint="--findings"
        )
    if Path(file).is_dir():
        from evaluation.studies.map_folder import folder_table, maps_of

        if findings is not None:
            raise typer.BadParameter("is for one map, not for a folder", param_hint="--findings")
        accounts = list(maps_of(Path(file), layer))
        for line in folder_table(iter(accounts)):
            typer.echo(line)
        return int(strict and any(account.refusal or account.defects for account in accounts))
    network = None
    try:
        network = load_map(shipped_map(file) if file in SHIPPED_MAPS else file, layer=layer)
        warnings = network.findings
    except MapReadError as error:
        if findings is None:
            raise
        warnings = (MapWarning("", "OpenDRIVE", str(error), WarningKind.REFUSED, rule=error.rule),)
    if findings is not None:
        if findings.suffix == ".json":
            findings.write_text(findings_json(file, warnings), encoding="utf-8")
        else:
            place = (lambda _: None) if network is None else network.place_of
            findings.write_bytes(findings_xqar(file, _version(), warnings, place))
    for line in warning_table(warnings):
        typer.echo(line)
    return int(network is None or (strict and any(warning.kind.is_defect for warning in network.warnings)))


def _version() -> str:
    from importlib.metadata import version

    return version("smartmot")
