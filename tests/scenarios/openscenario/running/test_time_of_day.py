"""Time of day, and places by latitude and longitude."""

import math

import pytest

from scenarios.openscenario import ContentError, Engine, RunError, load
from tests.scenarios.openscenario.conftest import (
    OTHER_AHEAD,
    act,
    at_time,
    by_value,
    condition,
    event,
    maneuver,
    private,
    set_variable,
    speed,
    teleport,
    trigger,
)

STOP = trigger(condition(at_time(6)), kind="StopTrigger")


def environment(day: str, goes_on: str = "true") -> str:
    return (
        '<GlobalAction><EnvironmentAction><Environment name="e">'
        f'<TimeOfDay animation="{goes_on}" dateTime="{day}"/>'
        "</Environment></EnvironmentAction></GlobalAction>"
    )


def later_than(day: str, rule: str = "greaterOrEqual") -> str:
    return by_value(f'<TimeOfDayCondition dateTime="{day}" rule="{rule}"/>')


@pytest.fixture
def triggered(write):
    """When the condition first holds, or None."""

    def run(condition_xml: str, *actions: str, acts=()):
        begin = trigger(condition(condition_xml))
        init = "".join(actions) + private("Ego", teleport(EGO)) + OTHER_AHEAD
        path = write(act(maneuver(event("e", set_variable("n", 1), begin))), *acts, init=init, stop=STOP)
        engine = Engine(load(path))
        while not engine.over:
            engine.advance(0.01)
            if engine.world.variables["n"] == 1:
                return engine.time_s
        return None

    return run


EGO = '<Position><LanePosition roadId="A" laneId="-1" s="10"/></Position>'
NOON = "2026-06-01T12:00:00"


@pytest.mark.parametrize(
    ("asked", "rule", "when"),
    [
        ("2026-06-01T12:00:02.5", "greaterOrEqual", 2.5),
        ("2026-06-01T12:00:02.5", "greaterThan", 2.5),
        ("2026-06-01T12:00:02.5", "equalTo", 2.5),
        ("2026-06-01T14:00:01.5+02:00", "greaterOrEqual", 1.5),
        ("2026-06-01T12:00:01Z", "greaterOrEqual", 1.0),
        ("2026-06-01T11:59:59", "greaterThan", 0.0),
        ("2026-06-01T12:00:01", "lessThan", 0.0),
        ("2026-06-01T13:00:00", "greaterThan", None),
    ],
)
def test_the_time_of_day_goes_on_with_the_run(triggered, asked, rule, when):
    got = triggered(later_than(asked, rule), environment(NOON))
    assert got == (None if when is None else pytest.approx(when, abs=0.0101))


def test_without_animation_it_stands(triggered):
    assert triggered(later_than("2026-06-01T12:00:01"), environment(NOON, "false")) is None
    assert triggered(later_than(NOON), environment(NOON, "false")) == pytest.approx(0.0, abs=0.0101)


def test_without_a_time_of_day_nothing_holds(triggered):
    assert triggered(later_than(NOON, "lessThan")) is None


def test_an_action_sets_it_anew(triggered):
    """At 2 s it becomes 12:00:00, so that 12:00:01 comes at 3 s."""
    setting = act(
        maneuver(event("e2", environment(NOON), trigger(condition(at_time(2)))), name="m2"), name="act2"
    )
    got = triggered(later_than("2026-06-01T12:00:01"), environment("2026-06-01T08:00:00"), acts=(setting,))
    assert got == pytest.approx(3.0, abs=0.0101)


def test_no_date_is_an_error_of_a_condition_and_a_note_of_an_environment(write):
    begin = trigger(condition(later_than("noon")))
    with pytest.raises(ContentError, match="dateTime: expected a date and time"):
        load(write(act(maneuver(event("e", set_variable("n", 1), begin)))))
    init = environment("noon") + private("Ego", teleport(EGO)) + OTHER_AHEAD
    (note,) = (note for note in load(write(init=init)).notes if "<TimeOfDay> is not used" in note)
    assert note.count("small.xosc") == 1


# Latitude and longitude

PROJECTION = (
    '<OpenDRIVE><header revMajor="1" revMinor="6" name="two roads"><geoReference>'
    "<![CDATA[+proj=tmerc +lat_0=48 +lon_0=11 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m]]>"
    "</geoReference></header>"
)
PRIME_VERTICAL_M = 6_378_137.0 / math.sqrt(1.0 - 6.69437999e-3 * math.sin(math.radians(48)) ** 2)
"""Radius of curvature in the prime vertical at 48 degrees, WGS 84."""
EAST = math.degrees(100 / (PRIME_VERTICAL_M * math.cos(math.radians(48))))
"""Degrees of longitude in 100 m."""


def geographic(write, position: str, projection: bool = True):
    init = private("Ego", teleport(f"<Position>{position}</Position>"), speed(10)) + OTHER_AHEAD
    path = write(init=init)
    if projection:
        road = path.parent / "two_roads.xodr"
        header = '<OpenDRIVE><header revMajor="1" revMinor="6" name="two roads"/>'
        assert header in road.read_text()
        road.write_text(road.read_text().replace(header, PROJECTION))
    return Engine(load(path))


@pytest.mark.parametrize(
    ("position", "y", "yaw"),
    [
        (f'<GeoPosition latitudeDeg="47.99999" longitudeDeg="{11 + EAST}"/>', -1.112, 0.0),
        (f'<GeoPosition latitudeDeg="48.00001" longitudeDeg="{11 + EAST}"/>', 1.112, math.pi),
        (
            f'<GeoPosition latitude="{math.radians(47.99999)}" longitude="{math.radians(11 + EAST)}"/>',
            -1.112,
            0.0,
        ),
        (
            f'<GeoPosition latitudeDeg="48.00001" longitudeDeg="{11 + EAST}">'
            '<Orientation type="absolute" h="0.1"/></GeoPosition>',
            1.112,
            0.1,
        ),
    ],
)
def test_latitude_and_longitude(write, position, y, yaw):
    """1e-5 degrees north are 1.112 m; it heads with the traffic of the lane there."""
    pytest.importorskip("pyproj")
    state = geographic(write, position).ego.state(0.0)
    assert (state.x_m, state.y_m) == pytest.approx((100, y), abs=2e-3)
    assert math.cos(state.yaw_rad - yaw) == pytest.approx(1)


def test_a_map_without_reference_refuses_them(write):
    with pytest.raises(RunError, match="latitude and longitude"):
        geographic(write, '<GeoPosition latitudeDeg="48" longitudeDeg="11"/>', projection=False)


@pytest.mark.parametrize(
    ("position", "message"),
    [
        ('latitude="48.1" longitude="0.19"', "latitude: it is in radians, at most 1.5708, got '48.1'"),
        ('latitude="0.84" longitude="11.5"', "longitude: it is in radians, at most 3.1416.*longitudeDeg"),
        ('latitudeDeg="90.1" longitudeDeg="11"', "latitudeDeg: expected at most 90 degrees"),
        ('latitudeDeg="48" longitudeDeg="-371"', "longitudeDeg: expected at most 180 degrees"),
    ],
)
def test_places_beyond_the_earth_are_refused(write, position, message):
    """Degrees in the place of radians, as a rule."""
    with pytest.raises(ContentError, match=message):
        geographic(write, f"<GeoPosition {position}/>")
