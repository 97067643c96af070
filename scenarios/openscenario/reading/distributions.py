"""Parameter value distributions: one file, many parameter sets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from scenarios.openscenario.errors import ConstraintError, ContentError, FileReadError, UnsupportedError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.catalogs import assignments
from scenarios.openscenario.reading.document import Node, as_text, parse
from scenarios.openscenario.reading.parameters import Declarations

MAX_VARIATIONS = 100_000
"""A file that asks for more is refused."""


@dataclass(frozen=True, slots=True)
class Variation:
    """One run that a file asks for.

    Args:
        name: file name and number.
        path: the scenario file.
        parameters: values in place of the declared ones.
        source: the file that asks for it: a distribution, or the scenario itself; None: no file does.
    """

    name: str
    path: Path
    parameters: Mapping[str, Value]
    source: Path | None = None


def expand(path: str | PathLike[str]) -> list[Variation]:
    """Runs that a file asks for; one for a scenario file. The last distribution in the file varies fastest.

    Args:
        path: the `.xosc` file.

    Raises:
        FileReadError: the file cannot be read.
        ContentError: a distribution is impossible or contradicts another.
        UnsupportedError: a distribution is stochastic.
    """
    file = Path(path)
    root = Node(parse(file), file, {})
    node = root.get("ParameterValueDistribution")
    if node is None:
        return [Variation(file.stem, file, {}, file)]
    root.allow("noNamespaceSchemaLocation", "FileHeader ParameterValueDistribution")
    node.allow(children="ScenarioFile Deterministic Stochastic")
    scenario = _scenario_file(node.need("ScenarioFile"))
    if node.get("Stochastic") is not None:
        raise UnsupportedError(
            f"{node.need('Stochastic').where} is not supported; use a Deterministic distribution"
        )
    kinds = "DeterministicSingleParameterDistribution DeterministicMultiParameterDistribution"
    axes = [_axis(child) for child in node.need("Deterministic").some(kinds, "distribution")]
    names: list[str] = [name for axis in axes for name in dict.fromkeys(n for part in axis for n in part)]
    for name in names:
        if names.count(name) > 1:
            raise ContentError(f"{node.where} distributes parameter '{name}' twice")
    if math.prod(len(axis) for axis in axes) > MAX_VARIATIONS:
        raise ContentError(f"{node.where} asks for more than {MAX_VARIATIONS} variations")
    variations: list[Variation] = []
    for number, choice in enumerate(itertools.product(*axes)):
        values: dict[str, Value] = {}
        for part in choice:
            values.update(part)
        variations.append(Variation(f"{file.stem}_{number:02d}", scenario, values, file))
    return variations


def admissible(variations: Sequence[Variation]) -> tuple[list[Variation], str]:
    """Variations whose values keep the constraints of the parameters, and a line about those that do not.

    Args:
        variations: as `expand` gives them.

    Returns:
        The variations, and the line (empty: all keep them).

    Raises:
        ConstraintError: none does.
        ParameterError: a parameter is unknown, circular, or of the wrong type.
    """
    kept: list[Variation] = []
    broken: list[ConstraintError] = []
    for variation in variations:
        try:
            _declared(variation.path, variation.parameters)
        except ConstraintError as error:
            broken.append(error)
        else:
            kept.append(variation)
    if not broken:
        return kept, ""
    if not kept:
        raise broken[0]
    return kept, f"{len(broken)} of {len(variations)} variations are left out, the first: {broken[0]}"


def _declared(path: Path, values: Mapping[str, Value]) -> None:
    """Work out the parameters of a scenario, if any of them has a constraint."""
    declarations = Node(parse(path), path, {}).get("ParameterDeclarations")
    if declarations is not None and declarations.element.find(".//ConstraintGroup") is not None:
        Declarations(declarations, values, {}, {}).scope()


def _scenario_file(node: Node) -> Path:
    node.allow("filepath")
    path = node.path("filepath")
    if not path.is_file():
        raise FileReadError(f"{node.where} scenario file {path} does not exist")
    return path.resolve()


def _axis(node: Node) -> list[dict[str, Value]]:
    """Parameter sets of one distribution."""
    if node.tag == "DeterministicMultiParameterDistribution":
        node.allow(children="ValueSetDistribution")
        sets = node.need("ValueSetDistribution")
        sets.allow(children="ParameterValueSet")
        # the standard's ParameterValueSet is itself a list of assignments
        axis = [dict(assignments(child)) for child in sets]
        if not axis:
            raise ContentError(f"{sets.where} needs at least one ParameterValueSet")
        return axis
    name = node.text("parameterName")
    child = node.one_of("DistributionSet DistributionRange UserDefinedDistribution", "parameterName")
    if child.tag == "UserDefinedDistribution":
        raise UnsupportedError(f"{child.where} is not supported; use a DistributionSet or DistributionRange")
    return [{name: value} for value in (_set(child) if child.tag == "DistributionSet" else _range(child))]


def _set(node: Node) -> list[Value]:
    values: list[Value] = []
    for element in node.some("Element"):
        element.allow("value")
        values.append(element.value("value"))
    return values


def _range(node: Node) -> list[Value]:
    """Lower limit, plus steps, up to the upper limit, which is met if a whole number of steps leads there."""
    node.allow("stepWidth", "Range")
    limits = node.need("Range")
    limits.allow("lowerLimit upperLimit")
    step = node.positive("stepWidth", zero=False)
    low, high = limits.number("lowerLimit"), limits.number("upperLimit")
    if high < low:
        raise ContentError(f"{limits.where} upperLimit {high:g} lies below lowerLimit {low:g}")
    count = math.floor((high - low) / step + 1e-9) + 1
    if count > MAX_VARIATIONS:
        raise ContentError(f"{node.where} asks for more than {MAX_VARIATIONS} variations")
    return [as_text(round(low + k * step, 12)) for k in range(count)]
