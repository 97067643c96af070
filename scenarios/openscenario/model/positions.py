"""Positions, routes and trajectories."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from scenarios.openscenario.elements import Attribute, Child, Element, EntityName, Reference

RouteStrategy: TypeAlias = Literal["shortest", "fastest", "leastIntersections", "random"]
System: TypeAlias = Literal["entity", "lane", "road", "trajectory"]
"""In whose coordinates a distance is measured."""


class Orientation(Element, attributes="h p r type"):
    """Heading; `relative` to the frame of the position, or absolute in the map frame."""

    heading_rad: Annotated[float, Attribute("h", 0.0)] = 0.0
    relative: Annotated[bool, Attribute("type", "absolute", {"relative": True, "absolute": False})] = True


Oriented: TypeAlias = Annotated[Orientation, Child("Orientation", Orientation())]
"""An orientation that may be missing: along the frame of the position."""


class WorldPosition(Element, attributes="x y z h p r"):
    """A point of the map frame; its height tells levels of the road apart, everybody stands on the ground."""

    x_m: Annotated[float, Attribute("x")]
    y_m: Annotated[float, Attribute("y")]
    heading_rad: Annotated[float, Attribute("h", 0.0)]
    z_m: Annotated[float | None, Attribute("z")] = None


class GeoPosition(
    Element,
    attributes="latitudeDeg longitudeDeg altitude latitude longitude height verticalRoadSelection",
):
    """A point by latitude and longitude, WGS 84, which the map's geoReference places."""

    latitude_deg: float
    longitude_deg: float
    orientation: Oriented
    z_m: float | None = None


class LanePosition(Element):
    """A place in a lane, offset from its middle to the left (positive t)."""

    road_id: Annotated[str, Attribute("roadId")]
    lane_id: Annotated[int, Attribute("laneId")]
    s_m: Annotated[float, Attribute("s")]
    offset_m: Annotated[float, Attribute("offset", 0.0)]
    orientation: Oriented


class RoadPosition(Element):
    """A place in road coordinates."""

    road_id: Annotated[str, Attribute("roadId")]
    s_m: Annotated[float, Attribute("s")]
    t_m: Annotated[float, Attribute("t")]
    orientation: Oriented


class RelativeLanePosition(Element, attributes="entityRef dLane ds dsLane offset"):
    """A place as many lanes and metres from an entity; `along_lane` measures along the lane, not the road."""

    entity: EntityName
    d_lane: Annotated[int, Attribute("dLane")]
    ds_m: Annotated[float, Attribute("dsLane", older="ds")]
    offset_m: Annotated[float, Attribute("offset", 0.0)]
    along_lane: bool
    orientation: Oriented


class RelativeRoadPosition(Element):
    """Road coordinates of an entity plus differences."""

    entity: EntityName
    ds_m: Annotated[float, Attribute("ds")]
    dt_m: Annotated[float, Attribute("dt")]
    orientation: Oriented


class RelativeObjectPosition(Element, attributes="entityRef dx dy dz"):
    """A point in an entity's own frame."""

    entity: EntityName
    dx_m: Annotated[float, Attribute("dx")]
    dy_m: Annotated[float, Attribute("dy")]
    orientation: Oriented
    dz_m: Annotated[float, Attribute("dz", 0.0)] = 0.0


class RelativeWorldPosition(Element, attributes="entityRef dx dy dz"):
    """An entity's point plus differences along the axes of the map frame."""

    entity: EntityName
    dx_m: Annotated[float, Attribute("dx")]
    dy_m: Annotated[float, Attribute("dy")]
    orientation: Oriented
    dz_m: Annotated[float, Attribute("dz", 0.0)] = 0.0


class RoutePosition(Element, children="RouteRef InRoutePosition Orientation"):
    """A place on a route; `lane_id` is None for road coordinates (then `offset_m` is t).

    Lane ids, offsets and heading are those of a road whose s runs along the route. With an entity it is where
    that is now, heading along the route.
    """

    route: Annotated[Route, Child("RouteRef")]
    path_s_m: float
    lane_id: int | None
    offset_m: float
    orientation: Oriented
    entity: Annotated[str | None, Reference()] = None


