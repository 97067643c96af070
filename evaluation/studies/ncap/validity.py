"""Whether a test of a protocol asks for what it is about: the unbraked ego meets the target where it should.

Sources of the tolerances: Euro NCAP Crash Avoidance, Frontal Collisions v1.1, conditions of a valid test
(lateral deviation of the VUT and of the target; the VRU test protocol v4.5.1 has the same). A simulation
holds its speeds exactly, so that the tolerances of speed add nothing. Nothing here is taken from runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from evaluation.protocols.file_format import Column, TableTest
from evaluation.protocols.grid import Cell
from evaluation.runs.conflict import Conflict, Part, Touch
from evaluation.studies.ncap.cells import counted_otherwise

VUT_LATERAL_M, VUT_LATERAL_TURNING_M = 0.05, 0.10
VRU_ACROSS_M, VRU_ALONG_M = 0.05, 0.15
VEHICLE_LATERAL_M = 0.10
"""Lateral deviation that a valid test allows: of the VUT straight on and in a turn, of pedestrian and cyclist
who cross or go along, of car and motorcyclist."""

REFERENCE_M = 0.06
"""The target's reference point is as far as this from the centre of its box, which is what is measured: the
H-point of the adult 0.06 m, of the child 0.04 m behind it, the crank of the bicycle 0.015 m in front."""

SAMPLING_S = 0.01
"""Time is measured at 100 Hz (v1.1, measurements): a crossing target is met within this time."""

TURN_RADIUS_M = {10.0: 9.00, 15.0: 11.75, 20.0: 14.75, 25.0: 14.75}
TURN_RADIUS_NEAR_SIDE_M = 8.00
"""Radius of the path by test speed, turning to the far side, and to the near side (v1.1, section 1.2.4)."""

SIDE_PLACE_PERCENT = 10.0
"""CMCscp: the motorcyclist's front meets the side of the VUT a tenth of its length behind its front (formula
for the synchronisation in Vector's scenario)."""


@dataclass(frozen=True, slots=True)
class Family:
    """What is alike in the tests of some scenarios.

    Args:
        vut_m: lateral tolerance of the VUT.
        target_m: lateral tolerance of the target.
        crosses: whether the target crosses the VUT's way: its lateral deviation then shifts the time at which
            it is met, and with it the place by the ratio of the speeds.
        reference: the point of the target that is to meet the place, in lengths of its box before its centre.
        reference_m: tolerance for what is not known of that point.
        turns: whether the VUT turns, see `_inside_m`.
        usual_percent: place where the grid names none.
        corner_first: whether the target comes askew, so that a corner of its front is met first.
    """

    vut_m: float = VUT_LATERAL_M
    target_m: float = VRU_ACROSS_M
    crosses: bool = True
    reference: float = 0.0
    reference_m: float = 0.0
    turns: bool = False
    usual_percent: float | None = None
    corner_first: bool = False


_CROSSING = Family(reference_m=REFERENCE_M)
_ALONG = Family(target_m=VRU_ALONG_M, crosses=False)
_REAR = Family(target_m=VEHICLE_LATERAL_M, crosses=False)
_TURNING = Family(VUT_LATERAL_TURNING_M, reference_m=REFERENCE_M, turns=True)
_ACROSS = Family(
    VUT_LATERAL_TURNING_M, VEHICLE_LATERAL_M, reference=0.5, turns=True, usual_percent=50.0, corner_first=True
)
"""The front of an oncoming target, in the middle (VRU and car-to-car protocols; 50 % of the VUT's width)."""
_JUNCTION = Family(target_m=VEHICLE_LATERAL_M, reference=0.25, usual_percent=50.0)
"""CCCscp: the point a quarter of the target's length behind its front (formula in Vector's scenario)."""

_FAMILIES = {
    **dict.fromkeys(("CPNA", "CPFA", "CPNCO", "CBNA", "CBFA", "CBNAO", "CPRA_Cm", "CPRA_Cs"), _CROSSING),
    **dict.fromkeys(("CPLA", "CBLA"), _ALONG),
    **dict.fromkeys(("CCRs", "CCRm", "CCRb", "CMRs", "CMRb", "CCFhos", "CCFhol"), _REAR),
    **dict.fromkeys(("CPTAfs", "CPTAfo", "CPTAns", "CPTAno"), _TURNING),
    **dict.fromkeys(("CBTAfs", "CBTAfo", "CBTAns", "CBTAno"), _TURNING),
    **dict.fromkeys(("CCFtap", "CMFtap"), _ACROSS),
    **dict.fromkeys(("CCCscp", "CMCscp"), _JUNCTION),
}
_BY_OVERLAP = frozenset({"CCRs", "CCRm", "CCRb"})


_OFF = "target off the place asked for"


