"""Named conditions: the paper's own, and a real car's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import _smartmot
from scenarios.brakes import BrakeConfig
from scenarios.errors import ScenarioError
from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.errors import greatest
from scenarios.sensors.interfaces import SensorChain
from scenarios.sensors.lidar.chain import AreaAt, LidarPerception, lidar_chain
from scenarios.sensors.lidar.street import BARE, Furnished, Street
from scenarios.sensors.measured_errors import REAL_ERRORS
from scenarios.sensors.sensor import box_chain, observing_chain
from scenarios.sources.pose_errors import (
    NO_LOCALISATION_ERRORS,
    NO_ODOMETRY_ERRORS,
    LocalisationErrors,
    OdometryErrors,
    PoseErrors,
)
from scenarios.weather import DRY_FRICTION, Light, Weather
from smartmot.area import AdaptiveAreaConfig, MapAreaConfig, PathAreaConfig, RectangularConfig
from smartmot.errors import suggestion
from smartmot.filters.motion_models import PerCategory, Setting
from smartmot.maps.faulty import MapErrors
from smartmot.pipeline import PipelineConfig
from smartmot.plugins import Plugin, require
from smartmot.tracking.tracker import TrackerConfig


@dataclass(frozen=True, slots=True)
class Preset:
    """Everything that is fixed about vehicle, sensor and perception in a run.

    Args:
        name: how the command line calls it.
        brakes: emergency brake on dry road.
        sensor: sensor in clear weather.
        rectangular, map_area, path_area: settings of the strategies.
        pipeline: settings of tracking, forecast and decision.
        ego_length_m, ego_width_m: outline of the ego.
        tracker_sigma_m: error of positions that the tracker takes for granted; None: the sensor's. See
            `pipeline_of`.
        detector: makes a detector or sensors of the user's own from a `SensorConfig` and a seed, in place of
            the shipped sensor; see `sensors_of`.
        path_from: where the planned path comes from; see `scenarios.sources.perception.AreaPipelines`.
        localisation, odometry: errors of the ego's pose on the map, and of its own motion.
        map_errors: what is wrong with the map that perception uses.
        lidar: a LiDAR in place of the shipped sensor, whose rate, latency and range it has; its noise, errors
            and hiding are the LiDAR's own.
        street: what stands along the road, which a LiDAR alone sees; None: nothing.
    """

    name: str
    brakes: BrakeConfig
    sensor: SensorConfig
    rectangular: RectangularConfig
    map_area: MapAreaConfig
    pipeline: PipelineConfig
    ego_length_m: float
    ego_width_m: float
    tracker_sigma_m: float | None = None
    detector: Plugin | None = None
    path_area: PathAreaConfig = field(default_factory=PathAreaConfig)
    adaptive_area: AdaptiveAreaConfig = field(default_factory=AdaptiveAreaConfig)
    path_from: str = "planner"
    localisation: LocalisationErrors = field(default_factory=LocalisationErrors)
    odometry: OdometryErrors = field(default_factory=OdometryErrors)
    map_errors: MapErrors = field(default_factory=MapErrors)
    lidar: LidarPerception | None = None
    street: Furnished | None = None


PAPER = Preset(
    name="paper",
    # Read off figure 5b of the SmartMOT paper: every curve falls with 14.5 m/s2 (CARLA's brakes) after about
    # 0.5 s of linear build-up, about 0.07 s after the flag.
    brakes=BrakeConfig(delay_s=0.07, build_up_s=0.5, max_decel_mps2=14.5),
    # Ground truth of the simulator with 0.05 m of noise at 20 Hz (authors' code). What limits the paper's
    # system is how far ahead an object may count; that is set in the areas below.
    sensor=SensorConfig(range_m=100.0, position_sigma_m=0.05, rate_hz=20.0),
    # The authors clamp the rectangle to 12..30 m. The published impact speeds (23.82 and 44.23 km/h) belong
    # to its lower clamp, whatever the speed; a longer rectangle would have stopped in time.
    rectangular=RectangularConfig(min_length_m=12.0, max_length_m=12.0),
    # Front limit of the authors' detections; objects count up to there.
    map_area=MapAreaConfig(reach_m=22.2),
    pipeline=PipelineConfig(),
    ego_length_m=4.4,  # authors' code
    ego_width_m=1.8,
)

PHYSICAL = Preset(
    name="physical",
    # Peak braking coefficient 0.9 of Euro NCAP's test track x 9.81 m/s2 = 8.8; 0.2 s delay and 0.4 s build-up
    # is the slower of the two profiles commonly assumed for AEB, near UN R157's 14.1 m/s3 build-up.
    brakes=BrakeConfig(delay_s=0.2, build_up_s=0.4, max_decel_mps2=8.8),
    sensor=SensorConfig(range_m=70.0, position_sigma_m=0.05, rate_hz=20.0),
    rectangular=RectangularConfig(),  # the authors' own clamps, 12..30 m
    map_area=MapAreaConfig(),
    pipeline=PipelineConfig(),
    ego_length_m=4.4,
    ego_width_m=1.8,
)

REAL = replace(
    PHYSICAL,  # car, brakes and areas
    name="real",
    sensor=SensorConfig(
        # The farthest at which cars were detected often enough to measure their errors; see `REAL_ERRORS`.
        range_m=60.0,
        # Where errors are by category and range, these two stand for none: with `sensor_errors=none`, what
        # cars have at 20 to 30 m.
        position_sigma_m=0.10,
        yaw_sigma_rad=math.radians(1.8),
        min_visible=0.1,  # assumed: what is largely hidden is missed by `REAL_ERRORS`, not by a limit
        # CenterPoint makes 11 to 13 frames per second (its README), KITTI's LiDAR turns 10 times per second.
        rate_hz=10.0,
        # The limit of Waymo's real-time challenge is 70 ms for the detector alone; 30 ms more for the sweep
        # and its transmission are assumed.
        latency_s=0.1,
        errors=REAL_ERRORS,
    ),
    # 0.05 to 0.1 m RMS over 60 km of city with GNSS, LiDAR and inertial sensors (Wan et al., ICRA 2018).
    localisation=LocalisationErrors(drift_sigma_m=0.1),
)
"""A real detector on the same car."""

PRESETS = {preset.name: preset for preset in (PAPER, PHYSICAL, REAL)}

TYPICAL_RANGE_M = 20.0
"""Range of the errors that a tracker is set for: where an emergency brake at 50 to 60 km/h decides."""

LIDAR_NOISE: tuple[Setting, Setting] = (
    PerCategory(0.25, 0.10, 0.10, 0.25, 0.10, 0.25),
    0.1,
)
"""Noise that a tracker expects of boxes fitted to points, where the category and nothing else is known: of
positions along each axis, m, and of headings, rad. Positions: root mean squares of what clusters on 31 frames
of a real drive (KITTI tracking sequence 0000) had; cars 0.25 m, pedestrians and cyclists 0.10 m, others as
what is most like them. Headings: assumed."""


def preset_in_weather(preset: Preset, weather: Weather) -> Preset:
    """The preset with brakes and sensor as the weather leaves them.

    The deceleration scales with friction relative to a dry road, so that a preset's dry value stays its own.
    """
    brakes = replace(
        preset.brakes, max_decel_mps2=preset.brakes.max_decel_mps2 * weather.friction / DRY_FRICTION
    )
    sensor = replace(preset.sensor, range_m=weather.range_m(preset.sensor.range_m))
    return replace(preset, brakes=brakes, sensor=sensor)


def preset_at_night(preset: Preset, light: Light) -> Preset:
    """The preset with the sensor as darkness leaves it."""
    if light.range_m is None:
        return preset
    return replace(preset, sensor=replace(preset.sensor, range_m=min(preset.sensor.range_m, light.range_m)))


def pipeline_of(preset: Preset) -> PipelineConfig:
    """Settings of perception with the tracker set for the sensor.

    The tracker's noise of positions and headings is the sensor's at 20 m or its own, whichever is greater: a
    named configuration keeps what it was published with until the sensor is worse. That of velocities is the
    sensor's where detections carry one. `Preset.tracker_sigma_m` puts another number in place of the noise of
    positions, and leaves the others as they are. A tracker of the user's own is given the sensor if it has a
    parameter of that name.
    """
    tracker = preset.pipeline.tracker
    if isinstance(tracker, Plugin):
        return replace(preset.pipeline, tracker=_TrackerOf(tracker, preset.sensor))
    if not isinstance(tracker, TrackerConfig):
        return preset.pipeline
    noise = tracker.filter
    if preset.tracker_sigma_m is not None:
        noise = replace(noise, position_sigma_m=preset.tracker_sigma_m)
    else:
        lidar = preset.lidar is not None
        position, heading = LIDAR_NOISE if lidar else preset.sensor.noise_at(TYPICAL_RANGE_M)
        errors = preset.sensor.errors
        velocity = None if errors is None else errors.velocity_sigma_mps
        noise = replace(
            noise,
            position_sigma_m=greatest(noise.position_sigma_m, position),
            yaw_sigma_rad=greatest(noise.yaw_sigma_rad, heading),
            velocity_sigma_mps=noise.velocity_sigma_mps if velocity is None else max(velocity, _LEAST_MPS),
        )
    if noise == tracker.filter:
        return preset.pipeline
    return replace(preset.pipeline, tracker=replace(tracker, filter=noise))


@dataclass(frozen=True, slots=True)
class _TrackerOf:
    """Makes a tracker of the user's own for a sensor."""

    plugin: Plugin
    sensor: SensorConfig

    @property
    def name(self) -> str:
        """Name of the tracker, for messages."""
        return self.plugin.name

    def __call__(self) -> Any:
        """The tracker."""
        return self.plugin(sensor=self.sensor)


