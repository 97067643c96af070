"""A LiDAR in the closed loop: its sensor, and what makes boxes of its clouds."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
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
from smartmot.errors import PluginError
from smartmot.lidar import METHODS, ClassicalConfig, detect
from smartmot.lidar.monitored import points_on
from smartmot.plugins import Plugin, require
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


@dataclass(frozen=True, slots=True)
class LidarPerception:
    """Which LiDAR the ego has, and what makes detections of its clouds.

    Args:
        sensor: name out of `SENSORS`.
        perception: name out of `PERCEPTIONS`, or what makes a detector of the user's own; it is called with
            the `LidarConfig` and the seed of the run.

    Raises:
        ScenarioError: an unknown name.
    """

    sensor: str
    perception: str | Plugin = PERCEPTIONS[0]

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
    """A shipped detector of clouds behind a LiDAR.

    Args:
        method: name out of `smartmot.lidar.METHODS`, with its default parameters, out of `UNSCORED` or of
            `MONITORED`.
        area_at: the monitored area at the time of a cloud, and the ego's pose in its frame; for `MONITORED`.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def __init__(self, method: str, area_at: AreaAt | None = None) -> None:
        config, self.scored = METHODS[(UNSCORED | MONITORED).get(method, method)](), method not in UNSCORED
        self.area_at = area_at if method in MONITORED else None
        # the tracker drops low scores, and they are counted; the detector keeps none back
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
    """A LiDAR with a shipped detector.

    Runs of several strategies meet the same world until their egos part. Detections depend on nothing but
    that world, so that equal frames are detected once in a process.

    Args:
        sensor: the LiDAR.
        detector: keeps no state.
        name: of the perception.
    """

    sensor: RunLidar

    def observe(self, world: World, ego: EgoState, keeps: bool = True) -> tuple[Detections, Any]:
        """See `SensorChain.observe`."""
        if keeps:
            return SensorChain.observe(self, world, ego)
        key = (self.name, self.sensor.key(world, ego))
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
    """
    config = lidar_of(lidar, sensor)
    perception = lidar.perception
    labelled = perception in OF_TRUTH
    carried = RunLidar(config, seed, street, backwards=backwards, labelled=labelled)
    if isinstance(perception, Plugin):
        own = OwnDetector(perception(config, seed), perception.name)
        return SensorChain(carried, own, perception.name)
    if perception in MONITORED:
        if area_at is None:
            other = MONITORED[perception]
            raise ScenarioError(
                f"perception={perception} needs a monitored area, and there is none; use {other}"
            )
        # detections of two strategies differ: no frame is shared
        return SensorChain(carried, CloudDetector(perception, area_at), perception)
    detector: Detector[Any] = OF_TRUTH[perception]() if labelled else CloudDetector(perception)
    return LidarChain(carried, detector, perception)
