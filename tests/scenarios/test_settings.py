"""Parameters: what is typed, and what it changes."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli.options import parse_vary
from evaluation.errors import ArgumentError
from evaluation.studies.compare.grid import (
    ABLATION,
    FAIR,
    FRONTIER,
    Point,
    ablation_points,
    fair_points,
    points_of,
    study_runs,
)
from scenarios.errors import ScenarioError
from scenarios.presets import PAPER, PHYSICAL, REAL, Preset, pipeline_of
from scenarios.scenes.scenes import choose_scenes
from scenarios.sensing import OF_LIDAR
from scenarios.sensors.variation import ERROR_NUMBERS
from scenarios.settings import PARAMETERS, TRIGGERS, Setting, preset_with
from scenarios.strategies import STRATEGIES
from smartmot.decision.aeb import AebConfig
from smartmot.decision.required_deceleration import RequiredDeceleration
from smartmot.decision.rules import PaperRule
from smartmot.decision.shipped import RULES
from smartmot.decision.staged import Staged
from smartmot.errors import ConfigError
from smartmot.filters.motion_models import PerCategory, table
from smartmot.plugins import Plugin
from smartmot.tracking.configs import tracker_config
from smartmot.tracking.profile import CategoryProfile, DetectorProfile
from smartmot.tracking.tracker import TrackerConfig


def test_ranges_lists_and_names() -> None:
    found = parse_vary(["margin_m=0..2:0.5", "iou_threshold=0.001,0.01", "ego_forecast=ctrv,route"])
    assert found == {
        "margin_m": (0.0, 0.5, 1.0, 1.5, 2.0),
        "iou_threshold": (0.001, 0.01),
        "ego_forecast": ("ctrv", "route"),
    }
    assert parse_vary(["localisation_lateral_m=-1..1:0.5"]) == {
        "localisation_lateral_m": (-1.0, -0.5, 0.0, 0.5, 1.0)
    }
    assert parse_vary(["horizon_s=2..5:1"])["horizon_s"] == (2.0, 3.0, 4.0, 5.0)


@pytest.mark.parametrize(
    "text",
    ["margin", "width=3", "margin_m=", "margin_m=a", "margin_m=0..4", "margin_m=4..0:1", "margin_m=0..4:0",
     "margin_m=nan", "margin_m=0..1e9:1", "filter=some", "motion="],
)  # fmt: skip
def test_mistakes_are_named(text: str) -> None:
    with pytest.raises(ArgumentError, match="--vary"):
        parse_vary([text])


def test_twice_the_same() -> None:
    with pytest.raises(ArgumentError, match="given twice"):
        parse_vary(["margin_m=1", "margin_m=2"])


SHARES = {"probability", "iou_threshold", "miss_rate", "miss_persistence", "heading_flip", "class_confusion"}
"""Parameters that are at most 1."""

WHOLE = {"street_seed"}
"""Parameters that are whole numbers."""


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_value_that_is_put_is_read_back_and_the_preset_keeps_its_own(name: str) -> None:
    parameter = PARAMETERS[name]
    rules = [rule for rule, trigger in TRIGGERS.items() if trigger == name]
    lidar: dict[str, Setting] = {"sensor": "hdl32", "street": "furnished"} if name in OF_LIDAR else {}
    beside = lidar | ({"rule": rules[0]} if rules else {})
    physical = preset_with(PHYSICAL, tuple(beside.items()))

    def having(value: Setting) -> Preset:
        return preset_with(PHYSICAL, tuple((beside | {name: value}).items()))

    for value in parameter.choices or (0.5, 0.25 if name in SHARES else 2.0):
        if name not in WHOLE or isinstance(value, str) or value == int(value):
            assert parameter.of(having(value)) == value
    assert having(parameter.of(physical)) == physical


def test_a_value_out_of_range_is_refused_before_the_first_run() -> None:
    with pytest.raises(ConfigError):
        study_runs([Point("map", (("margin_m", -1.0),))], choose_scenes(), "physical", ["dry"], 1)


@pytest.mark.parametrize(
    "setting",
    [
        ("rate_hz", 30.0), ("rate_hz", 0.0), ("rate_hz", math.inf), ("latency_s", 0.055),
        ("latency_s", math.inf), ("position_sigma_m", math.inf), ("heading_sigma_deg", math.inf),
    ],
)  # fmt: skip
def test_what_the_sensor_cannot_do_is_refused_before_the_first_run(setting: tuple[str, float]) -> None:
    """Frames come at steps of 10 ms."""
    with pytest.raises(ScenarioError, match=r"sensor: .* (multiple of the step of 10 ms|finite|positive)"):
        preset_with(PHYSICAL, (setting,))


def test_points_take_only_the_parameters_that_mean_something() -> None:
    points = points_of(("rectangular", "map", "all"), {"margin_m": (0.0, 1.0), "motion": ("cv", "ctrv")})
    assert [p.text for p in points if p.strategy == "all"] == ["motion=cv", "motion=ctrv"]
    assert len([p for p in points if p.strategy == "map"]) == 4
    assert len(set(points)) == len(points) == 8
    assert [p.text for p in points_of(("all",), FRONTIER)] == [""]


OWN_STRATEGY = "tests.areas:Own"


@pytest.mark.parametrize("strategies", [STRATEGIES, ("map",), ("path", OWN_STRATEGY)])
def test_rivals_of_the_default_differ_in_the_width_of_their_own_area_alone(
    strategies: tuple[str, ...],
) -> None:
    points = fair_points(strategies)
    fair, usual = points[: -len(strategies)], points[-len(strategies) :]
    assert usual == tuple(map(Point, strategies))
    assert {point.strategy for point in fair} == set(strategies)
    for point in fair:
        width = dict(point.settings[: -len(FAIR)])
        assert point.settings[-len(FAIR) :] == FAIR
        assert all(PARAMETERS[name].strategies == (point.strategy,) for name in width)
        assert len(width) <= 1
    assert len(set(points)) == len(points)


def test_ways_that_one_area_may_look_at_are_choices_of_all() -> None:
    points = ablation_points(STRATEGIES, "physical")
    for name, value in FAIR:
        assert {p.strategy for p in points if p.settings == ((name, value),)} == set(STRATEGIES)


def test_ablation_changes_one_choice_at_a_time() -> None:
    points = ablation_points(("map",), "physical")
    assert points[0] == Point("map")
    assert all(len(point.settings) == 1 for point in points[1:])
    assert len(points) == 1 + sum(len(values) - 1 for values in ABLATION.values())


def test_every_point_meets_the_same_scenes_and_noise() -> None:
    scenes = choose_scenes(("CPNA of the paper",))
    runs = study_runs(points_of(("map", "all"), {}), scenes, "physical", ["dry", "rain"], 3)
    met = {
        name: [
            (r.label, r.spec.weather, r.spec.seed, r.spec.phase_s) for r in runs if r.spec.strategy == name
        ]
        for name in ("map", "all")
    }
    first, second = met.values()
    assert first == second
    assert len({run.key for run in runs}) == len(runs)


def test_a_setting_that_the_preset_has_anyway_makes_no_other_run() -> None:
    (scene,) = choose_scenes(("lane change at road works",))
    points = [Point("map", settings) for settings in ((), (("margin_m", 1.8),), (("margin_m", 1.0),))]
    bare, same, other = (run.key for run in study_runs(points, [scene], "physical", ["dry"], 1))
    assert bare == same != other


def test_a_brake_rule_by_name() -> None:
    """Ours under a user's name; `paper` puts the preset's own back, and changes nothing where it is."""
    own = preset_with(PAPER, (("rule", "smartmot.decision.rules:PaperRule"),))
    assert isinstance(own.pipeline.aeb, Plugin)
    assert isinstance(own.pipeline.aeb(), PaperRule)
    assert PARAMETERS["rule"].of(own) == "smartmot.decision.rules:PaperRule"
    assert preset_with(own, (("rule", "paper"),)) == PAPER
    assert preset_with(PAPER, (("rule", "paper"),)) is PAPER
    assert replace(own, pipeline=replace(own.pipeline, aeb=AebConfig())) == PAPER


# Errors of the sensor


@pytest.mark.parametrize("name", ERROR_NUMBERS)
def test_a_number_of_the_errors_replaces_that_of_any_preset(name: str) -> None:
    """Also where it is a table; the other errors stay, and the number of the preset puts it back."""
    value, parameter = 0.375, PARAMETERS[name]
    for preset in (PHYSICAL, REAL):
        changed = preset_with(preset, ((name, value),))
        assert parameter.of(changed) == pytest.approx(value)
        assert changed.sensor != preset.sensor
        for other, number in ERROR_NUMBERS.items():
            if other != name:
                np.testing.assert_equal(number.of(changed.sensor), number.of(preset.sensor))
    usual = parameter.of(PHYSICAL)
    assert preset_with(preset_with(PHYSICAL, ((name, value),)), ((name, usual),)) == PHYSICAL


def test_single_numbers_replace_those_of_the_named_set_in_any_order() -> None:
    number, named = ("position_sigma_m", 0.2), ("sensor_errors", "real")
    first, second = preset_with(PHYSICAL, (number, named)), preset_with(PHYSICAL, (named, number))
    assert first == second
    assert PARAMETERS["sensor_errors"].of(first) == "varied"
    assert table(first.sensor.noise_at(10.0)[0]) == pytest.approx(0.2, abs=0.001)  # and a bias of 2 cm
    assert PARAMETERS["sensor_errors"].of(REAL) == "real"
    assert preset_with(REAL, (("sensor_errors", "none"),)).sensor.errors is None


def position_sigma(preset: Preset) -> object:
    tracker = pipeline_of(preset).tracker
    assert isinstance(tracker, TrackerConfig)
    return tracker.filter.position_sigma_m


def test_the_tracker_expects_the_noise_of_the_sensor() -> None:
    for preset in (PAPER, PHYSICAL):
        assert pipeline_of(preset) is preset.pipeline
    assert position_sigma(preset_with(PHYSICAL, (("position_sigma_m", 0.2),))) == 0.2
    ignorant = preset_with(PHYSICAL, (("position_sigma_m", 0.2), ("tracker_sigma_m", 0.05)))
    assert pipeline_of(ignorant) == PHYSICAL.pipeline
    turned = pipeline_of(preset_with(PHYSICAL, (("heading_sigma_deg", 10.0),))).tracker
    assert isinstance(turned, TrackerConfig)
    assert turned.filter.yaw_sigma_rad == pytest.approx(math.radians(10.0))
    fast = pipeline_of(preset_with(PHYSICAL, (("velocity_sigma_mps", 0.3),))).tracker
    assert isinstance(fast, TrackerConfig)
    assert fast.filter.velocity_sigma_mps == 0.3


def test_the_tracker_expects_what_was_measured_at_20_m() -> None:
    """Root mean square per axis of bias, radial and tangential error: 0.00, 0.09, 0.08 and -0.02, 0.14, 0.15
    m."""
    sigma = position_sigma(REAL)
    assert isinstance(sigma, PerCategory)
    assert sigma.car == pytest.approx(math.sqrt((0.09**2 + 0.08**2) / 2))
    assert sigma.pedestrian == pytest.approx(math.sqrt((0.02**2 + 0.14**2 + 0.15**2) / 2))
    assert sigma.cyclist == 0.05  # less than what the filter assumes at best


def test_a_named_tracker_keeps_its_noise_until_the_sensor_has_more() -> None:
    for noise, expected in ((0.05, 0.2), (0.2, 0.2), (0.5, 0.5)):
        settings = (("tracker", "centerpoint"), ("position_sigma_m", noise))
        assert position_sigma(preset_with(PHYSICAL, settings)) == expected
    assert position_sigma(preset_with(PHYSICAL, (("tracker", "ab3dmot"), ("tracker_sigma_m", 0.3)))) == 0.3


def test_a_tracker_of_ones_own_is_given_the_sensor_if_it_asks_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_trackers.py").write_text(
        "import smartmot\n"
        "def plain():\n    return smartmot.Tracker()\n"
        "def informed(sensor=None):\n"
        "    tracker = smartmot.Tracker()\n    tracker.sensor = sensor\n    return tracker\n"
    )
    monkeypatch.chdir(tmp_path)
    for name, expected in (("plain", None), ("informed", 0.5)):
        preset = preset_with(PHYSICAL, (("tracker", f"own_trackers:{name}"), ("position_sigma_m", 0.5)))
        make = pipeline_of(preset).tracker
        assert callable(make)
        sensor = getattr(make(), "sensor", None)
        assert (None if sensor is None else sensor.position_sigma_m) == expected
        assert PARAMETERS["tracker"].of(preset) == f"own_trackers:{name}"
    for name in ("tracker_sigma_m", "dynamic_sigmas"):
        with pytest.raises(ConfigError, match=rf"{name} is .* shipped trackers, not of own_trackers:plain"):
            preset_with(PHYSICAL, ((name, 0.5), ("tracker", "own_trackers:plain")))


def test_when_a_speed_counts_is_a_parameter() -> None:
    for settings in (("dynamic_sigmas", 1.5),), (("dynamic_sigmas", 1.5), ("tracker", "default")):
        tracker = preset_with(PHYSICAL, settings).pipeline.tracker
        assert isinstance(tracker, TrackerConfig)
        assert tracker.dynamic_sigmas == 1.5
    with pytest.raises(ConfigError, match="dynamic_sigmas"):
        preset_with(PHYSICAL, (("dynamic_sigmas", 11.0),))


def test_names_and_numbers_of_one_parameter() -> None:
    assert parse_vary(["tracker_sigma_m=sensor,0.05,0.2"])["tracker_sigma_m"] == ("sensor", 0.05, 0.2)
    with pytest.raises(ArgumentError, match="tracker_sigma_m"):
        parse_vary(["tracker_sigma_m=lidar"])


# Brake rules


@pytest.mark.parametrize("rule", RULES)
def test_every_shipped_rule_has_a_trigger_that_is_put_in_any_order(rule: str) -> None:
    trigger = TRIGGERS[rule]
    changed = preset_with(PHYSICAL, ((trigger, 0.75), ("rule", rule)))
    assert changed == preset_with(PHYSICAL, (("rule", rule), (trigger, 0.75)))
    assert PARAMETERS["rule"].of(changed) == rule
    assert getattr(changed.pipeline.aeb, trigger) == 0.75
    usual = PARAMETERS[trigger].of(preset_with(PHYSICAL, (("rule", rule),)))
    assert preset_with(changed, ((trigger, usual),)) == preset_with(PHYSICAL, (("rule", rule),))


def test_the_trigger_of_another_rule_is_refused() -> None:
    message = "rss_response_s is a parameter of rule=rss; the brake rule is cascade"
    with pytest.raises(ConfigError, match=message):
        preset_with(PHYSICAL, (("rss_response_s", 0.5), ("rule", "cascade")))
    with pytest.raises(ConfigError, match="rule=cascade or cascade_gentle; the brake rule is paper"):
        preset_with(PHYSICAL, (("cascade_margin_s", 0.5),))
    with pytest.raises(ConfigError, match=r"the brake rule is smartmot\.decision\.rules:PaperRule"):
        preset_with(PHYSICAL, (("near_m", 0.5), ("rule", "smartmot.decision.rules:PaperRule")))
    with pytest.raises(ConfigError, match="must be positive"):
        preset_with(PHYSICAL, (("required_decel_mps2", 0.0), ("rule", "required_deceleration")))


@pytest.mark.parametrize("preset", [PAPER, PHYSICAL])
def test_the_last_point_to_brake_is_that_of_the_presets_own_brakes_on_a_dry_road(preset: Preset) -> None:
    """A frame of 0.05 s before it."""
    wet = replace(preset, brakes=replace(preset.brakes, max_decel_mps2=3.0))
    for road in (preset, wet):
        rule = preset_with(road, (("rule", "last_point_to_brake"),)).pipeline.aeb
        assert isinstance(rule, RequiredDeceleration)
        brakes = preset.brakes
        assert (rule.required_decel_mps2, rule.delay_s, rule.build_up_s) == (
            brakes.max_decel_mps2, brakes.delay_s + 0.05, brakes.build_up_s
        )  # fmt: skip


def test_the_staged_rule_reckons_with_the_brakes_of_the_preset() -> None:
    """A frame of 0.05 s before them."""
    for preset in (PAPER, PHYSICAL):
        rule = preset_with(preset, (("rule", "staged"), ("staged_margin_s", 0.1))).pipeline.aeb
        assert isinstance(rule, Staged)
        brakes = preset.brakes
        assert (rule.full_mps2, rule.delay_s, rule.build_up_s, rule.staged_margin_s) == (
            brakes.max_decel_mps2, brakes.delay_s + 0.05, brakes.build_up_s, 0.1
        )  # fmt: skip


def test_others_may_be_forecast_by_category() -> None:
    forecasts = {
        name: preset_with(PAPER, (("motion", name),)).pipeline.forecast for name in ("cv", "ctrv", "class")
    }
    assert [f.model for f in forecasts.values()] == ["ctrv", "ctrv", "class"]
    assert forecasts["ctrv"] == PAPER.pipeline.forecast
    assert forecasts["cv"].max_yaw_rate_radps == 0.0 < forecasts["class"].max_yaw_rate_radps


def test_a_detectors_profile_is_a_tracker(tmp_path: Path) -> None:
    DetectorProfile("mine", 10.0, {"car": CategoryProfile(100, 0.5, 0.1)}).save(tmp_path / "mine.json")
    value = str(tmp_path / "mine.json")
    assert PARAMETERS["tracker"].admits(value)
    assert not PARAMETERS["rule"].admits(value)
    tracker = preset_with(REAL, (("tracker", value),)).pipeline.tracker
    assert tracker == tracker_config(value)
    with pytest.raises(ConfigError, match=r"nowhere\.json: No such file"):
        preset_with(REAL, (("tracker", "nowhere.json"),))
