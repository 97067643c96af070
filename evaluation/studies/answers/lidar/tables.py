"""Tables and sentences about chains of sensor and detector; every number in them is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from evaluation.results.tables import EMPTY, Table
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.lidar.runs import PLACES, dropped_share, stops_at
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import Difference, Results, benefit_difference, difference
from evaluation.studies.answers.rivals import MAP
from evaluation.studies.answers.tables import change_text, interval_text, points_text, verdict

if TYPE_CHECKING:
    from evaluation.studies.answers.lidar.question import Chain, LidarGain

Groups = Mapping[tuple["Chain", str], Sequence[Arm]]
SHOWN = ("avoided", "early", "impact", "flag_ttc", "stops", "speed_lost")
"""Measures of the table of chains."""


def findings(question: LidarGain, results: Results, differences: Sequence[Difference]) -> list[str]:
    """The answer in sentences: the map against the first area with each chain, then the ladder."""
    pairs = []
    for arms in question.groups.values():
        first, own = arms[0], next((arm for arm in arms if arm.strategy == MAP.strategy), None)
        if own is not None:
            pairs.append((own, first))
    lines = pair_findings(results, pairs, differences)
    steps = (step for step in question.steps if step[0].strategy == MAP.strategy)
    lines += [_step_line(results, *step) for step in steps]
    return lines


def pair_findings(
    results: Results, pairs: Sequence[tuple[Arm, Arm]], differences: Sequence[Difference]
) -> list[str]:
    """What one arm does against another, a sentence for each pair of which there are differences."""
    lines = []
    for own, first in pairs:
        pair = [d for d in differences if (d.arm, d.against) == (own, first)]
        if not pair:
            continue
        gained = points_text(benefit_difference(results, own, first))
        flag = difference(results, own, first, "flag_ttc")
        earlier = f"; TTC at the request {change_text(flag)} s" if flag.estimate.count else ""
        lines.append(f"{verdict(pair)} Avoided less stopped: {gained} points{earlier}.")
    return lines


def _step_line(results: Results, arm: Arm, before: Arm) -> str:
    parts = [
        f"{MEASURES[name].text} {change_text(difference(results, arm, before, name))} points"
        for name in DECISIVE
    ]
    return f"Step from {before.name} to {arm.name}: {' and '.join(parts)}."


def flag_table(results: Results, pairs: Sequence[tuple[Arm, Arm]]) -> Table:
    """Differences of the time to collision at the request, where both sides have one."""
    rows = []
    for arm, against in pairs:
        d = difference(results, arm, against, "flag_ttc")
        count = d.estimate.count
        cells = (change_text(d), str(count), f"{d.more} : {d.fewer}") if count else (EMPTY, "0", EMPTY)
        rows.append((arm.name, against.name, *cells))
    caption = (
        "Time to collision at the first request of scenes in which both sides ask in time; positive: the map "
        "asks earlier. Mean difference with Student's interval (95 %), not corrected for their number."
    )
    header = ("who", "against", "TTC at the request (s)", "scenes", "earlier : later")
    return Table(header, tuple(rows), (), caption)


def steps_table(results: Results, steps: Sequence[tuple[Arm, Arm]]) -> Table:
    """What each step of the ladder changes, by area."""
    names = (*DECISIVE, "early", "flag_ttc")
    header = ["step to", "from", *(f"{MEASURES[n].text} ({MEASURES[n].unit or 'points'})" for n in names)]
    rows = []
    for arm, before in steps:
        changes = (difference(results, arm, before, name) for name in names)
        rows.append(
            (arm.name, before.name, *(change_text(d) if d.estimate.count else EMPTY for d in changes))
        )
    caption = "Same scenes and seeds; 95 % intervals, not corrected for their number."
    return Table(tuple(header), tuple(rows), (), caption)


def chain_table(results: Results, groups: Groups) -> Table:
    """A line per chain, area and rule: rates, detections, and what the tracker dropped of them."""
    header = ["who", *(f"{MEASURES[n].text} ({MEASURES[n].unit or '%'})" for n in SHOWN)]
    header += ["detections per run", "dropped for their score (%)", "cut off"]
    rows = []
    for arms in groups.values():
        for arm in arms:
            runs = results.runs[arm]
            made, dropped = dropped_share(runs)
            share = f"{100.0 * dropped / made:.1f}" if made else EMPTY
            rows.append(
                (
                    arm.name,
                    *(interval_text(results.estimate(arm, name), name) for name in SHOWN),
                    f"{made / max(len(runs), 1):.0f}",
                    share,
                    str(sum(run.cut_off for run in runs)),
                )
            )
    caption = (
        "95 % intervals over the scenes (rates: Wilson, means: Student, medians: order statistics). A "
        "detection under the tracker's score changes nothing, however right its box is."
    )
    return Table(tuple(header), tuple(rows), (), caption)


def place_table(results: Results, groups: Groups) -> Table:
    """Unnecessary stops by where the ego drives."""
    rows = []
    for arms in groups.values():
        for arm in arms:
            rates = [stops_at(results, arm, place) for place in PLACES]
            cells = [
                f"{interval_text(rate, 'stops')} of {rate.count}" if rate.count else EMPTY for rate in rates
            ]
            rows.append((arm.name, *cells))
    header = ("who", *(f"{place} (%)" for place in PLACES))
    return Table(header, tuple(rows), (), "Of the scenes in which nothing should happen; Wilson's intervals.")
