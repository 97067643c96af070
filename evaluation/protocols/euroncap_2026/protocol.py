"""Euro NCAP 2026, Crash Avoidance - Frontal Collisions: colours, points, gates and totals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from evaluation.protocols.assessment import (
    Assessment,
    BlockScore,
    Gate,
    Protocol,
    Total,
    impact_text,
    invalid_notes,
    score_block,
    summed,
)
from evaluation.protocols.bands import (
    NEWEST,
    WEIGHT,
    Colour,
    Version,
    avoidance_colour,
    impact_colour,
    mitigation_colour,
    round_half_up,
    warning_colour,
    within_tolerance,
)
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.grid import Criterion, ScoredBlock, blocks
from evaluation.protocols.euroncap_2026.requirements import gates, requirement_cells, requirement_matrix
from evaluation.protocols.euroncap_2026.verification import Verification
from evaluation.protocols.grid import Block, Cell, Function, Layer, Measurement, Row, layer_cells, matrix
from evaluation.protocols.marks import MARKS
from evaluation.protocols.robustness import (
    CONDITIONS,
    LAYERS,
    NOT_SIMULATED,
    Bar,
    Condition,
    conditioned,
    failed_everywhere,
)

UNKNOWN = (
    "Lane Departure and Low Speed Collisions are other parts of the rating and are not scored here.",
    "CCFhos, CCFhol: the limits of the speed reduction (figure 5-2) are from Euro NCAP's calculator only.",
    "CBTAfs & CBTAns: standard at 100 and 0 %, extended at 75 % follows the calculator; a reading of v1.1 "
    "has 75 % as standard.",
    f"Robustness, not run and without points, because nothing here can simulate it: {NOT_SIMULATED}.",
    "v1.1: to which side the limits widened by the tolerance belong is in no source; they belong where "
    "v1.1's own limits do.",
    "That the AEB is on by default, and the dossier for large speed reductions, no run can show.",
)

_BELOW = (
    "Robustness: ! marks a cell that does not reach what its condition asks for, which is the colour of the "
    "same cell without it, or not to be red."
)
_HALF = 0.5
_EXTENDED_STEPS = (1.0, 0.75, 0.5)
_ROUNDING = 6  # decimals at which a score is compared with a step, as the calculator does


@dataclass(frozen=True, slots=True)
class EuroNcap2026(Protocol):
    """The protocol.

    Args:
        version: edition; 1.1 and 1.2 differ where an impact speed lies on the limit of two colours.
        choice: what is declared in the rows that may be FCW or AEB.
    """

    version: Version = NEWEST
    choice: Function = Function.FCW

    unknown = UNKNOWN

    @property
    def title(self) -> str:
        """Name and edition."""
        return f"Euro NCAP 2026, Crash Avoidance, Frontal Collisions v{self.version}"

    @property
    def scored_blocks(self) -> tuple[ScoredBlock, ...]:
        """The matrices with points and criteria."""
        return blocks(self.choice)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The matrices."""
        return tuple(scored.block for scored in self.scored_blocks)

    def robustness_cells(self, scenario: str | None = None) -> tuple[Cell, ...]:
        """Standard cells under the robustness conditions that are numbers, by day, where the points are.

        Raises:
            ProtocolError: there is no such scenario.
        """
        chosen = set(self.cells(scenario))
        return tuple(cell for base, cells in self.conditions().items() if base in chosen for _, cell in cells)

    def conditions(self) -> dict[Cell, tuple[tuple[Condition, Cell], ...]]:
        """The robustness conditions of every standard cell by day, with the cells that they make of it."""
        return {base: pairs for scored in self.scored_blocks for base, pairs in _conditioned(scored).items()}

    def requirement_cells(self) -> tuple[Cell, ...]:
        """Runs for the general requirements only."""
        return requirement_cells()

    @property
    def all_cells(self) -> tuple[Cell, ...]:
        """Standard and extended cells, and those of robustness and of the general requirements."""
        return (*self.cells(), *self.robustness_cells(), *self.requirement_cells())

    def colour(self, block: ScoredBlock, cell: Cell, measured: Measurement) -> Colour:
        """Colour of a valid measured cell; red if the emergency was requested before the target set off.

        Raises:
            ProtocolError: the cell needs a speed reduction and has none, or the speed has no bands.
        """
        if measured.false_activation:
            return Colour.RED
        criterion = block.criterion_of(cell)
        impact = round_half_up(measured.impact_speed_kmh)
        if criterion is Criterion.IMPACT_SPEED:
            return impact_colour(cell.speed_kmh, impact, self.version)
        if criterion is Criterion.AVOIDANCE:
            return avoidance_colour(impact)
        if criterion is Criterion.WARNING:
            ttc = measured.warning_ttc_s
            return warning_colour(None if ttc is None else round_half_up(ttc))
        if measured.speed_reduction_kmh is None:
            raise ProtocolError(f"{cell}: is judged by the speed reduction; give it with the measurement")
        return mitigation_colour(round_half_up(measured.speed_reduction_kmh))

    def assess(
        self,
        results: Mapping[Cell, Measurement],
        verification: Mapping[str, Verification] | None = None,
    ) -> Assessment:
        """Score finished runs.

        Cells that were not run, and invalid ones, win nothing; what was to be won with them stays.

        Args:
            results: measurements of cells of the grid, of robustness cells and of the requirement cells.
            verification: per matrix name, how many drawn cells confirmed the colours; None: every colour was
                measured and stands.

        Returns:
            Points per matrix, scenario, category and family; all of them zero if a gate is failed.

        Raises:
            ProtocolError: a result belongs to no cell, or lacks what its criterion needs.
        """
        scored = self.scored_blocks
        valid = self.valid_results(results)
        checked = verification or {}
        strange = set(checked) - {block.block.name for block in scored}
        if strange:
            raise ProtocolError(f"verification of {min(strange)!r}: there is no such matrix in {self.title}")
        colours = {
            cell: self.colour(block, cell, valid[cell])
            for block in scored
            for cell in block.block.cells
            if cell in valid
        }
        held = self._held(scored, results, colours)
        layers = _layers(scored, results, held)
        tested = gates(self.cells(), results, colours)
        open_gates = all(gate.passed is not False for gate in tested)
        done = []
        points: list[tuple[ScoredBlock, float]] = []
        for block in scored:
            totals = _block_totals(block, colours, checked.get(block.block.name), layers)
            points.append((block, sum(total.won for total in totals)))
            shown = totals if open_gates else _shut(totals)
            done.append(
                score_block(
                    block.block, results, lambda c, _: MARKS[colours[c]], shown, partial(_text, block)
                )
            )
        sums = _sums(points)
        conditions = [matrix for block in scored for matrix in self._conditions(block, results, held)]
        return Assessment(
            self.title,
            (*done, *conditions, *requirement_matrix(results)),
            sums if open_gates else _shut(sums),
            tested,
            (
                *invalid_notes(results),
                *_missing(done),
                *_untested(tested),
                *((_BELOW,) if conditions else ()),
                *UNKNOWN,
            ),
            "relative impact speed in km/h; FCW: time to collision at the warning; head-on: speed reduction",
        )

    def _held(
        self,
        scored: Iterable[ScoredBlock],
        results: Mapping[Cell, Measurement],
        colours: Mapping[Cell, Colour],
    ) -> dict[Cell, bool]:
        """Whether each valid cell under a robustness condition, of a valid base, reaches what is asked."""
        invalid = {cell for cell, measured in results.items() if measured.invalid}
        return {
            cell: self._holds(block, base, cell, condition.bar, results, colours)
            for block in scored
            for base, pairs in _conditioned(block).items()
            for condition, cell in pairs
            if cell in results and not {base, cell} & invalid
        }

    def _holds(
        self,
        block: ScoredBlock,
        base: Cell,
        cell: Cell,
        bar: Bar,
        results: Mapping[Cell, Measurement],
        colours: Mapping[Cell, Colour],
    ) -> bool:
        reached = self.colour(block, cell, results[cell])
        if bar is Bar.NOT_RED:
            return reached is not Colour.RED
        if base not in colours:
            raise ProtocolError(f"{cell}: is compared with the same cell without the condition; run that too")
        if WEIGHT[reached] >= WEIGHT[colours[base]]:
            return True
        impact = round_half_up(results[cell].impact_speed_kmh)
        return block.criterion_of(base) is Criterion.IMPACT_SPEED and within_tolerance(
            base.speed_kmh, colours[base], impact, self.version
        )

    def _conditions(
        self, block: ScoredBlock, results: Mapping[Cell, Measurement], held: Mapping[Cell, bool]
    ) -> Iterator[BlockScore]:
        """Standard cells under robustness conditions as a matrix, condition by speed, if any was run."""
        grid, scenario, under = block.block, block.block.scenario, _conditioned(block)
        places = {
            f"{condition.change}, {label}": (number, column)
            for number, condition in enumerate(CONDITIONS.get(scenario, ()))
            for column, label in enumerate(grid.columns)
        }
        lines = {row.label: row for row in grid.rows if any(cell in under for cell in row.cells)}

        def cell_of(place: tuple[int, int], line: Row) -> Cell | None:
            number, column = place
            base = line.cells[column]
            return under[base][number][1] if base in under else None

        name, headers = f"{grid.name}, robustness", (f"condition, {grid.column_header}", grid.row_header)
        under_all = matrix(name, headers, places, lines, cell_of, scenario)
        shown = replace(under_all, rows=tuple(row for row in under_all.rows if any(row.cells)))
        if not any(cell in results for cell in shown.cells):
            return
        score = score_block(
            shown, results, lambda c, run: MARKS[self.colour(block, c, run)], (), partial(_text, block)
        )
        failed = {
            cell: replace(outcome, text=f"{outcome.text}!")
            for cell, outcome in score.scores.items()
            if held.get(cell) is False
        }
        yield replace(score, scores={**score.scores, **failed})


