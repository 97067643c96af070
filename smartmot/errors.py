"""Errors that the perception package raises."""

from __future__ import annotations

from collections.abc import Iterable


class SmartMotError(ValueError):
    """Base of every error this package raises on bad input."""


class ShapeError(SmartMotError):
    """An array has another shape, length or kind than the type asks for."""


class ConfigError(SmartMotError):
    """A setting has a value outside its allowed range."""


class TimeOrderError(SmartMotError):
    """A frame is not newer than the one before it."""


class StampError(ShapeError, TimeOrderError):
    """A stamp is no finite number of seconds."""


class PluginError(SmartMotError):
    """An object of the user's cannot be loaded, fails, or returns something that cannot be used."""


def suggestion(name: str, names: Iterable[str]) -> str:
    """What was perhaps meant by an unknown name, for a message.

    Args:
        name: That was given.
        names: That there are.

    Returns:
        ` (did you mean 'NAME'?)`, or nothing where no name is near.
    """
    from difflib import get_close_matches

    typed, by_case = name.lower(), {each.lower(): each for each in names}
    near = [each for each in by_case if _differs_by_a_slip(typed, each)]
    near += get_close_matches(typed, by_case, n=1, cutoff=_LIKE)
    return f" (did you mean {by_case[near[0]]!r}?)" if near else ""


_LIKE = 0.7
"""Least likeness of two names: the share of their letters that they have in common. Assumed; at 0.6 `ideal`
would be `real`."""


def _differs_by_a_slip(typed: str, name: str) -> bool:
    """Whether one letter is another, or two have changed places; in short names too little is alike."""
    differing = [k for k, (a, b) in enumerate(zip(typed, name, strict=False)) if a != b]
    if len(typed) != len(name) or len(typed) < 3:
        return False
    return len(differing) == 1 or (len(differing) == 2 and sorted(typed) == sorted(name))
