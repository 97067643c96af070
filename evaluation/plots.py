"""Pictures of runs: the sequence of events, speed before stop or contact, the scene from above, the map.

Every function returns a `matplotlib.figure.Figure` that belongs to nobody else: no pyplot, no global state.
Sizes are chosen so that the texts stay readable when a figure is printed 85 mm wide. Colours are safe for
colour-blind readers (Okabe and Ito) and stand for the same thing in every picture.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evaluation.results import ResultsError, ordered_strategies, varying_conditions

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

FloatArray = NDArray[np.float64]
Area = tuple[str, FloatArray]
Pose = tuple[float, float, float]
Rectangle = tuple[float, float, float, float]
LineStyle = Literal["-", "--", ":"]
Segment = tuple[tuple[float, float], tuple[float, float]]

BLACK, GREY = "#000000", "#8c8c8c"
BLUE, SKY, GREEN = "#0072b2", "#56b4e9", "#009e73"
ORANGE, VERMILLION, PURPLE, WINE = "#e69f00", "#d55e00", "#cc79a7", "#882255"

SPEED_COLOURS = (BLUE, VERMILLION, ORANGE, PURPLE, GREEN, SKY, WINE, BLACK)
"""Colours of the test speeds 10, 20, ... 80 km/h; speeds between them are dashed."""

LAYERS = ("monitors", "unexpected", "selector", "start")
"""Layers of the event log, from the top of the temporal diagram to its bottom."""

CAUSES = {
    "predicted_collision": "collision",
    "unexpected": "forecasted_pedestrian",
    "end_unexpected": "free_lane",
    "follow_path": "end_unexpected",
}
"""Event that each event answers to, drawn as an arrow."""

AREA_COLOURS = {
    "current": BLUE,
    "back": SKY,
    "left": GREEN,
    "right": PURPLE,
    "split": ORANGE,
    "merge": WINE,
    "cross": VERMILLION,
    "vru_margin": "#b5a500",
    "rectangle": BLUE,
    "all": GREY,
}
"""Colours of the monitored areas by role."""

LANE_COLOURS = {
    "driving": "#d2d2d2",
    "sidewalk": "#f0dfc0",
    "shoulder": "#e9e9e0",
    "biking": "#e2cfe8",
    "parking": "#c9deee",
    "median": "#d0e6c2",
    "border": "#f1f1f1",
    "restricted": "#ead9d3",
    "stop": "#e6e6e6",
    "entry": "#c9c9c9",
    "exit": "#c9c9c9",
    "bidirectional": "#c3c7d4",
}
"""Light fills of the lane types; others share one tone."""

_OTHER_LANE = "#f7f7f7"
_STATE_COLOURS = {
    "run_start": BLUE,
    "follow_path": GREEN,
    "unexpected": ORANGE,
    "forecasted_pedestrian": ORANGE,
    "predicted_collision": VERMILLION,
}
_TRACK_COLOURS = {"static": BLUE, "dynamic": GREEN, "threat": VERMILLION}
_BOX = ("x_m", "y_m", "yaw_rad", "length_m", "width_m")
_WIDTH_IN = 5.0
_LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN = 0.62, 0.15, 0.28, 0.5
_TALLEST_IN = 5.0
_LEGEND_COLUMNS, _LEGEND_LINE_IN = 4, 0.135
_FONT_PT = 9.0
_SMALL_PT = 8.0
_KMH = 3.6
_STANDSTILL_MPS = 0.01
_CONTACT_GAP_M = 0.01
_TIME_TOLERANCE_S = 1e-6
_REPEAT_COST = 2.0
_PANEL_CONDITIONS = ("scenario", "preset", "weather", "adversaries")
_ADVERSARY_WORDS = {"none": "alone", "static": "with others"}


class LaneTable(Protocol):
    """What the pictures need of a network's lanes: one entry per lane and section."""

    @property
    def lane_type(self) -> Any:
        """Type of each lane, as text."""

    @property
    def s_start_m(self) -> Any:
        """Where each lane begins along its road."""

    @property
    def s_end_m(self) -> Any:
        """Where each lane ends along its road."""


class MapView(Protocol):
    """What the pictures need of a road network."""

    def __hash__(self) -> int:
        """Outlines of lanes are kept by network, so that a second picture is quick."""

    @property
    def lanes(self) -> LaneTable:
        """The lanes."""

    @property
    def crosswalks(self) -> Any:
        """Records with a `polygon` (P, 2), map frame, metres."""

    def lane_polygon(self, lane: int, s0_m: float, s1_m: float, /) -> FloatArray:
        """(P, 2) outline of a stretch of a lane, map frame, metres."""


