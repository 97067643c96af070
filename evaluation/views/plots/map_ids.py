"""Ids of roads and lanes on the picture of a map, where they fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evaluation.views.plots.fitting import text_size_in
from evaluation.views.plots.labels import Rectangle
from evaluation.views.plots.style import BLACK, WINE
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from opendrive import RoadNetwork

ID_PT = 5.5
"""Size of the texts."""
_PLACES = 17
"""So many places along a road or lane are tried, the middle first."""
_AIR = 1.15
"""A road or lane is this much larger than its id."""


class _Id(NamedTuple):
    """A text, how long its road or lane is, and where it may stand, the best place first.

    Attributes:
        text: the id.
        colour: of the text.
        length_m: of the road or lane.
        width_m: of the lane; a road's id may cover lanes.
        places_m: (P, 2) places, map frame.
    """

    text: str
    colour: str
    length_m: float
    width_m: float
    places_m: FloatArray


def draw_ids(axes: Axes, network: RoadNetwork, view: Rectangle) -> int:
    """Write the ids of roads and lanes within a view, the longest first, where none covers another.

    Returns:
        How many were written.
    """
    from matplotlib.patheffects import withStroke

    figure = axes.figure.get_figure(root=True)
    assert figure is not None
    width_in = axes.get_position().width * figure.get_size_inches()[0]
    m_per_in = (view[2] - view[0]) / width_in
    # ids side by side are as far apart as a digit is wide, or they read as one
    gap = m_per_in * text_size_in(figure, "0", ID_PT)[0]
    taken: list[Rectangle] = []
    for name in (*_road_ids(network), *_lane_ids(network)):
        wide, high = (m_per_in * size for size in text_size_in(figure, name.text, ID_PT))
        if name.length_m < _AIR * wide or name.width_m < _AIR * high:
            continue
        for x, y in name.places_m.tolist():
            box = (x - wide / 2, y - high / 2, x + wide / 2, y + high / 2)
            inside = box[0] >= view[0] and box[1] >= view[1] and box[2] <= view[2] and box[3] <= view[3]
            around = (box[0] - gap, box[1], box[2] + gap, box[3])
            if inside and not any(_meet(around, other) for other in taken):
                taken.append(box)
                axes.text(
                    x, y, name.text, color=name.colour, fontsize=ID_PT, ha="center", va="center", zorder=6.0,
                    gid="id", path_effects=[withStroke(linewidth=1.2, foreground="white")],
                )  # fmt: skip
                break
    return len(taken)


def _meet(a: Rectangle, b: Rectangle) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _from_middle(low: float, high: float) -> FloatArray:
    """Places between two s, the middle first."""
    share = np.linspace(0.0, 1.0, _PLACES + 2)[1:-1]
    return low + (high - low) * share[np.argsort(np.abs(share - 0.5), kind="stable")]


def _road_ids(network: RoadNetwork) -> Iterator[_Id]:
    for road_id, road in sorted(network.roads.items(), key=lambda item: -item[1].length_m):
        line = road.reference_line(_from_middle(0.0, road.length_m))
        yield _Id(road_id, WINE, road.length_m, np.inf, np.column_stack((line.x_m, line.y_m)))


def _lane_ids(network: RoadNetwork) -> Iterator[_Id]:
    lanes = network.lanes
    length_m = lanes.s_end_m - lanes.s_start_m
    for lane in np.argsort(-length_m, kind="stable").tolist():
        s_m = _from_middle(float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane]))
        x_m, y_m, _, _ = network.center_line(lane, s_m)
        width_m = float(network.lane_width(lane, s_m).max())
        text = str(lanes.key[lane].lane_id)
        yield _Id(text, BLACK, float(length_m[lane]), width_m, np.column_stack((x_m, y_m)))
