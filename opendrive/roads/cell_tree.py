"""A tree over the boxes around the cells of some lanes: which cells may hold a point, or be within reach."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import shapely

from opendrive.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_BLOCK = 16384
_FAR_M = 500.0
_FAR_BLOCK = 1024
"""Points far off are asked about this many at a time: each may be within reach of thousands of boxes."""


@dataclass(frozen=True, slots=True, eq=False)
class CellTree:
    """The cells that have lanes of some types.

    Attributes:
        lane_wanted: (L,) the lanes of these types.
        cell: (C',) their cells.
        frame: (C', 4) x, y, cos and sin of the heading of the frames of the boxes around these lanes.
        box: (C', 4) least and greatest u, least and greatest v of the boxes.
        circle: x, y and radius of the circles around the boxes, (C',) each.
        tree: tree over the boxes.
        centres: tree over the middles of the circles.
        samples: tree over points within these lanes, one in each lane of each cell.
        cell_of_sample: cell of each sample.
        lane_of_sample: its lane.
        sample_z_m: its height.
    """

    lane_wanted: BoolArray
    cell: IntArray
    frame: FloatArray
    box: FloatArray
    circle: tuple[FloatArray, FloatArray, FloatArray]
    tree: shapely.STRtree
    centres: "cKDTree"
    samples: "cKDTree"
    cell_of_sample: IntArray
    lane_of_sample: IntArray
    sample_z_m: FloatArray

    def candidates(self, xy_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Return pairs of point and row whose box holds the point."""
        point, row = self.tree.query(shapely.points(xy_m))
        beside_u, beside_v = self._beside(xy_m[point], row)
        inside = np.flatnonzero((beside_u <= 0.0) & (beside_v <= 0.0))
        return point[inside], row[inside]

    def within(self, xy_m: FloatArray, reach_m: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
        """Yield pairs of point and row whose box is within reach, block by block."""
        start, reached_m = 0, self.circle[2].max(initial=0.0)
        while start < len(xy_m):
            # A square around the point is the quicker question, but far off the map too many boxes meet it.
            is_far = reach_m[start : start + _BLOCK].max() > _FAR_M
            block = slice(start, start + (_FAR_BLOCK if is_far else _BLOCK))
            xy, reach = xy_m[block], reach_m[block]
            if is_far:
                near = self.centres.query_ball_point(xy, reach + reached_m, return_sorted=False)
                count = np.fromiter(map(len, near), np.int64, len(near))
                point = np.repeat(np.arange(len(xy)), count)
                row = np.fromiter(chain.from_iterable(near), np.int64, len(point))
            else:
                # The tree looks at envelopes alone, and a diagonal has that of its square.
                diagonals = np.stack([xy - reach[:, None], xy + reach[:, None]], axis=1)
                point, row = self.tree.query(shapely.linestrings(diagonals))
            # Most of them are further off than the circle around the box already is.
            dx, dy = xy[point, 0] - self.circle[0][row], xy[point, 1] - self.circle[1][row]
            near = np.flatnonzero(dx**2 + dy**2 <= (reach[point] + self.circle[2][row]) ** 2)
            point, row = point[near], row[near]
            beside_u, beside_v = np.maximum(self._beside(xy[point], row), 0.0)
            near = np.flatnonzero(beside_u**2 + beside_v**2 <= reach[point] ** 2)
            yield start + point[near], row[near]
            start = block.stop

    def _beside(self, xy_m: FloatArray, row: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return how far points lie outside boxes along u and along v; negative if between the sides."""
        x, y, cos, sin = self.frame[row].T
        u_low, u_high, v_low, v_high = self.box[row].T
        dx, dy = xy_m[:, 0] - x, xy_m[:, 1] - y
        u, v = cos * dx + sin * dy, cos * dy - sin * dx
        return np.maximum(u_low - u, u - u_high), np.maximum(v_low - v, v - v_high)
