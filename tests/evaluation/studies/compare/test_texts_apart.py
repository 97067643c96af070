"""Texts of the study's figures keep off each other and every curve is seen, however many strategies."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.runs.execution import FrameTime
from evaluation.studies.compare.figures import ablation, frontier
from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.table import Summary
from evaluation.studies.growth import GrowthRun, growth_figure
from tests.evaluation.studies.compare.test_figures import summary
from tests.figures import labelled_curves, text_faults, unseen

STRATEGIES = ("rectangular", "map", "all", *(f"my_package.monitored.areas:variant_{k}" for k in range(5)))
PRESET = "12 scene variants, 1 seed, preset physical, dry"


@pytest.mark.parametrize(("count", "others"), [(1, (0,)), (3, (0, 50, 200)), (8, (0,)), (8, (0, 10, 1000))])
def test_growth(count: int, others: tuple[int, ...]) -> None:
    """Equal times, tracks and requests: each curve lies on all others."""
    runs = [
        GrowthRun(name, k, seed, float(k), 3.0, False, 0.0)
        for name in STRATEGIES[:count]
        for k in others
        for seed in (0, 1)
    ]
    figure = growth_figure(runs, [FrameTime(10, 0.5, 0.7)] * len(runs))
    assert text_faults(figure) == []
    assert unseen(figure, labelled_curves(figure)[:count]) == []


def test_growth_shades_what_the_seeds_have() -> None:
    """An interval of the mean of two values, 12.706 times their half distance, would go below no tracks."""
    runs = [GrowthRun("map", 0, seed, tracks, 3.0, False, 0.0) for seed, tracks in enumerate((1.0, 4.0, 2.5))]
    tracks = growth_figure(runs, [FrameTime(10, 0.5, 0.7)] * 3).axes[1]
    (band,) = tracks.collections[0].get_paths()
    assert (band.get_extents().y0, band.get_extents().y1) == (1.0, 4.0)
    assert tracks.lines[0].get_ydata().tolist() == [2.5]


@pytest.mark.parametrize(("count", "choices"), [(1, 0), (1, 1), (3, 6), (5, 3), (8, 2)])
def test_ablation(count: int, choices: int) -> None:
    rows: list[Summary] = []
    for name in STRATEGIES[:count]:
        rows.append(summary(Point(name), 0.5, 0.2))
        for k in range(choices):
            settings = (("ego_forecast", "path"), ("horizon_s", float(k)))[k % 2 :]
            rows.append(summary(Point(name, settings), 0.5 + k / 50, 0.1))
    assert text_faults(ablation(rows, PRESET)) == []


@pytest.mark.parametrize("count", [1, 2, 5, 8])
@pytest.mark.parametrize("scenes", [1, 2, 50])
def test_frontier(count: int, scenes: int) -> None:
    """With one scene all points fall on one another, with few many do."""
    points = [Point(name) for name in STRATEGIES[:count] if name != "map"]
    if count > 1:
        points += [Point("map", (("margin_m", width),)) for width in (0.0, 0.5, 1.0, 1.8, 2.0, 3.0)]
    rng = np.random.default_rng(count)
    shares = rng.integers(0, scenes, size=(len(points), 2)) / max(scenes - 1, 1)
    rows = [summary(point, *share) for point, share in zip(points, shares.tolist(), strict=True)]
    figure = frontier(rows, points, f"{PRESET}, a_weather_of_my_own_with_a_long_name, a title of many words")
    assert text_faults(figure) == []
    assert unseen(figure, labelled_curves(figure)) == []
