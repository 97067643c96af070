"""Figures of a few panels: what stands around them is measured, so that nothing meets however much it is.

A figure of a study is made in four steps::

    page = panel_page(1, 2, title="...", note="...", entries=handles)   # legend entries, if any
    draw_band(page.axes[0], x, low, high, colour)                       # an interval, then its curve
    name_curves(page.axes[0], [CurveName(x[-1], y[-1], "map", colour)])  # instead of a legend
    save_picture(page.figure, path, "--out")
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from evaluation.views.plots.fitting import fitted, text_size_in, wrapped
from evaluation.views.plots.style import FONT_PT, SMALL_PT, WIDTH_IN, new_figure, set_style
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_EDGE_IN, _BETWEEN_IN = 0.06, 0.09
"""Free paper at the edge of a figure, and between title, panels, legend and note."""
_HANDLE_IN, _COLUMN_GAP_IN, _LEGEND_LINE_IN = 0.34, 0.28, 0.165
"""A legend's entry has a line or mark of this width beside its text; between columns; height of a line."""
_NOTE_PT = SMALL_PT - 1.5
_BAND_ALPHA = 0.18
_NAME_GAP_PT = 5.0
"""Between the end of a curve and its name."""


@dataclass(frozen=True, slots=True)
class PanelPage:
    """A figure and its panels, line by line.

    Args:
        figure: its layout follows what is drawn in the panels, ticks and labels too.
        axes: the panels.
    """

    figure: Figure
    axes: tuple[Axes, ...]


def panel_page(
    lines: int,
    columns: int,
    *,
    width_in: float = WIDTH_IN,
    panel_in: float = 1.9,
    title: str = "",
    note: str = "",
    entries: Sequence[Artist] = (),
    share_x: bool = False,
    share_y: bool = False,
) -> PanelPage:
    """An empty figure of panels, as tall as title, panels, legend and note need.

    Args:
        lines: panels above one another.
        columns: panels side by side.
        width_in: of the figure, inches.
        panel_in: height of each panel with its ticks, labels and heading, inches.
        title: above all; long ones get smaller and more lines.
        note: below all, in small grey letters, wrapped.
        entries: labelled artists of the legend between panels and note, in as many columns as fit.
        share_x: whether all panels have one scale along.
        share_y: whether all panels have one scale up.
    """
    figure = new_figure(1.0)
    room = width_in - 2 * _EDGE_IN
    figure.set_size_inches(width_in, 1.0)
    head = fitted(figure, title, room, FONT_PT)
    head_in = text_size_in(figure, head.text, head.size_pt)[1]
    foot = wrapped(figure, note, room, _NOTE_PT)
    foot_in = text_size_in(figure, foot, _NOTE_PT)[1]
    legend_columns = _legend_columns(figure, [str(entry.get_label()) for entry in entries], room)
    legend_in = _LEGEND_LINE_IN * math.ceil(len(entries) / legend_columns)
    parts = [part + _BETWEEN_IN if part else 0.0 for part in (head_in, legend_in, foot_in)]
    height = sum(parts) + lines * panel_in + 2 * _EDGE_IN
    figure.set_size_inches(width_in, height)
    low, high = (_EDGE_IN + parts[1] + parts[2]) / height, 1.0 - (_EDGE_IN + parts[0]) / height
    figure.set_layout_engine(
        "constrained", rect=(0.0, low, 1.0, high - low), w_pad=_EDGE_IN, h_pad=0.03, wspace=0.02, hspace=0.02
    )
    axes = figure.subplots(lines, columns, sharex=share_x, sharey=share_y, squeeze=False)
    for panel in axes.flat:
        set_style(panel)
    if title:
        figure.text(
            0.5, 1.0 - _EDGE_IN / height, head.text, ha="center", va="top", fontsize=head.size_pt,
            in_layout=False,
        )  # fmt: skip
    if entries:
        legend = figure.legend(
            handles=list(entries), loc="lower center", ncols=legend_columns, fontsize=SMALL_PT,
            frameon=False, bbox_to_anchor=(0.5, (_EDGE_IN + parts[2]) / height), borderaxespad=0.0,
            borderpad=0.0, labelspacing=0.4, handlelength=2.0, columnspacing=1.6,
        )  # fmt: skip
        legend.set_in_layout(False)
    if note:
        figure.text(
            0.5, _EDGE_IN / height, foot, ha="center", va="bottom", fontsize=_NOTE_PT, color="#444444",
            in_layout=False,
        )  # fmt: skip
    return PanelPage(figure, tuple(axes.flat))


