"""A recorded drive, or a simulated run, as an OpenSCENARIO file: everybody moves as recorded, by the clock.

The ego's way and times are a trajectory as well; who brakes it departs from the times and not from the way.
All others keep to theirs, whatever the ego does. Reference points are the middles of the boxes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count, pairwise
from typing import Any

import numpy as np
from lxml import etree

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import HEIGHT_M, Objects, Sequence
from scenarios.recorded.motion import center_poses
from scenarios.recorded.vehicles import Vehicle
from smartmot.types import FloatArray, IntArray

TOLERANCE_M, TOLERANCE_RAD = 0.003, 0.01
"""Frames are left out where a straight line in time between others departs by less."""
TURN_RAD = 1.5
"""Vertices whose headings are farther apart have others between them where there are frames: headings of
trajectories go the short way."""
STANDS_M = 0.002
"""Vertices in a row that are nearer are one place: there it stands. With that, places are within 5 mm."""
GAP_S = 1.0
"""Who is not recorded for longer is not there meanwhile; shorter gaps are bridged in a straight line."""
RUN_OUT_S = 5.0
"""A run goes on for so long beyond the recording if the ego has braked and not yet come to its end or to a
standstill: 5 s are a stop from 90 km/h with 5 m/s2, the least that UN R152 asks for."""
LAST_S, DRIFTS_MPS = 0.2, 0.3
"""Meanwhile all go on straight with their mean velocity over that time; who was slower stands, since labels
of parked cars move by centimetres."""
MARGIN_S = 1e-4
"""Who comes or goes does so this long before the first or after the last frame, so that both have it."""
STOOD_S, NEAR_END_M = 1.0, 0.05
"""Ends after the recording: the ego stands for so long, or is so near to its recorded end."""
REVERSES_MPS, REVERSES_M = 0.5, 0.2
"""An ego that goes faster and further against its heading than this drives in reverse."""

EGO = "Ego"
_DIGITS, _TIME_DIGITS = 4, 6
_VEHICLES = {"car": "car", "truck": "truck", "motorcycle": "motorbike", "cyclist": "bicycle"}


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """One road user from its first frame to its last.

    Args:
        name: Unique in the file.
        identity: In the recording; of the ego -1.
        category: One of `smartmot.types.CATEGORIES`.
        size_m: Length, width and height.
        time_s: (K,) times since the first frame of the drive.
        pose: (K, 3) x, y and unwrapped yaw of the middle of the box, or (K, 4) with the height of its
            underside behind.
    """

    name: str
    identity: int
    category: str
    size_m: tuple[float, float, float]
    time_s: FloatArray
    pose: FloatArray

    def vertices(self, run_out: bool = False) -> tuple[FloatArray, FloatArray]:
        """(V,) times and (V, 3) or (V, 4) poses that give all frames again; equal places are where it stands.

        Args:
            run_out: Whether to go on beyond the last frame.
        """
        kept = kept_frames(self.time_s, self.pose)
        time_s, pose = self.time_s[kept], self.pose[kept]
        pose[:, :2] = pose[:, :2].round(_DIGITS)
        for before, row in pairwise(pose):
            if math.dist(before[:2], row[:2]) < STANDS_M:
                row[:2] = before[:2]
        if run_out:
            beyond = np.append(pose[-1, :2] + RUN_OUT_S * self._last_velocity(), pose[-1, 2:])
            time_s, pose = np.append(time_s, time_s[-1] + RUN_OUT_S), np.vstack((pose, beyond))
        return time_s, pose

    def _last_velocity(self) -> FloatArray:
        """(2,) mean velocity at the end; 0 for who stands."""
        first = int(np.searchsorted(self.time_s, self.time_s[-1] - LAST_S, side="right")) - 1
        first = min(max(first, 0), max(len(self.time_s) - 2, 0))
        span_s = self.time_s[-1] - self.time_s[first]
        if span_s == 0.0:
            return np.zeros(2)
        velocity: FloatArray = (self.pose[-1, :2] - self.pose[first, :2]) / span_s
        return velocity if math.hypot(*velocity) >= DRIFTS_MPS else np.zeros(2)


def openscenario_bytes(
    sequence: Sequence,
    labels: Objects | None = None,
    *,
    map_file: str | None = None,
    ego: Vehicle | None = None,
    names: Mapping[int, str] | None = None,
    first: int | None = None,
) -> bytes:
    """The file of a drive.

    Args:
        sequence: The recording, with poses of the ego.
        labels: Who else is there, by identities; None: the recording's labels.
        map_file: OpenDRIVE file as the scenario is to name it; None: a plane without roads.
        ego: The vehicle's box; None: a car whose middle is recorded.
        names: Of road users, by identity; None: category and identity.
        first: Identity of whom the scenario is about; None: whom the ego passes last, since a run ends when
            the ego has passed whom it is about.

    Raises:
        DatasetError: There are no poses or no labels, or the ego drives in reverse.
    """
    ego = ego or Vehicle()
    labels = sequence.labels if labels is None else labels
    if sequence.world_SE3_ego is None:
        raise DatasetError(f"sequence {sequence.name} has no ego poses, which a scenario needs")
    if labels is None:
        raise DatasetError(f"sequence {sequence.name} has no labels, which a scenario needs")
    time_s = (sequence.stamp_s - sequence.stamp_s[0]).round(_TIME_DIGITS)
    if len(time_s) < 2 or np.any(np.diff(time_s) <= 0.0):
        raise DatasetError(f"sequence {sequence.name}: a scenario needs two frames at rising times or more")
    vehicle = _ego(sequence, time_s, ego)
    others = _road_users(labels, time_s, names or {}, sequence.ego_heights_m() is not None)
    if first is None:
        others.sort(key=lambda user: -_passed_s(user, vehicle))
    else:
        others.sort(key=lambda user: user.identity != first)
    return _file(sequence.name, map_file, vehicle, others)


def kept_frames(time_s: FloatArray, pose: FloatArray) -> IntArray:
    """Frames between which all others lie on straight lines in time, within the tolerances.

    Args:
        time_s: (K,) rising times.
        pose: (K, 3) x, y and unwrapped yaw.
    """
    kept, open_spans = {0, len(time_s) - 1}, [(0, len(time_s) - 1)]
    while open_spans:
        first, last = open_spans.pop()
        if last - first < 2:
            continue
        between = slice(first + 1, last)
        part = (time_s[between] - time_s[first]) / (time_s[last] - time_s[first])
        miss = pose[between] - (pose[first] + part[:, None] * (pose[last] - pose[first]))
        worst = np.maximum(np.hypot(miss[:, 0], miss[:, 1]) / TOLERANCE_M, np.abs(miss[:, 2]) / TOLERANCE_RAD)
        turns = abs(pose[last, 2] - pose[first, 2]) > TURN_RAD
        if turns or worst.max() > 1.0:
            middle = (first + last) // 2 if worst.max() <= 1.0 else first + 1 + int(worst.argmax())
            kept.add(middle)
            open_spans += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)


def _ego(sequence: Sequence, time_s: FloatArray, outline: Vehicle) -> Recorded:
    pose = center_poses(sequence, outline.center_ahead_m)
    pose[:, 2] = np.unwrap(pose[:, 2])
    if (heights_m := sequence.ego_heights_m()) is not None:
        pose = np.column_stack((pose, heights_m))
    size = (outline.length_m, outline.width_m, HEIGHT_M)
    vehicle = Recorded(EGO, -1, "car", size, time_s, pose)
    time, way = vehicle.vertices()
    step = np.diff(way[:, :2], axis=0)
    along = step[:, 0] * np.cos(way[:-1, 2]) + step[:, 1] * np.sin(way[:-1, 2])
    reverses = (along < -REVERSES_M) & (along / np.diff(time) < -REVERSES_MPS)
    if reverses.any():
        raise DatasetError(
            f"sequence {sequence.name}: the ego drives in reverse at {time[int(reverses.argmax())]:g} s, "
            "which its trajectory cannot say; cut the recording there"
        )
    return vehicle


def _road_users(
    labels: Objects, time_s: FloatArray, names: Mapping[int, str], has_heights: bool
) -> list[Recorded]:
    """All others, one for each time that they are there."""
    users: list[Recorded] = []
    taken = {EGO}
    for identity in np.unique(labels.object_id).tolist():
        rows = np.flatnonzero(labels.object_id == identity)
        rows = rows[np.unique(labels.frame[rows], return_index=True)[1]]
        times = time_s[labels.frame[rows]]
        for part in np.split(rows, np.flatnonzero(np.diff(times) > GAP_S) + 1):
            category = str(labels.category[part[0]])
            name = _free_name(names.get(identity, f"{category}_{identity}"), taken)
            taken.add(name)
            size = (*np.median(labels.size_m[part], axis=0).tolist(), float(np.median(labels.height_m[part])))
            columns = [labels.center_m[part], np.unwrap(labels.yaw_rad[part])]
            pose = np.column_stack([*columns, labels.bottom_m[part]] if has_heights else columns)
            users.append(Recorded(name, identity, category, size, time_s[labels.frame[part]], pose))
    return users


def _plain(name: str) -> str:
    """A name without what XML cannot hold, and without the mark of a parameter."""
    return "".join(c if c.isprintable() and c != "$" else "_" for c in name)


def _free_name(name: str, taken: set[str]) -> str:
    """A plain name, with a number where it is taken."""
    name = _plain(name)
    numbered = (f"{name}_{number}" for number in count(2))
    return name if name not in taken else next(each for each in numbered if each not in taken)


def _passed_s(user: Recorded, ego: Recorded) -> float:
    """When the ego has passed a road user that was ahead, infinite if never; -1 if it was never ahead."""
    pose = ego.pose[np.searchsorted(ego.time_s, user.time_s)]
    offset = user.pose[:, :2] - pose[:, :2]
    ahead = np.cos(pose[:, 2]) * offset[:, 0] + np.sin(pose[:, 2]) * offset[:, 1] > 0.0
    if not ahead.any():
        return -1.0
    lasts = user.time_s[-1] == ego.time_s[-1]
    return math.inf if ahead[-1] and lasts else float(user.time_s[np.flatnonzero(ahead)[-1]])


# The file


def _file(name: str, map_file: str | None, ego: Recorded, others: list[Recorded]) -> bytes:
    root = etree.Element("OpenSCENARIO")
    _add(root, "FileHeader", revMajor=1, revMinor=3, date="2026-11-29T00:00:00", author="smartmot",
         description=f"{_plain(name)}, as recorded")  # fmt: skip
    _add(root, "CatalogLocations")
    network = _add(root, "RoadNetwork")
    if map_file is not None:
        _add(network, "LogicFile", filepath=map_file)
    entities = _add(root, "Entities")
    for user in (ego, *others):
        _entity(entities, user)
    storyboard = _add(root, "Storyboard")
    init = _add(_add(storyboard, "Init"), "Actions")
    _begin(init, ego)
    for user in others:
        if user.time_s[0] == 0.0:
            _teleport(_add(init, "Private", entityRef=user.name), user.pose[0])
    story, end_s = _add(storyboard, "Story", name="recorded"), float(ego.time_s[-1])
    act = _add(story, "Act", name="recorded")
    for user in others:
        _group(act, user, end_s)
    if len(act):
        _at(_add(act, "StartTrigger"), "begin", 0.0)
    else:
        storyboard.remove(story)
    _stop(_add(storyboard, "StopTrigger"), ego)
    etree.indent(root)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8")) + b"\n"


def _entity(entities: etree._Element, user: Recorded) -> None:
    length, width, height = user.size_m
    scene_object = _add(entities, "ScenarioObject", name=user.name)
    if user.category == "pedestrian":
        box = _add(scene_object, "Pedestrian", name=user.category, mass=75, pedestrianCategory="pedestrian")
    elif user.category in _VEHICLES:
        kind = _VEHICLES[user.category]
        box = _add(scene_object, "Vehicle", name=user.category, vehicleCategory=kind)
    else:
        box = _add(scene_object, "MiscObject", name=user.category, mass=100, miscObjectCategory="none")
    bounding = _add(box, "BoundingBox")
    _add(bounding, "Center", x=0, y=0, z=0.5 * height)
    _add(bounding, "Dimensions", length=length, width=width, height=height)
    if user.category in _VEHICLES:
        _add(box, "Performance", maxSpeed=100, maxAcceleration=20, maxDeceleration=20)
        axles = _add(box, "Axles")
        wheel = {"wheelDiameter": 0.6, "trackWidth": 0.8 * width, "positionZ": 0.3}
        _add(axles, "FrontAxle", maxSteering=0.6, positionX=0.3 * length, **wheel)
        _add(axles, "RearAxle", maxSteering=0, positionX=-0.3 * length, **wheel)
    _add(box, "Properties")


def _begin(init: etree._Element, ego: Recorded) -> None:
    """The ego at its first place, with its first speed, on its way."""
    private = _add(init, "Private", entityRef=ego.name)
    _teleport(private, ego.pose[0])
    time_s, way = ego.vertices(run_out=True)
    length, span_s = math.dist(way[1, :2], way[0, :2]), time_s[1] - time_s[0]
    speed = _add(_add(_add(private, "PrivateAction"), "LongitudinalAction"), "SpeedAction")
    _add(speed, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0)
    _add(_add(speed, "SpeedActionTarget"), "AbsoluteTargetSpeed", value=float(length / span_s))
    _follow(private, time_s, way)


def _group(act: etree._Element, user: Recorded, end_s: float) -> None:
    """What becomes of a road user: it comes, moves, and goes."""
    group = _add(act, "ManeuverGroup", name=user.name, maximumExecutionCount=1)
    _add(_add(group, "Actors", selectTriggeringEntities="false"), "EntityRef", entityRef=user.name)
    maneuver = _add(group, "Maneuver", name=user.name)
    begin_s, last_s = user.time_s[0].item(), user.time_s[-1].item()
    time_s, way = user.vertices(run_out=last_s == end_s)
    moves = np.any(way[:, :2] != way[0, :2])
    if begin_s > 0.0 or moves:
        event = _add(maneuver, "Event", name="begins", priority="parallel", maximumExecutionCount=1)
        if begin_s > 0.0:
            action = _add(_add(event, "Action", name="comes"), "GlobalAction")
            _position(_add(_add(action, "EntityAction", entityRef=user.name), "AddEntityAction"), way[0])
        if moves:
            _follow(_add(event, "Action", name="moves"), time_s, way)
        _at(_add(event, "StartTrigger"), "begins", max(begin_s - MARGIN_S, 0.0))
    if last_s < end_s:
        event = _add(maneuver, "Event", name="ends", priority="parallel", maximumExecutionCount=1)
        action = _add(_add(event, "Action", name="goes"), "GlobalAction")
        _add(_add(action, "EntityAction", entityRef=user.name), "DeleteEntityAction")
        _at(_add(event, "StartTrigger"), "ends", last_s + MARGIN_S)
    if not len(maneuver):
        act.remove(group)


def _stop(trigger: etree._Element, ego: Recorded) -> None:
    """After the recording: the ego is at its end or stands, or has had its time."""
    end_s, (_, way) = ego.time_s[-1].item(), ego.vertices()
    length = float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum())
    for kind, limit in (
        ("TraveledDistanceCondition", {"value": max(length - NEAR_END_M, 0.0)}),
        ("StandStillCondition", {"duration": STOOD_S}),
    ):
        group = _at(trigger, "end of the recording", end_s + MARGIN_S)
        condition = _add(group, "Condition", name=kind, delay=0, conditionEdge="none")
        by_entity = _add(condition, "ByEntityCondition")
        triggering = _add(by_entity, "TriggeringEntities", triggeringEntitiesRule="any")
        _add(triggering, "EntityRef", entityRef=ego.name)
        _add(_add(by_entity, "EntityCondition"), kind, **limit)
    _at(trigger, "time is up", end_s + RUN_OUT_S)


def _follow(parent: etree._Element, time_s: FloatArray, way: FloatArray) -> None:
    """A trajectory by absolute times; nothing for who stands all the time."""
    if not np.any(way[:, :2] != way[0, :2]):
        return
    follow = _add(_add(_add(parent, "PrivateAction"), "RoutingAction"), "FollowTrajectoryAction")
    trajectory = _add(_add(follow, "TrajectoryRef"), "Trajectory", name="as recorded", closed="false")
    line = _add(_add(trajectory, "Shape"), "Polyline")
    for time, pose in zip(time_s.tolist(), way, strict=True):
        _position(_add(line, "Vertex", time=f"{time:.{_TIME_DIGITS}f}"), pose)
    timing = _add(follow, "TimeReference")
    _add(timing, "Timing", domainAbsoluteRelative="absolute", scale=1, offset=0)
    _add(follow, "TrajectoryFollowingMode", followingMode="position")


def _teleport(private: etree._Element, pose: FloatArray) -> None:
    _position(_add(_add(private, "PrivateAction"), "TeleportAction"), pose)


def _position(parent: etree._Element, pose: FloatArray) -> None:
    x, y, yaw, *heights = pose.tolist()
    place = _add(parent, "Position")
    heading = f"{math.remainder(yaw, 2.0 * math.pi):.5f}"
    z = {"z": f"{heights[0]:.{_DIGITS}f}"} if heights else {}
    _add(place, "WorldPosition", x=f"{x:.{_DIGITS}f}", y=f"{y:.{_DIGITS}f}", **z, h=heading)


def _at(trigger: etree._Element, name: str, time_s: float) -> etree._Element:
    """A group of conditions with one on the time."""
    group = _add(trigger, "ConditionGroup")
    condition = _add(group, "Condition", name=name, delay=0, conditionEdge="none")
    value = f"{time_s:.{_TIME_DIGITS}f}"
    _add(_add(condition, "ByValueCondition"), "SimulationTimeCondition", value=value, rule="greaterOrEqual")
    return group


def _add(parent: etree._Element, tag: str, **attributes: Any) -> etree._Element:
    return etree.SubElement(parent, tag, {key: _text(value) for key, value in attributes.items()})


def _text(value: object) -> str:
    return f"{round(value, 6) + 0.0:.10g}" if isinstance(value, float) else str(value)
