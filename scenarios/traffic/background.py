"""The traffic of a run: SUMO in step with the engine, the ego mirrored into it."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Never

from opendrive import OpenDriveError
from scenarios.errors import ScenarioError
from scenarios.openscenario.motion.paths import Path, Pose
from scenarios.openscenario.motion.way_behind import with_way_behind
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.world import Instant, World
from scenarios.traffic.carried import Carried
from scenarios.traffic.demand import CAR_M, STEP_S, WALKER_M, Traffic
from scenarios.traffic.session import Session, library, network_file

EGO = "ego"
NEAR_M = 150.0
"""Vehicles and pedestrians begin within this of the ego."""

ROUTE_M = 1500.0
"""Routes of vehicles are this long, where the map has so much road: more than a run of a minute takes."""

SAMPLE_M = 2.0
"""Spacing at which the ego's way is laid over SUMO's edges."""

TRIES = 50
"""So many random places are looked at for each who begins."""


class SumoTraffic:
    """Vehicles and pedestrians that react to the ego; a `Background` of the engine.

    SUMO goes one step of 0.1 s ahead. For this step it knows the ego's speed at its beginning, and takes the
    ego to keep it: at 10 m/s2 the ego is 5 cm elsewhere at its end. Within the step everybody moves as SUMO's
    ballistic update has them, so that contacts are found at any instant.

    Args:
        traffic: who is there.
        map_path: of the scenario.
        seed: of places, drivers and pedestrians.

    Raises:
        ScenarioError: SUMO is not installed.
    """

    def __init__(self, traffic: Traffic, map_path: FilePath, seed: int) -> None:
        library()
        self._traffic, self._map_path, self._seed = traffic, map_path, seed
        self.names = frozenset(name for names in traffic.names for name in names)
        self.next_s = math.inf
        self._steps = 0
        self._carried: dict[str, Carried] = {}
        self._actors: Mapping[str, Actor] = {}

    def __deepcopy__(self, memo: dict[int, object]) -> Never:
        raise ScenarioError(
            "traffic: a run with traffic of SUMO cannot be copied, since SUMO has one simulation per "
            "process; make another run"
        )

    def __reduce__(self) -> Never:
        raise ScenarioError("traffic: a run with traffic of SUMO cannot be pickled; pickle its RunSpec")

    # Start

    def begin(self, world: World, ego: Actor) -> None:
        """Place everybody at the start of a run, where the ego already is.

        Raises:
            ScenarioError: the map cannot be converted, or the ego is on no road of it.
        """
        traffic, definition = self._traffic, ego.definition
        self._world, self._ego, self._actors = world, ego, world.actors
        random_numbers = random.Random(self._seed)
        state = ego.state(0.0)
        speed = ego.asked_mps(0.0)
        try:
            network = network_file(self._map_path)
        except OpenDriveError as error:
            raise ScenarioError(f"traffic: {self._map_path}: {error}") from None
        types = {EGO: _car(traffic, definition.length_m, definition.width_m), "car": _car(traffic)}
        types["walker"] = _walker(traffic)
        self._session = session = Session(network, types, random_numbers.randrange(2**31), STEP_S)
        way = with_way_behind(world.locator.roads, ego.path)
        ahead = max(way.length_m - state.station_m, 0.0)
        count = math.ceil(min(ahead, ROUTE_M) / SAMPLE_M) + 1
        edges = session.edges_along([way.pose(state.station_m + SAMPLE_M * k) for k in range(count)])
        if not edges:
            raise ScenarioError(f"traffic: the ego begins on no road of {self._map_path} that SUMO has")
        session.add_vehicle(EGO, EGO, edges)
        starts = {EGO: _Start(self._front(state, 0.0), speed)}
        starts |= self._followers(way, state, speed, edges)
        starts |= self._vehicles(random_numbers, list(starts.values()))
        self._add_walkers(random_numbers, starts[EGO].front)
        # drivers decide at times of their own, which a first round of decisions spreads
        rounds = round(traffic.reaction_s / STEP_S)
        turns = {name: random_numbers.randrange(rounds) for name in starts}
        for turn in range(rounds):
            for name, start in starts.items():
                session.put(name, start.front)
            session.step()
            for name, start in starts.items():
                session.is_driving(name, start.speed_mps)
                if turns[name] == turn and name != EGO:
                    session.decides_now(name, traffic.reaction_s)
        for name in self._traffic.names[0]:
            if name in starts:
                session.wants(name, max(speed, session.limit_mps(session.lane_of(name))))
        present = session.present()
        for name in sorted(self.names):
            actor = world.actors[name]
            actor.placed = True
            if name not in present:
                actor.exists = False
                world.note(f"traffic: there is no room for '{name}'", (name, "traffic"))
                continue
            self._carried[name] = Carried(session.place(name), 0.0, STEP_S)
            actor.controller = self._carried[name]
            actor.heed(0.0)
            actor.anchor(0.0)  # takes note of its speed
        self._go_on(state, speed)

    def _followers(self, way: Path, state: State, speed_mps: float, edges: list[str]) -> dict[str, _Start]:
        """Add who follows the ego; those for whom the road is long enough."""
        starts, session = {}, self._session
        rear_m = state.station_m - self._ego.rear_m
        for name in self._traffic.names[0]:
            front_m = rear_m - self._traffic.first_gap_m(max(speed_mps, 0.0))
            rear_m = front_m - CAR_M[0]
            if rear_m < way.first_m:
                break
            count = math.ceil((state.station_m - front_m) / SAMPLE_M)
            stations = [*(front_m + SAMPLE_M * k for k in range(count)), state.station_m]
            before = session.edges_along([way.pose(at_m) for at_m in stations])
            if not before or before[-1] not in edges:
                break
            session.add_vehicle(name, "car", [*before, *edges[edges.index(before[-1]) + 1 :]])
            starts[name] = _Start(Pose(*way.pose(front_m)), speed_mps)
        return starts

    def _vehicles(self, random_numbers: random.Random, others: list[_Start]) -> dict[str, _Start]:
        """Add vehicles at random places near the ego, with Krauss' gap to all others of their direction."""
        session, traffic = self._session, self._traffic
        ego, starts = others[0].front, {}
        lanes = session.lanes(walkers=False) if traffic.vehicles else []
        for name in traffic.names[1]:
            for _ in range(TRIES):
                [(lane, length_m)] = random_numbers.choices(lanes, [length for _, length in lanes])
                at_m, speed = random_numbers.uniform(0.0, length_m), session.limit_mps(lane)
                if at_m <= CAR_M[0]:
                    continue
                front = session.pose(lane, at_m)
                apart_m = CAR_M[0] + traffic.min_gap_m + traffic.tau_s * speed
                same_way = [o.front for o in others if math.cos(o.front.yaw_rad - front.yaw_rad) > 0.0]
                if _far(front, ego) <= NEAR_M and all(_far(front, other) >= apart_m for other in same_way):
                    session.add_vehicle(name, "car", self._route(lane, random_numbers))
                    starts[name] = _Start(front, speed)
                    others.append(starts[name])
                    break
        return starts

    def _add_walkers(self, random_numbers: random.Random, ego: Pose) -> None:
        """Add pedestrians at random places of the sidewalks near the ego, who walk to one of the ends."""
        session = self._session
        lanes = session.lanes(walkers=True) if self._traffic.walkers else []
        for name in self._traffic.names[2]:
            for _ in range(TRIES if lanes else 0):
                [(lane, length_m)] = random_numbers.choices(lanes, [length for _, length in lanes])
                at_m = random_numbers.uniform(0.0, length_m)
                if at_m >= 1.0 and _far(session.pose(lane, at_m), ego) <= NEAR_M:
                    session.add_walker(name, "walker", lane, at_m, random_numbers.choice((0.0, length_m)))
                    break

    def _route(self, lane: str, random_numbers: random.Random) -> list[str]:
        """Edges from a lane on, at random where the road forks."""
        session = self._session
        lengths = dict(session.lanes(False))
        edges, length_m = [lane.rpartition("_")[0]], lengths[lane]
        while length_m < ROUTE_M:
            following = sorted(set(session.following(lane)))
            if not following:
                break
            edges.append(random_numbers.choice(following))
            lane = session.lane_of_edge(edges[-1])
            length_m += lengths.get(lane, 1.0)
        return edges

    # In step

    def update(self, now: Instant) -> bool:
        """Let SUMO go on if its step is over; whether it has."""
        if now.time_s < self.next_s - 1e-9:
            return False
        state = now.state(self._ego.name)
        self._go_on(state, state.speed_mps)
        return True

    def _go_on(self, state: State, speed_mps: float) -> None:
        """One step of SUMO, with the ego as it is now."""
        session, now_s = self._session, self._steps * STEP_S
        session.check()
        present = session.present()
        if EGO in present and self._ego.exists:
            session.is_driving(EGO, speed_mps)
            session.put(EGO, self._front(state, speed_mps * STEP_S))
        session.step()
        present = session.present()
        for name, carried in self._carried.items():
            actor = self._actors[name]
            if name in present and actor.exists:
                carried.go_on(session.place(name), now_s)
            else:
                actor.exists = False  # at the end of its way
        self._steps += 1
        self.next_s = round(self._steps * STEP_S, 9)

    def _front(self, state: State, ahead_m: float) -> Pose:
        """The middle of the ego's front, so far ahead along its heading."""
        x, y, length_m, _, yaw = self._ego.box(state)
        return Pose(x, y, yaw).moved(length_m / 2 + ahead_m, 0.0)


