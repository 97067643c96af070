"""`smartmot-eval run`: scenario files, shipped or of the user's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import OF_LIDAR, With, Without, refuse_idle
from evaluation.cli.call.traffic import TrafficText, parse_traffic
from evaluation.cli.output import SchedulerAddress, parse_gate, parse_workers, results_folder, write_mcaps
from evaluation.errors import ArgumentError

EXAMPLES = options.examples(
    "`smartmot-eval run cpfa --preset physical --strategy rectangular,map`",
    "`smartmot-eval run my_test.xosc --param Ego_speed_kph=50 --no-aeb`",
    "`smartmot-eval run crossing --param Target_entry=child --param Impact_percent=10 --workers 2`",
    "`smartmot-eval run cpfa --sensor mid70 --perception my_detector:Clouds --street furnished`",
    "`smartmot-eval run crossing --traffic followers=2,vehicles=8,walkers=6`",
    "`smartmot-eval run scenarios_of_others --check --roads maps`",
    "`smartmot-eval run my_test.xosc --fail-on 'contacts>0,criteria_failed>0' --junit run.xml`",
    "Names and parameters of the shipped scenarios: smartmot-eval list",
)
_OF_PERCEPTION = ("strategy", "tracker", "detector", "rule", *OF_LIDAR, "night")
EFFECTS = (
    With(("to_end", "as_markdown"), ("check",)),
    Without(
        (
            *_OF_PERCEPTION, "param", "no_aeb", "preset", "weather", "hold_speed", "apply_performance",
            "traffic", "map_file", "phase_ms", "seed", "out", "pictures", "form", "workers", "scheduler",
            "mcap", "fail_on", "junit",
        ),
        "check",
    ),
    Without(_OF_PERCEPTION, "no_aeb"),
    Without(("form",), "pictures"),
)  # fmt: skip


def command(
    context: typer.Context,
    scenario: Annotated[
        str,
        typer.Argument(
            help="Scenario or distribution file, or a shipped name; with --check also a folder.",
            metavar="FILE.xosc|NAME",
        ),
    ],
    param: Annotated[
        list[str] | None,
        typer.Option(help="Value of a parameter of the scenario; may be repeated.", metavar="NAME=VALUE"),
    ] = None,
    no_aeb: Annotated[
        bool, typer.Option("--no-aeb", help="No brake but the scenario's: the unbraked run.")
    ] = False,
    strategy: options.StrategyNames = "rectangular,map",
    preset: options.PresetName = "physical",
    tracker: options.TrackerName = "preset",
    detector: options.DetectorName = "preset",
    rule: options.RuleName = "paper",
    sensor: options.SensorName = "truth",
    perception: options.PerceptionName = None,
    street: options.StreetName = None,
    street_density: options.StreetDensity = None,
    street_seed: options.StreetSeed = None,
    weather: options.WeatherNames = "dry",
    hold_speed: Annotated[
        bool,
        typer.Option(
            "--hold-speed", help="As in tests of Euro NCAP: no ACC, and the run ends when the ego stands."
        ),
    ] = False,
    apply_performance: options.ApplyPerformance = False,
    traffic: TrafficText = None,
    night: options.Night = "lidar",
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="Map that perception uses; default: the scenario's own, or a street laid over a test track.",
            metavar="FILE.xodr",
        ),
    ] = None,
    road: Annotated[
        Path | None,
        typer.Option(
            "--road",
            "--roads",
            help="Road of a scenario that names a level (Town01) in place of a file: the file, or a folder "
            "with Town01.xodr.",
            metavar="FILE.xodr|DIR",
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Say which files can be run, as a table, and stop.")
    ] = False,
    to_end: Annotated[
        bool, typer.Option("--to-end", help="With --check: run each file unbraked, to its end or for 300 s.")
    ] = False,
    as_markdown: Annotated[
        bool,
        typer.Option(
            "--markdown", help="With --check: the table in Markdown, as docs/openscenario.md has it."
        ),
    ] = False,
    phase_ms: options.PhaseMs = 0.0,
    seed: options.Seed = 0,
    out: Annotated[Path, typer.Option(help=options.OUT)] = Path("results/run"),
    pictures: options.Pictures = True,
    form: options.PictureFormat = "png",
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    mcap: options.Mcap = False,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Run an OpenSCENARIO file, or every variation that a file asks for."""
    from evaluation.results.gates import RUN_MEASURES, sides_of_runs

    refuse_idle(context, EFFECTS)
    if road is not None and not road.exists():
        raise ArgumentError(f"--road: {road} does not exist")
    gate = parse_gate("run", fail_on, junit, lambda: RUN_MEASURES)
    if check:
        _check(scenario, road, to_end, as_markdown, quiet)
    if road is not None:
        map_file = _road_of(scenario, road, map_file)
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.runs.specs import Conditions, scenario_specs
    from evaluation.studies.suite import compare_files
    from evaluation.views.traces.mcap import require_foxglove
    from scenarios.spec import NO_AEB

    form = options.parse_format(form)
    conditions = Conditions(
        strategies=(NO_AEB,) if no_aeb else options.parse_strategies(strategy),
        preset=options.parse_preset(preset),
        weather=options.parse_weather(weather),
        map_name=str(map_file) if map_file else None,
        seed=seed,
        phase_s=phase_ms / 1000,
        night=options.parse_night(night),
        adapts=not hold_speed,
        settings=(
            *options.parse_plugged(tracker=tracker, detector=detector, rule=rule),
            *options.parse_lidar(sensor, perception, street, street_density, street_seed),
        ),
        apply_performance=apply_performance,
        traffic=parse_traffic(traffic),
    )
    notes: list[str] = []
    specs = scenario_specs(scenario, options.parse_parameters(param or []), conditions, notes)
    for note in notes:
        typer.echo(f"smartmot-eval: {note}", err=True)
    who = parse_workers(workers, scheduler)
    if mcap:
        require_foxglove()
    out = results_folder(context, out)
    with locked(writable_folder(out)):
        judged = compare_files(specs, out, form if pictures else None, who, quiet)
        if mcap:
            write_mcaps(out, quiet, who)
    gate.close(lambda: sides_of_runs(judged))


