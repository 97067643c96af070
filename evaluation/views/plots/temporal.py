"""Temporal diagram: events of each layer over time, above the ego's speed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from evaluation.views.plots.fitting import fitted, set_title
from evaluation.views.plots.labels import place_labels
from evaluation.views.plots.log_rows import TIME_TOLERANCE_S, Event, boxes_of, events_of, of_kind
from evaluation.views.plots.style import (
    BLACK,
    BLUE,
    FONT_PT,
    GREEN,
    GREY,
    MPS_TO_KMH,
    ORANGE,
    SMALL_PT,
    VERMILLION,
    WINE,
    new_figure,
    set_style,
)
from smartmot.geometry import signed_gap
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LAYERS = ("monitors", "unexpected", "selector", "start")
"""Layers of the event log, from the top of the temporal diagram to its bottom."""

LAYER_HEIGHTS = {layer: len(LAYERS) - 1 - rank for rank, layer in enumerate(LAYERS)}
"""Where the line of each layer is drawn, the lowest at 0."""

_EVENT_TEXTS = {"collision": "collision predicted"}
"""What the paper calls a collision is a prediction: nothing is hit then. The log keeps the paper's name."""

CAUSES = {
    "predicted_collision": "collision",
    "unexpected": "forecasted_pedestrian",
    "end_unexpected": "free_lane",
    "follow_path": "end_unexpected",
}
"""Event that each event answers to, drawn as an arrow."""

STATE_COLOURS = {
    "run_start": BLUE,
    "follow_path": GREEN,
    "unexpected": ORANGE,
    "forecasted_pedestrian": ORANGE,
    "predicted_collision": VERMILLION,
}
"""Colour of a layer from each event to the next; events without one begin no state."""

_STANDSTILL_MPS = 0.01
_CONTACT_GAP_M = 0.01

_HEIGHT_IN, _BELOW_IN, _EDGE_IN, _TITLE_IN = 4.1, 0.4715, 0.0615, 0.246
"""Of a figure with one line of heading: all, the time axis, the free edge above, and the heading."""
_TITLE_WIDTH_IN = 4.0


def temporal_diagram(log: pd.DataFrame, title: str | None = None) -> Figure:
    """Events of each layer over time, with causes and effects, above the ego's speed.

    A contact is the first time at which the boxes of ego and target touch in the log.

    Args:
        log: log of one run, as from `results.read_log`.
        title: heading, if any.
    """
    ego = of_kind(log, "ego").sort_values("time_s")
    events = of_kind(log, "event").sort_values("time_s", kind="stable")
    figure = new_figure(_HEIGHT_IN)
    heading = fitted(figure, title or "", _TITLE_WIDTH_IN)
    height_in = _HEIGHT_IN + heading.more_in
    figure.set_figheight(height_in)
    above_in = heading.more_in + (_TITLE_IN if title else 0.0)
    figure.subplots_adjust(
        left=0.155, right=0.885, bottom=_BELOW_IN / height_in, top=1.0 - (_EDGE_IN + above_in) / height_in,
        hspace=0.06,
    )  # fmt: skip
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1.0))
    set_style(above)
    set_style(below)
    if title:
        set_title(above, heading)
    start, end = time_range(ego, events)
    # room at the right for the names of what happens last
    below.set_xlim(start - 0.02 * (end - start), end + 0.14 * (end - start))
    _draw_layers(above, events, end)
    _draw_ego_speed(below, ego, contact_time(log))
    return figure


def event_text(name: str) -> str:
    """How an event of the log is shown."""
    return _EVENT_TEXTS.get(name, name)


def time_range(ego: pd.DataFrame, events: pd.DataFrame) -> tuple[float, float]:
    """First and last time of a run, never equal."""
    times = [*ego["time_s"], *events["time_s"]]
    if not times:
        return 0.0, 1.0
    return min(times), max(max(times), min(times) + 1e-3)


def _draw_layers(axes: Axes, events: pd.DataFrame, end_s: float) -> None:
    """One line per layer with its states, its events as markers and the arrows between layers."""
    height = {layer: float(rank) for layer, rank in LAYER_HEIGHTS.items()}
    axes.set_ylim(-0.75, len(LAYERS) - 0.25)
    axes.set_yticks([height[layer] for layer in LAYERS], [layer.capitalize() for layer in LAYERS])
    axes.tick_params(axis="both", length=0, labelbottom=False)
    known = events_of(events, height)
    for time, until, layer, name in states_of(known, end_s):
        axes.plot(
            [time, until], [height[layer]] * 2, color=STATE_COLOURS[name], linewidth=3.0,
            solid_capstyle="butt", gid="state",
        )  # fmt: skip
    for time, layer, name in known:
        _draw_event(axes, time, height[layer], name, instant=layer == "monitors")
    lines = [
        ((t0, height[above]), (t1, height[layer])) for (t0, above, _), (t1, layer, _) in arrows_of(known)
    ]
    for arrow in lines:
        _draw_arrow(axes, *arrow)
    if known:
        lines += [((float(events["time_s"].min()), h), (end_s, h)) for h in height.values()]
    texts = [(time, height[layer], event_text(name)) for time, layer, name in known]
    place_labels(axes, texts, lines, offsets_pt=(7.5, 16.5), leaders=True)


