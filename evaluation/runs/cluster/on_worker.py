"""What a worker of a scheduler carries out: it hands items to processes of its own, one per thread.

Such a process is what one of the local pool is: it starts anew for each session, so that no code, map or
plug-in of another session is left in it, and whatever the user's code does to it, the worker stays. Only
Python's own library is imported here: the worker itself needs nothing of ours.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any
from xml.sax.saxutils import escape

DONE, FAILED, REFUSED, LOST = "done", "failed", "refused", "lost"
"""What becomes of an item: a packed result or error, a worker that does not fit, a process that ended."""

CHILD = "evaluation.runs.cluster.child"
FOLDER = "smartmot"
"""In the worker's own folder."""


@dataclass(frozen=True, slots=True)
class Session:
    """What all items of one job have in common.

    Args:
        name: of no other session.
        surroundings: what the worker must have as it is at the caller's.
        folder: current folder of the caller.
        job: packed.
        files: that travel with the job; see `Parcel`.
    """

    name: str
    surroundings: Mapping[str, str]
    folder: str
    job: bytes
    files: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Order:
    """An item on its way to a process; see `Parcel`."""

    packed: bytes
    files: Mapping[str, str]
    needs: Mapping[tuple[str, str], str]
    folders: tuple[str, ...]


@dataclass(slots=True)
class _Child:
    """A process for the items of a session, one after another."""

    session: str
    process: subprocess.Popen[bytes]
    asked: IO[bytes]
    answers: IO[bytes]
    refusal: str = ""


@dataclass(slots=True)
class _Mirror:
    """Files of a session as they lie at the caller's, below a root."""

    root: Path
    digests: dict[str, str] = field(default_factory=dict)


_CHILDREN: dict[int, _Child] = {}
"""By thread."""
_MIRRORS: dict[str, _Mirror] = {}
"""By session."""
_LOCK = threading.Lock()


def carry_out(session: Session, order: Order, contents: Mapping[str, bytes]) -> tuple[str, Any]:
    """Carry out an item.

    Args:
        session: what the items have in common.
        order: the item.
        contents: of its files, by their digests.

    Returns:
        What became of it, and the packed result or error, or a text.
    """
    from distributed import get_worker

    worker = get_worker()
    address = str(worker.address)
    mirror = _mirror(session, Path(worker.local_directory) / FOLDER)
    _lay_out(mirror, order.files, contents)
    child = _child(session, mirror)
    if child.refusal:
        return REFUSED, (address, child.refusal)
    try:
        send(child.asked, order)
        kind, content = receive(child.answers)
    except (EOFError, OSError):
        status = _stop(threading.get_ident())
        return LOST, f"its process on the worker {address} ended with status {status}"
    if kind == REFUSED:
        return REFUSED, (address, content)
    return kind, content


def end(session: str) -> None:
    """Stop the processes of a session and remove its files."""
    for thread in [thread for thread, child in list(_CHILDREN.items()) if child.session == session]:
        _stop(thread)
    with _LOCK:
        mirror = _MIRRORS.pop(session, None)
    if mirror is not None:
        shutil.rmtree(mirror.root, ignore_errors=True)


def send(stream: IO[bytes], message: object) -> None:
    """Write a message to a pipe."""
    packed = pickle.dumps(message, protocol=5)
    stream.write(len(packed).to_bytes(8, "big") + packed)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read a message from a pipe.

    Raises:
        EOFError: the other end was closed.
    """
    return pickle.loads(_read(stream, int.from_bytes(_read(stream, 8), "big")))


def _read(stream: IO[bytes], length: int) -> bytes:
    """So many bytes of a pipe, which may come in pieces."""
    parts = []
    while length:
        part = stream.read(length)
        if not part:
            raise EOFError
        parts.append(part)
        length -= len(part)
    return b"".join(parts)


def _child(session: Session, mirror: _Mirror) -> _Child:
    """The process of this thread; of another session than the last one a new one."""
    thread = threading.get_ident()
    child = _CHILDREN.get(thread)
    if (
        child is not None
        and child.session == session.name
        and (child.refusal or child.process.poll() is None)
    ):
        return child
    _stop(thread)
    folder = Path(f"{mirror.root}{session.folder}")
    folder.mkdir(parents=True, exist_ok=True)
    # -P: no module of the folder takes the place of another
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", CHILD], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdin is not None
    assert process.stdout is not None
    child = _CHILDREN[thread] = _Child(session.name, process, process.stdin, process.stdout)
    try:
        send(child.asked, (session, str(mirror.root)))
        child.refusal = receive(child.answers)
    except (EOFError, OSError):
        status = process.wait()
        child.refusal = f"its processes do not start (exit status {status}); its own output says why"
    return child


def _stop(thread: int) -> int | None:
    """Stop the process of a thread; its exit status."""
    child = _CHILDREN.pop(thread, None)
    if child is None:
        return None
    ended = child.process.poll()
    child.process.kill()
    child.process.wait()
    for stream in (child.asked, child.answers):
        with contextlib.suppress(OSError):  # of what was not written when the process ended
            stream.close()
    return child.process.returncode if ended is None else ended


def _mirror(session: Session, folder: Path) -> _Mirror:
    with _LOCK:
        if session.name not in _MIRRORS:
            # of sessions whose caller was killed
            for old in list(_MIRRORS):
                if not any(child.session == old for child in _CHILDREN.values()):
                    shutil.rmtree(_MIRRORS.pop(old).root, ignore_errors=True)
            root = folder.resolve() / session.name
            root.mkdir(parents=True, exist_ok=True)
            _MIRRORS[session.name] = _Mirror(root)
        return _MIRRORS[session.name]


def _lay_out(mirror: _Mirror, files: Mapping[str, str], contents: Mapping[str, bytes]) -> None:
    """Write the files that the mirror has not, or has in another state."""
    with _LOCK:
        for path, digest in files.items():
            if mirror.digests.get(path) == digest:
                continue
            content = contents[digest]
            if hashlib.sha256(content).hexdigest() != digest:
                raise ValueError(f"{path}: damaged on its way to the worker")
            if path.endswith(".xosc"):
                content = _with_moved_references(content, files, str(mirror.root))
            place = Path(f"{mirror.root}{path}")
            place.parent.mkdir(parents=True, exist_ok=True)
            part = place.with_name(f"{place.name}.part{os.getpid()}")
            part.write_bytes(content)
            part.replace(place)
            mirror.digests[path] = digest


def _with_moved_references(scenario: bytes, files: Mapping[str, str], root: str) -> bytes:
    """A scenario whose absolute paths of files that travel lead into the mirror."""
    for path in sorted(files, key=len, reverse=True):
        text = escape(path)
        scenario = scenario.replace(f'"{text}"'.encode(), f'"{escape(root)}{text}"'.encode())
    return scenario
