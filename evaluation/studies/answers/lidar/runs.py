"""What is kept of a run with a LiDAR, and where it drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from evaluation.metrics.intervals import Estimate, wilson
from evaluation.runs.execution import FrameTime, frame_time
from evaluation.studies.answers.arms import Arm, ArmRun
from evaluation.studies.answers.measures import Decision, decided
from evaluation.studies.answers.results import Results
from scenarios.openscenario.running.engine import Engine
from scenarios.simulation.ends import TIME_LIMIT_S
from scenarios.simulation.simulation import Simulation

PLACES = ("straight", "bend", "junction")
"""Where the ego drives; a way over a junction is one, straight on or not."""

BEND_RAD = 0.1745
"""A way that turns by 10 degrees or more is a bend; assumed."""

SAMPLE_S = 0.5
"""How often it is looked at where the unbraked ego is."""


@dataclass(frozen=True, slots=True)
class LidarDecision(Decision):
    """A run, and what became of its detections.

    Args:
        place: where the ego drives without braking, out of `PLACES`.
        detections: that the detector reported.
        dropped_score: of these, dropped for a score under the tracker's.
    """

    place: str
    detections: int
    dropped_score: int


def decide(item: ArmRun) -> tuple[LidarDecision, FrameTime]:
    """Carry out one run; see `evaluation.studies.answers.measures.decide`."""
    decision, outcome, simulation = decided(item)
    kept = LidarDecision(
        **asdict(decision),
        place=place_of(simulation),
        detections=outcome.detections,
        dropped_score=outcome.dropped.score,
    )
    return kept, frame_time(outcome.frame_time_ms)


def place_of(simulation: Simulation) -> str:
    """Where the ego of a run drives if it does not brake."""
    definition, roads = simulation.engine.definition, simulation.engine.world.locator.roads
    engine = Engine(definition, roads=roads)
    ego = [entity.name for entity in definition.entities].index(engine.ego.name)
    points, yaws = [], []
    while True:
        boxes = engine.entities.boxes
        points.append(boxes.center_m[ego])
        yaws.append(float(boxes.yaw_rad[ego]))
        if engine.over or engine.time_s >= TIME_LIMIT_S:
            break
        engine.advance(SAMPLE_S)
    network = roads.network
    lanes = network.locate(np.array(points)).lane
    if any(network.lanes.junction_id[lane] is not None for lane in np.unique(lanes).tolist()):
        return PLACES[2]
    return PLACES[1] if np.ptp(np.unwrap(yaws)) >= BEND_RAD else PLACES[0]


def stops_at(results: Results, arm: Arm, place: str) -> Estimate:
    """Unnecessary stops of an arm in the scenes of a place in which nothing should happen."""
    runs = zip(results.scenes, results.runs[arm], strict=True)
    quiet = [run for scene, run in runs if scene.must == "nothing" and isinstance(run, LidarDecision)]
    there = [run for run in quiet if run.place == place and not run.cut_off]
    return wilson(sum(run.unnecessary_stop for run in there), len(there))


def dropped_share(runs: Sequence[Decision]) -> tuple[int, int]:
    """Detections of runs, and how many of them were dropped for their score."""
    kept = [run for run in runs if isinstance(run, LidarDecision)]
    return sum(run.detections for run in kept), sum(run.dropped_score for run in kept)
