"""How far a run can go at once: as long as no plan, condition, contact or command can change.

Who is commanded goes in steps, each from where it is after the last; all others are where their plans say.
"""

from __future__ import annotations

from collections.abc import Sequence

from scenarios.openscenario.running.actors import COMMAND_EPSILON_S, Actor
from scenarios.openscenario.running.conditions import Observed
from scenarios.openscenario.running.driving.contacts import Contacts
from scenarios.openscenario.running.driving.controllers import Driver
from scenarios.openscenario.running.world import Instant


def quiet_until_s(
    now: Instant, until_s: float, watches: Sequence[Observed], contacts: Contacts | None
) -> float:
    """Until when nothing can change, as far as a time; the instant itself if something can at once.

    Args:
        now: the instant.
        until_s: how far to look; no speed stops to grow or to fall before it.
        watches: conditions that matter.
        contacts: of the ego; None: they do not matter.
    """
    for actor in now.actors.values():
        if not actor.goes_alone:
            return now.time_s
        if actor.controller is None:
            continue
        if not actor.commanded:
            until_s = min(until_s, actor.controller.commands_from_s)
        elif isinstance(actor.controller, Driver) or gives_back(actor, now.time_s):
            return now.time_s  # decides at each step, or is to let go
    for watch in watches:
        if watch.settled_s < until_s:
            until_s = watch.settled_s
    if contacts is not None and until_s > now.time_s:
        until_s = contacts.quiet_until_s(now, until_s)
    return max(until_s, now.time_s)


def gives_back(actor: Actor, time_s: float) -> bool:
    """Whether the controller of somebody commanded gives the command back by a time."""
    return actor.controller is not None and actor.controller.commands_from_s > time_s + COMMAND_EPSILON_S
