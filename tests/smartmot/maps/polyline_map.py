"""A map whose lanes are polylines with a width: a second `smartmot.LaneMap`, without OpenDRIVE."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from smartmot.path import PlannedPath
from smartmot.types import FloatArray

Point = tuple[float, float]


@dataclass(frozen=True)
class Lane:
    """A lane along its points, in the direction of travel; s is the distance along them."""

    points: Sequence[Point]
    width_m: float = 3.5
    kind: str = "driving"
    road: str = "street"
    left: int | None = None
    right: int | None = None
    next_lanes: tuple[int, ...] = ()
    change: Mapping[str, Sequence[tuple[float, float]]] = field(default_factory=dict)


class PolylineMap:
    def __init__(
        self, lanes: Sequence[Lane], signals: Sequence[object] = (), crosswalks: Sequence[object] = ()
    ) -> None:
        self._lanes, self._signals, self.crosswalks = lanes, signals, crosswalks
        self._paths = [PlannedPath.through(lane.points) for lane in lanes]
        self.lanes = SimpleNamespace(
            key=[(lane.road, 0, k) for k, lane in enumerate(lanes)],
            lane_type=np.array([lane.kind for lane in lanes]),
            s_start_m=np.zeros(len(lanes)),
            s_end_m=np.array([path.length_m for path in self._paths]),
            direction=np.ones(len(lanes), dtype=np.int8),
            junction_id=[None] * len(lanes),
        )

    def center_line(self, lane: int, s_m: ArrayLike) -> tuple[FloatArray, ...]:
        points, heading = self._paths[lane].poses(np.atleast_1d(np.asarray(s_m, dtype=np.float64)))
        return points[:, 0], points[:, 1], np.zeros(len(points)), heading

    def lane_width(self, lane: int, s_m: ArrayLike) -> FloatArray:
        return np.full(np.shape(s_m), self._lanes[lane].width_m)

    def successors(self, lane: int) -> tuple[int, ...]:
        return self._lanes[lane].next_lanes

    def predecessors(self, lane: int) -> tuple[int, ...]:
        return tuple(k for k, other in enumerate(self._lanes) if lane in other.next_lanes)

    def left_neighbour(self, lane: int) -> int | None:
        return self._lanes[lane].left

    def right_neighbour(self, lane: int) -> int | None:
        return self._lanes[lane].right

    def lane_change_ranges(self, lane: int, side: str) -> FloatArray:
        return np.array(self._lanes[lane].change.get(side, ()), dtype=np.float64).reshape(-1, 2)

    def _beyond(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """(N, L) s of the foot, and distance beyond the lane's border, negative inside."""
        s, beyond = [], []
        for lane, path in zip(self._lanes, self._paths, strict=True):
            station, offset = path.place(np.asarray(xy_m, dtype=np.float64))
            on_it = np.clip(station, 0.0, path.length_m)
            s.append(on_it)
            beyond.append(np.hypot(offset, station - on_it) - lane.width_m / 2)
        return np.stack(s, axis=1), np.stack(beyond, axis=1)

    def locate(self, xy_m: ArrayLike) -> SimpleNamespace:
        s, beyond = self._beyond(xy_m)
        point, lane = np.nonzero(beyond <= 0.0)
        return SimpleNamespace(point=point, lane=lane, s_m=s[point, lane], margin_m=-beyond[point, lane])

    def nearest_lane(self, xy_m: ArrayLike, lane_types: Collection[str] = ("driving",)) -> SimpleNamespace:
        s, beyond = self._beyond(xy_m)
        beyond[:, ~np.isin(self.lanes.lane_type, list(lane_types))] = np.inf
        lane, rows = beyond.argmin(axis=1), np.arange(len(beyond))
        distance = np.maximum(beyond[rows, lane], 0.0)
        return SimpleNamespace(found=np.isfinite(distance), lane=lane, s_m=s[rows, lane], distance_m=distance)

    def signals_of(self, road_id: str) -> Sequence[object]:
        return [signal for signal in self._signals if signal.road_id == road_id]  # type: ignore[attr-defined]
