"""All sensors of the ego: when each measures, and in which order what they detect reaches perception."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.sensors.interfaces import Measurement, SensorChain, check_detections
from scenarios.sensors.world import World
from smartmot.plugins import failure
from smartmot.types import NOTHING_DROPPED, Boxes, Detections, EgoState

ARRIVAL_TOLERANCE_S = 1e-9
"""Sums of multiples of 10 ms are this exact."""


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """What several sensors have measured at the same instant.

    Args:
        stamp_s: when, seconds.
        parts: the measurements, in the order of the sensors.
    """

    stamp_s: float
    parts: tuple[Measurement, ...]

    @property
    def is_truth(self) -> bool:
        """False: ground truth is no part of it."""
        return False


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """What reaches perception at once: the detections of one instant of measurement.

    Args:
        time_s: when.
        detections: of all sensors that measured then.
        measurement: what they are made of, as far as that is not ground truth.
    """

    time_s: float
    detections: Detections
    measurement: Measurement | None = None


class _Schedule:
    """The steps at which one sensor measures, and which of its measurements its detector takes."""

    def __init__(self, chain: SensorChain[Any], step_s: float) -> None:
        timing = chain.sensor.timing
        self.chain = chain
        self.interval = whole_steps(1.0 / timing.rate_hz, step_s, "frame interval (1 / rate)", least=1)
        self.first = whole_steps(timing.phase_s, step_s, "frame phase")
        whole_steps(timing.latency_s, step_s, "latency")
        self.latency_s = chain.latency_s
        whole_steps(self.latency_s, step_s, "latency of sensor and detector")
        rate_hz = chain.detector.rate_hz
        self.pause = 0 if rate_hz is None else whole_steps(1.0 / rate_hz, step_s, "detector's interval")
        self._last: int | None = None

    def measures(self, step: int) -> bool:
        """Whether the sensor measures at a step."""
        since = step - self.first
        return since >= 0 and since % self.interval == 0

    def next_step(self, step: int) -> int:
        """The first step after another at which the sensor measures."""
        return max(self.first, step + self.interval - (step - self.first) % self.interval)

    def takes(self, step: int) -> bool:
        """Whether the detector takes the measurement of a step."""
        if self._last is not None and step < self._last + self.pause:
            return False
        self._last = step
        return True


class SensorSuite:
    """Runs sensors by the clock, and hands over what they detect.

    Detections are handed over in the order of their measurement, so that those of a fast sensor wait for
    older ones of a slow one. Sensors that measure at the same instant give one frame of detections: an
    object that two of them see is in it twice.

    Args:
        chains: the sensors.
        step_s: step of the world.
        keeps: whether arrivals have their measurements.

    Raises:
        ScenarioError: there is no sensor, or a time is not a multiple of the step.
    """

    def __init__(self, chains: Sequence[SensorChain[Any]], step_s: float, keeps: bool = True) -> None:
        if not chains:
            raise ScenarioError("sensors: expected one or more")
        self._keeps = keeps
        self._schedules = [_Schedule(chain, step_s) for chain in chains]
        self.waiting: deque[Arrival] = deque()
        """What has not arrived yet, in the order in which it will."""

    def next_step(self, step: int) -> int:
        """The first step after another at which a sensor measures."""
        return min(schedule.next_step(step) for schedule in self._schedules)

    def measure(self, step: int, time_s: float, world: World, ego: EgoState) -> None:
        """Let the sensors measure that do so at a step.

        Args:
            step: number of the step.
            time_s: its time.
            world: everybody but the ego then.
            ego: odometry then.

        Raises:
            PluginError: a sensor or detector fails, or returns something else than detections, or of another
                time.
        """
        arrivals: list[Arrival] = []
        for schedule in self._schedules:
            if not (schedule.measures(step) and schedule.takes(step)):
                continue
            chain = schedule.chain
            try:
                detections, shown = chain.observe(world, ego, self._keeps)
            except (Exception, SystemExit) as error:  # whatever a user's code may raise
                raise failure(f"{chain.name}, frame at {time_s:g} s", error) from error
            check_detections(chain.name, "detect", detections, time_s)
            arrivals.append(Arrival(time_s + schedule.latency_s, detections, shown))
        if arrivals:
            self.waiting.append(arrivals[0] if len(arrivals) == 1 else _together(arrivals))

    def arrived(self, time_s: float) -> Arrival | None:
        """What reaches perception next, and has done so by now; it is handed over once."""
        if self.waiting and self.waiting[0].time_s <= time_s + ARRIVAL_TOLERANCE_S:
            return self.waiting.popleft()
        return None


def _together(arrivals: Sequence[Arrival]) -> Arrival:
    """One arrival of several with the same time of measurement, once the last of them is there."""
    stamp_s = arrivals[0].detections.stamp_s
    shown = tuple(a.measurement for a in arrivals if a.measurement is not None)
    measurement = None if not shown else shown[0] if len(shown) == 1 else Measurements(stamp_s, shown)
    joined = joined_detections([arrival.detections for arrival in arrivals])
    return Arrival(max(arrival.time_s for arrival in arrivals), joined, measurement)


def joined_detections(parts: Sequence[Detections]) -> Detections:
    """The detections of several sensors at one instant as one value."""
    velocity = None
    if any(part.velocity_mps is not None for part in parts):
        columns = (
            np.full((len(part), 2), np.nan) if part.velocity_mps is None else part.velocity_mps
            for part in parts
        )
        velocity = np.concatenate(list(columns))
    covariance = None
    if any(part.pose_covariance is not None for part in parts):
        blocks = (
            np.full((len(part), 3, 3), np.nan) if part.pose_covariance is None else part.pose_covariance
            for part in parts
        )
        covariance = np.concatenate(list(blocks))
    return Detections(
        stamp_s=parts[0].stamp_s,
        boxes=Boxes(
            np.concatenate([part.boxes.center_m for part in parts]),
            np.concatenate([part.boxes.size_m for part in parts]),
            np.concatenate([part.boxes.yaw_rad for part in parts]),
        ),
        score=np.concatenate([part.score for part in parts]),
        category=np.concatenate([part.category for part in parts]),
        velocity_mps=velocity,
        dropped=sum((part.dropped for part in parts), NOTHING_DROPPED),
        pose_covariance=covariance,
    )


def whole_steps(time_s: float, step_s: float, name: str, least: int = 0) -> int:
    """A time as a whole number of steps.

    Raises:
        ScenarioError: it is none, or one under the least.
    """
    steps = round(time_s / step_s)
    if steps < least or abs(steps * step_s - time_s) > 1e-9:
        raise ScenarioError(
            f"sensor: the {name} must be a multiple of the step of {step_s * 1000:g} ms, "
            f"got {time_s * 1000:g} ms"
        )
    return steps
