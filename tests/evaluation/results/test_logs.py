"""Logs of runs: round trips, equal bytes, and every kind of damage is noticed."""

from __future__ import annotations

import io
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest

from evaluation.results.files import ResultsError, log_path
from evaluation.results.logs import LOG_COLUMNS, read_log, write_log
from evaluation.results.seal import check_seal
from scenarios.reading import ReadError
from tests.evaluation.results.conftest import some_log


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
