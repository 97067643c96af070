"""Bystanders of drawn scenes, drawn alike for both kinds, so that kinds do not differ by clutter."""

from __future__ import annotations

import math

from scenarios.drawn.actors import Actor, standing
from scenarios.drawn.situations.motions import along
from scenarios.drawn.situations.vehicles import parking_middle_m
from scenarios.drawn.stage import Stage
from scenarios.drawn.timeline import CLEAR_M, Timeline
from scenarios.drawn.values import Draw, RejectedDraw, law

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
            if timeline.gap_m(actor).min() > CLEAR_M and timeline.is_apart(actor):
                timeline.add(actor)
                actors.append(actor)
                break
    draw.values["bystanders_wanted"], draw.values["bystanders"] = float(wanted), float(len(actors))
    return actors


def _bystander(stage: Stage, draw: Draw, name: str, end_s: float) -> Actor:
    kind = law("bystander").text(draw.uniform())
    sign = stage.near if draw.uniform() < 0.6 else -stage.near
    station = draw.between(max(stage.start_m + 6.0, stage.line_m - 40.0), stage.line_m + 15.0)
    side = stage.side(station, sign)
    if kind in ("stands", "walks"):
        if side.sidewalk is None:
            raise RejectedDraw("no sidewalk")
        outline = "child" if draw.uniform() < 0.2 else "adult"
        left = sign * draw.between(side.kerb_m + 0.4, max(side.sidewalk.outer_m - 0.3, side.kerb_m + 0.5))
        if kind == "stands":
            return standing(name, outline, stage.pose(station, left, draw.between(-math.pi, math.pi)))
        speed = draw.sign() * draw.between(0.9, 1.7)
        return along(name, outline, stage, station, left, speed, end_s)
    if kind == "parked car":
        outline = "large car" if draw.uniform() < 0.5 else "small car"
        middle = parking_middle_m(stage, station, sign)
        return standing(
            name, outline, stage.pose(station, sign * middle, 0.0 if sign == stage.near else math.pi)
        )
    if kind == "oncoming car":
        strip = stage.side(station, -stage.near).nearest("driving", same_way=False)
        if strip is None:
            raise RejectedDraw("no oncoming lane")
        speed = draw.between(6.0, 14.0)
        return along(
            name,
            "small car",
            stage,
            station + draw.between(0.0, 40.0),
            -stage.near * strip.middle_m,
            -speed,
            end_s,
        )
    strip = side.nearest("biking")
    if strip is None:
        raise RejectedDraw("no cycle lane")
    speed = (1 if sign == stage.near else -1) * draw.between(3.5, 6.0)
    return along(name, "bicyclist", stage, station, sign * strip.middle_m, speed, end_s)
