"""Suites: what is run, on which place, and what a row of results says about it."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from evaluation.results.files import ResultsError
from evaluation.results.rows import write_runs
from evaluation.runs.configuration import configuration_of, read_configuration, read_specs
from evaluation.runs.execution import RunRecord
from evaluation.runs.plan import (
    Conditions,
    CpnaSuite,
    describe_map,
    is_published,
    load_site,
    notes,
    pose_site,
    run_suite,
    scenario_specs,
    suite_configuration,
)
from scenarios.errors import ScenarioError
from scenarios.openscenario.errors import ParameterError
from scenarios.places import Place, Site, lane_at
from scenarios.spec import NO_AEB, load_named_map

PAPER_TABLE = CpnaSuite(
    (10.0, 20.0, 30.0, 40.0, 50.0, 60.0), ("rectangular", "map"), "paper", ("dry",), "urban_street"
)
ROUND_TRIPS = [
    PAPER_TABLE,
    CpnaSuite(
        (30.0, 33.3),
        ("all",),
        "physical",
        ("rain", "dry"),
        "urban_street",
        Place("1", -1, 300.0),
        25.0,
        "static",
        9,
        0.02,
    ),
]


@pytest.fixture(scope="module")
def site() -> Site:
    return load_site(PAPER_TABLE)


@pytest.fixture(scope="module")
def paper_records(site: Site) -> list[RunRecord]:
    return list(run_suite(PAPER_TABLE, site))


def of(records: list[RunRecord], strategy: str) -> list[RunRecord]:
    return [r for r in records if r.row.strategy == strategy]


def test_runs_come_by_strategy_then_speed(paper_records: list[RunRecord]) -> None:
    order = [(r.row.strategy, r.row.v_test_kmh) for r in paper_records]
    assert order == [(s, v) for s in PAPER_TABLE.strategies for v in PAPER_TABLE.speeds_kmh]
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
    suite = CpnaSuite((30.0,), ("map",), "physical", ("wet",), "urban_street", None, 75.0, "static", 3)
    (record,) = run_suite(suite, site)
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
    (record,) = run_suite(CpnaSuite((30.0,), ("map",), "paper", ("dry",), "urban_street"), site)
    assert record.row.false_activation
    assert record.row.flag_time_s == 0.0
    assert not record.row.collided


@pytest.mark.parametrize("suite", ROUND_TRIPS)
def test_configuration_is_read_back(tmp_path: Path, suite: CpnaSuite) -> None:
    site = load_site(suite)
    write_runs(tmp_path, [], suite_configuration(suite, site, tmp_path))
    stored = read_configuration(tmp_path)
    assert [run.spec for run in stored.runs] == suite.specs(site)
    assert [run.preset for run in stored.runs] == [suite.preset_in(run.spec.weather) for run in stored.runs]
    assert stored.published == is_published(suite)


def test_configuration_names_the_place_and_the_conditions(site: Site, tmp_path: Path) -> None:
    write_runs(tmp_path, [], suite_configuration(PAPER_TABLE, site, tmp_path))
    written = json.loads((tmp_path / "runs.json").read_text())["configuration"]
    assert written["site"]["line_m"] == site.line_m
    assert written["presets"]["paper dry"]["brakes"]["max_decel_mps2"] == 14.5


# ---- scenario files ----------------------------------------------------------------------------------------

BOTH = Conditions(("rectangular", "map"), weather=("dry", "snow"), seed=3, phase_s=0.02, night="camera")


def test_a_distribution_becomes_runs_by_weather_strategy_and_file() -> None:
    specs = scenario_specs("cpna", {}, BOTH)
    assert len(specs) == 2 * 2 * 22
    assert len({spec.log for spec in specs}) == len(specs)
    order = [(s.weather, s.strategy) for s in specs[::22]]
    assert order == [("dry", "rectangular"), ("dry", "map"), ("snow", "rectangular"), ("snow", "map")]
    first, last = specs[0], specs[21]
    assert (first.scenario, first.v_test_kmh) == ("cpna Impact_percent=25", 10.0)
    assert (last.scenario, last.v_test_kmh) == ("cpna Impact_percent=75", 60.0)
    assert {(s.seed, s.phase_s, s.night, s.preset, s.file) for s in specs} == {
        (3, 0.02, "camera", "physical", "crossing")
    }


def test_a_given_value_takes_the_place_of_the_distributed_ones() -> None:
    specs = scenario_specs("cpna", {"Ego_speed_kmh": "42"}, Conditions(("map",)))
    assert [(s.scenario, s.v_test_kmh) for s in specs] == [
        ("cpna Impact_percent=25", 42.0),
        ("cpna Impact_percent=75", 42.0),
    ]
    (single,) = scenario_specs("crossing", {"Ego_speed_kmh": "42"}, Conditions(("map",)))
    assert (single.scenario, single.v_test_kmh) == ("crossing", 42.0)


def test_wrong_parameters_are_refused_before_the_first_run() -> None:
    with pytest.raises(ParameterError, match="'Speed' is not declared"):
        scenario_specs("cpna", {"Speed": "42"}, Conditions(("map",)))
    with pytest.raises(ParameterError, match="Impact_percent"):
        scenario_specs("crossing", {"Impact_percent": "120"}, Conditions(("map",)))
    for wrong in ({"preset": "x"}, {"weather": ("hail",)}, {"night": "owl"}):
        with pytest.raises(ScenarioError, match="unknown"):
            Conditions(("map",), **wrong)  # type: ignore[arg-type]


def test_runs_of_files_are_read_back(tmp_path: Path) -> None:
    specs = scenario_specs("cbla", {"Ego_speed_kmh": "30"}, BOTH)
    write_runs(tmp_path, [], configuration_of(specs, tmp_path))
    assert read_specs(tmp_path) == specs


def test_maps_laid_over_a_test_track_and_the_night_are_told(ncap: Path) -> None:
    track = str(ncap / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc")
    over = "perception uses the map euro_ncap_street, laid over StraightRoad_NCAP_noRoadmarks.xodr"
    assert notes(scenario_specs(track, {}, Conditions(("map",)))) == [over]
    assert notes(scenario_specs(track, {}, Conditions((NO_AEB,)))) == []  # nobody perceives
    street = Conditions(("map",), map_name="urban_street")
    assert notes(scenario_specs(track, {}, street)) == ["perception uses the map urban_street"]
    night = str(ncap / "CA-FC_2026" / "CPNA.xosc")
    told = notes(scenario_specs(night, {"LightingConditions": "Night"}, Conditions(("map",), night="camera")))
    assert told[0] == over
    assert told[1].startswith("night range 46 m")
    junction = str(ncap / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPTA_2023.xosc")
    assert notes(scenario_specs(junction, {}, Conditions(("map",)))) == []


@pytest.fixture(scope="session")
def ncap() -> Path:
    folder = Path(__file__).parents[4] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"
    if not folder.is_dir():
        pytest.skip(f"no reference scenarios at {folder}")
    return folder


# ---- broken folders ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content", [None, "", "{}", "[]", '{"configuration": 3}', '{"configuration": {"suite": {}}}']
)
def test_broken_configuration_is_one_clear_error(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "runs.json").write_text(content)
    with pytest.raises(ResultsError, match=r"runs\.json: .* (run the test again|first)"):
        read_specs(tmp_path)


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
    values = {
        "speeds_kmh": (30.0,), "strategies": ("map",), "preset": "paper", "weather": ("dry",),
        "map_name": "urban_street",
    }  # fmt: skip
    with pytest.raises(ScenarioError, match=message):
        CpnaSuite(**{**values, **changes})  # type: ignore[arg-type]


def test_published_numbers_belong_to_the_conditions_of_the_paper() -> None:
    assert is_published(PAPER_TABLE)
    for changes in (
        {"preset": "physical"},
        {"weather": ("wet",)},
        {"impact_point_percent": 50.0},
        {"adversaries": "static"},
    ):
        values = {name: getattr(PAPER_TABLE, name) for name in CpnaSuite.__slots__}
        assert not is_published(CpnaSuite(**{**values, **changes}))


def test_a_suite_takes_the_place_that_it_names() -> None:
    network = load_named_map("urban_street")
    site = load_site(CpnaSuite((30.0,), ("map",), "paper", ("dry",), "urban_street", Place("1", 1, 300.0)))
    x, y = (float(v[0]) for v in network.center_line(lane_at(network, Place("1", 1, 300.0)), [300.0])[:2])
    assert site.route.pose(site.line_m)[:2] == pytest.approx((x, y))


def test_a_pose_to_look_at_need_not_be_straight() -> None:
    network = load_named_map("urban_bend")
    site = pose_site(network, Place("1", -1, 250.0))
    x, y = (float(v[0]) for v in network.center_line(lane_at(network, Place("1", -1, 250.0)), [250.0])[:2])
    assert math.dist(site.route.pose(site.line_m)[:2], (x, y)) < 0.05
    with pytest.raises(ScenarioError, match="sidewalk; choose a driving lane"):
        pose_site(network, Place("1", -2, 250.0))


def test_a_map_is_described() -> None:
    lines = describe_map(load_named_map("urban_intersection"), None, 50.0)
    assert lines == [
        "map: urban_intersection, 16 roads, 32 lanes: 20 driving, 12 sidewalk",
        "crosswalks: 4, warnings: 0",
    ]


@pytest.mark.parametrize(("road", "kind"), [("1", "traffic_light"), ("2", "stop"), ("4", "give_way")])
def test_the_law_ahead_is_told_with_its_distance(road: str, kind: str) -> None:
    """The stop line is 7 m before the end of the 200 m long arm."""
    network = load_named_map("urban_intersection")
    entering = 1 if road == "4" else -1
    s_m = 100.0
    lines = describe_map(network, pose_site(network, Place(road, entering, s_m)), 50.0)
    assert f"  {kind} in 93.0 m (road {road})" in lines
    assert any(line.startswith("  crosswalk in ") for line in lines)
    assert any(line.startswith("  speed_limit 50 in ") for line in lines)


def test_nothing_to_obey_is_told_too() -> None:
    network = load_named_map("urban_intersection")
    lines = describe_map(network, pose_site(network, Place("1", 1, 100.0)), 50.0)
    assert lines[-1] == "  no regulatory element within 200 m"
