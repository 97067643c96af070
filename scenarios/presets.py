"""Named conditions: the paper's own, and a real car's; and the weather."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from scenarios.brakes import BrakeConfig
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import Environment
from scenarios.sensors.boxes import SensorConfig
from smartmot.area import MapAreaConfig, RectangularConfig
from smartmot.pipeline import PipelineConfig
from smartmot.plugins import Plugin


@dataclass(frozen=True, slots=True)
class Preset:
    """Everything that is fixed about vehicle, sensor and perception in a run.

    Args:
        name: how the command line calls it.
        brakes: emergency brake on dry road.
        sensor: sensor in clear weather.
        rectangular, map_area: settings of the two strategies.
        pipeline: settings of tracking, forecast and decision.
        ego_length_m, ego_width_m: outline of the ego.
        detector: makes a detector of the user's own from a `SensorConfig` and a seed, in place of
            `scenarios.sensors.sensor.Sensor`.
    """

    name: str
    brakes: BrakeConfig
    sensor: SensorConfig
    rectangular: RectangularConfig
    map_area: MapAreaConfig
    pipeline: PipelineConfig
    ego_length_m: float
    ego_width_m: float
    detector: Plugin | None = None


PAPER = Preset(
    name="paper",
    # Read off figure 5b of the SmartMOT paper: every curve falls with 14.5 m/s2 (CARLA's brakes) after about
    # 0.5 s of linear build-up, about 0.07 s after the flag.
    brakes=BrakeConfig(delay_s=0.07, build_up_s=0.5, max_decel_mps2=14.5),
    # Ground truth of the simulator with 0.05 m of noise at 20 Hz (authors' code). What limits the paper's
    # system is how far ahead an object may count; that is set in the areas below.
    sensor=SensorConfig(range_m=100.0, position_sigma_m=0.05, rate_hz=20.0),
    # The authors clamp the rectangle to 12..30 m. The published impact speeds (23.82 and 44.23 km/h) belong
    # to its lower clamp, whatever the speed; a longer rectangle would have stopped in time.
    rectangular=RectangularConfig(min_length_m=12.0, max_length_m=12.0),
    # Front limit of the authors' detections; objects count up to there.
    map_area=MapAreaConfig(reach_m=22.2),
    pipeline=PipelineConfig(),
    ego_length_m=4.4,  # authors' code
    ego_width_m=1.8,
)

PHYSICAL = Preset(
    name="physical",
    # Peak braking coefficient 0.9 of Euro NCAP's test track x 9.81 m/s2 = 8.8; 0.2 s delay and 0.4 s build-up
    # is the slower of the two profiles commonly assumed for AEB, near UN R157's 14.1 m/s3 build-up.
    brakes=BrakeConfig(delay_s=0.2, build_up_s=0.4, max_decel_mps2=8.8),
    sensor=SensorConfig(range_m=70.0, position_sigma_m=0.05, rate_hz=20.0),
    rectangular=RectangularConfig(),  # the authors' own clamps, 12..30 m
    map_area=MapAreaConfig(),
    pipeline=PipelineConfig(),
    ego_length_m=4.4,
    ego_width_m=1.8,
)

PRESETS = {preset.name: preset for preset in (PAPER, PHYSICAL)}


@dataclass(frozen=True, slots=True)
class Weather:
    """What the weather does to tyres and sensor.

    Args:
        name: how the command line calls it.
        friction: tyre-road friction coefficient.
        attenuation_db_per_km: of near-infrared light on its way through the precipitation.
        source: where the numbers come from.
    """

    name: str
    friction: float
    attenuation_db_per_km: float
    source: str

    def range_m(self, clear_m: float) -> float:
        """Range at which a lidar's echo is as strong as at its range in clear air.

        The echo of an extended target falls with 1/r^2 and twice with the attenuation on the way.
        """
        low, high = 0.0, clear_m
        for _ in range(60):
            middle = (low + high) / 2
            loss_db = 20 * math.log10(middle / clear_m) + 2 * self.attenuation_db_per_km * middle / 1000
            low, high = (middle, high) if loss_db < 0 else (low, middle)
        return high


@dataclass(frozen=True, slots=True)
class Light:
    """What darkness does to a sensor.

    Args:
        name: how the command line calls it.
        range_m: objects farther away are not seen; None: as far as by day.
        source: where the number comes from.
    """

    name: str
    range_m: float | None
    source: str


NIGHT = {
    light.name: light
    for light in (
        Light(
            "lidar",
            None,
            "night changes nothing: a near-infrared lidar, which the presets have, lights the scene itself; "
            "no source gives a probability of detection per frame at night",
        ),
        Light(
            "camera",
            46.0,
            "night range 46 m: 150 ft, at which a driver in low beam sees a pedestrian in dark clothes; "
            "a value of the human eye, used for want of one of a camera",
        ),
    )
}
"""Sensors by the way they take the night."""


DRY_FRICTION = 0.9
"""Peak braking coefficient of a Euro NCAP test track (protocol, track requirements: at least 0.9)."""


def rain_attenuation_db_per_km(rain_mm_per_h: float) -> float:
    """ITU-R P.1814 (free-space optical links), rain, coefficients measured in Japan."""
    return float(1.58 * rain_mm_per_h**0.63)


def dry_snow_attenuation_db_per_km(snow_mm_per_h: float, wavelength_nm: float = 905.0) -> float:
    """ITU-R P.1814, dry snow; the rate is that of the melted water."""
    return float((5.42e-5 * wavelength_nm + 5.4958776) * snow_mm_per_h**1.38)


WEATHER = {
    w.name: w
    for w in (
        Weather("dry", DRY_FRICTION, 0.0, "friction: Euro NCAP track requirement, PBC >= 0.9"),
        Weather(
            "wet",
            0.65,
            0.0,
            "friction: Bosch Automotive Handbook, 0.2 mm of water at 50 km/h, new tyre; clear air",
        ),
        Weather(
            "rain",
            0.55,
            rain_attenuation_db_per_km(25.0),
            "friction: Bosch Automotive Handbook, 1 mm of water at 50 km/h, new tyre; "
            "range: ITU-R P.1814 at 25 mm/h",
        ),
        Weather(
            "snow",
            0.22,
            dry_snow_attenuation_db_per_km(3.0),
            "friction: Noon 1994, snow 0.20 to 0.25; range: ITU-R P.1814, dry snow at 3 mm/h",
        ),
    )
}


def fog_attenuation_db_per_km(visual_range_m: float, wavelength_nm: float = 905.0) -> float:
    """I. Kim et al., "Comparison of laser beam propagation at 785 nm and 1550 nm in fog and haze" (2001).

    The visual range is where 2 % of the light is left (Koschmieder). Over 50 km, which is exceptionally clear
    air by the international visibility code, there is no fog.
    """
    if visual_range_m > CLEAR_AIR_M:
        return 0.0
    km = visual_range_m / 1000.0
    q = 1.3 if km > 6.0 else 0.16 * km + 0.34 if km > 1.0 else km - 0.5 if km > 0.5 else 0.0
    return float(10.0 * math.log10(50.0) / km * (wavelength_nm / 550.0) ** -q)


CLEAR_AIR_M = 50_000.0
"""Greater visual ranges are no fog."""

_ATTENUATION: Mapping[str, Callable[[float], float]] = {
    "rain": rain_attenuation_db_per_km,
    "snow": dry_snow_attenuation_db_per_km,
}


@dataclass(frozen=True, slots=True)
class ScenarioWeather:
    """What a scenario's environment does to tyres and sensor.

    Args:
        weather: in place of dry weather; None: the scenario has none.
        used: what of the environment that takes up, in words.
        unused: what it does not.
    """

    weather: Weather | None
    used: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()


def weather_of(environment: Environment) -> ScenarioWeather:
    """The weather of a scenario's environment.

    The file's friction factor scales the friction of a dry road. Without one, rain, snow and a wet road have
    the friction of the named weather. Rain, snow and fog shorten the range of the sensor.
    """
    used: list[str] = []
    unused: list[str] = []
    rate, fog, scale = environment.precipitation_mm_h, environment.visual_range_m, environment.friction_scale
    falls = environment.precipitation if rate != 0.0 else None
    falls = falls if falls in _ATTENUATION else None
    wet = environment.wetness not in (None, "dry")
    friction, attenuation = DRY_FRICTION, 0.0
    if falls is not None and rate is not None:
        attenuation += _ATTENUATION[falls](rate)
        used.append(f"{falls} of {rate:g} mm/h")
    elif falls is not None:
        unused.append(f"the range in {falls}, whose intensity has no unit")
    if fog is not None and 0.0 < fog <= CLEAR_AIR_M:
        attenuation += fog_attenuation_db_per_km(fog)
        used.append(f"fog with a visual range of {fog:g} m")
    elif fog == 0.0:
        unused.append("fog with a visual range of 0 m")
    if scale == 0.0:
        unused.append("a friction factor of 0, with which nothing would stop")
    if scale and (scale != 1.0 or falls or wet):
        friction *= scale
        instead = f" in place of the friction of {falls or 'a wet road'}" if falls or wet else ""
        used.append(f"friction factor {scale:g}{instead}")
    elif falls or wet:
        friction = WEATHER[falls or "wet"].friction
        used.append(f"the friction of {falls or 'a wet road'}")
    if not used:
        return ScenarioWeather(None, (), tuple(unused))
    weather = Weather("scenario", friction, attenuation, "the scenario's environment")
    return ScenarioWeather(weather, tuple(used), tuple(unused))


def preset_in_weather(preset: Preset, weather: Weather) -> Preset:
    """The preset with brakes and sensor as the weather leaves them.

    The deceleration scales with friction relative to a dry road, so that a preset's dry value stays its own.
    """
    brakes = replace(
        preset.brakes, max_decel_mps2=preset.brakes.max_decel_mps2 * weather.friction / DRY_FRICTION
    )
    sensor = replace(preset.sensor, range_m=weather.range_m(preset.sensor.range_m))
    return replace(preset, brakes=brakes, sensor=sensor)


def preset_at_night(preset: Preset, light: Light) -> Preset:
    """The preset with the sensor as darkness leaves it."""
    if light.range_m is None:
        return preset
    return replace(preset, sensor=replace(preset.sensor, range_m=min(preset.sensor.range_m, light.range_m)))


def named_preset(name: str) -> Preset:
    """Look up a preset.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in PRESETS:
        raise ScenarioError(f"unknown preset {name!r}; use one of: {', '.join(PRESETS)}")
    return PRESETS[name]


def named_weather(name: str) -> Weather:
    """Look up a weather.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in WEATHER:
        raise ScenarioError(f"unknown weather {name!r}; use one of: {', '.join(WEATHER)}")
    return WEATHER[name]


def named_light(name: str) -> Light:
    """Look up how a sensor takes the night.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in NIGHT:
        raise ScenarioError(f"unknown night sensor {name!r}; use one of: {', '.join(NIGHT)}")
    return NIGHT[name]
