"""Jobs in several processes of this machine, or on the workers of a scheduler."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.context import BaseContext
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from evaluation.errors import WorkerError

if TYPE_CHECKING:
    from evaluation.runs.cluster.scheduler import Scheduler

Item = TypeVar("Item")
Result = TypeVar("Result")

Workers: TypeAlias = "int | Scheduler"
"""How many processes of this machine, or the scheduler whose workers do the work."""

WAITING = 2
"""Items that are handed over per process: the one at work, and one that it goes on with."""

LATE = ("scenarios.simulation.follower",)
"""What runs import as they begin, half of all that they import: once for all processes of all pools."""

_SAFE_PATH = "PYTHONSAFEPATH"
"""With it, an interpreter that is started with `-c` does not look into the current folder for modules."""


def available_cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # systems without affinity
        return os.cpu_count() or 1


def told_workers(workers: Workers) -> str:
    """Who works, in words."""
    return f"{workers} processes" if isinstance(workers, int) else str(workers)


def local_processes(workers: Workers) -> int:
    """Processes for what stays on this machine: as many as were asked for, or one per core."""
    return workers if isinstance(workers, int) else available_cores()


def execute_all(
    job: Callable[[Item], Result], items: Sequence[Item], workers: Workers = 1
) -> Iterator[Result]:
    """Carry out a job for many items; the results come in the order of the items.

    See `execute_as_finished`, also for what it raises.
    """
    early: dict[int, Result] = {}
    next_number = 0
    for number, result in execute_as_finished(job, items, workers):
        early[number] = result
        while next_number in early:
            yield early.pop(next_number)
            next_number += 1


def execute_as_finished(
    job: Callable[[Item], Result], items: Sequence[Item], workers: Workers = 1
) -> Iterator[tuple[int, Result]]:
    """Carry out a job for many items; results come as they are finished, with the number of their item.

    An error of the job is raised after the results of all items before. Left before its end, by an error or
    an interrupt, it drops what has not begun and waits for what has; a scheduler's workers stop at once.

    Args:
        job: a function of a module, or a `functools.partial` of one, without side effects: it may be carried
            out on another machine, and twice.
        items: what each call gets.
        workers: processes, with one, this one does the work; or a scheduler.

    Raises:
        WorkerError: a process cannot be started or cannot import what it needs, or was ended from outside, as
            by a system that is out of memory; or a scheduler has no worker that can do the work.
    """
    if not isinstance(workers, int):
        yield from workers.execute(job, items)
    elif min(workers, len(items)) <= 1:
        yield from enumerate(map(job, items))
    else:
        yield from _in_pool(job, items, min(workers, len(items)))


def _in_pool(
    job: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[tuple[int, Result]]:
    """See `execute_as_finished`: in processes of this machine."""
    before = os.environ.get(_SAFE_PATH)
    with _clean_start():
        pool = ProcessPoolExecutor(workers, _context(job), _begin, (before,))
    packed = pickle.dumps(job)
    at_work: dict[Future[Result], int] = {}
    failures: dict[int, Exception] = {}
    numbers = iter(range(len(items)))
    try:
        while True:
            try:
                with _clean_start():  # the processes are started as the calls are handed over
                    while len(at_work) < WAITING * workers and (number := next(numbers, None)) is not None:
                        at_work[pool.submit(_call, packed, pickle.dumps(items[number]))] = number
            except (EOFError, OSError) as error:
                raise WorkerError(
                    f"worker processes cannot be started ({type(error).__name__}: {error}); use --workers 1"
                ) from error
            if not at_work:
                break
            for future in sorted(wait(at_work, return_when=FIRST_COMPLETED).done, key=at_work.__getitem__):
                number = at_work.pop(future)
                if future.cancelled():
                    continue
                failure = future.exception()
                if failure is None:
                    yield number, future.result()
                elif isinstance(failure, Exception) and not isinstance(failure, BrokenProcessPool):
                    failures[number] = failure
                    numbers = iter(())  # what has begun is waited for
                    for waiting in at_work:
                        waiting.cancel()
                else:
                    raise failure
    except BrokenProcessPool:
        raise WorkerError(
            "a worker process was ended from outside, as by a system without memory; try fewer --workers"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    if failures:
        raise failures[min(failures)]


def _context(job: Callable[..., Any]) -> BaseContext:
    """How processes are started.

    A forked copy of a process with threads may hang; these start from a clean one, which imports once. Where
    there is none of that kind, as on Windows, each starts by itself.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    function = job.func if isinstance(job, partial) else job
    context.set_forkserver_preload([str(function.__module__), *LATE])
    return context


def start_early(processes: int | None, module: str) -> None:
    """Let what a later pool's processes come from import what they need, while this process does the same.

    Args:
        processes: how many there are to be; None: one per core.
        module: of the job.
    """
    if (processes or available_cores()) < 2 or "forkserver" not in multiprocessing.get_all_start_methods():
        return
    from multiprocessing import forkserver

    with _clean_start(), suppress(OSError):  # a pool that cannot be started says so itself
        forkserver.set_forkserver_preload([module, *LATE])
        forkserver.ensure_running()


@contextmanager
def _clean_start() -> Iterator[None]:
    """Interpreters started meanwhile run nothing of the user's.

    They do not look into the current folder, which may have a `random.py`: the processes at work have the
    module search path of this one, which has been checked. And they do not run the script that started them
    once more, as `multiprocessing` wants it for scripts whose own functions are called: all that is called
    here is in modules.
    """
    before, main = os.environ.get(_SAFE_PATH), sys.modules["__main__"]
    os.environ[_SAFE_PATH] = "1"
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        _restore(before)


def _restore(safe_path: str | None) -> None:
    if safe_path is None:
        del os.environ[_SAFE_PATH]
    else:
        os.environ[_SAFE_PATH] = safe_path


def _begin(safe_path: str | None) -> None:
    """First thing in a process of the pool: what the user's code starts has the user's environment."""
    _restore(safe_path)
    _obey_parent()


def _call(job: bytes, item: bytes) -> Any:
    """Carry out a job in a process of the pool.

    Job and item come packed: what they import is imported here, where a failure can be told.
    """
    work, given = load_for_work(lambda: (pickle.loads(job), pickle.loads(item)))
    return work(given)


def load_for_work(load: Callable[[], tuple[Any, Any]]) -> tuple[Any, Any]:
    """A job and its item, unpacked in a process that works for another.

    Args:
        load: unpacks them.

    Raises:
        WorkerError: what they need cannot be imported.
    """
    try:
        return load()
    except BaseException as error:  # a module may even leave the interpreter
        frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith("<")]
        place, line, reason = frames[-1].filename, frames[-1].lineno, str(error)
        if isinstance(error, SyntaxError) and error.filename is not None:
            place, line, reason = error.filename, error.lineno, error.msg
        raise WorkerError(
            f"a worker process cannot import what it needs: {type(error).__name__}: "
            f"{' '.join(reason.split())} ({place}, line {line})"
        ) from None


def _obey_parent() -> None:
    """Leave the interrupt to the parent, and end with it even if it is killed.

    The processes of a pool hold both ends of their queue, and would wait for work for ever.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
