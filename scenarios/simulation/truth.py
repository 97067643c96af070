"""Ground truth of a run at the present instant, for sensors, log and ends; perception has no access."""

from __future__ import annotations

import math

import numpy as np

from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Entities
from scenarios.openscenario.running.storyboard import STANDBY, EventElement
from scenarios.sensors.world import FlatGround, MapSurface, RoadSurface, World, reversed_course
from scenarios.simulation.drive import Asked, EgoDrive
from scenarios.simulation.levels import RoadLevels
from scenarios.simulation.motion_actions import is_motion, is_to_set_off
from smartmot.area import ego_extent
from smartmot.types import Boxes, EgoState, FloatArray, IntArray, StrArray, unchecked

STEP_S = 0.01
"""Frames, latencies and phases are multiples of it. Motion, triggers and contact are exact inside a step."""


class Truth:
    """Ego, target and all others as they are now; the engine's clock is the time of all answers.

    Args:
        engine: the world.
        drive: of the ego.
        backwards: whether the ego drives in reverse.
        frame_interval_s: time between frames, over which a change of the ego's speed is foreseen.

    Attributes:
        own: index of the ego among the scenario's entities.
        actors: (N,) indices of everybody else.
        target: index of the entity that the test is about; None: there is nobody else.
        category: (N,) names of the actors.
    """

    def __init__(self, engine: Engine, drive: EgoDrive, backwards: bool, frame_interval_s: float) -> None:
        self.engine, self.backwards = engine, backwards
        self._drive, self._interval_s = drive, frame_interval_s
        names = [entity.name for entity in engine.definition.entities]
        self.own = names.index(engine.ego.name)
        self.actors: IntArray = np.array([k for k in range(len(names)) if k != self.own], dtype=np.int64)
        self.target = names.index(engine.target) if engine.target else None
        self._entities: Entities | None = None
        self._boxes: Boxes | None = None
        entities = engine.definition.entities
        self.category: StrArray = np.array([e.category for e in entities], dtype=np.str_)[self.actors]
        self._height_m: FloatArray = np.array([e.height_m for e in entities], dtype=np.float64)[self.actors]
        self._object_id: IntArray = np.arange(len(self.actors))
        plane = engine.definition.map_path is None
        network = engine.world.locator.roads.network
        self._surface: RoadSurface = FlatGround() if plane else MapSurface(network)
        roads = engine.world.locator.roads
        self._levels = RoadLevels(roads.network) if roads.has_levels else None
        self._odometry: EgoState | None = None
        self._events: dict[str, list[EventElement]] = {}
        self._shown_states: dict[str, str] = {}

    @property
    def entities(self) -> Entities:
        """Everybody now; made once for all who ask at the same time."""
        entities = self._entities
        if entities is None or entities.time_s != self.engine.time_s:
            entities = self._entities = self.engine.entities
            self._boxes = None
        return entities

    @property
    def actor_boxes(self) -> Boxes:
        """N outlines of the actors now; made once for sensors and log."""
        entities = self.entities
        if self._boxes is None:
            self._boxes = entities.boxes[self.actors]
        return self._boxes

    def world(self, time_s: float) -> World:
        """Everybody but the ego, for sensors; the objects are numbered as in the log.

        Where roads lie above one another, sensors see the ego's level alone: a deck hides the street below.
        """
        entities, actors = self.entities, self.actors
        seen, ground_m, own_ground_m = entities.seen.take(actors), None, None
        if self._levels is not None:
            ground = self._ground_m()
            center_m = entities.boxes.center_m
            own_ground_m, ground_m = float(ground[self.own]), ground[actors]
            shared = self._levels.shared(center_m[self.own], own_ground_m, center_m[actors], ground_m)
            for k in actors[seen & ~shared].tolist():
                name = str(entities.name[k])
                line = f"'{name}' is not seen while it is on another level than the ego, above or below it"
                self.engine.world.note(line, (name, "another level"))
            seen = seen & shared
        return unchecked(
            World,
            time_s,
            self.actor_boxes,
            entities.speed_mps.take(actors),
            self._height_m,
            self._object_id,
            self.category,
            entities.exists.take(actors),
            seen,
            self._surface,
            ground_m,
            own_ground_m,
        )

    def changed_signals(self, time_s: float) -> list[tuple[str, str, tuple[float, float]]]:
        """Traffic signals that show something else than at the last call: id, state, and place on the map.

        One that the scenario's map does not have is at NaN, and a note names it.
        """
        world = self.engine.world
        states = world.signals.states(time_s)
        changed = [(name, state) for name, state in states.items() if self._shown_states.get(name) != state]
        self._shown_states = states
        rows = []
        for name, state in changed:
            place = world.locator.roads.network.place_of_signal(name)
            if place is None:
                world.note(
                    f"the map has no signal '{name}': its states have no place in the replay",
                    (name, "signal"),
                )
            rows.append((name, state, (math.nan, math.nan) if place is None else place[:2]))
        return rows

    def _ground_m(self) -> FloatArray:
        """Height of the ground below everybody, where roads lie above one another."""
        actors = self.engine.world.actors.values()
        heights = (actor.ground_m(actor.state(self.engine.time_s)) for actor in actors)
        return np.array([0.0 if height_m is None else height_m for height_m in heights])

    @property
    def ego_speed_mps(self) -> float:
        """The ego's speed now, negative in reverse."""
        return self.engine.ego_speed_mps

    def odometry(self, time_s: float) -> EgoState:
        """What the ego knows of itself; the turn rate is that since the last time it was asked for."""
        before = self._odometry
        if before is not None and before.stamp_s == time_s:
            return before
        k, entities = self.own, self.entities
        boxes = entities.boxes
        yaw, rate = float(boxes.yaw_rad[k]), 0.0
        if before is not None:
            rate = math.remainder(yaw - before.yaw_rad, 2 * math.pi) / (time_s - before.stamp_s)
        commanded = self.engine.ego.commanded
        self._odometry = EgoState(
            stamp_s=time_s,
            x_m=float(boxes.center_m[k, 0]),
            y_m=float(boxes.center_m[k, 1]),
            yaw_rad=yaw,
            speed_mps=float(entities.speed_mps[k]),
            accel_mps2=self._drive.accel_mps2 if commanded else self.asked(time_s).accel_mps2,
            yaw_rate_radps=rate,
            length_m=float(boxes.size_m[k, 0]),
            width_m=float(boxes.size_m[k, 1]),
        )
        return self._odometry

    def course(self, time_s: float) -> EgoState:
        """The odometry with the heading in which the ego drives: in reverse that of its rear."""
        odometry = self.odometry(time_s)
        return reversed_course(odometry) if self.backwards else odometry

    def asked(self, time_s: float) -> Asked:
        """What the scenario asks of the ego's speed, and how that changes until the next frame."""
        ego = self.engine.ego
        speed = ego.asked_mps(time_s)
        return Asked(speed, (ego.asked_mps(time_s + self._interval_s) - speed) / self._interval_s)

    def target_along_mps(self, time_s: float) -> float:
        """The target's speed in the direction in which the ego drives; 0 without a target."""
        if self.target is None:
            return 0.0
        entities = self.entities
        turn = float(entities.boxes.yaw_rad[self.target]) - self.course(time_s).yaw_rad
        return float(entities.speed_mps[self.target]) * math.cos(turn)

    def gap_to_target_m(self, time_s: float) -> float | None:
        """Free distance from the end of the ego that leads to the target's box (0 beside it)."""
        if self.target is None:
            return None
        ego = self.course(time_s)
        ahead = ego_extent(self.entities.boxes[[self.target]], ego)[0][0]
        return max(float(ahead) - ego.length_m / 2, 0.0)

    def is_to_change(self, name: str, time_s: float) -> bool:
        """Whether an event is left, or an action goes on, that changes the speed of an entity."""
        if self.engine.world.actors[name].profile.end_s > time_s:
            return True
        return any(event.state == STANDBY for event in self._motion_events(name))

    def target_has_begun(self) -> bool:
        """Whether an event that moves the target has begun; true where the scenario has none."""
        target = self.engine.target
        events = [] if target is None else self._motion_events(target)
        return not events or any(action.running for event in events for action in event.actions)

    def is_false_activation(self, flag_time_s: float | None) -> bool | None:
        """Whether the first request came before the target had set off; None where it does not do so.

        Args:
            flag_time_s: when the request came; None: there was none.
        """
        target = self.engine.target
        set_off_s = None if target is None else self.engine.world.actors[target].set_off_s
        if set_off_s is None:
            return flag_time_s is not None if is_to_set_off(self.engine.definition, target) else None
        if set_off_s <= STEP_S:
            return None
        return flag_time_s is not None and flag_time_s < set_off_s

    def _motion_events(self, name: str) -> list[EventElement]:
        """Events of the storyboard that change the speed of an entity; looked up once."""
        if name not in self._events:
            self._events[name] = [
                element
                for element in self.engine.storyboard.elements
                if isinstance(element, EventElement)
                and any(name in a.entities and is_motion(a.action) for a in element.event.actions)
            ]
        return self._events[name]
