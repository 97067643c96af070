"""The parts of the reference results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from evaluation.runs.plan import CpnaSuite
from evaluation.studies.compare.command import CompareOptions
from evaluation.studies.reference.cpna import CpnaPart
from evaluation.studies.reference.mechanisms import MechanismsPart
from evaluation.studies.reference.part import Part
from evaluation.studies.reference.scenes import GrowthPart, ScenesPart
from scenarios.catalogue.maps import DEFAULT_MAP
from scenarios.settings import Setting
from scenarios.strategies import STRATEGIES

BOTH = ("rectangular", "map")
TEN_TO = {top: tuple(float(speed) for speed in range(10, top + 1, 10)) for top in (60, 80)}
URBAN = (30.0, 40.0, 50.0)
"""Speeds of figure 5c and d."""


def _scenes(
    name: str,
    preset: str,
    seeds: int,
    strategies: tuple[str, ...] = STRATEGIES,
    vary: Mapping[str, tuple[Setting, ...]] = MappingProxyType({}),
    ablation: bool = False,
) -> ScenesPart:
    options = CompareOptions(
        strategies=strategies,
        vary=dict(vary),
        preset=preset,
        weather=("dry",),
        scenes=(),
        full=False,
        seeds=seeds,
        workers=1,
        out=Path(),
        ablation=ablation,
        quiet=True,
        formats=() if vary else ("png",),  # single points make no curve
    )
    return ScenesPart(name, options)


THE_PAPERS: Mapping[str, tuple[Setting, ...]] = {
    "margin_m": (1.8,),
    "half_width_m": (2.6,),
    "ego_forecast": ("ctrv", "route"),
}
"""The paper's widths, with both forecasts of the ego: runs that the curves share."""

PARTS: tuple[Part, ...] = (
    CpnaPart("paper", CpnaSuite(TEN_TO[80], BOTH, "paper", ("dry",), DEFAULT_MAP)),
    CpnaPart("static", CpnaSuite(URBAN, BOTH, "paper", ("dry",), DEFAULT_MAP, adversaries="static"), "paper"),
    MechanismsPart("mechanisms", 5),
    CpnaPart("physical", CpnaSuite(TEN_TO[80], BOTH, "physical", ("dry",), DEFAULT_MAP)),
    CpnaPart("weather", CpnaSuite(TEN_TO[60], BOTH, "physical", ("dry", "wet", "rain", "snow"), DEFAULT_MAP)),
    _scenes("frontier_physical", "physical", 1),
    _scenes("frontier_paper", "paper", 1),
    _scenes("seeds", "physical", 3, BOTH, THE_PAPERS),
    _scenes("ablation", "physical", 1, ("map", "all"), ablation=True),
    GrowthPart("growth", STRATEGIES, "physical", "dry", 2),
)
"""In the order of the page that tells them."""
