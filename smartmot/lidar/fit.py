"""Boxes from the visible sides of bodies: these stay, and the box grows away from them to its class' size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import FloatArray, IntArray
from smartmot.geometry import wrap_angle
from smartmot.lidar.features import Clusters
from smartmot.pointcloud.cloud import RealArray

PEDESTRIAN_M = (0.6, 0.6, 1.8)
"""Euro NCAP's adult target is 0.60 m long, 0.50 m wide and 1.80 m tall (ISO 19206-2). The outline here is a
square, which needs no heading."""

CYCLIST_M = (1.89, 0.6, 1.86)
"""Length, and height with rider, of Euro NCAP's bicyclist target (ISO 19206-4); width of handlebars, DIN
79100."""

CAR_M = (4.023, 1.712, 1.427)
"""Euro NCAP's Global Vehicle Target (ISO 19206-3)."""

WIDEST_CAR_M = 2.1
"""A visible side that is longer is no front or rear. Cars are up to 2.05 m wide without mirrors."""

BROADSIDE = math.sin(math.radians(15.0))
"""Under this angle to the line of sight both ends of a side are seen and the box grows to both; over it, away
from the sensor; between, in proportion, so that nothing jumps."""

ADULT_DEPTH_M = 0.09
"""How far behind the mean of the points the middle of a body is: the mean depth of the front half of an
ellipse as deep as an adult's trunk and legs in mid-stride, 0.36 m, is (1 - pi/4) of its half under the tip:
pi/4 x 0.18 m, less arms and legs that are seen beside and behind it."""

SAMPLES = 32
"""Points of a cluster from which the heading of a vehicle is found."""

ANGLES = 30
"""Headings in a quarter turn that are tried: 3 degrees apart, then 1 degree around the best."""

CLOSEST_M = 0.1
"""Nearer points do not count more: Zhang, Xu, Dong, Dolan, "Efficient L-shape fitting for vehicle detection
using laser scanners", IEEE Intelligent Vehicles Symposium 2017, d0."""


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """N boxes from above, and how they fit.

    Args:
        center_m: (N, 2) middles.
        size_m: (N, 2) lengths and widths.
        yaw_rad: (N,) headings of the lengths.
        extent_m: (N, 2) how much of length and width is seen.
        off_side_m: (N,) mean distance of the points to the two sides that are seen.
    """

    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    extent_m: FloatArray
    off_side_m: FloatArray


def pedestrian_outlines(xy_m: FloatArray, clusters: Clusters, chosen: IntArray) -> Outlines:
    """Squares around people, turned to the line of sight.

    Args:
        xy_m: (K, 2) points of all clusters, run by run.
        clusters: whose they are.
        chosen: (N,) which of them.
    """
    middle = clusters.middle_m[chosen]
    yaw = np.arctan2(middle[:, 1], middle[:, 0])
    low, high = _extents(xy_m, clusters, chosen, yaw)
    distance = np.maximum(np.hypot(*middle.T), 1e-9)
    size = np.broadcast_to(np.array(PEDESTRIAN_M[:2]), (len(chosen), 2)).copy()
    center = middle * (1.0 + ADULT_DEPTH_M / distance)[:, None]
    return Outlines(center, size, yaw, high - low, np.zeros(len(chosen)))


def cyclist_outlines(xy_m: FloatArray, clusters: Clusters, chosen: IntArray) -> Outlines:
    """Boxes along the principal axes; see `pedestrian_outlines`."""
    yaw = clusters.axis_rad[chosen]
    low, high = _extents(xy_m, clusters, chosen, yaw)
    return _grown(low, high, CYCLIST_M, yaw, np.zeros(len(chosen)))


def car_outlines(xy_m: FloatArray, clusters: Clusters, chosen: IntArray) -> Outlines:
    """Boxes along two visible sides at right angles; see `pedestrian_outlines`."""
    yaw, off_side = _l_shapes(xy_m, clusters, chosen)
    low, high = _extents(xy_m, clusters, chosen, yaw)
    extent = high - low
    longer = extent[:, 0] >= extent[:, 1]
    # a side that is no longer than a car is wide is its front or rear
    swapped = np.where(extent.max(axis=1) > WIDEST_CAR_M, ~longer, longer)
    # axes (u, v) turned by 90 degrees are (v, -u)
    turned_low = np.column_stack((low[:, 1], -high[:, 0]))
    turned_high = np.column_stack((high[:, 1], -low[:, 0]))
    low = np.where(swapped[:, None], turned_low, low)
    high = np.where(swapped[:, None], turned_high, high)
    return _grown(low, high, CAR_M, yaw + np.where(swapped, 0.5 * math.pi, 0.0), off_side)


