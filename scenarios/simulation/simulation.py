"""The closed loop: a scenario's world, sensor, perception, decision, brakes. Knows no particular scenario."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import (
    Action,
    DeleteEntityAction,
    EntityDefinition,
    FollowTrajectoryAction,
    LongitudinalDistanceAction,
    ScenarioDefinition,
    SpeedAction,
    SynchronizeAction,
)
from scenarios.openscenario.motion.paths import Path
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.running.engine import Contact, Engine, Entities
from scenarios.openscenario.running.storyboard import STANDBY, EventElement
from scenarios.places import MapView
from scenarios.presets import Preset
from scenarios.sensors.sensor import ObjectDetector, Sensor
from scenarios.simulation.drive import Asked, EgoDrive
from scenarios.simulation.log import RunLog
from smartmot.area import MonitoredAreaStrategy, RectangularArea, ego_extent
from smartmot.errors import PluginError
from smartmot.maps.follow import route_along
from smartmot.pipeline import FrameResult, Pipeline, PipelineState
from smartmot.plugins import require
from smartmot.types import NOTHING_DROPPED, Detections, Dropped, EgoState, FloatArray

STEP_S = 0.01
"""Frames, latencies and phases are multiples of it. Motion, triggers and contact are exact inside a step."""

WAY_STEP_M = 2.0
"""Spacing at which the ego's way is laid over the perception's map."""

ROUTE_AHEAD_M, ROUTE_BEHIND_M = 100.0, 50.0
"""The route goes on beyond the ego's way, so that the monitored area does not end with it."""

WALKS_ALONG_MPS = 0.5
"""A target that goes along the ego's way at less than that crosses it, or stands."""

SAME_SPEED_MPS, SLOWED_MPS = 0.1, 1.0
"""The ego follows a target if it is as fast as that one and so much slower than it was at first."""

TIME_LIMIT_S = 60.0
"""A run that nothing else has ended is cut off then."""

STANDS_MPS = 0.1
"""Slower is standing still; a car that adapts its speed to one that stands comes to 0 ever more slowly."""

SOME_DETECTIONS = 5
"""A quarter of a second of one object at 20 Hz: if none of so many detections has the score that the tracker
asks for, the fault is the detector's or the threshold's and not that of a single weak detection."""

StrategyMaker = Callable[[MapView], MonitoredAreaStrategy]


class EndReason(StrEnum):
    """Why a run ended. All but the last two say that what was to come has come.

    Attributes:
        CONTACT: the ego touched somebody.
        STOPPED: the ego stood, or drove on from a stop, and nothing more was to come.
        PASSED: the target, once ahead, is behind the ego.
        FOLLOWED: the ego drives behind the target, no faster than that.
        STORYBOARD: the scenario's own stop trigger.
        NOT_BEGUN: the scenario's own stop trigger, before any event of the target began and without an
            emergency request; what would have come is not known.
        TIME_LIMIT: the time limit; what would have come is not known.
    """

    CONTACT = "contact"
    STOPPED = "stopped"
    PASSED = "passed"
    FOLLOWED = "followed"
    STORYBOARD = "storyboard"
    NOT_BEGUN = "not_begun"
    TIME_LIMIT = "time_limit"


CUT_OFF = frozenset({EndReason.NOT_BEGUN, EndReason.TIME_LIMIT})
"""Ends of runs that count nowhere as avoided."""


def is_avoided(collided: bool, end_reason: str, false_activation: bool | None) -> bool:
    """Whether a run in which the ego must brake counts as a collision avoided.

    Not if it was cut off before anything could happen, nor if the ego braked for something else than the
    target before that had set off: then it never met the target as the test has it.

    Args:
        collided: whether the ego touched anybody.
        end_reason: an `EndReason`; empty where it is not known, as of runs of version 0.1.0.
        false_activation: see `Outcome`.
    """
    return not collided and end_reason not in CUT_OFF and not false_activation


