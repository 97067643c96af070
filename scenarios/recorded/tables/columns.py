"""Tables whose columns have other names, units or axes: pairs `ours=theirs` say what they hold.

The left side is a name of ours with its unit and, where that matters, its axis; the right side is the
table's column, a number that holds for all rows, or `FILE:COLUMN` of a second table with one row per
track. Columns that already have our names need no pair. docs/formats.md has examples.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import DatasetError
from scenarios.recorded.tables.parquet import SUFFIX, column_names, read_parquet_table
from scenarios.recorded.textfile import TextTable, header_names, read_headed_table
from smartmot.geometry import wrap_angle
from smartmot.types import BoolArray, FloatArray

_HALF_TURN_DEG = 180.0
_KMH = 1.0 / 3.6
_FOOT_M = 0.3048
"""The international foot."""

OURS: dict[str, tuple[str, float, float]] = {
    **{name: (name, 1.0, 0.0) for name in ("sequence", "frame", "stamp_s", "track_id", "category", "score")},
    **{name: (name, 1.0, 0.0) for name in ("x_m", "y_m", "ahead_m", "left_m", "corner_x_m", "corner_y_m")},
    **{name: (name, 1.0, 0.0) for name in ("length_m", "width_m", "height_m", "z_m", "yaw_rad", "ignored")},
    **{name: (name, 1.0, 0.0) for name in ("vx_mps", "vy_mps")},
    **{name: (name, 1.0, 0.0) for name in ("x_var_m2", "y_var_m2", "xy_cov_m2", "yaw_var_rad2")},
    **{name: (name, 1.0, 0.0) for name in ("detector", "received_s")},
    **{f"stamp_{unit}": ("stamp_s", part, 0.0) for unit, part in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))},
    "y_down_m": ("y_m", -1.0, 0.0),
    "corner_y_down_m": ("corner_y_m", -1.0, 0.0),
    "yaw_deg": ("yaw_rad", math.pi / _HALF_TURN_DEG, 0.0),
    "yaw_down_rad": ("yaw_rad", -1.0, 0.0),
    "yaw_down_deg": ("yaw_rad", -math.pi / _HALF_TURN_DEG, 0.0),
    "course_rad": ("yaw_rad", -1.0, 0.5 * math.pi),
    "course_deg": ("yaw_rad", -math.pi / _HALF_TURN_DEG, 0.5 * math.pi),
    "vy_down_mps": ("vy_mps", -1.0, 0.0),
    "vx_kmh": ("vx_mps", _KMH, 0.0),
    "vy_kmh": ("vy_mps", _KMH, 0.0),
    "vy_down_kmh": ("vy_mps", -_KMH, 0.0),
}
"""Names on the left: the column that they become, the factor, and what is then added."""
OURS |= {
    name.removesuffix(metric) + feet: (column, _FOOT_M * factor, offset)
    for name, (column, factor, offset) in OURS.items()
    for metric, feet in (("_m", "_ft"), ("_mps", "_fps"))
    if name.endswith(metric)
}

_SAME = {"ahead_m": "x", "corner_x_m": "x", "x_m": "x", "left_m": "y", "corner_y_m": "y", "y_m": "y"}
_SAME |= {"frame": "time", "stamp_s": "time"}
"""Columns that say the same thing in several ways."""

EGO_TRACK = "ego_track"
"""On the left: which track is the vehicle."""

_TEXTS = ("sequence", "category", "track_id", "detector")

_SHORT = {"x": "x_m", "y": "y_m", "z": "z_m", "length": "length_m", "width": "width_m", "height": "height_m"}
_SHORT |= {"vx": "vx_mps", "vy": "vy_mps"}
"""Names without unit that are read as metres, metres per second, and places as those of the centre."""

_MEANT = {
    "time": ("stamp_s", "stamp_ms", "stamp_us", "stamp_ns", "frame"),
    "heading": ("yaw_rad", "yaw_deg", "yaw_down_rad", "yaw_down_deg", "course_rad", "course_deg"),
    "class": ("category",),
    "id": ("track_id",),
    "corner": ("corner_x_m", "corner_y_m", "corner_y_down_m"),
}
_MEANT |= {"stamp": _MEANT["time"], "timestamp": _MEANT["time"], "yaw": _MEANT["heading"]}
_MEANT |= {"course": ("course_rad", "course_deg"), "type": ("category",), "trackid": ("track_id",)}
"""What a name without unit may stand for."""

_NEEDED = (
    (("x_m", "y_m"), ("corner_x_m", "corner_y_m"), ("ahead_m", "left_m")),
    (("length_m", "width_m"),),
    (("yaw_rad",), ("vx_mps", "vy_mps")),
    (("stamp_s",), ("frame",)),
)
"""Columns of which one group each is needed."""

_ASKED = (
    "x_m= and y_m= (centre; y_down_m= with y down; corner_x_m= and corner_y_m= or corner_y_down_m=: "
    "upper left corner; ahead_m= and left_m=: from the vehicle)",
    "length_m= and width_m= (along and across the heading)",
    "yaw_rad= or yaw_deg= (from x towards y; yaw_down_deg= with y down; course_deg= clockwise from north), "
    "or vx_mps= and vy_mps=",
    "stamp_s= (or _ms, _us, _ns) or frame=",
)
"""How each of these is asked for."""

CLASSES = {
    "Car": "car",
    "Truck": "truck",
    "truck_bus": "truck",
    "van": "car",
    "bus": "truck",
    "trailer": "truck",
    "bicycle": "cyclist",
}
"""Classes of highD, inD, rounD and exiD (levelxdata.com, `class` in *_tracksMeta.csv) with other names."""

SIZES = {"pedestrian": (0.6, 0.5), "cyclist": (1.89, 0.5)}
"""Length and width where a table has 0, as inD's has for these: ISO 19206-2 (EPTa) and ISO 19206-4 (EBT)."""

