"""An area that adapts: who can reach the planned path, with what is not known, and the map as evidence.

Not a place but a probability decides who counts. An object counts when the probability that it reaches the
ego's planned path within the forecast's horizon is above `probability`. Two things may happen, and what is
seen of the object says how likely each is:

- it goes on as it is forecast. It then reaches the path if it crosses the border of what the ego sweeps; the
  forecast's spread, which grows with time, says how likely that is;
- it stays beside the path, as what lies between says: the sidewalk's kerb, or a lane of its own. Its velocity
  across the path is then none but the filter's error.

A fence would leave out whoever is behind it. Here the map sets the odds before anything is seen of the
motion, and the velocity across the path, measured against its own standard deviation, moves them: somebody
who walks to the kerb with 1.3 m/s counts as behind no kerb at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from smartmot.area.monitored import MonitoredArea, Relevance, is_vulnerable
from smartmot.area.path import corridor
from smartmot.area.way import ALONG_PATH, Way, with_way
from smartmot.errors import ConfigError
from smartmot.forecast.uncertain import UncertainMotion
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray

_LANE_TYPES = ("driving", "biking")
"""Lanes beside the ego's in which vehicles stay. Who moves on a parking lane or a shoulder is about to leave
it, or has just come."""

_ACROSS_MPS = 1.34
"""Standard deviation of the velocity across the path of who goes to it: the mean walking speed. Source: U.
Weidmann, Transporttechnik der Fussgaenger, ETH Zurich, IVT 90 (1993)."""

_LEAST_SIGMA_M = 0.01
"""No place is known better; a tracker that tells no covariance is not divided by."""


@dataclass(frozen=True, slots=True)
class AdaptiveAreaConfig:
    """Settings of the area.

    Args:
        probability: an object counts when it reaches the path with more than this (0.7: of 0.3, 0.5, 0.7 and
            0.85 the best benefit on 150 training scenes of each kind, preset `real`; docs/answers.md).
        entering: probability before anything is seen of the motion that somebody beside the path goes to it,
            where nothing lies between (even odds: assumed).
        over_kerb: the same for who is on a sidewalk, or a vehicle in a lane of its own (assumed: one in ten).
        map_sigma_m: standard deviation of the distance between object and border of a lane, by errors of map
            and localisation. Source: 0.05 to 0.1 m RMS, Wan et al., ICRA 2018.

    Raises:
        ConfigError: a value is outside its range.
    """

    probability: float = 0.7
    entering: float = 0.5
    over_kerb: float = 0.1
    map_sigma_m: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= self.probability < 1:
            raise ConfigError(f"adaptive area: probability must lie in [0, 1), got {self.probability}")
        for name in ("entering", "over_kerb"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(f"adaptive area: {name} must lie in (0, 1], got {getattr(self, name)}")
        if not self.map_sigma_m > 0:
            raise ConfigError(f"adaptive area: map_sigma_m must be positive, got {self.map_sigma_m}")


@dataclass(frozen=True, slots=True, eq=False)
class _Reaching:
    """The area at one moment: an endless corridor, and who reaches the path in it."""

    way: Way
    config: AdaptiveAreaConfig
    lane_map: LaneMap | None
    ahead: MonitoredArea

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return self.ahead.kept(boxes, category)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        return self.ahead.relevance(boxes, category)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        return self.ahead.on_lane(center_m)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        return self.ahead.polygons()

    def reaching(self, motion: Callable[[], UncertainMotion]) -> BoolArray:
        """(M,) which objects reach the path with more than the probability."""
        seen = motion()
        counts = np.zeros(len(seen), dtype=np.bool_)
        if not len(seen):
            return counts
        free, normal = self._beside(seen)
        sigma = np.maximum(seen.sigma_m(normal), _LEAST_SIGMA_M)
        by_time = _special().ndtr(-free / sigma)
        reach = by_time.max(axis=1)
        # the odds of going to the path at all can only lower it; the map is asked for few
        rows = np.flatnonzero(reach > self.config.probability)
        if len(rows):
            first = by_time.argmax(axis=1)[rows]
            moved = free[rows, 0] - free[rows, first]
            noise = seen.drift_sigma_m(normal)[rows, first]
            across = _ACROSS_MPS * seen.time_s[first]
            share = entering(self._before(seen[rows]), moved, noise, across)
            # who is on the path already is not beside it
            counts[rows] = np.where(free[rows, 0] <= 0.0, 1.0, share) * reach[rows] > self.config.probability
        return counts

    def _beside(self, motion: UncertainMotion) -> tuple[FloatArray, FloatArray]:
        """(M, T) distances from what the ego sweeps, on the side of now; (M, T, 2) normals of the path."""
        m, t = motion.yaw_rad.shape
        station, offset = self.way.place(motion.center_m.reshape(-1, 2))
        course, offset = self.way.course_rad(station).reshape(m, t), offset.reshape(m, t)
        turn = motion.yaw_rad - course
        length, width = motion.size_m.T[..., None]
        half = 0.5 * (np.abs(np.sin(turn)) * length + np.abs(np.cos(turn)) * width)
        side = np.where(offset[:, :1] < 0.0, -1.0, 1.0)
        normal = np.stack((-np.sin(course), np.cos(course)), axis=-1)
        return side * offset - half - self.way.ego.width_m / 2, normal

    def _before(self, motion: UncertainMotion) -> FloatArray:
        """(M,) probabilities of going to the path before anything is seen of the motion."""
        config = self.config
        before = np.full(len(motion), config.entering)
        if self.lane_map is None:
            return before
        vulnerable = is_vulnerable(motion.category)
        for rows, types in ((vulnerable, ("sidewalk",)), (~vulnerable, _LANE_TYPES)):
            if not rows.any():
                continue
            behind = _inside(self.lane_map, motion.center_m[rows, 0], types, config.map_sigma_m)
            before[rows] = behind * config.over_kerb + (1.0 - behind) * config.entering
        return before


def _special() -> ModuleType:
    """SciPy's functions: imported when an area is made, not with the tracker and not in a frame."""
    from scipy import special

    return special


