"""What a comparison came to at a glance: one verdict per strategy, and the matrix of scores."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evaluation.report.explain import Account
from evaluation.results import ordered_strategies, varying_conditions

if TYPE_CHECKING:
    import pandas as pd

SEVERITY = ("hit", "false", "stop", "pass")
"""Kinds of outcome, the worst first."""

MARKS = {"hit": "✕", "false": "!", "stop": "✓", "pass": "–"}
"""What says the outcome without colour."""

_WORST, _MIDDLE, _BEST = (0xF4, 0xB1, 0x83), (0xFB, 0xF3, 0xD9), (0xA6, 0xCE, 0xE3)
"""Light vermillion over cream to light blue: told apart with any colour vision, dark text readable on all."""


_SHARES = {"hit": 0.0, "false": 0.25, "stop": 1.0, "pass": 1.0}
"""Where an outcome stands on that scale when there are no points."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why runs failed, told of one of them.

    Args:
        log: the run that is told of.
        title: what failed, and in which run.
        text: what happened in it, and why.
        others: (log, title) of more runs with such an end.
        more: how many there are besides.
    """

    log: str
    title: str
    text: str
    others: tuple[tuple[str, str], ...]
    more: int


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a strategy came to.

    Args:
        strategy: its name.
        kind: worst kind of outcome.
        headline: how many runs ended how.
        reasons: one run for each kind of failure, and which others failed like that.
    """

    strategy: str
    kind: str
    headline: str
    reasons: tuple[Reason, ...]


@dataclass(frozen=True, slots=True)
class Cell:
    """One place of the score matrix.

    Args:
        log: the run it opens, the worst of those it stands for.
        score: points, or nothing.
        outcome: how that run ended.
        mark: the same as a sign.
        colour: light fill by the share of the points that could be won, else by the outcome.
    """

    log: str
    score: str
    outcome: str
    mark: str
    colour: str


def verdicts(runs: pd.DataFrame, accounts: Mapping[str, Account], titles: Mapping[str, str]) -> list[Verdict]:
    """One verdict per strategy.

    Args:
        runs: table of the runs.
        accounts: what each came to, by the name of its log.
        titles: how each is called, by the name of its log.
    """
    return [
        _verdict(name, _in_order(runs[runs["strategy"] == name]), accounts, titles)
        for name in ordered_strategies(runs)
    ]


def _verdict(
    strategy: str, runs: pd.DataFrame, accounts: Mapping[str, Account], titles: Mapping[str, str]
) -> Verdict:
    names = [str(name) for name in runs["log"]]
    by_kind = {kind: [name for name in names if accounts[name].kind == kind] for kind in SEVERITY}
    false_stops = [name for name in names if accounts[name].for_nobody]
    emergencies = set(map(str, runs.loc[runs["false_activation"].eq(True), "log"]))
    false_stops.sort(key=lambda name: name not in emergencies)
    parts = [_count("contact", by_kind["hit"], runs), _count("stop for nobody", false_stops, runs)]
    if waits := len(set(false_stops) - emergencies):
        parts[-1] += f", {'all' if waits == len(false_stops) else waits} of them without an emergency"
    headline = ", ".join(parts)
    reasons = []
    for what, chosen in (("hit", by_kind["hit"]), ("stop for nobody", false_stops)):
        if chosen:
            told, *others = chosen
            text = f"{accounts[told].finding} {accounts[told].why}".strip()
            also = tuple((name, titles[name].removeprefix(f"{strategy}, ")) for name in others[:_NAMED])
            title = f"Why the {what} ({titles[told]})"
            reasons.append(Reason(told, title, text, also, len(others) - len(also)))
    worst = "false" if false_stops and not by_kind["hit"] else next(k for k in SEVERITY if by_kind[k])
    return Verdict(strategy, worst, f"{headline[0].upper()}{headline[1:]}.", tuple(reasons))


_NAMED = 12
"""Further runs that failed in the same way, named in a verdict."""


