"""Values of curves stand beside their own points: nearer than to any point of another value."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from evaluation.views.plots.labels import Mark, write_values
from evaluation.views.plots.style import new_figure

COLOURS = ("red", "blue")
Curves = list[list[Mark]]


def written(curves: Curves) -> tuple[list[Annotation], list[Bbox], np.ndarray, Bbox]:
    """Texts, their boxes, the positions of all points in pixels, and the frame."""
    figure = new_figure(3.0)
    axes = figure.subplots()
    axes.set_xlim(-3.5, 100.0)
    axes.set_ylim(-2.0, 109.0)
    write_values(figure, axes, curves, 7.0)
    assert isinstance(figure.canvas, FigureCanvasAgg)
    renderer = figure.canvas.get_renderer()
    texts = [text for text in axes.texts if isinstance(text, Annotation)]
    at = axes.transData.transform([(mark.x, mark.y) for curve in curves for mark in curve])
    boxes = [text.get_window_extent(renderer) for text in texts]
    return texts, boxes, at, axes.get_window_extent(renderer)


def gap(box: Bbox, point: np.ndarray) -> float:
    nearest = np.clip(point, box.min, box.max)
    return float(np.linalg.norm(point - nearest))


def assert_each_stands_at_its_own(curves: Curves) -> None:
    texts, boxes, at, frame = written(curves)
    marks = [mark for curve in curves for mark in curve]
    for text, box in zip(texts, boxes, strict=True):
        values = text.get_text().split(", ")
        here = (text.get_color(), *text.xy)
        own = min(gap(box, p) for p, m in zip(at, marks, strict=True) if (m.colour, m.x, m.y) == here)
        foreign = [gap(box, p) for p, m in zip(at, marks, strict=True) if m.text not in values]
        assert own <= min(foreign, default=np.inf) + 1e-6, (text.get_text(), own, foreign)
        assert own < 60.0  # pixels: beside it
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_two_values_above_one_another_keep_their_own() -> None:
    """As margins of 1.8 and 4 m in the paper's preset: 4 percent apart, on two curves."""
    assert_each_stands_at_its_own(
        [
            [Mark(x - 4, 73, "0", "blue"), Mark(x - 4, 81, "0.5", "blue"), Mark(x, 96, "1.8", "blue"),
             Mark(x, 100, "4", "blue")]
            for x in (10.0, 17.0)
        ]
    )  # fmt: skip


@pytest.mark.parametrize("step", [(0.0, 0.4), (0.4, 0.0), (0.3, 0.3), (-0.4, 1.5), (1.5, -3.0)])
def test_values_that_almost_fall_on_one_another(step: tuple[float, float]) -> None:
    one = np.array([40.0, 60.0])
    assert_each_stands_at_its_own(
        [[Mark(*one, "1", "blue"), Mark(*(one + step), "2", "blue"), Mark(80.0, 90.0, "3", "blue")]]
    )


@settings(max_examples=25, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=7, unique=True),
    st.lists(
        st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)).filter(lambda d: max(map(abs, d)) > 0.2),
        min_size=7,
        max_size=7,
    ),
    st.booleans(),
)
def test_every_point_has_a_neighbour_almost_at_its_place(
    places: list[tuple[int, int]], steps: list[tuple[float, float]], of_one_curve: bool
) -> None:
    """Pairs of points, a quarter of an axis apart and as far from the frame as a text is wide."""
    first = [Mark(25.0 * x + 8, 27.0 * y + 10, f"{k}", "blue") for k, (x, y) in enumerate(places)]
    second = [
        Mark(mark.x + dx, mark.y + dy, f"{k}.5", "blue" if of_one_curve else "red")
        for k, (mark, (dx, dy)) in enumerate(zip(first, steps, strict=False))
    ]
    pairs = [mark for pair in zip(first, second, strict=True) for mark in pair]
    assert_each_stands_at_its_own([pairs] if of_one_curve else [first, second])


def test_points_that_fall_on_one_another_share_a_text() -> None:
    texts, *_ = written([[Mark(40.0, 60.0, "1", "blue"), Mark(40.0, 60.0, "2", "blue")]])
    assert [text.get_text() for text in texts] == ["1, 2"]
    texts, *_ = written([[Mark(40.0, 60.0, "1", "blue")], [Mark(40.0, 60.0, "2", "red")]])
    assert sorted(text.get_text() for text in texts) == ["1", "2"]


def test_no_other_curve_passes_between_a_value_and_its_point() -> None:
    """A curve just above the point: the value stands below."""
    curves = [
        [Mark(50.0, 50.0, "1", "blue")],
        [Mark(20.0, 53.0, "", "red"), Mark(80.0, 53.0, "", "red")],
    ]
    (text,), (box,), at, _ = written(curves)
    assert text.get_text() == "1"
    assert box.y1 < at[1][1]


def test_points_without_a_value_and_no_points_at_all() -> None:
    assert written([[Mark(50.0, 50.0, "", "blue")]])[0] == []
