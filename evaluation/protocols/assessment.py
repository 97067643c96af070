"""What scoring gives, whatever the protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from evaluation.protocols.bands import round_half_up
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Block, Cell, Measurement
from evaluation.protocols.marks import FALSE_ACTIVATION, INVALID, NOT_RUN, Mark


@dataclass(frozen=True, slots=True)
class CellScore:
    """One cell's outcome.

    Args:
        mark: its colour and letter.
        text: number shown in the cell.
        measurement: None where the cell was not run.
    """

    mark: Mark
    text: str
    measurement: Measurement | None

    def __str__(self) -> str:
        return f"{self.text} {self.mark.letter}".strip()


@dataclass(frozen=True, slots=True)
class Total:
    """Points won and to be won.

    Args:
        name: what is added up.
        won: points.
        most: points to be won.
        unit: of the numbers.
        before_gate: points before a failed requirement took them; None where none did.
    """

    name: str
    won: float
    most: float
    unit: str = "points"
    before_gate: float | None = None

    def __str__(self) -> str:
        lost = "" if not self.before_gate else f" (else {_number(self.before_gate)})"
        return f"{self.name} {_number(self.won)} of {_number(self.most)}{lost}"


@dataclass(frozen=True, slots=True, eq=False)
class BlockScore:
    """A scored matrix.

    Args:
        block: its cells.
        scores: outcome of every cell.
        totals: points per layer.
    """

    block: Block
    scores: Mapping[Cell, CellScore]
    totals: tuple[Total, ...]

    @property
    def cells_run(self) -> int:
        """How many cells were run, invalid ones included."""
        return sum(score.measurement is not None for score in self.scores.values())


@dataclass(frozen=True, slots=True)
class Gate:
    """A requirement without which nothing counts.

    Args:
        name: what is required, with its clause.
        passed: None where nothing was run that could tell.
    """

    name: str
    passed: bool | None


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """Runs scored by a protocol.

    Args:
        title: protocol and edition.
        blocks: the matrices.
        totals: per scenario, family and overall.
        gates: requirements.
        notes: what the numbers leave out, and why.
        unit: of the number in each cell.
    """

    title: str
    blocks: tuple[BlockScore, ...]
    totals: tuple[Total, ...]
    gates: tuple[Gate, ...]
    notes: tuple[str, ...]
    unit: str = "impact speed in km/h"

    def total(self, name: str) -> Total:
        """Total of a scenario or family by its name.

        Raises:
            ProtocolError: there is none.
        """
        for total in self.totals:
            if total.name == name:
                return total
        names = ", ".join(total.name for total in self.totals)
        raise ProtocolError(f"no total {name!r}; there are: {names or 'none'}")

    def block(self, name: str) -> BlockScore:
        """Scored matrix by its name.

        Raises:
            ProtocolError: there is none.
        """
        for block in self.blocks:
            if block.block.name == name:
                return block
        raise ProtocolError(f"no matrix {name!r}; there are: {', '.join(b.block.name for b in self.blocks)}")


class Protocol(ABC):
    """A set of rules that scores runs; subclasses are frozen values."""

    __slots__ = ()

    @property
    @abstractmethod
    def title(self) -> str:
        """Name and edition."""

    @property
    @abstractmethod
    def unknown(self) -> tuple[str, ...]:
        """What no source gives, and what is therefore not scored."""

    @property
    @abstractmethod
    def blocks(self) -> tuple[Block, ...]:
        """All matrices."""

    @abstractmethod
    def assess(self, results: Mapping[Cell, Measurement]) -> Assessment:
        """Score finished runs; cells that were not run and invalid ones win nothing.

        Raises:
            ProtocolError: a result belongs to no cell, or does not fit it.
        """

    def cells(self, scenario: str | None = None) -> tuple[Cell, ...]:
        """Cells of the grid, of all scenarios or of one by its own or its matrix's name.

        Raises:
            ProtocolError: there is no such scenario.
        """
        pairs = [(block, cell) for block in self.blocks for cell in block.cells]
        if scenario is None:
            return tuple(cell for _, cell in pairs)
        chosen = tuple(
            cell for block, cell in pairs if scenario in (block.scenario, block.name, cell.scenario)
        )
        if not chosen:
            names = sorted({block.scenario for block, _ in pairs})
            raise ProtocolError(f"no scenario {scenario!r}; use one of: {', '.join(names)}")
        return chosen

    @property
    def all_cells(self) -> tuple[Cell, ...]:
        """Cells of the grid, and those that other rules ask for."""
        return self.cells()

    def valid_results(self, results: Mapping[Cell, Measurement]) -> dict[Cell, Measurement]:
        """The results that score.

        Raises:
            ProtocolError: there is a result for a cell that the protocol does not have.
        """
        strange = set(results) - set(self.all_cells)
        if strange:
            first = min(strange, key=str)
            raise ProtocolError(
                f"{self.title} has no cell {first}; take the cells from the protocol's grid "
                f"({len(strange)} unknown)"
            )
        return {cell: measured for cell, measured in results.items() if not measured.invalid}


def summed(parts: Iterable[tuple[str, float, float]], unit: str = "points") -> tuple[Total, ...]:
    """Totals of what was won and was to be won, by name in the order of the first of that name."""
    sums: dict[str, tuple[float, float]] = {}
    for name, won, most in parts:
        before_won, before_most = sums.get(name, (0, 0))
        sums[name] = before_won + won, before_most + most
    return tuple(Total(name, won, most, unit) for name, (won, most) in sums.items())


def score_block(
    block: Block,
    results: Mapping[Cell, Measurement],
    mark: Callable[[Cell, Measurement], Mark],
    totals: tuple[Total, ...] = (),
    text: Callable[[Cell, Measurement], str] | None = None,
) -> BlockScore:
    """A matrix with the outcome of every cell; see `cell_score`."""
    scores = {cell: cell_score(cell, results, mark, text) for cell in block.cells}
    return BlockScore(block, scores, totals)


def cell_score(
    cell: Cell,
    results: Mapping[Cell, Measurement],
    mark: Callable[[Cell, Measurement], Mark],
    text: Callable[[Cell, Measurement], str] | None = None,
) -> CellScore:
    """Outcome of a cell.

    Args:
        cell: of the grid.
        results: what was measured in the cells that were run.
        mark: of a valid run without a false activation.
        text: the number to show; None: the impact speed.
    """
    measured = results.get(cell)
    if measured is None:
        return CellScore(NOT_RUN, "", None)
    if measured.invalid:
        return CellScore(INVALID, "", measured)
    if measured.false_activation:
        return CellScore(FALSE_ACTIVATION, "", measured)
    shown = impact_text(measured) if text is None else text(cell, measured)
    return CellScore(mark(cell, measured), shown, measured)


def invalid_notes(results: Mapping[Cell, Measurement]) -> tuple[str, ...]:
    """How many cells test nothing, in one line; none if there are none."""
    count = sum(bool(measured.invalid) for measured in results.values())
    if not count:
        return ()
    cells = "1 cell is" if count == 1 else f"{count} cells are"
    return (f"{cells} invalid and score{'s' if count == 1 else ''} nothing (reasons: cells.csv)",)


def impact_text(measurement: Measurement) -> str:
    """Impact speed as shown in a cell: 0 without contact, else one decimal."""
    return "0" if measurement.impact_speed_kmh == 0 else f"{measurement.impact_speed_kmh:.1f}"


def _number(value: float) -> str:
    return f"{round_half_up(value, 4):.4f}".rstrip("0").rstrip(".")
