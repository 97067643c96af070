"""Parameter value distributions: one file, many parameter sets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.openscenario.errors import (
    ConstraintError,
    ContentError,
    FileReadError,
    ParameterError,
    UnsupportedError,
)
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.catalogs import assignments
from scenarios.openscenario.reading.document import Node, as_text, parse
from scenarios.openscenario.reading.parameters import TYPES, Declarations, typed
from smartmot.types import FloatArray

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

    Stochastic distributions are drawn from independently of each other, the same values for the same seed.

    Args:
        path: the `.xosc` file.

    Raises:
        FileReadError: the file cannot be read.
        ContentError: a distribution is impossible or contradicts another.
        UnsupportedError: a distribution is user-defined.
    """
    file = Path(path)
    root = Node(parse(file), file, {})
    node = root.get("ParameterValueDistribution")
    if node is None:
        return [Variation(file.stem, file, {}, file)]
    root.allow("noNamespaceSchemaLocation", "FileHeader ParameterValueDistribution")
    node.allow(children="ScenarioFile Deterministic Stochastic")
    scenario = _scenario_file(node.need("ScenarioFile"))
    drawn = node.get("Stochastic")
    if drawn is not None:
        rows = _drawn(drawn)
        _check_types(drawn, scenario, rows)
        return [
            Variation(f"{file.stem}_{number:02d}", scenario, values, file)
            for number, values in enumerate(rows)
        ]
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


def _check_types(node: Node, scenario: Path, rows: Sequence[Mapping[str, Value]]) -> None:
    """Refuse what is drawn for a parameter of another type, such as numbers with decimals for whole ones."""
    declarations = Node(parse(scenario), scenario, {}).get("ParameterDeclarations")
    for child in declarations or ():
        name = str(child.element.get("name", "")).strip().removeprefix("$")
        for value in dict.fromkeys(row[name] for row in rows if name in row):
            try:
                typed(value, child.choice("parameterType", TYPES))
            except ParameterError as error:
                raise ContentError(f"{node.where} draws values for parameter '{name}': {error}") from None


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


# Stochastic distributions


def _drawn(node: Node) -> list[dict[str, Value]]:
    """Parameter sets drawn from stochastic distributions, each with a stream of random numbers of its own."""
    node.allow("numberOfTestRuns randomSeed", "StochasticDistribution")
    count, seed = node.integer("numberOfTestRuns"), node.number("randomSeed", 0.0)
    if not 1 <= count <= MAX_VARIATIONS:
        raise ContentError(
            f"{node.where} numberOfTestRuns: expected 1 to {MAX_VARIATIONS} variations, got {count}"
        )
    axes: dict[str, list[Value]] = {}
    children = node.all("StochasticDistribution")
    if not children:
        raise ContentError(f"{node.where} needs at least one StochasticDistribution")
    # a seed may be any number: its bits are the seed
    streams = np.random.SeedSequence(int(np.float64(seed).view(np.uint64))).spawn(len(children))
    for child, stream in zip(children, streams, strict=True):
        name = child.text("parameterName")
        if name in axes:
            raise ContentError(f"{node.where} distributes parameter '{name}' twice")
        # each value takes one number, so that more test runs begin with the same values
        parts = np.random.Generator(np.random.PCG64(stream)).random(count)
        axes[name] = _quantiles(child.one_of(STOCHASTIC, "parameterName"), parts)
    return [dict(zip(axes, row, strict=True)) for row in zip(*axes.values(), strict=True)]


STOCHASTIC = (
    "ProbabilityDistributionSet NormalDistribution LogNormalDistribution UniformDistribution "
    "PoissonDistribution Histogram UserDefinedDistribution"
)


def _quantiles(node: Node, parts: FloatArray) -> list[Value]:
    """Values of a distribution below which its shares lie: (K,) shares from 0 to 1."""
    if node.tag == "UserDefinedDistribution":
        raise UnsupportedError(f"{node.where} is not supported; use a distribution of the standard")
    if node.tag == "ProbabilityDistributionSet":
        node.allow(children="Element")
        elements = node.some("Element")
        for element in elements:
            element.allow("value weight")
        weights = [element.positive("weight") for element in elements]
        chosen = np.searchsorted(_shares(node, weights), parts, side="right")
        return [elements[k].value("value") for k in chosen.tolist()]
    if node.tag == "Histogram":
        numbers = _of_histogram(node, parts)
    elif node.tag == "UniformDistribution":
        node.allow(children="Range")
        low, high = _limits(node)
        numbers = low + parts * (high - low)
    else:
        numbers = _truncated(node, parts)
    return [as_text(number) for number in numbers.tolist()]


