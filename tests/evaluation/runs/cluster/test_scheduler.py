"""Runs on the workers of a real scheduler: processes of this machine, in other folders than the caller."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.errors import ArgumentError, WorkerError
from evaluation.runs.cluster import scheduler as cluster
from evaluation.runs.cluster.scheduler import Scheduler
from evaluation.runs.execution import execute
from evaluation.runs.workers import execute_all, execute_as_finished
from scenarios.catalogue.library import DEFINITIONS
from scenarios.catalogue.maps import shipped_map
from scenarios.spec import RunSpec

distributed = pytest.importorskip("distributed", reason="needs the extra dask")

TIMEOUT_S = 120.0
JOBS = """
import os, signal, time
def square(number):
    time.sleep(1.0 if number == 0 else 0.0)
    return number * number
def fails_at_three(number):
    if number == 3:
        raise ValueError("three")
    return number
def ends_its_process(folder):
    try:
        if folder:
            os.mkdir(folder)
    except FileExistsError:
        return "again"
    os.kill(os.getpid(), signal.SIGKILL)
def place(number):
    return os.getcwd(), os.getpid()
"""
COMPARE = (
    "compare", "--scenes", "crosses in a bend", "--strategies", "map",
    "--vary", "margin_m=0,2", "--seeds", "1", "--format", "svg", "--quiet",
)  # fmt: skip


@dataclass
class Cluster:
    """A scheduler and its workers.

    Args:
        address: of the scheduler.
        folder: scratch; workers stand in a folder of it.
        scheduler: its process.
        processes: of the workers.
    """

    address: str
    folder: Path
    scheduler: subprocess.Popen[bytes]
    processes: list[subprocess.Popen[bytes]]

    def add_worker(self, *options: str, path: Path | None = None) -> subprocess.Popen[bytes]:
        """Start a worker, with a folder in front of its modules."""
        own = self.folder / f"worker_{len(self.processes)}"
        own.mkdir()
        paths = [str(place) for place in (path, self.folder, *sys.path) if place]
        line = [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1"]
        line += ["--no-nanny", "--no-dashboard", "--local-directory", str(own), *options]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        with (own / "output").open("wb") as output:
            process = subprocess.Popen(line, cwd=own, env=environment, stdout=output, stderr=output)
        self.processes.append(process)
        return process

    def wait_for(self, count: int) -> None:
        """Wait until so many workers are there."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other versions, as is meant
            client = distributed.Client(self.address, set_as_default=False)
        with client:
            client.wait_for_workers(count, timeout=TIMEOUT_S)


@contextlib.contextmanager
def started(folder: Path) -> Iterator[Cluster]:
    file = folder / "scheduler.json"
    line = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    with (folder / "scheduler.log").open("wb") as log:
        line += ["--no-dashboard", "--scheduler-file", str(file)]
        with subprocess.Popen(line, cwd=folder, stdout=log, stderr=log) as process:
            until(lambda: file.exists() and file.read_bytes().endswith(b"}"), process)
            processes: list[subprocess.Popen[bytes]] = []
            try:
                yield Cluster(json.loads(file.read_text())["address"], folder, process, processes)
            finally:
                for each in (*processes, process):
                    each.kill()
                    each.wait()


def until(there: Callable[[], bool], process: subprocess.Popen[bytes] | None = None) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not there():
        assert time.monotonic() < deadline
        assert process is None or process.poll() is None
        time.sleep(0.02)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler with two workers, to which the jobs of these tests are known."""
    folder = tmp_path_factory.mktemp("cluster")
    (folder / "tests_cluster_jobs.py").write_text(JOBS)
    with started(folder) as running:
        for _ in range(2):
            running.add_worker()
        running.wait_for(2)
        yield running


@pytest.fixture
def jobs(two: Cluster, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(two.folder))
    return importlib.import_module("tests_cluster_jobs")


def test_results_come_as_they_are_finished(two: Cluster, jobs: Any) -> None:
    finished = list(execute_as_finished(jobs.square, range(12), Scheduler(two.address)))
    assert sorted(finished) == [(number, number**2) for number in range(12)]
    assert finished[0][0] != 0  # which takes its time
    assert list(execute_as_finished(jobs.square, [], Scheduler(two.address))) == []


def test_an_error_comes_after_the_results_before_it(two: Cluster, jobs: Any) -> None:
    results = execute_all(jobs.fails_at_three, range(9), Scheduler(two.address))
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(results)


def test_an_item_whose_process_ends_is_tried_again_and_named_in_the_end(
    two: Cluster, jobs: Any, tmp_path: Path
) -> None:
    results = execute_all(jobs.ends_its_process, [str(tmp_path / "once"), ""], Scheduler(two.address))
    assert next(results) == "again"
    with pytest.raises(WorkerError, match=r"run 2: its process on .*tcp://.* status -9, for the third"):
        next(results)


def test_nothing_is_left_of_a_session(two: Cluster, jobs: Any) -> None:
    results = execute_as_finished(jobs.place, range(40), Scheduler(two.address))
    _, (folder, process) = next(results)
    assert folder == str(Path.cwd())  # told as it is here, although the worker's process stands in the mirror
    assert Path(f"/proc/{process}").exists() or not Path("/proc").exists()
    results.close()
    until(lambda: not Path(f"/proc/{process}").exists())
    until(lambda: not [path for path in two.folder.rglob("smartmot/*") if path.is_dir()])


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's folder with a scenario, its catalogs, a map and a tracker in two modules."""
    folder = tmp_path / "own"
    shutil.copytree(DEFINITIONS / "catalogs", folder / "scenarios" / "catalogs")
    (folder / "maps").mkdir()
    shutil.copy(shipped_map("urban_street"), folder / "maps" / "street.xodr")
    text = (DEFINITIONS / "cpna_paper.xosc").read_text()
    (folder / "scenarios" / "test.xosc").write_text(text)
    (folder / "scenarios" / "fixed.xosc").write_text(text.replace('"$Map"', f'"{folder}/maps/street.xodr"'))
    (folder / "tracker_s.py").write_text(
        "import helper_s\nfrom smartmot import Tracker\n\ndef make():\n    return Tracker(helper_s.CONFIG)\n"
    )
    (folder / "helper_s.py").write_text(
        "from scenarios.presets import named_preset\nCONFIG = named_preset('paper').pipeline.tracker\n"
    )
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield folder
    for name in ("tracker_s", "helper_s"):
        sys.modules.pop(name, None)


