"""The frontier is legible: no text covers another, a point or the frame; the paper's widths are ringed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from evaluation.metrics.intervals import Estimate
from evaluation.studies.compare.figures import frontier, save
from evaluation.studies.compare.grid import COMPARED, Point, fair_points
from evaluation.studies.compare.table import Summary
from evaluation.views.plots.strategies import strategy_colour
from tests.figures import text_faults

NONE = Estimate(0.0, 0.0, 0.0, 10)


def summary(point: Point, avoided: float, stops: float) -> Summary:
    rates = [Estimate(r, max(r - 0.1, 0.0), min(r + 0.1, 1.0), 20) for r in (avoided, stops)]
    return Summary(
        strategy=point.strategy, settings=point.text, weather="dry", avoided=rates[0], v_impact_kmh=NONE,
        score_share=0.5, band_share=NONE, flag_ttc_s=NONE, flag_distance_m=NONE, false_activations=rates[1],
        false_activations_per_km=1.0, early_activations=NONE, cut_off=NONE,
        needless_stops=rates[1], speed_loss_kmh=NONE, delay_s=NONE, tracks=NONE,
    )  # fmt: skip


POINTS = fair_points(COMPARED)
VALUES = ("0.9", "2.6", "4", "0", "0.5", "1.8", "4")
NAMES = tuple(
    name + preset for preset in ("", ", as preset") for name in ("rectangle", "map", "no area", "path")
)


def drawn(values: list[tuple[float, float]]) -> Figure:
    rows = [summary(p, a, s) for p, (a, s) in zip(POINTS, values, strict=True)]
    return frontier(rows, POINTS, "test")


@settings(max_examples=8, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 5), st.integers(0, 5)),
        min_size=len(POINTS),
        max_size=len(POINTS),
        unique=True,
    )
)
def test_values_stay_inside_and_apart(counts: list[tuple[int, int]]) -> None:
    """Wherever the points are, if no two are nearer than a fifth of an axis."""
    figure = drawn([(a / 5, s / 5) for a, s in counts])
    assert isinstance(figure.canvas, FigureCanvasAgg)
    renderer = figure.canvas.get_renderer()
    for axes in figure.axes:
        frame = axes.get_window_extent(renderer)
        texts = [t for t in axes.texts if isinstance(t, Annotation)]
        assert sorted(t.get_text() for t in texts) == sorted((*VALUES, *(() if figure.legends else NAMES)))
        boxes = [text.get_window_extent(renderer) for text in texts]
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
        assert all(frame.x0 - 1 < box.x0 and box.x1 < frame.x1 + 30 for box in boxes)


def test_every_value_and_name_is_written_and_the_papers_are_ringed() -> None:
    k = np.arange(len(POINTS))
    figure = drawn([(float(a), float(s)) for a, s in zip(k / 12, k / 24, strict=True)])
    assert not figure.legends
    for axes in figure.axes:
        assert sorted(text.get_text() for text in axes.texts) == sorted((*VALUES, *NAMES))
        rings = [line for line in axes.lines if line.get_markersize() == 9.5 and len(line.get_xdata())]
        assert sorted(float(line.get_ydata()[0]) for line in rings) == pytest.approx(
            sorted(100 * n / 12 for n in (1, 5))
        )


def test_names_without_room_are_in_a_legend() -> None:
    """All points on one another."""
    figure = drawn([(1.0, 0.0)] * len(POINTS))
    [legend] = figure.legends
    assert sorted(text.get_text() for text in legend.get_texts()) == sorted(NAMES)
    assert text_faults(figure) == []


def test_shares_begin_at_0_and_markers_there_are_whole() -> None:
    figure = drawn([(k / 12, 0.0) for k in range(len(POINTS))])
    for axes in figure.axes:
        low, high = axes.get_xlim()
        shown = [tick for tick in axes.get_xticks() if low <= tick <= high]
        assert shown[0] == 0.0
        assert len(shown) > 3
        left = axes.transData.transform((low, 0.0))[0]
        at_0 = axes.transData.transform((0.0, 0.0))[0]
        assert (at_0 - left) * 72 / figure.dpi > 9.5 / 2  # radius of a ring, in points


def test_equal_figures_are_equal_bytes(tmp_path: Path) -> None:
    values = [(k / 12, k / 24) for k in range(len(POINTS))]
    first = [path.read_bytes() for path in save(drawn(values), tmp_path / "a")]
    second = [path.read_bytes() for path in save(drawn(values), tmp_path / "b")]
    assert first == second


ALONE = (Point("rectangular"), Point("map"), Point("all"), Point("mine:one"), Point("mine:two"))


def colours_of(points: tuple[Point, ...]) -> dict[str, set[object]]:
    """Colours of the curves of each strategy, by name in the legend."""
    figure = frontier([summary(point, 0.5, 0.1) for point in points], points, "test")
    found: dict[str, set[object]] = {}
    for axes in figure.axes:
        for line in axes.get_lines():
            found.setdefault(str(line.get_label()), set()).add(line.get_color())
    return {name: found[name] for name in found if not name.startswith("_")}


def test_a_strategy_has_one_colour_however_many_are_shown() -> None:
    together = colours_of(ALONE)
    assert len(together) == 5
    assert all(len(colours) == 1 for colours in together.values())
    for point in ALONE:
        [(name, colours)] = colours_of((point,)).items()
        assert colours == together[name] == {strategy_colour(point.strategy)}


def test_curves_on_the_same_points_are_all_seen() -> None:
    """A comparison of few scenes: every strategy avoids everything, and each is still to be seen."""
    figure = frontier([summary(point, 1.0, 0.2) for point in ALONE], ALONE, "test")
    assert isinstance(figure.canvas, FigureCanvasAgg)
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].astype(int)
    for axes in figure.axes:
        box = axes.get_window_extent()
        view = image[
            round(image.shape[0] - box.y1) : round(image.shape[0] - box.y0), round(box.x0) : round(box.x1)
        ]
        for point in ALONE:
            colour = np.rint(np.array(to_rgb(strategy_colour(point.strategy))) * 255)
            assert (np.abs(view - colour).max(axis=2) < 12).sum() > 40, point
