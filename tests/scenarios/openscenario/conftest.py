"""Small scenario files on a small map, written for each test."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from scenarios.openscenario import Engine, Run, load

SHARED = Path(__file__).parents[3].parent / "shared" / "ncap"


@pytest.fixture(scope="session")
def ncap() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"no reference scenarios at {SHARED}")
    return SHARED


def road(road_id: str, x: float, y: float, heading: float, length: float, link: str, lane_links: str) -> str:
    """Road with two lanes of 3.5 m on each side; the links of lanes change sides."""

    def lane(i: int) -> str:
        inner = f'<{lane_links} id="{-i}"/>' if lane_links else ""
        return (
            f'<lane id="{i}" type="driving"><link>{inner}</link>'
            '<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        )

    return (
        f'<road id="{road_id}" junction="-1" length="{length}"><link>{link}</link><planView>'
        f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry></planView>'
        f'<lanes><laneSection s="0"><left>{lane(2)}{lane(1)}</left><center><lane id="0" type="none"/>'
        f"</center>"
        f"<right>{lane(-1)}{lane(-2)}</right></laneSection></lanes></road>"
    )


MAP = (
    '<OpenDRIVE><header revMajor="1" revMinor="6" name="two roads"/>'
    # road A runs east from the origin; road B runs west and ends where A ends, so that both meet end to end
    + road("A", 0, 0, 0, 300, '<successor elementType="road" elementId="B" contactPoint="end"/>', "successor")
    + road(
        "B",
        700,
        0,
        3.141592653589793,
        400,
        '<successor elementType="road" elementId="A" contactPoint="end"/>',
        "successor",
    )
    + "</OpenDRIVE>"
)

CAR = (
    '<Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.5" y="0" z="0.8"/>'
    '<Dimensions length="4" width="2" height="1.6"/></BoundingBox>'
    '<Performance maxSpeed="70" maxAcceleration="5" maxDeceleration="10"/>'
    '<Axles><RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.5" positionX="0" '
    'positionZ="0.3"/></Axles></Vehicle>'
)  # front 3.5 m ahead of the rear axle, rear 0.5 m behind it
WALKER = (
    '<Pedestrian name="walker" pedestrianCategory="pedestrian" mass="80"><BoundingBox>'
    '<Center x="0" y="0" z="0.9"/>'
    '<Dimensions length="0.6" width="0.5" height="1.8"/></BoundingBox></Pedestrian>'
)


def lane_position(s: float, lane: int = -1, offset: float = 0.0, inner: str = "", road_id: str = "A") -> str:
    return (
        f'<Position><LanePosition roadId="{road_id}" laneId="{lane}" s="{s}" offset="{offset}">{inner}'
        "</LanePosition></Position>"
    )


def teleport(position: str) -> str:
    return f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"


def speed(value: float | str, shape: str = "step", dimension: str = "time", amount: float = 0) -> str:
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        f'<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{amount}"/>'
        f'<SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction></PrivateAction>"
    )


def private(entity: str, *actions: str) -> str:
    return f'<Private entityRef="{entity}">{"".join(actions)}</Private>'


def condition(inner: str, delay: float = 0, edge: str = "none") -> str:
    return f'<Condition name="c" delay="{delay}" conditionEdge="{edge}">{inner}</Condition>'


def criterion(name: str, value: str = "") -> str:
    """A condition by which CARLA's ScenarioRunner judges a run."""
    return (
        f'<Condition name="criteria_{name}" delay="0" conditionEdge="rising"><ByValueCondition>'
        f'<ParameterCondition parameterRef="" value="{value}" rule="lessThan"/>'
        "</ByValueCondition></Condition>"
    )


def by_value(inner: str) -> str:
    return f"<ByValueCondition>{inner}</ByValueCondition>"


def by_entity(inner: str, *entities: str, rule: str = "any") -> str:
    names = "".join(f'<EntityRef entityRef="{name}"/>' for name in entities or ("Ego",))
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{names}</TriggeringEntities>'
        f"<EntityCondition>{inner}</EntityCondition></ByEntityCondition>"
    )


def at_time(seconds: float) -> str:
    return by_value(f'<SimulationTimeCondition value="{seconds}" rule="greaterOrEqual"/>')


def trigger(*conditions: str, kind: str = "StartTrigger") -> str:
    return f"<{kind}><ConditionGroup>{''.join(conditions)}</ConditionGroup></{kind}>"


