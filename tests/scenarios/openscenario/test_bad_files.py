"""Files that are refused: one line each, with the place, before anything runs."""

import copy
import re

import pytest

from scenarios.errors import ScenarioError
from scenarios.openscenario import (
    ContentError,
    Engine,
    ExpressionError,
    FileReadError,
    OpenScenarioError,
    ParameterError,
    RunError,
    UnsupportedError,
    load,
)
from scenarios.simulation.motion_actions import ego_of
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    at_time,
    by_value,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    set_variable,
    speed,
    teleport,
    trigger,
)


def refused(path, error, *texts):
    with pytest.raises(error) as caught:
        Engine(load(path))
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    for text in texts:
        assert text in message
    return message


def edited(write, old, new, *acts, **parts):
    path = write(*acts, **parts)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("old", "new", "error", "texts"),
    [
        ("<OpenSCENARIO>", "<OpenDRIVE>", FileReadError, ["not well-formed XML"]),
        ('revMajor="1"', 'revMajor="2"', FileReadError, ["version '2.3'", "1.0 to 1.3"]),
        ('revMinor="3"', 'revMinor="x"', FileReadError, ["version '1.x'"]),
        ("<Storyboard>", "<Sounds/><Storyboard>", UnsupportedError, [":8: <Sounds> in <OpenSCENARIO>"]),
        ('s="60"', 's="60 m"', ContentError, [":9: <LanePosition> s: expected a number without "
        "unit", "'60 m'"]),
        ('s="60"', 's="1e12"', ContentError, ["expected a number"]),
        ('s="60"', "", ContentError, ["<LanePosition> needs an attribute 's'"]),
        ('s="60"', 's="60" lane="3"', UnsupportedError, ["attribute 'lane' is not supported"]),
        ('s="60"', 's="$here"', ParameterError, ["<LanePosition> s: parameter 'here' is not declared"]),
        ('s="60"', 's="${1/0}"', ExpressionError, ["<LanePosition> s: the expression '1/0' has no value"]),
        ('laneId="-1" s="60"', 'laneId="-1.5" s="60"', ContentError, ["expected a whole number"]),
        ('dynamicsShape="step"', 'dynamicsShape="jump"', UnsupportedError, ["Shape='jump'", "sinusoidal"]),
        ('dynamicsDimension="time"', 'dynamicsDimension="km"', UnsupportedError, ["dynamicsDimension='km'"]),
        ("<PrivateAction>", '<PrivateAction late="1">', UnsupportedError, ["<PrivateAction> attribute"]),
        ("<Position>", '<Position late="1">', UnsupportedError, ["<Position> attribute 'late'"]),
        ("<SpeedActionTarget>", '<SpeedActionTarget late="1">', UnsupportedError, ["attribute 'late'"]),
        ('author="test"', 'writer="test"', UnsupportedError, [":2: <FileHeader> attribute 'writer'"]),
        ("</TeleportAction>", "</TeleportAction>"
        "<TeleportAction/>", ContentError, ["<PrivateAction>", "got 2"]),
        ('<Private entityRef="Other">', '<Private entityRef="Third">', ContentError, ["entity 'Third'"]),
        ('vehicleCategory="car"', 'vehicleCategory="boat"', UnsupportedError, ["vehicleCategory='boat'"]),
        ('length="4"', 'length="-4"', ContentError, ["length: expected a non-negative number, got -4"]),
        ('filepath="two_roads.xodr"', 'filepath="gone.xodr"', FileReadError, [":6: <LogicFile> road "
        "network"]),
        ('name="Other"', 'name="Ego"', ContentError, ["two entities have the same name, 'Ego'"]),
    ],
)  # fmt: skip
def test_content(write, old, new, error, texts):
    refused(edited(write, old, new), error, *texts)


@pytest.mark.parametrize(
    "action",
    [
        "<RoutingAction><RandomRouteAction/></RoutingAction>",
    ],
)
def test_actions_that_are_not_carried_out_are_refused_by_name(write, action):
    name = re.findall(r"<(\w+)/?>", action)[-1]
    path = write(act(maneuver(event("e", f"<PrivateAction>{action}</PrivateAction>"))))
    wrapper = re.findall(r"<(\w+)", action)[0]
    message = refused(path, UnsupportedError, "is not supported")
    assert f"<{name}>" in message or f"<{wrapper}>" in message


def test_conditions_that_are_not_known_are_refused_by_name(write):
    kind = by_value('<UserDefinedValueCondition name="x" value="1" rule="equalTo"/>')
    path = write(act(maneuver(event("e", set_variable("n", 1), trigger(condition(kind))))))
    refused(path, UnsupportedError, "<UserDefinedValueCondition> in <", ":10:")


