import pytest

from scenarios.openscenario import Engine, RunError, load
from tests.scenarios.openscenario.conftest import (
    act,
    add_to_variable,
    at,
    at_time,
    by_value,
    condition,
    event,
    maneuver,
    set_variable,
    speed,
    trigger,
)


def later(seconds, kind="StartTrigger"):
    return trigger(condition(at_time(seconds)), kind=kind)


def n_at(engine, time_s):
    engine.advance(time_s - engine.time_s)
    return engine.world.variables["n"]


def engine_of(write, *acts, **parts):
    return Engine(load(write(*acts, **parts)))


def state(kind, name, wanted):
    return by_value(
        f'<StoryboardElementStateCondition storyboardElementType="{kind}" '
        f'storyboardElementRef="{name}" state="{wanted}"/>'
    )


def test_missing_triggers_hold_at_once(write):
    engine = engine_of(write, act(maneuver(event("e", set_variable("n", 3)))), stop="")
    assert engine.world.variables["n"] == 3
    assert engine.run(time_limit_s=2.0).stopped is False
    assert engine.time_s == pytest.approx(2.0)


def test_an_event_waits_for_its_act(write):
    """Its own condition holds from the start, but it is looked at only once the act runs."""
    engine = engine_of(write, act(maneuver(event("e", set_variable("n", 1), later(0))), start=later(1.5)))
    assert n_at(engine, 1.49) == 0
    assert n_at(engine, 1.51) == 1


def test_stop_trigger_of_an_act(write):
    """What runs is stopped where it is; what waits never starts."""
    ramp = event("ramp", speed(10, "linear", "time", 10))
    never = event("never", set_variable("n", 1), later(5))
    engine = engine_of(write, act(maneuver(ramp, never), stop=later(4, "StopTrigger")))
    run = engine.run()
    assert engine.world.variables["n"] == 0
    # a speed change that is stopped has nobody to go on with it: the profile remains the entity's
    assert at(run, "Other", 4.0)[3] == pytest.approx(4.0)


def test_stop_trigger_of_the_storyboard(write):
    run = engine_of(write, stop=later(3.21, "StopTrigger")).run()
    assert run.stopped
    assert run.end_time_s == pytest.approx(3.21, abs=1e-8)


def test_several_executions(write):
    """An event with a rising edge executes once per edge, up to its maximum."""
    blink = "".join(
        event(f"on{t}", set_variable("flag", 1), later(t))
        + event(f"off{t}", set_variable("flag", 0), later(t + 0.5))
        for t in (1, 2, 3)
    )
    edge = trigger(
        condition(by_value('<VariableCondition variableRef="flag" rule="equalTo" value="1"/>'), edge="rising")
    )
    variables = "".join(
        f'<VariableDeclaration name="{v}" variableType="double" value="0"/>' for v in ("n", "flag")
    )
    engine = engine_of(
        write,
        act(maneuver(blink, event("count", add_to_variable("n", 1), edge, count=2))),
        variables=variables,
    )
    assert n_at(engine, 1.6) == 1
    assert n_at(engine, 2.6) == 2
    assert n_at(engine, 5.0) == 2


def test_a_group_executes_again(write):
    engine = engine_of(write, act(maneuver(event("e", add_to_variable("n", 1))), count=3))
    assert n_at(engine, 0.01) == 3


@pytest.mark.parametrize(
    ("priority", "speed_at_3_s", "speed_at_8_s"),
    [
        # a ramp from 0 to 10 m/s in 10 s is running when, at 2 s, an event that sets n wants to start
        ("override", 2.0, 2.0),
        ("parallel", 3.0, 8.0),
        ("skip", 3.0, 8.0),
    ],
)
def test_priority(write, priority, speed_at_3_s, speed_at_8_s):
    ramp = event("ramp", speed(10, "linear", "time", 10))
    second = event("second", set_variable("n", 1), later(2), priority=priority)
    ended = event(
        "seen", set_variable("ended", 1), trigger(condition(state("event", "ramp", "completeState")))
    )
    variables = "".join(
        f'<VariableDeclaration name="{v}" variableType="double" value="0"/>' for v in ("n", "ended")
    )
    engine = engine_of(write, act(maneuver(ramp, second), maneuver(ended, name="watch")), variables=variables)
    engine.advance(3.0)
    assert engine.world.variables["n"] == (0 if priority == "skip" else 1)
    assert engine.world.variables["ended"] == (1 if priority == "override" else 0)
    assert engine.entities.speed_mps[1] == pytest.approx(speed_at_3_s, abs=1e-6)
    engine.advance(5.0)
    assert engine.entities.speed_mps[1] == pytest.approx(speed_at_8_s, abs=1e-6)


