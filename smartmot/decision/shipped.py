"""The shipped brake rules by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeAlias

from smartmot.decision.aeb import AebConfig
from smartmot.decision.autoware import AUTOWARE_README, Autoware
from smartmot.decision.cascade import CASCADE_GENTLE, Cascade
from smartmot.decision.r157 import R157
from smartmot.decision.required_deceleration import LAST_POINT_TO_BRAKE, RequiredDeceleration
from smartmot.decision.rss import Rss

ShippedRule: TypeAlias = AebConfig | Cascade | RequiredDeceleration | Rss | Autoware | R157
"""The paper's rule by its settings; the others are their own settings."""

PAPER_RULE = "paper"
"""The rule that every preset has."""

_SETS = (
    Cascade(), CASCADE_GENTLE, RequiredDeceleration(), LAST_POINT_TO_BRAKE, Rss(), Autoware(),
    AUTOWARE_README, R157(),
)  # fmt: skip

RULES: Mapping[str, ShippedRule] = MappingProxyType(
    {PAPER_RULE: AebConfig(), **{rule.name: rule for rule in _SETS}}
)
"""Each rule with its published parameters; where several sets are published, each has a name."""