@dataclass(frozen=True, slots=True)
class _Start:
    """The middle of a vehicle's front at the start, and its speed."""

    front: Pose
    speed_mps: float


def _far(a: Pose, b: Pose) -> float:
    return math.dist((a.x_m, a.y_m), (b.x_m, b.y_m))


def _car(traffic: Traffic, length_m: float = CAR_M[0], width_m: float = CAR_M[1]) -> dict[str, object]:
    """Vehicle type of SUMO; the ego's is the same to those behind, who expect its deceleration of it."""
    attributes: dict[str, object] = {
        "vClass": "passenger",
        "carFollowModel": traffic.model,
        "length": length_m,
        "width": width_m,
        "tau": traffic.tau_s,
        "accel": traffic.accel_mps2,
        "decel": traffic.decel_mps2,
        "emergencyDecel": traffic.emergency_decel_mps2,
        "minGap": traffic.min_gap_m,
        "actionStepLength": traffic.reaction_s,
        "speedDev": 0.0,
        "maxSpeed": 100.0,
    }
    return attributes | ({"sigma": traffic.sigma} if traffic.model == "Krauss" else {})


def _walker(traffic: Traffic) -> dict[str, object]:
    return {
        "vClass": "pedestrian",
        "length": WALKER_M[0],
        "width": WALKER_M[1],
        "maxSpeed": traffic.walking_mps,
        "desiredMaxSpeed": traffic.walking_mps,
        "speedDev": 0.0,
    }
