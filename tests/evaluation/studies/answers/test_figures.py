"""Figures of the questions: what is drawn is what the runs say, and no text lies on another."""

from __future__ import annotations

import pytest

from evaluation.studies.answers.break_even import BreakEven
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.sensor import SensorErrors
from evaluation.studies.answers.study import Question
from evaluation.studies.answers.trigger import Trigger
from tests.figures import text_faults

OWN = ("my_package.monitored.areas:variant_00_wide", "my_package.areas:narrow")
GAIN = Gain(presets=("physical",), own=OWN)
CHOSEN = (("map", "paper", (("margin_m", 4.0),)),)
QUESTIONS: tuple[Question, ...] = (GAIN, BreakEven(), BreakEven(tuned=CHOSEN), SensorErrors(), Trigger())


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.name)
def test_texts_keep_off_each_other(question: Question, make) -> None:
    ranks = {arm: k / len(question.arms) for k, arm in enumerate(question.arms)}
    for rates in (lambda arm: (1.0 - 0.4 * ranks[arm], 0.5 * ranks[arm]), lambda arm: (0.9, 0.1)):
        drawn = question.answer(make(question.arms, 40, rates)).figures
        assert len(drawn) >= 1
        for figure in drawn.values():
            assert text_faults(figure) == []


def test_curves_over_errors_are_named_at_their_ends(make) -> None:
    study = BreakEven(tuned=CHOSEN)
    both, *parts = study.answer(make(study.arms, 20, lambda arm: (0.9, 0.1))).figures.values()
    assert [text.get_text() for axes in both.axes for text in axes.texts] == ["map", "map, tuned"]
    for figure in parts:
        words = [text.get_text().split("\n")[0] for axes in figure.axes for text in axes.texts]
        assert words == ["collisions", "unnecessary"]
    assert not any(figure.legends for figure in (both, *parts))


def test_bars_are_the_differences(make) -> None:
    rates = {"path": (0.5, 0.5), "map": (0.75, 0.25)}
    results = make(GAIN.arms, 40, lambda arm: rates.get(arm.name, (0.5, 0.5)))
    (figure,) = GAIN.answer(results).figures.values()
    avoided, stops = figure.axes
    assert [label.get_text() for label in avoided.get_yticklabels()][-1] == "map"
    top = len(GAIN.arms) - 2
    points = [
        [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "o"]
        for axes in (avoided, stops)
    ]
    assert [25.0, float(top)] in [point[0] for point in points[0]]
    assert [-25.0, float(top)] in [point[0] for point in points[1]]
