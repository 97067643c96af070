"""The check of figures finds what is wrong with a figure, and nothing in one that is in order."""

from typing import Any

import pytest
from matplotlib.figure import Figure

from tests.figures import labelled_curves, text_faults, unseen


@pytest.fixture
def axes() -> Any:
    """In the middle of a figure of 400 x 300 pixels, with room around them."""
    axes = Figure(figsize=(4, 3), dpi=100).add_axes((0.25, 0.25, 0.5, 0.5))
    axes.set_title("heading")
    axes.set_xlabel("along")
    axes.set_ylabel("up")
    return axes


def test_a_usual_figure_is_in_order(axes: Any) -> None:
    axes.plot([0, 1], [0, 1], label="curve")
    axes.text(0.2, 0.7, "inside")
    axes.figure.legend(loc="lower right")
    assert text_faults(axes.figure) == []


def test_texts_over_one_another(axes: Any) -> None:
    axes.text(0.5, 0.5, "one")
    axes.text(0.52, 0.52, "two")
    assert text_faults(axes.figure) == ["'one' overlaps 'two'"]


def test_tick_labels_that_run_together(axes: Any) -> None:
    axes.set_xticks([0.4, 0.5], ["a_weather_of_my_own", "another_weather"])
    assert text_faults(axes.figure) == ["'a_weather_of_my_own' overlaps 'another_weather'"]


def test_ticks_out_of_view_are_not_drawn(axes: Any) -> None:
    axes.set_xticks([0.5, 5.0, 5.0], ["seen", "beyond", "as well"])
    axes.set_xlim(0.0, 1.0)
    assert text_faults(axes.figure) == []


def test_a_title_that_the_edge_cuts(axes: Any) -> None:
    axes.set_title("a heading that is much longer than the paper on which it is to be printed is wide")
    axes.set_yticks([])
    (fault,) = text_faults(axes.figure)
    assert fault.endswith("is cut by the edge of the figure")


def test_a_legend_over_the_title(axes: Any) -> None:
    axes.plot([0, 1], [0, 1], label="curve")
    axes.figure.legend(loc="upper center", bbox_to_anchor=(0.5, 0.88))
    assert "'heading' overlaps the legend" in text_faults(axes.figure)


def test_a_legend_over_a_curve(axes: Any) -> None:
    axes.plot([0.5], [0.5], label="curve")
    axes.legend(loc="center")
    assert text_faults(axes.figure) == ["the legend covers a point of a curve"]
    axes.legend(loc="upper left")
    assert text_faults(axes.figure) == []


def test_a_text_in_the_frame_of_other_axes(axes: Any) -> None:
    other = axes.figure.add_axes((0.8, 0.25, 0.15, 0.5))
    other.set_title("other")
    other.set_xticks([])
    other.set_yticks([0.5], ["a long value"])
    assert "'a long value' reaches into the frame of axes 'heading'" in text_faults(axes.figure)


def test_a_text_across_its_own_frame(axes: Any) -> None:
    axes.text(0.9, 0.5, "across the frame")
    assert text_faults(axes.figure) == ["'across the frame' crosses the frame of axes 'heading'"]


def test_what_is_hidden_is_no_fault(axes: Any) -> None:
    axes.text(0.5, 0.5, "one")
    axes.text(0.5, 0.5, "two").set_visible(False)
    axes.text(0.5, 0.5, " ")
    axes.text(3.0, 3.0, "clipped", clip_on=True)
    hidden = axes.figure.add_axes((0.25, 0.25, 0.5, 0.5))
    hidden.set_axis_off()
    assert text_faults(axes.figure) == []


def test_a_curve_under_another_is_not_seen(axes: Any) -> None:
    axes.plot([0, 1], [0, 1], label="below", color="blue")
    axes.plot([0, 1], [0, 1], label="above", color="red")
    axes.plot([0, 1], [1, 0], label="elsewhere", color="blue")
    curves = labelled_curves(axes.figure)
    assert unseen(axes.figure, curves) == ["below"]
    curves[0].set_linewidth(8.0)
    assert unseen(axes.figure, curves) == []
