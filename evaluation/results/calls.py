"""Which call wrote a folder of results, and which files: so that results of two calls are never mixed.

A folder has a file `.smartmot-call`: in its first line the command and the arguments that determine results,
in each further one a file that was written. Another call removes these files before it writes its first, and
no others: what a user has put there stays.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

CALL = ".smartmot-call"

_open: Path | None = None
"""Folder whose files are noted."""
_to_replace: tuple[str, tuple[str, ...], Callable[[], None]] | None = None
"""Call that begins in it with its first file, the files of the call before, and who says that these go."""


def call_text(command: str, arguments: Mapping[str, str]) -> str:
    """A call as a line."""
    return json.dumps({"command": command, "arguments": dict(arguments)}, sort_keys=True)


def call_of(folder: Path) -> str | None:
    """The call whose results a folder holds; None: it has no note of one."""
    lines = _lines(folder)
    return lines[0] if lines else None


def begin(folder: Path, call: str, say: Callable[[], None] = lambda: None) -> None:
    """Note a call, and from now on the files that are written into the folder, which must exist.

    Files of another call are removed when the first is written: a call that fails before costs nothing.

    Args:
        folder: of the results.
        call: `call_text`.
        say: called when files of another call are removed.

    Raises:
        OSError: the folder cannot be written.
    """
    global _open, _to_replace
    _open, _to_replace = folder.resolve(), None
    first, *names = _lines(folder) or [call]
    # nothing is touched that lies elsewhere, whatever the file says
    written = [name for name in dict.fromkeys(names) if _is_inside(_open / name) and (_open / name).is_file()]
    if first != call and written:
        _to_replace = call, tuple(written), say
    else:
        _write(_open, call, written)


def go_on(folder: Path) -> None:
    """Note further files of a folder of results, if its call is known."""
    global _open, _to_replace
    _open, _to_replace = (folder.resolve() if call_of(folder) is not None else None), None


def end() -> None:
    """Note no more files."""
    global _open, _to_replace
    _open = _to_replace = None


def note(path: Path) -> None:
    """Note a file that is about to be written, if it lies in the folder of the call.

    Raises:
        OSError: it cannot be noted, or a file of another call cannot be removed.
    """
    global _to_replace
    if _open is None or not _is_inside(path):
        return
    if _to_replace is not None:
        (call, names, say), _to_replace = _to_replace, None
        say()
        _remove(_open, names)
        _write(_open, call, ())
        path.parent.mkdir(parents=True, exist_ok=True)  # it was empty then
    with (_open / CALL).open("a", encoding="utf-8") as file:
        file.write(f"{(path.parent.resolve() / path.name).relative_to(_open).as_posix()}\n")


def _is_inside(path: Path) -> bool:
    return _open is not None and path.parent.resolve().is_relative_to(_open)


def _remove(folder: Path, names: Sequence[str]) -> None:
    """Remove files, and the folders that are empty then."""
    for name in names:
        (folder / name).unlink(missing_ok=True)
    for place in sorted({(folder / name).parent for name in names} - {folder}, reverse=True):
        with contextlib.suppress(OSError):  # something else is there, too
            place.rmdir()


def _write(folder: Path, call: str, names: Sequence[str]) -> None:
    (folder / CALL).write_text("".join(f"{line}\n" for line in (call, *names)), encoding="utf-8")


def _lines(folder: Path) -> list[str]:
    """The call, and names of files."""
    try:
        return (folder / CALL).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
