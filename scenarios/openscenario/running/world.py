"""Everything that conditions and actions of a run refer to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import Controller, Environment
from scenarios.openscenario.motion.positions import Locator
from scenarios.openscenario.motion.road_distances import RoadDistances
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.driving.signals import Signals
from smartmot.geometry import signed_gap_scalar

TIME_EPSILON_S = 1e-9
"""Times closer than this are the same."""


@dataclass(slots=True)
class Instant:
    """A time and the states of the entities at it; states are worked out when they are asked for.

    Args:
        time_s: when.
        actors: entities by name.
        memo: what has been worked out for it.
    """

    time_s: float
    actors: Mapping[str, Actor]
    memo: dict[object, Any] = field(default_factory=dict)

    def state(self, name: str) -> State:
        """State of an entity."""
        state: State | None = self.memo.get(name)
        if state is None:
            state = self.memo[name] = self.actors[name].state(self.time_s)
        return state

    def gap_m(self, a: str, b: str) -> float:
        """Free distance of two outlines; not positive where they touch or overlap."""
        gap: float | None = self.memo.get((a, b))
        if gap is None:
            box, other_box = self.actors[a].box(self.state(a)), self.actors[b].box(self.state(b))
            gap = signed_gap_scalar(box, other_box)
            self.memo[a, b] = gap
        return gap

    def above(self, a: str, b: str) -> bool:
        """Whether one entity is wholly above the other, as on a bridge."""
        actor, other = self.actors[a], self.actors[b]
        ground_m, other_ground_m = actor.ground_m(self.state(a)), other.ground_m(self.state(b))
        if ground_m is None or other_ground_m is None:
            return False
        top_m, other_top_m = ground_m + actor.definition.height_m, other_ground_m + other.definition.height_m
        return ground_m > other_top_m or other_ground_m > top_m

    def circle_gap_m(self, a: str, b: str) -> float:
        """A lower bound of the free distance, quickly."""
        state, other = self.state(a), self.state(b)
        reach = self.actors[a].radius_m + self.actors[b].radius_m
        dx, dy = state.x_m - other.x_m, state.y_m - other.y_m
        return float((dx * dx + dy * dy) ** 0.5) - reach


class Clock(NamedTuple):
    """Time of day: which it was at an instant of the run, in seconds since 1970, and whether it goes on."""

    since_s: float
    day_s: float
    goes_on: bool


@dataclass(slots=True)
class World:
    """State of a run apart from the storyboard.

    Args:
        actors: entities by name.
        locator: positions, routes, trajectories.
        variables: present values.
        element_state: tells whether a storyboard element is in a state or just made a transition.
        environment: light and weather, if the scenario sets them.
        clock: time of day, if the scenario sets it.
        apply_performance: whether entities stay within their Performance, whatever the file asks for.
        ego: name of the ego.
        assigned: controllers that actions have given to entities.
        parameters: present values.
        signals: traffic signals.
    """

    actors: dict[str, Actor]
    locator: Locator
    variables: dict[str, Value]
    element_state: Callable[[str, tuple[str, ...], str], bool] = lambda kind, path, state: False
    environment: Environment | None = None
    clock: Clock | None = None
    apply_performance: bool = False
    ego: str = ""
    assigned: dict[str, list[Controller]] = field(default_factory=dict)
    parameters: dict[str, Value] = field(default_factory=dict)
    signals: Signals = field(default_factory=Signals)
    _road_distances: RoadDistances | None = None
    _notes: dict[tuple[str, ...], tuple[float, str]] = field(default_factory=dict)

    @property
    def road_distances(self) -> RoadDistances:
        """Distances along the roads."""
        if self._road_distances is None:
            self._road_distances = RoadDistances(self.locator.roads)
        return self._road_distances

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines about what is not as the file asks for it."""
        return tuple(line for _, line in self._notes.values())

    def note(self, line: str, about: tuple[str, ...] = (), amount: float = 0.0) -> None:
        """Take a note; of those about the same, the one of the greatest amount stays."""
        key = about or (line,)
        if key not in self._notes or self._notes[key][0] < amount:
            self._notes[key] = amount, line
