"""The filter that suits a motion model."""

from __future__ import annotations

from smartmot.errors import ConfigError
from smartmot.filters.channels import ChannelFilter
from smartmot.filters.filterpy_adapter import FilterpyFilter, FilterpyMotion
from smartmot.filters.kalman import BevFilterConfig, BoxFilter
from smartmot.filters.motion_models import ConstantTurnRate, LinearMotion

Motion = LinearMotion | ConstantTurnRate | FilterpyMotion
"""What moves tracks: a model with a filter of ours, or one that makes filters of filterpy."""


def box_filter(motion: Motion, config: BevFilterConfig) -> BoxFilter:
    """The filter that suits a motion model.

    Args:
        motion: Motion model and its noise.
        config: Measurement noise and initial uncertainty.

    Returns:
        The linear filter in closed form, the extended one for CTRV, or filters of filterpy.

    Raises:
        ConfigError: It is no motion model.
        PluginError: A filter of the user's cannot be made.
    """
    from smartmot.filters.turn import TurnFilter

    if isinstance(motion, ConstantTurnRate):
        return TurnFilter(motion, config)
    if isinstance(motion, FilterpyMotion):
        return FilterpyFilter(motion, config)
    if not hasattr(motion, "densities"):
        raise ConfigError(f"TrackerConfig.motion: expected a motion model, got {motion!r}")
    return ChannelFilter(motion, config)
