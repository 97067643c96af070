"""Initial actions take place at the same instant, whatever their order in the file."""

import random
import time
from itertools import permutations
from pathlib import Path

import pytest

from scenarios.openscenario import Engine, RunError, load
from scenarios.openscenario.running.initial import _before, in_order
from tests.scenarios.openscenario.conftest import at, lane_position, private, speed, teleport, write_scenario
from tests.scenarios.openscenario.running.test_actions import distance

FILES = Path(__file__).parents[3] / "data" / "field" / "openscenario"


def test_a_place_may_refer_to_an_entity_further_down():
    """Ego 30 m behind B, which the file places after it; an event gives it 5 m/s at once."""
    run = Engine(load(FILES / "init_order.xosc")).run(4.0)
    assert at(run, "Ego", 0)[:2] == pytest.approx((70.0, at(run, "B", 0)[1]))
    assert at(run, "Ego", 1)[0] == pytest.approx(75.0)


EGO = teleport(lane_position(10)), speed(10)
FACTOR = '<RelativeTargetSpeed entityRef="Ego" value="0.5" speedTargetValueType="factor" continuous="false"/>'
HALF_AS_FAST = speed(0).replace('<AbsoluteTargetSpeed value="0"/>', FACTOR)


def test_every_order_gives_the_same_start(play):
    """Other is at 26 m: the ego's 10 m, its front overhang 3.5, free 12, the own rear overhang 0.5 m."""
    starts = set()
    for ego in permutations(EGO):
        own = (teleport(lane_position(60)), distance(12))
        parts = private("Ego", *ego), private("Other", *own)
        for init in (parts[0] + parts[1], parts[1] + parts[0]):
            _, run = play(init=init)
            starts.add((at(run, "Other", 0), at(run, "Ego", 0)))
    assert len(starts) == 1
    [(other, ego_start)] = starts
    assert (other[0], ego_start[0], other[3]) == pytest.approx((26.0, 10.0, 10.0))


def test_a_relative_speed_is_that_of_the_other_s_initial_speed(play):
    other = private("Other", HALF_AS_FAST, teleport(lane_position(60)))
    for init in (private("Ego", *EGO) + other, other + private("Ego", *EGO)):
        _, run = play(init=init)
        assert at(run, "Other", 1)[3] == 5.0
        assert at(run, "Other", 1)[0] == pytest.approx(65.0)


def test_a_speed_given_later_in_the_file_wins(play):
    init = private("Ego", speed(3), teleport(lane_position(10)), speed(10))
    _, run = play(init=init + private("Other", teleport(lane_position(60))))
    assert at(run, "Ego", 1)[3] == 10.0


def test_places_that_refer_to_one_another_are_refused(play):
    def beside(name):
        return teleport(f'<Position><RelativeObjectPosition entityRef="{name}" dx="1" dy="1"/></Position>')

    with pytest.raises(RunError, match="refers to 'Other' before that has one"):
        play(init=private("Ego", beside("Other"), speed(10)) + private("Other", beside("Ego")))


@pytest.fixture
def kinds(tmp_path):
    """Initial actions that refer to the other entity in several ways, and some that do not."""
    beside = teleport('<Position><RelativeObjectPosition entityRef="Ego" dx="1" dy="1"/></Position>')
    init = private("Ego", *EGO) + private("Other", beside, HALF_AS_FAST, distance(12))
    return [action for _, action in load(write_scenario(tmp_path, init=init)).init]


@pytest.mark.parametrize("seed", range(40))
def test_each_is_carried_out_as_soon_as_what_it_depends_on_is(kinds, seed):
    """The next is the first of the file that waits for none; of a circle the first of the file."""
    rng = random.Random(seed)
    init = [(rng.choice("ABC"), rng.choice(kinds)) for _ in range(rng.randrange(1, 30))]
    init += [("Ego", rng.choice(kinds)) for _ in range(rng.randrange(4))]
    rng.shuffle(init)
    before, waiting, expected = _before(init), list(range(len(init))), []
    while waiting:
        number = next((k for k in waiting if not before[k].intersection(waiting)), waiting[0])
        waiting.remove(number)
        expected.append(number)
    numbers = {id(item): number for number, item in enumerate(init)}
    assert [numbers[id(item)] for item in in_order(init)] == expected


def test_the_order_of_many_takes_a_moment(kinds):
    """Two thousand actions; looking at each pair took some 20 s."""
    init = [(str(k % 1000), random.Random(k).choice(kinds)) for k in range(2000)]
    begin = time.process_time()
    assert len(in_order(init)) == 2000
    assert time.process_time() - begin < 4.0
