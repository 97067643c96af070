"""General requirements of Euro NCAP 2026 Frontal Collisions: without them there are no points at all.

Sources: protocol v1.1, and the calculator `euroncap-rating-2026` 5.4.9.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from evaluation.protocols.assessment import BlockScore, CellScore, Gate, impact_text
from evaluation.protocols.bands import Colour
from evaluation.protocols.euroncap_2026_grid import VUT
from evaluation.protocols.grid import Block, Cell, Layer, Lighting, Measurement, Row
from evaluation.protocols.marks import FAILED, NOT_RUN, PASSED

_GATE_SPEED_KMH = 10.0
_GATE_IMPACT_PERCENT = 75.0
_SLOW_PEDESTRIAN_KMH = 3.0
_SLOW_TEST_KMH = 20.0
_REAR_AVOIDED_UP_TO_KMH = 20.0


def requirement_cells() -> tuple[Cell, ...]:
    """Runs for the general requirements only: CPNA-75 with a pedestrian of 3 km/h, day and night."""
    return tuple(
        Cell(
            "CPNA",
            _SLOW_TEST_KMH,
            _GATE_IMPACT_PERCENT,
            _SLOW_PEDESTRIAN_KMH,
            lighting,
            condition="general requirement",
        )
        for lighting in Lighting
    )


def gates(
    cells: Iterable[Cell], results: Mapping[Cell, Measurement], colours: Mapping[Cell, Colour]
) -> tuple[Gate, ...]:
    """Whether the general requirements are met.

    Args:
        cells: of the grid.
        results: measurements of cells of the grid and of the requirement cells.
        colours: of the cells of the grid that were run.
    """
    found = []
    for lighting in Lighting:
        first = [
            colour is Colour.GREEN
            for cell, colour in colours.items()
            if (cell.scenario, cell.speed_kmh, cell.impact_percent, cell.lighting)
            == ("CPNA", _GATE_SPEED_KMH, _GATE_IMPACT_PERCENT, lighting)
        ]
        found.append(Gate(f"CPNA-75 at 10 km/h is green by {lighting}", _all(first)))
    for cell in requirement_cells():
        slowed = [_slowed(cell, results[cell])] if cell in results else []
        name = f"CPNA-75 at 20 km/h slows down for a pedestrian of 3 km/h by {cell.lighting}"
        found.append(Gate(name, _all(slowed)))
    rear = [cell for cell in cells if _is_gate_of_rear(cell)]
    green = [colours[cell] is Colour.GREEN for cell in rear if cell in colours]
    whole = all(green) if green and (not all(green) or len(green) == len(rear)) else None
    found.append(Gate("CCRs avoids every standard collision up to 20 km/h", whole))
    return tuple(found)


def requirement_matrix(results: Mapping[Cell, Measurement]) -> Iterable[BlockScore]:
    """The runs that nothing but a gate asks for, as a matrix; none if there are none."""
    cells = requirement_cells()
    if not any(cell in results for cell in cells):
        return
    names = tuple(str(cell.lighting) for cell in cells)
    name = f"CPNA-{_GATE_IMPACT_PERCENT:g}, pedestrian {_SLOW_PEDESTRIAN_KMH:g} km/h"
    block = Block(name, "CPNA", VUT, "must slow down", names, (Row(f"{_SLOW_TEST_KMH:g}", cells),))
    scores = {
        cell: CellScore(PASSED if _slowed(cell, found) else FAILED, impact_text(found), found)
        if (found := results.get(cell)) is not None
        else CellScore(NOT_RUN, "", None)
        for cell in cells
    }
    yield BlockScore(block, scores, ())


def _slowed(cell: Cell, measured: Measurement) -> bool:
    return measured.impact_speed_kmh < cell.speed_kmh


def _is_gate_of_rear(cell: Cell) -> bool:
    return (
        cell.scenario == "CCRs" and cell.layer is Layer.STANDARD and cell.speed_kmh <= _REAR_AVOIDED_UP_TO_KMH
    )


def _all(passed: list[bool]) -> bool | None:
    return all(passed) if passed else None
