"""The points of one turn, or of one integration time, of a LiDAR."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmot.arrays import IntArray, frozen, part, positions, shared_by_copies, unchecked
from smartmot.errors import ShapeError
from smartmot.types import seconds

RealArray = NDArray[np.float32] | NDArray[np.float64]
"""Sensors and files have float32: it is kept, for half the memory and exact round trips."""


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points of a LiDAR, sensor's frame: x ahead, y left, z up, metres.

    Args:
        xyz_m: (N, 3) points, all finite; float32 is kept, everything else becomes float64.
        intensity: (N,) strength of the echo in the sensor's own unit (KITTI 0 to 1, nuScenes 0 to 255).
        ring: (N,) number of the laser or row.
        time_offset_s: (N,) when each point was measured, after `stamp_s`.
        frame: name of the sensor's frame.
        stamp_s: time of the cloud; None where it is not known.

    Raises:
        ShapeError: shapes disagree or a value is not finite.
        StampError: the stamp is no finite number, or not in seconds.
    """

    xyz_m: RealArray
    intensity: RealArray | None = None
    ring: IntArray | None = None
    time_offset_s: RealArray | None = None
    frame: str = ""
    stamp_s: float | None = None

    def __post_init__(self) -> None:
        xyz = _reals(self.xyz_m, (None, 3), "xyz_m")
        count = (len(xyz),)
        object.__setattr__(self, "xyz_m", xyz)
        for name in ("intensity", "time_offset_s"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _reals(getattr(self, name), count, name))
        if self.ring is not None:
            object.__setattr__(self, "ring", frozen(self.ring, np.int64, count, "ring"))
        if self.stamp_s is not None:
            object.__setattr__(self, "stamp_s", seconds(self.stamp_s, "point cloud"))

    def __len__(self) -> int:
        return len(self.xyz_m)

    def __getitem__(self, index: Any) -> PointCloud:
        """Subset by a mask, a slice or an index array."""
        index = positions(index)
        columns = (self.xyz_m, self.intensity, self.ring, self.time_offset_s)
        chosen = [None if column is None else part(column, index) for column in columns]
        return unchecked(PointCloud, *chosen, self.frame, self.stamp_s)


def _reals(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> NDArray[Any]:
    """Read-only finite array of float32 as given, or else of float64."""
    if isinstance(value, np.ndarray) and value.dtype == np.float32:
        array: NDArray[Any] = value if _owned(value) else value.copy()
        array.flags.writeable = False
        if array.ndim != len(shape) or any(
            n not in (None, m) for n, m in zip(shape, array.shape, strict=True)
        ):
            raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}")
    else:
        array = frozen(value, np.float64, shape, name)
    if not np.isfinite(array).all():
        raise ShapeError(f"{name}: a value is not finite; drop such points first")
    return array


def _owned(array: NDArray[Any]) -> bool:
    """Whether an array is the only holder of its numbers, and read-only."""
    return not array.flags.writeable and array.base is None
