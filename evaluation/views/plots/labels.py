"""Texts beside points, where none covers another: names of events and tracks, values along curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evaluation.views.plots.style import SMALL_PT
from smartmot.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import BboxBase

Rectangle = tuple[float, float, float, float]
"""Left, low, right, high."""

_POINTS_PER_INCH = 72.0

# ---- the placer --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Places:
    """Where one text may stand.

    Args:
        boxes: (P, 4) left, low, right and high of the text at each place, pixels.
        costs: of the boxes (T, 4) of other texts: how bad each place is, as keys (P,) of which the last
            decides first.
        limit: a text whose best place is as bad as this by the last key is left out.
    """

    boxes: FloatArray
    costs: Callable[[FloatArray], Sequence[NDArray[np.generic]]]
    limit: float = np.inf

    def best(self, taken: FloatArray) -> int | None:
        """The place to take."""
        costs = self.costs(taken)
        place = int(np.lexsort(tuple(costs))[0])
        return place if float(costs[-1][place]) < self.limit else None


def _chosen(texts: Sequence[_Places], rounds: int) -> list[int | None]:
    """The place of each text: one after the other takes the best that is left.

    Args:
        texts: in the order in which they choose.
        rounds: how often each chooses; from the second time on it knows what all others have chosen.
    """
    chosen: dict[int, int | None] = {}
    for _ in range(rounds):
        for k, text in enumerate(texts):
            taken = [texts[j].boxes[p] for j, p in chosen.items() if j != k and p is not None]
            chosen[k] = text.best(np.array(taken).reshape(-1, 4))
    return [chosen[k] for k in range(len(texts))]


def _overlaps(boxes: FloatArray, taken: FloatArray, gap: float = 0.0) -> NDArray[np.int64]:
    """(P,) how many of other boxes (T, 4) each box (P, 4) covers or comes nearer to than a gap."""
    below = boxes[:, None, :2] < taken[:, 2:] + gap
    above = taken[:, :2] < boxes[:, None, 2:] + gap
    counts: NDArray[np.int64] = (below & above).all(axis=-1).sum(axis=-1)
    return counts


# ---- names of events and tracks ----------------------------------------------------------------------------

_REPEAT_COST = 2.0
_NUDGE_PT, _SHIFT_PT = 4.0, 45.0
"""From a point to the text beside it, and from one place along a line to the next."""
_APART_PX = 6.0
"""Between two texts, about 2 pt."""


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
    scale = axes.figure.dpi / _POINTS_PER_INCH
    points: FloatArray = to_pixel(np.array([text[:2] for text in texts]).reshape(-1, 2))
    lines: FloatArray = to_pixel(np.asarray(segments, dtype=np.float64).reshape(-1, 2)).reshape(-1, 2, 2)
    offsets = [offset * scale for offset in offsets_pt]
    names = [name for _, _, name in texts]
    repeats = [names.index(name) != k for k, name in enumerate(names)]
    # each different text finds its place before any is repeated
    order = sorted(range(len(texts)), key=lambda k: repeats[k])
    labels, likings, places = [], [], []
    for k in order:
        x, y, name = texts[k]
        label = axes.annotate(
            name, (x, y), textcoords="offset points", xytext=(0, 0), fontsize=SMALL_PT, zorder=8, gid="label"
        )
        # a white rim keeps the text readable where it cannot keep clear of a line
        label.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
        extent = Text.get_window_extent(label)
        boxes, liking = _candidates(points[k], extent.width, extent.height, offsets, scale)
        boxes, outside = _slid_into(axes.bbox, boxes)
        costs = _label_costs(points[k], boxes, liking, outside, lines, points)
        labels.append(label)
        likings.append(liking)
        places.append(_Places(boxes, costs, _REPEAT_COST if repeats[k] else np.inf))
    for k, label, liking, text, place in zip(
        order, labels, likings, places, _chosen(places, rounds=1), strict=True
    ):
        if place is None:
            label.remove()
            continue
        box, point = text.boxes[place], points[k]
        label.set_position(((box[0] - point[0]) / scale, (box[1] - point[1]) / scale))
        label.set_verticalalignment("bottom")
        if leaders and liking[place] >= 2.0:
            ends = axes.transData.inverted().transform([point, np.clip(point, box[:2], box[2:])])
            axes.plot(ends[:, 0], ends[:, 1], color="#555555", linewidth=0.5, zorder=7, gid="leader")


def _candidates(
    point: FloatArray, width: float, height: float, offsets: Sequence[float], scale: float
) -> tuple[FloatArray, FloatArray]:
    """(P, 4) boxes in pixels where a text may stand, and (P,) how little each is liked."""
    nudge, shift = _NUDGE_PT * scale, _SHIFT_PT * scale
    lefts = [
        (0.0, point[0] + nudge),
        (0.5, point[0] - nudge - width),
        (1.0, point[0] - width / 2),
        *((1.5 + steps, point[0] + nudge + steps * shift) for steps in (1, 2, 3)),
        *((2.0 + steps, point[0] - nudge - width - steps * shift) for steps in (1, 2, 3)),
    ]
    boxes, liking = [], []
    for rank, offset in enumerate(offsets):
        for below, centre in ((0.0, point[1] + offset), (0.2, point[1] - offset)):
            low = centre - height / 2
            boxes += [(left, low, left + width, low + height) for _, left in lefts]
            liking += [2.0 * rank + below + side for side, _ in lefts]
    return np.array(boxes, dtype=np.float64), np.array(liking)


def _slid_into(frame: BboxBase, boxes: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(P, 4) boxes moved until they lie within a frame, and (P,) which of them stuck out of it."""
    low, high = boxes[:, :2], boxes[:, 2:]
    least, most = np.array(frame.min), np.array(frame.max)
    outside: BoolArray = np.any((low < least) | (high > most), axis=1)
    size = high - low
    inside = np.maximum(np.minimum(low, most - _APART_PX - size), least + _APART_PX)
    low = np.where(outside[:, None], inside, low)
    return np.hstack([low, low + size]), outside


