"""Scenario files of CARLA, in its coordinates and as its ScenarioRunner reads them.

A file whose description begins with `CARLA:` is in the left-handed coordinates of CARLA (ScenarioRunner,
`OpenScenarioParser.set_use_carla_coordinate_system`): y and offsets to the right, headings clockwise. The
lanes are those of the OpenDRIVE file, whose y has the other sign.

ScenarioRunner looks at no `conditionEdge`: each condition that has been met once stays met
(`oneshot_with_check`), and a trigger fires once all of a group have been. A speed action of shape `step`
takes the speed at once and goes on for the time or the way that its value says (`ChangeActorTargetSpeed`).
No event stops another, whatever its `priority`; an action of the same entity and kind still does. A lane to
the left has a negative number (`RelativeTargetLane`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scenarios.openscenario.elements import Element
from scenarios.openscenario.model import (
    AngleCondition,
    ClothoidSegment,
    LanePosition,
    Orientation,
    RelativeAngleCondition,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    RoutePosition,
    TrajectoryPosition,
    WorldPosition,
)

MARK = "CARLA:"
"""Beginning of the description of such a file."""

_SIDEWAYS: dict[type[Element], tuple[str, ...]] = {
    Orientation: ("heading_rad",),
    WorldPosition: ("y_m", "heading_rad"),
    LanePosition: ("offset_m",),
    RelativeLanePosition: ("offset_m",),
    RelativeRoadPosition: ("dt_m",),
    RelativeWorldPosition: ("dy_m",),
    RelativeObjectPosition: ("dy_m",),
    RoutePosition: ("offset_m",),
    TrajectoryPosition: ("t_m",),
    ClothoidSegment: ("curvature_start_per_m", "curvature_end_per_m", "heading_offset_rad"),
    AngleCondition: ("angle_rad",),
    RelativeAngleCondition: ("angle_rad",),
}
"""Fields that have the other sign."""


def right_handed(record: Element) -> Element:
    """A record of such a file as the standard has it; one without coordinates as it is."""
    if isinstance(record, RoadPosition):  # ScenarioRunner takes the amount, to the right
        return replace(record, t_m=-abs(record.t_m))
    names = _SIDEWAYS.get(type(record), ())
    turned: dict[str, Any] = {name: -getattr(record, name) for name in names}
    return replace(record, **turned) if turned else record  # type: ignore[type-var]  # a dataclass
