"""Parameters that the comparison varies: what they change, and for which strategies they mean anything."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from types import MappingProxyType
from typing import TypeVar

from scenarios import sensing
from scenarios.parameter import FileChoice, Parameter
from scenarios.parameter import Setting as Setting
from scenarios.parameter import Settings as Settings
from scenarios.presets import PRESETS, Preset
from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.lidar.chain import NETWORK_FORM, PERCEPTIONS, is_network, network_file
from scenarios.sensors.lidar.config import SENSORS
from scenarios.sensors.suite import whole_steps
from scenarios.sensors.variation import ERROR_NUMBERS, NAMED_ERRORS, errors_name
from scenarios.simulation.truth import STEP_S
from scenarios.sources.perception import PATHS_FROM
from scenarios.strategies import STRATEGIES
from smartmot.area import WAYS
from smartmot.decision.aeb import AebConfig
from smartmot.decision.required_deceleration import LAST_POINT_TO_BRAKE
from smartmot.decision.shipped import PAPER_RULE, RULES, with_brakes
from smartmot.errors import ConfigError
from smartmot.forecast import EGO_FORECASTS
from smartmot.lidar.learned import SHIPPED
from smartmot.maps.faulty import LANES, SIDEWALKS, TYPES
from smartmot.plugins import Plugin, is_plugin, plugin
from smartmot.tracking.configs import TRACKER_CONFIGS, tracker_config
from smartmot.tracking.profile import is_profile
from smartmot.tracking.settings import TrackerConfig

T = TypeVar("T")


def _with(owner: T, path: Sequence[str], value: object) -> T:
    """A dataclass with another value of a field of it, or of a dataclass in it."""
    name, *deeper = path
    inner = _with(getattr(owner, name), deeper, value) if deeper else value
    return replace(owner, **{name: inner})  # type: ignore[type-var]  # T has no bound for dataclasses


def _number(text: str, unit: str, strategies: tuple[str, ...], field: str) -> Parameter:
    """The parameter that is one number of a preset, by its place in it."""
    path = field.split(".")

    def of(preset: Preset) -> Setting:
        return float(attrgetter(field)(preset))

    return Parameter(text, unit, strategies, (), of, lambda preset, v: _with(preset, path, float(v)))


def _degrees(text: str, unit: str, strategies: tuple[str, ...], field: str) -> Parameter:
    """The parameter that is one angle of a preset, in degrees, by its place in it."""
    path = field.split(".")

    def of(preset: Preset) -> Setting:
        return round(math.degrees(attrgetter(field)(preset)), 9)

    def put(preset: Preset, value: Setting) -> Preset:
        return _with(preset, path, math.radians(float(value)))

    return Parameter(text, unit, strategies, (), of, put)


def _choice(text: str, strategies: tuple[str, ...], choices: tuple[str, ...], field: str) -> Parameter:
    """The parameter that is one name of a preset, by its place in it."""
    path = field.split(".")

    def of(preset: Preset) -> Setting:
        return str(attrgetter(field)(preset))

    return Parameter(text, "", strategies, choices, of, lambda preset, v: _with(preset, path, str(v)))


_FILTERS = {
    "both": (True, True),
    "detections": (True, False),
    "tracks": (False, True),
    "none": (False, False),
}
"""Whether detections and tracks are filtered, by name."""


def _filter_of(preset: Preset) -> str:
    chosen = (preset.pipeline.filter_detections, preset.pipeline.filter_tracks)
    return next(name for name, filters in _FILTERS.items() if filters == chosen)


def _put_filter(preset: Preset, value: Setting) -> Preset:
    detections, tracks = _FILTERS[str(value)]
    pipeline = replace(preset.pipeline, filter_detections=detections, filter_tracks=tracks)
    return replace(preset, pipeline=pipeline)


def _put_forecast(preset: Preset, **changes: float | str) -> Preset:
    forecast = replace(preset.pipeline.forecast, **changes)  # type: ignore[arg-type]  # fields of two kinds
    return replace(preset, pipeline=replace(preset.pipeline, forecast=forecast))


def _put_horizon(preset: Preset, value: Setting) -> Preset:
    horizon = float(value)
    longest = max(horizon, preset.pipeline.forecast.max_horizon_s)
    return _put_forecast(preset, min_horizon_s=horizon, max_horizon_s=longest)


def _limit(text: str, unit: str, strategies: tuple[str, ...], field: str) -> Parameter:
    """The parameter that is one number of a preset, infinite where the preset has None."""
    path = field.split(".")

    def of(preset: Preset) -> Setting:
        limit = attrgetter(field)(preset)
        return math.inf if limit is None else float(limit)

    def put(preset: Preset, value: Setting) -> Preset:
        return _with(preset, path, None if value == math.inf else float(value))

    return Parameter(text, unit, strategies, (), of, put)


def _put_length(preset: Preset, value: Setting) -> Preset:
    length = float(value)
    shortest = min(preset.rectangular.min_length_m, length)
    area = replace(preset.rectangular, min_length_m=shortest, max_length_m=length)
    return replace(preset, rectangular=area)


_TURNING_RADPS = 1.0
"""Limit on forecast turn rates where objects turn at all: the default of `smartmot.forecast`."""


def _motion_of(preset: Preset) -> str:
    forecast = preset.pipeline.forecast
    return "class" if forecast.model == "class" else "ctrv" if forecast.max_yaw_rate_radps > 0 else "cv"


def _put_motion(preset: Preset, value: Setting) -> Preset:
    limit = 0.0 if value == "cv" else preset.pipeline.forecast.max_yaw_rate_radps or _TURNING_RADPS
    model = "class" if value == "class" else "ctrv"
    return _put_forecast(preset, max_yaw_rate_radps=limit, model=model)


OF_PRESET = "preset"
"""Name of the preset's own tracker or detector."""
_TRACKERS = (OF_PRESET, *TRACKER_CONFIGS)


