"""Gates: rules that say when results fail, for a CI that goes by the exit status; as lines and as JUnit XML.

A rule is a measure, a comparison and a limit: `contacts>0` fails where there is a contact. It holds for each
side of the results (a strategy, a category), or for those of a name: `map/contacts>0`. docs/gates.md lists
the measures of each command.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from evaluation.errors import ArgumentError
from evaluation.results.files import write_bytes
from evaluation.results.rows import RunRow
from evaluation.results.tables import Table
from scenarios.simulation.ends import CUT_OFF

if TYPE_CHECKING:
    from evaluation.results.criteria import Judged
    from scenarios.openscenario.running.driving.criteria import Criterion

_COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_FORM = re.compile(r"(?:(?P<side>.+)/)?\s*(?P<measure>\w+)\s*(?P<sign>>=|<=|>|<)\s*(?P<limit>\S+)")
MOST_NAMED = 5
"""Runs that a line of a broken rule names."""


@dataclass(frozen=True, slots=True)
class Side:
    """What a command scored of one of those it compares.

    Args:
        name: of the strategy, category or class, which a rule may ask for.
        values: by measure; None or NaN where there is no value.
        detail: what else tells it apart, such as its settings; may be empty.
        runs: by measure, what it counts, in words.
    """

    name: str
    values: Mapping[str, float | None]
    detail: str = ""
    runs: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Name and detail."""
        return ", ".join(filter(None, (self.name, self.detail)))


@dataclass(frozen=True, slots=True)
class Rule:
    """When results fail.

    Args:
        text: as it is typed.
        side: name of those it is for; None: all.
        measure: what is compared.
        sign: one of >, >=, < and <=.
        limit: with what.
    """

    text: str
    side: str | None
    measure: str
    sign: str
    limit: float

    def is_broken(self, value: float | None) -> bool:
        """Whether a value fails; one that is not there does, since nothing shows that it would not."""
        return value is None or math.isnan(value) or _COMPARISONS[self.sign](value, self.limit)


@dataclass(frozen=True, slots=True)
class Verdict:
    """A rule and a side.

    Args:
        rule: the rule.
        side: whose results.
        broken: whether these fail.
        line: what is to be said of it.
    """

    rule: Rule
    side: Side
    broken: bool
    line: str


def parse_rules(text: str, measures: Sequence[str]) -> tuple[Rule, ...]:
    """Rules, comma-separated, as `--fail-on` takes them.

    Args:
        text: such as `contacts>0,score<9` or `pedestrian/hota<80`.
        measures: names of what the command scores.

    Raises:
        ArgumentError: a rule is none, or its measure is unknown; or there is none.
    """
    rules = []
    for part in filter(None, map(str.strip, text.split(","))):
        match = _FORM.fullmatch(part)
        limit = _number(match["limit"]) if match else None
        if match is None or limit is None:
            raise ArgumentError(
                f"--fail-on: {part!r} is no rule; write MEASURE>NUMBER, with >, >=, < or <=, such as "
                f"'{measures[0]}>0', between quotes"
            )
        if match["measure"] not in measures:
            raise ArgumentError(f"--fail-on: no measure {match['measure']!r}; use: {', '.join(measures)}")
        side = match["side"].strip() if match["side"] else None
        rules.append(Rule(part, side, match["measure"], match["sign"], limit))
    if not rules:
        raise ArgumentError(f"--fail-on: nothing given; use rules of: {', '.join(measures)}")
    return tuple(dict.fromkeys(rules))


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def judge(rules: Sequence[Rule], sides: Sequence[Side]) -> list[Verdict]:
    """Every rule on every side that it is for.

    Raises:
        ArgumentError: there is no side of the name that a rule asks for, or none at all.
    """
    verdicts = []
    for rule in rules:
        own = [side for side in sides if rule.side in (None, side.name)]
        if not own:
            names = ", ".join(dict.fromkeys(side.name for side in sides)) or "none"
            raise ArgumentError(
                f"--fail-on: {rule.text!r} is for nothing in these results; there are: {names}"
            )
        for side in own:
            value = side.values.get(rule.measure)
            broken = rule.is_broken(value)
            verdicts.append(Verdict(rule, side, broken, _line(rule, side, value, broken)))
    return verdicts


def _line(rule: Rule, side: Side, value: float | None, broken: bool) -> str:
    """Measure, value and rule in words; of a broken one also the runs that it counts."""
    measured = "no value" if value is None or math.isnan(value) else f"{value:.6g}"
    line = f"{side.title}: {rule.measure} {measured}, fails if {rule.sign} {rule.limit:g}"
    runs = side.runs.get(rule.measure, ()) if broken else ()
    if not runs:
        return line
    more = f" and {len(runs) - MOST_NAMED} more" if len(runs) > MOST_NAMED else ""
    return f"{line}: {'; '.join(runs[:MOST_NAMED])}{more}"


