"""What stands along the road of a run: furniture of the map, but nothing in the way of its road users."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.running.engine import Engine
from scenarios.sensors.lidar.street import BARE, Furnished, Street, furnished_street
from scenarios.sensors.world import MapSurface
from scenarios.simulation.ends import TIME_LIMIT_S
from smartmot.geometry import near_pairs
from smartmot.overlap import intersection_area
from smartmot.types import BoolArray, Boxes

SAMPLE_S = 0.1
"""How often it is looked at where road users are: a runner moves 0.3 m meanwhile, less than its own width."""

CLEARANCE_M = 0.1
"""Free width that a road user has beside its outline; assumed. More would clear what a real street has."""


@dataclass(frozen=True, slots=True, eq=False)
class RunStreet:
    """Makes the street of one run when it is asked for.

    A copy shares all of it: nothing is ever changed.

    Args:
        furnished: how; None: nothing stands along the road.
        network: the map along whose lanes furniture stands: that of perception.
        definition: the scenario.
        roads: the scenario's own map.
    """

    furnished: Furnished | None
    network: RoadNetwork
    definition: ScenarioDefinition
    roads: Roads

    def __deepcopy__(self, memo: object) -> RunStreet:
        return self

    def __call__(self) -> Street:
        """The street.

        Raises:
            ScenarioError: the scenario has no map.
        """
        if self.furnished is None:
            return BARE
        if self.definition.map_path is None:
            raise ScenarioError(
                f"{self.definition.path}: street=furnished needs a map, along whose lanes furniture stands, "
                "and the scenario has none; use street=bare"
            )
        street = _along(self.network, self.roads.network, self.furnished)
        return street.without(_touched(street, self.definition, self.roads))


@lru_cache(maxsize=8)
def _along(network: RoadNetwork, ground: RoadNetwork, furnished: Furnished) -> Street:
    """The street of a map, standing on the ground of another, or of the same; made once."""
    surface = None if ground is network else MapSurface(ground)
    return furnished_street(network, furnished.density_per_100_m, furnished.seed, surface=surface)


def _touched(street: Street, definition: ScenarioDefinition, roads: Roads) -> BoolArray:
    """(F,) pieces of furniture in which a road user of the scenario would stand or walk, the ego included."""
    swept = swept_outlines(definition, roads)
    touched = np.zeros(len(street.footprint), dtype=np.bool_)
    pieces = street.footprint
    reach = [0.5 * np.hypot(*boxes.size_m.T) for boxes in (pieces, swept)]
    piece, at = near_pairs(pieces.center_m, swept.center_m, *reach)
    a, b = pieces[piece], swept[at]
    area = intersection_area(a.center_m, a.size_m, a.yaw_rad, b.center_m, b.size_m, b.yaw_rad)
    touched[piece[area > 0.0]] = True
    return touched


def swept_outlines(definition: ScenarioDefinition, roads: Roads) -> Boxes:
    """Outlines of all road users along the unbraked run, past a contact, each with clearance around it."""
    engine = Engine(definition, roads=roads)
    centers, sizes, yaws = [], [], []
    next_s = 0.0
    while True:
        entities = engine.entities
        boxes = entities.boxes[np.flatnonzero(entities.exists)]
        centers.append(boxes.center_m)
        sizes.append(boxes.size_m)
        yaws.append(boxes.yaw_rad)
        if engine.over or next_s >= TIME_LIMIT_S:
            break
        next_s += SAMPLE_S
        engine.advance(SAMPLE_S)
    rows = np.column_stack(
        (np.concatenate(centers), np.concatenate(sizes) + 2.0 * CLEARANCE_M, np.concatenate(yaws))
    )
    rows = np.unique(np.round(rows, 6), axis=0)  # who stands is there once
    return Boxes(rows[:, :2], rows[:, 2:4], rows[:, 4])
