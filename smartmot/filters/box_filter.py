"""The filter that suits a motion model."""

from __future__ import annotations

from smartmot.errors import ConfigError
from smartmot.filters.channels import ChannelFilter
from smartmot.filters.kalman import BevFilterConfig, BoxFilter
from smartmot.filters.motion_models import ConstantTurnRate, LinearMotion


def box_filter(motion: LinearMotion | ConstantTurnRate, config: BevFilterConfig) -> BoxFilter:
    """The filter that suits a motion model.

    Args:
        motion: Motion model and its noise.
        config: Measurement noise and initial uncertainty.

    Returns:
        The linear filter in closed form, or the extended one for CTRV.

    Raises:
        ConfigError: It is no motion model.
    """
    from smartmot.filters.turn import TurnFilter

    if not isinstance(motion, ConstantTurnRate) and not hasattr(motion, "densities"):
        raise ConfigError(f"TrackerConfig.motion: expected a motion model, got {motion!r}")
    return (
        TurnFilter(motion, config) if isinstance(motion, ConstantTurnRate) else ChannelFilter(motion, config)
    )
