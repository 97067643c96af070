"""Speed over the time to stop or contact, a curve per run."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.results.files import ResultsError
from evaluation.results.rows import ordered_strategies, varying_conditions
from evaluation.views.plots.fitting import fitted, set_title, wrapped
from evaluation.views.plots.log_rows import TIME_TOLERANCE_S, of_kind
from evaluation.views.plots.strategies import strategy_looks
from evaluation.views.plots.style import (
    BLACK,
    BLUE,
    FONT_PT,
    GREEN,
    MPS_TO_KMH,
    ORANGE,
    PURPLE,
    SKY,
    SMALL_PT,
    VERMILLION,
    WIDTH_IN,
    WINE,
    LineStyle,
    new_figure,
    set_style,
)
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

SPEED_COLOURS = (BLUE, VERMILLION, ORANGE, PURPLE, GREEN, SKY, WINE, BLACK)
"""Colours of the test speeds 10, 20, ... 80 km/h; speeds between them are dashed."""

_LEGEND_COLUMNS, _LEGEND_LINE_IN, _TITLE_IN = 5, 0.16, 0.3
"""Entries in a line of the legend above the panels, its height, and what the panels' titles need."""

_LEFT, _RIGHT, _ACROSS, _UP = 0.105, 0.98, 0.14, 0.2
"""Where the panels begin and end, of the figure's width, and what is between them, of a panel's size."""
_BELOW_IN = 0.42
"""What the time axis of the lowest panels needs."""

_TIME_STEPS_S, _MOST_TICKS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0), 5
"""Steps of a time axis, and how many of them a panel has room for."""

_EARLIEST_S = -1.5
"""Curves begin at least this long before stop or contact, as figure 5 of the paper does."""

_PANEL_CONDITIONS = ("scenario", "preset", "weather", "adversaries")
_ADVERSARY_WORDS = {"none": "alone", "static": "with others"}


