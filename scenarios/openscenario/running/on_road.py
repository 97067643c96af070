"""Where entities are on the road: distances along it, its ends, and who is beside."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from opendrive.lanes.travel import ROUTE_LANE_TYPES
from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.lane_place import LanePlace
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.driving.separation import Separation
from scenarios.openscenario.running.holding import Holding, Mark
from scenarios.openscenario.running.world import TIME_EPSILON_S, Instant, World


class Lasting(Holding):
    """What holds once something has been so for a time.

    Args:
        duration_s: for how long it has to be.
        actor: on whom.
        world: in which.
    """

    def __init__(self, duration_s: float, actor: Actor, world: World) -> None:
        self._duration_s, self._actor, self._world = duration_s, actor, world
        self._since_s: float | None = None

    @abstractmethod
    def is_so(self, instant: Instant) -> bool:
        """Whether it is so at an instant."""

    def _so(self, instant: Instant) -> bool:
        so: bool | None = instant.memo.get(self)
        if so is None:
            so = instant.memo[self] = self.is_so(instant)
        return so

    def holds(self, instant: Instant) -> bool:
        """Whether it has been so for long enough; asked where anything changes, thus also where it begins."""
        if not self._so(instant):
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = instant.time_s
        return instant.time_s - self._since_s >= self._duration_s - TIME_EPSILON_S

    def mark(self, instant: Instant) -> Mark:
        """Also whether it has begun to be so."""
        so, since = self._so(instant), self._since_s
        long = so and since is not None and instant.time_s - since >= self._duration_s - TIME_EPSILON_S
        return so + 2 * long

    def next_s(self) -> float:
        """When it will have been so for long enough."""
        return math.inf if self._since_s is None else self._since_s + self._duration_s


class EndOfRoad(Lasting):
    """EndOfRoadCondition: at or beyond the end of its way, where the road ends; in reverse the end behind."""

    def is_so(self, instant: Instant) -> bool:
        """Whether it is there."""
        actor = self._actor
        state, path = instant.state(actor.name), actor.path
        if actor.on_trajectory or not path.on_road:
            return False
        back = actor.goes_back(state)
        end_m = path.first_m if back else path.length_m
        if (end_m - state.station_m) * (-1.0 if back else 1.0) > 1e-6:
            return False
        beyond = Pose(*path.pose(end_m)).moved(-0.01 if back else 0.01, 0.0)
        return self._world.locator.roads.place(beyond) is None


class OffRoad(Lasting):
    """OffroadCondition: the reference point is in no lane of a road, or beside it in one of type none."""

    def is_so(self, instant: Instant) -> bool:
        """Whether it is there."""
        return self._world.locator.roads.is_off_road(self._actor.pose(instant.time_s))


class Clearance(Holding):
    """RelativeClearanceCondition: no other entity is within a part of some lanes beside an entity.

    Where none of the lanes is, nothing is clear, as in esmini.

    Args:
        condition: as read.
        actor: whose clearance it is.
        world: who else is there.
    """

    def __init__(self, condition: model.RelativeClearanceCondition, actor: Actor, world: World) -> None:
        self._condition, self._actor, self._world = condition, actor, world
        self._there: dict[tuple[int, int], bool] = {}

    def _others(self) -> Sequence[Actor]:
        names = self._condition.entities or tuple(self._world.actors)
        actors = [self._world.actors[name] for name in names]
        return [other for other in actors if other is not self._actor and other.exists]

    def holds(self, instant: Instant) -> bool:
        """Whether one of the lanes is there, and all of it is free."""
        so: bool | None = instant.memo.get(self)
        if so is None:
            so = self._is_there(instant) and not any(self._is_in(other, instant) for other in self._others())
            instant.memo[self] = so
        return so

    def _is_there(self, instant: Instant) -> bool:
        """Whether the road has a lane to drive in of those asked for, where the entity is."""
        place = self._world.road_distances.place(self._actor.pose_in(instant.state(self._actor.name)))
        if place is None:
            return False
        key = place.lane, place.along_s
        if key not in self._there:
            lanes = self._world.locator.roads.network.lanes
            ids = [
                lanes.key[lane].lane_id
                for lane in np.flatnonzero(lanes.section == lanes.section[place.lane]).tolist()
                if str(lanes.lane_type[lane]) in ROUTE_LANE_TYPES
            ]
            self._there[key] = any(self._is_asked(place, lane_id) for lane_id in ids)
        return self._there[key]

    def _is_asked(self, place: LanePlace, lane_id: int) -> bool:
        """Whether a lane is one of those asked for, as seen from a place."""
        if not self._condition.opposite_lanes and lane_id * place.lane_id < 0:
            return False
        lanes, ranges = lanes_between(place.lane_id, lane_id) * place.along_s, self._condition.lanes
        return not ranges or any(low <= lanes <= high for low, high in ranges)

    def _is_in(self, other: Actor, instant: Instant) -> bool:
        condition, distances = self._condition, self._world.road_distances
        a, b = instant.state(self._actor.name), instant.state(other.name)
        pose, other_pose = self._actor.pose_in(a), other.pose_in(b)
        ahead, _ = distances.apart(pose, other_pose)
        if math.isnan(ahead):
            return False
        if condition.freespace:
            separation = Separation(self._world, self._actor, other, "road")
            apart = separation.between_m(a, b, lateral=False, freespace=True)
            ahead = math.copysign(max(apart, 0.0), ahead)
        if not -condition.backward_m <= ahead <= condition.forward_m:
            return False
        place, beside = distances.place(pose), distances.place(other_pose)
        hit = None if place is None or beside is None else distances.relate(place, beside)
        if place is None or beside is None or hit is None:
            return False
        return self._is_asked(place, beside.lane_id * hit[2])


def lanes_between(lane_id: int, other_id: int) -> int:
    """How many lanes another one is to the left along s; there is no lane 0."""
    across = lane_id * other_id < 0
    return other_id - lane_id - (int(math.copysign(1, other_id)) if across else 0)


class PlaceActor(Actor):
    """A position as conditions see it: a point that stands, or moves with the entities it is relative to.

    Args:
        position: as read.
        world: where it is.
    """

    def __init__(self, position: model.Position, world: World, moves: bool) -> None:
        super().__init__(model.EntityDefinition("a position", "", "unknown", *(1e-9,) * 3, 0.0, 0.0))
        self._position, self._world, self._moves = position, world, moves
        self._fixed: State | None = None
        self._z_m: float | None = None

    def ground_m(self, state: State) -> float | None:
        """Height of the position, where it has one."""
        return self._z_m

    def state(self, time_s: float) -> State:
        """Where it is; a place that is nowhere is infinitely far away."""
        if self._fixed is not None:
            return self._fixed
        world = self._world
        try:
            pose = world.locator.at(lambda name: world.actors[name].pose(time_s)).pose(self._position)
        except RunError:
            return State(math.nan, math.nan, 0.0, 0.0, 0.0, 0.0)
        self._z_m = pose.z_m
        state = State(pose.x_m, pose.y_m, pose.yaw_rad, 0.0, 0.0, 0.0)
        if not self._moves:
            self._fixed = state
        return state

    def fastest_mps(self, time_s: float) -> float:
        """Nothing, or not known."""
        return math.inf if self._moves else 0.0

    def steady(self, time_s: float) -> bool:
        """Whether it stands."""
        return not self._moves

    def turn_rad(self, state: State, later: State) -> float:
        """How much it turns."""
        return abs(math.remainder(later.yaw_rad - state.yaw_rad, 2 * math.pi))
