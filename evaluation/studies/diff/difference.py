"""What differs between two folders of results: what determines their runs, and what came out."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from evaluation.results.files import ResultsError
from evaluation.results.gates import Side
from evaluation.studies.diff.results import SEVERITY, Results, Run, Value, short_digest

TOLERANCE = 1e-9
"""Relative, and absolute in the measure's unit: numbers that differ by less are equal. Equal code and
libraries on equal processors give equal bytes; others round differently."""

KINDS = {".xosc": "scenario", ".xodr": "map"}
"""What files are, by how their names end."""

_KINDS_OF_FACTS = {
    "versions": "version", "plugins": "plug-in", "parameters": "parameter", "settings": "setting",
}  # fmt: skip

_Entry = tuple[str, str, str, str]
"""Kind and name of a change, and its two values."""
_Key = tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """Something that determines runs, and is not the same in both folders.

    Args:
        kind: scenario, map, file, plug-in, version, preset, setting, parameter, ...
        name: of it.
        first, second: in the one and in the other folder; empty where it is not.
        runs: how many pairs of runs it concerns.
    """

    kind: str
    name: str
    first: str
    second: str
    runs: int


@dataclass(frozen=True, slots=True)
class Pair:
    """The same run in both folders.

    Args:
        name: what tells it apart.
        first, second: the runs.
    """

    name: str
    first: Run
    second: Run

    @property
    def flips(self) -> bool:
        """Whether its outcome is another."""
        return self.first.outcome != self.second.outcome

    @property
    def is_worse(self) -> bool:
        """Whether the second outcome is worse."""
        return SEVERITY[self.second.outcome] > SEVERITY[self.first.outcome]

    @property
    def is_better(self) -> bool:
        """Whether the second outcome is better."""
        return SEVERITY[self.second.outcome] < SEVERITY[self.first.outcome]

    @property
    def strategy(self) -> str:
        """Whose runs they are."""
        return _of_both(*(str(run.identity["strategy"]) for run in (self.first, self.second)))

    def numbers(self) -> dict[str, tuple[float | None, float | None]]:
        """Measures that differ, by name."""
        both = {name: (value, self.second.measures.get(name)) for name, value in self.first.measures.items()}
        return {name: values for name, values in both.items() if not _equal(*values)}


@dataclass(frozen=True, slots=True)
class Difference:
    """Two folders compared.

    Args:
        first, second: the folders.
        changes: of what determines their runs.
        pairs: runs that both have, in the order of the first.
        only_first, only_second: names of runs that one of them has.
    """

    first: Results
    second: Results
    changes: tuple[Change, ...]
    pairs: tuple[Pair, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]

    @property
    def flips(self) -> list[Pair]:
        """Pairs with another outcome, the worst first."""
        flips = [pair for pair in self.pairs if pair.flips]
        return sorted(flips, key=lambda p: SEVERITY[p.first.outcome] - SEVERITY[p.second.outcome])

    @property
    def differing(self) -> list[Pair]:
        """Pairs with another outcome or another number."""
        return [pair for pair in self.pairs if pair.flips or pair.numbers()]


def difference(first: Results, second: Results) -> Difference:
    """Compare two folders.

    A run has its partner by what tells it apart in its folder. What all runs of either folder have alike
    tells nothing apart: it is a change if the two are not equal, as one strategy against another.

    Raises:
        ResultsError: the folders are of different kinds, or no run has a partner.
    """
    if first.kind != second.kind:
        raise ResultsError(
            f"{first.path} is of {first.kind}, {second.path} of {second.kind}; give two of the same command"
        )
    names = _telling(first.runs, second.runs)
    ours, theirs = _keyed(first.runs, names), _keyed(second.runs, names)
    pairs = tuple(Pair(_title(names, key), ours[key], theirs[key]) for key in ours if key in theirs)
    if not pairs:
        raise ResultsError(f"no run of {first.path} has a partner in {second.path}, by: {', '.join(names)}")
    return Difference(
        first,
        second,
        tuple(_changes(first, second, pairs)),
        pairs,
        tuple(_title(names, key) for key in ours if key not in theirs),
        tuple(_title(names, key) for key in theirs if key not in ours),
    )


def _telling(first: Sequence[Run], second: Sequence[Run]) -> list[str]:
    """Names of what tells runs apart: not constant in both folders, and not said by the names before."""

    def apart(runs: Sequence[Run], names: Sequence[str]) -> int:
        return len({tuple(run.identity.get(name) for name in names) for run in runs})

    telling: list[str] = []
    for name in dict.fromkeys(name for run in (*first, *second) for name in run.identity):
        if any(apart(runs, [*telling, name]) > max(apart(runs, telling), 1) for runs in (first, second)):
            telling.append(name)
    return telling


def _keyed(runs: Sequence[Run], names: Sequence[str]) -> dict[_Key, Run]:
    """Runs by what tells them apart, those that are alike by their number."""
    seen: Counter[_Key] = Counter()
    keyed = {}
    for run in runs:
        key = tuple(run.identity.get(name) for name in names)
        keyed[(*key, seen[key])] = run
        seen[key] += 1
    return keyed


def _title(names: Sequence[str], key: _Key) -> str:
    """What tells a run apart, in words."""
    plain = ("scenario", "scene", "variant", "strategy", "sequence", "settings", "rule", "preset", "weather")
    parts = [
        f"{_text(value)} km/h" if name == "v_test_kmh"
        else _text(value) if name in plain
        else f"{name.removeprefix('parameter ')} {_text(value)}"
        for name, value in zip(names, key, strict=False)
        if value not in (None, "")
    ]  # fmt: skip
    number = key[-1]
    return ", ".join([*parts, *([f"no. {int(number) + 1}"] if number else [])]) or "the run"


def _changes(first: Results, second: Results, pairs: Sequence[Pair]) -> Iterator[Change]:
    """What determines the runs and differs, the inputs first."""
    counts: Counter[_Entry] = Counter()
    for pair in pairs:
        counts.update(_changed_files(pair.first.files, pair.second.files))
        counts.update(_changed_facts(pair.first.facts, pair.second.facts))
    for kind, name, ours, theirs in _changed_facts(first.facts, second.facts):
        counts[kind, name, ours, theirs] = len(pairs)
    order = defaultdict(lambda: 3, {"scenario": 0, "map": 0, "file": 0, "plug-in": 1, "run": 2, "version": 9})
    for change, runs in sorted(counts.items(), key=lambda item: order[item[0][0]]):
        yield Change(*change, runs)


def _changed_files(first: Mapping[str, str], second: Mapping[str, str]) -> Iterator[_Entry]:
    """Files whose content is not in the other folder's run, by their names without folders."""
    ours = {path: digest for path, digest in first.items() if digest not in second.values()}
    theirs = {path: digest for path, digest in second.items() if digest not in first.values()}
    named = [{_file_name(path): digest for path, digest in own.items()} for own in (ours, theirs)]
    for name in dict.fromkeys((*named[0], *named[1])):
        before, after = (short_digest(own.get(name, "")) for own in named)
        yield KINDS.get(PurePosixPath(name).suffix, "file"), name, before, after


