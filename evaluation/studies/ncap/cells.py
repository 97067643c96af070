"""Which cell of a protocol a scenario with its parameters is, and the shipped scenario of a cell."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from evaluation.protocols.grid import Cell, Function, Lighting
from evaluation.protocols.robustness import Quantity
from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.reading.distributions import Variation, expand
from scenarios.spec import initial_speed_kmh
from scenarios.weather import NIGHT_LX, is_night

_FCW_PERCENT_2023 = {("CPLA", "25"), ("CBLA", "25")}
"""Rows that Euro NCAP 2023 drives as warning tests alone; their files tell it by the impact location."""

_IMPACT = ("Impact_percent", "ImpactLocation", "Overlap")
_TARGET_SPEED = (
    *("Target_speed_kmh", "VRU_finalSpeed_kph", "Target_init_speed_kph", "GVT_init_speed_kph"),
    *("Target_finalSpeed_kph", "Target_final_speed_kph"),
)
"""Parameters that hold the impact location and the target's test speed, the first that is there."""


def cell_columns(
    variation: Variation, file: Path, definition: ScenarioDefinition, overlaps: bool = True
) -> dict[str, object]:
    """What tells the cell of a run: the columns that `protocols.table.measurements` asks for.

    The scenario's name is taken from the parameter Scenario_ID that Vector's files of Euro NCAP's tests set,
    or else from the name of the file (`cpfa`, `NCAP_AEB_VRU_CPRA_Cm_Variation_2023`).

    Args:
        variation: the run, with its parameters.
        file: that asked for it.
        definition: the scenario with its final parameters.
        overlaps: whether tests behind a car are told by how much of the ego's width overlaps, as in 2023;
            else by the impact location.
    """
    values = definition.parameters
    name_of_test = str(variation.parameters.get("Scenario_ID", "")) or _name_in(file)
    match = re.fullmatch(
        r"(?P<name>[A-Za-z_]+?)(?:-(?P<percent>\d+))?(?P<fcw>_FCW)?", name_of_test, re.IGNORECASE
    )
    name, percent, fcw = (
        (match["name"], match["percent"], match["fcw"]) if match else (name_of_test, None, None)
    )
    warned = fcw or file.stem.upper().endswith("_FCW") or (name, percent) in _FCW_PERCENT_2023
    columns: dict[str, object] = {
        "scenario": _SPELLED.get(name.lower(), name),
        "v_test_kmh": initial_speed_kmh(definition),
        "lighting": str(Lighting.NIGHT if is_night(definition) else Lighting.DAY),
        "function": str(Function.FCW if warned else Function.AEB),
    }
    impact = percent or _first(values, _IMPACT)
    if impact is not None:
        columns["impact_location_percent"] = float(impact)
        if values.get("VRU_trajectoryOrientation") == -1:  # Vector's files count from the target's side
            columns["impact_location_percent"] = 100.0 - float(impact)
        elif columns["scenario"] in _BEHIND_A_CAR and overlaps != ("Overlap" in values):
            width = _width_of_target(definition)
            columns["impact_location_percent"] = counted_otherwise(float(impact), width, overlaps)
    target = _first(values, _TARGET_SPEED)
    if target is not None:
        columns["target_speed_kmh"] = float(target)
    if name == "CCRb" and "GVT_headway" in values:
        gap, decel = float(values["GVT_headway"]), float(values["GVT_deceleration"])
        columns["condition"] = f"gap {gap:g} m, {decel:g} m/s2"
    return columns


_BEHIND_A_CAR = ("CCRs", "CCRm", "CCRb")


def counted_otherwise(percent: float, width: float, overlaps: bool) -> float:
    """The overlap of an impact location, or the impact location of an overlap; the middle is 100 % or 50 %.

    Args:
        percent: of the ego's width; an overlap is negative on the ego's right.
        width: of the target, in widths of the ego.
        overlaps: whether the overlap is wanted.
    """
    beside = 50.0 * (1.0 + width)  # both half widths
    if overlaps:
        left = percent - 50.0
        return round(math.copysign(beside - abs(left), left), 3) if left else 100.0
    return 50.0 if percent == 100.0 else round(50.0 + math.copysign(beside - abs(percent), percent), 3)


def _width_of_target(definition: ScenarioDefinition) -> float:
    """In widths of the ego."""
    first, *more = definition.entities
    ego = next((entity for entity in definition.entities if entity.name == "Ego"), first)
    target = next((entity for entity in (first, *more) if entity is not ego), ego)
    return target.width_m / ego.width_m


def _first(values: Mapping[str, Value], names: tuple[str, ...]) -> Value | None:
    return next((values[name] for name in names if name in values), None)


_SCENARIOS = (
    *("CPNA", "CPFA", "CPNCO", "CPLA", "CPTAfs", "CPTAfo", "CPTAns", "CPTAno", "CPRA_Cm", "CPRA_Cs"),
    *("CBNAO", "CBNA", "CBFA", "CBLA", "CCRs", "CCRm", "CCRb", "CCFtap", "CCFhos", "CCFhol", "CCCscp"),
    *("CMRs", "CMRb", "CMFtap", "CMCscp"),
)
_SPELLED = {name.lower(): name for name in _SCENARIOS}