def write_junit(path: Path, command: str, verdicts: Sequence[Verdict]) -> None:
    """Write verdicts as JUnit XML: a suite per side, a test case per rule, equal bytes for equal verdicts.

    Args:
        path: the file.
        command: what was run, such as `cpna`.
        verdicts: of `judge`.

    Raises:
        ResultsError: it cannot be written.
    """
    failed = sum(verdict.broken for verdict in verdicts)
    root = Element(
        "testsuites", name=f"smartmot-eval {command}", tests=str(len(verdicts)), failures=str(failed)
    )
    by_side: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        by_side.setdefault(verdict.side.title, []).append(verdict)
    for title, own in by_side.items():
        broken = sum(verdict.broken for verdict in own)
        suite = SubElement(root, "testsuite", name=title, tests=str(len(own)), failures=str(broken))
        for verdict in own:
            case = SubElement(suite, "testcase", classname=f"{command}.{title}", name=verdict.rule.text)
            if verdict.broken:
                failure = SubElement(case, "failure", message=_printable(verdict.line))
                failure.text = _printable("\n".join(verdict.side.runs.get(verdict.rule.measure, ())))
    indent(root)
    write_bytes(path, tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


def _printable(text: str) -> str:
    """A text without the characters that XML cannot hold."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


# ---- tables ------------------------------------------------------------------------------------------------


def measures_of_table(table: Table) -> tuple[str, ...]:
    """Names of a table's columns as rules have them: in small letters, with low lines between words."""
    return tuple(re.sub(r"\W+", "_", name.lower()).strip("_") for name in table.header)


def sides_of_table(table: Table, texts: int = 1) -> list[Side]:
    """What each line of a table came to.

    Args:
        table: as it is shown; a cell without a number has no value.
        texts: how many of the first columns are names.
    """
    names = measures_of_table(table)
    return [
        Side(
            row[0], dict(zip(names[texts:], map(_number, row[texts:]), strict=True)), ", ".join(row[1:texts])
        )
        for row in table.rows
    ]


# ---- runs --------------------------------------------------------------------------------------------------

RUN_MEASURES = (
    "contacts", "avoided", "false_activations", "cut_off", "impact_speed_kmh", "score", "score_percent",
    "criteria_failed", "criteria_unknown", "runs",
)  # fmt: skip
"""Of a strategy over its runs; docs/gates.md has their meaning."""


def sides_of_runs(judged: Judged) -> list[Side]:
    """What each strategy came to.

    Args:
        judged: every run with the pass criteria of its file.
    """
    by_strategy: dict[str, list[tuple[RunRow, Sequence[Criterion]]]] = {}
    for row, criteria in judged:
        by_strategy.setdefault(row.strategy, []).append((row, criteria))
    return [_side_of(name, own) for name, own in by_strategy.items()]


def _side_of(name: str, judged: Judged) -> Side:
    rows = [row for row, _ in judged]
    named = [(f"{_run(row)}: {c.name}", c.met) for row, criteria in judged for c in criteria]
    counted = {
        "contacts": [f"{_run(row)} ({row.v_impact_kmh:.1f} km/h)" for row in rows if row.collided],
        "avoided": [_run(row) for row in rows if row.avoided],
        "false_activations": [_run(row) for row in rows if row.false_activation],
        "cut_off": [_run(row) for row in rows if row.end_reason in CUT_OFF],
        "criteria_failed": [text for text, met in named if met is False],
        "criteria_unknown": [text for text, met in named if met is None],
        "runs": [_run(row) for row in rows],
    }
    impacts = [row.v_impact_kmh for row in rows if row.v_impact_kmh is not None]
    won = [row.score for row in rows if row.score is not None]
    most = sum(row.score_max or 0.0 for row in rows if row.score is not None)
    values: dict[str, float | None] = {measure: float(len(runs)) for measure, runs in counted.items()}
    values |= {
        "impact_speed_kmh": max(impacts, default=None),
        "score": sum(won) if won else None,
        "score_percent": 100 * sum(won) / most if won and most else None,
    }
    counted["impact_speed_kmh"] = counted["contacts"]
    return Side(name, values, runs=counted)


def _run(row: RunRow) -> str:
    """A run in a few words."""
    several = f", {row.weather}" if row.weather != "dry" else ""
    return f"{row.scenario} at {row.v_test_kmh:g} km/h{several}"
