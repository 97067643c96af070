"""Maps that give each lane by its two borders: the second `smartmot.maps.lane_map.LaneMap`.

A lane runs along its middle, where a border point meets the one at the same share of the other border. Lanes
beside each other are one road, whose s is the share of the way along each of them times their mean length.

What lies between a lane and the edge of the drivable area is a lane of type shoulder, and beyond the edge
begins one of type sidewalk: what is measured from a sidewalk is measured from that edge. Where the edge is
farther away than `vector_lanes.MAX_SHOULDER_M`, or another lane is before it, both have no
width.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scenarios.errors import DatasetError
from scenarios.recorded.maps.vector_lanes import (
    ROADWAY,
    SIDES,
    VectorLane,
    edge_strips,
    opposite,
    outlines,
    ribbon_between,
    same_way,
    surfaces,
)
from smartmot.maps.lane_map import LEVEL_M, LaneColumns, MapSignal, NearestLanes, PlacedPoints, Side
from smartmot.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class VectorCrosswalk:
    """A crosswalk on a road; one that several roads pass is one of each.

    Args:
        id: Its name in the map.
        road_id: The road.
        s_m: Where it is.
        polygon: (P, 2) outline, map frame.
    """

    id: str
    road_id: str
    s_m: float
    polygon: FloatArray


class VectorMap:
    """Lanes, crosswalks and drivable areas, map frame.

    Args:
        lanes: The lanes.
        drivable_m: (P, 2) outlines of the drivable areas.
        crosswalks_m: (P, 2) outlines of the crosswalks by name.
        name: Of the map.

    Raises:
        DatasetError: A number stands for two lanes, a lane has no length, or lanes are beside each other in a
            circle.
    """

    def __init__(
        self,
        lanes: Sequence[VectorLane],
        drivable_m: Sequence[FloatArray] = (),
        crosswalks_m: Mapping[str, FloatArray] | None = None,
        name: str = "",
    ) -> None:
        self.name = name
        self._given = tuple(lanes)
        self._row = {lane.id: row for row, lane in enumerate(lanes)}
        if len(self._row) < len(lanes):
            raise DatasetError("two lanes have the same id")
        ribbons = [ribbon_between(lane) for lane in lanes]
        self._neighbour = self._mutual()
        road, sign = self._roads()
        lengths = np.array([ribbon.length_m for ribbon in ribbons])
        road_m = np.bincount(road, lengths) / np.maximum(np.bincount(road), 1)
        first = [min(lane.id for k, lane in enumerate(lanes) if road[k] == r) for r in range(len(road_m))]
        lane_areas = surfaces(ribbons)
        junction = self._junctions(lane_areas)
        owner = list(range(len(lanes)))  # lane on whose road a row lies
        kinds = [lane.kind for lane in lanes]
        for row, side, strips in edge_strips(self._given, ribbons, lane_areas, drivable_m):
            inner = row
            for kind, strip in zip(("shoulder", "sidewalk"), strips, strict=True):
                outer = len(ribbons)
                ribbons.append(strip)
                kinds.append(kind)
                owner.append(row)
                self._neighbour[inner, side] = outer
                self._neighbour[outer, opposite(side)] = inner
                inner = outer
        self._ribbons, self._owner = tuple(ribbons), owner
        self._made = dict(enumerate(lane_areas))
        own = np.array(owner, dtype=np.int64)
        strips_from = len(lanes)
        columns = {
            "key": [
                (str(first[road[k]]), 0, lanes[k].id if row < strips_from else strips_from - 1 - row)
                for row, k in enumerate(owner)
            ],
            "lane_type": np.array(kinds, dtype=np.str_),
            "s_start_m": np.zeros(len(owner)),
            "s_end_m": road_m[road[own]],
            "direction": sign[own],
            "junction_id": [junction[k] for k in owner],
        }
        self.lanes: LaneColumns = SimpleNamespace(**columns)
        self._successors, self._predecessors = self._links()
        self._trees: dict[tuple[str, ...], tuple[IntArray, shapely.STRtree]] = {}
        self.crosswalks = self._crossed(crosswalks_m or {})

    # --- making --------------------------------------------------------------------------------------

    def _mutual(self) -> dict[tuple[int, Side], int]:
        """Rows beside a lane on each side, where both lanes say so."""
        beside: dict[tuple[int, Side], int] = {}
        for row, lane in enumerate(self._given):
            for side in SIDES:
                other = self._row.get(lane.beside.get(side, -1))
                if other is None or other == row:
                    continue
                back = opposite(side) if same_way(lane, self._given[other]) else side
                if self._given[other].beside.get(back) == lane.id:
                    beside[row, side] = other
        return beside

    def _roads(self) -> tuple[IntArray, IntArray]:
        """(L,) number of each lane's road, and +1 or -1: whether it runs along the road's s."""
        road, sign = np.full(len(self._given), -1), np.ones(len(self._given), dtype=np.int64)
        count = 0
        for start in range(len(self._given)):
            if road[start] >= 0:
                continue
            road[start], front, edges, size = count, [start], 0, 0
            while front:
                row = front.pop()
                size += 1
                for side in SIDES:
                    other = self._neighbour.get((row, side))
                    if other is None:
                        continue
                    edges += 1
                    if road[other] < 0:
                        road[other] = count
                        same = same_way(self._given[row], self._given[other])
                        sign[other] = sign[row] if same else -sign[row]
                        front.append(other)
            if edges > 2 * (size - 1):  # of a row of lanes, each pair is met from both sides
                raise DatasetError(f"lane {self._given[start].id}: its neighbours go round in a circle")
            count += 1
        return road, sign

    def _junctions(self, lane_areas: Sequence[shapely.Geometry]) -> list[str | None]:
        """L junctions: lanes in one that overlap each other."""
        inside = [row for row, lane in enumerate(self._given) if lane.in_junction]
        junction: list[str | None] = [None] * len(self._given)
        if not inside:
            return junction
        areas = [lane_areas[row] for row in inside]
        a, b = shapely.STRtree(areas).query(areas, predicate="intersects")
        graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(inside), len(inside)))
        _, group = connected_components(graph, directed=False)
        names: dict[int, str] = {}
        for row, number in zip(inside, group.tolist(), strict=True):
            junction[row] = names.setdefault(number, f"junction of lane {self._given[row].id}")
        return junction

    def _links(self) -> tuple[dict[int, tuple[int, ...]], dict[int, tuple[int, ...]]]:
        """Successors and predecessors by row; what one of two lanes says holds for both."""
        pairs: set[tuple[int, int]] = set()
        for row, lane in enumerate(self._given):
            pairs |= {(row, self._row[other]) for other in lane.successors if other in self._row}
            pairs |= {(self._row[other], row) for other in lane.predecessors if other in self._row}
        after: dict[int, tuple[int, ...]] = {}
        before: dict[int, tuple[int, ...]] = {}
        for a, b in sorted(pairs):
            after[a] = (*after.get(a, ()), b)
            before[b] = (*before.get(b, ()), a)
        return after, before

    def _crossed(self, crosswalks_m: Mapping[str, FloatArray]) -> tuple[VectorCrosswalk, ...]:
        """Crosswalks by the roads that they cross."""
        rows = [row for row, lane in enumerate(self._given) if lane.kind in (*ROADWAY, "biking")]
        middles = shapely.STRtree([self._middles[row] for row in rows])
        made = []
        for name, outline in crosswalks_m.items():
            area = shapely.make_valid(shapely.Polygon(outline))
            s_of_road: dict[str, list[float]] = {}
            for row in (rows[k] for k in np.sort(middles.query(area, predicate="intersects")).tolist()):
                point = shapely.get_coordinates(shapely.centroid(self._middles[row].intersection(area)))
                s_of_road.setdefault(self.lanes.key[row][0], []).append(float(self._s_of(row, point)[0]))
            made += [VectorCrosswalk(name, road, float(np.mean(s)), outline) for road, s in s_of_road.items()]
        return tuple(made)

    # --- geometry ------------------------------------------------------------------------------------

    @cached_property
    def _middles(self) -> list[shapely.LineString]:
        return [shapely.LineString(ribbon.center_m[:, :2]) for ribbon in self._ribbons]

    @cached_property
    def _outlines(self) -> shapely.STRtree:
        """Index of the outlines of all lanes."""
        return shapely.STRtree(outlines(self._ribbons))

    def _areas(self, rows: IntArray) -> NDArray[np.object_]:
        """Surfaces of lanes; that of a strip beside a lane is made when it is first asked for."""
        missing = [row for row in np.unique(rows).tolist() if row not in self._made]
        self._made.update(zip(missing, surfaces([self._ribbons[row] for row in missing]), strict=True))
        return np.array([self._made[row] for row in rows.tolist()], dtype=np.object_)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least and greatest coordinates of all lanes: xmin, ymin, xmax, ymax, metres."""
        if not self._ribbons:
            return (0.0, 0.0, 0.0, 0.0)
        x_min, y_min, x_max, y_max = shapely.total_bounds(self._outlines.geometries).tolist()
        return (x_min, y_min, x_max, y_max)

    def _share(self, lane: int, s_m: ArrayLike) -> FloatArray:
        """Share of the way along a lane at some s."""
        share: FloatArray = np.asarray(s_m, dtype=np.float64) / self.lanes.s_end_m[lane]
        if self.lanes.direction[lane] < 0:
            share = 1.0 - share
        return np.asarray(np.clip(share, 0.0, 1.0))

    def _along(self, lane: int, s_m: ArrayLike) -> FloatArray:
        """Way from a lane's entry at some s."""
        return np.asarray(self._share(lane, s_m) * self._ribbons[lane].length_m)

    def _s_of(self, lane: int, xy_m: FloatArray) -> FloatArray:
        """(N,) s of the feet of (N, 2) points on the middle of a lane."""
        ribbon = self._ribbons[lane]
        on_line = shapely.line_locate_point(self._middles[lane], shapely.points(xy_m))
        steps = np.hypot(*np.diff(ribbon.center_m[:, :2], axis=0).T)
        share = np.interp(on_line, np.append(0.0, np.cumsum(steps)), ribbon.along_m) / ribbon.length_m
        if self.lanes.direction[lane] < 0:
            share = 1.0 - share
        return np.asarray(share * self.lanes.s_end_m[lane])

    def center_line(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """See `LaneMap`."""
        ribbon, along = self._ribbons[lane], self._along(lane, s_m)
        x, y, z = (np.interp(along, ribbon.along_m, column) for column in ribbon.center_m.T)
        # of a strip beside a lane, the lane's: its middle jumps where its width does
        inner = self._ribbons[self._owner[lane]]
        step = np.diff(inner.center_m[:, :2], axis=0)
        part = np.searchsorted(inner.along_m, along, side="right") - 1
        heading = np.arctan2(step[:, 1], step[:, 0])[np.clip(part, 0, len(step) - 1)]
        return x, y, z, heading

    def lane_width(self, lane: int, s_m: ArrayLike) -> FloatArray:
        """See `LaneMap`."""
        ribbon = self._ribbons[lane]
        return np.asarray(np.interp(self._along(lane, s_m), ribbon.along_m, ribbon.width_m))

    def lane_polygon(self, lane: int, s_start_m: float, s_end_m: float) -> FloatArray:
        """(P, 2) outline of a stretch of a lane."""
        low, high = np.sort(self._share(lane, (s_start_m, s_end_m))).tolist()
        return self._ribbons[lane].outline(low, high)

    # --- links ---------------------------------------------------------------------------------------

    def successors(self, lane: int) -> tuple[int, ...]:
        """See `LaneMap`; those that the map does not have are left out."""
        return self._successors.get(lane, ())

    def predecessors(self, lane: int) -> tuple[int, ...]:
        """See `LaneMap`; those that the map does not have are left out."""
        return self._predecessors.get(lane, ())

    def left_neighbour(self, lane: int) -> int | None:
        """See `LaneMap`."""
        return self._neighbour.get((lane, "left"))

    def right_neighbour(self, lane: int) -> int | None:
        """See `LaneMap`."""
        return self._neighbour.get((lane, "right"))

    def lane_change_ranges(self, lane: int, side: Side) -> FloatArray:
        """See `LaneMap`: all of the lane, or nothing, for it has one mark on each side."""
        if lane >= len(self._given) or (lane, side) not in self._neighbour:
            return np.empty((0, 2))
        if not self._given[lane].may_leave[side]:
            return np.empty((0, 2))
        return np.array([[self.lanes.s_start_m[lane], self.lanes.s_end_m[lane]]])

    # --- under points --------------------------------------------------------------------------------

    def locate(self, xy_m: ArrayLike, z_m: ArrayLike | None = None) -> PlacedPoints:
        """See `LaneMap`; the height of a lane is that of its middle."""
        xy = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        places = np.asarray(shapely.points(xy))
        point, lane = self._outlines.query(places)
        inside = shapely.intersects(self._areas(lane), places[point])
        point, lane = point[inside], lane[inside]
        order = np.lexsort((lane, point))
        point, lane = point[order], lane[order]
        s_m, margin_m = np.zeros(len(lane)), np.zeros(len(lane))
        for row in np.unique(lane).tolist():
            on_it = lane == row
            ribbon = self._ribbons[row]
            s_m[on_it] = self._s_of(row, xy[point[on_it]])
            borders = (shapely.LineString(ribbon.left_m), shapely.LineString(ribbon.right_m))
            to_border_m = (shapely.distance(places[point[on_it]], border) for border in borders)
            margin_m[on_it] = np.minimum(*to_border_m)
        if z_m is not None and len(lane):
            wanted = np.broadcast_to(np.asarray(z_m, dtype=np.float64), len(xy))[point]
            height = np.array(
                [float(self.center_line(row, s)[2]) for row, s in zip(lane.tolist(), s_m, strict=True)]
            )
            least = np.full(len(xy), np.inf)
            np.minimum.at(least, point, np.abs(height - wanted))
            level = np.abs(height - wanted) <= least[point] + LEVEL_M
            point, lane, s_m, margin_m = point[level], lane[level], s_m[level], margin_m[level]
        placed: PlacedPoints = SimpleNamespace(point=point, lane=lane, s_m=s_m, margin_m=margin_m)
        return placed

    def nearest_lane(
        self, xy_m: ArrayLike, lane_types: Collection[str] = ("driving",), *, z_m: ArrayLike | None = None
    ) -> NearestLanes:
        """See `LaneMap`; heights are not looked at: it is the nearest in plan."""
        xy = np.asarray(xy_m, dtype=np.float64).reshape(-1, 2)
        rows, tree = self._tree(tuple(sorted(lane_types)))
        nearest, s_m, distance = (
            np.zeros(len(xy), dtype=np.int64),
            np.zeros(len(xy)),
            np.full(len(xy), np.inf),
        )
        if len(rows) and len(xy):
            places = np.asarray(shapely.points(xy))
            (point, lane), off = tree.query_nearest(places, return_distance=True, all_matches=True)
            lane = rows[lane]
            middle = np.array(self._middles, dtype=object)[lane]
            # several lanes contain a point: the last one written is that whose middle is nearest
            order = np.lexsort((lane, shapely.distance(places[point], middle), point))[::-1]
            nearest[point[order]], distance[point[order]] = lane[order], off[order]
            for row in np.unique(nearest).tolist():
                on_it = nearest == row
                s_m[on_it] = self._s_of(row, xy[on_it])
        made: NearestLanes = SimpleNamespace(
            found=np.isfinite(distance), lane=nearest, s_m=s_m, distance_m=distance
        )
        return made

    def _tree(self, lane_types: tuple[str, ...]) -> tuple[IntArray, shapely.STRtree]:
        """Rows of some types, and an index of their surfaces."""
        if lane_types not in self._trees:
            rows = np.flatnonzero(np.isin(self.lanes.lane_type, list(lane_types)))
            self._trees[lane_types] = (rows, shapely.STRtree(self._areas(rows)))
        return self._trees[lane_types]

    # --- rules ---------------------------------------------------------------------------------------

    def signals_of(self, road_id: str) -> Sequence[MapSignal]:
        """See `LaneMap`: these maps have no signals."""
        return ()