def _extents(
    xy_m: FloatArray, clusters: Clusters, chosen: IntArray, yaw_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(C, 2) least and greatest coordinates along and across headings."""
    count = clusters.count[chosen]
    start = np.cumsum(count) - count
    rows = np.repeat(clusters.first[chosen] - start, count) + np.arange(int(count.sum()))
    owner = np.repeat(np.arange(len(chosen)), count)
    c, s = np.cos(yaw_rad)[owner], np.sin(yaw_rad)[owner]
    x, y = xy_m.T.take(rows, axis=1)
    axes = (c * x + s * y, c * y - s * x)
    low = np.column_stack([np.minimum.reduceat(axis, start) for axis in axes])
    high = np.column_stack([np.maximum.reduceat(axis, start) for axis in axes])
    return low, high


def _grown(
    low_m: FloatArray,
    high_m: FloatArray,
    least_m: tuple[float, ...],
    yaw_rad: FloatArray,
    off_side_m: FloatArray,
) -> Outlines:
    """Boxes with at least the size of a class; see `BROADSIDE`."""
    middle, extent = 0.5 * (low_m + high_m), high_m - low_m
    size = np.maximum(extent, least_m[:2])
    sight = middle / np.maximum(np.hypot(*middle.T), 1e-9)[:, None]
    center = middle + 0.5 * (size - extent) * np.clip(sight / BROADSIDE, -1.0, 1.0)
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    place = np.column_stack((c * center[:, 0] - s * center[:, 1], s * center[:, 0] + c * center[:, 1]))
    # of the two headings along the length the one that leads away from the sensor
    forward = np.where(sight[:, 0] < 0.0, yaw_rad + math.pi, yaw_rad)
    return Outlines(place, size, wrap_angle(forward), extent, off_side_m)


def _l_shapes(xy_m: FloatArray, clusters: Clusters, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """(C,) headings of the rectangles whose two near sides most points are close to, and how close."""
    count = clusters.count[chosen]
    sample = (np.arange(SAMPLES)[:, None] * (count - 1) / (SAMPLES - 1)).astype(np.intp)
    # relative to their mean, float32 is exact to a micrometre
    sight = clusters.middle_m[chosen]
    at = xy_m.T.take(clusters.first[chosen] + sample, axis=1)
    points = (at - sight.T[:, None]).astype(np.float32)
    coarse = np.linspace(0.0, 0.5 * math.pi, ANGLES, endpoint=False)
    best = coarse[_closeness(points, sight, coarse[None])[0].argmax(axis=1)]
    fine = best[:, None] + np.radians(np.arange(-2.0, 3.0))
    close, off_side = _closeness(points, sight, fine)
    row = np.arange(len(chosen))
    column = close.argmax(axis=1)
    return fine[row, column], off_side[row, column]


def _closeness(
    points_m: RealArray, sight_m: FloatArray, yaw_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(C, A) how close (2, S, C) points are to near sides under (C, A) headings, and mean distances."""
    c, s = (f(yaw_rad).astype(np.float32) for f in (np.cos, np.sin))
    x, y = points_m[..., None]
    far = None
    for along_x, along_y in ((c, s), (-s, c)):
        toward = along_x * sight_m[:, :1] + along_y * sight_m[:, 1:]
        sign = np.where(toward < 0.0, -1.0, 1.0).astype(np.float32)
        axis = sign * along_x * x
        axis += sign * along_y * y
        axis -= axis.min(axis=0)
        far = axis if far is None else np.minimum(far, axis, out=far)
    assert far is not None
    return (np.float32(1.0) / np.maximum(far, np.float32(CLOSEST_M))).mean(axis=0), far.mean(axis=0)
