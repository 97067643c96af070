"""Figures of the comparison."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evaluation.pictures import STAMPS
from evaluation.plots.style import (
    BLACK,
    BLUE,
    FONT_PT,
    GREY,
    SMALL_PT,
    VERMILLION,
    LineStyle,
    new_figure,
    set_style,
    set_title,
)
from evaluation.settings import PARAMETERS, setting_text
from evaluation.study.answer import Curve, curves
from evaluation.study.grid import Point
from evaluation.study.intervals import Estimate
from evaluation.study.table import Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

COLOURS = {"rectangular": VERMILLION, "map": BLUE, "all": BLACK}
MARKERS = {"rectangular": "s", "map": "o", "all": "D"}
FORMATS = ("png", "svg")


def frontier(rows: Sequence[Summary], points: Sequence[Point], title: str) -> Figure:
    """Avoidance against false stops: a curve per strategy, the width of its area along it.

    Left, false stops are emergency requests; right, standstills by mere speed adaptation count as well.
    Better is up and to the left. The paper's own widths are ringed.

    Args:
        rows: summaries of one weather, with scenes of both kinds.
        points: that they are of.
        title: what was run.
    """
    found = curves(rows, points)
    figure = new_figure(_HEIGHT_IN)
    figure.set_size_inches(_WIDTH_IN, _HEIGHT_IN)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.subplots_adjust(left=0.075, right=0.985, bottom=0.33, top=0.87, wspace=0.05)
    drawn: list[list[list[Mark]]] = []
    for axes, name, label, heading in (
        (panels[0], "false_stops", "runs with an emergency stop (%)", "Emergency stops for nobody"),
        (
            panels[1],
            "needless_stops",
            "runs with an emergency stop or a standstill (%)",
            "All stops for nobody",
        ),
    ):
        set_style(axes)
        set_title(axes, heading, room=40)
        axes.set_xlabel(label, fontsize=SMALL_PT)
        styles: dict[str, int] = {}
        lines: list[list[Mark]] = []
        for curve in found:
            styles[curve.strategy] = styles.get(curve.strategy, -1) + 1
            lines.append(_curve(axes, curve, name, styles[curve.strategy]))
        drawn.append(lines)
    panels[0].set_ylabel("contacts avoided (%)", fontsize=SMALL_PT)
    most = max(mark.x for lines in drawn for line in lines for mark in line)
    panels[0].set_xlim(-6.0, min(max(most * 1.12, 30.0), 106.0))
    panels[0].set_ylim(-2.0, 109.0)
    panels[0].set_yticks(range(0, 101, 20))
    for axes, lines in zip(panels, drawn, strict=True):
        _write_values(figure, axes, lines)
    figure.suptitle(title, fontsize=FONT_PT, y=0.985)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower center", ncols=2, fontsize=SMALL_PT, frameon=False,
        bbox_to_anchor=(0.5, 0.105), columnspacing=3.0,
    )  # fmt: skip
    widths = {curve.strategy: PARAMETERS[curve.parameter] for curve in found if curve.parameter}
    told = "; ".join(f"{strategy}: {width.text} ({width.unit})" for strategy, width in widths.items())
    count = f"{rows[0].avoided.count} runs that ask for braking, {rows[0].false_stops.count} that do not"
    figure.text(
        0.5, 0.015,
        f"Numbers along the curves: {told}. Ringed: the paper's.\n"
        f"Each point: {count}. Bars: 95 % intervals over the scenes. Up and to the left is better.",
        ha="center", va="bottom", fontsize=SMALL_PT - 1.0, color="#444444",
    )  # fmt: skip
    return figure


_WIDTH_IN, _HEIGHT_IN = 7.0, 3.9
"""Across both columns of a paper."""
_LINES: tuple[LineStyle, ...] = ("-", "--", ":")
PAPER_WIDTHS = {"map": 1.8, "rectangular": 2.6}
"""Width of each strategy's area in the paper and in its authors' code, metres."""
_NAMES = {
    "rectangular": "rectangle (baseline)",
    "map": "map",
    "all": "no area (control)",
    "ego_forecast=ctrv": "ego expected to keep its turn rate",
    "ego_forecast=route": "ego expected along its route",
}


class Mark(NamedTuple):
    """A point of a curve, in percent, and the value written beside it."""

    x: float
    y: float
    text: str
    colour: str


def _name(curve: Curve) -> str:
    """The curve in words, as far as there are any."""
    settings = (setting_text(name, value) for name, value in curve.rest)
    return ", ".join(_NAMES.get(text, text) for text in (curve.strategy, *settings))


def _curve(axes: Axes, curve: Curve, name: str, style: int) -> list[Mark]:
    """Draw a curve; the first of a strategy is solid and filled, others are dashed and open."""
    colour = COLOURS.get(curve.strategy, GREY)
    rates: list[Estimate] = [getattr(row, name) for row in curve.rows]
    avoided = [row.avoided for row in curve.rows]
    x, y = [100 * rate.value for rate in rates], [100 * rate.value for rate in avoided]
    axes.errorbar(
        x, y,
        xerr=[[100 * (r.value - r.low) for r in rates], [100 * (r.high - r.value) for r in rates]],
        yerr=[[100 * (r.value - r.low) for r in avoided], [100 * (r.high - r.value) for r in avoided]],
        fmt="none", ecolor=colour, elinewidth=0.6, alpha=0.22, zorder=2,
    )  # fmt: skip
    axes.plot(
        x, y,
        color=colour, linestyle=_LINES[style % len(_LINES)], linewidth=1.3, zorder=3, label=_name(curve),
        marker=MARKERS.get(curve.strategy, "o"), markersize=4.5,
        markerfacecolor="white" if style else colour,
    )  # fmt: skip
    ringed = [k for k, value in enumerate(curve.values) if value == PAPER_WIDTHS.get(curve.strategy)]
    axes.plot(
        [x[k] for k in ringed], [y[k] for k in ringed],
        linestyle="none", marker="o", markersize=9.5, markerfacecolor="none", markeredgecolor=colour,
        markeredgewidth=0.8, zorder=4,
    )  # fmt: skip
    values = [f"{value:g}" for value in curve.values] or [""] * len(x)
    return [Mark(*mark, colour) for mark in zip(x, y, values, strict=True)]


_PLACES = (
    (6, -7), (-6, 8), (6, 8), (-6, -7), (11, 0), (-11, 0), (0, 12), (0, -12), (14, -12), (-14, 12),
    (14, 12), (-14, -12), (20, 0), (-20, 0), (0, 20), (0, -20),
)  # fmt: skip
"""Where a value may stand beside its point, in points (1/72 inch), the best first."""


def _write_values(figure: Figure, axes: Axes, lines: Sequence[Sequence[Mark]]) -> None:
    """Values beside their points, where they cover neither a curve nor one another nor the frame.

    Points that fall on one another share a text.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.transforms import Bbox

    assert isinstance(figure.canvas, FigureCanvasAgg)
    renderer = figure.canvas.get_renderer()  # type: ignore[no-untyped-call]
    taken: list[Bbox] = []
    written: list[Bbox] = []
    for line in lines:
        corners = axes.transData.transform([(mark.x, mark.y) for mark in line])
        ways = [np.linspace(a, b, 40) for a, b in pairwise(corners)]
        for points, half_pt in ((corners, 3.2), (np.concatenate([corners[:0], *ways]), 0.8)):
            half = half_pt * figure.dpi / 72
            taken += [Bbox.from_extents(*(at - half), *(at + half)) for at in points]
    marks = [mark for line in lines for mark in line]
    frame = axes.get_window_extent(renderer)
    together: dict[tuple[float, float, str], list[str]] = {}
    for mark in marks:
        if mark.text:
            together.setdefault((round(mark.x, 1), round(mark.y, 1), mark.colour), []).append(mark.text)
    for (x, y, colour), values in together.items():
        text = axes.annotate(
            ", ".join(dict.fromkeys(values)), (x, y), textcoords="offset points", xytext=_PLACES[0],
            ha="center", va="center", fontsize=SMALL_PT - 1, color=colour, zorder=5,
        )  # fmt: skip

        def cost(place: tuple[int, int], text: Annotation = text) -> tuple[bool, int, int]:
            """Whether a place is outside, how many values it covers, how many points and pieces of curves."""
            _put(text, place)
            box = text.get_window_extent(renderer)
            inside = frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1
            return not inside, box.count_overlaps(written), box.count_overlaps(taken)

        _put(text, min(_PLACES, key=cost))
        written.append(text.get_window_extent(renderer))