def _shares(node: Node, weights: list[float]) -> FloatArray:
    """(K,) up to which share each of some weights reaches."""
    total = math.fsum(weights)
    if not total > 0.0:
        raise ContentError(f"{node.where} needs a weight above 0")
    shares = np.cumsum(weights) / total
    shares[np.flatnonzero(np.asarray(weights) > 0.0)[-1] :] = 1.0
    return shares


def _limits(node: Node) -> tuple[float, float]:
    """Limits of the range of a distribution; infinite where it has none and needs none."""
    limits = node.need("Range") if node.tag == "UniformDistribution" else node.get("Range")
    if limits is None:
        return -math.inf, math.inf
    limits.allow("lowerLimit upperLimit")
    low, high = limits.number("lowerLimit"), limits.number("upperLimit")
    if high < low:
        raise ContentError(f"{limits.where} upperLimit {high:g} lies below lowerLimit {low:g}")
    return low, high


def _of_histogram(node: Node, parts: FloatArray) -> FloatArray:
    """Uniform within bins, which are chosen by their weights."""
    node.allow(children="Bin")
    bins = node.some("Bin")
    for held in bins:
        held.allow("weight", "Range")
        held.need("Range")
    limits = np.array([_limits(held) for held in bins])
    shares = _shares(node, [held.positive("weight") for held in bins])
    chosen = np.searchsorted(shares, parts, side="right")
    begins = np.concatenate(([0.0], shares[:-1]))[chosen]
    within = (parts - begins) / (shares[chosen] - begins)
    numbers: FloatArray = limits[chosen, 0] + within * (limits[chosen, 1] - limits[chosen, 0])
    return numbers


def _truncated(node: Node, parts: FloatArray) -> FloatArray:
    """Normal, log-normal or Poisson, cut to the range; mean and variance are those before the cut."""
    from scipy import stats

    normal = node.tag != "PoissonDistribution"
    node.allow("expectedValue variance" if normal else "expectedValue", "Range")
    low, high = _limits(node)
    mean = (
        node.number("expectedValue") if node.tag == "NormalDistribution" else node.positive("expectedValue")
    )
    held: Any
    if not normal:
        held = stats.poisson(mean)
        low = math.ceil(low) - 1.0 if math.isfinite(low) else low  # the lower limit belongs to the range
    else:
        variance = node.positive("variance")
        if variance == 0.0 or (node.tag == "LogNormalDistribution" and mean == 0.0):
            if not low <= mean <= high:
                raise ContentError(f"{node.where} has no value within its Range")
            return np.full(len(parts), mean)
        if node.tag == "NormalDistribution":
            held = stats.norm(mean, math.sqrt(variance))
        else:
            spread = math.log1p(variance / mean / mean)  # variance of the logarithm
            if not math.isfinite(spread):
                raise ContentError(
                    f"{node.where} variance {variance:g} is too large for expectedValue {mean:g}"
                )
            held = stats.lognorm(math.sqrt(spread), scale=mean * math.exp(-0.5 * spread))
    # in the upper tail shares are counted from above, where they keep their digits
    if normal and low >= held.median():
        from_above, to_above = held.sf(low), held.sf(high)
        if not from_above > to_above:
            raise ContentError(f"{node.where} has no value within its Range")
        values = np.asarray(held.isf(from_above + parts * (to_above - from_above)), float)
        above: FloatArray = np.clip(values, low, high)
        return above
    begin, end = held.cdf(low), held.cdf(high)
    if not end > begin:
        raise ContentError(f"{node.where} has no value within its Range")
    # a share of 0 would be the value before the first one
    shares = begin + np.maximum(parts, 1e-12) * (end - begin)
    values = np.asarray(held.ppf(shares), float)
    numbers: FloatArray = np.clip(values, low if normal else low + 1.0, high)
    return numbers
