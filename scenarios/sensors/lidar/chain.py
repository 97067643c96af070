"""A LiDAR in the closed loop: its sensor, and what makes boxes of its clouds."""

from __future__ import annotations

import math
import re
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.interfaces import Detector, SensorChain
from scenarios.sensors.lidar.config import LidarConfig, lidar_config
from scenarios.sensors.lidar.cutout import CutoutDetector, LabelDetector, LabelledCloud
from scenarios.sensors.lidar.measurement import LidarMeasurement
from scenarios.sensors.lidar.patterns import Spinning
from scenarios.sensors.lidar.sensor import LidarSensor
from scenarios.sensors.lidar.street import Street
from scenarios.sensors.world import MapSurface, World, reversed_course
from smartmot.area import MonitoredArea
from smartmot.arrays import BoolArray, FloatArray
from smartmot.errors import ConfigError, PluginError
from smartmot.lidar import METHODS, ClassicalConfig, DetectorConfig, LearnedConfig, detect
from smartmot.lidar.learned import SHIPPED, shipped_network, shipped_path
from smartmot.lidar.monitored import points_on
from smartmot.plugins import Plugin, is_plugin, require
from smartmot.types import Detections, EgoState

OF_TRUTH: dict[str, type[CutoutDetector] | type[LabelDetector]] = {
    "cutout": CutoutDetector,
    "labels": LabelDetector,
}
"""Perceptions that know who is under each point: bounds of what a detector can reach."""

UNSCORED = {f"{name}_unscored": name for name in sorted(METHODS) if name != "plain"}
"""Detectors whose boxes all have score 1, and which they are: `plain` has no other scores."""

MONITORED = {f"{name}_monitored": name for name in sorted(METHODS) if name != "plain"}
"""Detectors that are given the points on the monitored area alone, and which they are."""

PERCEPTIONS = (*sorted(METHODS), *UNSCORED, *MONITORED, *OF_TRUTH)
"""Names of perceptions; the first is that of a LiDAR unless another is asked for."""

AreaAt = Callable[[float], tuple[MonitoredArea, EgoState]]

DEFAULT_PERCEPTION = PERCEPTIONS[0]

NETWORK_FORM = "FILE.onnx"
"""How a network is named, unless it is shipped and has a name; with `_monitored` behind it, it gets the
points on the monitored area alone."""

_NETWORK_NAME = re.compile(rf"(.+\.onnx|{'|'.join(SHIPPED)})(_monitored)?(?:@(.*))?")

_DIGITS = re.compile("[0-9a-f]{12,64}")

LEAST_NETWORK_SCORE = 0.1
"""Boxes of a network with lower scores are peaks of its noise, a hundred in a frame; no shipped tracker with
a threshold on scores has a lower one (`smartmot.tracking.configs`, CenterPoint's detection_th)."""


@dataclass(frozen=True, slots=True)
class NetworkFile:
    """A network as a run knows it. Made by `network_file`.

    Args:
        path: of the ONNX file, as it was typed; a shipped one's name.
        digest: SHA-256 of the file, which decides what network it is; the path does not.
        classes: that it can say.
        ahead_m: from and to where it looks, sensor's frame.
        left_m: likewise, to the left.
        monitored: whether it is given the points on the monitored area alone.

    Raises:
        ScenarioError: a field of view has not two ends.
    """

    path: str
    digest: str
    classes: tuple[str, ...]
    ahead_m: tuple[float, ...]
    left_m: tuple[float, ...]
    monitored: bool = False

    def __post_init__(self) -> None:
        if (len(self.ahead_m), len(self.left_m)) != (2, 2):
            raise ScenarioError(f"{self.path}: a network looks from one place to another, got {self}")

    @property
    def name(self) -> str:
        """As it is typed, with the first digits of the hash: `FILE.onnx@0123456789ab`."""
        return f"{self.path}{'_monitored' * self.monitored}@{self.digest[:12]}"

    def unseen(self, lidar: LidarConfig) -> str:
        """Where a LiDAR looks and the network does not; empty: nowhere."""
        pattern, (near, far), (right, left) = lidar.pattern, self.ahead_m, self.left_m
        behind = isinstance(pattern, Spinning) and pattern.field_rad > math.pi and near > -lidar.range_m
        if not behind and lidar.range_m <= min(far, left, -right):
            return ""
        return (
            f"it knows {', '.join(self.classes)} from {near:g} to {far:g} m ahead, {left:g} m to the left "
            f"and {-right:g} m to the right; what the sensor sees elsewhere is not detected"
        )


