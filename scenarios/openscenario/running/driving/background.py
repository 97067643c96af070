"""Entities that another simulator moves, in step with the engine, and how they touch the ego."""

from __future__ import annotations

import math
from typing import Protocol

from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.results import Contact
from scenarios.openscenario.running.world import Instant, World


class Background(Protocol):
    """Moves some entities of a scenario by a simulation of its own, which sees the ego.

    Attributes:
        names: of these entities. None of them is what the scenario is about.
        next_s: when `update` next has something to do; no step goes beyond it.
    """

    names: frozenset[str]
    next_s: float

    def begin(self, world: World, ego: Actor) -> None:
        """Place its entities, each with a controller, once the initial actions have placed the others."""

    def update(self, now: Instant) -> bool:
        """Go on to the next step if the present one is over; whether it has."""


def contact_of(ego: Actor, other: Actor, instant: Instant) -> Contact:
    """The touch of the ego with another at an instant."""
    own, hit = instant.state(ego.name), instant.state(other.name)
    _, left_m = _from_ego(ego, other, instant)
    return Contact(
        time_s=instant.time_s,
        entity=other.name,
        ego_speed_mps=own.speed_mps,
        entity_speed_mps=hit.speed_mps,
        impact_location_percent=50.0 + 100.0 * left_m / ego.definition.width_m,
    )


def strikes_from_behind(ego: Actor, other: Actor, instant: Instant) -> bool:
    """Whether the middle of another that touches the ego lies behind the ego's rear end."""
    return _from_ego(ego, other, instant)[0] < -ego.definition.length_m / 2


def _from_ego(ego: Actor, other: Actor, instant: Instant) -> tuple[float, float]:
    """From the centre of the ego's box to that of another's, ahead and to the left."""
    state = instant.state(ego.name)
    ego_box, box = ego.box(state), other.box(instant.state(other.name))
    dx, dy = box[0] - ego_box[0], box[1] - ego_box[1]
    cos, sin = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
    return cos * dx + sin * dy, cos * dy - sin * dx
