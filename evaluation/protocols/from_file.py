"""A protocol that a file describes: pass or fail of every cell, and the worst of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from evaluation.protocols.assessment import (
    Assessment,
    Protocol,
    Total,
    impact_text,
    invalid_notes,
    score_block,
    summed,
)
from evaluation.protocols.bands import round_half_up
from evaluation.protocols.file_format import Column, ProtocolTable, TableTest, Warned, read_protocol
from evaluation.protocols.grid import Block, Cell, Measurement, labelled, matrix
from evaluation.protocols.marks import FAILED, NO_WARNING, PASSED, Mark

FMVSS_127 = Path(__file__).parent / "fmvss127.toml"


@dataclass(frozen=True, slots=True)
class TableProtocol(Protocol):
    """The rules of a file; every cell is one run.

    Args:
        table: what the file holds.
    """

    table: ProtocolTable

    @property
    def title(self) -> str:
        """As the file has it."""
        return self.table.title

    @property
    def unknown(self) -> tuple[str, ...]:
        """What the file says that it leaves out."""
        return self.table.left_out

    @property
    def blocks(self) -> tuple[Block, ...]:
        """A matrix per test, speeds by columns."""
        return tuple(map(_block, self.table.tests))

    def asked(self, cell: Cell) -> tuple[TableTest, Column]:
        """The test and the column of a cell of this protocol."""
        test = next(test for test in self.table.tests if test.name == cell.scenario)
        return test, next(column for column in test.columns if column.label == cell.condition)

    def assess(self, results: Mapping[Cell, Measurement]) -> Assessment:
        """Pass or fail of every run; the totals count passed tests, of those that are valid."""
        valid, scored = self.valid_results(results), []
        for test, block in zip(self.table.tests, self.blocks, strict=True):
            marks = {cell: _mark(test, cell, valid[cell]) for cell in block.cells if cell in valid}
            passed = sum(mark is PASSED and not valid[cell].false_activation for cell, mark in marks.items())
            total = Total(test.name, passed, len(marks), "tests passed")
            text = _added_text if test.rule.impact_at_most_kmh is None else None
            scored.append(score_block(block, results, lambda c, _, m=marks: m[c], (total,), text))  # type: ignore[misc]
        totals = [total for score in scored for total in score.totals]
        together = summed([("together", total.won, total.most) for total in totals], "tests passed")
        notes = (*invalid_notes(results), *self.unknown)
        return Assessment(self.title, tuple(scored), (*totals, *together), (), notes, self._unit)

    @property
    def _unit(self) -> str:
        added = [test.name for test in self.table.tests if test.rule.impact_at_most_kmh is None]
        less = f"; added deceleration in m/s2: {', '.join(added)}" if added else ""
        return f"impact speed in km/h{less}"


def named_table(file: Path) -> TableProtocol:
    """The protocol of a file; see `read_protocol` for what it raises."""
    return TableProtocol(read_protocol(file))


def worst_cell(assessment: Assessment) -> str:
    """The failed cell that is worst, in words: the fastest impact, else the greatest added deceleration.

    After these come false activations, and runs without the warning that they ask for.
    """
    failed = [
        (cell, score.mark, score.measurement)
        for block in assessment.blocks
        for cell, score in block.scores.items()
        if score.measurement is not None and not score.measurement.invalid and score.mark is not PASSED
    ]
    if not failed:
        return "no cell failed"

    def rank(item: tuple[Cell, Mark, Measurement]) -> tuple[float, ...]:
        _, mark, run = item
        return (mark is FAILED, run.impact_speed_kmh, mark is not NO_WARNING, run.added_decel_mps2 or 0.0)

    cell, mark, run = max(failed, key=rank)
    column = f", {cell.condition}" if cell.condition else ""
    what = mark.name
    if mark is FAILED:
        added = f"{run.added_decel_mps2:.2f} m/s2 added" if run.added_decel_mps2 is not None else ""
        what = f"impact at {run.impact_speed_kmh:.1f} km/h" if run.impact_speed_kmh else added
    return f"{cell.scenario}{column}, {cell.speed_kmh:g} km/h: {what}"


def _block(test: TableTest) -> Block:
    columns = {column.label: column for column in test.columns}
    return matrix(
        test.name,
        ("VUT (km/h)", ""),
        labelled(test.speeds_kmh),
        columns,
        lambda v, column: Cell(test.name, v, lighting=test.lighting, condition=column.label),
    )


def _mark(test: TableTest, cell: Cell, run: Measurement) -> Mark:
    rule = test.rule
    if rule.impact_at_most_kmh is not None:
        limit = rule.impact_at_most_kmh[test.speeds_kmh.index(cell.speed_kmh)]
        if round_half_up(run.impact_speed_kmh) > limit:
            return FAILED
    added = run.added_decel_mps2
    if rule.added_decel_below_mps2 is not None and not (
        added is not None and added < rule.added_decel_below_mps2
    ):
        return FAILED
    lead = run.warning_lead_s
    if rule.warning is not None and (lead is None or (rule.warning is Warned.BEFORE_BRAKING and lead <= 0.0)):
        return NO_WARNING
    return PASSED


def _added_text(_: Cell, run: Measurement) -> str:
    """Deceleration that the emergency brake added; the impact, should there be one."""
    if run.impact_speed_kmh:
        return impact_text(run)
    return "" if run.added_decel_mps2 is None else f"{run.added_decel_mps2:.1f}"