def test_scenarios_maps_and_plug_ins_travel(two: Cluster, own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By relative and by absolute paths; when the first run begins, the caller's files are gone."""
    base = RunSpec(
        "own", "scenarios/test.xosc",
        (("Ego_speed_kmh", 30.0), ("Line_x", 150.0), ("Line_y", 1.75), ("Line_yaw", 3.14159265),
         ("Side", -1.0), ("Map", "../maps/street.xodr")),
        "map", "paper", "dry", 30.0, "maps/street.xodr", settings=(("tracker", "tracker_s:make"),),
    )  # fmt: skip
    fixed = tuple(pair for pair in base.parameters if pair[0] != "Map")
    specs = [
        base,
        replace(base, file=str(own / "scenarios" / "test.xosc"), map_name=str(own / "maps" / "street.xodr")),
        replace(base, file=str(own / "scenarios" / "fixed.xosc"), parameters=(*fixed, ("Map", ""))),
    ]
    job = partial(execute, keep_log=True)
    here = [job(spec) for spec in specs]
    take = cluster._Dispatch._take

    def hidden(self: cluster._Dispatch) -> Any:
        if own.exists():  # all is handed over, and no process of a worker has started yet
            own.rename(own.with_name("hidden"))
        return take(self)

    monkeypatch.setattr(cluster._Dispatch, "_take", hidden)
    there = list(execute_all(job, specs, Scheduler(two.address)))
    assert not own.exists()
    assert [record.row for record in there] == [record.row for record in here]
    assert [record.spec for record in there] == specs
    for one, other in zip(here, there, strict=True):
        assert one.log is not None
        assert other.log is not None
        assert list(one.log) == list(other.log)
        for name, column in one.log.items():
            np.testing.assert_array_equal(column, other.log[name], strict=True)


def test_workers_that_could_give_other_bytes_are_refused_by_name(tmp_path: Path) -> None:
    """Another numpy, another version of ours, none of ours; then there comes one that fits."""
    (tmp_path / "tests_cluster_jobs.py").write_text(JOBS)
    for folder, name in (("a", "numpy"), ("b", "smartmot")):
        info = tmp_path / folder / f"{name}-0.0.9.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.0.9\n")
    (tmp_path / "c" / "evaluation").mkdir(parents=True)
    (tmp_path / "c" / "evaluation" / "__init__.py").write_text("raise ImportError('another one')")
    lines: list[str] = []
    sys.path.insert(0, str(tmp_path))
    try:
        square = importlib.import_module("tests_cluster_jobs").square
        with started(tmp_path) as running:
            for folder in "abc":
                running.add_worker(path=tmp_path / folder)
            running.wait_for(3)
            scheduler = Scheduler(running.address, lines.append)
            with pytest.raises(WorkerError, match="no worker can do the work") as error:
                list(execute_all(square, range(8), scheduler))
            for said in ("numpy 0.0.9, here ", "smartmot 0.0.9+", "it has smartmot 0.1.0, which is another"):
                assert said in str(error.value)
            assert str(error.value).count("worker tcp://") == 3
            running.add_worker()
            # the third has ended itself, sooner or later
            output = running.folder / "worker_3" / "output"
            until(lambda: b"Registered to" in output.read_bytes())
            lines.clear()
            assert list(execute_all(square, range(8), scheduler)) == [number**2 for number in range(8)]
            assert all(line.startswith("worker tcp://127.0.0.1:") for line in lines)
            assert len(lines) == len(set(lines)) >= 1
    finally:
        sys.path.remove(str(tmp_path))