MOVES_MPS = 0.5
"""Slower than that, a velocity does not show where an object looks: the tracker's bound of moving."""


@dataclass(frozen=True, slots=True)
class Columns:
    """How a table is to be read.

    Args:
        pairs: Our name and theirs, each of ours once.
        frame_rate_hz: Frames per second of a table with frame numbers; None: not known.
        short: Names without unit among those typed.
        ego_track: Identity of the track that is the vehicle; None: the vehicle is no track of the table.
    """

    pairs: tuple[tuple[str, str], ...] = ()
    frame_rate_hz: float | None = None
    short: tuple[str, ...] = ()
    ego_track: str | None = None

    def __post_init__(self) -> None:
        rate = self.frame_rate_hz
        if rate is not None and not 0.0 < rate < math.inf:
            raise DatasetError(f"--frame-rate: must be positive, got {rate:g}")

    @classmethod
    def parse(cls, text: str | None, frame_rate_hz: float | None = None) -> Columns:
        """Pairs as typed: `x_m=xCenter,y_m=yCenter,yaw_deg=heading`.

        Raises:
            DatasetError: A pair is none, or its left side is no name of ours.
        """
        pairs: dict[str, str] = {}
        short: list[str] = []
        ego_track: str | None = None
        for part in (text or "").split(","):
            if not part.strip():
                continue
            ours, equals, theirs = (side.strip() for side in part.partition("="))
            if not (ours and equals and theirs):
                raise DatasetError(f"--columns: expected pairs ours=theirs such as x_m=xCenter, got {part!r}")
            if ours == EGO_TRACK:
                ego_track = theirs
                continue
            name = _SHORT.get(ours, ours)
            if name not in OURS:
                raise DatasetError(f"--columns: {_unknown(ours, theirs)}")
            if ours in _SHORT:
                short.append(ours)
            if name in pairs:
                raise DatasetError(f"--columns: {name} is there twice")
            pairs[name] = theirs
        if text is not None and not pairs and ego_track is None:
            raise DatasetError("--columns: expected pairs ours=theirs such as x_m=xCenter, got none")
        seen: dict[str, str] = {}
        for name in pairs:
            other = seen.setdefault(_quantity(name), name)
            if other != name and {other, name} != {"frame", "stamp_s"}:
                raise DatasetError(f"--columns: {other} and {name} say the same; give one")
        return cls(tuple(pairs.items()), frame_rate_hz, tuple(short), ego_track)


