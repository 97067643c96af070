"""Configurations as JSON; folders and files that are missing or cannot be written."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from evaluation.results.files import ResultsError, write_whole
from evaluation.results.logs import read_log, write_log
from evaluation.results.rows import read_runs, write_runs
from tests.evaluation.results.conftest import STOPPED, some_log


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


def test_missing_folder_and_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"nowhere: no such folder; give the folder"):
        read_runs(tmp_path / "nowhere")
    with pytest.raises(ResultsError, match=r"runs\.csv: no such file; run the evaluation"):
        read_runs(tmp_path)
    with pytest.raises(ResultsError, match=r"a\.parquet: no such file"):
        read_log(tmp_path / "a.parquet")


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(ResultsError, match=r"cannot be written .*; choose another folder"):
        write_runs(tmp_path / "file", [STOPPED], {})
    with pytest.raises(ResultsError, match=r"cannot be written"):
        write_log(tmp_path / "file" / "a.parquet", some_log())


@pytest.mark.parametrize("path", ["", ".", "/"])
def test_a_place_without_a_name_is_no_file(path: str) -> None:
    with pytest.raises(IsADirectoryError):
        write_whole(Path(path), b"")
