"""`smartmot-eval ncap`: the cells of a test protocol."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import For, refuse_idle
from evaluation.cli.output import SchedulerAddress, parse_gate, parse_workers, results_folder, write_mcaps

EXAMPLES = options.examples(
    "`smartmot-eval ncap OSC-NCAP-scenarios/OpenSCENARIO/NCAP/AEB_VRU_2023 --protocol 2023`",
    "`smartmot-eval ncap --protocol 2026 --strategy map`",
    "`smartmot-eval ncap cpna --protocol r152`",
    "`smartmot-eval ncap --protocol fmvss127 --rule cascade`",
    "`smartmot-eval ncap --protocol my.toml --strategy map`",
    "`smartmot-eval ncap --protocol paper --preset paper --weather dry,rain`",
    "`smartmot-eval ncap --protocol 2023 --sensor hdl64 --strategy map`",
    "`smartmot-eval ncap cpna --protocol r152 --strategy my_area:Corridor --fail-on 'score_percent<100'`",
)
EFFECTS = (For(("robustness",), "protocol", ("2026", "ancap")),)


def command(
    context: typer.Context,
    files: Annotated[
        list[str] | None,
        typer.Argument(
            help="Folders or files of scenarios, or names of shipped tests: these in the cells of the "
            "protocol. None: all shipped ones.",
            metavar="[DIR|FILE|NAME ...]",
        ),
    ] = None,
    protocol: Annotated[
        str,
        typer.Option(
            help="2023, 2026 (Euro NCAP; ancap: the same), paper (SmartMOT), r152 (UN Regulation), fmvss127 "
            "(United States), or a file of your own, my.toml: docs/protocols.md."
        ),
    ] = "2023",
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
    apply_performance: options.ApplyPerformance = False,
    night: options.Night = "lidar",
    phase_ms: options.PhaseMs = 0.0,
    seed: options.Seed = 0,
    logs: Annotated[
        bool,
        typer.Option("--logs", help="Keep the log of every run, for `report` and `replay`; --mcap does too."),
    ] = False,
    robustness: Annotated[
        bool, typer.Option(help="2026: run the cells under robustness conditions too.")
    ] = True,
    form: options.PictureFormat = "png",
    out: Annotated[Path, typer.Option(help="Folder for tables and matrices.")] = Path("results/ncap"),
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    mcap: options.Mcap = False,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Run every cell of a test protocol, score it, show its matrices."""
    import rich.console

    from evaluation.protocols.registry import ALIASES, PROTOCOLS, is_file
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.runs.specs import Conditions
    from evaluation.studies.ncap.run import NCAP_MEASURES, run_grid
    from evaluation.views.traces.mcap import require_foxglove

    refuse_idle(context, EFFECTS)
    gate = parse_gate("ncap", fail_on, junit, lambda: NCAP_MEASURES)
    name = protocol
    if not is_file(name):
        name = options.parse_name(name, (*PROTOCOLS, *ALIASES), "--protocol")
        name = ALIASES.get(name, name)
    conditions = Conditions(
        strategies=options.parse_strategies(strategy),
        preset=options.parse_preset(preset),
        weather=options.parse_weather(weather),
        seed=seed,
        phase_s=phase_ms / 1000,
        night=options.parse_night(night),
        adapts=name == "paper",
        settings=(
            *options.parse_plugged(tracker=tracker, detector=detector, rule=rule),
            *options.parse_lidar(sensor, perception, street, street_density, street_seed),
        ),
        apply_performance=apply_performance,
    )
    form = options.parse_format(form)
    who = parse_workers(workers, scheduler)
    if mcap:
        require_foxglove()
    out = results_folder(context, out)
    with locked(writable_folder(out)):
        sides = run_grid(
            files or [],
            name,
            conditions,
            out,
            who,
            rich.console.Console(quiet=quiet),
            keep_logs=logs or mcap,
            form=form,
            robustness=robustness,
        )
        if mcap:
            write_mcaps(out, quiet, who)
    gate.close(lambda: sides)
