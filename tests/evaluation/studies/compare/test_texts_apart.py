"""Texts of the study's small figures keep off each other, however many strategies there are."""

from __future__ import annotations

import itertools

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from evaluation.metrics.intervals import Estimate
from evaluation.runs.execution import FrameTime
from evaluation.studies.compare.figures import ablation
from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.table import Summary
from evaluation.studies.growth import GrowthRun, growth_figure
from tests.evaluation.studies.compare.test_figures import summary

STRATEGIES = ("rectangular", "map", "all", "my_package.areas:wide", "my_package.areas:narrow")


def overlapping(figure: Figure) -> list[tuple[str, str]]:
    """Titles, labels, legends and notes of a figure that share paper."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # puts legends in their places
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    texts = [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]
    for axes in figure.axes:
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label]
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in texts if text.get_text()]
    assert len(boxes) > 5
    return [(a, b) for (a, one), (b, two) in itertools.combinations(boxes, 2) if one.overlaps(two)]


@pytest.mark.parametrize("count", [1, 3, 5])
def test_growth(count: int) -> None:
    runs = [
        GrowthRun(name, others, 0, float(others), 3.0, False, 0.0)
        for name in STRATEGIES[:count]
        for others in (0, 50, 200)
    ]
    assert overlapping(growth_figure(runs, [FrameTime(10, 0.5, 0.7)] * len(runs))) == []


@pytest.mark.parametrize("count", [1, 3, 5])
def test_ablation(count: int) -> None:
    rows: list[Summary] = []
    for name in STRATEGIES[:count]:
        rows.append(summary(Point(name), 0.5, 0.2))
        rows += [summary(Point(name, (("horizon_s", s),)), 0.5 + 0.02 * s, 0.1) for s in (1.0, 2.0, 4.0)]
    assert isinstance(rows[0].avoided, Estimate)
    assert overlapping(ablation(rows, "12 scene variants, 1 seed, preset physical, dry")) == []
