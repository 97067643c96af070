"""What is wrong with a figure on paper: texts over one another, cut off or over data, curves never seen."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox

_LEGEND = "the legend"
_TOLERANCE_PX = 0.5
"""Boxes may share this much: letters do not fill them."""
_SEEN_PX, _SEEN_SHADE = 25, 64
"""A curve is seen if so many pixels are by so much different without it: smoothed edges do not count."""


@dataclass(frozen=True, slots=True)
class _Drawn:
    """A text or legend that was drawn.

    Args:
        name: for the report.
        box: pixels.
        axes: that it belongs to; None: to the figure.
        inside: whether it stands inside its axes on purpose: a name of a point, a note.
        legend: that it is, or is part of.
    """

    name: str
    box: Bbox
    axes: Axes | None
    inside: bool
    legend: Legend | None = None


def text_faults(figure: Figure) -> list[str]:
    """Texts of a figure that cannot be read, as sentences; none: the figure is in order.

    Found are texts whose boxes share paper, texts cut by the edge of the figure or by the frame that clips
    them, legends over a text or over a point of a curve, and texts that reach into the frame of other axes.
    Only what is really drawn counts, so that ticks outside the limits and hidden axes do no harm.

    Args:
        figure: as made by the product; it is drawn by this, at its own resolution.
    """
    drawn = _drawn(figure)
    page = figure.bbox
    faults = [
        f"{item.name} is cut by the edge of the figure" for item in drawn if not _within(item.box, page)
    ]
    for one, two in itertools.combinations(drawn, 2):
        if not (one.legend is not None and one.legend is two.legend) and _share(one.box, two.box):
            faults.append(f"{one.name} overlaps {two.name}")
    frames = [axes for axes in _all_axes(figure) if axes.axison and axes.get_visible()]
    for item in drawn:
        for axes in frames:
            own = axes is item.axes or axes in getattr(item.axes, "child_axes", ())
            if not _share(item.box, axes.bbox):
                continue
            if not (own and item.inside):
                faults.append(f"{item.name} reaches into the frame of {_name_of(axes)}")
            elif not _within(item.box, axes.bbox):
                faults.append(f"{item.name} crosses the frame of {_name_of(axes)}")
    for item in drawn:
        if item.name == _LEGEND and item.axes is not None and item.inside:
            covered = sum(int(_covered(item.box, line)) for line in item.axes.lines)
            faults += [f"{item.name} covers a point of a curve"] * (covered > 0)
    return faults


def unseen(figure: Figure, artists: Iterable[Artist]) -> list[str]:
    """Labels of curves, points or patches that are not to be seen, as others hide them.

    One is seen if the figure without it differs in enough pixels.

    Args:
        figure: that they are part of.
        artists: what should be seen.
    """
    FigureCanvasAgg(figure).draw()  # what is measured while drawing has its place now
    hidden = []
    for axes, own in itertools.groupby(artists, lambda artist: artist.axes):
        assert axes is not None
        layers = _layers(figure, axes)
        complete = _pixels(axes, layers)
        for artist in own:
            without = _pixels(axes, [layer for layer in layers if layer is not artist])
            changed = np.abs(without - complete).max(axis=-1) > _SEEN_SHADE
            if int(np.count_nonzero(changed)) < _SEEN_PX:
                hidden.append(str(artist.get_label()))
    return hidden


def labelled_curves(figure: Figure) -> list[Line2D]:
    """Curves with a name for the legend."""
    lines = (line for axes in figure.axes for line in axes.lines)
    return [line for line in lines if not str(line.get_label()).startswith("_")]


def _drawn(figure: Figure) -> list[_Drawn]:
    """Texts and legends in the order in which they are drawn."""
    texts: list[Text] = []
    draw = Text.draw

    def noted(text: Text, renderer: Any, *more: Any, **options: Any) -> None:
        if text.get_visible() and text.get_text().strip():
            texts.append(text)
        draw(text, renderer, *more, **options)

    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()  # what is measured while drawing has its place now
    with patch.object(Text, "draw", noted):
        figure.draw_without_rendering()
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    legends = [legend for legend in figure.findobj(Legend) if isinstance(legend, Legend)]
    owners = {id(text): legend for legend in legends for text in legend.findobj(Text)}
    items = []
    for text in dict.fromkeys(texts):
        box = _clipped(text, Text.get_window_extent(text, renderer))
        if box is None:
            continue
        axes = text.axes if isinstance(text.axes, Axes) else None
        inside = axes is not None and (text in axes.texts or id(text) in owners)
        items.append(_Drawn(repr(text.get_text()), box, axes, inside, owners.get(id(text))))
    for legend in legends:
        if legend.get_visible():
            owner = legend.parent if isinstance(legend.parent, Axes) else None
            box = legend.get_window_extent(renderer)
            inside = owner is not None and _within(box, owner.bbox)
            items.append(_Drawn(_LEGEND, box, owner, inside, legend))
    return items


def _clipped(text: Text, box: Bbox) -> Bbox | None:
    """What is seen of a text's box; None: nothing."""
    frame = text.get_clip_box() if text.get_clip_on() else None
    return box if frame is None else Bbox.intersection(box, frame)


def _all_axes(figure: Figure) -> Sequence[Axes]:
    return [*figure.axes, *(child for axes in figure.axes for child in axes.child_axes)]  # type: ignore[attr-defined]


def _name_of(axes: Axes) -> str:
    return f"axes {axes.get_title() or axes.get_xlabel() or axes.get_ylabel()!r}"


def _within(box: Bbox, frame: Bbox) -> bool:
    low, high = _TOLERANCE_PX, -_TOLERANCE_PX
    return bool(
        box.x0 >= frame.x0 - low
        and box.y0 >= frame.y0 - low
        and box.x1 <= frame.x1 - high
        and box.y1 <= frame.y1 - high
    )


def _share(one: Bbox, two: Bbox) -> bool:
    width = min(one.x1, two.x1) - max(one.x0, two.x0)
    height = min(one.y1, two.y1) - max(one.y0, two.y0)
    return bool(width > _TOLERANCE_PX and height > _TOLERANCE_PX)


def _covered(box: Bbox, line: Line2D) -> bool:
    """Whether a box covers a point of a curve."""
    points = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
    return any(box.contains(*point) for point in points.tolist())


def _layers(figure: Figure, axes: Axes) -> list[Artist]:
    """What may be seen in the frame of axes, the lowest first; the grid lies below all curves."""
    over = [other for other in figure.axes if other.get_visible() and _share(other.bbox, axes.bbox)]
    layers = [
        child
        for other in sorted(over, key=Artist.get_zorder)
        for child in sorted(other.get_children(), key=Artist.get_zorder)
        if child.get_visible() and not isinstance(child, Axis)
    ]
    layers += [*figure.legends, *figure.texts]
    return [
        layer
        for layer in layers
        if not isinstance(layer, (Text, Legend)) or _share(layer.get_window_extent(), axes.bbox)
    ]


def _pixels(axes: Axes, layers: Sequence[Artist]) -> Any:
    """What layers show in the frame of axes: (height, width, 4) colours of 0 to 255."""
    canvas = FigureCanvasAgg(axes.figure)
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    renderer.clear()
    for layer in layers:
        layer.draw(renderer)
    picture = np.asarray(canvas.buffer_rgba())
    (left, low), (right, high) = np.floor(axes.bbox.get_points()).astype(int)
    return picture[len(picture) - high - 1 : len(picture) - low, left : right + 1].astype(np.int16)
