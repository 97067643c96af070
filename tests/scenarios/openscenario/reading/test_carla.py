"""Files of CARLA's ScenarioRunner: left-handed coordinates, entities that Init adds."""

import math
from pathlib import Path

import pytest

from scenarios.openscenario import Engine, load
from scenarios.openscenario.model import (
    AngleCondition,
    Orientation,
    RelativeAngleCondition,
    Route,
    RoutePosition,
)
from scenarios.openscenario.reading.carla import right_handed
from tests.scenarios.openscenario.conftest import (
    act,
    at,
    at_time,
    by_entity,
    by_value,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)

SHARED = Path(__file__).parents[4].parent / "shared"
ORIENTED = '<Orientation type="relative" h="0.2"/>'
ADDED = (
    '<GlobalAction><EntityAction entityRef="Other"><AddEntityAction><Position>{}</Position></AddEntityAction>'
    "</EntityAction></GlobalAction>"
)


@pytest.fixture
def start(write):
    """Where the ego is at the start, in a file of CARLA or not."""

    def pose(position, description="small"):
        path = write(
            init=private("Ego", teleport(lane_position(10)), teleport(f"<Position>{position}</Position>"))
            + private("Other", teleport(lane_position(100)))
        )
        path.write_text(path.read_text("utf-8").replace('"small"', f'"{description}"'), encoding="utf-8")
        state = Engine(load(path)).ego.state(0.0)
        return state.x_m, state.y_m, math.remainder(state.yaw_rad, 2 * math.pi)

    return pose


@pytest.mark.parametrize(
    ("position", "ours", "theirs"),
    [
        ('<WorldPosition x="20" y="1" h="0.1"/>', (20, 1, 0.1), (20, -1, -0.1)),
        # lane -1 is 3.5 m wide and runs east, its middle at y = -1.75 m
        (
            f'<LanePosition roadId="A" laneId="-1" s="20" offset="0.5">{ORIENTED}</LanePosition>',
            (20, -1.25, 0.2),
            (20, -2.25, -0.2),
        ),
        ('<RoadPosition roadId="A" s="20" t="2"/>', (20, 2, 0), (20, -2, 0)),
        ('<RoadPosition roadId="A" s="20" t="-2"/>', (20, -2, 0), (20, -2, 0)),
        ('<RelativeObjectPosition entityRef="Other" dx="3" dy="1"/>', (103, -0.75, 0), (103, -2.75, 0)),
        ('<RelativeWorldPosition entityRef="Other" dx="3" dy="1"/>', (103, -0.75, 0), (103, -2.75, 0)),
        ('<RelativeRoadPosition entityRef="Other" ds="3" dt="1"/>', (103, -0.75, 0), (103, -2.75, 0)),
        (
            '<RelativeLanePosition entityRef="Other" dLane="0" ds="3" offset="1"/>',
            (103, -0.75, 0),
            (103, -2.75, 0),
        ),
    ],
)
def test_coordinates_to_the_right_where_the_description_says_carla(start, position, ours, theirs):
    assert start(position) == pytest.approx(ours, abs=1e-6)
    assert start(position, "CARLA:Test") == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize(("description", "side"), [("small", 1.0), ("CARLA:Test", -1.0)])
def test_offsets_of_actions(write, description, side):
    action = (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
        'dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.5"/></LaneOffsetTarget>'
        "</LaneOffsetAction></LateralAction></PrivateAction>"
    )
    ego = private("Ego", teleport(lane_position(10)), speed(10), action)
    path = write(init=ego + private("Other", teleport(lane_position(100))))
    path.write_text(path.read_text("utf-8").replace('"small"', f'"{description}"'), encoding="utf-8")
    assert at(Engine(load(path)).run(2.0), "Ego", 1.0)[:2] == pytest.approx((20, -1.75 + 0.5 * side))


def test_entities_that_init_adds_one_relative_to_the_other(play):
    """Wherever they stand in Init."""
    beside = '<RelativeRoadPosition entityRef="Ego" ds="50" dt="0"/>'
    _, run = play(init=ADDED.format(beside) + private("Ego", teleport(lane_position(10)), speed(0)))
    assert at(run, "Other", 1.0) == pytest.approx((60, -1.75, 0, 0))


def test_vehicles_of_carlas_examples_stand_on_roads_and_head_along_them():
    """The mirrored places of 16 files of others, against the maps, which are read without them."""
    folder = SHARED / "openscenario" / "carla"
    if not folder.is_dir():
        pytest.skip(f"no scenarios of CARLA at {folder}")
    turns = []
    for file in sorted(folder.rglob("*.xosc")):
        if file.parent.name == "catalogs" or file.stem == "VehicleLateralDistance":  # refused: distance -2
            continue
        engine = Engine(load(file, None, SHARED / "opendrive" / "maps"))
        roads = engine.world.locator.roads
        for actor in engine.world.actors.values():
            if not actor.placed or actor.definition.category not in ("car", "cyclist"):
                continue
            pose = actor.state(0.0).pose
            assert roads.place(pose) is not None, (file.stem, actor.name)
            way = roads.way(pose)
            turn = way.pose(way.project(pose.x_m, pose.y_m)[0])[2] - pose.yaw_rad
            turns.append(abs(math.remainder(turn, 2 * math.pi)))
    # one file changes the offset in its lane at once, with up to 45 degrees
    assert len(turns) > 25
    assert sum(turn < math.radians(1) for turn in turns) >= len(turns) - 2