def _in_order(runs: pd.DataFrame) -> pd.DataFrame:
    """By speed; scenarios as they were run."""
    return runs if by_scenario(runs) else runs.sort_values("v_test_kmh")


def _count(what: str, chosen: list[str], runs: pd.DataFrame) -> str:
    if not chosen:
        return f"no {what}"
    found = f"{what} in {len(chosen)} of {len(runs)} runs"
    if len(set(runs["scenario"])) > 1:
        return found
    speeds = sorted(set(runs.loc[runs["log"].isin(chosen), "v_test_kmh"]))
    return f"{found} (at {', '.join(f'{v:g}' for v in speeds)} km/h)"


@dataclass(frozen=True, slots=True)
class Matrix:
    """Scores and outcomes as a table.

    Args:
        corner: what the lines, or the columns, are.
        columns: their names.
        lines: per line its name and a place per column, None where nothing ran.
    """

    corner: str
    columns: list[str]
    lines: list[tuple[str, list[Cell | None]]]


def by_scenario(runs: pd.DataFrame) -> bool:
    """Whether there are many scenarios, each at a speed of its own."""
    names = set(runs["scenario"])
    return len(names) > 1 and len(set(zip(runs["scenario"], runs["v_test_kmh"], strict=True))) == len(names)


def score_matrix(runs: pd.DataFrame, accounts: Mapping[str, Account]) -> Matrix:
    """Scores by strategy, in its conditions, and by test speed; seeds share a place.

    Many scenarios, each at a speed of its own, are lines instead, and the strategies the columns.
    """
    if by_scenario(runs):
        return _scenario_matrix(runs, accounts)
    speeds = sorted({float(speed) for speed in runs["v_test_kmh"]})
    conditions = varying_conditions(runs)
    lines = []
    for values, group in runs.groupby(conditions, sort=True) if conditions else [((), runs)]:
        for strategy in ordered_strategies(group):
            own = group[group["strategy"] == strategy]
            cells = [_cell(own[own["v_test_kmh"] == speed], accounts) for speed in speeds]
            lines.append((", ".join([strategy, *map(str, values)]), cells))
    return Matrix("Test speed (km/h)", [f"{speed:g}" for speed in speeds], lines)


def _scenario_matrix(runs: pd.DataFrame, accounts: Mapping[str, Account]) -> Matrix:
    strategies = ordered_strategies(runs)
    conditions = [name for name in varying_conditions(runs) if name != "scenario"]
    lines = []
    for values, group in runs.groupby(["scenario", *conditions], sort=False):
        cells = [_cell(group[group["strategy"] == strategy], accounts) for strategy in strategies]
        lines.append((", ".join(map(str, values)), cells))
    return Matrix("Scenario", strategies, lines)


def _cell(runs: pd.DataFrame, accounts: Mapping[str, Account]) -> Cell | None:
    if runs.empty:
        return None
    names = [str(name) for name in runs["log"]]
    worst = min(names, key=lambda name: SEVERITY.index(accounts[name].kind))
    score, most = float(runs["score"].mean()), float(runs["score_max"].mean())
    kind = accounts[worst].kind
    text, colour = "", _tint(_SHARES[kind])
    if not math.isnan(score):
        text, colour = f"{score:.2f} of {most:g}", _tint(score / most if most else 0.0)
    outcome = accounts[worst].outcome
    if len(names) > 1:
        like = sum(accounts[name].kind == kind for name in names)
        outcome = f"{outcome} ({like} of {len(names)})"
    return Cell(worst, text, outcome, MARKS[kind], colour)


def _tint(share: float) -> str:
    """Colour of a share of points, 0 to 1."""
    low, high, part = (_WORST, _MIDDLE, 2 * share) if share < 0.5 else (_MIDDLE, _BEST, 2 * share - 1)
    return "#" + "".join(f"{round(a + (b - a) * part):02x}" for a, b in zip(low, high, strict=True))
