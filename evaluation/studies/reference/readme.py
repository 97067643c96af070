"""The page of the reference results: hand-written prose around what their tables say."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from evaluation.protocols.paper import PUBLISHED
from evaluation.results.by_speed import comparison_table
from evaluation.results.files import ResultsError
from evaluation.results.rows import RunRow, read_runs
from evaluation.results.tables import Table, markdown_table
from evaluation.runs.execution import FrameTime
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.detectors.comparison import DETECTORS_JSON
from evaluation.studies.drive.side_by_side.comparison import COMPARE_JSON
from evaluation.studies.growth import GrowthRun, growth_table
from evaluation.studies.reference.findings import (
    adaptive,
    answers,
    clouds,
    cpna,
    crowds,
    detectors,
    drives,
    scenes,
    seeds,
)
from evaluation.studies.reference.kept import read_json, read_records
from evaluation.studies.reference.mechanisms import MechanismRun, mechanism_table
from evaluation.studies.reference.parts import (
    ADAPTIVE_DRIVES,
    ADAPTIVE_GAIN,
    BREAK_EVEN,
    DETECTORS,
    DRIVES,
    GAIN,
    LEARNED,
    LIDAR,
    QUESTIONS,
    SENSOR,
    SEVERITY,
    TOWNS,
    TRIGGER,
    TUNING,
)
from evaluation.studies.reference.words import listed

README = "README.md"
TEMPLATE = "readme.md.j2"
VERSIONED = (
    "mechanisms/mechanisms.json", "frontier_physical/compare.json", "frontier_paper/compare.json",
    "seeds/compare.json", "ablation/compare.json", "growth/growth.json",
    *(f"{name}/runs.json" for name in ("paper", "static", "physical", "weather")),
    *(f"{question.name}/study.json" for question in QUESTIONS),
)  # fmt: skip
"""Files that tell the version that made them, with a digest of the code."""


def _versioned(reports: Path) -> list[str]:
    """Those of all parts that are there: some need data of others."""
    outside = (
        f"{TOWNS.name}/study.json",
        *(f"{part.name}/{COMPARE_JSON}" for part in (*DRIVES, *ADAPTIVE_DRIVES)),
    )
    outside += tuple(f"{part.name}/{DETECTORS_JSON}" for part in DETECTORS)
    return [*VERSIONED, *(path for path in outside if (reports / path).is_file())]


def _made_by(stored: dict[str, Any]) -> str:
    return str(stored.get("configuration", stored)["versions"]["smartmot"])


def render(reports: Path) -> str:
    """The page, from the tables in a folder of reference results and from nothing else.

    Raises:
        ResultsError: a table is missing or of another version.
    """
    import jinja2

    environment = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    environment.filters |= {"listed": listed, "points": _points, "table": _table}
    template = environment.from_string(files(__package__).joinpath(TEMPLATE).read_text(encoding="utf-8"))
    try:
        return template.render(_values(reports))
    except ValueError as error:  # a table without the runs that the page tells of
        raise ResultsError(f"{reports}: not the tables of this version ({error}); make them again") from None


def _values(reports: Path) -> dict[str, Any]:
    """What the template tells."""
    rows = {
        name: read_records(reports / name / "runs.csv", RunRow)
        for name in ("paper", "static", "physical", "weather")
    }
    mechanisms = read_records(reports / "mechanisms" / "runs.csv", MechanismRun)
    measures = {
        name: read_records(reports / name / "runs.csv", RunMeasures)
        for name in ("frontier_physical", "frontier_paper", "seeds", "ablation")
    }
    gain = answers.read(GAIN, reports)
    towns = answers.read(TOWNS, reports) if (reports / TOWNS.name / TOWNS.table).is_file() else None
    kept_drives = drives.read(DRIVES, reports)
    kept_detectors = detectors.read(DETECTORS, reports)
    growth = read_records(reports / "growth" / "growth.csv", GrowthRun)
    spent = read_records(reports / "growth" / "growth_times.csv", FrameTime)
    return {
        "versions": sorted({_made_by(read_json(reports / path)) for path in _versioned(reports)}),
        "answers": answers,
        "adaptive": adaptive,
        "adaptive_gain": answers.read(ADAPTIVE_GAIN, reports),
        "adaptive_drives": drives.read(ADAPTIVE_DRIVES, reports),
        "severity": answers.read(SEVERITY, reports),
        "gain": gain,
        "towns": towns,
        "clouds": clouds,
        "lidar": answers.read(LIDAR, reports),
        "learned": answers.read(LEARNED, reports),
        "drives": drives,
        "kept_drives": kept_drives,
        "detectors": detectors,
        "kept_detectors": kept_detectors,
        "break_even": answers.read(BREAK_EVEN, reports),
        "sensor": answers.read(SENSOR, reports),
        "trigger": answers.read(TRIGGER, reports),
        "tuning": answers.read(TUNING, reports),
        "cpna": cpna,
        "scenes": scenes,
        "crowds": crowds,
        "seeds": seeds,
        "rows": rows,
        "measures": measures,
        "mechanisms": mechanisms,
        "table_one": comparison_table(read_runs(reports / "paper"), PUBLISHED),
        "physical_table": comparison_table(read_runs(reports / "physical")),
        "mechanism_table": mechanism_table(mechanisms),
        "growth": growth,
        "spent": spent,
        "growth_table": growth_table(growth, spent),
        "contradictions": [
            *answers.contradictions(gain),
            *cpna.contradictions(rows["paper"], rows["static"], mechanisms, rows["physical"]),
            *scenes.contradictions(measures["frontier_paper"]),
            *crowds.contradictions(growth, spent),
        ],
    }


def _points(lines: Sequence[str]) -> str:
    """Sentences as a list."""
    return "\n".join(f"- {line}" for line in lines)


def _table(table: Table) -> str:
    return markdown_table(table).rstrip("\n")
