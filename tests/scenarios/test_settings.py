"""Parameters: what is typed, and what it changes."""

from dataclasses import replace

import pytest

from evaluation.cli.options import parse_vary
from evaluation.errors import ArgumentError
from evaluation.studies.compare.grid import ABLATION, FRONTIER, Point, ablation_points, points_of, study_runs
from scenarios.presets import PAPER, PHYSICAL
from scenarios.scenes.scenes import choose_scenes
from scenarios.settings import PARAMETERS, preset_with
from smartmot.decision.aeb import AebConfig
from smartmot.decision.rules import PaperRule
from smartmot.errors import ConfigError
from smartmot.plugins import Plugin


def test_ranges_lists_and_names() -> None:
    found = parse_vary(["margin_m=0..2:0.5", "iou_threshold=0.001,0.01", "ego_forecast=ctrv,route"])
    assert found == {
        "margin_m": (0.0, 0.5, 1.0, 1.5, 2.0),
        "iou_threshold": (0.001, 0.01),
        "ego_forecast": ("ctrv", "route"),
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


SHARES = {"iou_threshold", "miss_rate", "miss_persistence", "heading_flip", "class_confusion"}
"""Parameters that are at most 1."""


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_value_that_is_put_is_read_back_and_the_preset_keeps_its_own(name: str) -> None:
    parameter = PARAMETERS[name]
    for value in parameter.choices or (0.5, 0.25 if name in SHARES else 2.0):
        assert parameter.of(preset_with(PHYSICAL, ((name, value),))) == value
        assert (
            preset_with(preset_with(PHYSICAL, ((name, value),)), ((name, parameter.of(PHYSICAL)),))
            == PHYSICAL
        )
    usual = parameter.of(PHYSICAL)
    assert preset_with(PHYSICAL, ((name, usual),)) == PHYSICAL


def test_a_value_out_of_range_is_refused_before_the_first_run() -> None:
    with pytest.raises(ConfigError):
        study_runs([Point("map", (("margin_m", -1.0),))], choose_scenes(), "physical", ["dry"], 1)


def test_points_take_only_the_parameters_that_mean_something() -> None:
    points = points_of(("rectangular", "map", "all"), {"margin_m": (0.0, 1.0), "motion": ("cv", "ctrv")})
    assert [p.text for p in points if p.strategy == "all"] == ["motion=cv", "motion=ctrv"]
    assert len([p for p in points if p.strategy == "map"]) == 4
    assert len(set(points)) == len(points) == 8
    assert [p.text for p in points_of(("all",), FRONTIER)] == [""]


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