def _put(text: Annotation, place: tuple[int, int]) -> None:
    dx, _ = place
    text.set_horizontalalignment("left" if dx > 0 else "right" if dx < 0 else "center")
    text.set_position(place)


def ablation(rows: Sequence[Summary], title: str) -> Figure:
    """Change of avoidance and of false stops when one choice is changed; a line per choice and strategy."""
    base = {row.strategy: row for row in rows if not row.settings}
    changed = [row for row in rows if row.settings and row.strategy in base]
    figure = new_figure(1.3 + 0.17 * len(changed))
    panels = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.37, right=0.98, bottom=0.75 / figure.get_figheight(), wspace=0.12)
    figure.subplots_adjust(top=1 - 0.55 / figure.get_figheight())
    height = list(range(len(changed)))[::-1]
    for axes, name, label in zip(
        panels,
        ("avoided", "false_stops"),
        ("contacts avoided", "false emergency stops"),
        strict=True,
    ):
        set_style(axes)
        axes.axvline(0.0, color=GREY, linewidth=0.8)
        for row, y in zip(changed, height, strict=True):
            change = 100 * (getattr(row, name).value - getattr(base[row.strategy], name).value)
            colour = COLOURS.get(row.strategy, GREY)
            axes.plot([0.0, change], [y, y], color=colour, linewidth=1.0)
            axes.plot(change, y, color=colour, marker=MARKERS.get(row.strategy, "o"), markersize=4.0)
        set_title(axes, label, room=34)
        axes.set_xlabel("change, percentage points", fontsize=SMALL_PT)
        axes.margins(x=0.15)
        axes.set_ylim(-0.7, len(changed) - 0.3)
        for y, (row, above) in zip(height[1:], zip(changed[1:], changed, strict=False), strict=True):
            if row.strategy != above.strategy:
                axes.axhline(y + 0.5, color=GREY, linewidth=0.5, linestyle=":")
    panels[0].set_yticks(
        height, [f"{row.strategy}, {row.settings}" for row in changed], fontsize=SMALL_PT - 1
    )
    figure.suptitle(title, fontsize=FONT_PT, y=1 - 0.12 / figure.get_figheight())
    told = ", ".join(
        f"{name} {100 * row.avoided.value:.0f} and {100 * row.false_stops.value:.0f}"
        for name, row in base.items()
    )
    one = [
        f"{100 / rate.count:.1f}" for rate in (changed[0].avoided, changed[0].false_stops) if rate.count
    ] if changed else []  # fmt: skip
    figure.text(
        0.5, 0.05 / figure.get_figheight(),
        f"Against the preset as it is, avoided and false stops (%): {told}.\n"
        f"The same runs on both sides; one run more or less is {' or '.join(one)} points.",
        ha="center", fontsize=SMALL_PT - 1.5, color="#444444",
    )  # fmt: skip
    return figure


def save(figure: Figure, path: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write a figure in several formats, the same bytes every time; returns the files."""
    import matplotlib as mpl

    written = []
    with mpl.rc_context({"svg.hashsalt": "smartmot"}):
        for form in formats:
            target = path.with_suffix(f".{form}")
            figure.savefig(target, format=form, metadata=STAMPS[form])
            written.append(target)
    return written
