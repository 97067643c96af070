"""A protocol as a file: tests with their cells, what passes, and sources; docs/protocols.md.

Every fault of a file is one `ProtocolError` with the file and the key.
"""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Lighting
from scenarios.catalogue.library import SHIPPED_SCENARIOS
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.reading import ReadError, read_text, shown
from scenarios.simulation.driver import DriverBrake

WIDEST_M = 2.55
"""No vehicle is wider (Directive 96/53/EC, Annex I): a place within more is checked by nothing."""

MOST_MPS2 = 20.0
"""Of a driver: twice what tires hold on dry asphalt; more is another unit."""

MAX_CELLS = 2000
"""Of one protocol: as many are a run of an hour, more are a mistake."""
MAX_NAME = 60
"""Characters of the name of a test or a column; more do not fit into a picture."""
SPEED_PARAMETER = "Ego_speed_kmh"
"""Parameter of the shipped scenarios that holds the test speed."""


class Warned(StrEnum):
    """When the driver must be warned."""

    GIVEN = "given"
    BEFORE_BRAKING = "before_braking"


@dataclass(frozen=True, slots=True)
class PassRule:
    """What a run must reach; None: it is not asked for.

    Args:
        impact_at_most_kmh: fastest impact allowed, per test speed; 0: no contact.
        warning: when the driver must be warned.
        added_decel_below_mps2: the emergency brake must stay below this beyond what the driver brakes.
    """

    impact_at_most_kmh: tuple[float, ...] | None
    warning: Warned | None
    added_decel_below_mps2: float | None


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a test's matrix.

    Args:
        label: what stands above it; empty if it is the only one.
        parameters: of the scenario, beside those of the test.
        driver: who brakes as well.
        place_percent: see `TableTest`.
    """

    label: str
    parameters: Mapping[str, Value]
    driver: DriverBrake | None
    place_percent: float | None


@dataclass(frozen=True, slots=True)
class TableTest:
    """One test: a matrix of test speeds by columns.

    Args:
        name: of the matrix.
        source: of its numbers.
        scenario: name of a shipped scenario, or path of a file.
        speeds_kmh: test speeds.
        speed_parameter: parameter of the scenario that holds them.
        parameters: of the scenario, for all cells.
        columns: at least one.
        lighting: day or night.
        meets: whether the ego meets the target without braking; else it must touch nobody.
        relative_impact: whether the impact speed is relative to a target that goes along.
        to_standstill: whether the run goes on until the ego stands, also once it is as slow as the target.
        place_tolerance_m: how far beside its place the target may be met; None: the place is not checked.
            The place is where on the ego's width it is met, 0 % the right edge, 100 % the left edge.
        rule: what passes.
    """

    name: str
    source: str
    scenario: str
    speeds_kmh: tuple[float, ...]
    speed_parameter: str
    parameters: Mapping[str, Value]
    columns: tuple[Column, ...]
    lighting: Lighting
    meets: bool
    relative_impact: bool
    to_standstill: bool
    place_tolerance_m: float | None
    rule: PassRule


@dataclass(frozen=True, slots=True)
class ProtocolTable:
    """What a file holds.

    Args:
        file: it.
        title: name and edition.
        source: of the rules.
        left_out: what the protocol has and the file has not, one sentence each.
        tests: in the order of the file.
    """

    file: Path
    title: str
    source: str
    left_out: tuple[str, ...]
    tests: tuple[TableTest, ...]


def read_protocol(file: Path) -> ProtocolTable:
    """Read and check a protocol.

    Raises:
        ProtocolError: it cannot be read, or a value is missing, unknown, of another kind or out of range.
    """
    try:
        content = tomllib.loads(read_text(file))
    except (ReadError, tomllib.TOMLDecodeError) as error:
        raise ProtocolError(f"{file}: {error}") from None
    except (RecursionError, ValueError) as error:  # nested without end; numbers of too many digits
        raise ProtocolError(f"{file}: not TOML that can be read ({type(error).__name__})") from None
    top = _Table(file, "", content)
    top.allow("title", "source", "left_out", "drivers", "tests")
    title, source = top.text("title"), top.text("source")
    left_out = tuple(top.texts("left_out"))
    drivers = {name: _driver(top.table("drivers").table(name)) for name in top.table("drivers").content}
    tests = [_test(table, drivers) for table in top.tables("tests")]
    if not tests:
        top.refuse("tests", "there is none; write at least one [[tests]]")
    named = {
        each.content.get("driver")
        for table in top.tables("tests")
        for each in (table, *table.tables("columns"))
    }
    for name in drivers:
        if name not in named:
            top.table("drivers").refuse(name, "no test has this driver")
    _require_unique(top, "tests", [test.name for test in tests])
    cells = sum(len(test.speeds_kmh) * len(test.columns) for test in tests)
    if cells > MAX_CELLS:
        top.refuse("tests", f"{cells} cells; at most {MAX_CELLS} are run")
    return ProtocolTable(file, title, source, left_out, tuple(tests))


class _Table:
    """A table of a file, which is asked for what it must hold."""

    def __init__(self, file: Path, where: str, content: Mapping[str, Any]) -> None:
        self.file, self.where, self.content = file, where, content

    def refuse(self, key: str, why: str) -> None:
        """Raise what is wrong with a key."""
        raise ProtocolError(f"{self.file}: {self._at(key)}: {why}")

    def _at(self, key: str) -> str:
        named = shown(key) if not key or any(c.isspace() or not c.isprintable() for c in key) else key
        return f"{self.where}.{named}" if self.where else named

    def allow(self, *keys: str) -> None:
        """Refuse any other key."""
        for key in self.content:
            if key not in keys:
                self.refuse(key, f"unknown; there are: {', '.join(keys)}")

    def has(self, key: str) -> bool:
        """Whether a key is there."""
        return key in self.content

    def value(self, key: str) -> Any:
        """What must be there."""
        if key not in self.content:
            self.refuse(key, "missing")
        return self.content[key]

    def table(self, key: str) -> _Table:
        """A table; an empty one if it is not there."""
        value = self.content.get(key, {})
        if not isinstance(value, Mapping):
            self.refuse(key, f"must be a table, got {shown(value)}")
        return _Table(self.file, self._at(key), value)

    def tables(self, key: str) -> list[_Table]:
        """A list of tables; an empty one if it is not there."""
        value = self.content.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, Mapping) for item in value):
            self.refuse(key, f"must be a list of tables, got {shown(value)}")
        return [_Table(self.file, f"{self._at(key)}[{k}]", item) for k, item in enumerate(value, 1)]

    def text(self, key: str, default: str | None = None) -> str:
        """One line of text that is not empty, unless the default is."""
        value = self.value(key) if default is None else self.content.get(key, default)
        if not isinstance(value, str) or (not value.strip() and default != value):
            self.refuse(key, f"must be a text, got {shown(value)}")
        if not value.isprintable():
            self.refuse(key, f"must be one line of printable characters, got {shown(value)}")
        return str(value)

    def name(self, key: str) -> str:
        """A text that stands in tables and pictures."""
        text = self.text(key)
        if len(text) > MAX_NAME:
            self.refuse(key, f"{len(text)} characters; at most {MAX_NAME} fit into a picture")
        return text

    def texts(self, key: str) -> list[str]:
        """A list of texts; an empty one if it is not there."""
        value = self.content.get(key, [])
        if not isinstance(value, list):
            self.refuse(key, f"must be a list of texts, got {shown(value)}")
        return [_Table(self.file, self._at(key), {str(k): v}).text(str(k)) for k, v in enumerate(value, 1)]

    def choice(self, key: str, choices: Collection[str], default: str) -> str:
        """One of several words."""
        value = self.content.get(key, default)
        if not isinstance(value, str) or value not in choices:
            self.refuse(key, f"unknown {shown(value)}; use one of: {', '.join(choices)}")
        return str(value)

    def truth(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            self.refuse(key, f"must be true or false, got {shown(value)}")
        return bool(value)

    def number(self, key: str, low: float = 0.0, high: float = math.inf) -> float | None:
        """A finite number within limits; None if it is not there."""
        return self._number(key, self.content[key], low, high) if key in self.content else None

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of finite numbers that are not negative."""
        value = self.value(key)
        if not isinstance(value, list) or not value:
            self.refuse(key, f"must be a list of numbers, got {shown(value)}")
        return tuple(self._number(f"{key}[{k}]", v, 0.0, math.inf) for k, v in enumerate(value, 1))

    def _number(self, key: str, value: object, low: float, high: float) -> float:
        try:
            number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if isinstance(value, str) or not (math.isfinite(number) and low <= number <= high):
            limits = f"from {low:g}" if math.isinf(high) else f"from {low:g} to {high:g}"
            self.refuse(key, f"must be a number {limits}, got {shown(value)}")
        return number

    def parameters(self, key: str) -> dict[str, Value]:
        """Values of a scenario's parameters by name."""
        table = self.table(key)
        for name, value in table.content.items():
            if not isinstance(value, (bool, str)) and not (
                isinstance(value, (int, float)) and abs(value) <= sys.float_info.max
            ):
                table.refuse(name, f"must be a number, a text or a truth value, got {shown(value)}")
        return dict(table.content)


