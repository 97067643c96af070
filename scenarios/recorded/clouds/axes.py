"""Clouds whose sensor has another axis ahead than x, turned about their vertical by whole quarters."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D, PointCloud

_QUARTERS = {"x": 0, "y": 1, "-x": 2, "-y": 3}

AHEAD = tuple(_QUARTERS)
"""Axes of a sensor that may point ahead; z is up, so that the axis to the left follows."""

_OURS_OF_QUARTERS = (
    ((1.0, 0.0), (0.0, 1.0)),
    ((0.0, 1.0), (-1.0, 0.0)),
    ((-1.0, 0.0), (0.0, -1.0)),
    ((0.0, -1.0), (1.0, 0.0)),
)
"""Ahead and left of a sensor's x and y."""


def cloud_ahead(cloud: PointCloud, ahead: str) -> PointCloud:
    """A cloud with x ahead and y left.

    Args:
        cloud: in the sensor's axes.
        ahead: out of `AHEAD`, the sensor's axis that points ahead.
    """
    return cloud if ahead == "x" else replace(cloud, xyz_m=_turned(cloud.xyz_m, _QUARTERS[ahead]))


def boxes_ahead(boxes: Boxes3D, ahead: str) -> Boxes3D:
    """Boxes of a sensor's axes with x ahead and y left."""
    return _boxes(boxes, _QUARTERS[ahead])


def boxes_of_sensor(boxes: Boxes3D, ahead: str) -> Boxes3D:
    """Boxes with x ahead in the sensor's axes: the inverse of `boxes_ahead`."""
    return _boxes(boxes, -_QUARTERS[ahead] % 4)


def _boxes(boxes: Boxes3D, quarters: int) -> Boxes3D:
    if not quarters:
        return boxes
    yaw = wrap_angle(boxes.yaw_rad - 0.5 * math.pi * quarters)
    return Boxes3D(_turned(boxes.center_m, quarters), boxes.size_m, yaw)


def _turned(xyz_m: NDArray[Any], quarters: int) -> NDArray[Any]:
    """(N, 3) points of axes that are so many quarters further to the left; exact, of the same kind."""
    turned = np.array(xyz_m)
    for column, (of_x, of_y) in enumerate(_OURS_OF_QUARTERS[quarters]):
        turned[:, column] = of_x * xyz_m[:, 0] if of_x else of_y * xyz_m[:, 1]
    return turned
