"""The comparison over scenes, the ablations and the growth as parts of the reference results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.runs.execution import FrameTime
from evaluation.studies import growth
from evaluation.studies.compare.command import CompareOptions, compared, kept_measures, points_for, write
from evaluation.studies.compare.grid import StudyRun, study_runs
from evaluation.studies.compare.measures import RunMeasures, measure
from evaluation.studies.compare.table import summaries
from evaluation.studies.growth import GrowthRun, GrowthTask
from evaluation.studies.reference.part import Finished
from scenarios.scenes.scenes import choose_scenes

QUICK_OTHERS = 50


@dataclass(frozen=True, slots=True)
class ScenesPart:
    """A comparison over scenes.

    Args:
        name: of the folder.
        options: what is compared; where to is decided later.
    """

    name: str
    options: CompareOptions
    journal = "scenes_"
    table = "runs.csv"
    kind = RunMeasures

    def tasks(self, folder: Path) -> list[StudyRun]:
        """The runs, by weather, point, scene and seed."""
        options = self.options
        scenes = choose_scenes(options.scenes, full=options.full)
        return study_runs(points_for(options), scenes, options.preset, options.weather, options.seeds)

    @staticmethod
    def job(task: StudyRun) -> tuple[RunMeasures, FrameTime]:
        """Carry out one of them."""
        return measure(task)

    def is_quick(self, task: StudyRun) -> bool:
        """All of them."""
        return True

    def is_whole(self, task: StudyRun) -> bool:
        """Nothing is written beside the journal."""
        return True

    def write(self, folder: Path, tasks: Sequence[StudyRun], found: Finished) -> None:
        """Write tables and figures, as `smartmot-eval compare` does."""
        options = replace(self.options, out=folder)
        measures, spent = kept_measures(tasks, found)
        scenes, points = choose_scenes(options.scenes, full=options.full), points_for(options)
        rows, differences = summaries(measures), compared(options, points, measures)
        write(options, scenes, points, measures, rows, differences, spent)


@dataclass(frozen=True, slots=True)
class GrowthPart:
    """More and more others around the ego.

    Args:
        name: of the folder.
        strategies, preset, weather, seeds: what is run.
    """

    name: str
    strategies: tuple[str, ...]
    preset: str
    weather: str
    seeds: int
    journal = "growth_"
    table = "growth.csv"
    kind = GrowthRun

    def tasks(self, folder: Path) -> list[GrowthTask]:
        """The runs."""
        return growth.growth_tasks(self.strategies, self.preset, self.weather, self.seeds)

    @staticmethod
    def job(task: GrowthTask) -> tuple[GrowthRun, FrameTime]:
        """Carry out one of them."""
        return growth.grow(task)

    def is_quick(self, task: GrowthTask) -> bool:
        """Those among few others."""
        return task.others <= QUICK_OTHERS

    def is_whole(self, task: GrowthTask) -> bool:
        """Nothing is written beside the journal."""
        return True

    def write(self, folder: Path, tasks: Sequence[GrowthTask], found: Finished) -> None:
        """Write table and figure, as `smartmot-eval compare --growth` does."""
        runs, spent = zip(*(found[task.key] for task in tasks), strict=True)
        growth.write_growth(tasks, runs, spent, folder, ("png",))
