"""Placing texts beside points so that none covers another, nor lines and points if possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from evaluation.views.plots.style import SMALL_PT
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Rectangle = tuple[float, float, float, float]
"""Left, low, right, high."""

_REPEAT_COST = 2.0


def place_labels(
    axes: Axes,
    texts: Sequence[tuple[float, float, str]],
    segments: ArrayLike,
    *,
    offsets_pt: Sequence[float],
    leaders: bool = False,
) -> None:
    """Write texts beside their points (x, y) so that none covers another, nor lines and points if possible.

    The limits of the axes must be final. A text that repeats one already written is left out where there is
    no free room right beside its point.

    Args:
        axes: where to write.
        texts: x, y and text, in data coordinates.
        segments: (L, 2, 2) both ends of lines to keep clear of, in data coordinates.
        offsets_pt: distances above and below the point that may be used, nearest first.
        leaders: whether texts away from their point get a thin line to it.
    """
    from matplotlib.patheffects import withStroke
    from matplotlib.text import Text

    to_pixel = axes.transData.transform
    scale = axes.figure.dpi / 72.0
    points = to_pixel(np.array([text[:2] for text in texts]).reshape(-1, 2))
    lines = to_pixel(np.asarray(segments, dtype=np.float64).reshape(-1, 2)).reshape(-1, 2, 2)
    taken: list[Rectangle] = []
    written: set[str] = set()
    names = [name for _, _, name in texts]
    # Each different text finds its place before any is repeated.
    for index in sorted(range(len(texts)), key=lambda index: names.index(names[index]) != index):
        x, y, text = texts[index]
        label = axes.annotate(
            text, (x, y), textcoords="offset points", xytext=(0, 0), fontsize=SMALL_PT, zorder=8, gid="label"
        )
        # A white rim keeps the text readable where it cannot keep clear of a line.
        label.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
        extent = Text.get_window_extent(label)
        offsets = [offset * scale for offset in offsets_pt]
        cost, away, best = min(
            (liking + _cost(box, index, axes, taken, lines, points), liking, box)
            for liking, box in _candidates(points[index], extent.width, extent.height, offsets, scale)
        )
        if text in written and cost >= _REPEAT_COST:
            label.remove()
            continue
        label.set_position(((best[0] - points[index][0]) / scale, (best[1] - points[index][1]) / scale))
        label.set_verticalalignment("bottom")
        taken.append(best)
        written.add(text)
        if leaders and away >= 2.0:
            ends = axes.transData.inverted().transform([points[index], _nearest(points[index], best)])
            axes.plot(ends[:, 0], ends[:, 1], color="#555555", linewidth=0.5, zorder=7, gid="leader")


def _candidates(
    point: FloatArray, width: float, height: float, offsets: Sequence[float], scale: float
) -> Iterator[tuple[float, Rectangle]]:
    """Boxes (left, low, right, high) in pixels where a text may stand, with how little each is liked."""
    nudge, shift = 4.0 * scale, 45.0 * scale
    lefts = [
        (0.0, point[0] + nudge),
        (0.5, point[0] - nudge - width),
        (1.0, point[0] - width / 2),
        *((1.5 + steps, point[0] + nudge + steps * shift) for steps in (1, 2, 3)),
        *((2.0 + steps, point[0] - nudge - width - steps * shift) for steps in (1, 2, 3)),
    ]
    for rank, offset in enumerate(offsets):
        for below, centre in ((0.0, point[1] + offset), (0.2, point[1] - offset)):
            for side, left in lefts:
                low = centre - height / 2
                box = (float(left), float(low), float(left + width), float(low + height))
                yield 2.0 * rank + below + side, box


def _cost(
    box: Rectangle,
    index: int,
    axes: Axes,
    taken: Sequence[Rectangle],
    lines: FloatArray,
    points: FloatArray,
) -> float:
    """How much a text in this box would hide or stick out, or its leader to `points[index]` would cross."""
    frame = axes.bbox
    outside = box[0] < frame.x0 or box[2] > frame.x1 or box[1] < frame.y0 or box[3] > frame.y1
    covered = np.all((points >= box[:2]) & (points <= box[2:]), axis=1)
    leader = np.array([[points[index], _nearest(points[index], box)]])
    return float(
        40.0 * sum(_crossings(other, leader) for other in taken)
        + 1000.0 * sum(_overlap(box, other) for other in taken)
        + 200.0 * outside
        + 10.0 * min(_crossings(box, lines), 6)
        + 15.0 * min(int(covered.sum()), 4)
    )


def _overlap(one: Rectangle, two: Rectangle) -> bool:
    gap = 6.0  # pixels, about 2 pt
    return one[0] < two[2] + gap and two[0] < one[2] + gap and one[1] < two[3] + gap and two[1] < one[3] + gap


def _nearest(point: FloatArray, box: Rectangle) -> FloatArray:
    """Point of a box that is nearest to a point."""
    nearest: FloatArray = np.clip(point, box[:2], box[2:])
    return nearest


def _crossings(box: Rectangle, lines: FloatArray) -> int:
    """Number of line pieces (L, 2, 2) that pass through a box, by clipping each at its four sides."""
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (np.array(box[:2]) - start) / step, (np.array(box[2:]) - start) / step
    inside = (start >= box[:2]) & (start <= box[2:])
    still = step == 0.0
    enter = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(near, far)).max(axis=1, initial=0.0)
    leave = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(near, far)).min(axis=1, initial=1.0)
    return int(np.count_nonzero(enter <= leave))
