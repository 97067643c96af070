"""Jobs on the workers of a scheduler of Dask (`distributed`): items out, results in as they are finished.

Dask brings an item to a worker, and to another one if that is lost. What is ours: a few items are handed over
at a time, so that a million of them never wait there; files travel once to each worker that needs them; and a
worker whose results could be other bytes gets nothing to do.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import logging
import os
import queue
import time
import uuid
import warnings
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import _smartmot
from evaluation.errors import ArgumentError, WorkerError
from evaluation.runs.cluster.on_worker import DONE, FAILED, LOST, REFUSED, Order, Session

Item = TypeVar("Item")
Result = TypeVar("Result")

OPTION = "--scheduler"
KINDS = ("tcp://", "tls://")

ON_WORKER = "evaluation.runs.cluster.on_worker"
CONNECT_S = 10.0
WITHOUT_WORKERS_S = 60.0
"""How long a worker is waited for when there is none."""
LOOK_S = 1.0
"""How often it is looked at which workers are there, while nothing is finished."""
MOST_LOST = 3
"""Processes that may end over one item, as workers may by Dask's own default (`allowed-failures`)."""
WAITING = 2
"""Items per thread of the workers: the one at work, and one that it goes on with."""
MOST_FILES = 256
"""Contents that are kept for items to come."""

NOTHING_DONE = "what was finished before is kept where the command keeps a journal"