def speed_style(v_test_kmh: float) -> tuple[str, LineStyle]:
    """Colour and line style that stand for a test speed in every picture."""
    tens = int(v_test_kmh // 10)
    return SPEED_COLOURS[(tens - 1) % len(SPEED_COLOURS)], "-" if v_test_kmh % 10 == 0 else "--"


# Temporal diagram


def temporal_diagram(
    log: pd.DataFrame, title: str | None = None, *, contact_time_s: float | None = None
) -> Figure:
    """Events of each layer over time, with causes and effects, above the ego's speed.

    Args:
        log: log of one run, as from `results.read_log`.
        title: heading, if any.
        contact_time_s: time of contact. Without it, the first time at which the boxes of ego and target
            touch in the log.
    """
    ego = _of_kind(log, "ego").sort_values("time_s")
    events = _of_kind(log, "event").sort_values("time_s", kind="stable")
    figure = _figure(4.1)
    figure.subplots_adjust(left=0.155, right=0.885, bottom=0.115, top=0.925 if title else 0.985, hspace=0.06)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1.0))
    _style(above)
    _style(below)
    if title:
        _set_title(above, title, room=58)
    start, end = _time_range(ego, events)
    margin = 0.02 * (end - start)
    below.set_xlim(start - margin, end + margin)
    _draw_layers(above, events, end)
    _draw_ego_speed(below, ego, _contact_time(log) if contact_time_s is None else contact_time_s)
    return figure


def _draw_layers(axes: Axes, events: pd.DataFrame, end_s: float) -> None:
    """One line per layer with its states, its events as markers and the arrows between layers."""
    height = {layer: float(len(LAYERS) - 1 - rank) for rank, layer in enumerate(LAYERS)}
    axes.set_ylim(-0.75, len(LAYERS) - 0.25)
    axes.set_yticks([height[layer] for layer in LAYERS], [layer.capitalize() for layer in LAYERS])
    axes.tick_params(axis="both", length=0, labelbottom=False)
    known = [
        (float(time), str(layer), str(name))
        for time, layer, name in zip(events["time_s"], events["category"], events["label"], strict=True)
        if layer in height
    ]
    for layer in LAYERS:
        _draw_states(axes, [(t, name) for t, one, name in known if one == layer], height[layer], end_s)
    blocked = []
    for time, layer, name in known:
        instant = layer == "monitors"
        colour = SKY if instant else _STATE_COLOURS.get(name, GREY)
        axes.plot(
            [time],
            [height[layer]],
            marker="X" if instant else "s",
            markersize=6.0 if instant else 5.0,
            color=BLUE if instant else colour,
            markeredgecolor="white",
            markeredgewidth=0.5,
            linestyle="none",
            zorder=4,
            gid="event",
        )
        cause = _latest_cause(known, CAUSES.get(name), time)
        if cause is not None and height[cause[1]] > height[layer]:
            ends = ((cause[0], height[cause[1]]), (time, height[layer]))
            _draw_arrow(axes, *ends)
            blocked.append(ends)
    lines = [((events["time_s"].min(), h), (end_s, h)) for h in height.values()] if known else []
    texts = [(time, height[layer], name) for time, layer, name in known]
    _place_labels(axes, texts, blocked + lines, offsets_pt=(7.5, 16.5), leaders=True)


def _draw_states(axes: Axes, states: Sequence[tuple[float, str]], height: float, end_s: float) -> None:
    """The line of one layer: coloured from each event to the next, and to the end while a state lasts."""
    for (time, name), (until, _) in itertools.pairwise([*states, (end_s, "")]):
        if name in _STATE_COLOURS:
            axes.plot(
                [time, until],
                [height, height],
                color=_STATE_COLOURS[name],
                linewidth=3.0,
                solid_capstyle="butt",
                gid="state",
            )


def _draw_arrow(axes: Axes, tail: tuple[float, float], head: tuple[float, float]) -> None:
    axes.annotate(
        "",
        xy=head,
        xytext=tail,
        arrowprops={
            "arrowstyle": "->",
            "linestyle": (0, (3, 2)),
            "linewidth": 0.9,
            "color": "#333333",
            "shrinkA": 3.0,
            "shrinkB": 3.0,
        },
        gid="cause",
        zorder=3,
    )


def _latest_cause(
    events: Sequence[tuple[float, str, str]], name: str | None, time_s: float
) -> tuple[float, str] | None:
    """Time and layer of the last event of that name not after a time."""
    found = [
        (time, layer) for time, layer, one in events if one == name and time <= time_s + _TIME_TOLERANCE_S
    ]
    return found[-1] if found else None


