"""The command `smartmot-eval reference`: the reference results made again, or a part of them checked."""

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
from evaluation.runs.workers import Workers
from evaluation.studies.answers.study import Question
from evaluation.studies.reference import readme
from evaluation.studies.reference.article import article
from evaluation.studies.reference.article.article import ARTICLE
from evaluation.studies.reference.article.page import PAGE, PRINTED, page, print_pdf
from evaluation.studies.reference.findings.answers import read
from evaluation.studies.reference.kept import read_json, read_rows
from evaluation.studies.reference.outside import without_data
from evaluation.studies.reference.parts import PARTS, QUESTIONS
from evaluation.studies.reference.readme import README
from evaluation.studies.study import JOURNAL, Study, done_line

CHECKED_RUNS = 3
"""Runs of each part that a check makes again."""

TOLERANCE = 1e-6
"""Relative and absolute, between numbers kept and made again: they are printed in full, and equal but for
the last digits of other processors and libraries."""


def choose_parts(names: Sequence[str]) -> tuple[Study[Any, Any], ...]:
    """Parts by name, or by the folder that they are in; none: all.

    Raises:
        ArgumentError: there is none of that name.
    """
    known = [part.name for part in PARTS]
    for name in names:
        if not any(_is_called(part, name) for part in known):
            raise ArgumentError(f"--only: no part {name!r}; there are: {', '.join(known)}")
    return tuple(part for part in PARTS if not names or any(_is_called(part.name, name) for name in names))


def _is_called(part: str, name: str) -> bool:
    return part == name or part.startswith(f"{name}/")


def with_data(
    parts: Sequence[Study[Any, Any]], outside: Path | None
) -> tuple[list[Study[Any, Any]], dict[str, str]]:
    """The parts that can be made, with their data from outside, and what the others lack, by name."""
    lacks = {part.name: lack for part in parts if (lack := without_data(part.needs, outside))}
    there = [part for part in parts if part.name not in lacks]
    return [part if outside is None else part.with_outside(outside) for part in there], lacks


def make_reports(
    out: Path, names: Sequence[str], workers: Workers, quiet: bool, outside: Path | None = None
) -> None:
    """Make the reference results, or go on with it, and the page that tells them.

    Args:
        out: folder of the results.
        names: parts; none: all.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.
        outside: folder of data of others; None: parts that need them are left as they are.

    Raises:
        ArgumentError: an unknown part.
        ResultsError: the folder cannot be written.
    """
    console = rich.console.Console(quiet=quiet)
    parts, lacks = with_data(choose_parts(names), outside)
    for name, lack in lacks.items():
        console.print(f"{name} is left as it is: {lack}", highlight=False, soft_wrap=True)
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
    missing = [part.name for part in PARTS if not part.needs and not (out / part.name / part.table).is_file()]
    if missing:
        console.print(
            f"{README} and {ARTICLE} are written when all parts are there; missing: {', '.join(missing)}"
        )
        return
    _write_pages(out)


def write_again(out: Path, names: Sequence[str], quiet: bool) -> None:
    """Write tables, figures and page of questions again from their kept runs, which stay as they are.

    For what is told or drawn otherwise than before. Runs of sides that a question has no more are left out;
    the file of settings keeps the versions that carried the runs out.

    Args:
        out: folder of the results.
        names: questions; none: all.
        quiet: print nothing.

    Raises:
        ArgumentError: an unknown part, or one whose tables need more than a line per run.
        ResultsError: kept runs are missing or of other sides, or the folder cannot be written.
    """
    console = rich.console.Console(quiet=quiet)
    parts = choose_parts(names or [question.name for question in QUESTIONS])
    for part in parts:
        if not isinstance(part, Question):
            raise ArgumentError(f"--tables: {part.name} is written from its runs alone; make it again")
    for question in (part for part in parts if isinstance(part, Question)):
        folder = out / question.name
        kept = read(question, out, in_part=True)
        before = len(read_rows(folder / question.table)) // len(kept.results.scenes)
        stored = read_json(folder / "study.json")
        made_by = {name: stored[name] for name in ("version", "versions")}
        kept.question.write_answer(folder, kept.results, kept.question.answer(kept.results), made_by)
        left_out = before - len(kept.question.arms)
        omitted = f"; runs of {left_out} sides that it has no more are left out" if left_out else ""
        console.print(f"{question.name}: written again from its runs{omitted}", highlight=False)
    _write_pages(out)


def print_article(out: Path) -> Path:
    """Print the article as a PDF.

    Raises:
        ArgumentError: no browser prints it.
        ResultsError: it is not there.
    """
    if not (out / PAGE).is_file():
        raise ResultsError(f"{out / PAGE}: missing; make it with smartmot-eval reference --tables")
    print_pdf(out / PAGE, out / PRINTED)
    return out / PRINTED


def pages(reports: Path) -> dict[str, str]:
    """The page of all results and the article, by file name, from the tables in a folder.

    Raises:
        ResultsError: a table or figure is missing, or of another version.
    """
    text = article.render(reports)
    return {README: readme.render(reports), ARTICLE: text, PAGE: page(text, reports)}


def _write_pages(out: Path) -> None:
    for name, text in pages(out).items():
        try:
            (out / name).write_text(text, encoding="utf-8")
        except OSError as error:
            raise ResultsError(f"{out / name}: cannot be written ({error.strerror})") from None


def check_reports(
    out: Path, names: Sequence[str], count: int = CHECKED_RUNS, outside: Path | None = None
) -> list[str]:
    """Make a few runs of each part again, and compare them and the page with what is kept.

    Parts whose data are not there are left out; see `with_data`.

    Args:
        out: folder of the results.
        names: parts; none: all.
        count: runs of each part.
        outside: folder of data of others; None: there is none.

    Returns:
        What differs, one line each.

    Raises:
        ArgumentError: an unknown part.
        ResultsError: results are missing or not understood.
    """
    parts, _ = with_data(choose_parts(names), outside)
    lines = [line for part in parts for line in drift(part, out, count)]
    for name, text in ({} if names else pages(out)).items():
        path = out / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            lines.append(f"{path}: not what the tables beside it give today")
    return lines


def drift(part: Study[Any, Any], out: Path, count: int) -> list[str]:
    """Differences between what is kept of a part and some of its runs made again.

    Args:
        part: of the reference results.
        out: folder of the results.
        count: runs that are made again.

    Raises:
        ResultsError: the part's table is missing.
    """
    rows, lines = read_rows(out / part.name / part.table), []
    with TemporaryDirectory() as scratch:
        total, items = part.given(out).some(count, Path(scratch))
        if len(rows) != total:
            return [f"{part.name}: {len(rows)} runs are kept, {total} belong to it today"]
        for k, item in items.items():
            measured, _ = part.kept(item, part.job(item))
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
