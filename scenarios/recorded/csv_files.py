"""Detections, labels, ego poses and tracks as CSV: one header line, units in the names, columns in any order.

Files of a folder (docs/formats.md says what each column means)::

    detections.csv   [sequence,] stamp_s | frame, x_m, y_m | ahead_m, left_m, length_m, width_m, yaw_rad
                     [, score] [, category] [, height_m] [, z_m] [, vx_mps, vy_mps]
                     [, x_var_m2, y_var_m2 [, xy_cov_m2]] [, yaw_var_rad2] [, detector] [, received_s]
    labels.csv       the same with track_id [, ignored]      (optional; enough alone)
    ego.csv          [sequence,] stamp_s | frame, x_m, y_m, yaw_rad      (optional)

Parquet files with the same names and columns are read alike. `classes.csv` says what other names of
categories mean (`classes`), pairs of columns what a table with other columns holds (`columns`).

All positions are in one frame that stands still over a sequence (x and y on the ground, yaw counter-clockwise
from x), or all of them in the vehicle's own. With `ahead_m` and `left_m` in place of `x_m` and `y_m` boxes
are in the vehicle's frame (headings from its own, velocities over ground along its axes); poses move them.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, read_classes, require_categories
from scenarios.recorded.dataset import HEIGHT_M, Dataset, Objects, Sequence, finished, require_seconds
from scenarios.recorded.poses import heading, moved, rigid, turned, turned_about
from scenarios.recorded.tables.columns import CLASSES, Columns, fill_sizes, read_mapped
from scenarios.recorded.tables.parquet import SUFFIX, read_parquet_table
from scenarios.recorded.textfile import MAX_FRAMES, TextTable, is_given, read_headed_table
from smartmot.detection_input import stated_covariances, turned_covariances
from smartmot.geometry import wrap_angle
from smartmot.types import CATEGORIES, FloatArray, IntArray

FRAME_S = 0.1
"""Time between frames of a file that has frame numbers only, unless a frame rate is given."""

SAME_FRAME_S = 1e-3
"""Labels so near in time to a frame of detections belong to it: other software rounds stamps."""

_STILL, _VEHICLE = ("x_m", "y_m"), ("ahead_m", "left_m")
"""Columns of a position: in a frame that stands still, or in the vehicle's."""

_BOX = ("length_m", "width_m", "yaw_rad")
_POSITION_NOISE = ("x_var_m2", "y_var_m2")
_NUMBERS = frozenset(
    (
        *(*_STILL, *_VEHICLE, *_BOX, "stamp_s", "frame", "score", "height_m", "z_m", "vx_mps", "vy_mps"),
        *("track_id", "ignored", *_POSITION_NOISE, "xy_cov_m2", "yaw_var_rad2", "received_s"),
    )
)
_TEXTS = ("sequence", "category", "detector")
DETECTIONS, LABELS, EGO = "detections.csv", "labels.csv", "ego.csv"

EXISTENCE = "existence"

TRACK_COLUMNS = (
    *("sequence", "frame", "stamp_s", "track_id", "category", "score", *_STILL, *_BOX),
    *("z_m", "height_m", "vx_mps", "vy_mps"),
)


