"""Clouds from points with named fields, as PCD and PointCloud2 have them, and the other way round."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import DatasetError
from smartmot.pointcloud import PointCloud

INTENSITY_NAMES = ("intensity", "reflectivity", "reflectance", "i", "remission")
RING_NAMES = ("ring", "row", "line", "channel", "laser_id", "laser_number")
TIME_NAMES = ("time_offset_s", "time", "t", "timestamp", "offset_time", "time_stamp")
"""Names of the drivers of Velodyne, Ouster, Hesai, Livox and Robosense; the first that a cloud has counts."""

_GREATEST_OFFSET_S = 1e5
"""A greater number of seconds is a time of day since 1970, not an offset within a cloud."""

_LEAST_UNIX_NS = 1e14
"""In seconds the year is 3,170,000: a greater number is in nanoseconds."""

_DISTANCES_M = (1e-6, 1e8)
"""Coordinates other than 0: the resolution of any LiDAR and places on the Earth are inside."""

_MOST_IMPLAUSIBLE = 0.1
"""Share beyond which they are something else. Of float64 read as float32, two of three coordinates have an
exponent of random bits, of which one in five is plausible, and so have all in the wrong byte order; of text
none is."""


@dataclass(frozen=True, slots=True)
class NamedCloud:
    """A cloud as it was read.

    Args:
        name: its file's name without suffix, or its number in a bag.
        cloud: the points.
        dropped: points with a value that is not finite.
        notes: what else was not kept or was assumed.
        ahead: axis of the sensor that points ahead, out of `clouds.axes.AHEAD`, as far as the format says it.
    """

    name: str
    cloud: PointCloud
    dropped: int = 0
    notes: tuple[str, ...] = ()
    ahead: str = "x"


def cloud_from_rows(
    rows: NDArray[Any], name: str, frame: str = "", stamp_s: float | None = None
) -> NamedCloud:
    """A cloud from a structured array with fields x, y and z; points with a value that is not finite go.

    Args:
        rows: (N,) points with their fields.
        name: name of the cloud.
        frame: name of its frame.
        stamp_s: its time.

    Raises:
        DatasetError: a coordinate is missing, a field holds several numbers per point, coordinates are no
            distances, or rings are no whole numbers; the message does not name the file.
    """
    names = rows.dtype.names or ()
    missing = [axis for axis in "xyz" if axis not in names]
    if missing:
        raise DatasetError(f"no field {' and '.join(missing)}; there are {', '.join(names) or 'none'}")
    chosen = {
        "intensity": _first(names, INTENSITY_NAMES),
        "ring": _first(names, RING_NAMES),
        "time": _first(names, TIME_NAMES),
    }
    used = ["x", "y", "z", *(field for field in chosen.values() if field)]
    several = [field for field in used if rows.dtype[field].shape]
    if several:
        raise DatasetError(f"field {several[0]} holds several numbers per point")
    columns = {field: _native(rows[field]) for field in used}
    _require_distances([columns[axis] for axis in "xyz"])
    finite = np.ones(len(rows), dtype=np.bool_)
    for column in columns.values():
        finite &= np.isfinite(column)
    notes = []
    dropped = int(np.count_nonzero(~finite))
    if dropped:
        columns = {field: column[finite] for field, column in columns.items()}
    unused = [field for field in names if field not in used and not field.startswith("_")]
    if unused:
        notes.append(f"fields not kept: {', '.join(unused)}")
    offset = None
    if chosen["time"]:
        offset, first_s = _time_offset_s(columns[chosen["time"]])
        stamp_s = first_s if stamp_s is None else stamp_s
    cloud = PointCloud(
        _reals(np.column_stack([columns[axis] for axis in "xyz"])),
        _reals(columns[chosen["intensity"]]) if chosen["intensity"] else None,
        _whole(columns[chosen["ring"]], chosen["ring"]) if chosen["ring"] else None,
        offset,
        frame,
        stamp_s,
    )
    return NamedCloud(name, cloud, dropped, tuple(notes))


def rows_from_cloud(cloud: PointCloud) -> NDArray[Any]:
    """(N,) structured array of a cloud: x, y, z and those of intensity, ring and time that it has."""
    columns: dict[str, NDArray[Any]] = {axis: cloud.xyz_m[:, k] for k, axis in enumerate("xyz")}
    if cloud.intensity is not None:
        columns["intensity"] = cloud.intensity
    if cloud.ring is not None:
        small = not len(cloud) or (cloud.ring.min() >= 0 and cloud.ring.max() < 2**16)
        columns["ring"] = cloud.ring.astype(np.uint16 if small else np.int32)
    if cloud.time_offset_s is not None:
        columns["time"] = cloud.time_offset_s
    rows = np.empty(len(cloud), dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    return rows


def require_rings(cloud: PointCloud) -> None:
    """Demand ring numbers that 32 bits hold.

    Raises:
        DatasetError: one is greater.
    """
    if cloud.ring is not None and len(cloud) and np.abs(cloud.ring).max() >= 2**31:
        raise DatasetError(f"ring {int(np.abs(cloud.ring).max())} does not fit into 32 bits")


def _require_distances(axes: list[NDArray[Any]]) -> None:
    """See that coordinates can be distances; what is not finite may be among them.

    Raises:
        DatasetError: they are something else, or have another byte order.
    """
    low, high = _DISTANCES_M
    with np.errstate(invalid="ignore"):  # of NaN that signal
        size = np.abs(np.stack(axes).astype(np.float64))
    implausible = np.count_nonzero(((size > 0.0) & (size < low)) | ((size > high) & (size < np.inf)))
    if implausible > _MOST_IMPLAUSIBLE * size.size:
        raise DatasetError(
            f"{implausible} of {size.size} coordinates are no distances in metres; "
            f"expected {axes[0].dtype.name}, little endian, in the order of the fields"
        )


def _first(names: tuple[str, ...], wanted: tuple[str, ...]) -> str:
    return next((name for name in wanted if name in names), "")


def _native(column: NDArray[Any]) -> NDArray[Any]:
    """A column in the byte order of the machine."""
    return column.astype(column.dtype.newbyteorder("="))


def _reals(column: NDArray[Any]) -> NDArray[Any]:
    """float32 stays, whole numbers that it holds exactly become float32, everything else float64."""
    if column.dtype == np.float32 or (column.dtype.kind in "iu" and column.dtype.itemsize <= 2):
        return column.astype(np.float32)
    return column.astype(np.float64)


def _whole(column: NDArray[Any], name: str) -> NDArray[np.int64]:
    if not ((np.trunc(column) == column) & (np.abs(column.astype(np.float64)) < 2.0**31)).all():
        raise DatasetError(f"field {name}: expected whole numbers of 32 bits")
    return column.astype(np.int64)


def _time_offset_s(column: NDArray[Any]) -> tuple[NDArray[Any], float | None]:
    """(N,) seconds within the cloud, and the time of the first point where times are absolute.

    Whole numbers are nanoseconds (Ouster, Livox). Great ones are times since 1970, and count from the first.
    """
    if not len(column):
        return np.zeros(0), None
    if column.dtype.kind in "iu" or column.min() >= _LEAST_UNIX_NS:
        start = column.min() if column.min() >= _GREATEST_OFFSET_S * 1e9 else column.dtype.type(0)
        return (column - start).astype(np.float64) * 1e-9, float(start) * 1e-9 if start else None
    if column.min() >= _GREATEST_OFFSET_S:
        return column.astype(np.float64) - float(column.min()), float(column.min())
    return _reals(column), None
