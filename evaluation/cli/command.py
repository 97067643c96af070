"""The command `smartmot-eval`. Heavy libraries are imported by the commands that use them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

from evaluation.arguments import DEFAULT_MAP

PICTURE_FORMATS = ("png", "svg", "pdf")
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""
BROKEN_PIPE = 141
"""Exit status where the reader of the output has ended, as shells have it."""

app = typer.Typer(
    name="smartmot-eval",
    help="HD-map-aware tracking and automatic emergency braking, evaluated in closed loop.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

CPNA_EXAMPLES = """
**Examples**

`smartmot-eval cpna --speeds 10..60`

`smartmot-eval cpna --speeds 10..80 --preset physical --weather dry,rain --out results`

`smartmot-eval cpna --map town.xodr --at 12,-1,140 --speeds 30,50 --impact-point 25`

`smartmot-eval cpna --tracker my_tracker:MyTracker --strategy map,my_area:Corridor`
"""

RUN_EXAMPLES = """
**Examples**

`smartmot-eval run cpfa --preset physical --strategy rectangular,map`

`smartmot-eval run my_test.xosc --param Ego_speed_kph=50 --no-aeb`

`smartmot-eval run crossing --param Target_entry=child --param Impact_percent=10 --workers 2`

Names and parameters of the shipped scenarios: smartmot-eval list
"""

NCAP_EXAMPLES = """
**Examples**

`smartmot-eval ncap OSC-NCAP-scenarios/OpenSCENARIO/NCAP/AEB_VRU_2023 --protocol 2023`

`smartmot-eval ncap --protocol 2026 --strategy map`

`smartmot-eval ncap --protocol paper --preset paper --weather dry,rain`
"""

PLOT_EXAMPLES = """
**Examples**

`smartmot-eval plot results`

`smartmot-eval plot results --run CPNA_map_dry_none_60kmh_seed0 --format svg`
"""

REPORT_EXAMPLES = """
**Examples**

`smartmot-eval report results`

`smartmot-eval report results --out comparison.html`
"""

REPLAY_EXAMPLES = """
**Examples**

`smartmot-eval replay results/CPNA_map_dry_none_60kmh_seed0 --gif map60.gif`

`smartmot-eval replay results/logs/CPNA_map_dry_none_60kmh_seed0.parquet --mp4 map60.mp4 --speed 0.5`
"""

MAP_EXAMPLES = """
**Examples**

`smartmot-eval map town.xodr --png town.png`

`smartmot-eval map town.xodr --at 12,-1,140 --speed 50 --png here.png`

`smartmot-eval map town.xodr --check --strict`
"""

MOT_EXAMPLES = """
**Examples**

`smartmot-eval mot kitti/training --out results/mot`

`smartmot-eval mot nuscenes/detections.json --config centerpoint --write nuscenes`

`smartmot-eval mot my_csv_folder --gif tracks.gif --sequence 0001`

`smartmot-eval mot my_csv_folder --filter map --map town.xodr`

`smartmot-eval mot kitti/training --config my_tracker:MyTracker`

Formats, metrics and the files written: docs/mot.md. Metrics need trackeval: pip install trackeval.
"""

COMPARE_EXAMPLES = """
**Examples**

`smartmot-eval compare`

`smartmot-eval compare --vary margin_m=0..4:0.5 --vary ego_forecast=ctrv,route --strategies map`

`smartmot-eval compare --scenes 'people at the kerb,crosses in a bend' --weather dry,rain --seeds 5`

`smartmot-eval compare --strategies map --vary tracker=preset,centerpoint,my_tracker:MyTracker`

`smartmot-eval compare --ablation --out results/ablation`

`smartmot-eval compare --growth --out results/growth`

`smartmot-eval compare --scenes 'people at the kerb' --logs --out results/kerb` and then

`smartmot-eval report results/kerb/runs`

Scenes, parameters, measures and intervals: docs/study.md. A comparison that was killed goes on where it was.
"""

REPORTS_EXAMPLES = """
**Examples**

