"""What is run for a protocol: its cells from scenario files or from the shipped scenarios."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.protocols.assessment import Protocol
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.from_file import TableProtocol
from evaluation.protocols.grid import Cell, Function, Lighting
from evaluation.protocols.paper import PaperProtocol
from evaluation.protocols.robustness import Quantity
from evaluation.protocols.table import measurements
from evaluation.protocols.unece_r152 import R152
from evaluation.runs.specs import bare_run
from evaluation.studies.ncap.cells import cell_columns, changed_run, shipped_run, shipped_test
from evaluation.studies.study import LabelledRun
from scenarios.catalogue.library import scenario_name, scenario_path, shipped_scenario
from scenarios.openscenario.errors import OpenScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.distributions import Variation, expand
from scenarios.openscenario.reading.reader import load
from scenarios.spec import initial_speed_kmh
from scenarios.weather import is_night

_CPLA_FCW_2026_STEADY_M = 18.0
"""Steady distance of CPLA FCW in Euro NCAP 2026; 10 m in 2023 (Vector's files of both)."""


SAME_KMH = 1e-3
"""A speed in km/h that a file gives in m/s with rounding is still that speed."""


GridRun = LabelledRun[tuple[tuple[str, object], ...]]
"""A run of a grid, and the columns that tell its cell, see `cells.cell_columns`; it has no conditions yet."""


@dataclass(frozen=True, slots=True)
class Strange:
    """A run that belongs to no cell of the protocol, and is left out.

    Args:
        scenario: what it is.
        reason: where it is from, and what the protocol has instead.
    """

    scenario: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """What is run for a protocol.

    Args:
        runs: different runs.
        asked: how many the files ask for, equal ones included.
        strange: what is left out.
        undriven: robustness conditions for which scenarios have no parameter, with the names of these.
    """

    runs: tuple[GridRun, ...]
    asked: int
    strange: tuple[Strange, ...] = ()
    undriven: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class _Planned:
    """A run with its cells.

    Args:
        columns: what tells its cells, see `cells.cell_columns`.
        variation: the run.
        values: its final parameters.
        cells: that it belongs to.
    """

    columns: dict[str, object]
    variation: Variation
    values: Mapping[str, Value]
    cells: tuple[Cell, ...]


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


def grid_of_files(files: Sequence[Path], protocol: Protocol, robustness: bool = True) -> Grid:
    """The runs that files ask for, one that several files ask for once, and what the protocol adds to them.

    Args:
        files: scenarios and distributions.
        protocol: its grid.
        robustness: whether to add the runs under robustness conditions.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: a file cannot be read.
        ProtocolError: no run belongs to the protocol.
    """
    cells = protocol.cells()
    planned: dict[tuple[object, ...], _Planned] = {}
    strange: list[Strange] = []
    asked = 0
    for file in files:
        for variation in expand(file):
            asked += 1
            definition = load(variation.path, variation.parameters)
            columns = cell_columns(variation, file, definition, isinstance(protocol, EuroNcap2023))
            if isinstance(protocol, R152):  # it has no tests of the warning alone
                columns["function"] = str(Function.AEB)
            try:
                own = measurements([columns | {"v_impact_kmh": 0.0}], cells)
            except ProtocolError as error:
                strange.append(Strange(str(columns["scenario"]), f"{file.name}: {error}"))
                continue
            values = definition.parameters
            same = (variation.path, *sorted((k, str(v)) for k, v in values.items()), *columns)
            planned.setdefault(same, _Planned(columns, variation, values, tuple(own)))
    if not planned:
        reason = strange[0].reason if strange else "no files"
        more = f" (and {len(strange) - 1} more runs)" if len(strange) > 1 else ""
        raise ProtocolError(
            f"no scenario belongs to the protocol: {reason}{more}; without files the shipped ones are run"
        )
    return _grid(tuple(planned.values()), protocol, asked, tuple(strange), robustness)


def has_shipped(protocol: Protocol, tests: Sequence[str]) -> bool:
    """Whether all of these are names of shipped tests, and the protocol has cells for each."""
    return bool(tests) and set(tests) <= {shipped_test(cell) for cell in protocol.cells()} - {None}


def grid_of_shipped(
    protocol: Protocol, name: str, robustness: bool = True, tests: Sequence[str] = ()
) -> Grid:
    """The runs of the cells for which a scenario is shipped, and what the protocol adds to them.

    Args:
        protocol: its grid.
        name: of the protocol.
        robustness: see `grid_of_files`.
        tests: names of shipped tests; none: all of them.
    """
    planned = []
    for cell in protocol.cells():
        if tests and shipped_test(cell) not in tests:
            continue
        if isinstance(protocol, PaperProtocol):
            values: dict[str, Value] = {"Ego_speed_kmh": cell.speed_kmh}
            variation: Variation | None = Variation("cpna_paper", shipped_scenario("cpna_paper"), values)
        else:
            warned = name == "2026" and (cell.scenario, cell.function) == ("CPLA", Function.FCW)
            variation = shipped_run(cell, _CPLA_FCW_2026_STEADY_M if warned else None)
        if variation is not None:
            final = load(variation.path, variation.parameters).parameters
            planned.append(_Planned(_columns_of(cell), variation, final, (cell,)))
    return _grid(planned, protocol, len(planned), (), robustness)


def grid_of_table(protocol: TableProtocol) -> Grid:
    """The runs of a protocol's file, one per cell.

    Raises:
        ProtocolError: a scenario of it cannot be read, or is not what the file says.
    """
    runs: list[GridRun] = []
    logs: dict[str, Cell] = {}
    for number, test in enumerate(protocol.table.tests, 1):
        path = scenario_path(test.scenario)
        for cell in protocol.cells(test.name):
            _, column = protocol.asked(cell)
            values: dict[str, Value] = {
                **test.parameters, **column.parameters, test.speed_parameter: cell.speed_kmh
            }  # fmt: skip
            where = f"{protocol.table.file}: tests[{number}], {test.name}, {cell.speed_kmh:g} km/h"
            try:
                definition = load(path, values)
                speed_kmh = initial_speed_kmh(definition)
            except OpenScenarioError as error:
                raise ProtocolError(f"{where}: {error}") from None
            if abs(speed_kmh - cell.speed_kmh) > SAME_KMH:
                raise ProtocolError(
                    f"{where}: speed_parameter: with {test.speed_parameter} the ego drives {speed_kmh:g} km/h"
                )
            if is_night(definition) != (test.lighting is Lighting.NIGHT):
                light = Lighting.NIGHT if is_night(definition) else Lighting.DAY
                raise ProtocolError(f"{where}: lighting: the scenario is by {light}")
            words = " ".join(filter(None, (test.name, column.label)))
            spec = bare_run(scenario_name(path), values, words, cell.speed_kmh)
            spec = replace(spec, driver=column.driver, to_standstill=test.to_standstill)
            columns = _columns_of(cell) | ({"relative_impact": True} if test.relative_impact else {})
            if logs.setdefault(spec.log, cell) is not cell:
                raise ProtocolError(
                    f"{where}: name: the log would be called as that of {logs[spec.log]}; change a word"
                )
            runs.append(LabelledRun(spec, tuple(columns.items())))
    return Grid(tuple(runs), len(runs))


def _grid(
    planned: Sequence[_Planned],
    protocol: Protocol,
    asked: int,
    strange: tuple[Strange, ...],
    robustness: bool,
) -> Grid:
    runs = [_grid_run(base_run.columns, base_run.variation) for base_run in planned]
    undriven: dict[str, dict[str, None]] = {}
    if isinstance(protocol, EuroNcap2026):
        runs += _requirements(planned, protocol)
        if robustness:
            runs += _conditions(planned, protocol, undriven)
    names = {change: tuple(scenarios) for change, scenarios in undriven.items()}
    return Grid(tuple(_named_apart(runs)), asked, strange, names)


def _named_apart(runs: Iterable[GridRun]) -> Iterator[GridRun]:
    """Runs of one cell, such as the two sides of a crossing, with a number in their names."""
    seen: Counter[tuple[str, float]] = Counter()
    for run in runs:
        spec = run.spec
        seen[spec.scenario, spec.v_test_kmh] += 1
        number = seen[spec.scenario, spec.v_test_kmh]
        yield run if number == 1 else replace(run, spec=replace(spec, scenario=f"{spec.scenario} ({number})"))


def _requirements(planned: Iterable[_Planned], protocol: EuroNcap2026) -> Iterator[GridRun]:
    """The runs that the general requirements add: the run of the same cell with a slower pedestrian."""
    for cell in protocol.requirement_cells():
        for base_run in planned:
            for base in base_run.cells:
                like = replace(cell, target_speed_kmh=base.target_speed_kmh, condition="", layer=base.layer)
                if base != like or cell.target_speed_kmh is None or base.target_speed_kmh is None:
                    continue
                slower = cell.target_speed_kmh - base.target_speed_kmh
                run = changed_run(base_run.variation, base_run.values, Quantity.TARGET_SPEED_KMH, slower)
                if run is not None:
                    yield _grid_run(_columns_of(cell), run)


def _conditions(
    planned: Iterable[_Planned], protocol: EuroNcap2026, undriven: dict[str, dict[str, None]]
) -> Iterator[GridRun]:
    """The runs under robustness conditions; notes the conditions that no parameter can bring about."""
    conditions = protocol.conditions()
    for base_run in planned:
        for base in base_run.cells:
            for condition, cell in conditions.get(base, ()):
                run = changed_run(base_run.variation, base_run.values, condition.quantity, condition.amount)
                if run is None:
                    undriven.setdefault(condition.change, {})[cell.scenario] = None
                else:
                    columns = {"condition": cell.condition, "layer": str(cell.layer)}
                    yield _grid_run(base_run.columns | columns, run)


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
    spec = bare_run(
        scenario_name(variation.path),
        variation.parameters,
        " ".join(words),
        float(str(columns["v_test_kmh"])),
        must="brake",  # no protocol here has tests that ask for no reaction
    )
    return LabelledRun(spec, tuple(columns.items()))
