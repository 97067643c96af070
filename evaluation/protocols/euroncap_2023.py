"""Euro NCAP 2023: the grid that was driven, and what came out. No points: their tables are in no source.

Sources: Vector's OpenSCENARIO files of the VRU test protocol v4.5.1 and the car-to-car test protocol v4.3.1
(both February 2024) for scenarios, speeds and impact locations; for night in CPNA, CPFA, CPNCO and CPLA a
quotation of the VRU test protocol v4.5.1, and MathWorks' table of CPNCO (10 to 60 km/h, day and night).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from evaluation.protocols.assessment import Assessment, Protocol, Total, invalid_notes, score_block, summed
from evaluation.protocols.grid import Block, Cell, Function, Lighting, Measurement, labelled, matrix
from evaluation.protocols.marks import AVOIDED, CONTACT, Mark

UNKNOWN = (
    "Points per test speed, their limits and colours (assessment protocols v10.0.3 and v11) are in no "
    "source: no points are given, only which collisions were avoided and how fast the others were.",
    "The warning time that the FCW tests require is in no source; they show the impact speed.",
    "Testing above 40 km/h stops where the speed is reduced by less than 15 km/h (quoted from the test "
    "protocol); here every speed is run.",
    "CBDA (dooring) and lane support are not part of the grid.",
)

_ROW, _COLUMN, _OVERLAP = "VUT (km/h)", "impact location (%)", "overlap (%)"


@dataclass(frozen=True, slots=True)
class EuroNcap2023(Protocol):
    """The grid of 2023.

    Args:
        night: whether the pedestrian tests at night belong to it; the OpenSCENARIO files have day only.
    """

    night: bool = False

    title = "Euro NCAP 2023, VRU v4.5.1 and car-to-car v4.3.1, outcomes without points"
    unknown = UNKNOWN

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The matrices."""
        return (*_vru(self.night), *_car())

    def assess(self, results: Mapping[Cell, Measurement]) -> Assessment:
        """Which collisions were avoided."""
        valid = self.valid_results(results)
        scored = []
        for block in self.blocks:
            outcomes = [valid[cell].avoided for cell in block.cells if cell in valid]
            total = Total("avoided", sum(outcomes), len(outcomes), "valid cells")
            scored.append(score_block(block, results, _mark, (total,)))
        parts = [(score.block.scenario, total.won, total.most) for score in scored for total in score.totals]
        together = [("together", won, most) for _, won, most in parts]
        totals = summed([*parts, *together], "cells avoided")
        return Assessment(self.title, tuple(scored), totals, (), (*invalid_notes(results), *UNKNOWN))


def _mark(cell: Cell, measured: Measurement) -> Mark:
    return AVOIDED if measured.avoided else CONTACT


def _steps(first: int, last: int) -> tuple[float, ...]:
    return tuple(float(v) for v in range(first, last + 1, 5))


def _matrix(
    name: str,
    speeds: Iterable[float],
    percent: Iterable[float | None],
    target: float | None = None,
    lighting: Lighting = Lighting.DAY,
    function: Function = Function.AEB,
    scenario: str = "",
    header: str = _COLUMN,
) -> Block:
    def cell(v: float, p: float | None) -> Cell:
        return Cell(scenario or name, v, p, target, lighting, function)

    return matrix(name, (_ROW, header), labelled(speeds), labelled(percent), cell, scenario)


def _vru(night: bool) -> Iterable[Block]:
    crossing, warned = _steps(10, 60), _steps(50, 80)
    for lighting in Lighting if night else (Lighting.DAY,):
        for name, percent, target in (
            ("CPNA", (75.0, 25.0), 5.0),
            ("CPFA", (50.0,), 8.0),
            ("CPNCO", (50.0,), 5.0),
        ):
            yield _matrix(f"{name} {lighting}", crossing, percent, target, lighting, scenario=name)
        yield _matrix(f"CPLA {lighting}", _steps(20, 60), (50.0,), 5.0, lighting, scenario="CPLA")
        yield _matrix(f"CPLA FCW {lighting}", warned, (25.0,), 5.0, lighting, Function.FCW, scenario="CPLA")
    for name, speeds in (
        ("CPTAfs", (10.0, 15.0, 20.0)),
        ("CPTAfo", (10.0, 15.0, 20.0)),
        ("CPTAns", (10.0,)),
        ("CPTAno", (10.0,)),
    ):
        yield _matrix(name, speeds, (50.0,), 5.0, scenario=name)
    yield _matrix("CPRA_Cm", (4.0, 8.0), (50.0,), 5.0)
    yield _matrix("CPRA_Cs", (4.0, 8.0), (75.0, 50.0, 25.0), 0.0)
    for name, target in (("CBNA", 15.0), ("CBNAO", 10.0), ("CBFA", 20.0)):
        yield _matrix(name, crossing, (50.0,), target)
    yield _matrix("CBLA", _steps(25, 60), (50.0,), 15.0)
    yield _matrix("CBLA FCW", warned, (25.0,), 20.0, function=Function.FCW, scenario="CBLA")
    yield _turning("CMFtap")


def _car() -> Iterable[Block]:
    overlap = (-50.0, -75.0, 100.0, 75.0, 50.0)
    yield _matrix("CCRs", _steps(10, 50), overlap, 0.0, header=_OVERLAP)
    yield _matrix(
        "CCRs FCW", _steps(55, 80), overlap, 0.0, function=Function.FCW, scenario="CCRs", header=_OVERLAP
    )
    yield _matrix("CCRm", _steps(30, 80), overlap, 20.0, header=_OVERLAP)
    yield matrix(
        "CCRb",
        ("at 50 km/h", "target's deceleration (m/s2)"),
        {f"gap {gap} m": gap for gap in (12, 40)},
        labelled((2, 6)),
        lambda gap, decel: Cell("CCRb", 50.0, 100.0, 50.0, condition=f"gap {gap} m, {decel} m/s2"),
    )
    yield _turning("CCFtap")
    for name in ("CCFhos", "CCFhol"):
        yield _matrix(name, (50.0, 70.0), (None,), header="")


def _turning(name: str) -> Block:
    speeds, targets = labelled((10.0, 15.0, 20.0)), labelled((30.0, 45.0, 60.0))
    headers = (_ROW, "target speed (km/h)")
    return matrix(name, headers, speeds, targets, lambda v, target: Cell(name, v, None, target))
