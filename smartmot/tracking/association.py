"""Which detection belongs to which track: gate, affinity, and an assignment per stage.

Only pairs within a spatial gate exist, as index arrays; no table of all tracks by all detections is made. The
affinities:

- `overlap`: bird's-eye-view IoU, the paper's; pairs under a threshold are dropped.
- `overlap_then_distance`: alone, IoU loses whatever moves more than its own size between two frames, such as
  a running pedestrian at 5 Hz, so pairs without overlap may still match by distance within the gate. All
  distance matches together weigh less than the least overlap: they fill in what the overlaps leave free.
- `generalised_overlap`: generalised IoU, which says for boxes apart how far apart they are.
- `distance`: distance of the centres over the gate.
- `mahalanobis`: distance in standard deviations of the innovation over the gate's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from smartmot.errors import ConfigError
from smartmot.filters.kalman import Estimate
from smartmot.filters.motion_models import PerCategory, Setting, check_range, table
from smartmot.geometry import near_pairs
from smartmot.overlap import bev_giou, iou_exact, iou_scalar
from smartmot.tracking.assignment import contested, prepare
from smartmot.tracking.few.matching import FEW_CELLS, FEW_PAIRS, NO_REACH_M, FewMatcher, staged
from smartmot.types import CATEGORIES, BoolArray, Boxes, FloatArray, IntArray, unchecked

_GROUPS = (("car", "truck"), ("cyclist", "motorcycle"), ("pedestrian",))
"""Categories that detectors confuse from one frame to the next and that therefore may match."""

METHODS = ("hungarian", "greedy")
"""Greatest total affinity, or the best pair first."""


def _compatibility() -> BoolArray:
    """(C, C) flags: same group, or one of the two unknown."""
    group = {name: number for number, names in enumerate(_GROUPS) for name in names}
    compatible = [
        ["unknown" in (a, b) or group.get(a) == group.get(b) for b in CATEGORIES] for a in CATEGORIES
    ]
    return np.array(compatible)


COMPATIBLE = _compatibility()
"""(C, C) whether a track of one category may match a detection of another, in the order of CATEGORIES."""


@dataclass(frozen=True, slots=True)
class AssociationConfig:
    """How tracks and detections are matched.

    Args:
        cost: Name of the affinity, or one for each of CATEGORIES.
        method: "hungarian" or "greedy", or one for each of CATEGORIES.
        iou_threshold: Least overlap that counts as one. Source: paper, 0.001.
        giou_threshold: Least generalised overlap of a match.
        gate_m: Distance from the predicted centre within which a detection may be the track's. None: from
            the filter and the two settings below, wider after a long time without detection.
        gate_probability: Share of true matches that the gate keeps if the filter's covariance is right. 0
            with `gate_m` None: no distance matches at all, the paper's rule.
        speed_change_mps: Change of speed within one frame that the gate allows on top, because the filter
            knows no sudden starts. 15 km/h is a running pedestrian or child; the rest is the speed at which
            a category commonly enters the view.
        widest_gate_m: No gate is wider than this, whatever the filter says.
        hidden_gate_m: Distance within which what was hidden for a while may be found again, from the segment
            between the place where it was last seen and the predicted one: it may have stopped on the way. It
            also lets a category turn out another (`smartmot.tracking.recovery`). None: nothing of both.

    Raises:
        ConfigError: A value is outside its range, or a name is unknown.
    """

    cost: str | tuple[str, ...] = "overlap_then_distance"
    method: str | tuple[str, ...] = "hungarian"
    iou_threshold: Setting = 0.001
    giou_threshold: Setting = -0.5
    gate_m: Setting | None = None
    gate_probability: float = 0.999
    speed_change_mps: Setting = field(
        default=PerCategory(
            car=10.0, pedestrian=15.0 / 3.6, cyclist=25.0 / 3.6, truck=10.0, motorcycle=10.0, unknown=10.0
        )
    )
    widest_gate_m: Setting = 20.0
    hidden_gate_m: Setting | None = None

    def __post_init__(self) -> None:
        check_range(self, "iou_threshold", 1e-9, 1.0)
        check_range(self, "giou_threshold", -1.0, 1.0)
        check_range(self, "gate_probability", 0.0, 1.0 - 1e-12)
        check_range(self, "speed_change_mps", 0.0, math.inf)
        check_range(self, "widest_gate_m", 0.0, math.inf)
        if self.hidden_gate_m is not None:
            check_range(self, "hidden_gate_m", 0.0, math.inf)
        if self.gate_m is not None:
            check_range(self, "gate_m", 0.0, math.inf)
        for name, known in (("cost", tuple(AFFINITIES)), ("method", METHODS)):
            chosen = self.names(name)
            if len(chosen) != len(CATEGORIES) or not set(chosen) <= set(known):
                raise ConfigError(
                    f"AssociationConfig.{name}: choose one of {', '.join(known)}, or one for each of "
                    f"{', '.join(CATEGORIES)}; got {getattr(self, name)!r}"
                )
        statistical = {"distance", "mahalanobis", "generalised_overlap"} & set(self.names("cost"))
        if statistical and self.gate_m is None and self.gate_probability == 0.0:
            raise ConfigError(
                f"AssociationConfig: {min(statistical)} needs gate_m or a gate_probability over 0"
            )

    def names(self, setting: str) -> tuple[str, ...]:
        """The cost or method of each of CATEGORIES."""
        value: str | tuple[str, ...] = getattr(self, setting)
        return (value,) * len(CATEGORIES) if isinstance(value, str) else tuple(value)


@dataclass(slots=True, eq=False)
class Pairs:
    """Pairs of a track and a detection that a gate left, and what affinities are made of.

    Args:
        tracks: M predicted boxes.
        detections: N detected boxes.
        track: (P,) the tracks of the pairs.
        detection: (P,) their detections.
        offset_m: (P, 2) from the track's centre to the detection's, map frame.
        distance_m: (P,) length of the offset.
        reach_m: (P,) the distance gate.
        touching: (P,) whether the boxes' circumscribed circles meet.
        covariance: Predicted variances (M,) of the tracks' positions along x and y, and their covariance.
        noise: Variances (P,) of the measured position along x and y, and their covariance.
        contested: (P,) whether another pair has the same track or the same detection.
    """

    tracks: Boxes
    detections: Boxes
    track: IntArray
    detection: IntArray
    offset_m: FloatArray
    distance_m: FloatArray
    reach_m: FloatArray
    touching: BoolArray
    covariance: tuple[FloatArray, FloatArray, FloatArray]
    noise: tuple[FloatArray, FloatArray, FloatArray]
    contested: BoolArray

    def iou(self, which: IntArray) -> FloatArray:
        """(K,) overlaps of some of the pairs."""
        i, j, offset = self.track.take(which), self.detection.take(which), self.offset_m.take(which, axis=0)
        a, b = self.tracks, self.detections
        if len(which) > _FEW_PAIRS:
            a_size, b_size = a.size_m.take(i, axis=0), b.size_m.take(j, axis=0)
            return iou_exact(_ORIGIN, a_size, a.yaw_rad.take(i), offset, b_size, b.yaw_rad.take(j))
        sizes, yaws = a.size_m.tolist(), a.yaw_rad.tolist()
        other_sizes, other_yaws = b.size_m.tolist(), b.yaw_rad.tolist()
        return np.array(
            [
                iou_scalar((0.0, 0.0, *sizes[m], yaws[m]), (x, y, *other_sizes[n], other_yaws[n]))
                for m, n, (x, y) in zip(i.tolist(), j.tolist(), offset.tolist(), strict=True)
            ]
        )


# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_ZERO, _HALF, _ONE = np.array(0.0), np.array(0.5), np.array(1.0)

_ORIGIN = np.zeros(2)

_FEW_PAIRS = 20
"""Up to so many overlaps are computed faster one by one than as arrays."""

Affinity = Callable[[Pairs, FloatArray], FloatArray]
"""(P,) affinities of P pairs, at most 1, 0 for pairs that must not match; (P,) thresholds of the cost."""


def overlap(pairs: Pairs, threshold: FloatArray) -> FloatArray:
    """IoU where it reaches the threshold."""
    affinity = np.zeros(len(pairs.track))
    near = np.flatnonzero(pairs.touching)
    if len(near):
        iou = pairs.iou(near)
        affinity[near] = np.where(iou >= threshold[near], iou, 0.0)
    return affinity


def overlap_then_distance(pairs: Pairs, threshold: FloatArray) -> FloatArray:
    """IoU where it reaches the threshold, else a small affinity that falls with the distance.

    A pair within the gate that competes with no other matches whatever its overlap, so the exact overlap is
    computed for the remaining pairs only.
    """
    nearness = distance(pairs, threshold)
    # All distance matches of a frame together stay below the least overlap.
    affinity: FloatArray = nearness * (threshold / (min(len(pairs.tracks), len(pairs.detections)) + 1.0))
    exact = (pairs.touching & (pairs.contested | (nearness == 0.0))).nonzero()[0]
    if len(exact):
        iou = pairs.iou(exact)
        enough = (iou >= threshold.take(exact)).nonzero()[0]
        affinity[exact.take(enough)] = iou.take(enough)
    return affinity


def generalised_overlap(pairs: Pairs, threshold: FloatArray) -> FloatArray:
    """Generalised IoU from -1 to 1, mapped to 0 to 1."""
    giou = bev_giou(pairs.tracks[pairs.track], pairs.detections[pairs.detection])
    affinity: FloatArray = np.where(giou >= threshold, 0.5 * (giou + 1.0), 0.0)
    return affinity


def distance(pairs: Pairs, threshold: FloatArray) -> FloatArray:
    """1 at the predicted centre, 0 at the gate."""
    share: FloatArray = pairs.distance_m / np.maximum(pairs.reach_m, NO_REACH_M)
    np.subtract(_ONE, share, out=share)
    np.maximum(share, _ZERO, out=share)
    return share


def mahalanobis(pairs: Pairs, threshold: FloatArray) -> FloatArray:
    """1 at the predicted centre, 0 where the normalised innovation squared reaches the threshold."""
    of_track = (part[pairs.track] for part in pairs.covariance)
    squared = _squared_sigmas(pairs.offset_m, of_track, pairs.noise)
    affinity: FloatArray = np.maximum(1.0 - squared / threshold, 0.0)
    return affinity


def _squared_sigmas(
    offset_m: FloatArray, predicted: Iterable[FloatArray], noise: Iterable[FloatArray]
) -> FloatArray:
    """(P,) normalised innovations squared of offsets (P, 2); variances along x and y, then the covariance."""
    xx, yy, xy = (a + b for a, b in zip(predicted, noise, strict=True))
    dx, dy = offset_m[:, 0], offset_m[:, 1]
    # d' S^-1 d, with the inverse of the symmetric 2 x 2 innovation covariance S written out
    squared: FloatArray = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
    return squared


AFFINITIES: dict[str, Affinity] = {
    "overlap_then_distance": overlap_then_distance,
    "overlap": overlap,
    "generalised_overlap": generalised_overlap,
    "distance": distance,
    "mahalanobis": mahalanobis,
}
"""Affinities by name."""

_BY_DISTANCE = (overlap_then_distance, distance)
"""Affinities under which a pair within its gate that competes with no other matches in any case."""


class Associator:
    """Matches predicted tracks with detections.

    Args:
        config: Costs, methods and gates.
        position_variance_m2: (C,) variance of a measured position along each axis, for each category.
        affinity: Used for all categories in place of the configured cost.
    """

    def __init__(
        self, config: AssociationConfig, position_variance_m2: FloatArray, affinity: Affinity | None = None
    ) -> None:
        prepare()
        self._config = config
        self._variance = position_variance_m2
        # one table instead of three: taken once for all tracks
        self._gates = np.column_stack(
            (position_variance_m2, table(config.speed_change_mps), table(config.widest_gate_m))
        )
        # The chi-square quantile of two degrees of freedom has the closed form -2 ln(1 - p).
        self._chi2 = -2.0 * math.log1p(-config.gate_probability)
        self._fixed = None if config.gate_m is None else table(config.gate_m)
        costs, methods = config.names("cost"), config.names("method")
        self._rules = [
            (
                np.array([rule == (c, m) for c, m in zip(costs, methods, strict=True)]),
                affinity or AFFINITIES[rule[0]],
                self._threshold(rule[0]),
                rule[1],
            )
            for rule in dict.fromkeys(zip(costs, methods, strict=True))
        ]
        self._by_distance = all(rule[1] in _BY_DISTANCE for rule in self._rules)
        if "generalised_overlap" in costs:
            import shapely  # noqa: F401 - for `smartmot.overlap.bev_giou`; no frame waits for an import
        self._few = None
        if affinity is None and len(self._rules) == 1 and costs[0] == "overlap_then_distance":
            self._few = FewMatcher(
                self._gates, self._chi2, self._fixed, self._rules[0][2], COMPATIBLE, methods[0]
            )
        # Circles of boxes matter only where overlap does.
        self._overlaps = affinity is not None or any("overlap" in cost for cost in costs)

    def _threshold(self, cost: str) -> FloatArray:
        """(C,) threshold that a cost goes by."""
        if cost == "generalised_overlap":
            return table(self._config.giou_threshold)
        if cost == "mahalanobis":
            return np.full(len(CATEGORIES), max(self._chi2, NO_REACH_M))
        return table(self._config.iou_threshold)

    def reach_m(
        self,
        variance_m2: FloatArray,
        longest_m: FloatArray,
        code: IntArray,
        dt_s: float,
        own_noise_m2: FloatArray | None = None,
    ) -> FloatArray:
        """Distance from the predicted centre within which a detection may still be the track's.

        The larger of two: the chi-square gate of the innovation, and half the box plus what a sudden change
        of speed covers since the last frame. The gate is a circle of the mean variance.

        Args:
            variance_m2: (M,) predicted variance of the position along one axis, mean of the two.
            longest_m: (M,) longer side of the boxes.
            code: (M,) positions in CATEGORIES.
            dt_s: Time since the last frame.
            own_noise_m2: (M,) variance of the measured position, mean of both axes; None: as configured.

        Returns:
            (M,) metres; 0 where distance matches are switched off.
        """
        if self._fixed is not None:
            return self._fixed.take(code)
        if self._chi2 == 0.0:
            return np.zeros(len(code))
        noise_m2, sudden_mps, widest_m = self._gates.take(code, axis=0).T
        noise_m2 = noise_m2 if own_noise_m2 is None else own_noise_m2
        reach: FloatArray = variance_m2 + noise_m2
        reach *= self._chi2
        np.sqrt(reach, out=reach)
        sudden_m = sudden_mps * dt_s
        sudden_m += _HALF * longest_m
        np.maximum(reach, sudden_m, out=reach)
        np.minimum(reach, widest_m, out=reach)
        return reach

    def _noise(
        self, code: IntArray, pose_covariance: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Variances (P,) of measured positions along x and y, and their covariance, of pairs."""
        usual, nothing = self._variance.take(code), np.zeros(len(code))
        if pose_covariance is None:
            return usual, usual, nothing
        xx, yy, xy = (pose_covariance[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1)))
        own = np.isfinite(xx)
        return np.where(own, xx, usual), np.where(own, yy, usual), np.where(own, xy, nothing)

    def mean_noise_m2(self, code: IntArray, pose_covariance: FloatArray) -> FloatArray:
        """(P,) variances of measured positions, mean of both axes, for `reach_m`."""
        xx, yy, _ = self._noise(code, pose_covariance)
        mean: FloatArray = 0.5 * (xx + yy)
        return mean

    def _towards_m(
        self,
        offset_m: FloatArray,
        distance_m: FloatArray,
        covariance: tuple[FloatArray, FloatArray, FloatArray],
        track: IntArray,
        noise: tuple[FloatArray, FloatArray, FloatArray],
        longest_m: FloatArray,
        track_code: IntArray,
        dt_s: float,
    ) -> FloatArray:
        """(P,) `reach_m` of pairs, the gate being the ellipse of each innovation, towards the detection."""
        sigmas = np.sqrt(_squared_sigmas(offset_m, (part[track] for part in covariance), noise))
        along = distance_m / np.maximum(sigmas, NO_REACH_M)  # one standard deviation in that direction
        code = track_code[track]
        return self.reach_m(along * along, longest_m[track], code, dt_s, np.zeros(len(code)))

    def match(
        self,
        tracks: Estimate,
        track_code: IntArray,
        covariance: tuple[FloatArray, FloatArray, FloatArray],
        detections: Boxes,
        detection_code: IntArray,
        dt_s: float,
        first: BoolArray | None = None,
        overdue: BoolArray | None = None,
        pose_covariance: FloatArray | None = None,
    ) -> tuple[IntArray, IntArray]:
        """Matches, at most one per track and one per detection.

        Args:
            tracks: M predicted tracks.
            track_code: (M,) positions in CATEGORIES.
            covariance: Predicted variances (M,) of the position along x and y, and their covariance.
            detections: N detected boxes.
            detection_code: (N,) positions in CATEGORIES.
            dt_s: Time since the last frame.
            first: (N,) detections of the first stage; the others may only have the tracks it leaves. None:
                one stage.
            overdue: (M,) tracks that match by overlap alone, whatever the gate. None: none.
            pose_covariance: (N, 3, 3) noise that the detections state, NaN where they state none. A gate is
                then as wide as the innovation's ellipse towards the detection.

        Returns:
            (K,) tracks, ascending, and (K,) their detections.
        """
        size, center = tracks.size_m, detections.center_m
        variance, widest_m2 = covariance[0] + covariance[1], None
        variance *= _HALF
        if self._few is not None and pose_covariance is None and len(size) * len(center) <= FEW_CELLS:
            return self._few.match(
                tracks, track_code, variance, detections, detection_code, dt_s, first, overdue
            )
        longest_m = np.maximum(size[:, 0], size[:, 1])
        elliptic = self._fixed is None and self._chi2 > 0.0
        if pose_covariance is not None and elliptic:
            # no ellipse is longer than the root of its trace: which pairs lie in theirs is seen below
            trace = pose_covariance[:, 0, 0] + pose_covariance[:, 1, 1]
            widest_m2 = np.maximum(np.nanmax(trace, initial=0.0), 2.0 * self._variance.take(track_code))
            variance = 2.0 * variance
        reach = self.reach_m(variance, longest_m, track_code, dt_s, widest_m2)
        if overdue is not None:
            reach[overdue] = 0.0
        if self._overlaps:
            radius = np.hypot(size[:, 0], size[:, 1])
            other = np.hypot(detections.size_m[:, 0], detections.size_m[:, 1])
            radius *= _HALF
            other *= _HALF
        else:
            radius, other = np.zeros(len(size)), np.zeros(len(center))
        i, j = near_pairs(tracks.center_m, center, radius, other, reach)
        of_track, of_detection = track_code.take(i), detection_code.take(j)
        if np.count_nonzero(of_track == of_detection) < len(i):
            possible = COMPATIBLE[of_track, of_detection]
            i, j = i[possible], j[possible]
        if len(i) == 0:
            return i, j
        offset = center.take(j, axis=0) - tracks.center_m.take(i, axis=0)
        distance_m = np.hypot(offset[:, 0], offset[:, 1])
        gate, noise = reach.take(i), None
        if pose_covariance is not None:
            noise = self._noise(track_code.take(i), pose_covariance.take(j, axis=0))
            if elliptic:
                gate = self._towards_m(offset, distance_m, covariance, i, noise, longest_m, track_code, dt_s)
                if overdue is not None:
                    gate[overdue[i]] = 0.0
                near = (distance_m < gate) | (distance_m <= radius.take(i) + other.take(j))
                i, j, offset = i[near], j[near], offset[near]
                distance_m, gate = distance_m[near], gate[near]
                noise = noise[0][near], noise[1][near], noise[2][near]
                if len(i) == 0:
                    return i, j
        shared = contested(i, j)
        if shared is None and self._by_distance and np.count_nonzero(distance_m < gate) == len(i):
            return i, j
        meets = distance_m <= radius.take(i) + other.take(j)
        if self._few is not None and len(i) <= FEW_PAIRS:
            columns = i, j, offset[:, 0], offset[:, 1], distance_m, gate, meets
            candidates = list(zip(*(column.tolist() for column in columns), strict=True))
            return self._few.resolved(candidates, tracks, track_code, detections, first)
        code, shape = track_code.take(i), (len(size), len(center))
        pairs = Pairs(
            unchecked(Boxes, tracks.center_m, size, tracks.yaw_rad),
            detections,
            i,
            j,
            offset,
            distance_m,
            gate,
            meets,
            covariance,
            self._noise(code, None) if noise is None else noise,
            np.zeros(len(i), dtype=np.bool_) if shared is None else shared,
        )
        if len(self._rules) == 1:
            _, affinity, threshold, method = self._rules[0]
            value = affinity(pairs, threshold.take(code))
            pair = (value > 0.0).nonzero()[0] if shared is None else staged(i, j, shape, value, method, first)
            return i.take(pair), j.take(pair)
        chosen, free = [], np.ones(len(center), dtype=np.bool_)
        for members, affinity, threshold, method in self._rules:
            own = members[code] & free[j]
            value = np.where(own, affinity(pairs, threshold[code]), 0.0)
            pair = (value > 0.0).nonzero()[0] if shared is None else staged(i, j, shape, value, method, first)
            free[j[pair]] = False
            chosen.append(pair)
        pair = np.sort(np.concatenate(chosen))
        return i[pair], j[pair]
