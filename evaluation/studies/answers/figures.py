"""Figures of the questions: differences with intervals, curves with bands, tornadoes, operating curves."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from evaluation.metrics.intervals import Estimate
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import LEVEL, Difference
from evaluation.views.plots.fitting import wrapped
from evaluation.views.plots.panels import (
    CurveName,
    PanelPage,
    draw_band,
    hidden_by,
    name_curves,
    panel_page,
)
from evaluation.views.plots.style import (
    BLACK,
    BLUE,
    FONT_PT,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    SMALL_PT,
    VERMILLION,
    WINE,
    plain_figure,
    set_style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from evaluation.studies.answers.break_even import Curve
    from evaluation.studies.answers.sensor import Cost
    from evaluation.studies.answers.trigger import Operating

WIDTH_IN = 7.0
"""Across both columns of a paper."""
DPI = 200
_NAME_IN = 1.5
"""Width that names of rivals may take, inches."""
COLOURS = {"avoided": BLUE, "stops": VERMILLION}
BETTER = {"avoided": "better: right", "stops": "better: left"}


def gain(differences: Sequence[Difference], against: str, where: str) -> Figure:
    """Differences in collisions avoided and in unnecessary stops, a bar with its interval per rival.

    Args:
        differences: of one preset and rule.
        against: what the others are compared with, in words.
        where: that preset and rule.
    """
    names = list(dict.fromkeys(_pair_name(d, differences) for d in differences))
    figure = plain_figure((WIDTH_IN, 1.0), DPI)
    texts = [wrapped(figure, name, _NAME_IN, SMALL_PT) for name in names]
    row_in = 0.27 + 0.12 * max((text.count("\n") for text in texts), default=0)
    height_in = 1.45 + row_in * len(names)
    figure.set_figheight(height_in)
    panels = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(
        left=0.24, right=0.98, bottom=0.72 / height_in, top=1 - 0.55 / height_in, wspace=0.06
    )
    for axes, measure in zip(panels, DECISIVE, strict=True):
        own = [d for d in differences if d.measure == measure]
        set_style(axes)
        axes.axvline(0.0, color=GREY, linewidth=0.9)
        for d in own:
            place = len(names) - 1 - names.index(_pair_name(d, differences))
            _bar(axes, place, d)
        axes.set_title(f"{MEASURES[measure].text} ({BETTER[measure]})", fontsize=FONT_PT, pad=4.0)
        axes.set_xlabel("difference (percentage points)", fontsize=SMALL_PT)
        _room_for_labels(axes, own)
        axes.set_ylim(-0.6, len(names) - 0.4)
    panels[0].set_yticks(range(len(names)), texts[::-1], fontsize=SMALL_PT)
    figure.text(0.01, 1 - 0.2 / height_in, f"Against {against}, {where}", fontsize=FONT_PT)
    figure.text(
        0.5, 0.05 / height_in,
        f"{_scene_counts(differences)}. Bars: 95 % intervals. Filled: decided at {100 * LEVEL:g} %, "
        "corrected for all "
        "questions.",
        ha="center", fontsize=SMALL_PT - 1.0, color="#444444",
    )  # fmt: skip
    return figure


def _pair_name(d: Difference, differences: Sequence[Difference]) -> str:
    """The rival, and what it is compared with where that is not the same for all."""
    several = len({other.against.name for other in differences}) > 1
    return f"{d.arm.name} – {d.against.name}" if several else d.arm.name


def _bar(axes: Axes, place: int, d: Difference) -> None:
    """One difference with its interval and its number."""
    colour = COLOURS[d.measure]
    value, low, high = (100 * v for v in (d.estimate.value, d.estimate.low, d.estimate.high))
    axes.plot([low, high], [place, place], color=colour, linewidth=2.2, solid_capstyle="butt", alpha=0.55)
    axes.plot(
        value, place,
        marker="o", markersize=5.0, markeredgecolor=colour,
        markerfacecolor=colour if d.is_decided else "white",
    )  # fmt: skip
    axes.annotate(
        f"{value:+.1f}", (high, place), xytext=(4, 0), textcoords="offset points",
        va="center", fontsize=SMALL_PT - 1.0, color=colour,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip


def _room_for_labels(axes: Axes, differences: Sequence[Difference]) -> None:
    """Limits that hold all intervals, and the numbers to the right of them."""
    lows = [100 * d.estimate.low for d in differences] or [0.0]
    highs = [100 * d.estimate.high for d in differences] or [0.0]
    low, high = min(0.0, *lows), max(0.0, *highs)
    span = max(high - low, 1.0)
    axes.set_xlim(low - 0.04 * span, high + 0.2 * span)


def _scene_counts(differences: Sequence[Difference]) -> str:
    counts = {m: max((d.estimate.count for d in differences if d.measure == m), default=0) for m in DECISIVE}
    return f"{counts['avoided']} must-brake scenes, {counts['stops']} in which nothing should happen"


SIDE_COLOURS = (GREEN, PURPLE)
"""Of the map filters that are compared with the planned path: with the paper's margin, and tuned."""


