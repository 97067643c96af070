"""Clouds without headers: KITTI's and nuScenes' float32, and NumPy's archives."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import DatasetError
from scenarios.recorded.clouds.fields import NamedCloud, cloud_from_rows
from smartmot.pointcloud import PointCloud

NUSCENES_SUFFIX = ".pcd.bin"
KITTI_FIELDS = ("x", "y", "z", "intensity")
"""Source: KITTI object development kit, readme.txt."""
NUSCENES_FIELDS = (*KITTI_FIELDS, "ring")
"""Source: nuscenes-devkit, `LidarPointCloud.from_file`."""

AXES_KEPT = "axes of nuScenes kept: x right, y ahead"
"""Note of a reader, which turns nothing."""

SIMBEV_POINTS = "data"
"""Source: SimBEV (GoodarzMehr/SimBEV, 2026), the files of `sweeps/LIDAR`."""

_MOST_BYTES = 2**32
"""Of an array in an archive: a few bytes can claim any size."""

_COLUMNS = ("intensity", "ring", "time_offset_s")

_MOST_RINGS, _FEWEST_ROWS = 256, 100
"""More than any LiDAR has lines; and rows from which on every last number is not whole by chance."""

_NEAREST_M, _NEARLY_ALL = 1.0, 0.99
"""No sensor has nearly all of its points on a vehicle nearer than that: normals, colours and times are."""

OTHER_ROWS = (
    "where a point has other numbers, name them: smartmot-eval lidar convert FROM.bin TO.npz --columns "
    "x,y,z,intensity,_,_ ( _ : not kept)"
)
"""What to do about rows of other lengths."""

_MOST_NEGATIVE = 0.05
"""Share of negative strengths of echoes beyond which they are something else: where rows of three, five, six
or seven numbers are read as four, every fourth number is a coordinate as often as any other."""


def read_bin(path: Path, columns: Sequence[str] = ()) -> NamedCloud:
    """Read float32 rows: five numbers per point in a file `.pcd.bin` (nuScenes), four in any other `.bin`.

    Args:
        path: the file.
        columns: names of the numbers of a row, where they are others; "_" of one that is not kept.

    Raises:
        DatasetError: the file's length is no whole number of points, its numbers are no coordinates, they
            look like rows of another length, or a ring is no whole number.
    """
    nuscenes = path.name.endswith(NUSCENES_SUFFIX)
    fields = _unique(columns) or (NUSCENES_FIELDS if nuscenes else KITTI_FIELDS)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror or error}") from None
    size = 4 * len(fields)
    if len(data) % size:
        hint = (
            f"; {OTHER_ROWS}" if nuscenes or len(data) % 20 else f"; name nuScenes' sweeps {NUSCENES_SUFFIX}"
        )
        raise DatasetError(f"{path}: {len(data)} bytes are no whole number of points of {size} bytes{hint}")
    rows = np.frombuffer(data, dtype=[(name, "<f4") for name in fields])
    if not nuscenes and not columns:
        _require_rows_of_four(path, data)
    name = path.name.removesuffix(NUSCENES_SUFFIX) if nuscenes else path.stem
    try:
        named = cloud_from_rows(rows, name)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}; {OTHER_ROWS}") from None
    if columns:
        return named
    negative = np.count_nonzero(rows["intensity"] < 0.0)
    if not nuscenes and len(rows) >= _FEWEST_ROWS and negative > _MOST_NEGATIVE * len(rows):
        raise DatasetError(
            f"{path}: {negative} of {len(rows)} strengths of echoes are negative: expected rows of "
            f"{len(fields)} numbers, {' '.join(fields)}; {OTHER_ROWS}"
        )
    return replace(named, notes=(*named.notes, AXES_KEPT), ahead="y") if nuscenes else named


def _unique(columns: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, those that are not kept each with one of its own."""
    names = tuple(f"_{k}" if name == "_" else name for k, name in enumerate(columns))
    if len(set(names)) < len(names) or not all(names):
        raise DatasetError(f"columns: expected a name for each, and each once, got {','.join(columns)}")
    return names


def _require_rows_of_four(path: Path, data: bytes) -> None:
    """Refuse rows of five numbers with a ring, and of eight, twelve and sixteen, whose length fits four too.

    Read as rows of four, every second one (third, fourth) of longer rows is no point: it is full of whole
    numbers where the others are not, or nearly all of it is nearer to the sensor than any wall of it.
    """
    if _has_rings(data):
        raise DatasetError(
            f"{path}: every fifth number is a small whole one: rows of five numbers, as nuScenes' sweeps "
            f"have them; name the file {NUSCENES_SUFFIX}"
        )
    rows = np.frombuffer(data, dtype="<f4").reshape(-1, 4)[:, :3]
    for parts in (2, 3, 4):
        if len(rows) % parts or len(rows) < parts * _FEWEST_ROWS:
            continue
        with np.errstate(invalid="ignore"):  # of NaN that signal
            is_whole = (np.trunc(rows) == rows).reshape(-1, parts, 3).mean(axis=0)
            is_near = (np.abs(rows) <= _NEAREST_M).all(axis=1).reshape(-1, parts).mean(axis=0)
        is_other = (is_whole.max(axis=0) > _NEARLY_ALL) & (is_whole.min(axis=0) < 0.5)
        if is_other.any() or (is_near.max() > _NEARLY_ALL and is_near.min() < 0.5):
            order = {2: "second", 3: "third", 4: "fourth"}[parts]
            raise DatasetError(
                f"{path}: read as rows of four numbers every {order} one is no point: rows of {4 * parts} "
                f"numbers, or a multiple; {OTHER_ROWS}"
            )


