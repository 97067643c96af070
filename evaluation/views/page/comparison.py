"""What a page shows of a comparison: words, points with intervals, the runs behind each, tables."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import Table

WIDTH, HEIGHT = 380.0, 320.0
"""Of a chart in its own units: as wide as a phone, so that texts are legible there."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 12.0, 30.0, 44.0
_NEAR = 13.0
"""Points nearer than this share their numbers."""
_DIGIT, _LINE, _ASIDE = 8.0, 15.0, 9.0
"""Width of a digit, height of a line, and distance of numbers from their mark."""
_TICKS = 5
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


Box = tuple[float, float, float, float]
"""Left, top, right and bottom in a chart's units; of a bar both ends."""


@dataclass(frozen=True, slots=True)
class RunLine:
    """Runs of a point in one scene.

    Args:
        title: of the scene.
        outcome: how they ended.
        kind: good, bad or open.
        log: the replay that is in the page; empty: none.
    """

    title: str
    outcome: str
    kind: str
    log: str = ""


@dataclass(frozen=True, slots=True)
class PointView:
    """One point of a comparison.

    Args:
        number: on the page.
        name: strategy and settings.
        colour: of the strategy; empty: none.
        numbers: what was measured, with intervals, in words.
        lines: the runs behind it, those that went wrong first.
        left_out: what the lines leave out, in words; may be empty.
    """

    number: int
    name: str
    colour: str
    numbers: tuple[str, ...]
    lines: tuple[RunLine, ...]
    left_out: str = ""

    @property
    def replays(self) -> int:
        """Lines with a replay."""
        return sum(bool(line.log) for line in self.lines)


@dataclass(frozen=True, slots=True)
class Mark:
    """Points that fall on one another, in a chart's units: where, bars of intervals, and place of numbers."""

    x: float
    y: float
    numbers: tuple[tuple[int, str], ...]
    colour: str
    bars: tuple[Box, ...]
    text_x: float
    text_y: float
    is_left: bool


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart of points.

    Args:
        title: above it.
        x_label, y_label: of the axes.
        x_ticks, y_ticks: place and text.
        marks: the points.
        left_out: points without a value, by number.
    """

    title: str
    x_label: str
    y_label: str
    x_ticks: tuple[tuple[float, str], ...]
    y_ticks: tuple[tuple[float, str], ...]
    marks: tuple[Mark, ...]
    left_out: tuple[int, ...] = ()

    @property
    def frame(self) -> Box:
        """Left, top, right and bottom of the plotted area."""
        return _LEFT, _TOP, WIDTH - _RIGHT, HEIGHT - _BOTTOM


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure of the study, as it lies in its folder."""

    title: str
    source: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """Everything that a page shows of a comparison.

    Args:
        sentences: the answer in words.
        charts: of the points.
        points: all of them.
        tables: by heading.
        pictures: figures.
        notes: how to read it.
        most_first: sentences that are seen before the others are asked for.
    """

    sentences: tuple[str, ...]
    charts: tuple[Chart, ...]
    points: tuple[PointView, ...]
    tables: tuple[tuple[str, Table], ...]
    pictures: tuple[Picture, ...]
    notes: tuple[str, ...]
    most_first: int = 5


def picture(title: str, name: str, content: bytes) -> Picture:
    """A PNG or SVG as an address that holds it."""
    kind = "svg+xml" if name.endswith(".svg") else "png"
    return Picture(title, f"data:image/{kind};base64,{base64.b64encode(content).decode()}")


