"""The weather and the light of a run: what they do to tyres and sensors, and what a scenario asks for."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.openscenario.model import Environment, EnvironmentAction, ScenarioDefinition

CIVIL_TWILIGHT_RAD = -math.radians(6.0)
"""With the sun lower than this civil twilight is over: it is dark whatever illuminance a file gives."""
NIGHT_LX = 10.0
"""Darker than this is night (Euro NCAP: day tests at more than 2000 lx, night tests below 1 lx)."""


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


def initial_environment(definition: ScenarioDefinition) -> Environment:
    """Light and weather after the initial actions; what a later one leaves open stays."""
    values: dict[str, object] = {}
    for _, action in definition.init:
        if isinstance(action, EnvironmentAction):
            fields = dataclasses.asdict(action.environment).items()
            values |= {name: value for name, value in fields if value is not None}
    return Environment(**{"name": "", **values})  # type: ignore[arg-type]


def is_night(definition: ScenarioDefinition) -> bool:
    """Whether the scenario starts in the dark."""
    environment = initial_environment(definition)
    if environment.sun_elevation_rad is not None and environment.sun_elevation_rad < CIVIL_TWILIGHT_RAD:
        return True
    return environment.illuminance_lx is not None and environment.illuminance_lx < NIGHT_LX


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
