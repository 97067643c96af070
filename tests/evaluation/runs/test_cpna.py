"""Suites: what is run, on which place, and what a row of results says about it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.results.rows import write_runs
from evaluation.runs.configuration import read_configuration
from evaluation.runs.cpna import CpnaSuite, is_published, load_site
from evaluation.runs.execution import RunRecord, execute
from evaluation.runs.specs import Conditions
from evaluation.studies.suite import suite_configuration
from scenarios.errors import ScenarioError
from scenarios.places import Place, Site, lane_at
from scenarios.presets import named_preset, preset_in_weather
from scenarios.spec import load_named_map
from scenarios.weather import named_weather

PAPER = Conditions(("map",), "paper", ("dry",), "urban_street")
PAPER_TABLE = CpnaSuite(
    (10.0, 20.0, 30.0, 40.0, 50.0, 60.0), replace(PAPER, strategies=("rectangular", "map"))
)
ROUND_TRIPS = [
    PAPER_TABLE,
    CpnaSuite(
        (30.0, 33.3),
        Conditions(
            ("all",), "physical", ("rain", "dry"), "urban_street", adversaries="static", seed=9, phase_s=0.02
        ),
        Place("1", -1, 300.0),
        25.0,
    ),
]


def changed(suite: CpnaSuite, changes: dict[str, object]) -> CpnaSuite:
    """A suite with other values of its own or of its conditions."""
    own = {name: value for name, value in changes.items() if name in CpnaSuite.__slots__}
    conditions = {name: value for name, value in changes.items() if name not in own}
    return replace(suite, conditions=replace(suite.conditions, **conditions), **own)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def site() -> Site:
    return load_site(PAPER_TABLE)


@pytest.fixture(scope="module")
def paper_records(site: Site) -> list[RunRecord]:
    return list(map(execute, PAPER_TABLE.specs(site)))


def of(records: list[RunRecord], strategy: str) -> list[RunRecord]:
    return [r for r in records if r.row.strategy == strategy]


def test_runs_come_by_strategy_then_speed(paper_records: list[RunRecord]) -> None:
    order = [(r.row.strategy, r.row.v_test_kmh) for r in paper_records]
    assert order == [(s, v) for s in PAPER_TABLE.conditions.strategies for v in PAPER_TABLE.speeds_kmh]
    assert [r.spec for r in paper_records] == PAPER_TABLE.specs(load_site(PAPER_TABLE))


@pytest.mark.parametrize(("strategy", "total"), [("rectangular", 9.0), ("map", 10.0)])
def test_paper_preset_scores_what_the_paper_scored(
    paper_records: list[RunRecord], strategy: str, total: float
) -> None:
    assert sum(r.row.score or 0.0 for r in of(paper_records, strategy)) == total
    assert sum(r.row.score_max or 0.0 for r in of(paper_records, strategy)) == 10.0


def test_paper_preset_hits_as_fast_as_the_paper_did(paper_records: list[RunRecord]) -> None:
    impacts = {
        (r.row.strategy, r.row.v_test_kmh): r.row.v_impact_kmh for r in paper_records if r.row.collided
    }
    assert impacts == {
        ("rectangular", 50.0): pytest.approx(23.82, abs=3.0),
        ("rectangular", 60.0): pytest.approx(44.23, abs=3.0),
    }


def test_rows_agree_with_themselves(paper_records: list[RunRecord]) -> None:
    for record in paper_records:
        row = record.row
        assert row.collided == (row.contact_time_s is not None) == (row.ego_speed_at_contact_kmh is not None)
        assert row.v_impact_kmh == (row.ego_speed_at_contact_kmh or 0.0)
        assert (row.stop_gap_m is None) == row.collided
        assert row.collided or (row.v_impact_kmh == 0.0 and row.stop_gap_m is not None and row.stop_gap_m > 0)
        assert row.target_start_time_s == pytest.approx(2.0)
        assert row.target_steady_time_s == pytest.approx(2.0)
        assert not row.false_activation
        if row.collided:
            assert row.t0_s == row.contact_time_s
            assert row.target_speed_at_contact_kmh == pytest.approx(5.0)
        assert row.log == record.spec.log
        assert f"{row.v_test_kmh:g}kmh" in row.log
    assert len({r.row.log for r in paper_records}) == len(paper_records)


def test_log_of_a_row_shows_the_stop(paper_records: list[RunRecord]) -> None:
    record = of(paper_records, "map")[-1]
    assert record.log is not None
    ego = record.log["kind"] == "ego"
    time, speed = record.log["time_s"][ego], record.log["speed_mps"][ego]
    assert record.row.t0_s is not None
    assert speed[0] * 3.6 == pytest.approx(60.0)
    assert speed[np.searchsorted(time, record.row.t0_s)] == 0.0
    assert (speed[time < record.row.t0_s - 0.05] > 0.0).all()


def test_bystanders_and_weather_reach_the_row(site: Site) -> None:
    conditions = Conditions(("map",), "physical", ("wet",), "urban_street", adversaries="static", seed=3)
    (record,) = map(execute, CpnaSuite((30.0,), conditions, None, 75.0).specs(site))
    row = record.row
    assert (row.scenario, row.preset, row.weather, row.adversaries, row.seed) == (
        "CPNA-75", "physical", "wet", "static", 3,
    )  # fmt: skip
    assert record.log is not None
    assert (record.log["label"] == "other").any()


def test_a_request_before_the_pedestrian_starts_is_a_false_stop(
    monkeypatch: pytest.MonkeyPatch, site: Site
) -> None:
    from smartmot.decision import rules

    decide = rules.decide
    monkeypatch.setattr(rules, "decide", lambda *a: (decide(*a)[0], True, ()))
    (record,) = map(execute, CpnaSuite((30.0,), PAPER).specs(site))
    assert record.row.false_activation
    assert record.row.flag_time_s == 0.0
    assert not record.row.collided


@pytest.mark.parametrize("suite", ROUND_TRIPS)
def test_configuration_is_read_back(tmp_path: Path, suite: CpnaSuite) -> None:
    site = load_site(suite)
    write_runs(tmp_path, [], suite_configuration(suite, site, tmp_path))
    stored = read_configuration(tmp_path)
    assert [run.spec for run in stored.runs] == suite.specs(site)
    for run in stored.runs:
        preset = preset_in_weather(named_preset(suite.conditions.preset), named_weather(run.spec.weather))
        sensor = replace(preset.sensor, phase_s=suite.conditions.phase_s)
        assert run.preset == replace(preset, sensor=sensor)
    assert stored.published == is_published(suite)


def test_configuration_names_the_place_and_the_conditions(site: Site, tmp_path: Path) -> None:
    write_runs(tmp_path, [], suite_configuration(PAPER_TABLE, site, tmp_path))
    written = json.loads((tmp_path / "runs.json").read_text())["configuration"]
    assert written["site"]["line_m"] == site.line_m
    assert written["presets"]["paper dry"]["brakes"]["max_decel_mps2"] == 14.5


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speeds_kmh": ()}, "nothing to run"),
        ({"strategies": ()}, "nothing to run"),
        ({"weather": ()}, "nothing to run"),
        ({"preset": "x"}, "unknown preset"),
        ({"weather": ("hail",)}, "unknown weather"),
        ({"speeds_kmh": (30.0, 500.0)}, "test speed"),
        ({"impact_point_percent": -5.0}, "impact point"),
        ({"adversaries": "x"}, "unknown adversaries"),
    ],
)
def test_wrong_suites_are_refused_before_the_first_run(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        changed(CpnaSuite((30.0,), PAPER), changes)


def test_published_numbers_belong_to_the_conditions_of_the_paper() -> None:
    assert is_published(PAPER_TABLE)
    for changes in (
        {"preset": "physical"},
        {"weather": ("wet",)},
        {"impact_point_percent": 50.0},
        {"adversaries": "static"},
    ):
        assert not is_published(changed(PAPER_TABLE, changes))


def test_a_suite_takes_the_place_that_it_names() -> None:
    network = load_named_map("urban_street")
    site = load_site(CpnaSuite((30.0,), PAPER, Place("1", 1, 300.0)))
    x, y = (float(v[0]) for v in network.center_line(lane_at(network, Place("1", 1, 300.0)), [300.0])[:2])
    assert site.route.pose(site.line_m)[:2] == pytest.approx((x, y))