def chart(
    title: str,
    x_label: str,
    y_label: str,
    points: Sequence[tuple[PointView, Estimate, Estimate]],
    is_share: bool = False,
) -> Chart:
    """Points with their intervals.

    Args:
        title: above it.
        x_label: of one axis.
        y_label: of the other.
        points: each with its place, in the units of the axes.
        is_share: whether both are percentages; the axis upwards then ends at 100.
    """
    seen = [entry for entry in points if not math.isnan(entry[1].value) and not math.isnan(entry[2].value)]
    most = [
        max((value for e in places for value in (e.value, e.high) if value == value), default=1.0)
        for places in ([x for _, x, _ in seen], [y for _, _, y in seen])
    ]
    x_top, y_top = most[0] or 1.0, 100.0 if is_share else most[1] or 1.0

    def x_of(value: float) -> float:
        return round(_LEFT + (WIDTH - _LEFT - _RIGHT) * value / x_top, 1)

    def y_of(value: float) -> float:
        return round(HEIGHT - _BOTTOM - (HEIGHT - _TOP - _BOTTOM) * value / y_top, 1)

    groups: list[list[tuple[PointView, Estimate, Estimate]]] = []
    for entry in seen:
        near = (
            group
            for group in groups
            if math.hypot(x_of(entry[1].value) - x_of(group[0][1].value),
                          y_of(entry[2].value) - y_of(group[0][2].value)) < _NEAR
        )  # fmt: skip
        group = next(near, None)
        if group is None:
            groups.append([entry])
        else:
            group.append(entry)
    marks = []
    for group in groups:
        first, x, y = group[0]
        bars = []
        for _, own_x, own_y in group:
            at = x_of(own_x.value), y_of(own_y.value)
            if not math.isnan(own_x.low):
                bars.append((x_of(own_x.low), at[1], x_of(own_x.high), at[1]))
            if not math.isnan(own_y.low):
                bars.append((at[0], y_of(own_y.low), at[0], y_of(own_y.high)))
        numbers = tuple((point.number, point.name) for point, _, _ in group)
        place = x_of(x.value), y_of(y.value)
        marks.append(Mark(*place, numbers, first.colour, tuple(bars), *place, is_left=False))
    marks = _placed(marks)
    shown = {point.number for point, _, _ in seen}
    left_out = tuple(point.number for point, _, _ in points if point.number not in shown)
    x_ticks, y_ticks = (
        [(of(v), f"{v:g}") for v in _ticks(end)] for of, end in ((x_of, x_top), (y_of, y_top))
    )
    return Chart(title, x_label, y_label, tuple(x_ticks), tuple(y_ticks), tuple(marks), left_out)


def _placed(marks: Sequence[Mark]) -> list[Mark]:
    """Marks with their numbers where they cover no mark and no other numbers, as far as there is room."""
    taken = [(m.x - _ASIDE, m.y - _ASIDE, m.x + _ASIDE, m.y + _ASIDE) for m in marks]
    placed = []
    for mark in marks:
        width = _DIGIT * len(" ".join(str(number) for number, _ in mark.numbers))
        spots = []
        for up in (-6.0, 16.0, -22.0, 32.0):
            for is_left in (False, True):
                x = mark.x + (-_ASIDE if is_left else _ASIDE)
                left = x - width if is_left else x
                box = (left, mark.y + up - _LINE, left + width, mark.y + up)
                spots.append((box, x, mark.y + up, is_left))
        own = (mark.x - _ASIDE, mark.y - _ASIDE, mark.x + _ASIDE, mark.y + _ASIDE)

        def cost(spot: tuple[Box, float, float, bool], own: Box = own) -> float:
            left, top, right, bottom = spot[0]
            outside = left < _LEFT - _DIGIT or right > WIDTH or top < 0.0 or bottom > HEIGHT - _BOTTOM
            covered = sum(
                left < other[2] and other[0] < right and top < other[3] and other[1] < bottom
                for other in taken
                if other != own
            )
            return covered + 10.0 * outside

        box, x, y, is_left = min(spots, key=cost)
        taken.append(box)
        placed.append(replace(mark, text_x=x, text_y=y, is_left=is_left))
    return placed


def _ticks(end: float) -> list[float]:
    """Round numbers from 0 to the end of an axis."""
    size = 10.0 ** math.floor(math.log10(end / _TICKS))
    step = next(size * k for k in _STEPS if end / (size * k) <= _TICKS)
    return [round(k * step, 10) for k in range(int(end / step + 1e-9) + 1)]