def _has_rings(data: bytes) -> bool:
    """Whether numbers are rows of five with a ring at the end: of rows of four that is a mix of columns."""
    if len(data) % 20 or len(data) < 20 * _FEWEST_ROWS:
        return False
    rows = np.frombuffer(data, dtype="<f4").reshape(-1, 5)
    last = rows[:, 4]
    with np.errstate(invalid="ignore"):  # of NaN that signal
        are_rings = ((last >= 0.0) & (last < _MOST_RINGS) & (np.trunc(last) == last)).all()
        # of a cloud with whole coordinates nothing can be said
        return bool(are_rings and (last != last[0]).any() and (np.trunc(rows[:, :3]) != rows[:, :3]).any())


def bin_bytes(cloud: PointCloud, nuscenes: bool = False) -> bytes:
    """A cloud as float32 rows; 0 where it has no intensity or ring (`clouds.files.losses` says so).

    Raises:
        DatasetError: a number is too great for float32.
    """
    rows = np.zeros((len(cloud), 5 if nuscenes else 4), dtype="<f4")
    with np.errstate(over="ignore"):
        rows[:, :3] = cloud.xyz_m
    if cloud.intensity is not None:
        rows[:, 3] = cloud.intensity
    if nuscenes and cloud.ring is not None:
        if len(cloud) and np.abs(cloud.ring).max() > 2**24:
            raise DatasetError("a ring is too great for float32")
        rows[:, 4] = cloud.ring
    if not np.isfinite(rows).all():
        raise DatasetError("a number of the cloud is too great for float32")
    return rows.tobytes()


def read_npz(path: Path) -> NamedCloud:
    """Read an archive as `npz_bytes` writes it, or SimBEV's, which has one array `data` of points.

    Raises:
        DatasetError: it is no archive, holds Python objects, or an array is missing or wrong.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _MOST_BYTES:
                raise DatasetError(f"{path}: more than {_MOST_BYTES} bytes")
            content = {
                entry.filename.removesuffix(".npy"): _array(archive.read(entry), entry.filename)
                for entry in archive.infolist()
            }
        if "xyz_m" not in content and SIMBEV_POINTS in content:
            content["xyz_m"] = content.pop(SIMBEV_POINTS)
        if "xyz_m" not in content:
            raise DatasetError(f"no array xyz_m; there are {', '.join(sorted(content)) or 'none'}")
        columns = {name: _finite_or_not(content, name) for name in ("xyz_m", *_COLUMNS) if name in content}
        finite = np.ones(len(columns["xyz_m"]), dtype=np.bool_)
        for name, column in columns.items():
            if len(column) != len(finite):
                raise DatasetError(f"array {name}: {len(column)} rows for {len(finite)} points")
            finite &= np.isfinite(column) if column.ndim == 1 else np.isfinite(column).all(axis=1)
        stamp = content.get("stamp_s")
        cloud = PointCloud(
            **{name: column if finite.all() else column[finite] for name, column in columns.items()},
            frame=str(content.get("frame", "")),
            stamp_s=None if stamp is None else float(stamp),
        )
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror or error}") from None
    except DatasetError as error:
        raise DatasetError(str(error) if str(path) in str(error) else f"{path}: {error}") from None
    except Exception as error:  # zipfile's and zlib's own on damaged archives, and those of the cloud
        raise DatasetError(f"{path}: {' '.join(str(error).split()) or type(error).__name__}") from None
    unused = sorted(set(content) - {"xyz_m", *_COLUMNS, "frame", "stamp_s"})
    notes = (f"arrays not kept: {', '.join(unused)}",) if unused else ()
    return NamedCloud(path.stem, cloud, int(np.count_nonzero(~finite)), notes)


def _finite_or_not(content: dict[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """An array of one number or three for each point."""
    array = content[name]
    if array.dtype.kind not in "biuf" or array.ndim != (2 if name == "xyz_m" else 1):
        raise DatasetError(
            f"array {name}: expected numbers of points, got {array.dtype} of shape {array.shape}"
        )
    return array


def _array(data: bytes, name: str) -> NDArray[Any]:
    """An array whose header claims no more than there is."""
    try:
        array: NDArray[Any] = np.load(io.BytesIO(data), allow_pickle=False)
    except MemoryError:
        raise DatasetError(f"array {name}: its header claims more than the file holds") from None
    return array


def npz_bytes(cloud: PointCloud) -> bytes:
    """A cloud with all that it has, as an archive of NumPy."""
    arrays: dict[str, Any] = {"xyz_m": cloud.xyz_m, "frame": np.array(cloud.frame)}
    arrays |= {name: getattr(cloud, name) for name in _COLUMNS if getattr(cloud, name) is not None}
    if cloud.stamp_s is not None:
        arrays["stamp_s"] = np.array(cloud.stamp_s)
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    return content.getvalue()
