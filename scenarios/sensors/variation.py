"""One number of a sensor's errors at a time: how it is read, and how another is put in its place."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.errors import GAUSSIAN, SensorErrors
from scenarios.sensors.measured_errors import REAL_ERRORS
from smartmot.filters.motion_models import PerCategory

NAMED_ERRORS: Mapping[str, SensorErrors | None] = MappingProxyType({"none": None, "real": REAL_ERRORS})
"""Errors by name."""

VARIED = "varied"
"""Name of errors that are none of the named ones."""


@dataclass(frozen=True, slots=True)
class ErrorNumber:
    """One number of the errors.

    Args:
        of: its value in a sensor; NaN: it depends on category, range or occlusion.
        put: a sensor in which it has a value everywhere, all else as it was.
    """

    of: Callable[[SensorConfig], float]
    put: Callable[[SensorConfig, float], SensorConfig]


def errors_name(config: SensorConfig) -> str:
    """Name of a sensor's errors."""
    return next((name for name, errors in NAMED_ERRORS.items() if errors == config.errors), VARIED)


def with_errors(config: SensorConfig, **changes: Any) -> SensorConfig:
    """A sensor with other values of its errors."""
    return _with(config, replace(config.errors or SensorErrors(), **changes))


def with_rows(config: SensorConfig, **changes: Any) -> SensorConfig:
    """A sensor with other values in all rows of its errors."""
    return _with(config, (config.errors or SensorErrors()).with_rows(**changes))


def _with(config: SensorConfig, errors: SensorErrors) -> SensorConfig:
    return replace(config, errors=None if errors == SensorErrors() else errors)


def _in_rows(config: SensorConfig, *names: str) -> Any:
    """What all rows have in all of these fields; NaN: they differ."""
    values = {getattr(row, name) for row in (config.errors or SensorErrors()).rows for name in names}
    return values.pop() if len(values) == 1 else math.nan


def _row(*names: str) -> ErrorNumber:
    """A number of the rows, put into one or more fields."""
    return ErrorNumber(
        lambda config: float(_in_rows(config, *names)),
        lambda config, v: with_rows(config, **dict.fromkeys(names, v)),
    )


def _error(name: str) -> ErrorNumber:
    """A number of the errors beside their rows."""
    return ErrorNumber(
        lambda config: float(getattr(config.errors or SensorErrors(), name)),
        lambda config, v: with_errors(config, **{name: v}),
    )


def _position_of(config: SensorConfig) -> float:
    return config.position_sigma_m if _in_rows(config, "radial_sigma_m") is None else math.nan


def _put_position(config: SensorConfig, sigma_m: float) -> SensorConfig:
    plain = replace(config, position_sigma_m=sigma_m)
    return with_rows(plain, radial_sigma_m=None, tangential_sigma_m=None, position_tail=GAUSSIAN)


def _heading_of(config: SensorConfig) -> float:
    plain = _in_rows(config, "yaw_sigma_rad") is None
    return math.degrees(config.yaw_sigma_rad) if plain else math.nan


def _put_heading(config: SensorConfig, sigma_deg: float) -> SensorConfig:
    plain = replace(config, yaw_sigma_rad=math.radians(sigma_deg))
    return with_rows(plain, yaw_sigma_rad=None, yaw_tail=GAUSSIAN)


def _miss_rate_of(config: SensorConfig) -> float:
    return 1.0 - config.detection_probability if _in_rows(config, "miss") is None else math.nan


def _put_miss_rate(config: SensorConfig, rate: float) -> SensorConfig:
    return with_rows(replace(config, detection_probability=1.0 - rate), miss=None)


def _persistence_of(config: SensorConfig) -> float:
    levels = _in_rows(config, "miss_persistence")
    return levels[0] if isinstance(levels, tuple) and len(set(levels)) == 1 else math.nan


def _velocity_of(config: SensorConfig) -> float:
    sigma = None if config.errors is None else config.errors.velocity_sigma_mps
    return math.inf if sigma is None else sigma


def _put_velocity(config: SensorConfig, sigma_mps: float) -> SensorConfig:
    return with_errors(config, velocity_sigma_mps=None if sigma_mps == math.inf else sigma_mps)


def _ghosts_of(config: SensorConfig) -> float:
    ghosts = (config.errors or SensorErrors()).ghosts_per_frame
    return ghosts.car if ghosts == _ghosts(ghosts.car) else math.nan


def _ghosts(count: float) -> PerCategory:
    return PerCategory(car=count, pedestrian=count, cyclist=count, truck=0.0, motorcycle=0.0, unknown=0.0)


ERROR_NUMBERS: Mapping[str, ErrorNumber] = MappingProxyType(
    {
        "position_sigma_m": ErrorNumber(_position_of, _put_position),
        "position_bias_m": _row("radial_bias_m"),
        "position_correlation_s": _error("position_correlation_s"),
        "heading_sigma_deg": ErrorNumber(_heading_of, _put_heading),
        "heading_flip": _row("flip"),
        "size_bias": _row("length_bias", "width_bias"),
        "size_sigma": _row("length_sigma", "width_sigma"),
        "class_confusion": _row("confusion"),
        "velocity_sigma_mps": ErrorNumber(_velocity_of, _put_velocity),
        "miss_rate": ErrorNumber(_miss_rate_of, _put_miss_rate),
        "miss_persistence": ErrorNumber(
            _persistence_of, lambda config, v: with_rows(config, miss_persistence=(v, v, v))
        ),
        "ghosts_per_frame": ErrorNumber(
            _ghosts_of, lambda config, v: with_errors(config, ghosts_per_frame=_ghosts(v))
        ),
    }
)
"""Numbers of the errors by the name of their parameter."""
