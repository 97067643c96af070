"""The shipped box sensor: which boxes of the ground truth it makes out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.sensors.errors import BoxErrors, SensorErrors, per_category
from scenarios.sensors.interfaces import Timing
from scenarios.sensors.world import World
from smartmot.filters.motion_models import Setting
from smartmot.geometry import corners, wrap_angle
from smartmot.types import CATEGORIES, BoolArray, Boxes, EgoState, FloatArray, StrArray

_RAYS = 9


@dataclass(frozen=True, slots=True)
class SensorConfig:
    """A bird's-eye-view object sensor at the ego's centre.

    Args:
        range_m: objects whose centre is farther are not seen.
        fov_rad: horizontal field of view, symmetric about the ego's heading; 2 pi: all round.
        position_sigma_m: standard deviation of the centre's error, per axis (authors' code: 0.05 m).
        yaw_sigma_rad: standard deviation of the heading's error.
        detection_probability: chance that a visible object is reported in a frame.
        min_visible: share of the object's width, as seen from the sensor, that must not be occluded.
        latency_s: age of the detections when they reach the tracker.
        rate_hz: frames per second (paper: 20 Hz).
        phase_s: time of the first frame. At 20 Hz and 60 km/h the ego drives 0.8 m between frames, so the
            phase moves the flag and the impact speed.
        errors: by category and range, correlated in time, and ghosts; None: the white noise above is all.
    """

    range_m: float = 70.0
    fov_rad: float = 2 * np.pi
    position_sigma_m: float = 0.05
    yaw_sigma_rad: float = 0.0
    detection_probability: float = 1.0
    min_visible: float = 0.3
    latency_s: float = 0.0
    rate_hz: float = 20.0
    phase_s: float = 0.0
    errors: SensorErrors | None = None

    def __post_init__(self) -> None:
        if not (self.range_m > 0 and self.rate_hz > 0 and 0 < self.fov_rad <= 2 * np.pi):
            raise ScenarioError("sensor: range and rate must be positive, the field of view in (0, 2 pi]")
        times = (self.position_sigma_m, self.yaw_sigma_rad, self.latency_s, self.phase_s)
        if not all(0 <= value < math.inf for value in times):
            raise ScenarioError("sensor: noise, latency and phase must be finite and not negative")
        if not (0 <= self.detection_probability <= 1 and 0 <= self.min_visible <= 1):
            raise ScenarioError("sensor: detection_probability and min_visible must lie in [0, 1]")

    def noise_at(self, range_m: float) -> tuple[Setting, Setting]:
        """Root mean square errors at a range: of the centre along each axis, m, and of the heading, rad.

        Each one number, or one for each category. Flips are no part of them.
        """
        if self.errors is None:
            return self.position_sigma_m, self.yaw_sigma_rad
        position, heading = [], []
        for name in CATEGORIES:
            row = self.errors.row_at(name, range_m) or BoxErrors()
            radial = self.position_sigma_m if row.radial_sigma_m is None else row.radial_sigma_m
            across = self.position_sigma_m if row.tangential_sigma_m is None else row.tangential_sigma_m
            position.append(math.sqrt((row.radial_bias_m**2 + radial**2 + across**2) / 2.0))
            heading.append(self.yaw_sigma_rad if row.yaw_sigma_rad is None else row.yaw_sigma_rad)
        return per_category(position), per_category(heading)


def visible_share(boxes: Boxes, x_m: float, y_m: float) -> FloatArray:
    """(N,) share of each box's angular width that no nearer box hides, seen from a point.

    Nine rays over the width of each box; a ray is blocked by every box that it crosses and whose centre is
    nearer.
    """
    n = len(boxes)
    if n < 2:
        return np.ones(n)
    delta = boxes.center_m - np.array([x_m, y_m])
    distance = np.hypot(delta[:, 0], delta[:, 1])
    bearing = np.arctan2(delta[:, 1], delta[:, 0])
    edge = corners(boxes.center_m, boxes.size_m, boxes.yaw_rad) - np.array([x_m, y_m])
    spread = wrap_angle(np.arctan2(edge[..., 1], edge[..., 0]) - bearing[:, None])
    low, high = spread.min(axis=1), spread.max(axis=1)
    share = (np.arange(_RAYS) + 0.5) / _RAYS
    ray = bearing[:, None] + low[:, None] + (high - low)[:, None] * share
    # boxes farther apart in bearing than both are wide hide nothing of each other
    half = np.maximum(np.abs(low), np.abs(high))
    apart, wide = np.abs(bearing[:, None] - bearing), half[:, None] + half + 1e-9
    meet = (apart <= wide) | (apart >= 2.0 * np.pi - wide)
    pair, nearer = np.nonzero(meet & (distance < distance[:, None] - 1e-9))
    # (P, rays): does the nearer box of a pair hide this ray of the other?
    offset = wrap_angle(ray[pair] - bearing[nearer, None])
    blocked = (offset >= low[nearer, None]) & (offset <= high[nearer, None])
    hidden = np.zeros((n, _RAYS), dtype=np.bool_)
    if len(pair):
        first = np.flatnonzero(np.diff(pair, prepend=-1))
        hidden[pair[first]] = np.logical_or.reduceat(blocked, first, axis=0)
    share_seen: FloatArray = 1.0 - hidden.mean(axis=1)
    return share_seen


@dataclass(frozen=True, slots=True, eq=False)
class BoxMeasurement:
    """Ground truth of N objects, and which of them a box sensor makes out.

    Args:
        stamp_s: when, seconds.
        number: of the measurement; selects the errors of the detector.
        boxes: N outlines.
        category: (N,) names.
        visible: (N,) in range and in the field of view, and not hidden.
        ego: pose of the sensor; where it has errors.
        visible_share: (N,) share of each box that no nearer box hides; where the sensor has errors.
        velocity_mps: (N, 2) velocities over ground, map frame; where the sensor measures them.
    """

    stamp_s: float
    number: int
    boxes: Boxes
    category: StrArray
    visible: BoolArray
    ego: EgoState | None = None
    visible_share: FloatArray | None = None
    velocity_mps: FloatArray | None = None

    @property
    def is_truth(self) -> bool:
        """True: only the detector gets it."""
        return True


class BoxSensor:
    """Makes out who is in range, in the field of view and not hidden behind others.

    Args:
        config: range, field of view and timing.
    """

    def __init__(self, config: SensorConfig) -> None:
        self.config = config
        self.timing = Timing(config.rate_hz, config.phase_s, config.latency_s)

    def measure(self, world: World, ego: EgoState) -> BoxMeasurement:
        """Who is visible from the ego's centre."""
        number = self.timing.number_at(world.time_s)
        measurement = measured(self.config, number, ego, world.boxes, world.category, world.seen)
        errors = self.config.errors
        if errors is None or errors.velocity_sigma_mps is None:
            return measurement
        return replace(measurement, velocity_mps=world.velocity_mps)


