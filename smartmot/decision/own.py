"""A brake rule of the user's own in place of the paper's: made, asked and checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from smartmot.decision.aeb import Event
from smartmot.decision.rules import Assessment, BrakeRule, Command
from smartmot.errors import PluginError, SmartMotError
from smartmot.plugins import failure, require


def own_rule(make: Callable[[], BrakeRule]) -> BrakeRule:
    """A new brake rule of the user's.

    Args:
        make: what makes it.

    Raises:
        PluginError: it fails, or makes something that is no brake rule.
    """
    return require(make(), "decide", str(getattr(make, "name", make)))


def decide_own(rule: BrakeRule, state: Any, now: Assessment) -> tuple[Any, Command, tuple[Event, ...]]:
    """One decision of a user's rule, with its errors named and what it returns checked.

    Raises:
        PluginError: the rule fails, or returns something else than a state, a command and events.
    """
    name = f"brake rule {type(rule).__module__}:{type(rule).__qualname__}"
    when = f"frame at {now.ego.stamp_s:g} s"
    try:
        decision: Any = rule.decide(state, now)
    except SmartMotError as error:
        raise PluginError(f"{name}, {when}: {error}") from error
    except (Exception, SystemExit) as error:  # whatever a user's code may raise
        raise failure(f"{name}, {when}", error) from error
    if not isinstance(decision, tuple) or len(decision) != 3:
        raise PluginError(f"{name}, {when}: decide() returned {type(decision).__name__}; {_EXPECTED}")
    next_state, command, events = decision
    if not isinstance(command, Command):
        raise PluginError(
            f"{name}, {when}: decide() returned {type(command).__name__} as command; {_EXPECTED}"
        )
    if not isinstance(events, (tuple, list)) or not all(isinstance(event, Event) for event in events):
        raise PluginError(f"{name}, {when}: decide() returned events that are none; {_EXPECTED}")
    return next_state, command, tuple(events)


_EXPECTED = "return its state, a smartmot.Command and a tuple of smartmot.Event"
