"""One process per folder, and what is left where nothing more can be written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluation.cli import main
from evaluation.errors import ArgumentError
from evaluation.results.calls import CALL
from evaluation.results.files import ResultsError, write_bytes
from evaluation.runs.folder_lock import LOCK, locked, writable_folder

COMMAND = (sys.executable, "-c", "from evaluation.cli import main; main()")
FIELD = Path(__file__).parents[2] / "data" / "field" / "runs"
HOLD = """
import sys
from pathlib import Path
from evaluation.runs.folder_lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def other(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that has locked the folder until its input ends."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def command(*words: object, limit_kib: int | None = None) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, which may write files of so many KiB only."""
    line = [*COMMAND, *map(str, words)]
    if limit_kib is not None:
        line = ["bash", "-c", f'ulimit -f {limit_kib}; exec "$@"', "bash", *line]
    return subprocess.run(line, capture_output=True, text=True, timeout=120)


def test_another_process_is_told_which_one_writes(tmp_path: Path, other: subprocess.Popen[str]) -> None:
    message = f"{tmp_path}: process {other.pid} writes into this folder; wait for it, or choose another one"
    with pytest.raises(ResultsError) as error, locked(tmp_path):
        pass
    assert str(error.value) == f"{message} (--out)"
    other.kill()
    other.wait()
    with locked(tmp_path):  # the lock of a process that was killed is gone
        assert (tmp_path / LOCK).read_text() == f"{os.getpid()}\n"
    assert not (tmp_path / LOCK).exists()


@pytest.mark.parametrize(
    "words",
    [
        ("cpna", "--speeds", "10", "--strategy", "map"),
        ("run", "crossing"),
        ("ncap", "--protocol", "paper", "--strategy", "map"),
        ("compare", "--seeds", "1"),
        ("compare", "--growth", "--seeds", "1"),
        ("reference", "--only", "paper"),
        ("mot", FIELD / "nuscenes_no_score", "--format", "nuscenes"),
    ],
)
def test_every_command_that_writes_a_folder_waits_for_its_turn(
    tmp_path: Path,
    other: subprocess.Popen[str],
    words: tuple[object, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, words), "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert capsys.readouterr().err == (
        f"smartmot-eval: {tmp_path}: process {other.pid} writes into this folder; wait for it, or choose "
        "another one (--out)\n"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == [LOCK]


def test_within_a_process_a_folder_may_be_locked_again(tmp_path: Path) -> None:
    with locked(tmp_path) as first, locked(tmp_path / ".") as second:
        assert (first, second) == (True, False)
    assert not (tmp_path / LOCK).exists()


def test_a_file_is_written_as_a_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "table.md"
    write_bytes(path, b"before")

    def full(part: Path, content: bytes) -> int:
        with part.open("wb") as file:
            file.write(content[:3])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ResultsError, match=r"table\.md: cannot be written \(No space left on device\)"):
        write_bytes(path, b"after")
    assert path.read_bytes() == b"before"
    assert [file.name for file in tmp_path.iterdir()] == ["table.md"]


SHORT = (
    "compare", "--scenes", "crosses in a bend", "--strategies", "map", "--vary", "margin_m=0,2",
    "--seeds", "1", "--workers", "1", "--format", "svg", "--out",
)  # fmt: skip


@pytest.mark.skipif(os.name == "nt", reason="no ulimit on Windows")
def test_a_limit_on_files_is_one_line_and_nothing_is_lost(tmp_path: Path) -> None:
    """The journal's first lines fit into 1 KiB; the limit tears a line."""
    stopped = command(*SHORT, tmp_path, limit_kib=1)
    assert stopped.returncode == 2, stopped.stderr
    (line,) = stopped.stderr.strip().splitlines()
    assert line.startswith(f"smartmot-eval: {tmp_path / 'runs.jsonl'}: cannot be written (File too large); ")
    kept = (tmp_path / "runs.jsonl").read_bytes().count(b"\n")
    assert kept > 0
    again = command(*SHORT, tmp_path)
    assert again.returncode == 0, again.stderr
    assert f"{kept} of them from before" in again.stdout


@pytest.mark.skipif(os.name == "nt", reason="no ulimit on Windows")
@pytest.mark.parametrize("words", [("cpna", "--speeds", "10", "--strategy", "map"), ("run", "cpna_paper")])
def test_logs_that_cannot_be_written_are_one_line(tmp_path: Path, words: tuple[str, ...]) -> None:
    stopped = command(*words, "--workers", "1", "--out", tmp_path, limit_kib=1)
    assert stopped.returncode == 2
    (line,) = stopped.stderr.strip().splitlines()
    assert "cannot be written (File too large)" in line
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == [CALL]


def test_output_that_cannot_be_written_is_one_line() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*COMMAND, "list"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "smartmot-eval: output: cannot be read or written (No space left on device)\n"


def test_folder_is_made_and_left_empty(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    assert writable_folder(folder) == folder
    assert list(folder.iterdir()) == []
    assert writable_folder(folder) == folder


@pytest.mark.parametrize("below", [False, True])
def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path, below: bool) -> None:
    file = tmp_path / "results"
    file.touch()
    with pytest.raises(ArgumentError, match=r"--out: cannot write to folder .*; choose another one"):
        writable_folder(file / "sub" if below else file)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(ArgumentError, match="--out: cannot write"):
            writable_folder(tmp_path)
    finally:
        tmp_path.chmod(0o700)
