"""Named conditions and what the weather does to them."""

import math

import pytest

from scenarios.errors import ScenarioError
from scenarios.openscenario.model import Environment
from scenarios.presets import PAPER, PHYSICAL, PRESETS, named_preset, preset_in_weather
from scenarios.weather import (
    DRY_FRICTION,
    WEATHER,
    fog_attenuation_db_per_km,
    named_weather,
    rain_attenuation_db_per_km,
    weather_of,
)


def test_paper_preset_has_the_constants_measured_on_the_paper() -> None:
    assert (PAPER.brakes.delay_s, PAPER.brakes.build_up_s, PAPER.brakes.max_decel_mps2) == (0.07, 0.5, 14.5)
    assert PAPER.rectangular.min_length_m == PAPER.rectangular.max_length_m == 12.0
    assert PAPER.map_area.reach_m == 22.2
    assert (PAPER.ego_length_m, PAPER.ego_width_m) == (4.4, 1.8)
    assert (PAPER.sensor.position_sigma_m, PAPER.sensor.rate_hz) == (0.05, 20.0)


def test_physical_preset_is_a_real_car() -> None:
    assert PHYSICAL.brakes.max_decel_mps2 == pytest.approx(0.9 * 9.81, abs=0.05)
    assert (PHYSICAL.brakes.delay_s, PHYSICAL.brakes.build_up_s, PHYSICAL.sensor.range_m) == (0.2, 0.4, 70.0)


@pytest.mark.parametrize("name", PRESETS)
def test_dry_weather_changes_nothing(name: str) -> None:
    assert preset_in_weather(PRESETS[name], WEATHER["dry"]) == PRESETS[name]


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("weather", WEATHER)
def test_deceleration_scales_with_friction(name: str, weather: str) -> None:
    preset = PRESETS[name]
    now = preset_in_weather(preset, WEATHER[weather])
    assert now.brakes.max_decel_mps2 / preset.brakes.max_decel_mps2 == pytest.approx(
        WEATHER[weather].friction / DRY_FRICTION
    )
    assert now.brakes.delay_s == preset.brakes.delay_s
    assert now.sensor.range_m == WEATHER[weather].range_m(preset.sensor.range_m)
    assert now.map_area == preset.map_area


def test_the_worse_the_weather_the_less_deceleration() -> None:
    order = [
        preset_in_weather(PHYSICAL, WEATHER[w]).brakes.max_decel_mps2 for w in ("dry", "wet", "rain", "snow")
    ]
    assert order == sorted(order, reverse=True)
    # on a real car the deceleration is friction times gravity
    for weather, decel in zip(("dry", "wet", "rain", "snow"), order, strict=True):
        assert decel == pytest.approx(WEATHER[weather].friction * 9.81, rel=0.01)


@pytest.mark.parametrize("weather", WEATHER)
@pytest.mark.parametrize("clear_m", [70.0, 100.0])
def test_range_in_weather_is_where_the_echo_is_as_strong(weather: str, clear_m: float) -> None:
    """Lidar equation: the echo falls with 1/r^2 and with exp(-2 alpha r)."""
    range_m = WEATHER[weather].range_m(clear_m)
    alpha_per_m = WEATHER[weather].attenuation_db_per_km / 1000 * math.log(10) / 10
    echo = (clear_m / range_m) ** 2 * math.exp(-2 * alpha_per_m * range_m)
    assert echo == pytest.approx(1.0, rel=1e-6)
    assert 0 < range_m <= clear_m


def test_attenuation_in_rain_is_that_of_the_recommendation() -> None:
    # ITU-R P.1814, table 3, coefficients measured in Japan: 1.58 R^0.63 dB/km
    assert rain_attenuation_db_per_km(1.0) == pytest.approx(1.58)
    assert rain_attenuation_db_per_km(25.0) == pytest.approx(12.0, abs=0.05)


def test_attenuation_in_fog_is_that_of_two_percent_over_the_visual_range() -> None:
    """Under 500 m whatever the wavelength; at 905 nm haze of 10 km counts half of what is seen."""
    for visual_range_m in (50.0, 400.0):
        left = 10 ** (-fog_attenuation_db_per_km(visual_range_m) * visual_range_m / 1000 / 10)
        assert left == pytest.approx(0.02)
    seen = 10 * math.log10(50) / 10.0
    assert fog_attenuation_db_per_km(10_000.0) == pytest.approx(seen * (905 / 550) ** -1.3)
    assert fog_attenuation_db_per_km(100_000.0) == 0.0


@pytest.mark.parametrize(
    ("environment", "friction", "attenuation", "used", "unused"),
    [
        (Environment("e"), None, None, 0, 0),
        (Environment("e", friction_scale=1.0, precipitation="dry", visual_range_m=1e5), None, None, 0, 0),
        (Environment("e", precipitation="rain", precipitation_mm_h=0.0), None, None, 0, 0),
        (Environment("e", friction_scale=0.5), 0.45, 0.0, 1, 0),
        (Environment("e", wetness="wetWithPuddles"), 0.65, 0.0, 1, 0),
        (Environment("e", precipitation="rain", precipitation_mm_h=25.0), 0.55, 1.58 * 25**0.63, 2, 0),
        (
            Environment("e", precipitation="rain", precipitation_mm_h=25.0, friction_scale=0.7),
            0.63, 1.58 * 25**0.63, 2, 0,
        ),
        (Environment("e", precipitation="snow"), 0.22, 0.0, 1, 1),
        (Environment("e", visual_range_m=100.0), 0.9, 10 * math.log10(50) / 0.1, 1, 0),
        (Environment("e", visual_range_m=0.0, friction_scale=0.0), None, None, 0, 2),
    ],
)  # fmt: skip
def test_the_weather_of_a_scenario_is_used_or_named(
    environment: Environment, friction: float | None, attenuation: float | None, used: int, unused: int
) -> None:
    found = weather_of(environment)
    assert (len(found.used), len(found.unused)) == (used, unused)
    if friction is None:
        assert found.weather is None
        return
    assert found.weather is not None
    assert found.weather.friction == pytest.approx(friction)
    assert found.weather.attenuation_db_per_km == pytest.approx(attenuation)


def test_every_weather_names_its_source() -> None:
    assert all(w.source and 0 < w.friction <= DRY_FRICTION for w in WEATHER.values())


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    assert named_preset("paper") is PAPER
    assert named_weather("snow") is WEATHER["snow"]
    with pytest.raises(ScenarioError, match="unknown preset 'ideal'; use one of: paper, physical, real"):
        named_preset("ideal")
    with pytest.raises(ScenarioError, match="unknown weather 'hail'; use one of: dry, wet, rain, snow"):
        named_weather("hail")
