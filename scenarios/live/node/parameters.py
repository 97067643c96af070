"""Parameters of the live node, and the settings that they mean."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from scenarios.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.live.settings import LiveSettings

TEXT, WHOLE, NUMBERS = "a text", "a whole number", "numbers"
NUMBER = "a number"


@dataclass(frozen=True, slots=True)
class NodeParameter:
    """One parameter.

    Args:
        kind: what its value is, one of TEXT, WHOLE, NUMBER, NUMBERS.
        text: what it is.
    """

    kind: str
    text: str


PARAMETERS: Mapping[str, NodeParameter] = MappingProxyType(
    {
        "max_age": NodeParameter(WHOLE, "frames without a match that a track survives"),
        "detection_th": NodeParameter(NUMBER, "detections with a lower score are dropped"),
        "dataset": NodeParameter(TEXT, "whose classes the detections have: any (of both), simbev, nuscenes"),
        "map": NodeParameter(TEXT, "OpenDRIVE file or Argoverse 2 map, in the frame of the odometry"),
        "preset": NodeParameter(TEXT, "brakes, areas and tracker: paper, physical, real"),
        "strategy": NodeParameter(
            TEXT, "monitored area: path, rectangular, all, map (the default where there is one), or your own"
        ),
        "rule": NodeParameter(TEXT, "brake rule: paper, cascade, ... (docs/rules.md), or your own"),
        "velocity_frame": NodeParameter(TEXT, "axes of the detector's velocities: ignore, sensor, world"),
        "output_frame": NodeParameter(TEXT, "frame of what is published: map, sensor"),
        "vehicle": NodeParameter(
            NUMBERS, "length, width, and how far its middle is ahead of the frame's origin, m"
        ),
        "sensor_pose": NodeParameter(
            NUMBERS, "x, y, z (m) and yaw (rad) of the sensor on the vehicle; default: as the transforms say"
        ),
        "detectors": NodeParameter(
            TEXT, "file with topic, profile, delay and trust of each of several detectors (docs/ros.md)"
        ),
        "map_frame": NodeParameter(TEXT, "frame of the poses where transforms alone have them"),
        "base_frame": NodeParameter(TEXT, "the vehicle's frame where transforms alone have it"),
    }
)
"""By name; without a value those of `LiveSettings` hold."""


def live_settings(given: Mapping[str, object]) -> tuple[LiveSettings, Path | None]:
    """Settings, and the file of the map.

    Args:
        given: values by name; a text of length 0 stands for none.

    Raises:
        ScenarioError, DatasetError, smartmot.errors.SmartMotError: a name is unknown, or a value is none of
            its kind or out of range.
    """
    from scenarios.live.detectors import read_detectors
    from scenarios.live.settings import LiveSettings
    from scenarios.recorded.vehicles import Vehicle

    values = {name: _value(name, value) for name, value in given.items() if value != ""}
    map_file = values.pop("map", None)
    if "vehicle" in values:
        values["vehicle"] = Vehicle(*_of_length("vehicle", values["vehicle"], (2, 3)))
    if "sensor_pose" in values:
        values["sensor_pose"] = _of_length("sensor_pose", values["sensor_pose"], (4,))
    if "detectors" in values:
        values["detectors"] = read_detectors(Path(values["detectors"]))
    return LiveSettings(**values), None if map_file is None else Path(map_file)


def _value(name: str, value: object) -> Any:
    """The value in the type of Python that is meant; whole numbers are numbers too."""
    parameter = PARAMETERS.get(name)
    if parameter is None:
        raise ScenarioError(f"unknown parameter {name!r}; use one of: {', '.join(PARAMETERS)}")
    if parameter.kind == TEXT and isinstance(value, str):
        return value
    if parameter.kind == WHOLE and isinstance(value, int) and not isinstance(value, bool):
        return value
    if parameter.kind == NUMBER and _is_number(value):
        return value
    if parameter.kind == NUMBERS and isinstance(value, list | tuple) and all(map(_is_number, value)):
        return tuple(map(float, value))
    raise ScenarioError(f"{name}: expected {parameter.kind}, got {value!r}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _of_length(name: str, numbers: tuple[float, ...], lengths: tuple[int, ...]) -> Any:
    if len(numbers) not in lengths:
        expected = " or ".join(map(str, lengths))
        raise ScenarioError(f"{name}: expected {expected} numbers, got {len(numbers)}")
    return numbers
