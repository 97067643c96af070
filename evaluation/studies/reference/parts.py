"""The studies that the reference results consist of."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evaluation.runs.cpna import CpnaSuite
from evaluation.runs.specs import Conditions
from evaluation.studies.answers.break_even import BreakEven
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.lidar import LearnedGain, LidarGain
from evaluation.studies.answers.sensor import SensorErrors
from evaluation.studies.answers.study import Question, Sample
from evaluation.studies.answers.trigger import Trigger
from evaluation.studies.answers.tune import Tuning
from evaluation.studies.compare.grid import COMPARED
from evaluation.studies.compare.study import SceneStudy
from evaluation.studies.detectors.clouds import ComposedClouds, DrawnClouds, KittiDrive, KittiObjects
from evaluation.studies.detectors.comparison import DetectorComparison
from evaluation.studies.growth import GrowthStudy
from evaluation.studies.reference.adaptive import adaptive_parts
from evaluation.studies.reference.cpna import CpnaStudy
from evaluation.studies.reference.mechanisms import MechanismStudy
from evaluation.studies.reference.outside import DrivesPart, TownsPart, drives_part
from evaluation.studies.study import Study
from scenarios.catalogue.maps import DEFAULT_MAP
from scenarios.settings import Setting
from smartmot.lidar import METHODS
from smartmot.lidar.learned import SHIPPED

BOTH = ("rectangular", "map")
THREE = (*BOTH, "all")
TEN_TO = {top: tuple(float(speed) for speed in range(10, top + 1, 10)) for top in (60, 80)}
URBAN = (30.0, 40.0, 50.0)
"""Speeds of figure 5c and d."""

THE_PAPERS: Mapping[str, tuple[Setting, ...]] = {"margin_m": (1.8,), "half_width_m": (2.6,)}
"""The paper's widths: runs that the curves share."""

_PNG = ("png",)


def _cpna(
    name: str,
    speeds_kmh: tuple[float, ...],
    preset: str,
    weather: tuple[str, ...] = ("dry",),
    adversaries: str = "none",
    beside: str = "",
) -> CpnaStudy:
    conditions = Conditions(BOTH, preset, weather, DEFAULT_MAP, adversaries)
    return CpnaStudy(name, CpnaSuite(speeds_kmh, conditions), beside)


_RULES = ("paper", "cascade", "required_deceleration", "rss", "autoware", "r157")
"""The brake rules that the kept runs have, one for each trigger. `staged` is newer: it comes with the next
run of both questions."""

TUNING = Tuning(Sample("train", 60), _PNG, rules=_RULES, trials=6)
GAIN = Gain(Sample(count=300), _PNG, presets=("physical", "real"))
BREAK_EVEN = BreakEven(Sample(count=75), _PNG)
SENSOR = SensorErrors(Sample(count=40), _PNG)
TRIGGER = Trigger(Sample(count=40), _PNG, rules=_RULES)
LIDAR = LidarGain(Sample(count=20), _PNG)
LEARNED = LearnedGain(Sample(count=20), _PNG)
ADAPTIVE_TUNING, ADAPTIVE_GAIN, ADAPTIVE_LIDAR, SEVERITY = adaptive_parts(_PNG)
QUESTIONS: tuple[Question, ...] = (
    TUNING, GAIN, BREAK_EVEN, SENSOR, TRIGGER, LIDAR, LEARNED, ADAPTIVE_TUNING, ADAPTIVE_GAIN, ADAPTIVE_LIDAR,
    SEVERITY,
)  # fmt: skip
"""The first settles what is run in others. The scenes of fewer are among those of more."""

DRIVES: tuple[DrivesPart, ...] = (
    drives_part("drives/kitti", "kitti", ("path", "rectangular", "all")),  # without a map
    drives_part("drives/argoverse2", "argoverse2/logs", ("path", "map", "rectangular", "all")),
)
"""Recorded drives of others: KITTI with a detector's output, Argoverse 2 with labels in its place."""

ADAPTIVE_DRIVES: tuple[DrivesPart, ...] = (
    drives_part("adaptive/kitti", "kitti", ("adaptive", "path", "rectangular"), ("paper",)),
    drives_part(
        "adaptive/argoverse2", "argoverse2/logs", ("adaptive", "path", "map", "rectangular"), ("paper",)
    ),
)
"""The adaptive area against the others on the same drives, with the paper's rule."""

TOWNS = TownsPart(GAIN.sample, _PNG, presets=GAIN.presets)
"""The first question once more, on maps of others."""

_VAN_ROOF_M = 2.3
"""Height of a sensor on a van, higher than any that detectors were fitted with (2.1 m)."""

_METHODS = (*METHODS, SHIPPED[0])

DETECTORS: tuple[DetectorComparison, ...] = (
    DetectorComparison(
        "detectors/simulated",
        (
            DrawnClouds("hdl64", _VAN_ROOF_M, 60, 71), ComposedClouds("hdl64", _VAN_ROOF_M, 60, 72),
            DrawnClouds("hdl32", _VAN_ROOF_M, 60, 73),
        ),
        _METHODS,
    ),
    DetectorComparison(
        "detectors/kitti",
        (KittiObjects(Path("lidar/kitti_object")), KittiDrive(Path("lidar/kitti_sequence_0000"))),
        _METHODS,
    ),
)  # fmt: skip
"""Detectors on clouds that none of them has seen; those of KITTI are not in the project."""

PARTS: tuple[Study[Any, Any], ...] = (
    *QUESTIONS,
    TOWNS,
    *DRIVES,
    *ADAPTIVE_DRIVES,
    *DETECTORS,
    _cpna("paper", TEN_TO[80], "paper"),
    _cpna("static", URBAN, "paper", adversaries="static", beside="paper"),
    MechanismStudy("mechanisms", 5),
    _cpna("physical", TEN_TO[80], "physical"),
    _cpna("weather", TEN_TO[60], "physical", ("dry", "wet", "rain", "snow")),
    SceneStudy(COMPARED, "physical", formats=_PNG, name="frontier_physical"),
    SceneStudy(COMPARED, "paper", formats=_PNG, name="frontier_paper"),
    # without figures: single points make no curve
    SceneStudy((*BOTH, "path"), "physical", widths=THE_PAPERS, seeds=3, formats=(), name="seeds"),
    SceneStudy(THREE, "physical", ablation=True, formats=_PNG, name="ablation"),
    GrowthStudy(THREE, "physical", "dry", seeds=2, formats=_PNG),
)
"""In the order of the page that tells them."""
