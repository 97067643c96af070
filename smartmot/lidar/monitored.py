"""Points on a monitored area: those around a place at which a pedestrian would be kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from smartmot.arrays import BoolArray, FloatArray, StrArray
from smartmot.types import Boxes

Monitored = BoolArray | Callable[[FloatArray], BoolArray]
"""Which points may be of a road user: (P,) of a cloud's, or what says it of (Q, 3) points in its frame. The
second is asked only for those over the ground."""

Keeps = Callable[[Boxes, StrArray], BoolArray]

CELL_M = 0.5
"""Edge of the cells for which an area is asked: the width of an adult. A cell beside one that is kept is kept
too, so that a body with its middle on the area is whole."""


def points_on(keeps: Keeps, xy_m: FloatArray) -> BoolArray:
    """(N,) which points are of somebody whom an area would keep, a pedestrian where they are.

    Args:
        keeps: `kept` of a monitored area; one that keeps everybody keeps every point.
        xy_m: (N, 2) points, frame of the area, within reach of a detector.
    """
    if not len(xy_m):
        return np.zeros(0, dtype=np.bool_)
    low = xy_m.min(axis=0)
    # two empty cells all round, so that a step aside leads to no other row
    row, column = ((xy_m - low).T / CELL_M).astype(np.intp) + 2
    shape = (int(row.max()) + 3, int(column.max()) + 3)
    filled = np.zeros(shape, dtype=np.bool_)
    filled[row, column] = True
    i, j = np.nonzero(_grown(filled))
    center = low + (np.column_stack((i, j)) - 1.5) * CELL_M
    boxes = Boxes(center, np.full((len(center), 2), CELL_M), np.zeros(len(center)))
    kept = np.zeros(shape, dtype=np.bool_)
    kept[i, j] = keeps(boxes, np.full(len(center), "pedestrian"))
    on_area: BoolArray = _grown(kept)[row, column]
    return on_area


def _grown(cells: BoolArray) -> BoolArray:
    """Cells, and the eight around each."""
    along = cells.copy()
    along[1:] |= cells[:-1]
    along[:-1] |= cells[1:]
    grown = along.copy()
    grown[:, 1:] |= along[:, :-1]
    grown[:, :-1] |= along[:, 1:]
    return grown
