"""The article: hand-written prose around what the kept tables say, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from evaluation.results.files import STUDY_JSON, ResultsError
from evaluation.results.tables import Table, markdown_table
from evaluation.studies.answers.tuned import TUNED
from evaluation.studies.reference.adaptive import BEHIND, BEHIND_COMMAND, FOLDER, MARGINS_M
from evaluation.studies.reference.findings import adaptive, answers, drives
from evaluation.studies.reference.kept import read_json
from evaluation.studies.reference.parts import (
    ADAPTIVE_DRIVES,
    ADAPTIVE_GAIN,
    ADAPTIVE_LIDAR,
    ADAPTIVE_TUNING,
    BREAK_EVEN,
    GAIN,
    QUESTIONS,
    SENSOR,
    SEVERITY,
)
from evaluation.studies.reference.words import listed
from scenarios.settings import settings_text

ARTICLE = "article.md"
TEMPLATE = "article.md.j2"

WORST = (f"{FOLDER}/worst", "worst")
"""Folders of searches for the case that just fails, one folder in them per family."""


def render(reports: Path) -> str:
    """The article, from the tables in a folder of reference results and from nothing else.

    Raises:
        ResultsError: a table is missing or of another version.
    """
    import jinja2

    environment = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    environment.filters |= {"points": _points, "table": _table}
    template = environment.from_string(files(__package__).joinpath(TEMPLATE).read_text(encoding="utf-8"))
    try:
        return template.render(_values(reports))
    except (KeyError, ValueError) as error:
        raise ResultsError(
            f"{reports}: not the tables of this version ({error!r}); make them again"
        ) from None


def _values(reports: Path) -> dict[str, Any]:
    gain, lidar = answers.read(ADAPTIVE_GAIN, reports), answers.read(ADAPTIVE_LIDAR, reports)
    tuning, severity = answers.read(ADAPTIVE_TUNING, reports), answers.read(SEVERITY, reports)
    lanes = answers.read(GAIN, reports)
    behind = answers.read(BEHIND, reports)
    searches = [
        path.parent for folder in WORST for path in sorted((reports / folder).glob(f"*/{STUDY_JSON}"))
    ]
    chosen = read_json(reports / ADAPTIVE_TUNING.name / TUNED)["chosen"]
    told_chosen = [
        f"{entry['rival']}: {settings_text(tuple(entry['settings'].items())) or 'as it is'}"
        for entry in chosen
    ]
    return {
        "verdict": answers.told_verdict(lanes).replace("**", ""),
        "standing": adaptive.told_standing(gain),
        "path_line": adaptive.against_path(gain),
        "margins": f"{listed(MARGINS_M)} m",
        "trials": ADAPTIVE_TUNING.trials,
        "tuned_on": tuning.question.sample.count,
        "chosen": "; ".join(told_chosen),
        "lanes": answers.told_lanes(lanes),
        "origin": answers.told_origin(lanes)[-1:],
        "break_even": answers.told_break_even_in_short(answers.read(BREAK_EVEN, reports)),
        "sensor": answers.told_sensor(answers.read(SENSOR, reports)),
        "power": gain.power(),
        "rivals": adaptive.rivals_table(gain),
        "lidar_standing": adaptive.told_standing(lidar),
        "lidar_rivals": adaptive.rivals_table(lidar),
        "drives": adaptive.told_drives(drives.read(ADAPTIVE_DRIVES, reports)),
        "severity": adaptive.severity_table(severity),
        "severity_lines": adaptive.told_severity(severity),
        "behind": adaptive.told_behind(behind),
        "behind_table": adaptive.table_behind(behind),
        "behind_command": BEHIND_COMMAND,
        "worst": [_told_search(read_json(folder / STUDY_JSON)) for folder in searches],
        "worst_figures": [
            (folder / "boundary.png").relative_to(reports).as_posix()
            for folder in searches
            if (folder / "boundary.png").is_file()
        ],
        "worst_commands": [_command(folder.relative_to(reports), folder) for folder in searches],
        "versions": listed(_versions(reports)),
    }


def _told_search(stored: dict[str, Any]) -> str:
    low, high = stored["interval"]
    return (
        f"{stored['arm']['strategy']}, preset {stored['arm']['preset']}, {stored['family']}: a contact with "
        f"probability {stored['probability']:.2g} [{low:.2g}, {high:.2g}], by {stored['runs']} runs."
    )


def _command(path: Path, folder: Path) -> dict[str, str]:
    """Where a search lies, and how it is made again."""
    stored = read_json(folder / STUDY_JSON)
    arm, parent = stored["arm"], path.parents[1]
    out = (Path("reports") / parent).as_posix()
    return {
        "folder": f"[{path.as_posix()}]({path.as_posix()}/answer.md)",
        "command": f"smartmot-eval study worst --family '{stored['family']}' --strategies {arm['strategy']} "
        f"--preset {arm['preset']} --out {out}",
    }


def _versions(reports: Path) -> list[str]:
    used = (GAIN, BREAK_EVEN, SENSOR, *(part for part in QUESTIONS if part.name.startswith(FOLDER)), SEVERITY)
    return sorted({str(read_json(reports / part.name / STUDY_JSON)["version"]) for part in used})


def _points(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _table(table: Table) -> str:
    return markdown_table(table).rstrip("\n")