class TrajectoryPosition(Element):
    """A place beside a trajectory, in its own s and t."""

    trajectory: Annotated[Trajectory, Child("TrajectoryRef")]
    s_m: Annotated[float, Attribute("s", sign="not negative")]
    t_m: Annotated[float, Attribute("t", 0.0)]
    orientation: Oriented


Position: TypeAlias = (
    WorldPosition
    | GeoPosition
    | LanePosition
    | RoadPosition
    | RelativeLanePosition
    | RelativeRoadPosition
    | RelativeObjectPosition
    | RelativeWorldPosition
    | RoutePosition
    | TrajectoryPosition
)


class Waypoint(Element):
    """A place on the way of a route, and how the way that leads there is chosen."""

    position: Annotated[Position, Child("Position")]
    strategy: Annotated[RouteStrategy, Attribute("routeStrategy")]


class Route(Element, attributes="name closed", children="ParameterDeclarations Waypoint"):
    """Waypoints, joined along lanes; the way to each by its strategy (none given: the shortest)."""

    name: str
    waypoints: tuple[Position, ...]
    closed: bool = False
    strategies: tuple[RouteStrategy, ...] = ()


class Vertex(Element, first="time_s"):
    """Corner of a polyline, with its time if the trajectory has times."""

    position: Annotated[Position, Child("Position")]
    time_s: Annotated[float | None, Attribute("time")]


class Polyline(Element, children="Vertex"):
    """Straight pieces between vertices.

    `headed`: it is followed by time, and every vertex is a WorldPosition with a heading, which holds there;
    between vertices the heading changes linearly, and an entity stands between vertices at the same place.
    """

    vertices: tuple[Vertex, ...]
    headed: bool = False

    @property
    def has_times(self) -> bool:
        """Whether a vertex has a time."""
        return any(vertex.time_s is not None for vertex in self.vertices)


class ClothoidSegment(
    Element, tag="ClothoidSplineSegment", attributes="curvatureStart curvatureEnd length hOffset timeStart"
):
    """Piece of a clothoid spline; curvature changes linearly along it.

    `start` moves the piece there; without it the piece starts where the one before ends. `time_start_s` is
    when it begins, if the trajectory has times.
    """

    length_m: Annotated[float, Attribute("length", sign="positive")]
    curvature_start_per_m: Annotated[float, Attribute("curvatureStart")]
    curvature_end_per_m: Annotated[float, Attribute("curvatureEnd")]
    start: Annotated[Position | None, Child("PositionStart")]
    heading_offset_rad: Annotated[float, Attribute("hOffset", 0.0)]
    time_start_s: Annotated[float | None, Attribute("timeStart")] = None


class ClothoidSpline(Element, attributes="timeEnd", children="ClothoidSplineSegment"):
    """Clothoid pieces one after the other; without a start the first begins at the entity."""

    segments: tuple[ClothoidSegment, ...]
    time_end_s: float | None

    @property
    def has_times(self) -> bool:
        """Whether it, or a piece of it, has a time."""
        return self.time_end_s is not None or any(s.time_start_s is not None for s in self.segments)


class Nurbs(Element, attributes="order", children="ControlPoint Knot"):
    """Non-uniform rational B-spline; `order` is degree + 1.

    `times_s` are the time dimension of the control points; empty: it has none.
    """

    order: int
    control_points: tuple[Position, ...]
    weights: tuple[float, ...]
    knots: tuple[float, ...]
    times_s: tuple[float, ...] = ()

    @property
    def has_times(self) -> bool:
        """Whether the control points have times."""
        return bool(self.times_s)


Shape: TypeAlias = Polyline | ClothoidSpline | Nurbs


class Trajectory(Element, attributes="name closed", children="ParameterDeclarations Shape"):
    """A curve to follow."""

    name: str
    shape: Shape
    closed: bool = False