def _conditioned(block: ScoredBlock) -> dict[Cell, tuple[tuple[Condition, Cell], ...]]:
    """The conditions of each standard cell, with the cells that they make; none without points for them."""
    standard = layer_cells(block.block, Layer.STANDARD) if block.points.robustness else ()
    return {base: conditioned(block.block.scenario, base) for base in standard}


def _layers(
    scored: Iterable[ScoredBlock], results: Mapping[Cell, Measurement], held: Mapping[Cell, bool]
) -> dict[str, int]:
    """How many layers hold in each scenario: with all of their conditions, in every standard cell run.

    An invalid run is as one that is missing.
    """
    outcomes: dict[str, dict[str, bool]] = {}
    partner: dict[str, str] = {}
    incomplete: set[tuple[str, str]] = set()
    for block in scored:
        scenario = block.block.scenario
        partner[scenario] = block.partner
        layers = outcomes.setdefault(scenario, {})
        for base, pairs in _conditioned(block).items():
            for condition, cell in pairs:
                if cell in held:
                    layers[condition.layer] = layers.get(condition.layer, True) and held[cell]
                elif base in results or cell in results:
                    incomplete.add((scenario, condition.layer))
    failed = failed_everywhere(outcomes, partner)
    return {
        scenario: sum((scenario, layer) not in incomplete for layer in set(layers) - failed[scenario])
        for scenario, layers in outcomes.items()
    }


