"""Perception of a stream: messages in, in the order in which they arrive, and what is published out.

Frames of detections wait until the vehicle's pose at their stamp is known, and are then tracked and judged in
the order of their stamps. What comes out depends on stamps and contents alone, as long as every message
arrives within `LiveSettings.wait_s` of the frames that need it, and the messages of each topic in order.

How to use it::

    perception = LivePerception(LiveSettings())
    for message in messages:  # of scenarios.ros.messages
        for output in perception.take(message):
            ...
    for output in perception.finish():
        ...
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from scenarios.live.counts import Counts, Diagnostics, DiagnosticWatch
from scenarios.live.outputs import (
    LIFETIME_FRAMES,
    Decision,
    FrameOutput,
    MarkerBoard,
    TrackedBoxes,
    area_markers,
    track_markers,
)
from scenarios.live.placing import Heights, PlacedFrame, place
from scenarios.live.settings import LiveSettings
from scenarios.live.velocities import VelocityCheck
from scenarios.live.ways import Ways
from scenarios.recorded.classes import ClassMap
from scenarios.recorded.poses import heading
from scenarios.ros.frames.localisation import Localisation
from scenarios.ros.frames.poses import VehiclePose
from scenarios.ros.frames.transforms import inverse, placed
from scenarios.ros.messages import DetectionMessage, Message, OdometryMessage, TransformMessage
from scenarios.sources.frames import Frame
from scenarios.sources.requests import EMERGENCY, RequestWatch, begun_anew
from smartmot.area.monitored import MonitoredArea, ego_extent
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineState
from smartmot.tracking.state import TrackerState
from smartmot.types import EgoState, FloatArray, Tracks

LATE_LIMIT = 10
"""After so many late frames in a row, each newer than the one before, time has gone back: a bag begins anew,
or a single frame had a stamp of the future."""

MOST_WAITING = 100
"""Frames that wait at most, whatever the times of receipt say: 2 s at 50 Hz."""

_RATE_INTERVALS = 5
"""The frame rate is the median of so many intervals; until they are there, the preset's."""
_LIFETIME_INTERVALS = 9
"""Lifetimes of markers follow the median of so many."""
_LONGEST_LIFETIME_S = 2.0
_DIAGNOSTICS_NS = 1_000_000_000
"""A status every second."""
_NS = 1e-9

Output = FrameOutput | Diagnostics
"""What is published: for a frame, or once a second."""


@dataclass(frozen=True, slots=True, eq=False)
class _Waiting:
    """A frame that waits, and when the vehicle was where it saw it."""

    message: DetectionMessage
    pose_ns: int