def read_csv(folder: Path, columns: Columns | None = None) -> Dataset:
    """Read a folder in the layout above, or a single file of detections.

    Args:
        folder: The folder or file.
        columns: What a file with other columns holds. One with identities gives labels as well.

    Raises:
        DatasetError: A file is missing or wrong; the message names file, line and field.
    """
    columns = columns or Columns()
    path = folder if folder.is_file() else stored(folder, DETECTIONS)
    classes: ClassMap = dict(zip(CATEGORIES, CATEGORIES, strict=True))
    notes: list[str] = []
    frame_s = FRAME_S if columns.frame_rate_hz is None else 1.0 / columns.frame_rate_hz
    if columns.pairs or columns.ego_track is not None:
        classes = read_classes(path.parent, {**CLASSES, **classes})
        table, ego, notes = read_mapped(path, columns)
        tables = {"detections": _completed(table, classes, frame_s)}
        if filled := fill_sizes(table):
            notes.append(f"{filled} boxes without extent: the usual size of their category is taken")
        if ego is not None:
            tables[EGO] = _completed(ego, classes, frame_s)
        if "track_id" in table:
            tables[LABELS] = table
            notes.append("the table has identities: its rows are labels as well as detections")
    else:
        classes = read_classes(path.parent, classes)
        tables = {}
        if path.is_file() or not is_given(stored(path.parent, LABELS)):
            tables["detections"] = _table(path, _BOX, classes, frame_s)
    for name, needed in ((LABELS, (*_BOX, "track_id")), (EGO, (*_STILL, "yaw_rad"))):
        file = stored(path.parent, name)
        if name not in tables and file != path and is_given(file):
            tables[name] = _table(file, needed, classes, frame_s)
    if "detections" not in tables:
        tables["detections"] = tables[LABELS].rows(np.zeros(len(tables[LABELS]), dtype=np.bool_))
    if EGO not in tables and len({_stands_still(table) for table in tables.values()}) > 1:
        raise DatasetError(f"{path.parent}: detections and labels are in different frames; {EGO} is needed")
    names = list(dict.fromkeys(name for table in tables.values() for name in table["sequence"].tolist()))
    if not names:
        raise DatasetError(f"{path}: no rows; there is nothing to track")
    of_ego = columns.ego_track is not None
    sequences = [_sequence(name, tables, frame_s, of_ego) for name in names]
    if "stamp_s" not in tables["detections"] and columns.frame_rate_hz is None:
        notes.append(f"no column stamp_s: frames are {FRAME_S:g} s apart")
    return finished("csv", sequences, tuple(notes))


def stored(folder: Path, name: str) -> Path:
    """A file of the layout in a folder: the CSV file, or the Parquet file if there is that one alone."""
    parquet = (folder / name).with_suffix(SUFFIX)
    return parquet if not is_given(folder / name) and is_given(parquet) else folder / name


def _table(path: Path, needed: Collection[str], classes: ClassMap, frame_s: float) -> TextTable:
    """A file with the columns that it needs; see `_completed`."""
    if path.suffix == SUFFIX:
        table = read_parquet_table(path, needed, _NUMBERS, _TEXTS)
    else:
        table = read_headed_table(path, needed, _NUMBERS)
    if not (_stands_still(table) or all(name in table for name in _VEHICLE)):
        raise DatasetError(
            f"{path}:1: columns missing: x_m and y_m, or ahead_m and left_m (see docs/formats.md)"
        )
    if "stamp_s" not in table and "frame" not in table:
        raise DatasetError(f"{path}:1: a column 'stamp_s' or 'frame' is needed (see docs/formats.md)")
    return _completed(table, classes, frame_s)


def _completed(table: TextTable, classes: ClassMap, frame_s: float) -> TextTable:
    """The table with its sequence and classes named, and its time as `time_s`."""
    time = "stamp_s" if "stamp_s" in table else "frame"
    table.require_finite(time)
    if time == "frame":
        table.require(np.abs(table["frame"]) < MAX_FRAMES, "frame", f"must be under {MAX_FRAMES}")
    table.columns["time_s"] = table[time] if time == "stamp_s" else table.whole("frame") * frame_s
    require_seconds(str(table.path), table["time_s"])
    table.columns.setdefault("sequence", np.full(len(table), "0"))
    if "category" in table:
        rule = f"must be one of {', '.join(CATEGORIES)}, or stand in {CLASSES_CSV}"
        table.columns["kind"] = table["category"]
        table.columns["category"] = require_categories(table, "category", classes, rule)
    return table


def _stands_still(table: TextTable) -> bool:
    """Whether positions are in a frame that stands still; else they are in the vehicle's."""
    return all(name in table for name in _STILL)


