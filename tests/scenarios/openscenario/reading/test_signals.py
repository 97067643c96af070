"""Traffic signals in a file: what cannot be meant is refused in a line, what the schema allows is taken."""

import pytest

from scenarios.openscenario import ContentError, Engine, load


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
    def make(*controllers):
        path = write()
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
