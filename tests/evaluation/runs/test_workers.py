"""Jobs in several processes: order, errors, and what is left of them when the parent goes."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from multiprocessing import forkserver
from pathlib import Path

import pytest

from evaluation.errors import WorkerError
from evaluation.runs import workers
from evaluation.runs.workers import execute_all, start_early

SCRIPT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it
from tests_workers_job import mark
from evaluation.runs.workers import execute_all
list(execute_all(mark, [sys.argv[1]] * 40, 2))
"""
JOB = """
import os, time
def mark(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(0.2)
"""


def slow_for_small(number: int) -> int:
    time.sleep(0.05 / (1 + number))
    return number * number


def fails_at_three(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    return number


@pytest.mark.parametrize("count", [1, 2])
def test_results_come_in_the_order_of_the_items(count: int) -> None:
    assert list(execute_all(slow_for_small, range(6), count)) == [0, 1, 4, 9, 16, 25]


@pytest.mark.parametrize("count", [1, 2])
def test_an_error_comes_after_the_results_before_it(count: int) -> None:
    results = execute_all(fails_at_three, range(6), count)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(results)


def is_loaded(name: str) -> bool:
    return name in sys.modules


@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="needs a forkserver")
def test_processes_begin_with_what_runs_import() -> None:
    script = (
        "from tests.evaluation.runs.test_workers import is_loaded\n"
        "from evaluation.runs.workers import LATE, execute_all\n"
        "print(list(execute_all(is_loaded, [*LATE, 'nowhere'], 2)))"
    )
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout == f"{[True] * len(workers.LATE) + [False]}\n"


def is_killed_at_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_lost_worker_is_named() -> None:
    with pytest.raises(WorkerError, match="a worker process was ended from outside"):
        list(execute_all(is_killed_at_three, range(6), 2))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import not_installed_w", "ModuleNotFoundError: No module named 'not_installed_w'"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("raise SystemExit('gone')", "SystemExit: gone"),
        ("class Broken", "SyntaxError: "),
    ],
)
def test_a_worker_that_fails_at_import_names_the_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, told: str
) -> None:
    """The module is whole in this process only."""
    name = f"job_w{len(text)}"
    file = tmp_path / f"{name}.py"
    file.write_text("def job(number):\n    return number\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    job = importlib.import_module(name).job
    file.write_text(f"\n{text}\n")
    with pytest.raises(WorkerError) as caught:
        list(execute_all(job, range(4), 2))
    message = str(caught.value)
    assert told in message
    assert "\n" not in message
    assert message.startswith("a worker process cannot import what it needs: ")
    assert message.endswith(f"({file}, line 2)")


def test_workers_that_cannot_be_started_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **named: object) -> None:
        raise ConnectionResetError("the server is gone")

    monkeypatch.setattr(workers.ProcessPoolExecutor, "submit", refuse)
    with pytest.raises(WorkerError, match=r"cannot be started \(ConnectionResetError: the server is gone\)"):
        list(execute_all(slow_for_small, range(4), 2))


def safe_path(number: int) -> str | None:
    return os.environ.get("PYTHONSAFEPATH")


@pytest.mark.parametrize("given", [None, "", "yes"])
def test_the_environment_of_the_user_is_as_it_was(monkeypatch: pytest.MonkeyPatch, given: str | None) -> None:
    """Here and in the workers, of which only the start is shielded."""
    if given is None:
        monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    else:
        monkeypatch.setenv("PYTHONSAFEPATH", given)
    assert set(execute_all(safe_path, range(4), 2)) == {given}
    assert os.environ.get("PYTHONSAFEPATH") == given


def start_method(number: int) -> str:
    return type(multiprocessing.current_process()).__name__


def test_without_a_forkserver_each_worker_starts_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows."""
    assert set(execute_all(start_method, range(4), 2)) == {"ForkServerProcess"}
    monkeypatch.setattr(multiprocessing, "get_all_start_methods", lambda: ["spawn"])
    assert set(execute_all(start_method, range(4), 2)) == {"SpawnProcess"}


def test_an_early_start_is_that_of_the_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    """One process does the work itself, and needs no start."""
    started: list[str | None] = []
    ensure = forkserver.ensure_running

    def ensure_running() -> None:
        started.append(os.environ.get("PYTHONSAFEPATH"))
        ensure()

    monkeypatch.setattr(forkserver, "ensure_running", ensure_running)
    start_early(1, "evaluation.runs.execution")
    assert started == []
    before = os.environ.get("PYTHONSAFEPATH")
    start_early(2, "evaluation.runs.execution")
    assert started == ["1"]
    assert os.environ.get("PYTHONSAFEPATH") == before
    assert list(execute_all(slow_for_small, range(4), 2)) == [0, 1, 4, 9]


def alive(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_worker_outlives_its_parent(tmp_path: Path, end: signal.Signals) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    (tmp_path / "tests_workers_job.py").write_text(JOB)
    paths = os.pathsep.join([str(tmp_path), *(path for path in sys.path if path)])
    start = [sys.executable, "-c", SCRIPT, str(marks)]
    with subprocess.Popen(
        start,
        env={**os.environ, "PYTHONPATH": paths},
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    ) as parent:
        deadline = time.monotonic() + 60.0
        while len(started := [int(path.name) for path in marks.iterdir()]) < 2:
            assert time.monotonic() < deadline
            assert parent.poll() is None
            time.sleep(0.02)
        if end == signal.SIGINT:  # as a terminal does: to the whole group
            os.killpg(parent.pid, end)
        else:
            parent.send_signal(end)
        _, errors = parent.communicate(timeout=30.0)
    while any(alive(worker) for worker in started):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    if end == signal.SIGINT:  # one complaint, the parent's own
        assert errors.count("KeyboardInterrupt") == 1