@dataclass(frozen=True, slots=True)
class StopRule:
    """When a run ends, unless the scenario ends it before; a contact always ends it.

    A run in which the ego has braked and is no faster than a target that goes the same way ends too.

    Args:
        time_limit_s: at the latest; such a run is cut off, and counts nowhere as avoided.
        after_resume_s: this long after the ego drives on from a stop.
        after_pass_m: once the ego's centre is this far beyond the target's.
        after_following_s: this long behind a target to whose speed the ego has adapted its own, unless an
            event is left that would change the target's.
        after_standstill_s: once the ego has stood so long while the target does not come nearer and the
            scenario is not to change its speed any more, nor to set the ego off. 3 s is what the stop
            triggers of the shipped scenes wait.
        at_standstill: as soon as the ego has braked to a standstill, as tests of Euro NCAP do.
    """

    time_limit_s: float = TIME_LIMIT_S
    after_resume_s: float = 1.5
    after_pass_m: float = 10.0
    after_following_s: float = 3.0
    after_standstill_s: float = 3.0
    at_standstill: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run came to; None where it did not happen.

    Args:
        contact: first contact of the ego with anybody.
        flag_time_s: first emergency request.
        flag_distance_m: free distance from the ego's front to the target's box then.
        flag_ttc_s: that distance over the speed at which it shrinks.
        stop_time_s: when the ego first stood still after a request.
        stop_gap_m: that free distance then.
        target: name of the entity that the test is about.
        target_start_time_s: when it left standstill.
        target_steady_time_s: since when its speed was constant at the contact, or else at the end.
        false_activation: whether a request came before a target that was to set off had done so: then it
            can only have been meant for somebody else. None where the target stands for good, moves from the
            start on, or does not exist.
        end_reason: why the run ended.
        end_time_s: when.
        detections: how many detections the detector reported, dropped ones included.
        dropped: how many of them were dropped, and why.
        notes: lines about what was not as the scenario's file asks for it; see `Engine.notes`.
        log: everything that happened.
        frame_time_ms: (F,) processor time of perception and decision per frame; different in every run.
    """

    contact: Contact | None
    flag_time_s: float | None
    flag_distance_m: float | None
    flag_ttc_s: float | None
    stop_time_s: float | None
    stop_gap_m: float | None
    target: str | None
    target_start_time_s: float | None
    target_steady_time_s: float | None
    false_activation: bool | None
    end_reason: EndReason
    end_time_s: float
    detections: int
    dropped: Dropped
    notes: tuple[str, ...]
    log: RunLog
    frame_time_ms: FloatArray

    @property
    def avoided(self) -> bool:
        """Whether the run counts as a collision avoided; see `is_avoided`."""
        return is_avoided(self.contact is not None, self.end_reason, self.false_activation)

    @property
    def contact_time_s(self) -> float | None:
        """When the ego first touched anybody."""
        return self.contact.time_s if self.contact else None

    @property
    def impact_speed_mps(self) -> float:
        """How fast the ego was then, forward or in reverse; 0 without contact."""
        return abs(self.contact.ego_speed_mps) if self.contact else 0.0


class Simulation:
    """One run of a scenario with the ego in our hands.

    Args:
        definition: the scenario.
        preset: brakes, sensor and settings of perception. The ego's outline is the scenario's.
        strategy: makes the monitored area for the map and the ego's route on it; None: nobody brakes. In
            reverse, where no lane runs the ego's way, every one of them is the rectangle, behind the ego.
        seed: of the sensor noise.
        network: the map that perception uses; None: the scenario's own.
        rule: when to end.
        roads: the scenario's own map, if it is already loaded.
        adapts: whether the ego adapts its speed to who is ahead, as ACC does.
        apply_performance: whether vehicles stay within the Performance of their catalog; see `Engine`.

    Raises:
        RunError: the scenario cannot begin.
        ScenarioError: the sensor's times are not multiples of 10 ms, or the scenario deletes the ego or turns
            its direction.
        smartmot.errors.PluginError: a detector of the user's own cannot be made.
    """

    def __init__(
        self,
        definition: ScenarioDefinition,
        preset: Preset,
        strategy: StrategyMaker | None,
        seed: int = 0,
        network: RoadNetwork | None = None,
        rule: StopRule | None = None,
        roads: Roads | None = None,
        adapts: bool = True,
        apply_performance: bool = False,
    ) -> None:
        ego = ego_of(definition)
        self._backwards = drives_backwards(definition, ego.name)
        self._drive = EgoDrive(preset.brakes, ego.length_m, adapts)
        self.engine = Engine(
            definition, self._drive, roads=roads, until_contact=True, apply_performance=apply_performance
        )
        self.network = network or self.engine.world.locator.roads.network
        self._preset, self._make_strategy = preset, strategy
        own = preset.detector
        self._sensor: ObjectDetector = (
            require(own(preset.sensor, seed), "observe", own.name) if own else Sensor(preset.sensor, seed)
        )
        self._rule = rule or StopRule()
        names = [entity.name for entity in definition.entities]
        self._own = names.index(self.engine.ego.name)
        self._others = np.array([k for k in range(len(names)) if k != self._own], dtype=np.int64)
        self._target = names.index(self.engine.target) if self.engine.target else None
        self._log = RunLog(
            np.array([definition.entities[k].category for k in self._others], dtype=np.str_),
            np.array(["target" if k == self._target else "other" for k in self._others], dtype=np.str_),
        )
        self._spent_ns: list[int] = []
        self._following_since_s: float | None = None
        self._standing_since_s: float | None = None
        self._was_ahead = False
        self._counts = _Counts()
        self._way: Path | None = None
        self._pipeline: Pipeline | None = None
        self._state: PipelineState | None = None
        self._waiting: deque[tuple[float, Detections]] = deque()
        self._entities: Entities | None = None
        self._ego: EgoState | None = None
        self._flag: _Flag | None = None
        self._stop: tuple[float, float | None] | None = None
        self._resumed_s: float | None = None

    def run(self) -> Outcome:
        """Run to the end.

        Raises:
            PluginError: a detector or tracker of the user's own fails, or no detection has the score that the
                tracker asks for.
            ScenarioError: the scenario turns the ego's direction, by a speed relative to another's.
        """
        config, engine = self._preset.sensor, self.engine
        steps_per_frame = _steps(1.0 / config.rate_hz, "frame interval (1 / rate)")
        first = _steps(config.phase_s, "frame phase")
        _steps(config.latency_s, "latency")
        reason = EndReason.TIME_LIMIT
        for step in range(round(self._rule.time_limit_s / STEP_S)):
            now = step * STEP_S
            frame, between = divmod(step - first, steps_per_frame)
            if frame >= 0 and between == 0:
                over = self._over(now)
                if over is not None:
                    reason = over
                    break
                self._measure(now, frame)
            self._decide(now)
            engine.advance(now + STEP_S - engine.time_s)
            if engine.over:
                reason = EndReason.STORYBOARD if engine.contact is None else EndReason.CONTACT
                break
            if self._stop is None and self._flag is not None and self._speed_mps() == 0.0:
                self._stop = (now + STEP_S, self._gap_to_target(now + STEP_S))
                if self._rule.at_standstill:
                    reason = EndReason.STOPPED
                    break
        if engine.contact is not None:
            self._log_truth(engine.time_s)
        self._require_scores()
        if reason is EndReason.STORYBOARD and self._not_begun():
            reason = EndReason.NOT_BEGUN
        run = engine.result()
        return Outcome(
            contact=engine.contact,
            flag_time_s=self._flag.time_s if self._flag else None,
            flag_distance_m=self._flag.distance_m if self._flag else None,
            flag_ttc_s=self._flag.ttc_s if self._flag else None,
            stop_time_s=self._stop[0] if self._stop else None,
            stop_gap_m=self._stop[1] if self._stop else None,
            target=run.target,
            target_start_time_s=run.target_start_time_s,
            target_steady_time_s=run.target_steady_time_s,
            false_activation=self._false_activation(),
            end_reason=reason,
            end_time_s=engine.time_s,
            detections=self._counts.reported,
            dropped=self._counts.dropped,
            notes=engine.notes,
            log=self._log,
            frame_time_ms=np.array(self._spent_ns, dtype=np.float64) / 1e6,
        )

    def scene(self) -> MapView:
        """Map and route of perception for the way that the ego is on now.

        Raises:
            smartmot.maps.route.RouteError: that way runs on no driving lane of the map.
        """
        way = self.engine.ego.path
        station = self.engine.ego.state(self.engine.time_s).station_m
        length = max(way.length_m - station, WAY_STEP_M)
        stations = np.linspace(station, station + length, max(2, math.ceil(length / WAY_STEP_M) + 1))
        points = np.array([way.pose(s)[:2] for s in stations.tolist()])
        route = route_along(self.network, points, ROUTE_AHEAD_M, ROUTE_BEHIND_M)
        return MapView(self.network, route)

    def _world(self) -> Entities:
        """Everybody now; made once for all who ask at the same time."""
        if self._entities is None or self._entities.time_s != self.engine.time_s:
            self._entities = self.engine.entities
        return self._entities

    def _odometry(self, time_s: float) -> EgoState:
        """What the ego knows of itself; the turn rate is that since the last time it was asked for."""
        before = self._ego
        if before is not None and before.stamp_s == time_s:
            return before
        k, entities = self._own, self._world()
        boxes = entities.boxes
        yaw, rate = float(boxes.yaw_rad[k]), 0.0
        if before is not None:
            rate = math.remainder(yaw - before.yaw_rad, 2 * math.pi) / (time_s - before.stamp_s)
        self._ego = EgoState(
            stamp_s=time_s,
            x_m=float(boxes.center_m[k, 0]),
            y_m=float(boxes.center_m[k, 1]),
            yaw_rad=yaw,
            speed_mps=float(entities.speed_mps[k]),
            accel_mps2=self._drive.accel_mps2
            if self.engine.ego.commanded
            else self._asked(time_s).accel_mps2,
            yaw_rate_radps=rate,
            length_m=float(boxes.size_m[k, 0]),
            width_m=float(boxes.size_m[k, 1]),
        )
        return self._ego

    def _speed_mps(self) -> float:
        """The ego's speed now, negative in reverse."""
        return self.engine.ego_speed_mps

    def _accel_mps2(self, time_s: float) -> float:
        """The ego's acceleration now, by the drive or by the scenario."""
        return self._drive.accel_mps2 if self.engine.ego.commanded else self._asked(time_s).accel_mps2

    def _asked(self, time_s: float) -> Asked:
        """What the scenario asks of the ego's speed, and how that changes until the next frame."""
        ego, interval = self.engine.ego, 1.0 / self._preset.sensor.rate_hz
        speed = ego.asked_mps(time_s)
        return Asked(speed, (ego.asked_mps(time_s + interval) - speed) / interval)

    def _course(self, time_s: float) -> EgoState:
        """The odometry with the heading in which the ego drives: in reverse that of its rear."""
        odometry = self._odometry(time_s)
        if not self._backwards:
            return odometry
        return replace(
            odometry,
            yaw_rad=math.remainder(odometry.yaw_rad + math.pi, 2 * math.pi),
            speed_mps=-odometry.speed_mps,
            accel_mps2=-odometry.accel_mps2,
        )

    def _log_truth(self, time_s: float) -> None:
        entities = self._world()
        there = np.flatnonzero(entities.exists[self._others])
        shown = self._others[there]
        self._log.frame(self._odometry(time_s), entities.boxes[shown], entities.speed_mps[shown], there)

    def _measure(self, now: float, number: int) -> None:
        """Take one sensor frame; perception gets it after the sensor's latency."""
        self._log_truth(now)
        if self._course(now).speed_mps < -STANDS_MPS:
            raise ScenarioError(
                f"{self.engine.definition.path}: '{self.engine.ego.name}' turns its direction at {now:g} s; "
                "perception looks ahead or behind for a whole run, so make two scenarios of it"
            )
        if self._make_strategy is None:
            return
        entities, others = self._world(), self._others
        seen = self._sensor.observe(
            number,
            self._odometry(now),
            entities.boxes[others],
            entities.category[others],
            entities.seen[others],
        )
        if self._preset.detector is not None:
            _check_detections(self._preset.detector.name, seen, now)
        self._waiting.append((now + self._preset.sensor.latency_s, seen))

    def _decide(self, now: float) -> None:
        """Perceive what has arrived, and hand the decision to the drive."""
        while self._waiting and self._waiting[0][0] <= now + 1e-9:
            detections = self._waiting.popleft()[1]
            if detections.stamp_s < now:
                self._log_truth(now)  # so that every logged decision stands beside the truth
            odometry = self._odometry(now)
            pipeline = self._perception()
            state = self._state or pipeline.initial()
            start_ns = time.thread_time_ns()
            self._state, result = pipeline.step(state, detections, self._course(now))
            self._spent_ns.append(time.thread_time_ns() - start_ns)
            self._counts.add(result)
            self._log.perception(odometry, result)
            asked = self._asked(now)
            self._drive.control(now, result.command.emergency, result.lead, odometry.speed_mps, asked)
            if result.command.emergency and self._flag is None:
                self._flag = self._flag_now(now)
            if self._stop and self._resumed_s is None and not result.command.emergency:
                self._resumed_s = now

    def _perception(self) -> Pipeline:
        """The pipeline for the way that the ego is on; the scenario may have given it a new one."""
        if self._pipeline is None or self.engine.ego.path is not self._way:
            assert self._make_strategy is not None
            self._way = self.engine.ego.path
            self._pipeline = Pipeline(self._strategy(), self._preset.pipeline)
        return self._pipeline

    def _strategy(self) -> MonitoredAreaStrategy:
        assert self._make_strategy is not None
        if self._backwards:
            return RectangularArea(self._preset.rectangular, self._preset.pipeline.braking_distance)
        return self._make_strategy(self.scene())

    def _flag_now(self, now: float) -> _Flag:
        gap, closing = self._gap_to_target(now), self._course(now).speed_mps - self._target_along_mps(now)
        return _Flag(now, gap, gap / closing if gap is not None and closing > 0.0 else None)

    def _target_along_mps(self, time_s: float) -> float:
        """The target's speed in the direction in which the ego drives."""
        if self._target is None:
            return 0.0
        world = self._world()
        turn = float(world.boxes.yaw_rad[self._target]) - self._course(time_s).yaw_rad
        return float(world.speed_mps[self._target]) * math.cos(turn)

    def _gap_to_target(self, time_s: float) -> float | None:
        """Free distance from the end of the ego that leads to the target's box (0 beside it)."""
        if self._target is None:
            return None
        ego = self._course(time_s)
        ahead = ego_extent(self._world().boxes[[self._target]], ego)[0][0]
        return max(float(ahead) - ego.length_m / 2, 0.0)

    def _not_begun(self) -> bool:
        """Whether neither an event of the target has begun, nor the ego has braked."""
        target = self.engine.target
        events = [
            element
            for element in self.engine.storyboard.elements
            if isinstance(element, EventElement)
            and any(target in a.entities and is_motion(a.action) for a in element.event.actions)
        ]
        begun = any(action.running for event in events for action in event.actions)
        return self._flag is None and bool(events) and not begun

    def _require_scores(self) -> None:
        """Refuse a run in which no detection could start a track: the ego was blind.

        Raises:
            PluginError: so it was.
        """
        counts = self._counts
        if counts.trackable or counts.kept + counts.before.score < SOME_DETECTIONS:
            return
        assert self._state is not None
        limits = self._perception().score_limits(self._state.tracker)
        least = "" if limits is None else f" of {float(limits.start.min()):g}"
        outside = counts.before.score
        found = f"highest: {counts.highest:.3g}" if counts.kept else ""
        found += (", " if found and outside else "") + (f"{outside} outside [0, 1]" if outside else "")
        detector = self._preset.detector
        raise PluginError(
            f"{detector.name if detector else 'sensor'}: none of {counts.reported} detections has the score"
            f"{least} that the tracker needs to start a track ({found}), so that "
            "no object would be seen; scale the detector's scores, or give a tracker with a lower threshold "
            "(--tracker package.module:name)"
        )

    def _false_activation(self) -> bool | None:
        """Whether the first request came before the target had set off; None where it does not do so."""
        target = self.engine.target
        set_off_s = None if target is None else self.engine.world.actors[target].set_off_s
        if set_off_s is None:
            if not _is_to_set_off(self.engine.definition, target):
                return None
            return self._flag is not None
        if set_off_s <= STEP_S:
            return None
        return self._flag is not None and self._flag.time_s < set_off_s

    def _over(self, time_s: float) -> EndReason | None:
        """Why the run is finished; None: it is not."""
        if self._resumed_s is not None:
            return EndReason.STOPPED if time_s >= self._resumed_s + self._rule.after_resume_s else None
        if self._rests(time_s):
            return EndReason.STOPPED
        if self._target is None:
            return None
        ego, center = self._course(time_s), self._world().boxes.center_m[self._target]
        target_mps = self._target_along_mps(time_s)
        if self._flag is not None and max(ego.speed_mps, WALKS_ALONG_MPS) <= target_mps:
            return EndReason.FOLLOWED
        follows = (
            target_mps > WALKS_ALONG_MPS
            and abs(ego.speed_mps - target_mps) < SAME_SPEED_MPS
            and ego.speed_mps < abs(self._asked(time_s).speed_mps) - SLOWED_MPS
        )
        if not follows or self._target_waits(time_s):
            self._following_since_s = None
        elif self._following_since_s is None:
            self._following_since_s = time_s
        elif time_s >= self._following_since_s + self._rule.after_following_s:
            return EndReason.FOLLOWED
        along = math.cos(ego.yaw_rad) * (center[0] - ego.x_m) + math.sin(ego.yaw_rad) * (center[1] - ego.y_m)
        self._was_ahead |= float(along) > 0.0
        return EndReason.PASSED if self._was_ahead and float(along) < -self._rule.after_pass_m else None

    def _rests(self, time_s: float) -> bool:
        """Whether the ego has stood for long enough while nothing changes any more."""
        if abs(self._speed_mps()) >= STANDS_MPS or self._target_comes() or self._target_waits(time_s):
            self._standing_since_s = None
        elif abs(self._asked(time_s).speed_mps) < STANDS_MPS and self._is_to_change(
            self.engine.ego.name, time_s
        ):
            self._standing_since_s = None  # it waits as the scenario wants
        elif self._standing_since_s is None:
            self._standing_since_s = time_s
        else:
            return time_s >= self._standing_since_s + self._rule.after_standstill_s
        return False

    def _target_comes(self) -> bool:
        """Whether the target moves towards the ego."""
        if self._target is None:
            return False
        world, k = self._world(), self._target
        yaw, speed = float(world.boxes.yaw_rad[k]), float(world.speed_mps[k])
        dx, dy = world.boxes.center_m[k] - world.boxes.center_m[self._own]
        comes = speed * (math.cos(yaw) * dx + math.sin(yaw) * dy) < 0.0
        return bool(world.exists[k]) and abs(speed) >= STANDS_MPS and comes

    def _target_waits(self, time_s: float) -> bool:
        """Whether the scenario is still to change the target's speed."""
        return self.engine.target is not None and self._is_to_change(self.engine.target, time_s)

    def _is_to_change(self, name: str, time_s: float) -> bool:
        """Whether an event is left, or an action goes on, that changes the speed of an entity."""
        if self.engine.world.actors[name].profile.end_s > time_s:
            return True
        return any(
            isinstance(element, EventElement)
            and element.state == STANDBY
            and any(name in a.entities and is_motion(a.action) for a in element.event.actions)
            for element in self.engine.storyboard.elements
        )