def _draw_ego_speed(axes: Axes, ego: pd.DataFrame, contact_s: float | None) -> None:
    time, speed = ego["time_s"].to_numpy(float), ego["speed_mps"].to_numpy(float)
    axes.plot(time, speed, color=WINE, linewidth=1.4, gid="speed")
    top = 1.18 * max(float(speed.max(initial=0.0)), 1.0)
    axes.set_ylim(0.0, top)
    axes.set_xlabel("Time (s)", fontsize=_FONT_PT)
    axes.set_ylabel("Ego speed (m/s)", fontsize=_FONT_PT)
    right = axes.secondary_yaxis("right", functions=(_mps_to_kmh, _kmh_to_mps))
    right.set_ylabel("Ego speed (km/h)", fontsize=_FONT_PT)
    right.tick_params(labelsize=_SMALL_PT)
    marks = []
    stop = _stop_time(time, speed)
    if contact_s is not None:
        at_contact = float(np.interp(contact_s, time, speed))
        text = f"contact {at_contact * _KMH:.1f} km/h"
        marks.append((contact_s, at_contact, text, "o", VERMILLION))
    if stop is not None and (contact_s is None or stop > contact_s):
        marks.append((stop, 0.0, "stop", "s", BLACK))
    for x, y, text, marker, colour in marks:
        axes.plot(
            [x],
            [y],
            marker=marker,
            markersize=6.0,
            markerfacecolor="white",
            markeredgecolor=colour,
            linestyle="none",
            clip_on=False,
            zorder=5,
            gid=text.split()[0],
        )
    curve = list(itertools.pairwise(zip(time.tolist(), speed.tolist(), strict=True)))
    _place_labels(axes, [mark[:3] for mark in marks], curve, offsets_pt=(8.0, 18.0, 28.0))


def _mps_to_kmh(speed: ArrayLike) -> FloatArray:
    return np.asarray(speed, dtype=np.float64) * _KMH


def _kmh_to_mps(speed: ArrayLike) -> FloatArray:
    return np.asarray(speed, dtype=np.float64) / _KMH


def _stop_time(time_s: FloatArray, speed_mps: FloatArray) -> float | None:
    """First standstill after driving."""
    moved = np.maximum.accumulate(speed_mps > _STANDSTILL_MPS) if len(speed_mps) else np.zeros(0, dtype=bool)
    stopped = np.flatnonzero(moved & (speed_mps <= _STANDSTILL_MPS))
    return float(time_s[stopped[0]]) if len(stopped) else None


def _contact_time(log: pd.DataFrame) -> float | None:
    """First time at which the boxes of ego and target touch; the target is followed between its rows."""
    import shapely

    ego = _of_kind(log, "ego").sort_values("time_s")
    actors = _of_kind(log, "actor")
    target = actors[actors["label"] == "target"].sort_values("time_s")
    if ego.empty or target.empty:
        return None
    time, known = ego["time_s"].to_numpy(float), target["time_s"].to_numpy(float)
    there = (time >= known[0] - _TIME_TOLERANCE_S) & (time <= known[-1] + _TIME_TOLERANCE_S)
    box = {
        name: np.interp(time, known, target[name].to_numpy(float))
        for name in ("x_m", "y_m", "length_m", "width_m")
    }
    box["yaw_rad"] = np.interp(time, known, np.unwrap(target["yaw_rad"].to_numpy(float)))
    ours = shapely.polygons(_corners(*(ego[name].to_numpy(float) for name in _BOX)))
    theirs = shapely.polygons(_corners(*(box[name] for name in _BOX)))
    gap = np.where(there, shapely.distance(ours, theirs), np.inf)
    # The frame just before the contact may lie within the tolerance too: the smallest gap is the contact.
    closest = int(np.argmin(gap))
    return float(time[closest]) if gap[closest] <= _CONTACT_GAP_M else None


def _time_range(ego: pd.DataFrame, events: pd.DataFrame) -> tuple[float, float]:
    times = [*ego["time_s"], *events["time_s"]]
    if not times:
        return 0.0, 1.0
    return min(times), max(max(times), min(times) + 1e-3)


# Speed curves


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
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    if runs.empty:
        raise ResultsError("speed curves: the table of runs is empty; run at least one test")
    panels = _panels(runs)
    strategies = len(ordered_strategies(runs))
    columns = min(strategies if strategies in (2, 3) else 2, len(panels))
    lines = math.ceil(len(panels) / columns)
    figure = _figure(0.9 + 2.15 * lines)
    grid = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    left, right = 0.105, 0.98
    figure.subplots_adjust(
        left=left, right=right, bottom=0.42 / figure.get_figheight(), top=1.0 - 0.62 / figure.get_figheight()
    )
    figure.subplots_adjust(wspace=0.14, hspace=0.2)
    drawn = runs[runs["t0_s"].notna() & runs["log"].isin(list(logs))]
    flags = (drawn["flag_time_s"] - drawn["t0_s"]).dropna()
    earliest = min(-1.5, float(flags.min()) - 0.3) if len(flags) else -1.5
    top = 10.0 * math.ceil((float(runs["v_test_kmh"].max()) + 2.0) / 10.0)
    for number, (axes, (name, rows)) in enumerate(zip(grid.flat, panels, strict=False)):
        letter = chr(ord("a") + number) if number < 26 else str(number + 1)
        _set_title(axes, f"({letter}) {name}", room=30)
        _style(axes)
        axes.set_xlim(earliest, 0.0)
        axes.xaxis.set_major_locator(MultipleLocator(0.5))
        axes.xaxis.set_major_formatter(FuncFormatter(_short_number))
        axes.xaxis.set_minor_locator(MultipleLocator(0.25))
        axes.yaxis.set_major_locator(MultipleLocator(10.0))
        axes.set_ylim(0.0, top)
        for row in rows.sort_values("v_test_kmh").to_dict("records"):
            if row["log"] in logs and not math.isnan(row["t0_s"]):
                _draw_speed_curve(axes, row, logs[str(row["log"])], earliest)
        _note_undrawn(axes, rows[rows["t0_s"].isna()])
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("Time to T0 (s)", fontsize=_FONT_PT)
    for axes in grid[:, 0]:
        axes.set_ylabel("Vehicle speed (km/h)", fontsize=_FONT_PT)
    _speed_legend(figure, sorted({float(speed) for speed in runs["v_test_kmh"]}))
    return figure


