"""The closed loop: world, sensor, perception, brakes. Knows no particular scenario."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from scenarios.actors import Actors
from scenarios.errors import ScenarioError
from scenarios.recording import RunLog
from scenarios.sensors import Sensor
from scenarios.vehicle import EgoVehicle
from smartmot.geometry import signed_gap_scalar
from smartmot.monitored_area import ego_extent
from smartmot.pipeline import Pipeline, PipelineState
from smartmot.route import Route
from smartmot.types import Boxes, Detections

STEP_S = 0.01
"""Step of the world. Motion, trigger and contact are exact inside a step; its length only bounds how often
contact is looked for and which frame rates divide it (100, 50, 25, 20, 10 Hz ...)."""

CONTACT_TOLERANCE_S = 1e-7


@dataclass(frozen=True, slots=True)
class StopRule:
    """When a run ends; a contact always ends it.

    Args:
        time_limit_s: at the latest.
        after_resume_s: this long after the ego drives on from a stop.
        after_pass_m: once the ego's centre is this far beyond the target's.
    """

    time_limit_s: float = 30.0
    after_resume_s: float = 1.5
    after_pass_m: float = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run came to; None where it did not happen.

    Args:
        contact_time_s: first contact with any actor.
        impact_speed_mps: the ego's speed then; 0 without contact.
        contact_actor: index of the actor hit.
        flag_time_s: first emergency request.
        flag_distance_m: free distance from the ego's front to the target's box then.
        stop_time_s: when the ego first stood still after a request.
        stop_gap_m: that free distance then.
        trigger_time_s: when the actors were set off.
        log: everything that happened.
    """

    contact_time_s: float | None
    impact_speed_mps: float
    contact_actor: int | None
    flag_time_s: float | None
    flag_distance_m: float | None
    stop_time_s: float | None
    stop_gap_m: float | None
    trigger_time_s: float | None
    log: RunLog


