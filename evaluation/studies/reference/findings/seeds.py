"""What other noise and another frame phase change in the comparison over scenes, in sentences."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from evaluation.results.tables import Table
from evaluation.studies.compare.answer import told_intervals
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.table import summaries, summarise
from evaluation.studies.reference.findings.scenes import OUTCOMES, SHOWN, Outcome, of_point
from evaluation.studies.reference.words import counted, listed


def _names(runs: Sequence[RunMeasures]) -> list[str]:
    """Strategies that there are runs of."""
    return [name for name, point in SHOWN.items() if of_point(runs, point)]


def _by_seed(runs: Sequence[RunMeasures], outcome: Outcome) -> tuple[list[int], int]:
    """How many runs of each seed came to that, and of how many."""
    seeds: dict[int, list[bool]] = defaultdict(list)
    for run in outcome.runs(runs):
        seeds[run.seed].append(outcome.is_so(run))
    return [sum(marks) for _, marks in sorted(seeds.items())], max(map(len, seeds.values()), default=0)


def seed_table(runs: Sequence[RunMeasures]) -> Table:
    """Counts of each seed, and intervals over the seeds and over the scenes."""
    header = ["strategy"]
    for outcome in OUTCOMES.values():
        header += [f"{outcome.text}, by seed", "over the seeds (%)", "over the scenes (%)"]
    lines = []
    for name in _names(runs):
        of_name = of_point(runs, SHOWN[name])
        row = summarise(of_name)
        cells = [name]
        for measure, outcome in OUTCOMES.items():
            counts, of = _by_seed(of_name, outcome)
            estimates = (row.over_seeds[measure], getattr(row, measure))
            cells += [
                f"{listed(counts)} of {of}",
                *(f"{100 * e.low:.0f} to {100 * e.high:.0f}" for e in estimates),
            ]
        lines.append(tuple(cells))
    return Table(tuple(header), tuple(lines))


def told_seeds(runs: Sequence[RunMeasures]) -> list[str]:
    """How many outcomes differ between seeds, how wide intervals are, and what stays as it is."""
    lines = [told_changed(runs), told_intervals(summaries(runs))]
    for first, second in (
        ("the map", "the path"),
        ("the map", "the rectangle"),
        ("the map as published", "the rectangle as published"),
    ):
        changes = []
        for outcome in OUTCOMES.values():
            (ours, of), (theirs, _) = (
                _by_seed(of_point(runs, SHOWN[name]), outcome) for name in (first, second)
            )
            more = listed(f"{a - b:+d}" if a != b else "0" for a, b in zip(ours, theirs, strict=True))
            changes.append(f"{more} of {of} {outcome.text}")
        lines.append(f"Seed by seed, {first} less {second} is {' and '.join(changes)}.")
    return lines


def told_changed(runs: Sequence[RunMeasures]) -> str:
    """Which outcomes are not the same for all seeds."""
    total, changed = 0, []
    for name in _names(runs):
        outcomes: dict[tuple[str, str, float], set[bool]] = defaultdict(set)
        for run in of_point(runs, SHOWN[name]):
            for outcome in OUTCOMES.values():
                if run.must == outcome.must:
                    outcomes[run.scene, run.variant, run.v_test_kmh].add(outcome.is_so(run))
        total += len(outcomes)
        changed += [(name, scene, v) for (scene, _, v), values in outcomes.items() if len(values) > 1]
    seeds = len({run.seed for run in runs})
    text = f"{counted(len(changed), total).capitalize()} outcomes are not the same for all {seeds} seeds"
    if not changed:
        return f"{text}."
    places = [
        f"{name}: {listed(f'{scene} at {v:g} km/h' for who, scene, v in changed if who == name)}"
        for name in dict.fromkeys(who for who, _, _ in changed)
    ]
    return f"{text} ({'; '.join(places)})."