class LivePerception:
    """Perception and decision of a stream.

    Args:
        settings: how.
        lane_map: the map, in the frame of the odometry; None: there is none.
        classes: category of each class, in small letters; None: as the settings say.

    Raises:
        ScenarioError, smartmot.errors.SmartMotError: a setting is wrong, or the strategy needs a map.

    Attributes:
        settings: how.
        counts: what came, and what was left out.
        localisation: where the vehicle is.
        velocities: whether the detector's velocities are in the axes that were chosen.
    """

    def __init__(
        self, settings: LiveSettings, lane_map: LaneMap | None = None, classes: ClassMap | None = None
    ) -> None:
        self.settings, self.counts = settings, Counts()
        self.localisation = Localisation(settings)
        self.velocities = VelocityCheck()
        self._classes = settings.classes if classes is None else classes
        self._ways = Ways(settings, lane_map)
        self._status = DiagnosticWatch()
        self._boxes, self._areas = MarkerBoard(), MarkerBoard()
        self._waiting: list[_Waiting] = []
        self._now_ns: int | None = None
        self._status_ns = 0
        self._sensor = ""
        self._next_id = 1
        self._begin()

    def _begin(self) -> None:
        """Forget tracks and decisions; identifiers go on. What is shown is deleted with the next frame."""
        self._state: PipelineState | None = None
        self._has_pose = False
        self._watch = RequestWatch(self._ways.preset.brakes)
        self._anew = False
        self._heights = Heights()
        self._last_ns: int | None = None
        self._late_ns: list[int] = []
        self._intervals: deque[int] = deque(maxlen=_LIFETIME_INTERVALS)

    @property
    def strategy(self) -> str:
        """Name of the monitored area."""
        return self._ways.strategy

    def take(self, message: Message, static: bool = False) -> list[Output]:
        """Take the next message.

        Args:
            message: of any topic.
            static: whether it is of `/tf_static`.

        Returns:
            What can be published now.
        """
        # what should have been published before is, without looking at this message
        outputs = [] if self._now_ns is None else self.advance(message.received_ns - 1)
        if isinstance(message, DetectionMessage):
            self._arrive(message)
        elif isinstance(message, OdometryMessage):
            self.localisation.add_odometry(message)
        elif isinstance(message, TransformMessage):
            self.localisation.add_transforms(message, static)
        else:
            self.counts.other_messages += 1
        return [*outputs, *self.advance(message.received_ns)]

    def advance(self, now_ns: int) -> list[Output]:
        """Go on to a time of receipt at which no message came; a live node calls it by a timer.

        Returns:
            What can be published now: frames that have waited long enough, and a status every second.
        """
        if self._now_ns is None or now_ns < self._now_ns - _DIAGNOSTICS_NS:  # a simulation begins anew
            self._now_ns, self._status_ns = now_ns, now_ns + _DIAGNOSTICS_NS
        self._now_ns = max(self._now_ns, now_ns)
        outputs: list[Output] = list(self._answers(self._now_ns))
        if self._now_ns >= self._status_ns:
            due_ns = self._now_ns - (self._now_ns - self._status_ns) % _DIAGNOSTICS_NS
            outputs.append(self._status.status(self.counts, due_ns))
            self._status_ns = due_ns + _DIAGNOSTICS_NS
        return outputs

    def finish(self) -> list[Output]:
        """Answer the frames that still wait, and give a last status."""
        if self._now_ns is None:
            return []
        outputs: list[Output] = list(self._answers(None))
        if outputs or self._now_ns > self._status_ns - _DIAGNOSTICS_NS:
            outputs.append(self._status.status(self.counts, self._now_ns))
        return outputs

    def _arrive(self, message: DetectionMessage) -> None:
        """Let a frame wait, unless it is late."""
        self.counts.frames += 1
        self.counts.unstamped += message.stamp_ns is None
        stamp_ns = message.time_ns
        if self._last_ns is not None and stamp_ns <= self._last_ns:
            self.counts.late += 1
            ascending = bool(self._late_ns) and stamp_ns > self._late_ns[-1]
            self._late_ns = [*self._late_ns, stamp_ns] if ascending else [stamp_ns]
            if len(self._late_ns) < LATE_LIMIT:
                return
            self.counts.late += len(self._waiting) - 1
            self.counts.restarts += 1
            self.localisation.forget_after(stamp_ns)
            self._waiting.clear()
            self._begin()
        self._late_ns = []
        later = [k for k, other in enumerate(self._waiting) if other.message.time_ns > stamp_ns]
        waiting = _Waiting(message, self.localisation.pose_time_ns(message))
        self._waiting.insert(later[0] if later else len(self._waiting), waiting)

    def _answers(self, now_ns: int | None) -> list[FrameOutput]:
        """Answers to the frames that need not wait any longer; None: to all."""
        answers = []
        wait_ns = round(self.settings.wait_s / _NS)
        while self._waiting:
            message, pose_ns = self._waiting[0].message, self._waiting[0].pose_ns
            sensor = message.frame_id or self._sensor
            waits = (
                now_ns is not None
                and now_ns - message.received_ns < wait_ns
                and len(self._waiting) <= MOST_WAITING
            )
            if waits and not self.localisation.complete(sensor, pose_ns):
                break
            del self._waiting[0]
            answer = self._answer(message, pose_ns, sensor)
            if answer is not None:
                answers.append(answer)
        return answers

    def _answer(self, message: DetectionMessage, pose_ns: int, sensor: str) -> FrameOutput | None:
        """Track and judge a frame; None: it is late, or nobody knows where it is."""
        stamp_ns, counts = message.time_ns, self.counts
        if self._last_ns is not None and stamp_ns <= self._last_ns:
            counts.late += 1
            return None
        self._sensor = sensor
        counts.unnamed += not sensor
        self.localisation.decide(sensor, pose_ns)
        pose = self.localisation.pose(pose_ns)
        if pose is None:
            counts.without_pose += 1
            if self._has_pose:  # tracks live in another frame than this one's boxes
                return None
            # a sensor without a name has no frame of its own to be shown in
            own = np.eye(4) if sensor else self.localisation.base_SE3_sensor(sensor, pose_ns)
            return self._seen(message, stamp_ns, None, own)
        if not self._has_pose:
            self._forget_tracks()
        self._has_pose = True
        counts.carried += pose.carried
        if sensor in self.localisation.assumed:
            counts.without_transform[sensor] += 1
        sensor_pose = pose.map_SE3_base @ self.localisation.base_SE3_sensor(sensor, pose_ns)
        return self._seen(message, stamp_ns, pose, sensor_pose)

    def _forget_tracks(self) -> None:
        """Begin to track in another frame."""
        self._state = None
        self._heights = Heights()

    def _seen(
        self, message: DetectionMessage, stamp_ns: int, pose: VehiclePose | None, map_SE3_sensor: FloatArray
    ) -> FrameOutput:
        """The answer to a frame whose sensor is at a pose, in the frame of the tracks."""
        self._measure_interval(stamp_ns)
        frame = place(
            message,
            stamp_ns,
            map_SE3_sensor,
            self._classes,
            "ignore" if pose is None else self.settings.velocity_frame,
            self.counts,
        )
        ego = self._ego(stamp_ns, pose)
        path: PlannedPath | None = None
        if pose is None:
            pipeline = self._ways.without_pose
        else:
            pipeline, on_map = self._ways.pipeline(ego)
            self.counts.off_map += not on_map
            path = self._ways.path(ego)
        result = self._step(pipeline, frame, ego, path)
        self._last_ns = stamp_ns
        self.counts.tracked += 1
        decision = None
        if pose is not None:
            self.velocities.see(stamp_ns, result.tracks, frame, map_SE3_sensor)
            decision = self._decide(pipeline, frame, ego, path, result, float(pose.map_SE3_base[2, 3]))
        shown = pose.map_SE3_base if pose is not None and not self._sensor else map_SE3_sensor
        return self._output(message, stamp_ns, self._tracked(result.tracks, frame), decision, shown)

    def _step(
        self, pipeline: Pipeline, frame: PlacedFrame, ego: EgoState, path: PlannedPath | None
    ) -> FrameResult:
        state = self._state
        if state is None:
            state = pipeline.initial()
            if isinstance(state.tracker, TrackerState):
                state = replace(state, tracker=replace(state.tracker, next_id=self._next_id))
        self._state, result = pipeline.step(state, frame.detections, ego, path)
        if isinstance(self._state.tracker, TrackerState):
            self._next_id = self._state.tracker.next_id
        limits = pipeline.score_limits(self._state.tracker)
        if limits is not None:
            self.counts.under_threshold += limits.counts(frame.detections)[0]
        return result

    def _decide(
        self,
        pipeline: Pipeline,
        frame: PlacedFrame,
        ego: EgoState,
        path: PlannedPath | None,
        result: FrameResult,
        level_m: float,
    ) -> Decision:
        """What the rule asks for; it begins anew where the vehicle should stand by now, and drives on."""
        self.counts.decided += 1
        if self._anew:
            result = begun_anew(result, ego.stamp_s)
        known = len(self._watch.requests)
        self._anew = self._watch.see(Frame(ego.stamp_s, ego, frame.detections, path=path), result)
        if self._anew and self._state is not None:
            self._state = replace(self._state, rule=None)
        requests = tuple(self._watch.requests[known:])
        self.counts.requests += sum(request.kind == EMERGENCY for request in requests)
        monitored = pipeline.area(ego, path)
        gaps = [*result.threats.gap_m.tolist(), *([] if result.lead is None else [result.lead.gap_m])]
        gaps += _new_gaps_m(monitored, result.tracks, ego)
        area = tuple(
            (role, np.column_stack((ring, np.full(len(ring), level_m))))
            for role, ring in monitored.polygons()
        )
        return Decision(result.command.emergency, min(gaps, default=None), area, requests)

    def _tracked(self, tracks: Tracks, frame: PlacedFrame) -> TrackedBoxes:
        """The confirmed tracks as boxes with height."""
        ids = tracks.track_id.tolist()
        bottom, height = self._heights.of(ids, tracks.boxes, tracks.coasted_s <= 0.0, frame)
        shown = tracks.confirmed.nonzero()[0]
        self.counts.tracks = max(self.counts.tracks, max(tracks.track_id[shown].tolist(), default=0))
        middle = bottom + 0.5 * height
        return TrackedBoxes(
            tracks.track_id[shown],
            tracks.category[shown],
            tracks.score[shown],
            np.column_stack((tracks.boxes.center_m, middle))[shown],
            np.column_stack((tracks.boxes.size_m, height))[shown],
            tracks.boxes.yaw_rad[shown],
            tracks.velocity_mps[shown],
            tracks.dynamic[shown],
            None if tracks.existence is None else tracks.existence[shown],
        )

    def _output(
        self,
        message: DetectionMessage,
        stamp_ns: int,
        tracks: TrackedBoxes,
        decision: Decision | None,
        map_SE3_own: FloatArray,
    ) -> FrameOutput:
        """What is published, in the frame that is asked for.

        Args:
            message: the frame.
            stamp_ns: of the frame.
            tracks: frame of the odometry; without a decision that of the sensor.
            decision: None without a pose.
            map_SE3_own: (4, 4) pose of the sensor; of the vehicle's frame where the sensor has no name.
        """
        own_frame = self._sensor or self.localisation.base_frame
        frame_id = own_frame if decision is None else self.localisation.frame_id
        if decision is not None and self.settings.output_frame == "sensor":
            frame_id, back = own_frame, inverse(map_SE3_own)
            tracks = tracks.seen_from(back)
            area = tuple((role, placed(back, ring)) for role, ring in decision.area)
            decision = replace(decision, area=area)
        lifetime_s = self._lifetime_s()
        return FrameOutput(
            stamp_ns,
            message.received_ns,
            frame_id,
            tracks,
            self._boxes.show(track_markers(tracks, lifetime_s)),
            decision,
            self._areas.show(area_markers(() if decision is None else decision.area, lifetime_s)),
        )

    def _ego(self, stamp_ns: int, pose: VehiclePose | None) -> EgoState:
        """The vehicle; without a pose it stands at the origin of its own frame."""
        vehicle = self.settings.vehicle
        outline = {"length_m": vehicle.length_m, "width_m": vehicle.width_m}
        if pose is None:
            return EgoState(stamp_ns * _NS, 0.0, 0.0, 0.0, 0.0, **outline)
        x_m, y_m = pose.map_SE3_base[:2, 3].tolist()
        yaw_rad = float(heading(pose.map_SE3_base[None])[0])
        return EgoState(
            stamp_ns * _NS,
            x_m + vehicle.center_ahead_m * float(np.cos(yaw_rad)),
            y_m + vehicle.center_ahead_m * float(np.sin(yaw_rad)),
            yaw_rad,
            pose.forward_mps,
            yaw_rate_radps=pose.yaw_rate_radps,
            **outline,
        )

    def _measure_interval(self, stamp_ns: int) -> None:
        if self._last_ns is None:
            return
        self._intervals.append(stamp_ns - self._last_ns)
        if len(self._intervals) == _RATE_INTERVALS:
            self._ways.frames_every(self._interval_s())

    def _interval_s(self) -> float:
        """Median of the last intervals between frames; before the second frame that of the preset."""
        if not self._intervals:
            return 1.0 / self._ways.preset.sensor.rate_hz
        return sorted(self._intervals)[len(self._intervals) // 2] * _NS

    def _lifetime_s(self) -> float:
        return min(LIFETIME_FRAMES * self._interval_s(), _LONGEST_LIFETIME_S)


def _new_gaps_m(area: MonitoredArea, tracks: Tracks, ego: EgoState) -> list[float]:
    """Free distances from the vehicle's front to what is in its way and was seen once.

    Of these no motion is known yet, so that no decision rests on them; where they are is known.
    """
    new = (tracks.confirmed & (tracks.age_s <= tracks.coasted_s)).nonzero()[0]
    if not len(new):
        return []
    boxes = tracks.boxes[new]
    gap_m = ego_extent(boxes, ego)[0] - 0.5 * ego.length_m
    shown: list[float] = gap_m[area.relevance(boxes, tracks.category[new]).on_way & (gap_m > 0.0)].tolist()
    return shown