class Simulation:
    """One run.

    Args:
        ego: the vehicle.
        actors: everybody else; they start when the trigger fires.
        route: the ego's route.
        trigger_station_m: the ego's front at this station sets off the actors.
        target: index of the actor that the test is about.
        sensor: what the ego sees with.
        pipeline: perception and decision; None: nobody brakes.
        rule: when to end.
    """

    def __init__(
        self,
        ego: EgoVehicle,
        actors: Actors,
        route: Route,
        trigger_station_m: float,
        target: int,
        sensor: Sensor,
        pipeline: Pipeline | None,
        rule: StopRule,
    ) -> None:
        self._ego, self._actors, self._route, self._target = ego, actors, route, target
        self._sensor, self._pipeline, self._rule = sensor, pipeline, rule
        self._log = RunLog(actors)
        self._state: PipelineState | None = pipeline.initial() if pipeline else None
        self._waiting: deque[tuple[float, Detections]] = deque()
        self._reach_m = 0.5 * (
            np.hypot(ego.LENGTH, ego.WIDTH) + np.hypot(actors.size_m[:, 0], actors.size_m[:, 1])
        )
        self._trigger_in_m = trigger_station_m - ego.LENGTH / 2 - route.project(*ego.position)[0]
        self._top_mps = max((a.speed_mps for a in actors.actors), default=0.0)
        self._no_contact_before_s = 0.0
        self._trigger_time_s: float | None = None
        self._flag: tuple[float, float] | None = None
        self._stop: tuple[float, float] | None = None
        self._resumed_s: float | None = None

    def run(self) -> Outcome:
        """Run to the end."""
        config = self._sensor.config
        steps_per_frame = _steps(1.0 / config.rate_hz, "frame interval (1 / rate)")
        first = _steps(config.phase_s, "frame phase")
        _steps(config.latency_s, "latency")
        contact: tuple[float, int] | None = None
        for step in range(round(self._rule.time_limit_s / STEP_S)):
            now = step * STEP_S
            frame, between = divmod(step - first, steps_per_frame)
            if frame >= 0 and between == 0:
                if self._over(now):
                    break
                self._measure(now, frame)
            self._decide(now)
            self._fire_trigger(now)
            contact = self._contact(now)
            if contact is not None:
                self._ego.advance(now, max(contact[0] - now, 1e-9))
                self._log_truth(contact[0])
                break
            self._ego.advance(now, STEP_S)
            if self._stop is None and self._flag is not None and self._ego.speed <= 0.0:
                self._stop = (now + STEP_S, self._gap_to_target(now + STEP_S))
        return Outcome(
            contact_time_s=contact[0] if contact else None,
            impact_speed_mps=float(self._ego.speed) if contact else 0.0,
            contact_actor=contact[1] if contact else None,
            flag_time_s=self._flag[0] if self._flag else None,
            flag_distance_m=self._flag[1] if self._flag else None,
            stop_time_s=self._stop[0] if self._stop else None,
            stop_gap_m=self._stop[1] if self._stop else None,
            trigger_time_s=self._trigger_time_s,
            log=self._log,
        )

    def _since(self, time_s: float) -> float | None:
        return None if self._trigger_time_s is None else time_s - self._trigger_time_s

    def _log_truth(self, time_s: float) -> Boxes:
        boxes, speed = self._actors.state(self._since(time_s))
        self._log.frame(self._ego.state(time_s), boxes, speed)
        return boxes

    def _measure(self, now: float, number: int) -> None:
        """Take one sensor frame; perception gets it after the sensor's latency."""
        boxes = self._log_truth(now)
        if self._pipeline is None:
            self._ego.control(now, False, None)  # nobody brakes, but it keeps to its lane
            return
        seen = self._sensor.observe(number, self._ego.state(now), boxes, self._actors.category)
        self._waiting.append((now + self._sensor.config.latency_s, seen))

    def _decide(self, now: float) -> None:
        """Perceive what has arrived, and hand the decision to the vehicle."""
        while self._pipeline and self._state and self._waiting and self._waiting[0][0] <= now + 1e-9:
            detections = self._waiting.popleft()[1]
            if detections.stamp_s < now:
                self._log_truth(now)  # so that every logged decision stands beside the truth of its time
            odometry = self._ego.state(now)
            self._state, result = self._pipeline.step(self._state, detections, odometry)
            self._log.perception(odometry, result)
            self._ego.control(now, result.command.emergency, result.lead)
            if result.command.emergency and self._flag is None:
                self._flag = (now, self._gap_to_target(now))
            if self._stop and self._resumed_s is None and not result.command.emergency:
                self._resumed_s = now

    def _fire_trigger(self, now: float) -> None:
        """Set off the actors at the instant at which the ego's front passes the trigger station."""
        if self._trigger_time_s is not None:
            return
        left, step = self._trigger_in_m, self._ego.travel(now, STEP_S)[0]
        self._trigger_in_m -= step
        if left <= 1e-9:
            self._trigger_time_s = now
        elif step > left:
            low, high = 0.0, STEP_S
            while high - low > CONTACT_TOLERANCE_S:
                middle = (low + high) / 2
                low, high = (middle, high) if self._ego.travel(now, middle)[0] < left else (low, middle)
            self._trigger_time_s = now + high

    def _gap(self, now: float, after_s: float, actor: int) -> float:
        """Signed distance between the ego's outline and an actor's a time into the step."""
        x, y, yaw, _ = self._ego.pose_after(now, after_s)
        center = self._actors.centers(self._since(now + after_s))[actor]
        return signed_gap_scalar(
            (x, y, self._ego.LENGTH, self._ego.WIDTH, yaw),
            (center[0], center[1], *self._actors.size_m[actor], self._actors.yaw_rad[actor]),
        )

    def _contact(self, now: float) -> tuple[float, int] | None:
        """First contact within the step that starts now: (time, actor), found as the root of the gap."""
        if now + STEP_S < self._no_contact_before_s:
            return None
        x, y, _, _ = self._ego.pose_after(now, STEP_S)
        delta = self._actors.centers(self._since(now + STEP_S)) - (x, y)
        apart = np.hypot(delta[:, 0], delta[:, 1]) - self._reach_m
        # nobody can close the distance faster than this, so there is nothing to look for until then
        fastest = self._ego.speed + self._ego.COMFORT_ACC_MAX + self._top_mps
        self._no_contact_before_s = now + STEP_S + min(float(apart.min(initial=np.inf)) / fastest, 1.0)
        near = np.flatnonzero(apart <= 0.0)
        found: list[tuple[float, int]] = []
        for actor in near.tolist():
            if self._gap(now, STEP_S, actor) > 0.0:
                continue
            low, high = 0.0, STEP_S
            while high - low > CONTACT_TOLERANCE_S:
                middle = (low + high) / 2
                low, high = (middle, high) if self._gap(now, middle, actor) > 0.0 else (low, middle)
            found.append((now + high, actor))
        return min(found, default=None)

    def _gap_to_target(self, time_s: float) -> float:
        """Free distance along the ego's heading from its front to the target's box (0 beside it)."""
        target = self._actors.boxes(self._since(time_s))[[self._target]]
        return max(float(ego_extent(target, self._ego.state(time_s))[0][0]) - self._ego.LENGTH / 2, 0.0)

    def _over(self, time_s: float) -> bool:
        """Whether the run is finished."""
        if self._resumed_s is not None:
            return time_s >= self._resumed_s + self._rule.after_resume_s
        to_target = self._actors.centers(self._since(time_s))[self._target] - self._ego.position
        return float(to_target @ self._ego.direction) < -self._rule.after_pass_m


def _steps(time_s: float, name: str) -> int:
    """A time as a whole number of world steps.

    Raises:
        ScenarioError: it is none.
    """
    steps = round(time_s / STEP_S)
    if abs(steps * STEP_S - time_s) > 1e-9:
        raise ScenarioError(
            f"sensor: the {name} must be a multiple of the world's step of {STEP_S * 1000:g} ms, "
            f"got {time_s * 1000:g} ms"
        )
    return steps
