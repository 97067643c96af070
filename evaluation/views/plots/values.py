"""Values written beside the points of curves, each where it is plain which point it belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PLACES_PT = np.array(
    [
        (away * x, (away + 3.0) * y)
        for away in (7.0, 9.0, 12.0, 16.0, 20.0)
        for x, y in (
            (0.7, -0.7), (-0.7, 0.7), (0.7, 0.7), (-0.7, -0.7), (1, 0), (-1, 0), (0, 1), (0, -1),
            (0.9, -0.4), (-0.9, 0.4), (0.9, 0.4), (-0.9, -0.4),
            (0.3, -1.0), (-0.3, 1.0), (0.3, 1.0), (-0.3, -1.0),
        )
    ]
)  # fmt: skip
"""(P, 2) where a text may stand beside its point, in points (1/72 inch), among equals the best first."""
_POINT_PT, _CURVE_PT = 3.2, 0.8
"""Half the width of points and curves, which no text should cover."""
_CLEAR_PT = 9.0
"""Points that are farther from a text do not matter."""
_PIECES = 40
"""Pieces of the way from one point of a curve to the next."""
_ROUNDS = 4
"""How often every text chooses again, now that the others have chosen."""


class Mark(NamedTuple):
    """A point of a curve, in data coordinates, and the value written beside it."""

    x: float
    y: float
    text: str
    colour: str


@dataclass(frozen=True, slots=True)
class _Drawn:
    """What is drawn already, in pixels.

    Args:
        at: (N, 2) points of all curves.
        line_of: (N,) curve of each.
        values: (N,) value of each.
        pieces: (M, 2) points along the curves.
        piece_of: (M,) curve of each.
        pixel: pixels of a point (1/72 inch).
    """

    at: FloatArray
    line_of: np.ndarray
    values: tuple[str, ...]
    pieces: FloatArray
    piece_of: np.ndarray
    pixel: float

    def room(self, group: Sequence[int]) -> float:
        """Distance from a point to the next one that is not of its group."""
        here = self.at[group[:1]]
        return float(_distance(here, here, np.delete(self.at, group, axis=0)).min(initial=np.inf))


def write_values(figure: Figure, axes: Axes, lines: Sequence[Sequence[Mark]], size_pt: float) -> None:
    """Values beside their points, where they cover neither a curve nor one another nor the frame.

    A value stands nearer to its own point than to any point of another value, if there is a place. Points of
    one colour that fall on one another share a text.

    Args:
        figure: with the canvas on which texts are measured.
        axes: with its final limits.
        lines: points of each curve.
        size_pt: of the texts.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    assert isinstance(figure.canvas, FigureCanvasAgg)
    renderer = figure.canvas.get_renderer()  # type: ignore[no-untyped-call]
    marks = [mark for line in lines for mark in line]
    line_of = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    at: FloatArray = axes.transData.transform([(mark.x, mark.y) for mark in marks])
    drawn = _Drawn(at, line_of, tuple(mark.text for mark in marks), *_pieces(at, line_of), figure.dpi / 72)
    together: dict[tuple[float, float, str], list[int]] = {}
    for k, mark in enumerate(marks):
        if mark.text:
            together.setdefault((round(mark.x, 1), round(mark.y, 1), mark.colour), []).append(k)
    frame = axes.get_window_extent(renderer)
    texts, boxes, costs = [], [], []
    for group in sorted(together.values(), key=drawn.room):  # the crowded choose first
        mark = marks[group[0]]
        text = axes.annotate(
            ", ".join(dict.fromkeys(marks[k].text for k in group)), (mark.x, mark.y),
            textcoords="offset points", xytext=(0.0, 0.0), ha="center", va="center", fontsize=size_pt,
            color=mark.colour, zorder=5,
        )  # fmt: skip
        size = np.array(text.get_window_extent(renderer).size)
        low, high = _boxes(at[group[0]], size, _PLACES_PT * drawn.pixel)
        outside = ((low <= frame.min) | (high >= frame.max)).any(axis=-1)
        texts.append(text)
        boxes.append((low, high))
        costs.append(np.stack([*_costs(low, high, group, drawn), outside]))
    for text, place in zip(texts, _chosen(boxes, costs), strict=True):
        dx, dy = _PLACES_PT[place]
        text.set_horizontalalignment("left" if dx > 0 else "right" if dx < 0 else "center")
        text.set_position((dx, dy))