def _block_totals(
    block: ScoredBlock,
    colours: Mapping[Cell, Colour],
    verification: Verification | None,
    held: Mapping[str, int],
) -> tuple[Total, ...]:
    """Points of a matrix per layer (section 5.2 and 5.3)."""
    points = block.points
    kept = {layer: verification.share(layer) if verification else 1.0 for layer in Layer}
    standard = layer_cells(block.block, Layer.STANDARD)
    extended = layer_cells(block.block, Layer.EXTENDED)
    share = sum(WEIGHT[colours[c]] for c in standard if c in colours) / len(standard)
    won = share * points.standard * kept[Layer.STANDARD]
    not_red = sum(colours.get(c, Colour.RED) is not Colour.RED for c in extended) / len(extended)
    reached = extended_share(not_red) * points.extended * kept[Layer.EXTENDED]
    totals = [
        Total("standard", won, points.standard),
        Total("extended", reached, points.extended),
    ]
    if points.robustness:
        scenario = block.block.scenario
        counts = round(won, _ROUNDING) >= round(_HALF * points.standard, _ROUNDING)
        robust = points.robustness * held.get(scenario, 0) / LAYERS[scenario] if counts else 0.0
        totals.append(Total("robustness", robust, points.robustness))
    return tuple(totals)


def _shut(totals: Iterable[Total]) -> tuple[Total, ...]:
    """The totals after a failed requirement."""
    return tuple(Total(t.name, 0.0, t.most, t.unit, t.won) for t in totals)


def extended_share(not_red: float) -> float:
    """Share of the extended points for a share of cells that are not red: 0, then 50, 75, 100 %."""
    for step in _EXTENDED_STEPS:
        if round(not_red, _ROUNDING) >= step:
            return step
    return 0.0


def _sums(points: Sequence[tuple[ScoredBlock, float]]) -> tuple[Total, ...]:
    """Totals by scenario, then by category and family, then of all."""
    names: tuple[Callable[[ScoredBlock], str], ...] = (
        lambda block: block.block.scenario,
        lambda block: f"{block.subelement} / {block.category}",
        lambda block: str(block.subelement),
        lambda block: "Frontal Collisions",
    )
    return summed((name(block), won, block.points.total) for name in names for block, won in points)


def _missing(done: Iterable[BlockScore]) -> tuple[str, ...]:
    lines = [
        f"{score.block.name}: {score.cells_run} of {len(score.block.cells)} cells run"
        for score in done
        if 0 < score.cells_run < len(score.block.cells)
    ]
    silent = [score.block.name for score in done if not score.cells_run]
    if silent:
        lines.append(f"not run, counted as no points: {', '.join(silent)}")
    return tuple(lines)


def _untested(gates: Iterable[Gate]) -> tuple[str, ...]:
    names = [gate.name for gate in gates if gate.passed is None]
    return (f"required, but no run tests it: {'; '.join(names)}",) if names else ()


def _text(block: ScoredBlock, cell: Cell, measured: Measurement) -> str:
    criterion = block.criterion_of(cell)
    if criterion is Criterion.WARNING:
        return "none" if measured.warning_ttc_s is None else f"{measured.warning_ttc_s:.1f} s"
    if criterion is Criterion.REDUCTION and measured.speed_reduction_kmh is not None:
        return f"{measured.speed_reduction_kmh:.1f}"
    return impact_text(measured)
