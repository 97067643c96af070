"""Whether there is anything to avoid: the same run without braking, and where the ego touches whom."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from evaluation.results.rows import RunRow
from evaluation.runs.fingerprint import fingerprint
from evaluation.runs.workers import Workers, execute_all
from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Contact
from scenarios.simulation.ends import EndReason
from scenarios.spec import NO_AEB, RunSpec, simulation_of
from smartmot.geometry import signed_gap_scalar

TOUCH_M = 1e-3
"""Outlines this near touch: the engine finds a contact within 1 us, in which nothing moves 1 mm."""

RUNS_PER_WORKER = 16
"""A process takes about as long to start as this many unbraked runs."""


class Part(StrEnum):
    """Part of the ego's outline; in reverse its front is the end that leads."""

    FRONT = "front"
    SIDE = "side"
    REAR = "rear"


@dataclass(frozen=True, slots=True)
class Touch:
    """Where the outlines touch first, in the frame of the ego's front; in reverse of its rear, seen that way.

    Args:
        time_s: when.
        entity: who is touched.
        ego_speed_kmh, entity_speed_kmh: along their headings.
        part: of the ego: the end that leads, the other end, or a side alone.
        ahead_m, left_m: centre of the other's box from the middle of that end.
        heading_ahead, heading_left: unit vector of the other's heading.
        entity_length_m, entity_width_m: of its box.
        ego_length_m, ego_width_m: of the ego.
        axle_to_front_m: from the ego's reference point to that end.
        turns: 1 if the ego has turned left since its start, -1 right, 0 neither.
    """

    time_s: float
    entity: str
    ego_speed_kmh: float
    entity_speed_kmh: float
    part: Part
    ahead_m: float
    left_m: float
    heading_ahead: float
    heading_left: float
    entity_length_m: float
    entity_width_m: float
    ego_length_m: float
    ego_width_m: float
    axle_to_front_m: float
    turns: int

    @property
    def speed_ratio(self) -> float:
        """Speed of the other over that of the ego; infinite if the ego stands."""
        ego = abs(self.ego_speed_kmh)
        return abs(self.entity_speed_kmh) / ego if ego else math.inf

    def place_percent(self, reference_m: float = 0.0) -> float:
        """Where a point of the other's middle line meets the ego's width when its near face is reached.

        0 is the right edge, 100 the left one. A box that stands askew is touched before that, by a corner;
        both are then moved on at their speeds until the front is half the box's width from the point.

        Args:
            reference_m: the point, in front of the box's centre.
        """
        ahead = self.ahead_m + reference_m * self.heading_ahead
        left = self.left_m + reference_m * self.heading_left
        speed = self.entity_speed_kmh / 3.6
        closing = abs(self.ego_speed_kmh) / 3.6 - speed * self.heading_ahead
        if closing > 0.0:
            left += speed * self.heading_left * max(ahead - self.entity_width_m / 2, 0.0) / closing
        return 50.0 + 100.0 * left / self.ego_width_m


@dataclass(frozen=True, slots=True)
class Conflict:
    """What comes to pass if the ego does not brake.

    Args:
        target: entity that the test is about; None if the ego is alone.
        touch: first contact of the ego; None without one.
        cut_off_s: when the time limit ended the run; None where it did not.
    """

    target: str | None
    touch: Touch | None
    cut_off_s: float | None = None

    @property
    def missing(self) -> str:
        """Why nothing is to be avoided; empty where the ego would touch the target."""
        if self.touch is None:
            until = "" if self.cut_off_s is None else f" within {self.cut_off_s:g} s, the time limit"
            return f"no conflict without braking: the ego touches no road user{until}"
        if self.touch.entity != self.target:
            return f"no conflict with the target: without braking the ego touches {self.touch.entity} first"
        if self.touch.ego_speed_kmh == 0.0:
            return "no conflict that braking could avoid: the ego stands when it is touched"
        if self.touch.part is Part.REAR:
            return "no conflict that braking could avoid: the ego is touched at its rear"
        return ""


def unbraked(spec: RunSpec) -> RunSpec:
    """The run without perception and brakes: what is left of a run are its world and the ego's way."""
    return RunSpec(
        scenario=spec.file,
        file=spec.file,
        parameters=spec.parameters,
        strategy=NO_AEB,
        preset="physical",
        weather="dry",
        v_test_kmh=0.0,
        map_name=spec.map_name,  # the road of a scenario that names a level in place of a file
        adversaries=spec.adversaries,
        adapts=False,
    )


_KNOWN: dict[str, Conflict] = {}