def event(
    name: str, action: str, start: str = "", priority: str = "parallel", count: int | None = None
) -> str:
    many = "" if count is None else f' maximumExecutionCount="{count}"'
    return (
        f'<Event name="{name}" priority="{priority}"{many}><Action name="a">{action}</Action>{start}</Event>'
    )


def set_variable(name: str, value: object) -> str:
    return (
        f'<GlobalAction><VariableAction variableRef="{name}"><SetAction value="{value}"/>'
        f"</VariableAction></GlobalAction>"
    )


def add_to_variable(name: str, value: object) -> str:
    return (
        f'<GlobalAction><VariableAction variableRef="{name}"><ModifyAction><Rule>'
        f'<AddValue value="{value}"/></Rule>'
        "</ModifyAction></VariableAction></GlobalAction>"
    )


def maneuver(*events: str, name: str = "m") -> str:
    return f'<Maneuver name="{name}">{"".join(events)}</Maneuver>'


def act(
    *maneuvers: str, actors: str = "Other", start: str = "", stop: str = "", name: str = "act", count: int = 1
) -> str:
    references = "".join(f'<EntityRef entityRef="{actor}"/>' for actor in actors.split())
    return (
        f'<Act name="{name}"><ManeuverGroup name="group" maximumExecutionCount="{count}">'
        f'<Actors selectTriggeringEntities="false">{references}</Actors>{"".join(maneuvers)}</ManeuverGroup>'
        f"{start}{stop}</Act>"
    )


EGO_AT_START = private("Ego", teleport(lane_position(10)), speed(10))
OTHER_AHEAD = private("Other", teleport(lane_position(60)))
STOP_AT_10_S = trigger(condition(at_time(10)), kind="StopTrigger")


def write_scenario(
    directory: Path,
    *acts: str,
    init: str = EGO_AT_START + OTHER_AHEAD,
    parameters: str = "",
    variables: str = '<VariableDeclaration name="n" variableType="double" value="0"/>',
    other: str = CAR,
    stop: str = STOP_AT_10_S,
    catalogs: str = "",
    minor: int = 3,
) -> Path:
    """Write a scenario with a car `Ego` at s = 10 m, 10 m/s, and a car `Other` that stands at s = 60 m."""
    (directory / "two_roads.xodr").write_text(MAP, encoding="utf-8")
    stories = f'<Story name="story">{"".join(acts)}</Story>' if acts else ""
    text = (
        f'<OpenSCENARIO>\n<FileHeader revMajor="1" revMinor="{minor}" date="2026-01-01T00:00:00" '
        'author="test" description="small"/>\n'
        f"<ParameterDeclarations>{parameters}</ParameterDeclarations>\n"
        f"<VariableDeclarations>{variables}</VariableDeclarations>\n"
        f"<CatalogLocations>{catalogs}</CatalogLocations>\n"
        '<RoadNetwork><LogicFile filepath="two_roads.xodr"/></RoadNetwork>\n'
        f'<Entities><ScenarioObject name="Ego">{CAR}</ScenarioObject>'
        f'<ScenarioObject name="Other">{other}</ScenarioObject></Entities>\n'
        f"<Storyboard>\n<Init><Actions>{init}</Actions></Init>\n{stories}\n{stop}\n</Storyboard>\n"
        "</OpenSCENARIO>\n"
    )
    path = directory / "small.xosc"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """`write_scenario` into the test's own directory."""
    return partial(write_scenario, tmp_path)


@pytest.fixture
def play(write: Callable[..., Path]) -> Callable[..., tuple[Engine, Run]]:
    """Write a scenario, run it, and give the engine and the run."""

    def run(*acts: str, values: Mapping[str, Any] | None = None, **parts: Any) -> tuple[Engine, Run]:
        engine = Engine(load(write(*acts, **parts), values))
        return engine, engine.run()

    return run


def at(run: Run, entity: str, time_s: float) -> tuple[float, float, float, float]:
    """x, y, yaw and speed of an entity at a sampling time."""
    row = int(abs(run.time_s - time_s).argmin())
    assert abs(run.time_s[row] - time_s) < 1e-6
    column = run.names.tolist().index(entity)
    return tuple(float(a[row, column]) for a in (run.x_m, run.y_m, run.yaw_rad, run.speed_mps))  # type: ignore[return-value]
