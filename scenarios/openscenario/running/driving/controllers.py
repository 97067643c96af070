"""Controllers that a file gives to entities: what is carried out of them, and what is not.

The ego is driven by the scenario, or by whoever runs it; controllers that the file gives it are noted. Of the
others, one that asks for a driver who keeps a distance is the Intelligent Driver Model (`Driver`), one that
only follows speeds and ways is the default controller, and any other that is to drive is refused.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from scenarios.openscenario import model
from scenarios.openscenario.control import Motion
from scenarios.openscenario.errors import RunError, UnsupportedError
from scenarios.openscenario.motion.paths import Path
from scenarios.openscenario.running.actions import RunningAction
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.world import Instant, World
from smartmot.maps.lane_map import LEVEL_M
from smartmot.types import FloatArray, IntArray

DRIVERS = ("acc", "alks", "idm", "naturaldriver", "followroute")
"""Whole words in the names of controllers that keep a distance from who is ahead, such as esmini's."""

DEFAULTS = (
    "npc_vehicle_control",
    "vehicle_longitudinal_control",
    "simple_vehicle_control",
    "pedestrian_control",
)
"""Modules of CARLA's ScenarioRunner that drive the speeds and the ways that the scenario asks for."""

NAMING = ("name", "esminicontroller", "module", "controllertype")
"""Properties that say what a controller is; the first is its own name, which its holder may change."""

ACCEL_MPS2, DECEL_MPS2, HEADWAY_S, STANDSTILL_M = 0.73, 1.67, 1.6, 2.0
"""Intelligent Driver Model: Treiber, Hennecke, Helbing (2000), Physical Review E 62, table I; exponent 4."""

NEAR_M, LOOK_AHEAD_M = 100.0, 300.0
"""Who is ahead is looked for near by first, which is enough in dense traffic, where few are that near; who is
further ahead than the second makes no difference: less than 0.001 m/s2 at 30 m/s."""

SEARCH_S = 0.1
"""How often a driver looks who is ahead; in between it watches that one. Nobody cuts in by much meanwhile."""

COARSE_M = 10.0
"""Chords of the way on which others are looked for, before the one ahead is measured on the way itself."""

BESIDE_M = 0.2
"""A vehicle is in the way if less than this is left between its side and the own lane's track."""


def kind_of(controller: model.Controller) -> str:
    """What a controller is: `driver`, `default` or `unknown`."""
    properties = {name.lower(): value for name, value in controller.properties}
    names = [controller.name, *(properties[name] for name in NAMING if name in properties)]
    if any(name.lower() in DEFAULTS for name in names):
        return "default"
    return "driver" if any(word in DRIVERS for name in names for word in _words(name)) else "unknown"


def _words(name: str) -> list[str]:
    """Words of a name such as `ControllerALKS_R157SM`, in lower case, and each with the one after it."""
    apart = re.sub("controller", " ", name, flags=re.IGNORECASE)
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", apart)]
    return [*words, *(a + b for a, b in itertools.pairwise(words))]


def check(definition: model.ScenarioDefinition, ego: str) -> None:
    """Find controllers that would have to drive somebody and cannot, before anything runs.

    Raises:
        UnsupportedError: there is one.
        RunError: a driver has a property that is no number.
    """
    held = {entity.name: list(entity.controllers) for entity in definition.entities}
    for name, action in _by_entity(definition):
        parts = action if isinstance(action, model.ControllerAction) else None
        if parts is not None and parts.assigned is not None:
            held[name].append(parts.assigned)
        if name == ego:
            continue
        if parts is not None and parts.overridden:
            raise UnsupportedError(
                f"{parts.where} of '{name}' sets {', '.join(parts.overridden)}: pedals and wheels are not "
                "modelled; use speed and lateral actions"
            )
        activated = parts.activated if parts is not None else action
        if not isinstance(activated, model.ActivateControllerAction):
            continue
        if not (activated.lateral or activated.longitudinal):
            continue
        for controller in held[name]:
            wanted = activated.controller in (None, controller.name)
            if wanted and kind_of(controller) == "driver":
                try:
                    _settings(controller)
                except RunError as error:
                    raise RunError(f"{activated.where} '{name}': {error}") from None
            if wanted and kind_of(controller) == "unknown":
                raise UnsupportedError(
                    f"{activated.where} controller '{controller.name}' of '{name}' is not known; "
                    "the ego may have it, or leave it out: entities follow their actions without one"
                )


