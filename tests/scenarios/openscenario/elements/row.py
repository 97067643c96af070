"""One row of the table of elements, and the parts of small scenarios that its files are made of."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from scenarios.openscenario import Engine
from tests.scenarios.openscenario.conftest import (
    CAR,
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    at_time,
    by_entity,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)

NaN = math.nan
"""Stands for what a row says nothing about."""


@dataclass(frozen=True)
class Row:
    """A file and its expectation.

    Args:
        covers: elements whose expectation it is, as Parent/Child, separated by blanks.
        says: the closed form in words.
        parts: of the scenario; see `write_scenario`. `acts` are its acts, `network` stands in RoadNetwork,
            `entities` in Entities, `top` before these, `files` are written beside it.
        end_s: when the stop trigger ends the run.
        places: x, y, heading and speed by entity and time.
        then: what else holds at the end of the run.
    """

    covers: str
    says: str
    parts: dict[str, Any] = field(default_factory=dict)
    end_s: float | None = None
    places: dict[tuple[str, float], tuple[float, float, float, float]] = field(default_factory=dict)
    then: Callable[[Engine], bool] | None = None

    def __str__(self) -> str:
        return self.covers.replace("/", ".").replace(" ", "+")


def later(seconds: float) -> str:
    return trigger(condition(at_time(seconds)))


def ends(kind: str, **how: Any) -> dict[str, Any]:
    """The parts of a scenario that a condition ends."""
    return {"stop": trigger(condition(kind, **how), kind="StopTrigger")}


def does(*actions: str, actors: str = "Other", start_s: float = 2.0, **parts: Any) -> dict[str, Any]:
    """The parts of a scenario in which actors carry actions out from 2 s on."""
    events = [event(f"e{k}", action, later(start_s)) for k, action in enumerate(actions)]
    return {"acts": [act(maneuver(*events), actors=actors)], **parts}


def group(tag: str, inner: str) -> str:
    return f"<PrivateAction><{tag}>{inner}</{tag}></PrivateAction>"


longitudinal, lateral, routing, looks = (
    partial(group, tag)
    for tag in ("LongitudinalAction", "LateralAction", "RoutingAction", "AppearanceAction")
)


def everywhere(inner: str) -> str:
    return f"<GlobalAction>{inner}</GlobalAction>"


def put(inner: str, *more: str) -> dict[str, Any]:
    """The parts of a scenario in which the other one begins at a position."""
    return {"init": EGO_AT_START + private("Other", teleport(f"<Position>{inner}</Position>"), *more)}


def follow(shape: str) -> str:
    return routing(
        f'<FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape>{shape}</Shape>'
        "</Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>'
    )


def world(x: float, y: float) -> str:
    return f'<Position><WorldPosition x="{x}" y="{y}"/></Position>'


def line(*points: tuple[float, float]) -> str:
    return f"<Polyline>{''.join(f'<Vertex>{world(*point)}</Vertex>' for point in points)}</Polyline>"


CORNER = line((10, 20), (50, 20), (50, 120))
ROUTE = "".join(
    f'<Waypoint routeStrategy="shortest">{place}</Waypoint>'
    for place in (lane_position(100), lane_position(50, lane=1, road_id="B"))
)
EAST_AND_ON = f'<RouteRef><Route name="r" closed="false">{ROUTE}</Route></RouteRef>'
TURNS = private("Ego", speed(10), follow(CORNER)) + OTHER_AHEAD


def asked(target: str, shape: str = "step", dimension: str = "time", value: float = 0.0) -> str:
    dynamics = f'dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"'
    return longitudinal(
        f"<SpeedAction><SpeedActionDynamics {dynamics}/><SpeedActionTarget>{target}</SpeedActionTarget>"
        "</SpeedAction>"
    )


def swap(target: str) -> str:
    return lateral(
        '<LaneChangeAction><LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" '
        f'value="4"/><LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction>'
    )


def offset(target: str) -> str:
    return lateral(
        '<LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="cubic" '
        f'maxLateralAcc="1.5"/><LaneOffsetTarget>{target}</LaneOffsetTarget></LaneOffsetAction>'
    )


def along(position: str, tag: str) -> str:
    inner = position.removeprefix("<Position>").removesuffix("</Position>")
    return f"<{tag}>{inner}</{tag}>"


def meet(final: str) -> str:
    """The other one, at s = 60 in lane -2, is to be at 70 when the ego is at 90, which is at 8 s."""
    return (
        '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
        f"{along(lane_position(90), 'TargetPositionMaster')}"
        f"{along(lane_position(70, lane=-2), 'TargetPosition')}"
        f"<FinalSpeed>{final}</FinalSpeed></SynchronizeAction></PrivateAction>"
    )


BESIDE = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)))
BESIDE_FAST = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)), speed(20))
STEADY = '<TargetDistanceSteadyState distance="6"/>'
SIX_METRES = {
    ("Other", 1.0): (60, NaN, NaN, 0),
    ("Other", 5.0): (64, NaN, NaN, 2),
    ("Other", 8.0): (70, NaN, 0, 2),
}

SIGNALS = (
    '<TrafficSignals><TrafficSignalController name="c"><Phase name="go" duration="4">'
    '<TrafficSignalState trafficSignalId="1" state="green"/></Phase><Phase name="stop" duration="6">'
    '<TrafficSignalState trafficSignalId="1" state="red"/></Phase></TrafficSignalController></TrafficSignals>'
)
P_IS_1 = '<ParameterDeclaration name="p" parameterType="double" value="1"/>'


def of_parameter(inner: str) -> str:
    return everywhere(f'<ParameterAction parameterRef="p">{inner}</ParameterAction>')


def of_signals(inner: str) -> str:
    return everywhere(
        f"<InfrastructureAction><TrafficSignalAction>{inner}</TrafficSignalAction></InfrastructureAction>"
    )


def noon(goes_on: str = "true") -> str:
    return everywhere(
        f'<EnvironmentAction><Environment name="e"><TimeOfDay animation="{goes_on}" '
        'dateTime="2026-06-01T12:00:00"/></Environment></EnvironmentAction>'
    )


def controlled(inner: str) -> str:
    return f"<PrivateAction><ControllerAction>{inner}</ControllerAction></PrivateAction>"


UNUSED = '<Controller name="pilot"><Properties/></Controller>'
HITCHED = CAR.replace("</Vehicle>", '<TrailerHitch dx="-1"/>{}</Vehicle>')
BOX = CAR.replace('name="car" vehicleCategory="car"', 'name="box" vehicleCategory="trailer"').replace(
    "</Vehicle>", '<TrailerCoupler dx="3"/></Vehicle>'
)
TOWS = HITCHED.format(f'<Trailer><Trailer name="box">{BOX}</Trailer></Trailer>')
CATALOG = (
    '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="t" '
    'description="c"/><Catalog name="Things">{}</Catalog></OpenSCENARIO>'
)
LONG_CAR = CAR.replace('name="car"', 'name="long"').replace('length="4"', 'length="6"')
FASTER = event("e", speed(4, "linear", "rate", 2), later(2))
TRAVELLED_8_M = by_entity('<TraveledDistanceCondition value="8"/>', "both", rule="all")
GEO = (
    "<geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m]]>"
    "</geoReference>"
)
CLEAR = '<RelativeLaneRange from="0" to="0"/>'
AT_60 = lane_position(60)