def _short_number(value: float, _position: object) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def _panels(runs: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
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


def _draw_speed_curve(axes: Axes, run: Mapping[Any, Any], log: pd.DataFrame, earliest_s: float) -> None:
    colour, style = speed_style(float(run["v_test_kmh"]))
    ego = _of_kind(log, "ego").sort_values("time_s")
    time = ego["time_s"].to_numpy(float) - float(run["t0_s"])
    speed = ego["speed_mps"].to_numpy(float) * _KMH
    before = time < -_TIME_TOLERANCE_S
    final = float(run["v_impact_kmh"]) if run["collided"] else 0.0
    time, speed = np.append(time[before], 0.0), np.append(speed[before], final)
    # One row before the left edge is kept, so that the curve begins at it.
    first = max(int(np.searchsorted(time, earliest_s)) - 1, 0)
    axes.plot(
        time[first:], speed[first:], color=colour, linestyle=style, linewidth=1.3, gid="curve", label="_curve"
    )
    if not math.isnan(run["flag_time_s"]):
        flag = float(run["flag_time_s"]) - float(run["t0_s"])
        at_flag = float(np.interp(flag, time, speed))
        axes.plot(
            [flag],
            [at_flag],
            marker="x",
            markersize=6.0,
            markeredgewidth=1.8,
            color=colour,
            gid="flag",
            clip_on=False,
        )
    if run["collided"]:
        axes.plot(
            [0.0],
            [final],
            marker="o",
            markersize=6.0,
            markerfacecolor="white",
            markeredgewidth=1.4,
            color=colour,
            gid="contact",
            clip_on=False,
            zorder=5,
        )


def _note_undrawn(axes: Axes, runs: pd.DataFrame) -> None:
    """Names the test speeds that end in neither stop nor contact, which have no T0."""
    speeds = sorted({float(speed) for speed in runs["v_test_kmh"]})
    if speeds:
        text = "no stop or contact:\n" + ", ".join(f"{speed:g}" for speed in speeds) + " km/h"
        axes.text(0.03, 0.03, text, transform=axes.transAxes, fontsize=_SMALL_PT, color="#333333")


def _speed_legend(figure: Figure, speeds_kmh: Sequence[float]) -> None:
    from matplotlib.lines import Line2D

    handles = []
    for speed in speeds_kmh:
        colour, style = speed_style(speed)
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=1.6, label=f"{speed:g} km/h"))
    mark = {"color": "#333333", "linestyle": "none", "markersize": 6.0}
    handles.append(Line2D([], [], marker="x", markeredgewidth=1.8, label="collision flag", **mark))  # type: ignore[arg-type]
    handles.append(Line2D([], [], marker="o", markerfacecolor="white", label="contact", **mark))  # type: ignore[arg-type]
    _legend_above(figure, handles, columns=min(math.ceil(len(handles) / 2), 5))


# Scene and map


def birdseye(
    network: MapView,
    log: pd.DataFrame,
    time_s: float,
    areas: Sequence[Area],
    title: str | None = None,
    *,
    half_size_m: float = 25.0,
) -> Figure:
    """The scene around the ego at one frame, from above, the ego driving to the right.

    Args:
        network: the map, an `opendrive` network.
        log: log of one run, as from `results.read_log`.
        time_s: the frame nearest to this time is shown.
        areas: role and outline (P, 2) of each monitored area, map frame, metres.
        title: heading; by default the time of the frame and the ego's speed.
        half_size_m: half the length of the view, which reaches further ahead of the ego than behind it.

    Raises:
        ResultsError: the log holds no ego.
    """
    frame = _frame_at(log, time_s)
    ego = _of_kind(frame, "ego").iloc[-1]
    pose = (float(ego["x_m"]), float(ego["y_m"]), float(ego["yaw_rad"]))
    view = (-0.4 * half_size_m, -0.55 * half_size_m, 1.6 * half_size_m, 0.55 * half_size_m)
    figure, axes = _scene_axes(view)
    axes.set_xlabel("Ahead of ego (m)", fontsize=_FONT_PT)
    axes.set_ylabel("Left of ego (m)", fontsize=_FONT_PT)
    heading = f"t = {float(ego['time_s']):.2f} s, ego at {float(ego['speed_mps']) * _KMH:.1f} km/h"
    _set_title(axes, heading if title is None else title, room=62)
    handles = _draw_map(axes, network, pose, view) + _draw_areas(axes, areas, pose)
    handles += _draw_objects(axes, frame, pose)
    _legend_below(figure, handles)
    return figure


