"""Many short runs on local processes and on the workers of a scheduler: efficiency, and overhead per run.

    python -m benchmarks.scale_out [--runs 10000] [--workers 1,2] [--out benchmarks/scale_out.json]
    python -m benchmarks.scale_out --only pool_1   # a part; what is in the file is not measured again
    python -m benchmarks.scale_out --page   # docs/scale.md again, from the file

The runs are those of the paper's test (CPNA) at 10, 20, ... 60 km/h with two strategies, with a seed for each
dozen. Efficiency with k workers is the time of the runs, one after another in this process, over k times what
they took there; the runs of both are the same. On a machine that others use it says little; the share of the
workers' time that is spent in runs, and processor times, say more there, and all of them are in the file.
Scheduler and workers are processes of this machine, in a folder of their own.

Each way of carrying out the runs is a part, after which the file is written: stopped, the benchmark goes on
with the next. Parts of another commit, machine or number of runs are measured anew.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive
    sys.path[0] = str(ROOT)

from evaluation.results.files import write_whole
from evaluation.runs.fingerprint import digest_of

FILE = ROOT / "benchmarks" / "scale_out.json"
PAGE = ROOT / "docs" / "scale.md"
BEGIN, END = "<!-- computed from benchmarks/scale_out.json -->\n", "<!-- end -->\n"
ALONE = 12
"""Runs that are timed one after another, before and after each of the others."""
MILLION = 1_000_000


def specs(count: int) -> list[Any]:
    """The first runs of the test, seed by seed."""
    from evaluation.runs.cpna import CpnaSuite, load_site
    from evaluation.runs.specs import Conditions

    suite = CpnaSuite(
        tuple(range(10, 61, 10)), Conditions(("rectangular", "map"), "paper", ("dry",), "urban_street")
    )
    dozen = suite.specs(load_site(suite))
    return [replace(dozen[k % len(dozen)], seed=k // len(dozen)) for k in range(count)]


def timed(spec: Any) -> tuple[Any, Any, float, float]:
    """A run: its row, its time per frame, and what it took, on the clock and of the processor."""
    from evaluation.runs.execution import execute

    wall_s, cpu_s = time.perf_counter(), time.process_time()
    record = execute(spec, keep_log=False)
    return record.row, record.spent, time.perf_counter() - wall_s, time.process_time() - cpu_s


@contextlib.contextmanager
def cluster(count: int) -> Iterator[tuple[str, list[int]]]:
    """A scheduler with workers of one thread each: its address, and all processes."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as stack:

        def start(*words: str) -> int:
            line = [sys.executable, "-m", f"distributed.cli.{words[0]}", "--no-dashboard", *words[1:]]
            process = stack.enter_context(
                subprocess.Popen(line, cwd=scratch, env=environment, stderr=subprocess.DEVNULL)
            )
            stack.callback(process.terminate)
            return process.pid

        file = Path(scratch) / "scheduler.json"
        processes = [
            start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        ]
        while not file.exists() or not file.read_bytes().endswith(b"}"):
            time.sleep(0.05)
        address = json.loads(file.read_bytes())["address"]
        processes += [start("dask_worker", address, "--nthreads", "1", "--no-nanny") for _ in range(count)]
        from distributed import Client

        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(count)
        yield address, processes