def test_references(write):
    start = trigger(condition(by_value('<VariableCondition variableRef="m" rule="equalTo" value="1"/>')))
    refused(write(act(maneuver(event("e", speed(1), start)))), ContentError, "no variable 'm'; variables: n")
    start = trigger(condition(by_value('<ParameterCondition parameterRef="p" rule="equalTo" value="1"/>')))
    refused(
        write(act(maneuver(event("e", speed(1), start)))), ParameterError, "parameter 'p' is not declared"
    )
    start = trigger(
        condition(
            by_value(
                '<StoryboardElementStateCondition storyboardElementType="maneuver" '
                'storyboardElementRef="gone" '
                'state="completeState"/>'
            )
        )
    )
    refused(
        write(act(maneuver(event("e", speed(1), start)))),
        ContentError,
        "maneuver 'gone', of which there are 0",
    )


def test_text_cannot_be_ordered(write):
    start = trigger(condition(by_value('<VariableCondition variableRef="n" rule="lessThan" value="much"/>')))
    path = write(act(maneuver(event("e", speed(1), start))))
    refused(path, ParameterError, ":10: <VariableCondition> '0' and 'much' cannot be ordered by lessThan")


def test_a_scenario_without_anybody_takes_place_and_has_nobody_under_test(write):
    """What needs no road user goes on: a variable that an event at 2 s sets ends it."""
    change = event("e", set_variable("n", 3), trigger(condition(at_time(2))))
    stop = trigger(
        condition(by_value('<VariableCondition variableRef="n" value="3" rule="equalTo"/>')),
        kind="StopTrigger",
    )
    path = write(act(maneuver(change), actors=""), init="", stop=stop)
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub("<ScenarioObject.*</ScenarioObject>", "", text), encoding="utf-8")
    engine = Engine(load(path))
    run = engine.run()
    assert (run.stopped, run.end_time_s, run.contact_time_s) == (True, pytest.approx(2.0), None)
    assert run.x_m.shape == (len(run.time_s), 0)
    assert len(engine.entities.name) == 0
    assert any("<Entities> is empty" in note for note in engine.notes)
    copied = copy.deepcopy(Engine(load(path)))
    assert copied.run().end_time_s == pytest.approx(2.0)
    with pytest.raises(ScenarioError, match="no road user in <Entities>, thus no vehicle under test"):
        ego_of(load(path))


def test_places_are_checked_before_the_run(write):
    for position, text in (
        (lane_position(301), "s = 301 m is off road 'A'"),
        (lane_position(10, lane=-3), "road 'A' has no lane -3"),
        (lane_position(10, road_id="C"), "no road 'C'"),
    ):
        late = trigger(condition(by_value('<SimulationTimeCondition value="5" rule="greaterThan"/>')))
        refused(write(act(maneuver(event("e", teleport(position), late)))), RunError, text)
    moved = act(maneuver(event("e", speed(1))))
    refused(write(moved, init=EGO_AT_START), RunError, "'Other' is never given a position")
    refused(write(init=""), RunError, "'Ego' is never given a position")


def test_an_entity_that_nothing_places_or_uses_is_not_there(write):
    engine = Engine(load(write(init=EGO_AT_START)))
    assert not engine.run(1.0).exists[:, 1].any()
    assert any("'Other' is never given a position, and nothing refers to it" in n for n in engine.notes)


def test_what_is_no_scenario(write, tmp_path):
    path = tmp_path / "x.xosc"
    for text, message in (
        ("", "not well-formed"),
        ("<a/>", "root element is <a>"),
        ("<OpenSCENARIO/>", "version '.'"),
        (
            '<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/><Catalog name="c"/></OpenSCENARIO>',
            "holds a catalog",
        ),
        (
            '<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/><ParameterValueDistribution/>'
            "</OpenSCENARIO>",
            "parameter variations",
        ),
        ('<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/></OpenSCENARIO>', "needs an element <"),
    ):
        path.write_text(text, encoding="utf-8")
        refused(path, FileReadError if "needs" not in message else ContentError, message)


def test_entities_are_not_expanded(tmp_path):
    path = tmp_path / "bomb.xosc"
    path.write_text(
        '<!DOCTYPE a [<!ENTITY b "bbbb">]><OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/>'
        "<ParameterDeclarations>&b;</ParameterDeclarations></OpenSCENARIO>",
        encoding="utf-8",
    )
    with pytest.raises(OpenScenarioError, match=":1: the entity &b; in <ParameterDeclarations> is not supp"):
        load(path)


def test_every_truncation_is_refused_in_one_line(write):
    """Wherever a file breaks off, or loses a line, it is refused by a named error or still a scenario."""
    path = write(
        act(maneuver(event("e", speed(1)))), init=EGO_AT_START + OTHER_AHEAD + private("Other", speed(2))
    )
    text = path.read_text(encoding="utf-8")
    refused_count = 0
    for cut in range(0, len(text) - 20, 37):
        path.write_text(text[:cut] + text[cut + 20 :], encoding="utf-8")
        message = ""
        try:
            Engine(load(path))
        except OpenScenarioError as error:
            message = str(error)
        assert "\n" not in message
        refused_count += message != ""
    assert refused_count > 50
