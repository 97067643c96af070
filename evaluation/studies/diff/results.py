"""A folder of results as two of them are compared: each run with what determined it, and its outcome."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from evaluation.results.files import DRIVES_CSV, RUNS_CSV, RUNS_JSON, ResultsError, one_line, require_file
from evaluation.results.rows import cut_off, read_runs, without_conflict
from evaluation.runs.configuration import SHIPPED
from evaluation.runs.decoding import object_of
from scenarios.reading import ReadError, exact_floats, read_json

if TYPE_CHECKING:
    import pandas as pd

COMPARE_JSON, DRIVES_JSON = "compare.json", "drives.json"

Value = str | float | bool | None
"""Of a fact or a measure, as JSON has it."""

SEVERITY = {
    "avoided": 0, "no activation": 0, "no request": 0, "no conflict": 0, "request": 1, "unnecessary stop": 1,
    "early activation": 2, "false activation": 2, "cut off": 2, "contact": 3,
}  # fmt: skip
"""Outcomes of a run; a greater number is worse."""

_TEXTS = ("scene", "variant", "sequence", "strategy", "settings", "rule", "preset", "weather", "sees", "log")
_DIGEST_LENGTH = 12
_NAMES = ("file", "map_name")
"""Entries of a run that are names of files, which are compared by their content."""
_NOT_OF_RUN = ("files", "resolved_preset", *_NAMES)


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a folder.

    Args:
        identity: what tells it apart from the others of its folder.
        facts: what determined it, by name; names are paths such as `preset.brakes.max_decel_mps2`.
        files: SHA-256 of what it read, by path.
        outcome: one of `SEVERITY`.
        measures: numbers that came out; None where there is none.
        log: name of its log; None: it has none.
    """

    identity: Mapping[str, Value]
    facts: Mapping[str, Value]
    files: Mapping[str, str]
    outcome: str
    measures: Mapping[str, float | None]
    log: str | None


@dataclass(frozen=True, slots=True)
class Results:
    """A folder of results.

    Args:
        path: the folder.
        kind: what wrote it: runs, compare or drive.
        facts: what holds for all its runs, such as versions.
        runs: in the order of its table.
    """

    path: Path
    kind: str
    facts: Mapping[str, Value]
    runs: tuple[Run, ...]


def read_results(folder: Path) -> Results:
    """Read what `cpna`, `run`, `ncap`, `compare` or `drive` wrote.

    Raises:
        ResultsError: the folder is none of these, or a file is missing or damaged.
    """
    readers = {RUNS_JSON: _of_runs, COMPARE_JSON: _of_comparison, DRIVES_JSON: _of_drives}
    if not folder.is_dir():
        raise ResultsError(f"{folder}: no such folder; give one that cpna, run, ncap, compare or drive wrote")
    for name, reader in readers.items():
        if (folder / name).is_file():
            try:
                return reader(folder, object_of(read_json(folder / name), "the file"))
            except (ReadError, KeyError, TypeError) as error:
                raise ResultsError(
                    f"{folder / name}: not understood ({one_line(error)}); run the evaluation again"
                ) from None
    raise ResultsError(
        f"{folder}: no {', '.join(readers)} in it; give a folder that cpna, run, ncap, compare or drive wrote"
    )


