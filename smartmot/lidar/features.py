"""What is measured of clusters: extents, profile, count of points, and what is around them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import BoolArray, FloatArray, IntArray
from smartmot.lidar.clusters import by_label

FEATURES = (
    "range_m", "log_count", "log_count_of_body", "top_m", "bottom_m", "width_m", "possible_width_m",
    "depth_m", "major_m", "minor_m", "log_fill", "head_width_m", "upper_width_m", "lower_width_m",
    "mean_height", "spread_height", "crowding", "overhead", "hidden_sides", "joined_sides",
)  # fmt: skip
"""Columns of `Clusters.features`. Heights are over the ground; widths lie across the line of sight, depths
along it; a possible width is wider by the mean step between two rays; major and minor are standard deviations
along the principal axes; counts of a body are those of an adult."""

DENSITY_CELL_RAD = 0.07
"""Four degrees: three rows of a sensor with 32."""

STEEPEST = 1.4
"""Steepest row of cells, rise over distance: 54 degrees."""

SIDE_RAD = math.radians(0.5)
"""Bins of azimuth in which the nearest point counts: over the step of a spinning sensor, 0.17 to 0.33 deg."""

SIDE_GAP_M = 0.6
"""What is nearer by more hides, what is within it belongs together: half a lane's margin to a parked car."""

RAY_SLOPE, FLATTEST = 0.01, 0.5
"""Bins of rise over distance in which rays are counted, 20 cm at 20 m, and the steepest."""

MOST_ROWS = 16
"""So many bins under a cluster are looked at, from the lowest on."""

AROUND_CELL_M, AROUND_M = 0.25, 0.75
"""Grid in which neighbours are counted, and how far from a cluster."""

HEAD, UPPER = 0.87, 0.6
"""Shares of the height over which the head is, and trunk and head: chin at 0.87, hip at 0.53 of the stature
(Drillis and Contini, 1966)."""

