"""Every cell that was run as a table, and which of them test nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from evaluation.protocols.assessment import Assessment, CellScore
from evaluation.protocols.grid import Cell, Measurement
from evaluation.results.tables import csv_bytes

CELLS_CSV = "cells.csv"
COLUMNS = (
    *("strategy", "matrix", "scenario", "v_test_kmh", "impact_location_percent", "target_speed_kmh"),
    *("lighting", "function", "layer", "condition", "state", "mark", "value", "reason"),
)
SCORED, FALSE_ACTIVATION, INVALID = "scored", "false activation", "invalid"


def cell_table(assessments: Mapping[str, Assessment]) -> bytes:
    """Every cell that was run, as CSV with `COLUMNS`.

    The state is scored, false activation (failed, whatever came out), or invalid, then with the reason.

    Args:
        assessments: per strategy.
    """
    lines = []
    for strategy, matrix, cell, score, measured in _run_cells(assessments):
        state = INVALID if measured.invalid else FALSE_ACTIVATION if measured.false_activation else SCORED
        test = (cell.scenario, cell.speed_kmh, cell.impact_percent, cell.target_speed_kmh)
        how = (cell.lighting, cell.function, cell.layer, cell.condition)
        outcome = (state, score.mark.name, score.text, measured.invalid)
        lines.append((strategy, matrix, *test, *how, *outcome))
    return csv_bytes(COLUMNS, lines)


def told_invalid(assessments: Mapping[str, Assessment]) -> str:
    """How many cells are invalid, and why, in one line; empty if none is. Of several strategies it is one.

    Args:
        assessments: per strategy.
    """
    reasons: dict[Cell, str] = {}
    cells = set()
    for _, _, cell, _, measured in _run_cells(assessments):
        cells.add(cell)
        if measured.invalid:
            reasons.setdefault(cell, measured.invalid.split(":")[0])
    if not reasons:
        return ""
    why = "; ".join(f"{count} {reason}" for reason, count in Counter(reasons.values()).items())
    verb = "is invalid and scores" if len(reasons) == 1 else "are invalid and score"
    return f"{len(reasons)} of {len(cells)} cells {verb} nothing: {why}"


def _run_cells(
    assessments: Mapping[str, Assessment],
) -> Iterator[tuple[str, str, Cell, CellScore, Measurement]]:
    """Strategy, matrix, cell, outcome and measurement of every cell that was run."""
    for strategy, assessment in assessments.items():
        for block in assessment.blocks:
            for cell, score in block.scores.items():
                if score.measurement is not None:
                    yield strategy, block.block.name, cell, score, score.measurement