def _tracker_of(preset: Preset) -> str:
    tracker = preset.pipeline.tracker
    if isinstance(tracker, Plugin):
        return tracker.name
    return next((name for name, config in TRACKER_CONFIGS.items() if config == tracker), OF_PRESET)


def _put_tracker(preset: Preset, value: Setting) -> Preset:
    name = str(value)
    if name == OF_PRESET:
        return preset
    tracker = plugin(name) if is_plugin(name) else tracker_config(name)
    return _with(preset, ("pipeline", "tracker"), tracker)


TRIGGERS: Mapping[str, str] = MappingProxyType(
    {
        PAPER_RULE: "braking_factor",
        "cascade": "cascade_margin_s",
        "cascade_gentle": "cascade_margin_s",
        "required_deceleration": "required_decel_mps2",
        LAST_POINT_TO_BRAKE.name: "required_decel_mps2",
        "rss": "rss_response_s",
        "autoware": "autoware_response_s",
        "autoware_readme": "autoware_response_s",
        "r157": "r157_ttc_s",
        "staged": "staged_margin_s",
    }
)
"""The parameter of each shipped brake rule that decides how early it brakes; a field of the rule as well."""


def _rule_of(preset: Preset) -> str:
    rule = preset.pipeline.aeb
    return PAPER_RULE if isinstance(rule, AebConfig) else str(getattr(rule, "name", rule))


def _put_rule(preset: Preset, value: Setting) -> Preset:
    name = str(value)
    if name == _rule_of(preset):
        return preset
    rule = plugin(name) if is_plugin(name) else RULES[name]
    # the brakes on a dry road: the rule does not know the weather; it decides once in a frame
    brakes, frame_s = PRESETS.get(preset.name, preset).brakes, 1.0 / preset.sensor.rate_hz
    rule = with_brakes(rule, brakes.delay_s + frame_s, brakes.build_up_s, brakes.max_decel_mps2)
    return _with(preset, ("pipeline", "aeb"), rule)


def _trigger(text: str, unit: str, field: str, rules: Sequence[str] = ()) -> Parameter:
    """A parameter of some brake rules only; by default of those that it triggers."""
    rules = rules or tuple(name for name, trigger in TRIGGERS.items() if trigger == field)

    def of(preset: Preset) -> Setting:
        chosen = _rule_of(preset)
        return float(getattr(preset.pipeline.aeb if chosen in rules else RULES[rules[0]], field))

    def put(preset: Preset, value: Setting) -> Preset:
        chosen = _rule_of(preset)
        if chosen not in rules:
            raise ConfigError(
                f"{field} is a parameter of rule={' or '.join(rules)}; the brake rule is {chosen}"
            )
        return _with(preset, ("pipeline", "aeb", field), float(value))

    return Parameter(text, unit, STRATEGIES, (), of, put)


