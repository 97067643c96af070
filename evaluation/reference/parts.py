"""The parts of the reference results."""

from __future__ import annotations

from pathlib import Path

from evaluation.arguments import DEFAULT_MAP
from evaluation.reference.cpna import CpnaPart
from evaluation.reference.mechanisms import MechanismsPart
from evaluation.reference.part import Part
from evaluation.reference.scenes import GrowthPart, ScenesPart
from evaluation.runner import CpnaSuite
from evaluation.study.command import CompareOptions
from scenarios.strategies import STRATEGIES

BOTH = ("rectangular", "map")
TEN_TO = {top: tuple(float(speed) for speed in range(10, top + 1, 10)) for top in (60, 80)}
URBAN = (30.0, 40.0, 50.0)
"""Speeds of figure 5c and d."""


def _scenes(
    name: str, preset: str, seeds: int, strategies: tuple[str, ...] = STRATEGIES, ablation: bool = False
) -> ScenesPart:
    options = CompareOptions(
        strategies=strategies,
        vary={},
        preset=preset,
        weather=("dry",),
        scenes=(),
        full=False,
        seeds=seeds,
        workers=1,
        out=Path(),
        ablation=ablation,
        quiet=True,
        formats=("png",),
    )
    return ScenesPart(name, options)


PARTS: tuple[Part, ...] = (
    CpnaPart("paper", CpnaSuite(TEN_TO[80], BOTH, "paper", ("dry",), DEFAULT_MAP)),
    CpnaPart("static", CpnaSuite(URBAN, BOTH, "paper", ("dry",), DEFAULT_MAP, adversaries="static"), "paper"),
    MechanismsPart("mechanisms", 10),
    CpnaPart("physical", CpnaSuite(TEN_TO[80], BOTH, "physical", ("dry",), DEFAULT_MAP)),
    CpnaPart("weather", CpnaSuite(TEN_TO[60], BOTH, "physical", ("dry", "wet", "rain", "snow"), DEFAULT_MAP)),
    _scenes("frontier_physical", "physical", 1),
    _scenes("frontier_paper", "paper", 1),
    _scenes("ablation", "physical", 1, ("map", "all"), ablation=True),
    GrowthPart("growth", STRATEGIES, "physical", "dry", 2),
)
"""In the order of the page that tells them."""
