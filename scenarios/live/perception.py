"""Perception of a stream: messages in, in the order in which they arrive, and what is published out.

Frames of detections wait until the vehicle's pose at their stamp is known, and are then tracked and judged in
the order of their stamps. One of several detectors that comes after a newer one counts at its own time, and
leads to a new answer at the newest. What comes out depends on stamps and contents alone, as long as every
message arrives within `LiveSettings.wait_s` of the frames that need it, and those of each topic in order.

How to use it::

    perception = LivePerception(LiveSettings())
    for message in messages:  # of scenarios.ros.messages
        for output in perception.take(message):
            ...
    for output in perception.finish():
        ...
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarios.live.counts import Counts, Diagnostics, DiagnosticWatch, summed
from scenarios.live.detectors import LiveDetector, own_frame
from scenarios.live.fusion import Fusion, MadeTracks
from scenarios.live.outputs import (
    LIFETIME_FRAMES,
    Decision,
    FrameOutput,
    MarkerBoard,
    TrackedBoxes,
    area_markers,
    new_gaps_m,
    track_markers,
)
from scenarios.live.placing import Heights, PlacedFrame, place
from scenarios.live.rates import FrameRates
from scenarios.live.settings import LiveSettings, class_names
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
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineState
from smartmot.tracking.state import TrackerState
from smartmot.types import Detections, EgoState, FloatArray, Tracks

LATE_LIMIT = 10
"""After so many late frames in a row, each newer than the one before, time has gone back: a bag begins anew,
or a single frame had a stamp of the future."""

MOST_WAITING = 100
"""Frames that wait at most, whatever the times of receipt say: 2 s at 50 Hz."""

_RATE_INTERVALS = 5
"""The frame rate is the median of so many intervals; until they are there, the preset's."""
_LONGEST_LIFETIME_S = 2.0
_DIAGNOSTICS_NS = 1_000_000_000
"""A status every second."""
_NS = 1e-9

Output = FrameOutput | Diagnostics
"""What is published: for a frame, or once a second."""


@dataclass(frozen=True, slots=True, eq=False)
class _Waiting:
    """A frame that waits, when the vehicle was where it saw it, and whose it is."""

    message: DetectionMessage
    pose_ns: int
    detector: str


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """Where the vehicle was at the time of a frame; None: no pose is known."""

    stamp_ns: int
    pose: VehiclePose | None
    ego: EgoState


