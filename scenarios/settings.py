"""Parameters that the comparison varies: what they change, and for which strategies they mean anything."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from scenarios.presets import Preset
from scenarios.strategies import STRATEGIES
from smartmot.decision.aeb import AebConfig
from smartmot.pipeline import PipelineConfig
from smartmot.plugins import Plugin, is_plugin, plugin
from smartmot.tracking.configs import TRACKER_CONFIGS, tracker_config

Setting = float | str
Settings = tuple[tuple[str, Setting], ...]
"""Names and values of the parameters that depart from the preset, by name."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter.

    Args:
        text: what it is, for tables and figures.
        unit: of its values; empty for names and ratios.
        strategies: those that it changes.
        choices: possible names; empty: it is a number.
        of: its value in a preset.
        put: a preset with another value.
        own: whether `package.module:name` of the user's own is possible as well.
    """

    text: str
    unit: str
    strategies: tuple[str, ...]
    choices: tuple[str, ...]
    of: Callable[[Preset], Setting]
    put: Callable[[Preset, Setting], Preset]
    own: bool = False

    def changes(self, strategy: str) -> bool:
        """Whether it means anything for a strategy; what all have, one of the user's own has as well."""
        return strategy in self.strategies or (is_plugin(strategy) and self.strategies == STRATEGIES)


def _pipeline(preset: Preset, **changes: object) -> Preset:
    return replace(preset, pipeline=replace(preset.pipeline, **changes))  # type: ignore[arg-type]


def _filter_of(config: PipelineConfig) -> str:
    names = {
        (True, True): "both",
        (True, False): "detections",
        (False, True): "tracks",
        (False, False): "none",
    }
    return names[config.filter_detections, config.filter_tracks]


def _put_filter(preset: Preset, value: Setting) -> Preset:
    detections, tracks = value in ("both", "detections"), value in ("both", "tracks")
    return _pipeline(preset, filter_detections=detections, filter_tracks=tracks)


def _put_horizon(preset: Preset, value: Setting) -> Preset:
    forecast, horizon = preset.pipeline.forecast, float(value)
    longest = max(horizon, forecast.max_horizon_s)
    return _pipeline(preset, forecast=replace(forecast, min_horizon_s=horizon, max_horizon_s=longest))


def _put_reach(preset: Preset, value: Setting) -> Preset:
    reach = None if value == math.inf else float(value)
    return replace(preset, map_area=replace(preset.map_area, reach_m=reach))


def _put_length(preset: Preset, value: Setting) -> Preset:
    area, length = preset.rectangular, float(value)
    shortest = min(area.min_length_m, length)
    return replace(preset, rectangular=replace(area, min_length_m=shortest, max_length_m=length))


def _put_ego_forecast(preset: Preset, value: Setting) -> Preset:
    return _pipeline(preset, forecast=replace(preset.pipeline.forecast, ego=str(value)))


_TURNING_RADPS = 1.0
"""Limit on forecast turn rates where objects turn at all: the default of `smartmot.forecast`."""


def _put_motion(preset: Preset, value: Setting) -> Preset:
    limit = 0.0 if value == "cv" else preset.pipeline.forecast.max_yaw_rate_radps or _TURNING_RADPS
    return _pipeline(preset, forecast=replace(preset.pipeline.forecast, max_yaw_rate_radps=limit))


OF_PRESET = "preset"
"""Name of the preset's own tracker or detector."""


def _tracker_of(preset: Preset) -> str:
    tracker = preset.pipeline.tracker
    if isinstance(tracker, Plugin):
        return tracker.name
    return next((name for name, config in TRACKER_CONFIGS.items() if config == tracker), OF_PRESET)


def _put_tracker(preset: Preset, value: Setting) -> Preset:
    name = str(value)
    if name == OF_PRESET:
        return preset
    return _pipeline(preset, tracker=plugin(name) if is_plugin(name) else tracker_config(name))


PAPER_RULE = "paper"
"""Name of the brake rule that every preset has."""


def _rule_of(preset: Preset) -> str:
    rule = preset.pipeline.aeb
    return rule.name if isinstance(rule, Plugin) else PAPER_RULE


