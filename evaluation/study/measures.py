"""One run of a comparison, and what is measured in it."""

from __future__ import annotations

import math
import multiprocessing
import multiprocessing.connection
import os
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from evaluation.protocols.paper import paper_score
from evaluation.runs import definition_of, load_named_map, perception_map, preset_of
from evaluation.study.criticality import criticality
from evaluation.study.grid import StudyRun
from evaluation.study.parameters import preset_with
from scenarios.places import Scene
from scenarios.simulation import Simulation, StopRule
from scenarios.strategies import make_strategy
from smartmot.monitored_area import MonitoredAreaStrategy
from smartmot.pipeline import FrameResult, Pipeline, PipelineState
from smartmot.types import Detections, EgoState

THROUGH = StopRule(time_limit_s=60.0, after_resume_s=math.inf, after_pass_m=math.inf)
"""A scene in which nothing should happen is driven to its end, so that the delay can be measured."""
STANDING_MPS = 0.1


@dataclass(frozen=True, slots=True)
class RunMeasures:
    """What one run came to; None where it did not happen or has no meaning.

    Args:
        scene, variant, must: the scene.
        strategy, settings, preset, weather, seed: who decided, and in which conditions.
        v_test_kmh: speed of the ego.
        collided: whether the ego touched anybody.
        v_impact_kmh: its speed then, 0 without contact.
        score: the paper's points, of scenes that ask for braking.
        flag_time_s: first emergency request.
        flag_distance_m: free distance to the target then.
        flag_ttc_s: time to collision with anybody then, from ground truth at constant velocities; None also
            where nobody was on a collision course.
        false_stop: an emergency request where nothing should happen.
        needless_stop: a false stop, or a standstill where nothing should happen: adapting the speed to
            somebody who is in nobody's way can end in a standstill without an emergency.
        speed_loss_kmh: by how much it was slower at the slowest than without braking.
        delay_s: how much later it was where it came to than without braking.
        distance_m: driven.
        duration_s: of the run.
        detections_mean, tracks_mean: per frame.
        min_ttc_s: shortest time to collision; None: nobody was ever on a collision course.
        max_btn: greatest brake threat number before a contact.
    """

    scene: str
    variant: str
    must: str
    strategy: str
    settings: str
    preset: str
    weather: str
    seed: int
    v_test_kmh: float
    collided: bool
    v_impact_kmh: float
    score: float | None
    flag_time_s: float | None
    flag_distance_m: float | None
    flag_ttc_s: float | None
    false_stop: bool
    needless_stop: bool
    speed_loss_kmh: float
    delay_s: float
    distance_m: float
    duration_s: float
    detections_mean: float
    tracks_mean: float
    min_ttc_s: float | None
    max_btn: float


@dataclass(frozen=True, slots=True)
class FrameTime:
    """Processor time of perception and decision; kept apart, because it is different in every run.

    Args:
        frames: how many.
        median_ms, p95_ms: per frame.
    """

    frames: int
    median_ms: float
    p95_ms: float


class _Stopwatch(Pipeline):
    """A pipeline that measures its processor time."""

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline.strategy, pipeline.config)
        self.inner, self.spent_ns = pipeline, list[int]()

    def step(
        self, state: PipelineState, detections: Detections, ego: EgoState
    ) -> tuple[PipelineState, FrameResult]:
        """Process one frame."""
        start = time.thread_time_ns()
        result = super().step(state, detections, ego)
        self.spent_ns.append(time.thread_time_ns() - start)
        return result


class TimedSimulation(Simulation):
    """A simulation that measures the processor time of perception and decision."""

    watches: list[_Stopwatch]

    def _perception(self) -> Pipeline:
        pipeline = super()._perception()
        if not hasattr(self, "watches"):
            self.watches = []
        if not self.watches or self.watches[-1].inner is not pipeline:
            self.watches.append(_Stopwatch(pipeline))
        return self.watches[-1]

    @property
    def frame_time(self) -> FrameTime:
        """Processor time so far."""
        spent = [ns for watch in getattr(self, "watches", []) for ns in watch.spent_ns]
        return frame_time(np.array(spent, dtype=np.float64) / 1e6)


