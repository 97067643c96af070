"""How objects lie to the ego's path: along it, beside it, and how fast they move so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.path import PlannedPath
from smartmot.types import EgoState, FloatArray, Forecast, Tracks

_STEP_M = 1e-3
"""Least distance between two points of a path that is made of a forecast; nearer ones are one."""

_OUTLINE = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], dtype=np.float64)
"""Corners and middles of the edges of a box, in half lengths and half widths."""


@dataclass(frozen=True, slots=True, eq=False)
class PathRelation:
    """How M objects lie to the ego's path now.

    The ego goes on along the path as far beside it as its forecast begins. Its swept width is its own width;
    the swing of its corners in a bend is left out (0.1 m for a car at a radius of 20 m).

    Args:
        gap_m: (M,) free distance along the path from the ego's front to the near face of each box; negative
            where that is behind the front.
        aside_m: (M,) free distance from each box to the swept width, at its nearest point; 0 or negative: it
            is in it.
        speed_mps: (M,) speed along the path's direction at the object.
        aside_mps: (M,) rate at which `aside_m` grows; negative: the object comes nearer.
        offset_m: (M,) of each centre from the middle of the swept width; left is positive.
    """

    gap_m: FloatArray
    aside_m: FloatArray
    speed_mps: FloatArray
    aside_mps: FloatArray
    offset_m: FloatArray


def relation(
    ego: EgoState, path: PlannedPath, tracks: Tracks, forecast: Forecast, ego_forecast: Forecast
) -> PathRelation:
    """Relation of tracks to the ego's path.

    Args:
        ego: odometry now.
        path: of the ego's centre.
        tracks: M tracks; those that are not dynamic stand.
        forecast: of the tracks; its first poses are where they are now.
        ego_forecast: of the ego; its first pose is where it is expected on the path, or beside it.
    """
    points = _outline(forecast.center_m[:, 0], forecast.yaw_rad[:, 0], forecast.size_m)
    own, centers = ego_forecast.center_m[0, :1], forecast.center_m[:, 0]
    # one call places them all: each takes as long as some dozens of points
    all_station, all_offset = path.place(np.concatenate((own, centers, points.reshape(-1, 2))))
    own_station, own_offset = float(all_station[0]), float(all_offset[0])
    of_center = slice(1, 1 + len(tracks))
    center_station, center_offset = all_station[of_center], all_offset[of_center]
    station = all_station[of_center.stop :].reshape(len(tracks), len(_OUTLINE)) - own_station
    offset = all_offset[of_center.stop :].reshape(len(tracks), len(_OUTLINE)) - own_offset
    left, right = offset.min(axis=1), -offset.max(axis=1)
    _, heading = path.poses(center_station)
    velocity = np.where(tracks.dynamic[:, None], tracks.velocity_mps, 0.0)
    c, s = np.cos(heading), np.sin(heading)
    to_left = velocity[:, 1] * c - velocity[:, 0] * s
    return PathRelation(
        gap_m=station.min(axis=1) - ego.length_m / 2,
        aside_m=np.maximum(left, right) - ego.width_m / 2,
        speed_mps=velocity[:, 0] * c + velocity[:, 1] * s,
        aside_mps=np.where(left >= right, to_left, -to_left),
        offset_m=center_offset - own_offset,
    )


def path_of_forecast(ego: EgoState, ego_forecast: Forecast) -> PlannedPath:
    """The ego's path from its own forecast: the arc of its present turn rate, straight on beyond its end."""
    points = ego_forecast.center_m[0]
    apart = np.hypot(*np.diff(points, axis=0).T) > _STEP_M
    if ego.speed_mps <= 0.0 or not apart.all() or len(points) < 2:
        ahead = np.array([math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)])
        center = np.array([ego.x_m, ego.y_m])
        return PlannedPath.through(np.stack((center, center + ahead)))
    return PlannedPath.through(points)


def _outline(center_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray) -> FloatArray:
    """(M, 8, 2) corners and middles of the edges of boxes, map frame."""
    half = size_m[:, None, :] / 2 * _OUTLINE
    c, s = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    points = np.empty_like(half)
    points[..., 0] = c * half[..., 0] - s * half[..., 1]
    points[..., 1] = s * half[..., 0] + c * half[..., 1]
    points += center_m[:, None, :]
    return points
