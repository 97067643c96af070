"""The command `smartmot-eval reports`: the reference results made again, or a part of them checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rich.console

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.studies.reference.kept import read_rows
from evaluation.studies.reference.parts import PARTS
from evaluation.studies.reference.readme import README, render
from evaluation.studies.study import JOURNAL, Study, done_line

CHECKED_RUNS = 3
"""Runs of each part that a check makes again."""

TOLERANCE = 1e-6
"""Relative and absolute, between numbers kept and made again: they are printed in full, and equal but for
the last digits of other processors and libraries."""


def choose_parts(names: Sequence[str]) -> tuple[Study[Any, Any], ...]:
    """Parts by name; none: all.

    Raises:
        ArgumentError: there is none of that name.
    """
    known = {part.name: part for part in PARTS}
    for name in names:
        if name not in known:
            raise ArgumentError(f"--only: no part {name!r}; there are: {', '.join(known)}")
    return tuple(part for part in PARTS if not names or part.name in names)


def make_reports(out: Path, names: Sequence[str], workers: int, quiet: bool) -> None:
    """Make the reference results, or go on with it, and the page that tells them.

    Args:
        out: folder of the results.
        names: parts; none: all.
        workers: processes.
        quiet: print nothing.

    Raises:
        ArgumentError: an unknown part.
        ResultsError: the folder cannot be written.
    """
    console = rich.console.Console(quiet=quiet)
    parts = choose_parts(names)
    seen: set[tuple[str, str]] = set()
    before = 0
    (out / JOURNAL).mkdir(parents=True, exist_ok=True)
    for part in (part.given(out) for part in parts):
        folder = out / part.name
        folder.mkdir(parents=True, exist_ok=True)
        items = part.items(part.place(out))
        keys = {(part.journal, item.key) for item in items}
        shared = len(keys & seen)
        seen |= keys
        finished, old = part.carry_out_behind_bar(
            items, out / JOURNAL, part.journal, workers, console, part.name
        )
        before += old - shared
        part.write(folder, items, finished)
    total = len(seen)
    console.print(done_line(total, before, out, [part.name for part in parts]), highlight=False)
    missing = [part.name for part in PARTS if not (out / part.name / part.table).is_file()]
    if missing:
        console.print(f"{README} is written when all parts are there; missing: {', '.join(missing)}")
        return
    try:
        (out / README).write_text(render(out), encoding="utf-8")
    except OSError as error:
        raise ResultsError(f"{out / README}: cannot be written ({error.strerror})") from None


def check_reports(out: Path, names: Sequence[str], count: int = CHECKED_RUNS) -> list[str]:
    """Make a few runs of each part again, and compare them and the page with what is kept.

    Args:
        out: folder of the results.
        names: parts; none: all.
        count: runs of each part.

    Returns:
        What differs, one line each.

    Raises:
        ArgumentError: an unknown part.
        ResultsError: results are missing or not understood.
    """
    lines = [line for part in choose_parts(names) for line in drift(part, out / part.name, count)]
    page = out / README
    if not names and (not page.is_file() or page.read_text(encoding="utf-8") != render(out)):
        lines.append(f"{page}: not what the tables beside it give today")
    return lines


def drift(part: Study[Any, Any], folder: Path, count: int) -> list[str]:
    """Differences between what is kept of a part and some of its runs made again.

    Raises:
        ResultsError: the part's table is missing.
    """
    rows, lines = read_rows(folder / part.table), []
    with TemporaryDirectory() as scratch:
        total, items = part.given(folder.parent).some(count, Path(scratch))
        if len(rows) != total:
            return [f"{part.name}: {len(rows)} runs are kept, {total} belong to it today"]
        for k, item in items.items():
            measured, _ = part.job(item)
            kept = rows[k]
            lines += [
                f"{part.name}, run {k + 1}, {name}: {kept[name] or 'nothing'} is kept, {value} comes out"
                for name, value in dataclasses.asdict(measured).items()
                if name in kept and not _same(kept[name], value)
            ]
    return lines


def _same(kept: str, value: Any) -> bool:
    if value is None:
        return not kept
    if isinstance(value, bool):
        return kept.lower() == str(value).lower()
    if isinstance(value, (int, float)):
        try:
            return math.isclose(float(kept), value, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
        except ValueError:
            return False
    return kept == str(value)