def _sequence(name: str, tables: dict[str, TextTable], frame_s: float, of_ego: bool) -> Sequence:
    """One sequence of all files.

    Args:
        name: Of the sequence.
        tables: The files.
        frame_s: Time between frames that have numbers.
        of_ego: Whether each row of the ego is a frame.
    """
    parts = {key: table.rows(table["sequence"] == name) for key, table in tables.items()}
    detections = parts["detections"]
    detected_s = detections["time_s"]
    stamp_s, frame = _frames(detected_s)
    labelled_s = None
    if np.all(stamp_s[1:] > stamp_s[:-1]):  # the tracker refuses other times
        if len(stamp_s) and "stamp_s" not in detections:
            # numbers that are left out are frames without detections
            stamp_s = np.arange(detections["frame"][0], detections["frame"][-1] + 1.0) * frame_s
        if of_ego:
            stamp_s = np.union1d(stamp_s, _snapped(parts[EGO]["time_s"], stamp_s))
        if LABELS in parts:
            labelled_s = _snapped(parts[LABELS]["time_s"], stamp_s)
            stamp_s = np.union1d(stamp_s, labelled_s)
        frame = np.searchsorted(stamp_s, detected_s)
    pose = _poses(name, parts[EGO], stamp_s) if EGO in parts else None
    labels = None
    if labelled_s is not None:
        labels = _objects(parts[LABELS], np.searchsorted(stamp_s, labelled_s), pose)
    return Sequence(
        name=name,
        stamp_s=stamp_s,
        frame_name=_frame_names(stamp_s, detections, frame_s),
        detections=_objects(detections, frame, pose),
        labels=labels,
        world_SE3_ego=pose,
    )


