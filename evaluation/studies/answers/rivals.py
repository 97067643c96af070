"""The rivals of the lane filter: everything that knows no more than a planner gives, and the paper's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from evaluation.errors import ArgumentError
from evaluation.studies.answers.arms import Arm
from evaluation.studies.compare.grid import FAIR
from scenarios.settings import PARAMETERS, Setting, Settings, setting_text


@dataclass(frozen=True, slots=True)
class Rival:
    """A way to monitor.

    Args:
        name: in tables and figures.
        text: what it is, in words.
        strategy: monitored area.
        settings: parameters that depart from the preset.
    """

    name: str
    text: str
    strategy: str
    settings: Settings = FAIR

    @property
    def is_as_published(self) -> bool:
        """Whether it is the paper's, which knows no planned path."""
        return not self.settings

    def arm(self, preset: str, rule: str) -> Arm:
        """It in a preset, with a brake rule."""
        return Arm(self.name, self.strategy, self.settings, preset).having(("rule", rule))


PATH = Rival("path", "the planned path without lanes, kerbs or filter", "path")
MAP = Rival("map", "the lanes of the map, along the planned path", "map")

RIVALS: tuple[Rival, ...] = (
    PATH,
    MAP,
    Rival("rectangle", "the paper's rectangle, along the planned path", "rectangular"),
    Rival(
        "rectangle, wide",
        "a rectangle with the half width 4 m and the length 60 m, along the planned path",
        "rectangular",
        (("half_width_m", 4.0), ("length_m", 60.0), *FAIR),
    ),
    Rival("map, as published", "the map filter with the ego forecast by its turn rate", "map", ()),
    Rival("rectangle, as published", "the paper's rectangle with the same forecast", "rectangular", ()),
    Rival("all, as published", "everything that is seen, with the same forecast", "all", ()),
)
"""The first is what the others are compared with. `all` along the planned path would be the first again, so
that it is a rival only as published."""


ADAPTIVE = Rival("adaptive", "who reaches the planned path with more than a probability", "adaptive")
"""Beside the others where it is asked for."""


def rivals(more: Sequence[str] = ()) -> tuple[Rival, ...]:
    """The rivals, and more: the adaptive area, or some of the user's own (`package.module:name`)."""
    own = (ADAPTIVE if name == ADAPTIVE.name else Rival(name, "of the user's own", name) for name in more)
    return (*RIVALS, *own)


def varied(run: Sequence[Rival], name: str, values: Sequence[Setting]) -> list[Rival]:
    """Areas with other values of a parameter: of the rivals that differ in the area alone those that have it.

    Raises:
        ArgumentError: it changes none of them.
    """
    changed = [r for r in run if r.settings == FAIR and PARAMETERS[name].changes(r.strategy)]
    if not changed:
        raise ArgumentError(f"--vary {name}: changes none of the areas")
    return [
        Rival(f"{r.name}, {setting_text(name, value)}", r.text, r.strategy, ((name, value), *FAIR))
        for r in changed
        for value in values
    ]
