"""Where tracks and the ego are going to be: by motion, by category, along lanes."""

from smartmot.forecast.motion import (
    ACCELERATION_MEMORY_S,
    CHI2_95,
    SPREAD_M2PS3,
    Motion,
    accelerations,
    class_motion,
    class_positions,
    codes,
    driven_m,
    forecast_covariance,
)
from smartmot.forecast.tracks import (
    EGO_FORECASTS,
    TRACK_FORECASTS,
    ForecastConfig,
    forecast_ego,
    forecast_ego_along,
    forecast_times,
    forecast_tracks,
)

__all__ = [
    "ACCELERATION_MEMORY_S",
    "CHI2_95",
    "EGO_FORECASTS",
    "SPREAD_M2PS3",
    "TRACK_FORECASTS",
    "ForecastConfig",
    "Motion",
    "accelerations",
    "class_motion",
    "class_positions",
    "codes",
    "driven_m",
    "forecast_covariance",
    "forecast_ego",
    "forecast_ego_along",
    "forecast_times",
    "forecast_tracks",
]