def break_even(curves: Mapping[str, Sequence[Curve]], where: str) -> Figure:
    """Benefit of each map filter over growing errors, with bands, and where it is lost.

    Args:
        curves: one per error, by the name of the map filter.
        where: preset and rule.
    """
    colours = dict(zip(curves, itertools.cycle(SIDE_COLOURS), strict=False))
    every = list(curves.values())
    lost = any(0.0 < curve.crossing < math.inf for own in every for curve in own)
    title = "Avoided less stopped: map filter less planned path"
    page = _error_page(every[0], title, where, _LOST if lost else "")
    for k, axes in enumerate(page.axes[: len(every[0])]):
        for side, own in curves.items():
            _curve(axes, own[k], "benefit", colours[side])
            _mark_loss(axes, own[k], colours[side])
        _error_axis(axes, every[0][k])
    _name_ends(page, [(own, "benefit", side, colours[side]) for side, own in curves.items()])
    return page.figure


def break_even_parts(curves: Sequence[Curve], where: str) -> Figure:
    """Collisions avoided and unnecessary stops of a map filter less those of the planned path.

    Args:
        curves: one per error.
        where: map filter, preset and rule.
    """
    page = _error_page(curves, "Map filter less planned path", where)
    for axes, curve in zip(page.axes, curves, strict=False):
        lines = [
            [(x, 100 * getattr(p, name).value) for x, p in zip(curve.values, curve.points, strict=True)]
            for name in DECISIVE
        ]
        for name, hiding in zip(DECISIVE, hidden_by(lines, _SAME), strict=True):
            _curve(axes, curve, name, COLOURS[name], hiding)
        _error_axis(axes, curve)
    _name_ends(
        page,
        [(curves, name, f"{MEASURES[name].text}\n({BETTER_UP[name]})", COLOURS[name]) for name in DECISIVE],
    )
    return page.figure


def _name_ends(page: PanelPage, lines: Sequence[tuple[Sequence[Curve], str, str, str]]) -> None:
    """Names beside the ends of the curves in the last panel of the first line; the others have the same.

    Args:
        page: with all curves drawn.
        lines: curves by panel, what of their points is drawn, name and colour.
    """
    last = min(_COLUMNS, len(lines[0][0])) - 1
    if last < 0:
        return
    names = [
        CurveName(
            own[last].values[-1],
            100 * getattr(own[last].points[-1], measure).value,
            wrapped(page.figure, name, _END_IN, SMALL_PT),
            colour,
        )
        for own, measure, name, colour in lines
    ]
    name_curves(page.axes[last], [name for name in names if not math.isnan(name.y)])


_COLUMNS = 3
"""Panels of errors in a line."""
_END_IN = 0.8
"""Width that the name of a curve may take, inches."""


BETTER_UP = {"avoided": "better: up", "stops": "better: down"}
_LOST = " Black ticks: where the benefit is lost, and its interval."


