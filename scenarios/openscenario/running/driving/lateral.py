"""Actions that move entities sideways: lane changes, lane offsets, and what they share."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TypeVar

import numpy as np

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.lane_place import LanePlace
from scenarios.openscenario.motion.lateral import (
    BENDS,
    SHAPES,
    Swerve,
    by_station,
    by_way_gone,
    count_of,
    too_steep,
)
from scenarios.openscenario.motion.paths import Path, backwards
from scenarios.openscenario.motion.profiles import SLOPES, SpeedProfile
from scenarios.openscenario.motion.way_behind import with_way_behind
from scenarios.openscenario.running.actions import LATERAL, RunningAction
from scenarios.openscenario.running.actors import STANDING_MPS, Actor
from scenarios.openscenario.running.following import go_on, take_route
from scenarios.openscenario.running.world import Instant, World
from smartmot.types import FloatArray

NO_OFFSET_M = 1e-6
"""Smaller changes of an offset are none."""

LateralT_co = TypeVar(
    "LateralT_co",
    bound="model.LaneChangeAction | model.LaneOffsetAction | model.LateralDistanceAction",
    covariant=True,
)


class _Sideways(RunningAction[LateralT_co]):
    """What lateral actions share: a change of the offset from a curve, over a time or over a way.

    A change over a time follows the speed of the entity: it is worked out again where the scenario gives the
    entity another one. Who is commanded by a controller keeps the way that was worked out at the beginning.
    """

    domains = frozenset({LATERAL})
    outlasts_routes = True
    shape: model.SpeedShape = "step"

    def __init__(self, world: World, actor: Actor | None, action: LateralT_co) -> None:
        super().__init__(world, actor, action)
        self._route = None if actor is None else actor.route

    def _begin(self, time_s: float, curve: Path, target_m: float, duration_s: float) -> None:
        """Begin a change to an offset from a curve over a time."""
        who = self.who
        pose = who.pose(time_s)
        # in reverse the same happens along the curve as it is seen in a mirror: backwards, left for right
        self._along = -1.0 if who.asked_mps(time_s) < -STANDING_MPS else 1.0
        self._ahead, self._begin_s, self._duration_s = curve, time_s, duration_s
        if self._along < 0.0:
            self._curve = backwards(with_way_behind(self.world.locator.roads, curve))
        else:
            self._curve = curve
        self._station, self._left = self._curve.project(pose.x_m, pose.y_m)
        self._target = self._along * target_m
        self._swerve: Swerve | None = None
        self._profile: SpeedProfile | None = None
        self._by_way = False
        if abs(self._target - self._left) <= NO_OFFSET_M or duration_s <= 0.0:
            self._jump(time_s)
            return
        self._plan(time_s)

    def _begin_over_way(self, time_s: float, curve: Path, target_m: float, way_m: float) -> None:
        """Begin a change over a way along a curve."""
        self._begin(time_s, curve, target_m, 0.0 if way_m <= 0.0 else math.inf)
        if self._duration_s > 0.0 and abs(self._target - self._left) > NO_OFFSET_M:
            self._over_way(time_s, way_m)

    def _jump(self, time_s: float) -> None:
        """Be beside the curve at once."""
        stations = self._station + np.linspace(0.0, 1.0, 3)
        self._take(time_s, by_station(self._curve, stations, np.full(3, self._target), (True, True)))
        self._end_m = 0.0

    def _take(self, time_s: float, swerve: Swerve) -> None:
        self._swerve = swerve
        self._end_m = float(swerve.gone_m[-1])
        path = swerve.path
        if self._along < 0.0:
            path = backwards(path)
            path.both_ways = True
        self.who.follow(time_s, path, 0.0, trajectory=False)

    def _done(self, part: FloatArray) -> FloatArray:
        """Offsets after shares of the time or way."""
        return self._left + (self._target - self._left) * SHAPES[self.shape](part)

    def _plan(self, time_s: float) -> None:
        """Work out the way from a time on, for the speed that the scenario has given the entity."""
        if not math.isfinite(self._duration_s):
            return
        who = self.who
        gone_share = (time_s - self._begin_s) / self._duration_s
        station = self._station_now(time_s)
        self._profile = who.profile
        left_s = self._duration_s * (1.0 - gone_share)
        speed_mps = self._along * who.progress_mps(who.state(time_s))
        follows = who.tow is None and not who.commanded
        length = (
            self._along * (who.profile.at(time_s + left_s)[0] - who.profile.at(time_s)[0])
            if follows
            else speed_mps * left_s
        )
        part = np.linspace(gone_share, 1.0, count_of(abs(length)))
        if follows:
            before = who.profile.at(time_s)[0]
            times = time_s + (part - gone_share) * self._duration_s
            gone = self._along * (np.array([who.profile.at(t)[0] for t in times.tolist()]) - before)
        else:
            gone = speed_mps * (part - gone_share) * self._duration_s
        left = self._done(part)
        if too_steep(gone, left):
            # there is not way enough for the time: as soon as the heading stays within 45 degrees
            way = SLOPES[self.shape] * abs(self._target - self._left) * (1.0 - gone_share)
            self._over_way(time_s, way, gone_share, station)
            return
        self._by_way = False
        self._take(time_s, by_way_gone(self._curve, station, gone, left, self._smooth(gone_share)))

    def _over_way(
        self, time_s: float, way_m: float, gone_share: float = 0.0, station_m: float | None = None
    ) -> None:
        """Work out the way for what is left of a change over a way."""
        station = self._station if station_m is None else station_m
        self._by_way, self._planned_s = True, time_s
        part = np.linspace(gone_share, 1.0, count_of(way_m))
        stations = station + (part - gone_share) / (1.0 - gone_share) * way_m
        self._take(time_s, by_station(self._curve, stations, self._done(part), self._smooth(gone_share)))

    def _smooth(self, gone_share: float) -> tuple[bool, bool]:
        """Whether what is left of the change begins, and ends, along the curve."""
        return self.shape != "linear" and gone_share == 0.0, self.shape != "linear"

    def _station_now(self, time_s: float) -> float:
        """Arc length on the curve beside the entity."""
        if self._swerve is None:
            return self._station
        gone = self._along * self.who.state(time_s).station_m
        return float(np.interp(gone, self._swerve.gone_m, self._swerve.station_m))

    def update(self, instant: Instant) -> bool:
        """Follow a speed that is new; on from here where the entity has turned back."""
        time_s, who = instant.time_s, self.who
        if self._along * who.asked_mps(time_s) < -STANDING_MPS and not who.commanded and who.tow is None:
            self._turn_back(time_s)
            return True
        if self._profile is None:
            return False
        if self._by_way and time_s > self._planned_s:
            self._profile = None  # over a way from now on, whatever the speed
            self.world.note(
                f"'{who.name}' is too slow to move {abs(self._target - self._left):.3g} m sideways within "
                f"{self._duration_s:.3g} s at {self._begin_s:.3f} s: it takes longer"
            )
            return False
        if who.profile is self._profile or who.commanded or who.tow is not None:
            return False
        if time_s < self._begin_s + self._duration_s:
            self._plan(time_s)
            return True
        return False

    def _turn_back(self, time_s: float) -> None:
        """What is left of the change, the other way along the curve."""
        curve, target = with_way_behind(self.world.locator.roads, self._ahead), self._along * self._target
        left_s = self._begin_s + self._duration_s - time_s
        if math.isfinite(left_s) and left_s > 0.0 and not self._by_way:
            self._begin(time_s, curve, target, left_s)
        else:
            gone_m = self._along * self.who.state(time_s).station_m
            self._begin_over_way(time_s, curve, target, max(self._end_m - gone_m, 0.0))

    def ended(self, instant: Instant) -> bool:
        """At the offset."""
        return self._along * instant.state(self.who.name).station_m >= self._end_m - NO_OFFSET_M

    def finish(self, time_s: float) -> None:
        """Go on along a route that was assigned meanwhile, or the curve itself if there is no offset."""
        who = self.who
        if who.route is not None and who.route is not self._route:
            take_route(who, self.world, time_s, who.route, "the route")
        elif self._target == 0.0:
            station = self._along * self._station_now(time_s)
            who.follow(time_s, self._ahead, station, trajectory=False)
        super().finish(time_s)

    def leave(self, time_s: float) -> None:
        """Go on along the lane at the present offset."""
        go_on(self.who, self.world, time_s)

    # Where it is to go

    def _place(self, name: str, time_s: float) -> LanePlace:
        """Lane of an entity.

        Raises:
            RunError: it is in none.
        """
        place = self.world.locator.roads.place(self.world.actors[name].pose(time_s))
        if place is None:
            raise RunError(
                f"'{name}' is on no road at {time_s:.3f} s, which {type(self.action).__name__} needs"
            )
        return place

    def _lane_curve(self, place: LanePlace, lane: int) -> Path:
        """The middle of a lane from beside the entity on; at forks along its route."""
        roads, route = self.world.locator.roads, self.who.route or ()
        lanes = roads.network.lanes
        on_route = frozenset(lanes.key[leg.lane].road_id for leg in route)
        return roads.lane_way(lane, place.s_m, place.along_s, on_route)


class LaneChange(_Sideways[model.LaneChangeAction]):
    """LaneChangeAction."""

    def start(self, time_s: float) -> None:
        """Begin the change to the lane."""
        action, roads = self.action, self.world.locator.roads
        place = self._place(self.who.name, time_s)
        target = action.target
        if isinstance(target, model.RelativeLane):
            other = self.world.road_distances.beside(place, self._place(target.entity, time_s))
            lane_id = other.beside(target.lanes)
        else:
            lane_id = target
        lane = roads.lane(place.road_id, lane_id, place.s_m)
        curve = self._lane_curve(place, lane)
        offset = action.offset_m * place.along_s
        self.shape = action.shape
        if action.shape == "step":
            self._begin(time_s, curve, offset, 0.0)
        elif action.dimension == "distance":
            self._begin_over_way(time_s, curve, offset, action.value)
        else:
            pose = self.who.pose(time_s)
            change = abs(offset - curve.project(pose.x_m, pose.y_m)[1])
            rate = action.dimension == "rate"
            if rate and action.value <= 0.0 and change > NO_OFFSET_M:
                raise RunError(f"a rate of 0 never leads '{self.who.name}' to lane {lane_id}")
            duration = SLOPES[action.shape] * change / action.value if rate and change > 0.0 else action.value
            self._begin(time_s, curve, offset, duration)


class Kept(_Sideways[LateralT_co]):
    """An offset that may be kept beside an entity."""

    def start(self, time_s: float) -> None:
        """Begin the change to the offset."""
        self._middle = self._beside_what(time_s)
        self._begin(time_s, self._middle, *self._asked(time_s))

    def _beside_what(self, time_s: float) -> Path:
        """The curve from which the offset counts: the middle of the entity's lane."""
        self._place_now = self._place(self.who.name, time_s)
        return self._lane_curve(self._place_now, self._place_now.lane)

    def _beside(self, name: str, time_s: float) -> tuple[float, float]:
        """Offset of another entity from the middle, and +1 if it heads along it, -1 if against."""
        state = self.world.actors[name].state(time_s)
        station, left = self._middle.project(state.x_m, state.y_m)
        if station < self._middle.first_m:  # it is behind, where the lane may bend
            self._middle = with_way_behind(self.world.locator.roads, self._middle)
            station, left = self._middle.project(state.x_m, state.y_m)
        return left, math.copysign(1.0, math.cos(self._middle.pose(station)[2] - state.yaw_rad))

    def _asked(self, time_s: float) -> tuple[float, float]:
        """The offset from the lane, and how long the change to it takes."""
        offset = self._target_m(time_s)
        pose = self.who.pose(time_s)
        return offset, self._duration(abs(offset - self._middle.project(pose.x_m, pose.y_m)[1]))

    @abstractmethod
    def _target_m(self, time_s: float) -> float:
        """The offset to the left of the lane's middle that is asked for now."""

    @abstractmethod
    def _duration(self, change_m: float) -> float:
        """How long a change of the offset takes."""

    @abstractmethod
    def _follows(self) -> bool:
        """Whether the offset moves with another entity."""

    def update(self, instant: Instant) -> bool:
        """Follow the other entity, and a route that is new."""
        if self.who.route is not self._route and self._reached(instant):
            self._route, self._middle = self.who.route, self._beside_what(instant.time_s)
            self._begin(instant.time_s, self._middle, *self._asked(instant.time_s))
            return True
        if self._follows() and instant.time_s > self._begin_s:
            offset, duration = self._asked(instant.time_s)
            if abs(offset - self._along * self._target) > NO_OFFSET_M and self._reached(instant):
                self._begin(instant.time_s, self._middle, offset, duration)
                return True
        return super().update(instant)

    def _reached(self, instant: Instant) -> bool:
        return super().ended(instant)

    def ended(self, instant: Instant) -> bool:
        """At the offset, unless it is to be kept."""
        return not self.action.continuous and self._reached(instant)  # type: ignore[union-attr]


class LaneOffset(Kept[model.LaneOffsetAction]):
    """LaneOffsetAction."""

    def start(self, time_s: float) -> None:
        """Begin the change to the offset."""
        self.shape = self.action.shape
        super().start(time_s)

    def _target_m(self, time_s: float) -> float:
        target = self.action.target
        if isinstance(target, model.RelativeOffset):
            left, facing = self._beside(target.entity, time_s)
            return left + facing * target.offset_m
        return target * self._place_now.along_s

    def _duration(self, change_m: float) -> float:
        limit = self.action.max_lateral_mps2
        if limit is None or self.shape == "step":
            return 0.0
        return math.sqrt(BENDS[self.shape] * change_m / limit)

    def _follows(self) -> bool:
        """One from the entity itself is from where it is at the start: it would never end else."""
        target = self.action.target
        is_beside = isinstance(target, model.RelativeOffset) and target.entity != self.who.name
        return self.action.continuous and is_beside

    def needs(self) -> frozenset[str]:
        """Whom it stays beside."""
        target = self.action.target
        return frozenset({target.entity}) if isinstance(target, model.RelativeOffset) else frozenset()
