"""How far a run can go at once: as long as no plan, condition, contact or command can change."""

from __future__ import annotations

from collections.abc import Sequence

from scenarios.openscenario.running.conditions import Observed
from scenarios.openscenario.running.driving.contacts import Contacts
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
        if not actor.has_plan:
            return now.time_s
        if actor.controller is not None and actor.controller.commands_from_s < until_s:
            until_s = actor.controller.commands_from_s
    for watch in watches:
        if watch.settled_s < until_s:
            until_s = watch.settled_s
    if contacts is not None and until_s > now.time_s:
        until_s = contacts.quiet_until_s(now, until_s)
    return max(until_s, now.time_s)
