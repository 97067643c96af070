"""Which scenario files run: each is read and begun, or also run unbraked to its end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

from scenarios.openscenario.errors import FileReadError, OpenScenarioError
from scenarios.openscenario.reading.distributions import admissible, expand
from scenarios.openscenario.reading.document import Node, parse
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.driving.criteria import Criterion
from scenarios.openscenario.running.engine import Engine

Verdict = Literal["supported", "noted", "refused"]

TIME_LIMIT_S = 300.0
"""A run without an end of its own is cut off: UN R157's free driving, the longest test, lasts 5 minutes."""


@dataclass(frozen=True, slots=True)
class FileCheck:
    """What came of a file.

    Args:
        path: the file.
        version: of the standard, as the file gives it.
        verdict: supported; noted: it runs, and something of it is not used or not as the file asks for it.
        lines: notes, or why it is refused.
        outcome: how the run ended; empty if it was not run.
        criteria: what the file judges a run by, and what came of it.
    """

    path: Path
    version: str
    verdict: Verdict
    lines: tuple[str, ...]
    outcome: str = ""
    criteria: tuple[Criterion, ...] = ()


def check(path: str | PathLike[str], road: str | PathLike[str] | None = None, run: bool = False) -> FileCheck:
    """Read a scenario or distribution file and begin its first variation that keeps its constraints.

    Args:
        path: the `.xosc` file.
        road: see `load`.
        run: also run it unbraked, to its end or for 300 s.
    """
    file = Path(path)
    version, outcome = "?", ""
    try:
        header = Node(parse(file), file, {}).need("FileHeader")
        version = f"{header.element.get('revMajor')}.{header.element.get('revMinor')}"
        variations, left_out = admissible(expand(file))
        variation = variations[0]
        engine = Engine(load(variation.path, variation.parameters, road))
        if run:
            result = engine.run(TIME_LIMIT_S)
            end = "by its stop trigger" if result.stopped else "cut off"
            outcome = f"{end} at {result.end_time_s:.2f} s"
            if result.contact_time_s is not None:
                outcome += f", contact at {result.contact_time_s:.2f} s"
    except OpenScenarioError as error:
        return FileCheck(file, version, "refused", (str(error),))
    notes = (*filter(None, (left_out,)), *engine.notes)
    return FileCheck(file, version, "noted" if notes else "supported", notes, outcome, engine.criteria)


def scenario_files(path: str | PathLike[str]) -> list[Path]:
    """Scenario and distribution files: the file itself, or all below a folder, without catalogs.

    Raises:
        FileReadError: there is none.
    """
    place = Path(path)
    files = sorted(place.rglob("*.xosc")) if place.is_dir() else [place]
    files = [file for file in files if not _is_catalog(file)]
    if not files:
        raise FileReadError(f"{place}: no scenario file (.xosc) there")
    return files


def _is_catalog(file: Path) -> bool:
    try:
        return parse(file).find("Catalog") is not None
    except OpenScenarioError:
        return False


def table(checks: Sequence[FileCheck], base: Path) -> Iterator[str]:
    """A line for each file, then the counts; paths count from a folder."""
    names = [_name(held.path, base) for held in checks]
    width = max(map(len, names), default=0)
    for name, held in zip(names, checks, strict=True):
        yield f"{name:<{width}}  {held.version:<4} {held.verdict:<9}  {_result(held, base)}".rstrip()
    yield _counts(checks)


def markdown(checks: Sequence[FileCheck], base: Path) -> Iterator[str]:
    """The same as a table in Markdown, with the folder below the base as the source of a file."""
    yield "| source | file | version | what came out |"
    yield "| --- | --- | --- | --- |"
    for held in checks:
        source, _, name = _name(held.path, base).rpartition("/")
        result = _result(held, base).replace("|", "\\|")
        yield f"| {source} | {name} | {held.version} | {held.verdict}{': ' if result else ''}{result} |"
    yield ""
    yield _counts(checks)


def _name(path: Path, base: Path) -> str:
    return path.relative_to(base).as_posix() if path.is_relative_to(base) else str(path)


def _result(held: FileCheck, base: Path) -> str:
    """How it ended, why it is refused, or its first note, and its criteria; paths count from the base."""
    if held.outcome or not held.lines:
        return held.outcome + _judged(held)
    text = held.lines[0].removeprefix(f"{held.path}:").strip().replace(f"{base}/", "")
    if held.verdict == "refused":
        return text
    notes = f"{len(held.lines)} notes, the first" if len(held.lines) > 1 else "1 note"
    return f"{notes}: {text}{_judged(held)}"


def _judged(held: FileCheck) -> str:
    """The criteria of a file; of one that was run, which are met."""
    if not held.criteria:
        return ""
    if not held.outcome:
        return f"; pass criteria: {', '.join(criterion.name for criterion in held.criteria)}"
    words = {True: "met", False: "not met", None: "not evaluated"}
    names = {met: [c.name for c in held.criteria if c.met is met] for met in words}
    return "".join(
        f"; {words[met]}: {', '.join(of_verdict)}" for met, of_verdict in names.items() if of_verdict
    )


def _counts(checks: Sequence[FileCheck]) -> str:
    counts = Counter(held.verdict for held in checks)
    words = ", ".join(f"{counts[verdict]} {verdict}" for verdict in get_args(Verdict))
    return f"{len(checks)} file{'' if len(checks) == 1 else 's'}: {words}"
