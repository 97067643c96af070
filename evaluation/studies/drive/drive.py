"""One drive: a recorded sequence, seen and judged with one strategy and one brake rule."""

from __future__ import annotations

import hashlib
import re
from bisect import bisect_right
from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.runs.execution import FrameTime, frame_time
from evaluation.studies.drive.verdicts import Verdict, judge
from scenarios.errors import DatasetError
from scenarios.presets import Preset, named_preset, pipeline_of, pose_errors_of, sensors_of
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.motion import RecordedMotion, motion_of
from scenarios.recorded.vehicles import Vehicle
from scenarios.settings import Settings, preset_with, setting_text, settings_text
from scenarios.simulation.log import RunLog
from scenarios.sources.frames import Frame, FrameSource, frames
from scenarios.sources.labelled import LabelledSource, without_detections
from scenarios.sources.perception import AreaPipelines, Perception, PipelineMaker, faulty_map
from scenarios.sources.pose_errors import NO_LOCALISATION_ERRORS
from scenarios.sources.recorded import RecordedSource
from scenarios.sources.requests import Request, RequestWatch, begun_anew
from scenarios.strategies import NamedStrategy
from smartmot.area import MonitoredArea, MonitoredAreaStrategy, RectangularArea, uses_path
from smartmot.detection_input import MAX_SPEED_MPS
from smartmot.maps.faulty import NO_MAP_ERRORS
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import RouteError
from smartmot.path import PlannedPath
from smartmot.pipeline import Pipeline
from smartmot.types import Boxes, EgoState, FloatArray

LABELS, DETECTIONS = "labels", "detections"
SEES = (LABELS, DETECTIONS)
"""What perception sees of a recording."""

LONGEST_GAP_S = 10.0
"""Between two frames of a drive; nothing can be said of what was met in a longer hole (assumed)."""

LEAST_INTERVAL_S = 0.01
"""Sensors of presets measure at whole multiples of it."""

RULE = "rule"
"""Parameter that chooses the brake rule."""

LONGEST_NAME = 180
"""Characters of a log's name: file systems take 255 bytes."""