def read_mapped(path: Path, columns: Columns) -> tuple[TextTable, TextTable | None, list[str]]:
    """A table under our names, in our units, axes and order of time.

    Returns:
        The table; the rows of the vehicle, if it is one of the tracks, without which the table then is and to
        whose time it is limited; notes on what was assumed.

    Raises:
        DatasetError: A column is missing or holds no numbers, or something that is needed is not named.
    """
    names = column_names(path) if path.suffix == SUFFIX else header_names(path)
    pairs = dict(columns.pairs)
    given = {_quantity(name) for name in pairs}
    pairs |= {name: name for name in names if name in OURS and _quantity(name) not in given}
    constants = {ours: theirs for ours, theirs in pairs.items() if _is_constant(ours, theirs, names)}
    by_track = {ours: theirs for ours, theirs in pairs.items() if theirs not in names and ":" in theirs}
    direct = {ours: theirs for ours, theirs in pairs.items() if ours not in constants | by_track}
    for ours, theirs in direct.items():
        if theirs not in names:
            raise DatasetError(f"{path}: no column {theirs!r} for {ours}; {_near(theirs, names)}")
    _require_all(path, pairs, names, columns)
    table = _read(path, direct)
    count = len(table)
    read = {ours: table[theirs] for ours, theirs in direct.items()}
    read |= {ours: np.full(count, float(value)) for ours, value in constants.items()}
    for ours, theirs in by_track.items():
        read[ours] = _of_tracks(table, direct.get("track_id"), ours, theirs)
    mapped = TextTable(path, table.line, {})
    for ours, values in read.items():
        name, factor, offset = OURS[ours]
        mapped.columns[name] = values if ours in _TEXTS else values * factor + offset
    is_ego = _rows_of_ego(mapped, columns.ego_track)
    if "track_id" in mapped:
        mapped.columns["track_id"] = numbered(mapped["track_id"])
    notes = []
    if columns.short:
        meant = ", ".join(_SHORT[name] for name in columns.short)
        notes.append(
            f"{', '.join(columns.short)}: taken for {meant} (SI units, centre of the box, y up, not down)"
        )
    if "yaw_rad" in mapped:
        mapped.columns["yaw_rad"] = wrap_angle(mapped["yaw_rad"])
    else:
        mapped.columns["yaw_rad"], unknown = _along_velocity(mapped)
        notes.append("no column for the heading: it is that of the velocity")
        if unknown:
            notes.append(
                f"{unknown} rows are of objects that never move at {MOVES_MPS:g} m/s or more: "
                "their headings are guessed from slower velocities"
            )
    if "corner_x_m" in mapped:
        mapped.columns["x_m"], mapped.columns["y_m"] = _centres(mapped)
    time = "stamp_s" if "stamp_s" in mapped else "frame"
    mapped.require_finite(time)
    order = np.argsort(mapped[time], kind="stable")
    if is_ego is None:
        return mapped.rows(order), None, notes
    ego = mapped.rows(order[is_ego[order]])
    meanwhile = (mapped[time] >= ego[time][0]) & (mapped[time] <= ego[time][-1]) & ~is_ego
    if "sequence" in mapped:
        meanwhile &= mapped["sequence"] == ego["sequence"][0]
    return mapped.rows(order[meanwhile[order]]), ego, notes