def is_network(name: str) -> bool:
    """Whether the name of a perception is that of a network's file; see `network_file`."""
    return _NETWORK_NAME.fullmatch(name) is not None and not is_plugin(name)


def network_path(name: str) -> Path:
    """The file that a name of the form of a network's names; see `network_file`."""
    match = _NETWORK_NAME.fullmatch(name)
    path = name if match is None else match[1]
    return shipped_path(path) if path in SHIPPED else Path(path)


def network_file(name: str) -> NetworkFile:
    """The network of a file, loaded to see that it can run.

    Args:
        name: `FILE.onnx`, or that of a shipped network, with `_monitored` where it is given the points on the
            monitored area alone, and `@` with the first 12 or more digits of its SHA-256 where no other
            network will do.

    Raises:
        ConfigError: the file is missing or damaged, another network, or no network of this form; or
            onnxruntime is missing.
    """
    match = _NETWORK_NAME.fullmatch(name)
    if match is None:
        raise ConfigError(f"{name}: expected {NETWORK_FORM} or {', '.join(SHIPPED)}")
    path, monitored, typed = match.groups()
    digits = "" if typed is None else typed.lower()
    if typed is not None and not _DIGITS.fullmatch(digits):
        raise ConfigError(
            f"{name}: expected the first 12 to 64 hexadecimal digits of the file's SHA-256 after @, "
            f"got {typed!r}"
        )
    config = shipped_network(path) if path in SHIPPED else LearnedConfig(Path(path))
    if not config.digest.startswith(digits):
        raise ConfigError(
            f"{path}: is not the network with SHA-256 {digits}..., but {config.digest[:12]}...; "
            "it has changed since it was named"
        )
    decoder = config.network.decoder
    grid = decoder.grid
    return NetworkFile(path, config.digest, decoder.classes, grid.ahead_m, grid.left_m, bool(monitored))


@dataclass(frozen=True, slots=True)
class LidarPerception:
    """Which LiDAR the ego has, and what makes detections of its clouds.

    Args:
        sensor: name out of `SENSORS`.
        perception: name out of `PERCEPTIONS`, a network, or what makes a detector of the user's own; it is
            called with the `LidarConfig` and the seed of the run.

    Raises:
        ScenarioError: an unknown name.
    """

    sensor: str
    perception: str | Plugin | NetworkFile = PERCEPTIONS[0]

    def __post_init__(self) -> None:
        lidar_config(self.sensor)
        if isinstance(self.perception, str) and self.perception not in PERCEPTIONS:
            raise ScenarioError(
                f"perception: unknown {self.perception!r}; use one of: {', '.join(PERCEPTIONS)}"
            )

    @property
    def perception_name(self) -> str:
        """Name of the perception."""
        return self.perception if isinstance(self.perception, str) else self.perception.name


def lidar_of(lidar: LidarPerception, sensor: SensorConfig) -> LidarConfig:
    """The LiDAR with rate, phase, latency, field and range of a sensor, as far as it can have them.

    Its echoes reach no farther than the sensor, whose range the weather limits.
    """
    config = lidar_config(lidar.sensor)
    pattern = replace(config.pattern, rate_hz=sensor.rate_hz)  # type: ignore[type-var]  # each is a dataclass
    if isinstance(pattern, Spinning):
        pattern = replace(pattern, field_rad=min(pattern.field_rad, sensor.fov_rad))
    return replace(
        config,
        pattern=pattern,
        range_m=min(config.range_m, sensor.range_m),
        latency_s=sensor.latency_s,
        phase_s=sensor.phase_s,
    )


