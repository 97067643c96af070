"""Options that several commands share, and what is typed after an option turned into values.

Every mistake becomes an `ArgumentError` of one line, which names the option and what to write instead.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from scenarios.parameter import Parameter
    from scenarios.places import Place
    from scenarios.recorded.formats import Reading
    from scenarios.settings import Setting, Settings

PICTURE_FORMATS = ("png", "svg", "pdf")
DEFAULT_SPEED_STEP_KMH = 10.0
MAX_SPEEDS = 200
"""Of one call: 200 speeds are a run of minutes, more are a mistake."""
MAX_VALUES = 100
"""Of one parameter of `--vary`."""

OUT = "Folder for tables, logs and pictures."

StrategyNames = Annotated[
    str,
    typer.Option(
        help="Monitored areas to compare, comma-separated: rectangular, map, all, path, adaptive, or your "
        "own, package.module:name."
    ),
]
TrackerName = Annotated[
    str,
    typer.Option(
        help="preset, ab3dmot, centerpoint, default, imm, smartmot, ukf, or your own, package.module:name.",
        metavar="NAME",
    ),
]
RuleName = Annotated[
    str,
    typer.Option(
        help="Brake rule: paper, cascade, cascade_gentle, required_deceleration, last_point_to_brake, rss, "
        "autoware, autoware_readme, r157, or your own, package.module:name.",
        metavar="NAME",
    ),
]
DetectorName = Annotated[str, typer.Option(help="preset, or your own, package.module:name.", metavar="NAME")]
LIDAR = "LiDAR"
"""Heading of the options of a LiDAR; docs/lidar.md, In the loop."""

SensorName = Annotated[
    str,
    typer.Option(
        help="truth (boxes of the ground truth with the preset's errors), or a LiDAR: hdl32, hdl64, mid70.",
        metavar="NAME",
        rich_help_panel=LIDAR,
    ),
]
PerceptionName = Annotated[
    str | None,
    typer.Option(
        help="What makes detections of the LiDAR's clouds: classical, plain, a network (FILE.onnx), cutout "
        "(boxes around points that truth cuts out), labels (true boxes of all who have a point), or your "
        "own, package.module:name; all: list --perceptions. Default: the first.",
        metavar="NAME",
        rich_help_panel=LIDAR,
    ),
]
StreetName = Annotated[
    str | None,
    typer.Option(
        help="bare, or furnished: kerbs, posts, signs, trees, bins, walls and parked cars along the map, "
        "which a LiDAR alone sees. Default: bare.",
        metavar="NAME",
        rich_help_panel=LIDAR,
    ),
]
StreetDensity = Annotated[
    float | None,
    typer.Option(
        "--street-density",
        help="Pieces of furniture per 100 m of each side of a road. Default: 8.",
        rich_help_panel=LIDAR,
    ),
]
StreetSeed = Annotated[
    int | None,
    typer.Option("--street-seed", min=0, help="Of what stands where. Default: 0.", rich_help_panel=LIDAR),
]
AllowPlugins = Annotated[
    bool,
    typer.Option(
        "--allow-plugins",
        help="Run code of your own (package.module:name) that made monitored areas, to draw them again.",
    ),
]
PresetName = Annotated[
    str,
    typer.Option(
        help="paper: the SmartMOT paper's conditions; physical: brakes and sensor of a real car; real: the "
        "same with the measured errors of a detector."
    ),
]
WeatherNames = Annotated[
    str, typer.Option(help="dry, wet, rain, snow; several, comma-separated: the score is their mean.")
]
At = Annotated[
    str | None, typer.Option(help="Place of the pedestrian's line: ROAD,LANE,S. Default: found by itself.")
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
Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Processes, default: one per core; the results are the same for any number."),
]
Pictures = Annotated[bool, typer.Option(help="Draw the pictures.")]
PictureFormat = Annotated[str, typer.Option("--format", help="Pictures as png, svg or pdf.")]
Mcap = Annotated[
    bool,
    typer.Option(
        "--mcap", help="Every run as mcap/NAME.mcap too, for Foxglove, Lichtblick and rerun: docs/mcap.md."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no table.")]
GATE = "Gate"
"""Heading of the options that make results fail; docs/gates.md."""

FailOn = Annotated[
    str | None,
    typer.Option(
        "--fail-on",
        help="Exit with status 3 if one of these rules is met, such as 'contacts>0,false_activations>0' or "
        "'map/score<9': docs/gates.md.",
        metavar="RULES",
        rich_help_panel=GATE,
    ),
]
Junit = Annotated[
    Path | None,
    typer.Option(
        help="The rules of --fail-on as JUnit XML, for a CI.", metavar="FILE.xml", rich_help_panel=GATE
    ),
]


ColumnPairs = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="What a table's columns hold: pairs of our name (with unit) and the table's, comma-separated, "
        "such as x_m=xCenter,yaw_deg=heading; docs/formats.md.",
        metavar="OURS=THEIRS,...",
    ),
]
FrameRate = Annotated[
    float | None,
    typer.Option("--frame-rate", help="Frames per second of a table with frame numbers.", metavar="HZ"),
]
BagTopic = Annotated[
    str | None,
    typer.Option(help="Of a ROS bag: topic of the boxes. Default: the only one.", metavar="TOPIC"),
]
BagOdometry = Annotated[
    str | None,
    typer.Option(help="Of a ROS bag: topic of the odometry. Default: the only one.", metavar="TOPIC"),
]
VelocityFrame = Annotated[
    str | None,
    typer.Option(
        help="Of a ROS bag: axes of the detector's velocities: sensor, world or ignore. Default: ignore.",
        metavar="AXES",
    ),
]


def source_reading(
    pairs: str | None,
    frame_rate_hz: float | None,
    topic: str | None = None,
    odometry: str | None = None,
    velocity_frame: str | None = None,
) -> Reading | None:
    """What options say of a table (`--columns`, `--frame-rate`) or a bag (the others); None: nothing.

    Raises:
        ArgumentError: they are for both.
        DatasetError: A pair is none, or its left side is no name of ours; or axes are unknown.
    """
    from scenarios.recorded.bags.reader import BagReading
    from scenarios.recorded.tables.columns import Columns

    of_table = pairs is not None or frame_rate_hz is not None
    if topic is None and odometry is None and velocity_frame is None:
        return Columns.parse(pairs, frame_rate_hz) if of_table else None
    if of_table:
        raise ArgumentError(
            "--columns and --frame-rate are for tables; --topic, --odometry and --velocity-frame for ROS bags"
        )
    return BagReading(topic, odometry, velocity_frame or "ignore")


def examples(*paragraphs: str) -> str:
    """The end of a command's help, as Markdown."""
    return "\n\n".join(("**Examples**", *paragraphs))