ADULT_M2 = 0.5 * 1.55
"""Silhouette of an adult between 0.25 m and the top: 0.5 m by 1.80 m is Euro NCAP's target (ISO 19206-2)."""


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """C clusters of points, each a run in a list of points.

    Args:
        point: (K,) the points, cluster after cluster; a point may be in two.
        first: (C,) where each cluster begins.
        count: (C,) its points.
        middle_m: (C, 2) means.
        features: (C, len(FEATURES)) what is measured.
        axis_rad: (C,) direction of the principal axis.
    """

    point: IntArray
    first: IntArray
    count: IntArray
    middle_m: FloatArray
    features: FloatArray
    axis_rad: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def column(self, name: str) -> FloatArray:
        """(C,) one of the features."""
        column: FloatArray = self.features[:, FEATURES.index(name)]
        return column


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What clusters are measured against.

    Args:
        xyz_m: (P, 3) all points within reach.
        azimuth_rad: (P,) of each.
        distance_m: (P,) horizontal, of each.
        obstacle: (Q,) points that stand on the ground and are no higher than a road user.
        tall: (T,) points over that.
        height_m: (Q,) of the obstacles over the ground.
    """

    xyz_m: FloatArray
    azimuth_rad: FloatArray
    distance_m: FloatArray
    obstacle: IntArray
    tall: IntArray
    height_m: FloatArray


def runs(label: IntArray, least_points: int) -> tuple[IntArray, IntArray, IntArray]:
    """Points sorted by label, first and count of each label that has enough of them."""
    count = np.bincount(label)
    order = by_label(label, len(count))
    large = count >= least_points
    kept = count[large]
    return order[np.repeat(large, count)], np.cumsum(kept) - kept, kept


def measured(around: Surroundings, labels: list[IntArray], least_points: int) -> Clusters:
    """Clusters of several groupings of the same obstacles.

    Args:
        around: the cloud.
        labels: (Q,) each: the cluster of every obstacle, -1: none.
        least_points: smaller clusters are left out.
    """
    parts = [runs(label + 1, least_points) for label in labels]
    points, firsts, counts = [], [], []
    start = 0
    for (point, first, count), label in zip(parts, labels, strict=True):
        if len(first) and label[point[0]] < 0:  # points without a cluster
            point, first, count = point[count[0] :], first[1:] - count[0], count[1:]
        points.append(point)
        firsts.append(first + start)
        counts.append(count)
        start += len(point)
    point, first, count = (np.concatenate(column) for column in (points, firsts, counts))
    if not len(first):
        none = np.zeros(0)
        return Clusters(point, first, count, np.zeros((0, 2)), np.zeros((0, len(FEATURES))), none)
    return _measured(around, point, first, count)


def _measured(around: Surroundings, point: IntArray, first: IntArray, count: IntArray) -> Clusters:
    """See `measured`."""
    x, y, z = around.xyz_m.T.take(around.obstacle[point], axis=1)
    height = around.height_m[point]
    owner = np.repeat(np.arange(len(first)), count)

    def mean(values: FloatArray) -> FloatArray:
        result: FloatArray = np.add.reduceat(values, first) / count
        return result

    def span(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)

    mx, my = mean(x), mean(y)
    distance = np.maximum(np.hypot(mx, my), 1e-9)
    ex, ey = mx / distance, my / distance
    dx, dy = x - mx[owner], y - my[owner]
    along, across = dx * ex[owner] + dy * ey[owner], dy * ex[owner] - dx * ey[owner]
    (near, far), (right, left) = span(along), span(across)
    bottom, top = span(height)
    xx, xy, yy = mean(dx * dx), mean(dx * dy), mean(dy * dy)
    half, root = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    axis = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    share = height / top[owner]
    upper = share > UPPER
    widths = []
    for chosen in (share > HEAD, upper, ~upper):
        low = np.minimum.reduceat(np.where(chosen, across, np.inf), first)
        high = np.maximum.reduceat(np.where(chosen, across, -np.inf), first)
        widths.append(np.maximum(np.where(np.isfinite(low), high - low, 0.0), 0.0))
    mean_height = mean(height)
    spread = np.sqrt(np.maximum(mean(height * height) - mean_height**2, 0.0))
    density = _density_per_sr(around, (mx, my), mean(z), distance)
    width, rise = np.maximum(left - right, 0.02), np.maximum(top - bottom, 0.02)
    fill = count / (density * width * rise / distance**2)
    low, high = (np.column_stack(pair) for pair in zip(span(x), span(y), strict=True))
    crowding, overhead = (
        _counts(around.xyz_m.T[:2].take(chosen, axis=1), low, high, margin_m)
        for chosen, margin_m in ((around.obstacle, AROUND_M), (around.tall, 0.25))
    )
    crowding -= count
    hidden, joined = _sides(around, (mx, my), distance, (right, left), (near, far))
    columns = (
        distance, np.log(count), np.log(count * distance**2 / (density * ADULT_M2)), top, bottom,
        left - right, left - right + distance / np.sqrt(density), far - near, np.sqrt(half + root),
    np.sqrt(np.maximum(half - root, 0.0)), np.log(fill), *widths, mean_height / top, spread / top,
    np.log1p(np.maximum(crowding, 0.0) / count), np.log1p(overhead / count), hidden, joined, )  # fmt: skip
    return Clusters(point, first, count, np.column_stack((mx, my)), np.column_stack(columns), axis)


def _density_per_sr(
    around: Surroundings, middle_m: tuple[FloatArray, FloatArray], z_m: FloatArray, distance_m: FloatArray
) -> FloatArray:
    """(C,) points per steradian of the sensor in the direction of each cluster, as the cloud shows them.

    The fullest of the nine cells around it counts: in others rays meet nothing. Rows are of equal height at a
    distance of 1 m: cells shrink with the cosine cubed.
    """
    step = DENSITY_CELL_RAD
    row = np.maximum(around.distance_m, 1e-9)
    np.divide(around.xyz_m[:, 2], row, out=row)
    np.clip(row, -STEEPEST, STEEPEST, out=row)
    columns, rows = int(2.0 * math.pi / step) + 3, 2 * int(STEEPEST / step) + 4
    cell = _binned(row, STEEPEST, step)
    cell *= columns
    cell += _binned(around.azimuth_rad, math.pi, step)
    count = np.bincount(cell, minlength=rows * columns)
    own = np.clip(z_m / distance_m, -STEEPEST, STEEPEST)
    at = _binned(own, STEEPEST, step) * columns
    at += _binned(np.arctan2(middle_m[1], middle_m[0]), math.pi, step)
    steps = (np.arange(-1, 2)[:, None] * columns + np.arange(-1, 2)).ravel()
    fullest = count[at[:, None] + steps].max(axis=1)
    area_sr = step**2 / (1.0 + own**2) ** 1.5
    density: FloatArray = np.maximum(fullest, 1.0) / area_sr
    return density


def _binned(value: FloatArray, least: float, step: float) -> IntArray:
    """Number of the bin of each value from -least on; the first is 1."""
    bins = value + least
    bins /= step
    bins += 1.0
    return bins.astype(np.intp)


def in_a_gap(
    around: Surroundings, clusters: Clusters, chosen: IntArray, ground_m: FloatArray, least_m: float
) -> BoolArray:
    """(N,) under which clusters the cloud shows nothing, so that they may reach down to the ground.

    Where a ray passes higher than `least_m` to something behind, nobody is; where it ends in front, it is not
    known what is hidden.

    Args:
        around: the cloud.
        clusters: what is found in it.
        chosen: (N,) which of them.
        ground_m: (N,) z of the ground under them.
        least_m: height over the ground.
    """
    x, y = clusters.middle_m[chosen].T
    range_m = clusters.column("range_m")[chosen]
    bottom_m = clusters.column("bottom_m")[chosen]
    low, high = (
        np.clip((ground_m + height_m) / range_m, -FLATTEST, FLATTEST) for height_m in (least_m, bottom_m)
    )
    z, distance_m = around.xyz_m[:, 2], around.distance_m
    ray = np.flatnonzero((z >= low.min() * distance_m) & (z <= high.max() * distance_m))
    columns, rows = round(2.0 * math.pi / SIDE_RAD), 2 * round(FLATTEST / RAY_SLOPE) + 1
    distance_m = distance_m[ray]
    slope = z[ray] / np.maximum(distance_m, 1e-9)
    bins = _sectors(around.azimuth_rad[ray], columns) * rows
    bins += np.rint((np.clip(slope, -FLATTEST, FLATTEST) + FLATTEST) / RAY_SLOPE).astype(np.intp)
    hit = np.zeros(columns * rows, dtype=np.bool_)
    hit[bins] = True
    # bins that lie between the two heights with their whole width
    window = np.ceil((low + FLATTEST) / RAY_SLOPE + 0.5).astype(np.intp)[:, None] + np.arange(MOST_ROWS)
    last = np.floor((high + FLATTEST) / RAY_SLOPE - 0.5).astype(np.intp)
    own = _sectors(np.arctan2(y, x), columns) * rows
    empty: BoolArray = ~((window <= last[:, None]) & hit[own[:, None] + np.minimum(window, rows - 1)]).any(
        axis=1
    )
    return empty


def _sectors(azimuth_rad: FloatArray, count: int) -> IntArray:
    """Number of the sector of each azimuth, of so many in a turn."""
    return np.floor(azimuth_rad * (count / (2.0 * math.pi))).astype(np.intp) % count


def _counts(axes_m: FloatArray, low_m: FloatArray, high_m: FloatArray, margin_m: float) -> FloatArray:
    """(C,) of the points, x and y (2, Q), within rectangles widened all round, to the nearest cells."""
    if not axes_m.shape[1]:
        return np.zeros(len(low_m))
    start = axes_m.min(axis=1)
    # sums over all cells before each: the first row and column are empty
    row, column = ((axes_m - start[:, None]) / AROUND_CELL_M).astype(np.intp) + 1
    rows, columns = int(row.max()) + 1, int(column.max()) + 1
    row *= columns
    row += column
    # no sum is greater than the number of points: small numbers keep the table in the cache
    total = np.zeros((rows, columns), dtype=np.int16 if len(row) < 2**15 else np.int32)
    np.add.at(total.ravel(), row, total.dtype.type(1))
    np.cumsum(total, axis=0, out=total)
    np.cumsum(total, axis=1, out=total)
    most = (rows - 1, columns - 1)
    i, j = np.clip(np.rint((low_m - margin_m - start) / AROUND_CELL_M), 0, most).astype(np.int64).T
    k, m = np.clip(np.rint((high_m + margin_m - start) / AROUND_CELL_M), 0, most).astype(np.int64).T
    counts: FloatArray = (total[k, m] - total[i, m] - total[k, j] + total[i, j]).astype(np.float64)
    return counts


def _sides(
    around: Surroundings,
    middle: tuple[FloatArray, FloatArray],
    distance_m: FloatArray,
    across: tuple[FloatArray, FloatArray],
    along: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """(C,) sides, 0 to 2, where something nearer hides what comes next, and those with something as near."""
    bins = round(2.0 * math.pi / SIDE_RAD)
    azimuth, range_m = around.azimuth_rad[around.obstacle], around.distance_m[around.obstacle]
    nearest = np.full(bins, np.inf)
    np.minimum.at(nearest, (azimuth / SIDE_RAD).astype(np.int64) % bins, range_m)
    heading = np.arctan2(middle[1], middle[0])
    hidden, joined = np.zeros(len(heading)), np.zeros(len(heading))
    for offset, outward in zip(across, (-1, 1), strict=True):
        edge = np.floor((heading + np.arctan2(offset, distance_m)) / SIDE_RAD).astype(np.int64)
        beside = np.minimum(nearest[(edge + outward) % bins], nearest[(edge + 2 * outward) % bins])
        hidden += beside < distance_m + along[0] - SIDE_GAP_M
        joined += (beside >= distance_m + along[0] - SIDE_GAP_M) & (
            beside <= distance_m + along[1] + SIDE_GAP_M
        )
    return hidden, joined