def spent_s(process: int) -> float:
    """Processor time of a process and of its children that have ended."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def measure(runs: list[Any], workers: Any, processes: list[int]) -> tuple[dict[str, float], list[Any]]:
    """Carry out runs behind a journal."""
    from benchmarks.scale_out import timed  # by a name that workers can import
    from evaluation.results.rows import RunRow
    from evaluation.runs.journal import Journal

    ends: list[float] = []
    busy: list[tuple[float, float]] = []

    def kept(spec: Any, result: tuple[Any, Any, float, float]) -> tuple[Any, Any]:
        ends.append(time.perf_counter())
        busy.append(result[2:])
        return result[:2]

    others_s = sum(map(spent_s, processes))
    own_s, begin = spent_s(os.getpid()), time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        with Journal(Path(scratch), RunRow) as journal:
            items = {f"{k:024x}": spec for k, spec in enumerate(runs)}
            finished, _ = journal.carry_out(timed, items, workers, kept=kept)
        size = (Path(scratch) / "runs.jsonl").stat().st_size
        held = held_bytes(Path(scratch), list(items))
    end = time.perf_counter()
    work_s = sum(cpu for _, cpu in busy)
    others_s = sum(map(spent_s, processes)) - others_s
    own_s = spent_s(os.getpid()) - own_s
    values = {
        "wall_s": end - begin,
        "first_result_s": ends[0] - begin,
        "runs_wall_s": sum(wall for wall, _ in busy),
        "runs_cpu_s": work_s,
        "caller_cpu_s": own_s if processes else 0.0,
        "all_cpu_s": own_s + others_s,
        "journal_bytes": size,
        "held_bytes": held,
    }
    return values, [finished[key][0] for key in items]  # in their order, whichever was finished first


def held_bytes(folder: Path, keys: list[str]) -> int:
    """Memory that the caller has for what is kept of finished runs."""
    from evaluation.results.rows import RunRow
    from evaluation.runs.journal import Journal

    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    with Journal(folder, RunRow) as journal:
        finished = journal.finished(dict.fromkeys(keys))
        after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(finished) == len(keys)
    return after - before


def known_parts(out: Path, count: int) -> dict[str, Any]:
    """What the file has of this benchmark, on this machine and of this code."""
    content = measured(out)
    if content is None or content.get("made_with") != made_with(count):
        return {}
    return content


def made_with(count: int) -> dict[str, object]:
    """What makes parts comparable."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return {
        "runs": count,
        "commit": commit.stdout.strip(),
        "python": platform.python_version(),
        "machine": platform.node(),
        "cores": len(os.sched_getaffinity(0)),
    }


