"""Runs of scenario files in their conditions, and what is told of their maps and light."""

from pathlib import Path

import pytest

from evaluation.results.files import ResultsError
from evaluation.results.rows import write_runs
from evaluation.runs.configuration import configuration_of, read_configuration
from evaluation.runs.specs import Conditions, perception_notes, scenario_specs
from scenarios.errors import ScenarioError
from scenarios.openscenario.errors import ParameterError
from scenarios.spec import NO_AEB

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
    assert [run.spec for run in read_configuration(tmp_path).runs] == specs


def test_maps_laid_over_a_test_track_and_the_night_are_told(ncap: Path) -> None:
    track = str(ncap / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc")
    over = "perception uses the map euro_ncap_street, laid over StraightRoad_NCAP_noRoadmarks.xodr"
    assert perception_notes(scenario_specs(track, {}, Conditions(("map",)))) == [over]
    assert perception_notes(scenario_specs(track, {}, Conditions((NO_AEB,)))) == []  # nobody perceives
    street = Conditions(("map",), map_name="urban_street")
    assert perception_notes(scenario_specs(track, {}, street)) == ["perception uses the map urban_street"]
    night = str(ncap / "CA-FC_2026" / "CPNA.xosc")
    told = perception_notes(
        scenario_specs(night, {"LightingConditions": "Night"}, Conditions(("map",), night="camera"))
    )
    assert told[0] == over
    assert told[1].startswith("night range 46 m")
    junction = str(ncap / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPTA_2023.xosc")
    assert perception_notes(scenario_specs(junction, {}, Conditions(("map",)))) == []


@pytest.fixture(scope="session")
def ncap() -> Path:
    folder = Path(__file__).parents[4] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"
    if not folder.is_dir():
        pytest.skip(f"no reference scenarios at {folder}")
    return folder


@pytest.mark.parametrize(
    "content", [None, "", "{}", "[]", '{"configuration": 3}', '{"configuration": {"suite": {}}}']
)
def test_broken_configuration_is_one_clear_error(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "runs.json").write_text(content)
    with pytest.raises(ResultsError, match=r"runs\.json: .* (run the test again|first)"):
        read_configuration(tmp_path)
