"""From a table of finished runs to measurements of a grid's cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Cell, Measurement
from scenarios.simulation.ends import EndReason

ALONG_TARGETS = frozenset({"CPLA", "CBLA", "CCRs", "CCRm", "CCRb", "CMRs", "CMRb"})
"""Scenarios whose target drives along the VUT's path: the impact speed is relative to it. In the crossing and
turning ones the protocol takes the target's longitudinal velocity as 0 (v1.1, definitions)."""

_KEYS = {
    # column of the table -> attribute of a cell; a column that is absent or empty fits every cell
    "impact_location_percent": "impact_percent",
    "target_speed_kmh": "target_speed_kmh",
    "lighting": "lighting",
    "function": "function",
    "layer": "layer",
}

TOUCHED_KMH = 0.01
"""Least impact speed of a contact, as 0 stands for none: two decimals count."""
CUT_OFF: dict[str, str] = {
    EndReason.TIME_LIMIT: "cut off by the time limit: nothing was decided until then",
    EndReason.NOT_BEGUN: "ended by the scenario's stop trigger before any event of the target began",
}

_EMPTY = frozenset({"", "None", "nan", "<NA>"})


def measurements(
    records: Iterable[Mapping[str, object]],
    cells: Iterable[Cell],
    why_invalid: Callable[[int, Cell], str] | None = None,
) -> dict[Cell, Measurement]:
    """Assign finished runs to the cells they belong to.

    Several runs of one cell (seeds, or both approaches of a crossing car) count as the worst of them: the
    laboratory drives one that it draws.

    Args:
        records: one mapping per run, as from `DataFrame.to_dict("records")`, with the columns `scenario`,
            `v_test_kmh` and `v_impact_kmh` (speed of the VUT at contact, 0 without), and as far as they apply
            `impact_location_percent`, `target_speed_kmh`, `lighting`, `function`, `condition`, `layer`,
            `target_speed_at_contact_kmh`, `warning_ttc_s`, `speed_reduction_kmh`, `false_activation`,
            `warning_lead_s`, `added_decel_mps2`, `relative_impact` (whether the target's speed is taken off)
            and `end_reason`: a run that the time limit cut off is invalid.
        cells: the protocol's grid.
        why_invalid: why a run, told by its number, tests nothing as one of a cell; empty if it is valid.
            None: all are.

    Returns:
        Measurement of every cell that was run.

    Raises:
        ProtocolError: a run belongs to no cell, or lacks a value.
    """
    grid: dict[tuple[str, float], list[Cell]] = {}
    for cell in cells:
        grid.setdefault((cell.scenario, cell.speed_kmh), []).append(cell)
    by_cell: dict[Cell, Measurement] = {}
    for index, record in enumerate(records):
        run = _Run(index, record)
        fitting = [cell for cell in grid.get((run.scenario, run.speed_kmh), ()) if run.fits(cell)]
        if not fitting:
            raise ProtocolError(f"{run}: {_nearest(run, grid)}")
        measured = run.measurement()
        for cell in fitting:
            reason = measured.invalid or (why_invalid(index, cell) if why_invalid else "")
            judged = replace(measured, invalid=reason)
            by_cell[cell] = _worse(by_cell[cell], judged) if cell in by_cell else judged
    return by_cell


@dataclass(frozen=True, slots=True)
class _Run:
    """One line of the table."""

    index: int
    record: Mapping[str, object]

    def __str__(self) -> str:
        shown = ("scenario", "v_test_kmh", *_KEYS, "condition")
        parts = (f"{name} {self.record[name]}" for name in shown if self.has(name))
        return f"run {self.index} ({', '.join(parts)})"

    @property
    def scenario(self) -> str:
        if not self.has("scenario"):
            raise ProtocolError(f"run {self.index}: column 'scenario' is missing or empty")
        return str(self.record["scenario"])

    @property
    def speed_kmh(self) -> float:
        return self.number("v_test_kmh")

    def has(self, name: str) -> bool:
        """Whether a column is there and not empty."""
        return str(self.record.get(name)) not in _EMPTY

    def number(self, name: str) -> float:
        """Value of a column that has to be a finite number."""
        try:
            value = float(str(self.record[name]))
        except (KeyError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise ProtocolError(
                f"run {self.index}: column {name!r} is {self.record.get(name)!r}; give a number"
            )
        return value

    def fits(self, cell: Cell) -> bool:
        """Whether the run belongs to a cell of its scenario and speed."""
        if (str(self.record["condition"]) if self.has("condition") else "") != cell.condition:
            return False
        for column, attribute in _KEYS.items():
            value = getattr(cell, attribute)
            if value is None or not self.has(column):
                continue
            if isinstance(value, float):
                if self.number(column) != value:
                    return False
            elif str(self.record[column]) != value:
                return False
        return True

    def measurement(self) -> Measurement:
        """What the run measured."""
        impact = self.number("v_impact_kmh")
        reduction = self.speed_kmh - impact
        if self.has("speed_reduction_kmh"):
            reduction = self.number("speed_reduction_kmh")
        along = self.scenario in ALONG_TARGETS or self.record.get("relative_impact") is True
        if impact > 0.0 and along:
            impact = max(impact - self._target_speed_kmh(), TOUCHED_KMH)
        warning = self.number("warning_ttc_s") if self.has("warning_ttc_s") else None
        return Measurement(
            impact,
            warning,
            reduction,
            CUT_OFF.get(str(self.record["end_reason"]), "") if self.has("end_reason") else "",
            self.has("false_activation") and str(self.record["false_activation"]).lower() == "true",
            float(str(self.record["warning_lead_s"])) if self.has("warning_lead_s") else None,
            self.number("added_decel_mps2") if self.has("added_decel_mps2") else None,
        )

    def _target_speed_kmh(self) -> float:
        for column in ("target_speed_at_contact_kmh", "target_speed_kmh"):
            if self.has(column):
                return self.number(column)
        raise ProtocolError(
            f"{self}: the impact speed is relative to the target; give 'target_speed_at_contact_kmh'"
        )


def _worse(a: Measurement, b: Measurement) -> Measurement:
    warnings = [m.warning_ttc_s for m in (a, b)]
    reductions = [m.speed_reduction_kmh for m in (a, b) if m.speed_reduction_kmh is not None]
    leads = [m.warning_lead_s for m in (a, b)]
    added = [m.added_decel_mps2 for m in (a, b) if m.added_decel_mps2 is not None]
    return Measurement(
        max(a.impact_speed_kmh, b.impact_speed_kmh),
        None if None in warnings else min(w for w in warnings if w is not None),
        min(reductions, default=None),
        a.invalid or b.invalid,
        a.false_activation or b.false_activation,
        None if None in leads else min(lead for lead in leads if lead is not None),
        max(added, default=None),
    )


def _nearest(run: _Run, grid: Mapping[tuple[str, float], list[Cell]]) -> str:
    """What the grid has instead of a cell that it lacks."""
    speeds = sorted({speed for scenario, speed in grid if scenario == run.scenario})
    if not speeds:
        names = ", ".join(sorted({scenario for scenario, _ in grid}))
        return f"the protocol has no scenario {run.scenario!r}; it has: {names}"
    if run.speed_kmh not in speeds:
        return f"the protocol tests {run.scenario} at {', '.join(f'{v:g}' for v in speeds)} km/h"
    some = "; ".join(map(str, grid[run.scenario, run.speed_kmh][:6]))
    return f"the protocol's cells there are: {some}"
