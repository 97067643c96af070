"""Traffic signals in a file: what cannot be meant is refused in a line, what the schema allows is taken."""

import pytest

from scenarios.openscenario import ContentError, Engine, UnsupportedError, load
from tests.scenarios.openscenario.conftest import act, by_value, condition, event, maneuver, speed, trigger


def controller(name, *phases, more=""):
    return f'<TrafficSignalController name="{name}"{more}>{"".join(phases)}</TrafficSignalController>'


def phase(name, duration, *states):
    inner = "".join(f'<TrafficSignalState trafficSignalId="{i}" state="{state}"/>' for i, state in states)
    return f'<Phase name="{name}" duration="{duration}">{inner}</Phase>'


RED = phase("stop", 5, ("s", "red"))
TWICE = phase("stop", 5, ("s", "red"), ("s", "green"))


def after(name):
    return f' reference="{name}" delay="1"'


@pytest.fixture
def signalled(write):
    def make(*controllers, acts=()):
        path = write(*acts)
        text = path.read_text(encoding="utf-8")
        signals = f"<TrafficSignals>{''.join(controllers)}</TrafficSignals></RoadNetwork>"
        path.write_text(text.replace("</RoadNetwork>", signals), encoding="utf-8")
        return path

    return make


@pytest.mark.parametrize(
    ("controllers", "message"),
    [
        ((controller("c", RED), controller("c", RED)), "has two controllers of the name 'c'"),
        ((controller("c", RED, more=after("c")),), "'c' refers to 'c', which waits for it"),
        (
            (controller("c", RED, more=after("d")), controller("d", RED, more=after("c"))),
            "'d' refers to 'c', which waits for it",
        ),
        ((controller("c", RED, more=after("z")),), "'c' refers to 'z', which is none"),
        (
            (controller("c", phase("p", 5, ("s", "red"), ("s", "green"))),),
            "'s' shows 'red' in this phase already",
        ),
        ((controller("c", phase("p", 5, ("s", ""))),), "state: expected a word for what 's' shows, got ''"),
        ((controller("c", phase("p", -1)),), "duration: expected a non-negative number, got -1"),
    ],
)
def test_what_cannot_be_meant(signalled, controllers, message):
    path = signalled(*controllers)
    with pytest.raises(ContentError, match=message) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}:")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        (("d", "stop"), "trafficSignalControllerRef: no controller 'd'; controllers: c, empty"),
        (("c", "go"), "phase: no phase 'go'; phases of 'c': stop"),
        (("empty", "go"), "phase: no phase 'go'; phases of 'empty': none"),
    ],
)
@pytest.mark.parametrize("kind", ["Action", "Condition"])
def test_a_phase_that_is_not_there_is_refused_before_the_run(signalled, kind, reference, message):
    name, phase_name = reference
    inner = f'<TrafficSignalController{kind} trafficSignalControllerRef="{name}" phase="{phase_name}"/>'
    action, start = speed(1), trigger(condition(by_value(inner)))
    if kind == "Action":
        inner = (
            f"<InfrastructureAction><TrafficSignalAction>{inner}</TrafficSignalAction></InfrastructureAction>"
        )
        action, start = f"<GlobalAction>{inner}</GlobalAction>", ""
    path = signalled(
        controller("c", RED), controller("empty"), acts=[act(maneuver(event("e", action, start)))]
    )
    with pytest.raises(ContentError, match=message) as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_the_state_of_a_group_is_noted_unless_a_condition_asks_for_it(signalled):
    group = '<Phase name="go" duration="5"><TrafficSignalGroupState state="green"/></Phase>'
    noted = load(signalled(controller("c", group)))
    assert any("<TrafficSignalGroupState> is not used: which signals are" in note for note in noted.notes)
    start = trigger(condition(by_value('<TrafficSignalCondition name="7" state="green"/>')))
    path = signalled(controller("c", group), acts=[act(maneuver(event("e", speed(1), start)))])
    with pytest.raises(UnsupportedError, match="<TrafficSignalGroupState> is not supported where a Traffic"):
        load(path)


@pytest.mark.parametrize(
    "controllers",
    [
        (),
        (controller("c"),),
        (controller("c", phase("p", 0)),),
        (controller("c", phase("p", 5, ("s", "red"), ("s", "red"))),),
        (controller("c", RED), controller("d", RED, more=after("c")), controller("e", RED, more=after("d"))),
    ],
)
def test_what_the_schema_allows(signalled, controllers):
    engine = Engine(load(signalled(*controllers)))
    assert engine.run(1.0).end_time_s == pytest.approx(1.0)
