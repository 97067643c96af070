"""Criteria by which CARLA's ScenarioRunner judges a run, for the ego."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opendrive.lanes.travel import ROUTE_LANE_TYPES
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.reading.document import as_number
from scenarios.openscenario.running.actors import Actor, State
from smartmot.geometry import corners

LOOK_S = 0.1
"""Criteria of places look this often where the ego is."""

PLACES = frozenset({"OnSidewalkTest", "WrongLaneTest", "KeepLaneTest"})
"""Criteria that ask where the ego is; outside junctions."""

_UNKNOWN = {
    "RunningRedLightTest": "which lanes a traffic light stops is not looked at",
    "RunningStopTest": "stop signs are not looked at",
}


@dataclass(frozen=True, slots=True)
class Criterion:
    """A criterion and what came of it so far.

    Args:
        name: as the file has it, without `criteria_`.
        met: whether it is met so far; None: it is not evaluated.
        detail: numbers, or why it is not evaluated; may be empty.
    """

    name: str
    met: bool | None
    detail: str = ""

    def __str__(self) -> str:
        verdict = {True: "met", False: "not met", None: "not evaluated"}[self.met]
        return f"criterion {self.name}: {verdict}{f' ({self.detail})' if self.detail else ''}"


class Criteria:
    """Judges the ego's run.

    Args:
        asked: names and values as read.
        ego: whom they are about.
        roads: the map.
    """

    def __init__(self, asked: Sequence[tuple[str, str]], ego: Actor, roads: Roads) -> None:
        self._asked, self._ego, self._roads = asked, ego, roads
        self._failed: dict[str, float] = {}
        self._top_mps = 0.0
        self._next_s = -math.inf
        self._places = PLACES.intersection(name for name, _ in asked)

    @property
    def looks(self) -> bool:
        """Whether it asks from time to time where the ego is."""
        return bool(self._places)

    def look(self, time_s: float, state: State) -> None:
        """Take in where the ego is now, and how fast."""
        self._top_mps = max(self._top_mps, abs(state.speed_mps))
        if not self._places or time_s < self._next_s or not self._ego.exists:
            return
        self._next_s = time_s + LOOK_S
        for name in self._broken(state):
            self._failed.setdefault(name, time_s)

    def _broken(self, state: State) -> set[str]:
        """Criteria of places that are not met now; in junctions, where lanes cross, none is broken."""
        x_m, y_m, length_m, width_m, yaw_rad = self._ego.box(state)
        network, height_m = self._roads.network, self._ego.ground_m(state)
        place = self._roads.place(Pose(x_m, y_m, yaw_rad, height_m))
        if place is None or network.roads[place.road_id].record.junction_id is not None:
            return set()
        broken, lanes = set(), network.lanes
        kind = str(lanes.lane_type[place.lane])
        if kind == "sidewalk":
            broken.add("OnSidewalkTest")
        if kind in ROUTE_LANE_TYPES and place.along_s != self._roads.direction(place.lane):
            broken.add("WrongLaneTest")
        outline = corners(np.array([[x_m, y_m]]), np.array([[length_m, width_m]]), np.array([yaw_rad]))[0]
        touched = network.locate(outline, height_m if self._roads.has_levels else None).lane
        if (lanes.section[touched] == lanes.section[place.lane])[touched != place.lane].any():
            broken.add("KeepLaneTest")
        return broken

    def judged(self, collided: bool, driven_m: float) -> tuple[Criterion, ...]:
        """Every criterion so far.

        Args:
            collided: whether the ego has touched anybody.
            driven_m: by the ego.
        """
        return tuple(self._judge(name, as_number(value), collided, driven_m) for name, value in self._asked)

    def _judge(self, name: str, value: float | None, collided: bool, driven_m: float) -> Criterion:
        if name == "CollisionTest":
            return Criterion(name, not collided)
        if name in PLACES and self._roads.network.roads:
            since_s = self._failed.get(name)
            return Criterion(name, since_s is None, "" if since_s is None else f"at {since_s:.1f} s")
        if name == "DrivenDistanceTest" and value is not None:
            return Criterion(name, driven_m >= value, f"{driven_m:.1f} m of {value:g} m")
        if name == "MaxVelocityTest" and value is not None:
            return Criterion(name, self._top_mps <= value, f"{self._top_mps:.1f} m/s of {value:g} m/s")
        if name in PLACES:
            return Criterion(name, None, "there are no roads")
        if name in ("DrivenDistanceTest", "MaxVelocityTest"):
            return Criterion(name, None, "it has no number")
        return Criterion(name, None, _UNKNOWN.get(name, "not known here"))