def _require_unique(table: _Table, key: str, values: Sequence[object]) -> None:
    twice = next((value for k, value in enumerate(values) if value in values[:k]), None)
    if twice is not None:
        table.refuse(key, f"{shown(twice)} is there twice")


def _driver(table: _Table) -> DriverBrake:
    table.allow("decel_mps2", "ramp_s", "after_warning_s", "at_ttc_s", "source")
    table.text("source")
    for key in ("decel_mps2", "ramp_s"):
        table.value(key)
    try:
        return DriverBrake(
            table.number("decel_mps2", 0.0, MOST_MPS2) or 0.0,
            table.number("ramp_s") or 0.0,
            table.number("after_warning_s"),
            table.number("at_ttc_s"),
        )
    except ScenarioError as error:
        raise ProtocolError(f"{table.file}: {table.where}: {error}") from None


_TEST_KEYS = (
    *("name", "source", "scenario", "speeds_kmh", "speed_parameter", "parameters", "columns", "driver"),
    *("lighting", "meets", "relative_impact", "to_standstill", "place_percent", "place_tolerance_m", "pass"),
)


def _test(table: _Table, drivers: Mapping[str, DriverBrake]) -> TableTest:
    table.allow(*_TEST_KEYS)
    name, speeds = table.name("name"), table.numbers("speeds_kmh")
    _require_unique(table, "speeds_kmh", speeds)
    if min(speeds) <= 0.0:
        table.refuse("speeds_kmh", "a test speed must be positive")
    parameters, parameter = table.parameters("parameters"), table.text("speed_parameter", SPEED_PARAMETER)
    if table.has("columns") and not table.tables("columns"):
        table.refuse("columns", "empty; write at least one, or leave it out")
    columns = tuple(_column(each, table, drivers) for each in table.tables("columns")) or (
        Column("", {}, _named_driver(table, drivers, None), table.number("place_percent", 0.0, 100.0)),
    )
    _require_unique(table, "columns", [column.label for column in columns])
    for given in (parameters, *(column.parameters for column in columns)):
        if parameter in given:
            table.refuse("parameters", f"{parameter} is the test speed; write it in speeds_kmh")
    tolerance_m = table.number("place_tolerance_m", 0.0, WIDEST_M)
    if tolerance_m is not None and any(column.place_percent is None for column in columns):
        table.refuse("place_percent", "missing, though there is a place_tolerance_m")
    if tolerance_m is None and any(column.place_percent is not None for column in columns):
        table.refuse("place_tolerance_m", "missing, though there is a place_percent")
    meets = table.truth("meets", True)
    for key in ("place_tolerance_m", "relative_impact"):
        if not meets and table.content.get(key):
            table.refuse(key, "has no effect where meets is false: nothing is met")
    return TableTest(
        name=name,
        source=table.text("source"),
        scenario=_scenario(table),
        speeds_kmh=speeds,
        speed_parameter=parameter,
        parameters=parameters,
        columns=columns,
        lighting=Lighting(table.choice("lighting", tuple(Lighting), Lighting.DAY)),
        meets=meets,
        relative_impact=table.truth("relative_impact", False),
        to_standstill=table.truth("to_standstill", False),
        place_tolerance_m=tolerance_m,
        rule=_rule(table, speeds),
    )


