"""Whether an area that adapts beats every fence, in sentences from the kept runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from evaluation.results.tables import Table
from evaluation.studies.answers.gain import Gain, standings
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import Difference, benefit_difference, decisive_differences
from evaluation.studies.answers.severity import Severity
from evaluation.studies.answers.severity.question import (
    behind_sentence,
    behind_table,
    changes_of,
    cost_of,
    costs_table,
    findings,
)
from evaluation.studies.answers.tables import change_text, differences_table, interval_text, points_text
from evaluation.studies.reference.adaptive import FollowedSeverity
from evaluation.studies.reference.findings.answers import Kept
from evaluation.studies.reference.findings.drives import KeptDrives
from evaluation.studies.reference.words import counted, listed

Asked = TypeVar("Asked", bound=Gain)


def differences(kept: Kept[Asked]) -> list[Difference]:
    """Of every rival against the area, corrected for their number."""
    return decisive_differences(kept.results, kept.question.pairs)


def told_standing(kept: Kept[Asked]) -> str:
    """How the area stands among its rivals."""
    return " ".join(standings(kept.results, differences(kept)))


def against_path(kept: Kept[Asked]) -> str:
    """The area less the planned path: both measures."""
    path = next(arm for arm in kept.question.arms if arm.name == "path")
    own = [d for d in differences(kept) if d.arm == path]
    parts = []
    for d in own:
        e = d.estimate
        text = points_text(type(e)(-e.value, -e.high, -e.low, e.count))
        decided = "decided" if d.is_decided else "not decided"
        parts.append(f"{MEASURES[d.measure].text} {text} points ({decided})")
    return f"The area {own[0].against.name} against the planned path: {listed(parts)}."


def rivals_table(kept: Kept[Asked]) -> Table:
    """A line per rival: rates by themselves, differences against the area."""
    every = differences(kept)
    reference = every[0].against
    rows = []
    for arm in kept.question.arms:
        rates = [interval_text(kept.results.estimate(arm, name), name) for name in DECISIVE]
        own = [d for d in every if d.arm == arm]
        changes = [f"{change_text(d)}{' *' if d.is_decided else ''}" for d in own] or ["", ""]
        gained = points_text(benefit_difference(kept.results, arm, reference)) if own else ""
        rows.append((arm.name, *rates, *changes, gained))
    header = (
        "who", "avoided (%)", "unnecessary stops (%)", "avoided (points)", "stops (points)",
        "benefit (points)",
    )  # fmt: skip
    counts = {must: sum(s.must == must for s in kept.results.scenes) for must in ("brake", "nothing")}
    return Table(
        header,
        tuple(rows),
        (),
        f"{counts['brake']} must-brake and {counts['nothing']} nothing scenes. Points: the rival less "
        f"{reference.name}, with 95 % intervals; * decided, corrected for {len(every)} differences.",
    )


def full_table(kept: Kept[Asked]) -> Table:
    """Every difference with discordant scenes and p-values."""
    every = differences(kept)
    return differences_table(every, len(every))


def severity_table(kept: Kept[Severity]) -> Table:
    """A line per area and rule: what is avoided, and what stops cost."""
    question = kept.question
    return costs_table([cost_of(kept.results, arm, question.weights) for arm in question.arms])


def told_severity(kept: Kept[Severity]) -> list[str]:
    """Differences in weighed stops of every rule against the first, with the same area."""
    question = kept.question
    return findings([], changes_of(kept.results, question.pairs, question.weights))


def told_behind(kept: Kept[FollowedSeverity]) -> list[str]:
    """How often a false activation was answered by a contact from behind, by side."""
    return [behind_sentence(kept.results, arm) for arm in kept.question.arms]


def table_behind(kept: Kept[FollowedSeverity]) -> Table:
    """What false activations did to the car of SUMO behind, by side."""
    return behind_table(kept.results, kept.question.arms)


def told_drives(kept: Sequence[KeptDrives]) -> list[str]:
    """False activations of the adaptive area and the others on recorded drives, with the paper's rule."""
    lines = []
    for drives in kept:
        totals = drives.compared.totals
        counts = listed(f"{row.strategy} {row.false_activations}" for row in totals)
        decided = sum(d.p_corrected <= 0.05 for d in drives.compared.differences)
        lines.append(
            f"{drives.title}: false activations {counts}; "
            f"{counted(decided, len(drives.compared.differences))} differences decided."
        )
    return lines
