"""Points that belong together: connected cells of a grid seen from above."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from smartmot.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


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
    from scipy.sparse.csgraph import connected_components  # takes longer to import than a run

    if not len(x_m):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    widest = int(gap_m.max() / cell_m + 1e-9)
    row, column = (((axis - axis.min()) / cell_m).astype(np.intp) + widest for axis in (x_m, y_m))
    rows, columns = int(row.max()) + widest + 1, int(column.max()) + widest + 1
    key = row * columns + column
    # small numbers keep the image in the cache
    number = np.arange(len(key), dtype=np.int16 if len(key) < 2**15 else np.int32)
    # an image of rows: which point, then which cell; writing it takes less time than sorting
    image = np.full(rows * columns, -1, dtype=number.dtype)
    image[key] = number
    first = np.flatnonzero(image[key] == number)
    cell = key[first]
    image[cell] = number[: len(cell)]
    gap = gap_m[first] / cell_m + 1e-9
    dx, dy, distance = _half_disc(widest)
    neighbour = image.take(cell + (dx * columns + dy)[:, None]).ravel()
    filled = np.flatnonzero(neighbour >= 0)
    offset = filled // len(cell)
    own, target = filled - offset * len(cell), neighbour.take(filled)
    near = np.maximum(gap.take(own), gap.take(target)) >= distance.take(offset)
    links = _linked(own[near], target[near], len(cell))
    label = connected_components(links, directed=False)[1]
    return label[image[key]].astype(np.int64), first


def _linked(own: IntArray, target: IntArray, count: int) -> csr_matrix:
    """Graph of so many cells with links from own to target, row by row as it is searched."""
    from scipy.sparse import csr_matrix

    first = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(np.bincount(own, minlength=count), out=first[1:])
    sorted_target = target[by_label(own, count)]
    return csr_matrix((np.ones(len(target)), sorted_target, first), shape=(count, count))


def by_label(label: IntArray, count: int) -> IntArray:
    """Order of so many labels from 0 on, equal ones as they are."""
    # 16 bits are sorted by radix, in a tenth of the time
    return np.argsort(label.astype(np.uint16) if count <= 2**16 else label, kind="stable")


@lru_cache(maxsize=32)
def _half_disc(radius: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Every other cell within a radius, or the one opposite to it: (K,) steps along x, along y, distance."""
    dx, dy = np.meshgrid(np.arange(radius + 1), np.arange(-radius, radius + 1), indexing="ij")
    distance = np.hypot(dx, dy)
    chosen = ((dx > 0) | (dy > 0)) & (distance <= radius + 0.5)
    return dx[chosen], dy[chosen], distance[chosen]