def ego_of(definition: ScenarioDefinition) -> EntityDefinition:
    """The entity under test: the one called Ego, or the first."""
    return next((e for e in definition.entities if e.name == "Ego"), definition.entities[0])


def ego_actions(definition: ScenarioDefinition, ego: str) -> tuple[list[Action], list[Action]]:
    """What the scenario asks of the ego in its initial actions, and in its events."""
    initial = [action for name, action in definition.init if name == ego]
    later = [a.action for e in definition.events() for a in e.actions if ego in a.entities]
    return initial, later


def drives_backwards(definition: ScenarioDefinition, ego: str) -> bool:
    """Whether the ego drives in reverse.

    Raises:
        ScenarioError: the scenario asks of the ego what cannot be carried out in our hands.
    """
    initial, later = ego_actions(definition, ego)
    asked = [*initial, *later]
    named = [a.action for e in definition.events() for a in e.actions]
    if any(isinstance(a, DeleteEntityAction) and a.entity == ego for a in named):
        raise ScenarioError(f"{definition.path}: DeleteEntityAction on '{ego}', the vehicle under test")
    speeds = [a.target for a in asked if isinstance(a, SpeedAction) and isinstance(a.target, float)]
    if min(speeds, default=0.0) < 0.0 < max(speeds, default=0.0):
        raise ScenarioError(
            f"{definition.path}: SpeedAction of '{ego}' turns its direction; perception looks ahead or "
            "behind for a whole run, so make two scenarios of it"
        )
    return min(speeds, default=0.0) < 0.0