def parse_names(text: str, allowed: Sequence[str], option: str, own: bool = False) -> tuple[str, ...]:
    """Comma-separated names, each once, in the order given.

    Args:
        text: what was typed.
        allowed: possible names.
        option: where, for the message.
        own: whether `package.module:name` of the user's own is possible as well.

    Raises:
        ArgumentError: a name is not allowed, or there is none.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        _require(name, allowed, option, own, "one or more of")
    if not names:
        raise ArgumentError(f"{option}: nothing given; use one or more of: {', '.join(allowed)}")
    return tuple(dict.fromkeys(names))


def parse_name(text: str, allowed: Sequence[str], option: str, own: bool = False) -> str:
    """A single name; see `parse_names`."""
    name = text.strip()
    _require(name, allowed, option, own, "one of")
    return name


def _require(name: str, allowed: Sequence[str], option: str, own: bool, choice: str) -> None:
    if name not in allowed and not (own and ":" in name):
        from smartmot.errors import suggestion

        more = " or package.module:name" if own else ""
        close = suggestion(name, allowed)
        raise ArgumentError(f"{option}: unknown {name!r}{close}; use {choice}: {', '.join(allowed)}{more}")


def parse_strategies(text: str, option: str = "--strategy") -> tuple[str, ...]:
    """Monitored areas; see `parse_names`."""
    from scenarios.strategies import STRATEGIES

    return parse_names(text, STRATEGIES, option, own=True)


def parse_preset(text: str) -> str:
    """A preset; see `parse_names`."""
    from scenarios.presets import PRESETS

    return parse_name(text, tuple(PRESETS), "--preset")


def parse_weather(text: str) -> tuple[str, ...]:
    """Weather conditions; see `parse_names`."""
    from scenarios.weather import WEATHER

    return parse_names(text, tuple(WEATHER), "--weather")


def parse_night(text: str) -> str:
    """How the sensor takes the night; see `parse_names`."""
    from scenarios.weather import NIGHT

    return parse_name(text, tuple(NIGHT), "--night")


def parse_format(text: str) -> str:
    """The format of pictures; see `parse_names`."""
    return parse_name(text, PICTURE_FORMATS, "--format")


def parse_speeds(text: str) -> tuple[float, ...]:
    """Speeds in km/h: `10..60` (step 10), `10..60:5`, `30,50`, or any of these joined by commas.

    Raises:
        ArgumentError: not of that form, not positive, or too many.
    """
    form = "use 10..60, 10..60:5 or 30,50"
    speeds: list[float] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([^.\s:]+(?:\.\d+)?)\s*(?:\.\.\s*([^:\s]+)\s*(?::\s*(\S+)\s*)?)?", part)
        if match is None:
            raise ArgumentError(f"--speeds: cannot read {part.strip()!r} in {text!r}; {form}")
        try:
            low = float(match[1])
            high = low if match[2] is None else float(match[2])
            step = DEFAULT_SPEED_STEP_KMH if match[3] is None else float(match[3])
        except ValueError:
            raise ArgumentError(f"--speeds: {part.strip()!r} is not a number or a range; {form}") from None
        if not all(map(math.isfinite, (low, high, step))) or low <= 0 or step <= 0 or high < low:
            raise ArgumentError(
                f"--speeds: {part.strip()!r} must be positive and rise from low to high; {form}"
            )
        if len(speeds) + (high - low) / step + 1 > MAX_SPEEDS + 1e-9:
            raise ArgumentError(
                f"--speeds: {part.strip()!r} gives over {MAX_SPEEDS} speeds; use a larger step"
            )
        speeds += _range(low, high, step)
    return tuple(sorted(set(speeds)))


def _range_length(low: float, high: float, step: float) -> int:
    # a step in tenths has no exact binary form; the last value must not get lost
    return math.floor((high - low) / step + 1e-9) + 1


def _range(low: float, high: float, step: float) -> list[float]:
    """The values from low to high, both included."""
    return [round(low + k * step, 9) for k in range(_range_length(low, high, step))]


def parse_place(text: str | None) -> Place | None:
    """`ROAD,LANE,S`: id of the road, id of the lane, road coordinate in metres; None if none is given.

    Raises:
        ArgumentError: not of that form.
    """
    from scenarios.places import Place

    if text is None:
        return None
    try:
        road, lane, s = (part.strip() for part in text.rsplit(",", 2))
        place = Place(road, int(lane), float(s))
    except ValueError:
        place = None
    if place is None or not math.isfinite(place.s_m):
        raise ArgumentError(f"--at: expected ROAD,LANE,S such as 1,-1,250.0; got {text!r}")
    return place


def parse_parameters(texts: Sequence[str]) -> dict[str, str]:
    """`NAME=VALUE` each, as values by name.

    Raises:
        ArgumentError: not of that form, or a name twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().removeprefix("$")
        if not equals or not name:
            raise ArgumentError(f"--param: expected NAME=VALUE such as Ego_speed_kmh=50, got {text!r}")
        if name in values:
            raise ArgumentError(f"--param: {name} is given twice; give it once")
        values[name] = value.strip()
    return values