def _by_entity(
    definition: model.ScenarioDefinition,
) -> Iterator[tuple[str, model.ControllerAction | model.ActivateControllerAction]]:
    kinds = model.ControllerAction | model.ActivateControllerAction
    for name, action in definition.init:
        if name is not None and isinstance(action, kinds):
            yield name, action
    for event in definition.events():
        for named in event.actions:
            if isinstance(named.action, kinds):
                for name in named.entities:
                    yield name, named.action


class Control(RunningAction["model.ControllerAction | model.ActivateControllerAction"]):
    """ControllerAction and ActivateControllerAction."""

    def start(self, time_s: float) -> None:
        """Assign, activate, or give back."""
        action, who = self.action, self.who
        activated = action if isinstance(action, model.ActivateControllerAction) else action.activated
        if isinstance(action, model.ControllerAction) and action.assigned is not None:
            self.world.assigned.setdefault(who.name, []).append(action.assigned)
        if activated is None:
            return
        if who.name == self.world.ego:
            self.world.note(
                f"controllers of '{who.name}' are not used: the ego is driven by the scenario, or by whoever "
                "runs it"
            )
            return
        if activated.longitudinal is False:
            if isinstance(who.controller, Driver):
                who.controller.commands_from_s = math.inf
            return
        chosen = self._chosen(activated)
        if not activated.longitudinal or chosen is None:
            return
        if kind_of(chosen) == "default":
            if isinstance(who.controller, Driver):
                who.controller.commands_from_s = math.inf
            self.world.note(
                f"controller '{chosen.name}' of '{who.name}' is the default one: it does as asked"
            )
            return
        self.world.note(f"'{who.name}' is driven by the Intelligent Driver Model for '{chosen.name}'")
        who.controller = Driver(self.world, who, chosen, time_s)

    def _chosen(self, activated: model.ActivateControllerAction) -> model.Controller | None:
        """The controller that is meant; None: the default one."""
        held: list[model.Controller] = [
            *self.who.definition.controllers,
            *self.world.assigned.get(self.who.name, ()),
        ]
        if activated.controller is None:
            return held[-1] if held else None
        named: list[model.Controller] = [
            controller for controller in held if controller.name == activated.controller
        ]
        if not named:
            names = ", ".join(controller.name for controller in held) or "none"
            raise RunError(
                f"'{self.who.name}' has no controller '{activated.controller}' to activate; it has: {names}"
            )
        return named[-1]


