"""`smartmot-eval study`: options that do not go together, and which question they become."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import pytest

from evaluation.cli import main
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.study import Question
from evaluation.studies.answers.trigger import FAMILIES
from scenarios.scenes.scenes import SceneRun


def call(*arguments: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", "study", *arguments])
        try:
            main()
        except SystemExit as stop:
            return int(stop.code or 0)
    return 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("profit",), "QUESTION: unknown 'profit'; use one of: gain"),
        (("sensor", "--preset", "physical,real"), "--preset: has no effect with study sensor"),
        (("sensor", "--rule", "paper,rss"), "--rule: sensor takes one"),
        (("gain", "--rule", "none"), "--rule: unknown 'none'"),
        (("gain", "--weights", "1,1,1"), "--weights: has no effect with study gain; it is for severity"),
        (("severity", "--weights", "1,1"), "--weights: expected three numbers such as 1,1,1"),
        (("severity", "--preset", "real,paper"), "--preset: severity takes one"),
        (("severity", "--tuned", "x.json"), "--tuned: has no effect with study severity"),
        (("gain", "--path-from", "map"), "--path-from: has no effect with study gain; it is for break-even"),
        (("break-even", "--path-from", "sky"), "--path-from: unknown 'sky'"),
        (
            ("sensor", "--tuned", "x.json"),
            "--tuned: has no effect with study sensor; it is for gain, break-even or trigger",
        ),
        (("gain", "--tuned", "x.json"), "x.json is not a tuned.json"),
        (("gain", "--split", "all"), "--split: unknown 'all'"),
        (("gain", "--maps", "nowhere"), "--maps: nowhere is no folder"),
        (("trigger", "--strategies", "lidar"), "--strategies: unknown 'lidar'"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: tuple[str, ...],
    message: str,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(*arguments) == 2
    error = capfd.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def results() -> Results:
    """A side that avoids one of two collisions and stops unnecessarily in one of two scenes."""
    quiet = Decision(False, 0.0, False, False, 1.5, None, 0.0, 0.0, "stopped")
    outcomes = {
        "hit": ("brake", dataclasses.replace(quiet, collided=True, v_impact_kmh=20.0, end_reason="contact")),
        "avoided": ("brake", quiet),
        "stop": ("nothing", dataclasses.replace(quiet, unnecessary_stop=True, speed_lost_kmh=30.0)),
        "free": ("nothing", quiet),
    }
    scenes = tuple(SceneRun(name, "straight", must, "", (), 50.0) for name, (must, _) in outcomes.items())
    return Results(scenes, {Arm("map", "map"): tuple(run for _, run in outcomes.values())})


@pytest.mark.parametrize(
    ("rules", "status", "line"),
    [
        ("avoided<0.5,stops>0.5,impact>10,scenes<4", 0, ""),
        ("map/avoided<0.9", 3, "map, physical, map: avoided 0.5, fails if < 0.9: hit, straight"),
        ("stops>0.1", 3, "map, physical, map: stops 0.5, fails if > 0.1: stop, straight"),
        ("impact>=10", 3, "map, physical, map: impact 10, fails if >= 10"),
        ("warning_ttc<1", 3, "map, physical, map: warning_ttc no value, fails if < 1"),
    ],
)
def test_a_study_fails_where_a_rule_is_met(
    rules: str,
    status: int,
    line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("evaluation.studies.answers.command.ask", lambda *_: results())
    assert call("gain", "--out", str(tmp_path), "--fail-on", rules) == status
    errors = capfd.readouterr().err.splitlines()
    assert errors == ([f"smartmot-eval: failed: {line}"] if line else [])


def test_the_search_for_one_case_has_measures_of_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    assert call("worst", "--family", "pedestrian crosses", "--fail-on", "avoided<1") == 2
    assert "--fail-on: no measure 'avoided'; use: probability" in capfd.readouterr().err


def test_options_become_a_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Question] = []
    monkeypatch.setattr(
        "evaluation.studies.answers.command.ask", lambda question, *_: asked.append(question) or results()
    )
    out = ("--out", str(tmp_path))
    assert call("gain", "--preset", "physical,real", "--rule", "paper,rss", "--count", "7", *out) == 0
    assert call("break-even", "--preset", "real", "--path-from", "map", *out) == 0
    assert call("tune", "--trials", "3", *out) == 0
    assert call("trigger", "--strategies", "map", *out) == 0
    gain, break_even, tune, trigger = asked
    assert {arm.preset for arm in break_even.arms} == {"real"}
    assert {dict(arm.settings)["path_from"] for arm in break_even.arms} == {"map"}
    assert {(arm.preset, arm.rule) for arm in gain.arms} == {
        (preset, rule) for preset in ("physical", "real") for rule in ("paper", "rss")
    }
    assert (gain.sample.count, gain.sample.split, tune.sample.split) == (7, "test", "train")
    assert len(tune.arms) == len(("path", "map", "rectangle")) * 3
    assert {arm.strategy for arm in trigger.arms} == {"map"}
    assert {arm.rule for arm in trigger.arms} == set(FAMILIES)
