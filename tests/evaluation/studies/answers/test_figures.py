"""Figures of the questions: what is drawn is what the runs say, and no text lies on another."""

from __future__ import annotations

import itertools

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from evaluation.studies.answers.break_even import BreakEven
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.sensor import SensorErrors
from evaluation.studies.answers.study import Question
from evaluation.studies.answers.trigger import Trigger

GAIN = Gain(presets=("physical",), own=("my_package.areas:narrow",))
QUESTIONS: tuple[Question, ...] = (GAIN, BreakEven(), SensorErrors(), Trigger())


def overlapping(figure: Figure) -> list[tuple[str, str]]:
    """Headings, labels, notes and ticks of a figure that share paper, and texts that leave it."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    texts = list(figure.texts)
    for axes in figure.axes:
        if not axes.axison:
            continue
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label]
        low, high = sorted(axes.get_xlim())
        texts += [
            label
            for label, tick in zip(axes.get_xticklabels(), axes.get_xticks(), strict=True)
            if low <= tick <= high
        ]
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in texts if text.get_text()]
    assert len(boxes) > 8
    width, height = figure.get_size_inches() * figure.dpi
    outside = [
        (name, "the edge")
        for name, box in boxes
        if box.x0 < 0 or box.y0 < 0 or box.x1 > width or box.y1 > height
    ]
    return outside + [(a, b) for (a, one), (b, two) in itertools.combinations(boxes, 2) if one.overlaps(two)]


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda question: question.name)
def test_texts_keep_off_each_other(question: Question, make) -> None:
    ranks = {arm: k / len(question.arms) for k, arm in enumerate(question.arms)}
    results = make(question.arms, 40, lambda arm: (1.0 - 0.4 * ranks[arm], 0.5 * ranks[arm]))
    drawn = question.answer(results).figures
    assert len(drawn) >= 1
    for figure in drawn.values():
        assert overlapping(figure) == []


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
