"""All lanes of a network as one struct of arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import BoolArray, FloatArray, IntArray, read_only
from opendrive.lane_borders import BorderTable
from opendrive.model import Lane, Road
from opendrive.profiles import CubicTable


class LaneKey(NamedTuple):
    """Name of a lane: road, index of its lane section in the road, and lane id."""

    road_id: str
    section: int
    lane_id: int


@dataclass(frozen=True, eq=False)
class LaneTable:
    """Lanes of a network, index i in 0 .. L-1; the centre lanes, which have no width, are left out.

    Attributes:
        key: (L,) names.
        lane_type: (L,) OpenDRIVE type names.
        s_start_m: (L,) road s where the lane starts.
        s_end_m: (L,) road s where it ends.
        direction: (L,) int8, +1 if traffic runs along s, -1 if against; honours left-hand traffic
            and lanes whose direction is reversed.
        junction_id: (L,) junction of the lane's road, or None.
        road: (L,) index of the road.
        side: (L,) int8, +1 left of the centre lane, -1 right of it.
        section: (L,) index of the lane section in the network; its lanes are numbered without gap.
        rank: (L,) number of lanes between the lane and the centre lane.
        is_border: (L,) whether `profile` is the outer border's t instead of a width.
        profiles: width or border of lane i is profile i, over road s.
        lane_offset: offset of the centre lane; profile r belongs to road r.
        lane_of_key: index by name.
        records: (L,) lanes as read.
    """

    key: tuple[LaneKey, ...]
    lane_type: NDArray[np.str_]
    s_start_m: FloatArray
    s_end_m: FloatArray
    direction: NDArray[np.int8]
    junction_id: tuple[str | None, ...]
    road: IntArray
    side: NDArray[np.int8]
    section: IntArray
    rank: IntArray
    is_border: BoolArray
    profiles: CubicTable
    lane_offset: CubicTable
    lane_of_key: dict[LaneKey, int]
    records: tuple[Lane, ...]

    def __len__(self) -> int:
        return len(self.key)

    @classmethod
    def collect(cls, roads: Sequence[Road]) -> "LaneTable":
        """Collect the lanes of `roads`."""
        key: list[LaneKey] = []
        rows: list[tuple[float, float, int, int, int, int, int]] = []
        sections = 0
        junction: list[str | None] = []
        records: list[Lane] = []
        for r, road in enumerate(roads):
            keep_right = 1 if road.rule == "RHT" else -1
            starts = [section.s_m for section in road.sections]
            ends = [*starts[1:], max(road.length_m, starts[-1])]
            for k, section in enumerate(road.sections):
                left = [lane for lane in section.lanes if lane.id > 0][::-1]
                right = [lane for lane in section.lanes if lane.id < 0]
                for side, lanes in ((1, left), (-1, right)):
                    for rank, lane in enumerate(lanes):
                        turned = -1 if lane.direction == "reversed" else 1
                        direction = -side * keep_right * turned
                        rows.append((starts[k], ends[k], direction, r, side, sections, rank))
                        key.append(LaneKey(road.id, k, lane.id))
                        junction.append(road.junction_id)
                        records.append(lane)
                sections += 1
        columns = np.array(rows, dtype=np.float64).reshape(-1, 7).T
        start, end = read_only(columns[0].copy()), read_only(columns[1].copy())
        return cls(
            key=tuple(key),
            lane_type=read_only(np.array([lane.type for lane in records], dtype=np.str_)),
            s_start_m=start,
            s_end_m=end,
            direction=read_only(columns[2].astype(np.int8)),
            junction_id=tuple(junction),
            road=read_only(columns[3].astype(np.int64)),
            side=read_only(columns[4].astype(np.int8)),
            section=read_only(columns[5].astype(np.int64)),
            rank=read_only(columns[6].astype(np.int64)),
            is_border=np.array(
                [not len(lane.width) and len(lane.border) > 0 for lane in records], dtype=np.bool_
            ),
            profiles=CubicTable.stack(
                [lane.width if len(lane.width) else lane.border for lane in records], list(start)
            ),
            lane_offset=CubicTable.stack([road.lane_offset for road in roads]),
            lane_of_key={name: i for i, name in enumerate(key)},
            records=tuple(records),
        )

    @cached_property
    def borders(self) -> BorderTable:
        """Borders of all lanes as cubics of s.

        Raises:
            MapContentError: the lanes have too many records.
        """
        return BorderTable.build(
            self.road,
            self.section,
            self.s_start_m,
            self.s_end_m,
            self.side,
            self.rank,
            self.is_border,
            self.profiles,
            self.lane_offset,
        )

    def offsets_and_slopes(
        self, lane: IntArray, s_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return t of the inner and outer border and their derivatives by s.

        At the end of a lane the limit from inside holds, even if the lane offset jumps there.

        Args:
            lane: (N,) lane indices.
            s_m: (N,) road s.

        Returns:
            t_inner, t_outer, dt_inner/ds, dt_outer/ds, all (N,).
        """
        borders = self.borders
        stretch = borders.stretch_of(lane, self.road[lane], s_m)
        row, ds_m = borders.rows(stretch, lane), s_m - borders.low_m[stretch]
        return *borders.offsets(row, ds_m), *borders.slopes(row, ds_m)
