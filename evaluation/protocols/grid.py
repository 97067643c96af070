"""Cells of a protocol's grid, what was measured in them, and how the grid is laid out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from evaluation.protocols.errors import ProtocolError


class Lighting(StrEnum):
    """Light in which a test is driven."""

    DAY = "day"
    NIGHT = "night"


class Function(StrEnum):
    """What of the car is tested: it brakes by itself, or it warns and a robot brakes."""

    AEB = "AEB"
    FCW = "FCW"


class Layer(StrEnum):
    """Part of the score that a cell belongs to."""

    STANDARD = "standard"
    EXTENDED = "extended"
    ROBUSTNESS = "robustness"


@dataclass(frozen=True, slots=True)
class Cell:
    """One test of a grid.

    Args:
        scenario: the protocol's abbreviation, such as CPNA or CPTAfs.
        speed_kmh: test speed of the vehicle under test (VUT).
        impact_percent: impact location on the VUT's width, or overlap, in percent; None where there is none.
        target_speed_kmh: test speed of the target; None where the scenario fixes it.
        lighting: day or night.
        function: AEB or FCW.
        layer: standard, extended or robustness.
        condition: what else distinguishes the test: a robustness condition, a weather, a gap.
    """

    scenario: str
    speed_kmh: float
    impact_percent: float | None = None
    target_speed_kmh: float | None = None
    lighting: Lighting = Lighting.DAY
    function: Function = Function.AEB
    layer: Layer = Layer.STANDARD
    condition: str = ""

    def __str__(self) -> str:
        parts = [f"{self.scenario} {self.function} at {self.speed_kmh:g} km/h"]
        if self.impact_percent is not None:
            parts.append(f"{self.impact_percent:g} %")
        if self.target_speed_kmh is not None:
            parts.append(f"target {self.target_speed_kmh:g} km/h")
        return ", ".join([*parts, str(self.lighting), *filter(None, [self.condition])])


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a finished run measured.

    Args:
        impact_speed_kmh: speed of the VUT at contact less the target's speed along it; 0 without contact.
        warning_ttc_s: time to collision at the warning; None without one.
        speed_reduction_kmh: speed without braking less speed at contact, or at the slowest without contact;
            None where it is not asked for.
        invalid: why the run tests nothing; it then scores nothing, whatever came out. Empty if it is valid.
        false_activation: whether an emergency was requested before the target set off; the test is then
            failed, whatever came out.
        warning_lead_s: from the warning to the onset of automatic braking; infinite without that, None
            without a warning.
        added_decel_mps2: greatest deceleration of the emergency brake beyond that of a driver who brakes;
            None where it is not known.

    Raises:
        ProtocolError: a value is not finite or an impact speed is negative.
    """

    impact_speed_kmh: float
    warning_ttc_s: float | None = None
    speed_reduction_kmh: float | None = None
    invalid: str = ""
    false_activation: bool = False
    warning_lead_s: float | None = None
    added_decel_mps2: float | None = None

    @property
    def avoided(self) -> bool:
        """Whether the collision that the test is about was avoided."""
        return not self.invalid and not self.false_activation and self.impact_speed_kmh == 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.impact_speed_kmh) and self.impact_speed_kmh >= 0):
            raise ProtocolError(
                f"impact speed {self.impact_speed_kmh!r} km/h: give a finite number, 0 for no contact"
            )
        for name, value in (
            ("warning time to collision", self.warning_ttc_s),
            ("speed reduction", self.speed_reduction_kmh),
        ):
            if value is not None and not math.isfinite(value):
                raise ProtocolError(f"{name} {value!r}: give a finite number, or None where there is none")


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a block: a cell, or none, per column.

    Args:
        label: what stands left of the line, such as the test speed.
        cells: as many as the block has columns.
    """

    label: str
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True, slots=True)
class Block:
    """A matrix of cells as the protocol prints it.

    Args:
        name: name of the matrix, such as `CPNA day`.
        scenario: what it belongs to, such as CPNA.
        row_header: meaning of the row labels, with unit.
        column_header: meaning of the column labels, with unit.
        columns: column labels.
        rows: the lines, in the order of the protocol.
    """

    name: str
    scenario: str
    row_header: str
    column_header: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def cells(self) -> tuple[Cell, ...]:
        """All cells, line by line."""
        return tuple(cell for row in self.rows for cell in row.cells if cell is not None)


_Line = TypeVar("_Line")
_Column = TypeVar("_Column")


def matrix(
    name: str,
    headers: tuple[str, str],
    lines: Mapping[str, _Line],
    columns: Mapping[str, _Column],
    cell: Callable[[_Line, _Column], Cell | None],
    scenario: str = "",
) -> Block:
    """A block with a cell for each line and column.

    Args:
        name: of the block.
        headers: meaning of the row labels and of the column labels, with units.
        lines: what the lines stand for, by their labels.
        columns: what the columns stand for, by their labels.
        cell: makes the cell of a line and a column; None: there is none.
        scenario: what it belongs to; empty: it has the block's name.
    """
    rows = [Row(label, tuple(cell(line, each) for each in columns.values())) for label, line in lines.items()]
    return Block(name, scenario or name, *headers, tuple(columns), tuple(rows))


def labelled(values: Iterable[_Line]) -> dict[str, _Line]:
    """Numbers by their labels; None by an empty one."""
    return {"" if value is None else f"{value:g}": value for value in values}


def layer_cells(block: Block, layer: Layer) -> tuple[Cell, ...]:
    """Cells of a block that count for one layer."""
    return tuple(cell for cell in block.cells if cell.layer is layer)
