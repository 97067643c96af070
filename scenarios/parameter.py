"""One parameter of a run: its name in tables, its possible values, and where it goes in a preset."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from scenarios.presets import Preset
from scenarios.strategies import STRATEGIES
from smartmot.plugins import is_plugin

Setting = float | str
Settings = tuple[tuple[str, Setting], ...]
"""Names and values of the parameters that depart from the preset, by name."""


@dataclass(frozen=True, slots=True)
class FileChoice:
    """A file that may stand in the place of a name.

    Args:
        form: how it is written, for messages.
        fits: whether a name is of that form.
        known_as: the name with which a run is set up, of the name that was typed; see `Parameter.known_as`.
    """

    form: str
    fits: Callable[[str], bool]
    known_as: Callable[[str], str] = str


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter.

    Args:
        text: what it is, for tables and figures.
        unit: of its values; empty for names and ratios.
        strategies: those that it changes.
        choices: possible names; empty: it is a number.
        of: its value in a preset.
        put: a preset with another value.
        own: whether `package.module:name` of the user's own is possible as well.
        numeric: whether numbers are possible beside the names.
        old: earlier names of choices, which are still accepted.
        file: which file is possible as well, if any.
    """

    text: str
    unit: str
    strategies: tuple[str, ...]
    choices: tuple[str, ...]
    of: Callable[[Preset], Setting]
    put: Callable[[Preset, Setting], Preset]
    own: bool = False
    numeric: bool = False
    old: tuple[str, ...] = ()
    file: FileChoice | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Possible names, and the form of the file that is possible as well."""
        return self.choices if self.file is None else (*self.choices, self.file.form)

    def is_file(self, name: str) -> bool:
        """Whether a name is that of a file that is possible."""
        return self.file is not None and self.file.fits(name)

    def known_as(self, name: str) -> str:
        """A typed name as a run is set up with it.

        That of a network has its hash, so that a file that changes while runs are made is refused.

        Raises:
            smartmot.errors.ConfigError: the file is missing, or not what it should be.
        """
        return self.file.known_as(name) if self.file is not None and self.file.fits(name) else name

    def changes(self, strategy: str) -> bool:
        """Whether it means anything for a strategy; what all have, one of the user's own has as well."""
        return strategy in self.strategies or (is_plugin(strategy) and self.strategies == STRATEGIES)

    def admits(self, value: Setting) -> bool:
        """Whether a value is one of the names, or a number where that is asked; ranges are the preset's."""
        if isinstance(value, str):
            by_form = (self.own and is_plugin(value)) or self.is_file(value)
            return value in (*self.choices, *self.old) or by_form
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and not math.isnan(value)
        return is_number and (self.numeric or not self.choices)