def parse_vary(texts: Sequence[str]) -> dict[str, tuple[Setting, ...]]:
    """`NAME=VALUES` each: names, numbers joined by commas, or ranges `0..4:0.5`.

    Raises:
        ArgumentError: not of that form, an unknown parameter or name, or a parameter twice.
        smartmot.errors.ConfigError: see `_chosen`.
    """
    from scenarios.settings import PARAMETERS

    varied: dict[str, tuple[Setting, ...]] = {}
    for text in texts:
        name, equals, values = (part.strip() for part in text.partition("="))
        if name not in PARAMETERS or not equals:
            from smartmot.errors import suggestion

            close = suggestion(name, PARAMETERS) if name not in PARAMETERS else ""
            raise ArgumentError(
                f"--vary: expected NAME=VALUES with one of {', '.join(PARAMETERS)}; got {text!r}{close}"
            )
        if name in varied:
            raise ArgumentError(f"--vary: {name} is given twice; give all its values at once")
        parameter = PARAMETERS[name]
        settings: list[Setting] = []
        for part in (part.strip() for part in values.split(",")):
            if parameter.choices and not (parameter.numeric and part not in parameter.choices):
                settings.append(_chosen(part, parameter, f"--vary {name}"))
            else:
                settings += _numbers(name, part)
        varied[name] = tuple(dict.fromkeys(settings))
    return varied


