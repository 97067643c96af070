"""Detectors that observe ground truth: the shipped one, and those of one's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scenarios.sensors.boxes import BoxMeasurement, BoxSensor, SensorConfig, measured
from scenarios.sensors.detector import BoxDetector, detected, error_process
from scenarios.sensors.interfaces import SensorChain, Timing, check_detections
from scenarios.sensors.world import World
from smartmot.types import BoolArray, Boxes, Detections, EgoState, StrArray


class ObjectDetector(Protocol):
    """What a detector of one's own must do that turns ground truth into what it would report.

    `Sensor` does it. To take sensor and detector apart, see `scenarios.sensors.interfaces`.
    """

    def observe(
        self, frame: int, ego: EgoState, boxes: Boxes, category: StrArray, there: BoolArray | None = None, /
    ) -> Detections:
        """Detections of one frame; see `Sensor.observe`."""
        ...


class Sensor:
    """Box sensor and box detector in one: base of detectors of one's own.

    Args:
        config: properties.
        seed: of the noise; see `BoxDetector`.
    """

    def __init__(self, config: SensorConfig, seed: int) -> None:
        self.config, self.seed = config, seed
        self._process = error_process(config, seed)

    def observe(
        self, frame: int, ego: EgoState, boxes: Boxes, category: StrArray, there: BoolArray | None = None
    ) -> Detections:
        """Detections of one frame.

        Args:
            frame: number of the frame; selects the noise.
            ego: ego state at the measurement.
            boxes: N ground-truth boxes.
            category: (N,) names.
            there: (N,) which of them can be seen at all; None: all.

        Returns:
            What the sensor reports, stamped with the ego's time.
        """
        measurement = measured(self.config, frame, ego, boxes, category, there)
        return detected(self.config, self.seed, measurement, self._process)


@dataclass(frozen=True, slots=True, eq=False)
class ObservedWorld:
    """Ground truth as a detector that observes it is given it.

    Args:
        stamp_s: when, seconds.
        number: of the frame.
        ego: odometry.
        world: everybody else.
    """

    stamp_s: float
    number: int
    ego: EgoState
    world: World

    @property
    def is_truth(self) -> bool:
        """True: only the detector gets it."""
        return True


class PassThrough:
    """A sensor that hands the world to its detector as it is.

    Args:
        timing: when it does so.
    """

    def __init__(self, timing: Timing) -> None:
        self.timing = timing

    def measure(self, world: World, ego: EgoState) -> ObservedWorld:
        """The world, and the number of the frame."""
        return ObservedWorld(world.time_s, self.timing.number_at(world.time_s), ego, world)


class ObservingDetector:
    """A detector that observes ground truth, behind the interface of those that get a measurement.

    Args:
        detector: the object with `observe`.
        name: for messages.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def __init__(self, detector: ObjectDetector, name: str) -> None:
        self.detector, self.name = detector, name

    def detect(self, measurement: ObservedWorld) -> Detections:
        """What the detector reports.

        Raises:
            PluginError: no detections, or of another time.
        """
        world = measurement.world
        category, there = world.category.copy(), world.seen.copy()  # to be changed at will
        detections = self.detector.observe(measurement.number, measurement.ego, world.boxes, category, there)
        check_detections(self.name, "observe", detections, measurement.stamp_s)
        return detections


def box_chain(config: SensorConfig, seed: int) -> SensorChain[BoxMeasurement]:
    """The shipped sensor: ground truth with seeded errors."""
    return SensorChain(BoxSensor(config), BoxDetector(config, seed))


def observing_chain(config: SensorConfig, detector: ObjectDetector, name: str) -> SensorChain[ObservedWorld]:
    """A detector of one's own that observes ground truth, at the rate, phase and latency of a sensor."""
    timing = Timing(config.rate_hz, config.phase_s, config.latency_s)
    return SensorChain(PassThrough(timing), ObservingDetector(detector, name), name)