def _detector_of(preset: Preset) -> str:
    return preset.detector.name if preset.detector else OF_PRESET


def _put_detector(preset: Preset, value: Setting) -> Preset:
    return preset if value == OF_PRESET else replace(preset, detector=plugin(str(value)))


def _sensor_error(text: str, unit: str, name: str) -> Parameter:
    """The parameter that is one number of the sensor's errors, by its name in `ERROR_NUMBERS`."""
    number = ERROR_NUMBERS[name]
    return Parameter(
        text,
        unit,
        STRATEGIES,
        (),
        lambda preset: number.of(preset.sensor),
        lambda preset, v: replace(preset, sensor=number.put(preset.sensor, float(v))),
    )


def _put_errors(preset: Preset, value: Setting) -> Preset:
    return _with(preset, ("sensor", "errors"), NAMED_ERRORS[str(value)])


def _furnishing(text: str, name: str) -> Parameter:
    """The parameter that is one number of a furnished street."""
    of, put = partial(sensing.street_number, name=name), partial(sensing.put_street_number, name=name)
    return Parameter(text, "", STRATEGIES, (), of, put)


OF_SENSOR = "sensor"
"""The tracker goes by the sensor's own noise."""


def _tracker_sigma_of(preset: Preset) -> Setting:
    return OF_SENSOR if preset.tracker_sigma_m is None else preset.tracker_sigma_m


def _sigmas_of(preset: Preset) -> Setting:
    tracker = preset.pipeline.tracker
    return tracker.dynamic_sigmas if isinstance(tracker, TrackerConfig) else math.nan


def _put_sigmas(preset: Preset, value: Setting) -> Preset:
    tracker = preset.pipeline.tracker
    if not isinstance(tracker, TrackerConfig):
        name = tracker.name if isinstance(tracker, Plugin) else "your own"
        raise ConfigError(f"dynamic_sigmas is a parameter of the shipped trackers, not of {name}")
    return _with(preset, ("pipeline", "tracker"), replace(tracker, dynamic_sigmas=float(value)))


def _put_tracker_sigma(preset: Preset, value: Setting) -> Preset:
    if value != OF_SENSOR and not 0.0 < float(value) < math.inf:
        raise ConfigError(f"tracker_sigma_m must be positive and finite, got {value}")
    tracker = preset.pipeline.tracker
    if value != OF_SENSOR and isinstance(tracker, Plugin):
        raise ConfigError(f"tracker_sigma_m is a parameter of the shipped trackers, not of {tracker.name}")
    return replace(preset, tracker_sigma_m=None if value == OF_SENSOR else float(value))


_MAP, _RECTANGLE, _PATH = ("map",), ("rectangular",), ("path",)

