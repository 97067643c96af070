"""Road users by what is measured of clusters: local ground, two groupings, boxes by class, calibrated scores.

1. The ground is found by sector and distance (`ground`).
2. Obstacles, points between 0.25 and 2.1 m over it, are grouped twice: closely, as people stand apart, and
   loosely, as parts of a vehicle do (`clusters`).
3. Each cluster is measured (`features`), and gets the box of each class whose limits it keeps (`fit`).
4. Scores are probabilities that the box of a class overlaps one of its road users (`evidence`); of boxes that
   overlap the most probable stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.errors import ConfigError
from smartmot.geometry import circles_touch
from smartmot.lidar.clusters import components
from smartmot.lidar.detections import GROUND, LOOSE, OFF_AREA, OUT_OF_REACH, BoxDetections, StageClock
from smartmot.lidar.evidence import probability
from smartmot.lidar.features import Clusters, Surroundings, in_a_gap, measured
from smartmot.lidar.fit import (
    CAR_M,
    CYCLIST_M,
    PEDESTRIAN_M,
    Outlines,
    car_outlines,
    cyclist_outlines,
    pedestrian_outlines,
)
from smartmot.lidar.ground import Ground, ground_under
from smartmot.lidar.monitored import Monitored
from smartmot.overlap import intersection_area
from smartmot.pointcloud import Boxes3D, PointCloud

CLOSE_CELL_M, LOOSE_CELL_M = 0.15, 0.35
"""Cells of the two groupings. Loose ones are linked to all eight around: a car's windows and bonnet are
gaps."""

TALLEST_PERSON_M, SHORTEST_PERSON_M = 2.1, 0.8
"""Tops of people, with shoes, hats and a ground wrong by a decimetre: 95 % of men are under 1.90 m
(DIN 33402-2), children of two over 0.85 m (WHO, child growth standards)."""

CHILD_TOP_M = 1.3
"""Who is seen to be lower is a child: between Euro NCAP's child (1.154 m) and adult (1.80 m)."""


