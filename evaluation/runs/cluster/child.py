"""A process of a worker: reads items from its input, carries them out, writes what became of them.

Its output is for the worker alone; what the user's code prints goes to the worker's own output.
"""

from __future__ import annotations

import os
import select
import signal
import sys
from pathlib import Path
from typing import IO, Any

from evaluation.errors import WorkerError
from evaluation.runs.cluster.on_worker import DONE, FAILED, REFUSED, Order, Session, receive, send
from evaluation.runs.cluster.parcel import PLUGIN, pack_result, state, unpack
from evaluation.runs.cluster.surroundings import differences, surroundings
from evaluation.runs.workers import load_for_work

IDLE_S = 600.0
"""A process whose caller was killed ends after so long."""


def main() -> None:
    """Carry out items until the input is closed, or nothing has come for long."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # left to the worker
    asked, answers = _own_streams()
    session, root = receive(asked)
    refusal = differences(session.surroundings, surroundings())
    send(answers, refusal)
    if refusal:
        return
    known: dict[tuple[str, str], str] = {}
    while select.select([asked], [], [], IDLE_S)[0]:
        try:
            order = receive(asked)
        except EOFError:
            return
        send(answers, _answer(session, root, order, known))


def _own_streams() -> tuple[IO[bytes], IO[bytes]]:
    """Input and output, which the user's code shall neither read nor write."""
    # unbuffered: else `select` would wait for what has been read already
    asked, answers = os.fdopen(os.dup(0), "rb", buffering=0), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return asked, answers


def _answer(session: Session, root: str, order: Order, known: dict[tuple[str, str], str]) -> tuple[str, Any]:
    """What becomes of an item."""
    current_folder = str(Path.cwd())
    for folder in order.folders:
        moved = f"{root}{folder}"
        # the current folder is looked through as it is at the caller's: after all others
        if moved != current_folder and moved not in sys.path:
            sys.path.insert(0, moved)
    for need, wanted in order.needs.items():
        if need not in known:
            known[need] = state(need)
        if known[need] != wanted:
            return REFUSED, _refusal(need, known[need], wanted)
    try:
        job, item = load_for_work(
            lambda: (unpack(session.job, root, session.files), unpack(order.packed, root, order.files))
        )
        return DONE, pack_result(job(item), root)
    except (Exception, SystemExit) as error:
        return FAILED, _packed_error(error, root)


def _refusal(need: tuple[str, str], there: str, wanted: str) -> str:
    kind, name = need
    if kind == PLUGIN:
        return f"its {kind} {name} is {'another' if there else 'missing'}"
    return f"{name} {there or 'none'}, here {wanted}"


def _packed_error(error: BaseException, root: str) -> bytes:
    """An error as bytes that the caller can read."""
    try:
        packed = pack_result(error, root)
        unpack(packed)
    except Exception:
        text = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return pack_result(WorkerError(text), root)
    return packed


if __name__ == "__main__":
    main()
