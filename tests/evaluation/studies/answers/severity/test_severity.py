"""Weighed stops from made-up runs: what the question answers follows from them alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.arms import Arm, arm_runs
from evaluation.studies.answers.measures import decide as decide_plainly
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.answers.severity import RULES, Severity, Weights
from evaluation.studies.answers.severity.question import changes_of, cost_of, severities
from evaluation.studies.answers.severity.runs import BrakingDecision, at_distinct_times, decide
from evaluation.studies.answers.study import Sample
from tests.evaluation.studies.answers.conftest import scenes_of

STUDY = Severity(Sample(count=4), rules=("paper", "staged"), areas=(PATH, MAP))


def run(
    lost_kmh: float = 0.0, peak_mps2: float = 0.0, rear: float | None = 0.0, stop: bool = True
) -> BrakingDecision:
    """A run in a nothing scene from 50 km/h."""
    return BrakingDecision(
        False, 0.0, stop, stop, None, None, lost_kmh, peak_mps2, "storyboard", 50.0, rear,
        None if rear is None else 20.0 * (rear > 0.0),
    )  # fmt: skip


AVOIDED = replace(run(50.0, 8.8, 0.5), unnecessary_stop=False, false_activation=False, end_reason="stopped")
HARD, SOFT, NONE = run(50.0, 9.81, 0.6), run(5.0, 3.924, 0.0), run(stop=False)


def results(nothing: dict[str, list[BrakingDecision]]) -> Results:
    """Four scenes of each kind; what each rule does in the nothing scenes, alike with both areas."""
    runs = {arm: tuple([AVOIDED] * 4 + nothing[arm.rule]) for arm in STUDY.arms}
    return Results(scenes_of(4), runs)


MADE = results({"paper": [HARD, HARD, NONE, NONE], "staged": [SOFT, SOFT, SOFT, NONE]})


@pytest.mark.parametrize(
    ("weights", "expected"),
    [
        # a stop with 1 g that six of ten drive into; 10 % of the speed with 0.4 g
        (Weights(), (2.6 / 3, 0.5 / 3)),
        (Weights(1.0, 0.0, 0.0), (1.0, 0.1)),
        (Weights(0.0, 2.0, 0.0), (1.0, 0.4)),
        (Weights(1.0, 1.0, 2.0), (3.2 / 4, 0.5 / 4)),
    ],
)
def test_a_severity_is_the_weighed_mean_of_its_parts(weights: Weights, expected: tuple[float, float]) -> None:
    assert [weights.severity(each) for each in (HARD, SOFT)] == pytest.approx(list(expected))
    assert weights.severity(NONE) == 0.0
    assert weights.severity(run(80.0, 20.0, 1.0)) == pytest.approx(1.0)  # no part is above 1
    assert weights.severity(run(50.0, 9.81, None)) is None


def test_a_side_that_stops_more_often_may_weigh_less() -> None:
    """By hand: 2 of 4 stops of 0.867 weigh as 43.3 %, 3 of 4 of 0.167 as 12.5 %."""
    paper, staged = (cost_of(MADE, STUDY.arm(PATH, rule), Weights()) for rule in STUDY.rules)
    assert (paper.stops.value, staged.stops.value) == (0.5, 0.75)
    assert paper.weighed.value == pytest.approx(2 * 2.6 / 3 / 4)
    assert staged.weighed.value == pytest.approx(3 * 0.5 / 3 / 4)
    assert paper.lost_kmh.value == 50.0
    assert (paper.rear.value, paper.closing_kmh.value) == (0.6, 20.0)
    assert math.isnan(staged.closing_kmh.value)
    assert (paper.rear_brake.value, paper.early.value) == (0.5, 0.0)
    assert staged.benefit.value == pytest.approx(1.0 - 0.125)


def test_rules_are_compared_with_the_first_scene_by_scene() -> None:
    """Less in two scenes, more in the third: p = 1 of the sign test; twice for two areas."""
    changes = changes_of(MADE, STUDY.pairs, Weights())
    assert [(c.arm.name, c.against.name) for c in changes] == [
        ("path with staged", "path with paper"), ("map with staged", "map with paper"),
    ]  # fmt: skip
    assert changes[0].weighed.value == pytest.approx(0.125 - 2 * 2.6 / 3 / 4)
    assert (changes[0].more, changes[0].fewer, changes[0].p_value, changes[0].adjusted) == (1, 2, 1.0, 1.0)
    assert changes[0].avoided.value == 0.0


def test_the_answer_is_in_words_first_and_names_the_least_whatever_weighs() -> None:
    answer = STUDY.answer(MADE)
    assert answer.sentences[0].startswith("path with staged: 100.0 [")
    assert "which weigh as 12.5 [" in answer.sentences[0]
    assert answer.sentences[-1] == (
        "Whatever the weights, the least weighed stops in these scenes: map with staged, path with staged."
    )
    other = results({"paper": [HARD, NONE, NONE, NONE], "staged": [SOFT, SOFT, SOFT, SOFT]})
    assert STUDY.answer(other).sentences[-1].startswith("Which side has the least weighed stops depends on")
    none = results({"paper": [NONE] * 4, "staged": [NONE] * 4})
    assert STUDY.answer(none).sentences[-1].startswith("Whatever the weights, no side has less")
    page = answer.markdown().decode()
    assert "Weights: 1, 1, 1 (assumed; --weights)" in page
    assert answer.tables["By weights"].rows[0][0] == "path with paper"
    [line] = [
        text for text in answer.files["severity.csv"].decode().splitlines() if ",staged,path,weighed," in text
    ]
    assert float(line.split(",")[4]) == pytest.approx(0.125)


def test_runs_that_were_cut_off_or_touched_are_in_no_mean() -> None:
    cut = replace(NONE, end_reason="time_limit")
    touched = replace(HARD, collided=True, rear_share=None, rear_closing_kmh=None)
    made = results({"paper": [cut, touched, HARD, NONE], "staged": [NONE] * 4})
    values = severities(made, STUDY.arm(PATH, "paper"), Weights())
    assert np.isnan(values).tolist() == [True] * 6 + [False] * 2
    assert cost_of(made, STUDY.arm(PATH, "paper"), Weights()).weighed.count == 2


@pytest.mark.parametrize("text", ["1,1", "1,1,1,1", "a,1,1", "-1,1,1", "0,0,0", "nan,1,1", "inf,1,1", ""])
def test_impossible_weights_are_refused(text: str) -> None:
    with pytest.raises(ArgumentError, match="--weights: expected three numbers"):
        Weights.parsed(text)
    assert Weights.parsed("1,0,2.5") == Weights(1.0, 0.0, 2.5)


def test_a_run_keeps_what_the_other_questions_keep_and_more(tmp_path: Path) -> None:
    sample = Sample("train", 1, 3)
    scenes = sample.draw(tmp_path)
    arms = [Severity(sample).arm(PATH, "paper")]
    for item in arm_runs(arms, scenes, sample.seed):
        braked, plain = decide(item)[0], decide_plainly(item)[0]
        assert [getattr(braked, name) for name in type(plain).__slots__] == [
            getattr(plain, name) for name in type(plain).__slots__
        ]
        assert braked.initial_kmh == pytest.approx(scenes[0].speed_kmh, abs=60.0)
        assert (braked.rear_share is None) == braked.collided
    assert len(Severity().arms) == 3 * len(RULES)
    times, values = at_distinct_times(np.array([0.0, 0.0, 0.1]), np.array([1.0, 2.0, 3.0]))
    assert (times.tolist(), values.tolist()) == ([0.0, 0.1], [1.0, 3.0])


def test_every_rule_of_the_question_is_shipped() -> None:
    arms: tuple[Arm, ...] = Severity().arms
    assert {arm.rule for arm in arms} == set(RULES)
    for arm in arms:
        arm.check()