def speed_style(v_test_kmh: float) -> tuple[str, LineStyle]:
    """Colour and line style of a test speed, the same in every picture."""
    tens = int(v_test_kmh // 10)
    return SPEED_COLOURS[(tens - 1) % len(SPEED_COLOURS)], "-" if v_test_kmh % 10 == 0 else "--"


def speed_curves(runs: pd.DataFrame, logs: Mapping[str, pd.DataFrame]) -> Figure:
    """Speed over the time to stop or contact, a panel per strategy, a curve per test speed.

    A cross marks the request of the emergency brake, an open circle a contact. Runs that differ in
    scenario, preset, weather or adversaries get panels of their own; seeds share one.

    Args:
        runs: table of runs, as from `results.read_runs`.
        logs: log of each run by the name in column `log`; runs without log or T0 are left out.

    Raises:
        ResultsError: there are no runs.
    """
    if runs.empty:
        raise ResultsError("speed curves: the table of runs is empty; run at least one test")
    panels = panels_of(runs)
    looks = strategy_looks(map(str, runs["strategy"]))
    strategies = len(ordered_strategies(runs))
    columns = min(strategies if strategies in (2, 3) else 2, len(panels))
    lines = math.ceil(len(panels) / columns)
    handles = _legend_handles(sorted({float(speed) for speed in runs["v_test_kmh"]}))
    legend_columns = min(math.ceil(len(handles) / 2), _LEGEND_COLUMNS)
    above_in = _TITLE_IN + _LEGEND_LINE_IN * math.ceil(len(handles) / legend_columns)
    figure = new_figure(1.0)
    width_in = WIDTH_IN * (_RIGHT - _LEFT) / (columns + _ACROSS * (columns - 1))
    headings = [
        fitted(figure, f"({_letter(k)}) {name}", (1.0 + 0.8 * _ACROSS) * width_in)
        for k, (name, _) in enumerate(panels)
    ]
    more_in = max(heading.more_in for heading in headings)
    above_in += more_in
    panel_in = _panels_in(lines) / (lines + _UP * (lines - 1))
    height_in = _BELOW_IN + _panels_in(lines) + more_in * (lines - 1) + above_in
    figure.set_figheight(height_in)
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(
        left=_LEFT, right=_RIGHT, bottom=_BELOW_IN / height_in, top=1.0 - above_in / height_in,
        wspace=_ACROSS, hspace=_UP + more_in / panel_in,
    )  # fmt: skip
    drawn, earliest, top = curves_of(runs, logs)
    for number, (axes, (_, rows)) in enumerate(zip(grid.flat, panels, strict=False)):
        set_title(axes, headings[number])
        _set_scales(axes, earliest, top)
        axes.spines["top"].set(color=looks[str(rows["strategy"].iloc[0])][0], linewidth=2.5)
        for row in rows[rows.index.isin(drawn.index)].sort_values("v_test_kmh").to_dict("records"):
            _draw_speed_curve(axes, row, logs[row["log"]], earliest)
        _note_undrawn(axes, rows[rows["t0_s"].isna()], width_in)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("Time to T0 (s)", fontsize=FONT_PT)
    for axes in grid[:, 0]:
        axes.set_ylabel("Vehicle speed (km/h)", fontsize=FONT_PT)
    figure.legend(
        handles=handles, loc="upper center", ncols=legend_columns, fontsize=SMALL_PT, frameon=False,
        columnspacing=1.2, handlelength=1.6, borderaxespad=0.2,
    )  # fmt: skip
    return figure


def _panels_in(lines: int) -> float:
    """Height of panels above one another with one line of heading each, inches."""
    return 2.15 * lines - 0.14


def _letter(number: int) -> str:
    """How a panel is called."""
    return chr(ord("a") + number) if number < 26 else str(number + 1)


def curves_of(runs: pd.DataFrame, logs: Container[str]) -> tuple[pd.DataFrame, float, float]:
    """Runs that have a curve, where the time axis begins (s) and where the speed axis ends (km/h).

    All requests of the brake are in view.
    """
    drawn = runs[runs["t0_s"].notna() & runs["log"].map(lambda name: name in logs)]
    flags = (drawn["flag_time_s"] - drawn["t0_s"]).dropna()
    earliest = min(_EARLIEST_S, float(flags.min()) - 0.3) if len(flags) else _EARLIEST_S
    return drawn, earliest, 10.0 * math.ceil((float(runs["v_test_kmh"].max()) + 2.0) / 10.0)


def panels_of(runs: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Runs of each panel with its name: strategies within each set of conditions."""
    conditions = varying_conditions(runs, _PANEL_CONDITIONS)
    groups = runs.groupby(conditions, sort=True) if conditions else [((), runs)]
    panels = []
    for values, group in groups:
        words = [
            _ADVERSARY_WORDS.get(str(value), str(value)) if condition == "adversaries" else str(value)
            for condition, value in zip(conditions, values, strict=True)
        ]
        panels += [
            (", ".join([strategy, *words]), group[group["strategy"] == strategy])
            for strategy in ordered_strategies(group)
        ]
    return panels


def time_step(duration_s: float) -> float:
    """Seconds between the ticks of a time axis, so that their labels stand apart."""
    return next((step for step in _TIME_STEPS_S if duration_s <= _MOST_TICKS * step), _TIME_STEPS_S[-1])


def _set_scales(axes: Axes, earliest_s: float, top_kmh: float) -> None:
    """Limits, ticks and grid of a panel."""
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    set_style(axes)
    axes.set_xlim(earliest_s, 0.0)
    step = time_step(-earliest_s)
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.xaxis.set_major_formatter(FuncFormatter(_short_number))
    axes.xaxis.set_minor_locator(MultipleLocator(step / 2))
    axes.yaxis.set_major_locator(MultipleLocator(10.0))
    axes.set_ylim(0.0, top_kmh)


def _short_number(value: float, _position: object) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


Point = tuple[float, float]
"""Time relative to T0 in seconds, and speed in km/h."""


def speed_before_t0(
    run: Mapping[Any, Any], log: pd.DataFrame, earliest_s: float
) -> tuple[FloatArray, FloatArray, Point | None, Point | None]:
    """Speed of a run up to its stop or contact, which ends the curve with the speed then.

    Args:
        run: its row in the table of runs, with a T0.
        log: its log.
        earliest_s: where the time axis begins.

    Returns:
        (N,) time relative to T0 in seconds, rising to 0, and (N,) speed in km/h; the request of the brake
        and the contact, if there were any.
    """
    ego = of_kind(log, "ego").sort_values("time_s")
    time = ego["time_s"].to_numpy(float) - float(run["t0_s"])
    speed = ego["speed_mps"].to_numpy(float) * MPS_TO_KMH
    before = time < -TIME_TOLERANCE_S
    final = float(run["v_impact_kmh"]) if run["collided"] else 0.0
    time, speed = np.append(time[before], 0.0), np.append(speed[before], final)
    flag = None
    if not math.isnan(run["flag_time_s"]):
        flag_s = float(run["flag_time_s"] - run["t0_s"])
        flag = (flag_s, float(np.interp(flag_s, time, speed)))
    contact = (0.0, float(speed[-1])) if run["collided"] else None
    # one row before the left edge is kept, so that the curve begins at it
    first = max(int(np.searchsorted(time, earliest_s)) - 1, 0)
    return time[first:], speed[first:], flag, contact


def _draw_speed_curve(axes: Axes, run: Mapping[Any, Any], log: pd.DataFrame, earliest_s: float) -> None:
    colour, style = speed_style(float(run["v_test_kmh"]))
    time, speed, flag, contact = speed_before_t0(run, log, earliest_s)
    axes.plot(time, speed, color=colour, linestyle=style, linewidth=1.3, gid="curve")
    mark: dict[str, Any] = {"markersize": 6.0, "color": colour, "clip_on": False}
    if flag is not None:
        axes.plot(*flag, marker="x", markeredgewidth=1.8, gid="flag", **mark)
    if contact is not None:
        axes.plot(
            *contact,
            marker="o",
            markerfacecolor="white",
            markeredgewidth=1.4,
            gid="contact",
            zorder=5,
            **mark,
        )


def _note_undrawn(axes: Axes, runs: pd.DataFrame, width_in: float) -> None:
    """Name the test speeds that end in neither stop nor contact, which have no T0."""
    speeds = sorted({float(speed) for speed in runs["v_test_kmh"]})
    if speeds:
        figure = axes.get_figure(root=True)
        assert figure is not None
        names = ", ".join(f"{speed:g}" for speed in speeds)
        text = wrapped(figure, f"no emergency stop, no contact:\n{names} km/h", 0.94 * width_in, SMALL_PT)
        note = axes.text(0.03, 0.03, text, transform=axes.transAxes, fontsize=SMALL_PT, color="#333333")
        # curves of low speeds pass behind it
        note.set_bbox({"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.0})


def _legend_handles(speeds_kmh: Sequence[float]) -> list[Line2D]:
    """What the legend above the panels shows: test speeds and marks."""
    from matplotlib.lines import Line2D

    handles = []
    for speed in speeds_kmh:
        colour, style = speed_style(speed)
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=1.6, label=f"{speed:g} km/h"))
    mark: dict[str, Any] = {"color": "#333333", "linestyle": "none", "markersize": 6.0}
    handles.append(Line2D([], [], marker="x", markeredgewidth=1.8, label="brake requested", **mark))
    handles.append(Line2D([], [], marker="o", markerfacecolor="white", label="contact", **mark))
    return handles