class LivePerception:
    """Perception and decision of a stream.

    Args:
        settings: how.
        lane_map: the map, in the frame of the odometry; None: there is none.
        classes: category of classes, in small letters, beside and before those of the settings.

    Raises:
        ScenarioError, smartmot.errors.SmartMotError: a setting is wrong, or the strategy needs a map.

    Attributes:
        settings: how.
        counts_of: what came, and what was left out, by detector; of a single one under "".
        localisation: where the vehicle is.
        velocities: whether velocities are in the axes that were chosen, by detector.
    """

    def __init__(
        self, settings: LiveSettings, lane_map: LaneMap | None = None, classes: ClassMap | None = None
    ) -> None:
        self.settings = settings
        self._detectors: dict[str, LiveDetector] = {each.name: each for each in settings.detectors}
        self._common = Counts()
        self.counts_of = {name: Counts() for name in self._detectors} or {"": self._common}
        given = {own_frame(each): each.sensor_pose for each in settings.detectors if each.sensor_pose}
        self.localisation = Localisation(settings, given=given)
        self.velocities = {name: VelocityCheck() for name in self.counts_of}
        datasets = dict.fromkeys(self.counts_of, settings.dataset) | {
            each.name: each.dataset for each in settings.detectors if each.dataset is not None
        }
        self._classes = {name: {**class_names(of), **(classes or {})} for name, of in datasets.items()}
        self._ways = Ways(settings, lane_map)
        self._fusion = Fusion(settings.detectors, self._ways.config) if settings.detectors else None
        self._buffer_ns = 0 if self._fusion is None else self._fusion.buffer_ns
        self._status = DiagnosticWatch()
        self._boxes, self._areas = MarkerBoard(), MarkerBoard()
        self._waiting: list[_Waiting] = []
        self._now_ns: int | None = None
        self._status_ns = 0
        self._sensor = ""
        self._sensors: dict[str, str] = {}
        self._next_id = 1
        self._begin()

    def _begin(self) -> None:
        """Forget tracks and decisions; identifiers go on. What is shown is deleted with the next frame."""
        self._has_pose = False
        self._watch = RequestWatch(self._ways.preset.brakes)
        self._anew = False
        self._forget_tracks()
        self._last_ns: int | None = None
        self._late_ns: list[int] = []
        self._rates = FrameRates(1.0 / self._ways.preset.sensor.rate_hz)

    @property
    def counts(self) -> Counts:
        """What came, and what was left out, of all detectors together."""
        return self._common if self._fusion is None else summed([self._common, *self.counts_of.values()])

    @property
    def strategy(self) -> str:
        """Name of the monitored area."""
        return self._ways.strategy

    def take(self, message: Message, static: bool = False, detector: str = "") -> list[Output]:
        """Take the next message.

        Args:
            message: of any topic.
            static: whether it is of `/tf_static`.
            detector: whose boxes they are, where the settings name several.

        Returns:
            What can be published now.
        """
        # what should have been published before is, without looking at this message
        outputs = [] if self._now_ns is None else self.advance(message.received_ns - 1)
        if isinstance(message, DetectionMessage):
            self._arrive(message, detector)
        elif isinstance(message, OdometryMessage):
            self.localisation.add_odometry(message)
        elif isinstance(message, TransformMessage):
            self.localisation.add_transforms(message, static)
        else:
            self._common.other_messages += 1
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
            outputs.append(self._status_at(due_ns))
            self._status_ns = due_ns + _DIAGNOSTICS_NS
        return outputs

    def finish(self) -> list[Output]:
        """Answer the frames that still wait, and give a last status."""
        if self._now_ns is None:
            return []
        outputs: list[Output] = list(self._answers(None))
        if outputs or self._now_ns > self._status_ns - _DIAGNOSTICS_NS:
            outputs.append(self._status_at(self._now_ns))
        return outputs

    def _status_at(self, stamp_ns: int) -> Diagnostics:
        return self._status.status(self.counts, stamp_ns, {} if self._fusion is None else self.counts_of)

    def _arrive(self, message: DetectionMessage, detector: str) -> None:
        """Let a frame wait, unless it is late."""
        counts = self.counts_of[detector]
        counts.frames += 1
        counts.unstamped += message.stamp_ns is None
        stamp_ns = message.time_ns
        if self._is_late(stamp_ns):
            counts.late += 1
            ascending = bool(self._late_ns) and stamp_ns > self._late_ns[-1]
            self._late_ns = [*self._late_ns, stamp_ns] if ascending else [stamp_ns]
            if len(self._late_ns) < LATE_LIMIT or self._late_ns[-1] - self._late_ns[0] < self._buffer_ns:
                return
            for other in self._waiting:
                self.counts_of[other.detector].late += 1
            counts.late -= 1
            self._common.restarts += 1
            self.localisation.forget_after(stamp_ns)
            self._waiting.clear()
            self._begin()
        self._late_ns = []
        later = [k for k, other in enumerate(self._waiting) if other.message.time_ns > stamp_ns]
        waiting = _Waiting(message, self.localisation.pose_time_ns(message), detector)
        self._waiting.insert(later[0] if later else len(self._waiting), waiting)

    def _is_late(self, stamp_ns: int) -> bool:
        """Whether a frame is older than what the tracker takes; several detectors may see at one time."""
        if self._last_ns is None:
            return False
        behind_ns = self._last_ns - stamp_ns
        return behind_ns >= 0 if self._fusion is None else behind_ns > self._buffer_ns

    def _answers(self, now_ns: int | None) -> list[FrameOutput]:
        """Answers to the frames that need not wait any longer; None: to all."""
        answers = []
        wait_ns = round(self.settings.wait_s / _NS)
        while self._waiting:
            message, pose_ns = self._waiting[0].message, self._waiting[0].pose_ns
            sensor = self._sensor_of(message, self._waiting[0].detector)
            waits = (
                now_ns is not None
                and now_ns - message.received_ns < wait_ns
                and len(self._waiting) <= MOST_WAITING
            )
            if waits and not self.localisation.complete(sensor, pose_ns):
                break
            answer = self._answer(message, pose_ns, sensor, self._waiting.pop(0).detector)
            if answer is not None:
                answers.append(answer)
        return answers

    def _sensor_of(self, message: DetectionMessage, detector: str) -> str:
        """Frame of the sensor of a message; one without a name has the sensor of the one before."""
        own = self._detectors.get(detector)
        if own is not None and own.sensor_pose is not None:
            return own_frame(own)
        return message.frame_id or self._sensors.get(detector, "")

    def _answer(
        self, message: DetectionMessage, pose_ns: int, sensor: str, detector: str
    ) -> FrameOutput | None:
        """Track and judge a frame; None: it is late or left out, or nobody knows where it is."""
        stamp_ns, counts = message.time_ns, self.counts_of[detector]
        if self._is_late(stamp_ns):
            counts.late += 1
            return None
        self._sensors[detector] = sensor
        # the tracks of several detectors are in no sensor's frame
        self._sensor = sensor if self._fusion is None else ""
        counts.unnamed += not sensor
        self.localisation.decide(sensor, pose_ns)
        pose = self.localisation.pose(pose_ns)
        if pose is None:
            counts.without_pose += 1
            if self._has_pose:  # tracks live in another frame than this one's boxes
                return None
            # a sensor without a name has no frame of its own to be shown in
            own = np.eye(4) if self._sensor else self.localisation.base_SE3_sensor(sensor, pose_ns)
            return self._seen(message, detector, _Moment(stamp_ns, None, self._ego(stamp_ns, None)), own)
        if not self._has_pose:
            self._forget_tracks()
        self._has_pose = True
        counts.carried += pose.carried
        if sensor in self.localisation.assumed:
            counts.without_transform[sensor] += 1
        sensor_pose = pose.map_SE3_base @ self.localisation.base_SE3_sensor(sensor, pose_ns)
        return self._seen(message, detector, _Moment(stamp_ns, pose, self._ego(stamp_ns, pose)), sensor_pose)

    def _forget_tracks(self) -> None:
        """Begin to track, perhaps in another frame."""
        self._state: PipelineState | None = None
        self._heights = Heights()
        self._moments: dict[float, _Moment] = {}
        self._pipeline: Pipeline | None = None
        self._on_map = True
        if self._fusion is not None:
            self._fusion.begin(self._next_id)

    def _seen(
        self, message: DetectionMessage, detector: str, moment: _Moment, map_SE3_sensor: FloatArray
    ) -> FrameOutput | None:
        """The answer to a frame whose sensor is at a pose, frame of the tracks; None: it is left out."""
        known = self._rates.see(moment.stamp_ns, detector)
        if known == _RATE_INTERVALS and self._fusion is None:
            self._ways.frames_every(self._rates.interval_s)
        counts = self.counts_of[detector]
        velocity_frame = self._detectors.get(detector, self.settings).velocity_frame
        frame = place(
            message,
            moment.stamp_ns,
            map_SE3_sensor,
            self._classes[detector],
            "ignore" if moment.pose is None else velocity_frame,
            counts,
        )
        pipeline = self._pipeline_of(moment, counts)
        if self._fusion is None:
            result = self._step(pipeline, frame.detections, moment.ego, self._path(moment))
            assert self._state is not None
            limits = pipeline.score_limits(self._state.tracker)
            if limits is not None:
                counts.under_threshold += limits.counts(frame.detections)[0]
            seen = moment
        else:
            fused = self._fused(pipeline, frame, moment, detector)
            if fused is None:
                return None
            result, seen = fused
        then = (
            result.tracks
            if seen is moment or self._fusion is None
            else self._fusion.at(frame.detections.stamp_s)
        )
        if then is not None:
            self._heights.see(then, frame)
        self._last_ns = seen.stamp_ns
        counts.tracked += 1
        decision = None
        if seen.pose is not None:
            if seen is moment:
                self.velocities[detector].see(seen.stamp_ns, result.tracks, frame, map_SE3_sensor)
            level_m = float(seen.pose.map_SE3_base[2, 3])
            decision = self._decide(pipeline, result, seen.ego, self._path(seen), level_m)
        shown = seen.pose.map_SE3_base if seen.pose is not None and not self._sensor else map_SE3_sensor
        return self._output(message, seen.stamp_ns, self._tracked(result.tracks), decision, shown)

    def _path(self, moment: _Moment) -> PlannedPath | None:
        return None if moment.pose is None else self._ways.path(moment.ego)

    def _pipeline_of(self, moment: _Moment, counts: Counts) -> Pipeline:
        """The pipeline of a frame; one that comes after a newer one is seen with that one's."""
        behind = self._last_ns is not None and moment.stamp_ns < self._last_ns
        if self._pipeline is None or not behind:
            if moment.pose is None:
                self._pipeline, self._on_map = self._ways.without_pose, True
            else:
                self._pipeline, self._on_map = self._ways.pipeline(moment.ego)
        counts.off_map += not self._on_map
        counts.behind += behind
        return self._pipeline

    def _fused(
        self, pipeline: Pipeline, frame: PlacedFrame, moment: _Moment, detector: str
    ) -> tuple[FrameResult, _Moment] | None:
        """Result at the newest time of all measurements, and the vehicle then; None: this one is left out."""
        assert self._fusion is not None
        detections = replace(frame.detections, detector=detector)
        self._moments[detections.stamp_s] = moment
        tracks = self._fusion.track(pipeline, detections, moment.ego, self._path(moment), self.counts_of)
        if tracks is None:
            return None
        newest = self._moments[tracks.stamp_s]
        if not self._fusion.is_waiting:
            self._moments = {tracks.stamp_s: newest}
        if newest is not moment:
            detections = Detections.empty(tracks.stamp_s)
        self._state = PipelineState(MadeTracks(tracks), self._state and self._state.rule)
        result = self._step(pipeline, detections, newest.ego, self._path(newest))
        self._next_id = max(self._next_id, self._fusion.next_id)
        return result, newest

    def _step(
        self, pipeline: Pipeline, detections: Detections, ego: EgoState, path: PlannedPath | None
    ) -> FrameResult:
        state = self._state
        if state is None:
            state = pipeline.initial()
            if isinstance(state.tracker, TrackerState):
                state = replace(state, tracker=replace(state.tracker, next_id=self._next_id))
        self._state, result = pipeline.step(state, detections, ego, path)
        if isinstance(self._state.tracker, TrackerState):
            self._next_id = self._state.tracker.next_id
        return result

    def _decide(
        self,
        pipeline: Pipeline,
        result: FrameResult,
        ego: EgoState,
        path: PlannedPath | None,
        level_m: float,
    ) -> Decision:
        """What the rule asks for; it begins anew where the vehicle should stand by now, and drives on."""
        self._common.decided += 1
        if self._anew:
            result = begun_anew(result, ego.stamp_s)
        known = len(self._watch.requests)
        self._anew = self._watch.see(Frame(ego.stamp_s, ego, result.detections, path=path), result)
        if self._anew and self._state is not None:
            self._state = replace(self._state, rule=None)
        requests = tuple(self._watch.requests[known:])
        self._common.requests += sum(request.kind == EMERGENCY for request in requests)
        monitored = pipeline.area(ego, path)
        gaps = [*result.threats.gap_m.tolist(), *([] if result.lead is None else [result.lead.gap_m])]
        gaps += new_gaps_m(monitored, result.tracks, ego)
        area = tuple(
            (role, np.column_stack((ring, np.full(len(ring), level_m))))
            for role, ring in monitored.polygons()
        )
        return Decision(result.command.emergency, min(gaps, default=None), area, requests)

    def _tracked(self, tracks: Tracks) -> TrackedBoxes:
        """The confirmed tracks as boxes with height."""
        bottom, height = self._heights.of(tracks.track_id.tolist())
        shown = tracks.confirmed.nonzero()[0]
        self._common.tracks = max(self._common.tracks, max(tracks.track_id[shown].tolist(), default=0))
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

    def _lifetime_s(self) -> float:
        return min(LIFETIME_FRAMES * self._rates.interval_s, _LONGEST_LIFETIME_S)
