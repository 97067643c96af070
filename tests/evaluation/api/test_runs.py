"""Runs and results by `import smartmot`: the same as by the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import smartmot
from evaluation.cli import main
from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.runs.configuration import read_configuration
from scenarios.catalogue.maps import shipped_map

SPEEDS_KMH = (40, 50)


@pytest.fixture(scope="module")
def swept() -> smartmot.Results:
    return smartmot.sweep("cpna", speed_kmh=SPEEDS_KMH, workers=1)


def command(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["smartmot-eval", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def test_a_sweep_has_the_rows_of_the_command(
    swept: smartmot.Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "cpna"
    assert command(monkeypatch, "cpna", "--speeds", "40,50", "--no-pictures", "-q", "--out", out) == 0
    assert (swept.folder / "runs.csv").read_bytes() == (out / "runs.csv").read_bytes()
    assert (swept.folder / "table.md").read_bytes() == (out / "table.md").read_bytes()
    pd.testing.assert_frame_equal(swept.frame(), smartmot.load_results(out).frame())
    for log in swept.logs:
        assert (swept.folder / f"logs/{log}.parquet").read_bytes() == (
            out / f"logs/{log}.parquet"
        ).read_bytes()


def test_a_run_is_a_row_of_the_sweep(swept: smartmot.Results) -> None:
    single = smartmot.run("cpna", speed_kmh=50, strategy="rectangular")
    row = swept.frame().set_index("log").loc[single.spec.log]
    values = single.to_dict()["row"]
    for name in row.index:
        assert values[name] == row[name] or (values[name] is None and pd.isna(row[name])), name
    pd.testing.assert_frame_equal(single.frame(), swept.log(single.spec.log))
    assert single.outcome.contact is not None
    # the contact is at the speed that is left after braking over the distance from the flag
    assert single.outcome.impact_speed_mps * 3.6 == pytest.approx(values["v_impact_kmh"])


def test_a_scenario_has_the_rows_of_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "run"
    words = ("run", "cpfa", "--param", "Ego_speed_kmh=40", "--hold-speed", "--weather", "dry,rain")
    assert command(monkeypatch, *words, "--workers", "1", "--no-pictures", "-q", "--out", out) == 0
    given: dict[str, Any] = {"weather": ("dry", "rain"), "hold_speed": True, "workers": 1}
    results = smartmot.sweep("cpfa", speed_kmh=40, **given)
    assert (results.folder / "runs.csv").read_bytes() == (out / "runs.csv").read_bytes()
    single = smartmot.run("cpfa", speed_kmh=40, strategy="map", weather="rain", hold_speed=True)
    rows = results.frame()
    row = rows[(rows["strategy"] == "map") & (rows["weather"] == "rain")].iloc[0]
    assert single.row.flag_time_s == row["flag_time_s"]


def test_several_speeds_come_by_strategy_and_then_speed() -> None:
    rows = smartmot.sweep("cpfa", speed_kmh=(30, 20), strategy=("map", "all"), workers=1).frame()
    assert rows["strategy"].tolist() == ["map", "map", "all", "all"]
    assert rows["v_test_kmh"].tolist() == [30, 20, 30, 20]


def test_results_are_text_plain_values_page_and_film(swept: smartmot.Results, tmp_path: Path) -> None:
    assert "CPNA, preset paper" in repr(swept)
    assert "placed at --at 1,1,150.0" in swept.text
    rows = swept.to_dict()["rows"]
    assert json.loads(json.dumps(rows)) == rows
    assert rows[0]["strategy"] == "rectangular"
    assert rows[0]["stop_gap_m"] is not None
    page = swept.report(tmp_path / "page.html")
    assert "CPNA" in page.read_text("utf-8")
    with pytest.raises(ArgumentError, match="report: name a file"):
        swept.report()
    with pytest.raises(ArgumentError, match=r"no table 'cells'; it has: runs"):
        swept.frame("cells")
    with pytest.raises(ArgumentError, match=r"no log 'CPNA_map'.* it has 4 logs"):
        swept.replay("CPNA_map", tmp_path / "film.gif")


def test_a_run_is_saved_shown_and_filmed(tmp_path: Path) -> None:
    single = smartmot.run("crossing", speed_kmh=20, parameters={"Target_entry": "child"})
    saved = single.save(tmp_path / "kept")
    pd.testing.assert_frame_equal(saved.log(saved.logs[0]), single.frame())
    assert len(saved.frame()) == 1
    assert saved.report() == tmp_path / "kept/report.html"
    film = single.replay(tmp_path / "film.gif")
    assert film.read_bytes().startswith(b"GIF89a")
    with pytest.raises(ArgumentError, match="holds something already"):
        single.save(tmp_path / "kept")
    assert json.loads(json.dumps(single.to_dict())) == single.to_dict()


def test_saved_results_find_the_files_of_the_user_again(tmp_path: Path) -> None:
    """Names of files are relative to the folder of results, which moves."""
    town = tmp_path / "town.xodr"
    town.write_bytes(shipped_map("urban_street").read_bytes())
    results = smartmot.sweep("cpna", speed_kmh=40, strategy="map", map_name=town, workers=1)
    saved = results.save(tmp_path / "deep/kept")
    stored = read_configuration(saved.folder)
    assert [run.spec.map_name for run in stored.runs] == [str(town)]
    assert town in (stored.runs[0].files or {})
    assert "lanes and monitored areas are not drawn" not in saved.report().read_text("utf-8").lower()


def test_what_happened_is_said_in_a_line() -> None:
    unbraked = smartmot.run("cpna", speed_kmh=40, strategy="none")
    assert unbraked.outcome.contact is not None
    assert unbraked.outcome.impact_speed_mps == pytest.approx(40 / 3.6)
    assert "contact with Target at 40.0 km/h" in repr(unbraked)
    assert "no emergency request" in repr(unbraked.outcome)
    values = unbraked.outcome.to_dict()
    assert values["contact"]["entity"] == "Target"
    assert values["end_reason"] == "contact"
    assert "log" not in values


def test_a_protocol_has_runs_and_cells(tmp_path: Path) -> None:
    yard = Path(__file__).parents[3] / "docs/examples/yard.toml"
    results = smartmot.ncap(yard, strategy="map", workers=1)
    assert set(results.tables) >= {"runs", "cells"}
    assert len(results.frame()) >= len(results.frame("cells")) > 0


def test_a_comparison_has_its_tables() -> None:
    results = smartmot.compare(
        "map", vary={"margin_m": (0, 1)}, scenes="walking along", seeds=1, workers=1, settings={"range_m": 50}
    )
    table = results.frame("table")
    assert len(table) == 2
    assert results.frame()["scene"].unique().tolist() == ["walking along"]
    assert "1 seed" in results.text


def test_folders_without_results_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no such folder"):
        smartmot.load_results(tmp_path / "nowhere")
    with pytest.raises(ResultsError, match=r"runs\.csv: no such file"):
        smartmot.load_results(tmp_path)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: smartmot.run("cpna"), "speed_kmh: cpna is a test at several speeds"),
        (lambda: smartmot.run("cpfaa"), r"no file 'cpfaa' \(did you mean 'cpfa'\?\)"),
        (lambda: smartmot.run("cpfa"), "cpfa: 11 runs .* choose one by speed_kmh"),
        (lambda: smartmot.run("cpfa", speed_kmh=40, at="1,1,2"), "at: places the line of cpna"),
        (lambda: smartmot.run("cpna", speed_kmh=40, at="1,1"), "at: expected ROAD,LANE,S"),
        (lambda: smartmot.run("cpfa", speed_kmh=4, adversaries="static"), "adversaries: stand beside"),
        (lambda: smartmot.run("cpna", speed_kmh=40, parameters={"Lead_s": 1}), "cpna takes Impact_percent"),
        (
            lambda: smartmot.run("cpfa", speed_kmh=40, parameters={"Ego_speed_kmh": 30}),
            "parameters has Ego_speed_kmh as well",
        ),
        (lambda: smartmot.run("cpna", speed_kmh=40, strategy="mpa"), r"'mpa' \(did you mean 'map'\?\)"),
        (lambda: smartmot.run("cpna", speed_kmh=40, preset="phisical"), r"did you mean 'physical'"),
        (lambda: smartmot.run("cpna", speed_kmh=40, weather="rian"), r"weather: unknown 'rian' .*'rain'"),
        (lambda: smartmot.run("cpna", speed_kmh=40, tracker="centrepoint"), "did you mean 'centerpoint'"),
        (lambda: smartmot.run("cpna", speed_kmh=40, rule="rrs"), r"rule: unknown 'rrs' .*'rss'"),
        (lambda: smartmot.run("cpna", speed_kmh=40, perception="plain"), "perception: for a LiDAR"),
        (lambda: smartmot.run("cpna", speed_kmh=40, settings={"margin": 1}), "did you mean 'margin_m'"),
        (lambda: smartmot.sweep("cpna", workers=0), "workers: at least 1, got 0"),
        (lambda: smartmot.ncap("2032"), r"protocol: unknown '2032' .*'2023'"),
        (lambda: smartmot.compare(scenes="walking allong"), "did you mean 'walking along'"),
        (lambda: smartmot.load_map("urban_steet"), r"did you mean 'urban_street'"),
        (lambda: smartmot.scenarios("crosing"), r"did you mean 'crossing'"),
        (lambda: smartmot.drive("nowhere", detections="label"), r"did you mean 'labels'"),
    ],
)
def test_mistakes_are_named_with_what_was_perhaps_meant(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
