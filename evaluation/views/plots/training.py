"""Curves of a training: losses, and how good the boxes of held-out frames are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from evaluation.views.plots.panels import panel_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {"car": "#0b5fa5", "pedestrian": "#c1272d", "cyclist": "#1a7f37"}

SMOOTHED = 50
"""Parts of a training over which losses of single steps are averaged."""


def training_figure(rows: Sequence[dict[str, float]], classes: Sequence[str]) -> Figure:
    """Losses and F1 over steps.

    Args:
        rows: as `training.csv` has them.
        classes: names.
    """
    from matplotlib.lines import Line2D

    names = {"steps": "#888888", "held out": "#222222"} | {name: COLORS[name] for name in classes}
    entries = [Line2D([], [], color=color, label=name) for name, color in names.items()]
    page = panel_page(1, 2, entries=entries, title="Training of the pillar network")
    losses, scores = page.axes
    step = np.array([row["step"] for row in rows])
    loss = np.array([row["loss_scores"] + row["loss_boxes"] for row in rows])
    parts = np.array_split(np.arange(len(rows)), min(SMOOTHED, len(rows)))
    losses.plot([step[p].mean() for p in parts], [loss[p].mean() for p in parts], color=names["steps"])
    seen = [row for row in rows if "loss_held_out" in row]
    at = [row["step"] for row in seen]
    losses.plot(at, [row["loss_held_out"] for row in seen], color=names["held out"], marker="o", markersize=3)
    losses.set_ylim(bottom=0.0)
    losses.set_ylabel("loss per object")
    for name in classes:
        scores.plot(at, [row[f"f1_{name}"] for row in seen], color=names[name], marker="o", markersize=3)
    scores.set_ylim(0.0, 1.0)
    scores.set_ylabel("F1, held-out frames")
    for axes in page.axes:
        axes.set_xlabel("step")
    return page.figure
