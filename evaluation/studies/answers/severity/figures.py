"""Figure of weighed stops: what each side avoids, how often it stops for nothing, and what that weighs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from evaluation.studies.answers.figures import DPI, WIDTH_IN
from evaluation.views.plots.fitting import wrapped
from evaluation.views.plots.style import BLUE, FONT_PT, GREY, SMALL_PT, VERMILLION, plain_figure, set_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from evaluation.metrics.intervals import Estimate
    from evaluation.studies.answers.severity.question import Cost

_NAME_IN = 1.35
"""Width that names of sides may take, inches."""


def severity_rows(costs: Sequence[Cost], where: str) -> Figure:
    """A row per side: collisions avoided; unnecessary stops counted and weighed, each with its interval."""
    figure = plain_figure((WIDTH_IN, 1.0), DPI)
    texts = [wrapped(figure, cost.arm.name, _NAME_IN, SMALL_PT) for cost in costs]
    height_in = 1.35 + 0.27 * len(costs)
    figure.set_figheight(height_in)
    avoided, stops = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(
        left=0.22, right=0.98, bottom=0.72 / height_in, top=1 - 0.55 / height_in, wspace=0.06
    )
    for axes in (avoided, stops):
        set_style(axes)
        axes.set_xlabel("% of the scenes", fontsize=SMALL_PT)
    for row, cost in enumerate(reversed(costs)):
        _mark(avoided, cost.avoided, row, BLUE)
        _mark(stops, cost.stops, row + 0.13, GREY, "counted" if row == 0 else "")
        _mark(stops, cost.weighed, row - 0.13, VERMILLION, "weighed" if row == 0 else "")
    avoided.set_title("collisions avoided", fontsize=FONT_PT, pad=4.0)
    stops.set_title("unnecessary stops", fontsize=FONT_PT, pad=4.0)
    avoided.set_yticks(range(len(costs)), texts[::-1], fontsize=SMALL_PT)
    avoided.set_ylim(-0.6, len(costs) - 0.4)
    marks = stops.get_legend_handles_labels()
    figure.legend(*marks, fontsize=SMALL_PT, loc="upper right", ncols=2, frameon=False)
    figure.text(0.01, 1 - 0.22 / height_in, f"Severity of false activations: {where}", fontsize=FONT_PT)
    figure.text(
        0.5, 0.08 / height_in, "Bars: 95 % intervals over the scenes.", ha="center", fontsize=SMALL_PT - 1.0,
        color="#444444",
    )  # fmt: skip
    return figure


def _mark(axes: Axes, estimate: Estimate, place: float, colour: str, label: str = "") -> None:
    value, low, high = (100 * v for v in (estimate.value, max(estimate.low, 0.0), estimate.high))
    axes.plot([low, high], [place, place], color=colour, linewidth=2.0, alpha=0.4)
    axes.plot(value, place, marker="o", markersize=4.0, color=colour, linestyle="none", label=label or None)
