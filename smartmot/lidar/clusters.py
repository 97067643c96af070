"""Points that belong together: connected cells of a grid seen from above."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from smartmot.arrays import FloatArray, IntArray


def components(
    x_m: FloatArray, y_m: FloatArray, cell_m: float, gap_m: FloatArray
) -> tuple[IntArray, IntArray]:
    """(P,) number of the component of each point, from 0 on, and one point of each cell.

    Cells that hold a point are linked if their middles are as near as the greater of their gaps.

    Args:
        x_m: (P,) of the points.
        y_m: (P,) of the points.
        cell_m: edge of a cell.
        gap_m: (P,) gap at each point; that of a cell is the one of any of its points.
    """
    if not len(x_m):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    widest = int(gap_m.max() / cell_m + 1e-9)
    row, column = (((axis - axis.min()) / cell_m).astype(np.int64) + widest for axis in (x_m, y_m))
    rows, columns = int(row.max()) + widest + 1, int(column.max()) + widest + 1
    key = row * columns + column
    number = np.arange(len(key), dtype=np.int32)
    # an image of rows: which point, then which cell; writing it takes less time than sorting
    image = np.full(rows * columns, -1, dtype=np.int32)
    image[key] = number
    first = np.flatnonzero(image[key] == number)
    cell = key[first]
    image[cell] = number[: len(cell)]
    gap = gap_m[first] / cell_m + 1e-9
    dx, dy, distance = _half_disc(widest)
    neighbour = image[cell + (dx * columns + dy)[:, None]]
    offset, own = (neighbour >= 0).nonzero()
    target = neighbour[offset, own]
    near = np.maximum(gap[own], gap[target]) >= distance[offset]
    i, j = own[near], target[near]
    links = coo_matrix((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(cell), len(cell)))
    label = connected_components(links, directed=False)[1]
    return label[image[key]].astype(np.int64), first


@lru_cache(maxsize=32)
def _half_disc(radius: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Every other cell within a radius, or the one opposite to it: (K,) steps along x, along y, distance."""
    dx, dy = np.meshgrid(np.arange(radius + 1), np.arange(-radius, radius + 1), indexing="ij")
    distance = np.hypot(dx, dy)
    chosen = ((dx > 0) | (dy > 0)) & (distance <= radius + 0.5)
    return dx[chosen], dy[chosen], distance[chosen]