def _frames(time_s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Times of the frames in the order of the file, and the frame of each row: rows of one time in a run."""
    if not len(time_s):
        return np.zeros(0), np.zeros(0, dtype=np.int64)
    new = np.concatenate(([True], time_s[1:] != time_s[:-1]))
    return time_s[new], np.cumsum(new) - 1


def _snapped(time_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
    """(K,) times, those within `SAME_FRAME_S` of a frame's replaced by it."""
    if not len(stamp_s):
        return time_s
    after = np.searchsorted(stamp_s, time_s).clip(max=len(stamp_s) - 1)
    before = np.maximum(after - 1, 0)
    nearest = stamp_s[np.where(time_s - stamp_s[before] < stamp_s[after] - time_s, before, after)]
    return np.where(np.abs(nearest - time_s) <= SAME_FRAME_S, nearest, time_s)


def _frame_names(stamp_s: FloatArray, detections: TextTable, frame_s: float) -> tuple[str, ...]:
    """F names: frame numbers if the detections go by them, else times."""
    number = np.rint(stamp_s / frame_s)
    by_time = "stamp_s" in detections or np.any(np.abs(number * frame_s - stamp_s) > SAME_FRAME_S)
    if by_time:
        return tuple(f"{t:.3f} s" for t in stamp_s.tolist())
    return tuple(f"{k:.0f}" for k in number.tolist())


def _objects(table: TextTable, frame: IntArray, world_SE3_ego: FloatArray | None) -> Objects:
    """Rows of a table as boxes; those in the vehicle's frame are moved by the poses, if there are any."""
    names = ("category", "kind", "score", "height_m", "detector", "received_s")
    columns = {name: table[name] for name in names if name in table}
    if "z_m" in table:
        height = columns.get("height_m", np.full(len(table), HEIGHT_M))
        with np.errstate(invalid="ignore", over="ignore"):  # boxes that are not finite are rejected later
            columns["bottom_m"] = table["z_m"] - 0.5 * height
    if "vx_mps" in table and "vy_mps" in table:
        columns["velocity_mps"] = table.stacked("vx_mps", "vy_mps")
    if "track_id" in table:
        columns["object_id"] = table.whole("track_id")
    if "ignored" in table:
        columns["ignored"] = table["ignored"] != 0.0
    noise = _stated_noise(table)
    if noise is not None:
        columns["pose_covariance"] = noise
    still = _stands_still(table)
    center, yaw = table.stacked(*(_STILL if still else _VEHICLE)), table["yaw_rad"]
    if not still and world_SE3_ego is not None:
        pose = world_SE3_ego[frame]
        with np.errstate(invalid="ignore", over="ignore"):  # boxes that are not finite are rejected later
            center = moved(pose, center)
            yaw = wrap_angle(yaw + heading(pose))
            if "velocity_mps" in columns:
                columns["velocity_mps"] = turned(pose, columns["velocity_mps"])
            if noise is not None:
                columns["pose_covariance"] = turned_covariances(noise, heading(pose))
    return Objects.of(frame, center, size_m=table.stacked("length_m", "width_m"), yaw_rad=yaw, **columns)


def _stated_noise(table: TextTable) -> FloatArray | None:
    """(K, 3, 3) noise of x, y and yaw that the rows state, in their own axes; None: the table has none.

    Raises:
        DatasetError: a column of the position's noise lacks another.
    """
    position = all(name in table for name in _POSITION_NOISE)
    given = [name for name in (*_POSITION_NOISE, "xy_cov_m2") if name in table]
    if given and not position:
        raise DatasetError(f"{table.path}:1: {', '.join(given)} without both of {', '.join(_POSITION_NOISE)}")
    if not (position or "yaw_var_rad2" in table):
        return None
    covariance = np.zeros((len(table), 3, 3))
    if position:
        covariance[:, 0, 0], covariance[:, 1, 1] = table["x_var_m2"], table["y_var_m2"]
        if "xy_cov_m2" in table:
            covariance[:, 0, 1] = covariance[:, 1, 0] = table["xy_cov_m2"]
    if "yaw_var_rad2" in table:
        covariance[:, 2, 2] = table["yaw_var_rad2"]
    return stated_covariances(covariance)


def _poses(name: str, table: TextTable, stamp_s: FloatArray) -> FloatArray:
    """(F, 4, 4) poses of the vehicle at the frames, linear between the given times."""
    time = table["time_s"]
    if not len(time):
        raise DatasetError(f"{table.path}: no poses of sequence {name!r}")
    late = np.flatnonzero(time[1:] <= time[:-1]) + 1
    if len(late):
        raise DatasetError(f"{table.path}:{table.line[late[0]]}: times must rise within a sequence")
    early = stamp_s.min(initial=np.inf) < time[0] - SAME_FRAME_S
    late = stamp_s.max(initial=-np.inf) > time[-1] + SAME_FRAME_S
    if early or late:
        raise DatasetError(
            f"{table.path}: poses from {time[0]:g} to {time[-1]:g} s do not cover the detections"
        )
    table.require_finite("x_m", "y_m", "yaw_rad")
    # unwrapped, a heading goes the short way over 180 degrees
    yaw = np.interp(stamp_s, time, np.unwrap(table["yaw_rad"]))
    place = [np.interp(stamp_s, time, table[column]) for column in _STILL]
    return rigid(turned_about(2, yaw), np.column_stack((*place, np.zeros(len(stamp_s)))))


def tracks_text(
    parts: Collection[tuple[Sequence, Objects]], existence: Collection[FloatArray | None] = ()
) -> str:
    """Tracks of all sequences as CSV with the columns of `TRACK_COLUMNS`; z_m is the centre's height.

    Args:
        parts: Sequences and their tracks.
        existence: (K,) for each: probabilities that there is an object; a column if all are known.
    """
    known = [each for each in existence if each is not None]
    has_existence = len(known) == len(parts) > 0
    columns = (*TRACK_COLUMNS, EXISTENCE) if has_existence else TRACK_COLUMNS
    lines = [",".join(columns)]
    form = "%s,%d,%.6f,%d,%s" + ",%.6f" * (len(columns) - 5)
    for k, (sequence, tracks) in enumerate(parts):
        numbers = np.column_stack(
            (
                tracks.score,
                tracks.center_m,
                tracks.size_m,
                tracks.yaw_rad,
                tracks.bottom_m + 0.5 * tracks.height_m,
                tracks.height_m,
                tracks.velocity_mps,
                *((known[k],) if has_existence else ()),
            )
        )
        rows = zip(
            sequence.frame_numbers()[tracks.frame].tolist(),
            sequence.stamp_s[tracks.frame].tolist(),
            tracks.object_id.tolist(),
            tracks.category.tolist(),
            numbers.tolist(),
            strict=True,
        )
        lines += [form % (sequence.name, frame, t, i, name, *v) for frame, t, i, name, v in rows]
    return "\n".join(lines) + "\n"
