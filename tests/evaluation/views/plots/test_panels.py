"""Figures of panels: nothing meets, whatever stands around them; names at the ends of curves stand apart."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.lines import Line2D

from evaluation.views.plots.panels import CurveName, draw_band, hidden_by, name_curves, panel_page, spread
from tests.figures import text_faults

NAMES = ["rectangular", "map", "all", *(f"my_package.monitored.areas:variant_{k}_wide" for k in range(5))]


def handles(count: int) -> list[Line2D]:
    return [Line2D([], [], label=name) for name in NAMES[:count]]


@pytest.mark.parametrize("count", [0, 3, 8])
@pytest.mark.parametrize("columns", [1, 3])
def test_title_panels_legend_and_note_keep_apart(count: int, columns: int) -> None:
    page = panel_page(
        2, columns, entries=handles(count), title="a title of many words " * (count + 1),
        note="a note of many words " * 3 * count,
    )  # fmt: skip
    for axes in page.axes:
        axes.plot([0.0, 1e4], [0.0, 1e6])
        axes.set_xlabel("along (m)")
        axes.set_ylabel("up (m)")
        axes.set_title("heading")
    assert text_faults(page.figure) == []
    assert len(page.axes) == 2 * columns
    heights = [axes.get_window_extent().height / page.figure.dpi for axes in page.axes]
    assert min(heights) > 1.0  # of 1.9 with ticks and labels


def test_a_band_spans_its_interval() -> None:
    (axes,) = panel_page(1, 1).axes
    draw_band(axes, [0.0, 1.0, 2.0], [1.0, np.nan, 1.0], [2.0, np.nan, 3.0], "#0072b2")
    draw_band(axes, [0.0, 1.0], [1.0, 2.0], [2.0, 4.0], "#0072b2")
    (band,) = axes.collections[1].get_paths()
    assert band.get_extents().bounds == (0.0, 1.0, 1.0, 3.0)


def test_curves_under_others_are_counted() -> None:
    rise, fall = [(0.0, 0.0), (1.0, 1.0)], [(0.0, 1.0), (1.0, 0.0)]
    assert hidden_by([rise, fall, rise, rise], 0.01) == [2, 0, 1, 0]
    assert hidden_by([[(0.0, 0.0)], rise], 0.01) == [1, 0]
    assert hidden_by([rise, [(0.0, 0.0)]], 0.01) == [0, 0]
    assert hidden_by([[(0.0, 0.0), (1.0, np.nan)], [(0.0, 0.001)]], 0.01) == [1, 0]


@pytest.mark.parametrize("ends", [(0.1, 0.5, 0.9), (0.5,) * 8, (0.0, 0.0, 1.0, 1.0), (1.0,) * 8])
def test_names_of_curves_stand_apart_at_the_right(ends: tuple[float, ...]) -> None:
    page = panel_page(1, 1, panel_in=2.4)
    (axes,) = page.axes
    for end in ends:
        axes.plot([0.0, 1.0], [0.5, end])
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    name_curves(axes, [CurveName(1.0, end, NAMES[k], "#000000") for k, end in enumerate(ends)])
    assert text_faults(page.figure) == []
    assert sorted(text.get_text() for text in axes.texts) == sorted(NAMES[: len(ends)])


def test_a_name_with_room_stands_at_its_curve() -> None:
    (axes,) = panel_page(1, 1).axes
    axes.set_ylim(0.0, 1.0)
    name_curves(axes, [CurveName(1.0, 0.2, "low", "#000000"), CurveName(1.0, 0.8, "high", "#000000")])
    assert [tuple(text.get_position()) for text in axes.texts] == [(5.0, 0.0), (5.0, 0.0)]


LENGTHS = st.lists(st.tuples(st.floats(-5, 15), st.floats(0.1, 3)), min_size=1, max_size=8)


@given(LENGTHS)
def test_spread_items_touch_at_most_and_keep_their_order(items: Any) -> None:
    wanted, sizes = np.array(items).T
    places = spread(wanted, sizes, 0.0, 10.0)
    order = np.argsort(wanted, kind="stable")
    gaps = np.diff(places[order]) - (sizes[order][1:] + sizes[order][:-1]) / 2
    assert (gaps >= -1e-9).all()
    assert (places - sizes / 2 >= -1e-9).all()
    if sizes.sum() <= 10.0:
        assert (places + sizes / 2 <= 10.0 + 1e-9).all()


def test_spread_by_hand() -> None:
    """Two that want the same place share it; one with room stays; none of nothing."""
    assert spread(np.array([5.0, 5.0, 9.0]), np.full(3, 2.0), 0.0, 10.0).tolist() == [4.0, 6.0, 9.0]
    assert spread(np.array([0.0, 0.0]), np.full(2, 2.0), 0.0, 10.0).tolist() == [1.0, 3.0]
    assert spread(np.array([9.0, 1.0]), np.full(2, 2.0), 0.0, 10.0).tolist() == [9.0, 1.0]
    assert spread(np.empty(0), np.empty(0), 0.0, 1.0).tolist() == []
