"""The journal of finished runs: what is whole is kept, and one process writes."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.results.files import ResultsError
from evaluation.runs.execution import FrameTime
from evaluation.runs.folder_lock import locked
from evaluation.runs.journal import RUNS, TIMES, Journal
from evaluation.studies.growth import GrowthRun

RUN = GrowthRun("map", 0, 0, 1.0, None, False, 0.0)
SPENT = FrameTime(1, 1.0, 1.0)


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """A folder in whose journal a run is finished."""
    with Journal(tmp_path, GrowthRun) as journal:
        journal.add("k1", RUN, SPENT)
    return tmp_path


def test_two_journals_in_one_folder_do_not_spoil_each_other(tmp_path: Path) -> None:
    """A second one that opens while the first has half a line on disk must not cut that half off."""
    first = Journal(tmp_path, GrowthRun)
    first.add("k1", RUN, SPENT)
    file = first._files[0]
    file.write('{"key": "k2", "strategy": "ma')
    file.flush()
    with Journal(tmp_path, GrowthRun) as second:
        assert set(second.finished({"k1", "k2"})) == {"k1"}
    file.write('p", "others": 0}\n')
    file.flush()
    with Journal(tmp_path, GrowthRun) as third:
        assert set(third._lines) == {"k1", "k2"}
    with first:
        pass


@pytest.mark.parametrize("rest", [b'{"key": "k2", "str', b"\0\0\0\0", b"\0\0\0\n", b"\xff\xfe"])
def test_what_a_killed_process_left_of_a_line_is_cut_off(begun: Path, rest: bytes) -> None:
    path = begun / RUNS
    whole = path.read_bytes()
    path.write_bytes(whole + rest)
    with Journal(begun, GrowthRun) as journal:
        assert journal.finished({"k1"}) == {"k1": (RUN, SPENT)}
        journal.add("k2", RUN, SPENT)
    assert path.read_bytes().startswith(whole)
    with Journal(begun, GrowthRun) as journal:
        assert journal.finished({"k1", "k2"}) == {"k1": (RUN, SPENT), "k2": (RUN, SPENT)}


@pytest.mark.parametrize("line", [b"[" * 100_000, b"\xff", b'{"key": []}', b"3", b'{"key": "a", "key": "b"}'])
def test_a_damaged_line_in_between_is_one_clear_error(begun: Path, line: bytes) -> None:
    path = begun / RUNS
    path.write_bytes(line + b"\n" + path.read_bytes())
    with pytest.raises(ResultsError, match=r"runs\.jsonl: not a journal of a comparison \(line 1: ") as error:
        Journal(begun, GrowthRun)
    assert "\n" not in str(error.value)
    path.unlink()
    with Journal(begun, GrowthRun) as journal:  # the lock was given back
        assert journal.finished({"k1"}) == {}


@pytest.mark.parametrize(
    ("file", "field", "value", "message"),
    [
        (RUNS, "strategy", None, "strategy must be a text, got None"),
        (RUNS, "strategy", [1], r"strategy must be a text, got \[1\]"),
        (RUNS, "seed", True, "seed must be a whole number, got True"),
        (RUNS, "tracks_mean", "x", "tracks_mean must be a number, got 'x'"),
        (RUNS, "flag_time_s", float("nan"), "flag_time_s must be a number or null, got nan"),
        (RUNS, "false_activation", 1, "false_activation must be true or false, got 1"),
        (RUNS, "extra", 1, "has no 'extra'"),
        (TIMES, "median_ms", {}, "median_ms must be a number, got {}"),
        (TIMES, "frames", 1.5, "frames must be a whole number, got 1.5"),
    ],
)
def test_a_line_of_other_kinds_is_one_clear_error(
    begun: Path, file: str, field: str, value: object, message: str
) -> None:
    path = begun / file
    values = json.loads(path.read_text())
    del values["check"]  # as in version 0.1.0
    path.write_text(json.dumps({**values, field: value}) + "\n")
    with (
        Journal(begun, GrowthRun) as journal,
        pytest.raises(ResultsError, match=r"runs\.jsonl: not a journal of this version .*; remove") as error,
    ):
        journal.finished({"k1"})
    assert re.search(message, str(error.value))


@pytest.mark.parametrize("file", [RUNS, TIMES])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_value_that_was_changed_is_one_clear_error(begun: Path, file: str, newline: str) -> None:
    path = begun / file
    with Journal(begun, GrowthRun) as journal:
        journal.add("k2", RUN, SPENT)
    path.write_text(path.read_text().replace("\n", newline), newline="")
    with Journal(begun, GrowthRun) as journal:
        assert len(journal.finished({"k1", "k2"})) == 2
    path.write_text(path.read_text().replace("1.0", "2.0", 1))
    with pytest.raises(ResultsError, match=r"not a journal of a comparison \(line 1: .*checksum is another"):
        Journal(begun, GrowthRun)


def test_a_number_that_was_written_as_a_whole_one_stays_one(begun: Path) -> None:
    with Journal(begun, GrowthRun) as journal:
        journal.add("k2", replace(RUN, tracks_mean=3), SPENT)
    with Journal(begun, GrowthRun) as journal:
        assert repr(journal.finished({"k2"})["k2"][0].tracks_mean) == "3"


def test_a_torn_line_is_cut_off_although_the_command_holds_the_folder(begun: Path) -> None:
    """As every command does; else the next run is written behind it, and both are lost."""
    path = begun / RUNS
    path.write_bytes(path.read_bytes() + b'{"key": "k2", "str')
    with locked(begun), Journal(begun, GrowthRun) as journal:
        journal.add("k3", RUN, SPENT)
    with locked(begun), Journal(begun, GrowthRun) as journal:
        assert set(journal.finished({"k1", "k2", "k3"})) == {"k1", "k3"}


def test_lines_stand_in_the_order_of_the_items_whatever_was_finished_first(tmp_path: Path) -> None:
    items = {f"{number:024x}": number for number in range(5)}

    def measured(number: int) -> tuple[GrowthRun, FrameTime]:
        return replace(RUN, seed=number), SPENT

    for name, order in (("one", [0, 1, 2, 3, 4]), ("other", [3, 0, 4])):
        with Journal(tmp_path / name, GrowthRun) as journal:
            for number in order:
                journal.add(f"{number:024x}", *measured(number))
        with Journal(tmp_path / name, GrowthRun) as journal:
            kept, before = journal.carry_out(measured, items, 1)
        assert before == len(order)
        assert {key: run.seed for key, (run, _) in kept.items()} == items
    assert (tmp_path / "one" / RUNS).read_bytes() == (tmp_path / "other" / RUNS).read_bytes()
    assert (tmp_path / "one" / TIMES).read_bytes() == (tmp_path / "other" / TIMES).read_bytes()
