"""Parts of roads that place them: links, types, and the shape of the reference line."""

from opendrive.errors import WarningKind
from opendrive.model import Arc, Line, ParamPoly3, Poly3, RoadLink, RoadType, Shape, Spiral
from opendrive.xml.values import Element, Values, first

MAX_TURN_RAD = 100.0
"""A piece of reference line that turns further than this is refused."""

LINE = Line()


def read_link(values: Values, element: Element | None) -> RoadLink | None:
    """Return the link of a road or connection to its predecessor or successor, or None."""
    if element is None:
        return None
    get = element.get
    element_type = get("elementType", "road")
    element_id = values.text(element, "elementId")
    contact_point = values.contact_point(element)
    s_m = values.number(element, "elementS", None)
    if element_type == "road" and contact_point is None and s_m is None:
        values.warn(
            WarningKind.LINK, element, f"no contactPoint for road {element_id!r}; the link is not followed"
        )
    return RoadLink(element_type, element_id, contact_point, s_m, get("elementDir", ""))


def read_road_type(values: Values, element: Element) -> RoadType:
    """Return a type of a road, with its speed limit."""
    speed = first(element, "speed")
    get = element.get
    return RoadType(
        s_m=values.number(element, "s", 0.0),
        type=get("type", "unknown"),
        country=get("country", ""),
        speed_mps=None if speed is None else values.speed_mps(speed),
    )


def read_shape(values: Values, geometry: Element, s_m: float, length_m: float) -> Shape:
    """Return the shape of a piece of reference line."""
    element = next((child for child in geometry if child.tag != "userData"), None)
    if element is None:
        raise values.error(geometry, "has no shape; expected line, arc, spiral, poly3 or paramPoly3")
    number = values.number
    shape: Shape
    turn_rad = 0.0
    match element.tag:
        case "line":
            return LINE
        case "arc":
            shape = Arc(number(element, "curvature"))
            turn_rad = abs(shape.curvature_per_m) * length_m
            if shape.curvature_per_m == 0.0:
                kind = WarningKind.ARC_WITHOUT_CURVATURE
                values.warn(kind, element, "arc of curvature 0; read as a line", s_m)
        case "spiral":
            start, end = number(element, "curvStart"), number(element, "curvEnd")
            shape = Spiral(start, end)
            turn_rad = max(abs(start), abs(end)) * length_m
            if start == end:
                read_as = "an arc" if start else "a line"
                kind = WarningKind.CONSTANT_SPIRAL
                values.warn(kind, element, f"spiral of constant curvature; read as {read_as}", s_m)
        case "poly3":
            shape = Poly3(
                (number(element, "a"), number(element, "b"), number(element, "c"), number(element, "d"))
            )
        case "paramPoly3":
            u0, u1, u2, u3 = (number(element, name) for name in ("aU", "bU", "cU", "dU"))
            v0, v1, v2, v3 = (number(element, name) for name in ("aV", "bV", "cV", "dV"))
            # Before 1.4 the attribute did not exist; the range was [0, 1].
            p_range = element.get("pRange", "normalized")
            if p_range not in ("normalized", "arcLength"):
                raise values.error(
                    element, f"attribute 'pRange' is {p_range!r:.40}, expected 'normalized' or 'arcLength'"
                )
            shape = ParamPoly3((u0, u1, u2, u3), (v0, v1, v2, v3), p_range == "normalized")
        case other:
            raise values.error(
                element, f"has the shape <{other:.40}>, expected line, arc, spiral, poly3 or paramPoly3"
            )
    if turn_rad > MAX_TURN_RAD:
        raise values.error(element, f"the piece turns by {turn_rad:.3g} rad; check its curvature and length")
    return shape
