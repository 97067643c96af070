"""What detectors make of clouds that they were not fitted to, in sentences from the kept tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.metrics.detection.from_above import LEAST_OVERLAP
from evaluation.results.tables import EMPTY, Table
from evaluation.studies.detectors.comparison import LEAST_SCORE, DetectorComparison, DetectorScores
from evaluation.studies.reference.kept import read_records, read_rows


@dataclass(frozen=True, slots=True, eq=False)
class KeptDetectors:
    """A part with what is kept of it.

    Args:
        part: which clouds and detectors.
        runs: a line per set of clouds, detector and class.
        median_ms: processor time of a cloud, by set and detector.
    """

    part: DetectorComparison
    runs: list[DetectorScores]
    median_ms: dict[tuple[str, str], float]


def read(parts: Sequence[DetectorComparison], reports: Path) -> list[KeptDetectors]:
    """The parts that are kept: some need data of others.

    Raises:
        ResultsError: a table is missing or of another version.
    """
    kept = []
    for part in parts:
        folder = reports / part.name
        if part.needs and not (folder / part.table).is_file():
            continue
        times = {
            (row["clouds"], row["method"]): float(row["median_ms"]) for row in read_rows(folder / "times.csv")
        }
        kept.append(KeptDetectors(part, read_records(folder / part.table, DetectorScores), times))
    return kept


def sentences(kept: Sequence[KeptDetectors]) -> list[str]:
    """F1 of every detector, set by set."""
    return [
        _sentence(clouds.name, clouds.title, clouds.is_real, part)
        for part in kept
        for clouds in part.part.sets
    ]


def _sentence(name: str, title: str, is_real: bool, kept: KeptDetectors) -> str:
    parts, frames = [], 0
    for category in LEAST_OVERLAP:
        runs = [run for run in kept.runs if (run.clouds, run.category) == (name, category)]
        if not runs or not runs[0].labels:
            continue
        frames = runs[0].frames
        values = ", ".join(f"{run.method} {run.f1:.2f}" for run in runs)
        parts.append(f"{category} ({runs[0].labels} labels): {values}")
    kind = "real" if is_real else "simulated, an upper bound"
    return f"{frames} clouds, {title} ({kind}). F1 at a score of {LEAST_SCORE:g}: {'; '.join(parts)}."


def told_in_short(kept: Sequence[KeptDetectors]) -> str:
    """Mean F1 over the classes of every detector, simulated and real, in a sentence."""
    parts = []
    for part in kept:
        for clouds in part.part.sets:
            means = []
            for method in part.part.methods:
                own = [run for run in part.runs if (run.clouds, run.method) == (clouds.name, method)]
                values = [run.f1 for run in own if run.labels]
                means.append(f"{method} {sum(values) / len(values):.2f}" if values else f"{method} {EMPTY}")
            kind = "real" if clouds.is_real else "simulated"
            parts.append(f"{clouds.name} ({kind}) {', '.join(means)}")
    return (
        f"**Which detector?** Mean F1 over the classes at a score of {LEAST_SCORE:g}: {'; '.join(parts)}. "
        "Simulated figures are upper bounds, and the real clouds are few."
    )


def table(kept: Sequence[KeptDetectors]) -> Table:
    """A line per set and detector: F1 by class in both counts of misses, and the time of a cloud."""
    rows = []
    for part in kept:
        for (clouds, method), spent_ms in part.median_ms.items():
            cells = []
            for category in LEAST_OVERLAP:
                (run,) = (
                    each
                    for each in part.runs
                    if (each.clouds, each.method, each.category) == (clouds, method, category)
                )
                known = f"{run.f1:.2f} / {run.f1_untouched:.2f}, {run.average_precision or 0.0:.2f}"
                cells.append(known if run.labels else EMPTY)
            rows.append((clouds, method, *cells, f"{spent_ms:.1f}"))
    caption = (
        "F1 with misses as labels less true positives / as labels that no box of their class touches, and "
        "average precision. Milliseconds: median processor time of a cloud; different in every run."
    )
    header = ("clouds", "detector", *LEAST_OVERLAP, "ms")
    return Table(header, tuple(rows), (), caption)