def _check(place: str, road: Path | None, to_end: bool, as_markdown: bool, quiet: bool) -> None:
    """Print the table of what can be run, with a line per note for a single file; ends the command."""
    from evaluation.cli.output import counting, one_line
    from scenarios.catalogue.library import scenario_path
    from scenarios.openscenario.checking import check, markdown, scenario_files, table

    path = Path(place) if Path(place).exists() else scenario_path(place)
    files = scenario_files(path)
    checks = []
    with counting("checking", quiet) as done:
        for number, file in enumerate(files):
            done(number, len(files))
            checks.append(check(file, road, to_end))
    form = markdown if as_markdown else table
    for line in form(checks, path if path.is_dir() else path.parent):
        typer.echo(one_line(line))
    for note in checks[0].lines if len(checks) == 1 and not as_markdown else ():
        typer.echo(f"  {one_line(note)}")
    raise typer.Exit(1 if any(held.verdict == "refused" for held in checks) else 0)


def _road_of(scenario: str, road: Path, map_file: Path | None) -> Path | None:
    """The map of perception: that which is asked for, or the road that stands in for the scenario's own."""
    from scenarios.catalogue.library import scenario_path
    from scenarios.openscenario import expand, load

    variation = expand(scenario_path(scenario))[0]
    own = load(variation.path, variation.parameters, road).map_path
    if own is None or not own.resolve().is_relative_to(road.resolve()):
        where = "takes place on a plane" if own is None else f"has a road of its own, {own}"
        typer.echo(f"smartmot-eval: --road {road} is not used: the scenario {where}", err=True)
    elif map_file is not None and map_file.resolve() != own.resolve():
        raise ArgumentError(
            f"--map: {map_file} is not {own}, on which the scenario takes place by --road; leave --map out"
        )
    return map_file or own
