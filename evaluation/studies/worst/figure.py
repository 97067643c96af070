"""The boundary of failure over the two drawn numbers that go with the margin most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evaluation.studies.worst.search import Searched, number_columns
from evaluation.views.plots.style import BLACK, BLUE, SMALL_PT, VERMILLION, plain_figure, set_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEIGHBOURS = 15
"""Scenes nearest to a place that say whether it fails."""
_GRID = 80


def boundary(searched: Searched, across: str, up: str) -> Figure:
    """All scenes that were tried: with a contact or without, and where half of those around have one.

    Args:
        searched: the search.
        across: name of a drawn number.
        up: name of another.
    """
    from scipy.spatial import cKDTree

    figure = plain_figure((5.0, 3.8), 200)
    figure.set_layout_engine("constrained")
    axes = figure.add_subplot()
    set_style(axes)
    cases = [came for _, came in searched.possible]
    columns = number_columns(cases)
    x, y = columns[across], columns[up]
    known = ~(np.isnan(x) | np.isnan(y))
    failed = np.array([came.collided for came in cases])
    for which, colour, marker, text in (
        (known & ~failed, BLUE, ".", "avoided"),
        (known & failed, VERMILLION, "x", "contact"),
    ):
        axes.plot(x[which], y[which], marker, color=colour, markersize=4, label=text, alpha=0.7, lw=0)
    if known.sum() > _NEIGHBOURS and failed[known].any() and not failed[known].all():
        low, high = np.array([[x[known].min(), y[known].min()], [x[known].max(), y[known].max()]])
        scale = np.maximum(high - low, 1e-12)
        tree = cKDTree((np.column_stack((x[known], y[known])) - low) / scale)
        ticks = np.linspace(0.0, 1.0, _GRID)
        grid = np.stack(np.meshgrid(ticks, ticks), axis=-1)
        _, near = tree.query(grid.reshape(-1, 2), _NEIGHBOURS)
        share = failed[known][near].mean(axis=1).reshape(_GRID, _GRID)
        axes.contour(
            low[0] + ticks * scale[0],
            low[1] + ticks * scale[1],
            share,
            levels=[0.5],
            colors=BLACK,
            linewidths=1,
        )
        axes.plot([], [], color=BLACK, lw=1, label=f"half of the {_NEIGHBOURS} nearest have a contact")
        for values, limits in ((x, axes.set_xlim), (y, axes.set_ylim)):
            low_end, high_end = float(values[known].min()), float(values[known].max())
            room = 0.03 * (high_end - low_end)
            limits(low_end - room, high_end + room)
    axes.set_xlabel(_label(across))
    axes.set_ylabel(_label(up))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=SMALL_PT)
    return figure


def _label(name: str) -> str:
    """A drawn number with its unit, which ends its name."""
    units = {"kmh": "km/h", "mps": "m/s", "m": "m", "s": "s", "percent": "%", "deg": "°", "mps2": "m/s²"}
    *words, last = name.split("_")
    return f"{' '.join(words)} ({units[last]})" if words and last in units else name.replace("_", " ")
