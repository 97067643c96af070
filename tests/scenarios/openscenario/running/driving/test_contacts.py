"""Cost of a step by counting, and contacts that wait against contacts that are all looked at."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.openscenario_actors import write_road, write_scenario
from scenarios.openscenario import Engine, load
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.driving.contacts import Contacts
from scenarios.openscenario.running.world import Instant

STEPS = 20


def started(folder, kind, count, spacing_m=20.0):
    road, path = folder / "road.xodr", folder / f"{kind}_{count}.xosc"
    write_road(road, 700.0)
    write_scenario(path, road, kind, count, spacing_m)
    return Engine(load(path), ego="car0")


def calls_per_entity(monkeypatch, folder, kind, count):
    """How often states and gaps are worked out per entity and step."""
    engine = started(folder, kind, count)
    calls = Counter()
    with monkeypatch.context() as patched:
        for owner, name in ((Actor, "state"), (Instant, "circle_gap_m")):
            original = getattr(owner, name)

            def counted(*args, original=original, name=name):
                calls[name] += 1
                return original(*args)

            patched.setattr(owner, name, counted)
        for _ in range(STEPS):
            engine.advance()
    return calls["state"] / (STEPS * count), calls["circle_gap_m"] / (STEPS * count)


@pytest.mark.parametrize(("kind", "most"), [("speed", 1.1), ("distance", 1.5), ("driver", 1.5)])
def test_a_step_costs_the_same_per_entity_however_many_there_are(monkeypatch, tmp_path, kind, most):
    """Everybody's state is worked out once a step; who cannot meet the ego is not asked for its distance."""
    few, _ = calls_per_entity(monkeypatch, tmp_path, kind, 20)
    many, gaps = calls_per_entity(monkeypatch, tmp_path, kind, 80)
    assert many <= 1.02 * few
    assert many <= most
    assert gaps < 0.3


@settings(max_examples=12, deadline=None)
@given(kind=st.sampled_from(["speed", "distance", "driver"]), spacing_m=st.floats(4.6, 7.0))
def test_contacts_that_wait_are_those_that_are_looked_at_all_the_time(tmp_path_factory, kind, spacing_m):
    folder = tmp_path_factory.mktemp("law")

    def contact():
        return started(folder, kind, 12, spacing_m).run(5.0).contact_time_s

    waiting = contact()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Contacts, "may_change", lambda self, now, until_s: self._watches)
        assert contact() == waiting
