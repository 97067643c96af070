"""Drawn scenes as OpenSCENARIO files that need nothing but their map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from lxml import etree

from scenarios.drawn.actors import EGO, Actor, Outline
from scenarios.drawn.stage import Stage
from scenarios.drawn.timeline import RUN_OUT_M

WAITS_S = 2.0
"""A scene also ends when the ego has stood for so long."""
STRAIGHT_M = 1e-3
"""Points of a way that depart from its chord by less are left out."""


def scene_bytes(stage: Stage, map_file: str, description: str, actors: list[Actor]) -> bytes:
    """The file of a scene.

    Args:
        stage: where.
        map_file: its map, from the folder of the file.
        description: for its header.
        actors: all but the ego; what the scene is about comes first.
    """
    root = etree.Element("OpenSCENARIO")
    _add(root, "FileHeader", revMajor=1, revMinor=3, date="2026-11-29T00:00:00", author="smartmot",
         description=description)  # fmt: skip
    _add(_add(root, "RoadNetwork"), "LogicFile", filepath=map_file)
    entities = _add(root, "Entities")
    _entity(entities, "Ego", EGO)
    for actor in actors:
        _entity(entities, actor.name, actor.box)
    storyboard = _add(root, "Storyboard")
    init = _add(_add(storyboard, "Init"), "Actions")
    _ego(init, stage)
    for actor in actors:
        _begins(_add(init, "Private", entityRef=actor.name), actor)
    groups = [(actor, events) for actor in actors if (events := _events(actor, stage))]
    if groups:
        act = _add(_add(storyboard, "Story", name="scene"), "Act", name="scene")
        for actor, events in groups:
            group = _add(act, "ManeuverGroup", name=actor.name, maximumExecutionCount=1)
            _add(_add(group, "Actors", selectTriggeringEntities="false"), "EntityRef", entityRef=actor.name)
            _add(group, "Maneuver", name=actor.name).extend(events)
    stop = _add(storyboard, "StopTrigger")
    passed = stage.speed_mps * stage.lead_s + RUN_OUT_M
    _condition(stop, "passed", "Ego", "TraveledDistanceCondition", value=passed)
    _condition(stop, "the ego waits", "Ego", "StandStillCondition", duration=WAITS_S)
    etree.indent(root)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8")) + b"\n"


def _add(parent: etree._Element, tag: str, **attributes: Any) -> etree._Element:
    return etree.SubElement(parent, tag, {key: _text(value) for key, value in attributes.items()})


def _text(value: object) -> str:
    """Numbers to a tenth of a millimetre, so that files do not vary between machines."""
    return f"{round(value, 4) + 0.0:.10g}" if isinstance(value, float) else str(value)


def _entity(entities: etree._Element, name: str, box: Outline) -> None:
    """A road user with its reference point in the middle of its box."""
    scene_object = _add(entities, "ScenarioObject", name=name)
    if box.category == "pedestrian":
        user = _add(scene_object, "Pedestrian", name=name, mass=75, pedestrianCategory="pedestrian")
    else:
        user = _add(scene_object, "Vehicle", name=name, vehicleCategory=box.category)
    bounding = _add(user, "BoundingBox")
    _add(bounding, "Center", x=0, y=0, z=box.height_m / 2)
    _add(bounding, "Dimensions", length=box.length_m, width=box.width_m, height=box.height_m)
    if box.category != "pedestrian":
        half = box.length_m * 0.3
        _add(user, "Performance", maxSpeed=70, maxAcceleration=10, maxDeceleration=15)
        axles = _add(user, "Axles")
        shape = {"wheelDiameter": 0.6, "trackWidth": box.width_m - 0.3, "positionZ": 0.3}
        _add(axles, "FrontAxle", maxSteering=0.6, positionX=half, **shape)
        _add(axles, "RearAxle", maxSteering=0, positionX=-half, **shape)
    _add(user, "Properties")


def _speed(private: etree._Element, target_mps: float, over_m: float | None = None) -> None:
    action = _add(_add(private, "LongitudinalAction"), "SpeedAction")
    if over_m is None:
        _add(action, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0)
    else:
        _add(
            action, "SpeedActionDynamics", dynamicsShape="linear", dynamicsDimension="distance", value=over_m
        )
    # the whole speed: its fourth decimal would be centimetres over a scene
    _add(_add(action, "SpeedActionTarget"), "AbsoluteTargetSpeed", value=f"{target_mps:.9g}")


def _position(parent: etree._Element, x: float, y: float, yaw: float | None = None) -> None:
    heading = {} if yaw is None else {"h": f"{math.remainder(yaw, 2.0 * math.pi):.5f}"}
    _add(_add(parent, "Position"), "WorldPosition", x=x, y=y, **heading)


def _ego(init: etree._Element, stage: Stage) -> None:
    """At the start of its way, which it follows lane by lane, at its speed."""
    private = _add(init, "Private", entityRef="Ego")
    places = [{"roadId": road, "laneId": lane, "s": s} for road, lane, s in stage.waypoints()]
    teleport = _add(_add(private, "PrivateAction"), "TeleportAction")
    _add(_add(teleport, "Position"), "LanePosition", **places[0])
    _speed(_add(private, "PrivateAction"), stage.speed_mps)
    routing = _add(_add(private, "PrivateAction"), "RoutingAction")
    route = _add(_add(routing, "AssignRouteAction"), "Route", name="way", closed="false")
    for place in places:
        waypoint = _add(route, "Waypoint", routeStrategy="shortest")
        _add(_add(waypoint, "Position"), "LanePosition", **place)


def _begins(private: etree._Element, actor: Actor) -> None:
    """Place, way and speed at the start."""
    if actor.motion.speed_mps == 0.0:
        pose = actor.start
        teleport = _add(_add(private, "PrivateAction"), "TeleportAction")
        _position(teleport, pose.x_m, pose.y_m, pose.yaw_rad)
        return
    routing = _add(_add(private, "PrivateAction"), "RoutingAction")
    follow = _add(routing, "FollowTrajectoryAction")
    trajectory = _add(_add(follow, "TrajectoryRef"), "Trajectory", name="way", closed="false")
    _curve(_add(trajectory, "Shape"), actor)
    _add(_add(follow, "TimeReference"), "None")
    _add(follow, "TrajectoryFollowingMode", followingMode="position")
    if actor.motion.sets_off_s is None:
        _speed(_add(private, "PrivateAction"), actor.motion.speed_mps)


def _curve(shape: etree._Element, actor: Actor) -> None:
    """A polyline of a straight way; else a cubic B-spline with the way's points as control points.

    Between control points h apart a curve of curvature k is h^2 k / 6 inside of them: 2 cm for 2 m at 35 m.
    """
    points = actor.way_m
    chord = points[-1] - points[0]
    aside = np.abs((points - points[0]) @ np.array([-chord[1], chord[0]])) / math.hypot(*chord)
    if not actor.smooth or float(aside.max()) < STRAIGHT_M:
        line = _add(shape, "Polyline")
        for x, y in (points[0].tolist(), points[-1].tolist()):
            _position(_add(line, "Vertex", time=0), x, y)
        return
    curve = _add(shape, "Nurbs", order=4)
    for x, y in points.tolist():
        _position(_add(curve, "ControlPoint", weight=1), x, y)
    for knot in (0, 0, 0, *range(len(points) - 2), *[len(points) - 3] * 3):
        _add(curve, "Knot", value=knot)


def _events(actor: Actor, stage: Stage) -> list[etree._Element]:
    """Setting off when the ego has driven as far as it would have then, and stopping after its own way."""
    motion, events = actor.motion, []
    if motion.sets_off_s is not None:
        event = etree.Element("Event", name="sets off", priority="override")
        action = _add(_add(event, "Action", name="sets off"), "PrivateAction")
        _speed(action, motion.speed_mps, motion.accelerates_m)
        driven = stage.speed_mps * motion.sets_off_s
        trigger = _add(event, "StartTrigger")
        _condition(trigger, "the ego is near enough", "Ego", "TraveledDistanceCondition", value=driven)
        events.append(event)
    if motion.brakes_after_m is not None:
        event = etree.Element("Event", name="stops", priority="override")
        action = _add(_add(event, "Action", name="stops"), "PrivateAction")
        _speed(action, 0.0, motion.brakes_m)
        trigger = _add(event, "StartTrigger")
        way = motion.brakes_after_m
        _condition(trigger, "at the kerb", actor.name, "TraveledDistanceCondition", value=way)
        events.append(event)
    return events


def _condition(trigger: etree._Element, name: str, entity: str, kind: str, **limit: float) -> None:
    group = _add(trigger, "ConditionGroup")
    condition = _add(group, "Condition", name=name, delay=0, conditionEdge="none")
    by_entity = _add(condition, "ByEntityCondition")
    triggering = _add(by_entity, "TriggeringEntities", triggeringEntitiesRule="any")
    _add(triggering, "EntityRef", entityRef=entity)
    _add(_add(by_entity, "EntityCondition"), kind, **limit)