_LEAST_MPS = 1e-3
"""A filter takes no measurement for exact."""


def named_preset(name: str) -> Preset:
    """Look up a preset.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in PRESETS:
        raise ScenarioError(
            f"unknown preset {name!r}{suggestion(name, PRESETS)}; use one of: {', '.join(PRESETS)}"
        )
    return PRESETS[name]


def bare_street() -> Street:
    """A road along which nothing stands."""
    return BARE


def sensors_of(
    preset: Preset,
    seed: int,
    street: Callable[[], Street] = bare_street,
    *,
    backwards: bool = False,
    area_at: AreaAt | None = None,
) -> tuple[SensorChain[Any], ...]:
    """The sensors of a preset: the shipped one, its LiDAR, or what the user's own name makes.

    Args:
        preset: what they are like.
        seed: of their errors.
        street: makes what stands along the road; a LiDAR asks for it at its first cloud.
        backwards: whether the ego drives in reverse.
        area_at: the monitored area at a time, and the ego in its frame, for detectors that ask for it.

    Raises:
        ScenarioError: a detector asks for a monitored area, and there is none.
        smartmot.errors.PluginError: what is made is neither a detector that observes, nor a `SensorChain` or
            several of them; or a detector of clouds has no `detect`.
    """
    plugin = preset.detector
    if preset.lidar is not None:
        return (lidar_chain(preset.lidar, preset.sensor, seed, street, backwards=backwards, area_at=area_at),)
    if plugin is None:
        return (box_chain(preset.sensor, seed),)
    made = plugin(preset.sensor, seed)
    parts = made if isinstance(made, (tuple, list)) else (made,)
    if parts and all(isinstance(part, SensorChain) for part in parts):
        return tuple(replace(chain, name=plugin.name) for chain in parts)
    return (observing_chain(preset.sensor, require(made, "observe", plugin.name), plugin.name),)


def pose_errors_of(preset: Preset, seed: int) -> PoseErrors | None:
    """The errors of localisation and odometry of a run; None: there are none."""
    if (preset.localisation, preset.odometry) == (NO_LOCALISATION_ERRORS, NO_ODOMETRY_ERRORS):
        return None
    return PoseErrors(preset.localisation, preset.odometry, seed)


__getattr__ = _smartmot.names_of(__name__, "scenarios.weather")