def run_benchmark(count: int, parts: list[str], out: Path) -> None:
    """Measure the parts that the file does not have, compare the rows, and write the file after each."""
    from evaluation.runs.cluster.scheduler import Scheduler

    runs = specs(count)
    few = runs[: max(count // 4, *(int(name.rpartition("_")[2]) for name in parts))]
    content = known_parts(out, count)
    results: dict[str, Any] = content.get("results", {})
    alone: list[list[float]] = content.get("alone", [])
    for spec in runs[:12]:
        timed(spec)
    for name in parts:
        if name in results:
            print(name, "is in the file")
            continue
        kind, _, text = name.partition("_")
        k = int(text)
        alone += [list(timed(spec)[2:]) for spec in runs[:ALONE]]
        with contextlib.ExitStack() as stack:
            workers: Any = k
            processes: list[int] = []
            if kind == "scheduler":
                address, processes = stack.enter_context(cluster(k))
                workers = Scheduler(address, print)
            small, _ = measure(few, workers, processes)
            large, rows = measure(runs, workers, processes)
        large["rows"] = digest_of([dataclasses.asdict(row) for row in rows])
        others = {part["all"]["rows"] for part in results.values()}
        assert others <= {large["rows"]}, f"other rows than before: {name}"
        results[name] = {"few": small, "all": large}
        print(name, json.dumps(large))
        content = {
            "made_with": made_with(count),
            "runs": count,
            "few": len(few),
            "alone": alone,
            "alone_wall_s": statistics.median(wall for wall, _ in alone),
            "alone_cpu_s": statistics.fmean(cpu for _, cpu in alone),
            "load": os.getloadavg()[1],
            "cores": len(os.sched_getaffinity(0)),
            "results": results,
        }
        write_whole(out, (json.dumps(content, indent=1) + "\n").encode())
    if any(name.startswith("scheduler") for name in results):
        print(section(content))


def overheads(content: dict[str, Any], name: str) -> dict[str, float]:
    """What one way of carrying out the runs costs beside them."""
    few, runs = content["few"], content["runs"]
    small, large = (content["results"][name][part] for part in ("few", "all"))
    k = int(name.rpartition("_")[2])

    def beside_s(values: dict[str, float]) -> float:
        return values["all_cpu_s"] - values["runs_cpu_s"]

    per_run_s = (beside_s(large) - beside_s(small)) / (runs - few)
    return {
        "efficiency": content["alone_wall_s"] * runs / (k * large["wall_s"]),
        "busy": large["runs_wall_s"] / (k * large["wall_s"]),
        "busy_started": large["runs_wall_s"] / (k * (large["wall_s"] - large["first_result_s"])),
        "per_run_s": per_run_s,
        "start_s": beside_s(large) - per_run_s * runs,
        "caller_s": (large["caller_cpu_s"] - small["caller_cpu_s"]) / (runs - few),
    }


def section(content: dict[str, Any] | None) -> str:
    """What the page says of the measurement, and what a million runs need by it; None: there is none."""
    if content is None:
        return "It has not been run on a machine of its own yet, so that nothing is computed here.\n"
    runs, run_s = content["runs"], content["alone_cpu_s"]
    lines = [
        f"Measured with {runs:,} runs of the paper's test, on {content['cores']} cores at a load of "
        f"{content['load']:.0f} by whatever else the machine did. A run takes {1e3 * run_s:.0f} ms of a "
        "processor.",
        "",
        "| | efficiency on the clock | workers' time that is spent in runs | the same after the start | "
        "processor time beside a run | and for the start |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in content["results"]:
        kind, _, k = name.partition("_")
        costs = overheads(content, name)
        who = (
            f"{k} process{'es' * (k != '1')} here"
            if kind == "pool"
            else f"scheduler, {k} worker{'s' * (k != '1')}"
        )
        beside = f"{1e3 * costs['per_run_s']:.1f} ms | {round(costs['start_s'], 1) + 0.0:.1f} s"
        if kind == "pool" and k != "1":
            beside = "– | –"  # processes of a local pool are children of another one, and are not measured
        lines.append(
            f"| {who} | {costs['efficiency']:.2f} | {costs['busy']:.2f} | {costs['busy_started']:.2f} | "
            f"{beside} |"
        )
    last = max(
        (name for name in content["results"] if name.startswith("scheduler")), key=lambda n: int(n[10:])
    )
    costs = overheads(content, last)
    total_h = MILLION * (run_s + costs["per_run_s"]) / 3600
    share = costs["per_run_s"] / (run_s + costs["per_run_s"])
    feeds = run_s / costs["caller_s"]
    size, held = (content["results"][last]["all"][name] / runs for name in ("journal_bytes", "held_bytes"))
    lines += [
        "",
        "A million of these runs need by that:",
        "",
        f"- {total_h:.0f} hours of one core, {100 * share:.1f} % of them beside the runs;",
        *(
            f"- with {cores} workers {total_h / cores:.1f} hours;"
            for cores in (16, 64, 256)
            if cores <= feeds
        ),
        f"- a caller that spends {1e3 * costs['caller_s']:.1f} ms per run, and so keeps up with "
        f"{feeds:.0f} workers at most;",
        f"- {MILLION * held / 1e9:.1f} GB of the caller's memory for their rows ({held:.0f} bytes each);",
        f"- {MILLION * size / 1e9:.2f} GB for the journal ({size:.0f} bytes per run).",
        "",
    ]
    return "\n".join(lines)


def measured(file: Path = FILE) -> dict[str, Any] | None:
    """What the benchmark wrote; None: nothing yet."""
    content: dict[str, Any] | None = json.loads(file.read_text()) if file.is_file() else None
    return content


def write_page(content: dict[str, Any] | None, page: Path = PAGE) -> None:
    """Put the section into the page."""
    page.write_text(page_with(page.read_text(), content))


def page_with(text: str, content: dict[str, Any] | None) -> str:
    """The page with the section of a measurement."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n{section(content)}\n{END}{rest.partition(END)[2]}"


def main() -> None:
    """Run the benchmark, or write the page again."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--out", type=Path, default=FILE)
    parser.add_argument("--only", help="parts, comma-separated, such as pool_2,scheduler_2; default: all")
    parser.add_argument("--page", action="store_true")
    given = parser.parse_args()
    if not given.page:
        every = [f"{kind}_{k}" for k in given.workers.split(",") for kind in ("pool", "scheduler")]
        run_benchmark(given.runs, given.only.split(",") if given.only else every, given.out)
    else:
        write_page(measured(given.out))


if __name__ == "__main__":
    main()