@dataclass(frozen=True, slots=True)
class DriveSpec:
    """How a sequence is seen and judged.

    Args:
        strategy: name of the monitored area.
        rule: name of the brake rule.
        preset: name of the conditions; brakes, areas and tracker of it apply, and with labels its sensor.
        settings: parameters that depart from it, the rule among them.
        sees: one of `SEES`.
        seed: of the sensor's errors.
        vehicle: the recording vehicle.
    """

    strategy: str
    rule: str = "paper"
    preset: str = "real"
    settings: Settings = ()
    sees: str = DETECTIONS
    seed: int = 0
    vehicle: Vehicle = field(default_factory=Vehicle)

    def preset_for(self, sequence: Sequence) -> Preset:
        """The preset with the recording's rate, which is the sensor's, and the settings.

        Its errors of localisation are left out, since the recording has its own; those of the settings are
        put on top.

        Raises:
            ScenarioError, ConfigError: unknown preset, or a setting is out of range.
        """
        preset = named_preset(self.preset)
        steps = np.diff(sequence.stamp_s)
        interval_s = max(round(float(np.median(steps)) if len(steps) else 0.1, 2), LEAST_INTERVAL_S)
        sensor = replace(preset.sensor, rate_hz=1.0 / interval_s, phase_s=0.0)
        exact = replace(preset, sensor=sensor, localisation=NO_LOCALISATION_ERRORS)
        return preset_with(exact, self.settings)

    @property
    def text(self) -> str:
        """The settings as they are typed, the brake rule apart."""
        return settings_text(tuple(setting for setting in self.settings if setting[0] != RULE))

    def log_name(self, sequence: str, usual: Settings = ()) -> str:
        """Name of the log.

        Args:
            sequence: name of the recording.
            usual: settings that need not stand in it.
        """
        own = [setting_text(*s) for s in self.settings if s not in usual and s[0] != RULE]
        parts = (sequence, self.strategy, self.rule, *own, f"seed{self.seed}")
        name = re.sub(r"[^\w.=+-]+", "-", "_".join(parts))
        if len(name) <= LONGEST_NAME:
            return name
        digest = hashlib.sha256(name.encode()).hexdigest()[:8]
        return f"{name[: LONGEST_NAME - 9]}-{digest}"


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A finished drive.

    Args:
        spec: how it was seen.
        sequence: name of the recording.
        motion: how it went on.
        frames: how many were decided on.
        requests: with their verdicts, in the order of time.
        held_s: time in which a request was held, so that no other could begin.
        log: as columns, like that of a simulated run.
        spent: processor time of perception per frame.
        off_map: how often the way ran on no driving lane, of so many ways.
    """

    spec: DriveSpec
    sequence: str
    motion: RecordedMotion
    frames: int
    requests: tuple[tuple[Request, Verdict], ...]
    held_s: float
    log: dict[str, NDArray[Any]]
    spent: FrameTime
    off_map: tuple[int, int] = (0, 0)


def drivable(sequence: Sequence) -> Sequence:
    """The sequence with times from its first frame on.

    Raises:
        DatasetError: it has no poses or no frames, its times do not ascend, or no vehicle can have driven so.
    """
    if sequence.world_SE3_ego is None:
        raise DatasetError(f"sequence {sequence.name} has no ego poses, which decisions need")
    if len(sequence) < 2:
        raise DatasetError(f"sequence {sequence.name} has {len(sequence)} frames; a drive needs two or more")
    stamp_s = sequence.stamp_s
    if not np.isfinite(stamp_s).all():
        raise DatasetError(f"sequence {sequence.name}: frame times must be finite")
    late = np.flatnonzero(np.diff(stamp_s) <= 0.0)
    if len(late):
        k = int(late[0]) + 1
        raise DatasetError(
            f"sequence {sequence.name}: frame {sequence.frame_name[k]} ({stamp_s[k]:.6g} s) is not later "
            f"than the one before ({stamp_s[k - 1]:.6g} s); sort the frames by time"
        )
    _require_driven(sequence, stamp_s)
    return replace(sequence, stamp_s=stamp_s - stamp_s[0])


def _require_driven(sequence: Sequence, stamp_s: FloatArray) -> None:
    """Demand frames between which a vehicle can have driven; else exposure counts what was never driven.

    Raises:
        DatasetError: There is a hole in the recording, or the ego leaps.
    """
    elapsed_s = np.diff(stamp_s)
    speed_mps = np.hypot(*np.diff(sequence.ego_xy_yaw()[:, :2], axis=0).T) / elapsed_s
    for wrong, what in (
        (elapsed_s > LONGEST_GAP_S, "{0:.6g} s later than the one before; split the recording there"),
        (~(speed_mps <= MAX_SPEED_MPS), "reached at {1:.3g} m/s; are poses and times right?"),
    ):
        if wrong.any():
            k = int(np.argmax(wrong))
            text = what.format(elapsed_s[k], speed_mps[k])
            raise DatasetError(f"sequence {sequence.name}: frame {sequence.frame_name[k + 1]} is {text}")


def carry_out(
    sequence: Sequence,
    spec: DriveSpec,
    lane_map: LaneMap | None = None,
    done: Callable[[], None] = lambda: None,
) -> Drive:
    """See and judge one sequence; see `RecordedSource` and `Pipeline.step` for what it raises.

    Args:
        sequence: from `drivable`.
        spec: how.
        lane_map: the map, in the frame of the poses; None: there is none.
        done: called after each frame.

    Raises:
        DatasetError: there are no labels although perception is to see them, or the map does not cover the
            way.
        ScenarioError: the strategy needs a map, and there is none.
    """
    preset = spec.preset_for(sequence)
    vehicle = spec.vehicle
    motion = motion_of(sequence, vehicle.length_m, vehicle.width_m, vehicle.center_ahead_m)
    pipelines = _Pipelines.of(spec, preset)
    perception = Perception(pipelines)
    watch, log, errors = RequestWatch(preset.brakes), _TruthLog(motion), FrameErrors(preset, spec.seed)
    result = (source := source_of(sequence, spec, preset, lane_map)).start()
    anew = False
    while (frame := result.frame) is not None:
        perceived = errors.put_into(frame)
        decided = perception.step(perceived)
        if anew:
            decided = begun_anew(decided, frame.stamp_s)
        log.add(frame)
        log.run.perception(perceived.ego, decided)
        # tracks lie to the ego as it perceives itself; how fast it was is a matter of fact
        ego = replace(perceived.ego, speed_mps=frame.ego.speed_mps)
        anew = watch.see(replace(perceived, ego=ego), decided)
        if anew:
            perception.begin_anew()
        done()
        result = source.step(decided.command)
    if 0 < pipelines.made == pipelines.off_map:
        raise DatasetError(
            f"strategy {spec.strategy}, sequence {sequence.name}: the recorded way runs on no driving lane "
            "of the map; is it in the frame of the poses?"
        )
    judged = [
        (r, judge(motion, r.time_s, r.speed_mps, r.horizon_s, preset.brakes, r.decel_mps2))
        for r in watch.requests
    ]
    return Drive(
        spec,
        sequence.name,
        motion,
        len(perception.frame_time_ms),
        tuple(judged),
        watch.held_s,
        log.run.table(),
        frame_time(perception.frame_time_ms),
        (pipelines.off_map, pipelines.made),
    )


def source_of(sequence: Sequence, spec: DriveSpec, preset: Preset, lane_map: LaneMap | None) -> FrameSource:
    """Frames of a sequence, with the way that was driven up to the forecast's horizon as the planned path."""
    labelled = spec.sees == LABELS
    vehicle = spec.vehicle
    recorded = RecordedSource(
        without_detections(sequence) if labelled else sequence,
        lane_map,
        hindsight_s=preset.pipeline.forecast.max_horizon_s,
        length_m=vehicle.length_m,
        width_m=vehicle.width_m,
        center_ahead_m=vehicle.center_ahead_m,
    )
    return LabelledSource(sequence, sensors_of(preset, spec.seed), recorded) if labelled else recorded


