"""What is kept of a run whose braking is weighed."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.metrics.rear_end import Followers, exposure
from evaluation.runs.execution import FrameTime, frame_time
from evaluation.studies.answers.arms import ArmRun
from evaluation.studies.answers.measures import Decision, decided
from evaluation.studies.answers.severity.behind import behind_of
from smartmot.types import FloatArray

FOLLOWERS = Followers()
"""Who drives behind the ego."""

G_MPS2 = 9.81


@dataclass(frozen=True, slots=True)
class BrakingDecision(Decision):
    """A run, and what its braking costs; None of a run with a contact, which is another matter.

    Args:
        initial_kmh: the ego's speed at the beginning.
        rear_share: share of the followers who would touch the ego from behind.
        rear_closing_kmh: mean relative speed of these; 0 if none would.
        struck_kmh, behind_ttc_s, behind_decel_mps2: of the first vehicle of SUMO behind the ego, see
            `evaluation.studies.answers.severity.behind.Behind`; None without a request or such a vehicle.
    """

    initial_kmh: float
    rear_share: float | None
    rear_closing_kmh: float | None
    struck_kmh: float | None = None
    behind_ttc_s: float | None = None
    behind_decel_mps2: float | None = None


@dataclass(frozen=True, slots=True)
class Weights:
    """How much each cost of a braking weighs; an assumed yardstick, all alike unless given.

    Args:
        speed: of the share of the speed that is lost, 1 for a stop.
        decel: of the peak deceleration in g, at most 1.
        rear: of the share of followers who would touch the ego from behind.
    """

    speed: float = 1.0
    decel: float = 1.0
    rear: float = 1.0

    @classmethod
    def parsed(cls, text: str) -> Weights:
        """Three numbers as they are typed, `1,1,1`.

        Raises:
            ArgumentError: they are not three, or one is negative, or all are 0.
        """
        try:
            values = [float(part) for part in text.split(",")]
        except ValueError:
            values = []
        if len(values) != 3 or not all(0.0 <= v < math.inf for v in values) or not sum(values) > 0.0:
            raise ArgumentError(
                f"--weights: expected three numbers such as 1,1,1, none negative and not all 0; got {text!r}"
            )
        return cls(*values)

    def severity(self, run: Decision) -> float | None:
        """Of an unnecessary stop, from 0 to 1; 0 where there was none, None where it is not known.

        1 is an emergency stop with 1 g that everybody behind drives into.
        """
        if not run.unnecessary_stop:
            return 0.0
        if not isinstance(run, BrakingDecision) or run.rear_share is None:
            return None
        lost = run.speed_lost_kmh / run.initial_kmh if run.initial_kmh > 0.0 else 0.0
        parts = (min(lost, 1.0), min(run.peak_decel_mps2 / G_MPS2, 1.0), run.rear_share)
        weights = (self.speed, self.decel, self.rear)
        return sum(w * part for w, part in zip(weights, parts, strict=True)) / sum(weights)


def decide(item: ArmRun) -> tuple[BrakingDecision, FrameTime]:
    """Carry out one run; see `evaluation.studies.answers.measures.decide`."""
    decision, outcome, simulation = decided(item)
    log = outcome.log.table()
    ego = log["kind"] == "ego"
    time_s, speed_mps = at_distinct_times(log["time_s"][ego], np.abs(log["speed_mps"][ego]))
    exposed = None if decision.collided else exposure(time_s, speed_mps, FOLLOWERS)
    behind = behind_of(simulation, outcome)
    kept = BrakingDecision(
        **asdict(decision),
        initial_kmh=3.6 * float(speed_mps[0]),
        rear_share=None if exposed is None else exposed.share,
        rear_closing_kmh=None if exposed is None else 3.6 * exposed.closing_mps,
        struck_kmh=None if behind is None else behind.struck_kmh,
        behind_ttc_s=None if behind is None else behind.ttc_s,
        behind_decel_mps2=None if behind is None else behind.decel_mps2,
    )
    return kept, frame_time(outcome.frame_time_ms)


def at_distinct_times(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and values without those that come twice: a log has an entry per sensor frame and decision."""
    times, first = np.unique(time_s, return_index=True)
    return times, values[first]
