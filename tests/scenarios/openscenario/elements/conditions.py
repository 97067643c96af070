"""Rows of conditions: when they end a run."""

import math

from tests.scenarios.openscenario.conftest import (
    OTHER_AHEAD,
    at_time,
    by_entity,
    by_value,
    lane_position,
    private,
    set_variable,
    speed,
    teleport,
)
from tests.scenarios.openscenario.elements.row import (
    AT_60,
    CLEAR,
    P_IS_1,
    SIGNALS,
    TURNS,
    Row,
    does,
    ends,
    everywhere,
    noon,
    of_parameter,
    of_signals,
)

CONDITIONS_ON_ENTITIES = [
    Row(
        "EntityCondition/CollisionCondition CollisionCondition/EntityRef",
        "front 3.5 m ahead of 10 + 10 t meets the rear at 59.5 m: 4.6 s",
        ends(by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>')),
        4.6,
    ),
    Row(
        "CollisionCondition/ByType",
        "the same with any vehicle",
        ends(by_entity('<CollisionCondition><ByType type="vehicle"/></CollisionCondition>')),
        4.6,
    ),
    Row(
        "EntityCondition/EndOfRoadCondition",
        "690 m at 69 m/s, and 1.5 s there",
        {
            **ends(by_entity('<EndOfRoadCondition duration="1.5"/>')),
            "init": private("Ego", teleport(lane_position(10)), speed(69)) + OTHER_AHEAD,
        },
        11.5,
    ),
    Row(
        "EntityCondition/OffroadCondition",
        "from y = -1.75 straight to the left at 10 m/s: off the road at y = 7, and 0.5 s there",
        {
            **ends(by_entity('<OffroadCondition duration="0.5"/>')),
            "init": private(
                "Ego", teleport(lane_position(10, inner=f'<Orientation h="{math.pi / 2}"/>')), speed(10)
            )
            + OTHER_AHEAD,
        },
        0.875 + 0.5,
    ),
    Row(
        "EntityCondition/TimeHeadwayCondition",
        "50 - 10 t = 2 x 10",
        ends(
            by_entity(
                '<TimeHeadwayCondition entityRef="Other" value="2" freespace="false" rule="lessOrEqual"/>'
            )
        ),
        3.0,
    ),
    Row(
        "EntityCondition/TimeToCollisionCondition TimeToCollisionConditionTarget/EntityRef",
        "46 - 10 t between the outlines, closing at 10 m/s: 2 s at 2.6 s",
        ends(
            by_entity(
                '<TimeToCollisionCondition value="2" freespace="true" rule="lessOrEqual">'
                '<TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
                "</TimeToCollisionConditionTarget>"
                "</TimeToCollisionCondition>"
            )
        ),
        2.6,
    ),
    Row(
        "TimeToCollisionConditionTarget/Position",
        "50 - 10 t between the points: 2 s at 3 s",
        ends(
            by_entity(
                '<TimeToCollisionCondition value="2" freespace="false" rule="lessOrEqual">'
                f"<TimeToCollisionConditionTarget>{AT_60}</TimeToCollisionConditionTarget>"
                "</TimeToCollisionCondition>"
            )
        ),
        3.0,
    ),
    Row(
        "EntityCondition/AccelerationCondition",
        "2 m/s2 from 2 s on",
        {
            **does(speed(20, "linear", "rate", 2), actors="Ego"),
            **ends(by_entity('<AccelerationCondition value="1.9" rule="greaterThan"/>')),
        },
        2.0,
    ),
    Row(
        "EntityCondition/StandStillCondition",
        "from 10 m/s with 5 m/s2 from 2 s on: at rest at 4 s, for 1.5 s",
        {
            **does(speed(0, "linear", "rate", 5), actors="Ego"),
            **ends(by_entity('<StandStillCondition duration="1.5"/>')),
        },
        5.5,
    ),
    Row(
        "EntityCondition/SpeedCondition",
        "10 + 2 (t - 2) = 14",
        {
            **does(speed(20, "linear", "rate", 2), actors="Ego"),
            **ends(by_entity('<SpeedCondition value="14" rule="greaterOrEqual"/>')),
        },
        4.0,
    ),
    Row(
        "EntityCondition/RelativeSpeedCondition",
        "10 - 3 (t - 2) = 4",
        {
            **does(speed(9, "linear", "rate", 3)),
            **ends(by_entity('<RelativeSpeedCondition entityRef="Other" value="4" rule="lessOrEqual"/>')),
        },
        4.0,
    ),
    Row(
        "EntityCondition/TraveledDistanceCondition",
        "10 t = 35",
        ends(by_entity('<TraveledDistanceCondition value="35"/>')),
        3.5,
    ),
    Row(
        "EntityCondition/ReachPositionCondition",
        "2 m before x = 60",
        ends(by_entity(f'<ReachPositionCondition tolerance="2">{AT_60}</ReachPositionCondition>')),
        4.8,
    ),
    Row(
        "EntityCondition/DistanceCondition",
        "front at 13.5 + 10 t, 20 m before x = 60",
        ends(
            by_entity(
                f'<DistanceCondition value="20" freespace="true" rule="lessOrEqual">{AT_60}'
                "</DistanceCondition>"
            )
        ),
        2.65,
    ),
    Row(
        "EntityCondition/RelativeDistanceCondition",
        "50 - 10 t = 20",
        ends(
            by_entity(
                '<RelativeDistanceCondition entityRef="Other" relativeDistanceType="longitudinal" value="20" '
                'freespace="false" rule="lessOrEqual"/>'
            )
        ),
        3.0,
    ),
    Row(
        "EntityCondition/RelativeClearanceCondition",
        "its lane is free for 20 m ahead until 50 - 10 t = 20",
        ends(
            by_entity(
                '<RelativeClearanceCondition distanceForward="20" distanceBackward="0" freeSpace="false" '
                f'oppositeLanes="false">{CLEAR}</RelativeClearanceCondition>'
            ),
            edge="falling",
        ),
        3.0,
    ),
    Row(
        "EntityCondition/AngleCondition",
        "40 m to the corner, where it turns to the north",
        {
            **ends(
                by_entity(f'<AngleCondition angleType="heading" angle="{math.pi / 2}" angleTolerance="0.1"/>')
            ),
            "init": TURNS,
        },
        4.0,
    ),
    Row(
        "EntityCondition/RelativeAngleCondition",
        "the same, less the heading of the car that looks east",
        {
            **ends(
                by_entity(
                    f'<RelativeAngleCondition entityRef="Other" angleType="heading" angle="{math.pi / 2}" '
                    'angleTolerance="0.1"/>'
                )
            ),
            "init": TURNS,
        },
        4.0,
    ),
]

CONDITIONS_ON_VALUES = [
    Row(
        "ByValueCondition/ParameterCondition GlobalAction/ParameterAction ParameterAction/SetAction "
        "OpenSCENARIO/ParameterDeclarations",
        "it is 4 from 2 s on",
        {
            **does(of_parameter('<SetAction value="4"/>')),
            **ends(by_value('<ParameterCondition parameterRef="p" value="4" rule="equalTo"/>')),
            "parameters": P_IS_1,
        },
        2.0,
    ),
    Row(
        "ParameterAction/ModifyAction",
        "1 + 2 - 4 = -1 at 2 s",
        {
            **does(
                of_parameter('<ModifyAction><Rule><AddValue value="2"/></Rule></ModifyAction>'),
                of_parameter('<ModifyAction><Rule><AddValue value="-4"/></Rule></ModifyAction>'),
            ),
            **ends(by_value('<ParameterCondition parameterRef="p" value="-1" rule="lessOrEqual"/>')),
            "parameters": P_IS_1,
        },
        2.0,
    ),
    Row(
        "ByValueCondition/TimeOfDayCondition GlobalAction/EnvironmentAction",
        "noon at 2 s, three seconds later",
        {
            **does(noon()),
            **ends(by_value('<TimeOfDayCondition dateTime="2026-06-01T12:00:03" rule="greaterOrEqual"/>')),
        },
        5.0,
    ),
    Row(
        "ByValueCondition/SimulationTimeCondition Storyboard/StopTrigger",
        "3.25 s",
        ends(at_time(3.25)),
        3.25,
    ),
    Row(
        "ByValueCondition/StoryboardElementStateCondition Storyboard/Story",
        "a change that takes 2.5 s from 2 s on ends, and 1 s later",
        {
            **does(speed(4, "linear", "time", 2.5)),
            **ends(
                by_value(
                    '<StoryboardElementStateCondition storyboardElementType="event" '
                    'storyboardElementRef="e0" '
                    'state="completeState"/>'
                ),
                delay=1.0,
            ),
        },
        5.5,
    ),
    Row(
        "ByValueCondition/TrafficSignalCondition RoadNetwork/TrafficSignals",
        "4 s of green, then red",
        {**ends(by_value('<TrafficSignalCondition name="1" state="red"/>')), "network": SIGNALS},
        4.0,
    ),
    Row(
        "ByValueCondition/TrafficSignalControllerCondition",
        "the phase after 4 s",
        {
            **ends(
                by_value('<TrafficSignalControllerCondition trafficSignalControllerRef="c" phase="stop"/>')
            ),
            "network": SIGNALS,
        },
        4.0,
    ),
    Row(
        "GlobalAction/InfrastructureAction TrafficSignalAction/TrafficSignalControllerAction",
        "the phase that an action at 2 s begins, two seconds earlier than by itself",
        {
            **does(
                of_signals('<TrafficSignalControllerAction trafficSignalControllerRef="c" phase="stop"/>')
            ),
            **ends(by_value('<TrafficSignalCondition name="1" state="red"/>')),
            "network": SIGNALS,
        },
        2.0,
    ),
    Row(
        "TrafficSignalAction/TrafficSignalStateAction",
        "what it shows from 2 s on",
        {
            **does(of_signals('<TrafficSignalStateAction name="9" state="on"/>')),
            **ends(by_value('<TrafficSignalCondition name="9" state="on"/>')),
        },
        2.0,
    ),
    Row(
        "ByValueCondition/VariableCondition GlobalAction/VariableAction VariableAction/SetAction "
        "OpenSCENARIO/VariableDeclarations",
        "it is 5 from 2 s on",
        {
            **does(set_variable("n", 5)),
            **ends(by_value('<VariableCondition variableRef="n" value="4" rule="greaterThan"/>')),
        },
        2.0,
    ),
    Row(
        "VariableAction/ModifyAction",
        "(0 + 3) x 2 = 6 at 2 s",
        {
            **does(
                everywhere(
                    '<VariableAction variableRef="n"><ModifyAction><Rule><AddValue value="3"/></Rule>'
                    "</ModifyAction></VariableAction>"
                ),
                everywhere(
                    '<VariableAction variableRef="n"><ModifyAction><Rule><MultiplyByValue value="2"/></Rule>'
                    "</ModifyAction></VariableAction>"
                ),
            ),
            **ends(by_value('<VariableCondition variableRef="n" value="6" rule="equalTo"/>')),
        },
        2.0,
    ),
]
