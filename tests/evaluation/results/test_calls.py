"""A folder holds the results of one call: files of another are removed, and no others."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.results.calls import CALL, begin, call_of, call_text, end, go_on, note
from evaluation.results.files import write_bytes

FIRST, SECOND = (call_text("cpna", {"speeds": text}) for text in ("30", "50"))


@pytest.fixture(autouse=True)
def _closed() -> None:
    end()


def names(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.name != CALL
    }


def test_another_call_removes_what_the_first_has_written_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("kept")
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "mine.parquet").write_text("kept")
    said: list[str] = []
    begin(tmp_path, FIRST, lambda: said.append("first"))
    for name in ("runs.csv", "logs/a.parquet", "old/b.png"):
        write_bytes(tmp_path / name, b"first")
    begin(tmp_path, SECOND, lambda: said.append("second"))
    assert call_of(tmp_path) == FIRST
    assert "logs/a.parquet" in names(tmp_path), "a call that fails before it writes costs nothing"
    assert said == []
    write_bytes(tmp_path / "runs.csv", b"second")
    write_bytes(tmp_path / "table.md", b"second")
    assert said == ["second"]
    assert names(tmp_path) == {"mine.txt", "logs/mine.parquet", "runs.csv", "table.md"}
    assert not (tmp_path / "old").exists()
    assert (tmp_path / "runs.csv").read_bytes() == b"second"
    assert call_of(tmp_path) == SECOND


def test_a_folder_that_was_emptied_is_used_again(tmp_path: Path) -> None:
    begin(tmp_path, FIRST)
    write_bytes(tmp_path / "logs" / "a.parquet", b"first")
    begin(tmp_path, SECOND)
    write_bytes(tmp_path / "logs" / "b.parquet", b"second")
    assert names(tmp_path) == {"logs/b.parquet"}


def test_the_same_call_keeps_what_it_has_written(tmp_path: Path) -> None:
    for _ in range(2):
        begin(tmp_path, FIRST, lambda: pytest.fail("nothing is replaced"))
        write_bytes(tmp_path / "runs.csv", b"first")
    assert (tmp_path / CALL).read_text().splitlines() == [FIRST, "runs.csv", "runs.csv"]
    begin(tmp_path, SECOND)
    write_bytes(tmp_path / "table.md", b"second")
    assert names(tmp_path) == {"table.md"}


def test_files_that_a_killed_call_has_written_are_known(tmp_path: Path) -> None:
    begin(tmp_path, FIRST)
    write_bytes(tmp_path / "logs" / "a.parquet", b"first")
    end()  # as a process that was killed: nothing is done at its end
    begin(tmp_path, SECOND)
    write_bytes(tmp_path / "runs.csv", b"second")
    assert names(tmp_path) == {"runs.csv"}


def test_pages_that_are_made_later_go_with_their_results(tmp_path: Path) -> None:
    begin(tmp_path, FIRST)
    write_bytes(tmp_path / "runs.csv", b"first")
    end()
    write_bytes(tmp_path / "notes.html", b"of the user")
    go_on(tmp_path)
    write_bytes(tmp_path / "report.html", b"page")
    begin(tmp_path, SECOND)
    write_bytes(tmp_path / "runs.csv", b"second")
    assert names(tmp_path) == {"runs.csv", "notes.html"}


def test_files_elsewhere_are_not_noted_and_never_touched(tmp_path: Path) -> None:
    results, other = tmp_path / "results", tmp_path / "other.csv"
    results.mkdir()
    begin(results, FIRST)
    write_bytes(other, b"kept")
    write_bytes(results / "runs.csv", b"first")
    (results / CALL).write_text(f"{FIRST}\nruns.csv\n../other.csv\n{other}\n")
    begin(results, SECOND)
    write_bytes(results / "table.md", b"second")
    assert other.read_bytes() == b"kept"
    assert names(results) == {"table.md"}


def test_a_folder_without_a_call_notes_nothing(tmp_path: Path) -> None:
    go_on(tmp_path)
    note(tmp_path / "report.html")
    assert not (tmp_path / CALL).exists()
