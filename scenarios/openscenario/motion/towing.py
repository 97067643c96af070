"""A trailer behind a towing vehicle: its axle does not slip sideways, its coupler stays on the hitch.

The kinematic model of tractor and trailer (J.-P. Laumond, ed., Robot Motion Planning and Control, 1998,
section 1): with the hitch moving by ds in a direction that is turned by phi against the trailer, the trailer
turns by sin(phi) ds / L, where L is from its axle to its coupler. Along a straight line this is a tractrix,
tan(phi/2) = tan(phi0/2) exp(-s/L); behind a vehicle that turns on a circle of radius R, with its hitch h
behind its axle, the axle of the trailer comes to a circle of radius sqrt(R^2 + h^2 - L^2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from scenarios.openscenario.motion.paths import Pose


def drawn(pose: Pose, coupler_m: float, hitches: Iterable[tuple[float, float]]) -> tuple[Pose, float]:
    """Pose of a trailer after its coupler has been drawn along straight lines, and the way of its axle.

    Args:
        pose: at the beginning.
        coupler_m: from axle to coupler.
        hitches: x and y of the ends of the lines; the first line begins at the coupler.

    Returns:
        The pose, and the way in metres, negative where it is pushed back on the whole.
    """
    at = pose.moved(coupler_m, 0.0)
    x, y, yaw = at.x_m, at.y_m, pose.yaw_rad
    back_x, back_y, way = pose.x_m, pose.y_m, 0.0
    for to_x, to_y in hitches:
        dx, dy = to_x - x, to_y - y
        moved = math.hypot(dx, dy)
        if moved > 0.0:
            turned = math.remainder(yaw - math.atan2(dy, dx), 2 * math.pi)
            # tan(phi/2) is infinite where the trailer heads straight against the motion, and stays so
            yaw += 2.0 * math.atan(math.tan(0.5 * turned) * math.exp(-moved / coupler_m)) - turned
        x, y = to_x, to_y
        c, s = math.cos(yaw), math.sin(yaw)
        new_x, new_y = x - coupler_m * c, y - coupler_m * s
        way += (new_x - back_x) * c + (new_y - back_y) * s
        back_x, back_y = new_x, new_y
    return Pose(back_x, back_y, yaw), way
