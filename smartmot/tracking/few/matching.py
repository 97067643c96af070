"""Gate and affinity of few tracks and detections without arrays.

The rules are those of `smartmot.tracking.association` for the affinity `overlap_then_distance`, and the tests
hold both to the same matches. A call of NumPy takes as long as two or three passes of a loop, and the arrays
take some fifty calls.
"""

from __future__ import annotations

import math

import numpy as np

from smartmot.filters.kalman import Estimate
from smartmot.overlap import iou_scalar
from smartmot.tracking.assignment import solve
from smartmot.types import BoolArray, Boxes, FloatArray, IntArray

FEW_CELLS = 16
"""Up to so many tracks times detections the gate is quicker as a loop."""

FEW_PAIRS = 20
"""Up to so many pairs in the gate their affinities are."""

NO_REACH_M = 1e-9
"""Stands for a gate of 0 m in a division; closer centres than this overlap anyway."""

Candidate = tuple[int, int, float, float, float, float, bool]
"""Track, detection, offset along x and y, distance, reach of the gate, and whether the circles meet."""


class FewMatcher:
    """Matches few tracks and detections.

    Args:
        gates: Variance of a measured position, sudden change of speed and widest gate, for each category.
        chi2: Quantile of the squared innovation that the gate takes; 0: no gate at all.
        fixed_m: Gates for each category in their place; None: there are none.
        threshold: Least overlap that counts as one, for each category.
        compatible: (C, C) which categories of track and detection may match.
        method: See `smartmot.tracking.assignment.solve`.
    """

    def __init__(
        self,
        gates: FloatArray,
        chi2: float,
        fixed_m: FloatArray | None,
        threshold: FloatArray,
        compatible: BoolArray,
        method: str,
    ) -> None:
        self._gates: list[tuple[float, float, float]] = [tuple(row) for row in gates.tolist()]
        self._chi2, self._method = chi2, method
        self._fixed_m = None if fixed_m is None else fixed_m.tolist()
        self._threshold: list[float] = threshold.tolist()
        self._compatible: list[list[bool]] = compatible.tolist()

    def _reach_m(self, variance_m2: float, longest_m: float, code: int, dt_s: float) -> float:
        """See `Associator.reach_m`."""
        if self._fixed_m is not None:
            return float(self._fixed_m[code])
        if self._chi2 == 0.0:
            return 0.0
        noise_m2, sudden_mps, widest_m = self._gates[code]
        reach = math.sqrt((variance_m2 + noise_m2) * self._chi2)
        return min(max(reach, sudden_mps * dt_s + 0.5 * longest_m), widest_m)

    def match(
        self,
        tracks: Estimate,
        track_code: IntArray,
        variance_m2: FloatArray,
        detections: Boxes,
        detection_code: IntArray,
        dt_s: float,
        first: BoolArray | None,
        overdue: BoolArray | None,
    ) -> tuple[IntArray, IntArray]:
        """See `Associator.match`; `variance_m2` (M,) is the mean of both axes."""
        candidates = self._candidates(
            tracks, track_code, variance_m2, detections, detection_code, dt_s, overdue
        )
        return self.resolved(candidates, tracks, track_code, detections, first)

    def resolved(
        self,
        candidates: list[Candidate],
        tracks: Estimate,
        track_code: IntArray,
        detections: Boxes,
        first: BoolArray | None,
    ) -> tuple[IntArray, IntArray]:
        """Matches among candidates, which come by their tracks; the rest as `Associator.match` has it."""
        in_row, in_column = _counts(candidates, 0), _counts(candidates, 1)
        free = len(in_row) == len(candidates) == len(in_column)
        least = min(len(track_code), len(detections)) + 1.0
        affinity = []
        for candidate in candidates:
            track, detection, _, _, distance_m, reach_m, meets = candidate
            nearness = max(1.0 - distance_m / max(reach_m, NO_REACH_M), 0.0)
            threshold = self._threshold[track_code[track]]
            value = nearness * (threshold / least)
            if meets and (nearness == 0.0 or in_row[track] > 1 or in_column[detection] > 1):
                iou = _iou(candidate, tracks, detections)
                value = iou if iou >= threshold else value
            affinity.append(value)
        if free:
            matched = [c for c, value in zip(candidates, affinity, strict=True) if value > 0.0]
            return _positions(matched, 0), _positions(matched, 1)
        row, column = _positions(candidates, 0), _positions(candidates, 1)
        shape = len(track_code), len(detections)
        pair = staged(row, column, shape, np.array(affinity), self._method, first)
        return row.take(pair), column.take(pair)

    def _candidates(
        self,
        tracks: Estimate,
        track_code: IntArray,
        variance_m2: FloatArray,
        detections: Boxes,
        detection_code: IntArray,
        dt_s: float,
        overdue: BoolArray | None,
    ) -> list[Candidate]:
        """Pairs in the gate or with circles that meet."""
        places = detections.center_m.tolist()
        around = [0.5 * math.hypot(length, width) for length, width in detections.size_m.tolist()]
        codes = detection_code.tolist()
        late = [False] * len(track_code) if overdue is None else overdue.tolist()
        candidates = []
        for track, ((x, y), (length, width), variance, code) in enumerate(
            zip(
                tracks.center_m.tolist(),
                tracks.size_m.tolist(),
                variance_m2.tolist(),
                track_code.tolist(),
                strict=True,
            )
        ):
            reach_m = 0.0 if late[track] else self._reach_m(variance, max(length, width), code, dt_s)
            radius_m, compatible = 0.5 * math.hypot(length, width), self._compatible[code]
            for detection, (to_x, to_y) in enumerate(places):
                dx, dy, circles_m = to_x - x, to_y - y, radius_m + around[detection]
                limit_m = circles_m if circles_m > reach_m else reach_m
                if dx * dx + dy * dy <= limit_m * limit_m and compatible[codes[detection]]:
                    distance_m = math.hypot(dx, dy)
                    candidates.append(
                        (track, detection, dx, dy, distance_m, reach_m, distance_m <= circles_m)
                    )
        return candidates