@dataclass(frozen=True, slots=True)
class ClassicalConfig:
    """Parameters of the detector.

    Args:
        reach_m: horizontal distance up to which points count.
        ground_m: points up to this height over the ground are of the ground; over the usual kerb of 0.12 m.
        top_m: what is higher is no obstacle, but overhead.
        gap_m: greatest distance between neighbours of a close cluster near the sensor.
        gap_rad: the same as an angle, where that is more: two steps of 0.33 degrees.
        widest_gap_m: the most that it may be.
        least_points: smaller clusters are left out.
        least_score: boxes with a lower score are left out; trackers here drop those under 0.3.

    Raises:
        ConfigError: a value is out of range.
    """

    reach_m: float = 50.0
    ground_m: float = 0.25
    top_m: float = 2.1
    gap_m: float = 0.3
    gap_rad: float = 0.0116
    widest_gap_m: float = 0.5
    least_points: int = 3
    least_score: float = 0.3

    def __post_init__(self) -> None:
        lengths = (self.reach_m, self.ground_m, self.top_m, self.gap_m, self.widest_gap_m)
        if not all(0.0 < value < math.inf for value in lengths) or not 0.0 <= self.gap_rad < 1.0:
            raise ConfigError(f"classical detector: lengths must be positive and finite, got {self}")
        if self.top_m <= self.ground_m or self.widest_gap_m < self.gap_m:
            raise ConfigError(
                "classical detector: top_m must exceed ground_m, widest_gap_m be at least gap_m"
            )
        if self.least_points < 2 or not 0.0 <= self.least_score <= 1.0:
            raise ConfigError(
                "classical detector: least_points must be at least 2, least_score lie in [0, 1]"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Boxes before they are scored, N of all classes.

    Args:
        category: (N,) classes.
        boxes: the boxes.
        features: (N, F) what is measured of their clusters and boxes.
        cluster: (N,) which cluster each is of.
    """

    category: StrArray
    boxes: Boxes3D
    features: FloatArray
    cluster: IntArray


def detect_classical(
    cloud: PointCloud,
    config: ClassicalConfig,
    *,
    monitored: Monitored | None = None,
    sensor_height_m: float | None = None,
) -> BoxDetections:
    """Boxes of a cloud with probabilities; see `smartmot.lidar.detect`."""
    clock = StageClock()
    candidates, clusters, point_cluster = find_candidates(cloud, config, clock, monitored, sensor_height_m)
    score = probability(candidates.category, candidates.features)
    likely = np.flatnonzero(score >= config.least_score)
    likely = likely[np.argsort(-score[likely], kind="stable")]
    kept = likely[_apart(candidates.boxes[likely])]
    clock.note("scores", len(kept), "boxes")
    del clusters
    return BoxDetections(
        candidates.boxes[kept],
        score[kept],
        candidates.category[kept],
        clock.stages,
        point_cluster,
        candidates.cluster[kept],
    )


def find_candidates(
    cloud: PointCloud,
    config: ClassicalConfig,
    clock: StageClock,
    monitored: Monitored | None = None,
    sensor_height_m: float | None = None,
) -> tuple[Candidates, Clusters, IntArray]:
    """Boxes of all classes, their clusters, and (P,) what has become of each point."""
    point_cluster = np.full(len(cloud), OUT_OF_REACH, dtype=np.int64)
    # coordinate by coordinate: what goes through one of them reads no other
    axes = cloud.xyz_m.T.astype(np.float64, order="C")
    distance = np.hypot(axes[0], axes[1])
    within = np.flatnonzero(distance <= config.reach_m)
    if len(within) < len(cloud):
        axes, distance = axes.take(within, axis=1), distance.take(within)
    xyz, azimuth = axes.T, np.arctan2(axes[1], axes[0])
    clock.note("region of interest", len(within), "points")
    ground, height = ground_under(xyz, azimuth, distance, config.reach_m, sensor_height_m)
    above, over = height > config.ground_m, height > config.top_m
    fate = np.where(above, OUT_OF_REACH, GROUND)
    obstacle, tall = np.flatnonzero(above & ~over), np.flatnonzero(over)
    clock.note("ground", len(obstacle), "points")
    if monitored is not None:
        kept = monitored(xyz[obstacle]) if callable(monitored) else monitored[within[obstacle]]
        fate[obstacle[~kept]] = OFF_AREA
        obstacle = obstacle[kept]
        clock.note("monitored area", len(obstacle), "points")
    around = Surroundings(xyz, azimuth, distance, obstacle, tall, height[obstacle])
    gap = np.clip(distance[obstacle] * config.gap_rad, config.gap_m, config.widest_gap_m)
    close, loose = _groupings(axes[0].take(obstacle), axes[1].take(obstacle), gap)
    fate[obstacle] = np.where(np.bincount(close, minlength=1)[close] >= config.least_points, close, LOOSE)
    point_cluster[within] = fate
    clock.note("clusters", int(close.max(initial=-1)) + 1, "clusters")
    clusters = measured(around, [close, loose], config.least_points)
    clock.note("features", len(clusters), "clusters")
    candidates = _candidates(around, clusters, axes[:2].take(obstacle[clusters.point], axis=1).T, ground)
    clock.note("boxes", len(candidates.category), "boxes")
    return candidates, clusters, point_cluster


def _groupings(x_m: FloatArray, y_m: FloatArray, gap_m: FloatArray) -> tuple[IntArray, IntArray]:
    """(Q,) close cluster of each point, and (Q,) the loose one of several close ones that it is in, or -1."""
    close, sample = components(x_m, y_m, CLOSE_CELL_M, gap_m)
    if not len(close):
        return close, close
    x, y = x_m[sample], y_m[sample]
    group = components(x, y, LOOSE_CELL_M, np.full(len(x), 1.5 * LOOSE_CELL_M))[0]
    group_of = np.zeros(int(close.max()) + 1, dtype=np.int64)
    group_of[close[sample]] = group
    several = np.bincount(group_of, minlength=int(group.max()) + 1) > 1
    return close, np.where(several[group_of], group_of, -1)[close]


@dataclass(frozen=True, slots=True)
class ClassLimits:
    """What a cluster must be to be looked at as a class: physics, not evidence.

    Args:
        top_m: least and greatest height over the ground.
        extent_m: least and greatest extent across or along the line of sight, whichever is more.
        size_m: length, width and height of the class.
        outlines: makes the boxes.
        widest_m: greatest width of the box.
    """

    top_m: tuple[float, float]
    extent_m: tuple[float, float]
    size_m: tuple[float, float, float]
    outlines: Callable[[FloatArray, Clusters, IntArray], Outlines]
    widest_m: float


LIMITS = {
    "pedestrian": ClassLimits(
        (SHORTEST_PERSON_M, TALLEST_PERSON_M), (0.1, 1.1), PEDESTRIAN_M, pedestrian_outlines, math.inf
    ),
    "cyclist": ClassLimits((1.0, TALLEST_PERSON_M), (0.3, 2.4), CYCLIST_M, cyclist_outlines, 1.2),
    "car": ClassLimits((0.6, TALLEST_PERSON_M), (1.0, 7.0), CAR_M, car_outlines, 2.6),
}
"""Extents: a pace is up to 0.8 m, with a foot 1.1 m; a bicycle up to 2.0 m long (DIN 79100) and 1.2 m
wide with load; a van up to 7.0 m, and 2.6 m wide with its mirrors (96/53/EC: 2.55 m without)."""

LOWEST_M = 0.45
"""A body begins no higher over the ground, knees behind a kerb, unless its lower part lies
between rays."""

LEAST_SEEN_M = 0.5
"""How much is seen of a body whose lower part lies between rays: a trunk, 0.29 of the stature (Drillis and
Contini, 1966)."""

NARROWEST_PERSON_M = 0.25
"""Extent across the line of sight that a person could have, by the step between rays: from the side a trunk
with arms is 0.26 m deep (DIN 33402-2, median of adults), and children stand or walk with feet apart. Posts
are 0.1 to 0.2 m wide."""

LEAST_SHARE = 0.15
"""Share of the points of an adult that a person in full view has: a child of 1 m is a quarter of an adult's
silhouette, and dark cloth loses four echoes in ten (assumed)."""

BOX_FEATURES = ("extent_long_m", "extent_wide_m", "off_side_m")
"""What the box adds to the features of its cluster."""

OVERLAP = 0.3
"""Of two boxes that share more of the smaller one's area, one is wrong."""


def _candidates(around: Surroundings, clusters: Clusters, xy_m: FloatArray, ground: Ground) -> Candidates:
    """A box of each class for each cluster that keeps its limits."""
    top = clusters.column("top_m")
    extent = np.maximum(clusters.column("width_m"), clusters.column("depth_m"))
    grounded = clusters.column("bottom_m") <= LOWEST_M
    seen = top - clusters.column("bottom_m")
    high = np.flatnonzero(~grounded & (seen >= LEAST_SEEN_M) & (top <= TALLEST_PERSON_M))
    if len(high):
        level = ground.level_m(clusters.middle_m[high])
        grounded[high] = in_a_gap(around, clusters, high, level, LOWEST_M)
    category, boxes, features, rows = [], [], [], []
    for name, limits in LIMITS.items():
        kept = grounded & (top >= limits.top_m[0]) & (top <= limits.top_m[1])
        chosen = np.flatnonzero(kept & (extent >= limits.extent_m[0]) & (extent <= limits.extent_m[1]))
        if not len(chosen):
            continue
        outlines = limits.outlines(xy_m, clusters, chosen)
        fits = outlines.size_m[:, 1] <= limits.widest_m
        if name == "pedestrian":
            fits &= _solid(clusters)[chosen]
        narrow = np.flatnonzero(fits)
        chosen = chosen[narrow]
        center = outlines.center_m[narrow]
        # a part of the body is hidden, or lies between two rows; a child is a person as tall as it is seen
        grown = (name != "pedestrian") | (top[chosen] > CHILD_TOP_M)
        height = np.where(grown, np.maximum(top[chosen], limits.size_m[2]), top[chosen])
        category.append(np.full(len(chosen), name))
        boxes.append(
            (
                np.column_stack((center, ground.level_m(center) + 0.5 * height)),
                np.column_stack((outlines.size_m[narrow], height)),
                outlines.yaw_rad[narrow],
            )
        )
        own = np.column_stack((outlines.extent_m, outlines.off_side_m))[narrow]
        features.append(np.column_stack((clusters.features[chosen], own)))
        rows.append(chosen)
    if not rows:
        none = np.zeros((0, clusters.features.shape[1] + len(BOX_FEATURES)))
        return Candidates(np.zeros(0, dtype=np.str_), Boxes3D.empty(), none, np.zeros(0, dtype=np.int64))
    columns = (np.concatenate(column) for column in zip(*boxes, strict=True))
    return Candidates(
        np.concatenate(category), Boxes3D(*columns), np.concatenate(features), np.concatenate(rows)
    )


def _solid(clusters: Clusters) -> BoolArray:
    """(C,) which clusters are wide enough for a person, and have the points of one unless it is hidden."""
    wide = clusters.column("possible_width_m") >= NARROWEST_PERSON_M
    # two standard deviations of a count allow for how rays happen to fall
    most = (clusters.count + 2.0 * np.sqrt(clusters.count)) / clusters.count
    full = clusters.column("log_count_of_body") + np.log(most) >= math.log(LEAST_SHARE)
    solid: BoolArray = wide & (full | (clusters.column("hidden_sides") > 0.0))
    return solid


def _apart(boxes: Boxes3D) -> IntArray:
    """Which of the boxes, the most probable first, share no more than `OVERLAP` with one before them."""
    count = len(boxes)
    i, j = np.triu_indices(count, 1)
    outline = boxes.on_ground
    a, b = outline[i], outline[j]
    near = np.flatnonzero(circles_touch(a.center_m, a.size_m, b.center_m, b.size_m))
    if not len(near):
        return np.arange(count)
    i, j, a, b = i[near], j[near], a[near], b[near]
    common = intersection_area(a.center_m, a.size_m, a.yaw_rad, b.center_m, b.size_m, b.yaw_rad)
    least = np.minimum(a.size_m.prod(axis=1), b.size_m.prod(axis=1))
    kept = np.ones(count, dtype=np.bool_)
    clash = common > OVERLAP * least
    # pairs are in the order of the first, so that whether it is kept is settled
    for first, second in zip(i[clash].tolist(), j[clash].tolist(), strict=True):
        kept[second] &= not kept[first]
    return np.flatnonzero(kept)
