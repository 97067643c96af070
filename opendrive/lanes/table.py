"""All lanes of a network as one struct of arrays."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import BoolArray, FloatArray, IntArray, read_only
from opendrive.geometry.borders import BorderTable
from opendrive.geometry.profiles import CubicTable
from opendrive.model import LaneSection, Road, RoadLink, TrafficRule

_Value = TypeVar("_Value")


class LaneKey(NamedTuple):
    """Name of a lane: road, index of its lane section in the road, and lane id."""

    road_id: str
    section: int
    lane_id: int


class RoadTable(NamedTuple):
    """Roads of a network, index r in 0 .. R-1.

    Attributes:
        id: (R,) ids.
        length_m: (R,) lengths of the reference lines.
        rule: (R,) right-hand or left-hand traffic.
        junction_id: (R,) junction that the road is part of, or None.
        predecessor: (R,) links of the starts.
        successor: (R,) links of the ends.
    """

    id: tuple[str, ...]
    length_m: FloatArray
    rule: tuple[TrafficRule, ...]
    junction_id: tuple[str | None, ...]
    predecessor: tuple[RoadLink | None, ...]
    successor: tuple[RoadLink | None, ...]

    @classmethod
    def collect(cls, roads: Sequence[Road]) -> "RoadTable":
        """Collect `roads`."""
        return cls(
            id=tuple(road.id for road in roads),
            length_m=np.array([road.length_m for road in roads], dtype=np.float64),
            rule=tuple(road.rule for road in roads),
            junction_id=tuple(road.junction_id for road in roads),
            predecessor=tuple(road.predecessor for road in roads),
            successor=tuple(road.successor for road in roads),
        )


class SectionColumns(NamedTuple):
    """Lane sections, ascending in road and s.

    Attributes:
        road: (S,) road index.
        start_m: (S,) s where the section starts.
    """

    road: IntArray
    start_m: FloatArray


class LaneColumns(NamedTuple):
    """Lanes as they stand in a file, N of them, in any order within their section.

    Attributes:
        section: (N,) index of the lane section.
        id: (N,) lane ids; 0 for centre lanes.
        type: (N,) type names.
        level: (N,) whether they are kept horizontal.
        direction: (N,) ``standard``, ``reversed`` or ``both``.
        predecessors: (N,) ids of the linked lanes at the start of the section.
        successors: (N,) ids of the linked lanes at its end.
        width: lane index (K,) and cubics (K, 5), ascending in s within a lane.
        border: the same of the outer borders.
        height: lane index (K,) and rows (K, 3) of ``s, inner, outer``.
    """

    section: IntArray
    id: IntArray
    type: Sequence[str]
    level: Sequence[bool]
    direction: Sequence[str]
    predecessors: Sequence[tuple[int, ...]]
    successors: Sequence[tuple[int, ...]]
    width: tuple[IntArray, FloatArray]
    border: tuple[IntArray, FloatArray]
    height: tuple[IntArray, FloatArray]

    def joined(self, other: "LaneColumns", sections: int) -> "LaneColumns":
        """Return these lanes, in `sections` lane sections, followed by others in sections of their own."""
        count = len(self.id)

        def rows(
            own: tuple[IntArray, FloatArray], others: tuple[IntArray, FloatArray]
        ) -> tuple[IntArray, FloatArray]:
            return np.append(own[0], others[0] + count), np.concatenate([own[1], others[1]])

        return LaneColumns(
            np.append(self.section, other.section + sections),
            np.append(self.id, other.id),
            [*self.type, *other.type],
            [*self.level, *other.level],
            [*self.direction, *other.direction],
            [*self.predecessors, *other.predecessors],
            [*self.successors, *other.successors],
            rows(self.width, other.width),
            rows(self.border, other.border),
            rows(self.height, other.height),
        )

    def renumbered(self, section_of: IntArray) -> "LaneColumns":
        """Return the lanes with new indices of their sections, without those whose index is negative."""
        section = section_of[self.section]
        kept = np.flatnonzero(section >= 0)
        lane_of = np.full(len(section), -1, dtype=np.int64)
        lane_of[kept] = np.arange(len(kept))
        return LaneColumns(
            section[kept],
            self.id[kept],
            _picked(self.type, kept),
            _picked(self.level, kept),
            _picked(self.direction, kept),
            _picked(self.predecessors, kept),
            _picked(self.successors, kept),
            _placed(self.width, lane_of),
            _placed(self.border, lane_of),
            _placed(self.height, lane_of),
        )

    @classmethod
    def collect(cls, sections: Iterable[LaneSection]) -> "LaneColumns":
        """Collect the lanes of `sections`."""
        placed = [(k, lane) for k, section in enumerate(sections) for lane in section.lanes]
        lanes = [lane for _, lane in placed]

        def rows(parts: Sequence[FloatArray], width: int) -> tuple[IntArray, FloatArray]:
            owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
            return owner, np.concatenate([np.empty((0, width)), *parts])

        return cls(
            section=np.array([k for k, _ in placed], dtype=np.int64),
            id=np.array([lane.id for lane in lanes], dtype=np.int64),
            type=[lane.type for lane in lanes],
            level=[lane.level for lane in lanes],
            direction=[lane.direction for lane in lanes],
            predecessors=[lane.predecessors for lane in lanes],
            successors=[lane.successors for lane in lanes],
            width=rows([lane.width for lane in lanes], 5),
            border=rows([lane.border for lane in lanes], 5),
            height=rows([lane.height for lane in lanes], 3),
        )


@dataclass(frozen=True, eq=False)
class LaneTable:
    """Lanes of a network, index i in 0 .. L-1; the centre lanes, which have no width, are left out.

    Attributes:
        key: (L,) names.
        lane_type: (L,) OpenDRIVE type names.
        s_start_m: (L,) road s where the lane starts.
        s_end_m: (L,) road s where it ends.
        direction: (L,) int8, +1 if traffic runs along s, -1 if against; honours left-hand traffic
            and lanes whose direction is reversed. Lanes for both directions have that of ``standard``.
        junction_id: (L,) junction of the lane's road, or None.
        road: (L,) index of the road.
        side: (L,) int8, +1 left of the centre lane, -1 right of it.
        section: (L,) index of the lane section in the network; its lanes are numbered without gap.
        sections: all lane sections, also those without lanes.
        rank: (L,) number of lanes between the lane and the centre lane.
        level: (L,) whether it is kept horizontal.
        predecessors: (L,) ids of the linked lanes at the start of the section.
        successors: (L,) ids of the linked lanes at its end.
        is_border: (L,) whether its profile is the outer border's t instead of a width.
        profiles: width or border of lane i is profile i, over road s.
        lane_offset: offset of the centre lane; profile r belongs to road r.
        inner_height: height of the inner border above the road; profile i belongs to lane i, over road s.
        outer_height: the same of the outer border.
        lane_of_key: index by name.
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
    sections: SectionColumns
    rank: IntArray
    level: BoolArray
    predecessors: tuple[tuple[int, ...], ...]
    successors: tuple[tuple[int, ...], ...]
    is_border: BoolArray
    profiles: CubicTable
    lane_offset: CubicTable
    inner_height: CubicTable
    outer_height: CubicTable
    lane_of_key: dict[LaneKey, int]

    def __len__(self) -> int:
        return len(self.key)

    @classmethod
    def build(
        cls, roads: RoadTable, sections: SectionColumns, columns: LaneColumns, lane_offset: CubicTable
    ) -> "LaneTable":
        """Put lanes into order: by section, the left ones before the right ones, from the centre outwards."""
        side_of = np.sign(columns.id)
        order = np.lexsort((np.abs(columns.id), -side_of, columns.section))
        order = order[columns.id[order] != 0]
        section, lane_id = columns.section[order], columns.id[order]
        side = side_of[order].astype(np.int8)
        first = np.flatnonzero((np.diff(section, prepend=-1) != 0) | (np.diff(side, prepend=0) != 0))
        rank = np.arange(len(order)) - np.repeat(first, np.diff(np.append(first, len(order))))

        last = np.append(np.diff(sections.road) != 0, True)[: len(sections.road)]
        road_end_m = np.maximum(roads.length_m[sections.road], sections.start_m)
        section_end_m = np.where(last, road_end_m, np.append(sections.start_m[1:], 0.0))
        road = sections.road[section]
        number = section - np.searchsorted(sections.road, road)
        key = tuple(
            map(LaneKey._make, zip(_picked(roads.id, road), number.tolist(), lane_id.tolist(), strict=True))
        )
        keep_right = np.array([1 if rule == "RHT" else -1 for rule in roads.rule], dtype=np.int8)
        turned = np.array([-1 if name == "reversed" else 1 for name in columns.direction], dtype=np.int8)

        lane_of = np.full(len(columns.id), -1, dtype=np.int64)
        lane_of[order] = np.arange(len(order))
        start_m = read_only(sections.start_m[section])
        by_width = np.zeros(len(order) + 1, dtype=np.bool_)
        by_width[lane_of[columns.width[0]]] = True
        by_width = by_width[:-1]
        owner, rows = _placed(columns.width, lane_of)
        border_owner, border_rows = _placed(columns.border, lane_of)
        used = ~by_width[border_owner]
        owner, rows = np.append(owner, border_owner[used]), np.concatenate([rows, border_rows[used]])
        is_border = np.zeros(len(order), dtype=np.bool_)
        is_border[border_owner[used]] = True
        height = _placed(columns.height, lane_of)
        return cls(
            key=key,
            # Every cell of the array is as wide as the longest text.
            lane_type=read_only(np.array([columns.type[i][:80] for i in order.tolist()], dtype=np.str_)),
            s_start_m=start_m,
            s_end_m=read_only(section_end_m[section]),
            direction=read_only(-side * keep_right[road] * turned[order]),
            junction_id=tuple(_picked(roads.junction_id, road)),
            road=read_only(road),
            side=read_only(side),
            section=read_only(section),
            sections=sections,
            rank=read_only(rank),
            level=read_only(np.array(columns.level, dtype=np.bool_)[order]),
            predecessors=tuple(_picked(columns.predecessors, order)),
            successors=tuple(_picked(columns.successors, order)),
            is_border=read_only(is_border),
            profiles=CubicTable.of_rows(owner, rows, len(order), start_m),
            lane_offset=lane_offset,
            inner_height=_ramps(*height, 1, start_m),
            outer_height=_ramps(*height, 2, start_m),
            lane_of_key={name: i for i, name in enumerate(key)},
        )

    @classmethod
    def collect(cls, roads: Sequence[Road]) -> "LaneTable":
        """Collect the lanes of `roads`."""
        count = [len(road.sections) for road in roads]
        sections = [section for road in roads for section in road.sections]
        starts = np.array([section.s_m for section in sections], dtype=np.float64)
        return cls.build(
            RoadTable.collect(roads),
            SectionColumns(np.repeat(np.arange(len(roads)), count), starts),
            LaneColumns.collect(sections),
            CubicTable.stack([road.lane_offset for road in roads]),
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


def _picked(values: Sequence[_Value], indices: IntArray) -> list[_Value]:
    return [values[i] for i in indices.tolist()]


def _placed(records: tuple[IntArray, FloatArray], lane_of: IntArray) -> tuple[IntArray, FloatArray]:
    """Return records with the lanes' new indices, without those of lanes that have none (-1)."""
    owner, rows = lane_of[records[0]], records[1]
    kept = owner >= 0
    return owner[kept], rows[kept]


def _ramps(owner: IntArray, rows: FloatArray, column: int, origin_m: FloatArray) -> CubicTable:
    """Return the profiles that join a column of the records by straight lines over their s."""
    order = np.lexsort((rows[:, 0], owner))
    owner, s_m, value = owner[order], rows[order, 0], rows[order, column]
    records = np.zeros((len(order), 5))
    records[:, 0], records[:, 1] = s_m, value
    joined = np.flatnonzero((owner[1:] == owner[:-1]) & (s_m[1:] > s_m[:-1]))
    records[joined, 2] = (value[joined + 1] - value[joined]) / (s_m[joined + 1] - s_m[joined])
    return CubicTable.of_rows(owner, records, len(origin_m), origin_m)
