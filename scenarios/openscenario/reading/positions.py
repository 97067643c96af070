"""Positions, routes and trajectories from XML."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from scenarios.openscenario.errors import ContentError, UnsupportedError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    ClothoidSegment,
    ClothoidSpline,
    LanePosition,
    Nurbs,
    Orientation,
    Polyline,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    Route,
    RoutePosition,
    Shape,
    Trajectory,
    TrajectoryPosition,
    Vertex,
    WorldPosition,
)
from scenarios.openscenario.reading.catalogs import Catalogs
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.parameters import Declarations

MAX_CONTROL_POINTS = 1000
"""Greater splines are refused."""


@dataclass(frozen=True, slots=True)
class Context:
    """What references in a scenario file are checked against.

    Args:
        catalogs: entries by name.
        entities: names of the entities.
        variables: start values by name.
    """

    catalogs: Catalogs
    entities: Collection[str]
    variables: Mapping[str, Value]

    def entity(self, node: Node, attribute: str = "entityRef") -> str:
        """Name of an entity that exists.

        Raises:
            ContentError: it does not.
        """
        name = node.text(attribute)
        if name not in self.entities:
            raise ContentError(
                f"{node.where} {attribute}: no entity '{name}'; "
                f"entities: {', '.join(self.entities) or 'none'}"
            )
        return name

    def variable(self, node: Node) -> str:
        """Name of a variable that exists.

        Raises:
            ContentError: it does not.
        """
        name = node.text("variableRef")
        if name not in self.variables:
            raise ContentError(
                f"{node.where} variableRef: no variable '{name}'; "
                f"variables: {', '.join(self.variables) or 'none'}"
            )
        return name


def orientation(parent: Node) -> Orientation:
    """The Orientation child; missing means along the frame of the position."""
    node = parent.get("Orientation")
    if node is None:
        return Orientation()
    node.allow("h p r type")
    return Orientation(
        node.number("h", 0.0), node.choice("type", "relative absolute", "absolute") == "relative"
    )


def _world(node: Node, context: Context) -> Position:
    node.allow("x y z h p r")
    return WorldPosition(node.number("x"), node.number("y"), node.number("h", 0.0))


def _lane(node: Node, context: Context) -> Position:
    node.allow("roadId laneId s offset", "Orientation")
    return LanePosition(
        node.text("roadId"),
        node.integer("laneId"),
        node.number("s"),
        node.number("offset", 0.0),
        orientation(node),
    )


def _road(node: Node, context: Context) -> Position:
    node.allow("roadId s t", "Orientation")
    return RoadPosition(node.text("roadId"), node.number("s"), node.number("t"), orientation(node))


def _relative_lane(node: Node, context: Context) -> Position:
    node.allow("entityRef dLane ds dsLane offset", "Orientation")
    if node.has("ds") == node.has("dsLane"):
        raise ContentError(f"{node.where} needs either 'ds' or 'dsLane'")
    along = node.has("dsLane")
    return RelativeLanePosition(
        context.entity(node),
        node.integer("dLane"),
        node.number("dsLane" if along else "ds"),
        node.number("offset", 0.0),
        along,
        orientation(node),
    )


def _relative_road(node: Node, context: Context) -> Position:
    node.allow("entityRef ds dt", "Orientation")
    return RelativeRoadPosition(context.entity(node), node.number("ds"), node.number("dt"), orientation(node))


def _relative_object(node: Node, context: Context) -> Position:
    node.allow("entityRef dx dy dz", "Orientation")
    return RelativeObjectPosition(
        context.entity(node), node.number("dx"), node.number("dy"), orientation(node)
    )


def _relative_world(node: Node, context: Context) -> Position:
    node.allow("entityRef dx dy dz", "Orientation")
    return RelativeWorldPosition(
        context.entity(node), node.number("dx"), node.number("dy"), orientation(node)
    )


def _route(node: Node, context: Context) -> Position:
    node.allow(children="RouteRef InRoutePosition Orientation")
    found = route(node.need("RouteRef"), context)
    place = node.need("InRoutePosition").one_of("FromLaneCoordinates FromRoadCoordinates")
    if place.tag == "FromLaneCoordinates":
        place.allow("pathS laneId laneOffset")
        lane, offset = place.integer("laneId"), place.number("laneOffset", 0.0)
        return RoutePosition(found, place.positive("pathS"), lane, offset, orientation(node))
    place.allow("pathS t")
    return RoutePosition(found, place.positive("pathS"), None, place.number("t"), orientation(node))


def _on_trajectory(node: Node, context: Context) -> Position:
    node.allow("s t", "TrajectoryRef Orientation")
    return TrajectoryPosition(
        trajectory(node.need("TrajectoryRef"), context),
        node.positive("s"),
        node.number("t", 0.0),
        orientation(node),
    )


_POSITIONS: dict[str, Callable[[Node, Context], Position]] = {
    "WorldPosition": _world,
    "LanePosition": _lane,
    "RoadPosition": _road,
    "RelativeLanePosition": _relative_lane,
    "RelativeRoadPosition": _relative_road,
    "RelativeObjectPosition": _relative_object,
    "RelativeWorldPosition": _relative_world,
    "RoutePosition": _route,
    "TrajectoryPosition": _on_trajectory,
}


def position(node: Node, context: Context) -> Position:
    """Position from an element that holds one (Position, TargetPosition, PositionStart ...)."""
    child = node.one_of(" ".join(_POSITIONS))
    return _POSITIONS[child.tag](child, context)


def referenced(parent: Node, tag: str, context: Context) -> Node:
    """The element `tag` inside `parent`, or the catalog entry in its place; seeing its own parameters."""
    child = parent.one_of(f"{tag} CatalogReference")
    if child.tag == "CatalogReference":
        return context.catalogs.entry(child, tag)
    return child.within(Declarations(child.get("ParameterDeclarations"), {}, child.scope).scope())


def route(parent: Node, context: Context) -> Route:
    """Route from RouteRef or AssignRouteAction."""
    node = referenced(parent, "Route", context)
    node.allow("name closed", "ParameterDeclarations Waypoint")
    if node.boolean("closed"):
        raise UnsupportedError(f"{node.where} closed='true' is not supported; give an open route")
    waypoints: list[Position] = []
    for waypoint in node.all("Waypoint"):
        waypoint.allow("routeStrategy", "Position")
        waypoint.choice("routeStrategy", "shortest fastest leastIntersections random")
        waypoints.append(position(waypoint.need("Position"), context))
    if len(waypoints) < 2:
        raise ContentError(f"{node.where} needs at least two Waypoints, got {len(waypoints)}")
    return Route(node.text("name"), tuple(waypoints))


def trajectory(parent: Node, context: Context) -> Trajectory:
    """Trajectory from TrajectoryRef (or, as in 1.0, from the action itself)."""
    node = referenced(parent, "Trajectory", context)
    node.allow("name closed", "ParameterDeclarations Shape")
    if node.boolean("closed"):
        raise UnsupportedError(f"{node.where} closed='true' is not supported; give an open trajectory")
    shape = node.need("Shape").one_of("Polyline ClothoidSpline Clothoid Nurbs")
    return Trajectory(node.text("name"), _SHAPES[shape.tag](shape, context))


def _polyline(node: Node, context: Context) -> Shape:
    node.allow(children="Vertex")
    vertices: list[Vertex] = []
    for vertex in node:
        vertex.allow("time", "Position")
        time_s = vertex.number("time") if vertex.has("time") else None
        vertices.append(Vertex(position(vertex.need("Position"), context), time_s))
    if len(vertices) < 2:
        raise ContentError(f"{node.where} needs at least two vertices, got {len(vertices)}")
    return Polyline(tuple(vertices))


def _clothoid_spline(node: Node, context: Context) -> Shape:
    node.allow("timeEnd", "ClothoidSplineSegment")
    segments: list[ClothoidSegment] = []
    for segment in node:
        segment.allow("curvatureStart curvatureEnd length hOffset", "PositionStart")
        start = segment.get("PositionStart")
        if segment.has("hOffset") and start is not None:
            raise UnsupportedError(f"{segment.where} hOffset together with PositionStart is not supported")
        segments.append(
            ClothoidSegment(
                segment.positive("length", zero=False),
                segment.number("curvatureStart"),
                segment.number("curvatureEnd"),
                None if start is None else position(start, context),
                segment.number("hOffset", 0.0),
            )
        )
    if not segments:
        raise ContentError(f"{node.where} needs at least one ClothoidSplineSegment")
    return ClothoidSpline(tuple(segments), node.number("timeEnd") if node.has("timeEnd") else None)


def _clothoid(node: Node, context: Context) -> Shape:
    """A single clothoid is a spline of one piece; 1.0 calls the change of curvature `curvatureDot`."""
    node.allow("curvature curvatureDot curvaturePrime length startTime stopTime", "Position")
    if node.has("startTime") or node.has("stopTime"):
        raise UnsupportedError(f"{node.where} times of a Clothoid are not supported; use a ClothoidSpline")
    rate = node.number("curvaturePrime" if node.has("curvaturePrime") else "curvatureDot")
    length, curvature = node.positive("length", zero=False), node.number("curvature")
    start = position(node.need("Position"), context)
    return ClothoidSpline((ClothoidSegment(length, curvature, curvature + rate * length, start, 0.0),), None)


def _nurbs(node: Node, context: Context) -> Shape:
    node.allow("order", "ControlPoint Knot")
    order = node.integer("order")
    points: list[Position] = []
    weights: list[float] = []
    for point in node.all("ControlPoint"):
        point.allow("weight time", "Position")
        if point.has("time"):
            raise UnsupportedError(
                f"{point.where} attribute 'time' is not supported; use a Polyline with times"
            )
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
    return Nurbs(order, tuple(points), tuple(weights), tuple(knots))


_SHAPES: dict[str, Callable[[Node, Context], Shape]] = {
    "Polyline": _polyline,
    "ClothoidSpline": _clothoid_spline,
    "Clothoid": _clothoid,
    "Nurbs": _nurbs,
}
