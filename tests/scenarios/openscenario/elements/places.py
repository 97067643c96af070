"""Rows of positions, shapes of trajectories, entities and the storyboard."""

import math

from tests.scenarios.openscenario.conftest import (
    CAR,
    EGO_AT_START,
    OTHER_AHEAD,
    WALKER,
    act,
    at_time,
    by_entity,
    by_value,
    condition,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)
from tests.scenarios.openscenario.elements.row import (
    CATALOG,
    CORNER,
    EAST_AND_ON,
    FASTER,
    GEO,
    LONG_CAR,
    TRAVELLED_8_M,
    UNUSED,
    NaN,
    Row,
    ends,
    follow,
    noon,
    put,
    world,
)

ORIENTED = '<Orientation type="relative" h="0.5"/>'

WEST = (
    '<RouteRef><Route name="r" closed="false">'
    + "".join(f'<Waypoint routeStrategy="shortest">{lane_position(s, 1)}</Waypoint>' for s in (290, 5))
    + "</Route></RouteRef>"
)

POSITIONS = [
    Row(
        "Position/WorldPosition",
        "as it stands there",
        put('<WorldPosition x="120" y="34" h="1"/>'),
        places={("Other", 1.0): (120, 34, 1, 0)},
    ),
    Row(
        "Position/RelativeWorldPosition",
        "(10, -1.75) + (5, 20)",
        put('<RelativeWorldPosition entityRef="Ego" dx="5" dy="20"/>'),
        places={("Other", 1.0): (15, 18.25, 0, 0)},
    ),
    Row(
        "Position/RelativeObjectPosition",
        "20 m ahead of the ego and 3 m to its left, turned by half a radian",
        put(f'<RelativeObjectPosition entityRef="Ego" dx="20" dy="3">{ORIENTED}</RelativeObjectPosition>'),
        places={("Other", 1.0): (30, 1.25, 0.5, 0)},
    ),
    Row(
        "Position/RoadPosition",
        "100 m along B, which runs west from x = 700",
        put('<RoadPosition roadId="B" s="100" t="2"/>'),
        places={("Other", 1.0): (600, -2, math.pi, 0)},
    ),
    Row(
        "Position/RelativeRoadPosition",
        "s = 10 + 40, t = -1.75 + 3",
        put('<RelativeRoadPosition entityRef="Ego" ds="40" dt="3"/>'),
        places={("Other", 1.0): (50, 1.25, 0, 0)},
    ),
    Row(
        "Position/LanePosition",
        "middle of lane 1, 1 m along t; the traffic there runs west",
        put('<LanePosition roadId="A" laneId="1" s="50" offset="1"/>'),
        places={("Other", 1.0): (50, 2.75, math.pi, 0)},
    ),
    Row(
        "Position/RelativeLanePosition",
        "one lane to the right, 20 m ahead",
        put('<RelativeLanePosition entityRef="Ego" dLane="-1" ds="20"/>'),
        places={("Other", 1.0): (30, -5.25, 0, 0)},
    ),
    Row(
        "Position/RoutePosition InRoutePosition/FromLaneCoordinates",
        "230 m along a route that begins at x = 100, on the right of its direction",
        put(
            f"<RoutePosition>{EAST_AND_ON}<InRoutePosition>"
            '<FromLaneCoordinates pathS="230" laneId="-1"/></InRoutePosition></RoutePosition>'
        ),
        places={("Other", 1.0): (330, -1.75, 0, 0)},
    ),
    Row(
        "InRoutePosition/FromRoadCoordinates",
        "the same, 1 m to the left of the road's line",
        put(
            f"<RoutePosition>{EAST_AND_ON}<InRoutePosition>"
            '<FromRoadCoordinates pathS="230" t="1"/></InRoutePosition></RoutePosition>'
        ),
        places={("Other", 1.0): (330, 1, 0, 0)},
    ),
    Row(
        "InRoutePosition/FromCurrentEntity",
        "where the ego is, along a route the other way: with its orientation of 0.1 on top",
        put(
            f"<RoutePosition>{WEST}<InRoutePosition>"
            '<FromCurrentEntity entityRef="Ego"/></InRoutePosition>'
            '<Orientation type="relative" h="0.1"/></RoutePosition>'
        ),
        places={("Other", 1.0): (10, -1.75, math.pi + 0.1, 0)},
    ),
    Row(
        "Position/TrajectoryPosition",
        "10 m behind the corner on the way north, 3 m to its left",
        put(
            '<TrajectoryPosition s="50" t="3"><TrajectoryRef><Trajectory name="t" closed="false"><Shape>'
            f"{CORNER}</Shape></Trajectory></TrajectoryRef></TrajectoryPosition>"
        ),
        places={("Other", 1.0): (47, 30, math.pi / 2, 0)},
    ),
    Row(
        "Position/GeoPosition",
        "on the equator 1e-5 degrees east of the map's meridian: 6378137 m x 1e-5 pi / 180",
        {
            **put('<GeoPosition latitudeDeg="0" longitudeDeg="9.00001"/>'),
            "geo": GEO,
        },
        places={("Other", 1.0): (6378137 * math.radians(1e-5), 0, NaN, 0)},
    ),
]