def is_motion(action: Action) -> bool:
    """Whether an action changes the speed of the entity that carries it out."""
    if isinstance(action, FollowTrajectoryAction):
        return action.timing is not None
    return isinstance(action, (SpeedAction, LongitudinalDistanceAction, SynchronizeAction))


def _is_to_set_off(definition: ScenarioDefinition, target: str | None) -> bool:
    """Whether the scenario moves the target: by an event, or by an initial action that takes time."""
    named = [a for event in definition.events() for a in event.actions]
    actions = [action for name, action in definition.init if name == target]
    actions += [a.action for a in named if target in a.entities]
    return any(is_motion(a) and not (isinstance(a, SpeedAction) and a.target == 0.0) for a in actions)


@dataclass(slots=True)
class _Counts:
    """Detections of a run so far.

    Args:
        kept: those that reached the pipeline.
        before: those that the detector itself had dropped.
        dropped: by the detector and the tracker.
        trackable: those with which a track can start.
        highest: score.
    """

    kept: int = 0
    before: Dropped = NOTHING_DROPPED
    dropped: Dropped = NOTHING_DROPPED
    trackable: int = 0
    highest: float = 0.0

    @property
    def reported(self) -> int:
        """All detections that the detector made."""
        return self.kept + self.before.total

    def add(self, result: FrameResult) -> None:
        """Count a frame."""
        detections = result.detections
        self.kept += len(detections)
        if detections.dropped is not NOTHING_DROPPED:
            self.before += detections.dropped
        if result.dropped is not NOTHING_DROPPED:
            self.dropped += result.dropped
        self.trackable += result.trackable
        if not self.trackable:  # it is told where none is
            self.highest = max(self.highest, float(detections.score.max(initial=0.0)))


@dataclass(frozen=True, slots=True)
class _Flag:
    """The first emergency request."""

    time_s: float
    distance_m: float | None
    ttc_s: float | None


def _check_detections(name: str, seen: object, now: float) -> None:
    """Refuse what a detector of the user's own must not return.

    Raises:
        PluginError: no detections, or of another time.
    """
    if not isinstance(seen, Detections):
        raise PluginError(
            f"{name}: observe() returned {type(seen).__name__}; return smartmot.Detections, "
            "for example from smartmot.detections_from_arrays"
        )
    if abs(seen.stamp_s - now) > 1e-9:
        raise PluginError(f"{name}: detections of {seen.stamp_s:g} s at {now:g} s; give them the ego's time")


def _steps(time_s: float, name: str) -> int:
    """A time as a whole number of steps.

    Raises:
        ScenarioError: it is none.
    """
    steps = round(time_s / STEP_S)
    if abs(steps * STEP_S - time_s) > 1e-9:
        raise ScenarioError(
            f"sensor: the {name} must be a multiple of the step of {STEP_S * 1000:g} ms, "
            f"got {time_s * 1000:g} ms"
        )
    return steps