def _label_costs(
    point: FloatArray,
    boxes: FloatArray,
    liking: FloatArray,
    outside: BoolArray,
    lines: FloatArray,
    points: FloatArray,
) -> Callable[[FloatArray], Sequence[NDArray[np.generic]]]:
    """How much a text at each place would hide or its leader to the point would cross.

    What had to be slid into the frame stands away from where a reader looks for it.
    """
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    covered = ((points >= low) & (points <= high)).all(axis=-1).sum(axis=-1)
    crossed = _crossings(boxes, lines).sum(axis=-1)
    # weights in the order of what disturbs most: a text over a text, slid, over a point, over a line
    alone = 200.0 * outside + 10.0 * np.minimum(crossed, 6) + 15.0 * np.minimum(covered, 4)
    nearest = np.clip(point, boxes[:, :2], boxes[:, 2:])
    leaders = np.stack([np.broadcast_to(point, nearest.shape), nearest], axis=1)

    def costs(taken: FloatArray) -> Sequence[NDArray[np.generic]]:
        by_leader = _crossings(taken, leaders).sum(axis=0)
        total = liking + (40.0 * by_leader + 1000.0 * _overlaps(boxes, taken, _APART_PX) + alone)
        return (*boxes.T[::-1], liking, total)

    return costs


def _crossings(boxes: FloatArray, lines: FloatArray) -> BoolArray:
    """(B, L) which line pieces (L, 2, 2) pass through which boxes (B, 4)."""
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    # Liang and Barsky: where a piece enters and leaves the strips between opposite sides, as parts of its
    # length; it passes through where it has entered both before it leaves one
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (low - start) / step, (high - start) / step
    inside = (start >= low) & (start <= high)
    still = step == 0.0
    first, second = np.minimum(near, far), np.maximum(near, far)
    enter = np.where(still, np.where(inside, -np.inf, np.inf), first).max(axis=-1, initial=0.0)
    leave = np.where(still, np.where(inside, np.inf, -np.inf), second).min(axis=-1, initial=1.0)
    crossed: BoolArray = enter <= leave
    return crossed


