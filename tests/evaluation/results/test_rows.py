"""The table of runs: round trips, equal bytes for equal runs, clear errors."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.results.by_speed import comparison_table
from evaluation.results.files import ResultsError, log_path
from evaluation.results.logs import LOG_COLUMNS, read_logs, write_log
from evaluation.results.rows import RUN_COLUMNS, SINCE_0_2, RunRow, avoided, read_runs, write_runs
from tests.evaluation.results.conftest import CUT_OFF, HIT, STOPPED, some_log

DOCUMENTED_RUNS = (
    "scenario,strategy,preset,weather,adversaries,seed,v_test_kmh,v_impact_kmh,collided,score,score_max,"
    "flag_time_s,flag_distance_m,stop_gap_m,contact_time_s,t0_s,end_reason,end_time_s,false_activation,"
    "detections,dropped_score,dropped_category,dropped_box,target_start_time_s,"
    "target_steady_time_s,ego_speed_at_contact_kmh,target_speed_at_contact_kmh,impact_location_percent,log"
)


DOCUMENTED_LOG = (
    "time_s,kind,id,category,label,x_m,y_m,yaw_rad,length_m,width_m,speed_mps,accel_mps2,horizon_s"
)


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


def test_importing_the_package_loads_no_heavy_library() -> None:
    code = (
        "import sys, evaluation.results.rows, evaluation.views.plots\n"
        "assert not {'matplotlib', 'pandas', 'pyarrow', 'rich'} & set(sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


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


def test_logs_named_by_the_runs_are_read(tmp_path: Path) -> None:
    write_everything(tmp_path)
    assert list(read_logs(tmp_path, read_runs(tmp_path))) == ["cpna-map-50"]