class FrameErrors:
    """Errors of map, localisation and odometry that were asked for, put into the frames of a drive.

    Args:
        preset: with the errors.
        seed: of what is drawn.
    """

    def __init__(self, preset: Preset, seed: int) -> None:
        self._map_errors, self._pose_errors = preset.map_errors, pose_errors_of(preset, seed)
        self._path: PlannedPath | None = None
        self._faulty: LaneMap | None = None

    def put_into(self, frame: Frame) -> Frame:
        """A frame as the ego perceives it; frames come in the order of time."""
        frame = self.with_faulty_map(frame)
        return frame if self._pose_errors is None else self._pose_errors.perceived(frame)

    def with_faulty_map(self, frame: Frame) -> Frame:
        """A frame with the map as perception has it."""
        if self._map_errors == NO_MAP_ERRORS or frame.lane_map is None or frame.path is None:
            return frame
        if frame.path is not self._path:
            self._path = frame.path
            self._faulty = faulty_map(frame.lane_map, frame.path, self._map_errors)
        return replace(frame, lane_map=self._faulty)


class DrivenArea:
    """The monitored area of a drive, whose map view and path change on the way.

    Args:
        name: of the strategy.
        parts: from when on which strategy watches, and the path that it is given.
    """

    def __init__(
        self, name: str, parts: Many[tuple[float, MonitoredAreaStrategy, PlannedPath | None]]
    ) -> None:
        self.name, self._parts = name, tuple(parts)
        self._from_s = [time_s for time_s, *_ in self._parts]

    def at(self, ego: EgoState) -> MonitoredArea:
        """The monitored area around `ego`, by its time."""
        part = self._parts[max(bisect_right(self._from_s, ego.stamp_s + 1e-6) - 1, 0)]
        _, strategy, path = part
        along = {"path": path} if uses_path(strategy) and "path" in signature(strategy.at).parameters else {}
        return strategy.at(ego, **along)


def driven_area(sequence: Sequence, spec: DriveSpec, lane_map: LaneMap | None) -> DrivenArea:
    """The monitored area of a drive, without driving it; see `carry_out` for what it raises.

    It lies on the map as perception has it, and where it would be without errors of the localisation.
    """
    preset = spec.preset_for(sequence)
    pipelines, errors = _Pipelines.of(spec, preset), FrameErrors(preset, spec.seed)
    parts: list[tuple[float, MonitoredAreaStrategy, PlannedPath | None]] = []
    of_vehicle = replace(spec, sees=DETECTIONS)
    for frame in frames(source_of(without_detections(sequence), of_vehicle, preset, lane_map)):
        if not parts or frame.path is not parts[-1][2]:
            strategy = pipelines(errors.with_faulty_map(frame)).strategy
            parts.append((frame.stamp_s, strategy, frame.path))
    return DrivenArea(spec.strategy, parts)


class _Pipelines:
    """Makes the pipelines of a drive; where the way runs on no driving lane, that of the rectangle."""

    def __init__(self, of_area: PipelineMaker, preset: Preset) -> None:
        self._of_area, self._preset = of_area, preset
        self.made = self.off_map = 0

    @classmethod
    def of(cls, spec: DriveSpec, preset: Preset) -> _Pipelines:
        """Those of a strategy."""
        strategy = NamedStrategy(spec.strategy, preset)
        return cls(AreaPipelines(strategy, pipeline_of(preset), preset.path_from), preset)

    def __call__(self, frame: Frame) -> Pipeline:
        self.made += 1
        try:
            return self._of_area(frame)
        except RouteError:
            self.off_map += 1
            config = pipeline_of(self._preset)
            return Pipeline(RectangularArea(self._preset.rectangular, config.braking_distance), config)


class _TruthLog:
    """The log of a drive: the recorded vehicle and the labelled objects at every decision."""

    def __init__(self, motion: RecordedMotion) -> None:
        labels = motion.labels
        category = np.zeros(0, dtype=np.str_) if labels is None else labels.category
        self.run = RunLog(category, np.full(len(category), "other"))
        self._motion = motion
        self._speed_mps = np.zeros(0) if labels is None else labels.speed_mps

    def add(self, frame: Frame) -> None:
        """The truth at a frame."""
        ego, labels = self._motion.ego, self._motion.labels
        accel = float(ego.accel_mps2(np.array([frame.stamp_s]))[0])
        state: EgoState = replace(frame.ego, accel_mps2=0.0 if np.isnan(accel) else accel)
        none = np.zeros(0, dtype=np.int64)
        if labels is None:
            self.run.frame(state, _NO_BOXES, np.zeros(0), none)
            return
        after = int(np.searchsorted(ego.time_s, frame.stamp_s - 1e-6))
        rows = labels.rows[min(after, len(labels.rows) - 1)]
        index, moving = labels.index[rows], labels.labels
        # labels are at frames; a decision between two has those of the next, moved back
        shift = (frame.stamp_s - float(ego.time_s[after])) * labels.velocity_mps[rows]
        boxes = Boxes(moving.center_m[rows] + shift, moving.size_m[rows], moving.yaw_rad[rows])
        self.run.frame(state, boxes, self._speed_mps[rows], index)


_NO_BOXES = Boxes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