def _put_rule(preset: Preset, value: Setting) -> Preset:
    name = str(value)
    if name == PAPER_RULE:
        return preset if isinstance(preset.pipeline.aeb, AebConfig) else _pipeline(preset, aeb=AebConfig())
    return _pipeline(preset, aeb=plugin(name))


def _put_detector(preset: Preset, value: Setting) -> Preset:
    return preset if value == OF_PRESET else replace(preset, detector=plugin(str(value)))


PARAMETERS: Mapping[str, Parameter] = MappingProxyType(
    {
        "margin_m": Parameter(
            "VRU margin over the sidewalk",
            "m",
            ("map",),
            (),
            lambda preset: preset.map_area.vru_margin_m,
            lambda preset, v: replace(preset, map_area=replace(preset.map_area, vru_margin_m=float(v))),
        ),
        "half_width_m": Parameter(
            "half width of the rectangle",
            "m",
            ("rectangular",),
            (),
            lambda preset: preset.rectangular.half_width_m,
            lambda preset, v: replace(preset, rectangular=replace(preset.rectangular, half_width_m=float(v))),
        ),
        "reach_m": Parameter(
            "how far ahead an object may count",
            "m",
            ("map",),
            (),
            lambda preset: math.inf if preset.map_area.reach_m is None else preset.map_area.reach_m,
            _put_reach,
        ),
        "length_m": Parameter(
            "greatest length of the rectangle",
            "m",
            ("rectangular",),
            (),
            lambda preset: preset.rectangular.max_length_m,
            _put_length,
        ),
        "range_m": Parameter(
            "range of the sensor",
            "m",
            STRATEGIES,
            (),
            lambda preset: preset.sensor.range_m,
            lambda preset, v: replace(preset, sensor=replace(preset.sensor, range_m=float(v))),
        ),
        "iou_threshold": Parameter(
            "overlap of forecast boxes that predicts a collision",
            "",
            STRATEGIES,
            (),
            lambda preset: preset.pipeline.iou_threshold,
            lambda preset, v: _pipeline(preset, iou_threshold=float(v)),
        ),
        "horizon_s": Parameter(
            "shortest forecast horizon",
            "s",
            STRATEGIES,
            (),
            lambda preset: preset.pipeline.forecast.min_horizon_s,
            _put_horizon,
        ),
        "ego_forecast": Parameter(
            "forecast of the ego",
            "",
            ("map",),  # the others know no route and fall back on the turn rate
            ("ctrv", "route"),
            lambda preset: preset.pipeline.forecast.ego,
            _put_ego_forecast,
        ),
        "filter": Parameter(
            "what the monitored lanes filter",
            "",
            ("map",),  # the others keep everything
            ("detections", "tracks", "both", "none"),
            lambda preset: _filter_of(preset.pipeline),
            _put_filter,
        ),
        "motion": Parameter(
            "forecast of the others",
            "",
            STRATEGIES,
            ("cv", "ctrv"),
            lambda preset: "ctrv" if preset.pipeline.forecast.max_yaw_rate_radps > 0 else "cv",
            _put_motion,
        ),
        "tracker": Parameter(
            "tracker",
            "",
            STRATEGIES,
            (OF_PRESET, *TRACKER_CONFIGS),
            _tracker_of,
            _put_tracker,
            own=True,
        ),
        "detector": Parameter(
            "detector",
            "",
            STRATEGIES,
            (OF_PRESET,),
            lambda preset: preset.detector.name if preset.detector else OF_PRESET,
            _put_detector,
            own=True,
        ),
        "rule": Parameter(
            "brake rule",
            "",
            STRATEGIES,
            (PAPER_RULE,),
            _rule_of,
            _put_rule,
            own=True,
        ),
    }
)
"""Parameters by name."""


def preset_with(preset: Preset, settings: Settings) -> Preset:
    """A preset with other values of some parameters.

    Raises:
        smartmot.errors.ConfigError: a value is out of range.
    """
    for name, value in settings:
        preset = PARAMETERS[name].put(preset, value)
    return preset


def settings_text(settings: Settings) -> str:
    """Settings as they are typed."""
    return ", ".join(setting_text(name, value) for name, value in settings)


def setting_text(name: str, value: Setting) -> str:
    """`NAME=VALUE` as it is typed."""
    return f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
