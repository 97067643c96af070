"""The borders of all lanes as cubics of s.

Between two records of lane offset, lane width or lane border every border of a lane section is one cubic: the
sum of the lane offset and of the widths between the centre lane and the border (ASAM OpenDRIVE 1.8, chapter
"Lanes"). The sums are taken once, so that a query costs one look-up per lane, however many lanes lie between
it and the centre.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    concatenated_ranges,
    first_rows,
    run_starts,
    until_next,
)
from opendrive.errors import MapContentError
from opendrive.geometry.cubic import control_values, restarted
from opendrive.geometry.profiles import CubicTable, sort_keys

MAX_ROWS = 1_000_000
"""A map that needs more cubics is refused: the towns of CARLA need two thousand."""


@dataclass(frozen=True, slots=True, eq=False)
class BorderTable:
    """Borders of the lanes over stretches of road within which every border is one cubic.

    Attributes:
        key: (P,) road and start of each stretch, ascending.
        road: (P,) road of each stretch.
        low_m: (P,) road s where it starts.
        high_m: (P,) road s where it ends.
        first_lane: (P,) first of its lanes, which are numbered without gap.
        lane_count: (P,) number of its lanes.
        first_row: (P + 1,) row of its first lane; the other lanes follow.
        coefficients: (2, 4, Q) a, b, c, d of the inner and of the outer border's t over s - low.
        first_stretch: (L,) first stretch of each lane.
        last_stretch: (L,) last stretch of each lane.
        is_slanted: (Q,) whether a border of the row is not parallel to the reference line.
    """

    key: NDArray[np.complex128]
    road: IntArray
    low_m: FloatArray
    high_m: FloatArray
    first_lane: IntArray
    lane_count: IntArray
    first_row: IntArray
    coefficients: FloatArray
    first_stretch: IntArray
    last_stretch: IntArray
    is_slanted: BoolArray

    @classmethod
    def build(
        cls,
        road: IntArray,
        section: IntArray,
        s_start_m: FloatArray,
        s_end_m: FloatArray,
        side: NDArray[np.int8],
        rank: IntArray,
        is_border: BoolArray,
        profiles: CubicTable,
        lane_offset: CubicTable,
    ) -> "BorderTable":
        """Add up the profiles of the lanes; the arguments are columns of a `LaneTable`.

        Raises:
            MapContentError: the lanes have so many records that the table would not fit into memory.
        """
        lanes = np.arange(len(road), dtype=np.int64)
        first_lane = run_starts(section)
        lane_count = np.diff(np.append(first_lane, len(lanes)))
        dense = np.repeat(np.arange(len(first_lane), dtype=np.int64), lane_count)
        start_m, end_m, of_road = s_start_m[first_lane], s_end_m[first_lane], road[first_lane]

        owner = dense[np.repeat(lanes, np.diff(profiles.first))]
        beside = np.searchsorted(sort_keys(of_road, start_m), lane_offset.key, side="right") - 1
        known = beside >= 0
        known[known] = of_road[beside[known]] == lane_offset.key.real[known]
        cut_section = np.concatenate([owner, beside[known]])
        cut_m = np.concatenate([profiles.start_m, lane_offset.start_m[known]])
        inside = (cut_m > start_m[cut_section]) & (cut_m < end_m[cut_section])
        of_section = np.concatenate([np.arange(len(first_lane)), cut_section[inside]])
        low_m = np.concatenate([start_m, cut_m[inside]])
        order = np.lexsort((low_m, of_section))
        of_section, low_m = of_section[order], low_m[order]
        distinct = np.ones(len(order), dtype=np.bool_)
        distinct[1:] = (of_section[1:] != of_section[:-1]) | (low_m[1:] != low_m[:-1])
        of_section, low_m = of_section[distinct], low_m[distinct]
        high_m = until_next(of_section, low_m, end_m[of_section])

        count = lane_count[of_section]
        first_row = first_rows(count)
        if first_row[-1] > MAX_ROWS:
            raise MapContentError(
                f"the lanes have {len(profiles.start_m) + len(lane_offset.start_m)} width, border and "
                f"laneOffset records, which make {first_row[-1]} border curves, expected at most {MAX_ROWS}; "
                "thin them out"
            )
        lane = concatenated_ranges(first_lane[of_section], count)
        stretch = np.repeat(np.arange(len(low_m), dtype=np.int64), count)
        own = _about(profiles, lane, low_m[stretch])
        centre = _about(lane_offset, of_road[of_section], low_m)
        coefficients = _summed(own, centre, stretch, rank[lane], side[lane], is_border[lane])
        first_stretch = first_rows(np.bincount(of_section, minlength=len(first_lane)))
        return cls(
            key=sort_keys(of_road[of_section], low_m),
            road=of_road[of_section],
            low_m=low_m,
            high_m=high_m,
            first_lane=first_lane[of_section],
            lane_count=count,
            first_row=first_row,
            coefficients=np.ascontiguousarray(coefficients.transpose(1, 2, 0)),
            first_stretch=first_stretch[dense],
            last_stretch=first_stretch[dense + 1] - 1,
            is_slanted=np.asarray(coefficients[:, :, 1:].any(axis=(1, 2)), dtype=np.bool_),
        )

    def stretch_of(self, lane: IntArray, road: IntArray, s_m: FloatArray) -> IntArray:
        """Return the stretch of each lane that holds `s_m`, both (N,); at a lane's end its last one."""
        stretch = np.searchsorted(self.key, sort_keys(road, s_m), side="right") - 1
        within: IntArray = np.clip(stretch, self.first_stretch[lane], self.last_stretch[lane])
        return within

    def rows(self, stretch: IntArray, lane: IntArray) -> IntArray:
        """Return the rows of lanes in stretches, both (N,)."""
        return self.first_row[stretch] + (lane - self.first_lane[stretch])

    def offsets(self, row: IntArray, ds_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return t of the inner and outer border at `ds_m` after the start of the stretch, (N,) each."""
        inner, outer = (
            a[row] + ds_m * (b[row] + ds_m * (c[row] + ds_m * d[row])) for a, b, c, d in self.coefficients
        )
        return inner, outer

    def slopes(self, row: IntArray, ds_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dt/ds of the inner and outer border at `ds_m` after the start of the stretch."""
        inner, outer = (
            b[row] + ds_m * (2.0 * c[row] + ds_m * 3.0 * d[row]) for _, b, c, d in self.coefficients
        )
        return inner, outer

    def extremes(self) -> tuple[FloatArray, FloatArray]:
        """Return bounds of t, (Q,) each, that hold for both borders of a row over its stretch.

        A cubic lies within the hull of its Bezier control values.
        """
        counts = np.diff(self.first_row)
        span = np.repeat(self.high_m - self.low_m, counts)
        a, b, c, d = np.moveaxis(self.coefficients, 1, 0)
        b, c, d = b * span, c * span**2, d * span**3
        control = control_values(a, b, c, d)
        return control.min(axis=(0, 1)), control.max(axis=(0, 1))


def _about(table: CubicTable, profile: IntArray, s_m: FloatArray) -> FloatArray:
    """Return the coefficients (N, 4) of profiles as cubics of the distance from `s_m`."""
    if not len(table.start_m):
        return np.zeros((len(profile), 4))
    return restarted(*table.records(profile, s_m))


def _summed(
    own: FloatArray,
    centre: FloatArray,
    stretch: IntArray,
    rank: IntArray,
    side: NDArray[np.int8],
    is_border: BoolArray,
) -> FloatArray:
    """Return inner and outer borders (Q, 2, 4) from what each lane adds, from the centre outwards.

    A lane given by its border does not depend on the lanes further inside.
    """
    borders = np.empty((len(own), 2, 4))
    order = np.argsort(rank, kind="stable")
    count = np.bincount(rank)
    ends = np.cumsum(count)
    for low, high in zip((ends - count).tolist(), ends.tolist(), strict=True):
        rows = order[low:high]
        base = centre[stretch[rows]]
        # The next lane towards the centre is the row before, which is finished.
        inner = base if low == 0 else borders[rows - 1, 1]
        borders[rows, 0] = inner
        borders[rows, 1] = np.where(
            is_border[rows, None], base + own[rows], inner + side[rows, None] * own[rows]
        )
    return borders
