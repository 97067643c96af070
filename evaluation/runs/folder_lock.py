"""One process per folder of results."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LOCK = ".smartmot-lock"
"""File in a folder that a process writes into; it holds the number of the process, and is removed at the end.
A process that was killed leaves the file, but not the lock."""


@dataclass(slots=True)
class _Held:
    """A lock of this process: the open file, and how often it was taken."""

    file: IO[str]
    count: int = 1


_HELD: dict[tuple[int, Path], _Held] = {}
"""Locks by process, since a forked copy has none, and folder."""


def writable_folder(path: Path) -> Path:
    """Make a folder for results and see that files can be written there.

    Raises:
        ArgumentError: it cannot be made or written to.
    """
    probe = path / ".smartmot-write-test"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ArgumentError(f"--out: cannot write to folder {path}: {reason}; choose another one") from None
    return path


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[bool]:
    """Keep other processes from writing into a folder, which is made if needed.

    Yields:
        Whether the lock is new; within a process it can be taken several times.

    Raises:
        ResultsError: another process has it, or the folder cannot be written.
    """
    new = take(folder)
    try:
        yield new
    finally:
        release(folder)


def take(folder: Path) -> bool:
    """Take the lock of a folder, as `locked` does; `release` must follow."""
    key = _key(folder)
    if key in _HELD:
        _HELD[key].count += 1
        return False
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        while True:
            file = path.open("a+", encoding="utf-8")
            try:
                _lock(file)
                if _is_there(file, path):
                    break
            except BlockingIOError:
                raise ResultsError(
                    f"{folder}: {_who(file)} writes into this folder; wait for it, or choose another one "
                    "(--out)"
                ) from None
            except BaseException:
                file.close()
                raise
            file.close()  # the process before has removed it in between
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ResultsError(f"{folder}: cannot be written ({reason}); choose another folder (--out)") from None
    _HELD[key] = _Held(file)
    return True


def release(folder: Path) -> None:
    """Give the lock of a folder back."""
    key = _key(folder)
    held = _HELD.get(key)
    if held is None:
        return
    held.count -= 1
    if held.count:
        return
    del _HELD[key]
    path = folder / LOCK
    with contextlib.suppress(OSError):
        if sys.platform == "win32":  # which removes no open file
            held.file.close()
            path.unlink()
        else:
            path.unlink()
            held.file.close()


def _key(folder: Path) -> tuple[int, Path]:
    return os.getpid(), folder.resolve()


def _lock(file: IO[str]) -> None:
    """Lock a file without waiting.

    Raises:
        BlockingIOError: another process has locked it.
    """
    if sys.platform == "win32":
        try:
            # far behind the text, which others may then still read
            file.seek(1 << 20)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            raise BlockingIOError from None
    else:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_there(file: IO[str], path: Path) -> bool:
    """Whether a path still leads to an open file."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _who(file: IO[str]) -> str:
    """The process that has locked a file."""
    with file:
        file.seek(0)
        text = file.read(20).strip()
    return f"process {text}" if text.isdigit() else "another process"
