"""`smartmot-eval compare`: strategies over scenes, ablations, and more and more others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options

EXAMPLES = options.examples(
    "`smartmot-eval compare`",
    "`smartmot-eval compare --vary margin_m=0..4:0.5 --vary ego_forecast=ctrv,path --strategies map`",
    "`smartmot-eval compare --scenes 'people at the kerb,crosses in a bend' --weather dry,rain --seeds 5`",
    "`smartmot-eval compare --strategies map --vary tracker=preset,centerpoint,my_tracker:MyTracker`",
    "`smartmot-eval compare --ablation --out results/ablation`",
    "`smartmot-eval compare --growth --out results/growth`",
    "`smartmot-eval compare --scenes 'people at the kerb' --logs --out results/kerb` and then",
    "`smartmot-eval report results/kerb/runs`",
    "Scenes, parameters, measures and intervals: docs/study.md. "
    "A comparison that was killed goes on where it was.",
)


def command(
    strategies: options.StrategyNames = "rectangular,map,all",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Values of a parameter; may be repeated. Default: margin_m, half_width_m, ego_forecast.",
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
        typer.Option("--logs", help="Also log a run per scene and strategy into OUT/runs, for `report`."),
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for tables, figures and the journal.")] = Path(
        "results/compare"
    ),
    form: Annotated[
        str, typer.Option("--format", help="Figures as png, svg or pdf; several, comma-separated.")
    ] = "png,svg",
    workers: options.Workers = None,
    quiet: options.Quiet = False,
) -> None:
    """Compare strategies over scenes: collisions avoided, false activations and unnecessary stops."""
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.runs.workers import available_cores
    from evaluation.studies.compare.command import compare
    from evaluation.studies.compare.study import SceneStudy
    from evaluation.studies.growth import GrowthStudy, compare_growth
    from scenarios.scenes.scenes import scene_names

    if ablation + growth + bool(vary) > 1:
        raise ArgumentError("--vary, --ablation and --growth exclude one another; give one of them")
    chosen = options.parse_strategies(strategies, "--strategies")
    preset = options.parse_preset(preset)
    conditions = options.parse_weather(weather)
    formats = options.parse_names(form, options.PICTURE_FORMATS, "--format")
    varied = options.parse_vary(vary or [])
    only = options.parse_names(scenes, scene_names(), "--scenes") if scenes is not None else ()
    if growth and (only or full or logs or len(conditions) > 1):
        raise ArgumentError("--growth: takes one --weather, and neither --scenes, --full nor --logs")
    if maps is not None and not full:
        raise ArgumentError("--maps: only --full runs scenes on outer maps; add --full")
    if maps is not None and not maps.is_dir():
        raise ArgumentError(f"--maps: {maps} is no folder; give the one with the OpenDRIVE files")
    processes = workers or available_cores()
    with locked(writable_folder(out)):
        if growth:
            crowd = GrowthStudy(chosen, preset, conditions[0], seeds, formats=formats)
            compare_growth(crowd, out, processes, quiet)
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
        )
        compare(study, out, processes, quiet, logs)
