"""Lanes around a way, of a map of any size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opendrive import RoadNetwork
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.types import FloatArray, IntArray

REACH_M = 150.0
"""Lanes farther than this from the box around the ego's way are left out: beyond it no sensor sees."""
_STEP_M = 50.0
"""Of the points at which a lane is looked for; half of it is added to the reach."""


@dataclass(frozen=True, slots=True, eq=False)
class NearLanes:
    """Lanes around a way.

    Args:
        lane: (K,) their rows in the map's table.
        outline_m: K outlines (P, 2), map frame, along the right border and back along the left.
        left_out: lanes of the map that are too far away.
    """

    lane: IntArray
    outline_m: tuple[FloatArray, ...]
    left_out: int

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know, a line each."""
        if not self.left_out:
            return ()
        total = self.left_out + len(self.lane)
        return (f"{self.left_out} of {total} lanes are left out: over {REACH_M:g} m from the ego's way",)


def lanes_near(network: DriveMap, way_m: FloatArray) -> NearLanes:
    """Lanes around a way, but those of type none.

    Args:
        network: the map.
        way_m: (N, 2) the way, map frame.
    """
    lanes = network.lanes
    shown = np.flatnonzero(np.asarray(lanes.lane_type) != "none")
    low, high = way_m.min(axis=0) - REACH_M, way_m.max(axis=0) + REACH_M
    near = shown[_in_box(network, shown, low - 0.5 * _STEP_M, high + 0.5 * _STEP_M)]
    outlines = [
        network.lane_polygon(lane, float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane]))
        for lane in near.tolist()
    ]
    meets = [bool((o.max(axis=0) >= low).all() and (o.min(axis=0) <= high).all()) for o in outlines]
    kept = tuple(outline for outline, inside in zip(outlines, meets, strict=True) if inside)
    return NearLanes(near[np.array(meets, dtype=np.bool_)], kept, len(shown) - len(kept))


def _in_box(network: DriveMap, lanes: IntArray, low: FloatArray, high: FloatArray) -> np.ndarray:
    """(K,) whether any point of the middle of a lane, `_STEP_M` apart, lies in a box."""
    if not isinstance(network, RoadNetwork):
        return np.ones(len(lanes), dtype=np.bool_)  # their outlines are stored: asking costs nothing
    first, last = network.lanes.s_start_m[lanes], network.lanes.s_end_m[lanes]
    counts = np.ceil((last - first) / _STEP_M).astype(np.int64) + 1
    owner = np.repeat(np.arange(len(lanes)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = rank / np.maximum(counts - 1, 1)[owner]
    x, y, _, _ = network.center_line(lanes[owner], first[owner] + share * (last - first)[owner])
    points = np.column_stack((x, y))
    inside = ((points >= low) & (points <= high)).all(axis=1)
    return np.bincount(owner, weights=inside, minlength=len(lanes)) > 0