def why_invalid(cell: Cell, conflict: Conflict, overlaps: bool = False) -> str:
    """Why a run of a cell tests nothing, or something else than the cell asks for.

    Args:
        cell: of any protocol.
        conflict: what comes to pass without braking.
        overlaps: whether tests behind a car are told by the overlap, as in 2023.

    Returns:
        The reason; empty if the run is valid.
    """
    touch = conflict.touch
    if touch is None or conflict.missing:
        return conflict.missing
    if cell.scenario == "CMCscp":
        return _off_the_side(touch)
    if touch.part is not Part.FRONT:
        return f"{_OFF}: without braking it meets the {touch.part} of the ego, not its front"
    family = _FAMILIES[cell.scenario]
    asked = family.usual_percent if cell.impact_percent is None else cell.impact_percent
    if asked is None:
        return ""
    if overlaps and cell.scenario in _BY_OVERLAP:
        asked = counted_otherwise(asked, touch.entity_width_m / touch.ego_width_m, overlaps=False)
    place = touch.place_percent(family.reference * touch.entity_length_m)
    allowed = 100.0 * tolerance_m(family, touch) / touch.ego_width_m
    inside = touch.turns * 100.0 * _inside_m(family, cell, touch) / touch.ego_width_m
    low, high = sorted((asked, asked + inside))
    if low - allowed <= place <= high + allowed:
        return ""
    return (
        f"{_OFF}: without braking it is met at {place:.0f} % of the ego's width, not between "
        f"{low - allowed:.0f} and {high + allowed:.0f} %"
    )


def why_invalid_by_table(test: TableTest, column: Column, conflict: Conflict) -> str:
    """Why a run of a protocol's file tests something else than that asks for; empty if it is valid."""
    touch = conflict.touch
    if not test.meets:
        return f"without braking the ego touches {touch.entity}: nothing is to be met" if touch else ""
    if touch is None or conflict.missing:
        return conflict.missing
    if test.place_tolerance_m is None or column.place_percent is None:
        return ""
    beside_m = (touch.place_percent() - column.place_percent) / 100.0 * touch.ego_width_m
    if touch.part is Part.FRONT and abs(beside_m) <= test.place_tolerance_m:
        return ""
    return (
        f"{_OFF}: without braking it is met at {touch.place_percent():.0f} % of the ego's width, "
        f"{abs(beside_m):.2f} m off; within {test.place_tolerance_m:g} m of the front is asked for"
    )


def tolerance_m(family: Family, touch: Touch) -> float:
    """How far beside its place a target may be met in a valid test."""
    if not family.crosses:
        return family.vut_m + family.target_m
    sampling_m = SAMPLING_S * abs(touch.entity_speed_kmh) / 3.6
    return family.vut_m + family.target_m * touch.speed_ratio + family.reference_m + sampling_m


def _inside_m(family: Family, cell: Cell, touch: Touch) -> float:
    """How far to the inside of a turn a target may be met because of the point that is kept on the path.

    The protocol leads the middle of the front axle along the path; OpenSCENARIO the reference point, which is
    the middle of the rear axle. As long as that is on the arc, the ego points along its tangent, from which a
    point of the path a distance d ahead is off by d^2 / (2 R) to the inside. Past the arc it is less, and 0
    at the end.
    """
    if not family.turns:
        return 0.0
    near = cell.scenario[4:5] == "n"
    radius = TURN_RADIUS_NEAR_SIDE_M if near else TURN_RADIUS_M.get(cell.speed_kmh, TURN_RADIUS_NEAR_SIDE_M)
    # The front is half the target's width before the point when its near face is met; a corner at 45 degrees
    # is met half of its diagonal before.
    before = touch.entity_width_m / 2 * (math.sqrt(2.0) if family.corner_first else 1.0)
    return (touch.axle_to_front_m + before) ** 2 / (2.0 * radius)


def _off_the_side(touch: Touch) -> str:
    """Why a motorcyclist does not meet the side of the ego where it should; empty if it does."""
    behind = -100.0 * touch.ahead_m / touch.ego_length_m
    # here the motorcyclist's lateral deviation shifts the place itself, and the VUT's the time
    crossing_mps, ego_mps = abs(touch.entity_speed_kmh) / 3.6, abs(touch.ego_speed_kmh) / 3.6
    late_s = VUT_LATERAL_M / crossing_mps + SAMPLING_S if crossing_mps else 0.0
    allowed = 100.0 * (VEHICLE_LATERAL_M + late_s * ego_mps) / touch.ego_length_m
    if touch.part is Part.SIDE and abs(behind - SIDE_PLACE_PERCENT) <= allowed:
        return ""
    return (
        f"{_OFF}: without braking it meets the {touch.part} of the ego {behind:.0f} % of its length "
        f"behind the front, not its side at {SIDE_PLACE_PERCENT:g} % (within {allowed:.0f} %)"
    )
