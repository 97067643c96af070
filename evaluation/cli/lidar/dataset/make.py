"""`smartmot-eval lidar dataset make`: labelled clouds for training, without recording anything."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import For, Without, refuse_idle
from evaluation.cli.output import counting
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from evaluation.studies.datasets.compose import Composer
    from evaluation.studies.datasets.make import FrameMaker
    from evaluation.studies.datasets.scenarios import ScenarioFrames
    from evaluation.studies.datasets.streets import Streets
    from scenarios.sensors.lidar import LidarConfig

EXAMPLES = options.examples(
    "`smartmot-eval lidar dataset make --sensor hdl64 --frames 1000 --out data` draws streets and their road "
    "users, casts a LiDAR, and writes KITTI's tree.",
    "`smartmot-eval lidar dataset make --sensor mid70 --frames 400 --layout nuscenes --min-points 5`",
    "`smartmot-eval lidar dataset make --from crops --crops data --flip --scale 0.1 --out composed`",
    "What is in it: docs/datasets.md.",
)

SOURCES = ("scenes", "crops")
CROPS = "Of --from crops"
EFFECTS = (
    For(("maps", "scenario"), "source", ("scenes",)),
    For(("crops", "background", "flip", "scale", "noise", "turn"), "source", ("crops",)),
    Without(("maps",), "scenario"),
)
HIGHEST_M = 5.0
"""Of a sensor on a vehicle: a truck's roof is at 4 m."""


def command(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Option(
            "--from",
            help="scenes: simulated streets drawn at random; crops: road users cut out and placed anew.",
            metavar="NAME",
        ),
    ] = "scenes",
    sensor: Annotated[str, typer.Option(help="hdl32, hdl64 or mid70.", metavar="NAME")] = "hdl32",
    frames: Annotated[int, typer.Option(min=1, max=1_000_000, help="Frames in all splits together.")] = 1000,
    layout: Annotated[str, typer.Option(help="kitti, nuscenes or simbev.", metavar="NAME")] = "kitti",
    min_points: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Labels with fewer points in their box are left out.")
    ] = 1,
    height: Annotated[
        float | None, typer.Option(help="Of the sensor over the ground, m. Default: 1.73, that of KITTI's.")
    ] = None,
    maps: Annotated[
        list[Path] | None,
        typer.Option(
            "--map", help="OpenDRIVE file, again for more. Default: the shipped maps.", metavar="FILE"
        ),
    ] = None,
    crops: Annotated[
        Path | None,
        typer.Option(
            help="Data set whose road users are cut out. Default: simulated ones, each recorded alone.",
            metavar="DIR",
            rich_help_panel=CROPS,
        ),
    ] = None,
    background: Annotated[
        Path | None,
        typer.Option(
            help="Data set into whose frames they are pasted. Default: an empty floor.",
            metavar="DIR",
            rich_help_panel=CROPS,
        ),
    ] = None,
    flip: Annotated[bool, typer.Option("--flip", help="Mirror half of them.", rich_help_panel=CROPS)] = False,
    scale: Annotated[
        float | None,
        typer.Option(min=0.0, max=0.5, help="Change sizes by up to this share.", rich_help_panel=CROPS),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Move points along their rays, standard deviation in m.",
            rich_help_panel=CROPS,
        ),
    ] = None,
    turn: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=180.0,
            help="Turn them by up to so many degrees against the line of sight. Default: 30.",
            rich_help_panel=CROPS,
        ),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            help="Of --from scenes: shipped scenarios or files, comma-separated, run unbraked on furnished "
            "streets, in place of streets drawn at random.",
            metavar="NAMES",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the data set.")] = Path("results/dataset"),
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Of all that is drawn.")] = 1,
    workers: options.Workers = None,
    quiet: options.Quiet = False,
) -> None:
    """Make a data set of labelled clouds, split by scene into train, val and test."""
    import rich.console

    from evaluation.runs.workers import available_cores
    from evaluation.studies.datasets.layouts import LAYOUTS
    from evaluation.studies.datasets.make import Recipe, make_dataset

    source = options.parse_name(source, SOURCES, "--from")
    refuse_idle(context, EFFECTS)
    layout = options.parse_name(layout, tuple(LAYOUTS), "--layout")
    config = parse_sensor(sensor, height)
    typed: dict[str, Any] = {
        name: value
        for name, value in (
            *(("crops", crops), ("background", background), ("flip", flip or None)),
            *(("scale", scale), ("noise", noise), ("turn", turn)),
        )
        if value is not None
    }
    if source == "crops":
        maker: FrameMaker = parse_composer(config, seed, **typed)
    else:
        maker = parse_streets(config, maps, seed) if scenario is None else parse_runs(config, scenario, seed)
    values = {name: value.name if isinstance(value, Path) else value for name, value in typed.items()}
    values |= {"from": source, "sensor": sensor}
    if scenario is not None:
        values["scenario"] = [Path(name).name for name in scenario.split(",")]
    if maps:
        values["map"] = [path.name for path in maps]
    recipe = Recipe(maker, layout, frames, seed, min_points, values)
    with counting("making", quiet) as done:
        made = make_dataset(recipe, out, workers or available_cores(), done)
    console = rich.console.Console(quiet=quiet)
    splits = ", ".join(f"{name} {count}" for name, count in made.frames.items())
    labels = ", ".join(f"{name} {count}" for name, count in made.labels.items()) or "none"
    few = "no point" if min_points == 1 else f"fewer than {min_points} points"
    lines = [f"frames: {splits}", f"labels: {labels}"]
    if made.hidden:
        lines.append(f"left out: {made.hidden} labels with {few} in their box")
    for line in (*lines, f"written to {out}"):
        console.print(line, highlight=False, soft_wrap=True, markup=False)