def _scenario(table: _Table) -> str:
    """Name of a shipped scenario, or path of a file beside the protocol's."""
    text = table.text("scenario")
    if text in SHIPPED_SCENARIOS:
        return text
    path = table.file.parent / text
    try:
        there = path.is_file()
    except OSError:  # a name that is too long
        there = False
    if not there:
        table.refuse("scenario", f"{path} is no file, and no shipped scenario: smartmot-eval list")
    return str(path)


def _named_driver(
    table: _Table, drivers: Mapping[str, DriverBrake], default: DriverBrake | None
) -> DriverBrake | None:
    if not table.has("driver"):
        return default
    name = table.text("driver")
    if name not in drivers:
        known = ", ".join(drivers) or "none; write a table [drivers.NAME]"
        table.refuse("driver", f"unknown {shown(name)}; there are: {known}")
    return drivers[name]


def _column(table: _Table, test: _Table, drivers: Mapping[str, DriverBrake]) -> Column:
    table.allow("label", "parameters", "driver", "place_percent")
    place = table if table.has("place_percent") else test
    return Column(
        table.name("label"),
        table.parameters("parameters"),
        _named_driver(table, drivers, _named_driver(test, drivers, None)),
        place.number("place_percent", 0.0, 100.0),
    )


def _rule(test: _Table, speeds: Sequence[float]) -> PassRule:
    test.value("pass")
    table = test.table("pass")
    table.allow("impact_at_most_kmh", "warning", "added_decel_below_mps2")
    if not table.content:
        test.refuse("pass", "empty; write what a run must reach")
    impacts: tuple[float, ...] | None = None
    if isinstance(table.content.get("impact_at_most_kmh"), list):
        impacts = table.numbers("impact_at_most_kmh")
        if len(impacts) != len(speeds):
            table.refuse("impact_at_most_kmh", f"{len(impacts)} limits for {len(speeds)} test speeds")
    elif table.has("impact_at_most_kmh"):
        impacts = (table.number("impact_at_most_kmh") or 0.0,) * len(speeds)
    for limit, speed in zip(impacts or (), speeds, strict=False):
        if limit >= speed:
            table.refuse("impact_at_most_kmh", f"{limit:g} passes whatever happens at {speed:g} km/h")
    warning = Warned(table.choice("warning", tuple(Warned), "")) if table.has("warning") else None
    added = table.number("added_decel_below_mps2")
    if added == 0.0:
        table.refuse("added_decel_below_mps2", "0 never passes: the deceleration must be below it")
    return PassRule(impacts, warning, added)
