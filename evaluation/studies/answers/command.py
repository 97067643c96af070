"""The command `smartmot-eval study`: a question carried out, or gone on with, and answered."""

from __future__ import annotations

from pathlib import Path

import rich.console

from evaluation.runs.workers import Workers
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.study import Question, results_of
from evaluation.studies.study import done_line


def ask(question: Question, out: Path, workers: Workers = 1, quiet: bool = False) -> Results:
    """Carry a question out, or go on with it; say before the runs what they can decide.

    Args:
        question: what is asked.
        out: folder of all questions; the scenes and the journal are there, the answer in a folder of its own.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.

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
    return results
