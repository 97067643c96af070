"""Robustness layers of Euro NCAP 2026 Frontal Collisions: which apply, how they are verified, what they win.

Sources: calculator `euroncap-rating-2026` 5.4.9 (input sheets and verification conditions), after protocol
v1.2, sections 4.2.2 and 5.2.1.3. In v1.1 the heading of CPNA turns by 20 degrees either way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
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


class Quantity(StrEnum):
    """What a condition changes; the impact that the test aims at stays the same."""

    TARGET_SPEED_KMH = "target {:+g} km/h"
    START_PERCENT = "start {:+g} %"
    HEADING_DEG = "heading {:+g} deg"
    PATH_OFFSET_M = "path {:+g} m"
    TARGET_DECELERATION_MPS2 = "deceleration {:+g} m/s2"
    HEADWAY_S = "headway {:+g} s"
    ILLUMINANCE_LX = "darkness {:g} lx"


@dataclass(frozen=True, slots=True)
class Condition:
    """A robustness condition that a simulation can drive.

    Args:
        layer: name of the layer.
        quantity: what is changed. The start is that of the target, in percent of its distance to the impact
            point; the heading turns its way about that point, counter-clockwise from above.
        amount: by how much, in the quantity's unit; of the illuminance, to how much.
        bar: what is required.
    """

    layer: str
    quantity: Quantity
    amount: float
    bar: Bar

    @property
    def change(self) -> str:
        """What is changed, by how much."""
        return self.quantity.format(self.amount)

    def __str__(self) -> str:
        return f"{self.layer}: {self.change}"


_SPEED, _POSITION = "Speed", "Initial position offset"


def _speed(worse: float, better: float) -> tuple[Condition, Condition]:
    return (
        Condition(_SPEED, Quantity.TARGET_SPEED_KMH, worse, Bar.NOT_RED),
        Condition(_SPEED, Quantity.TARGET_SPEED_KMH, better, Bar.SAME_OR_BETTER),
    )


def _both_speeds(bar: Bar) -> tuple[Condition, ...]:
    return tuple(Condition(_SPEED, Quantity.TARGET_SPEED_KMH, change, bar) for change in (5, -5))


def _heading(*degrees: float) -> tuple[Condition, ...]:
    return tuple(
        Condition("Trajectory/Heading", Quantity.HEADING_DEG, angle, Bar.SAME_OR_BETTER) for angle in degrees
    )


def _path_offset() -> tuple[Condition, ...]:
    return tuple(
        Condition(_POSITION, Quantity.PATH_OFFSET_M, offset, Bar.SAME_OR_BETTER) for offset in (0.5, -0.5)
    )


def _closer(bar: Bar) -> tuple[Condition, ...]:
    return (Condition(_POSITION, Quantity.START_PERCENT, -25, bar),)


_DARK = (Condition("Illumination (Night)", Quantity.ILLUMINANCE_LX, 1, Bar.NOT_RED),)
_BRAKING = (
    Condition("Acceleration", Quantity.TARGET_DECELERATION_MPS2, 2, Bar.NOT_RED),
    Condition("Acceleration", Quantity.TARGET_DECELERATION_MPS2, -2, Bar.SAME_OR_BETTER),
    Condition(_POSITION, Quantity.HEADWAY_S, 0.5, Bar.NOT_RED),
    Condition(_POSITION, Quantity.HEADWAY_S, -0.5, Bar.NOT_RED),
)
_WALKER = (*_speed(3, -2), *_closer(Bar.NOT_RED))
_RIDER = (*_speed(5, -3), *_closer(Bar.NOT_RED))
_TURNED = Bar.SAME_OR_BETTER

CONDITIONS: dict[str, tuple[Condition, ...]] = {
    "CCRs": (*_heading(-10, 20), *_DARK),
    "CCRm": _DARK,
    "CMRs": (*_heading(-10, 20), *_DARK),
    "CCRb": (*_BRAKING, *_DARK),
    "CMRb": (*_BRAKING, *_DARK),
    "CCFhos": (*_both_speeds(Bar.NOT_RED), *_DARK),
    "CCFhol": (*_both_speeds(Bar.NOT_RED), *_DARK),
    "CCFtap": (*_both_speeds(_TURNED), *_path_offset(), *_DARK),
    "CMFtap": (*_both_speeds(_TURNED), *_path_offset(), *_DARK),
    "CCCscp": (*_both_speeds(_TURNED), *_DARK),
    "CMCscp": (*_both_speeds(_TURNED), *_DARK),
    "CPTA": (Condition(_SPEED, Quantity.TARGET_SPEED_KMH, 3, _TURNED), *_closer(_TURNED), *_DARK),
    "CBTA": (Condition(_SPEED, Quantity.TARGET_SPEED_KMH, 5, _TURNED), *_path_offset(), *_DARK),
    "CPNA": (*_WALKER, *_heading(-10, 20)),
    "CPFA": (*_WALKER, *_heading(-10, 20)),
    "CPNCO": (*_WALKER, *_heading(20)),
    "CBNA": (*_RIDER, *_heading(20), *_DARK),
    "CBFA": (*_RIDER, *_heading(-20), *_DARK),
    "CBNAO": (*_RIDER, *_heading(-10, 20), *_DARK),
}
"""Conditions of the layers that are numbers, by scenario; CPLA and CBLA have none. Others: `NOT_SIMULATED`.

The calculator gives the acceleration: -2 m/s2, with which the target brakes harder, may not be red. Where a
layer has two conditions the laboratory drives one, drawn at random, so both must hold.
"""

NOT_SIMULATED = (
    "driver input, target type and appearance, adverse weather, sun and headlamp glare, clutter, obstruction"
)
"""Layers that cannot be claimed from runs of this simulation."""


def conditioned(scenario: str, base: Cell) -> tuple[tuple[Condition, Cell], ...]:
    """A standard cell under each of its scenario's conditions."""
    return tuple(
        (condition, replace(base, layer=Layer.ROBUSTNESS, condition=str(condition)))
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