class Driver:
    """Keeps a distance from who is ahead, and else the speed that the scenario asks for.

    Args:
        world: in which it drives.
        actor: whom it drives.
        controller: may name a speed (`setSpeed`) and a time gap (`timeGap`).
        time_s: from when on.
    """

    def __init__(self, world: World, actor: Actor, controller: model.Controller, time_s: float) -> None:
        self._world, self._actor = world, actor
        self.commands_from_s = time_s
        self._speed_mps = self._accel_mps2 = 0.0
        self._desired_mps, headway_s = _settings(controller)
        self._headway_s = HEADWAY_S if headway_s is None else headway_s
        self._leader: Actor | None = None
        self._leader_m = 0.0
        self._path: Path | None = None
        self._search_s = -math.inf

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Go on from the speed that it has."""
        self._speed_mps = speed_mps
        self.decide(Traffic(Instant(time_s, self._world.actors)))

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """On with the acceleration that was decided, to a standstill at most."""
        speed, accel = self._speed_mps, self._accel_mps2
        moving_s = duration_s
        if accel < 0.0 and speed + accel * duration_s < 0.0:
            moving_s = speed / -accel
        distance = speed * moving_s + 0.5 * accel * moving_s**2
        return Motion(distance, max(speed + accel * moving_s, 0.0))

    def advance(self, time_s: float, duration_s: float) -> None:
        """Take over the speed at the end; what follows is decided there."""
        self._speed_mps = self.motion(time_s, duration_s).speed_mps

    def decide(self, traffic: Traffic) -> None:
        """Choose the acceleration of the step that begins."""
        speed, time_s = self._speed_mps, traffic.now.time_s
        desired = self._actor.asked_mps(time_s) if self._desired_mps is None else self._desired_mps
        free = 1.0 - (speed / desired) ** 4 if desired > 0.0 else -1.0 if speed > 0.0 else 0.0
        gap_m, leader_mps = self._ahead(traffic)
        wanted = STANDSTILL_M + speed * self._headway_s
        wanted += speed * (speed - leader_mps) / (2.0 * math.sqrt(ACCEL_MPS2 * DECEL_MPS2))
        crowded = (max(wanted, STANDSTILL_M) / max(gap_m, 0.1)) ** 2 if math.isfinite(gap_m) else 0.0
        # nobody brakes harder than a car can, however near another one appears
        self._accel_mps2 = max(ACCEL_MPS2 * (free - crowded), -9.0)

    def _ahead(self, traffic: Traffic) -> tuple[float, float]:
        """Free distance to the nearest one on the way, and its speed along it; infinite if there is none."""
        path, leader, time_s = self._actor.path, self._leader, traffic.now.time_s
        if path is self._path and time_s < self._search_s - 1e-9:
            if leader is None:
                return math.inf, 0.0
            gap = self._gap(leader, self._leader_m, traffic.now) if leader.exists else None
            if gap is not None:
                return gap
        self._path, self._search_s = path, time_s + SEARCH_S
        return self._search(traffic)

    def _search(self, traffic: Traffic) -> tuple[float, float]:
        """Find who is ahead, how far and how fast that one is: first near by, then as far as it counts."""
        own, actor = traffic.now.state(self._actor.name), self._actor
        away_m = np.hypot(traffic.places_m[:, 0] - own.x_m, traffic.places_m[:, 1] - own.y_m)
        gap = math.inf, 0.0
        for look_m in (NEAR_M, LOOK_AHEAD_M):
            near = np.flatnonzero(away_m <= look_m)
            self._leader = None
            if len(near) <= 1:  # it sees itself
                continue
            gap, reach_m = self._nearest(traffic, own, near, look_m)
            rear_m = float(traffic.rear_m[near].max())
            if gap[0] <= look_m - COARSE_M - reach_m - rear_m - actor.front_m:
                break  # whoever is further ahead is not nearer, however far it reaches back
        return gap

    def _nearest(
        self, traffic: Traffic, own: State, near: IntArray, look_m: float
    ) -> tuple[tuple[float, float], float]:
        """Free distance to the nearest of some others, and its speed along the way; how wide was looked."""
        path, nearest = self._actor.path, (math.inf, 0.0)
        stations = own.station_m + np.arange(0.0, look_m + COARSE_M, COARSE_M)
        points = path.poses(stations)
        x, y = points[:-1, 0], points[:-1, 1]
        dx, dy = points[1:, 0] - x, points[1:, 1] - y
        away_x, away_y = traffic.places_m[near, 0, None] - x, traffic.places_m[near, 1, None] - y
        part = ((away_x * dx + away_y * dy) / (dx * dx + dy * dy)).clip(0.0, 1.0)
        miss = np.hypot(away_x - part * dx, away_y - part * dy)
        chord = miss.argmin(axis=1)
        rows = np.arange(len(near))
        ahead = COARSE_M * (chord + part[rows, chord])
        # an arc departs from its chord by an eighth of chord times turn
        turn = points[1:, 2] - points[:-1, 2]
        turn -= 2.0 * math.pi * np.rint(turn / (2.0 * math.pi))
        bulge = COARSE_M / 8.0 * float(np.abs(turn).max())
        reach = 0.5 * self._actor.definition.width_m + traffic.half_width_m[near] + BESIDE_M + bulge
        in_way = np.flatnonzero(miss[rows, chord] <= reach)
        for k in in_way[ahead[in_way].argsort(kind="stable")].tolist():
            other = traffic.actors[near[k]]
            if other is self._actor or ahead[k] - other.rear_m - self._actor.front_m > nearest[0] + COARSE_M:
                continue
            station = own.station_m + float(ahead[k])
            gap = self._gap(other, station, traffic.now)
            if gap is not None and gap[0] < nearest[0]:
                nearest, self._leader, self._leader_m = gap, other, station
        return nearest, float(reach.max())

    def _gap(self, other: Actor, near_m: float, now: Instant) -> tuple[float, float] | None:
        """Free distance to another on the way, and its speed along it; None if it is not on it, or behind."""
        actor = self._actor
        own, state = now.state(actor.name), now.state(other.name)
        station, left = actor.path.project_from(state.x_m, state.y_m, near_m)
        self._leader_m = station
        reach = 0.5 * (other.definition.width_m + actor.definition.width_m) + BESIDE_M
        if station <= own.station_m or abs(left) > reach:
            return None
        if actor.levels is not None:
            x_m, y_m, _ = actor.path.pose(station)
            way_m = actor.levels.lane_height_m(actor.path, station, x_m, y_m)
            own_m, ground_m = actor.ground_m(own) if way_m is None else way_m, other.ground_m(state)
            if own_m is not None and ground_m is not None and abs(ground_m - own_m) > LEVEL_M:
                return None  # above or below the way
        along = state.speed_mps * math.cos(state.yaw_rad - actor.path.pose(station)[2])
        return station - own.station_m - other.rear_m - actor.front_m, along


class Traffic:
    """Everybody who is there at an instant, worked out once for all drivers that look then.

    Args:
        now: the instant.
    """

    def __init__(self, now: Instant) -> None:
        self.now = now

    @cached_property
    def actors(self) -> list[Actor]:
        """Entities."""
        return [actor for actor in self.now.actors.values() if actor.exists and actor.placed]

    @cached_property
    def places_m(self) -> FloatArray:
        """(N, 2) reference points."""
        states = [self.now.state(actor.name) for actor in self.actors]
        return np.array([(state.x_m, state.y_m) for state in states])

    @cached_property
    def half_width_m(self) -> FloatArray:
        """(N,) half widths."""
        return np.array([0.5 * actor.definition.width_m for actor in self.actors])

    @cached_property
    def rear_m(self) -> FloatArray:
        """(N,) from reference points back to the rear ends."""
        return np.array([actor.rear_m for actor in self.actors])


def _settings(controller: model.Controller) -> tuple[float | None, float | None]:
    """Speed and time gap that a controller names."""
    properties = {name.lower(): value for name, value in controller.properties}
    return _number(properties.get("setspeed"), controller), _number(properties.get("timegap"), controller)


def _number(text: str | None, controller: model.Controller) -> float | None:
    if text is None:
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number >= 0.0):
        raise RunError(f"controller '{controller.name}' has a property that is no number from 0 on: '{text}'")
    return number


def decide(actors: Iterator[Actor], instant: Instant) -> bool:
    """Let drivers choose what they do in the step that begins; whether one of them does."""
    driven, traffic = False, Traffic(instant)
    for actor in actors:
        if isinstance(actor.controller, Driver) and actor.commanded:
            actor.controller.decide(traffic)
            driven = True
    return driven
