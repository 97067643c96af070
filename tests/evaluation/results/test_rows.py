"""Result files: round trips, equal bytes for equal runs, clear errors; and the comparison table."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from dataclasses import dataclass, fields, replace
from enum import Enum
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest

from evaluation.results.by_speed import comparison_table, impact_table
from evaluation.results.files import ResultsError, log_path
from evaluation.results.logs import LOG_COLUMNS, read_log, read_logs, write_log
from evaluation.results.notes import told_notes, told_runs
from evaluation.results.rows import RUN_COLUMNS, SINCE_0_2, RunRow, avoided, read_runs, write_runs
from evaluation.results.seal import check_seal
from evaluation.results.tables import Table, markdown_table, rich_table
from scenarios.reading import ReadError

DOCUMENTED_RUNS = (
    "scenario,strategy,preset,weather,adversaries,seed,v_test_kmh,v_impact_kmh,collided,score,score_max,"
    "flag_time_s,flag_distance_m,stop_gap_m,contact_time_s,t0_s,end_reason,end_time_s,false_activation,"
    "detections,dropped_score,dropped_category,dropped_box,target_start_time_s,"
    "target_steady_time_s,ego_speed_at_contact_kmh,target_speed_at_contact_kmh,impact_location_percent,log"
)
DOCUMENTED_LOG = (
    "time_s,kind,id,category,label,x_m,y_m,yaw_rad,length_m,width_m,speed_mps,accel_mps2,horizon_s"
)
STOPPED = RunRow(
    scenario="cpna",
    strategy="map",
    preset="paper",
    weather="clear",
    adversaries="none",
    seed=1,
    v_test_kmh=50.0,
    v_impact_kmh=0.0,
    collided=False,
    score=2.0,
    score_max=2.0,
    flag_time_s=0.1 + 0.2,
    flag_distance_m=17.25,
    stop_gap_m=1.5,
    contact_time_s=None,
    t0_s=4.25,
    end_reason="stopped",
    end_time_s=6.5,
    false_activation=False,
    detections=120,
    dropped_score=0,
    dropped_category=0,
    dropped_box=0,
    target_start_time_s=2.0,
    target_steady_time_s=None,
    ego_speed_at_contact_kmh=None,
    target_speed_at_contact_kmh=None,
    impact_location_percent=None,
    log="cpna-map-50",
)
HIT = replace(
    STOPPED,
    strategy="rectangular",
    v_impact_kmh=23.0,
    collided=True,
    score=0.0,
    stop_gap_m=None,
    contact_time_s=4.1,
    t0_s=4.1,
    end_reason="contact",
    end_time_s=4.1,
    target_steady_time_s=2.5,
    ego_speed_at_contact_kmh=23.0,
    target_speed_at_contact_kmh=5.0,
    impact_location_percent=48.3,
    log=None,
)
PUBLISHED: dict[str, dict[float, tuple[float, float | None]]] = {
    "rectangular": {50.0: (23.82, 2.0), 60.0: (44.23, 0.0)},
    "map": {50.0: (0.0, 2.0), 70.0: (0.0, None)},
}


def runs_of(*rows: RunRow) -> pd.DataFrame:
    values = [[getattr(row, field.name) for field in fields(RunRow)] for row in rows]
    return pd.DataFrame(values, columns=list(RUN_COLUMNS))


def some_log(count: int = 3) -> dict[str, np.ndarray[Any, Any]]:
    table: dict[str, np.ndarray[Any, Any]] = {name: np.arange(count) / 7.0 for name in LOG_COLUMNS}
    table["kind"] = np.array(["ego", "track", "event"][:count])
    table["category"] = np.array(["", "pedestrian", "start"][:count])
    table["label"] = np.array([None, "threat", "run_start"][:count], dtype=object)
    table["id"] = np.array([np.nan, 7.0, np.nan][:count])
    table["horizon_s"] = np.full(count, np.nan)
    return table


def test_columns_are_those_of_the_documentation() -> None:
    assert ",".join(RUN_COLUMNS) == DOCUMENTED_RUNS
    assert ",".join(LOG_COLUMNS) == DOCUMENTED_LOG
    document = (Path(__file__).parents[3] / "docs" / "run-log.md").read_text()
    assert ", ".join(RUN_COLUMNS) in " ".join(document.split())


def test_runs_come_back_as_they_were_written(tmp_path: Path) -> None:
    write_runs(tmp_path / "new" / "folder", [STOPPED, HIT], {})
    runs = read_runs(tmp_path / "new" / "folder")
    assert list(runs.columns) == list(RUN_COLUMNS)
    back = [
        RunRow(**{str(k): None if pd.isna(v) else v for k, v in row.items()})
        for row in runs.to_dict("records")
    ]
    assert back == [STOPPED, HIT]
    assert runs["collided"].dtype == bool
    assert runs["seed"].dtype == np.int64


def test_a_weather_called_none_stays_a_text(tmp_path: Path) -> None:
    write_runs(tmp_path, [replace(STOPPED, weather="None", log="NA")], {})
    runs = read_runs(tmp_path)
    assert (runs["weather"][0], runs["log"][0]) == ("None", "NA")


def test_no_runs_are_a_table_too(tmp_path: Path) -> None:
    write_runs(tmp_path, [], {})
    assert read_runs(tmp_path).empty


def test_numpy_values_and_nan_are_written_like_plain_ones(tmp_path: Path) -> None:
    odd = replace(
        HIT, v_impact_kmh=np.float64(23.0), collided=np.bool_(True), seed=np.int64(1), stop_gap_m=float("nan")
    )
    write_runs(tmp_path / "a", [HIT], {})
    write_runs(tmp_path / "b", [odd], {})
    for name in ("runs.csv", "runs.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_equal_runs_give_equal_bytes_in_another_process_and_folder(tmp_path: Path) -> None:
    code = (
        "import importlib.util, sys; from pathlib import Path\n"
        "spec = importlib.util.spec_from_file_location('here', sys.argv[1])\n"
        "here = importlib.util.module_from_spec(spec); sys.modules['here'] = here\n"
        "spec.loader.exec_module(here); here.write_everything(Path(sys.argv[2]))\n"
    )
    write_everything(tmp_path / "one")
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    subprocess.run([sys.executable, "-c", code, __file__, str(tmp_path / "two")], check=True, env=environment)
    for name in ("runs.csv", "runs.json", "logs/cpna-map-50.parquet"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
        assert str(tmp_path).encode() not in (tmp_path / "one" / name).read_bytes()


def write_everything(directory: Path) -> None:
    write_runs(directory, [STOPPED, HIT], {"weathers": {"rain", "clear", "fog"}, "reach_m": 22.2})
    write_log(log_path(directory, "cpna-map-50"), some_log())


def test_configuration_is_written_with_version_and_runs(tmp_path: Path) -> None:
    class Level(Enum):
        EMERGENCY = 2

    @dataclass(frozen=True)
    class Brakes:
        delay_s: float
        level: Level

    configuration = {
        "brakes": Brakes(0.2, Level.EMERGENCY),
        "reach_m": np.array([12.0, 22.2]),
        "map": Path("maps") / "a.xodr",
        "weathers": frozenset({"rain", "clear"}),
    }
    write_runs(tmp_path, [STOPPED], configuration)
    text = (tmp_path / "runs.json").read_text(encoding="utf-8")
    content = json.loads(text)
    assert content["configuration"] == {
        "brakes": {"delay_s": 0.2, "level": "EMERGENCY"},
        "reach_m": [12.0, 22.2],
        "map": "maps/a.xodr",
        "weathers": ["clear", "rain"],
    }
    assert content["runs"][0]["flag_time_s"] == 0.1 + 0.2
    assert content["runs"][0]["contact_time_s"] is None
    assert content["version"]
    assert text == json.dumps(content, sort_keys=True, indent=2) + "\n"


@pytest.mark.parametrize("value", [object(), float("nan")])
def test_configuration_that_json_cannot_hold_is_refused(tmp_path: Path, value: object) -> None:
    with pytest.raises(ResultsError, match="configuration of the runs"):
        write_runs(tmp_path, [], {"value": value})
    assert not list(tmp_path.iterdir())


def test_logs_come_back_as_they_were_written(tmp_path: Path) -> None:
    path = log_path(tmp_path, "a run")
    assert path == tmp_path / "logs" / "a run.parquet"
    write_log(path, some_log())
    log = read_log(path)
    assert list(log.columns) == list(LOG_COLUMNS)
    assert list(log["kind"]) == ["ego", "track", "event"]
    assert log["category"].isna().tolist() == [True, False, False]
    assert log["label"].isna().tolist() == [True, False, False]
    assert log["id"].tolist()[1] == 7
    assert log["horizon_s"].isna().all()
    assert np.array_equal(log["x_m"], np.arange(3) / 7.0)


def test_an_empty_log_keeps_its_columns(tmp_path: Path) -> None:
    write_log(tmp_path / "empty.parquet", {name: np.zeros(0) for name in LOG_COLUMNS})
    log = read_log(tmp_path / "empty.parquet")
    assert list(log.columns) == list(LOG_COLUMNS)
    assert log.empty


def test_logs_named_by_the_runs_are_read(tmp_path: Path) -> None:
    write_everything(tmp_path)
    assert list(read_logs(tmp_path, read_runs(tmp_path))) == ["cpna-map-50"]


def test_missing_folder_and_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"nowhere: no such folder; give the folder"):
        read_runs(tmp_path / "nowhere")
    with pytest.raises(ResultsError, match=r"runs\.csv: no such file; run the evaluation"):
        read_runs(tmp_path)
    with pytest.raises(ResultsError, match=r"a\.parquet: no such file"):
        read_log(tmp_path / "a.parquet")


@pytest.mark.parametrize("reason", ["exploded", "STOPPED", " stopped"])
def test_an_end_that_is_not_known_does_not_count_as_avoided(tmp_path: Path, reason: str) -> None:
    write_runs(tmp_path, [replace(STOPPED, end_reason=reason)], {})
    with pytest.raises(ResultsError, match=rf"runs\.csv: .* \(column 'end_reason': unknown: '{reason}'\)"):
        read_runs(tmp_path)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "not a readable table"),
        (b"scenario,strategy\ncpna,map\n", "columns missing: preset, weather"),
        (b"\xff\xfe\x00broken", "not a readable table"),
        (f"{DOCUMENTED_RUNS}\ncpna,map,paper\n".encode(), "not a readable table"),
        (
            f"{DOCUMENTED_RUNS}\ncpna,map,p,c,0,1,fast,0,false,1,1,,,,,,false,,,,,,\n".encode(),
            "not a readable table",
        ),
    ],
)
def test_broken_tables_of_runs_give_one_clear_line(tmp_path: Path, content: bytes, problem: str) -> None:
    (tmp_path / "runs.csv").write_bytes(content)
    with pytest.raises(ResultsError, match=problem) as caught:
        read_runs(tmp_path)
    assert "\n" not in str(caught.value)
    assert "runs.csv" in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"PAR1 and then nothing"])
def test_broken_logs_give_one_clear_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.parquet").write_bytes(content)
    with pytest.raises(ResultsError, match=r"a\.parquet: not a readable Parquet log") as caught:
        read_log(tmp_path / "a.parquet")
    assert "\n" not in str(caught.value)


def test_a_single_byte_that_has_changed_is_noticed_wherever_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_log(path, some_log())
    content = path.read_bytes()
    check_seal(content)
    random = np.random.default_rng(0)
    for place, change in enumerate(random.integers(1, 256, len(content)).tolist()):
        damaged = bytearray(content)
        damaged[place] ^= change
        with pytest.raises(ReadError, match="damaged: its checksum is"):
            check_seal(bytes(damaged))
    damaged = bytearray(content)
    damaged[len(content) // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(ResultsError, match=r"a\.parquet: not a readable Parquet log \(damaged: its checksum"):
        read_log(path)


def test_a_log_that_was_cut_off_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_log(path, some_log())
    content = path.read_bytes()
    for length in range(0, len(content), 101):
        path.write_bytes(content[:length])
        with pytest.raises(ResultsError, match="not a readable Parquet log"):
            read_log(path)


def test_equal_logs_are_equal_bytes_and_their_pages_have_checksums_too(tmp_path: Path) -> None:
    one, two = tmp_path / "one.parquet", tmp_path / "two.parquet"
    for path in (one, two):
        write_log(path, some_log())
    assert one.read_bytes() == two.read_bytes()
    told = pq.read_metadata(one).metadata[b"smartmot.checksum"]
    zeros = one.read_bytes().replace(told[7:], b"0" * 64)
    assert told == b"sha256:" + sha256(zeros).hexdigest().encode()
    start = pq.read_metadata(one).row_group(0).column(0).dictionary_page_offset
    damaged = bytearray(one.read_bytes())
    damaged[start + 40] ^= 1  # behind the page's header
    with pytest.raises(OSError, match="CRC"):
        pq.read_table(io.BytesIO(damaged), page_checksum_verification=True)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"x_m": ["a", "b", "c"]}, "column 'x_m' holds other values"),
        ({"kind": [1, 2, 3]}, "column 'kind' holds other values"),
        ({"label": [b"a", None, b"b"]}, "not a readable Parquet log|column 'label' holds other values"),
        ({"id": [True, False, True]}, "column 'id' holds other values"),
        ({"time_s": [0.0, np.nan, 1.0]}, "column 'time_s' has a row without a value"),
        ({"yaw_rad": [np.nan, 0.0, 0.0]}, "column 'yaw_rad' has a row of kind ego without a value"),
        ({"length_m": [4.0, np.nan, 0.0]}, "column 'length_m' has a row of kind track without a value"),
        ({"yaw_rad": [np.inf, 0.0, 0.0]}, r"column 'yaw_rad' holds a value beyond 1e\+09"),
    ],
)
def test_logs_with_values_of_another_kind_are_refused(
    tmp_path: Path, change: dict[str, Any], problem: str
) -> None:
    """Written by another program: without our checksum."""
    pd.DataFrame(some_log() | change).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(ResultsError, match=problem):
        read_log(tmp_path / "a.parquet")


def test_parquet_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    pd.DataFrame({"time_s": [1.0]}).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(ResultsError, match="columns missing: kind, id"):
        read_log(tmp_path / "a.parquet")


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"x_m": np.zeros(2)}, "equally long"),
        ({"x_m": np.array(["a", "b", "c"])}, "column 'x_m' of the log: expected numbers"),
        ({"id": np.array([0.5, 1.0, 2.0])}, "column 'id' of the log: expected whole numbers"),
    ],
)
def test_logs_of_wrong_columns_are_refused(
    tmp_path: Path, change: dict[str, np.ndarray[Any, Any]], problem: str
) -> None:
    with pytest.raises(ResultsError, match=problem):
        write_log(tmp_path / "a.parquet", {**some_log(), **change})
    with pytest.raises(ResultsError, match="columns missing: time_s"):
        write_log(tmp_path / "a.parquet", {})
    assert not (tmp_path / "a.parquet").exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(ResultsError, match=r"cannot be written .*; choose another folder"):
        write_runs(tmp_path / "file", [STOPPED], {})
    with pytest.raises(ResultsError, match=r"cannot be written"):
        write_log(tmp_path / "file" / "a.parquet", some_log())


def test_comparison_sets_strategies_side_by_side() -> None:
    slow = [
        replace(row, v_test_kmh=10.0, v_impact_kmh=0.0, score=1.0, score_max=1.0) for row in (STOPPED, HIT)
    ]
    table = comparison_table(runs_of(STOPPED, HIT, *slow))
    assert table.header == (
        "v_test (km/h)",
        "rectangular v_impact (km/h)",
        "score",
        "map v_impact (km/h)",
        "score",
    )
    assert table.rows == (("10", "0.00", "1.00", "0.00", "1.00"), ("50", "23.00", "0.00", "0.00", "2.00"))
    assert table.totals == (("total", "", "1.00/3", "", "3.00/3"),)
    assert table.caption == ""


def test_comparison_with_published_values_shows_differences() -> None:
    table = comparison_table(runs_of(STOPPED, HIT), PUBLISHED)
    assert table.header[3:5] == ("published (km/h)", "diff. (km/h)")
    assert table.rows == (("50", "23.00", "0.00", "23.82", "-0.82", "0.00", "2.00", "0.00", "0.00"),)
    assert table.totals == (("total", "", "0.00/2", "score 2", "", "", "2.00/2", "score 2", ""),)


def test_comparison_leaves_out_what_was_not_run_or_published() -> None:
    fast = replace(HIT, v_test_kmh=80.0, v_impact_kmh=70.0, score=None, score_max=None)
    table = comparison_table(runs_of(STOPPED, HIT, fast), PUBLISHED)
    assert table.rows[1] == ("80", "70.00", "–", "–", "–", "–", "–", "–", "–")
    assert table.totals[0][2] == "0.00/2"


def test_comparison_takes_published_speeds_without_a_score() -> None:
    fast = replace(STOPPED, v_test_kmh=70.0, v_impact_kmh=0.0, score=None, score_max=None)
    table = comparison_table(runs_of(STOPPED, fast), PUBLISHED)
    assert table.rows[1] == ("70", "0.00", "–", "0.00", "0.00")
    assert table.totals == (("total", "", "2.00/2", "score 2", ""),)


def test_comparison_shows_each_weather_and_scores_their_mean() -> None:
    table = comparison_table(runs_of(HIT, replace(HIT, weather="rain", v_impact_kmh=30.0, score=1.0)))
    assert table.rows == (("clear", "50", "23.00", "0.00"), ("rain", "50", "30.00", "1.00"))
    assert table.totals == (
        ("clear", "total", "", "0.00/2"),
        ("rain", "total", "", "1.00/2"),
        ("mean", "total", "", "0.50/2"),
    )


def test_comparison_averages_seeds() -> None:
    table = comparison_table(runs_of(HIT, replace(HIT, seed=1, v_impact_kmh=30.0, score=1.0)))
    assert table.rows == (("50", "26.50", "0.50"),)
    assert table.totals == (("total", "", "0.50/2"),)
    assert table.caption == "Means over up to 2 runs per speed and strategy."


def test_comparison_keeps_conditions_apart_and_counts_false_activations() -> None:
    stop = replace(STOPPED, adversaries="static", false_activation=True)
    table = comparison_table(runs_of(STOPPED, HIT, stop))
    assert table.header[:2] == ("adversaries", "v_test (km/h)")
    assert [row[:2] for row in table.rows] == [("none", "50"), ("static", "50")]
    assert table.rows[1] == ("static", "50", "–", "–", "0.00", "2.00")
    assert table.totals[-1] == ("false activations", "", "0 of 1", "", "1 of 2", "")


CUT_OFF = replace(STOPPED, score=None, end_reason="time_limit", end_time_s=60.0, false_activation=None)


def test_a_run_that_was_cut_off_has_no_number_in_a_table() -> None:
    table = comparison_table(runs_of(CUT_OFF, HIT))
    assert table.rows == (("50", "23.00", "0.00", "cut off", "–"),)
    assert table.totals == (
        ("total", "", "0.00/2", "", "–"),
        ("cut off", "0 of 1", "", "1 of 1", ""),
    )
    # false activations and cut-off runs have denominators of their own
    impacts = impact_table(runs_of(CUT_OFF, replace(STOPPED, v_test_kmh=60.0), HIT))
    assert impacts.rows == (("50", "23.00", "cut off"), ("60", "–", "0.00"))
    assert impacts.totals == (("contacts", "1 of 1", "0 of 1"), ("cut off", "0 of 1", "1 of 2"))
    assert told_runs([CUT_OFF, HIT]) == [
        "1 of 2 runs were cut off at 60 s: they count nowhere as avoided, and have no score; shorten what "
        "comes before, or give the scenario a stop trigger"
    ]
    assert told_runs([STOPPED, HIT]) == []


def test_a_mean_leaves_out_a_run_that_was_cut_off() -> None:
    table = comparison_table(runs_of(replace(CUT_OFF, strategy="rectangular", seed=2), HIT))
    assert table.rows == (("50", "23.00", "0.00"),)


def test_a_run_without_conflict_wins_no_points_and_is_not_avoided() -> None:
    nothing = replace(STOPPED, score=None)
    assert not nothing.avoided
    table = comparison_table(
        runs_of(nothing, replace(STOPPED, v_test_kmh=60.0, score=1.0, score_max=1.0), HIT)
    )
    assert table.rows == (("50", "23.00", "0.00", "no conflict", "–"), ("60", "–", "–", "0.00", "1.00"))
    assert table.totals == (
        ("total", "", "0.00/2", "", "1.00/1"),
        ("no conflict", "0 of 1", "", "1 of 2", ""),
    )


def test_avoided_of_a_table_and_of_its_rows_agree(tmp_path: Path) -> None:
    rows = [
        STOPPED,
        HIT,
        CUT_OFF,
        replace(STOPPED, score=None),
        replace(STOPPED, false_activation=True),
        replace(STOPPED, end_reason="passed"),
    ]
    write_runs(tmp_path, rows, {})
    assert avoided(read_runs(tmp_path)).tolist() == [row.avoided for row in rows]
    assert [row.avoided for row in rows] == [True, False, False, False, False, True]


def test_a_folder_of_version_0_1_0_is_still_read(tmp_path: Path) -> None:
    """It has `false_stop` and neither why nor when a run ended."""
    write_runs(tmp_path, [replace(STOPPED, false_activation=True), HIT], {})
    lines = [line.split(",") for line in (tmp_path / "runs.csv").read_text().splitlines()]
    new = [lines[0].index(name) for name in SINCE_0_2 if name != "false_activation"]
    old = [[cell for k, cell in enumerate(line) if k not in new] for line in lines]
    old[0][old[0].index("false_activation")] = "false_stop"
    (tmp_path / "runs.csv").write_text("".join(",".join(line) + "\n" for line in old))
    runs = read_runs(tmp_path)
    assert list(runs.columns) == list(RUN_COLUMNS)
    assert runs["false_activation"].tolist() == [True, False]
    assert runs["end_reason"].isna().all()
    assert avoided(runs).tolist() == [False, False]
    assert comparison_table(runs).rows == (("50", "23.00", "0.00", "0.00", "2.00"),)


def test_comparison_of_nothing_says_so() -> None:
    with pytest.raises(ResultsError, match="table of runs is empty"):
        comparison_table(runs_of())
    with pytest.raises(ResultsError, match="columns missing: scenario"):
        comparison_table(pd.DataFrame({"strategy": ["map"]}))


def test_markdown_has_a_line_per_row() -> None:
    text = markdown_table(comparison_table(runs_of(STOPPED, HIT, HIT), PUBLISHED))
    lines = text.splitlines()
    assert lines[1].count("---:") == 9
    assert lines[2].startswith("| 50 | 23.00 | 0.00 | 23.82 | -0.82 |")
    assert lines[3].startswith("| **total** |  | **0.00/2** |")
    assert lines[5] == "Means over up to 2 runs per speed and strategy."


def printed_table(table: Table, width: int) -> str:
    from rich.console import Console

    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(rich_table(table, "CPNA"))
    return console.export_text()


def test_rich_table_prints_every_cell() -> None:
    table = comparison_table(runs_of(STOPPED, HIT, replace(HIT, scenario="[bold]")), PUBLISHED)
    printed = printed_table(table, width=140)
    for row in (*table.rows, *table.totals):
        for cell in row:
            assert cell in printed
    assert "CPNA" in printed


def test_rich_table_of_two_strategies_fits_a_terminal_of_80_columns() -> None:
    rows = [
        replace(row, v_test_kmh=speed) for row in (STOPPED, HIT) for speed in (10.0, 20.0, 30.0, 40.0, 50.0)
    ]
    published: dict[str, dict[float, tuple[float, float | None]]]
    published = {name: {row.v_test_kmh: (0.0, 2.0) for row in rows} for name in ("rectangular", "map")}
    table = comparison_table(runs_of(*rows), published)
    printed = printed_table(table, width=80)
    assert max(map(len, printed.splitlines())) <= 80
    for row in (*table.rows, *table.totals):
        assert any(all(cell in line for cell in row) for line in printed.splitlines())


def test_importing_the_package_loads_no_heavy_library() -> None:
    code = (
        "import sys, evaluation.results.rows, evaluation.views.plots\n"
        "assert not {'matplotlib', 'pandas', 'pyarrow', 'rich'} & set(sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_notes_about_the_same_are_one_line() -> None:
    first, second = (f"the file asks for {a} m/s2 of 'VRU' (Bicycle), whose ..." for a in (2.48, 2.6))
    other = "SpeedAction of 'B' at 1.000 s is not carried out: it refers to 'A', which is deleted"
    assert told_notes([(first,), (), (second, other)]) == [
        f"{first} (in 2 of 3 runs)",
        f"{other} (in 1 of 3 runs)",
    ]


def test_a_run_cut_off_has_no_impact_speed_and_any_other_must_have_one(tmp_path):
    ended = replace(STOPPED, v_impact_kmh=None, end_reason="time_limit", score=None)
    write_runs(tmp_path, [HIT, ended], {})
    # the mean over the column is that of the run that came to its end: 23 km/h
    assert read_runs(tmp_path)["v_impact_kmh"].mean() == 23.0
    write_runs(tmp_path, [HIT, replace(STOPPED, v_impact_kmh=None)], {})
    with pytest.raises(
        ResultsError, match="'v_impact_kmh': a value is missing of a run that was not cut off"
    ):
        read_runs(tmp_path)