class RunLidar:
    """The LiDAR of one run.

    Args:
        config: the LiDAR.
        seed: of its noise.
        street: makes what stands along the road; called once, at the first cloud.
        backwards: whether the ego drives in reverse; then the LiDAR looks to where it drives.
        labelled: whether the detector gets the ground truth of each point.
    """

    def __init__(
        self,
        config: LidarConfig,
        seed: int,
        street: Callable[[], Street],
        *,
        backwards: bool = False,
        labelled: bool = False,
    ) -> None:
        self.config, self.seed, self.backwards, self.labelled = config, seed, backwards, labelled
        self._street = street
        self._sensor: LidarSensor | None = None
        self.timing = LidarSensor(config).timing

    @property
    def sensor(self) -> LidarSensor:
        """The sensor on its street, made when it is first asked for."""
        if self._sensor is None:
            self._sensor = LidarSensor(self.config, self.seed, self._street())
        return self._sensor

    def measure(self, world: World, ego: EgoState) -> LidarMeasurement | LabelledCloud:
        """The cloud that ends with the world's time."""
        carrier = reversed_course(ego) if self.backwards else ego
        measurement, row = self.sensor.label(world, carrier)
        return LabelledCloud(measurement, row, world) if self.labelled else measurement

    def key(self, world: World, ego: EgoState) -> tuple[Hashable, ...]:
        """All that a cloud depends on."""
        surface = world.surface
        ground: Any = surface.network if isinstance(surface, MapSurface) else surface
        columns = (world.boxes.center_m, world.boxes.size_m, world.boxes.yaw_rad, world.speed_mps)
        columns_there = (world.height_m, world.exists, world.seen, world.category)
        state = b"".join(column.tobytes() for column in (*columns, *columns_there))
        state += b"" if world.ground_m is None else b"ground" + world.ground_m.tobytes()
        carried = (self.config, self.seed, self.backwards, self.sensor.street.digest)
        return (*carried, ground, world.time_s, ego, world.ego_ground_m, state)


class CloudDetector:
    """A shipped detector of clouds, or a network, behind a LiDAR.

    Args:
        method: name out of `smartmot.lidar.METHODS`, with its default parameters, out of `UNSCORED` or of
            `MONITORED`; or a network.
        area_at: the monitored area at the time of a cloud, and the ego's pose in its frame, where the
            detector is given the points on it alone; None: all points.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def __init__(self, method: str | NetworkFile, area_at: AreaAt | None = None) -> None:
        self.area_at = area_at
        self.scored = method not in UNSCORED
        self.config: DetectorConfig
        # the tracker drops low scores, and they are counted; the detector keeps none back
        if isinstance(method, NetworkFile):
            self.config = LearnedConfig(network_path(method.path), method.digest, LEAST_NETWORK_SCORE)
            return
        config = METHODS[(UNSCORED | MONITORED).get(method, method)]()
        self.config = replace(config, least_score=0.0) if isinstance(config, ClassicalConfig) else config

    def detect(self, measurement: LidarMeasurement) -> Detections:
        """Detections of a cloud, with the detector's scores."""
        height_m = measurement.mount.height_m
        made = detect(
            measurement.cloud, self.config, monitored=self._monitored(measurement), sensor_height_m=height_m
        )
        score = made.score if self.scored else np.ones(len(made.score))
        return measurement.detections(made.boxes, score, made.category)

    def _monitored(self, measurement: LidarMeasurement) -> Callable[[FloatArray], BoolArray] | None:
        """What says which points are on the monitored area; None: all count."""
        if self.area_at is None:
            return None
        area, ego = self.area_at(measurement.stamp_s)
        return lambda xyz_m: points_on(area.kept, measurement.places(xyz_m, ego))