PARAMETERS: Mapping[str, Parameter] = MappingProxyType(
    {
        "margin_m": _number("VRU margin over the sidewalk", "m", _MAP, "map_area.vru_margin_m"),
        "half_width_m": _number("half width of the rectangle", "m", _RECTANGLE, "rectangular.half_width_m"),
        "corridor_m": _limit("half width of the corridor", "m", _PATH, "path_area.half_width_m"),
        "probability": _number(
            "with more than which an object that counts reaches the path",
            "",
            ("adaptive",),
            "adaptive_area.probability",
        ),
        "reach_m": _limit("how far ahead an object may count", "m", _MAP, "map_area.reach_m"),
        "length_m": Parameter(
            "greatest length of the rectangle",
            "m",
            _RECTANGLE,
            (),
            lambda preset: preset.rectangular.max_length_m,
            _put_length,
        ),
        "sensor": Parameter(
            "sensor", "", STRATEGIES, (sensing.TRUTH, *SENSORS), sensing.sensor_of, sensing.put_sensor
        ),
        "perception": Parameter(
            "what makes detections of a LiDAR's clouds",
            "",
            STRATEGIES,
            PERCEPTIONS,
            sensing.perception_of,
            sensing.put_perception,
            own=True,
            file=FileChoice(
                ", ".join((*SHIPPED, NETWORK_FORM)), is_network, lambda name: network_file(name).name
            ),
        ),
        "street": Parameter(
            "what stands along the road",
            "",
            STRATEGIES,
            sensing.STREETS,
            lambda preset: sensing.STREETS[preset.street is not None],
            sensing.put_street,
        ),
        "street_density": _furnishing("pieces of furniture per 100 m of each side", "street_density"),
        "street_seed": _furnishing("seed of the street", "street_seed"),
        "range_m": _number("range of the sensor", "m", STRATEGIES, "sensor.range_m"),
        "iou_threshold": _number(
            "overlap of forecast boxes that predicts a collision", "", STRATEGIES, "pipeline.iou_threshold"
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
            STRATEGIES,
            EGO_FORECASTS,
            lambda preset: preset.pipeline.forecast.ego,
            lambda preset, v: _put_forecast(preset, ego=str(v)),
            old=("route",),
        ),
        "way": _choice("what speed adaptation looks at", STRATEGIES, WAYS, "pipeline.way"),
        "standing": _choice("which standing objects count", STRATEGIES, WAYS, "pipeline.standing"),
        "path_from": _choice("where the planned path comes from", STRATEGIES, PATHS_FROM, "path_from"),
        "localisation_lateral_m": _number(
            "bias of the localisation to the left", "m", STRATEGIES, "localisation.lateral_m"
        ),
        "localisation_longitudinal_m": _number(
            "bias of the localisation ahead", "m", STRATEGIES, "localisation.longitudinal_m"
        ),
        "localisation_heading_deg": _degrees(
            "bias of the localised heading to the left", "degrees", STRATEGIES, "localisation.heading_rad"
        ),
        "localisation_drift_m": _number(
            "slow error of the localisation", "m", STRATEGIES, "localisation.drift_sigma_m"
        ),
        "localisation_noise_m": _number(
            "noise of the localisation in each frame", "m", STRATEGIES, "localisation.noise_sigma_m"
        ),
        "odometry_speed": _number("error of the ego's speed, relative", "", STRATEGIES, "odometry.speed"),
        "odometry_yaw_rate_deg_s": _degrees(
            "bias of the ego's turn rate", "degrees/s", STRATEGIES, "odometry.yaw_rate_radps"
        ),
        "map_kerb_m": _number("sidewalks of the map too far out", "m", STRATEGIES, "map_errors.kerb_m"),
        "map_lane_m": _number("lanes of the map too far left", "m", STRATEGIES, "map_errors.lane_m"),
        "map_sidewalk": _choice("sidewalks of the map", STRATEGIES, SIDEWALKS, "map_errors.sidewalk"),
        "map_lanes": _choice("lanes of the map beside the route", STRATEGIES, LANES, "map_errors.lanes"),
        "map_types": _choice("lane types of the map", STRATEGIES, TYPES, "map_errors.types"),
        "filter": Parameter(
            "what the monitored lanes filter",
            "",
            _MAP,  # the others keep everything
            ("detections", "tracks", "both", "none"),
            _filter_of,
            _put_filter,
        ),
        "motion": Parameter(
            "forecast of the others", "", STRATEGIES, ("cv", "ctrv", "class"), _motion_of, _put_motion
        ),
        "tracker": Parameter(
            "tracker",
            "",
            STRATEGIES,
            _TRACKERS,
            _tracker_of,
            _put_tracker,
            own=True,
            file=FileChoice("FILE.json", is_profile),
        ),
        "detector": Parameter(
            "detector", "", STRATEGIES, (OF_PRESET,), _detector_of, _put_detector, own=True
        ),
        "rate_hz": _number("frames of the sensor per second", "Hz", STRATEGIES, "sensor.rate_hz"),
        "latency_s": _number("age of the detections", "s", STRATEGIES, "sensor.latency_s"),
        # The named errors come first: single numbers then replace one of theirs.
        "sensor_errors": Parameter(
            "errors of the sensor",
            "",
            STRATEGIES,
            tuple(NAMED_ERRORS),
            lambda preset: errors_name(preset.sensor),
            _put_errors,
        ),
        "position_sigma_m": _sensor_error("noise of positions along each axis", "m", "position_sigma_m"),
        "position_bias_m": _sensor_error("bias of positions, away from the ego", "m", "position_bias_m"),
        "position_correlation_s": _sensor_error(
            "correlation time of errors of position", "s", "position_correlation_s"
        ),
        "heading_sigma_deg": _sensor_error("noise of headings", "degrees", "heading_sigma_deg"),
        "heading_flip": _sensor_error("headings that point backwards", "", "heading_flip"),
        "size_bias": _sensor_error("lengths and widths too great, relative", "", "size_bias"),
        "size_sigma": _sensor_error("noise of lengths and widths, relative", "", "size_sigma"),
        "class_confusion": _sensor_error("objects in a wrong category", "", "class_confusion"),
        "velocity_sigma_mps": _sensor_error("noise of reported velocities", "m/s", "velocity_sigma_mps"),
        "miss_rate": _sensor_error("objects that a frame misses", "", "miss_rate"),
        "miss_persistence": _sensor_error("correlation of misses 0.1 s apart", "", "miss_persistence"),
        "ghosts_per_frame": _sensor_error(
            "false cars, pedestrians and cyclists in a frame, each", "", "ghosts_per_frame"
        ),
        "tracker_sigma_m": Parameter(
            "noise of positions that the tracker expects",
            "m",
            STRATEGIES,
            (OF_SENSOR,),
            _tracker_sigma_of,
            _put_tracker_sigma,
            numeric=True,
        ),
        "dynamic_sigmas": Parameter(
            "standard deviations of its speed at which who moves counts as moving",
            "",
            STRATEGIES,
            (),
            _sigmas_of,
            _put_sigmas,
        ),
        # after the rate of the sensor, of which one of them needs to know
        "rule": Parameter("brake rule", "", STRATEGIES, tuple(RULES), _rule_of, _put_rule, own=True),
        "braking_factor": _trigger("planned braking distance, by factor", "", "braking_factor"),
        "near_m": _trigger("how near is near at any speed", "m", "near_m", (PAPER_RULE,)),
        "cascade_margin_s": _trigger("margin over the stopping times", "s", "cascade_margin_s"),
        "required_decel_mps2": _trigger("required deceleration that triggers", "m/s2", "required_decel_mps2"),
        "rss_response_s": _trigger("response time of the ego (RSS)", "s", "rss_response_s"),
        "autoware_response_s": _trigger("response time (Autoware)", "s", "autoware_response_s"),
        "r157_ttc_s": _trigger("time to collision that triggers", "s", "r157_ttc_s"),
        "staged_margin_s": _trigger("margin over the time that is needed", "s", "staged_margin_s"),
    }
)
"""Parameters by name, in the order in which their values are put."""

