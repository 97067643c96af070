"""General requirements of Euro NCAP 2026 Frontal Collisions: without them there are no points at all.

Sources: protocol v1.1, and the calculator `euroncap-rating-2026` 5.4.9.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from evaluation.protocols.assessment import BlockScore, Gate, score_block
from evaluation.protocols.bands import Colour, round_half_up
from evaluation.protocols.euroncap_2026.grid import VUT
from evaluation.protocols.grid import Block, Cell, Layer, Lighting, Measurement, Row
from evaluation.protocols.marks import FAILED, PASSED

_GATE_SPEED_KMH = 10.0
_GATE_IMPACT_PERCENT = 75.0
_SLOW_PEDESTRIAN_KMH = 3.0
_SLOW_TEST_KMH = 20.0
_SLOWED_KMH = 5.0
"""From this reduction on a car has slowed down: the test protocols release the accelerator once the speed has
dropped by 5 km/h, as the sign that the brake acts. The requirement itself names no amount."""
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
        results: measurements of cells of the grid and of the requirement cells. An invalid run does not show
            what is required, so that the requirement is not met.
        colours: of the cells of the grid with a valid run.
    """
    tested = []
    for lighting in Lighting:
        first = [
            cell
            for cell in results
            if not cell.condition
            and (cell.scenario, cell.speed_kmh, cell.impact_percent, cell.lighting)
            == ("CPNA", _GATE_SPEED_KMH, _GATE_IMPACT_PERCENT, lighting)
        ]
        name = _named(f"CPNA-75 at 10 km/h is green by {lighting}", first, results)
        tested.append(Gate(name, _all([colours.get(cell) is Colour.GREEN for cell in first])))
    for cell in requirement_cells():
        slow = [cell] if cell in results else []
        name = (
            f"CPNA-75 at 20 km/h slows down by {_SLOWED_KMH:g} km/h for a pedestrian of 3 km/h "
            f"by {cell.lighting}"
        )
        tested.append(Gate(_named(name, slow, results), _all([_slowed(c, results[c]) for c in slow])))
    rear = [
        cell
        for cell in cells
        if (cell.scenario, cell.layer) == ("CCRs", Layer.STANDARD)
        and cell.speed_kmh <= _REAR_AVOIDED_UP_TO_KMH
    ]
    driven = [cell for cell in rear if cell in results]
    green = all(colours.get(cell) is Colour.GREEN for cell in driven)
    passed = green if driven and (not green or len(driven) == len(rear)) else None
    name = "CCRs avoids every standard collision up to 20 km/h"
    tested.append(Gate(_named(name, driven, results), passed))
    return tuple(tested)


def requirement_matrix(results: Mapping[Cell, Measurement]) -> Iterable[BlockScore]:
    """The runs that nothing but a gate asks for, as a matrix; none if there are none."""
    cells = requirement_cells()
    if not any(cell in results for cell in cells):
        return
    names = tuple(str(cell.lighting) for cell in cells)
    name = f"CPNA-{_GATE_IMPACT_PERCENT:g}, pedestrian {_SLOW_PEDESTRIAN_KMH:g} km/h"
    block = Block(
        name,
        "CPNA",
        VUT,
        f"must slow down by {_SLOWED_KMH:g} km/h",
        names,
        (Row(f"{_SLOW_TEST_KMH:g}", cells),),
    )
    yield score_block(block, results, lambda cell, run: PASSED if _slowed(cell, run) else FAILED)


def _slowed(cell: Cell, measured: Measurement) -> bool:
    if measured.invalid or measured.false_activation:
        return False
    reduction = measured.speed_reduction_kmh
    if reduction is None:
        reduction = cell.speed_kmh - measured.impact_speed_kmh
    return round_half_up(reduction) >= _SLOWED_KMH


def _named(name: str, driven: Iterable[Cell], results: Mapping[Cell, Measurement]) -> str:
    """What is required, and whether one of its tests shows nothing."""
    return f"{name} (not shown: a test is invalid)" if any(results[c].invalid for c in driven) else name


def _all(passed: list[bool]) -> bool | None:
    return all(passed) if passed else None