def _file_name(path: str) -> str:
    return path.replace("\\", "/").rpartition("/")[2]


def _changed_facts(first: Mapping[str, Value], second: Mapping[str, Value]) -> Iterator[_Entry]:
    for name in dict.fromkeys((*first, *second)):
        ours, theirs = (facts.get(name, "") for facts in (first, second))
        if ours != theirs or isinstance(ours, bool) != isinstance(theirs, bool):
            kind, _, path = name.partition(".")
            if not path:
                kind, path = "run", name
            short = [short_digest(_text(v)) if kind == "plugins" else _text(v) for v in (ours, theirs)]
            yield _KINDS_OF_FACTS.get(kind, kind), path, short[0], short[1]


def _text(value: Value) -> str:
    """A value as people write it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _of_both(first: str, second: str) -> str:
    return first if first == second else f"{first} → {second}"


def _equal(first: float | None, second: float | None) -> bool:
    if first is None or second is None:
        return first is second
    return math.isclose(first, second, rel_tol=TOLERANCE, abs_tol=TOLERANCE)


DIFF_MEASURES = ("flips", "worse", "better", "differing", "only_first", "only_second", "changes", "pairs")
"""For `--fail-on`; `only_first`, `only_second` and `changes` are those of the folders in each side."""


def sides_of_difference(folders: Difference) -> list[Side]:
    """What differs of each strategy, with `DIFF_MEASURES`."""
    by_strategy: dict[str, list[Pair]] = {}
    for pair in folders.pairs:
        by_strategy.setdefault(pair.strategy, []).append(pair)
    sides = []
    for name, pairs in by_strategy.items():
        counted = {
            "flips": [_flip(pair) for pair in pairs if pair.flips],
            "worse": [_flip(pair) for pair in pairs if pair.is_worse],
            "better": [_flip(pair) for pair in pairs if pair.is_better],
            "differing": [pair.name for pair in pairs if pair.flips or pair.numbers()],
            "only_first": list(folders.only_first),
            "only_second": list(folders.only_second),
            "changes": [f"{change.kind} {change.name}" for change in folders.changes],
            "pairs": [pair.name for pair in pairs],
        }
        sides.append(
            Side(name, {measure: float(len(runs)) for measure, runs in counted.items()}, runs=counted)
        )
    return sides


def _flip(pair: Pair) -> str:
    return f"{pair.name}: {pair.first.outcome} → {pair.second.outcome}"
