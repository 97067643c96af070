"""The scenarios that are shipped with the package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.distributions import expand
from scenarios.openscenario.reading.document import Node, parse

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
class ScenarioDescription:
    """What a file holds.

    Args:
        name: file name without ending.
        text: description from its header.
        runs: how many it asks for.
        parameters: names and declared values of what may be set.
    """

    name: str
    text: str
    runs: int
    parameters: tuple[tuple[str, str], ...]


def shipped_scenario(name: str) -> Path:
    """Path of a shipped scenario or distribution file.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name not in SHIPPED_SCENARIOS:
        raise ScenarioError(f"no shipped scenario {name!r}; there are: {', '.join(SHIPPED_SCENARIOS)}")
    return DEFINITIONS / f"{name}.xosc"


def scenario_path(name: str) -> Path:
    """Path of a shipped scenario by its name, or of any file."""
    return shipped_scenario(name) if name in SHIPPED_SCENARIOS else Path(name)


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
    parameters = [
        (node.text("name"), str(variations[0].parameters.get(node.text("name"), node.text("value"))))
        for node in (declared.all("ParameterDeclaration") if declared else ())
        if not node.text("name").startswith("_")
    ]
    return ScenarioDescription(path.stem, header.text("description", ""), len(variations), tuple(parameters))
