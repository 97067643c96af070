"""Every cell of a protocol's grid, run from scenario files or the shipped scenarios, scored and drawn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from evaluation.protocols.assessment import Assessment, Protocol
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.from_file import TableProtocol, worst_cell
from evaluation.protocols.grid import Cell
from evaluation.protocols.paper import PaperProtocol
from evaluation.protocols.registry import is_file, named_protocol
from evaluation.protocols.sheet import Sheet, make_sheet
from evaluation.protocols.table import TOUCHED_KMH, measurements
from evaluation.results.files import LOGS_FOLDER, write_bytes
from evaluation.results.gates import RUN_MEASURES, Side, sides_of_runs
from evaluation.results.notes import told_notes, told_runs
from evaluation.results.rows import RunRow, write_runs
from evaluation.runs.configuration import configuration_of
from evaluation.runs.conflict import Conflict, conflicts, unbraked
from evaluation.runs.execution import RunRecord
from evaluation.runs.logged import logged_runs
from evaluation.runs.specs import Conditions, perception_notes
from evaluation.runs.workers import Workers, told_workers
from evaluation.studies.ncap.cell_table import CELLS_CSV, cell_table, told_invalid
from evaluation.studies.ncap.grid import (
    Grid,
    GridRun,
    grid_of_files,
    grid_of_shipped,
    grid_of_table,
    has_shipped,
    scenario_files,
)
from evaluation.studies.ncap.validity import why_invalid, why_invalid_by_table
from scenarios.settings import settings_text
from scenarios.spec import RunSpec

if TYPE_CHECKING:
    from rich.console import Console

WARNING_NOTE = (
    "The system gives no warning of its own: in warning tests (FCW) the first request of the emergency brake "
    "counts as one."
)
NO_ROBUSTNESS_NOTE = "Robustness was left out as asked (--no-robustness), and has no points."
SPEED_NOTE = "The ego holds the test speed until the emergency brake acts, as the protocols want: no ACC."


def protocol_for(name: str, weather: Sequence[str]) -> Protocol:
    """A protocol by its name; the paper's has a column per weather.

    Raises:
        ProtocolError: there is none of that name, or several weathers for one that has no place for them.
    """
    if name == "paper":
        return PaperProtocol(tuple(weather))
    if len(weather) > 1:
        raise ProtocolError(f"protocol {name} has no weather: give one --weather, not {', '.join(weather)}")
    return named_protocol(name)


def specs_of(grid: Grid, conditions: Conditions, protocol_name: str) -> list[tuple[GridRun, RunSpec]]:
    """The runs in all conditions, strategy by strategy."""
    paired = []
    for strategy in conditions.strategies:
        for run in grid.runs:
            columns = dict(run.label)
            weather = str(columns["condition"]) if protocol_name == "paper" else conditions.weather[0]
            single = replace(conditions, strategies=(strategy,), weather=(weather,))
            (spec,) = single.specs([run.spec])
            paired.append((run, spec))
    return paired


def assess(
    protocol: Protocol,
    finished: Iterable[tuple[GridRun, RunRecord]],
    known: Mapping[RunSpec, Conflict] | None = None,
) -> dict[str, Assessment]:
    """Score finished runs, per strategy.

    Args:
        protocol: its rules.
        finished: runs of its grid, and what came out.
        known: what comes to pass without braking, as `conflicts` gives it; None: it is found out here.

    Raises:
        ProtocolError: a run belongs to no cell.
    """
    by_strategy: dict[str, list[tuple[GridRun, RunRecord]]] = {}
    for run, record in finished:
        by_strategy.setdefault(record.spec.strategy, []).append((run, record))
    if known is None:
        known = conflicts(record.spec for runs in by_strategy.values() for _, record in runs)
    cells, overlaps = protocol.all_cells, isinstance(protocol, EuroNcap2023)
    assessments = {}
    for name, runs in by_strategy.items():
        of_strategy = [known[unbraked(record.spec)] for _, record in runs]
        table = [
            dict(run.label) | _outcome(record, conflict)
            for (run, record), conflict in zip(runs, of_strategy, strict=True)
        ]

        if isinstance(protocol, TableProtocol):
            for columns, (_, record) in zip(table, runs, strict=True):
                if record.row.collided:  # also with an ego that stands
                    columns["v_impact_kmh"] = max(record.row.v_impact_kmh or 0.0, TOUCHED_KMH)

        def reason(index: int, cell: Cell, of_strategy: Sequence[Conflict] = of_strategy) -> str:
            if isinstance(protocol, TableProtocol):
                return why_invalid_by_table(*protocol.asked(cell), of_strategy[index])
            return why_invalid(cell, of_strategy[index], overlaps)

        assessments[name] = protocol.assess(measurements(table, cells, reason))
    return assessments


def _outcome(record: RunRecord, conflict: Conflict) -> dict[str, object]:
    """What a run came to, as columns for `measurements`."""
    row, touch = record.row, conflict.touch
    impact_kmh = row.v_impact_kmh or 0.0  # one that was cut off is scored by its end reason
    unbraked_kmh = row.v_test_kmh if touch is None else abs(touch.ego_speed_kmh)
    return {
        "v_impact_kmh": impact_kmh,
        "target_speed_at_contact_kmh": row.target_speed_at_contact_kmh,
        "warning_ttc_s": record.warning_ttc_s,
        "speed_reduction_kmh": unbraked_kmh - (impact_kmh if row.collided else record.slowest_kmh),
        "end_reason": row.end_reason,
        "false_activation": row.false_activation,
        "warning_lead_s": record.warning_lead_s,
        "added_decel_mps2": record.added_decel_mps2,
    }


def run_grid(
    paths: Sequence[str],
    name: str,
    conditions: Conditions,
    out: Path,
    workers: Workers,
    console: Console,
    keep_logs: bool = False,
    form: str = "png",
    robustness: bool = True,
) -> list[Side]:
    """Run a protocol's grid behind a progress bar, write its files, print its matrices.

    Args:
        paths: folders and files; none: the shipped scenarios.
        name: of the protocol.
        conditions: strategies, preset, weather, night and so on.
        out: folder for everything.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        console: where to print.
        keep_logs: whether to write the log of every run, for `report` and `replay`.
        form: of the picture: png, svg or pdf.
        robustness: whether to run the cells under robustness conditions too (2026).

    Returns:
        What each strategy came to, with `NCAP_MEASURES`.
    """
    import rich.progress

    from evaluation.views.matrix.matrix import matrix_view

    protocol = protocol_for(name, conditions.weather)
    if isinstance(protocol, TableProtocol):
        if paths:
            raise ProtocolError(f"protocol {name} has scenarios of its own: leave out {paths[0]}")
        grid = grid_of_table(protocol)
    elif has_shipped(protocol, paths):  # by their names: the protocol's own cells of these tests
        grid = grid_of_shipped(protocol, name, robustness, paths)
    elif paths:
        grid = grid_of_files(scenario_files(paths), protocol, robustness)
    else:
        grid = grid_of_shipped(protocol, name, robustness)
    paired = specs_of(grid, conditions, name)
    specs = [spec for _, spec in paired]
    notes = perception_notes(specs)
    configuration = configuration_of(specs, out, notes)  # files as they are before the first run
    with rich.progress.Progress(console=console, transient=True, disable=console.quiet) as progress:
        total = len(specs) + len(set(map(unbraked, specs)))
        task = progress.add_task(f"running on {told_workers(workers)}", total=total)
        known = conflicts(specs, workers, lambda: progress.advance(task))
        records = logged_runs(specs, out, workers, lambda: progress.advance(task), keep_logs)
        finished = [(run, record) for (run, _), record in zip(paired, records, strict=True)]
    write_runs(out, [record.row for _, record in finished], configuration)
    assessments = assess(protocol, finished, known)
    cells_csv = out / CELLS_CSV
    write_bytes(cells_csv, cell_table(assessments))
    sheet = make_sheet(assessments, ())
    left_out: tuple[str, ...] = (NO_ROBUSTNESS_NOTE,) if name == "2026" and not robustness else ()
    noted = told_notes([record.notes for _, record in finished])
    if isinstance(protocol, TableProtocol):
        left_out = table_notes(protocol, assessments)
    sheet = replace(sheet, notes=(*_notes(grid, specs, name, notes), *noted, *left_out, *sheet.notes))
    console.print(matrix_view(sheet))
    written = [path.name for path in (cells_csv, *_draw(sheet, out, name, form), *_left_out(grid, out))]
    written += [f"{LOGS_FOLDER}/"] if keep_logs else []
    hits = [record.row for _, record in finished if record.row.collided]
    if hits:
        console.print(_how_to_see(max(hits, key=lambda row: row.v_impact_kmh or 0.0), out), soft_wrap=True)
    for line in told_runs([record.row for _, record in finished]):
        console.print(line, highlight=False, soft_wrap=True)
    done_line = f"{len(specs)} runs in {out}: runs.csv, runs.json, {', '.join(written)}"
    console.print(". ".join(filter(None, (done_line, told_invalid(assessments)))), soft_wrap=True)
    sides = sides_of_runs([(record.row, record.criteria) for _, record in finished])
    return [_with_assessment(side, assessments[side.name]) for side in sides]


NCAP_MEASURES = (*RUN_MEASURES, "cells_invalid", "requirements_failed")
"""Of a strategy; `score` and `score_percent` are of the protocol's last total, that of all scenarios."""


