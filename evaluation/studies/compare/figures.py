"""Figures of the comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evaluation.metrics.intervals import Estimate
from evaluation.results.files import write_bytes
from evaluation.studies.compare.answer import Curve, curves
from evaluation.studies.compare.grid import FAIR, Point
from evaluation.studies.compare.table import Summary
from evaluation.views.pictures import drawn
from evaluation.views.plots.fitting import fitted, wrapped
from evaluation.views.plots.labels import Mark, write_values
from evaluation.views.plots.panels import hidden_by, panel_page
from evaluation.views.plots.strategies import strategy_looks
from evaluation.views.plots.style import FONT_PT, GREY, SMALL_PT, LineStyle, new_figure, set_style
from scenarios.settings import PARAMETERS, setting_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")

_WIDTH_IN, _HEIGHT_IN = 7.0, 3.9
"""Across both columns of a paper."""
_LEGEND_IN = 0.165
"""Height of a line of the legend."""
_NOTE_LINE_IN = 0.125
"""Height of a line of the note below."""
_LINES: tuple[LineStyle, ...] = ("-", "--", ":")
_MARKER_PT, _LINE_PT, _WIDER_PT = 4.5, 1.3, 3.0
"""Size of markers, width of lines, and how much both grow for each curve that would hide a curve."""
_RIM_PT = 1.0
"""Of free paper around a marker, which no text should cover."""
_SAME = 0.005
"""Shares nearer than this fall on one another."""
PAPER_WIDTHS = {"map": 1.8, "rectangular": 2.6}
"""Width of each strategy's area in the paper and in its authors' code, metres."""
_CHOICE_IN, _CHOICE_LINE_IN = 2.0, 0.17
"""Width that names of changed choices may take, and height of each of their lines, inches."""
_NAMES = {"rectangular": "rectangle", "all": "no area"}
"""What strategies are called here, where they are called otherwise."""

_PANELS = (
    ("false_activations", "false activations (% of nothing scenes)", "False activations"),
    ("needless_stops", "activations or standstills (% of nothing scenes)", "Unnecessary stops"),
)
"""Measure, label of its axis and heading of each panel of `frontier`."""


def _curve_looks(plotted: Sequence[Curve]) -> list[tuple[str, str, int]]:
    """Colour and marker of each curve's strategy, and which of its strategy's curves it is."""
    look = strategy_looks(curve.strategy for curve in plotted)
    seen = [curve.strategy for curve in plotted]
    return [(*look[name], seen[:k].count(name)) for k, name in enumerate(seen)]


def frontier(rows: Sequence[Summary], points: Sequence[Point], title: str) -> Figure:
    """Collisions avoided against unnecessary stops: a curve per strategy, the width of its area along it.

    Left, false activations; right, standstills by speed adaptation count as well.
    Better is up and to the left. The paper's own widths are ringed. Curves are named beside their points, or
    in a legend where a panel has no room for that.

    Args:
        rows: summaries of one weather, with scenes of both kinds.
        points: that they are of.
        title: what was run.
    """
    figure, has_room = _frontier(rows, points, title, is_direct=True)
    return figure if has_room else _frontier(rows, points, title, is_direct=False)[0]


def _note(rows: Sequence[Summary], plotted: Sequence[Curve]) -> str:
    """What the numbers, marks and bars mean."""
    widths = {curve.strategy: PARAMETERS[curve.parameter] for curve in plotted if curve.parameter}
    named = "; ".join(f"{_word(strategy)}: {w.text} ({w.unit})" for strategy, w in widths.items())
    numbers = f"Numbers along the curves: {named}. Ringed: the paper's.\n" if named else ""
    fair = f"{_FAIR}\n" if any(curve.fixed == FAIR for curve in plotted) else ""
    brake, nothing = rows[0].avoided.count, rows[0].false_activations.count
    return (
        f"{fair}{numbers}Each point: {brake} runs in must-brake scenes, {nothing} in nothing scenes. "
        "Bars: 95 % intervals over the scenes. Up and to the left is better."
    )


_FAIR = (
    "Filled: fair, all with the same planned path for forecast, speed adaptation and standing objects. "
    "Open: as the preset has it."
)


def _frontier(
    rows: Sequence[Summary], points: Sequence[Point], title: str, is_direct: bool
) -> tuple[Figure, bool]:
    """The figure with names beside the curves or with a legend, and whether the names have room."""
    plotted = curves(rows, points)
    look = _curve_looks(plotted)
    note = _note(rows, plotted)
    figure = new_figure(_HEIGHT_IN)
    figure.set_size_inches(_WIDTH_IN, _HEIGHT_IN)
    heading = fitted(figure, title, 0.97 * _WIDTH_IN)
    note = wrapped(figure, note, 0.97 * _WIDTH_IN, SMALL_PT - 1.0)
    note_in = _NOTE_LINE_IN * max(0, note.count("\n") - 1)
    entries = 0 if is_direct else math.ceil(len(plotted) / 2)
    lines_below = note_in + _LEGEND_IN * (entries - 2)
    height = _HEIGHT_IN + lines_below + heading.more_in
    figure.set_size_inches(_WIDTH_IN, height)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    bottom, top = (0.33 * _HEIGHT_IN + lines_below) / height, 0.13 * _HEIGHT_IN + heading.more_in
    figure.subplots_adjust(left=0.075, right=0.985, bottom=bottom, top=1.0 - top / height, wspace=0.05)
    drawn: list[list[list[Mark]]] = []
    for axes, (name, label, words) in zip(panels, _PANELS, strict=True):
        set_style(axes)
        axes.set_title(words, fontsize=FONT_PT, pad=4.0)
        axes.set_xlabel(label, fontsize=SMALL_PT)
        # curves that fall on one another stay visible: the lower one is larger and thicker
        shares = [[(getattr(row, name).value, row.avoided.value) for row in curve.rows] for curve in plotted]
        hiding = hidden_by(shares, _SAME)
        drawn.append(
            [
                _curve(axes, curve, name, look[k], hiding[k], _name(curve, plotted))
                for k, curve in enumerate(plotted)
            ]
        )
    panels[0].set_ylabel("avoided (% of must-brake scenes)", fontsize=SMALL_PT)
    most = max(mark.x for lines in drawn for line in lines for mark in line)
    widest = min(max(most * 1.12, 30.0), 106.0)
    panels[0].set_xlim(-0.035 * widest, widest)  # markers at 0 are whole
    panels[0].set_xticks([tick for tick in panels[0].get_xticks() if 0.0 <= tick <= widest])
    panels[0].set_ylim(-2.0, 118.0)
    panels[0].set_yticks(range(0, 101, 20))
    names = [_name(curve, plotted) for curve in plotted] if is_direct else ()
    written = [
        write_values(figure, axes, lines, SMALL_PT - 1, names)
        for axes, lines in zip(panels, drawn, strict=True)
    ]
    figure.suptitle(heading.text, fontsize=heading.size_pt, y=1.0 - 0.015 * _HEIGHT_IN / height)
    if not is_direct:
        handles, labels = panels[0].get_legend_handles_labels()
        legend = figure.legend(
            handles, labels, loc="lower center", ncols=2, fontsize=SMALL_PT, frameon=False,
            bbox_to_anchor=(0.5, (0.105 * _HEIGHT_IN + note_in) / height), columnspacing=3.0,
        )  # fmt: skip
        for line in legend.get_lines():
            line.set(markersize=_MARKER_PT, linewidth=_LINE_PT)
    figure.text(
        0.5, 0.015 * _HEIGHT_IN / height, note, ha="center", va="bottom", fontsize=SMALL_PT - 1.0,
        color="#444444",
    )  # fmt: skip
    return figure, all(written)


def _word(strategy: str) -> str:
    return _NAMES.get(strategy, strategy)


def _name(curve: Curve, plotted: Sequence[Curve]) -> str:
    """The curve in words: where others are fair, fair is left unsaid, and what is not is said."""
    if curve.fixed == FAIR:
        return _word(curve.strategy)
    settings = [setting_text(name, value) for name, value in curve.fixed]
    if not settings and any(other.fixed == FAIR for other in plotted):
        settings = ["as preset"]
    return ", ".join((_word(curve.strategy), *settings))


def _curve(
    axes: Axes, curve: Curve, name: str, look: tuple[str, str, int], hiding: int, label: str
) -> list[Mark]:
    """Draw a curve; the first of a strategy is solid and filled, others are dashed and open.

    Args:
        axes: where to draw.
        curve: points.
        name: what its x axis shows.
        look: colour, marker, and which of its strategy's curves it is.
        hiding: how many curves would hide it.
        label: what it is called.
    """
    colour, marker, style = look
    size_pt = _MARKER_PT + _WIDER_PT * hiding
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
        color=colour, linestyle=_LINES[style % len(_LINES)], label=label, zorder=3,
        linewidth=_LINE_PT + size_pt - _MARKER_PT, marker=marker, markersize=size_pt,
        markerfacecolor="white" if style else colour, clip_on=False,  # marks at 0 are whole
    )  # fmt: skip
    ringed = [k for k, value in enumerate(curve.values) if value == PAPER_WIDTHS.get(curve.strategy)]
    axes.plot(
        [x[k] for k in ringed], [y[k] for k in ringed],
        linestyle="none", marker="o", markersize=size_pt + 5.0, zorder=4,
        markerfacecolor="none", markeredgecolor=colour, markeredgewidth=0.8,
    )  # fmt: skip
    values = [f"{value:g}" for value in curve.values] or [""] * len(x)
    return [Mark(*mark, colour, 0.5 * size_pt + _RIM_PT) for mark in zip(x, y, values, strict=True)]


def ablation(rows: Sequence[Summary], title: str) -> Figure:
    """Change of collisions avoided and of false activations by one changed choice; a line per choice."""
    base = {row.strategy: row for row in rows if not row.settings}
    changed = [row for row in rows if row.settings and row.strategy in base]
    look = strategy_looks(row.strategy for row in changed)
    usual = ", ".join(
        f"{name} {100 * row.avoided.value:.0f} and {100 * row.false_activations.value:.0f}"
        for name, row in base.items()
    )
    one_run = [
        f"{100 / rate.count:.1f}" for rate in (changed[0].avoided, changed[0].false_activations) if rate.count
    ] if changed else []  # fmt: skip
    names = [f"{row.strategy}, {row.settings}" for row in changed]
    names = [wrapped(new_figure(1.0), name, _CHOICE_IN, SMALL_PT - 1) for name in names]
    # rows are as high as their names
    lines = np.array([1.0 + 0.8 * name.count("\n") for name in names])
    height = (lines.sum() - np.cumsum(lines) + (lines - 1.0) / 2).tolist()
    page = panel_page(
        1, 2, panel_in=0.75 + _CHOICE_LINE_IN * float(lines.sum()), share_y=True, title=title,
        note=f"Against the preset as it is, collisions avoided and false activations (%): {usual}.\n"
        f"The same runs on both sides; one run more or less is {' or '.join(one_run)} points.",
    )  # fmt: skip
    measures = (("avoided", "collisions avoided"), ("false_activations", "false activations"))
    for axes, (name, label) in zip(page.axes, measures, strict=True):
        axes.axvline(0.0, color=GREY, linewidth=0.8)
        for row, y in zip(changed, height, strict=True):
            change = 100 * (getattr(row, name).value - getattr(base[row.strategy], name).value)
            colour, marker = look[row.strategy]
            axes.plot([0.0, change], [y, y], color=colour, linewidth=1.0)
            axes.plot(change, y, color=colour, marker=marker, markersize=4.0)
        axes.set_title(label, fontsize=FONT_PT, pad=4.0)
        axes.set_xlabel("change (% points)", fontsize=SMALL_PT)
        axes.margins(x=0.15)
        axes.set_ylim(-0.7, float(lines.sum()) - 0.3)
        for k, (row, below) in enumerate(pairwise(changed)):
            if row.strategy != below.strategy:
                axes.axhline(height[k] - lines[k] / 2, color=GREY, linewidth=0.5, linestyle=":")
    page.axes[0].set_yticks(height, names, fontsize=SMALL_PT - 1)
    return page.figure


def save(figure: Figure, path: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write a figure in several formats, the same bytes every time; returns the files."""
    written = []
    for form in formats:
        target = path.with_suffix(f".{form}")
        write_bytes(target, drawn(figure, form))
        written.append(target)
    return written