def conflict_of(spec: RunSpec) -> Conflict:
    """Carry out a run without braking, once for the same files, parameters and code.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scenario cannot be run.
        opendrive.OpenDriveError: a map cannot be read.
    """
    run = unbraked(spec)
    key = fingerprint(run)
    if key not in _KNOWN:
        _KNOWN[key] = _carried_out(run)
    return _KNOWN[key]


def conflicts(
    specs: Iterable[RunSpec], workers: Workers = 1, done: Callable[[], None] = lambda: None
) -> dict[RunSpec, Conflict]:
    """What comes to pass in runs without brakes, by their `unbraked` run; each of these is run once.

    Args:
        specs: the runs; what they differ in beside the scenario and its parameters plays no part.
        workers: processes, or a scheduler; a few runs are carried out here.
        done: called after each unbraked run.
    """
    runs = list(dict.fromkeys(map(unbraked, specs)))
    if len(runs) < 2 * RUNS_PER_WORKER:
        workers = 1
    elif isinstance(workers, int):
        workers = min(workers, len(runs) // RUNS_PER_WORKER)
    by_run = {}
    for run, conflict in zip(runs, execute_all(conflict_of, runs, workers), strict=True):
        by_run[run] = conflict
        done()
    return by_run


def scored(row: RunRow, conflict: Conflict) -> RunRow:
    """The row of a run with the points that it is worth: none where nothing is to be avoided."""
    return replace(row, score=None) if conflict.missing else row


def told_without_conflict(specs: Sequence[RunSpec], by_run: Mapping[RunSpec, Conflict]) -> list[str]:
    """A line for each scenario and speed in which nothing is to be avoided.

    Args:
        specs: the runs.
        by_run: what comes to pass without braking, as `conflicts` gives it.
    """
    lines: dict[str, None] = {}
    for spec in specs:
        missing = by_run[unbraked(spec)].missing
        if missing:
            lines[f"{spec.scenario}, {spec.v_test_kmh:g} km/h: {missing}"] = None
    return list(lines)


def _carried_out(run: RunSpec) -> Conflict:
    simulation = simulation_of(run)
    engine = simulation.engine
    before = engine.entities.boxes.yaw_rad[_index(engine, engine.ego.name)]
    outcome = simulation.run()
    touch = None if outcome.contact is None else _touch(engine, outcome.contact, float(before))
    cut_off = outcome.end_reason is EndReason.TIME_LIMIT
    return Conflict(engine.target, touch, outcome.end_time_s if cut_off else None)


def _index(engine: Engine, name: str) -> int:
    return [entity.name for entity in engine.definition.entities].index(name)


def _touch(engine: Engine, contact: Contact, yaw_before_rad: float) -> Touch:
    """The contact in the frame of the end that leads; the engine stands at its instant."""
    world = engine.entities
    own, other = _index(engine, engine.ego.name), _index(engine, contact.entity)
    boxes = world.boxes
    length, width = boxes.size_m[own].tolist()
    backwards = contact.ego_speed_mps < 0.0
    yaw = float(boxes.yaw_rad[own]) + (math.pi if backwards else 0.0)
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = boxes.center_m[own].tolist()
    front = (x + c * length / 2, y + s * length / 2)
    other_x, other_y = boxes.center_m[other].tolist()
    other_length, other_width = boxes.size_m[other].tolist()
    other_yaw = float(boxes.yaw_rad[other])
    dx, dy = other_x - front[0], other_y - front[1]
    box = (other_x, other_y, other_length, other_width, other_yaw)
    part = Part.SIDE
    for end, sign in ((Part.REAR, -1), (Part.FRONT, 1)):
        # the edge as a rectangle without depth
        edge = (x + sign * c * length / 2, y + sign * s * length / 2, 0.0, width, yaw)
        if signed_gap_scalar(edge, box) <= TOUCH_M:
            part = end
    axle_x, axle_y = world.reference_m[own].tolist()
    turned = math.remainder(float(boxes.yaw_rad[own]) - yaw_before_rad, 2 * math.pi)
    return Touch(
        time_s=contact.time_s,
        entity=contact.entity,
        ego_speed_kmh=contact.ego_speed_mps * 3.6,
        entity_speed_kmh=contact.entity_speed_mps * 3.6,
        part=part,
        ahead_m=c * dx + s * dy,
        left_m=c * dy - s * dx,
        heading_ahead=math.cos(other_yaw - yaw),
        heading_left=math.sin(other_yaw - yaw),
        entity_length_m=other_length,
        entity_width_m=other_width,
        ego_length_m=length,
        ego_width_m=width,
        axle_to_front_m=c * (front[0] - axle_x) + s * (front[1] - axle_y),
        turns=0 if abs(turned) < math.radians(1.0) else int(math.copysign(1, turned)),
    )
