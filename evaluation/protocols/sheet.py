"""What a picture of matrices shows, whatever draws it: strategies, matrices, legend, totals, notes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from evaluation.protocols.assessment import Assessment, BlockScore, Total
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Layer
from evaluation.protocols.marks import Mark


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """Matrices of several strategies side by side.

    Args:
        title: scenario, or the whole protocol.
        protocol: name and edition.
        panels: per strategy the matrices, in the same order.
        totals: per strategy the sums that belong to the title.
        marks: those that occur, for the legend.
        extended: whether extended cells occur.
        unit: of the numbers in the cells.
        gates: per strategy the requirements that failed.
        notes: what the numbers leave out.
    """

    title: str
    protocol: str
    panels: Mapping[str, tuple[BlockScore, ...]]
    totals: Mapping[str, tuple[Total, ...]]
    marks: tuple[Mark, ...]
    extended: bool
    unit: str
    gates: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]


def make_sheet(assessments: Mapping[str, Assessment], scenarios: Collection[str] = ()) -> Sheet:
    """Collect what a picture shows.

    Args:
        assessments: per strategy, all by the same protocol.
        scenarios: a family, such as CPNA, CPFA and CPNCO; empty: all matrices in which something was run.

    Raises:
        ProtocolError: there is nothing to show, or the assessments are of different protocols.
    """
    if not assessments:
        raise ProtocolError("no assessment to show; score at least one strategy")
    titles = {assessment.title for assessment in assessments.values()}
    if len(titles) > 1:
        raise ProtocolError(f"assessments of different protocols: {', '.join(sorted(titles))}; show one")
    panels = {name: _chosen(assessment, scenarios) for name, assessment in assessments.items()}
    shown = {
        score.block.name for scores in panels.values() for score in scores if scenarios or score.cells_run
    }
    if not shown:
        known = sorted({s.block.scenario for a in assessments.values() for s in a.blocks})
        raise ProtocolError(
            f"nothing to show for {', '.join(scenarios) or 'any scenario'}; run one of: {', '.join(known)}"
        )
    panels = {name: tuple(s for s in scores if s.block.name in shown) for name, scores in panels.items()}
    cells = [
        (cell, score)
        for scores in panels.values()
        for block in scores
        for cell, score in block.scores.items()
    ]
    marks = dict.fromkeys(score.mark for _, score in cells)
    (title,) = titles
    first = next(iter(assessments.values()))
    return Sheet(
        title=", ".join(scenarios) or "all scenarios",
        protocol=title,
        panels=panels,
        totals={name: _totals(assessment, scenarios) for name, assessment in assessments.items()},
        marks=tuple(sorted(marks, key=lambda mark: _LEGEND.index(mark.letter))),
        extended=any(cell.layer is Layer.EXTENDED for cell, _ in cells),
        unit=first.unit,
        gates={
            name: tuple(gate.name for gate in assessment.gates if gate.passed is False)
            for name, assessment in assessments.items()
        },
        notes=tuple(dict.fromkeys(note for a in assessments.values() for note in a.notes)),
    )


def total_line(totals: tuple[Total, ...]) -> str:
    """Sums in one line, the unit once."""
    units = dict.fromkeys(total.unit for total in totals)
    return ", ".join(map(str, totals)) + (f" {' / '.join(units)}" if totals else "")


def gate_line(failed: tuple[str, ...]) -> str:
    """What a failed requirement means, in one line; empty if none failed."""
    return f"No points, because this is required and not so: {'; '.join(failed)}." if failed else ""


_LEGEND = ("G", "A", "P", "Y", "O", "B", "C", "W", "F", "N", "R", "FA", "×", "?", "–")


def _chosen(assessment: Assessment, scenarios: Collection[str]) -> tuple[BlockScore, ...]:
    return tuple(
        score
        for score in assessment.blocks
        if not scenarios or {score.block.scenario, score.block.name} & set(scenarios)
    )


def _totals(assessment: Assessment, scenarios: Collection[str]) -> tuple[Total, ...]:
    """The scenarios' sums, or for a whole protocol every sum that is no scenario's, that of all first."""
    every = {score.block.scenario for score in assessment.blocks}
    if not scenarios:
        return tuple(total for total in reversed(assessment.totals) if total.name not in every)
    own = tuple(total for total in assessment.totals if total.name in scenarios)
    return own or (assessment.totals if len(every) == 1 else ())
