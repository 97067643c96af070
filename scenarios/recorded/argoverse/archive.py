"""Argoverse 2's vector maps: `log_map_archive_*.json` of a log or of a forecasting scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.reading import shown
from scenarios.recorded.maps.vector_lanes import VectorLane
from scenarios.recorded.maps.vector_map import VectorMap
from scenarios.recorded.textfile import read_json
from smartmot.detection_input import MAX_POSITION_M
from smartmot.maps.lane_map import Side
from smartmot.types import FloatArray

ARCHIVES = "log_map_archive_*.json"

_KIND = {"VEHICLE": "driving", "BIKE": "biking", "BUS": "bus"}
"""OpenDRIVE's names of the lane types."""

MAY_LEAVE = {
    "NONE": True,
    "UNKNOWN": True,
    "DASHED_WHITE": True,
    "DASHED_YELLOW": True,
    "DOUBLE_DASH_WHITE": True,
    "DOUBLE_DASH_YELLOW": True,
    "DASH_SOLID_WHITE": True,
    "DASH_SOLID_YELLOW": True,
    "SOLID_DASH_WHITE": False,
    "SOLID_DASH_YELLOW": False,
    "SOLID_WHITE": False,
    "SOLID_YELLOW": False,
    "SOLID_BLUE": False,
    "DOUBLE_SOLID_WHITE": False,
    "DOUBLE_SOLID_YELLOW": False,
}
"""Whether a mark lets traffic leave the lane that it is given for. Of two lines the first named is next to
the lane (av2 0.3.6, rendering/map.py). Where there is no paint nothing forbids it, as in OpenDRIVE."""

_PARTS = ("lane_segments", "drivable_areas", "pedestrian_crossings")


def map_archive(folder: Path) -> Path | None:
    """The vector map of a log or scenario; None: it has none.

    Raises:
        DatasetError: It has several.
    """
    archives = sorted(path for place in (folder / "map", folder) for path in place.glob(ARCHIVES))
    if len(archives) > 1:
        raise DatasetError(
            f"{folder}: {len(archives)} maps in it: {archives[0].name}, {archives[1].name} ..."
        )
    return archives[0] if archives else None


def read_vector_map(path: Path) -> VectorMap:
    """Read a vector map.

    Raises:
        DatasetError: It is missing or wrong; the message names file, lane and field.
    """
    content = read_json(path)
    if not isinstance(content, dict) or any(not isinstance(content.get(part), dict) for part in _PARTS):
        raise DatasetError(f"{path}: not a map of Argoverse 2: expected objects {', '.join(_PARTS)}")
    if not content["lane_segments"]:
        raise DatasetError(f"{path}: no lanes in it")
    lanes = [_lane(_Record(path, f"lane {key}", each)) for key, each in content["lane_segments"].items()]
    areas = [
        _Record(path, f"drivable area {key}", each).line("area_boundary", 3)[:, :2]
        for key, each in content["drivable_areas"].items()
    ]
    crossings = {}
    for key, each in content["pedestrian_crossings"].items():
        record = _Record(path, f"pedestrian crossing {key}", each)
        edge, opposite = (record.line(name, 2)[:, :2] for name in ("edge1", "edge2"))
        crossings[str(key)] = np.concatenate((edge, opposite[::-1]))
    try:
        return VectorMap(lanes, areas, crossings, name=path.stem)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from None


class _Record:
    """An object of the file, whose fields are checked as they are read."""

    def __init__(self, path: Path, name: str, fields: Any) -> None:
        self._where, self._fields = f"{path}: {name}", fields
        if not isinstance(fields, Mapping):
            raise DatasetError(f"{self._where}: expected an object, got {shown(fields)}")

    def _get(self, name: str) -> Any:
        if name not in self._fields:
            raise DatasetError(f"{self._where}: field {name!r} is missing")
        return self._fields[name]

    def _wrong(self, name: str, rule: str) -> DatasetError:
        return DatasetError(f"{self._where}: field {name!r} must be {rule}, got {shown(self._fields[name])}")

    def whole(self, name: str) -> int:
        """A whole number."""
        value = self._get(name)
        if not _is_whole(value):
            raise self._wrong(name, "a whole number")
        return int(value)

    def whole_or_null(self, name: str) -> int | None:
        """A whole number, or None."""
        return None if self._get(name) is None else self.whole(name)

    def wholes(self, name: str) -> tuple[int, ...]:
        """Whole numbers."""
        values = self._get(name)
        if not isinstance(values, list) or not all(map(_is_whole, values)):
            raise self._wrong(name, "a list of whole numbers")
        return tuple(values)

    def truth(self, name: str) -> bool:
        """True or false."""
        value = self._get(name)
        if not isinstance(value, bool):
            raise self._wrong(name, "true or false")
        return value

    def one_of(self, name: str, known: Mapping[str, Any]) -> Any:
        """What a name means."""
        value = self._get(name)
        if not isinstance(value, str) or value not in known:
            raise self._wrong(name, f"one of {', '.join(known)}")
        return known[value]

    def line(self, name: str, least: int) -> FloatArray:
        """(P, 3) points; a height that is NaN, as in some of the data set's maps, is that between others."""
        points = self._get(name)
        line = _line(points) if isinstance(points, list) and len(points) >= least else None
        if line is None:
            raise self._wrong(name, f"{least} or more points with x, y and z within {MAX_POSITION_M:g} m")
        known = np.flatnonzero(np.isfinite(line[:, 2]))
        if len(known) < len(line):
            row = np.arange(len(line))
            line[:, 2] = np.interp(row, known, line[known, 2]) if len(known) else 0.0
        return line


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _line(points: list[Any]) -> FloatArray | None:
    """(P, 3) points, of which a height may be NaN; None: these are none."""
    if not all(isinstance(point, dict) for point in points):
        return None
    values = [point.get(axis) for point in points for axis in "xyz"]
    if not set(map(type, values)) <= {int, float}:  # neither texts nor truth values
        return None
    line = np.array(values, dtype=np.float64).reshape(-1, 3)
    within = np.abs(line) <= MAX_POSITION_M
    within[:, 2] |= np.isnan(line[:, 2])
    return line if within.all() else None


def _lane(record: _Record) -> VectorLane:
    sides: tuple[Side, Side] = ("left", "right")
    beside = {side: record.whole_or_null(f"{side}_neighbor_id") for side in sides}
    return VectorLane(
        id=record.whole("id"),
        kind=record.one_of("lane_type", _KIND),
        borders_m=(record.line("left_lane_boundary", 2), record.line("right_lane_boundary", 2)),
        in_junction=record.truth("is_intersection"),
        successors=record.wholes("successors"),
        predecessors=record.wholes("predecessors"),
        beside={side: number for side, number in beside.items() if number is not None},
        may_leave={side: record.one_of(f"{side}_lane_mark_type", MAY_LEAVE) for side in sides},
    )