def _rows_of_ego(table: TextTable, ego_track: str | None) -> BoolArray | None:
    """(N,) rows of the track that is the vehicle, in one sequence; None: it is none of the tracks."""
    if ego_track is None:
        return None
    if "track_id" not in table:
        raise DatasetError(f"--columns: {EGO_TRACK}={ego_track} needs track_id=")
    is_ego: BoolArray = table["track_id"] == ego_track
    if not is_ego.any():
        some = ", ".join(dict.fromkeys(table["track_id"].tolist()[:20]))
        raise DatasetError(f"{table.path}: no track {ego_track!r} for {EGO_TRACK}; there are: {some} ...")
    if "sequence" in table and len(names := np.unique(table["sequence"][is_ego])) > 1:
        raise DatasetError(f"{table.path}: track {ego_track!r} is in several sequences: {', '.join(names)}")
    return is_ego


def fill_sizes(table: TextTable) -> int:
    """Give boxes of length and width 0 the usual size of their category, where one is known; their number."""
    if "category" not in table:
        return 0
    none = (table["length_m"] == 0.0) & (table["width_m"] == 0.0) & np.isin(table["category"], list(SIZES))
    for category, (length_m, width_m) in SIZES.items():
        rows = none & (table["category"] == category)
        table["length_m"][rows], table["width_m"][rows] = length_m, width_m
    return int(none.sum())


def _quantity(name: str) -> str:
    column = OURS[name][0]
    return _SAME.get(column, column)


def _unknown(ours: str, theirs: str) -> str:
    """What to write in place of a name that is none of ours."""
    meant = _MEANT.get(ours.lower().removesuffix("_"))
    if meant is not None:
        return f"{ours}={theirs}: unit or axis is not known; write one of: {', '.join(meant)}"
    return f"no column {ours!r} of ours; {_near(ours, OURS)}"


def _near(name: str, known: Collection[str]) -> str:
    """Names that are like one, or all."""
    by_lower = {each.lower(): each for each in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=3, cutoff=0.6)
    if close:
        return f"near: {', '.join(by_lower[each] for each in close)}"
    return f"there are: {', '.join(list(known)[:40])}"


def _is_constant(ours: str, theirs: str, names: Collection[str]) -> bool:
    if theirs in names or ours in _TEXTS:
        return False
    try:
        return math.isfinite(float(theirs))
    except ValueError:
        return False


def _require_all(path: Path, pairs: Mapping[str, str], names: Collection[str], columns: Columns) -> None:
    """Ask for everything that is needed and not named, in one line."""
    have = {OURS[ours][0] for ours in pairs}
    asked = [
        text
        for groups, text in zip(_NEEDED, _ASKED, strict=True)
        if not any(have.issuperset(group) for group in groups)
    ]
    if "frame" in have and "stamp_s" not in have and columns.frame_rate_hz is None:
        asked.append("--frame-rate HZ for the frame numbers")
    if asked:
        shown = ", ".join(list(names)[:40])
        raise DatasetError(f"{path}: --columns: also needed: {'; '.join(asked)}. The table has: {shown}")


def _read(path: Path, direct: Mapping[str, str]) -> TextTable:
    """The columns of a table that pairs name, under its own names."""
    texts = [theirs for ours, theirs in direct.items() if ours in _TEXTS]
    numbers = [theirs for ours, theirs in direct.items() if ours not in _TEXTS]
    for name in texts:
        if name in numbers:
            raise DatasetError(f"--columns: column {name!r} of {path} is to be both a text and a number")
    if path.suffix == SUFFIX:
        return read_parquet_table(path, direct.values(), numbers, texts)
    return read_headed_table(path, direct.values(), numbers)


