"""What the map gains with a LiDAR: which sides there are, what is kept of a run, and what is said of them."""

from __future__ import annotations

import csv
import gzip
from dataclasses import asdict
from pathlib import Path

import pytest

from evaluation.studies.answers.arms import arm_runs
from evaluation.studies.answers.command import ask
from evaluation.studies.answers.lidar import LidarGain
from evaluation.studies.answers.lidar.question import LADDER, Chain, lidar
from evaluation.studies.answers.lidar.runs import LidarDecision, dropped_share, place_of, stops_at
from evaluation.studies.answers.lidar.tables import chain_table
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.answers.study import Sample
from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario.reading.reader import load
from scenarios.presets import PHYSICAL
from scenarios.scenes.scenes import choose_scenes
from scenarios.simulation.simulation import Simulation
from scenarios.spec import RunSpec, simulation_of
from tests.figures import text_faults

STUDY = LidarGain(
    chains=(
        LADDER[0],
        Chain("hdl32, labels", lidar("hdl32", "labels")),
        Chain("cut", lidar("mid70", "cutout")),
    )
)


def test_every_side_can_be_run_and_has_a_name_of_its_own() -> None:
    study = LidarGain()
    for arm in study.arms:
        arm.check()
    assert len({arm.name for arm in study.arms}) == len(study.arms)
    assert {dict(arm.settings).get("sensor", "truth") for arm in study.arms} == {
        "truth", "hdl32", "hdl64", "mid70",
    }  # fmt: skip


def test_sides_are_compared_within_one_chain_and_rule() -> None:
    study = LidarGain()
    for arm, against in study.pairs:
        assert arm.strategy == MAP.strategy
        assert arm.name.split(": ")[0] == against.name.split(": ")[0]
        assert arm.rule == against.rule
    for arm, before in study.steps:
        assert arm.strategy == before.strategy
        assert dict(arm.settings).get("sensor", "hdl32") == "hdl32"
    assert len(study.steps) == len(study.areas) * (len(LADDER) - 1)


def test_each_scene_has_a_street_of_its_own_and_all_sides_the_same() -> None:
    scenes = choose_scenes(("walking along",))[:2]
    chosen = [STUDY.arm(STUDY.chains[2], area) for area in STUDY.areas]
    seeds = [dict(item.spec.settings)["street_seed"] for item in arm_runs(chosen, scenes, 0)]
    first, second = seeds[::2], seeds[1::2]
    assert len(set(first)) == len(set(second)) == 1
    assert first[0] != second[0]
    bare = arm_runs([STUDY.arm(STUDY.chains[0], PATH)], scenes, 0)
    assert "street_seed" not in dict(bare[0].spec.settings)
    (asked,) = arm_runs([chosen[0].having(("street_seed", 7.0))], scenes[:1], 0)
    assert dict(asked.spec.settings)["street_seed"] == 7.0


def with_places(results: Results) -> Results:
    """The same runs on streets, bends and junctions in turn; every tenth detection has too low a score."""
    places = ("straight", "bend", "junction")
    runs = {
        arm: tuple(
            LidarDecision(**asdict(run), place=places[k % 3], detections=100, dropped_score=10)
            for k, run in enumerate(decisions)
        )
        for arm, decisions in results.runs.items()
    }
    return Results(results.scenes, runs)


def test_texts_of_figures_keep_off_each_other(make) -> None:
    for study in (STUDY, LidarGain()):
        results = with_places(make(study.arms, 30, lambda arm: (0.8, 0.2)))
        drawn = study.answer(results).figures
        assert set(drawn) == {"gain", "chains"}
        for figure in drawn.values():
            assert text_faults(figure) == []
            texts = " ".join(text.get_text() for text in figure.texts)
            assert "upper bound" in texts


def test_the_answer_says_what_the_map_gains_with_each_chain_and_what_a_step_costs(make) -> None:
    """All avoid 0.8; the map stops in 3 of 30 scenes, the others in 9; with labels in 6 and 12."""

    def rates(arm) -> tuple[float, float]:
        stops = 0.1 if arm.strategy == "map" else 0.3
        return 0.8, stops + (0.1 if arm.name.startswith("hdl32, labels") else 0.0)

    answer = STUDY.answer(with_places(make(STUDY.arms, 30, rates)))
    first = next(line for line in answer.sentences if line.startswith("truth: map against truth: path"))
    assert "unnecessary stops -20.0 [" in first
    assert "Avoided less stopped: +20.0 [" in first
    step = next(line for line in answer.sentences if line.startswith("Step from truth: map"))
    assert "to hdl32, labels: map: collisions avoided 0.0" in step
    assert "unnecessary stops +10.0 [" in step
    assert "upper bound" in answer.markdown().decode()


def test_detections_that_the_tracker_drops_are_said(make) -> None:
    results = with_places(make(STUDY.arms, 30, lambda arm: (0.8, 0.2)))
    assert dropped_share(results.runs[STUDY.arms[0]]) == (6000, 600)
    table = chain_table(results, STUDY.groups)
    column = table.header.index("dropped for their score (%)")
    assert {row[column] for row in table.rows} == {"10.0"}


def test_stops_are_counted_by_place(make) -> None:
    results = with_places(make(STUDY.arms, 30, lambda arm: (0.8, 0.2)))
    rates = [stops_at(results, STUDY.arms[0], place) for place in ("straight", "bend", "junction")]
    assert [rate.count for rate in rates] == [10, 10, 10]
    assert sum(rate.value * rate.count for rate in rates) == pytest.approx(6.0)


def test_where_the_unbraked_ego_drives() -> None:
    crossing = Simulation(load(shipped_scenario("crossing"), {}), PHYSICAL, None)
    assert place_of(crossing) == "straight"
    for scene, place in (("crosses in a bend", "bend"), ("crosses after a turn", "junction")):
        run = choose_scenes((scene,))[0]
        spec = RunSpec(run.name, run.file, run.parameters, "none", "physical", "dry", run.speed_kmh)
        assert place_of(simulation_of(spec)) == place


def test_a_small_study_goes_through_and_keeps_a_line_per_run(tmp_path: Path) -> None:
    chain = Chain("labels", lidar("mid70", "labels"))
    study = LidarGain(Sample(count=1), (), chains=(chain,), areas=(PATH, MAP))
    ask(study, tmp_path, quiet=True)
    lines = gzip.decompress((tmp_path / "lidar" / "runs.csv.gz").read_bytes()).decode().splitlines()
    rows = list(csv.DictReader(lines))
    assert len(rows) == 2 * len(study.arms)
    assert all(int(row["detections"]) > 0 for row in rows)
    assert {row["place"] for row in rows} <= {"straight", "bend", "junction"}
    page = (tmp_path / "lidar" / "answer.md").read_text()
    assert "Sensors: mid70 10 frames per second, 70 m." in page
