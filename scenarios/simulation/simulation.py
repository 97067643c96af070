"""The closed loop: a scenario's world, sensors and brakes. What is decided comes from outside.

A run can be stepped with any decision, or carried out with the perception of its preset::

    simulation = Simulation(definition, preset, strategy)
    outcome = simulation.run()

is the same as::

    perception = simulation.perception()
    step = simulation.start()
    while step.frame is not None:
        result = perception.step(step.frame)
        simulation.record(result)
        step = simulation.step(result.command)
    outcome = simulation.outcome()

Between two steps a simulation can be copied (`copy.deepcopy`) and pickled; the copy goes on as the original
would. Whatever is given to it must allow that: a detector of one's own, and to be pickled also the strategy.
"""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError, StepOrderError
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.motion.paths import Path
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.running.driving.background import Background
from scenarios.openscenario.running.engine import Engine
from scenarios.places import MapView
from scenarios.presets import Preset, pipeline_of, pose_errors_of, sensors_of
from scenarios.sensors.interfaces import SensorChain
from scenarios.sensors.suite import Arrival, SensorSuite
from scenarios.sensors.world import World, reversed_course
from scenarios.simulation.counts import DetectionCounts
from scenarios.simulation.drive import EgoDrive
from scenarios.simulation.driver import DriverBrake
from scenarios.simulation.ends import STANDS_MPS, EndReason, EndWatch, StopRule
from scenarios.simulation.log import RunLog
from scenarios.simulation.motion_actions import drives_backwards, ego_of
from scenarios.simulation.outcome import Flag, Milestones, Outcome
from scenarios.simulation.street import RunStreet
from scenarios.simulation.truth import STEP_S, Truth
from scenarios.sources.frames import Frame, StepResult
from scenarios.sources.perception import AreaPipelines, Perception, StrategyMaker, faulty_map, map_view
from smartmot.area import MonitoredArea, RectangularArea
from smartmot.decision.rules import Command
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig
from smartmot.types import Boxes, Detections, EgoState

WAY_STEP_M = 2.0
"""Spacing at which the ego's way is laid over the perception's map."""

NO_COMMAND = Command(emergency=False)