class OwnDetector:
    """A detector of the user's own behind a LiDAR; latency and rate are 0 and all where it has none.

    Args:
        detector: the object with `detect`.
        name: for messages.

    Raises:
        PluginError: it has no `detect`, or its latency or rate is no number.
    """

    def __init__(self, detector: Any, name: str) -> None:
        self.detector = require(detector, "detect", name)
        latency_s, rate_hz = getattr(detector, "latency_s", 0.0), getattr(detector, "rate_hz", None)
        if not _is_number(latency_s) or not (rate_hz is None or _is_number(rate_hz)):
            raise PluginError(
                f"{name}: latency_s and rate_hz must be numbers, got {latency_s!r} and {rate_hz!r}"
            )
        self.latency_s: float = float(latency_s)
        self.rate_hz: float | None = None if rate_hz is None else float(rate_hz)

    def detect(self, measurement: LidarMeasurement) -> Detections:
        """What the detector makes of a cloud."""
        detections: Detections = self.detector.detect(measurement)
        return detections


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value >= 0.0


_KEPT_FRAMES = 16_384
"""Frames whose detections are kept, some 2 KB each."""

_kept: OrderedDict[Hashable, Detections] = OrderedDict()


@dataclass(frozen=True, slots=True, eq=False)
class LidarChain(SensorChain[Any]):
    """A LiDAR with a shipped detector, or a network.

    Runs of several strategies meet the same world until their egos part. Detections depend on nothing but
    that world, so that equal frames are detected once in a process.

    Args:
        sensor: the LiDAR.
        detector: keeps no state.
        name: of the perception.
        perception: which it is.
    """

    sensor: RunLidar
    perception: str | NetworkFile = DEFAULT_PERCEPTION

    def observe(self, world: World, ego: EgoState, keeps: bool = True) -> tuple[Detections, Any]:
        """See `SensorChain.observe`."""
        if keeps:
            return SensorChain.observe(self, world, ego)
        key = (self.perception, self.sensor.key(world, ego))
        detections = _kept.get(key)
        if detections is None:
            detections = _kept[key] = SensorChain.observe(self, world, ego)[0]
            if len(_kept) > _KEPT_FRAMES:
                _kept.popitem(last=False)
        return detections, None


def lidar_chain(
    lidar: LidarPerception,
    sensor: SensorConfig,
    seed: int,
    street: Callable[[], Street],
    *,
    backwards: bool = False,
    area_at: AreaAt | None = None,
) -> SensorChain[Any]:
    """The LiDAR of a run and its detector.

    Args:
        lidar: which.
        sensor: whose rate, phase, latency and range they have.
        seed: of the noise.
        street: makes what stands along the road.
        backwards: whether the ego drives in reverse.
        area_at: see `CloudDetector`.

    Raises:
        PluginError: a detector of the user's own cannot be made.
        ScenarioError: the perception asks for a monitored area, and there is none.
        ConfigError: the file of a network is missing, or has changed.
    """
    config = lidar_of(lidar, sensor)
    perception, name = lidar.perception, lidar.perception_name
    labelled = perception in OF_TRUTH
    carried = RunLidar(config, seed, street, backwards=backwards, labelled=labelled)
    if isinstance(perception, Plugin):
        own = OwnDetector(perception(config, seed), name)
        return SensorChain(carried, own, name)
    if perception.monitored if isinstance(perception, NetworkFile) else perception in MONITORED:
        if area_at is None:
            other = perception.path if isinstance(perception, NetworkFile) else MONITORED[perception]
            raise ScenarioError(f"perception={name} needs a monitored area, and there is none; use {other}")
        # detections of two strategies differ: no frame is shared
        return SensorChain(carried, CloudDetector(perception, area_at), name)
    of_truth = OF_TRUTH.get(perception) if isinstance(perception, str) else None
    detector: Detector[Any] = CloudDetector(perception) if of_truth is None else of_truth()
    return LidarChain(carried, detector, name, perception)
