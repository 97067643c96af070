"""Jobs in several processes."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Any, TypeVar

from evaluation.errors import WorkerError

Item = TypeVar("Item")
Result = TypeVar("Result")


def execute_all(job: Callable[[Item], Result], items: Sequence[Item], workers: int = 1) -> Iterator[Result]:
    """Carry out a job for many items; the results come in the order of the items.

    Left before its end, by an error or an interrupt, it drops what has not begun and waits for what has.

    Args:
        job: a function of a module, or a `functools.partial` of one, without side effects on this process.
        items: what each call gets.
        workers: processes; with one, this one does the work.

    Raises:
        WorkerError: a process was ended from outside, as by a system that is out of memory.
    """
    workers = min(workers, len(items))
    if workers <= 1:
        yield from map(job, items)
        return
    # a forked copy of a process with threads may hang; these start from a clean one, which imports once
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([_module_of(job)])
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_obey_parent)
    try:
        yield from pool.map(job, items, chunksize=1)
    except BrokenProcessPool:
        raise WorkerError(
            "a worker process was ended from outside, as by a system without memory; try fewer --workers"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _module_of(job: Callable[..., Any]) -> str:
    return str((job.func if isinstance(job, partial) else job).__module__)


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
