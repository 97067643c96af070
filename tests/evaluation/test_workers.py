"""Jobs in several processes: order, errors, and what is left of them when the parent goes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evaluation.errors import WorkerError
from evaluation.workers import execute_all

SCRIPT = """
import sys
from tests_workers_job import mark
from evaluation.workers import execute_all
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


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_items(workers: int) -> None:
    assert list(execute_all(slow_for_small, range(6), workers)) == [0, 1, 4, 9, 16, 25]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_comes_after_the_results_before_it(workers: int) -> None:
    results = execute_all(fails_at_three, range(6), workers)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(results)


def is_killed_at_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_lost_worker_is_named() -> None:
    with pytest.raises(WorkerError, match="a worker process was ended from outside"):
        list(execute_all(is_killed_at_three, range(6), 2))


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
        while len(workers := [int(path.name) for path in marks.iterdir()]) < 2:
            assert time.monotonic() < deadline
            assert parent.poll() is None
            time.sleep(0.02)
        if end == signal.SIGINT:  # as a terminal does: to the whole group
            os.killpg(parent.pid, end)
        else:
            parent.send_signal(end)
        _, errors = parent.communicate(timeout=30.0)
    while any(alive(worker) for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    if end == signal.SIGINT:  # one complaint, the parent's own
        assert errors.count("KeyboardInterrupt") == 1