def test_overwrite_is_the_old_name_of_override(write):
    first = event("first", speed(10, "linear", "time", 10))
    second = event("second", speed(1), later(2), priority="overwrite")
    run = engine_of(write, act(maneuver(first, second)), minor=0).run()
    assert at(run, "Other", 3.0)[3] == 1.0


def test_a_new_speed_action_ends_the_old_one(write):
    """Even in another maneuver: an entity has one speed."""
    first = act(maneuver(event("first", speed(10, "linear", "time", 10))))
    second = act(maneuver(event("second", speed(2), later(1)), name="other"), name="second")
    done = trigger(condition(state("event", "first", "completeState")))
    third = act(maneuver(event("third", set_variable("n", 1), done), name="third"), name="third")
    engine = engine_of(write, first, second, third)
    assert n_at(engine, 0.99) == 0
    assert n_at(engine, 1.01) == 1
    assert engine.entities.speed_mps[1] == 2.0


@pytest.mark.parametrize(
    ("kind", "name", "wanted", "expected"),
    [
        ("event", "ramp", "startTransition", 1.0),
        ("event", "ramp", "runningState", 1.0),
        ("event", "ramp", "endTransition", 3.0),
        ("event", "ramp", "completeState", 3.0),
        ("action", "ramp::a", "completeState", 3.0),
        ("maneuver", "m", "completeState", 3.0),
        ("maneuverGroup", "story::act::group", "completeState", 3.0),
        ("act", "act", "completeState", 3.0),
        ("act", "act", "runningState", 0.0),
        ("act", "act", "endTransition", 3.0),
        ("event", "story/act/group/m/ramp", "standbyState", 0.0),
    ],
)
def test_element_states(write, kind, name, wanted, expected):
    ramp = act(maneuver(event("ramp", speed(4, "linear", "time", 2), later(1))))
    group = act(
        maneuver(
            event("seen", set_variable("n", 1), trigger(condition(state(kind, name, wanted)))), name="watch"
        ),
        name="second",
    ).replace('"group"', '"watchers"')
    engine = engine_of(write, ramp, group)
    if expected == 0.0:
        assert engine.world.variables["n"] == 1
    else:
        assert n_at(engine, expected - 0.001) == 0
        assert n_at(engine, expected + 0.001) == 1


@pytest.mark.parametrize(
    ("kind", "name", "wanted", "expected"),
    [
        # a ramp of 10 s; at 2 s its event is overridden, at 2.5 s one is skipped, at 4 s the act is stopped
        ("event", "ramp", "stopTransition", 2.0),
        ("event", "ramp", "completeState", 2.0),
        ("event", "over", "startTransition", 2.0),
        ("event", "skipped", "skipTransition", 2.5),
        ("event", "over", "stopTransition", 4.0),
        ("act", "act", "stopTransition", 4.0),
        ("action", "over::a", "stopTransition", 4.0),
        # the story ends with its only act
        ("story", "story", "endTransition", 4.0),
        ("story", "story", "completeState", 4.0),
        ("story", "story", "runningState", 0.0),
    ],
)
def test_states_of_what_is_overridden_skipped_and_stopped(write, kind, name, wanted, expected):
    ramp = event("ramp", speed(10, "linear", "time", 10))
    over = event("over", speed(0, "linear", "time", 10), later(2), priority="override")
    skipped = event("skipped", speed(5), later(2.5), priority="skip")
    ramps = act(maneuver(ramp, over, skipped), stop=later(4, "StopTrigger"))
    seen = event("seen", set_variable("n", 1), trigger(condition(state(kind, name, wanted))))
    path = write(ramps)
    text = path.read_text(encoding="utf-8")
    watch = act(maneuver(seen, name="watch"), name="second").replace('"group"', '"watchers"')
    path.write_text(
        text.replace("</Story>", f'</Story><Story name="watcher">{watch}</Story>'), encoding="utf-8"
    )
    engine = Engine(load(path))
    if expected == 0.0:
        assert engine.world.variables["n"] == 1
    else:
        assert n_at(engine, expected - 0.001) == 0
        assert n_at(engine, expected + 0.001) == 1


def test_delay_after_completion(write):
    """As in the braking targets of Euro NCAP: a second maneuver starts a time after the first has ended."""
    first = maneuver(event("first", speed(5)), name="first")
    second = maneuver(
        event("second", speed(1), trigger(condition(state("maneuver", "first", "completeState"), delay=3))),
        name="second",
    )
    run = engine_of(write, act(first, second)).run()
    assert at(run, "Other", 2.99)[3] == 5.0
    assert at(run, "Other", 3.01)[3] == 1.0
    assert at(run, "Other", 4.0)[0] == pytest.approx(60 + 15 + 1, abs=1e-6)


def test_events_that_start_one_another_without_end_are_refused(write):
    engine_error = pytest.raises(RunError, match="start one another without end")
    with engine_error:
        engine_of(write, act(maneuver(event("e", add_to_variable("n", 1))), count=100_000))


