"""Several detectors of one stream: a file that says topic, profile, place and quality of service of each."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scenarios.errors import ScenarioError
from scenarios.ros.definitions import DETECTION_3D_ARRAY
from scenarios.ros.messages import DETECTION_TYPES, VELOCITY_FRAMES
from smartmot.errors import ConfigError
from smartmot.tracking.profile import DetectorProfile

_PROFILE_KEYS = ("rate_hz", "delay_s", "trust")
_KEYS = (
    *("topic", "type", "profile"),
    *_PROFILE_KEYS,
    *("sensor_pose", "velocity_frame", "dataset", "reliable", "depth"),
)


@dataclass(frozen=True, slots=True)
class LiveDetector:
    """One of several detectors.

    Args:
        name: by which it is counted.
        topic: of its boxes.
        type_name: of its messages, one of `DETECTION_TYPES`.
        profile: rate, delay, trust, scale of its scores and noise; None: nothing is known, scores are
            estimated as they come.
        sensor_pose: x, y, z (m) and yaw (rad) of its sensor in the vehicle's frame; None: as the transforms
            say.
        velocity_frame: axes of its velocities, one of `VELOCITY_FRAMES`.
        dataset: whose classes its boxes have; None: that of the settings.
        reliable: whether the live node asks the sender to send again what was lost.
        depth: so many messages are kept by the live node until they are taken.

    Raises:
        ScenarioError: a value is unknown or out of range.
    """

    name: str
    topic: str
    type_name: str = DETECTION_3D_ARRAY
    profile: DetectorProfile | None = None
    sensor_pose: tuple[float, float, float, float] | None = None
    velocity_frame: str = "ignore"
    dataset: str | None = None
    reliable: bool = False
    depth: int = 10

    def __post_init__(self) -> None:
        for key, allowed in (("type_name", DETECTION_TYPES), ("velocity_frame", VELOCITY_FRAMES)):
            if getattr(self, key) not in allowed:
                raise ScenarioError(
                    f"{key.removesuffix('_name')}: unknown {getattr(self, key)!r}; use one of: "
                    f"{', '.join(allowed)}"
                )
        if not self.topic.startswith("/") or self.topic != self.topic.rstrip("/"):
            raise ScenarioError(f"topic: expected a name that begins with /, got {self.topic!r}")
        if self.depth < 1:
            raise ScenarioError(f"depth: expected a number of messages from 1 on, got {self.depth}")


def own_frame(detector: LiveDetector) -> str:
    """Frame of a sensor whose place is given, whatever its headers say; no frame of ROS has such a name."""
    return f"{detector.name} (sensor_pose)"


def read_detectors(path: Path) -> tuple[LiveDetector, ...]:
    """Detectors of a TOML file, a table each; docs/ros.md has the keys.

    Args:
        path: the file; profiles that it names lie beside it.

    Raises:
        ScenarioError: the file is missing or no TOML, a key is unknown, missing or has a wrong value, or two
            detectors share a topic; the message names file, detector and key.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: {error.strerror or error}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ScenarioError(f"{path}: no TOML ({error})") from None
    if not tables:
        raise ScenarioError(f'{path}: no detectors; a table each, as [lidar] with topic = "/lidar/boxes"')
    detectors: list[LiveDetector] = []
    for name, keys in tables.items():
        where = f"{path}, [{name}]"
        if not isinstance(keys, dict):
            raise ScenarioError(f"{path}: {name} stands in no table of a detector; begin with [NAME]")
        try:
            detectors.append(_detector(name, keys, path.parent))
        except (ScenarioError, ConfigError) as error:
            raise ScenarioError(f"{where}: {error}") from None
        same = [each.name for each in detectors[:-1] if each.topic == detectors[-1].topic]
        if same:
            raise ScenarioError(f"{where}: topic {detectors[-1].topic} is that of {same[0]} too")
    return tuple(detectors)


def _detector(name: str, keys: dict[str, Any], folder: Path) -> LiveDetector:
    """A detector of its table."""
    unknown = [key for key in keys if key not in _KEYS]
    if unknown:
        raise ScenarioError(f"unknown key {unknown[0]!r}; use: {', '.join(_KEYS)}")
    if "topic" not in keys:
        raise ScenarioError('topic is missing; give that of its boxes, as topic = "/lidar/boxes"')
    values: dict[str, Any] = {"name": name, "profile": _profile(name, keys, folder)}
    for key in ("topic", "type", "velocity_frame", "dataset"):
        if key in keys:
            values["type_name" if key == "type" else key] = _of_kind(key, keys[key], str, "a text")
    kind = values.get("type_name", "")
    if kind.count("/") == 1:  # as ros2 topic list once showed types, and as people write them
        values["type_name"] = kind.replace("/", "/msg/")
    if "reliable" in keys:
        values["reliable"] = _of_kind("reliable", keys["reliable"], bool, "true or false")
    if "depth" in keys:
        values["depth"] = _of_kind("depth", keys["depth"], int, "a whole number")
    if "sensor_pose" in keys:
        pose = keys["sensor_pose"]
        if not (isinstance(pose, list) and len(pose) == 4 and all(map(_is_number, pose))):
            raise ScenarioError(f"sensor_pose: expected [x, y, z, yaw] in m and rad, got {pose!r}")
        values["sensor_pose"] = tuple(map(float, pose))
    return LiveDetector(**values)


def _profile(name: str, keys: dict[str, Any], folder: Path) -> DetectorProfile | None:
    """The profile that a table names, with what it says besides; None: it says nothing."""
    own = {key: keys[key] for key in _PROFILE_KEYS if key in keys}
    if "profile" in keys:
        file = folder / _of_kind("profile", keys["profile"], str, "the name of a file")
        return replace(DetectorProfile.load(file), **own)
    if not own:
        return None
    if "rate_hz" not in own:
        raise ScenarioError(f"{next(iter(own))} needs rate_hz, or a profile (mot DIR --profile FILE)")
    return DetectorProfile(name, **own)


def _of_kind(key: str, value: object, kind: type, text: str) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise ScenarioError(f"{key}: expected {text}, got {value!r}")
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
