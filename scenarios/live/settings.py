"""Settings of the perception of a stream."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from scenarios.errors import ScenarioError
from scenarios.live.detectors import LiveDetector
from scenarios.presets import Preset, named_preset
from scenarios.recorded import nuscenes
from scenarios.recorded.bags.reader import CLASSES
from scenarios.recorded.classes import ClassMap
from scenarios.recorded.simbev import reader as simbev
from scenarios.recorded.vehicles import Vehicle
from scenarios.ros.frames.poses import CARRY_S
from scenarios.ros.messages import VELOCITY_FRAMES
from scenarios.settings import Settings, preset_with
from smartmot.decision.shipped import PAPER_RULE
from smartmot.tracking.settings import TrackerConfig
from smartmot.types import CATEGORIES

OUTPUT_FRAMES = ("map", "sensor")
"""In which frame tracks are published: that of the odometry, or that of the detections."""

DATASETS: Mapping[str, ClassMap] = MappingProxyType(
    {
        "any": CLASSES,
        "simbev": simbev.CATEGORY_OF_CLASS,
        "nuscenes": nuscenes.CATEGORY_OF_CLASS,
    }
)
"""Classes of the data sets that detectors are trained on, as the tracker's categories; `any`: of both, as
recordings have them. The tracker's own names go with each of them."""

WAIT_S = 0.05
"""A frame waits so long for a pose that is not older: one interval of an odometry with 20 Hz."""


def class_names(dataset: str) -> ClassMap:
    """Category of each class name of a data set, and of the tracker's own."""
    return {**{name: name for name in CATEGORIES}, **DATASETS[dataset]}


@dataclass(frozen=True, slots=True)
class LiveSettings:
    """How a stream is seen and judged.

    Args:
        preset: name of the conditions; brakes, areas and tracker of it apply.
        strategy: name of the monitored area; None: map where there is one, else path.
        rule: name of the brake rule.
        settings: other parameters that depart from the preset.
        max_age: frames without a match that a track survives; None: the time of the preset's tracker.
        detection_th: detections with a lower score are dropped; None: the threshold of the preset's tracker.
        dataset: whose classes the detections have, one of `DATASETS`.
        velocity_frame: one of `VELOCITY_FRAMES`.
        output_frame: one of `OUTPUT_FRAMES`.
        vehicle: outline, and how far its middle is ahead of the origin of the vehicle's frame.
        sensor_pose: x, y, z (m) and yaw (rad) of the sensor in the vehicle's frame; None: as the transforms
            say.
        map_frame: frame of the poses where transforms alone have them.
        base_frame: the vehicle's frame where transforms alone have it; an odometry names its own.
        wait_s: time of receipt that a frame waits for a pose that is not older.
        carry_s: how long the last pose is carried on with its velocity and turn rate.
        detectors: several that go into one tracker; empty: there is one.

    Raises:
        ScenarioError: a name is unknown or a number is out of range.
    """

    preset: str = "real"
    strategy: str | None = None
    rule: str = PAPER_RULE
    settings: Settings = ()
    max_age: int | None = None
    detection_th: float | None = None
    dataset: str = "any"
    velocity_frame: str = "ignore"
    output_frame: str = "map"
    vehicle: Vehicle = field(default_factory=Vehicle)
    sensor_pose: tuple[float, float, float, float] | None = None
    map_frame: str = "map"
    base_frame: str = "base_link"
    wait_s: float = WAIT_S
    carry_s: float = CARRY_S
    detectors: tuple[LiveDetector, ...] = ()

    def __post_init__(self) -> None:
        names = (
            ("dataset", tuple(DATASETS)),
            ("velocity_frame", VELOCITY_FRAMES),
            ("output_frame", OUTPUT_FRAMES),
        )
        for name, allowed in names:
            if getattr(self, name) not in allowed:
                raise ScenarioError(
                    f"{name}: unknown {getattr(self, name)!r}; use one of: {', '.join(allowed)}"
                )
        if self.max_age is not None and self.max_age < 0:
            raise ScenarioError(f"max_age: expected a number of frames from 0 on, got {self.max_age}")
        if self.detection_th is not None and not 0.0 <= self.detection_th <= 1.0:
            raise ScenarioError(f"detection_th: expected a score in [0, 1], got {self.detection_th}")
        for name in ("wait_s", "carry_s"):
            if not 0.0 <= getattr(self, name) <= 10.0:
                raise ScenarioError(f"{name}: expected seconds in [0, 10], got {getattr(self, name)}")
        if self.sensor_pose is not None and not all(map(math.isfinite, self.sensor_pose)):
            raise ScenarioError(f"sensor_pose: every number must be finite, got {self.sensor_pose}")
        if self.detectors:
            self._check_detectors()

    def _check_detectors(self) -> None:
        """Refuse what a single detector alone can mean."""
        instead = {
            "max_age": "frames are of each detector; the tracker's times hold",
            "detection_th": "scores count relative to each detector's own, times its trust: say that there",
            "sensor_pose": "say it of each detector",
            "velocity_frame": "say it of each detector",
            "output_frame": "the detectors have frames of their own; leave it at map",
        }
        for name, why in instead.items():
            if getattr(self, name) != type(self).__dataclass_fields__[name].default:
                raise ScenarioError(f"{name}: not with several detectors: {why}")
        for each in self.detectors:
            if each.dataset is not None and each.dataset not in DATASETS:
                names = ", ".join(DATASETS)
                raise ScenarioError(
                    f"detector {each.name}: dataset: unknown {each.dataset!r}; use one of: {names}"
                )

    def preset_at(self, interval_s: float) -> Preset:
        """The preset for frames that come in an interval.

        Raises:
            ScenarioError, smartmot.errors.ConfigError: unknown preset, a setting is out of range, or a
                parameter of the tracker is given although it is the user's own.
        """
        rule: Settings = () if self.rule == PAPER_RULE else (("rule", self.rule),)
        preset = preset_with(named_preset(self.preset), (*self.settings, *rule))
        if self.max_age is None and self.detection_th is None:
            return preset
        tracker = preset.pipeline.tracker
        if not isinstance(tracker, TrackerConfig):
            raise ScenarioError("max_age and detection_th are parameters of our tracker, not of one's own")
        if self.detection_th is not None:
            tracker = replace(tracker, score_threshold=self.detection_th)
        if self.max_age is not None:
            # halfway to the next frame: stamps are not exactly one interval apart
            max_age_s = (self.max_age + 0.5) * interval_s
            lifecycle = replace(tracker.lifecycle, max_age_s=max_age_s, tentative_max_age_s=None)
            tracker = replace(tracker, lifecycle=lifecycle)
        return replace(preset, pipeline=replace(preset.pipeline, tracker=tracker))
