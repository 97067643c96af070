"""The shipped brake rules by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias, TypeVar

from smartmot.decision.aeb import AebConfig
from smartmot.decision.autoware import AUTOWARE_README, Autoware
from smartmot.decision.cascade import CASCADE_GENTLE, Cascade
from smartmot.decision.r157 import R157
from smartmot.decision.required_deceleration import LAST_POINT_TO_BRAKE, RequiredDeceleration
from smartmot.decision.rss import Rss
from smartmot.decision.staged import Staged

ShippedRule: TypeAlias = AebConfig | Cascade | RequiredDeceleration | Rss | Autoware | R157 | Staged
"""The paper's rule by its settings; the others are their own settings."""

PAPER_RULE = "paper"
"""The rule that every preset has."""

_SETS = (
    Cascade(), CASCADE_GENTLE, RequiredDeceleration(), LAST_POINT_TO_BRAKE, Rss(), Autoware(),
    AUTOWARE_README, R157(), Staged(),
)  # fmt: skip

RULES: Mapping[str, ShippedRule] = MappingProxyType(
    {PAPER_RULE: AebConfig(), **{rule.name: rule for rule in _SETS}}
)
"""Each rule with its published parameters; where several sets are published, each has a name."""


T = TypeVar("T")


def with_brakes(rule: T, delay_s: float, build_up_s: float, full_mps2: float) -> T:
    """A rule with a vehicle's brakes in place of those that it reckons with, if it reckons with any.

    Args:
        rule: shipped, or the user's own.
        delay_s: from the decision to the first deceleration.
        build_up_s: linear rise to the full deceleration.
        full_mps2: that deceleration.
    """
    if isinstance(rule, Staged):
        return replace(rule, delay_s=delay_s, build_up_s=build_up_s, full_mps2=full_mps2)
    if rule is LAST_POINT_TO_BRAKE:
        return replace(rule, delay_s=delay_s, build_up_s=build_up_s, required_decel_mps2=full_mps2)
    return rule