def _chosen(text: str, parameter: Parameter, option: str) -> str:
    """One of the names of a parameter, or a file; an earlier name stays as it is typed.

    Raises:
        ArgumentError: an unknown name.
        smartmot.errors.ConfigError: a file is missing, or not what it should be.
    """
    text = text.strip()
    if text in parameter.old or parameter.is_file(text):
        return parameter.known_as(text)
    return parse_name(text, parameter.names, option, own=parameter.own)


def _numbers(name: str, text: str) -> list[float]:
    """A number, or a range LOW..HIGH:STEP."""
    form = f"--vary {name}: cannot read {text!r}; use 1.8, 0,1,2 or 0..4:0.5"
    match = re.fullmatch(r"(.+?)(?:\.\.(.+?):(.+))?", text)
    try:
        numbers = [float(group) for group in match.groups() if group is not None] if match else []
    except ValueError:
        raise ArgumentError(form) from None
    if not numbers or not all(map(math.isfinite, numbers)):
        raise ArgumentError(form)
    if len(numbers) == 1:
        return numbers
    low, high, step = numbers
    if step <= 0 or high < low:
        raise ArgumentError(form)
    count = _range_length(low, high, step)
    if count > MAX_VALUES:
        raise ArgumentError(f"--vary {name}: {text!r} gives {count} values; use at most {MAX_VALUES}")
    return _range(low, high, step)


def parse_plugged(**typed: str) -> Settings:
    """The options `--tracker`, `--detector` and `--rule` as settings; what the preset has anyway is none.

    Args:
        typed: the names by option.

    Raises:
        ArgumentError: an unknown name.
    """
    from scenarios.settings import PARAMETERS

    chosen = {name: _chosen(text, PARAMETERS[name], f"--{name}") for name, text in typed.items()}
    # the first choice stands for what the preset has
    return tuple((name, value) for name, value in chosen.items() if value != PARAMETERS[name].choices[0])


def parse_lidar(
    sensor: str,
    perception: str | None,
    street: str | None,
    density: float | None,
    seed: int | None,
    varied: Collection[str] = (),
) -> Settings:
    """The options of a LiDAR as settings.

    Args:
        sensor: name of the sensor.
        perception: name of what makes detections.
        street: name of the street.
        density: of its furniture.
        seed: of the street.
        varied: parameters that `--vary` sets.

    Raises:
        ArgumentError: an unknown name, or an option without what it belongs to.
        smartmot.errors.ConfigError: a network is missing or damaged, or cannot be run.
    """
    from scenarios.sensing import TRUTH
    from scenarios.settings import PARAMETERS

    typed = {"perception": perception, "street": street, "street_density": density, "street_seed": seed}
    given: dict[str, str | float] = {name: value for name, value in typed.items() if value is not None}
    sensor = parse_name(sensor, PARAMETERS["sensor"].choices, "--sensor")
    for name in given.keys() & {"perception", "street"}:
        given[name] = _chosen(str(given[name]), PARAMETERS[name], f"--{name}")
    if given and sensor == TRUTH and "sensor" not in varied:
        raise ArgumentError(
            f"--{next(iter(given)).replace('_', '-')}: for a LiDAR; add --sensor hdl32, hdl64 or mid70"
        )
    if given.get("street", "bare") == "bare" and "street" not in varied:
        for name in given.keys() & {"street_density", "street_seed"}:
            raise ArgumentError(f"--{name.replace('_', '-')}: add --street furnished")
    if sensor != TRUTH:
        given = {"sensor": sensor, **given}
    for name in given:
        if name in varied:
            raise ArgumentError(f"--{name.replace('_', '-')}: --vary {name} gives its values; leave one out")
    return tuple((name, float(v) if isinstance(v, int) else v) for name, v in given.items())
