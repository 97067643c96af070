"""Vehicles of SUMO behind the ego in the question of severity: drivers, measures, and the answer."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import replace

import numpy as np
import pytest

from evaluation.metrics.rear_end import Followers
from evaluation.studies.answers.arms import arm_runs
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.rivals import PATH
from evaluation.studies.answers.severity import Severity
from evaluation.studies.answers.severity.behind import behind_of, gaps_m, least_ttc_s, with_followers
from evaluation.studies.answers.severity.question import behind_sentence
from evaluation.studies.answers.severity.runs import BrakingDecision
from evaluation.studies.answers.study import Sample
from scenarios.spec import RunSpec, simulation_of
from scenarios.traffic import Traffic
from tests.evaluation.studies.answers.conftest import scenes_of

STUDY = Severity(Sample(count=4), rules=("paper", "staged"), areas=(PATH,), followers=2)
STOP = BrakingDecision(
    False, 0.0, True, True, None, None, 50.0, 9.0, "storyboard", 50.0, 0.5, 20.0, None, 1.5, 6.0
)  # fmt: skip
STRUCK = replace(STOP, struck_kmh=12.0, behind_ttc_s=0.0, behind_decel_mps2=7.0)
ALONE = replace(STOP, behind_ttc_s=None, behind_decel_mps2=None)
BRAKED = replace(ALONE, unnecessary_stop=False, false_activation=False, end_reason="stopped")


def results() -> Results:
    paper, staged = STUDY.arms
    brake = (BRAKED,) * 4
    return Results(
        scenes_of(4),
        {paper: (*brake, STRUCK, STOP, STOP, ALONE), staged: (*brake, STOP, ALONE, ALONE, ALONE)},
    )


def test_least_times_to_collision() -> None:
    """10 m at 5 m/s are 2 s, 3 m at 2 m/s are 1.5 s; who falls back never comes nearer."""
    assert least_ttc_s(np.array([10.0, 3.0, 1.0]), np.array([5.0, 2.0, -1.0])) == 1.5
    assert least_ttc_s(np.array([10.0]), np.array([-1.0])) is None


def test_only_who_is_straight_behind_has_a_free_distance() -> None:
    """Cars of 4 x 2 m: 10 m behind, 6 m are free; behind an ego turned away by 90 degrees, beside, ahead."""
    size = np.tile([4.0, 2.0], (4, 1))
    ego = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    other = np.array([[-10.0, 1.0], [-10.0, 0.0], [-10.0, 3.0], [10.0, 0.0]])
    assert gaps_m(ego, size, other, size) == pytest.approx([6.0, np.nan, np.nan, np.nan], nan_ok=True)


def test_all_sides_of_a_scene_have_the_same_driver_of_the_distribution() -> None:
    drivers = Followers()
    scenes = scenes_of(4)
    items = STUDY.items_of(scenes)
    assert [replace(item.spec, traffic=None) for item in items] == [
        item.spec for item in arm_runs(STUDY.arms, scenes, 0)
    ]
    by_scene: dict[str, set[Traffic | None]] = {}
    for item in items:
        by_scene.setdefault(item.spec.scenario, set()).add(item.spec.traffic)
    chosen = [traffic for kinds in by_scene.values() for traffic in kinds]
    assert len(chosen) == len(by_scene)
    for traffic in chosen:
        assert traffic is not None
        assert traffic.followers == 2
        assert traffic.tau_s in drivers.gap_s
        assert np.abs(drivers.dead_s - traffic.reaction_s).min() <= 0.05 + 1e-9
        assert traffic.emergency_decel_mps2 == drivers.decel_mps2


def test_what_is_said_counts_false_activations_with_somebody_behind() -> None:
    paper, staged = STUDY.arms
    made = results()
    assert behind_sentence(made, paper).startswith("path with paper: in 1 of 3 false activations (33.3")
    assert behind_sentence(made, staged).startswith("path with staged: in 0 of 1 false activations")
    answer = STUDY.answer(made)
    rows = answer.tables["Those behind, driven by SUMO"].rows
    assert [row[1:3] for row in rows] == [("3", "1"), ("1", "0")]
    assert rows[0][3].startswith("12.0")
    assert rows[0][4].startswith("1.50")  # median of 0, 1.5 and 1.5 s
    assert any("none of the scene's other road users" in note for note in answer.notes)
    without = replace(STUDY, followers=0).answer(made)
    assert "Those behind, driven by SUMO" not in without.tables


def test_a_follower_of_sumo_is_measured_from_the_request_on() -> None:
    if importlib.util.find_spec("libsumo") is None:
        assert os.environ.get("SMARTMOT_TRAFFIC") != "required"
        pytest.skip("vehicles of SUMO need the extra sumo (no libsumo); .ci/traffic has it")
    weak = "gap_m=3,tau_s=0.1,decel_mps2=3,emergency_decel_mps2=3,reaction_s=0.1,sigma=0,min_gap_m=0"
    spec = RunSpec("c", "crossing", (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)
    for traffic, strikes in ((Traffic.parsed(weak), True), (Traffic(sigma=0.0), False)):
        simulation = simulation_of(replace(spec, traffic=traffic))
        outcome = simulation.run()
        behind = behind_of(simulation, outcome)
        assert behind is not None
        assert (behind.struck_kmh is not None) == strikes
        if strikes:
            [hit] = outcome.struck
            assert behind.struck_kmh == pytest.approx(3.6 * (hit.entity_speed_mps - hit.ego_speed_mps))
            assert behind.ttc_s == 0.0
            assert behind.decel_mps2 <= 3.0 + 1e-6
        else:
            assert behind.ttc_s is not None
            assert behind.ttc_s > 0.0
            assert behind.decel_mps2 <= 9.0 + 1e-6
    simulation = simulation_of(with_followers(spec, 1, Followers()))
    assert behind_of(simulation, simulation.run()) is not None
