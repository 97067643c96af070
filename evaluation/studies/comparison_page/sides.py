"""The sides of a comparison, each a point with its intervals and runs, read from its tables."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.metrics.intervals import NO_SAMPLE, Estimate
from evaluation.results.files import ResultsError, one_line, require_columns, require_file
from evaluation.studies.compare.grid import shown_settings
from evaluation.studies.compare.table import AS_PRESET
from evaluation.studies.diff.results import compared_outcome, read_results
from scenarios.reading import exact_floats

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Ended:
    """A run behind a point.

    Args:
        title: its scene, or its drive.
        outcome: how it ended.
        logged: by what its log is known, if it has one.
    """

    title: str
    outcome: str
    logged: Hashable


@dataclass(frozen=True, slots=True)
class Axis:
    """A measure of sides.

    Args:
        name: of the columns.
        text: in words.
        scale: of the values to what is shown; 100: a share in percent.
    """

    name: str
    text: str
    scale: float = 1.0


@dataclass(slots=True)
class Side:
    """One side of a comparison.

    Args:
        group: which of the charts it is on: weather, or preset and rule; empty where there is one.
        strategy: monitored area; empty where the tables do not say it.
        settings: as they are typed.
        name: as it is shown.
        values: by the name of the axis, scaled.
        runs: behind it.
    """

    group: str
    strategy: str
    settings: str
    name: str
    values: dict[str, Estimate]
    runs: list[Ended] = field(default_factory=list)


PERCENT = 100.0
AVOIDED = Axis("avoided", "collisions avoided (%)", PERCENT)
FALSE = Axis("false_activations", "false activations (%)", PERCENT)
STOPS = Axis("needless_stops", "unnecessary stops (%)", PERCENT)
STUDY_STOPS = Axis("stops", "unnecessary stops (%)", PERCENT)
FALSE_PER_KM = Axis("false_per_km", "false activations per km")
REQUESTS = Axis("requests", "emergency requests")


def read_table(path: Path, columns: Iterable[str]) -> pd.DataFrame:
    """A table of results, texts as they are.

    Raises:
        ResultsError: it is missing or damaged, or lacks a column.
    """
    import pandas as pd

    require_file(path)
    texts = ("strategy", "settings", "weather", "sequence", "rule", "preset", "name", "scene", "variant")
    try:
        table: pd.DataFrame = pd.read_csv(
            path, dtype=dict.fromkeys(texts, "str"), keep_default_na=False, na_values=[""], **exact_floats()
        )
    except (ValueError, UnicodeDecodeError, OSError, EOFError) as error:
        raise ResultsError(
            f"{path}: not a readable table ({one_line(error)}); run the comparison again"
        ) from None
    require_columns(path, table.columns, columns)
    for name in texts:
        if name in table:
            table[name] = table[name].fillna("")
    return table


def _estimate(row: Mapping[Any, Any], axis: Axis) -> Estimate:
    """A measure with its interval; NaN where there is none."""
    value, low, high = (
        axis.scale * float(row.get(f"{axis.name}{end}", np.nan)) for end in ("", "_low", "_high")
    )
    return Estimate(value, low, high, int(row.get(f"{axis.name}_count") or 0))


def settings_of(text: str) -> frozenset[str]:
    """Settings as they are typed, in no order."""
    return frozenset(filter(None, text.split(", ")))


def sides_of_scenes(folder: Path) -> list[Side]:
    """Of a folder of `compare`.

    Raises:
        ResultsError: a table is missing or damaged.
    """
    rows = read_table(folder / "table.csv", ("strategy", "settings", "weather", AVOIDED.name, FALSE.name))
    several = len(set(rows["weather"])) > 1
    sides = {
        (row["weather"], row["strategy"], row["settings"]): Side(
            row["weather"] if several else "",
            row["strategy"],
            row["settings"],
            f"{row['strategy']}, {shown_settings(row['settings']) or AS_PRESET}",
            {axis.name: _estimate(row, axis) for axis in (AVOIDED, FALSE, STOPS)},
        )
        for row in rows.to_dict("records")
    }
    for run in read_results(folder).runs:
        weather, strategy, settings = (str(run.identity[n]) for n in ("weather", "strategy", "settings"))
        side = sides.get((weather, strategy, settings))
        if side is not None:
            title = ", ".join(filter(None, (str(run.identity["scene"]), str(run.identity["variant"]))))
            own = settings_of(settings)
            side.runs.append(Ended(title, run.outcome, (weather, strategy, own, title)))
    return list(sides.values())


OF_DRIVE = ("strategy", "rule", "settings", "sequence")
"""By what a drive of a side is known."""


def sides_of_drives(folder: Path) -> list[Side]:
    """Of a folder of `compare --drives`.

    Raises:
        ResultsError: a table is missing or damaged.
    """
    *key, _ = OF_DRIVE
    rows = read_table(folder / "table.csv", (*key, REQUESTS.name, FALSE_PER_KM.name))
    several = len(set(rows["settings"])) > 1
    sides = {
        tuple(row[name] for name in key): Side(
            "",
            row["strategy"],
            row["settings"],
            ", ".join(
                filter(
                    None, (row["strategy"], row["rule"], shown_settings(row["settings"]) if several else "")
                )
            ),
            {axis.name: _estimate(row, axis) for axis in (REQUESTS, FALSE_PER_KM)},
        )
        for row in rows.to_dict("records")
    }
    runs = read_table(folder / "runs.csv", (*key, "sequence", "requests", "false_activations"))
    for row in runs.to_dict("records"):
        requests, false = int(row["requests"]), int(row["false_activations"])
        outcome = f"{false} of {requests} requests false" if requests else "no request"
        side = sides.get(tuple(row[name] for name in key))
        if side is not None:
            logged = tuple(row[name] for name in OF_DRIVE)
            side.runs.append(Ended(f"drive {row['sequence']}", outcome, logged))
    return list(sides.values())


_OF_STUDY = ("table.csv", "trigger.csv", "tune.csv")
"""Files of questions with rates of sides; others have differences alone, which their figures show."""


def sides_of_study(folder: Path) -> list[Side]:
    """Of a folder of a question; empty where its tables hold differences alone.

    Raises:
        ResultsError: a table is damaged.
    """
    path = next((folder / name for name in _OF_STUDY if (folder / name).is_file()), None)
    if path is None:
        return []
    rows = read_table(path, ("settings",))
    if "measure" in rows:
        return _sides_by_measure(rows, folder)
    require_columns(path, rows.columns, ("rival", "rule", "trial", AVOIDED.name, STUDY_STOPS.name))
    sides = {
        (f"{row['rival']}, trial {row['trial']}", row["rule"]): Side(
            f"rule {row['rule']}",
            str(row["rival"]),
            row["settings"],
            f"{row['rival']}, trial {row['trial']}: {row['settings'] or 'as it is'}",
            {axis.name: _estimate(row, axis) for axis in (AVOIDED, STUDY_STOPS)},
        )
        for row in rows.to_dict("records")
    }
    for row, ended in _runs_of_study(folder):
        rules = (text.removeprefix("rule=") for text in settings_of(row["settings"]) if "rule=" in text)
        side = sides.get((row["name"], next(rules, "paper")))
        if side is not None:
            side.runs.append(ended)
    return list(sides.values())


def _runs_of_study(folder: Path) -> Iterator[tuple[Mapping[Any, Any], Ended]]:
    """Rows of `runs.csv.gz`, and how each ended; a log is known by its side's number and its scenario."""
    columns = ("scene", "variant", "must", "name", "preset", "settings", "collided", "false_activation")
    runs = read_table(folder / "runs.csv.gz", (*columns, "unnecessary_stop", "end_reason"))
    numbers: dict[tuple[str, ...], int] = {}
    for row in runs.rename(columns={"unnecessary_stop": "needless_stop"}).to_dict("records"):
        arm = (row["name"], row["preset"], row["settings"])
        number = numbers.setdefault(arm, len(numbers))
        title, scenario = (
            ", ".join(filter(None, names))
            for names in ((row["variant"], row["scene"]), (row["scene"], row["variant"]))
        )
        yield row, Ended(title, compared_outcome(row), (number, scenario))


def _sides_by_measure(rows: pd.DataFrame, folder: Path) -> list[Side]:
    """Of a table with a line per side and measure, and the runs of `runs.csv.gz`."""
    require_columns(folder, rows.columns, ("preset", "rule", "name", "value", "low", "high", "count"))
    sides: dict[tuple[str, str], Side] = {}
    for (preset, rule, name, settings), own in rows.groupby(
        ["preset", "rule", "name", "settings"], sort=False
    ):
        by_measure = own.set_index("measure").to_dict("index")
        values = {}
        for axis in (AVOIDED, STUDY_STOPS):
            measured = by_measure.get(axis.name)
            if measured is None:
                values[axis.name] = NO_SAMPLE
                continue
            value, low, high = (axis.scale * float(measured[end]) for end in ("value", "low", "high"))
            values[axis.name] = Estimate(value, low, high, int(measured["count"]))
        strategy = str(settings).split(",")[0]
        sides[str(preset), str(settings)] = Side(
            f"preset {preset}, rule {rule}", strategy, str(settings), str(name), values
        )
    for row, ended in _runs_of_study(folder):
        side = sides.get((row["preset"], row["settings"]))
        if side is not None:
            side.runs.append(ended)
    return list(sides.values())