# ---- values along curves -----------------------------------------------------------------------------------

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
"""(P, 2) where a value may stand beside its point, in points (1/72 inch), among equals the best first."""
_POINT_PT, _CURVE_PT = 3.2, 0.8
"""Half the width of points and curves, which no text should cover."""
_CLEAR_PT = 9.0
"""Points that are farther from a text do not matter."""
_PIECES = 40
"""Pieces of the way from one point of a curve to the next."""
_TEXT_GAP_PT = 2.0
"""Between two texts, if there is room."""
_ROUNDS = 4


class Mark(NamedTuple):
    """A point of a curve, in data coordinates, the value written beside it, and half its width."""

    x: float
    y: float
    text: str
    colour: str
    radius_pt: float = _POINT_PT


def write_values(
    figure: Figure,
    axes: Axes,
    lines: Sequence[Sequence[Mark]],
    size_pt: float,
    names: Sequence[str] = (),
) -> bool:
    """Values beside their points, where they cover neither a curve nor one another nor the frame.

    A value stands nearer to its own point than to any point of another value, if there is a place. Points of
    one colour that fall on one another share a text. The name of a curve stands beside any of its points.

    Args:
        figure: with the canvas on which texts are measured.
        axes: with its final limits.
        lines: points of each curve.
        size_pt: of the texts.
        names: of the curves.

    Returns:
        Whether all names are there; where one would stand over a text or a point, or cross the frame, none
        is.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    assert isinstance(figure.canvas, FigureCanvasAgg)
    renderer = figure.canvas.get_renderer()  # type: ignore[no-untyped-call]
    curves = _Curves(axes, lines, figure.dpi / _POINTS_PER_INCH)
    together: dict[tuple[float, float, str], list[int]] = {}
    for k, mark in enumerate(curves.marks):
        if mark.text:
            together.setdefault((round(mark.x, 1), round(mark.y, 1), mark.colour), []).append(k)
    frame = axes.get_window_extent(renderer)
    groups = sorted(together.values(), key=curves.room)  # the crowded choose first
    words = [", ".join(dict.fromkeys(curves.marks[k].text for k in group)) for group in groups]
    anchors = [group[:1] for group in groups]
    named = [np.flatnonzero(curves.line_of == line).tolist() for line in range(len(names))]
    texts, places = [], []
    for word, points, group in zip([*words, *names], [*anchors, *named], [*groups, *named], strict=True):
        mark = curves.marks[points[0]]
        text = axes.annotate(
            word, (mark.x, mark.y), textcoords="offset points", xytext=(0.0, 0.0), ha="center", va="center",
            fontsize=size_pt, color=mark.colour, zorder=5,
        )  # fmt: skip
        size = np.array(text.get_window_extent(renderer).size)
        boxes = np.concatenate([_boxes(curves.at[k], size, _PLACES_PT * curves.pixel) for k in points])
        low, high = boxes[:, :2], boxes[:, 2:]
        outside = np.any((low <= frame.min) | (high >= frame.max), axis=-1)
        at = np.repeat(curves.at[points], len(_PLACES_PT), axis=0)
        texts.append(text)
        places.append(_Places(boxes, curves.costs(boxes, at, group, outside)))
    chosen = _chosen(places, _ROUNDS)
    for text, points, place in zip(texts, [*anchors, *named], chosen, strict=True):
        assert place is not None
        mark = curves.marks[points[place // len(_PLACES_PT)]]
        dx, dy = _PLACES_PT[place % len(_PLACES_PT)]
        text.xy = (mark.x, mark.y)
        text.set_horizontalalignment("left" if dx > 0 else "right" if dx < 0 else "center")
        text.set_position((dx, dy))
    boxes = np.array([text.boxes[place] for text, place in zip(places, chosen, strict=True)]).reshape(-1, 4)
    of_names = boxes[len(words) :]
    clear = (
        (_overlaps(of_names, boxes) == 1).all()
        and (_distance(of_names, curves.at) > curves.radius).all()
        and (of_names[:, :2] > frame.min).all()
        and (of_names[:, 2:] < frame.max).all()
    )
    if names and not clear:
        for text in texts:
            text.remove()
        write_values(figure, axes, lines, size_pt)
    return bool(clear)


class _Curves:
    """What is drawn already: the points of all curves, in pixels, and points along the curves between them.

    Args:
        axes: where they are drawn.
        lines: points of each curve.
        pixel: pixels of a point (1/72 inch).
    """

    def __init__(self, axes: Axes, lines: Sequence[Sequence[Mark]], pixel: float) -> None:
        self.pixel = pixel
        self.marks = [mark for line in lines for mark in line]
        self.at: FloatArray = axes.transData.transform([(mark.x, mark.y) for mark in self.marks])
        self.radius = np.array([mark.radius_pt for mark in self.marks]) * pixel
        self.line_of = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        pieces, self.piece_of = [np.empty((0, 2))], np.empty(0, dtype=int)
        for line in np.unique(self.line_of):
            ways = [np.linspace(*ends, _PIECES) for ends in pairwise(self.at[self.line_of == line])]
            pieces += ways
            self.piece_of = np.append(self.piece_of, np.full(_PIECES * len(ways), line))
        self.pieces: FloatArray = np.concatenate(pieces)

    def room(self, group: Sequence[int]) -> float:
        """Distance from a point to the next one that is not of its group."""
        place = np.tile(self.at[group[:1]], 2)
        return float(_distance(place, np.delete(self.at, group, axis=0)).min(initial=np.inf))

    def costs(
        self, boxes: FloatArray, at: FloatArray, group: Sequence[int], outside: BoolArray
    ) -> Callable[[FloatArray], Sequence[NDArray[np.generic]]]:
        """How bad places are for the text of a group of points.

        Args:
            boxes: (P, 4) the text at each place.
            at: (P, 2) the point that it stands beside.
            group: numbers of the points.
            outside: (P,) whether a place sticks out of the axes.
        """
        own = self.at[group]
        near = _distance(boxes, own).min(axis=-1)
        others_at = np.delete(self.at, group, axis=0)
        far = _distance(boxes, others_at).min(axis=-1, initial=_CLEAR_PT * self.pixel)
        # between a text and its point there should be no other curve either
        strange = self.pieces[~np.isin(self.piece_of, self.line_of[group])]
        between = np.hstack([np.minimum(boxes[:, :2], at), np.maximum(boxes[:, 2:], at)])
        hidden = (_distance(boxes, self.at) < self.radius).sum(axis=-1)
        covered = (_distance(boxes, self.pieces) < _CURVE_PT * self.pixel).sum(axis=-1) + (
            _distance(between, strange) == 0.0
        ).sum(axis=-1)
        values = {self.marks[k].text for k in group}
        foreign = self.at[[mark.text not in values for mark in self.marks]]
        wrong = _distance(boxes, foreign).min(axis=-1, initial=np.inf) < near
        gap = _TEXT_GAP_PT * self.pixel
        return lambda taken: (
            near - far, covered, wrong, hidden, _overlaps(boxes, taken, gap), outside
        )  # fmt: skip


def _boxes(point: FloatArray, size: FloatArray, places: FloatArray) -> FloatArray:
    """(P, 4) boxes of a text of a size at each place: beside the point, or centred above or below it."""
    left = np.where(places[:, 0] > 0, 0.0, np.where(places[:, 0] < 0, -size[0], -size[0] / 2))
    low = point + places + np.column_stack([left, np.full(len(places), -size[1] / 2)])
    return np.hstack([low, low + size])


def _distance(boxes: FloatArray, points: FloatArray) -> FloatArray:
    """(P, N) distances from boxes (P, 4) to points (N, 2); 0 inside."""
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    beyond = np.maximum(np.maximum(low - points, points - high), 0.0)
    distances: FloatArray = np.hypot(beyond[..., 0], beyond[..., 1])
    return distances