def _legend_columns(figure: Figure, labels: Sequence[str], room_in: float) -> int:
    """How many columns of a legend fit a width."""
    widths = [text_size_in(figure, label, SMALL_PT)[0] + _HANDLE_IN for label in labels]
    for columns in range(len(labels), 1, -1):
        lines = math.ceil(len(labels) / columns)
        each = [max(widths[k : k + lines]) for k in range(0, len(widths), lines)]
        if sum(each) + _COLUMN_GAP_IN * (len(each) - 1) <= room_in:
            return columns
    return 1


def draw_band(axes: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, colour: str) -> None:
    """An interval around a curve, in its colour and without an edge.

    Args:
        axes: where to draw.
        x: (N,) along.
        low: (N,) where the interval begins; not a number: there is none.
        high: (N,) where it ends.
        colour: of the curve.
    """
    axes.fill_between(
        np.asarray(x, dtype=float), np.asarray(low, dtype=float), np.asarray(high, dtype=float),
        color=colour, alpha=_BAND_ALPHA, linewidth=0.0, zorder=1.5, gid="band",
    )  # fmt: skip


def hidden_by(curves: Sequence[ArrayLike], same: float) -> list[int]:
    """How many of the curves drawn after each one lie on all of its points.

    Who draws a curve wider and with larger marks for each of them keeps it visible.

    Args:
        curves: (N, 2) points of each curve in the order of drawing; what is not a number is no point.
        same: coordinates nearer than this are equal.
    """
    points = [np.asarray(curve, dtype=np.float64).reshape(-1, 2) for curve in curves]
    points = [curve[~np.isnan(curve).any(axis=1)] for curve in points]

    def lies_on(above: FloatArray, below: FloatArray) -> bool:
        near = np.abs(below[:, None] - above[None]) < same
        return bool(near.all(axis=-1).any(axis=-1).all())

    return [sum(lies_on(above, below) for above in points[k + 1 :]) for k, below in enumerate(points)]


class CurveName(NamedTuple):
    """The last point of a curve, in data coordinates, with what is written to the right of it."""

    x: float
    y: float
    text: str
    colour: str


def name_curves(axes: Axes, names: Sequence[CurveName], size_pt: float = SMALL_PT) -> None:
    """Write names to the right of the panel, beside the ends of their curves, in their colours.

    Names whose curves end near one another move up or down until none covers another; a thin line joins
    such a name to its curve. The limits of the axes must be final; call this last, and for the rightmost
    panels only: their names reserve the paper that they need.

    Args:
        axes: whose right edge the names stand at.
        names: of the curves.
        size_pt: of the letters.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    right = axes.get_xlim()[1]
    joint = {"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0}
    texts = [
        axes.annotate(
            name.text, (right, name.y), textcoords="offset points", xytext=(_NAME_GAP_PT, 0.0), ha="left",
            va="center", fontsize=size_pt, color=name.colour, annotation_clip=False, gid="name",
            arrowprops={**joint, "color": name.colour},
        )
        for name in names
    ]  # fmt: skip
    figure.draw_without_rendering()  # the panel has its height now
    scale = 72.0 / figure.dpi
    ends = np.array([axes.transData.transform((right, name.y))[1] for name in names]) * scale
    heights = np.array([text_size_in(figure, name.text, size_pt)[1] for name in names]) * 72.0
    low, high = axes.bbox.y0 * scale, axes.bbox.y1 * scale
    places = spread(ends, heights + 1.0, low, high)
    for text, end, place in zip(texts, ends.tolist(), places.tolist(), strict=True):
        moved = abs(place - end) > 1.0
        text.set_position((_NAME_GAP_PT * (2.5 if moved else 1.0), place - end))


def spread(wanted: FloatArray, sizes: FloatArray, low: float, high: float) -> FloatArray:
    """Places in order of what is wanted that overlap nowhere and lie as near to it as they can.

    Blocks of touching items are put at the mean of what their items want: the least squares solution
    (pool adjacent violators).

    Args:
        wanted: (N,) middle of each item.
        sizes: (N,) length of each item.
        low: where the first may begin; without room for all they go beyond `high`.
        high: where the last may end.

    Returns:
        (N,) middle of each item.
    """
    order = np.argsort(wanted, kind="stable")
    size = sizes[order]
    # measured from the middle of the first item, all items touching: what is left to choose rises only
    offsets = np.concatenate([[0.0], np.cumsum((size[1:] + size[:-1]) / 2)]) if len(size) else np.empty(0)
    blocks: list[tuple[float, int]] = []
    for start in (wanted[order] - offsets).tolist():
        blocks.append((start, 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (a, n), (b, m) = blocks[-2:]
            blocks[-2:] = [((a * n + b * m) / (n + m), n + m)]
    starts = np.array([start for start, count in blocks for _ in range(count)])
    if len(size):
        least, most = low + size[0] / 2, high - offsets[-1] - size[-1] / 2
        starts = np.clip(starts, least, max(most, least))
    places = np.empty(len(wanted))
    places[order] = starts + offsets
    return places
