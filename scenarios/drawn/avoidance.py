"""Whether a must-brake scene can be avoided: by full braking as soon as there is something to brake for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarios.drawn.actors import EGO, Actor
from scenarios.drawn.stage import Stage
from scenarios.presets import PHYSICAL
from scenarios.sensors import visible_share
from smartmot.geometry import signed_gap
from smartmot.types import Boxes

STEP_S = 0.02
WAITS_S = 6.0
"""So long the ego stands: who drives into it then could not be avoided by braking (assumed)."""
_SIGHT_S = 0.05


@dataclass(frozen=True, slots=True)
class Avoidance:
    """What an emergency brake could do at best.

    Args:
        notice_s: time before the unbraked contact from which on the target is in sight and has set off.
        avoidable: whether full braking from then on avoids the contact.
    """

    notice_s: float
    avoidable: bool


def avoidance(stage: Stage, actors: list[Actor], contact_s: float) -> Avoidance:
    """The best that sensor and brakes of the preset `physical` could do, without noise and doubt.

    Args:
        stage: where.
        actors: all but the ego, the target first.
        contact_s: time of the unbraked contact.
    """
    target = actors[0]
    from_s = max(_in_sight_s(stage, actors, contact_s), target.motion.sets_off_s or 0.0)
    return Avoidance(contact_s - from_s, _stops_in_time(stage, target, from_s))


def _in_sight_s(stage: Stage, actors: list[Actor], contact_s: float) -> float:
    """From when on the target is seen until the contact."""
    sensor = PHYSICAL.sensor
    time_s = np.arange(0.0, contact_s, _SIGHT_S)
    ego, _ = stage.route.poses(stage.start_m + stage.speed_mps * time_s)
    poses = [actor.poses(time_s) for actor in actors]
    size = np.array([[actor.box.length_m, actor.box.width_m] for actor in actors])
    hidden_s = 0.0
    for k, (x, y) in enumerate(ego.tolist()):
        center = np.array([center[k] for center, _ in poses])
        near = math.hypot(center[0, 0] - x, center[0, 1] - y) <= sensor.range_m
        boxes = Boxes(center, size, np.array([yaw[k] for _, yaw in poses]))
        if not near or visible_share(boxes, x, y)[0] < sensor.min_visible:
            hidden_s = float(time_s[k]) + _SIGHT_S
    return min(hidden_s, contact_s)


def _stops_in_time(stage: Stage, target: Actor, from_s: float) -> bool:
    """Whether ego and target never touch if the ego brakes fully from an instant on, and stands."""
    brakes, speed = PHYSICAL.brakes, stage.speed_mps
    stop_s = brakes.delay_s + brakes.build_up_s + speed / brakes.max_decel_mps2
    since_s = np.arange(0.0, stop_s + WAITS_S, STEP_S)
    way_m = np.array([brakes.travel(speed, 0.0, float(t))[0] for t in since_s])
    ego, ego_yaw = stage.route.poses(stage.start_m + speed * from_s + way_m)
    center, yaw = target.poses(from_s + since_s)
    size = np.array([target.box.length_m, target.box.width_m])
    gaps = signed_gap(ego, np.array([EGO.length_m, EGO.width_m]), ego_yaw, center, size, yaw)
    return bool((gaps > 0.0).all())