`smartmot-eval reports`

`smartmot-eval reports --only paper,static`

`smartmot-eval reports --check`

Started again after it was stopped, it goes on where it was.
"""

Speeds = Annotated[str, typer.Option(help="Test speeds in km/h: 10..60 (step 10), 10..60:5, or 30,50.")]
Strategy = Annotated[
    str,
    typer.Option(
        help="Monitored areas to compare, comma-separated: rectangular, map, all, or your own, "
        "package.module:name."
    ),
]
TrackerName = Annotated[
    str,
    typer.Option(
        help="preset, ab3dmot, centerpoint, default, smartmot, or your own, package.module:name.",
        metavar="NAME",
    ),
]
DetectorName = Annotated[str, typer.Option(help="preset, or your own, package.module:name.", metavar="NAME")]
AllowPlugins = Annotated[
    bool,
    typer.Option(
        "--allow-plugins",
        help="Run code of your own (package.module:name) that made monitored areas, to draw them again.",
    ),
]
PresetName = Annotated[
    str,
    typer.Option(help="paper: the SmartMOT paper's conditions; physical: brakes and sensor of a real car."),
]
WeatherNames = Annotated[
    str, typer.Option(help="dry, wet, rain, snow; several, comma-separated: the score is their mean.")
]
MapFile = Annotated[
    Optional[Path],  # noqa: UP045 - typer reads the annotation at run time
    typer.Option("--map", help=f"OpenDRIVE file; default: the shipped {DEFAULT_MAP}.", metavar="FILE.xodr"),
]
At = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(help="Place of the pedestrian's line: ROAD,LANE,S. Default: found by itself."),
]
Impact = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--impact-point",
        help="Euro NCAP impact location in % of the ego's width (25, 50, 75); default: the paper's test.",
    ),
]
ApplyPerformance = Annotated[
    bool,
    typer.Option(
        "--apply-performance",
        help="Keep vehicles within the Performance of their catalog, as esmini does; else it is only said.",
    ),
]
Night = Annotated[
    str,
    typer.Option(help="Sensor in the dark: lidar (sees as by day) or camera (as far as low beam lights)."),
]
PhaseMs = Annotated[
    float,
    typer.Option(min=0, max=50, help="Time of the first sensor frame, steps of 10 ms; shifts all frames."),
]
Seed = Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Seed of the sensor noise.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes; the results are the same for any number.")]
AllWorkers = Annotated[
    Optional[int],  # noqa: UP045
    typer.Option(min=1, help="Processes, default: one per core; the results are the same for any number."),
]
PictureFormat = Annotated[str, typer.Option("--format", help="Pictures as png, svg or pdf.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]


@app.command(epilog=CPNA_EXAMPLES)
def cpna(
    speeds: Speeds = "10..60",
    strategy: Strategy = "rectangular,map",
    preset: PresetName = "paper",
    tracker: TrackerName = "preset",
    detector: DetectorName = "preset",
    weather: WeatherNames = "dry",
    map_file: MapFile = None,
    at: At = None,
    impact_point: Impact = None,
    phase_ms: PhaseMs = 0.0,
    adversaries: Annotated[
        str, typer.Option(help="none, or static: parked cars and standing people.")
    ] = "none",
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder for tables, logs and pictures.")] = Path("results"),
    pictures: Annotated[bool, typer.Option(help="Draw the pictures.")] = True,
    form: PictureFormat = "png",
    workers: Workers = 1,
    quiet: Quiet = False,
) -> None:
    """Car to pedestrian, near side, adult: an adult steps out in front of the ego."""
    from evaluation.arguments import (
        parse_name,
        parse_names,
        parse_place,
        parse_plugged,
        parse_speeds,
        writable_folder,
    )
    from evaluation.runs.folder_lock import locked
    from evaluation.runs.plan import CpnaSuite
    from evaluation.studies.suite import compare_cpna
    from scenarios.places import Place
    from scenarios.presets import PRESETS, WEATHER
    from scenarios.strategies import STRATEGIES

    form = parse_name(form, PICTURE_FORMATS, "--format")
    suite = CpnaSuite(
        speeds_kmh=parse_speeds(speeds),
        strategies=parse_names(strategy, STRATEGIES, "--strategy", own=True),
        preset=parse_name(preset, tuple(PRESETS), "--preset"),
        weather=parse_names(weather, tuple(WEATHER), "--weather"),
        map_name=str(map_file) if map_file else DEFAULT_MAP,
        place=Place(*parse_place(at)) if at is not None else None,
        impact_point_percent=impact_point,
        adversaries=adversaries,
        seed=seed,
        phase_s=phase_ms / 1000,
        settings=parse_plugged(tracker, detector),
    )
    with locked(writable_folder(out)):
        compare_cpna(suite, out, form if pictures else None, workers, quiet)


@app.command(epilog=RUN_EXAMPLES)
def run(
    scenario: Annotated[
        str,
        typer.Argument(help="Scenario or distribution file, or a shipped name.", metavar="FILE.xosc|NAME"),
    ],
    param: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="Value of a parameter of the scenario; may be repeated.", metavar="NAME=VALUE"),
    ] = None,
    no_aeb: Annotated[
        bool, typer.Option("--no-aeb", help="No brake but the scenario's: the unbraked run.")
    ] = False,
    strategy: Strategy = "rectangular,map",
    preset: PresetName = "physical",
    tracker: TrackerName = "preset",
    detector: DetectorName = "preset",
    weather: WeatherNames = "dry",
    hold_speed: Annotated[
        bool,
        typer.Option(
            "--hold-speed", help="As in tests of Euro NCAP: no ACC, and the run ends when the ego stands."
        ),
    ] = False,
    apply_performance: ApplyPerformance = False,
    night: Night = "lidar",
    map_file: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--map",
            help="Map that perception uses; default: the scenario's own, or a street laid over a test track.",
            metavar="FILE.xodr",
        ),
    ] = None,
    phase_ms: PhaseMs = 0.0,
    seed: Seed = 0,
    out: Annotated[Path, typer.Option(help="Folder for tables, logs and pictures.")] = Path("results/run"),
    pictures: Annotated[bool, typer.Option(help="Draw the pictures.")] = True,
    form: PictureFormat = "png",
    workers: AllWorkers = None,
    quiet: Quiet = False,
) -> None:
    """Run an OpenSCENARIO file, or every variation that a file asks for."""
    from evaluation.arguments import (
        available_cores,
        parse_name,
        parse_names,
        parse_parameters,
        parse_plugged,
        writable_folder,
    )
    from evaluation.runs.folder_lock import locked
    from evaluation.runs.plan import Conditions, scenario_specs
    from evaluation.studies.suite import compare_files
    from scenarios.presets import NIGHT, PRESETS, WEATHER
    from scenarios.spec import NO_AEB
    from scenarios.strategies import STRATEGIES

    form = parse_name(form, PICTURE_FORMATS, "--format")
    conditions = Conditions(
        strategies=(NO_AEB,) if no_aeb else parse_names(strategy, STRATEGIES, "--strategy", own=True),
        preset=parse_name(preset, tuple(PRESETS), "--preset"),
        weather=parse_names(weather, tuple(WEATHER), "--weather"),
        map_name=str(map_file) if map_file else None,
        seed=seed,
        phase_s=phase_ms / 1000,
        night=parse_name(night, tuple(NIGHT), "--night"),
        adapts=not hold_speed,
        settings=parse_plugged(tracker, detector),
        apply_performance=apply_performance,
    )
    specs = scenario_specs(scenario, parse_parameters(param or []), conditions)
    processes = workers or available_cores()
    with locked(writable_folder(out)):
        compare_files(specs, out, form if pictures else None, processes, quiet)


@app.command(epilog=NCAP_EXAMPLES)
def ncap(
    files: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Argument(
            help="Folders or files of scenarios; none: the shipped ones.", metavar="[DIR|FILE ...]"
        ),
    ] = None,
    protocol: Annotated[
        str, typer.Option(help="2023, 2026 (Euro NCAP), paper (SmartMOT) or r152 (UN Regulation).")
    ] = "2023",
    strategy: Strategy = "rectangular,map",
    preset: PresetName = "physical",
    tracker: TrackerName = "preset",
    detector: DetectorName = "preset",
    weather: WeatherNames = "dry",
    apply_performance: ApplyPerformance = False,
    night: Night = "lidar",
    phase_ms: PhaseMs = 0.0,
    seed: Seed = 0,
    logs: Annotated[
        bool, typer.Option("--logs", help="Keep the log of every run, for `report` and `replay`.")
    ] = False,
    robustness: Annotated[
        bool, typer.Option(help="2026: run the cells under robustness conditions too.")
    ] = True,
    form: PictureFormat = "png",
    out: Annotated[Path, typer.Option(help="Folder for tables and matrices.")] = Path("results/ncap"),
    workers: AllWorkers = None,
    quiet: Quiet = False,
) -> None:
    """Run every cell of a test protocol, score it, show its matrices."""
    import rich.console

    from evaluation.arguments import available_cores, parse_name, parse_names, parse_plugged, writable_folder
    from evaluation.protocols.registry import PROTOCOLS
    from evaluation.runs.folder_lock import locked
    from evaluation.runs.plan import Conditions
    from evaluation.studies.ncap.run import run_grid
    from scenarios.presets import NIGHT, PRESETS, WEATHER
    from scenarios.strategies import STRATEGIES

    name = parse_name(protocol, tuple(PROTOCOLS), "--protocol")
    conditions = Conditions(
        strategies=parse_names(strategy, STRATEGIES, "--strategy", own=True),
        preset=parse_name(preset, tuple(PRESETS), "--preset"),
        weather=parse_names(weather, tuple(WEATHER), "--weather"),
        seed=seed,
        phase_s=phase_ms / 1000,
        night=parse_name(night, tuple(NIGHT), "--night"),
        adapts=name == "paper",
        settings=parse_plugged(tracker, detector),
        apply_performance=apply_performance,
    )
    console = rich.console.Console(quiet=quiet)
    processes = workers or available_cores()
    picture = parse_name(form, PICTURE_FORMATS, "--format")
    with locked(writable_folder(out)):
        run_grid(
            files or [],
            name,
            conditions,
            out,
            processes,
            console,
            keep_logs=logs,
            form=picture,
            robustness=robustness,
        )


@app.command("list")
def list_command(
    scenario: Annotated[
        Optional[str],  # noqa: UP045
        typer.Argument(help="Only this one, with its parameters.", metavar="[FILE.xosc|NAME]"),
    ] = None,
) -> None:
    """List the shipped scenarios: name, number of runs, description; or one with its parameters."""
    from scenarios.catalogue.library import SHIPPED_SCENARIOS, describe

    for name in SHIPPED_SCENARIOS if scenario is None else (scenario,):
        found = describe(name)
        runs = f"{found.runs} run{'s' if found.runs > 1 else ''}"
        typer.echo(f"{found.name:<20} {runs:>8}  {found.text}")
        if scenario is None:
            typer.echo(f"{'':<31}{', '.join(key for key, _ in found.parameters)}")
        for key, value in found.parameters if scenario is not None else ():
            typer.echo(f"  {key} = {value}")


@app.command(epilog=PLOT_EXAMPLES)
def plot(
    directory: Annotated[Path, typer.Argument(help="Folder that `cpna` or `run` wrote.", metavar="DIR")],
    run: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Log name (column log of runs.csv) for temporal diagram and bird's-eye view."),
    ] = None,
    form: PictureFormat = "png",
    allow_plugins: AllowPlugins = False,
    quiet: Quiet = False,
) -> None:
    """Draw the pictures of a folder of results again, for any of its runs."""
    from evaluation.arguments import parse_name
    from evaluation.studies.suite import draw_again

    form = parse_name(form, PICTURE_FORMATS, "--format")
    written, notes = draw_again(directory, run, form, allow_plugins)
    for note in notes:
        typer.echo(f"smartmot-eval: {one_line(note)}", err=True)
    if not quiet:
        for path in written:
            typer.echo(path)


@app.command(epilog=REPORT_EXAMPLES)
def report(
    directory: Annotated[Path, typer.Argument(help="Folder that a run wrote.", metavar="DIR")],
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Page to write; default: report.html in the folder.", metavar="FILE.html"),
    ] = None,
    allow_plugins: AllowPlugins = False,
    quiet: Quiet = False,
) -> None:
    """Write a folder of results as one HTML page: findings, scores, diagrams, a replay of every run."""
    import rich.progress

    from evaluation.views.page.page import write_page

    with rich.progress.Progress(transient=True, disable=quiet or not sys.stdout.isatty()) as progress:
        task = progress.add_task("reading runs", total=None)
        page, notes = write_page(
            directory,
            out,
            lambda done, total: progress.update(task, completed=done, total=total),
            allow_plugins,
        )
    for note in notes:
        typer.echo(f"smartmot-eval: {one_line(note)}", err=True)
    if not quiet:
        typer.echo(page)


@app.command(epilog=REPLAY_EXAMPLES)
def replay(
    run: Annotated[Path, typer.Argument(help="DIR/NAME of a run, or the path of its log.", metavar="RUN")],
    gif: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Animated GIF to write; default: NAME.gif in DIR.", metavar="FILE.gif"),
    ] = None,
    mp4: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="H.264 film to write; needs ffmpeg.", metavar="FILE.mp4"),
    ] = None,
    fps: Annotated[float, typer.Option(help="Pictures per second, 1 to 50.")] = 20.0,
    speed: Annotated[float, typer.Option(help="1: real time, 0.5: half as fast.")] = 1.0,
    allow_plugins: AllowPlugins = False,
    quiet: Quiet = False,
) -> None:
    """Film a run from above, with what happens in words."""
    import rich.progress

    from evaluation.views.page.replay import replay as film

    with rich.progress.Progress(transient=True, disable=quiet or not sys.stdout.isatty()) as progress:
        task = progress.add_task("drawing", total=None)
        written, notes = film(
            run,
            gif,
            mp4,
            fps,
            speed,
            lambda done, total: progress.update(task, completed=done, total=total),
            allow_plugins,
        )
    for note in notes:
        typer.echo(f"smartmot-eval: {one_line(note)}", err=True)
    if not quiet:
        for path in written:
            typer.echo(path)


@app.command("map", epilog=MAP_EXAMPLES)
def map_command(
    file: Annotated[
        str, typer.Argument(help="OpenDRIVE file, or the name of a shipped map.", metavar="FILE.xodr")
    ],
    at: At = None,
    strategy: Annotated[str, typer.Option(help="Monitored area to draw: rectangular, map or all.")] = "map",
    speed: Annotated[float, typer.Option(min=0, help="Ego speed for the monitored area, km/h.")] = 50.0,
    preset: PresetName = "physical",
    png: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Picture to write; the ending may also be svg or pdf.", metavar="FILE"),
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="List the defects of the map, and stop.")] = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="With --check: exit status 1 if there are any defects.")
    ] = False,
) -> None:
    """Describe a map, and draw it with the monitored area at a pose."""
    from evaluation.arguments import parse_name, parse_place
    from evaluation.runs import plan as runner
    from scenarios.places import Place
    from scenarios.presets import PRESETS
    from scenarios.spec import load_named_map
    from scenarios.strategies import STRATEGIES

    strategy = parse_name(strategy, STRATEGIES, "--strategy")
    preset = parse_name(preset, tuple(PRESETS), "--preset")
    place = Place(*parse_place(at)) if at is not None else None
    network = load_named_map(file)
    if check:
        from opendrive.checks import warning_table

        for line in warning_table(network.warnings):
            typer.echo(line)
        raise typer.Exit(1 if strict and network.warnings else 0)
    site = runner.pose_site(network, place) if place else None
    for line in runner.describe_map(network, site, speed):
        typer.echo(line)
    if png is not None:
        from evaluation.views.pictures import save_map

        save_map(network, png, site, strategy, speed, preset)
        typer.echo(f"picture: {png}")


@app.command(epilog=MOT_EXAMPLES)
def mot(
    directory: Annotated[Path, typer.Argument(help="Recorded detections, and labels if any.", metavar="DIR")],
    form: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option("--format", help="kitti, nuscenes or csv; default: what the files look like."),
    ] = None,
    config: Annotated[
        str,
        typer.Option(
            help="Tracker: default, smartmot, centerpoint, ab3dmot, or your own, package.module:name."
        ),
    ] = "default",
    area: Annotated[
        str, typer.Option("--filter", help="none, or map: only what is on lanes that matter to the ego.")
    ] = "none",
    map_file: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--map", help="OpenDRIVE file: for --filter map and forecasts along lanes.", metavar="FILE"
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for tracks and tables.")] = Path("results/mot"),
    write: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Track files: kitti, csv, nuscenes; default: csv and the format that was read."),
    ] = None,
    similarity: Annotated[
        str, typer.Option(help="distance (2 m) or iou, comma-separated: what makes a match.")
    ] = "distance",
    threshold: Annotated[
        str, typer.Option(help="best: leave out tracks below the score with the best MOTA; none: keep all.")
    ] = "best",
    sequence: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Only these sequences, comma-separated."),
    ] = None,
    gif: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="Film of the first sequence from above, as GIF.", metavar="FILE"),
    ] = None,
    video: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="The same as MP4; needs ffmpeg.", metavar="FILE"),
    ] = None,
    frames: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Frames of the film: 0..200. Default: all."),
    ] = None,
    forecast: Annotated[bool, typer.Option(help="Score forecasts too.")] = True,
    quiet: Quiet = False,
) -> None:
    """Track recorded detections (KITTI, nuScenes, CSV); score the tracks where there are labels."""
    from evaluation.studies.mot.command import MotOptions, run_mot

    run_mot(
        MotOptions(
            directory=directory,
            form=form,
            config=config,
            area=area,
            map_file=map_file,
            out=out,
            write=write,
            similarity=similarity,
            threshold=threshold,
            sequence=sequence,
            gif=gif,
            video=video,
            frames=frames,
            forecast=forecast,
            quiet=quiet,
        )
    )


@app.command(epilog=COMPARE_EXAMPLES)
def compare(
    strategies: Annotated[
        str,
        typer.Option(
            help="Monitored areas to compare, comma-separated: rectangular, map, all, or your own, "
            "package.module:name."
        ),
    ] = "rectangular,map,all",
    vary: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            help="Values of a parameter; may be repeated. Default: margin_m, half_width_m, ego_forecast.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    preset: PresetName = "physical",
    weather: Annotated[
        str, typer.Option(help="dry, wet, rain, snow; several, comma-separated: a table and figure each.")
    ] = "dry",
    scenes: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Only these scenes, comma-separated; see docs/study.md. Default: all."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Every variant of the scenes, and outer maps where there are any.")
    ] = False,
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
    workers: AllWorkers = None,
    quiet: Quiet = False,
) -> None:
    """Compare strategies over scenes: collisions avoided, false activations and unnecessary stops."""
    from evaluation.arguments import available_cores, parse_name, parse_names, parse_vary, writable_folder
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked
    from evaluation.studies.compare.command import CompareOptions
    from evaluation.studies.compare.command import compare as carry_out
    from evaluation.studies.growth import compare_growth
    from scenarios.presets import PRESETS, WEATHER
    from scenarios.scenes.scenes import scene_names
    from scenarios.strategies import STRATEGIES

    if ablation + growth + bool(vary) > 1:
        raise ArgumentError("--vary, --ablation and --growth exclude one another; give one of them")
    chosen = parse_names(strategies, STRATEGIES, "--strategies", own=True)
    preset = parse_name(preset, tuple(PRESETS), "--preset")
    conditions = parse_names(weather, tuple(WEATHER), "--weather")
    formats = parse_names(form, PICTURE_FORMATS, "--format")
    varied = parse_vary(vary or [])
    only = parse_names(scenes, scene_names(), "--scenes") if scenes is not None else ()
    if growth and (only or full or logs or len(conditions) > 1):
        raise ArgumentError("--growth: takes one --weather, and neither --scenes, --full nor --logs")
    processes = workers or available_cores()
    with locked(writable_folder(out)):
        if growth:
            compare_growth(chosen, preset, conditions[0], seeds, processes, out, quiet, formats)
            return
        carry_out(
            CompareOptions(
                strategies=chosen,
                vary=varied,
                preset=preset,
                weather=conditions,
                scenes=only,
                full=full,
                seeds=seeds,
                workers=processes,
                out=out,
                ablation=ablation,
                logs=logs,
                formats=formats,
                quiet=quiet,
            )
        )


@app.command(epilog=REPORTS_EXAMPLES)
def reports(
    out: Annotated[Path, typer.Option(help="Folder of the reference results.")] = Path("reports"),
    only: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(help="Only these parts, comma-separated; default: all.", metavar="NAME,..."),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Make a few runs of each part again; exit status 1 on drift.")
    ] = False,
    workers: AllWorkers = None,
    quiet: Quiet = False,
) -> None:
    """Make all reference results: the paper's table and figures, scenes, ablations, growth."""
    from evaluation.arguments import available_cores, writable_folder
    from evaluation.runs.folder_lock import locked
    from evaluation.studies.reference.command import check_reports, make_reports

    names = [name.strip() for name in only.split(",")] if only else []
    if not check:
        with locked(writable_folder(out)):
            make_reports(out, names, workers or available_cores(), quiet)
        return
    lines = check_reports(out, names)
    for line in lines:
        typer.echo(line, err=True)
    raise typer.Exit(1 if lines else 0)