def _costs(
    low: FloatArray, high: FloatArray, group: Sequence[int], drawn: _Drawn
) -> tuple[FloatArray, np.ndarray, np.ndarray]:
    """How bad places are for the text of a group of points.

    Args:
        low: (P, 2) lower left corners of the text at each place.
        high: (P, 2) upper right corners.
        group: numbers of the points.
        drawn: what is drawn.

    Returns:
        (P,) how near a place is to its own point and to others, how much it covers, and whether it is nearer
        to another value's point.
    """
    at, pixel, own = drawn.at, drawn.pixel, drawn.at[group]
    near = _distance(low, high, own).min(axis=-1)
    far = _distance(low, high, np.delete(at, group, axis=0)).min(axis=-1, initial=_CLEAR_PT * pixel)
    # between a text and its point there should be no other curve either
    strange = drawn.pieces[~np.isin(drawn.piece_of, drawn.line_of[group])]
    between = np.minimum(low, own[0]), np.maximum(high, own[0])
    covered = (
        (_distance(low, high, at) < _POINT_PT * pixel).sum(axis=-1)
        + (_distance(low, high, drawn.pieces) < _CURVE_PT * pixel).sum(axis=-1)
        + (_distance(*between, strange) == 0.0).sum(axis=-1)
    )
    mine = {drawn.values[k] for k in group}
    foreign = at[[value not in mine for value in drawn.values]]
    return near - far, covered, _distance(low, high, foreign).min(axis=-1, initial=np.inf) < near


def _chosen(boxes: Sequence[tuple[FloatArray, FloatArray]], costs: Sequence[FloatArray]) -> list[int]:
    """The place of each text: one after the other takes the best that is left, and then chooses again.

    Args:
        boxes: of each text, (P, 2) corners at all places.
        costs: of each text, (4, P) how near a place is to its own point and to others, how much it covers,
            whether it is nearer to another value's point, and whether it is outside.
    """
    chosen: dict[int, int] = {}
    for _ in range(_ROUNDS):
        for k, ((low, high), (nearness, covered, wrong, outside)) in enumerate(
            zip(boxes, costs, strict=True)
        ):
            over = np.zeros(len(low))
            for other, place in chosen.items():
                if other != k:
                    box = boxes[other]
                    over += ((low < box[1][place]) & (high > box[0][place])).all(axis=-1)
            # the last key decides first
            chosen[k] = int(np.lexsort((nearness, covered, wrong, over, outside))[0])
    return [chosen[k] for k in range(len(boxes))]


def _pieces(at: FloatArray, line_of: np.ndarray) -> tuple[FloatArray, np.ndarray]:
    """(M, 2) points along the curves in pixels, and (M,) the curve of each."""
    found = [np.empty((0, 2))]
    index: list[int] = []
    for line in np.unique(line_of):
        for one, two in pairwise(at[line_of == line]):
            found.append(np.linspace(one, two, _PIECES))
            index += [line] * _PIECES
    return np.concatenate(found), np.array(index, dtype=int)


def _boxes(point: FloatArray, size: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(P, 2) corners of a text of a size at each place: beside the point, or centred above or below it."""
    left = np.where(places[:, 0] > 0, 0.0, np.where(places[:, 0] < 0, -size[0], -size[0] / 2))
    low = point + places + np.column_stack([left, np.full(len(places), -size[1] / 2)])
    return low, low + size


def _distance(low: FloatArray, high: FloatArray, points: FloatArray) -> FloatArray:
    """(P, N) distances from (P, 2) boxes to (N, 2) points; 0 inside."""
    beyond = np.maximum(np.maximum(low[:, None] - points, points - high[:, None]), 0.0)
    distances: FloatArray = np.hypot(beyond[..., 0], beyond[..., 1])
    return distances
