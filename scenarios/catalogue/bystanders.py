"""People and cars around a crossing that have no part in the test, as in figure 5c, d of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from opendrive import RoadNetwork
from scenarios.openscenario.model import (
    Action,
    EntityDefinition,
    ScenarioDefinition,
    SpeedAction,
    TeleportAction,
    WorldPosition,
)
from scenarios.openscenario.motion.paths import Pose
from scenarios.places import kerb_m, lane_under

CAR_WIDTH_M = 1.8
SIZES_M = {"car": (4.4, CAR_WIDTH_M), "pedestrian": (0.60, 0.50)}
"""Length and width; people are the Euro NCAP adult target EPTa, along and across its walking direction."""
HEIGHT_M = 1.6
KERB_GAP_M = 0.1


@dataclass(frozen=True, slots=True)
class Bystander:
    """One of them: car or pedestrian, the middle of its box, and its constant speed."""

    category: str
    pose: Pose
    speed_mps: float = 0.0


def add_bystanders(
    definition: ScenarioDefinition, bystanders: Sequence[Bystander], name: str = "bystander"
) -> ScenarioDefinition:
    """A scenario with more entities, called by the name and a number from 1."""
    entities = list(definition.entities)
    init: list[tuple[str | None, Action]] = list(definition.init)
    for number, bystander in enumerate(bystanders, start=1):
        own_name, category, pose = f"{name} {number}", bystander.category, bystander.pose
        size = SIZES_M[category]
        entities.append(EntityDefinition(own_name, category, category, *size, HEIGHT_M, 0.0, 0.0))
        init.append((own_name, TeleportAction(WorldPosition(pose.x_m, pose.y_m, pose.yaw_rad))))
        if bystander.speed_mps:
            init.append((own_name, SpeedAction("step", "time", 0.0, bystander.speed_mps)))
    return replace(definition, entities=tuple(entities), init=tuple(init))


def with_bystanders(definition: ScenarioDefinition, network: RoadNetwork) -> ScenarioDefinition:
    """A crossing test with bystanders, placed from its parameters Line_x, Line_y, Line_yaw and Side.

    Cars stand 0.1 m from the far kerb, pedestrians 0.9 m over the near kerb (inside the usual margin of
    1.8 m) and 2.2 m over it (outside), and on the far sidewalk.

    Raises:
        ScenarioError: the crossing is on no driving lane.
    """
    x, y, yaw = (float(definition.parameters[name]) for name in ("Line_x", "Line_y", "Line_yaw"))
    line, side = Pose(x, y, yaw), int(definition.parameters["Side"])
    lane, s_m = lane_under(network, line)
    near, far = (kerb_m(network, lane, s_m, k)[0] for k in (side, -side))
    # where the far kerb is too near for a parked car (the innermost lane of a divided road) none stands there
    roomy = far >= float(network.lane_width(lane, s_m)) / 2 + CAR_WIDTH_M + 2 * KERB_GAP_M
    parked = -(far - CAR_WIDTH_M / 2 - KERB_GAP_M)
    cars = [(along, parked) for along in (-25.0, -12.0, 3.0, 12.0)] if roomy else []
    people = [(along, near + 0.9) for along in (-18.0, 6.0, 14.0)]
    people += [(along, near + 2.2) for along in (-22.0, 9.0)]
    people.append((2.0, -(far + 1.0)))
    return add_bystanders(
        definition,
        [
            *(Bystander("car", line.moved(along, side * across, np.pi)) for along, across in cars),
            *(Bystander("pedestrian", line.moved(along, side * across, 0.0)) for along, across in people),
        ],
    )
