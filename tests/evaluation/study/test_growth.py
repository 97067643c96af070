"""Growth: others who keep out of the way."""

import numpy as np
import pytest

from evaluation.study.growth import COUNTS, SPEED_KMH, grow, growth_table, with_others
from scenarios.library import shipped_scenario
from scenarios.openscenario import Engine, load
from scenarios.presets import PHYSICAL


@pytest.mark.parametrize("seed", [0, 1])
def test_the_ego_meets_the_pedestrian_and_none_of_the_others(seed: int) -> None:
    alone = load(shipped_scenario("crossing"), {"Ego_speed_kmh": SPEED_KMH})
    crowd = with_others(alone, max(COUNTS), seed)
    assert len(crowd.entities) == len(alone.entities) + max(COUNTS)
    first, second = Engine(alone).run(), Engine(crowd).run()
    assert second.contact_entity == "Target"
    assert second.contact_time_s == pytest.approx(first.contact_time_s, abs=1e-8)


def test_others_make_tracks_for_all_but_hardly_for_the_map() -> None:
    runs = [grow(strategy, 25, 0, PHYSICAL) for strategy in ("map", "all")]
    few, many = (run.tracks_mean for run in runs)
    assert 0 < few < many
    assert all(run.spent.frames > 0 and run.spent.median_ms > 0 for run in runs)
    table = growth_table(runs)
    assert np.shape(table.rows) == (1, 11)