def map_picture(
    network: MapView,
    areas: Sequence[Area] = (),
    ego_pose: Pose | None = None,
    title: str | None = None,
    *,
    half_size_m: float | None = None,
) -> Figure:
    """The map in its own frame, with lanes by type, and monitored areas and the ego if given.

    Args:
        network: the map, an `opendrive` network.
        areas: role and outline (P, 2) of each monitored area, map frame, metres.
        ego_pose: x, y in metres and yaw in radians.
        title: heading, if any.
        half_size_m: half the side of the square around the ego that is shown. Without it, or without an ego,
            the surroundings of the areas, and the whole map if there are none.
    """
    origin = (0.0, 0.0, 0.0)
    if half_size_m is not None and ego_pose is not None:
        x, y, _ = ego_pose
        view = (x - half_size_m, y - half_size_m, x + half_size_m, y + half_size_m)
    else:
        view = _view_of([ring for _, ring in areas], 0.25) if areas else _whole_view(network)
    figure, axes = _scene_axes(view)
    axes.set_xlabel("x, east (m)", fontsize=_FONT_PT)
    axes.set_ylabel("y, north (m)", fontsize=_FONT_PT)
    if title:
        _set_title(axes, title, room=62)
    handles = _draw_map(axes, network, origin, view) + _draw_areas(axes, areas, origin)
    if ego_pose is not None:
        x, y, yaw = ego_pose
        # A real car would be a dot on the map of a town.
        length = max(4.4, 0.02 * (view[2] - view[0]))
        corners = _corners(*(np.array([v]) for v in (x, y, yaw, length, 0.41 * length)))
        handles.append(_add_polygons(axes, corners, "ego", face=BLACK, edge=BLACK, zorder=7.0))
    _legend_below(figure, handles)
    return figure


def _draw_map(axes: Axes, network: MapView, pose: Pose, view: Rectangle) -> list[Any]:
    """Lanes and crosswalks within the view; returns what the legend shows."""
    by_type: dict[str, list[FloatArray]] = {}
    for lane_type, outline in _lane_outlines(network):
        moved = _into_frame(outline, pose)
        if _meets(moved, view):
            by_type.setdefault(lane_type, []).append(moved)
    handles = []
    for lane_type in sorted(by_type, key=_lane_rank):
        face = LANE_COLOURS.get(lane_type, _OTHER_LANE)
        handles.append(
            _add_polygons(
                axes,
                by_type[lane_type],
                f"{lane_type} lane",
                face=face,
                edge="#bdbdbd",
                width=0.3,
                zorder=1.0,
            )
        )
    crossings = [_into_frame(np.asarray(one.polygon, float), pose) for one in network.crosswalks]
    crossings = [outline for outline in crossings if _meets(outline, view)]
    if crossings:
        handles.append(
            _add_polygons(
                axes,
                crossings,
                "crosswalk",
                face="white",
                edge="#7a7a7a",
                width=0.5,
                zorder=1.5,
                hatch="/////",
            )
        )
    return handles


def _lane_rank(lane_type: str) -> tuple[int, str]:
    known = list(LANE_COLOURS)
    return (known.index(lane_type) if lane_type in LANE_COLOURS else len(known), lane_type)


@functools.lru_cache(maxsize=1)
def _lane_outlines(network: MapView) -> tuple[tuple[str, FloatArray], ...]:
    """Type and outline of every lane that has an area, kept for the next picture of the same map."""
    lanes = network.lanes
    stretches = zip(lanes.lane_type, lanes.s_start_m, lanes.s_end_m, strict=True)
    outlines = (
        (str(lane_type), np.asarray(network.lane_polygon(lane, float(start), float(end)), dtype=np.float64))
        for lane, (lane_type, start, end) in enumerate(stretches)
        if str(lane_type) != "none"
    )
    return tuple((lane_type, outline[:, :2]) for lane_type, outline in outlines if len(outline) >= 3)


def _whole_view(network: MapView) -> Rectangle:
    outlines = [outline for _, outline in _lane_outlines(network)]
    return _view_of(outlines, 0.02) if outlines else (0.0, 0.0, 1.0, 1.0)


def _view_of(outlines: Sequence[FloatArray], margin: float) -> Rectangle:
    """Rectangle around outlines, with a margin as part of its longer side."""
    points = np.concatenate([np.asarray(outline, dtype=np.float64)[:, :2] for outline in outlines])
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    more = margin * max(right - left, high - low, 1.0)
    return (float(left - more), float(low - more), float(right + more), float(high + more))


def _draw_areas(axes: Axes, areas: Sequence[Area], pose: Pose) -> list[Any]:
    handles = []
    for role in dict.fromkeys(role for role, _ in areas):
        rings = [_into_frame(np.asarray(ring, float)[:, :2], pose) for one, ring in areas if one == role]
        colour = AREA_COLOURS.get(role, GREY)
        label = f"monitored: {role.replace('_', ' ')}"
        handles.append(_add_polygons(axes, rings, label, face=colour, edge=colour, alpha=0.22, zorder=2.0))
    return handles


