"""What does not move: lanes, crosswalks and the monitored areas on them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import shapely.geometry

from evaluation.views.plots.labels import Rectangle
from evaluation.views.plots.polygons import Pose, draw_polygons
from evaluation.views.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, WINE
from smartmot.geometry import to_frame
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch
    from matplotlib.path import Path

    from scenarios.recorded.maps.drive_map import DriveMap

_NO_AREA_M2 = 1e-3
"""What is smaller is left over from two outlines that meet."""

Area = tuple[str, FloatArray]
"""Role and outline (P, 2) of a monitored area, map frame, metres."""

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
    "path": BLUE,
    "all": GREY,
}
"""Colours of the monitored areas by role; where they overlap, the first is seen."""

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
"""Light fills of the lane types, first in the legend; others share one tone."""

OTHER_LANE_COLOUR, LANE_EDGE_COLOUR = "#f7f7f7", "#bdbdbd"


def draw_map(axes: Axes, network: DriveMap, pose: Pose, view: Rectangle) -> list[Patch]:
    """Lanes and crosswalks within the view, seen from a pose; returns what the legend shows."""
    by_type: dict[str, list[FloatArray]] = {}
    for lane_type, outline in lane_outlines(network):
        moved = to_frame(outline, *pose)
        if _meets(moved, view):
            by_type.setdefault(lane_type, []).append(moved)
    handles = []
    for lane_type in sorted(by_type, key=_lane_rank):
        outlines, face = by_type[lane_type], LANE_COLOURS.get(lane_type, OTHER_LANE_COLOUR)
        patch = draw_polygons(
            axes, outlines, f"{lane_type} lane", face=face, edge=LANE_EDGE_COLOUR, width=0.3, zorder=1.0
        )
        handles.append(patch)
    crossings = [to_frame(crosswalk.polygon, *pose) for crosswalk in network.crosswalks]
    crossings = [outline for outline in crossings if _meets(outline, view)]
    if crossings:
        patch = draw_polygons(
            axes, crossings, "crosswalk", face="white", edge="#7a7a7a", width=0.5, hatch="/////", zorder=1.5
        )
        handles.append(patch)
    return handles


def draw_areas(axes: Axes, areas: Sequence[Area], pose: Pose) -> list[Patch]:
    """Monitored areas by role, seen from a pose; returns what the legend shows."""
    from matplotlib.collections import PathCollection
    from matplotlib.patches import Patch

    handles = []
    moved = [(role, to_frame(ring, *pose)) for role, ring in areas]
    for role, path in area_paths(moved).items():
        style = area_style(role)
        label = f"monitored: {role.replace('_', ' ')}"
        axes.add_collection(PathCollection([path], gid=label, zorder=2.0, **style), autolim=False)
        handles.append(Patch(label=label, **style))
    return handles


def area_style(role: str) -> dict[str, Any]:
    """Fill and edge of a monitored area; the edge stays stronger than the fill."""
    colour = AREA_COLOURS.get(role, GREY)
    return {"facecolor": (colour, 0.3), "edgecolor": (colour, 0.6), "linewidth": 0.9}


def area_paths(areas: Sequence[Area]) -> dict[str, Path]:
    """What is to be seen of each role, so that no two translucent layers lie on one another.

    Areas of one role become one; where roles overlap, as on an intersection, the first of `AREA_COLOURS` is
    shown. Roles of which nothing is left are left out.
    """
    from matplotlib.path import Path

    rings: dict[str, list[FloatArray]] = {}
    for role, ring in areas:
        rings.setdefault(role, []).append(ring)
    rank = {role: k for k, role in enumerate(AREA_COLOURS)}
    taken: shapely.Geometry = shapely.Polygon()
    paths = {}
    for role in sorted(rings, key=lambda role: rank.get(role, len(rank))):
        area = shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in rings[role]])
        seen = shapely.difference(area, taken)
        taken = shapely.union(taken, area)
        parts = [part for part in shapely.get_parts(seen) if part.area > _NO_AREA_M2]
        # outlines run against holes, which the rule of non-zero winding leaves open
        outlines = [
            np.asarray(ring.coords)
            for part in map(shapely.geometry.polygon.orient, parts)
            for ring in (part.exterior, *part.interiors)
        ]
        if outlines:
            paths[role] = Path.make_compound_path(*(Path(points, closed=True) for points in outlines))
    return paths


@functools.lru_cache(maxsize=1)
def lane_outlines(network: DriveMap) -> tuple[tuple[str, FloatArray], ...]:
    """Type and outline of every lane but those of type none, kept for the next picture of the same map."""
    lanes = network.lanes
    stretches = zip(lanes.lane_type, lanes.s_start_m, lanes.s_end_m, strict=True)
    return tuple(
        (str(lane_type), network.lane_polygon(lane, float(start), float(end)))
        for lane, (lane_type, start, end) in enumerate(stretches)
        if lane_type != "none"
    )


def _lane_rank(lane_type: str) -> tuple[int, str]:
    known = list(LANE_COLOURS)
    return (known.index(lane_type) if lane_type in LANE_COLOURS else len(known), lane_type)


def _meets(outline: FloatArray, view: Rectangle) -> bool:
    """Whether the bounding box of an outline touches the view."""
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    return bool(left <= view[2] and right >= view[0] and low <= view[3] and high >= view[1])
