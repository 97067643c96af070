"""One-to-one assignment of sparse pairs: each connected component on its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from smartmot.types import BoolArray, FloatArray, IntArray

_TABLE_CELLS = 2048
"""Up to this size one table is solved at once; taking it apart would take longer."""


def contested(row: IntArray, column: IntArray) -> BoolArray | None:
    """Which pairs share their row or their column with another pair.

    Args:
        row: (P,) rows of the pairs.
        column: (P,) columns of the pairs.

    Returns:
        (P,) flags; None if there is no such pair.
    """
    in_row, in_column = np.bincount(row), np.bincount(column)
    # no row and no column comes twice if there are as many of both as pairs
    if np.count_nonzero(in_row) == len(row) == np.count_nonzero(in_column):
        return None
    shared: BoolArray = in_row.take(row) + in_column.take(column) > 2
    return shared


def prepare() -> None:
    """Import what frames may need of SciPy: start-up stays light, and no frame waits for an import."""
    import scipy.sparse.csgraph  # noqa: F401 - for `_components`

    _hungarian()


@cache
def _hungarian() -> Callable[..., tuple[IntArray, IntArray]]:
    """SciPy's solver."""
    from scipy.optimize import linear_sum_assignment

    return linear_sum_assignment


def solve(
    row: IntArray,
    column: IntArray,
    affinity: FloatArray,
    method: str = "hungarian",
    shape: tuple[int, int] | None = None,
) -> IntArray:
    """Pairs that are matched, at most one per row and one per column.

    Args:
        row: (P,) rows of the pairs.
        column: (P,) columns of the pairs; no pair comes twice.
        affinity: (P,) how well the pairs go together; 0 or less forbids the match.
        method: "hungarian": the greatest total affinity. "greedy": the best pair first.
        shape: How many rows and columns there are. None: up to the last that has a pair.

    Returns:
        (K,) positions of the matched pairs, ascending.
    """
    if shape is None:
        shape = (int(row.max()) + 1, int(column.max()) + 1) if len(row) else (0, 0)
    if method == "hungarian" and shape[0] * shape[1] <= _TABLE_CELLS:
        return _table(row, column, affinity, shape)
    pair = (affinity > 0.0).nonzero()[0]
    if len(pair) == 0:
        return pair
    if len(pair) < len(affinity):
        row, column, affinity = row[pair], column[pair], affinity[pair]
    open_pairs = contested(row, column)
    if open_pairs is None:
        return pair
    left = open_pairs.nonzero()[0]
    row, column, affinity = _compact(row[left]), _compact(column[left]), affinity[left]
    if method == "greedy":
        won = _greedy(row, column, affinity)
    else:
        shape = (int(row.max()) + 1, int(column.max()) + 1)
        small = shape[0] * shape[1] <= _TABLE_CELLS
        won = _table(row, column, affinity, shape) if small else _components(row, column, affinity)
    matched = ~open_pairs
    matched[left[won]] = True
    return pair[matched]


def _compact(index: IntArray) -> IntArray:
    """The same indices counted without gaps from 0."""
    present = np.bincount(index) > 0
    compact: IntArray = (np.cumsum(present) - 1)[index]
    return compact


def _greedy(row: IntArray, column: IntArray, affinity: FloatArray) -> IntArray:
    """Positions of the pairs that are the best of their row and column among those left."""
    rows, columns = row.tolist(), column.tolist()
    taken_rows: set[int] = set()
    taken_columns: set[int] = set()
    won = []
    for k in np.argsort(-affinity, kind="stable").tolist():
        if rows[k] not in taken_rows and columns[k] not in taken_columns:
            taken_rows.add(rows[k])
            taken_columns.add(columns[k])
            won.append(k)
    return np.array(won, dtype=np.int64)


def _table(row: IntArray, column: IntArray, affinity: FloatArray, shape: tuple[int, int]) -> IntArray:
    """Positions of the pairs of greatest total affinity, by the Hungarian algorithm on a table."""
    table = np.zeros(shape)
    table[row, column] = np.maximum(affinity, 0.0)
    i, j = _hungarian()(table, maximize=True)
    partner = np.empty(shape[0], dtype=np.int64)
    partner.fill(-1)
    partner[i] = j
    # Cells of affinity 0 fill the assignment up and match nothing.
    won: IntArray = ((partner.take(row) == column) & (affinity > 0.0)).nonzero()[0]
    return won


def _components(row: IntArray, column: IntArray, affinity: FloatArray) -> IntArray:
    """`_table` for each connected component of the pairs; rows and columns are counted without gaps."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows = int(row.max()) + 1
    nodes = rows + int(column.max()) + 1
    graph = coo_array((np.ones(len(row), dtype=np.int8), (row, rows + column)), shape=(nodes, nodes))
    count, part = connected_components(graph, directed=False)
    # Where several tracks want one detection, or the reverse, the best pair wins.
    star = (
        np.minimum(np.bincount(part[:rows], minlength=count), np.bincount(part[rows:], minlength=count)) == 1
    )
    label = part[row]
    order = np.lexsort((-affinity, label))
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    won = [order[starts][star]]
    ends = np.append(starts[1:], len(order))
    for k in np.flatnonzero(~star).tolist():
        pairs = order[starts[k] : ends[k]]
        i, j = _compact(row[pairs]), _compact(column[pairs])
        won.append(pairs[_table(i, j, affinity[pairs], (int(i.max()) + 1, int(j.max()) + 1))])
    return np.concatenate(won)
