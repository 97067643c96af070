"""Arms: settings that mean something, signs by coins, noise of its own in each scene."""

from __future__ import annotations

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.arms import Arm, arm_runs, scene_seed
from evaluation.studies.answers.rivals import MAP, PATH, RIVALS
from evaluation.studies.answers.tables import path_note
from scenarios.scenes.scenes import SceneRun, all_scenes


def test_settings_that_mean_nothing_drop_out() -> None:
    arm = Arm("rectangle", "rectangular").having(("margin_m", 1.0), ("half_width_m", 2.0))
    assert arm.settings == (("half_width_m", 2.0),)
    assert arm.having(("half_width_m", 3.0)).settings == (("half_width_m", 3.0),)


def test_a_bias_has_either_sign_in_about_half_of_the_scenes_and_the_same_for_all_arms() -> None:
    arms = [rival.arm("physical", "paper").having(("range_m", 5.0), coin=True) for rival in (MAP, PATH)]
    values = [[dict(arm.settings_in(seed))["range_m"] for seed in range(400)] for arm in arms]
    assert values[0] == values[1]
    assert set(values[0]) == {5.0, -5.0}
    assert 160 < values[0].count(5.0) < 240  # four standard deviations of a fair coin
    assert dict(arms[0].having(("range_m", 7.0)).settings_in(3))["range_m"] == 7.0


def test_each_scene_has_noise_of_its_own_and_all_arms_the_same() -> None:
    scenes = all_scenes()[:40]
    seeds = {scene_seed(0, scene) for scene in scenes}
    assert len(seeds) == 40
    assert not seeds & {scene_seed(1, scene) for scene in scenes}
    runs = arm_runs([rival.arm("physical", "paper") for rival in (MAP, PATH)], scenes, 0)
    assert [run.spec.seed for run in runs[:40]] == [run.spec.seed for run in runs[40:]]
    assert [run.label[1] for run in runs[:40]] == list(scenes)


def test_a_value_out_of_range_is_said_before_the_first_run() -> None:
    with pytest.raises(ArgumentError, match="map"):
        MAP.arm("physical", "paper").having(("margin_m", -1.0)).check()


@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.name)
def test_rivals_can_be_run(rival) -> None:
    rival.arm("physical", "paper").check()


def test_the_drawn_scene_is_named_by_scene_and_variant() -> None:
    scenes = [SceneRun("s", variant, "brake", "f", (), 50.0) for variant in ("a", "b")]
    assert scene_seed(0, scenes[0]) != scene_seed(0, scenes[1])


def test_the_page_says_whose_planned_path_comes_from_where() -> None:
    arms = [rival.arm("physical", "paper") for rival in RIVALS if rival.name in ("path", "all, as published")]
    of_map = arms[0].having(("path_from", "map"), name="wrong")
    assert path_note([*arms, of_map]) == (
        "Planned path: from the planner, exact relative to the ego under every error of localisation and map "
        "(path); none (all, as published); from the map, as wrong as that and the localisation are (wrong)."
    )
