"""A brake rule of the user's own in place of the paper's: made, asked and checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

from smartmot.decision.aeb import Event
from smartmot.decision.rules import Assessment, BrakeRule, Command
from smartmot.errors import PluginError
from smartmot.plugins import called, name_of, require

MAX_EVENT_TEXT = 24
"""Characters of a text in the run log; longer ones would be cut off."""

_EXPECTED = "return its state, a smartmot.Command and a tuple of smartmot.Event"


def is_rule(given: object) -> bool:
    """Whether something is a brake rule itself, and not what makes one."""
    return callable(getattr(given, "decide", None)) and not isinstance(given, type)


def own_rule(given: BrakeRule | Callable[[], BrakeRule]) -> BrakeRule:
    """A brake rule, or a new one of the user's.

    Args:
        given: the rule, which remembers nothing and may decide for several pipelines; or what makes it.

    Raises:
        PluginError: it fails, or makes something that is no brake rule.
    """
    if is_rule(given):
        return cast(BrakeRule, given)
    made = cast(Callable[[], BrakeRule], given)()
    return require(made, "decide", str(getattr(given, "name", given)))


def decide_own(rule: BrakeRule, state: Any, now: Assessment) -> tuple[Any, Command, tuple[Event, ...]]:
    """One decision of a user's rule, with its errors named and what it returns checked.

    Raises:
        PluginError: the rule fails, or returns something else than a state, a command and events.
    """
    name = f"{name_of('brake rule', rule)}, frame at {now.ego.stamp_s:g} s"
    decision: object = called(name, rule.decide, state, now)
    if not isinstance(decision, tuple) or len(decision) != 3:
        raise PluginError(f"{name}: decide() returned {type(decision).__name__}; {_EXPECTED}")
    next_state, command, events = decision
    if not isinstance(command, Command):
        raise PluginError(f"{name}: decide() returned {type(command).__name__} as command; {_EXPECTED}")
    if not isinstance(events, (tuple, list)) or not all(isinstance(event, Event) for event in events):
        raise PluginError(f"{name}: decide() returned events that are none; {_EXPECTED}")
    for event in events:
        if not _can_be_logged(event):
            raise PluginError(
                f"{name}: {event}: expected a finite stamp, and layer and name as texts of at most "
                f"{MAX_EVENT_TEXT} characters"
            )
    return next_state, command, tuple(events)


def _can_be_logged(event: Event) -> bool:
    """Whether the fields of an event are what they are to be: a user's code may give anything."""
    stamp, texts = event.stamp_s, (event.layer, event.name)
    return (
        isinstance(stamp, (int, float))
        and math.isfinite(stamp)
        and all(isinstance(text, str) and len(text) <= MAX_EVENT_TEXT for text in texts)
    )