class Simulation:
    """One run of a scenario with the ego in our hands; a `scenarios.sources.frames.FrameSource`.

    Args:
        definition: the scenario.
        preset: brakes, sensor and settings of perception. The ego's outline is the scenario's.
        strategy: makes the monitored area of `perception` for the map and the ego's route on it; None: `run`
            has no perception, and nobody brakes. In reverse, where no lane runs the ego's way, every one of
            them is the rectangle, behind the ego.
        seed: of the errors of sensor and localisation.
        network: the map that perception uses; None: the scenario's own.
        rule: when to end.
        roads: the scenario's own map, if it is already loaded.
        adapts: whether the ego adapts its speed to who is ahead, as ACC does.
        apply_performance: whether vehicles stay within the Performance of their catalog; see `Engine`.
        sensors: of the ego, each with its own rate, phase and latency; None: that of the preset.
        driver: who brakes as well; None: nobody does.
        background: moves some of the scenario's entities, such as `scenarios.traffic.SumoTraffic`.

    Raises:
        RunError: the scenario cannot begin.
        ScenarioError: the scenario deletes the ego or turns its direction.
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
        sensors: Sequence[SensorChain[Any]] | None = None,
        driver: DriverBrake | None = None,
        background: Background | None = None,
    ) -> None:
        ego = ego_of(definition)
        backwards = drives_backwards(definition, ego.name)
        self._drive = EgoDrive(preset.brakes, ego.length_m, adapts, driver)
        self.engine = Engine(
            definition,
            self._drive,
            roads=roads,
            until_contact=True,
            apply_performance=apply_performance,
            keeps_samples=strategy is None,  # of what is perceived the log tells
            background=background,
        )
        self.network = network or self.engine.world.locator.roads.network
        self._preset, self._make_strategy = preset, strategy
        self._pose_errors = pose_errors_of(preset, seed)
        street = RunStreet(preset.street, self.network, definition, self.engine.world.locator.roads)
        self._chains = (
            sensors_of(preset, seed, street, backwards=backwards, area_at=self._sensed_area)
            if sensors is None
            else tuple(sensors)
        )
        interval_s = min((1.0 / chain.sensor.timing.rate_hz for chain in self._chains), default=1.0)
        self._truth = Truth(self.engine, self._drive, backwards, interval_s)
        self._rule = rule or StopRule()
        self._ends = EndWatch(self._truth, self._rule)
        parts = ["target" if k == self._truth.target else "other" for k in self._truth.actors.tolist()]
        self._log = RunLog(self._truth.category, np.array(parts, dtype=np.str_))
        self._counts, self._milestones = DetectionCounts(), Milestones()
        self._suite: SensorSuite | None = None
        self._senses, self._keeps = True, True
        self._sensing: Perception | None = None
        self._step_count = round(self._rule.time_limit_s / STEP_S)
        self._steps_done, self._now_s, self._measure_step = 0, 0.0, 0
        self._frame: Frame | None = None
        self._result: FrameResult | None = None
        self._end_reason: EndReason | None = None
        self._way: Path | None = None
        self._path: PlannedPath | None = None
        self._lane_map: LaneMap = self.network

    # Running

    def run(self) -> Outcome:
        """Run to the end, with the perception of the preset.

        Raises:
            PluginError: a detector or tracker of the user's own fails, or no detection has the score that the
                tracker asks for.
            ScenarioError: the sensor's times are not multiples of 10 ms, or the scenario turns the ego's
                direction, by a speed relative to another's.
            StepOrderError: the simulation has been started before.
        """
        if self._make_strategy is None:
            self._senses = False  # no frame ever comes
            self.start()
            return self.outcome()
        perception = self.perception()
        self._keeps = False  # no measurement leaves the run
        step = self.start()
        while step.frame is not None:
            result = perception.step(step.frame)
            self.record(result)
            step = self.step(result.command)
        self._counts.require_scores(self._chains[0].name, perception.score_limits)
        return replace(self.outcome(), frame_time_ms=perception.frame_time_ms)

    def perception(self) -> Perception:
        """A new perception with the strategy and the preset's settings, for the frames of this simulation.

        Raises:
            ScenarioError: the simulation has no strategy.
        """
        config = pipeline_of(self._preset)
        if self._truth.backwards:
            area = RectangularArea(self._preset.rectangular, config.braking_distance)
            return Perception(_FixedPipeline(area, config), reversed_course)
        if self._make_strategy is None:
            raise ScenarioError("simulation: it has been made without a strategy, so it has no perception")
        return Perception(AreaPipelines(self._make_strategy, config, self._preset.path_from))

    def start(self) -> StepResult:
        """Go to the first frame, or to the end if none comes.

        Raises:
            StepOrderError: the simulation has been started before.
            ScenarioError: a sensor's times are not multiples of 10 ms.
        """
        if self._suite is not None:
            raise StepOrderError("simulation: start() a second time; make another, or copy it before")
        self._suite = SensorSuite(self._chains, STEP_S, self._keeps)
        self._measure_step = self._suite.next_step(-1)
        self._begin_step()
        return self._to_next_frame()

    def record(self, result: FrameResult) -> None:
        """Put what a pipeline made of the present frame into the log and the counts.

        Raises:
            StepOrderError: there is no frame, or its result is there already.
            ScenarioError: it is no result of a pipeline.
        """
        frame = self._present_frame("record()")
        _require(result, FrameResult, "record()")
        if self._result is not None:
            raise StepOrderError(f"simulation: record() a second time for the frame of {frame.stamp_s:g} s")
        self._result = result
        self._log.perception(frame.ego, result)

    def step(self, command: Command | None) -> StepResult:
        """Carry out the decision on the present frame, and go on to the next, or to the end.

        Several frames may have the same time: each has its own step, and the last command holds.

        Args:
            command: the decision; None: neither to brake nor to follow anybody.

        Raises:
            StepOrderError: the simulation has not been started, or is at its end.
            PluginError: a detector of the user's own fails.
            ScenarioError: it is no command, or the scenario turns the ego's direction, by a speed relative to
                another's.
        """
        frame = self._present_frame("step()")
        if command is not None:
            _require(command, Command, "step()")
        self._counts.add(frame.detections, self._result)
        self._frame = self._result = None
        self._carry_out(NO_COMMAND if command is None else command, frame.stamp_s)
        return self._to_next_frame()

    def outcome(self) -> Outcome:
        """What the run has come to.

        Raises:
            StepOrderError: it is not at its end.
        """
        if self._end_reason is None:
            raise StepOrderError("simulation: outcome() before the end; step() until there is no frame")
        engine, milestones = self.engine, self._milestones
        flag, warning, run = milestones.flag, milestones.warning, engine.result()
        return Outcome(
            contact=engine.contact,
            flag_time_s=flag.time_s if flag else None,
            flag_distance_m=flag.distance_m if flag else None,
            flag_ttc_s=flag.ttc_s if flag else None,
            stop_time_s=milestones.stop_time_s,
            stop_gap_m=milestones.stop_gap_m,
            target=run.target,
            target_start_time_s=run.target_start_time_s,
            target_steady_time_s=run.target_steady_time_s,
            false_activation=self._truth.is_false_activation(flag.time_s if flag else None),
            end_reason=self._end_reason,
            end_time_s=engine.time_s,
            detections=self._counts.reported,
            dropped=self._counts.dropped,
            notes=engine.notes,
            log=self._log,
            frame_time_ms=np.zeros(0),
            warning_time_s=warning.time_s if warning else None,
            warning_ttc_s=warning.ttc_s if warning else None,
            peak_decel_mps2=self._drive.peak_decel_mps2,
            added_decel_mps2=self._drive.added_decel_mps2,
            braking_time_s=self._drive.braking_time_s,
            criteria=engine.criteria,
            struck=engine.struck,
        )

    def world(self) -> World:
        """Ground truth now: every object but the ego. For rewards and pictures; perception never gets it."""
        return self._truth.world(self._now_s)

    def ego_box(self) -> Boxes:
        """The ego's true outline now, a single box."""
        return self._truth.entities.boxes[[self._truth.own]]

    def map_view(self) -> MapView:
        """Map and route of perception for the way that the ego is on now.

        Raises:
            smartmot.maps.route.RouteError: that way runs on no driving lane of the map.
        """
        return map_view(self.network, self._way_ahead())

    def scene(self) -> MapView:
        """Old name of `map_view`, for one version."""
        warnings.warn("Simulation.scene has moved to Simulation.map_view", DeprecationWarning, stacklevel=2)
        return self.map_view()

    def __deepcopy__(self, memo: dict[int, Any]) -> Simulation:
        """A copy that goes on for itself; maps, scenario and preset, which never change, are shared."""
        for shared in (self.network, self.engine.definition, self._preset, self._path, self._make_strategy):
            memo[id(shared)] = shared
        memo[id(self._lane_map)] = self._lane_map
        copied = object.__new__(type(self))
        memo[id(self)] = copied
        copied.__dict__.update(copy.deepcopy(self.__dict__, memo))
        return copied

    # The loop

    def _present_frame(self, call: str) -> Frame:
        if self._frame is not None:
            return self._frame
        if self._suite is None:
            raise StepOrderError(f"simulation: {call} before start()")
        raise StepOrderError(f"simulation: {call} after the end ({self._end_reason})")

    def _to_next_frame(self) -> StepResult:
        """Go on until detections arrive or the run ends."""
        suite = self._suite
        assert suite is not None
        while self._end_reason is None:
            arrival = suite.arrived(self._now_s) if suite.waiting else None
            if arrival is not None:
                self._frame = self._frame_of(arrival, self._now_s)
                return StepResult(self._frame)
            self._advance()
        return StepResult(None, self._end_reason)

    def _frame_of(self, arrival: Arrival, now: float) -> Frame:
        """What perception gets to know of an arrival."""
        detections = arrival.detections
        if detections.stamp_s < now:
            self._log_truth(now)  # so that every logged decision stands beside the truth
        if not self._truth.backwards and self.engine.ego.path is not self._way:
            # the scenario may give the ego another way
            self._way, self._path = self.engine.ego.path, self._way_ahead()
            self._lane_map = faulty_map(self.network, self._path, self._preset.map_errors)
        odometry = self._truth.odometry(now)
        frame = Frame(now, odometry, detections, arrival.measurement, self._lane_map, self._path)
        return frame if self._pose_errors is None else self._pose_errors.perceived(frame)

    def _sensed_area(self, now: float) -> tuple[MonitoredArea, EgoState]:
        """The monitored area of a frame that arrived now, and the ego in its frame."""
        self._sensing = self._sensing or self.perception()
        return self._sensing.area(self._frame_of(Arrival(now, Detections.empty(now)), now))

    def _advance(self) -> None:
        """Move the world on by a step, or by all of them up to the next measurement or arrival.

        Step by step where the ego may come to the stop that is waited for.
        """
        engine, milestones, suite = self.engine, self._milestones, self._suite
        assert suite is not None
        waits_for_stop = milestones.flag is not None and milestones.stop_time_s is None
        until = min(self._measure_step, self._step_count)
        if suite.waiting:
            until = min(until, round(suite.waiting[0].time_s / STEP_S))
        if waits_for_stop and not self._keeps_moving((until - self._steps_done) * STEP_S):
            until = self._steps_done + 1
        # a change just before the end of a step leaves the engine a little before it, for one step
        between = abs(engine.time_s - self._now_s) > 1e-12
        steps = 1 if between else max(until - self._steps_done, 1)
        after = (self._steps_done + steps) * STEP_S if steps > 1 else self._now_s + STEP_S
        engine.advance(after - engine.time_s)
        if engine.over:
            # the last step that has been completed is the one before that in which it ended
            self._steps_done = max(self._steps_done, math.ceil(engine.time_s / STEP_S - 1e-6) - 1)
            self._now_s = self._steps_done * STEP_S
            if engine.contact is not None:
                reason = EndReason.CONTACT
            else:
                begun = milestones.flag is not None or self._truth.target_has_begun()
                reason = EndReason.STORYBOARD if begun else EndReason.NOT_BEGUN
            self._end(reason)
            return
        if waits_for_stop and engine.ego_speed_mps == 0.0:
            milestones.stop_time_s, milestones.stop_gap_m = after, self._truth.gap_to_target_m(after)
            if self._rule.at_standstill:
                self._end(EndReason.STOPPED)
                return
        self._steps_done += steps
        self._now_s = self._steps_done * STEP_S
        if self._steps_done in (self._measure_step, self._step_count):
            self._begin_step()

    def _keeps_moving(self, duration_s: float) -> bool:
        """Whether the ego is commanded, and will not stand within a duration."""
        drive, now = self._drive, self._now_s
        commands = self.engine.ego.commanded and drive.commands_from_s <= now
        return commands and drive.motion(now, duration_s).speed_mps != 0.0

    def _begin_step(self) -> None:
        """End the run where the rule asks for it; else let the sensors measure that are to do so."""
        assert self._suite is not None
        if self._steps_done >= self._step_count:
            self._end(EndReason.TIME_LIMIT)
        elif self._steps_done == self._measure_step:
            self._measure_step = self._suite.next_step(self._steps_done)
            now, milestones = self._now_s, self._milestones
            reason = self._ends.reason(now, milestones.flag is not None, milestones.resumed_s)
            if reason is not None:
                self._end(reason)
            else:
                self._measure(now)

    def _end(self, reason: EndReason) -> None:
        self._end_reason = reason
        if self.engine.contact is not None:
            self._log_truth(self.engine.time_s)

    def _measure(self, now: float) -> None:
        """Log the truth, and let the sensors measure it."""
        assert self._suite is not None
        truth, odometry = self._truth, self._truth.odometry(now)
        self._log_truth(now)
        if (-odometry.speed_mps if truth.backwards else odometry.speed_mps) < -STANDS_MPS:
            raise ScenarioError(
                f"{self.engine.definition.path}: '{self.engine.ego.name}' turns its direction at {now:g} s; "
                "perception looks ahead or behind for a whole run, so make two scenarios of it"
            )
        if self._senses:
            self._suite.measure(self._steps_done, now, truth.world(now), odometry)
            if self._pose_errors is not None:
                self._pose_errors.drive(odometry)

    def _carry_out(self, command: Command, now: float) -> None:
        """Hand the decision to the drive, and note what has come of it."""
        truth, milestones = self._truth, self._milestones
        speed_mps = truth.odometry(now).speed_mps
        asked, decel_mps2 = truth.asked(now), command.decel_mps2
        if command.emergency and milestones.flag is None:
            milestones.flag = self._flag(now)
        if command.warning and milestones.warning is None:
            milestones.warning = self._flag(now)
        if self._drive.driver is not None:
            warning = milestones.warning
            self._drive.heed(now, None if warning is None else warning.time_s, self._flag(now).ttc_s)
        self._drive.control(now, command.emergency, command.lead, speed_mps, asked, decel_mps2)
        stopped = milestones.stop_time_s is not None
        if stopped and milestones.resumed_s is None and not command.emergency:
            milestones.resumed_s = now

    def _flag(self, now: float) -> Flag:
        """How far the target is in space and time, at a request or warning."""
        truth = self._truth
        gap = truth.gap_to_target_m(now)
        closing = truth.course(now).speed_mps - truth.target_along_mps(now)
        return Flag(now, gap, gap / closing if gap is not None and closing > 0.0 else None)

    def _way_ahead(self) -> PlannedPath:
        """The way that the ego is on, from where it is now."""
        way = self.engine.ego.path
        station = self.engine.ego.state(self.engine.time_s).station_m
        length = max(way.length_m - station, WAY_STEP_M)
        stations = np.linspace(station, station + length, max(2, math.ceil(length / WAY_STEP_M) + 1))
        points_m = np.array([way.pose(s)[:2] for s in stations.tolist()])
        ego, roads = self.engine.ego, self.engine.world.locator.roads
        if not roads.has_levels:
            return PlannedPath.through(points_m)
        ground_m = ego.ground_m(ego.state(self.engine.time_s)) or 0.0
        return PlannedPath.through(points_m, roads.way_heights_m(way, stations, points_m, ground_m))

    def _log_truth(self, time_s: float) -> None:
        truth = self._truth
        entities, actors = truth.entities, truth.actors
        existing = entities.exists.take(actors).nonzero()[0]
        if len(existing) == len(actors):
            boxes, rows = truth.actor_boxes, actors
        else:
            rows = actors[existing]
            boxes = entities.boxes[rows]
        self._log.frame(truth.odometry(time_s), boxes, entities.speed_mps[rows], existing)
        for signal, state, place_m in truth.changed_signals(time_s):
            self._log.signal(time_s, signal, state, place_m)


def _require(given: object, kind: type, call: str) -> None:
    if not isinstance(given, kind):
        raise ScenarioError(f"simulation: {call} takes a {kind.__name__}, got {given!r}")


class _FixedPipeline:
    """Makes pipelines around an area that is the same wherever the ego is to go."""

    def __init__(self, area: RectangularArea, config: PipelineConfig) -> None:
        self._area, self._config = area, config

    def __call__(self, frame: Frame) -> Pipeline:
        return Pipeline(self._area, self._config)
