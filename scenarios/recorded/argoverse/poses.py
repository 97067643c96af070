"""The recording vehicle's poses in the city's frame, at their own rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from scenarios.errors import DatasetError
from scenarios.recorded.poses import interpolated
from smartmot.types import FloatArray, IntArray

NS = 1e-9

MAX_GAP_S = 0.5
"""Poses are not interpolated over more: at 8 m/s2 a straight line is then 0.25 m off (a T^2 / 8)."""


@dataclass(frozen=True, slots=True, eq=False)
class VehiclePoses:
    """Poses of the vehicle.

    Args:
        path: The file.
        stamp_ns: (P,) times, ascending.
        rotation: P rotations.
        place_m: (P, 3) places.
    """

    path: Path
    stamp_ns: IntArray
    rotation: Rotation
    place_m: FloatArray

    def at(self, stamp_ns: IntArray) -> FloatArray:
        """(F, 4, 4) poses at some times; raises `DatasetError` where there are none."""
        known = self.stamp_ns
        after = np.searchsorted(known, stamp_ns)
        outside = (stamp_ns < known[0]) | (stamp_ns > known[-1])
        after = np.minimum(after, len(known) - 1)
        gap_ns = np.where(known[after] == stamp_ns, 0, known[after] - known[np.maximum(after - 1, 0)])
        missing = np.asarray(outside | (gap_ns * NS > MAX_GAP_S))
        if missing.any():
            first = int(stamp_ns[np.argmax(missing)])
            raise DatasetError(
                f"{self.path}: poses from {known[0]} to {known[-1]} ns do not cover the boxes: "
                f"none within {MAX_GAP_S:g} s about {first} ns"
            )
        # differences of nanoseconds are exact as floats for 104 days
        time_s, at_s = (NS * (stamps - known[0]) for stamps in (known, stamp_ns))
        return interpolated(time_s, self.rotation, self.place_m, np.minimum(at_s, time_s[-1]))