def _name_in(file: Path) -> str:
    """The test's abbreviation in the name of a file; the whole name if there is none."""
    match = re.search(f"(?<![A-Za-z])({'|'.join(_SCENARIOS)})(?![A-Za-z])", file.stem, re.IGNORECASE)
    return match[1] if match else file.stem


# ---- shipped scenarios -------------------------------------------------------------------------------------

_SHIPPED = {
    ("CPNA", Function.AEB): "cpna",
    ("CPFA", Function.AEB): "cpfa",
    ("CPNCO", Function.AEB): "cpnco",
    ("CPLA", Function.AEB): "cpla",
    ("CPLA", Function.FCW): "cpla_fcw",
    ("CBNA", Function.AEB): "cbna",
    ("CBLA", Function.AEB): "cbla",
    ("CBLA", Function.FCW): "cbla_fcw",
}
NIGHT_TEST_LX = 0.1
assert NIGHT_TEST_LX < NIGHT_LX


def shipped_test(cell: Cell) -> str | None:
    """Name of the shipped test that a cell belongs to; None if there is none."""
    return None if cell.impact_percent is None else _SHIPPED.get((cell.scenario, cell.function))


def shipped_run(cell: Cell, steady_distance_m: float | None = None) -> Variation | None:
    """The shipped scenario of a cell, with its parameters; None if there is none.

    Args:
        cell: of any protocol.
        steady_distance_m: of the target's constant speed in tests along the lane, where the protocol wants
            another than the shipped grid.
    """
    name = shipped_test(cell)
    if name is None or cell.impact_percent is None:
        return None
    first = _expanded(name)[0]
    values = dict(first.parameters) | {
        "Ego_speed_kmh": cell.speed_kmh,
        "Impact_percent": cell.impact_percent,
    }
    if cell.target_speed_kmh is not None:
        values["Target_speed_kmh"] = cell.target_speed_kmh
    if cell.lighting is Lighting.NIGHT:
        values["Illuminance"] = NIGHT_TEST_LX
    if steady_distance_m is not None and name in ("cpla_fcw", "cbla_fcw", "cpla", "cbla"):
        values["Steady_distance"] = steady_distance_m
    return Variation(f"{name}_{cell.speed_kmh:g}", first.path, values)


# ---- changed scenarios -------------------------------------------------------------------------------------

_CHANGED_BY = {
    # the parameters that a quantity is added to: of the shipped scenarios, then of Vector's files of 2026
    Quantity.TARGET_SPEED_KMH: (
        *("Target_speed_kmh", "VRU_finalSpeed_kph", "Target_final_speed_kph", "Target_init_speed_kph"),
    ),
    Quantity.START_PERCENT: ("Target_offset", "VRU_initLatDist", "VRU_steadyStateDist"),
    Quantity.HEADING_DEG: ("Target_heading_deg",),
    Quantity.PATH_OFFSET_M: (),
    Quantity.TARGET_DECELERATION_MPS2: ("Target_deceleration",),
    Quantity.HEADWAY_S: ("Target_time_headway",),
    Quantity.ILLUMINANCE_LX: ("Illuminance",),
}


def changed_run(
    variation: Variation, values: Mapping[str, Value], quantity: Quantity, amount: float
) -> Variation | None:
    """A run with one quantity changed; None if its scenario has no parameter for that.

    Args:
        variation: the run.
        values: its final parameters.
        quantity: what changes.
        amount: by how much; to how much, of the illuminance.
    """
    name = next((name for name in _CHANGED_BY[quantity] if name in values), None)
    if name is None:
        return None
    if quantity is Quantity.START_PERCENT:
        distance = _distance_to_impact_m(values)
        if distance is None:
            return None
        amount = amount / 100.0 * distance
    before = 0.0 if quantity is Quantity.ILLUMINANCE_LX else float(values[name])
    value = round(before + amount, 9)
    label = f"{variation.name}_{name}_{value:g}"
    return Variation(label, variation.path, {**variation.parameters, name: value})


def _distance_to_impact_m(values: Mapping[str, Value]) -> float | None:
    """From the target's start to the impact point, of the shipped crossings and Vector's of 2026."""
    if "_Walk" in values:
        return float(values["_Walk"])
    if "VRU_initLatDist" in values:
        to_impact = float(values["_Ego_impactPointOffset"]) - float(values["VRU_collisionPointOffset"])
        return float(values["VRU_initLatDist"]) + to_impact
    points = [float(value) for name, value in values.items() if name.startswith("_Road_collisionPointA")]
    return points[0] - float(values["_VRU_initS"]) if points else None


@cache
def _expanded(name: str) -> list[Variation]:
    return expand(shipped_scenario(name))
