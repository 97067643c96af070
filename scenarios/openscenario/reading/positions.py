"""Positions, routes and trajectories from XML, where their declarations alone do not say how."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import cast

from scenarios.openscenario.errors import ContentError, UnsupportedError
from scenarios.openscenario.model import (
    ClothoidSegment,
    ClothoidSpline,
    GeoPosition,
    Nurbs,
    Polyline,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    Route,
    RoutePosition,
    Shape,
    Trajectory,
    Vertex,
    Waypoint,
)
from scenarios.openscenario.reading.carla import right_handed
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, allow, declared, one_of, read, reads
from scenarios.openscenario.reading.parameters import Declarations

MAX_CONTROL_POINTS = 1000
"""Greater splines are refused."""


def position(node: Node, context: Context) -> Position:
    """Position from an element that holds one (Position, TargetPosition, PositionStart ...)."""
    return cast(Position, one_of(Position, node, context))


@reads(RelativeLanePosition)
def _relative_lane(node: Node, context: Context) -> RelativeLanePosition:
    allow(RelativeLanePosition, node)
    if node.has("ds") and node.has("dsLane"):
        raise ContentError(f"{node.where} needs either 'ds' or 'dsLane'")
    along_lane = node.has("dsLane")
    given = _zeros(node, context, {"dLane": "d_lane"} if along_lane else {"dLane": "d_lane", "ds": "ds_m"})
    return declared(RelativeLanePosition, node, context, along_lane=along_lane, **given)


@reads(RelativeRoadPosition)
def _relative_road(node: Node, context: Context) -> RelativeRoadPosition:
    allow(RelativeRoadPosition, node)
    given = _zeros(node, context, {"ds": "ds_m", "dt": "dt_m"})
    return declared(RelativeRoadPosition, node, context, **given)


@reads(RelativeObjectPosition)
@reads(RelativeWorldPosition)
def _relative_point(node: Node, context: Context) -> RelativeObjectPosition | RelativeWorldPosition:
    kind = RelativeObjectPosition if node.tag == "RelativeObjectPosition" else RelativeWorldPosition
    allow(kind, node)
    given = _zeros(node, context, {"dx": "dx_m", "dy": "dy_m"})
    if kind is RelativeObjectPosition:
        return declared(RelativeObjectPosition, node, context, **given)
    return declared(RelativeWorldPosition, node, context, **given)


def _zeros(node: Node, context: Context, fields: Mapping[str, str]) -> dict[str, int]:
    """Differences that a relative position does not give: 0, as in esmini."""
    missing = [name for name in fields if not node.has(name)]
    if missing:
        context.note(node, f"gives no {' and no '.join(missing)}: 0")
    return {fields[name]: 0 for name in missing}


@reads(GeoPosition)
def _geographic(node: Node, context: Context) -> GeoPosition:
    """In degrees; `latitude` and `longitude`, as before 1.2, are in radians.

    Raises:
        ContentError: a value is outside its range, which degrees in the place of radians mostly are.
    """
    allow(GeoPosition, node)
    degrees: list[float] = []
    for name, most in (("latitude", 90.0), ("longitude", 180.0)):
        old = not node.has(f"{name}Deg") and node.has(name)
        value = node.number(name if old else f"{name}Deg")
        degrees.append(math.degrees(value) if old else value)
        if abs(degrees[-1]) > most * (1.0 + 1e-9):
            asked = (
                f"{name}: it is in radians, at most {math.radians(most):.5g}, got '{value:g}'; "
                f"degrees are {name}Deg"
                if old
                else f"{name}Deg: expected at most {most:g} degrees, got '{value:g}'"
            )
            raise ContentError(f"{node.where} {asked}")
    if node.has("verticalRoadSelection") and node.integer("verticalRoadSelection") != 0:
        raise UnsupportedError(f"{node.where} verticalRoadSelection is not supported; give the altitude")
    height = next((name for name in ("altitude", "height") if node.has(name)), None)
    z_m = None if height is None else node.number(height)
    return declared(GeoPosition, node, context, latitude_deg=degrees[0], longitude_deg=degrees[1], z_m=z_m)


@reads(RoutePosition)
def _on_route(node: Node, context: Context) -> RoutePosition:
    allow(RoutePosition, node)
    way = route(node.need("RouteRef"), context)
    place = node.need("InRoutePosition").one_of("FromLaneCoordinates FromRoadCoordinates FromCurrentEntity")
    lane_id: int | None = None
    entity: str | None = None
    path_s_m = offset_m = 0.0
    if place.tag == "FromCurrentEntity":
        place.allow("entityRef")
        entity = context.entity(place)
    elif place.tag == "FromLaneCoordinates":
        place.allow("pathS laneId laneOffset")
        lane_id, offset_m = place.integer("laneId"), place.number("laneOffset", 0.0)
        path_s_m = place.positive("pathS")
    else:
        place.allow("pathS t")
        path_s_m, offset_m = place.positive("pathS"), place.number("t")
    given = {"path_s_m": path_s_m, "lane_id": lane_id, "offset_m": offset_m, "entity": entity}
    return declared(RoutePosition, node, context, route=way, **given)


def scoped(node: Node) -> Node:
    """The element, seeing the parameters that it declares itself."""
    return node.within(Declarations(node.get("ParameterDeclarations"), {}, node.scope).scope())


def referenced(parent: Node, tag: str, context: Context, attributes: str = "") -> Node:
    """The element `tag` inside `parent`, or the catalog entry in its place; seeing its own parameters."""
    child = parent.one_of(f"{tag} CatalogReference", attributes)
    return context.catalogs.entry(child, tag) if child.tag == "CatalogReference" else scoped(child)


@reads(Route)
def route(parent: Node, context: Context) -> Route:
    """Route from RouteRef or AssignRouteAction."""
    node = referenced(parent, "Route", context)
    allow(Route, node)
    waypoints = [read(Waypoint, child, context) for child in node.all("Waypoint")]
    if len(waypoints) < 2:
        raise ContentError(f"{node.where} needs at least two Waypoints, got {len(waypoints)}")
    places = tuple([waypoint.position for waypoint in waypoints])
    strategies = tuple([waypoint.strategy for waypoint in waypoints])
    return Route(node.text("name"), places, node.boolean("closed"), strategies)


@reads(Trajectory)
def trajectory(parent: Node, context: Context, timed: bool = False) -> Trajectory:
    """Trajectory from TrajectoryRef (or, as in 1.0, from the action itself); by time or not."""
    node = referenced(parent, "Trajectory", context)
    allow(Trajectory, node)
    closed = node.boolean("closed")
    shape = node.need("Shape").one_of("Polyline ClothoidSpline Clothoid Nurbs")
    kind = {"Polyline": Polyline, "Nurbs": Nurbs}.get(shape.tag, ClothoidSpline)
    curve = cast(Shape, read(kind, shape, context))
    timed = timed and curve.has_times
    if timed and isinstance(curve, Polyline) and all(map(_gives_heading, shape)):
        curve = Polyline(curve.vertices, headed=True)
    return Trajectory(node.text("name"), curve, closed)


def _gives_heading(vertex: Node) -> bool:
    place = vertex.need("Position").get("WorldPosition")
    return place is not None and place.has("h")


@reads(Polyline)
def _polyline(node: Node, context: Context) -> Polyline:
    allow(Polyline, node)
    vertices = tuple(read(Vertex, child, context) for child in node)
    if len(vertices) < 2:
        raise ContentError(f"{node.where} needs at least two vertices, got {len(vertices)}")
    return Polyline(vertices)


@reads(ClothoidSpline)
def _clothoid_spline(node: Node, context: Context) -> ClothoidSpline:
    if node.tag == "Clothoid":
        return _clothoid(node, context)
    allow(ClothoidSpline, node)
    segments = tuple(read(ClothoidSegment, child, context) for child in node)
    if not segments:
        raise ContentError(f"{node.where} needs at least one ClothoidSplineSegment")
    return ClothoidSpline(segments, node.number("timeEnd") if node.has("timeEnd") else None)


def _clothoid(node: Node, context: Context) -> ClothoidSpline:
    """A single clothoid is a spline of one piece; 1.0 calls the change of curvature `curvatureDot`."""
    node.allow("curvature curvatureDot curvaturePrime length startTime stopTime", "Position")
    begin_s = node.number("startTime") if node.has("startTime") else None
    end_s = node.number("stopTime") if node.has("stopTime") else None
    rate = node.number("curvaturePrime" if node.has("curvaturePrime") else "curvatureDot")
    length, curvature = node.positive("length", zero=False), node.number("curvature")
    start = position(node.need("Position"), context)
    piece = ClothoidSegment(length, curvature, curvature + rate * length, start, 0.0, begin_s)
    return ClothoidSpline((cast(ClothoidSegment, right_handed(piece)) if context.of_carla else piece,), end_s)


@reads(Nurbs)
def _nurbs(node: Node, context: Context) -> Nurbs:
    node.allow("order", "ControlPoint Knot")
    order = node.integer("order")
    points: list[Position] = []
    weights: list[float] = []
    times: list[float] = []
    for point in node.all("ControlPoint"):
        point.allow("weight time", "Position")
        if point.has("time"):
            times.append(point.number("time"))
        points.append(position(point.need("Position"), context))
        weights.append(point.positive("weight", 1.0, zero=False))
    knots: list[float] = []
    for knot in node.all("Knot"):
        knot.allow("value")
        knots.append(knot.number("value"))
    if not 2 <= order <= len(points) <= MAX_CONTROL_POINTS:
        raise ContentError(
            f"{node.where} needs order >= 2 and {max(order, 2)} to {MAX_CONTROL_POINTS} ControlPoints, "
            f"got order {order} and {len(points)}"
        )
    if len(knots) != len(points) + order:
        raise ContentError(f"{node.where} needs {len(points) + order} Knots, got {len(knots)}")
    if knots != sorted(knots) or knots[order - 1] >= knots[len(points)]:
        raise ContentError(f"{node.where} the Knots must not decrease and must span an interval")
    if times and len(times) < len(points):
        raise ContentError(f"{node.where} needs a time at every ControlPoint, or at none")
    return Nurbs(order, tuple(points), tuple(weights), tuple(knots), tuple(times))