def entering(
    before: FloatArray, moved_m: FloatArray, noise_m: FloatArray, across_m: FloatArray
) -> FloatArray:
    """(N,) probabilities that objects go to the path rather than stay beside it: Bayes' rule for two normals.

    Args:
        before: (N,) probabilities before anything is seen of the motion.
        moved_m: (N,) forecast ways to the path.
        noise_m: (N,) standard deviations of those of who stays: errors of the estimate.
        across_m: (N,) standard deviations of the true ways of who goes.
    """
    special = _special()
    noise = np.maximum(noise_m, _LEAST_SIGMA_M) ** 2
    spread = noise + across_m**2
    # logarithms: what walks has odds beyond any number
    of_motion = 0.5 * moved_m**2 * (1.0 / noise - 1.0 / spread) + 0.5 * np.log(noise / spread)
    goes = (moved_m > 0.0) | (before >= 1.0)
    return np.asarray(np.where(goes, special.expit(special.logit(before) + of_motion), 0.0))


def _inside(lane_map: LaneMap, xy_m: FloatArray, types: tuple[str, ...], sigma_m: float) -> FloatArray:
    """(N,) probabilities that points, (N, 2), are inside a lane of some types, given the border's error."""
    nearest = lane_map.nearest_lane(xy_m, types)
    depth = np.where(nearest.found, -nearest.distance_m, -np.inf)
    lane_type = lane_map.lanes.lane_type
    placed = lane_map.locate(xy_m)
    of_types = np.isin(lane_type[placed.lane], types)
    np.maximum.at(depth, placed.point[of_types], placed.margin_m[of_types])
    return np.asarray(_special().ndtr(depth / sigma_m))


class AdaptiveArea:
    """Counts who reaches the planned path with more than a probability; tracks everything.

    Way and standing objects are those of the path (`smartmot.area.way`).

    Args:
        lane_map: for what lies between object and path; None: nothing is known of that.
        config: see there.
    """

    name = "adaptive"
    uses_path = True

    def __init__(self, lane_map: LaneMap | None, config: AdaptiveAreaConfig | None = None) -> None:
        self.config = config or AdaptiveAreaConfig()
        self._map = lane_map
        _special()

    def at(self, ego: EgoState, path: PlannedPath | None = None) -> MonitoredArea:
        """The area ahead of `ego`."""
        way = Way(ego, path)
        area = _Reaching(way, self.config, self._map, corridor(way))
        return with_way(area, ego, path, ALONG_PATH, ALONG_PATH)
