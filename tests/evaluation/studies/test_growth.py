"""Growth: others who keep out of the way."""

import json
from pathlib import Path

import numpy as np
import pytest

from evaluation.studies.growth import (
    COUNTS,
    SPEED_KMH,
    GrowthStudy,
    grow,
    growth_table,
    with_others,
)
from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario import Engine, load


@pytest.mark.parametrize("seed", [0, 1])
def test_the_ego_meets_the_pedestrian_and_none_of_the_others(seed: int) -> None:
    alone = load(shipped_scenario("crossing"), {"Ego_speed_kmh": SPEED_KMH})
    crowd = with_others(alone, max(COUNTS), seed)
    assert len(crowd.entities) == len(alone.entities) + max(COUNTS)
    first, second = Engine(alone).run(), Engine(crowd).run()
    assert second.contact_entity == "Target"
    assert second.contact_time_s == pytest.approx(first.contact_time_s, abs=1e-8)


def test_others_make_tracks_for_all_but_hardly_for_the_map() -> None:
    tasks = GrowthStudy(("map", "all"), "physical", "dry", seeds=1, counts=(25,)).items(Path())
    runs, spent = zip(*map(grow, tasks), strict=True)
    few, many = (run.tracks_mean for run in runs)
    assert 0 < few < many
    assert all(time.frames > 0 and time.median_ms > 0 for time in spent)
    table = growth_table(runs, spent)
    assert np.shape(table.rows) == (1, 11)


def test_the_configuration_has_the_schema_of_all_commands(tmp_path: Path) -> None:
    study = GrowthStudy(("map",), "physical", "rain", seeds=2, counts=(0, 10), formats=())
    items = study.items(tmp_path)[:1]
    study.write(tmp_path, items, {item.key: study.job(item) for item in items})
    content = json.loads((tmp_path / "growth.json").read_text())
    configuration = content["configuration"]
    assert (content["schema"], configuration["others"], configuration["min_visible"]) == (2, [0], 0.0)
    (spec,) = configuration["specs"]
    # each file of the run has its hash, and its preset is there in the rain
    assert spec["files"]
    assert set(spec["files"]) <= set(configuration["files"])
    assert spec["resolved_preset"] in configuration["presets"]
    assert spec["weather"] == "rain"
