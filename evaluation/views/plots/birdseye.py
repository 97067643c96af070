"""What is around the ego, from above, and the map with its lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from evaluation.views.plots.fitting import fitted, set_title
from evaluation.views.plots.ground import Area, draw_areas, draw_map, lane_outlines
from evaluation.views.plots.labels import Rectangle
from evaluation.views.plots.log_rows import frame_at, of_kind, placed_signals, signals_at
from evaluation.views.plots.map_ids import draw_ids
from evaluation.views.plots.objects import draw_objects, draw_signals
from evaluation.views.plots.polygons import Pose, draw_polygons
from evaluation.views.plots.style import BLACK, FONT_PT, MPS_TO_KMH, SMALL_PT, WIDTH_IN, new_figure
from smartmot.geometry import corners
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    from opendrive import RoadNetwork
    from scenarios.recorded.maps.drive_map import DriveMap

_LEFT_IN, _RIGHT_IN, _TOP_IN, _BOTTOM_IN = 0.62, 0.15, 0.28, 0.5
_TALLEST_IN = 5.0
_LEGEND_COLUMNS, _LEGEND_LINE_IN = 4, 0.135
_TITLE_WIDTH_IN = 4.35
_AROUND_EGO = (-10.0, -13.75, 40.0, 13.75)
"""View in the ego's frame, metres: further ahead than behind."""


def birdseye(
    network: DriveMap,
    log: pd.DataFrame,
    time_s: float,
    areas: Sequence[Area],
    title: str | None = None,
) -> Figure:
    """What is around the ego at one frame, from above, the ego driving to the right.

    Args:
        network: the map.
        log: log of one run, as from `results.read_log`.
        time_s: the frame nearest to this time is shown.
        areas: role and outline (P, 2) of each monitored area, map frame, metres.
        title: heading; by default the time of the frame and the ego's speed.

    Raises:
        ResultsError: the log holds no ego.
    """
    frame = frame_at(log, time_s)
    ego = of_kind(frame, "ego").iloc[-1]
    pose = (float(ego["x_m"]), float(ego["y_m"]), float(ego["yaw_rad"]))
    figure, axes = _map_axes(_AROUND_EGO)
    axes.set_xlabel("Ahead of ego (m)", fontsize=FONT_PT)
    axes.set_ylabel("Left of ego (m)", fontsize=FONT_PT)
    if title is None:
        title = f"t = {ego['time_s']:.2f} s, ego at {ego['speed_mps'] * MPS_TO_KMH:.1f} km/h"
    _add_title(figure, axes, title)
    handles = draw_map(axes, network, pose, _AROUND_EGO) + draw_areas(axes, areas, pose)
    handles += draw_objects(axes, frame, pose)
    draw_signals(axes, signals_at(placed_signals(log), float(ego["time_s"])), pose)
    _add_legend(figure, axes, handles)
    return figure


def map_picture(
    network: RoadNetwork,
    areas: Sequence[Area] = (),
    ego_pose: Pose | None = None,
    title: str | None = None,
    ids: bool = False,
) -> Figure:
    """The map in its own frame, with lanes by type, and monitored areas and the ego if given.

    Args:
        network: the map.
        areas: role and outline (P, 2) of each monitored area, map frame, metres. Their surroundings are
            shown, and the whole map if there are none.
        ego_pose: x, y in metres and yaw in radians.
        title: heading, if any.
        ids: write the ids of roads and lanes where they fit.
    """
    origin = (0.0, 0.0, 0.0)
    view = _view_of([ring for _, ring in areas], 0.25) if areas else _whole_view(network)
    figure, axes = _map_axes(view)
    axes.set_xlabel("x, east (m)", fontsize=FONT_PT)
    axes.set_ylabel("y, north (m)", fontsize=FONT_PT)
    if title:
        _add_title(figure, axes, title)
    handles = draw_map(axes, network, origin, view) + draw_areas(axes, areas, origin)
    if ego_pose is not None:
        x, y, yaw = ego_pose
        # A real car would be a dot on the map of a town.
        length = max(4.4, 0.02 * (view[2] - view[0]))
        box = corners(np.array([x, y]), np.array([length, 0.41 * length]), np.array(yaw))
        handles.append(draw_polygons(axes, [box], "ego", face=BLACK, edge=BLACK, zorder=7.0))
    if ids:
        draw_ids(axes, network, view)
    _add_legend(figure, axes, handles)
    return figure


def _whole_view(network: RoadNetwork) -> Rectangle:
    outlines = [outline for _, outline in lane_outlines(network)]
    return _view_of(outlines, 0.02) if outlines else (0.0, 0.0, 1.0, 1.0)


def _view_of(outlines: Sequence[FloatArray], margin: float) -> Rectangle:
    """Rectangle around outlines, with a margin as part of its longer side."""
    points = np.concatenate(outlines)
    (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
    more = margin * max(right - left, high - low, 1.0)
    return (float(left - more), float(low - more), float(right + more), float(high + more))


def _map_axes(view: Rectangle) -> tuple[Figure, Axes]:
    """Axes with equal scales that fill the width of a figure, or its height where the view is tall."""
    width_in = WIDTH_IN - _LEFT_IN - _RIGHT_IN
    height_in = min(max(width_in * (view[3] - view[1]) / (view[2] - view[0]), 1.2), _TALLEST_IN)
    figure = new_figure(height_in)
    axes = figure.add_subplot()
    _lay_out(figure, axes, height_in, bottom_in=_BOTTOM_IN)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(view[0], view[2])
    axes.set_ylim(view[1], view[3])
    axes.tick_params(labelsize=SMALL_PT)
    return figure, axes


def _lay_out(
    figure: Figure, axes: Axes, height_in: float, *, bottom_in: float, top_in: float = _TOP_IN
) -> None:
    """Give axes of this height their place in a figure that is as tall as needed."""
    total_in = height_in + top_in + bottom_in
    figure.set_figheight(total_in)
    left, width = _LEFT_IN / WIDTH_IN, 1.0 - (_LEFT_IN + _RIGHT_IN) / WIDTH_IN
    axes.set_position((left, bottom_in / total_in, width, height_in / total_in))


def _height_in(figure: Figure, axes: Axes) -> float:
    """Height of the axes, inches."""
    return float(axes.get_position(original=True).height * figure.get_figheight())


def _add_title(figure: Figure, axes: Axes, title: str) -> None:
    """Heading above the axes; the figure grows by its lines."""
    heading = fitted(figure, title, _TITLE_WIDTH_IN)
    set_title(axes, heading)
    top_in = _TOP_IN + heading.more_in
    _lay_out(figure, axes, _height_in(figure, axes), bottom_in=_BOTTOM_IN, top_in=top_in)


def _add_legend(figure: Figure, axes: Axes, handles: Sequence[Patch]) -> None:
    """Legend under the axes; the figure grows by its lines."""
    lines = math.ceil(len(handles) / _LEGEND_COLUMNS)
    height_in = _height_in(figure, axes)
    top_in = (1.0 - axes.get_position(original=True).y1) * figure.get_figheight()
    _lay_out(figure, axes, height_in, bottom_in=_BOTTOM_IN + _LEGEND_LINE_IN * lines, top_in=top_in)
    figure.legend(
        handles=handles, loc="lower center", ncols=_LEGEND_COLUMNS, fontsize=SMALL_PT - 1.0, frameon=False,
        columnspacing=1.0, handlelength=1.4, handletextpad=0.5, labelspacing=0.3, borderaxespad=0.1,
    )  # fmt: skip
