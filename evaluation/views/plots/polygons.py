"""Outlines and boxes, drawn as one collection each and named for the legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from evaluation.views.plots.style import LineStyle
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch
    from matplotlib.typing import ColorType

Pose = tuple[float, float, float]
"""x and y in metres and yaw in radians, map frame."""


def draw_polygons(
    axes: Axes,
    outlines: Sequence[FloatArray] | FloatArray,
    label: str,
    *,
    face: ColorType,
    edge: ColorType,
    width: float = 1.0,
    line: LineStyle = "-",
    hatch: str | None = None,
    zorder: float,
) -> Patch:
    """Draw outlines as one collection, named by `gid`; returns a patch for the legend."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Patch

    collection = PolyCollection(
        list(outlines), facecolors=face, edgecolors=edge, linewidths=width, linestyles=line, hatch=hatch,
        zorder=zorder, gid=label,
    )  # fmt: skip
    axes.add_collection(collection, autolim=False)
    return Patch(
        facecolor=face, edgecolor=edge, linestyle=line, linewidth=max(width, 0.6), hatch=hatch, label=label
    )