def command(*words: object, limit_kib: int | None = None) -> subprocess.Popen[str]:
    line = [sys.executable, "-c", "from evaluation.cli import main; main()", *map(str, words)]
    if limit_kib is not None:
        line = ["bash", "-c", f'ulimit -f {limit_kib}; exec "$@"', "bash", *line]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, errors = process.communicate(timeout=TIMEOUT_S)
    return process.returncode, errors


def lines_of(journal: Path) -> int:
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def contents(folder: Path) -> dict[str, bytes]:
    """All files but those of times."""
    return {
        path.name: path.read_bytes() for path in sorted(folder.iterdir()) if not path.name.startswith("times")
    }


@pytest.fixture(scope="module")
def locally(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The comparison by two processes of this machine."""
    out = tmp_path_factory.mktemp("locally")
    assert ended(command(*COMPARE, "--workers", 2, "--out", out)) == (0, "")
    return contents(out)


def test_a_killed_worker_changes_no_byte(tmp_path: Path, locally: dict[str, bytes]) -> None:
    (tmp_path / "cluster").mkdir()
    with started(tmp_path / "cluster") as running:
        victim = running.add_worker()
        running.add_worker()
        running.wait_for(2)
        run = command(*COMPARE, "--scheduler", running.address, "--out", tmp_path / "out")
        until(lambda: lines_of(tmp_path / "out" / "runs.jsonl") > 0)
        assert run.poll() is None
        victim.kill()
        assert ended(run) == (0, "")
    assert contents(tmp_path / "out") == locally


@pytest.mark.parametrize("at", ["workers", "scheduler"])
def test_a_killed_caller_goes_on_where_it_was(
    two: Cluster, tmp_path: Path, locally: dict[str, bytes], at: str
) -> None:
    who = ("--workers", 2) if at == "workers" else ("--scheduler", two.address)
    first = command(*COMPARE, *who, "--out", tmp_path)
    until(lambda: lines_of(tmp_path / "runs.jsonl") > 0)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    before = (tmp_path / "runs.jsonl").read_bytes().splitlines()
    assert ended(command(*COMPARE, *who, "--out", tmp_path)) == (0, "")
    assert contents(tmp_path) == locally
    assert set(before[:-1]) <= set(locally["runs.jsonl"].splitlines())


@pytest.mark.skipif(os.name == "nt", reason="no ulimit on Windows")
@pytest.mark.parametrize("at", ["workers", "scheduler"])
def test_a_full_disk_is_one_line_and_loses_nothing(
    two: Cluster, tmp_path: Path, locally: dict[str, bytes], at: str
) -> None:
    """The limit tears a line of the journal; what was torn is made again."""
    who = ("--workers", 2) if at == "workers" else ("--scheduler", two.address)
    status, errors = ended(command(*COMPARE, *who, "--out", tmp_path, limit_kib=2))
    assert status == 2
    (line,) = errors.splitlines()
    assert line.startswith(f"smartmot-eval: {tmp_path / 'runs.jsonl'}: cannot be written (File too large); ")
    assert 0 < lines_of(tmp_path / "runs.jsonl") < lines_of_bytes(locally["runs.jsonl"])
    assert ended(command(*COMPARE, *who, "--out", tmp_path)) == (0, "")
    assert contents(tmp_path) == locally


def lines_of_bytes(journal: bytes) -> int:
    return journal.count(b"\n")


def test_a_scheduler_that_is_not_there_or_is_lost_is_one_line(tmp_path: Path, jobs: Any) -> None:
    status, errors = ended(command(*COMPARE, "--scheduler", "tcp://127.0.0.1:1", "--out", tmp_path / "out"))
    assert status == 2
    (line,) = errors.splitlines()
    assert line.startswith("smartmot-eval: --scheduler tcp://127.0.0.1:1: no scheduler answers")
    with started(tmp_path) as running:
        said: list[str] = []

        def lost(text: str) -> None:
            said.append(text)
            running.scheduler.kill()

        with pytest.raises(WorkerError, match="the scheduler was lost"):
            list(execute_all(jobs.square, range(3), Scheduler(running.address, lost)))
        assert said == [
            f"{running.address} has no worker; waiting for one up to {cluster.WITHOUT_WORKERS_S:g} s"
        ]


def scheduler_process(running: Cluster) -> int:
    return int(json.loads((running.folder / "scheduler.json").read_text())["id"].split("-")[-1] or 0)


def test_without_workers_it_ends_in_time(tmp_path: Path, jobs: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "WITHOUT_WORKERS_S", 0.5)
    with (
        started(tmp_path) as running,
        pytest.raises(WorkerError, match=r"no worker came in 0\.5 s; start one"),
    ):
        list(execute_all(jobs.square, range(3), Scheduler(running.address)))


@pytest.mark.parametrize(
    "address", ["127.0.0.1:8786", "tcp://127.0.0.1", "tcp://:8786", "http://h:1", "tcp://h:x"]
)
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(ArgumentError, match=r"--scheduler: expected tcp://HOST:PORT or tls://HOST:PORT, got"):
        Scheduler(address)


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ArgumentError, match=r"need the extra dask .*pip install 'smartmot\[dask\]'"):
        Scheduler("tcp://127.0.0.1:8786")
