"""`smartmot-eval cpna`: the paper's test at several speeds, strategies beside one another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import Without, refuse_idle
from evaluation.cli.output import SchedulerAddress, parse_gate, parse_workers, results_folder, write_mcaps
from scenarios.catalogue.maps import DEFAULT_MAP

EXAMPLES = options.examples(
    "`smartmot-eval cpna --speeds 10..60`",
    "`smartmot-eval cpna --speeds 10..80 --preset physical --weather dry,rain --out results`",
    "`smartmot-eval cpna --map town.xodr --at 12,-1,140 --speeds 30,50 --impact-point 25`",
    "`smartmot-eval cpna --preset physical --sensor hdl32 --street furnished`",
    "`smartmot-eval cpna --tracker my_tracker:MyTracker --strategy map,my_area:Corridor`",
    "`smartmot-eval cpna --strategy map --fail-on 'contacts>0,score<9' --junit cpna.xml`",
)
EFFECTS = (Without(("form",), "pictures"),)


def command(
    context: typer.Context,
    speeds: Annotated[
        str, typer.Option(help="Test speeds in km/h: 10..60 (step 10), 10..60:5, or 30,50.")
    ] = "10..60",
    strategy: options.StrategyNames = "rectangular,map",
    preset: options.PresetName = "paper",
    tracker: options.TrackerName = "preset",
    detector: options.DetectorName = "preset",
    rule: options.RuleName = "paper",
    sensor: options.SensorName = "truth",
    perception: options.PerceptionName = None,
    street: options.StreetName = None,
    street_density: options.StreetDensity = None,
    street_seed: options.StreetSeed = None,
    weather: options.WeatherNames = "dry",
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", help=f"OpenDRIVE file; default: the shipped {DEFAULT_MAP}.", metavar="FILE.xodr"
        ),
    ] = None,
    at: options.At = None,
    impact_point: Annotated[
        float | None,
        typer.Option(
            "--impact-point",
            help="Euro NCAP impact location in % of the ego's width (25, 50, 75); default: the paper's test.",
        ),
    ] = None,
    phase_ms: options.PhaseMs = 0.0,
    adversaries: Annotated[
        str, typer.Option(help="none, or static: parked cars and standing people.")
    ] = "none",
    seed: options.Seed = 0,
    out: Annotated[Path, typer.Option(help=options.OUT)] = Path("results/cpna"),
    pictures: options.Pictures = True,
    form: options.PictureFormat = "png",
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    mcap: options.Mcap = False,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Car to pedestrian, near side, adult: an adult steps out in front of the ego."""
    from evaluation.runs.workers import start_early

    if scheduler is None:
        start_early(workers, "evaluation.runs.execution")
    from evaluation.results.gates import RUN_MEASURES, sides_of_runs
    from evaluation.runs.cpna import CpnaSuite
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.runs.specs import Conditions
    from evaluation.studies.suite import compare_cpna
    from evaluation.views.traces.mcap import require_foxglove

    refuse_idle(context, EFFECTS)
    form = options.parse_format(form)
    gate = parse_gate("cpna", fail_on, junit, lambda: RUN_MEASURES)
    suite = CpnaSuite(
        speeds_kmh=options.parse_speeds(speeds),
        conditions=Conditions(
            strategies=options.parse_strategies(strategy),
            preset=options.parse_preset(preset),
            weather=options.parse_weather(weather),
            map_name=str(map_file) if map_file else DEFAULT_MAP,
            adversaries=adversaries,
            seed=seed,
            phase_s=phase_ms / 1000,
            settings=(
                *options.parse_plugged(tracker=tracker, detector=detector, rule=rule),
                *options.parse_lidar(sensor, perception, street, street_density, street_seed),
            ),
        ),
        place=options.parse_place(at),
        impact_point_percent=impact_point,
    )
    who = parse_workers(workers, scheduler)
    if mcap:
        require_foxglove()
    out = results_folder(context, out)
    with locked(writable_folder(out)):
        judged = compare_cpna(suite, out, form if pictures else None, who, quiet)
        if mcap:
            write_mcaps(out, quiet, who)
    gate.close(lambda: sides_of_runs(judged))
