"""Bystanders of drawn scenes, drawn alike for both kinds, so that kinds do not differ by clutter."""

from __future__ import annotations

import math

from scenarios.drawn.actors import Actor, standing
from scenarios.drawn.situations.motions import along
from scenarios.drawn.situations.vehicles import parking_middle_m
from scenarios.drawn.stage import Stage
from scenarios.drawn.timeline import CLEAR_M, Timeline
from scenarios.drawn.values import Draw, RejectedDraw, law
from scenarios.openscenario.motion.paths import Pose

MOST = 6
TRIES = 8
"""Draws of one bystander until it is given up: the road may have no room for it."""


def bystanders(stage: Stage, draw: Draw, timeline: Timeline) -> list[Actor]:
    """Up to six people, parked cars, oncoming cars and cyclists that have no part in the situation.

    Each stays clear of the unbraked ego and of all others.

    Args:
        stage: where.
        draw: of the scene.
        timeline: with all others; bystanders are added.
    """
    wanted = int(draw.uniform() * (MOST + 1))
    actors: list[Actor] = []
    for number in range(1, wanted + 1):
        for _ in range(TRIES):
            try:
                actor = _bystander(stage, draw, f"Bystander {number}", timeline.end_s)
            except RejectedDraw:
                continue
            fits = timeline.gap_m(actor).min() > CLEAR_M and timeline.keeps_to_its_ground(actor)
            if fits and timeline.is_apart(actor):
                timeline.add(actor)
                actors.append(actor)
                break
    draw.values["bystanders_wanted"], draw.values["bystanders"] = float(wanted), float(len(actors))
    return actors


def _bystander(stage: Stage, draw: Draw, name: str, end_s: float) -> Actor:
    """One bystander; what is drawn for it is not noted.

    Raises:
        RejectedDraw: the road has no place for it.
    """

    def number(of: str) -> float:
        return law(of).number(draw.uniform())

    kind = law("bystander").text(draw.uniform())
    sign = stage.near if draw.uniform() < 0.5 else -stage.near
    station = draw.between(max(stage.start_m + 6.0, stage.line_m - 40.0), stage.line_m + 15.0)
    side = stage.side(station, sign)
    along_way = 1 if sign == stage.near else -1
    if kind in ("stands", "walks"):
        if side.sidewalk is None:
            raise RejectedDraw("no sidewalk")
        outline = law("pedestrian").text(draw.uniform())
        left = sign * min(side.kerb_m + number("stands_from_kerb_m"), side.sidewalk.outer_m)
        if kind == "stands":
            return standing(name, outline, stage.pose(station, left, draw.between(-math.pi, math.pi)), "off")
        speed = draw.sign() * number("walking_speed_mps")
        return along(name, outline, stage, station, left, speed, end_s, "off")
    if kind == "parked car":
        pose = stage.pose(station, sign * parking_middle_m(stage, station, sign), 0.0)
        return standing(name, law("car").text(draw.uniform()), turned_by(pose, along_way))
    if kind == "oncoming car":
        strip = stage.side(station, -stage.near).nearest("driving", same_way=False)
        if strip is None:
            raise RejectedDraw("no oncoming lane")
        outline, speed = law("car").text(draw.uniform()), number("oncoming_speed_kmh") / 3.6
        station += draw.between(0.0, 40.0)
        left = -stage.near * strip.middle_m
        return along(name, outline, stage, station, left, -speed, end_s, "on")
    strip = side.nearest("biking")
    if strip is None:
        raise RejectedDraw("no cycle lane")
    speed = along_way * number("cyclist_speed_mps")
    return along(name, "bicyclist", stage, station, sign * strip.middle_m, speed, end_s, "on")


def turned_by(pose: Pose, along_way: int) -> Pose:
    """A pose along the ego's way (1), or turned against it (-1)."""
    return pose if along_way > 0 else pose.moved(0.0, 0.0, math.pi)
