"""How much was driven: what a number of requests has to be seen against."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scenarios.recorded.motion import RecordedMotion
from smartmot.geometry import to_frame

MET_AHEAD_M, MET_ASIDE_M = 20.0, 5.0
"""A pedestrian is met who is labelled within 20 m ahead of the ego's middle, about the stopping distance from
50 km/h, and within 5 m of its axis: on its lane, the next one or the sidewalk beside it (assumed)."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """What was driven.

    Args:
        km: way.
        hours: time, standing included.
        pedestrians: labelled pedestrians met; None: nothing is labelled.
    """

    km: float
    hours: float
    pedestrians: int | None

    @property
    def at_most_per_km(self) -> float | None:
        """Rate below which the true one lies with 95 % confidence if nothing has happened; None of no way.

        Source: the rule of three, J. A. Hanley and A. Lippman-Hand, JAMA 249 (1983) 1743. It holds for events
        that are independent, on ways like those driven.
        """
        return 3.0 / self.km if self.km > 0.0 else None


def exposure_of(motion: RecordedMotion) -> Exposure:
    """What was driven in a recording."""
    ego = motion.ego
    return Exposure(ego.driven_m / 1000.0, float(np.ptp(ego.time_s)) / 3600.0, _met(motion))


def total(parts: Iterable[Exposure]) -> Exposure:
    """Several recordings as one."""
    parts = list(parts)
    met = [part.pedestrians for part in parts if part.pedestrians is not None]
    return Exposure(
        sum(part.km for part in parts), sum(part.hours for part in parts), sum(met) if met else None
    )


def _met(motion: RecordedMotion) -> int | None:
    if motion.labels is None:
        return None
    labels, index = motion.labels.labels, motion.labels.index
    met: set[int] = set()
    persons = labels.category == "pedestrian"
    for rows, pose in zip(motion.labels.rows, motion.ego.pose(motion.ego.time_s).tolist(), strict=True):
        chosen = persons[rows]
        if chosen.any():
            ahead, left = to_frame(labels.center_m[rows][chosen], *pose).T
            near = (ahead > 0.0) & (ahead <= MET_AHEAD_M) & (np.abs(left) <= MET_ASIDE_M)
            met |= set(index[rows][chosen][near].tolist())
    return len(met)
