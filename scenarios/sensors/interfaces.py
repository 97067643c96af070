"""Sensor and detector apart: one measures the world, the other makes detections of what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from scenarios.errors import ScenarioError
from scenarios.sensors.world import World
from smartmot.errors import PluginError
from smartmot.types import Detections, EgoState

STAMP_TOLERANCE_S = 1e-9
"""Detections belong to a measurement if their stamps differ by no more."""


@dataclass(frozen=True, slots=True)
class Timing:
    """When a sensor measures.

    Args:
        rate_hz: measurements per second.
        phase_s: time of the first.
        latency_s: age of a measurement when it reaches the detector.

    Raises:
        ScenarioError: the rate is not positive, or a time is negative.
    """

    rate_hz: float
    phase_s: float = 0.0
    latency_s: float = 0.0

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0 and self.phase_s >= 0 and self.latency_s >= 0):
            raise ScenarioError(
                "sensor: the rate must be positive, phase and latency must not be negative; got "
                f"{self.rate_hz:g} Hz, {self.phase_s:g} s and {self.latency_s:g} s"
            )

    def number_at(self, time_s: float) -> int:
        """Number of the measurement at a time, counted from 0."""
        return round((time_s - self.phase_s) * self.rate_hz)


class Measurement(Protocol):
    """What a sensor has measured at one instant."""

    @property
    def stamp_s(self) -> float:
        """When, seconds."""

    @property
    def is_truth(self) -> bool:
        """Whether it holds ground truth; then the detector alone gets it, and no frame."""


M_co = TypeVar("M_co", bound=Measurement, covariant=True)
M_contra = TypeVar("M_contra", bound=Measurement, contravariant=True)
M = TypeVar("M", bound=Measurement)


class SensorModel(Protocol[M_co]):
    """A sensor: from the world to a measurement."""

    @property
    def timing(self) -> Timing:
        """When it measures."""

    def measure(self, world: World, ego: EgoState) -> M_co:
        """The measurement of one instant.

        Args:
            world: everybody but the ego.
            ego: pose and motion of the vehicle that carries the sensor, at the same time.
        """
        ...


class Detector(Protocol[M_contra]):
    """A detector: from a measurement to detections. It knows nothing else of the world."""

    @property
    def latency_s(self) -> float:
        """How long it takes for one measurement."""

    @property
    def rate_hz(self) -> float | None:
        """How many measurements per second it takes at most, the others are lost; None: all."""

    def detect(self, measurement: M_contra) -> Detections:
        """Detections of one measurement, map frame, stamped with its time."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class SensorChain(Generic[M]):
    """A sensor and the detector behind it.

    Args:
        sensor: measures the world.
        detector: gets all that the sensor measures.
        name: for messages.
    """

    sensor: SensorModel[M]
    detector: Detector[M]
    name: str = "sensor"

    @property
    def latency_s(self) -> float:
        """Age of the detections when they reach perception."""
        return self.sensor.timing.latency_s + self.detector.latency_s

    def observe(self, world: World, ego: EgoState, keeps: bool = True) -> tuple[Detections, M | None]:
        """Detections of one instant, and the measurement as far as it is no ground truth.

        Args:
            world: everybody but the ego.
            ego: odometry then.
            keeps: whether the measurement is asked for; if not, a chain may leave it out.
        """
        measurement = self.sensor.measure(world, ego)
        detections = self.detector.detect(measurement)
        return detections, None if measurement.is_truth else measurement


def check_detections(name: str, method: str, detections: object, time_s: float) -> None:
    """Refuse what a detector must not return.

    Args:
        name: of the detector, for the message.
        method: that has been called.
        detections: what has been returned.
        time_s: time of the measurement.

    Raises:
        PluginError: no detections, or of another time.
    """
    if not isinstance(detections, Detections):
        raise PluginError(
            f"{name}: {method}() returned {type(detections).__name__}; return smartmot.Detections, "
            "for example from smartmot.detections_from_arrays"
        )
    if abs(detections.stamp_s - time_s) > STAMP_TOLERANCE_S:
        raise PluginError(
            f"{name}: detections of {detections.stamp_s:g} s at {time_s:g} s; give them the ego's time"
        )