def _error_page(curves: Sequence[Curve], title: str, where: str, more: str = "") -> PanelPage:
    """A panel for each error, three in a line."""
    columns = min(_COLUMNS, max(1, len(curves)))
    scenes = curves[0].points[0] if curves else None
    counts = f"{scenes.avoided.count} + {scenes.stops.count} scenes per point. " if scenes else ""
    page = panel_page(
        max(1, math.ceil(len(curves) / columns)), columns,
        width_in=WIDTH_IN, panel_in=1.85, title=f"{title}, {where}", share_y=True,
        note=f"{counts}Bands: 95 % intervals over the scenes.{more}",
    )  # fmt: skip
    for axes in page.axes[len(curves) :]:
        axes.set_axis_off()
    for axes in page.axes[::columns]:
        axes.set_ylabel("difference (points)", fontsize=SMALL_PT)
    return page


def _curve(axes: Axes, curve: Curve, name: str, colour: str, hiding: int = 0) -> None:
    """One difference along the errors with its band; wider if another lies on it."""
    points: list[Estimate] = [getattr(point, name) for point in curve.points]
    low, high = ([100 * getattr(p, end) for p in points] for end in ("low", "high"))
    draw_band(axes, curve.values, low, high, colour)
    axes.plot(
        curve.values, [100 * p.value for p in points], color=colour, marker="o",
        markersize=3.0 + 2.0 * hiding, linewidth=1.3 + 2.0 * hiding,
    )  # fmt: skip


def _mark_loss(axes: Axes, curve: Curve, colour: str) -> None:
    """Where a benefit is lost on the line of no difference, with its interval."""
    if not 0.0 < curve.crossing < math.inf:
        return
    most = curve.values[-1]
    axes.plot([curve.low, min(curve.high, most)], [0.0, 0.0], color=colour, linewidth=2.4, alpha=0.8)
    axes.plot(curve.crossing, 0.0, marker="|", markersize=9.0, color=BLACK)


def _error_axis(axes: Axes, curve: Curve) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.9, zorder=1.0)
    label = f"{curve.sweep.text} ({curve.sweep.unit})"
    figure = axes.get_figure(root=True)
    assert figure is not None
    axes.set_xlabel(wrapped(figure, label, _LABEL_IN, SMALL_PT), fontsize=SMALL_PT)
    axes.set_xlim(-0.03 * curve.values[-1], 1.03 * curve.values[-1])


_LABEL_IN = 1.6
"""Width that the label of one of three panels may take, inches."""
_SAME = 0.01
"""Points nearer than this fall on one another: the lower curve is drawn wider."""


def tornado(costs: Sequence[Cost], where: str) -> Figure:
    """What each error of the sensor costs in benefit, alone and among all, the costliest on top."""
    height_in = 1.35 + 0.34 * len(costs)
    figure = plain_figure((WIDTH_IN, height_in), DPI)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.17, right=0.97, bottom=0.75 / height_in, top=1 - 0.4 / height_in)
    set_style(axes)
    axes.axvline(0.0, color=GREY, linewidth=0.9)
    for place, cost in enumerate(reversed(costs)):
        for shift, part, colour in ((0.17, cost.alone, ORANGE), (-0.17, cost.among, PURPLE)):
            value, low, high = (100 * v for v in (part[2].value, part[2].low, part[2].high))
            axes.barh(place + shift, value, height=0.3, color=colour, alpha=0.85)
            axes.plot([low, high], [place + shift] * 2, color=BLACK, linewidth=0.8)
    axes.set_yticks(range(len(costs)), [cost.error for cost in reversed(costs)], fontsize=SMALL_PT)
    axes.set_ylim(-0.6, len(costs) - 0.4)
    axes.set_xlabel(
        "change of collisions avoided less unnecessary stops (percentage points)", fontsize=SMALL_PT
    )
    figure.text(0.01, 1 - 0.2 / height_in, f"What each error of the sensor costs: {where}", fontsize=FONT_PT)
    for x, colour, text in ((0.6, ORANGE, "alone"), (0.7, PURPLE, "added to all others")):
        figure.text(x, 1 - 0.2 / height_in, f"■ {text}", fontsize=SMALL_PT, color=colour)
    counts = f"{costs[0].alone[0].count} + {costs[0].alone[1].count} scenes. " if costs else ""
    figure.text(
        0.5, 0.05 / height_in, f"{counts}Lines: 95 % intervals over the scenes.",
        ha="center", fontsize=SMALL_PT - 1.0, color="#444444",
    )  # fmt: skip
    return figure


RULE_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, BLACK, SKY, WINE)