def _draw_objects(axes: Axes, frame: pd.DataFrame, pose: Pose) -> list[Any]:
    """Ground truth, detections, tracks, forecasts and the ego of one frame."""
    handles = []
    ego, tracks = _of_kind(frame, "ego").iloc[-1:], _of_kind(frame, "track")
    handles.append(_add_boxes(axes, ego, pose, "ego", face="#4d4d4d", edge=BLACK, zorder=6.0))
    ahead = _with_sizes(_of_kind(frame, "ego_forecast"), ego, by_id=False)
    handles += _draw_fading(axes, ahead, pose, "ego forecast", "#4d4d4d")
    actors = _of_kind(frame, "actor")
    if len(actors):
        handles.append(
            _add_boxes(axes, actors, pose, "ground truth", face="none", edge=BLACK, line=":", zorder=5.5)
        )
    detections = _of_kind(frame, "detection")
    styles = {"kept": ("#ffffff", BLACK), "dropped": ("#c9c9c9", GREY)}
    for label, (face, edge) in styles.items():
        rows = detections[detections["label"] == label]
        if len(rows):
            handles.append(
                _add_boxes(axes, rows, pose, f"detection {label}", face=face, edge=edge, zorder=4.0)
            )
    forecasts = _with_sizes(_of_kind(frame, "forecast"), tracks, by_id=True)
    state_of = dict(zip(tracks["id"], tracks["label"], strict=True))
    for state, colour in _TRACK_COLOURS.items():
        rows = tracks[tracks["label"] == state]
        if len(rows):
            width = 2.2 if state == "threat" else 1.3
            handles.append(
                _add_boxes(
                    axes, rows, pose, f"track, {state}", face="none", edge=colour, width=width, zorder=5.0
                )
            )
            _draw_velocities(axes, rows, pose, colour)
        if state == "threat" and len(rows):
            # A pedestrian's box is tiny at this scale: a ring shows at once which track the threat is.
            around = _into_frame(rows[["x_m", "y_m"]].to_numpy(float), pose)
            ring: dict[str, Any] = {
                "marker": "o",
                "markersize": 15.0,
                "markerfacecolor": "none",
                "linestyle": "none",
            }
            axes.plot(around[:, 0], around[:, 1], color=colour, gid="threat", zorder=5.5, **ring)
        _draw_fading(axes, forecasts[forecasts["id"].map(state_of) == state], pose, "forecast", colour)
    if len(forecasts):
        handles.append(_patch("forecast", face="none", edge=GREY))
    _label_tracks(axes, tracks, [ego, ahead, actors, detections, tracks], pose)
    return handles


def _draw_fading(axes: Axes, rows: pd.DataFrame, pose: Pose, label: str, colour: str) -> list[Any]:
    """Forecast boxes, paler the further ahead in time; returns what the legend shows."""
    horizons = sorted({float(value) for value in rows["horizon_s"]})
    for rank, horizon in enumerate(horizons):
        alpha = 0.75 - 0.55 * rank / max(len(horizons) - 1, 1)
        chosen = rows[rows["horizon_s"] == horizon]
        _add_boxes(axes, chosen, pose, label, face="none", edge=colour, width=0.8, alpha=alpha, zorder=3.0)
    return [_patch(label, face="none", edge=colour, alpha=0.5)] if horizons else []


def _draw_velocities(axes: Axes, rows: pd.DataFrame, pose: Pose, colour: str) -> None:
    """Arrow from each moving track to where it is in one second."""
    moving = rows[rows["speed_mps"] > 0.2]
    tails = _into_frame(moving[["x_m", "y_m"]].to_numpy(float), pose)
    yaw = moving["yaw_rad"].to_numpy(float) - pose[2]
    steps = moving["speed_mps"].to_numpy(float)[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    ends = {"shrinkA": 0.0, "shrinkB": 0.0}
    for tail, head in zip(tails.tolist(), (tails + steps).tolist(), strict=True):
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.0, "mutation_scale": 6.0, **ends}
        arrow = axes.annotate("", xy=head, xytext=tail, arrowprops=style, zorder=6.0, gid="velocity")
        arrow.set_clip_on(True)
        arrow.set_annotation_clip(True)


def _label_tracks(axes: Axes, tracks: pd.DataFrame, objects: Sequence[pd.DataFrame], pose: Pose) -> None:
    """Category and number of each track in view, clear of all boxes; threats choose their places first."""
    points = _into_frame(tracks[["x_m", "y_m"]].to_numpy(float), pose)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    texts = []
    for (x, y), row in zip(points.tolist(), tracks.to_dict("records"), strict=True):
        if left < x < right and low < y < high:
            category = row["category"] if isinstance(row["category"], str) else "track"
            text = f"{category} {int(row['id'])}"
            texts.append((row["label"] != "threat", (x, y, text)))
    ordered = [text for _, text in sorted(texts, key=lambda one: one[0])]
    boxes = np.concatenate([_corners(*(rows[name].to_numpy(float) for name in _BOX)) for rows in objects])
    sides = [
        (tuple(a), tuple(b))
        for box in boxes
        for a, b in itertools.pairwise(_into_frame(np.vstack([box, box[:1]]), pose).tolist())
    ]
    _place_labels(axes, ordered, sides, offsets_pt=(9.0, 18.0, 27.0, 36.0), leaders=True)