def _iou(candidate: Candidate, tracks: Estimate, detections: Boxes) -> float:
    """Overlap of a pair."""
    track, detection, dx, dy = candidate[:4]
    length, width = tracks.size_m[track].tolist()
    to_length, to_width = detections.size_m[detection].tolist()
    yaw_rad, to_yaw_rad = float(tracks.yaw_rad[track]), float(detections.yaw_rad[detection])
    return iou_scalar((0.0, 0.0, length, width, yaw_rad), (dx, dy, to_length, to_width, to_yaw_rad))


def _counts(candidates: list[Candidate], entry: int) -> dict[int, int]:
    """How often each number stands in an entry of the candidates."""
    counts: dict[int, int] = {}
    for candidate in candidates:
        number = int(candidate[entry])
        counts[number] = counts.get(number, 0) + 1
    return counts


def _positions(candidates: list[Candidate], entry: int) -> IntArray:
    """(P,) one entry of the candidates."""
    return np.array([candidate[entry] for candidate in candidates], dtype=np.int64)


def staged(
    track: IntArray,
    detection: IntArray,
    shape: tuple[int, int],
    affinity: FloatArray,
    method: str,
    first: BoolArray | None,
) -> IntArray:
    """Positions of the matched pairs, ascending, in one stage or in two.

    Args:
        track: (P,) tracks of the pairs.
        detection: (P,) their detections.
        shape: How many tracks and detections there are.
        affinity: (P,) how well they go together; 0: not at all.
        method: See `smartmot.tracking.assignment.solve`.
        first: (N,) detections of the first stage. None: there is one stage.
    """
    if first is None:
        return solve(track, detection, affinity, method, shape)
    # the second stage solves only what the first left: pairs of its detections with tracks without a match
    early = first.take(detection)
    won = solve(track, detection, np.where(early, affinity, 0.0), method, shape)
    free = np.ones(shape[0], dtype=np.bool_)
    free[track.take(won)] = False
    left = (~early & free.take(track)).nonzero()[0]
    if len(left) == 0:
        return won
    late = solve(track.take(left), detection.take(left), affinity.take(left), method)
    return np.sort(np.concatenate((won, left.take(late))))
