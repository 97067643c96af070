"""Which element of the storyboard a reference means."""

import pytest

from scenarios.openscenario import ContentError, load
from tests.scenarios.openscenario.conftest import (
    act,
    at,
    at_time,
    by_value,
    condition,
    event,
    maneuver,
    speed,
    trigger,
)


def after(name):
    kind = f'storyboardElementType="event" storyboardElementRef="{name}" state="completeState"'
    return trigger(condition(by_value(f"<StoryboardElementStateCondition {kind}/>")))


def twice(slow, fast, name):
    """The same maneuver for both, which ends at different times: 4 s and 2 s after the start."""

    def one(actor, lasts):
        begin = event("begin", speed(8, "linear", "time", lasts), trigger(condition(at_time(0))))
        return act(maneuver(begin, event("go on", speed(3), after(name))), actors=actor, name=actor)

    return one("Ego", slow), one("Other", fast)


def test_the_nearest_of_several_is_meant(play):
    _, run = play(*twice(4, 2, "begin"))
    assert at(run, "Other", 1.99)[3] == pytest.approx(7.96)
    assert at(run, "Other", 2.01)[3] == 3.0
    assert at(run, "Ego", 3.99)[3] == pytest.approx(8.005)
    assert at(run, "Ego", 4.01)[3] == 3.0


def test_a_path_names_one_of_several(play):
    _, run = play(*twice(4, 2, "story::Ego::group::m::begin"))
    assert at(run, "Other", 3.99)[3] == 8.0
    assert at(run, "Other", 4.01)[3] == 3.0


def test_several_that_are_as_near_are_refused(write):
    pair = twice(4, 2, "begin")
    third = act(maneuver(event("e", speed(1), after("begin"))), name="third")
    with pytest.raises(ContentError, match="refers to event 'begin', of which there are 2; give its path"):
        load(write(*pair, third))
    with pytest.raises(ContentError, match="refers to event 'nothing', of which there are 0"):
        load(write(act(maneuver(event("e", speed(1), after("nothing"))))))
