"""Where a pose lies in the network."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.openscenario.elements import Immutable


@dataclass(frozen=True, slots=True)
class LanePlace(Immutable):
    """Where a pose lies in the network."""

    lane: int
    road_id: str
    lane_id: int
    s_m: float
    t_m: float
    offset_m: float
    along_s: int

    def beside(self, lanes: int) -> int:
        """Id of the lane so many to the left, as seen along the heading of the pose; there is no lane 0."""
        lane_id, side = self.lane_id, (1 if lanes > 0 else -1) * self.along_s
        for _ in range(abs(lanes)):
            lane_id += side
            lane_id += 0 if lane_id else side
        return lane_id
