"""Rows of actions: where entities are."""

import math

from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    by_entity,
    by_value,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
)
from tests.scenarios.openscenario.elements.row import (
    BESIDE,
    BESIDE_FAST,
    BOX,
    HITCHED,
    ROUTE,
    SIX_METRES,
    STEADY,
    TOWS,
    TURNS,
    UNUSED,
    NaN,
    Row,
    asked,
    controlled,
    does,
    ends,
    everywhere,
    group,
    later,
    lateral,
    longitudinal,
    looks,
    meet,
    offset,
    routing,
    swap,
)

ACTIONS = [
    Row(
        "Action/PrivateAction PrivateAction/LongitudinalAction LongitudinalAction/SpeedAction "
        "SpeedActionTarget/AbsoluteTargetSpeed",
        "6 m/s by 1.5 m/s2 from 2 s on: half of 1.5 x 2^2 after 2 s",
        does(speed(6, "linear", "rate", 1.5)),
        places={("Other", 4.0): (63, -1.75, 0, 3), ("Other", 8.0): (60 + 12 + 12, -1.75, 0, 6)},
    ),
    Row(
        "SpeedActionTarget/RelativeTargetSpeed",
        "half of the ego's 10 m/s at once",
        does(
            asked(
                '<RelativeTargetSpeed entityRef="Ego" value="0.5" speedTargetValueType="factor" '
                'continuous="false"/>'
            )
        ),
        places={("Other", 4.0): (70, -1.75, 0, 5)},
    ),
    Row(
        "LongitudinalAction/SpeedProfileAction",
        "4 m/s in 2 s, down to 2 m/s in 4 s: 4 m and 12 m",
        does(
            longitudinal(
                '<SpeedProfileAction followingMode="position"><SpeedProfileEntry speed="4" time="2"/>'
                '<SpeedProfileEntry speed="2" time="4"/></SpeedProfileAction>'
            )
        ),
        places={
            ("Other", 4.0): (64, NaN, 0, 4),
            ("Other", 6.0): (71, NaN, 0, 3),
            ("Other", 8.0): (76, NaN, 0, 2),
        },
    ),
    Row(
        "LongitudinalAction/LongitudinalDistanceAction",
        "12 m between outlines of 3.5 m ahead and 0.5 m behind their points: 16 m ahead of the ego",
        does(
            longitudinal(
                '<LongitudinalDistanceAction entityRef="Ego" distance="12" freespace="true" '
                'continuous="true" '
                'displacement="leadingReferencedEntity"/>'
            )
        ),
        places={("Other", 2.0): (46, -1.75, 0, 10), ("Other", 7.0): (96, -1.75, 0, 10)},
    ),
    Row(
        "PrivateAction/LateralAction LateralAction/LaneChangeAction LaneChangeTarget/AbsoluteTargetLane",
        "3.5 m along half a cosine wave in 4 s",
        does(swap('<AbsoluteTargetLane value="-1"/>'), init=BESIDE_FAST),
        places={
            ("Other", 3.0): (NaN, -5.25 + 3.5 * 0.5 * (1 - math.cos(math.pi / 4)), NaN, 20),
            ("Other", 4.0): (NaN, -3.5, NaN, 20),
            ("Other", 7.0): (NaN, -1.75, 0, 20),
        },
    ),
    Row(
        "LaneChangeTarget/RelativeTargetLane",
        "one lane to the left of the ego's, beyond the middle of the road: lane 1",
        does(swap('<RelativeTargetLane entityRef="Ego" value="1"/>'), init=BESIDE_FAST),
        places={("Other", 7.0): (NaN, 1.75, 0, 20)},
    ),
    Row(
        "LateralAction/LaneOffsetAction LaneOffsetTarget/AbsoluteTargetLaneOffset",
        "1 m within 1.5 m/s2: sqrt(6 / 1.5) = 2 s, half of it after 1 s",
        does(offset('<AbsoluteTargetLaneOffset value="1"/>'), init=BESIDE_FAST),
        places={("Other", 3.0): (NaN, -4.75, NaN, 20), ("Other", 5.0): (NaN, -4.25, 0, 20)},
    ),
    Row(
        "LaneOffsetTarget/RelativeTargetLaneOffset",
        "3 m to the right of the ego's -1.75 m",
        does(offset('<RelativeTargetLaneOffset entityRef="Ego" value="-3"/>'), init=BESIDE_FAST),
        places={("Other", 6.0): (NaN, -4.75, 0, 20)},
    ),
    Row(
        "LateralAction/LateralDistanceAction",
        "1 m between two cars of 2 m width: 3 m to the right of the ego, at once",
        does(
            lateral(
                '<LateralDistanceAction entityRef="Ego" distance="1" freespace="true" continuous="true" '
                'displacement="rightToReferencedEntity"/>'
            ),
            init=BESIDE_FAST,
        ),
        places={("Other", 2.0): (100, -4.75, 0, 20), ("Other", 5.0): (160, -4.75, 0, 20)},
    ),
    Row(
        "PrivateAction/SynchronizeAction FinalSpeed/AbsoluteSpeed",
        "10 m to go in 8 s, the last 6 m at 2 m/s: 4 m with 0.5 m/s2 from 1 s to 5 s",
        {**does(meet(f'<AbsoluteSpeed value="2">{STEADY}</AbsoluteSpeed>'), start_s=0.0), "init": BESIDE},
        places=SIX_METRES,
    ),
    Row(
        "FinalSpeed/RelativeSpeedToMaster",
        "the same, 2 m/s as a fifth of the ego's 10",
        {
            **does(
                meet(
                    f'<RelativeSpeedToMaster value="0.2" speedTargetValueType="factor">{STEADY}'
                    "</RelativeSpeedToMaster>"
                ),
                start_s=0.0,
            ),
            "init": BESIDE,
        },
        places=SIX_METRES,
    ),
    Row(
        "PrivateAction/SynchronizeAction SynchronizeAction/TargetPosition",
        "the first of these ends 2 m before its place, which it passes at 8 s with 2 m/s: at 7 s",
        {
            **does(
                meet(f'<AbsoluteSpeed value="2">{STEADY}</AbsoluteSpeed>').replace(
                    "<SynchronizeAction ", '<SynchronizeAction targetTolerance="2" '
                ),
                start_s=0.0,
            ),
            **ends(
                by_value(
                    '<StoryboardElementStateCondition storyboardElementType="event" '
                    'storyboardElementRef="e0" state="completeState"/>'
                )
            ),
            "init": BESIDE,
        },
        7.0,
    ),
    Row(
        "PrivateAction/TeleportAction",
        "at s = 100 of lane -2 at 2 s",
        does(teleport(lane_position(100, lane=-2))),
        places={("Other", 1.99): (60, -1.75, 0, 0), ("Other", 2.0): (100, -5.25, 0, 0)},
    ),
    Row(
        "PrivateAction/RoutingAction RoutingAction/FollowTrajectoryAction Shape/Polyline",
        "40 m east, then north, at 10 m/s",
        {"init": TURNS},
        places={("Ego", 3.0): (40, 20, 0, 10), ("Ego", 6.0): (50, 40, math.pi / 2, 10)},
    ),
    Row(
        "RoutingAction/AssignRouteAction",
        "from lane -1 of road A into lane 1 of road B, which runs against s: straight on, 500 m",
        {
            "init": private(
                "Ego",
                teleport(lane_position(10)),
                speed(50),
                routing(
                    f'<AssignRouteAction><Route name="r" closed="false">{ROUTE}</Route></AssignRouteAction>'
                ),
            )
            + OTHER_AHEAD
        },
        places={("Ego", 10.0): (510, -1.75, 0, 50)},
    ),
    Row(
        "RoutingAction/AcquirePositionAction",
        "a place 190 m ahead in the lane to the right: 3.5 m by a cubic within 1 m/s2, sqrt(21) s",
        {
            "init": private(
                "Ego",
                teleport(lane_position(10)),
                speed(10),
                routing(f"<AcquirePositionAction>{lane_position(200, lane=-2)}</AcquirePositionAction>"),
            )
            + OTHER_AHEAD,
        },
        places={("Ego", 6.0): (NaN, -5.25, 0, 10)},
    ),
    Row(
        "PrivateAction/VisibilityAction",
        "it moves as it did, and sensors no longer see it",
        does(
            '<PrivateAction><VisibilityAction graphics="true" traffic="true" '
            'sensors="false"/></PrivateAction>'
        ),
        places={("Other", 3.0): (60, -1.75, 0, 0)},
        then=lambda engine: engine.entities.seen.tolist() == [True, False],
    ),
    Row(
        "PrivateAction/AppearanceAction AppearanceAction/LightStateAction LightType/VehicleLight",
        "it moves as it did, and the light is as asked",
        does(
            looks(
                '<LightStateAction><LightType><VehicleLight vehicleLightType="brakeLights"/></LightType>'
                '<LightState mode="on"/></LightStateAction>'
            )
        ),
        places={("Other", 3.0): (60, -1.75, 0, 0)},
        then=lambda engine: engine.world.actors["Other"].lights == {"brakeLights": "on"},
    ),
    Row(
        "LightType/UserDefinedLight",
        "it moves as it did, and the light is as asked",
        does(
            looks(
                '<LightStateAction><LightType><UserDefinedLight userDefinedLightType="beacon"/></LightType>'
                '<LightState mode="flashing"/></LightStateAction>'
            )
        ),
        places={("Other", 3.0): (60, -1.75, 0, 0)},
        then=lambda engine: engine.world.actors["Other"].lights == {"beacon": "flashing"},
    ),
    Row(
        "AppearanceAction/AnimationAction",
        "it lasts 1.5 s from 2 s on",
        {
            **does(
                looks(
                    '<AnimationAction loop="false" animationDuration="1.5"><AnimationType>'
                    '<UserDefinedAnimation userDefinedAnimationType="wave"/></AnimationType>'
                    "</AnimationAction>"
                )
            ),
            **ends(
                by_value(
                    '<StoryboardElementStateCondition storyboardElementType="event" '
                    'storyboardElementRef="e0" '
                    'state="completeState"/>'
                )
            ),
        },
        3.5,
    ),
    Row(
        "PrivateAction/ControllerAction ControllerAction/AssignControllerAction",
        "one that is not activated drives nothing",
        does(
            speed(5),
            controlled(
                '<AssignControllerAction activateLateral="false" activateLongitudinal="false">'
                f"{UNUSED}</AssignControllerAction>"
            ),
        ),
        places={("Other", 4.0): (70, -1.75, 0, 5)},
    ),
    Row(
        "ControllerAction/ActivateControllerAction ControllerAction/OverrideControllerValueAction",
        "the ego is driven by the scenario, whatever its file's controllers are to do",
        does(
            controlled(
                f'<AssignControllerAction activateLateral="false">{UNUSED}</AssignControllerAction>'
                '<OverrideControllerValueAction><Brake active="true" value="1"/>'
                "</OverrideControllerValueAction>"
                '<ActivateControllerAction lateral="true" longitudinal="true"/>'
            ),
            actors="Ego",
        ),
        places={("Ego", 4.0): (50, -1.75, 0, 10)},
    ),
    Row(
        "PrivateAction/ActivateControllerAction",
        "that of the ego",
        does(
            '<PrivateAction><ActivateControllerAction lateral="true" longitudinal="true"/></PrivateAction>',
            actors="Ego",
        ),
        places={("Ego", 4.0): (50, -1.75, 0, 10)},
    ),
    Row(
        "Action/GlobalAction GlobalAction/EntityAction EntityAction/DeleteEntityAction",
        "who is deleted is not met: the ego drives on, and nothing stops it",
        {
            **does(everywhere('<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>')),
            **ends(by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>')),
        },
        None,
        {("Ego", 9.0): (100, -1.75, 0, 10)},
        then=lambda engine: engine.entities.exists.tolist() == [True, False] and not engine.over,
    ),
    Row(
        "EntityAction/AddEntityAction",
        "it comes at 2 s, 30 m ahead of the ego's front at 33.5 m",
        {
            **does(
                everywhere(
                    f'<EntityAction entityRef="Other"><AddEntityAction>{lane_position(64)}</AddEntityAction>'
                    "</EntityAction>"
                )
            ),
            **ends(by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>')),
            "init": EGO_AT_START,
        },
        5.0,
    ),
    Row(
        "GlobalAction/SetMonitorAction OpenSCENARIO/MonitorDeclarations",
        "nothing moves by it",
        {
            **does(everywhere('<SetMonitorAction monitorRef="m" value="true"/>'), speed(3)),
            "top": '<MonitorDeclarations><MonitorDeclaration name="m" value="false"/></MonitorDeclarations>',
        },
        places={("Other", 4.0): (66, -1.75, 0, 3)},
    ),
    Row(
        "PrivateAction/TrailerAction TrailerAction/DisconnectTrailerAction Vehicle/Trailer "
        "Vehicle/TrailerHitch "
        "Vehicle/TrailerCoupler",
        "4 m behind (hitch 1 m behind, coupler 3 m ahead of the points); let go at 2 s with 5 m/s",
        {
            "other": TOWS,
            "init": EGO_AT_START + private("Other", teleport(lane_position(60)), speed(5)),
            "acts": [
                act(
                    maneuver(
                        event("e", group("TrailerAction", "<DisconnectTrailerAction/>"), later(2)),
                        event("f", speed(0), later(3)),
                    )
                )
            ],
        },
        places={
            ("box", 1.0): (61, -1.75, 0, 5),
            ("box", 5.0): (81, -1.75, 0, 5),
            ("Other", 5.0): (75, -1.75, 0, 0),
        },
    ),
    Row(
        "TrailerAction/ConnectTrailerAction",
        "connected at 2 s, 4 m behind at 5 m/s from then on",
        {
            "other": HITCHED.format(""),
            "entities": f'<ScenarioObject name="box">{BOX}</ScenarioObject>',
            "init": EGO_AT_START
            + private("Other", teleport(lane_position(60)), speed(5))
            + private("box", teleport(lane_position(66))),
            **does(group("TrailerAction", '<ConnectTrailerAction trailerRef="box"/>')),
        },
        places={("box", 1.0): (66, -1.75, 0, 0), ("box", 4.0): (76, -1.75, 0, 5)},
    ),
]
