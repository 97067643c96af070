"""Parameters of what the ego senses with: the shipped sensor or a LiDAR, its perception, its street."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from scenarios.parameter import Setting
from scenarios.presets import Preset
from scenarios.sensors.lidar.chain import PERCEPTIONS, LidarPerception, is_network, network_file
from scenarios.sensors.lidar.config import SENSORS, lidar_config
from scenarios.sensors.lidar.street import Furnished
from scenarios.sensors.variation import ERROR_NUMBERS
from smartmot.errors import ConfigError
from smartmot.plugins import is_plugin, plugin

TRUTH = "truth"
"""Name of the shipped sensor: ground truth with errors."""

STREETS = ("bare", "furnished")

OF_LIDAR = ("perception", "street", "street_density", "street_seed")
"""Parameters that mean nothing for the shipped sensor."""

OF_FURNISHED = {"street_density": "density_per_100_m", "street_seed": "seed"}
"""Parameters of a furnished street, and the fields of `Furnished` that they are."""

OF_TRUTH = ("detector", "sensor_errors", *ERROR_NUMBERS)
"""Parameters that mean nothing for a LiDAR."""


def idle(settings: Iterable[tuple[str, Setting]]) -> dict[str, str]:
    """Parameters that mean nothing beside the others, with what they are for."""
    values = dict(settings)
    sensor = values.get("sensor", TRUTH)
    if sensor == TRUTH:
        reasons = dict.fromkeys(OF_LIDAR, f"a LiDAR, sensor={', '.join(SENSORS)}; the sensor is {TRUTH}")
    else:
        reasons = dict.fromkeys(OF_TRUTH, f"sensor={TRUTH}; the sensor is {sensor}")
        reasons["detector"] += "; its detector is set by perception"
        if values.get("street", STREETS[0]) == STREETS[0]:
            reasons |= dict.fromkeys(OF_FURNISHED, f"street=furnished; the street is {STREETS[0]}")
    return {name: reasons[name] for name in values if name in reasons}


def meaningful(settings: Iterable[tuple[str, Setting]]) -> tuple[tuple[str, Setting], ...]:
    """Settings without those that mean nothing beside the others."""
    kept = tuple(settings)
    without = idle(kept)
    return tuple((name, value) for name, value in kept if name not in without)


def sensor_of(preset: Preset) -> str:
    """Name of the sensor."""
    return TRUTH if preset.lidar is None else preset.lidar.sensor


def put_sensor(preset: Preset, value: Setting) -> Preset:
    """The preset with a LiDAR, which has its own rate, and none of the errors of the shipped sensor."""
    if value == TRUTH:
        return preset
    rate_hz = lidar_config(str(value)).pattern.rate_hz
    sensor = replace(preset.sensor, rate_hz=rate_hz, errors=None)
    return replace(preset, sensor=sensor, lidar=LidarPerception(str(value)))


def perception_of(preset: Preset) -> str:
    """Name of what makes detections of clouds."""
    return PERCEPTIONS[0] if preset.lidar is None else preset.lidar.perception_name


def put_perception(preset: Preset, value: Setting) -> Preset:
    """The preset with another detector behind its LiDAR.

    Raises:
        ConfigError: there is no LiDAR, or the file of a network is none.
        smartmot.errors.PluginError: what is the user's own cannot be loaded.
    """
    if preset.lidar is None:
        raise ConfigError("perception is for a LiDAR, and there is none")
    name = str(value)
    chosen = plugin(name) if is_plugin(name) else network_file(name) if is_network(name) else name
    return replace(preset, lidar=replace(preset.lidar, perception=chosen))


def put_street(preset: Preset, value: Setting) -> Preset:
    """The preset on a bare or a furnished street."""
    return replace(preset, street=None if value == STREETS[0] else Furnished())


def street_number(preset: Preset, name: str) -> Setting:
    """A number of the furnished street, or the usual one; see `OF_FURNISHED`."""
    return float(getattr(preset.street or Furnished(), OF_FURNISHED[name]))


def put_street_number(preset: Preset, value: Setting, name: str) -> Preset:
    """The preset with another number of its furnished street; see `OF_FURNISHED`.

    Raises:
        ConfigError: the seed is no whole number.
        ScenarioError: the number is out of range.
    """
    number = float(value)
    if name == "street_density":
        return replace(preset, street=replace(preset.street or Furnished(), density_per_100_m=number))
    if number != int(number):
        raise ConfigError(f"street_seed must be a whole number, got {value}")
    return replace(preset, street=replace(preset.street or Furnished(), seed=int(number)))
