"""The decision: follow the path, adapt the speed, or stop; with the events of the temporal diagram.

Rules of the paper (section III, figure 4; conditions of the authors' code):

- `forecasted_pedestrian` opens the unexpected behaviour: the forecast of a moving VRU enters the ego's way.
- `predicted_collision`: forecast boxes overlap, and the nearest object that counts is nearer than the
  braking distance or than 12 m. The ego brakes until it stands, and holds.
- `free_lane`, `end_unexpected`: nothing on the ego's way and nobody about to enter it, for 3 frames (0.15 s).
  After an emergency brake only at standstill: the area that is looked at shrinks with the speed, and an
  object that is no longer in it has not gone away.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import _smartmot
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class AebConfig:
    """Conditions of the decision.

    Args:
        near_m: an object nearer than this counts as near at any speed (paper's authors: 12 m).
        clear_s: time for which the way must be free before driving on (3 frames at 20 Hz).
        braking_factor: by which the planned braking distance is multiplied: more brakes earlier (paper: 1).
    """

    near_m: float = 12.0
    clear_s: float = 0.15
    braking_factor: float = 1.0

    def __post_init__(self) -> None:
        if not (self.near_m >= 0 and self.clear_s >= 0 and self.braking_factor >= 0):
            raise ConfigError("aeb: near_m, clear_s and braking_factor must not be negative")


@dataclass(frozen=True, slots=True)
class Event:
    """Something one layer of the decision reports.

    Args:
        stamp_s: when.
        layer: start, selector, unexpected or monitors.
        name: run_start, follow_path, unexpected, forecasted_pedestrian, predicted_collision,
            end_unexpected, collision or free_lane.
    """

    stamp_s: float
    layer: str
    name: str


@dataclass(frozen=True, slots=True)
class Situation:
    """What the paper's rule looks at in one frame.

    Args:
        stamp_s: time.
        collision_predicted: some object that counts is on a collision course.
        nearest_m: distance to the nearest object that counts, from the ego's centre, or from as far behind
            its front as a car's centre is; infinite without one.
        braking_distance_m: at the ego's present speed.
        vru_entering: the forecast of a moving VRU enters the ego's way.
        way_occupied: an object is on the ego's way.
        standing: the ego stands still.
    """

    stamp_s: float
    collision_predicted: bool
    nearest_m: float
    braking_distance_m: float
    vru_entering: bool
    way_occupied: bool
    standing: bool


@dataclass(frozen=True, slots=True)
class AebState:
    """Memory between frames; `AebState()` before the first."""

    started: bool = False
    unexpected: bool = False
    emergency: bool = False
    clear_since_s: float | None = None


def decide(state: AebState, now: Situation, config: AebConfig) -> tuple[AebState, bool, tuple[Event, ...]]:
    """One decision.

    Returns:
        The next state, whether to brake fully and hold, and the events of this frame.
    """
    events: list[Event] = []

    def report(layer: str, name: str) -> None:
        events.append(Event(now.stamp_s, layer, name))

    if not state.started:
        report("start", "run_start")
        report("selector", "follow_path")
        state = replace(state, started=True)
    near = now.nearest_m < max(now.braking_distance_m, config.near_m)
    flag = now.collision_predicted and near
    if (now.vru_entering or flag) and not state.unexpected:
        if now.vru_entering:
            report("unexpected", "forecasted_pedestrian")
        report("selector", "unexpected")
        state = replace(state, unexpected=True)
    if flag and not state.emergency:
        report("monitors", "collision")
        report("unexpected", "predicted_collision")
        state = replace(state, emergency=True)
    if not state.unexpected:
        return state, False, tuple(events)
    braking = state.emergency and not now.standing
    if braking or now.vru_entering or now.way_occupied or flag:
        state = state if state.clear_since_s is None else replace(state, clear_since_s=None)
        return state, state.emergency, tuple(events)
    since = now.stamp_s if state.clear_since_s is None else state.clear_since_s
    if now.stamp_s - since < config.clear_s - 1e-9:
        return replace(state, clear_since_s=since), state.emergency, tuple(events)
    report("monitors", "free_lane")
    report("unexpected", "end_unexpected")
    report("selector", "follow_path")
    return AebState(started=True), False, tuple(events)


__getattr__ = _smartmot.renamed(__name__, {"BrakeCommand": "smartmot.decision.rules.Command"})