def parse_sensor(name: str, height_m: float | None) -> LidarConfig:
    """The LiDAR on its mount.

    Raises:
        ArgumentError: an unknown name, or a height that no vehicle has.
    """
    from dataclasses import replace

    from scenarios.sensors.lidar import SENSORS, Mount

    config = SENSORS[options.parse_name(name, tuple(SENSORS), "--sensor")]
    if height_m is None:
        return config
    if not 0.1 <= height_m <= HIGHEST_M:
        raise ArgumentError(f"--height: expected 0.1 to {HIGHEST_M:g} m, got {height_m:g}")
    return replace(config, mount=Mount(height_m))


def parse_streets(config: LidarConfig, maps: list[Path] | None, seed: int) -> Streets:
    """Streets on maps."""
    from evaluation.studies.datasets.streets import Streets
    from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map

    return Streets(tuple(maps or map(shipped_map, SHIPPED_MAPS)), config, seed)


def parse_runs(config: LidarConfig, scenarios: str, seed: int) -> ScenarioFrames:
    """Runs of scenarios.

    Raises:
        ArgumentError: none is named.
        scenarios.openscenario.errors.OpenScenarioError: one cannot be read.
    """
    from evaluation.studies.datasets.scenarios import ScenarioFrames, unbraked_runs

    names = tuple(name.strip() for name in scenarios.split(",") if name.strip())
    if not names:
        raise ArgumentError("--scenario: nothing given; name scenarios or files")
    return ScenarioFrames(unbraked_runs(names), config, seed)


def parse_composer(
    config: LidarConfig,
    seed: int,
    *,
    crops: Path | None = None,
    background: Path | None = None,
    flip: bool = False,
    scale: float = 0.0,
    noise: float = 0.0,
    turn: float = 30.0,
) -> Composer:
    """The composer of cut-out road users.

    Raises:
        ArgumentError: the sensor of a data set is at another height.
    """
    import math

    from evaluation.studies.datasets.compose import Composer
    from evaluation.studies.datasets.make import DATASET_JSON
    from evaluation.studies.datasets.reading import dataset_values

    if background is not None:
        height = dataset_values(background, DATASET_JSON).get("sensor_height_m", config.mount.height_m)
        if height != config.mount.height_m:
            raise ArgumentError(f"--background: its sensor is at {height} m; add --height {height}")
    return Composer(config, seed, crops, background, flip, scale, noise, math.radians(turn))
