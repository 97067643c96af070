"""What the reader has to know about finished runs, in lines that commands print after them."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.results.rows import RunRow
from scenarios.simulation.ends import TIME_LIMIT_S, EndReason

MANY_DROPPED = 0.1
"""Users are told when more than this share of the detections of a run is dropped."""


def told_runs(rows: Sequence[RunRow]) -> list[str]:
    """What the reader has to know about finished runs, one line each; none if all ended as they should."""
    ended = sum(row.end_reason == EndReason.TIME_LIMIT for row in rows)
    lines = []
    if ended:
        lines.append(
            f"{ended} of {len(rows)} runs were cut off at {TIME_LIMIT_S:g} s: they count nowhere as avoided, "
            "and have no score; shorten what comes before, or give the scenario a stop trigger"
        )
    not_begun = sum(row.end_reason == EndReason.NOT_BEGUN for row in rows)
    if not_begun:
        lines.append(
            f"{not_begun} of {len(rows)} runs were ended by the scenario's stop trigger before any event of "
            "the target began: they count nowhere as avoided, and have no score"
        )
    lost = [row for row in rows if row.dropped > MANY_DROPPED * (row.detections or 0)]
    if lost:
        worst = max(lost, key=lambda row: row.dropped / (row.detections or 1))
        lines.append(
            f"in {len(lost)} of {len(rows)} runs more than a tenth of the detections were dropped; most in "
            f"{worst.scenario}, {worst.strategy}, {worst.v_test_kmh:g} km/h: of {worst.detections} "
            f"{worst.dropped_score} for a score under the tracker's threshold, {worst.dropped_category} for "
            f"an unknown category, {worst.dropped_box} for an impossible box"
        )
    return lines


def told_notes(notes: Sequence[Sequence[str]]) -> list[str]:
    """Notes of finished runs, one line for those about the same: the first, and in how many runs.

    Args:
        notes: of every run.
    """
    first: dict[str, str] = {}
    runs: dict[str, int] = {}
    for lines in notes:
        for line in lines:
            about = line.partition(" of ")[2] or line  # the amounts before differ from run to run
            first.setdefault(about, line)
            runs[about] = runs.get(about, 0) + 1
    return [f"{line} (in {runs[about]} of {len(notes)} runs)" for about, line in first.items()]