@dataclass(frozen=True, slots=True)
class Scheduler:
    """A scheduler by its address.

    Args:
        address: such as `tcp://10.0.0.1:8786`.
        say: takes a line for the user about workers that get nothing to do, or are waited for.
    """

    address: str
    say: Callable[[str], None] = field(default=lambda line: None, compare=False)

    def __post_init__(self) -> None:
        """Check the address, and whether what connects to it is installed."""
        host, _, port = self.address.partition("://")[2].rpartition(":")
        if not self.address.startswith(KINDS) or not host or not port.isdecimal():
            raise ArgumentError(
                f"{OPTION}: expected tcp://HOST:PORT or tls://HOST:PORT, got {self.address!r}"
            )
        if os.name == "nt":
            raise ArgumentError(f"{OPTION}: paths of Windows do not travel; start on Linux or macOS")
        if importlib.util.find_spec("distributed") is None:
            error = ImportError("no module named 'distributed'", name="distributed")
            raise ArgumentError(_smartmot.missing_extra(f"{OPTION}: workers of Dask", "dask", error))

    def __str__(self) -> str:
        """The workers, as a progress bar names them."""
        return f"the workers of {self.address}"

    def execute(self, job: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[tuple[int, Result]]:
        """Carry out a job for many items; see `evaluation.runs.workers.execute_as_finished`.

        Raises:
            WorkerError: the scheduler cannot be reached or was lost, no worker can do the work, or an item
                ended several of them.
        """
        if not items:
            return
        with self._client() as client:
            yield from _Dispatch(self, client, job, items).results()

    @contextmanager
    def _client(self) -> Iterator[Any]:
        """A connection."""
        from distributed import Client
        from distributed.versions import VersionMismatchWarning

        # what goes wrong is said by our errors
        for name in list(logging.root.manager.loggerDict):
            if name.partition(".")[0] == "distributed":
                logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", VersionMismatchWarning)  # what matters is refused
                client = Client(self.address, timeout=CONNECT_S, set_as_default=False, name="smartmot")
        except (OSError, TimeoutError, ValueError) as error:
            raise WorkerError(
                f"{OPTION} {self.address}: no scheduler answers ({' '.join(str(error).split())}); start one "
                "with `dask scheduler`, see docs/scale.md"
            ) from None
        try:
            yield client
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.close(timeout=CONNECT_S)


class _Dispatch:
    """The items of one job on their way."""

    def __init__(
        self, scheduler: Scheduler, client: Any, job: Callable[[Any], Any], items: Sequence[Any]
    ) -> None:
        from evaluation.runs.cluster.parcel import pack
        from evaluation.runs.cluster.surroundings import surroundings

        self._say, self._address, self._client = scheduler.say, scheduler.address, client
        self._items = items
        parcel = pack(job)
        self._job = parcel
        self._session = Session(
            uuid.uuid4().hex[:16], surroundings(), str(Path.cwd()), parcel.packed, tuple(parcel.files)
        )
        self._finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._at_work: dict[Any, int] = {}
        self._contents: OrderedDict[str, Any] = OrderedDict()
        self._refused: dict[str, str] = {}
        self._lost: Counter[int] = Counter()
        self._failures: dict[int, BaseException] = {}
        self._threads = 0
        self._alone_since: float | None = None

    def results(self) -> Iterator[tuple[int, Any]]:
        """See `Scheduler.execute`."""
        from concurrent.futures import CancelledError

        try:
            self._refuse_strangers()
            yield from self._results()
        except (OSError, CancelledError) as error:
            raise WorkerError(
                f"{OPTION} {self._address}: the scheduler was lost ({type(error).__name__}); {NOTHING_DONE}"
            ) from None
        finally:
            self._end()
        if self._failures:
            raise self._failures[min(self._failures)]

    def _results(self) -> Iterator[tuple[int, Any]]:
        from evaluation.runs.cluster.parcel import unpack

        waiting = iter(range(len(self._items)))
        self._look_at_workers()
        while True:
            while len(self._at_work) < max(WAITING * self._threads, 1) and not self._failures:
                number = next(waiting, None)
                if number is None:
                    break
                self._submit(number)
            if not self._at_work:
                return
            for number, kind, content in self._take():
                if kind == DONE:
                    yield number, unpack(content)
                elif kind == FAILED:
                    self._fail(number, unpack(content))
                elif kind == REFUSED:
                    self._refuse(*content)
                    self._submit(number)
                else:
                    self._lost[number] += 1
                    if self._lost[number] >= MOST_LOST:
                        raise WorkerError(f"run {number + 1}: {content}, for the third time; {NOTHING_DONE}")
                    self._submit(number)

    def _submit(self, number: int) -> None:
        """Hand an item over."""
        from evaluation.runs.cluster.on_worker import carry_out
        from evaluation.runs.cluster.parcel import pack

        parcel = pack(self._items[number])
        files = self._job.files | parcel.files
        needs = self._job.needs | parcel.needs
        folders = tuple(dict.fromkeys((*self._job.folders, *parcel.folders)))
        order = Order(parcel.packed, files, needs, folders)
        fitting = self._fitting() if self._refused else None
        contents = {digest: self._content(path, digest) for path, digest in files.items()}
        future = self._client.submit(
            carry_out, self._session, order, contents, pure=False, workers=fitting,
            # what has been refused says so again, rather than that nothing moves when all others are lost
            allow_other_workers=fitting is not None, key=f"smartmot-{uuid.uuid4().hex}",
        )  # fmt: skip
        self._at_work[future] = number
        future.add_done_callback(self._finished.put)

    def _content(self, path: str, digest: str) -> Any:
        """The content of a file, at the scheduler, which brings it to the workers that need it."""
        from evaluation.runs.cluster.parcel import content

        if digest not in self._contents:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
                # of Python's own: it can be called on any worker, and again where one was lost
                self._contents[digest] = self._client.submit(
                    bytes, content(path, digest), key=f"smartmot-file-{digest}"
                )
        self._contents.move_to_end(digest)
        while len(self._contents) > MOST_FILES:
            self._contents.popitem(last=False)
        return self._contents[digest]

    def _take(self) -> list[tuple[int, str, Any]]:
        """What has become of items since; waits for the first."""
        futures = []
        try:
            futures.append(self._finished.get(timeout=LOOK_S))
            while True:
                futures.append(self._finished.get_nowait())
        except queue.Empty:
            pass
        if not futures:
            self._look_at_workers()
            return []
        self._alone_since = None
        ended = [future for future in futures if future in self._at_work]
        good = [future for future in ended if future.status == "finished"]
        outcomes = dict(zip(good, self._client.gather(good), strict=True)) if good else {}
        taken = []
        for future in ended:
            number = self._at_work.pop(future)
            taken.append((number, *(outcomes[future] if future in outcomes else self._unfinished(future))))
        return taken

    def _unfinished(self, future: Any) -> tuple[str, Any]:
        """What became of an item that Dask has no result of."""
        from distributed.scheduler import KilledWorker

        if future.status != "error":
            raise ConnectionError(future.status)
        error = future.exception()
        if isinstance(error, KilledWorker):
            raise WorkerError(
                f"{OPTION} {self._address}: a run ended {error.allowed_failures + 1} workers, the last one "
                f"{error.last_worker.address}; {NOTHING_DONE}"
            )
        if isinstance(error, ImportError | AttributeError) and self._refuse_strangers():
            return LOST, f"the worker has another smartmot ({error})"
        raise WorkerError(
            f"{OPTION} {self._address}: a worker cannot do its work: {type(error).__name__}: "
            f"{' '.join(str(error).split())}"
        )

    def _fail(self, number: int, error: BaseException) -> None:
        """Keep an error of the job; only items before it are still waited for."""
        self._failures[number] = error
        later = [future for future, other in self._at_work.items() if other > min(self._failures)]
        for future in later:
            del self._at_work[future]
        self._client.cancel(later, force=True)

    def _look_at_workers(self) -> None:
        """Count the threads of workers that fit; say, and in the end complain, that there are none.

        Raises:
            WorkerError: there is none for long, or none of them fits.
        """
        if self._client.status != "running":
            raise ConnectionError(self._client.status)
        threads = self._client.nthreads()
        fitting = [address for address in threads if address not in self._refused]
        self._threads = sum(threads[address] for address in fitting)
        if fitting:
            self._alone_since = None
            return
        if self._refused:
            raise WorkerError(
                f"{OPTION} {self._address}: no worker can do the work: {'; '.join(self._refused.values())}"
            )
        now = time.monotonic()
        if self._alone_since is None:
            self._alone_since = now
            self._say(f"{self._address} has no worker; waiting for one up to {WITHOUT_WORKERS_S:g} s")
        elif now - self._alone_since > WITHOUT_WORKERS_S:
            raise WorkerError(
                f"{OPTION} {self._address}: no worker came in {WITHOUT_WORKERS_S:g} s; start one with "
                f"`dask worker {self._address}`; {NOTHING_DONE}"
            )

    def _fitting(self) -> list[str]:
        return [address for address in self._client.nthreads() if address not in self._refused]

    def _refuse(self, address: str, reason: str) -> None:
        """Give a worker nothing more to do."""
        if address in self._refused:
            return
        self._refused[address] = f"worker {address} is refused: {reason}"
        self._look_at_workers()
        self._say(self._refused[address])

    def _refuse_strangers(self) -> bool:
        """Refuse workers on which our module cannot be found; whether there are any."""
        there = self._client.run(importlib.util.find_spec, ON_WORKER, on_error="return")
        strangers = [address for address, spec in there.items() if getattr(spec, "name", "") != ON_WORKER]
        if not strangers:
            return False
        versions = self._client.run(
            importlib.metadata.version, "smartmot", workers=strangers, on_error="return"
        )
        for address, text in versions.items():
            has = f"smartmot {text}, which is another version" if isinstance(text, str) else "no smartmot"
            self._refuse(address, f"it has {has}")
        return True

    def _end(self) -> None:
        """Leave nothing at work."""
        from evaluation.runs.cluster.on_worker import end

        with suppress(Exception):  # the scheduler may be gone
            self._client.cancel([*self._at_work, *self._contents.values()], force=True)
            workers = [address for address in self._client.nthreads() if address not in self._refused]
            self._client.run(end, self._session.name, workers=workers, on_error="ignore")
