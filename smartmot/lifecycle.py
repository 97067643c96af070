"""Life of a track: born from an unmatched detection, confirmed, coasted and deleted, all by elapsed time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmot.motion_models import Setting, check_range, table
from smartmot.types import BoolArray, FloatArray, IntArray

_ROUNDING_S = 1e-6
"""Stamps in seconds since 1970 carry 2.4e-7 s of rounding; a limit of three frames must include the third."""


@dataclass(frozen=True, slots=True)
class LifecycleConfig:
    """When a track changes its status.

    Args:
        confirm_s: Age at which a matched track is confirmed; until then it is tentative. 0: at birth, the
            paper's min_hits 1.
        max_age_s: Time without a match, or outside the monitored area, that a track survives. The paper's
            max_age of 3 frames at 20 Hz.
        tentative_max_age_s: The same for a tentative track. None: as `max_age_s`.
        birth_score: Detections under it start no track.

    Raises:
        ConfigError: A value is outside its range.
    """

    confirm_s: Setting = 0.0
    max_age_s: Setting = 0.15
    tentative_max_age_s: Setting | None = None
    birth_score: Setting = 0.0

    def __post_init__(self) -> None:
        check_range(self, "confirm_s", 0.0, math.inf)
        check_range(self, "max_age_s", 0.0, math.inf)
        if self.tentative_max_age_s is not None:
            check_range(self, "tentative_max_age_s", 0.0, math.inf)
        check_range(self, "birth_score", 0.0, 1.0)


def confirm(
    confirmed: BoolArray, age_s: FloatArray, coasted_s: FloatArray, code: IntArray, config: LifecycleConfig
) -> BoolArray:
    """Which tracks are confirmed now; a confirmed track stays so.

    Args:
        confirmed: (M,) before this frame.
        age_s: (M,) time since birth.
        coasted_s: (M,) time since the last match.
        code: (M,) positions in CATEGORIES.
        config: Times.

    Returns:
        (M,) flags.
    """
    return confirmed | ((coasted_s <= 0.0) & (age_s >= table(config.confirm_s)[code] - _ROUNDING_S))


def survives(
    confirmed: BoolArray,
    coasted_s: FloatArray,
    outside_s: FloatArray,
    code: IntArray,
    config: LifecycleConfig,
) -> BoolArray:
    """Which tracks live on.

    Args:
        confirmed: (M,) flags.
        coasted_s: (M,) time since the last match.
        outside_s: (M,) time since the track was last seen inside the monitored area.
        code: (M,) positions in CATEGORIES.
        config: Times.

    Returns:
        (M,) flags; False for tracks unmatched or outside for longer than they may be.
    """
    limit = table(config.max_age_s)[code] + _ROUNDING_S
    alive: BoolArray = (coasted_s <= limit) & (outside_s <= limit)
    if config.tentative_max_age_s is not None:
        alive &= confirmed | (coasted_s <= table(config.tentative_max_age_s)[code] + _ROUNDING_S)
    return alive
