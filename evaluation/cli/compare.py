"""`smartmot-eval compare`: strategies over scenes, ablations, and more and more others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import OF_LIDAR, With, Without, is_typed, refuse_idle
from evaluation.cli.output import SchedulerAddress, parse_gate, parse_workers, results_folder
from evaluation.cli.recorded import options as recorded

if TYPE_CHECKING:
    from evaluation.results.gates import Side
    from evaluation.runs.workers import Workers
    from evaluation.studies.drive.recordings import Source

EXAMPLES = options.examples(
    "`smartmot-eval compare`",
    "`smartmot-eval compare --vary localisation_lateral_m=-1..1:0.5 --strategies map,path`",
    "`smartmot-eval compare --scenes 'people at the kerb,crosses in a bend' --weather dry,rain --seeds 5`",
    "`smartmot-eval compare --strategies map --vary tracker=preset,centerpoint,my_tracker:MyTracker`",
    "`smartmot-eval compare --vary sensor=truth,hdl32,mid70 --street furnished --strategies map,path`",
    "`smartmot-eval compare --ablation --out results/ablation`",
    "`smartmot-eval compare --growth --out results/growth`",
    "`smartmot-eval compare --scenes 'people at the kerb' --logs --out results/kerb` and then",
    "`smartmot-eval report results/kerb`",
    "`smartmot-eval compare --strategies my_area:Corridor --fail-on 'avoided<0.9,needless_stops>0.05'`",
    "`smartmot-eval compare --drives argoverse_logs --vary rule=paper,cascade,rss --out results/drives`",
    "Scenes, parameters, measures and intervals: docs/study.md. "
    "A comparison that was killed goes on where it was.",
)

_OF_SCENES = ("scenes", "full", "maps", *OF_LIDAR)
"""Options of a comparison over scenes alone."""
EFFECTS = (
    With(("sees", "map_file", "sequence", "ego", "columns", "frame_rate"), ("drives",)),
    Without((*_OF_SCENES, "weather", "seeds", "ablation", "growth", "form"), "drives"),
    Without((*_OF_SCENES, "vary", "ablation", "logs", "fail_on", "junit"), "growth"),
    Without(("vary",), "ablation"),
    With(("maps",), ("full",)),
)


def command(
    context: typer.Context,
    strategies: options.StrategyNames = "rectangular,map,all,path",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Values of a parameter; may be repeated. Default: the width of each area with all else "
            "alike, and each strategy as the preset has it.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    preset: options.PresetName = "physical",
    weather: Annotated[
        str, typer.Option(help="dry, wet, rain, snow; several, comma-separated: a table and figure each.")
    ] = "dry",
    scenes: Annotated[
        str | None,
        typer.Option(help="Only these scenes, comma-separated; see docs/study.md. Default: all."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Every variant of the scenes; those of outer maps with --maps.")
    ] = False,
    maps: Annotated[
        Path | None,
        typer.Option(help="With --full: folder with CARLA's towns and the campus maps.", metavar="DIR"),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Repetitions, each with its own noise.")] = 2,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Change the paper's choices one at a time.")
    ] = False,
    growth: Annotated[
        bool, typer.Option("--growth", help="0 to 200 other participants: time per frame, and the flag.")
    ] = False,
    logs: Annotated[
        bool,
        typer.Option(
            "--logs",
            help="Also log a run per scene and side into OUT/runs*, for `report OUT`; of drives 300 at most.",
        ),
    ] = False,
    sensor: options.SensorName = "truth",
    perception: options.PerceptionName = None,
    street: options.StreetName = None,
    street_density: options.StreetDensity = None,
    street_seed: options.StreetSeed = None,
    out: Annotated[Path, typer.Option(help="Folder for tables, figures and the journal.")] = Path(
        "results/compare"
    ),
    form: Annotated[
        str, typer.Option("--format", help="Figures as png, svg or pdf; several, comma-separated.")
    ] = "png,svg",
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
    drives: Annotated[
        Path | None,
        typer.Option(
            help="Compare on recorded drives instead: a data set with ego poses, or a folder of them. Takes "
            "--strategies, --vary, --preset (real by default), --workers and what follows.",
            metavar="DIR",
            rich_help_panel=recorded.DRIVES,
        ),
    ] = None,
    sees: recorded.Sees = None,
    map_file: recorded.DriveMap = None,
    sequence: recorded.SequenceNames = None,
    ego: recorded.EgoOutline = None,
    columns: options.ColumnPairs = None,
    frame_rate: options.FrameRate = None,
) -> None:
    """Compare strategies over scenes: collisions avoided, false activations and unnecessary stops.

    They differ in their area alone; each is also run once as the preset has it.
    """
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.compare.command import compare
    from evaluation.studies.compare.study import SceneStudy
    from evaluation.studies.compare.table import MEASURES, sides_of_summaries
    from evaluation.studies.drive.tables import DRIVE_MEASURES
    from evaluation.studies.growth import GrowthStudy, compare_growth
    from scenarios.scenes.scenes import scene_names

    refuse_idle(context, EFFECTS)
    if drives is not None:
        reading = options.source_reading(columns, frame_rate)
        source = recorded.drive_source(drives, sequence, sees, map_file, ego, reading)
        # the two kinds of comparison have defaults of their own
        named = strategies if is_typed(context, "strategies") else None
        drive_preset = preset if is_typed(context, "preset") else "real"
        who = parse_workers(workers, scheduler)
        gate = parse_gate("compare", fail_on, junit, lambda: DRIVE_MEASURES)
        out = results_folder(context, out)
        sides = _compare_drives(source, named, vary or [], drive_preset, out, who, quiet, logs)
        gate.close(lambda: sides)
        return
    chosen = options.parse_strategies(strategies, "--strategies")
    preset = options.parse_preset(preset)
    conditions = options.parse_weather(weather)
    formats = options.parse_names(form, options.PICTURE_FORMATS, "--format")
    varied = options.parse_vary(vary or [])
    lidar = options.parse_lidar(sensor, perception, street, street_density, street_seed, varied)
    only = options.parse_names(scenes, scene_names(), "--scenes") if scenes is not None else ()
    if growth and len(conditions) > 1:
        raise ArgumentError("--weather: --growth takes one")
    if maps is not None and not maps.is_dir():
        raise ArgumentError(f"--maps: {maps} is no folder; give the one with the OpenDRIVE files")
    gate = parse_gate("compare", fail_on, junit, lambda: MEASURES)
    who = parse_workers(workers, scheduler)
    out = results_folder(context, out)
    with locked(writable_folder(out)):
        if growth:
            crowd = GrowthStudy(chosen, preset, conditions[0], seeds, formats=formats)
            compare_growth(crowd, out, who, quiet)
            return
        study = SceneStudy(
            strategies=chosen,
            preset=preset,
            vary=varied,
            weather=conditions,
            scenes=only,
            full=full,
            maps=maps,
            seeds=seeds,
            ablation=ablation,
            formats=formats,
            common=lidar,
        )
        rows = compare(study, out, who, quiet, logs)
    gate.close(lambda: sides_of_summaries(rows))


def _compare_drives(
    source: Source,
    strategies: str | None,
    vary: list[str],
    preset: str,
    out: Path,
    workers: Workers,
    quiet: bool,
    logs: bool,
) -> list[Side]:
    """Compare on recorded drives; what each side came to.

    Raises:
        ArgumentError: an option cannot be read, or means nothing on drives.
    """
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.drive.side_by_side.command import compare_drives
    from evaluation.studies.drive.side_by_side.comparison import DriveComparison
    from evaluation.studies.drive.study import Options
    from evaluation.studies.drive.tables import sides_of_drives

    varied = options.parse_vary(vary)
    asked = Options(
        source,
        () if strategies is None else options.parse_strategies(strategies, "--strategies"),
        recorded.parse_rules(None, varied),
        options.parse_preset(preset),
        vary=varied,
    )
    with locked(writable_folder(out)):
        compared = compare_drives(DriveComparison(asked), out, workers, quiet, logs)
    return sides_of_drives(compared.totals)
