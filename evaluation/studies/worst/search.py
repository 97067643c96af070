"""`study worst`: where a rule and its area just fail, and how probable that is."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rich.console

from evaluation.metrics.intervals import Estimate, wilson
from evaluation.progress import study_progress
from evaluation.results.calls import note
from evaluation.results.files import SCHEMA, STUDY_JSON, json_bytes, write_files
from evaluation.results.gates import Side
from evaluation.results.tables import Table, csv_bytes
from evaluation.runs.configuration import versions
from evaluation.runs.fingerprint import version
from evaluation.runs.journal import Journal
from evaluation.runs.workers import Workers
from evaluation.studies.answers.study import Answer
from evaluation.studies.compare.figures import FORMATS, save
from evaluation.studies.suite import compare_files
from evaluation.studies.worst.family import CUT_OFF_RUN, EARLY_RUN, Came, Case, Family, come
from evaluation.studies.worst.subset import RareFailure, monte_carlo, subset_simulation
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PREFIX = "worst_"
"""Of the journal."""
NEAREST = 10
"""Failures that are shown: those with the least impact speeds."""


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """What a search came to.

    Args:
        family: where it was searched.
        failure: the estimate.
        cases: all that were tried, in their order, with what they came to.
        first: how many of these are the independent ones of the first level, drawn in vain or not.
        plain: independent runs and contacts among them, where they were asked for: an estimate beside.
    """

    family: Family
    failure: RareFailure
    cases: tuple[tuple[Case, Came], ...]
    first: int
    plain: Estimate | None

    @property
    def possible(self) -> list[tuple[Case, Came]]:
        """Cases that can be."""
        return [(case, came) for case, came in self.cases if came.margin is not None]

    @property
    def nearest(self) -> list[tuple[Case, Came]]:
        """The failures with the least impact speeds, each once."""
        failed = {case.key: (case, came) for case, came in self.possible if came.collided}
        return sorted(failed.values(), key=lambda pair: pair[1].v_impact_kmh)[:NEAREST]


def search(
    family: Family,
    out: Path,
    *,
    samples: int = 200,
    share: float = 0.2,
    seed: int = 0,
    plain: int = 0,
    workers: Workers = 1,
    quiet: bool = False,
) -> Searched:
    """Search a family; what was carried out before in the folder is taken from its journal.

    Args:
        family: of scenes, with who decides in them.
        out: folder of the journal.
        samples: of each level, see `subset_simulation`.
        share: that a level goes on with.
        seed: of the draws.
        plain: independent runs that estimate the same beside; 0: none.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: no progress bar.

    Raises:
        ArgumentError: hardly any scene of the family can be.
        ResultsError: the folder cannot be written.
    """
    tried: dict[str, tuple[Case, Came]] = {}
    first = 0
    with Journal(out, Came, PREFIX) as journal, study_progress(rich.console.Console(quiet=quiet)) as bar:

        def steps(count: int) -> None:
            for _ in range(count):
                bar.done()

        def margins(sample: FloatArray) -> FloatArray:
            cases = {case.key: case for case in family.cases(sample)}
            bar.begin(f"{family.name}: {len(tried)} scenes so far", len(cases))
            kept, _ = journal.carry_out(come, cases, workers, steps)
            outcomes = [kept[key][0] for key in cases]
            tried.update({key: (cases[key], came) for key, came in zip(cases, outcomes, strict=True)})
            return np.array([np.nan if came.margin is None else came.margin for came in outcomes])

        failure = subset_simulation(
            margins, family.dimension, samples=samples, share=share, seed=seed, apart=1
        )
        first, cases = failure.drawn, tuple(tried.values())
        estimate = None
        if plain:
            failed, count = monte_carlo(margins, family.dimension, plain, seed + 1)
            estimate = wilson(failed, count)
    return Searched(family, failure, cases, first, estimate)


def answer(searched: Searched) -> Answer:
    """The answer in words, levels, failures and figure."""
    failure, family = searched.failure, searched.family
    low, high = failure.interval
    ended = failure.levels[-1].threshold == 0.0 and failure.levels[-1].share > 0.0
    if ended:
        words = [
            f"{family.arm.text}, preset {family.arm.preset}, in scenes of the family {family.name!r}: a "
            f"contact with probability {failure.probability:.2g} [{low:.2g}, {high:.2g}].",
            f"{failure.runs} runs. As many independent ones as give the same interval: "
            f"{failure.monte_carlo_runs:.0f}, {failure.monte_carlo_runs / failure.runs:.2g} times as many.",
        ]
    else:
        words = [f"No contact in {failure.runs} runs of the family {family.name!r}."]
    if searched.plain is not None:
        p = searched.plain
        agree = ended and low <= p.high and p.low <= high
        words.append(
            f"Independent runs beside: {p.value:.2g} [{p.low:.2g}, {p.high:.2g}] of {p.count}; the two "
            f"{'agree' if agree else 'do not agree'}."
        )
    for reason, text in (
        (CUT_OFF_RUN, "were cut off by the time limit"),
        (EARLY_RUN, "braked before the target set off, and never met it"),
    ):
        count = sum(came.rejected == reason for _, came in searched.cases)
        if count:
            words.append(f"{count} runs {text}; they are in no number.")
    ranked = influence(searched)
    if ranked:
        named = ", ".join(f"{name} ({value:+.2f})" for name, value in ranked[:4])
        words.append(f"What goes with the margin most, by rank correlation over independent draws: {named}.")
    figures: dict[str, Figure] = {}
    if len(ranked) >= 2:
        from evaluation.studies.worst.figure import boundary

        figures["boundary"] = boundary(searched, ranked[0][0], ranked[1][0])
    return Answer(
        f"Where does {family.arm.strategy} with rule {family.arm.rule} just fail?",
        words,
        {"Levels": _levels_table(failure), "The nearest failures": _nearest_table(searched)},
        figures,
        {"levels.csv": _csv(_levels_table(failure)), "nearest.csv": _csv(_nearest_table(searched))},
        (
            f"{failure.drawn} draws gave the first {len(failure.levels[0].margin)} scenes; the others cannot "
            "be, as scenes of the family are drawn (docs/scenes.md). Probabilities are of those.",
            f"{failure.proposed_in_vain} proposals of the chains could not be either.",
            "The margin is the least gap to the target, or the impact speed with a minus. Levels are taken "
            "for independent, which makes the interval a little too narrow: docs/answers.md.",
        ),
    )


def influence(searched: Searched) -> list[tuple[str, float]]:
    """Rank correlations of drawn numbers with the margin over the independent scenes, the greatest first."""
    from scipy.stats import spearmanr

    cases = [came for _, came in searched.cases[: searched.first] if came.margin is not None]
    margin = np.array([came.margin for came in cases])
    columns = number_columns(cases)
    ranked = []
    for name, values in columns.items():
        known = ~np.isnan(values)
        if known.sum() >= max(10, len(cases) // 2) and len(np.unique(values[known])) > 2:
            rho = float(spearmanr(values[known], margin[known]).statistic)
            if np.isfinite(rho):
                ranked.append((name, rho))
    return sorted(ranked, key=lambda pair: (-abs(pair[1]), pair[0]))


def number_columns(cases: Sequence[Came]) -> Mapping[str, FloatArray]:
    """(N,) drawn numbers by name; NaN where one was not drawn."""
    values = [json.loads(came.values) for came in cases]
    names = sorted({name for row in values for name, value in row.items() if isinstance(value, float)})
    return {name: np.array([_number(row.get(name)) for row in values]) for name in names}


def _number(value: object) -> float:
    return value if isinstance(value, float) else np.nan


def write(
    searched: Searched, out: Path, formats: Sequence[str] = FORMATS, workers: Workers = 1
) -> list[Path]:
    """Write the answer, all runs, and the nearest failures as a folder of runs with their scenes and logs.

    Raises:
        ResultsError: the folder cannot be written.
    """
    result = answer(searched)
    family, failure = searched.family, searched.failure
    asked = {
        "schema": SCHEMA,
        "version": version(),
        "versions": versions(),
        "question": "worst",
        "family": family.name,
        "split": family.split,
        "arm": {"strategy": family.arm.strategy, "preset": family.arm.preset}
        | {"settings": dict(family.arm.settings), "common": dict(family.common)},
        "probability": failure.probability,
        "interval": list(failure.interval),
        "runs": failure.runs,
    }
    contents = {
        "answer.md": result.markdown(form=formats[0] if formats else FORMATS[0]),
        "runs.csv.gz": gzip.compress(_runs_csv(searched), mtime=0),
        STUDY_JSON: json_bytes(asked, indent=1),
        **result.files,
    }
    written = write_files(out, contents)
    for name, figure in result.figures.items() if formats else ():
        written += save(figure, out / name, formats)
    if searched.nearest:
        folder = out / "nearest"
        (folder / "scenes").mkdir(parents=True, exist_ok=True)
        specs = [case.spec(case.draw(folder / "scenes")) for case, _ in searched.nearest]
        for file in (folder / "scenes").rglob("*.x*"):
            note(file)
        compare_files(specs, folder, None, workers, quiet=True)
        written.append(folder)
    return written


def _levels_table(failure: RareFailure) -> Table:
    header = ("level", "margin at most", "share below", "variation", "accepted", "probability so far")
    rows, so_far = [], 1.0
    for number, level in enumerate(failure.levels):
        so_far *= level.share
        accepted = "" if np.isnan(level.accepted) else f"{level.accepted:.2f}"
        rows.append(
            (
                str(number), f"{level.threshold:.3f}", f"{level.share:.3f}", f"{level.variation:.3f}",
                accepted, f"{so_far:.3g}",
            )
        )  # fmt: skip
    return Table(header, tuple(rows))


def _nearest_table(searched: Searched) -> Table:
    ranked = [name for name, _ in influence(searched)[:6]]
    header = ("run", "impact speed (km/h)", "scene", *ranked)
    rows = []
    for case, came in searched.nearest:
        values = json.loads(came.values)
        rows.append(
            (case.name, f"{came.v_impact_kmh:.1f}", came.variant, *(f"{values.get(n, '')}" for n in ranked))
        )
    return Table(header, tuple(rows))


def _csv(table: Table) -> bytes:
    return csv_bytes(table.header, table.rows)


def _runs_csv(searched: Searched) -> bytes:
    names = [entry.name for entry in fields(Came)]
    return csv_bytes(
        ("run", "independent", "noise", *names),
        (
            (case.name, number < searched.first, case.noise, *(getattr(came, name) for name in names))
            for number, (case, came) in enumerate(searched.cases)
        ),
    )


def folder_of(family: Family, out: Path) -> Path:
    """The folder for the answer, in the folder of all questions."""
    return out / "worst" / family.name.replace(" ", "-")


WORST_MEASURES = ("probability", "probability_low", "probability_high", "contacts", "runs")
"""Of the one that was searched, for gates; docs/gates.md has their meaning."""


def side_of_search(searched: Searched) -> Side:
    """What a search came to, with its nearest failures."""
    low, high = searched.failure.interval
    values = {
        "probability": searched.failure.probability,
        "probability_low": low,
        "probability_high": high,
        "contacts": float(sum(came.collided for _, came in searched.possible)),
        "runs": float(searched.failure.runs),
    }
    arm = searched.family.arm
    detail = ", ".join((searched.family.name, arm.preset, arm.text))
    return Side(arm.name, values, detail, {"contacts": [case.name for case, _ in searched.nearest]})


def ask(
    family: Family,
    out: Path,
    *,
    samples: int,
    seed: int,
    plain: int,
    formats: Sequence[str],
    workers: Workers,
    quiet: bool,
) -> Searched:
    """Carry out a search, say what it came to, and write it."""
    console = rich.console.Console(quiet=quiet)
    searched = search(family, out, samples=samples, seed=seed, plain=plain, workers=workers, quiet=quiet)
    folder = folder_of(family, out)
    written = write(searched, folder, formats, workers)
    for line in answer(searched).sentences:
        console.print(line, highlight=False)
    names = ", ".join(path.name for path in written)
    console.print(f"{len(searched.cases)} scenes; in {folder}: {names}", highlight=False, soft_wrap=True)
    if searched.nearest:
        console.print(
            f"smartmot-eval report {folder / 'nearest'} shows the nearest failures",
            highlight=False,
            soft_wrap=True,
        )
    return searched