def states_of(events: Sequence[Event], end_s: float) -> Iterator[tuple[float, float, str, str]]:
    """Beginning, end, layer and name of each state, which lasts to the layer's next event or to the end."""
    for layer in LAYERS:
        of_layer = [event for event in events if event[1] == layer]
        for (time, _, name), (until, _, _) in itertools.pairwise([*of_layer, (end_s, layer, "")]):
            if name in STATE_COLOURS:
                yield time, until, layer, name


def _draw_event(axes: Axes, time_s: float, height: float, name: str, *, instant: bool) -> None:
    """Marker of an event: a cross for what is over at once, a square for the start of a state."""
    axes.plot(
        [time_s], [height], marker="X" if instant else "s", markersize=6.0 if instant else 5.0,
        color=BLUE if instant else STATE_COLOURS.get(name, GREY), markeredgecolor="white",
        markeredgewidth=0.5, linestyle="none", zorder=4, gid="event",
    )  # fmt: skip


def _draw_arrow(axes: Axes, tail: tuple[float, float], head: tuple[float, float]) -> None:
    style = {
        "arrowstyle": "->", "linestyle": (0, (3, 2)), "linewidth": 0.9, "color": "#333333", "shrinkA": 3.0,
        "shrinkB": 3.0,
    }  # fmt: skip
    axes.annotate("", xy=head, xytext=tail, arrowprops=style, gid="cause", zorder=3)


def arrows_of(events: Sequence[Event]) -> list[tuple[Event, Event]]:
    """Each event that answers to one of a layer above, after the last such event that is not later."""
    arrows = []
    for event in events:
        time_s, layer, name = event
        causes = [e for e in events if e[2] == CAUSES.get(name) and e[0] <= time_s + TIME_TOLERANCE_S]
        if causes and LAYER_HEIGHTS[causes[-1][1]] > LAYER_HEIGHTS[layer]:
            arrows.append((causes[-1], event))
    return arrows


def _draw_ego_speed(axes: Axes, ego: pd.DataFrame, contact_s: float | None) -> None:
    """Speed over time, with contact or stop marked."""
    time, speed = ego["time_s"].to_numpy(float), ego["speed_mps"].to_numpy(float)
    axes.plot(time, speed, color=WINE, linewidth=1.4, gid="speed")
    axes.set_ylim(0.0, 1.18 * max(float(speed.max(initial=0.0)), 1.0))
    axes.set_xlabel("Time (s)", fontsize=FONT_PT)
    axes.set_ylabel("Ego speed (m/s)", fontsize=FONT_PT)
    right = axes.secondary_yaxis("right", functions=(_mps_to_kmh, _kmh_to_mps))
    right.set_ylabel("Ego speed (km/h)", fontsize=FONT_PT)
    right.tick_params(labelsize=SMALL_PT)
    marks = []
    stop = stop_time(time, speed)
    if contact_s is not None:
        at_contact = float(np.interp(contact_s, time, speed))
        marks.append((contact_s, at_contact, f"contact {at_contact * MPS_TO_KMH:.1f} km/h", "o", VERMILLION))
    if stop is not None and (contact_s is None or stop > contact_s):
        marks.append((stop, 0.0, "stop", "s", BLACK))
    for x, y, text, marker, colour in marks:
        axes.plot(
            [x], [y], marker=marker, markersize=6.0, markerfacecolor="white", markeredgecolor=colour,
            linestyle="none", clip_on=False, zorder=5, gid=text.split()[0],
        )  # fmt: skip
    curve = np.column_stack([time, speed])
    pieces = np.stack([curve[:-1], curve[1:]], axis=1)
    place_labels(axes, [mark[:3] for mark in marks], pieces, offsets_pt=(8.0, 18.0, 28.0))


def _mps_to_kmh(speed: ArrayLike) -> FloatArray:
    return np.asarray(speed, dtype=np.float64) * MPS_TO_KMH


def _kmh_to_mps(speed: ArrayLike) -> FloatArray:
    return np.asarray(speed, dtype=np.float64) / MPS_TO_KMH


def stop_time(time_s: FloatArray, speed_mps: FloatArray) -> float | None:
    """First standstill after driving."""
    moved = np.logical_or.accumulate(speed_mps > _STANDSTILL_MPS)
    stopped = np.flatnonzero(moved & (speed_mps <= _STANDSTILL_MPS))
    return float(time_s[stopped[0]]) if len(stopped) else None


def contact_time(log: pd.DataFrame) -> float | None:
    """First time at which the boxes of ego and target touch."""
    actors = of_kind(log, "actor")
    targets = actors[actors["label"] == "target"]
    both = of_kind(log, "ego").merge(targets, on="time_s", suffixes=("", "_target")).sort_values("time_s")
    if both.empty:
        return None
    gap = np.maximum(signed_gap(*boxes_of(both), *boxes_of(both, "_target")), 0.0)
    # The frame just before the contact may lie within the tolerance too: the smallest gap is the contact.
    closest = int(np.argmin(gap))
    return float(both["time_s"].iloc[closest]) if gap[closest] <= _CONTACT_GAP_M else None