def main() -> None:
    """Entry point: run the command; one line and status 2 for a mistake of the user, 130 for Ctrl-C."""
    try:
        status = app(standalone_mode=False)
        if status == INTERRUPTED:
            typer.echo("smartmot-eval: interrupted; compare and reports go on if started again", err=True)
        sys.exit(status)
    except BrokenPipeError:
        # who reads the output has ended, as `head` does; what is left of it must not fail at the exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(BROKEN_PIPE)
    except Exception as error:
        message = _message_for_user(error)
        if message is None:
            raise
        if message:
            typer.echo(message, err=True)
        sys.exit(2)


def _message_for_user(error: Exception) -> str | None:
    """What to print for a mistake of the user; None for anything else."""
    if hasattr(error, "format_message"):
        # an error of the option parser, whose classes have moved between typer's versions; without a
        # command it has printed the help already, or its message is the help
        text = str(error.format_message())
        return text if not text or "Usage:" in text else f"smartmot-eval: {text}"
    # the packages of the named errors are loaded only now, when one was raised
    from evaluation.errors import ArgumentError, WorkerError
    from evaluation.protocols.errors import ProtocolError
    from evaluation.results.rows import ResultsError
    from opendrive import OpenDriveError
    from scenarios.errors import DatasetError, ScenarioError
    from smartmot.errors import SmartMotError

    named = (ArgumentError, DatasetError, WorkerError, ProtocolError, ResultsError)
    if isinstance(error, (*named, ScenarioError, SmartMotError, OpenDriveError)):
        return f"smartmot-eval: {one_line(str(error))}"
    if isinstance(error, OSError):
        # a full disk, a limit on files or a folder that has gone, wherever that is noticed
        place = f"{error.filename}: " if error.filename else "output: "
        return one_line(f"smartmot-eval: {place}cannot be read or written ({error.strerror or error})")
    return None


def one_line(text: str) -> str:
    """A text without what would break its line or the terminal, such as parts of a damaged file."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.splitlines()))
