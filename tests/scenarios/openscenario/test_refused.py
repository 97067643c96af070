"""What docs/openscenario.md says is refused, against the standard's schema and the reader."""

import re
from pathlib import Path

import pytest

from scenarios.openscenario import expand, load
from scenarios.openscenario.errors import UnsupportedError
from tests.scenarios.openscenario.conftest import (
    act,
    by_entity,
    by_value,
    condition,
    event,
    lane_position,
    maneuver,
    speed,
    teleport,
    trigger,
)

DOCUMENT = Path(__file__).parents[3] / "docs" / "openscenario.md"

SCHEMA = {
    # ASAM OpenSCENARIO XML 1.3, OpenSCENARIO.xsd: the children that an element may have
    "OpenSCENARIO": "FileHeader ParameterDeclarations VariableDeclarations MonitorDeclarations "
    "CatalogLocations RoadNetwork Entities Storyboard",
    "Entities": "ScenarioObject EntitySelection",
    "ScenarioObject": "CatalogReference Vehicle Pedestrian MiscObject ExternalObjectReference "
    "ObjectController",
    "Vehicle": "ParameterDeclarations BoundingBox Performance Axles Properties TrailerHitch TrailerCoupler "
    "Trailer",
    "Actions": "GlobalAction UserDefinedAction Private",
    "Action": "GlobalAction UserDefinedAction PrivateAction",
    "PrivateAction": "LongitudinalAction LateralAction VisibilityAction SynchronizeAction "
    "ActivateControllerAction ControllerAction TeleportAction RoutingAction AppearanceAction TrailerAction",
    "LongitudinalAction": "SpeedAction LongitudinalDistanceAction SpeedProfileAction",
    "RoutingAction": "AssignRouteAction FollowTrajectoryAction AcquirePositionAction RandomRouteAction",
    "AppearanceAction": "LightStateAction AnimationAction",
    "LightType": "VehicleLight UserDefinedLight",
    "GlobalAction": "EnvironmentAction EntityAction InfrastructureAction SetMonitorAction ParameterAction "
    "TrafficAction VariableAction",
    "EntityAction": "AddEntityAction DeleteEntityAction",
    "EntityCondition": "EndOfRoadCondition CollisionCondition OffroadCondition TimeHeadwayCondition "
    "TimeToCollisionCondition AccelerationCondition StandStillCondition SpeedCondition "
    "RelativeSpeedCondition TraveledDistanceCondition ReachPositionCondition DistanceCondition "
    "RelativeDistanceCondition RelativeClearanceCondition AngleCondition RelativeAngleCondition",
    "ByValueCondition": "ParameterCondition TimeOfDayCondition SimulationTimeCondition "
    "StoryboardElementStateCondition UserDefinedValueCondition TrafficSignalCondition "
    "TrafficSignalControllerCondition VariableCondition",
    "CollisionCondition": "EntityRef ByType",
    "TimeToCollisionConditionTarget": "Position EntityRef",
    "Position": "WorldPosition RelativeWorldPosition RelativeObjectPosition RoadPosition "
    "RelativeRoadPosition LanePosition RelativeLanePosition RoutePosition GeoPosition TrajectoryPosition",
    "InRoutePosition": "FromCurrentEntity FromRoadCoordinates FromLaneCoordinates",
    "SpeedActionTarget": "RelativeTargetSpeed AbsoluteTargetSpeed",
    "FinalSpeed": "AbsoluteSpeed RelativeSpeedToMaster",
    "Shape": "Polyline Clothoid ClothoidSpline Nurbs",
    "Storyboard": "Init Story StopTrigger",
}


def place(tag: str, s_m: float) -> str:
    """A position under another name."""
    inner = lane_position(s_m).removeprefix("<Position>").removesuffix("</Position>")
    return f"<{tag}>{inner}</{tag}>"


WAYPOINT = '<Waypoint routeStrategy="shortest">{}</Waypoint>'
ROUTE = "".join(WAYPOINT.format(lane_position(s)) for s in (60, 90))

