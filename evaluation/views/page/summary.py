"""What a comparison came to at a glance: one verdict per strategy, and the matrix of scores."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evaluation.results.rows import ordered_strategies, varying_conditions
from evaluation.views.account.explain import KINDS, Account

if TYPE_CHECKING:
    import pandas as pd

MARKS = {
    "hit": "✕", "mitigated": "◐", "false": "!", "unnecessary": "▼", "cut": "…", "invalid": "∅", "stop": "✓",
    "pass": "–",
}  # fmt: skip
"""What says the outcome without colour."""

_WORST, _MIDDLE, _BEST = (0xF4, 0xB1, 0x83), (0xFB, 0xF3, 0xD9), (0xA6, 0xCE, 0xE3)
"""Light vermillion over cream to light blue: distinct with any colour vision, dark text readable on all."""


_SHARES = {
    "hit": 0.0, "mitigated": 0.15, "false": 0.25, "unnecessary": 0.35, "stop": 1.0, "pass": 1.0,
}  # fmt: skip
"""Where an outcome stands on that scale when there are no points."""

_NAMED = 12
"""Further runs that failed in the same way, named in a verdict."""

_UNDECIDED = "#e4e6e9"
"""Fill of runs that decide nothing: in no rate, or without braking where it is unknown what must happen."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why runs failed, on the example of one of them.

    Args:
        log: the run of the example.
        title: what failed, and in which run.
        text: what happened in it, and why.
        also: (log, title) of further runs with such an end.
        more: how many there are besides.
    """

    log: str
    title: str
    text: str
    also: tuple[tuple[str, str], ...]
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
    verdicts = []
    for name in ordered_strategies(runs):
        own = runs[runs["strategy"] == name]
        # by speed; scenarios as they were run
        ordered = own if by_scenario(own) else own.sort_values("v_test_kmh")
        verdicts.append(_verdict(name, ordered, accounts, titles))
    return verdicts


def _verdict(
    strategy: str, runs: pd.DataFrame, accounts: Mapping[str, Account], titles: Mapping[str, str]
) -> Verdict:
    names = [str(name) for name in runs["log"]]

    def those(chosen: Callable[[Account], bool]) -> list[str]:
        return [name for name in names if chosen(accounts[name])]

    hits = those(lambda account: account.collided)
    false = those(lambda account: bool(account.false_activation))
    unnecessary = those(lambda account: account.unnecessary and not account.false_activation)
    reasons = []
    for what, failed in (
        ("collision", hits), ("false activation", false), ("unnecessary braking", unnecessary)
    ):  # fmt: skip
        if failed:
            example, *further = failed
            text = f"{accounts[example].finding} {accounts[example].why}".strip()
            also = tuple((name, titles[name].removeprefix(f"{strategy}, ")) for name in further[:_NAMED])
            title = f"Why the {what} ({titles[example]})"
            reasons.append(Reason(example, title, text, also, len(further) - len(also)))
    worst = min((accounts[name].kind for name in names), key=KINDS.index)
    headline = "; ".join(_rates(runs, accounts))
    return Verdict(strategy, worst, f"{headline[0].upper()}{headline[1:]}.", tuple(reasons))


def _rates(runs: pd.DataFrame, accounts: Mapping[str, Account]) -> list[str]:
    """How often each outcome came, of the runs in which it can: must-brake runs, or those of nothing scenes.

    Runs that the time limit cut off before anything was decided, and tests without conflict, are in no rate
    and have a part of their own.
    """
    known = {str(name): accounts[str(name)] for name in runs["log"]}
    decided = {name: account for name, account in known.items() if account.kind not in ("cut", "invalid")}
    brake = {name: account for name, account in decided.items() if account.must != "nothing"}
    nothing = {name: account for name, account in decided.items() if account.must == "nothing"}
    group = " in must-brake scenes" if all(account.must == "brake" for account in brake.values()) else ""
    in_nothing = " in nothing scenes"

    def rate(what: str, is_so: Callable[[Account], bool], among: Mapping[str, Account], group: str) -> str:
        return _count(what, [name for name in among if is_so(among[name])], len(among), group, runs)

    parts = []
    if brake:
        mitigated = sum(account.kind == "mitigated" for account in brake.values())
        collisions = sum(account.collided for account in brake.values())
        some = f", {_of_them(mitigated, collisions)}mitigated" if mitigated else ""
        parts.append(rate("collision", lambda a: a.collided, brake, group) + some)
        applies = {name: account for name, account in brake.items() if account.false_activation is not None}
        if applies and (not nothing or any(account.false_activation for account in applies.values())):
            parts.append(rate("false activation", lambda a: bool(a.false_activation), applies, group))
    if nothing:
        if any(account.collided for account in nothing.values()):
            parts.append(rate("collision", lambda a: a.collided, nothing, in_nothing))
        parts.append(rate("false activation", lambda a: bool(a.false_activation), nothing, in_nothing))
        braked = [account for account in nothing.values() if account.unnecessary]
        adapted = sum(not account.false_activation for account in braked)
        some = f", {_of_them(adapted, len(braked))}by speed adaptation alone" if adapted else ""
        parts.append(rate("unnecessary braking", lambda a: a.unnecessary, nothing, in_nothing) + some)
    for kind, why in (("cut", "cut off by the time limit"), ("invalid", "without conflict")):
        if number := sum(account.kind == kind for account in known.values()):
            parts.append(f"{number} run{'s' if number > 1 else ''} {why}, in no rate")
    return parts


def _of_them(count: int, of: int) -> str:
    """`2 of them `, or nothing where it is all of them."""
    return "" if count == of else f"{count} of them "


def _count(what: str, chosen: list[str], of: int, group: str, runs: pd.DataFrame) -> str:
    """`collision in 1 of 2 runs in must-brake scenes (at 60 km/h)`, or `no collision in 2 runs`."""
    runs_there = f"{of} run{'s' if of > 1 else ''}{group}"
    if not chosen:
        return f"no {what} in {runs_there}"
    share = f"{what} in {len(chosen)} of {runs_there}"
    if len(set(runs["scenario"])) > 1:
        return share
    speeds = sorted(set(runs.loc[runs["log"].isin(chosen), "v_test_kmh"]))
    return f"{share} (at {', '.join(f'{v:g}' for v in speeds)} km/h)"


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
    worst = min(names, key=lambda name: KINDS.index(accounts[name].kind))
    score, most = float(runs["score"].mean()), float(runs["score_max"].mean())
    kind = accounts[worst].kind
    decided = kind in _SHARES and not (kind == "pass" and not accounts[worst].must)
    text, colour = "", _tint(_SHARES[kind]) if decided else _UNDECIDED
    if not math.isnan(score) and kind in _SHARES:
        # a false activation is no success, whatever points the impact speed alone is worth
        text = f"{score:.2f} of {most:g}"
        share = score / most if most else 0.0
        colour = _tint(min(share, _SHARES[kind]) if kind == "false" else share)
    outcome = accounts[worst].outcome
    if len(names) > 1:
        like = sum(accounts[name].kind == kind for name in names)
        outcome = f"{outcome} ({like} of {len(names)})"
    return Cell(worst, text, outcome, MARKS[kind], colour)


def outcome_colour(kind: str) -> str:
    """Fill of an outcome where there are no points; of one that decides nothing grey."""
    return _tint(_SHARES[kind]) if kind in _SHARES else _UNDECIDED


def _tint(share: float) -> str:
    """Colour of a share of points, 0 to 1."""
    low, high, part = (_WORST, _MIDDLE, 2 * share) if share < 0.5 else (_MIDDLE, _BEST, 2 * share - 1)
    return "#" + "".join(f"{round(a + (b - a) * part):02x}" for a, b in zip(low, high, strict=True))