def _with_assessment(side: Side, assessment: Assessment) -> Side:
    """A strategy's runs with what the protocol gives them."""
    total = assessment.totals[-1] if assessment.totals else None
    failed = [gate.name for gate in assessment.gates if gate.passed is False]
    invalid = [
        str(cell)
        for block in assessment.blocks
        for cell, score in block.scores.items()
        if score.measurement is not None and score.measurement.invalid
    ]
    values = {
        "score": None if total is None else total.won,
        "score_percent": None if total is None or not total.most else 100 * total.won / total.most,
        "cells_invalid": len(invalid),
        "requirements_failed": len(failed),
    }
    runs = {"cells_invalid": invalid, "requirements_failed": failed}
    return replace(side, values={**side.values, **values}, runs={**side.runs, **runs})


def _how_to_see(row: RunRow, out: Path) -> str:
    """A run in words, and the command that films it."""
    how = f"smartmot-eval replay {out / row.log}" if row.log else "give --logs, which keeps all runs"
    what = f"{row.scenario}, {row.strategy}, {row.v_test_kmh:g} km/h, contact at {row.v_impact_kmh:.1f} km/h"
    return f"Fastest contact: {what}. To see it: {how}"


def table_notes(protocol: TableProtocol, assessments: Mapping[str, Assessment]) -> tuple[str, ...]:
    """Source and worst cell of a protocol's file, and whether nobody was warned."""
    lines = [f"Worst cell, {name}: {worst_cell(assessment)}." for name, assessment in assessments.items()]
    leads = [
        score.measurement.warning_lead_s
        for assessment in assessments.values()
        for block in assessment.blocks
        for score in block.scores.values()
        if score.measurement is not None
    ]
    if any(test.rule.warning for test in protocol.table.tests) and all(lead is None for lead in leads):
        lines.append("No run has a warning: the brake rule may give none. Rules that warn: --rule cascade.")
    return (*lines, f"Source: {protocol.table.source}.")