def flat(value: object, prefix: str = "") -> Iterator[tuple[str, Value]]:
    """The entries of JSON by their paths, such as `brakes.max_decel_mps2` or `points[0]`."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from flat(part, f"{prefix}.{name}" if prefix else str(name))
    elif isinstance(value, list):
        for k, part in enumerate(value):
            yield from flat(part, f"{prefix}[{k}]")
    elif value is None or isinstance(value, str | bool | int | float):
        yield prefix, value


# ---- cpna, run, ncap ---------------------------------------------------------------------------------------

_RUN_IDENTITY = (
    "scenario",
    "strategy",
    "preset",
    "weather",
    "adversaries",
    "seed",
    "v_test_kmh",
    "night",
    "phase_s",
)
_RUN_MEASURES = (
    "v_impact_kmh", "score", "flag_time_s", "flag_distance_m", "stop_gap_m", "contact_time_s", "t0_s",
    "end_time_s", "ego_speed_at_contact_kmh", "target_speed_at_contact_kmh", "impact_location_percent",
)  # fmt: skip


def _of_runs(folder: Path, content: Mapping[str, Any]) -> Results:
    if "schema" not in content:
        raise ReadError("it is of version 0.1.0, which says too little of its runs")
    stored = object_of(content.get("configuration"), "configuration")
    table = read_runs(folder)
    specs = stored["specs"]
    if len(specs) != len(table):
        raise ReadError(f"{len(specs)} runs, and {len(table)} in {RUNS_CSV}")
    outcomes = _outcomes(table, [spec["must"] for spec in specs])
    runs = []
    for spec, outcome, (_, row) in zip(specs, outcomes, table.iterrows(), strict=True):
        own = {name: value for name, value in spec.items() if name not in _NOT_OF_RUN}
        files = _files(folder, spec["files"], stored["files"])
        parameters = {name: _named(value) for name, value in spec["parameters"].items()}
        own["parameters"] = parameters
        identity: dict[str, Value] = {name: spec[name] for name in _RUN_IDENTITY}
        identity |= {f"parameter {name}": value for name, value in parameters.items()}
        identity |= {f"setting {name}": value for name, value in spec["settings"].items()}
        facts = dict(flat(own)) | dict(flat(stored["presets"][spec["resolved_preset"]], "preset"))
        log = row["log"] if isinstance(row["log"], str) else None
        runs.append(Run(identity, facts, files, outcome, _numbers(row, _RUN_MEASURES), log))
    facts = dict(flat({name: stored.get(name, {}) for name in ("versions", "plugins", "weather", "light")}))
    return Results(folder, "runs", facts, tuple(runs))


def _files(folder: Path, names: Sequence[str], digests: Mapping[str, str]) -> dict[str, str]:
    """Hashes by path, whatever folder the names are relative to."""
    return {
        name if name.startswith(SHIPPED) else str((folder / name).resolve()): digests[name] for name in names
    }


def _named(value: object) -> Value:
    """A parameter; of a file its name without folders, since its content is compared."""
    if isinstance(value, Mapping):
        return PurePosixPath(str(value["file"])).name
    return value  # type: ignore[return-value]


def _outcomes(table: pd.DataFrame, must: Sequence[str]) -> list[str]:
    """What came of each run, by `runs.csv` and what its test asks for."""
    marks = zip(
        cut_off(table),
        without_conflict(table),
        table["collided"],
        table["false_activation"],
        must,
        strict=True,
    )
    return [
        "cut off" if is_cut
        else "contact" if collided
        else "false activation" if active is True and asked == "nothing"
        else "early activation" if active is True
        else "no conflict" if free
        else "no activation" if asked == "nothing"
        else "avoided"
        for is_cut, free, collided, active, asked in marks
    ]  # fmt: skip


def _numbers(row: pd.Series[Any], names: Sequence[str]) -> dict[str, float | None]:
    """Measures of a row by name."""
    values = {name: row[name] for name in names}
    return {
        name: None if value is None or (isinstance(value, float) and math.isnan(value)) else float(value)
        for name, value in values.items()
    }


# ---- compare -----------------------------------------------------------------------------------------------

_COMPARED_IDENTITY = ("scene", "variant", "strategy", "settings", "preset", "weather", "seed")
_COMPARED_MEASURES = (
    "v_impact_kmh", "score", "flag_time_s", "flag_distance_m", "flag_ttc_s", "speed_loss_kmh", "delay_s",
    "distance_m", "duration_s", "tracks_mean", "min_ttc_s", "max_btn",
)  # fmt: skip


def _of_comparison(folder: Path, content: Mapping[str, Any]) -> Results:
    if "scenes" not in content:
        raise ReadError("it is of a comparison on recorded drives; compare those of drive")
    table = _read(folder / RUNS_CSV, (*_COMPARED_IDENTITY, *_COMPARED_MEASURES, "must", "collided"))
    scenes = {(scene["scene"], scene["variant"]): scene for scene in content["scenes"]}
    runs = []
    for _, row in table.iterrows():
        identity: dict[str, Value] = {name: _plain(row[name]) for name in _COMPARED_IDENTITY}
        scene = scenes[row["scene"], row["variant"]]
        settings = f"{row['strategy']} {row['settings'] or ''} {row['weather']}"
        preset = content["presets"][settings]
        facts = dict(flat(scene["parameters"], "parameters")) | dict(flat(preset, "preset"))
        files = _files(folder, scene["files"], content["files"])
        runs.append(
            Run(identity, facts, files, compared_outcome(row), _numbers(row, _COMPARED_MEASURES), None)
        )
    facts = dict(flat({name: content[name] for name in ("versions", "preset", "seeds")}))
    return Results(folder, "compare", facts, tuple(runs))


def compared_outcome(row: Mapping[Any, Any] | pd.Series[Any]) -> str:
    """What came of a run of a comparison."""
    if row["end_reason"] in ("time_limit", "not_begun"):
        return "cut off"
    if row["collided"]:
        return "contact"
    if row["must"] == "nothing":
        quiet = "unnecessary stop" if row["needless_stop"] is True else "no activation"
        return "false activation" if row["false_activation"] is True else quiet
    return "early activation" if row["false_activation"] is True else "avoided"


# ---- drive -------------------------------------------------------------------------------------------------

_DRIVE_IDENTITY = ("sequence", "strategy", "rule", "settings", "preset", "sees", "seed")
_DRIVE_MEASURES = (
    "requests", "false_activations", "undecided", "standing", "warnings", "false_warnings",
    "undecided_warnings", "frames", "km", "pedestrians", "held_s",
)  # fmt: skip


def _of_drives(folder: Path, content: Mapping[str, Any]) -> Results:
    stored = object_of(content.get("configuration"), "configuration")
    table = _read(folder / DRIVES_CSV, (*_DRIVE_IDENTITY, *_DRIVE_MEASURES, "log"))
    of_drive = {entry["name"]: entry for entry in stored["recordings"]}
    runs = []
    for _, row in table[table["log"].notna()].iterrows():
        identity: dict[str, Value] = {name: _plain(row[name]) for name in _DRIVE_IDENTITY}
        entry = of_drive[row["sequence"]]
        facts = {name: _plain(row[name]) for name in _DRIVE_IDENTITY if name != "sequence"}
        facts |= dict(flat(entry["vehicle"], "vehicle"))
        outcome = (
            "false activation" if row["false_activations"] else "request" if row["requests"] else "no request"
        )
        runs.append(Run(identity, facts, {}, outcome, _numbers(row, _DRIVE_MEASURES), str(row["log"])))
    return Results(folder, "drive", dict(flat({"columns": stored.get("columns")})), tuple(runs))


def _read(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """A table of results.

    Raises:
        ResultsError: it is missing or damaged, or lacks a column.
    """
    import pandas as pd

    from evaluation.results.files import require_columns

    require_file(path)
    try:
        texts = dict.fromkeys(_TEXTS, "str")  # a drive may be called 0010
        table: pd.DataFrame = pd.read_csv(
            path, dtype=texts, keep_default_na=False, na_values=[""], **exact_floats()
        )
    except (ValueError, UnicodeDecodeError) as error:
        raise ResultsError(
            f"{path}: not a readable table ({one_line(error)}); run the evaluation again"
        ) from None
    require_columns(path, table.columns, columns)
    for name in ("settings", "variant"):
        if name in table:
            table[name] = table[name].fillna("")
    return table


def _plain(value: Any) -> Value:
    """Python's own kind of a value; None for NaN."""
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and math.isnan(value) else value


def short_digest(digest: str) -> str:
    """The beginning of a hash, for people."""
    return digest[:_DIGEST_LENGTH]
