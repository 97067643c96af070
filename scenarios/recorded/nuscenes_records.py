"""Records of nuScenes' tables and results, their fields checked as they are read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from scenarios.errors import DatasetError
from scenarios.reading import shown
from scenarios.recorded.textfile import is_given, read_json

_T = TypeVar("_T")

_ABSENT = object()
"""In place of a field that a record does not have; what it has may be None."""


@dataclass(frozen=True, slots=True)
class Rule:
    """What a field must be.

    Args:
        complaint: What is said of a value that is not; "{}" stands for it.
        fits: Whether a value is.
    """

    complaint: str
    fits: Callable[[Any], bool]


def _is_finite(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def is_number_or_null(value: object) -> bool:
    """Also NaN, which some writers put as null: it is rejected later with the impossible boxes."""
    return value is None or (isinstance(value, (int, float)) and not isinstance(value, bool))


def vector(length: int, fits: Callable[[object], bool] = _is_finite, needed: bool = True) -> Rule:
    """So many values that fit; where it is not needed, null or nothing too."""

    def is_vector(value: object) -> bool:
        return isinstance(value, list) and len(value) == length and all(map(fits, value))

    if needed:
        return Rule(f"must be {length} numbers", is_vector)
    return Rule(f"must be {length} numbers", lambda value: value in (None, _ABSENT) or is_vector(value))


def _texts(*names: str) -> dict[str, Rule]:
    return dict.fromkeys(names, Rule("must be a text", lambda value: isinstance(value, str)))


_NUMBER = Rule("must be a number", _is_finite)
FIELDS = {
    "scene": _texts("token", "name"),
    "sample": _texts("token", "scene_token") | {"timestamp": _NUMBER},
    "category": _texts("token", "name"),
    "instance": _texts("token", "category_token"),
    "sample_annotation": _texts("sample_token", "instance_token")
    | {"translation": vector(3), "size": vector(3), "rotation": vector(4)},
    "sensor": _texts("token", "channel"),
    "calibrated_sensor": _texts("token", "sensor_token"),
    "sample_data": _texts("sample_token", "ego_pose_token", "calibrated_sensor_token")
    | {"is_key_frame": _NUMBER},
    "ego_pose": _texts("token") | {"translation": vector(3), "rotation": vector(4)},
}
"""nuScenes' tables and the fields that are read of each."""

LABEL_TABLES = ("sample_annotation", "instance", "category")
POSE_TABLES = ("sample_data", "ego_pose", "calibrated_sensor", "sensor")
OTHER_TABLES = ("attribute", "visibility", "log", "map", "splits")


def require(record: object, rules: dict[str, Rule], path: Path, noun: str, name: object) -> None:
    """Demand rules of a record.

    Raises:
        DatasetError: The first rule that it breaks, with file, record and field.
    """
    for field, rule in rules.items():
        value = record.get(field, _ABSENT) if isinstance(record, dict) else _ABSENT
        if not isinstance(record, dict) or not rule.fits(value):
            complaint = rule.complaint.format(shown(None if value is _ABSENT else value))
            raise DatasetError(f"{path}: {noun} {name!r}: field {field!r} {complaint}")


def read_records(folder: Path, name: str) -> list[dict[str, Any]]:
    """Rows of one of nuScenes' tables; they have the fields of `FIELDS`.

    Raises:
        DatasetError: The file is missing or wrong, or has a token twice.
    """
    path = folder / f"{name}.json"
    records = read_json(path)
    if not isinstance(records, list):
        raise DatasetError(f"{path}: expected a list of records")
    for index, record in enumerate(records):
        require(record, FIELDS[name], path, "record", index)
    known: set[str] = set()
    for token in (record["token"] for record in records if "token" in FIELDS[name]):
        if token in known:
            raise DatasetError(f"{path}: token {token!r} is there twice")
        known.add(token)
    return records


def has_tables(folder: Path, names: Iterable[str]) -> bool:
    """Whether all of some tables are there."""
    return not missing_tables(folder, names)


def missing_tables(folder: Path, names: Iterable[str]) -> list[str]:
    """Files of tables that are not there."""
    return [f"{name}.json" for name in names if not is_given(folder / f"{name}.json")]


def referred(folder: Path, table: Mapping[str, _T], name: str, row: Mapping[str, Any], noun: str) -> _T:
    """What a row's token refers to in another table.

    Raises:
        DatasetError: It refers to nothing.
    """
    token = row[f"{noun}_token"]
    if token not in table:
        raise DatasetError(f"{folder / name}.json: {noun} {token!r} is not in {noun}.json")
    return table[token]
