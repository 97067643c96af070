"""Options that mean something in some ways of calling a command only, and are refused in the others.

An option that is ignored is a wrong answer: who typed it believes that the results are with it. Each command
lists its rules in `EFFECTS`; a test goes over all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import typer

from evaluation.errors import ArgumentError

OF_LIDAR = ("sensor", "perception", "street", "street_density", "street_seed")


@dataclass(frozen=True, slots=True)
class For:
    """Options that have an effect with some values of another parameter.

    Args:
        options: by parameter of the command.
        of: the parameter that decides.
        values: of it, with which they have one.
    """

    options: tuple[str, ...]
    of: str
    values: tuple[str, ...]

    def idle(self, context: typer.Context) -> str:
        """Why they have no effect in a call; empty where they have one."""
        value = context.params[self.of]
        if value in self.values:
            return ""
        return f"has no effect with {_shown(context, self.of, value)}; it is for {_listed(self.values)}"


@dataclass(frozen=True, slots=True)
class With:
    """Options that have an effect where one of some others is given.

    Args:
        options: by parameter of the command.
        others: one of these must be given.
    """

    options: tuple[str, ...]
    others: tuple[str, ...]

    def idle(self, context: typer.Context) -> str:
        """Why they have no effect in a call; empty where they have one."""
        if any(_is_given(context, other) for other in self.others):
            return ""
        others = [_name(context, other, asked_for=True) for other in self.others]
        return f"has no effect without {_listed(others)}; add it"


@dataclass(frozen=True, slots=True)
class Without:
    """Options that have no effect where another one is given.

    Args:
        options: by parameter of the command.
        other: must not be given.
    """

    options: tuple[str, ...]
    other: str

    def idle(self, context: typer.Context) -> str:
        """Why they have no effect in a call; empty where they have one."""
        if not _is_given(context, self.other):
            return ""
        return f"has no effect with {_name(context, self.other)}; leave one of them out"


Effects: TypeAlias = "Sequence[For | With | Without]"
"""Rules of a command."""


def refuse_idle(context: typer.Context, effects: Effects) -> None:
    """See that every option that was typed has an effect.

    Args:
        context: of the command.
        effects: its rules.

    Raises:
        ArgumentError: one has none.
    """
    for rule in effects:
        reason = rule.idle(context)
        for option in rule.options if reason else ():
            if is_typed(context, option):
                raise ArgumentError(f"{_name(context, option)}: {reason}")


def is_typed(context: typer.Context, parameter: str) -> bool:
    """Whether a parameter was given by the user, and has not its default."""
    source = context.get_parameter_source(parameter)
    return source is not None and source.name == "COMMANDLINE"


def _is_given(context: typer.Context, parameter: str) -> bool:
    """Whether a parameter was typed; of a flag that is on by default: switched off."""
    value, declared = context.params[parameter], _declared(context, parameter)
    if declared.default is True:
        return value is False
    return is_typed(context, parameter) and value is not False


def _declared(context: typer.Context, parameter: str) -> Any:
    """A parameter as the option parser has it, whose classes have moved between typer's versions."""
    return next(param for param in context.command.params if param.name == parameter)


def _name(context: typer.Context, parameter: str, *, asked_for: bool = False) -> str:
    """A parameter as it is typed: its long option, or the name of an argument.

    `asked_for`: as it would be typed to have it, whatever is typed.
    """
    declared = _declared(context, parameter)
    if declared.param_type_name == "argument":
        return str(declared.metavar or declared.name).strip("[]")
    refused = context.params[parameter] is False and not asked_for
    names = declared.secondary_opts if refused else declared.opts
    return str(max(names or declared.opts, key=len))


def _shown(context: typer.Context, parameter: str, value: object) -> str:
    """A parameter with its value, as it is typed."""
    declared = _declared(context, parameter)
    command = context.info_name or ""
    if declared.param_type_name == "argument":
        return f"{command} {value}"
    return f"{_name(context, parameter)} {value}"


def _listed(names: Sequence[str]) -> str:
    """Names in words: a, b or c."""
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last
