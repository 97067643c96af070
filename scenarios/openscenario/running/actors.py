"""Entities of a run: where each is at any time of the present step, in closed form.

Long because all that changes how one entity moves shares one anchor: path, speed, tow, trailer, controller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol

from scenarios.openscenario.control import EgoController
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import EntityDefinition
from scenarios.openscenario.motion.paths import SPACING_M, Path, Pose, straight
from scenarios.openscenario.motion.profiles import SpeedProfile
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.motion.route_changes import Leg
from scenarios.openscenario.motion.towing import drawn

STANDING_MPS = 1e-9
"""Slower than this is standing."""

MAX_ACCELERATION_MPS2 = 20.0
"""No controller accelerates or brakes harder; bounds how soon outlines can meet."""

JUMP_M = 0.05
"""A trailer whose towing vehicle is put further away from it than this stands straight behind it again."""

KAPPA_M = 0.05
"""Distance on both sides over which the curvature of a path is taken: that of its points."""

MOMENT_S = 1e-4
"""Over which a place that depends on a leader's speed moves, for the speed of who is there."""

COMMAND_EPSILON_S = 1e-9
"""A controller that commands from an instant this near on commands now."""


class State(NamedTuple):
    """Reference point of an entity at an instant, map frame; speed along the heading."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    station_m: float
    travelled_m: float

    @property
    def pose(self) -> Pose:
        """Point and heading, without height; see `Actor.pose`."""
        return Pose(self.x_m, self.y_m, self.yaw_rad)

    def __deepcopy__(self, memo: dict[int, object]) -> State:
        return self


state_of = partial(tuple.__new__, State)
"""A state from a tuple, in half the time of its constructor."""


class Kept(Protocol):
    """A place on a path that moves with another entity; `gap_s`: at a time at its speed."""

    gap_s: float | None

    def left_m(self, own: State, seen: State) -> float:
        """How far the place is ahead; NaN if there is none."""
        ...

    def on(self, path: Path, own: State, seen: State) -> State | None:
        """The state of an entity there, near a state of it; None if there is no such place."""
        ...

    def rates(self, path: Path, own: State, seen: State, left_m: float) -> tuple[float, float]:
        """By how much what is left shrinks per metre of way, and the speed at which the place moves."""
        ...


@dataclass(frozen=True, slots=True)
class Tow:
    """Kept at a distance from another entity, on the own path.

    Args:
        leader: the other entity.
        place: where on the path that is.
        ahead_m: along the path from its reference point, where there is no such place.
    """

    leader: Actor
    place: Kept
    ahead_m: float


@dataclass(frozen=True, slots=True)
class Coupling:
    """A trailer's connection with the vehicle that tows it, which may itself be a trailer.

    Args:
        tower: the towing vehicle.
        hitch_m: of the hitch from the reference point of the towing vehicle, forward.
        coupler_m: of the coupler from the reference point of the trailer, forward, positive.
    """

    tower: Actor
    hitch_m: float
    coupler_m: float

    def hitch(self, pose: Pose) -> tuple[float, float]:
        """Where the hitch is if the towing vehicle is there."""
        at = pose.moved(self.hitch_m, 0.0)
        return at.x_m, at.y_m

    def behind(self, pose: Pose) -> Pose:
        """Pose of the trailer straight behind the towing vehicle."""
        return pose.moved(self.hitch_m - self.coupler_m, 0.0)


class Actor:
    """One entity.

    Motion is anchored at an instant: from there on the path and the speed profile give every later state.

    Args:
        definition: as read.
    """

    def __init__(self, definition: EntityDefinition) -> None:
        self.definition = definition
        self.name = definition.name
        self.front_m = definition.center_x_m + definition.length_m / 2
        self.rear_m = definition.length_m / 2 - definition.center_x_m
        self.radius_m = math.hypot(
            abs(definition.center_x_m) + definition.length_m / 2,
            abs(definition.center_y_m) + definition.width_m / 2,
        )
        self.placed = False
        self.exists = True
        self.seen = True
        self.levels: Roads | None = None  # the roads, where some lie above one another
        self._ground_m = 0.0
        self.lights: dict[str, str] = {}
        self.path: Path = straight(Pose(0.0, 0.0, 0.0))
        self.on_trajectory = False
        self.profile = SpeedProfile(0.0, 0.0)
        self.tow: Tow | None = None
        self.coupling: Coupling | None = None
        self.trailer: Actor | None = None
        self.unparted: list[Actor] = []  # with whom there is no contact until outlines have been apart once
        self.route: list[Leg] | None = None
        self.controller: EgoController | None = None
        self.commanded = False
        self.standing_since_s: float | None = 0.0
        self.paced_by: Actor | None = None  # whose speed it follows all the time
        self.left_pose: Pose | None = None  # where it was when it was deleted
        self.left_mps = 0.0
        self.set_off_s: float | None = None
        self._towed_path: Path | None = None
        self._towed_s = self._towed_m = self._towed_mps = 0.0
        self._steady_s = 0.0
        self._yaw_offset = 0.0
        self._reversed = False
        self._noted_s = self._noted_mps = 0.0
        self._anchor_s = 0.0
        self._anchor_station = 0.0
        self._anchor_travelled = 0.0
        self._anchor_distance = 0.0
        self._anchor_pose = Pose(0.0, 0.0, 0.0)

    # Where it is

    def state(self, time_s: float) -> State:
        """State at a time from the anchor on."""
        pose = None
        if self.coupling is not None:
            return self._drawn(self.coupling, time_s)
        if self.controller is not None and self.commanded:
            motion = self.controller.motion(self._anchor_s, time_s - self._anchor_s)
            distance, speed, pose = motion.distance_m, motion.speed_mps, motion.pose
        elif self.tow is not None:
            return self._towed(time_s)
        else:
            profile = self.profile
            if time_s >= profile.end_s:  # most of the time
                speed = profile.final_mps
                distance = profile.length_m + speed * (time_s - profile.end_s) - self._anchor_distance
            else:
                distance, speed = profile.at(time_s)
                distance -= self._anchor_distance
        gone = abs(distance)
        station = self._anchor_station + (gone if self.on_trajectory else distance)
        if pose is not None:
            return state_of((pose.x_m, pose.y_m, pose.yaw_rad, speed, station, self._anchor_travelled + gone))
        x, y, yaw = self.path.pose(station)
        yaw += self._yaw_offset
        if self.on_trajectory:
            if self.path.reverse_at(station):
                speed = -speed
            elif self.path.reverse is None and self._backwards(speed):
                yaw += math.pi
        return state_of((x, y, yaw, speed, station, self._anchor_travelled + gone))

    def _towed(self, time_s: float) -> State:
        assert self.tow is not None
        tow, path = self.tow, self.path
        leader = tow.leader.state(time_s)
        near_m = self._towed_m
        if self._towed_path is not path:
            self._towed_path = path
            self._towed_s, self._towed_m, self._towed_mps = time_s, self._anchor_station, self._noted_mps
            near_m = path.project(leader.x_m, leader.y_m)[0] + tow.ahead_m
        there = tow.place.on(path, State(*path.pose(near_m), 0.0, near_m, 0.0), leader)
        if there is None:  # on as it is
            station, along = self._towed_m + self._towed_mps * (time_s - self._towed_s), self._towed_mps
            x, y, yaw = path.pose(station)
        else:
            x, y, yaw, _, station, _ = there
            along = tow.place.rates(path, there, leader, tow.place.left_m(there, leader))[1]
            if tow.place.gap_s is not None:  # the gap changes with the leader's speed
                later = tow.leader.state(time_s + MOMENT_S)
                smooth = abs(later.speed_mps - leader.speed_mps) <= MAX_ACCELERATION_MPS2 * MOMENT_S
                ahead = tow.place.on(path, there, later) if smooth else None
                along = along if ahead is None else (ahead.station_m - station) / MOMENT_S
            along = self._towed_mps if math.isnan(along) else along
            self._towed_s, self._towed_m, self._towed_mps = time_s, station, along
        gone = abs(station - self._anchor_station)
        return State(x, y, yaw + self._yaw_offset, along, station, self._anchor_travelled + gone)

    def _drawn(self, coupling: Coupling, time_s: float) -> State:
        """Behind the towing vehicle, from where it was at the anchor."""
        tower, since_s = coupling.tower, self._anchor_s
        end = coupling.hitch(tower.state(time_s).pose)
        coupler = self._anchor_pose.moved(coupling.coupler_m, 0.0)
        pieces = max(math.ceil(math.dist(end, (coupler.x_m, coupler.y_m)) / SPACING_M), 1)
        times = (since_s + (time_s - since_s) * k / pieces for k in range(1, pieces))
        hitches = [*(coupling.hitch(tower.state(t).pose) for t in times), end]
        pose, way_m = drawn(self._anchor_pose, coupling.coupler_m, hitches)
        speed_mps = self.moves(pose.yaw_rad, time_s)[0]
        station = self._anchor_station + way_m
        gone = self._anchor_travelled + abs(way_m)
        return State(pose.x_m, pose.y_m, pose.yaw_rad, speed_mps, station, gone)

    def _backwards(self, speed_mps: float) -> bool:
        return speed_mps < 0.0 or (speed_mps == 0.0 and self._reversed)

    def goes_back(self, state: State) -> bool:
        """Whether it drives in reverse, or stands and did so before."""
        return self._backwards(state.speed_mps)

    def moves(self, yaw_rad: float, time_s: float) -> tuple[float, float]:
        """Speed along the heading, m/s, and turn rate, rad/s; of a trailer as its hitch draws it."""
        if self.coupling is None:
            state = self.state(time_s)
            before, after = (self.path.pose(state.station_m + s)[2] for s in (-KAPPA_M, KAPPA_M))
            return state.speed_mps, (after - before) / (2 * KAPPA_M) * self.progress_mps(state)
        tower = self.coupling.tower
        tower_yaw = tower.state(time_s).yaw_rad
        speed, rate = tower.moves(tower_yaw, time_s)
        across, turned = rate * self.coupling.hitch_m, tower_yaw - yaw_rad
        c, s = math.cos(turned), math.sin(turned)
        return speed * c - across * s, (speed * s + across * c) / self.coupling.coupler_m

    def train(self) -> Actor:
        """The vehicle at the head of those that it is coupled with: itself, if it is towed by none."""
        return self if self.coupling is None else self.coupling.tower.train()

    def depends_on(self, other: Actor) -> bool:
        """Whether it is another one, or its place follows from that one's."""
        chain: Actor | None = self
        while chain is not None and chain is not other:
            follows = chain.coupling.tower if chain.coupling is not None else None
            chain = chain.tow.leader if chain.tow is not None else follows
        return chain is not None

    def towed(self) -> list[Actor]:
        """It and the trailers behind it."""
        return [self] if self.trailer is None else [self, *self.trailer.towed()]

    def pose(self, time_s: float) -> Pose:
        """Point and heading at a time, with the height of the ground where roads lie above one another."""
        return self.pose_in(self.state(time_s))

    def pose_in(self, state: State) -> Pose:
        """Point and heading in a state of this step, with that height."""
        return Pose(state.x_m, state.y_m, state.yaw_rad, self.ground_m(state))

    def ground_m(self, state: State) -> float | None:
        """Height of the ground below it; None where no roads lie above one another.

        On a way along lanes that of the lane; else it stays on its level from step to step.
        """
        if self.levels is None:
            return None
        if self.coupling is not None:
            return self.levels.ground_m(state.x_m, state.y_m, self.coupling.tower._ground_m)
        lane_m = self.levels.lane_height_m(self.path, state.station_m, state.x_m, state.y_m)
        return self.levels.ground_m(state.x_m, state.y_m, self._ground_m) if lane_m is None else lane_m

    # How it can move

    def fastest_mps(self, time_s: float) -> float:
        """Greatest speed within the second after a time, as an amount; infinite if that is not known."""
        if self.coupling is not None or (self.tow is not None and not self.commanded):
            return math.inf
        if self.controller is None:
            return self.profile.fastest_mps
        return max(self.profile.fastest_mps, abs(self._noted_mps)) + MAX_ACCELERATION_MPS2

    def steady(self, time_s: float) -> bool:
        """Whether its speed stays as it is unless something intervenes."""
        if self.coupling is not None:
            return self.rests(time_s)
        return self.tow is None and not self.commanded and time_s >= self.profile.end_s

    def rests(self, time_s: float) -> bool:
        """Whether it stands until something intervenes."""
        if self.coupling is not None:
            return self.coupling.tower.rests(time_s)
        return self.steady(time_s) and self.profile.final_mps == 0.0

    @property
    def goes_alone(self) -> bool:
        """Whether it goes along its path forward, by its profile or its controller, and by nobody else."""
        alone = self.tow is None and self.coupling is None
        return alone and not self.unparted and not self.profile.goes_back

    def next_kink_s(self, after_s: float) -> float:
        """When its speed next stops to grow or to fall."""
        if self.tow is not None or self.commanded or self.coupling is not None:
            return math.inf
        return self.profile.next_kink_s(after_s)

    def turn_rad(self, state: State, later: State) -> float:
        """How much it turns between two states at most, whichever way."""
        if self.coupling is not None:
            return abs(later.yaw_rad - state.yaw_rad)
        if state.station_m == later.station_m:
            return 0.0
        turn = self.path.turn_rad(state.station_m, later.station_m)
        if self.commanded:  # the controller may have left the path
            turn = max(turn, abs(math.remainder(later.yaw_rad - state.yaw_rad, 2 * math.pi)))
        return turn

    def standing_since(self, time_s: float, state: State) -> float | None:
        """Since when it stands; None if it moves."""
        if abs(state.speed_mps) > STANDING_MPS:
            return None
        if self.standing_since_s is not None:
            return self.standing_since_s
        # it moved when that was noted last, and stands now: halve down to when it came to rest
        low, high = self._noted_s, time_s
        while high - low > COMMAND_EPSILON_S:
            middle = 0.5 * (low + high)
            if abs(self.state(middle).speed_mps) > STANDING_MPS:
                low = middle
            else:
                high = middle
        return high

    # How it moves on

    def pass_on(self, time_s: float, state: State) -> None:
        """Take note of the end of a step; who is driven by a controller is anchored there."""
        if self.levels is not None:
            self._ground_m = self.ground_m(state) or 0.0
        if self.commanded or self.coupling is not None:
            self._anchor(time_s, state)
        else:
            stops = self.standing_since_s is None and abs(state.speed_mps) <= STANDING_MPS
            self._note(time_s, state.speed_mps, self.standing_since(time_s, state) if stops else None)

    def anchor(self, time_s: float, state: State | None = None) -> State:
        """Anchor the motion at a time, after which earlier states are no longer asked for."""
        state = state or self.state(time_s)
        self._anchor(time_s, state)
        return state

    def _anchor(self, time_s: float, state: State) -> None:
        since = self.standing_since(time_s, state)
        if self.controller is not None and self.commanded:
            self.controller.advance(self._anchor_s, time_s - self._anchor_s)
        self._anchor_s, self._anchor_station = time_s, state.station_m
        self._anchor_travelled = state.travelled_m
        self._anchor_pose = state.pose
        self._anchor_distance = self.profile.at(time_s)[0]
        self._note(time_s, state.speed_mps, since)

    def _note(self, time_s: float, speed_mps: float, standing_since_s: float | None) -> None:
        self._noted_s, self._noted_mps = time_s, speed_mps
        if abs(speed_mps) > STANDING_MPS:
            self.standing_since_s = None
            self._reversed = speed_mps < 0.0
            if self.set_off_s is None:
                alone = self.tow is None and self.coupling is None and not self.commanded
                self.set_off_s = min(self.profile.sets_off_s(), time_s) if alone else time_s
        elif self.standing_since_s is None:
            self.standing_since_s = time_s if standing_since_s is None else standing_since_s

    def heed(self, time_s: float) -> bool:
        """Let the controller take command, or give it back, as it says; whether that has changed."""
        if self.controller is None:
            return False
        commands = self.controller.commands_from_s <= time_s + COMMAND_EPSILON_S
        if commands == self.commanded:
            return False
        state = self.anchor(time_s)
        if commands:
            self.controller.take_over(time_s, self.path, state.station_m, state.speed_mps)
        self.commanded = commands
        return True

    def asked_mps(self, time_s: float) -> float:
        """Speed along the heading that the scenario asks for: its speed unless a controller commands it."""
        if self.coupling is not None:
            return self.state(time_s).speed_mps
        return self._towed(time_s).speed_mps if self.tow is not None else self.profile.at(time_s)[1]

    def arrives_s(self, time_s: float, station_m: float) -> float:
        """When it will be at a place of its path if nothing changes its plans; infinite if never."""
        state = self.state(time_s)
        left = station_m - state.station_m
        if left <= 0.0:
            return time_s
        if self.tow is not None or self.commanded or self.coupling is not None:
            speed = self.progress_mps(state)
            return time_s + left / speed if speed > STANDING_MPS else math.inf
        return self.profile.covers_s(time_s, left, self.on_trajectory)

    def steady_since_s(self, time_s: float) -> float | None:
        """Since when its speed has been constant at a time; None if it is changing."""
        leader = self.tow.leader if self.tow is not None else None
        if self.coupling is not None:
            leader = self.coupling.tower
        if leader is not None:
            return leader.steady_since_s(time_s)
        return None if time_s < self.profile.end_s - 1e-9 else max(self._steady_s, self.profile.end_s)

    # What changes it

    def teleport(
        self, time_s: float, path: Path, station_m: float, yaw_rad: float, ground_m: float | None = None
    ) -> None:
        """Put it on a path with a heading of its own, on the level of a height if that is known."""
        self.anchor(time_s)
        self.placed = True
        self._put(path, station_m)
        if self.levels is not None:
            state = self.state(time_s)
            self._ground_m = self.levels.level_m(state.x_m, state.y_m, ground_m)
        self._yaw_offset = math.remainder(yaw_rad - path.pose(station_m)[2], 2 * math.pi)
        self._pull(time_s)

    def follow(self, time_s: float, path: Path, station_m: float, trajectory: bool) -> None:
        """Put it on a path, heading along it. A trajectory is followed from start to end, in reverse too."""
        self.anchor(time_s)
        appears, self.placed = not self.placed, True
        self._yaw_offset = 0.0
        self.on_trajectory = trajectory
        self._put(path, station_m)
        if self.levels is not None and (appears or path.first_z_m is not None):
            state = self.state(time_s)
            self._ground_m = self.levels.level_m(state.x_m, state.y_m, path.first_z_m)
        self._pull(time_s)

    def _put(self, path: Path, station_m: float) -> None:
        self.path, self._anchor_station = path, station_m

    def couple(self, time_s: float, coupling: Coupling, pose: Pose) -> None:
        """Be towed from a time on, from a pose at which the coupler is on the hitch."""
        if coupling.tower.depends_on(self):
            raise RunError(
                f"'{self.name}' cannot be coupled to '{coupling.tower.name}', which keeps a distance from it"
            )
        if self.placed:
            self.anchor(time_s)
        self.coupling, self.tow, self.placed = coupling, None, True
        coupling.tower.trailer = self
        self._anchor_s, self._anchor_pose = time_s, pose
        self._note(time_s, self.state(time_s).speed_mps, time_s)
        self._pull(time_s)

    def uncouple(self, time_s: float) -> None:
        """Go on alone with the present speed, straight ahead."""
        if self.coupling is None:
            return
        state = self.anchor(time_s)
        self.coupling.tower.trailer = None
        self.unparted.append(self.coupling.tower)
        self.coupling = None
        self.on_trajectory, self._yaw_offset = False, 0.0
        self._put(straight(state.pose), 0.0)
        self.drive(time_s, SpeedProfile(time_s, state.speed_mps))

    def _pull(self, time_s: float) -> None:
        """Take the trailer along where the vehicle is put elsewhere at once."""
        trailer = self.trailer
        if trailer is None or trailer.coupling is None:
            return
        coupling, pose = trailer.coupling, self.state(time_s).pose
        coupler = trailer._anchor_pose.moved(coupling.coupler_m, 0.0)
        apart_m = math.dist(coupling.hitch(pose), (coupler.x_m, coupler.y_m))
        if trailer.placed and trailer._anchor_s == time_s and apart_m <= JUMP_M:
            return
        trailer.placed, trailer._anchor_s = True, time_s
        trailer._anchor_pose = coupling.behind(pose)
        trailer._note(time_s, trailer.state(time_s).speed_mps, time_s)
        trailer._pull(time_s)

    def drive(self, time_s: float, profile: SpeedProfile, state: State | None = None) -> None:
        """Give it a new speed profile from a time on; `state` is that of this time, if it is known."""
        before = self.steady_since_s(time_s)
        state = self.anchor(time_s, state)
        self.tow = None
        self.profile = profile
        self._anchor_distance, speed_mps = profile.at(time_s)
        same = before is not None and abs(speed_mps - state.speed_mps) < STANDING_MPS
        self._steady_s = before if same and before is not None else time_s
        if not self.commanded:
            self._note(time_s, speed_mps, time_s)

    def attach(self, time_s: float, leader: Actor, place: Kept, ahead_m: float) -> None:
        """Keep a distance from another entity from a time on."""
        self.anchor(time_s)
        if leader.depends_on(self):
            raise RunError(
                f"'{self.name}' keeps a distance from '{leader.name}', which keeps one from it"
                " or is towed by it"
            )
        self.tow = Tow(leader, place, ahead_m)
        self._towed_path = None
        if self.commanded:
            return
        state = self._towed(time_s)
        self._anchor_station = state.station_m
        self._note(time_s, state.speed_mps, time_s)

    def detach(self, time_s: float) -> None:
        """Go on alone with the present speed."""
        if self.tow is not None:
            self.keep_speed(time_s)

    def leave_scene(self, time_s: float) -> None:
        """Take note of the place and the speed with which it leaves: relative to these it comes back."""
        self.left_pose, self.left_mps = self.pose(time_s), self.asked_mps(time_s)

    def keep_speed(self, time_s: float) -> None:
        """Go on with the speed that it has (or, while it is commanded, that the scenario asks for)."""
        self.drive(time_s, SpeedProfile(time_s, self.asked_mps(time_s)))

    # Outline

    def box(self, state: State) -> tuple[float, float, float, float, float]:
        """Centre x, centre y, length, width and yaw of its bounding box."""
        d = self.definition
        c, s = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
        return (
            state.x_m + c * d.center_x_m - s * d.center_y_m,
            state.y_m + s * d.center_x_m + c * d.center_y_m,
            d.length_m,
            d.width_m,
            state.yaw_rad,
        )

    def progress_mps(self, state: State) -> float:
        """Speed along its path."""
        return abs(state.speed_mps) if self.on_trajectory else state.speed_mps