R_M = 50.0
SHAPES = [
    Row(
        "Shape/Clothoid",
        "a circle of 50 m radius to the left: a radian after 50 m",
        {
            "init": EGO_AT_START
            + private(
                "Other",
                speed(10),
                follow(
                    f'<Clothoid curvature="{1 / R_M}" curvatureDot="0" length="150">{world(10, 20)}'
                    "</Clothoid>"
                ),
            )
        },
        places={("Other", 5.0): (10 + R_M * math.sin(1), 20 + R_M * (1 - math.cos(1)), 1, 10)},
    ),
    Row(
        "Shape/ClothoidSpline",
        "40 m straight, then the circle",
        {
            "init": EGO_AT_START
            + private(
                "Other",
                speed(10),
                follow(
                    '<ClothoidSpline><ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="40" '
                    'hOffset="0"><PositionStart><WorldPosition x="10" y="20"/></PositionStart>'
                    f'</ClothoidSplineSegment><ClothoidSplineSegment curvatureStart="{1 / R_M}" '
                    f'curvatureEnd="{1 / R_M}" length="100"/></ClothoidSpline>'
                ),
            )
        },
        places={
            ("Other", 3.0): (40, 20, 0, 10),
            ("Other", 9.0): (50 + R_M * math.sin(1), 20 + R_M * (1 - math.cos(1)), 1, 10),
        },
    ),
    Row(
        "Shape/Nurbs",
        "a quarter of a circle of 50 m radius is a rational curve of degree 2: weights 1, sqrt(1/2), 1",
        {
            "init": EGO_AT_START
            + private(
                "Other",
                speed(10),
                follow(
                    '<Nurbs order="3">'
                    + "".join(
                        f'<ControlPoint weight="{weight}">{world(x, y)}</ControlPoint>'
                        for x, y, weight in ((10, 20, 1), (60, 20, math.sqrt(0.5)), (60, 70, 1))
                    )
                    + "".join(f'<Knot value="{k}"/>' for k in (0, 0, 0, 1, 1, 1))
                    + "</Nurbs>"
                ),
            )
        },
        places={("Other", 5.0): (10 + R_M * math.sin(1), 20 + R_M * (1 - math.cos(1)), 1, 10)},
    ),
]

