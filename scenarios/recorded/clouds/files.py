"""Clouds read from any path and written in any format."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.clouds.arrays import NUSCENES_SUFFIX, bin_bytes, npz_bytes, read_bin, read_npz
from scenarios.recorded.clouds.bags import read_bag_clouds
from scenarios.recorded.clouds.fields import NamedCloud
from scenarios.recorded.clouds.pcd import ENCODINGS, pcd_bytes, read_pcd
from scenarios.ros.bags.bag import is_bag
from smartmot.pointcloud import PointCloud

_READERS: dict[str, Callable[[Path], NamedCloud]] = {
    NUSCENES_SUFFIX: read_bin,  # before .bin, which it ends with
    ".bin": read_bin,
    ".pcd": read_pcd,
    ".npz": read_npz,
}

FORMATS = tuple(suffix.removeprefix(".") for suffix in _READERS)
"""Formats of files with one cloud each."""

_HOLDS = {
    "bin": {"intensity"},
    "pcd.bin": {"intensity", "ring"},
    "pcd": {"intensity", "ring", "time_offset_s"},
    "npz": {"intensity", "ring", "time_offset_s", "frame", "stamp_s"},
}
"""What each format has a place for beside the points."""

_NEEDS = {"bin": ("intensity",), "pcd.bin": ("intensity", "ring")}
"""Columns that a format cannot leave out."""

_WORDS = {
    "intensity": "intensity",
    "ring": "ring",
    "time_offset_s": "time of each point",
    "frame": "name of the frame",
    "stamp_s": "time of the cloud",
}


def file_format(path: Path) -> str | None:
    """Format of a file by its suffix; None: no cloud."""
    return next((suffix[1:] for suffix in _READERS if path.name.lower().endswith(suffix)), None)


def cloud_files(folder: Path) -> list[Path]:
    """Files with clouds in a folder, by name."""
    return sorted(path for path in folder.iterdir() if path.is_file() and file_format(path))


def read_cloud(path: Path, columns: Sequence[str] = ()) -> NamedCloud:
    """The cloud of one file.

    Args:
        path: the file.
        columns: names of the numbers of a point in a `.bin`; see `arrays.read_bin`.

    Raises:
        DatasetError: the file is of no known format, or damaged; or columns are named of one that names them.
    """
    form = file_format(path)
    if form is None:
        raise DatasetError(f"{path}: no file with a cloud; they end in {', '.join(_READERS)}")
    if columns:
        if not form.endswith("bin"):
            raise DatasetError(f"{path}: the file names its columns itself; leave out --columns")
        return read_bin(path, columns)
    return _READERS[f".{form}"](path)


def read_clouds(path: Path, topic: str | None = None, columns: Sequence[str] = ()) -> Iterator[NamedCloud]:
    """Clouds of a file, a folder or a bag, one at a time.

    Args:
        path: what to read.
        topic: of a bag; None: the only one with clouds.
        columns: names of the numbers of a point in a `.bin`; see `arrays.read_bin`.

    Raises:
        DatasetError: there is no cloud, or a file is damaged.
    """
    if not path.exists():
        raise DatasetError(f"{path}: no such file or folder")
    if is_bag(path):
        if columns:
            raise DatasetError(f"{path}: messages name their columns themselves; leave out --columns")
        yield from read_bag_clouds(path, topic)
        return
    if path.is_dir():
        files = cloud_files(path)
        if not files:
            raise DatasetError(f"{path}: no file that ends in {', '.join(_READERS)}, and no bag")
        yield from (read_cloud(file, columns) for file in files)
        return
    yield read_cloud(path, columns)


def cloud_bytes(cloud: PointCloud, form: str, encoding: str = ENCODINGS[0]) -> bytes:
    """A cloud as the content of a file.

    Args:
        cloud: the points.
        form: one of `FORMATS`.
        encoding: DATA of PCD.

    Raises:
        DatasetError: the format cannot hold a number of the cloud.
    """
    if form == "pcd":
        return pcd_bytes(cloud, encoding)
    if form == "npz":
        return npz_bytes(cloud)
    return bin_bytes(cloud, nuscenes=form == "pcd.bin")


def losses(cloud: PointCloud, form: str) -> list[str]:
    """What a format cannot hold of a cloud, or has to make up.

    Args:
        cloud: the points.
        form: one of `FORMATS`.
    """
    notes = []
    missing = [name for name in _WORDS if name not in _HOLDS[form]]
    lost = [_WORDS[name] for name in missing if _is_given(getattr(cloud, name))]
    if lost:
        notes.append(f"{form} does not hold: {', '.join(lost)}")
    made_up = [name for name in _NEEDS.get(form, ()) if getattr(cloud, name) is None]
    if made_up:
        notes.append(f"no {' and '.join(made_up)} in the cloud: {form} holds 0 for it")
    if form in _NEEDS:
        notes += [*_strengths(cloud, form), *_rounding(cloud)]
    return notes


_STRENGTHS = {"bin": 1.0, "pcd.bin": 255.0}
"""Greatest strength of an echo in KITTI's and nuScenes' own files."""


def _strengths(cloud: PointCloud, form: str) -> list[str]:
    """Strengths of echoes that seem to have another unit than a format's, which stays."""
    if cloud.intensity is None or not len(cloud):
        return []
    of_bytes = float(cloud.intensity.max()) > 1.0
    if of_bytes == (_STRENGTHS[form] > 1.0) or not cloud.intensity.any():
        return []
    return [
        f"intensities kept, {'some over 1' if of_bytes else 'none over 1'}: in {form} they are from 0 to "
        f"{_STRENGTHS[form]:g}, as a rule"
    ]


def _is_given(value: object) -> bool:
    """Whether a cloud has a column, a stamp or a name."""
    return value is not None and (not isinstance(value, str) or value != "")


def _rounding(cloud: PointCloud) -> list[str]:
    """How far float32 moves points of float64."""
    if cloud.xyz_m.dtype == np.float32 or not len(cloud):
        return []
    with np.errstate(over="ignore"):
        shift = float(np.abs(cloud.xyz_m.astype(np.float32) - cloud.xyz_m).max())
    return [f"points rounded to float32, by up to {shift:.2g} m"] if shift else []
