"""Every cell of a protocol's grid, run from scenario files or the shipped scenarios, scored and drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from evaluation import results, runner
from evaluation.cells import cell_columns, shipped_run
from evaluation.errors import ArgumentError
from evaluation.protocols.assessment import Assessment, Protocol
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Cell, Function
from evaluation.protocols.paper import PaperProtocol
from evaluation.protocols.registry import named_protocol
from evaluation.protocols.sheet import Sheet, make_sheet
from evaluation.protocols.table import measurements
from evaluation.runner import Conditions
from evaluation.runs import RunRecord, RunSpec, execute_all
from scenarios.library import scenario_name, scenario_path, shipped_scenario
from scenarios.openscenario.distributions import Variation, expand
from scenarios.openscenario.reader import load

if TYPE_CHECKING:
    from rich.console import Console

_CPLA_FCW_2026_STEADY_M = 18.0
"""Steady distance of CPLA FCW in Euro NCAP 2026; 10 m in 2023 (Vector's files of both)."""

WARNING_NOTE = (
    "The system gives no warning of its own: in warning tests (FCW) the first request of the emergency brake "
    "counts as one."
)
SPEED_NOTE = "The ego holds the test speed until the emergency brake acts, as the protocols want: no ACC."


@dataclass(frozen=True, slots=True)
class GridRun:
    """A run of a grid.

    Args:
        columns: what tells its cell, see `cells.cell_columns`.
        spec: the run; strategy and conditions are filled in later.
    """

    columns: tuple[tuple[str, object], ...]
    spec: RunSpec


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """What is run for a protocol.

    Args:
        runs: different runs.
        asked: how many the files ask for, equal ones included.
        strange: runs that belong to no cell of the protocol, and are left out.
    """

    runs: tuple[GridRun, ...]
    asked: int
    strange: tuple[str, ...]


def scenario_files(paths: Iterable[str]) -> list[Path]:
    """Scenario files that are named, or that lie in a folder: there those with variations, if there are any.

    Raises:
        ArgumentError: a folder has none.
    """
    files: list[Path] = []
    for text in paths:
        path = scenario_path(text)
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted(p for p in path.rglob("*.xosc") if "Catalogs" not in p.parts)
        varied = [p for p in inside if "ParameterValueDistribution" in p.read_text(errors="replace")]
        if not inside:
            raise ArgumentError(f"{path}: no .xosc files in this folder; name a folder of scenarios")
        files += varied or inside
    return files


def grid_of_files(files: Sequence[Path], protocol: Protocol) -> Grid:
    """The runs that files ask for; one that several files ask for is run once.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: a file cannot be read.
        ProtocolError: no run belongs to the protocol.
    """
    cells = protocol.cells()
    runs: dict[tuple[object, ...], GridRun] = {}
    strange: dict[str, None] = {}
    asked = 0
    for file in files:
        for variation in expand(file):
            asked += 1
            definition = load(variation.path, variation.parameters)
            columns = cell_columns(variation, file, definition)
            try:
                measurements([columns | {"v_impact_kmh": 0.0}], cells)
            except ProtocolError as error:
                strange.setdefault(f"{file.name}: {error}")
                continue
            same = (variation.path, *sorted((k, str(v)) for k, v in definition.parameters.items()), *columns)
            runs.setdefault(same, _grid_run(columns, variation))
    if not runs:
        raise ProtocolError(f"no scenario belongs to the protocol: {next(iter(strange), 'no files')}")
    return Grid(tuple(runs.values()), asked, tuple(strange))


def grid_of_shipped(protocol: Protocol, name: str) -> Grid:
    """The runs of the cells for which a scenario is shipped.

    Args:
        protocol: its grid.
        name: of the protocol.
    """
    runs = []
    for cell in protocol.cells():
        if name == "paper":
            values = {"Ego_speed_kmh": cell.speed_kmh}
            variation: Variation | None = Variation("cpna_paper", shipped_scenario("cpna_paper"), values)
        else:
            warned = name == "2026" and (cell.scenario, cell.function) == ("CPLA", Function.FCW)
            variation = shipped_run(cell, _CPLA_FCW_2026_STEADY_M if warned else None)
        if variation is not None:
            runs.append(_grid_run(_columns_of(cell), variation))
    return Grid(tuple(runs), len(runs), ())


def _columns_of(cell: Cell) -> dict[str, object]:
    columns: dict[str, object] = {
        "scenario": cell.scenario,
        "v_test_kmh": cell.speed_kmh,
        "lighting": str(cell.lighting),
        "function": str(cell.function),
        "impact_location_percent": cell.impact_percent,
        "target_speed_kmh": cell.target_speed_kmh,
        "condition": cell.condition or None,
    }
    return {name: value for name, value in columns.items() if value is not None}


def _grid_run(columns: dict[str, object], variation: Variation) -> GridRun:
    words = [f"{columns['scenario']}"]
    if "impact_location_percent" in columns:
        words.append(f"{columns['impact_location_percent']:g}%")
    if columns["function"] == "FCW":
        words.append("FCW")
    words.append(str(columns["lighting"]))
    if "condition" in columns:
        words.append(str(columns["condition"]))
    spec = RunSpec(
        scenario=" ".join(words),
        file=scenario_name(variation.path),
        parameters=tuple(sorted(variation.parameters.items())),
        strategy="",
        preset="",
        weather="",
        v_test_kmh=float(str(columns["v_test_kmh"])),
    )
    return GridRun(tuple(columns.items()), spec)


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
            told = dict(run.columns)
            weather = str(told["condition"]) if protocol_name == "paper" else conditions.weather[0]
            one = replace(conditions, strategies=(strategy,), weather=(weather,))
            (spec,) = one.specs(run.spec)
            paired.append((run, spec))
    return paired


def assess(protocol: Protocol, finished: Iterable[tuple[GridRun, RunRecord]]) -> dict[str, Assessment]:
    """Score finished runs, per strategy.

    Raises:
        ProtocolError: a run belongs to no cell.
    """
    tables: dict[str, list[dict[str, object]]] = {}
    for run, record in finished:
        row = record.row
        told = dict(run.columns) | {
            "v_impact_kmh": row.v_impact_kmh,
            "target_speed_at_contact_kmh": row.target_speed_at_contact_kmh,
            "warning_ttc_s": record.flag_ttc_s,
        }
        tables.setdefault(record.spec.strategy, []).append(told)
    cells = protocol.cells()
    return {name: protocol.assess(measurements(table, cells)) for name, table in tables.items()}


def run_grid(
    paths: Sequence[str], name: str, conditions: Conditions, out: Path, workers: int, console: Console
) -> None:
    """Run a protocol's grid behind a progress bar, write its files, print its matrices.

    Args:
        paths: folders and files; none: the shipped scenarios.
        name: of the protocol.
        conditions: strategies, preset, weather, night and so on.
        out: folder for everything.
        workers: processes.
        console: where to print.
    """
    import rich.progress

    from evaluation.protocols.matrix import matrix_view

    protocol = protocol_for(name, conditions.weather)
    grid = grid_of_files(scenario_files(paths), protocol) if paths else grid_of_shipped(protocol, name)
    paired = specs_of(grid, conditions, name)
    specs = [spec for _, spec in paired]
    finished: list[tuple[GridRun, RunRecord]] = []
    with rich.progress.Progress(console=console, transient=True, disable=console.quiet) as progress:
        task = progress.add_task(f"running on {workers} processes", total=len(specs))
        for (run, _), record in zip(paired, execute_all(specs, workers, keep_log=False), strict=True):
            finished.append((run, record))
            progress.advance(task)
    results.write_runs(out, [record.row for _, record in finished], runner.scenario_configuration(specs))
    assessments = assess(protocol, finished)
    sheet = make_sheet(assessments, ())
    sheet = replace(sheet, notes=(*_notes(grid, specs, name), *sheet.notes))
    console.print(matrix_view(sheet))
    written = _draw(sheet, out, name)
    console.print(f"{len(specs)} runs in {out}: runs.csv, runs.json, {', '.join(p.name for p in written)}")


def _notes(grid: Grid, specs: Sequence[RunSpec], name: str) -> list[str]:
    lines = []
    if grid.asked > len(grid.runs) + len(grid.strange):
        lines.append(f"The files ask for {grid.asked} runs; equal ones are run once: {len(grid.runs)}.")
    if grid.strange:
        lines.append(
            f"{len(grid.strange)} runs belong to no cell and are left out, such as {grid.strange[0]}."
        )
    if name != "paper":
        lines.append(SPEED_NOTE)
    if any(" FCW" in spec.scenario for spec in specs):
        lines.append(WARNING_NOTE)
    return lines + [f"{line[0].upper()}{line[1:]}." for line in runner.notes(specs)]


def _draw(sheet: Sheet, out: Path, name: str) -> list[Path]:
    from evaluation.protocols.matrix_html import matrix_page
    from evaluation.protocols.matrix_png import matrix_figure

    picture, page = out / f"matrix_{name}.png", out / f"matrix_{name}.html"
    _written(picture, lambda: matrix_figure(sheet).savefig(picture, metadata={"Software": None}))
    _written(page, lambda: page.write_text(matrix_page(sheet), encoding="utf-8"))
    return [picture, page]


def _written(path: Path, write: Callable[[], object]) -> None:
    try:
        write()
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None