def measured(
    config: SensorConfig,
    number: int,
    ego: EgoState,
    boxes: Boxes,
    category: StrArray,
    there: BoolArray | None,
) -> BoxMeasurement:
    """The measurement of N boxes in which those that are there (None: all) are looked for."""
    n = len(boxes)
    if config.errors is not None:
        present = np.ones(n, dtype=np.bool_) if there is None else there
        share = np.zeros(n)
        share[present] = visible_share(boxes[present], ego.x_m, ego.y_m)
        visible = present & _in_view(config, ego, boxes) & (share >= config.min_visible)
        return BoxMeasurement(ego.stamp_s, number, boxes, category, visible, ego, share)
    if there is None or np.count_nonzero(there) == n:
        visible = _visible(config, ego, boxes)
    else:
        visible = np.zeros(n, dtype=np.bool_)
        visible[there] = _visible(config, ego, boxes[there])
    return BoxMeasurement(ego.stamp_s, number, boxes, category, visible)


def _visible(config: SensorConfig, ego: EgoState, boxes: Boxes) -> BoolArray:
    near = _in_view(config, ego, boxes)
    if len(boxes) > 1 and np.count_nonzero(near):  # nobody hides a single one
        near &= visible_share(boxes, ego.x_m, ego.y_m) >= config.min_visible
    return near


def _in_view(config: SensorConfig, ego: EgoState, boxes: Boxes) -> BoolArray:
    """(N,) in range and in the field of view."""
    delta = boxes.center_m - np.array([ego.x_m, ego.y_m])
    near: BoolArray = np.hypot(delta[:, 0], delta[:, 1]) <= config.range_m
    if config.fov_rad < 2 * np.pi:
        bearing = wrap_angle(np.arctan2(delta[:, 1], delta[:, 0]) - ego.yaw_rad)
        near &= np.abs(bearing) <= config.fov_rad / 2
    return near
