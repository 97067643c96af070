"""Life of a track: born from an unmatched detection, confirmed, and deleted, all by elapsed time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmot.motion_models import check_range
from smartmot.types import BoolArray, FloatArray

_ROUNDING_S = 1e-6
"""Stamps in seconds since 1970 carry 2.4e-7 s of rounding; a limit of three frames must include the third."""


@dataclass(frozen=True, slots=True)
class LifecycleConfig:
    """Times at which a track changes its status.

    Args:
        confirm_s: Age at which a matched track is confirmed. 0: at birth, the paper's min_hits 1.
        max_age_s: Time without a match, or outside the monitored area, that a track survives. The paper's
            max_age of 3 frames at 20 Hz.

    Raises:
        ConfigError: A time is negative or not finite.
    """

    confirm_s: float = 0.0
    max_age_s: float = 0.15

    def __post_init__(self) -> None:
        check_range(self, "confirm_s", 0.0, math.inf)
        check_range(self, "max_age_s", 0.0, math.inf)


def confirm(
    confirmed: BoolArray, age_s: FloatArray, coasted_s: FloatArray, config: LifecycleConfig
) -> BoolArray:
    """Which tracks are confirmed now; a confirmed track stays so.

    Args:
        confirmed: (M,) before this frame.
        age_s: (M,) time since birth.
        coasted_s: (M,) time since the last match.
        config: Times.

    Returns:
        (M,) flags.
    """
    return confirmed | ((coasted_s <= 0.0) & (age_s >= config.confirm_s - _ROUNDING_S))


def survives(coasted_s: FloatArray, outside_s: FloatArray, config: LifecycleConfig) -> BoolArray:
    """Which tracks live on.

    Args:
        coasted_s: (M,) time since the last match.
        outside_s: (M,) time since the track was last seen inside the monitored area.
        config: Times.

    Returns:
        (M,) flags; False for tracks unmatched or outside for more than `max_age_s`.
    """
    limit = config.max_age_s + _ROUNDING_S
    return (coasted_s <= limit) & (outside_s <= limit)