ACTIONS = {
    "Action": "{}",
    "PrivateAction": "<PrivateAction>{}</PrivateAction>",
    "LongitudinalAction": "<PrivateAction><LongitudinalAction>{}</LongitudinalAction></PrivateAction>",
    "RoutingAction": "<PrivateAction><RoutingAction>{}</RoutingAction></PrivateAction>",
    "AppearanceAction": "<PrivateAction><AppearanceAction>{}</AppearanceAction></PrivateAction>",
    "LightType": "<PrivateAction><AppearanceAction><LightStateAction><LightType>{}</LightType>"
    '<LightState mode="on"/></LightStateAction></AppearanceAction></PrivateAction>',
    "GlobalAction": "<GlobalAction>{}</GlobalAction>",
    "EntityAction": '<GlobalAction><EntityAction entityRef="Other">{}</EntityAction></GlobalAction>',
    "Position": teleport("<Position>{}</Position>"),
    "InRoutePosition": teleport(
        f'<Position><RoutePosition><RouteRef><Route name="r" closed="false">{ROUTE}</Route></RouteRef>'
        "<InRoutePosition>{}</InRoutePosition></RoutePosition></Position>"
    ),
    "SpeedActionTarget": "<PrivateAction><LongitudinalAction><SpeedAction>"
    '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
    "<SpeedActionTarget>{}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>",
    "FinalSpeed": '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
    + place("TargetPositionMaster", 50)
    + place("TargetPosition", 90)
    + "<FinalSpeed>{}</FinalSpeed></SynchronizeAction></PrivateAction>",
    "Shape": "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
    '<Trajectory name="t" closed="false"><Shape>{}</Shape></Trajectory></TrajectoryRef><TimeReference><None/>'
    '</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
    "</RoutingAction></PrivateAction>",
}
CONDITIONS = {
    "EntityCondition": by_entity("{}"),
    "ByValueCondition": by_value("{}"),
    "CollisionCondition": by_entity("<CollisionCondition>{}</CollisionCondition>"),
    "TimeToCollisionConditionTarget": by_entity(
        '<TimeToCollisionCondition freespace="true" rule="lessThan" value="1">'
        "<TimeToCollisionConditionTarget>{}</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    ),
}


def documented() -> dict[str, set[str]]:
    """The table of the document: element, and which of its children are refused."""
    text = DOCUMENT.read_text(encoding="utf-8")
    section = text.split("## What is refused", 1)[1].split("\n## ", 1)[0]
    rows = re.findall(r"^\| `(\w+)`[^|]*\| (.*) \|$", section, re.MULTILINE)
    return {parent: set(re.findall(r"`(\w+)`", cell)) for parent, cell in rows}


def holding(write, parent: str, child: str) -> Path:
    """A scenario in which an element has a child."""
    if parent in ACTIONS:
        return write(act(maneuver(event("e", ACTIONS[parent].format(child)))))
    if parent in CONDITIONS:
        start = trigger(condition(CONDITIONS[parent].format(child)))
        return write(act(maneuver(event("e", speed(1), start))))
    path = write()
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(f"</{parent}>", f"{child}</{parent}>", 1), encoding="utf-8")
    return path


@pytest.mark.parametrize("parent", SCHEMA)
def test_the_document_lists_what_the_reader_lacks_of_the_standard(write, parent: str) -> None:
    path = holding(write, parent, "<Nonsense/>")
    with pytest.raises(UnsupportedError, match=rf"<Nonsense> in <{parent}> is not supported") as caught:
        load(path)
    read = set(str(caught.value).split("supported there: ")[1].split(", "))
    standard = set(SCHEMA[parent].split())
    assert standard - read == documented().get(parent, set())
    # deprecated forms of 1.0 to 1.2 apart, nothing else is taken
    assert read <= standard


@pytest.mark.parametrize(
    ("parent", "child"), [(p, c) for p, row in documented().items() for c in sorted(row)]
)
def test_what_the_document_lists_is_refused_by_name(write, tmp_path: Path, parent: str, child: str) -> None:
    if parent in SCHEMA:
        with pytest.raises(UnsupportedError, match=rf"<{child}> in <{parent}> is not supported") as caught:
            load(holding(write, parent, f"<{child}/>"))
        assert "\n" not in str(caught.value)
        return
    write()
    distribution = {
        "ParameterValueDistribution": f'<{child} numberOfTestRuns="1"/>',
        "DeterministicSingleParameterDistribution": "<Deterministic>"
        f'<DeterministicSingleParameterDistribution parameterName="p"><{child} type="x">y</{child}>'
        "</DeterministicSingleParameterDistribution></Deterministic>",
    }[parent]
    file = tmp_path / "varied.xosc"
    file.write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3"/><ParameterValueDistribution>'
        f'<ScenarioFile filepath="small.xosc"/>{distribution}</ParameterValueDistribution></OpenSCENARIO>',
        encoding="utf-8",
    )
    with pytest.raises(UnsupportedError, match=rf"varied.xosc:1: <{child}> is not supported"):
        expand(file)
