"""The formats of recordings: which one a folder has, and what reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.reader import POSES, is_argoverse, read_argoverse
from scenarios.recorded.bags.reader import BagReading, read_bag
from scenarios.recorded.csv_files import DETECTIONS, LABELS, read_csv, stored
from scenarios.recorded.dataset import Dataset
from scenarios.recorded.kitti import read_kitti
from scenarios.recorded.nuscenes import read_nuscenes
from scenarios.recorded.simbev.reader import is_simbev, read_simbev
from scenarios.recorded.tables.columns import Columns
from scenarios.recorded.tables.parquet import SUFFIX
from scenarios.ros.bags.bag import is_bag

READERS: dict[str, Callable[[Path], Dataset]] = {
    "kitti": read_kitti,
    "nuscenes": read_nuscenes,
    "csv": read_csv,
    "simbev": read_simbev,
    "argoverse": read_argoverse,
    "bag": read_bag,
}
FORMATS = tuple(READERS)

Reading = Columns | BagReading
"""What a user says of a source that does not say it itself."""


def read_dataset(folder: Path, form: str | None = None, columns: Reading | None = None) -> Dataset:
    """Read a folder in a given format, or in the one that its files show.

    Args:
        folder: The folder, or a single file.
        form: The format; None: the one that the files show.
        columns: What the columns of a table mean, or which topics of a bag are read; None: ours, all.

    Raises:
        DatasetError: The format is not recognised, or a file is missing or wrong.
    """
    if not folder.exists():
        raise DatasetError(f"{folder}: no such folder or file")
    if isinstance(columns, BagReading):
        form = form or _recognised(folder)
        if form != "bag":
            raise DatasetError(
                f"{folder}: --topic, --odometry and --velocity-frame are for ROS bags, not for {form}"
            )
        return read_bag(folder, columns)
    named = columns is not None and (columns.pairs or columns.ego_track is not None)
    form = form or ("csv" if named else _recognised(folder))
    if columns is None:
        return READERS[form](folder)
    if form != "csv":
        raise DatasetError(f"{folder}: --columns and --frame-rate are for tables (csv), not for {form}")
    return read_csv(folder, columns)


def form_of(columns: Reading | None) -> str | None:
    """The format that what a user says of a source belongs to; None: nothing is said."""
    if columns is None:
        return None
    return "bag" if isinstance(columns, BagReading) else "csv"


def recognised(folder: Path) -> str | None:
    """The format that a folder or file shows; None: none."""
    try:
        return _recognised(folder)
    except DatasetError:
        return None


def _recognised(folder: Path) -> str:
    """Name of the format.

    Raises:
        DatasetError: it is not recognised.
    """
    if is_bag(folder):
        return "bag"
    if is_simbev(folder):
        return "simbev"
    if is_argoverse(folder):
        return "argoverse"
    if folder.is_file():
        return "csv" if folder.suffix in (".csv", SUFFIX) else "nuscenes"
    if (folder / "detections").is_dir() or (folder / "label_02").is_dir():
        return "kitti"
    if stored(folder, DETECTIONS).is_file() or stored(folder, LABELS).is_file():
        return "csv"
    if any(folder.glob("*.json")) or any(folder.glob("v1.0-*/sample.json")):
        return "nuscenes"
    raise DatasetError(
        f"{folder}: no detections/ (kitti), {DETECTIONS} (csv), {POSES} or scenario_*.parquet (argoverse), "
        "infos/simbev_infos_*.json (simbev), metadata.yaml, *.db3, *.mcap (bag) or *.json (nuscenes) in it; "
        "see docs/formats.md"
    )
