"""The scenarios that are shipped with the package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenarios.catalogue.parameters import INTERNAL, MEANINGS
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.distributions import expand
from scenarios.openscenario.reading.document import Node, parse
from smartmot.errors import suggestion

DEFINITIONS = Path(__file__).parents[1] / "definitions"

SHIPPED_SCENARIOS = (
    "cpna_paper",
    "cpna",
    "cpfa",
    "cpnco",
    "cpla",
    "cpla_fcw",
    "cbna",
    "cbla",
    "cbla_fcw",
    "crossing",
    "crossing_obstructed",
    "ahead",
    "approach",
    "lead_braking",
    "steel_plate",
    "pass_through",
)
"""Tests first, then the scenarios that they are variations of."""


@dataclass(frozen=True, slots=True)
class ScenarioParameter:
    """What may be set in a scenario.

    Args:
        name: of the parameter.
        value: declared one, as the file has it; of a distribution that of its first run.
        kind: declared type: double, integer, string, boolean ...
        unit: of its values; empty for names, ratios and truth values, and where the file is not ours.
        text: what it is; empty where the file is not ours.
    """

    name: str
    value: str
    kind: str
    unit: str = ""
    text: str = ""

    def __str__(self) -> str:
        value = f"{self.name} = {self.value}{f' {self.unit}' if self.unit else ''}"
        return f"{value:<36}{self.text or self.kind}"


@dataclass(frozen=True, slots=True)
class ScenarioDescription:
    """What a file holds.

    Args:
        name: file name without ending.
        text: description from its header.
        runs: how many it asks for.
        parameters: what may be set; of the shipped ones without what follows from others (`INTERNAL`).
    """

    name: str
    text: str
    runs: int
    parameters: tuple[ScenarioParameter, ...]

    def __repr__(self) -> str:
        runs = f"{self.runs} run{'s' if self.runs > 1 else ''}"
        return "\n  ".join([f"{self.name} ({runs}): {self.text}", *map(str, self.parameters)])


def shipped_scenario(name: str) -> Path:
    """Path of a shipped scenario or distribution file.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in SHIPPED_SCENARIOS:
        close = suggestion(name, SHIPPED_SCENARIOS)
        raise ScenarioError(f"no shipped scenario {name!r}{close}; there are: {', '.join(SHIPPED_SCENARIOS)}")
    return DEFINITIONS / f"{name}.xosc"


def scenario_path(name: str) -> Path:
    """Path of a shipped scenario by its name, or of any file.

    Raises:
        ScenarioError: the name is neither, and looks like that of a shipped one: no file is called so.
    """
    if name in SHIPPED_SCENARIOS:
        return shipped_scenario(name)
    path = Path(name)
    if name.isidentifier() and not path.exists():
        close = suggestion(name, SHIPPED_SCENARIOS)
        raise ScenarioError(
            f"no file and no shipped scenario {name!r}{close}; smartmot-eval list has their names"
        )
    return path


def scenario_name(path: Path) -> str:
    """What `scenario_path` finds a file by: the name of a shipped one, else its path."""
    shipped = path.suffix == ".xosc" and path.parent.resolve() == DEFINITIONS.resolve()
    return path.stem if shipped and path.stem in SHIPPED_SCENARIOS else str(path)


def describe(name: str) -> ScenarioDescription:
    """Describe a shipped scenario by its name, or any file.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: it cannot be read.
    """
    path = scenario_path(name)
    variations = expand(path)
    header = Node(parse(path), path, {}).need("FileHeader")
    scenario = variations[0].path
    declared = Node(parse(scenario), scenario, {}).get("ParameterDeclarations")
    is_shipped = scenario_name(scenario) in SHIPPED_SCENARIOS
    parameters = []
    for node in declared.all("ParameterDeclaration") if declared else ():
        name = node.text("name")
        if name.startswith("_") or (is_shipped and name in INTERNAL):
            continue
        value = str(variations[0].parameters.get(name, node.text("value")))
        unit, text = MEANINGS[name] if is_shipped else ("", "")
        parameters.append(ScenarioParameter(name, value, node.text("parameterType", "string"), unit, text))
    if is_shipped:
        order = list(MEANINGS)
        parameters.sort(key=lambda parameter: order.index(parameter.name))
    return ScenarioDescription(path.stem, header.text("description", ""), len(variations), tuple(parameters))


def describe_all() -> tuple[ScenarioDescription, ...]:
    """The shipped scenarios, described: tests first, then what they are variations of."""
    return tuple(map(describe, SHIPPED_SCENARIOS))
