"""Ways between waypoints by their strategies, on a ring of roads with two ways from west to east."""

import numpy as np
import pytest

from scenarios.openscenario import Engine, RunError, load
from scenarios.openscenario.motion.paths import Pose
from tests.scenarios.openscenario.conftest import (
    MAP,
    act,
    at,
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


def road(name, place, heading, length, junction=-1, limit="", link="", lane_link=True):
    x, y = place
    kind = f'<type s="0" type="town"><speed max="{limit}" unit="m/s"/></type>' if limit else ""
    links = '<link><predecessor id="-1"/><successor id="-1"/></link>' if lane_link else "<link/>"
    return (
        f'<road id="{name}" junction="{junction}" length="{length}"><link>{link}</link>{kind}<planView>'
        f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry></planView>'
        '<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>'
        f'<lane id="-1" type="driving">{links}<width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>'
        "</laneSection></lanes></road>"
    )


def network(limits=("", "")):
    """From road W to road E by `near` (100 m) or by `far` (120 m), and by `back` to W again.

    The roads are straight lines that do not meet in the plane: only their links count for a way.
    """
    short, long = limits
    junction = (
        '<junction id="J" name="J">'
        + "".join(
            f'<connection id="{k}" incomingRoad="W" connectingRoad="{name}" contactPoint="start">'
            '<laneLink from="-1" to="-1"/></connection>'
            for k, name in enumerate(("near", "far"))
        )
        + "</junction>"
    )
    into = '<predecessor elementType="road" elementId="{}" contactPoint="end"/>'
    onto = '<successor elementType="road" elementId="{}" contactPoint="start"/>'
    roads = (
        road("W", (0, 0), 0, 100, link='<successor elementType="junction" elementId="J"/>')
        + road("near", (100, 0), 0, 100, "J", short, into.format("W") + onto.format("E"))
        + road("far", (100, 0), 0.3, 120, "J", long, into.format("W") + onto.format("E"))
        + road(
            "E",
            (200, 0),
            0,
            100,
            link='<predecessor elementType="junction" elementId="J"/>' + onto.format("back"),
        )
        + road("back", (300, 0), 2.8, 300, link=into.format("E") + onto.format("W"))
    )
    return f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{roads}{junction}</OpenDRIVE>'


def place(name, s):
    return lane_position(s, -1, 0.0, "", name)


def assigned(strategy, goal=("E", 50), lane=-1):
    start = lane_position(20, lane, road_id="W")
    waypoints = f'<Waypoint routeStrategy="shortest">{start}</Waypoint>'
    waypoints += f'<Waypoint routeStrategy="{strategy}">{place(*goal)}</Waypoint>'
    return (
        '<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">'
        f"{waypoints}</Route></AssignRouteAction></RoutingAction></PrivateAction>"
    )


def acquired(goal):
    return (
        "<PrivateAction><RoutingAction><AcquirePositionAction>"
        f"{place(*goal)}</AcquirePositionAction></RoutingAction></PrivateAction>"
    )


@pytest.fixture
def drive(write, tmp_path):
    def run(*actions, until=10.0, limits=("", ""), edit=("", "")):
        path = write(
            stop=trigger(condition(at_time(until)), kind="StopTrigger"),
            init=private("Ego", teleport(place("W", 20)), *actions, speed(10))
            + private("Other", teleport(place("back", 100))),
        )
        (tmp_path / "two_roads.xodr").write_text(network(limits).replace(*edit), encoding="utf-8")
        engine = Engine(load(path))
        return engine, engine.run(until)

    return run


def way(engine, run, seconds):
    """Road below the ego."""
    x, y, yaw, _ = at(run, "Ego", seconds)
    return engine.world.locator.roads.place(Pose(x, y, yaw)).road_id


@pytest.mark.parametrize(
    ("strategy", "limits", "taken"),
    [
        ("shortest", ("", ""), "near"),
        ("shortest", ("5", "20"), "near"),
        ("fastest", ("", ""), "near"),
        ("fastest", ("20", "20"), "near"),
        ("fastest", ("10", "13"), "far"),  # 10 s against 9.2 s
        ("fastest", ("10", "11"), "near"),  # 10 s against 10.9 s
        ("fastest", ("10", ""), "near"),  # without a limit: the greatest of the map
        ("leastIntersections", ("5", "20"), "near"),
    ],
)
def test_the_way_to_a_waypoint(drive, strategy, limits, taken):
    engine, run = drive(assigned(strategy), limits=limits)
    assert way(engine, run, 9.0) == taken
    assert not any("routeStrategy" in note for note in engine.notes)


def test_the_way_with_the_fewest_intersections(drive):
    """The longer one, once it is in no junction."""
    outside = ('id="far" junction="J"', 'id="far" junction="-1"')
    for strategy, taken in (("shortest", "near"), ("leastIntersections", "far")):
        engine, run = drive(assigned(strategy), edit=outside)
        assert way(engine, run, 9.0) == taken


NEAR = (
    '<RelativeDistanceCondition entityRef="Other" relativeDistanceType="longitudinal" value="5" '
    'freespace="false" rule="lessThan" routingAlgorithm="{}" coordinateSystem="{}"/>'
)


@pytest.mark.parametrize(
    ("algorithm", "system", "refused"),
    [("fastest", "road", True), ("assignedRoute", "lane", True), ("fastest", "entity", False)]
    + [(algorithm, "road", False) for algorithm in ("shortest", "undefined")],
)
def test_distances_by_another_way_are_refused_where_lanes_fork(write, tmp_path, algorithm, system, refused):
    path = write(
        act(maneuver(event("e", speed(1), trigger(condition(by_entity(NEAR.format(algorithm, system))))))),
        init=private("Ego", teleport(place("W", 20)), speed(10)) + private("Other", teleport(place("E", 50))),
    )
    text = path.read_text(encoding="utf-8").replace("<Condition ", "\n<Condition ")
    path.write_text(text, encoding="utf-8")
    (tmp_path / "two_roads.xodr").write_text(network(), encoding="utf-8")
    if refused:
        line = next(n for n, row in enumerate(text.splitlines(), 1) if row.startswith("<Condition"))
        said = rf"'c' \(small\.xosc:{line}\): routingAlgorithm='{algorithm}' is not carried"
        with pytest.raises(RunError, match=said):
            Engine(load(path))
    else:
        Engine(load(path))
    # where no lane forks there is one way
    path.write_text(
        text.replace('roadId="W"', 'roadId="A"').replace('roadId="E"', 'roadId="A"'), encoding="utf-8"
    )
    (tmp_path / "two_roads.xodr").write_text(MAP, encoding="utf-8")
    assert not any("routingAlgorithm" in note for note in Engine(load(path)).notes)


def test_a_random_way_is_the_same_each_time(drive):
    ways = set()
    for _ in range(3):
        engine, run = drive(assigned("random"))
        ways.add(way(engine, run, 9.0))
    assert len(ways) == 1
    assert ways < {"near", "far"}


def test_a_place_behind_is_driven_to_round_the_block(drive):
    engine, run = drive(acquired(("W", 10)), until=80.0)
    assert [way(engine, run, seconds) for seconds in (5.0, 9.0, 20.0, 40.0)] == ["W", "near", "E", "back"]
    away = np.hypot(run.x_m[:, 0] - 10, run.y_m[:, 0] + 2)
    assert away[:500].min() > 9.9
    assert away.min() < 0.06


SECOND_LANE = (
    "</lane></right>",
    '</lane><lane id="-2" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>',
)
"""A second lane on each road, which leads nowhere: who is in it changes to the first."""


def test_a_strategy_that_asks_for_other_roads_and_lane_changes_is_refused(drive):
    """To E only by a change to lane -1 of W: 100 m at 5 m/s or 120 m at 20 m/s."""
    limits = ("5", "20")
    with pytest.raises(RunError, match="routeStrategy 'fastest' asks for another way than 'shortest', with"):
        drive(assigned("fastest", lane=-2), limits=limits, edit=SECOND_LANE)
    for strategy, allowed in (("shortest", limits), ("fastest", ("", ""))):
        engine, run = drive(assigned(strategy, lane=-2), limits=allowed, edit=SECOND_LANE)
        assert way(engine, run, 9.0) == "near"


def test_a_waypoint_behind_the_one_before_is_refused_where_nothing_leads_round(play):
    """The two roads of these tests end."""
    with pytest.raises(RunError, match="no route leads"):
        play(
            init=private("Ego", teleport(lane_position(100)), acquired(("A", 20)), speed(10))
            + private("Other", teleport(lane_position(200)))
        )
