"""What a track is and which way it faces, by the evidence of all its detections.

A detector errs in single frames. Evidence is a sum of scores that fades with time, so that a pedestrian who
mounts a bicycle becomes a cyclist, and a truck of one frame stays a car.
"""

from __future__ import annotations

import math

import numpy as np

from smartmot.filters.kalman import BoxFilter
from smartmot.filters.motion_models import PerCategory, table
from smartmot.tracking.frame import Frame
from smartmot.tracking.settings import CODES
from smartmot.tracking.state import CODE, EVIDENCE, FRONT
from smartmot.types import BoolArray, FloatArray, IntArray

CLEARLY = 1.5
"""A track changes its category when the evidence for another exceeds its own by this factor, so that a
detector that cannot decide does not make it flicker."""

_MOST_MOTION = 3.0
"""Motion counts at most as so many sure detections."""


_FORWARDS_MPS = table(PerCategory.grouped(4.0, 1.0, 2.0))
"""Faster than this nobody of the category goes backwards for long: vehicles reverse at up to about 15 km/h,
people step back at less than walking pace, and a bicycle is only pushed backwards."""

_LEAST_M2PS2 = 0.25 * _FORWARDS_MPS * _FORWARDS_MPS
"""Slower than half of that, motion says nothing."""

# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_ZERO, _FOUR = np.array(0.0), np.array(4.0)

_LEAST, _FORWARDS = _LEAST_M2PS2.tolist(), _FORWARDS_MPS.tolist()

_FEW = 8
"""Up to so many tracks votes are counted faster one by one than as arrays."""

_UNKNOWN = CODES["unknown"]

UNIT = np.eye(len(CODES))
"""One sure detection of each category as evidence."""


class Evidence:
    """Weighs what the detections of a frame say.

    Args:
        memory_s: Time over which evidence fades.
        heading: Whether headings are weighed too.
        box_filter: The tracker's filter.
    """

    def __init__(self, memory_s: float, heading: bool, box_filter: BoxFilter) -> None:
        self._memory_s, self._by_evidence, self._filter = memory_s, heading, box_filter

    def weigh(
        self,
        frame: Frame,
        matched: FloatArray,
        track: IntArray,
        code: IntArray,
        detected: IntArray,
        measured_yaw_rad: FloatArray,
        score: FloatArray,
        dt_s: float,
    ) -> None:
        """Headings and categories by evidence, in place; `matched` and the others are the rows of `track`."""
        matched[:, FRONT:] *= math.exp(-dt_s / self._memory_s)
        if self._by_evidence:
            filtered = frame.filtered.take(track, axis=0) if frame.coasting else frame.filtered
            yaw_rad, velocity_mps = self._filter.motion(filtered)
            variance = self._filter.speed_variance(filtered)
            wrong = backwards(
                matched[:, FRONT],
                measured_yaw_rad,
                yaw_rad,
                velocity_mps,
                variance,
                code,
                score,
            )
            if np.count_nonzero(wrong):
                self._filter.turn_round(filtered, wrong)
                if frame.coasting:
                    frame.filtered[track] = filtered
            if not frame.coasting:
                frame.speed_variance = variance
        changed = classified(matched[:, EVIDENCE], code, detected, score, _UNKNOWN)
        if changed is not code:
            frame.code[track] = matched[:, CODE] = changed


def classified(
    evidence: FloatArray, code: IntArray, detected: IntArray, score: FloatArray, unknown: int
) -> IntArray:
    """Categories of tracks after one more detection each.

    Args:
        evidence: (N, C) evidence for each category; changed in place.
        code: (N,) categories so far, positions in CATEGORIES.
        detected: (N,) what the detections say.
        score: (N,) their scores.
        unknown: The category that says nothing.

    Returns:
        (N,) categories; `code` itself if none changes.
    """
    evidence += UNIT.take(detected, axis=0) * score[:, None]
    if np.count_nonzero(detected == code) == len(code):
        return code
    row = np.arange(len(code))
    evidence[:, unknown] = 0.0
    best = evidence.argmax(axis=1)
    changed = evidence[row, best] > CLEARLY * evidence[row, code]
    return np.where(changed, best, code)


def backwards(
    front: FloatArray,
    measured_yaw_rad: FloatArray,
    yaw_rad: FloatArray,
    velocity_mps: FloatArray,
    speed_variance_m2ps2: FloatArray,
    code: IntArray,
    score: FloatArray,
) -> BoolArray:
    """Which tracks face the other way than their heading says, after one more detection each.

    A detection votes for its own heading with its score; who moves votes for the direction of motion. At
    the category's `_FORWARDS_MPS` motion weighs as much as a sure detection: what always faces one way and
    goes backwards more slowly reverses.

    Args:
        front: (N,) evidence for the heading so far; changed in place, and never negative afterwards.
        measured_yaw_rad: (N,) detected headings.
        yaw_rad: (N,) headings of the tracks.
        velocity_mps: (N, 2) velocities over ground.
        speed_variance_m2ps2: (N,) variance of the speed.
        code: (N,) positions in CATEGORIES.
        score: (N,) scores of the detections.

    Returns:
        (N,) flags.
    """
    if len(code) <= _FEW:
        return _few_backwards(
            front, measured_yaw_rad, yaw_rad, velocity_mps, speed_variance_m2ps2, code, score
        )
    said = measured_yaw_rad - yaw_rad
    np.cos(said, out=said)
    said *= score
    front += said
    vx, vy = velocity_mps[:, 0], velocity_mps[:, 1]
    # within two standard deviations of the estimate, motion says nothing either
    least = _FOUR * speed_variance_m2ps2
    np.maximum(least, _LEAST_M2PS2.take(code), out=least)
    squared = vx * vx
    squared += vy * vy
    if np.count_nonzero(squared > least):
        along = vx * np.cos(yaw_rad)
        along += vy * np.sin(yaw_rad)
        moving = along * along > least
        along /= _FORWARDS_MPS.take(code)
        np.minimum(along, _MOST_MOTION, out=along)
        np.maximum(along, -_MOST_MOTION, out=along)
        along *= moving
        front += along
    wrong: BoolArray = front < _ZERO
    if np.count_nonzero(wrong):
        np.abs(front, out=front)
    return wrong


def _few_backwards(front: FloatArray, *columns: FloatArray | IntArray) -> BoolArray:
    """`backwards` without arrays; the columns are its other arguments."""
    votes, wrong = [], []
    rows = zip(front.tolist(), *(column.tolist() for column in columns), strict=True)
    for vote, measured_rad, yaw_rad, (vx, vy), variance, code, score in rows:
        vote += math.cos(measured_rad - yaw_rad) * score
        least = max(4.0 * variance, _LEAST[code])
        if vx * vx + vy * vy > least:
            along = vx * math.cos(yaw_rad) + vy * math.sin(yaw_rad)
            if along * along > least:
                vote += max(min(along / _FORWARDS[code], _MOST_MOTION), -_MOST_MOTION)
        wrong.append(vote < 0.0)
        votes.append(abs(vote))
    front[:] = votes
    return np.array(wrong, dtype=np.bool_)