@pytest.mark.parametrize(("description", "side"), [("small", 1.0), ("CARLA:Test", -1.0)])
@pytest.mark.parametrize("spline", [False, True])
def test_curvatures_turn_to_the_right(write, description, side, spline):
    """A quarter of a circle of 20 m radius from (20, 0) on."""
    place = '<Position{0}><WorldPosition x="20" y="0" h="0"/></Position{0}>'
    length = 10 * math.pi
    shape = (
        f'<ClothoidSpline><ClothoidSplineSegment curvatureStart="0.05" curvatureEnd="0.05" length="{length}">'
        f"{place.format('Start')}</ClothoidSplineSegment></ClothoidSpline>"
        if spline
        else f'<Clothoid curvature="0.05" curvatureDot="0" length="{length}">{place.format("")}</Clothoid>'
    )
    action = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="false"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        "<TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>'
        "</PrivateAction>"
    )
    ego = private("Ego", teleport(lane_position(10)), action, speed(math.pi))
    path = write(init=ego + private("Other", teleport(lane_position(200))))
    path.write_text(path.read_text("utf-8").replace('"small"', f'"{description}"'), encoding="utf-8")
    x, y, yaw, _ = at(Engine(load(path)).run(6.0), "Ego", 5.0)  # half of it
    half = math.sqrt(0.5)
    assert (x, y, yaw) == pytest.approx(
        (20 + 20 * half, side * 20 * (1 - half), side * math.pi / 4), abs=1e-3
    )


def test_angles_and_places_beside_ways_are_mirrored():
    for record, name in (
        (AngleCondition(0.2, 0.1), "angle_rad"),
        (RelativeAngleCondition("Ego", 0.2, 0.1), "angle_rad"),
        (RoutePosition(Route("r", ()), 1.0, None, 0.2, Orientation()), "offset_m"),
    ):
        assert getattr(right_handed(record), name) == -0.2


def as_carla(path):
    path.write_text(path.read_text("utf-8").replace('"small"', '"CARLA:Test"'), encoding="utf-8")
    return Engine(load(path))


def step(value, amount, dimension):
    return speed(value, "step", dimension, amount)


def test_conditions_that_have_been_met_stay_met(write):
    """Two that hold one after the other: with edges, as the file has them, never together; at 1 s and 5 s."""
    passed = by_entity('<TraveledDistanceCondition value="10"/>')  # the ego is at 10 m/s
    both = trigger(
        condition(passed, edge="rising"),
        condition(by_value('<SimulationTimeCondition value="0" rule="equalTo"/>'), edge="rising"),
    )
    moves = act(maneuver(event("e", speed(5), both)))
    assert at(Engine(load(write(moves))).run(6.0), "Other", 5.0)[3] == 0.0
    run = as_carla(write(moves)).run(6.0)
    assert at(run, "Other", 0.99)[3] == 0.0
    assert at(run, "Other", 5.0)[0] == pytest.approx(60 + 4 * 5)


@pytest.mark.parametrize(("dimension", "amount"), [("distance", 12), ("time", 3)])
def test_a_step_lasts_as_long_as_its_value(write, dimension, amount):
    """At 4 m/s for 12 m or 3 s from 1 s on; only then the action has ended, and the other event begins."""
    ended = by_value(
        '<StoryboardElementStateCondition storyboardElementType="action" storyboardElementRef="a" '
        'state="completeState"/>'
    )
    events = (
        event("drives", step(4, amount, dimension), trigger(condition(at_time(1))), "overwrite"),
        event("stands", step(0, 10, "time"), trigger(condition(ended)), "overwrite"),
    )
    second = events[1].replace('<Action name="a">', '<Action name="b">')
    run = as_carla(write(act(maneuver(events[0], second)))).run(8.0)
    assert at(run, "Other", 3.9)[3] == 4.0
    assert at(run, "Other", 4.1)[3] == 0.0
    assert at(run, "Other", 7.0)[0] == pytest.approx(72.0, abs=1e-6)


def test_no_event_stops_another(write):
    """A speed for 24 m, and 1 s later with priority overwrite a visibility: both come to their ends."""
    unseen = (
        '<PrivateAction><VisibilityAction graphics="true" sensors="false" traffic="true"/></PrivateAction>'
    )
    ended = (
        '<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="drives" '
        'state="endTransition"/>'
    )
    events = (
        event("drives", step(4, 24, "distance"), trigger(condition(at_time(1))), "overwrite"),
        event("hides", unseen, trigger(condition(at_time(2))), "overwrite"),
        event("quicker", speed(9), trigger(condition(by_value(ended))), "overwrite"),
    )
    run = as_carla(write(act(maneuver(*events)))).run(9.0)
    assert at(run, "Other", 6.9)[3] == 4.0
    assert at(run, "Other", 7.1)[3] == 9.0


@pytest.mark.parametrize(("description", "y"), [("small", -1.75), ("CARLA:Test", -5.25)])
def test_lanes_to_the_left_have_negative_numbers(write, description, y):
    change = (
        '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="linear" '
        'dynamicsDimension="distance" value="20"/><LaneChangeTarget><RelativeTargetLane entityRef="Ego" '
        'value="{}"/></LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>'
    )
    lane, value = (-2, 1) if description == "small" else (-1, 1)
    path = write(
        act(maneuver(event("e", change.format(value), trigger(condition(at_time(1))))), actors="Ego"),
        init=private("Ego", teleport(lane_position(10, lane)), speed(10))
        + private("Other", teleport(lane_position(200))),
    )
    path.write_text(path.read_text("utf-8").replace('"small"', f'"{description}"'), encoding="utf-8")
    assert at(Engine(load(path)).run(6.0), "Ego", 5.0)[1] == pytest.approx(y, abs=1e-6)