def operating_curves(points: Sequence[Operating], where: str) -> Figure:
    """Collisions avoided against unnecessary stops, a curve per rule along its trigger."""
    figure = plain_figure((WIDTH_IN, 4.3), DPI)
    axes = figure.subplots()
    rules = list(dict.fromkeys(point.rule for point in points))
    names_in = 0.35 + 0.062 * max(map(len, rules))
    figure.subplots_adjust(left=0.085, right=1 - names_in / WIDTH_IN, bottom=0.17, top=0.9)
    set_style(axes)
    ends: list[tuple[float, float, str, str]] = []
    for rule, colour in zip(rules, itertools.cycle(RULE_COLOURS), strict=False):
        tuned = [point for point in points if point.rule == rule and point.tuned]
        own = [point for point in points if point.rule == rule and not point.tuned]
        x, y = [100 * p.stops.value for p in own], [100 * p.avoided.value for p in own]
        for p in (p for p in (*own, *tuned) if p.is_usual or p.tuned):
            low, high = (100 * e for e in (p.stops.low, p.stops.high))
            axes.plot([low, high], [100 * p.avoided.value] * 2, color=colour, linewidth=0.7, alpha=0.4)
            low, high = (100 * e for e in (p.avoided.low, p.avoided.high))
            axes.plot([100 * p.stops.value] * 2, [low, high], color=colour, linewidth=0.7, alpha=0.4)
        axes.plot(x, y, color=colour, marker="o", markersize=3.5, linewidth=1.3)
        usual = [k for k, p in enumerate(own) if p.is_usual]
        axes.plot(
            [x[k] for k in usual], [y[k] for k in usual], linestyle="none", marker="o", markersize=8.5,
            markerfacecolor="none", markeredgecolor=colour,
        )  # fmt: skip
        axes.plot(
            [100 * p.stops.value for p in tuned], [100 * p.avoided.value for p in tuned], linestyle="none",
            marker="*", markersize=10.0, markerfacecolor=colour, markeredgecolor="white", markeredgewidth=0.6,
            zorder=4.0,
        )  # fmt: skip
        # named where it stands out: at its point of most unnecessary stops
        last = max(range(len(own)), key=lambda k: (x[k], y[k]))
        ends.append((x[last], y[last], rule, colour))
    _name_curves(axes, ends)
    axes.set_xlabel("unnecessary stops (% of nothing scenes)", fontsize=SMALL_PT)
    axes.set_ylabel("collisions avoided (% of must-brake scenes)", fontsize=SMALL_PT)
    figure.text(0.01, 0.95, f"Rules along their triggers: {where}", fontsize=FONT_PT)
    counts = f"{points[0].avoided.count} + {points[0].stops.count} scenes per point. " if points else ""
    starred = " Star: tuned on other scenes." if any(point.tuned for point in points) else ""
    figure.text(
        0.5, 0.02,
        f"{counts}Ringed: as the rule's source has it.{starred} Bars: their 95 % intervals. "
        "Up and to the left is better.",
        ha="center", fontsize=SMALL_PT - 1.0, color="#444444",
    )  # fmt: skip
    return figure


_NAME_PT = 10.0
"""Least distance of names one above the other."""


def _name_curves(axes: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Names at the right edge, each with a line to its curve, none on another."""
    figure = axes.figure
    height_pt = 72.0 * axes.get_window_extent().height / figure.dpi
    low, high = axes.get_ylim()
    step = (high - low) * _NAME_PT / height_pt
    places: list[float] = []
    for _, y, *_ in (ranked := sorted(ends, key=lambda end: end[1])):
        places.append(max(y, places[-1] + step) if places else y)
    over = max(0.0, (places[-1] if places else low) - high)
    right = axes.get_xlim()[1]
    for (x, y, name, colour), place in zip(ranked, places, strict=True):
        axes.annotate(
            name, (x, y), xytext=(right + 0.03 * (right - axes.get_xlim()[0]), place - over),
            textcoords="data", va="center", fontsize=SMALL_PT, color=colour, annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5, "alpha": 0.6, "shrinkB": 3.0},
        )  # fmt: skip
    axes.set_ylim(low, high)
    axes.set_xlim(axes.get_xlim()[0], right)