ENTITIES = [
    Row(
        "Entities/ScenarioObject ScenarioObject/Vehicle Vehicle/BoundingBox "
        "Vehicle/Performance Vehicle/Axles "
        "OpenSCENARIO/FileHeader OpenSCENARIO/RoadNetwork OpenSCENARIO/Entities OpenSCENARIO/Storyboard "
        "Storyboard/Init Actions/Private",
        "front 3.5 m ahead of the rear axle, rear 0.5 m behind it",
        {"init": EGO_AT_START + OTHER_AHEAD},
        places={("Ego", 4.6): (56, -1.75, 0, 10)},
    ),
    Row(
        "ScenarioObject/Pedestrian",
        "0.6 m long around its point: met 0.2 m later than the car, whose rear is 0.5 m behind its point",
        {
            "other": WALKER,
            **ends(by_entity('<CollisionCondition><ByType type="pedestrian"/></CollisionCondition>')),
        },
        4.62,
    ),
    Row(
        "ScenarioObject/MiscObject",
        "a box of 2 m around its point",
        {
            "other": '<MiscObject name="box" miscObjectCategory="obstacle" mass="9"><BoundingBox>'
            '<Center x="0" y="0" z="0.5"/><Dimensions length="2" width="2" height="1"/>'
            "</BoundingBox></MiscObject>",
            **ends(by_entity('<CollisionCondition><ByType type="miscellaneous"/></CollisionCondition>')),
        },
        4.55,
    ),
    Row(
        "ScenarioObject/CatalogReference OpenSCENARIO/CatalogLocations",
        "6 m long around 1.5 m ahead of its point: its rear 1.5 m behind, met at 4.5 s",
        {
            "other": '<CatalogReference catalogName="Things" entryName="long"/>',
            "catalogs": '<VehicleCatalog><Directory path="shelf"/></VehicleCatalog>',
            "files": {"shelf/things.xosc": CATALOG.format(LONG_CAR)},
            **ends(by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>')),
        },
        4.5,
    ),
    Row(
        "ScenarioObject/ObjectController Vehicle/Properties Vehicle/ParameterDeclarations",
        "a controller that is never activated changes nothing; the outline has the vehicle's own parameter",
        {
            "other": CAR.replace(
                "<BoundingBox>",
                '<ParameterDeclarations><ParameterDeclaration name="long" parameterType="double" value="6"/>'
                "</ParameterDeclarations><BoundingBox>",
            )
            .replace('length="4"', 'length="$long"')
            .replace("</Vehicle>", '<Properties><Property name="colour" value="red"/></Properties></Vehicle>')
            + f"<ObjectController>{UNUSED}</ObjectController>",
            **ends(by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>')),
        },
        4.5,
    ),
    Row(
        "Entities/EntitySelection",
        "both at 4 m/s from the start: all have gone 8 m at 2 s",
        {
            "entities": '<EntitySelection name="both"><Members><EntityRef entityRef="Ego"/>'
            '<EntityRef entityRef="Other"/></Members></EntitySelection>',
            "init": private("Ego", teleport(lane_position(10)))
            + private("Other", teleport(lane_position(60)))
            + private("both", speed(4)),
            **ends(TRAVELLED_8_M),
        },
        2.0,
    ),
    Row(
        "Actions/GlobalAction",
        "noon at the start; half past at 3 s would be later than the end at 10 s",
        {
            "init": noon() + EGO_AT_START + OTHER_AHEAD,
            **ends(by_value('<TimeOfDayCondition dateTime="2026-06-01T12:00:03" rule="greaterOrEqual"/>')),
        },
        3.0,
    ),
    Row(
        "ManeuverGroup/Actors ManeuverGroup/Maneuver Maneuver/Event Event/StartTrigger Event/Action "
        "Act/ManeuverGroup Story/Act Actors/EntityRef",
        "from 2 s on to 4 m/s by 2 m/s2",
        {"acts": [act(maneuver(FASTER))]},
        places={("Other", 3.0): (61, -1.75, 0, 2), ("Other", 6.0): (72, -1.75, 0, 4)},
    ),
    Row(
        "ManeuverGroup/CatalogReference",
        "the same from a catalog",
        {
            "acts": [act('<CatalogReference catalogName="Things" entryName="m"/>')],
            "catalogs": '<ManeuverCatalog><Directory path="shelf"/></ManeuverCatalog>',
            "files": {"shelf/things.xosc": CATALOG.format(maneuver(FASTER))},
        },
        places={("Other", 3.0): (61, -1.75, 0, 2)},
    ),
    Row(
        "Act/StartTrigger Act/StopTrigger",
        "an act from 3 s to 4 s: its event, due at 2 s, begins at 3 s and is stopped at 4 s with 2 m/s",
        {
            "acts": [
                act(
                    maneuver(FASTER),
                    start=trigger(condition(at_time(3))),
                    stop=trigger(condition(at_time(4)), kind="StopTrigger"),
                )
            ]
        },
        places={("Other", 4.0): (61, -1.75, 0, 2), ("Other", 6.0): (65, -1.75, 0, 2)},
    ),
]
