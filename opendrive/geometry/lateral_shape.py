"""The lateral shape of road surfaces: height over t, such as that of a crowned or rutted road.

At some s a road has cubics of the height over t; between two such places the heights are interpolated
linearly (ASAM OpenDRIVE 1.8, chapter "Roads", "Shape definition").
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import FloatArray, IntArray, first_rows
from opendrive.geometry.profiles import CubicTable, sort_keys


@dataclass(frozen=True, slots=True, eq=False)
class ShapeTable:
    """Lateral shapes of all roads.

    Attributes:
        key: (P,) road and s of each place with a shape, ascending.
        first: (R + 1,) first place of each road.
        s_m: (P,) s of the places.
        heights: height over t; profile p belongs to place p.
        least_t_m: (P,) where the first cubic of each place starts.
    """

    key: NDArray[np.complex128]
    first: IntArray
    s_m: FloatArray
    heights: CubicTable
    least_t_m: FloatArray

    @classmethod
    def stack(cls, shapes: Sequence[FloatArray]) -> "ShapeTable":
        """Stack the shapes of R roads: arrays (K, 6) of ``s, t, a, b, c, d``."""
        road = np.repeat(np.arange(len(shapes)), [len(shape) for shape in shapes])
        return cls.build(road, np.concatenate([np.empty((0, 6)), *shapes]), len(shapes))

    @classmethod
    def build(cls, road: IntArray, rows: FloatArray, roads: int) -> "ShapeTable":
        """Make the table from cubics.

        Args:
            road: (K,) road index.
            rows: (K, 6) columns ``s, t, a, b, c, d``.
            roads: number of roads R.
        """
        order = np.lexsort((rows[:, 1], rows[:, 0], road))
        road, rows = road[order], rows[order]
        is_first = np.append(True, (np.diff(road) > 0) | (np.diff(rows[:, 0]) > 0.0))[: len(rows)]
        first, place = np.flatnonzero(is_first), np.cumsum(is_first) - 1
        return cls(
            key=sort_keys(road[first], rows[first, 0]),
            first=first_rows(np.bincount(road[first], minlength=roads)),
            s_m=rows[first, 0],
            heights=CubicTable.of_rows(place, rows[:, 1:], len(first)),
            least_t_m=rows[first, 1],
        )

    def __bool__(self) -> bool:
        return bool(len(self.s_m))

    def greatest_heights(self, reach_m: float) -> FloatArray:
        """Return bounds (R,) of the magnitude of the heights within `reach_m` of the reference lines."""
        road = np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        greatest = np.zeros(len(self.first) - 1)
        np.maximum.at(greatest, road, self.heights.greatest(np.full(len(road), reach_m)))
        return greatest

    def height(self, road: IntArray, s_m: FloatArray, t_m: FloatArray) -> FloatArray:
        """Return the heights (N,) at (s, t) of roads.

        Before the first place and after the last one of a road its shape is held; to the right of the first
        cubic its first value.
        """
        height = np.zeros(len(s_m))
        some = np.flatnonzero(self.first[road + 1] > self.first[road])
        if not some.size:
            return height
        road, s_m, t_m = road[some], s_m[some], t_m[some]
        place = np.searchsorted(self.key, sort_keys(road, s_m), side="right") - 1
        last = self.first[road + 1] - 1
        before = np.clip(place, self.first[road], last)
        after = np.clip(place + 1, self.first[road], last)
        gap = self.s_m[after] - self.s_m[before]
        share = np.where(gap > 0.0, (s_m - self.s_m[before]) / np.where(gap > 0.0, gap, 1.0), 0.0)
        low, high = (self.heights.value(at, np.maximum(t_m, self.least_t_m[at])) for at in (before, after))
        height[some] = low + np.clip(share, 0.0, 1.0) * (high - low)
        return height