def frame_time(spent_ms: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> FrameTime:
    """Summary of times per frame."""
    if not len(spent_ms):
        return FrameTime(0, 0.0, 0.0)
    return FrameTime(len(spent_ms), float(np.median(spent_ms)), float(np.percentile(spent_ms, 95)))


def measure(run: StudyRun) -> tuple[RunMeasures, FrameTime]:
    """Carry out one run.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scene cannot be run.
        opendrive.OpenDriveError: its map cannot be read.
    """
    spec, nothing = run.spec, run.scene.must == "nothing"
    definition = definition_of(spec)
    preset = preset_with(preset_of(spec, definition), run.point.settings)
    name = perception_map(definition, spec.map_name)

    def strategy(scene: Scene) -> MonitoredAreaStrategy:
        return make_strategy(spec.strategy, preset, scene)

    network = load_named_map(name) if name else None
    simulation = TimedSimulation(
        definition, preset, strategy, spec.seed, network, THROUGH if nothing else None
    )
    outcome = simulation.run()
    log = outcome.log.table()
    own = np.flatnonzero(log["kind"] == "ego")
    time_s, speed = log["time_s"][own], log["speed_mps"][own]
    driven = float(np.hypot(np.diff(log["x_m"][own]), np.diff(log["y_m"][own])).sum())
    duration = float(time_s[-1] - time_s[0])
    threat = criticality(log, preset.brakes.max_decel_mps2)
    flagged, flag_ttc = outcome.flag_time_s is not None, None
    if outcome.flag_time_s is not None:
        at = min(int(np.searchsorted(threat.time_s, outcome.flag_time_s)), len(threat.time_s) - 1)
        flag_ttc = _finite(float(threat.time_to_collision_s[at]))
    before = threat.brake_threat_number[np.isfinite(threat.brake_threat_number)]
    frames = max(simulation.frame_time.frames, 1)
    impact = outcome.impact_speed_mps * 3.6
    measures = RunMeasures(
        scene=run.scene.scene,
        variant=run.scene.variant,
        must=run.scene.must,
        strategy=spec.strategy,
        settings=run.point.text,
        preset=spec.preset,
        weather=spec.weather,
        seed=spec.seed,
        v_test_kmh=spec.v_test_kmh,
        collided=outcome.contact is not None,
        v_impact_kmh=impact,
        score=None if nothing else paper_score(spec.v_test_kmh, impact),
        flag_time_s=outcome.flag_time_s,
        flag_distance_m=outcome.flag_distance_m,
        flag_ttc_s=flag_ttc,
        false_stop=nothing and flagged,
        needless_stop=nothing and (flagged or float(speed.min()) < STANDING_MPS),
        speed_loss_kmh=3.6 * float(speed[0] - speed.min()),
        delay_s=duration - driven / float(speed[0]),
        distance_m=driven,
        duration_s=duration,
        detections_mean=float(np.count_nonzero(log["kind"] == "detection")) / frames,
        tracks_mean=float(np.count_nonzero(log["kind"] == "track")) / frames,
        min_ttc_s=_finite(float(threat.time_to_collision_s.min())),
        max_btn=float(before.max(initial=0.0)),
    )
    return measures, simulation.frame_time


def measure_all(
    runs: Sequence[StudyRun], workers: int = 1
) -> Iterator[tuple[StudyRun, RunMeasures, FrameTime]]:
    """Carry out runs; they come in the given order, whatever the number of processes."""
    workers = min(workers, len(runs))
    if workers <= 1:
        for run in runs:
            yield run, *measure(run)
        return
    # a forked copy of a process with threads may hang; these start from a clean one, which imports once
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_with_parent)
    try:
        for run, (measures, spent) in zip(runs, pool.map(measure, runs, chunksize=1), strict=True):
            yield run, measures, spent
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _leave_with_parent() -> None:
    """End this process when its parent is killed; a pool's processes would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
