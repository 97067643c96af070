"""Selections of entities: their members act, trigger and are placed as if they were named one by one."""

import pytest

from scenarios.openscenario import ContentError, Engine, load
from tests.scenarios.openscenario.conftest import (
    WALKER,
    act,
    at,
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


@pytest.fixture
def selecting(write):
    def make(*selections, acts=(), **parts):
        path = write(*acts, **parts)
        text = path.read_text(encoding="utf-8")
        inner = "".join(
            f'<EntitySelection name="{name}"><Members>{members}</Members></EntitySelection>'
            for name, members in selections
        )
        path.write_text(text.replace("</Entities>", f"{inner}</Entities>"), encoding="utf-8")
        return path

    return make


BOTH = ("both", '<EntityRef entityRef="Ego"/><EntityRef entityRef="Other"/>')
INIT = private("Ego", teleport(lane_position(10))) + private("Other", teleport(lane_position(60)))


def test_members_are_actors_and_are_started(selecting):
    """All at 4 m/s from the start; when the ego has driven 8 m (2 s), all at 6 m/s."""
    travelled = trigger(condition(by_entity('<TraveledDistanceCondition value="8"/>', "both", rule="all")))
    faster = act(maneuver(event("faster", speed(6), travelled)), actors="both")
    init = INIT + private("both", speed(4))
    run = Engine(load(selecting(BOTH, acts=[faster], init=init))).run(4.0)
    assert at(run, "Ego", 4.0)[0] == pytest.approx(10 + 8 + 12)
    assert at(run, "Other", 4.0)[0] == pytest.approx(60 + 8 + 12)


@pytest.mark.parametrize(
    ("members", "moved"),
    [
        ('<ByType objectType="vehicle"/>', ["Ego"]),
        ('<ByType objectType="pedestrian"/>', ["Other"]),
        ('<ByType objectType="vehicle"/><ByType objectType="pedestrian"/>', ["Ego", "Other"]),
        ('<ByType objectType="miscellaneous"/>', []),
    ],
)
def test_members_by_type(selecting, members, moved):
    path = selecting(("some", members), other=WALKER, init=INIT + private("some", speed(2)))
    run = Engine(load(path)).run(1.0)
    assert [name for name in ("Ego", "Other") if at(run, name, 1.0)[3] == 2.0] == moved


@pytest.mark.parametrize(
    ("selections", "message"),
    [
        ([("Ego", BOTH[1])], "name: 'Ego' is there already"),
        ([BOTH, BOTH], "name: 'both' is there already"),
        ([("some", '<EntityRef entityRef="Ghost"/>')], "no entity 'Ghost'; entities: Ego, Other"),
        ([("some", "")], "<Members> needs at least one EntityRef ByType"),
    ],
)
def test_wrong_selections(selecting, selections, message):
    with pytest.raises(ContentError, match=message):
        load(selecting(*selections))


def test_one_entity_is_meant_where_one_is_needed(selecting):
    follow = act(
        maneuver(event("e", teleport('<Position><RelativeObjectPosition entityRef="both"/></Position>')))
    )
    with pytest.raises(ContentError, match="no entity 'both'; entities: Ego, Other"):
        load(selecting(BOTH, acts=[follow]))