def test_empty_triggers_are_as_those_that_are_not_there(write):
    """As in esmini: what has no condition to wait for starts at once, and nothing stops it."""
    empty = event("e", add_to_variable("n", 1), "<StartTrigger/>")
    after = event("after", add_to_variable("n", 10), later(2))
    stops = act(maneuver(empty, after), start="<StartTrigger/>", stop="<StopTrigger/>")
    engine = engine_of(write, stops)
    assert n_at(engine, 0.5) == 1
    assert n_at(engine, 3.0) == 11


def test_an_event_that_may_again_begins_once_a_step(write):
    """It sets n at 1 s and a step later, and is not used up at one instant, however great its count."""
    often = event("e", add_to_variable("n", 1), later(1), count=5000)
    engine = engine_of(write, act(maneuver(often)))
    assert n_at(engine, 0.995) == 0
    assert n_at(engine, 1.005) == 1
    assert n_at(engine, 2.005) == 101


def test_what_holds_at_one_instant_begins_an_event_once(write):
    """As esmini's lights at the start: at time 0 and while it moves; the count is left for later."""
    now = by_value('<SimulationTimeCondition value="0" rule="equalTo"/>')
    later_on = trigger(condition(at_time(2), edge="rising"))
    begins = trigger(condition(now)).replace("</StartTrigger>", "") + later_on.replace("<StartTrigger>", "")
    engine = engine_of(write, act(maneuver(event("e", add_to_variable("n", 1), begins, count=1000))))
    assert n_at(engine, 1.0) == 1
    assert n_at(engine, 5.0) == 2


@pytest.mark.parametrize("where", ["event", "group", "act"])
def test_an_action_is_stopped_from_wherever_it_is_overridden(write, where):
    """A ramp to 10 m/s within 10 s; at 2 s another event, group or act takes the speed to 1 m/s at once."""
    ramp = event("ramp", speed(10, "linear", "time", 10))
    takes = event("takes", speed(1), later(2))
    seen = [
        event(name, set_variable(name, 1), trigger(condition(state("action", "ramp/a", transition))))
        for name, transition in (("stopped", "stopTransition"), ("ended", "endTransition"))
    ]
    ends = event("left", set_variable("left", 1), trigger(condition(state("event", "ramp", "endTransition"))))
    watch = act(maneuver(*seen, ends, name="watch"), name="watch")
    variables = "".join(
        f'<VariableDeclaration name="{v}" variableType="double" value="0"/>'
        for v in ("stopped", "ended", "left")
    )
    if where == "event":
        acts = [act(maneuver(ramp, takes))]
    elif where == "group":
        acts = [act(maneuver(ramp), maneuver(takes, name="second"))]
    else:
        acts = [act(maneuver(ramp)), act(maneuver(takes, name="second"), name="second")]
    engine = engine_of(write, *acts, watch, variables=variables)
    engine.advance(1.999)
    assert engine.world.variables == {"stopped": 0, "ended": 0, "left": 0}
    engine.advance(1.0)
    assert engine.world.variables == {"stopped": 1, "ended": 0, "left": 1}
    assert engine.entities.speed_mps[1] == 1.0


def test_a_group_executes_a_change_that_takes_time_as_often_as_it_may(write):
    """Each execution accelerates by 1 m/s within 2 s: three of them take 6 s."""
    faster = speed(1, "linear", "time", 2).replace(
        '<AbsoluteTargetSpeed value="1"/>',
        '<RelativeTargetSpeed entityRef="Other" value="1" speedTargetValueType="delta" continuous="false"/>',
    )
    run = engine_of(write, act(maneuver(event("e", faster)), count=3)).run()
    for t, v in ((2, 1.0), (3, 1.5), (6, 3.0), (9, 3.0)):
        assert at(run, "Other", t)[3] == pytest.approx(v, abs=1e-6)


def test_what_changes_while_an_event_runs_is_no_edge_afterwards(write):
    """Other changes its speed for 3 s from 2 s on; the condition that started it ends to hold at 3 s.

    The change that is over when the event waits again, at 5 s, starts nothing.
    """
    brief = by_value('<VariableCondition variableRef="n" rule="equalTo" value="1"/>')
    waits = event(
        "waits", speed(6, "linear", "time", 3), trigger(condition(brief, edge="risingOrFalling")), count=2
    )
    on = event("on", set_variable("n", 1), trigger(condition(at_time(2))))
    off = event("off", set_variable("n", 0), trigger(condition(at_time(3))))
    engine = Engine(load(write(act(maneuver(waits)), act(maneuver(on, off, name="m2"), name="second"))))
    engine.advance(9)
    found = next(e for e in engine.storyboard.elements if e.kind == "event" and e.path[-1] == "waits")
    assert found.executions == 1
    assert found.state == "standbyState"