def _of_tracks(table: TextTable, key: str | None, ours: str, theirs: str) -> NDArray[np.generic]:
    """(N,) values of a column that stands in a second table, with one row per track.

    Args:
        table: The rows.
        key: Column of the tracks' identities.
        ours: Our name.
        theirs: `FILE:COLUMN`; the file is in the folder of the table.
    """
    file, _, name = theirs.rpartition(":")
    path = table.path.parent / file
    if key is None:
        raise DatasetError(f"--columns: {ours}={theirs} needs track_id=, by which its rows are found")
    if not path.is_file():
        raise DatasetError(f"--columns: {ours}={theirs}: no column of that name, and no file {path}")
    known = column_names(path) if path.suffix == SUFFIX else header_names(path)
    keys = [key, "id", "trackId", "track_id"]
    own_key = next((each for each in keys if each in known), None)
    if own_key is None:
        raise DatasetError(
            f"{path}: no column {key!r}, by which tracks are found; there are: {', '.join(known)}"
        )
    if name not in known:
        raise DatasetError(f"{path}: no column {name!r} for {ours}; {_near(name, known)}")
    second = _read(path, {"track_id": own_key, ours: name})
    of_track = dict(zip(second[own_key].tolist(), second[name].tolist(), strict=True))
    table.require(np.isin(table[key], list(of_track)), key, f"must be a track of {path}")
    return np.array([of_track[track] for track in table[key].tolist()], dtype=second[name].dtype)


def numbered(identity: NDArray[np.generic]) -> FloatArray:
    """(N,) identities as they are if all are whole numbers, else numbers in the order of appearance."""
    try:
        numbers = identity.astype(np.float64)
    except ValueError:
        numbers = np.full(len(identity), np.nan)
    if np.isfinite(numbers).all() and (np.floor(numbers) == numbers).all():
        return numbers
    unique, first, inverse = np.unique(identity, return_index=True, return_inverse=True)
    rank = np.empty(len(unique))
    rank[np.argsort(first)] = np.arange(len(unique))
    return np.asarray(rank[inverse], dtype=np.float64)


def _along_velocity(table: TextTable) -> tuple[FloatArray, int]:
    """(N,) headings along the velocity, and how many show none: of an object that never moves.

    An object that stands keeps its last heading, or has its next one.
    """
    vx, vy = table["vx_mps"], table["vy_mps"]
    yaw: FloatArray = np.arctan2(vy, vx)
    shown = np.hypot(vx, vy) >= MOVES_MPS
    if "track_id" not in table or shown.all():
        return yaw, int((~shown).sum())
    unknown = 0
    time = table["stamp_s"] if "stamp_s" in table else table["frame"]
    for rows in _tracks(table, time):
        known = np.flatnonzero(shown[rows])
        if len(known):
            last = np.maximum(np.searchsorted(known, np.arange(len(rows)), side="right") - 1, 0)
            yaw[rows] = yaw[rows[known[last]]]
        else:
            unknown += len(rows)
    return yaw, unknown


def _tracks(table: TextTable, time: FloatArray) -> Iterable[NDArray[np.intp]]:
    """Rows of each track in the order of time."""
    sequence = table.columns.get("sequence", np.zeros(len(table)))
    order = np.lexsort((time, table["track_id"], sequence))
    same = (np.diff(table["track_id"][order]) == 0.0) & (sequence[order][1:] == sequence[order][:-1])
    return np.split(order, np.flatnonzero(~same) + 1)


def _centres(table: TextTable) -> tuple[FloatArray, FloatArray]:
    """X and y (N,) of the centres of boxes along the axes, from their upper left corners; y points up.

    A box along the axes has its length along that axis to which its heading is nearer.
    """
    length, width, yaw = table["length_m"], table["width_m"], table["yaw_rad"]
    along_x = np.abs(np.cos(yaw)) >= np.abs(np.sin(yaw))
    x = table["corner_x_m"] + 0.5 * np.where(along_x, length, width)
    return x, table["corner_y_m"] - 0.5 * np.where(along_x, width, length)