def _add_boxes(axes: Axes, rows: pd.DataFrame, pose: Pose, label: str, **style: Any) -> Any:
    corners = _corners(*(rows[name].to_numpy(float) for name in _BOX))
    return _add_polygons(axes, [_into_frame(box, pose) for box in corners], label, **style)


def _add_polygons(
    axes: Axes,
    outlines: Sequence[FloatArray] | FloatArray,
    label: str,
    *,
    face: str,
    edge: str,
    width: float = 1.0,
    alpha: float = 1.0,
    line: LineStyle = "-",
    hatch: str | None = None,
    zorder: float,
) -> Any:
    """Draw outlines as one collection, named by `gid`; returns a patch for the legend."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgba

    # Edges of a translucent fill stay stronger than the fill.
    translucent = alpha < 1.0 and face != "none"
    collection = PolyCollection(
        list(outlines),
        facecolors="none" if face == "none" else [to_rgba(face, alpha)],
        edgecolors=[to_rgba(edge, min(2.5 * alpha, 1.0) if translucent else alpha)],
        linewidths=width,
        linestyles=line,
        hatch=hatch,
        zorder=zorder,
        gid=label,
    )
    axes.add_collection(collection, autolim=False)
    return _patch(label, face=face, edge=edge, alpha=alpha, line=line, hatch=hatch, width=width)


def _patch(
    label: str,
    *,
    face: str,
    edge: str,
    alpha: float = 1.0,
    line: LineStyle = "-",
    hatch: str | None = None,
    width: float = 1.0,
) -> Any:
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Patch

    fill: Any = "none" if face == "none" else to_rgba(face, alpha)
    return Patch(
        facecolor=fill,
        edgecolor=to_rgba(edge, min(2.5 * alpha, 1.0)),
        linestyle=line,
        linewidth=max(width, 0.6),
        hatch=hatch,
        label=label,
    )


# Shared


def _of_kind(log: pd.DataFrame, kind: str) -> pd.DataFrame:
    return log[log["kind"] == kind]


def _frame_at(log: pd.DataFrame, time_s: float) -> pd.DataFrame:
    """Rows of the frame nearest to a time, among those with an ego and, if there are any, with perception."""
    with_ego = set(_of_kind(log, "ego")["time_s"])
    if not with_ego:
        raise ResultsError("log without rows of kind 'ego': nothing to show; see docs/run-log.md")
    seen = log.loc[log["kind"].isin(["detection", "track", "ego_forecast"]), "time_s"]
    times = sorted(with_ego & set(seen)) or sorted(with_ego)
    nearest = min(times, key=lambda time: abs(time - time_s))
    rows: pd.DataFrame = log[(log["time_s"] - nearest).abs() <= _TIME_TOLERANCE_S]
    return rows


def _with_sizes(rows: pd.DataFrame, objects: pd.DataFrame, *, by_id: bool) -> pd.DataFrame:
    """Forecast rows with the length and width of their object where they have none."""
    filled = rows.copy()
    for name in ("length_m", "width_m"):
        if by_id:
            sizes = dict(zip(objects["id"], objects[name], strict=True))
            filled[name] = filled[name].fillna(filled["id"].map(sizes))
        elif len(objects):
            filled[name] = filled[name].fillna(float(objects[name].iloc[-1]))
    return filled.dropna(subset=["x_m", "y_m", "yaw_rad", "length_m", "width_m"])


def _corners(
    x_m: FloatArray, y_m: FloatArray, yaw_rad: FloatArray, length_m: FloatArray, width_m: FloatArray
) -> FloatArray:
    """(N, 4, 2) corners of N boxes, counter-clockwise."""
    along = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])[:, None, :] * length_m[:, None, None] / 2
    across = np.column_stack([-np.sin(yaw_rad), np.cos(yaw_rad)])[:, None, :] * width_m[:, None, None] / 2
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    centre = np.column_stack([x_m, y_m])[:, None, :]
    corners: FloatArray = centre + signs[None, :, :1] * along + signs[None, :, 1:] * across
    return corners


def _into_frame(points_m: FloatArray, pose: Pose) -> FloatArray:
    """(N, 2) map points in the frame of a pose: x ahead of it, y to its left."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    moved: FloatArray = (np.asarray(points_m, dtype=np.float64) - (x, y)) @ np.array(
        [[cos, -sin], [sin, cos]]
    )
    return moved


def _meets(outline: FloatArray, view: Rectangle) -> bool:
    """Whether the bounding box of an outline touches the view (left, low, right, high)."""
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    return bool(left <= view[2] and right >= view[0] and low <= view[3] and high >= view[1])


def _figure(height_in: float) -> Figure:
    """An empty figure with a canvas of its own, on which texts can be measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_IN, height_in), dpi=200, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _style(axes: Axes) -> None:
    """Fine grid behind everything and texts of the pictures' size."""
    axes.grid(visible=True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=_SMALL_PT)


