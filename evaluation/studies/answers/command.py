"""The command `smartmot-eval study`: a question carried out, or gone on with, and answered."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import rich.console

from evaluation.runs.workers import Workers
from evaluation.studies.answers.arms import ArmRun
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.study import Question, results_of
from evaluation.studies.diff.results import compared_outcome
from evaluation.studies.logged import MOST_REPLAYS, folder_name, log_runs, most_telling
from evaluation.studies.study import done_line
from scenarios.spec import RunSpec


def ask(
    question: Question, out: Path, workers: Workers = 1, quiet: bool = False, logs: bool = False
) -> Results:
    """Carry a question out, or go on with it; say before the runs what they can decide.

    Args:
        question: what is asked.
        out: folder of all questions; the scenes and the journal are there, the answer in a folder of its own.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.
        logs: whether to log the runs that say most as well, `MOST_REPLAYS` at most.

    Returns:
        The runs, by side.

    Raises:
        ArgumentError: a setting is out of range.
        ResultsError: the folder cannot be written.
        ScenarioError: an unknown preset, rule or split.
    """
    console = rich.console.Console(quiet=quiet)
    items = question.items(out)
    scenes = tuple(dict.fromkeys(item.label[1] for item in items))
    for line in question.power(scenes):
        console.print(line, highlight=False)
    finished, before = question.carry_out_behind_bar(
        items, out, question.journal, workers, console, question.name
    )
    results = results_of(items, finished)
    answer = question.answer(results)
    written = question.write_answer(out / question.name, results, answer)
    for line in answer.sentences:
        console.print(line, highlight=False)
    names = [path.name for path in written]
    console.print(done_line(len(items), before, out / question.name, names), highlight=False)
    if logs:
        groups = logged_groups(items, results)
        log_runs(groups, out / question.name, workers)
        count = sum(map(len, groups.values()))
        console.print(
            f"logs of {count} of {len(items)} runs, {MOST_REPLAYS} at most; smartmot-eval report "
            f"{out / question.name} makes a page with replays",
            highlight=False,
            soft_wrap=True,
        )
    return results


def logged_groups(items: Sequence[ArmRun], results: Results) -> dict[str, list[RunSpec]]:
    """The runs that are logged, by folder: of each side those that ended badly first; see `most_telling`."""
    arms = list(results.runs)
    specs = {item.label: item.spec for item in items}
    scenes = {scene.name: scene for scene in results.scenes}
    endings = [
        {
            scene.name: (_outcome(scene.must, run),)
            for scene, run in zip(results.scenes, results.runs[arm], strict=True)
        }
        for arm in arms
    ]
    groups: dict[str, list[RunSpec]] = {}
    for number, name in most_telling(endings):
        folder = folder_name(number, arms[number].name)
        groups.setdefault(folder, []).append(specs[arms[number], scenes[name]])
    return groups


def _outcome(must: str, run: Decision) -> str:
    """How a run ended, in a word, as the page of the comparison has it."""
    values = {"must": must, "needless_stop": run.unnecessary_stop}
    return compared_outcome(dataclasses.asdict(run) | values)
