"""Figures of the comparison."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
from evaluation.study.answer import Curve, curves
from evaluation.study.grid import Point
from evaluation.study.intervals import Estimate
from evaluation.study.parameters import PARAMETERS
from evaluation.study.table import Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"rectangular": VERMILLION, "map": BLUE, "all": BLACK}
MARKERS = {"rectangular": "s", "map": "o", "all": "D"}
FORMATS = ("png", "svg")


def frontier(rows: Sequence[Summary], points: Sequence[Point], title: str) -> Figure:
    """Avoidance against false stops: a curve per strategy, the width of its area along it.

    Left, false stops are emergency requests; right, standstills by mere speed adaptation count as well.
    Better is up and to the left.

    Args:
        rows: summaries of one weather, with scenes of both kinds.
        points: that they are of.
        title: what was run.
    """
    found = curves(rows, points)
    figure = new_figure(3.75)
    panels = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.1, right=0.985, bottom=0.36, top=0.87, wspace=0.08)
    for axes, name, label, heading in (
        (panels[0], "false_stops", "runs with an emergency stop (%)", "Emergency stops for nobody"),
        (panels[1], "needless_stops", "runs with any stop (%)", "All stops for nobody"),
    ):
        set_style(axes)
        set_title(axes, heading, room=34)
        axes.set_xlabel(label, fontsize=SMALL_PT)
        texts: dict[tuple[float, float], list[tuple[str, str]]] = {}
        styles: dict[str, int] = {}
        for curve in found:
            styles[curve.strategy] = styles.get(curve.strategy, -1) + 1
            _curve(axes, curve, name, styles[curve.strategy], texts)
        axes.margins(0.1)
        axes.set_xlim(left=-4.0)
        _write_values(axes, texts)
    panels[0].set_ylabel("contacts avoided (%)", fontsize=SMALL_PT)
    panels[0].set_ylim(top=107.0)
    figure.suptitle(title, fontsize=FONT_PT, y=0.985)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower center", ncols=2, fontsize=SMALL_PT, frameon=False,
        bbox_to_anchor=(0.5, 0.13),
    )  # fmt: skip
    widths = {curve.strategy: PARAMETERS[curve.parameter] for curve in found if curve.parameter}
    told = "\n".join(f"{strategy}: {width.text} in {width.unit}" for strategy, width in widths.items())
    figure.text(
        0.5, 0.015,
        f"Numbers along the curves, {told}\n"
        "Bars: Wilson's 95 % intervals over all runs. Up and to the left is better.",
        ha="center", va="bottom", fontsize=SMALL_PT - 1.5, color="#444444",
    )  # fmt: skip
    return figure


_LINES: tuple[LineStyle, ...] = ("-", "--", ":")


def _curve(
    axes: Axes, curve: Curve, name: str, style: int, texts: dict[tuple[float, float], list[tuple[str, str]]]
) -> None:
    """Draw a curve; the first of a strategy is solid and filled, others are dashed and open."""
    colour = COLOURS.get(curve.strategy, GREY)
    rates: list[Estimate] = [getattr(row, name) for row in curve.rows]
    avoided = [row.avoided for row in curve.rows]
    x, y = [100 * rate.value for rate in rates], [100 * rate.value for rate in avoided]
    axes.errorbar(
        x, y,
        xerr=[[100 * (r.value - r.low) for r in rates], [100 * (r.high - r.value) for r in rates]],
        yerr=[[100 * (r.value - r.low) for r in avoided], [100 * (r.high - r.value) for r in avoided]],
        fmt="none", ecolor=colour, elinewidth=0.5, alpha=0.25, zorder=2,
    )  # fmt: skip
    axes.plot(
        x, y,
        color=colour, linestyle=_LINES[style % len(_LINES)], linewidth=1.2, zorder=3, label=curve.name,
        marker=MARKERS.get(curve.strategy, "o"), markersize=4.5,
        markerfacecolor="white" if style else colour,
    )  # fmt: skip
    for value, at in zip(curve.values, zip(x, y, strict=True), strict=False):  # none where there is no curve
        texts.setdefault((round(at[0], 1), round(at[1], 1)), []).append((f"{value:g}", colour))


def _write_values(axes: Axes, texts: dict[tuple[float, float], list[tuple[str, str]]]) -> None:
    """Values beside their points; those of points that fall on one another share a text."""
    for (x, y), found in texts.items():
        values = list(dict.fromkeys(value for value, _ in found))
        colour = found[0][1]
        right = colour != COLOURS["map"]
        axes.annotate(
            ", ".join(values), (x, y), textcoords="offset points", xytext=(5, -6) if right else (-4, 6),
            ha="left" if right else "right", va="center", fontsize=SMALL_PT - 1, color=colour, zorder=5,
        )  # fmt: skip


def ablation(rows: Sequence[Summary], title: str) -> Figure:
    """Change of avoidance and of false stops when one choice is changed; a line per choice and strategy."""
    base = {row.strategy: row for row in rows if not row.settings}
    changed = [row for row in rows if row.settings and row.strategy in base]
    figure = new_figure(1.15 + 0.17 * len(changed))
    panels = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(left=0.37, right=0.98, bottom=0.6 / figure.get_figheight(), wspace=0.08)
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
        axes.margins(x=0.15, y=0.03)
    panels[0].set_yticks(
        height, [f"{row.strategy}, {row.settings}" for row in changed], fontsize=SMALL_PT - 1
    )
    figure.suptitle(title, fontsize=FONT_PT, y=1 - 0.12 / figure.get_figheight())
    told = ", ".join(
        f"{name} {100 * row.avoided.value:.0f} and {100 * row.false_stops.value:.0f}"
        for name, row in base.items()
    )
    figure.text(
        0.5, 0.03 / figure.get_figheight() + 0.005, f"Against the preset as it is (%): {told}.",
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
            metadata: dict[str, None] = {"Date": None} if form == "svg" else {}
            figure.savefig(target, format=form, metadata=metadata)
            written.append(target)
    return written