def _set_title(axes: Axes, title: str, *, room: int) -> None:
    """Heading, smaller where it has more characters than there is room for."""
    size = _FONT_PT * min(1.0, room / max(len(title), 1))
    axes.set_title(title, fontsize=size, pad=4.0)


def _scene_axes(view: Rectangle) -> tuple[Figure, Axes]:
    """Axes with equal scales that fill the width of a figure, or its height where the view is tall."""
    width_in = _WIDTH_IN - _LEFT_IN - _RIGHT_IN
    height_in = min(max(width_in * (view[3] - view[1]) / (view[2] - view[0]), 1.2), _TALLEST_IN)
    figure = _figure(height_in + _TOP_IN + _BOTTOM_IN)
    _lay_out(figure, figure.add_subplot(), height_in, _BOTTOM_IN)
    (axes,) = figure.axes
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(view[0], view[2])
    axes.set_ylim(view[1], view[3])
    axes.tick_params(labelsize=_SMALL_PT)
    return figure, axes


def _lay_out(figure: Figure, axes: Axes, height_in: float, bottom_in: float) -> None:
    """Give axes of this height their place in a figure that is as tall as needed."""
    total_in = height_in + _TOP_IN + bottom_in
    figure.set_figheight(total_in)
    axes.set_position(
        (
            _LEFT_IN / _WIDTH_IN,
            bottom_in / total_in,
            1.0 - (_LEFT_IN + _RIGHT_IN) / _WIDTH_IN,
            height_in / total_in,
        )
    )


def _legend_above(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    figure.legend(
        handles=handles,
        loc="upper center",
        ncols=columns,
        fontsize=_SMALL_PT,
        frameon=False,
        columnspacing=1.2,
        handlelength=1.6,
        borderaxespad=0.2,
    )


def _legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """Legend under the axes of a scene; the figure grows by its lines."""
    (axes,) = figure.axes
    unique = {handle.get_label(): handle for handle in handles}
    lines = math.ceil(len(unique) / _LEGEND_COLUMNS)
    height_in = axes.get_position(original=True).height * figure.get_figheight()
    _lay_out(figure, axes, height_in, _BOTTOM_IN + _LEGEND_LINE_IN * lines)
    figure.legend(
        handles=list(unique.values()),
        loc="lower center",
        ncols=_LEGEND_COLUMNS,
        fontsize=_SMALL_PT - 1.0,
        frameon=False,
        columnspacing=1.0,
        handlelength=1.4,
        handletextpad=0.5,
        labelspacing=0.3,
        borderaxespad=0.1,
    )


def _place_labels(
    axes: Axes,
    texts: Sequence[tuple[float, float, str]],
    segments: Sequence[Segment],
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
        segments: lines to keep clear of, in data coordinates.
        offsets_pt: distances above and below the point that may be used, nearest first.
        leaders: whether texts away from their point get a thin line to it.
    """
    from matplotlib.patheffects import withStroke

    to_pixel = axes.transData.transform
    scale = axes.figure.dpi / 72.0
    points = np.array([to_pixel(text[:2]) for text in texts]).reshape(-1, 2)
    lines = np.array([to_pixel(segment) for segment in segments]).reshape(-1, 2, 2)
    taken: list[Rectangle] = []
    written: set[str] = set()
    first_of_each = {text[2]: index for index, text in reversed(list(enumerate(texts)))}
    order = sorted(range(len(texts)), key=lambda index: first_of_each[texts[index][2]] != index)
    for index in order:
        x, y, text = texts[index]
        label = axes.annotate(
            text, (x, y), textcoords="offset points", xytext=(0, 0), fontsize=_SMALL_PT, zorder=8, gid="label"
        )
        # A white rim keeps the text readable where it cannot keep clear of a line.
        label.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
        width, height = _text_size(label)
        choices = [
            (liking + _cost(box, index, axes, taken, lines, points), liking, box)
            for liking, box in _candidates(
                points[index], width, height, [offset * scale for offset in offsets_pt], scale
            )
        ]
        cost, away, best = min(choices)
        if text in written and cost >= _REPEAT_COST:
            label.remove()
            continue
        left, low, _, _ = best
        label.set_position(((left - points[index][0]) / scale, (low - points[index][1]) / scale))
        label.set_verticalalignment("bottom")
        taken.append(best)
        written.add(text)
        if leaders and away >= 2.0:
            ends = axes.transData.inverted().transform([points[index], _nearest(points[index], best)])
            axes.plot(ends[:, 0], ends[:, 1], color="#555555", linewidth=0.5, zorder=7, gid="leader")


def _text_size(label: Annotation) -> tuple[float, float]:
    """Width and height of a text in pixels."""
    from matplotlib.text import Text

    box = Text.get_window_extent(label)
    return box.width, box.height


def _candidates(
    point: FloatArray, width: float, height: float, offsets: Sequence[float], scale: float
) -> Iterable[tuple[float, Rectangle]]:
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
