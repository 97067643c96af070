"""Carrying out a run: from a plain value to its row and its log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.protocols.paper import paper_score, paper_score_max
from evaluation.results.rows import RunRow
from opendrive import OpenDriveError
from scenarios.errors import ScenarioError
from scenarios.openscenario.running.driving.criteria import Criterion
from scenarios.simulation.ends import CUT_OFF, THROUGH, EndReason, StopRule
from scenarios.simulation.outcome import Outcome
from scenarios.spec import RunSpec, simulation_of
from smartmot.errors import SmartMotError
from smartmot.plugins import failure
from smartmot.types import FloatArray


@dataclass(frozen=True, slots=True)
class FrameTime:
    """Processor time of perception and decision; different in every run.

    Args:
        frames: how many.
        median_ms, p95_ms: per frame.
    """

    frames: int
    median_ms: float
    p95_ms: float


def frame_time(spent_ms: FloatArray) -> FrameTime:
    """Summary of times per frame."""
    if not len(spent_ms):
        return FrameTime(0, 0.0, 0.0)
    return FrameTime(len(spent_ms), float(np.median(spent_ms)), float(np.percentile(spent_ms, 95)))


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """One finished run.

    Args:
        spec: what was run.
        row: its line in `runs.csv`.
        warning_ttc_s: time to collision with the target at the first warning; of a brake rule that does not
            warn at the first emergency request.
        log: its log as columns; None if it was not asked for.
        spent: processor time per frame.
        slowest_kmh: least speed of the ego up to the contact, or else the end; in reverse too not negative.
        notes: lines about what was not as the scenario's file asks for it.
        warning_lead_s, added_decel_mps2, criteria: see `scenarios.simulation.outcome.Outcome`.
    """

    spec: RunSpec
    row: RunRow
    warning_ttc_s: float | None
    log: dict[str, NDArray[Any]] | None
    spent: FrameTime
    slowest_kmh: float
    notes: tuple[str, ...] = ()
    warning_lead_s: float | None = None
    added_decel_mps2: float = 0.0
    criteria: tuple[Criterion, ...] = ()


def execute(spec: RunSpec, keep_log: bool = True, through: bool = False) -> RunRecord:
    """Carry out one run; see `simulation_of` for what it raises.

    Args:
        spec: what to run.
        keep_log: whether the record has its log.
        through: whether a scene in which nothing should happen goes on to its own end, as in comparisons.

    Raises:
        smartmot.errors.PluginError: also whenever an object of the user's own fails.
    """
    rule = THROUGH if through and spec.must == "nothing" else None
    return record_of(spec, outcome_of(spec, rule), keep_log)


def outcome_of(spec: RunSpec, rule: StopRule | None = None) -> Outcome:
    """What a run comes to; see `execute`."""
    try:
        return simulation_of(spec, rule).run()
    except (SmartMotError, ScenarioError, OpenDriveError):
        raise
    except (Exception, SystemExit) as error:
        if not spec.plugins:
            raise
        raise failure(" and ".join(spec.plugins), error) from error


def record_of(spec: RunSpec, outcome: Outcome, keep_log: bool = True) -> RunRecord:
    """What is kept of a finished run."""
    log = outcome.log.table() if keep_log else None
    spent = frame_time(outcome.frame_time_ms)
    # a car that has stopped may have stood between two entries of the log
    slowest_mps = 0.0 if outcome.end_reason is EndReason.STOPPED else outcome.log.slowest_mps
    row = row_of(spec, outcome, keep_log)
    warned = outcome.warning_time_s is not None
    warning_ttc_s = outcome.warning_ttc_s if warned else outcome.flag_ttc_s
    return RunRecord(
        spec,
        row,
        warning_ttc_s,
        log,
        spent,
        slowest_mps * 3.6,
        outcome.notes,
        outcome.warning_lead_s,
        outcome.added_decel_mps2,
        outcome.criteria,
    )


def impact_speed_kmh(outcome: Outcome) -> float | None:
    """Speed at contact, 0 without; None of a run that was cut off, since what it comes to is not known."""
    return None if outcome.end_reason in CUT_OFF else outcome.impact_speed_mps * 3.6


def row_of(spec: RunSpec, outcome: Outcome, has_log: bool = False) -> RunRow:
    """A finished run as a row of `runs.csv`.

    Args:
        spec: what was run.
        outcome: what came of it.
        has_log: whether its log is kept.
    """
    contact = outcome.contact
    return RunRow(
        scenario=spec.scenario,
        strategy=spec.strategy,
        preset=spec.preset,
        weather=spec.weather,
        adversaries=spec.adversaries,
        seed=spec.seed,
        v_test_kmh=spec.v_test_kmh,
        v_impact_kmh=impact_speed_kmh(outcome),
        collided=contact is not None,
        score=run_points(outcome, spec.v_test_kmh) if spec.paper_points else None,
        score_max=paper_score_max(spec.v_test_kmh) if spec.paper_points else None,
        flag_time_s=outcome.flag_time_s,
        flag_distance_m=outcome.flag_distance_m,
        stop_gap_m=outcome.stop_gap_m,
        contact_time_s=outcome.contact_time_s,
        t0_s=contact.time_s if contact else outcome.stop_time_s,
        end_reason=outcome.end_reason.value,
        end_time_s=outcome.end_time_s,
        false_activation=_false_activation(spec, outcome),
        detections=outcome.detections,
        dropped_score=outcome.dropped.score,
        dropped_category=outcome.dropped.category,
        dropped_box=outcome.dropped.box,
        target_start_time_s=outcome.target_start_time_s,
        target_steady_time_s=outcome.target_steady_time_s,
        ego_speed_at_contact_kmh=contact.ego_speed_mps * 3.6 if contact else None,
        target_speed_at_contact_kmh=contact.entity_speed_mps * 3.6 if contact else None,
        impact_location_percent=contact.impact_location_percent if contact else None,
        log=spec.log if has_log else None,
    )


def _false_activation(spec: RunSpec, outcome: Outcome) -> bool | None:
    if spec.must == "nothing":
        return outcome.flag_time_s is not None
    return outcome.false_activation


def run_points(outcome: Outcome, v_test_kmh: float) -> float | None:
    """The paper's points; none of a run that was cut off, 0 for braking before the target has set off."""
    if outcome.end_reason in CUT_OFF:
        return None
    if outcome.false_activation:
        return 0.0
    return paper_score(v_test_kmh, outcome.impact_speed_mps * 3.6)
