"""Sides of a comparison on the same drives: which pairs differ, and which requests they share.

The drives are the sample. Requests of one drive have the same people, the same road and the same driver in
common; a drive on which one side asks more often than the other counts once, however often it does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evaluation.metrics.intervals import CONFIDENCE, sign_test
from evaluation.metrics.power import holm
from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.drive.drive import RULE, DriveSpec
from evaluation.studies.drive.measures import DriveEvent, DriveRow
from evaluation.studies.drive.tables import side_name
from evaluation.studies.drive.verdicts import FALSE, STANDING
from scenarios.sources.requests import EMERGENCY

Side = tuple[str, str, str]
"""Strategy, settings as they are typed, and brake rule."""

MEASURES = ("requests", "false_activations")
"""Counts of a drive that are compared."""


@dataclass(frozen=True, slots=True)
class Occasion:
    """A stretch of a drive on which someone asked for the emergency brake.

    It begins with a request of whichever side, and lasts as long as that looked ahead: what another side asks
    for meanwhile is taken for the same. Tracks cannot say so, since each side has its own.

    Args:
        sequence: name of the drive.
        events: the requests, in the order of time.
    """

    sequence: str
    events: tuple[DriveEvent, ...]

    def sides(self, measure: str) -> set[Side]:
        """Who asked; of `false_activations` only whose request was one."""
        return {side_of(e) for e in self.events if measure == MEASURES[0] or e.verdict == FALSE}


@dataclass(frozen=True, slots=True)
class DriveDifference:
    """What one side asks for that another does not, on the same drives.

    Args:
        side, against: the two.
        measure: one of `MEASURES`.
        count, count_against: of each, over all drives.
        both, only, only_against: occasions on which both, or one of them alone, asked.
        more, fewer, equal: drives on which the first has more of them, fewer, or as many.
        p_value: exact sign test over the drives.
        p_corrected: the same, corrected for all questions by Holm's method.
    """

    side: Side
    against: Side
    measure: str
    count: int
    count_against: int
    both: int
    only: int
    only_against: int
    more: int
    fewer: int
    equal: int
    p_value: float
    p_corrected: float


def side_of(row: DriveEvent | DriveRow) -> Side:
    """Whose row or request it is."""
    return row.strategy, row.settings, row.rule


def pairs_of(specs: Sequence[DriveSpec]) -> list[tuple[Side, Side]]:
    """Sides that differ in one thing, each with the first in that: strategy, brake rule, or one parameter.

    Strategies are compared with the first one's where the parameters that both have are the same.
    """
    return [
        (_side(spec), _side(other))
        for k, spec in enumerate(specs)
        for other in specs[:k]
        if _differ_in_one(spec, other, specs)
    ]


def _side(spec: DriveSpec) -> Side:
    return spec.strategy, spec.text, spec.rule


def _differ_in_one(spec: DriveSpec, other: DriveSpec, specs: Sequence[DriveSpec]) -> bool:
    own, others = ({name: value for name, value in s.settings if name != RULE} for s in (spec, other))
    unlike = [name for name in own if name in others and own[name] != others[name]]
    if spec.strategy != other.strategy:
        return other.strategy == specs[0].strategy and spec.rule == other.rule and not unlike
    if spec.rule != other.rule:
        return other.rule == specs[0].rule and not unlike
    if len(unlike) != 1:
        return False
    first = next(dict(s.settings) for s in specs if s.strategy == spec.strategy)
    return others[unlike[0]] == first[unlike[0]]


def occasions_of(events: Sequence[DriveEvent]) -> list[Occasion]:
    """The occasions of all drives, in the order in which drives and times come."""
    asked = [event for event in events if event.kind == EMERGENCY and event.verdict != STANDING]
    occasions: list[Occasion] = []
    for sequence in dict.fromkeys(event.sequence for event in asked):
        group: list[DriveEvent] = []
        # of the same time in the order of the sides, so that the first is always the same
        for event in sorted((e for e in asked if e.sequence == sequence), key=lambda e: e.time_s):
            if group and event.time_s > group[0].time_s + group[0].horizon_s:
                occasions.append(Occasion(sequence, tuple(group)))
                group = []
            group.append(event)
        occasions.append(Occasion(sequence, tuple(group)))
    return occasions


def differences_of(
    rows: Sequence[DriveRow], occasions: Sequence[Occasion], pairs: Sequence[tuple[Side, Side]]
) -> list[DriveDifference]:
    """Every pair in every measure.

    Args:
        rows: of single drives; every side has the same drives in the same order.
        occasions: of these drives.
        pairs: sides.
    """
    by_side: dict[Side, list[DriveRow]] = {}
    for row in rows:
        by_side.setdefault(side_of(row), []).append(row)
    raw = []
    for side, against in pairs:
        for measure in MEASURES:
            first, second = ([int(getattr(row, measure)) for row in by_side[s]] for s in (side, against))
            more, fewer = sum(map(int.__gt__, first, second)), sum(map(int.__lt__, first, second))
            asked = [(side in sides, against in sides) for sides in (o.sides(measure) for o in occasions)]
            counts = (
                sum(first), sum(second), asked.count((True, True)), asked.count((True, False)),
                asked.count((False, True)), more, fewer, len(first) - more - fewer,
            )  # fmt: skip
            raw.append((side, against, measure, counts, sign_test(more, fewer)))
    corrected = holm([p_value for *_, p_value in raw])
    return [
        DriveDifference(side, against, measure, *counts, p_value, p_corrected)
        for (side, against, measure, counts, p_value), p_corrected in zip(raw, corrected, strict=True)
    ]


def least_drives(questions: int) -> int:
    """So many drives at least have to differ, all of them the same way, for a difference to be decided.

    The sign test then has the p-value 2 / 2^n, which has to be within what the first of Holm's steps allows.
    """
    return math.ceil(1.0 + math.log2(max(questions, 1) / (1.0 - CONFIDENCE)) - 1e-12)


def told_power(drives: int, questions: int) -> str:
    """What so many drives can decide, whatever comes out."""
    alone, together = least_drives(1), least_drives(questions)
    what = f"{drives} drive{'s' * (drives != 1)} {'are' if drives != 1 else 'is'} the sample"
    if drives < alone:
        return (
            f"{what}: the exact sign test needs {alone} that differ, all of them the same way, to decide a "
            "difference at 5 %. None can be decided here; counts describe these drives alone."
        )
    if drives < together:
        return (
            f"{what}: a single difference that was asked for beforehand is decided at 5 % if {alone} or more "
            f"drives differ and all of them the same way. Corrected for the {questions} differences that are "
            f"looked at here it would take {together}: none of them can be decided; counts describe these "
            "drives."
        )
    return (
        f"{what}: a difference is decided at 5 %, corrected for {questions}, if at least {together} drives "
        "differ, all of them the same way."
    )


_COLUMNS = (
    "strategy", "settings", "rule", "against_strategy", "against_settings", "against_rule", "measure",
    "count", "count_against", "occasions_both", "occasions_only", "occasions_only_against", "drives_more",
    "drives_fewer", "drives_equal", "p_value", "p_corrected",
)  # fmt: skip


def differences_csv(differences: Sequence[DriveDifference]) -> bytes:
    """One line per pair and measure."""
    lines = (
        (
            *d.side, *d.against, d.measure, d.count, d.count_against, d.both, d.only, d.only_against, d.more,
            d.fewer, d.equal, d.p_value, d.p_corrected,
        )
        for d in differences
    )  # fmt: skip
    return csv_bytes(_COLUMNS, lines)


def difference_table(differences: Sequence[DriveDifference], own: dict[str, str]) -> Table:
    """A line per pair and measure in which anything differs.

    Args:
        differences: all.
        own: what settings have beyond those of all, see `common_settings`.
    """
    header = (
        "who", "against", "measure", "count", "against", "occasions: both", "only who", "only against",
        "drives: more", "fewer", "equal", "p", "p corrected",
    )  # fmt: skip
    lines = [
        (
            _name(d.side, own), _name(d.against, own), d.measure.replace("_", " "), str(d.count),
            str(d.count_against), str(d.both), str(d.only), str(d.only_against), str(d.more), str(d.fewer),
            str(d.equal), f"{d.p_value:.2g}", f"{d.p_corrected:.2g}",
        )
        for d in differences
        if d.only or d.only_against or d.more or d.fewer
    ]  # fmt: skip
    alike = len({(d.side, d.against) for d in differences}) - len({line[:2] for line in lines})
    left_out = f" {alike} pairs that differ in nothing are left out." if alike else ""
    caption = (
        "Same drives, same noise. An occasion begins with a request and lasts as long as that looked ahead; "
        "p: exact sign test over the drives, and corrected for all questions (Holm)." + left_out
    )
    return Table(header, tuple(lines), caption=caption)


def _name(side: Side, own: dict[str, str]) -> str:
    strategy, settings, rule = side
    return side_name(strategy, own[settings], rule)


_OCCASION_COLUMNS = (
    "sequence", "occasion", "time_s", "last_s", "strategy", "settings", "rule", "request_s", "category",
    "verdict", "reason",
)  # fmt: skip


def occasions_csv(occasions: Sequence[Occasion]) -> bytes:
    """One line per request: the occasion that it belongs to, and whose it is."""
    numbers: dict[str, int] = {}
    lines = []
    for occasion in occasions:
        number = numbers[occasion.sequence] = numbers.get(occasion.sequence, 0) + 1
        first, last = occasion.events[0].time_s, occasion.events[-1].time_s
        lines += [
            (occasion.sequence, number, first, last, *side_of(e), e.time_s, e.category, e.verdict, e.reason)
            for e in occasion.events
        ]
    return csv_bytes(_OCCASION_COLUMNS, lines)


def occasion_table(occasions: Sequence[Occasion], sides: Sequence[Side], own: dict[str, str]) -> Table:
    """A line per occasion: when, for what, with which verdicts, and who asked."""
    lines = []
    for occasion in occasions:
        events, asked = occasion.events, occasion.sides(MEASURES[0])
        categories = dict.fromkeys(event.category or EMPTY for event in events)
        verdicts = dict.fromkeys(
            event.verdict + (f" ({event.reason})" if event.reason else "") for event in events
        )
        lines.append(
            (
                occasion.sequence, f"{events[0].time_s:.1f}", ", ".join(categories), ", ".join(verdicts),
                f"{len(asked)} of {len(sides)}", _told_sides(asked, sides, own),
            )
        )  # fmt: skip
    return Table(("sequence", "from (s)", "for", "verdicts", "asked", "who"), tuple(lines))


def _told_sides(asked: set[Side], sides: Sequence[Side], own: dict[str, str]) -> str:
    """Who asked: all, or strategies by the rules with which they did."""
    if len(asked) == len(sides):
        return "all"
    all_rules = tuple(dict.fromkeys(rule for *_, rule in sides))
    by_rules: dict[tuple[str, ...], list[str]] = {}
    for strategy, settings in dict.fromkeys((strategy, settings) for strategy, settings, _ in sides):
        rules = tuple(rule for rule in all_rules if (strategy, settings, rule) in asked)
        if rules:
            by_rules.setdefault(rules, []).append(side_name(strategy, own[settings], ""))
    strategies = len({side[:2] for side in sides})
    return "; ".join(
        ("every strategy" if len(names) == strategies else ", ".join(names))
        + ("" if len(all_rules) == 1 else f": {_told_rules(rules, all_rules)}")
        for rules, names in by_rules.items()
    )


def _told_rules(rules: tuple[str, ...], all_rules: tuple[str, ...]) -> str:
    if rules == all_rules:
        return "every rule"
    missing = [rule for rule in all_rules if rule not in rules]
    return f"every rule but {', '.join(missing)}" if len(missing) <= 2 < len(rules) else ", ".join(rules)