LEFT_OUT = "left_out.txt"


def _left_out(grid: Grid, out: Path) -> list[Path]:
    """Write which runs belong to no cell, one a line; nothing if all do."""
    if not grid.strange:
        return []
    path = out / LEFT_OUT
    lines = "".join(f"{run.reason}\n" for run in grid.strange)
    write_bytes(path, lines.encode())
    return [path]


def _notes(grid: Grid, specs: Sequence[RunSpec], name: str, perception: Sequence[str]) -> list[str]:
    lines = []
    own = sum("layer" not in dict(run.label) for run in grid.runs)
    if grid.asked > own + len(grid.strange):
        lines.append(f"The files ask for {grid.asked} runs; equal ones are run once.")
    if grid.strange:
        counts = Counter(run.scenario for run in grid.strange)
        listed = ", ".join(f"{scenario} {count}" for scenario, count in counts.items())
        lines.append(f"Runs that belong to no cell and are left out (all in {LEFT_OUT}): {listed}.")
    if grid.undriven:
        listed = "; ".join(f"{change} ({', '.join(names)})" for change, names in grid.undriven.items())
        lines.append(
            f"Robustness, not run and without points, because the scenarios have no parameter for it: "
            f"{listed}."
        )
    if specs[0].settings:
        lines.append(f"Other than in the preset: {settings_text(specs[0].settings)}.")
    if name != "paper":
        lines.append(SPEED_NOTE)
    if any(" FCW" in spec.scenario for spec in specs):
        lines.append(WARNING_NOTE)
    return lines + [f"{line[0].upper()}{line[1:]}." for line in perception]


def _draw(sheet: Sheet, out: Path, name: str, form: str) -> list[Path]:
    from evaluation.views.matrix.html import matrix_page
    from evaluation.views.matrix.png import matrix_figure
    from evaluation.views.pictures import save_picture

    stem = Path(name).stem if is_file(name) else name
    picture, page = out / f"matrix_{stem}.{form}", out / f"matrix_{stem}.html"
    save_picture(matrix_figure(sheet), picture, "--out")
    write_bytes(page, matrix_page(sheet).encode())
    return [picture, page]
