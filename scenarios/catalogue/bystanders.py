"""People and parked cars around a crossing that have no part in the test (figure 5c, d of the paper)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opendrive import RoadNetwork
from scenarios.openscenario.model import (
    Action,
    EntityDefinition,
    ScenarioDefinition,
    TeleportAction,
    WorldPosition,
)
from scenarios.openscenario.motion.paths import Pose
from scenarios.places import kerb_m, lane_under

CAR_LENGTH_M, CAR_WIDTH_M = 4.4, 1.8
ADULT_LENGTH_M, ADULT_WIDTH_M = 0.60, 0.50
"""Euro NCAP adult target EPTa: along and across its walking direction."""
KERB_GAP_M = 0.1


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
    entities: list[EntityDefinition] = []
    places: list[tuple[str | None, Action]] = []

    def put(category: str, along: float, across: float, size: tuple[float, float], turn: float = 0.0) -> None:
        name = f"bystander {len(entities) + 1}"
        pose = line.moved(along, side * across, turn)
        entities.append(EntityDefinition(name, category, category, *size, 1.6, 0.0, 0.0))
        places.append((name, TeleportAction(WorldPosition(pose.x_m, pose.y_m, pose.yaw_rad))))

    # where the far kerb is too near for a parked car (the innermost lane of a divided road) none stands there
    roomy = far >= float(network.lane_width(lane, s_m)) / 2 + CAR_WIDTH_M + 2 * KERB_GAP_M
    for along in (-25.0, -12.0, 3.0, 12.0) if roomy else ():
        put("car", along, -(far - CAR_WIDTH_M / 2 - KERB_GAP_M), (CAR_LENGTH_M, CAR_WIDTH_M), np.pi)
    adult = (ADULT_LENGTH_M, ADULT_WIDTH_M)
    for along in (-18.0, 6.0, 14.0):
        put("pedestrian", along, near + 0.9, adult)
    for along in (-22.0, 9.0):
        put("pedestrian", along, near + 2.2, adult)
    put("pedestrian", 2.0, -(far + 1.0), adult)
    return replace(
        definition,
        entities=(*definition.entities, *entities),
        init=(*definition.init, *places),
    )