_ORDER = {name: k for k, name in enumerate(PARAMETERS)}


def preset_with(preset: Preset, settings: Settings) -> Preset:
    """A preset with other values of some parameters, in whichever order they are given.

    Raises:
        smartmot.errors.ConfigError: there is no parameter of that name, or a value is out of range.
        ScenarioError: one of the sensor is, or no multiple of the simulation's step.
    """
    for name, value in settings:
        if name not in PARAMETERS:
            raise ConfigError(f"no parameter {name!r}; there are: {', '.join(PARAMETERS)}")
        if not PARAMETERS[name].admits(value):
            expected = ", ".join(PARAMETERS[name].names) or "a number"
            raise ConfigError(f"{name}: expected {expected}; got {value!r}")
    for name, purpose in sensing.idle(settings).items():
        raise ConfigError(f"{name} is for {purpose}")
    for name, value in sorted(settings, key=lambda setting: _ORDER[setting[0]]):
        preset = PARAMETERS[name].put(preset, value)
    _check_timing(preset.sensor)
    return preset


def _check_timing(sensor: SensorConfig) -> None:
    """See that frames come at steps of the simulation."""
    whole_steps(1.0 / sensor.rate_hz, STEP_S, "frame interval (1 / rate_hz)", least=1)
    whole_steps(sensor.latency_s, STEP_S, "latency")


def settings_text(settings: Settings) -> str:
    """Settings as they are typed."""
    return ", ".join(setting_text(name, value) for name, value in settings)


def setting_text(name: str, value: Setting) -> str:
    """`NAME=VALUE` as it is typed."""
    return f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
