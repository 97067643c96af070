"""Robustness layers of Euro NCAP 2026 Frontal Collisions: which apply, how they are verified, what they win.

Sources: calculator `euroncap-rating-2026` 5.4.9 (input sheets and verification conditions), after protocol
v1.2, sections 4.2.2 and 5.2.1.3. In v1.1 the heading of CPNA turns by 20 degrees either way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from evaluation.protocols.grid import Cell, Layer

LAYERS: dict[str, int] = {
    "CCRs": 8, "CCRm": 7, "CCRb": 9, "CCFhos": 6, "CCFhol": 6, "CCFtap": 8, "CCCscp": 8, "CMRs": 8, "CMRb": 9,
    "CMFtap": 8, "CMCscp": 8, "CPLA": 7, "CPTA": 9, "CPNA": 10, "CPFA": 10, "CPNCO": 10, "CBLA": 7, "CBTA": 9,
    "CBNA": 10, "CBFA": 10, "CBNAO": 10,
}  # fmt: skip
"""How many robustness layers apply to a scenario; each wins an equal share of the points."""


class Bar(StrEnum):
    """What a cell run under a robustness condition has to reach."""

    SAME_OR_BETTER = "same colour or better"
    NOT_RED = "not red"


@dataclass(frozen=True, slots=True)
class Condition:
    """A robustness condition that a simulation can drive.

    Args:
        layer: name of the layer.
        change: what is changed, by how much.
        bar: what is required.
    """

    layer: str
    change: str
    bar: Bar

    def __str__(self) -> str:
        return f"{self.layer}: {self.change}"


def _speed(worse: int, better: int) -> tuple[Condition, Condition]:
    return (
        Condition("Speed", f"target {worse:+d} km/h", Bar.NOT_RED),
        Condition("Speed", f"target {better:+d} km/h", Bar.SAME_OR_BETTER),
    )


def _both_speeds(bar: Bar) -> tuple[Condition, ...]:
    return tuple(Condition("Speed", f"target {sign}5 km/h", bar) for sign in "+-")


def _heading(*degrees: int) -> tuple[Condition, ...]:
    return tuple(
        Condition("Trajectory/Heading", f"{angle:+d} deg about the impact point", Bar.SAME_OR_BETTER)
        for angle in degrees
    )


def _path_offset() -> tuple[Condition, ...]:
    name = "Initial position offset"
    return tuple(Condition(name, f"path {sign}0.5 m", Bar.SAME_OR_BETTER) for sign in "+-")


def _closer(bar: Bar) -> tuple[Condition, ...]:
    return (Condition("Initial position offset", "-25 % of the distance to the impact point", bar),)


_BRAKING = (
    Condition("Acceleration", "-2 m/s2", Bar.NOT_RED),
    Condition("Acceleration", "+2 m/s2", Bar.SAME_OR_BETTER),
    Condition("Initial position offset", "time headway +0.5 s", Bar.NOT_RED),
    Condition("Initial position offset", "time headway -0.5 s", Bar.NOT_RED),
)
_WALKER = (*_speed(3, -2), *_closer(Bar.NOT_RED))
_RIDER = (*_speed(5, -3), *_closer(Bar.NOT_RED))
_TURNED = Bar.SAME_OR_BETTER

CONDITIONS: dict[str, tuple[Condition, ...]] = {
    "CCRs": _heading(-10, 20),
    "CMRs": _heading(-10, 20),
    "CCRb": _BRAKING,
    "CMRb": _BRAKING,
    "CCFhos": _both_speeds(Bar.NOT_RED),
    "CCFhol": _both_speeds(Bar.NOT_RED),
    "CCFtap": (*_both_speeds(_TURNED), *_path_offset()),
    "CMFtap": (*_both_speeds(_TURNED), *_path_offset()),
    "CCCscp": _both_speeds(_TURNED),
    "CMCscp": _both_speeds(_TURNED),
    "CPTA": (Condition("Speed", "target +3 km/h", _TURNED), *_closer(_TURNED)),
    "CBTA": (Condition("Speed", "target +5 km/h", _TURNED), *_path_offset()),
    "CPNA": (*_WALKER, *_heading(-10, 20)),
    "CPFA": (*_WALKER, *_heading(-10, 20)),
    "CPNCO": (*_WALKER, *_heading(20)),
    "CBNA": (*_RIDER, *_heading(20)),
    "CBFA": (*_RIDER, *_heading(-20)),
    "CBNAO": (*_RIDER, *_heading(-10, 20)),
}
"""Conditions of the layers that change the target's motion, by scenario. CPLA, CBLA and CCRm have none.

Not here, because they are no numbers: driver input, target type and appearance, weather, darkness, glare,
clutter and obstruction. Where a layer has two conditions the laboratory drives one, drawn at random, so both
must hold.
"""


def robustness_cells(scenario: str, standard: Iterable[Cell]) -> tuple[Cell, ...]:
    """The standard cells of a scenario under each of its conditions."""
    return tuple(
        replace(cell, layer=Layer.ROBUSTNESS, condition=str(condition))
        for cell in standard
        for condition in CONDITIONS.get(scenario, ())
    )


def failed_everywhere(
    outcomes: Mapping[str, Mapping[str, bool]], partner: Mapping[str, str]
) -> dict[str, frozenset[str]]:
    """Layers that fail for a scenario once they failed in two of the same collision partner (section 4.2.2).

    Args:
        outcomes: per scenario, whether each of the layers that were run holds.
        partner: collision partner of each scenario.

    Returns:
        Per scenario the layers that fail, its own failures included.
    """
    fails = Counter(
        (partner[scenario], layer)
        for scenario, layers in outcomes.items()
        for layer, holds in layers.items()
        if not holds
    )
    return {
        scenario: frozenset(
            layer for layer, holds in layers.items() if not holds or fails[partner[scenario], layer] >= 2
        )
        for scenario, layers in outcomes.items()
    }
