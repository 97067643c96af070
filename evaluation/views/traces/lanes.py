"""Lanes around a way, of a map of any size."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import shapely

from opendrive import RoadNetwork
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.types import FloatArray, IntArray

REACH_M = 150.0
"""Lanes farther than this from the box around the ego's way are left out: beyond it no sensor sees."""


@dataclass(frozen=True, slots=True, eq=False)
class NearLanes:
    """Lanes around a way.

    Args:
        lane: (K,) their rows in the map's table.
        outlines_m: K tuples of outlines (P, 2), map frame, without repetition of the first corner; several
            where a lane is nowhere wide in between, none where it is nowhere wide.
        left_out: lanes of the map that are too far away.
    """

    lane: IntArray
    outlines_m: tuple[tuple[FloatArray, ...], ...]
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
    low, high = way_m.min(axis=0) - REACH_M, way_m.max(axis=0) + REACH_M
    outlines = _outlines(network)
    bounds = shapely.bounds(outlines)
    shown = np.asarray(network.lanes.lane_type) != "none"
    # A lane that is nowhere wide has no bounds, and meets nothing.
    meets = (bounds[:, 2:] >= low).all(axis=1) & (bounds[:, :2] <= high).all(axis=1)
    near = np.flatnonzero(shown & meets)
    rings_m = tuple(
        tuple(
            shapely.get_coordinates(ring)[:-1]
            for ring in shapely.get_exterior_ring(shapely.get_parts(outline))
        )
        for outline in outlines[near]
    )
    return NearLanes(near, rings_m, int(shown.sum()) - len(near))


@functools.lru_cache(maxsize=1)
def _outlines(network: DriveMap) -> np.ndarray:
    """(L,) outlines of all lanes as polygons, kept for the next run on the same map."""
    if isinstance(network, RoadNetwork):
        return network.lane_polygons()  # all at once takes a tenth of the time of one by one
    lanes = network.lanes
    stretches = zip(lanes.s_start_m.tolist(), lanes.s_end_m.tolist(), strict=True)
    return np.array(
        [
            shapely.Polygon(network.lane_polygon(lane, start, end))
            for lane, (start, end) in enumerate(stretches)
        ],
        dtype=np.object_,
    )
