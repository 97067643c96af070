"""The comparison over scenes: its runs, and the tables and figures that are made of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import SCHEMA, json_bytes, write_files
from evaluation.results.tables import Table, markdown_table
from evaluation.runs.configuration import digests_of_files, versions
from evaluation.runs.execution import FrameTime
from evaluation.runs.fingerprint import version
from evaluation.studies.compare import figures
from evaluation.studies.compare.answer import answer, told_intervals
from evaluation.studies.compare.differences import (
    Difference,
    difference_table,
    differences,
    differences_csv,
    pairs_with,
    pairs_with_bases,
    told_differences,
)
from evaluation.studies.compare.grid import (
    FRONTIER,
    Point,
    SceneItem,
    ablation_points,
    fair_points,
    joined,
    shown_settings,
    study_runs,
    varied_points,
)
from evaluation.studies.compare.measures import RunMeasures, measure, told_measures
from evaluation.studies.compare.table import (
    AS_PRESET,
    Summary,
    runs_csv,
    scene_table,
    seed_table,
    summaries,
    summary_csv,
    summary_table,
)
from evaluation.studies.study import Finished, Study
from scenarios.catalogue.library import scenario_path
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.reader import load
from scenarios.presets import named_preset, preset_in_weather
from scenarios.scenes.scenes import SceneRun, choose_scenes
from scenarios.sensing import OF_TRUTH, meaningful
from scenarios.settings import (
    PARAMETERS,
    Setting,
    Settings,
    preset_with,
    setting_text,
    settings_text,
)
from scenarios.strategies import path_source
from scenarios.weather import named_weather
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class SceneStudy(Study[SceneItem, RunMeasures]):
    """Strategies and settings over scenes; the help of `smartmot-eval compare` explains each option.

    What is not varied is fair; without `vary` each area has the widths of `widths`; see `fair_points`. All
    points have the settings of `common`.
    """

    strategies: tuple[str, ...]
    preset: str
    vary: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    weather: tuple[str, ...] = ("dry",)
    scenes: tuple[str, ...] = ()
    full: bool = False
    maps: Path | None = None
    seeds: int = 1
    ablation: bool = False
    formats: tuple[str, ...] = figures.FORMATS
    name: str = "compare"
    widths: Mapping[str, tuple[Setting, ...]] = field(default_factory=lambda: FRONTIER)
    common: Settings = ()
    journal = "scenes_"
    table = "runs.csv"
    kind = RunMeasures

    @property
    def points(self) -> tuple[Point, ...]:
        """Strategies and settings that are compared.

        Raises:
            ScenarioError: an unknown preset.
            ArgumentError: a value is out of range.
        """
        if self.ablation:
            return ablation_points(self.strategies, self.preset)
        preset = named_preset(self.preset)
        for name, values in self.vary.items():
            for value in values:
                try:
                    preset_with(preset, tuple((self._beside(name) | {name: value}).items()))
                except (ConfigError, ScenarioError) as error:
                    raise ArgumentError(f"--vary {setting_text(name, value)}: {error}") from None
        if not self.vary:
            return fair_points(self.strategies, self.widths)
        points = varied_points(self.strategies, self.vary)
        # of a sensor without what else is varied, such as a perception, one point is left
        full = (meaningful((dict(self.common) | dict(point.settings)).items()) for point in points)
        own = (Point(p.strategy, self.own(settings)) for p, settings in zip(points, full, strict=True))
        return tuple(dict.fromkeys(own))

    def _beside(self, name: str) -> dict[str, Setting]:
        """What a varied parameter may need beside it: a LiDAR, or the shipped sensor, and a street."""
        chosen = {}
        for key in ("sensor", "street") if name != "sensor" else ():
            usual = PARAMETERS[key].choices[0]
            values = self.vary.get(key, tuple(value for other, value in self.common if other == key))
            unusual = [value for value in values if value != usual]
            if unusual and not (name in OF_TRUTH and usual in values):
                chosen[key] = unusual[0]
        return chosen if "sensor" in chosen else {}

    def own(self, settings: Settings) -> Settings:
        """Settings without those that all points have."""
        return tuple(setting for setting in settings if setting not in self.common)

    def chosen_scenes(self) -> tuple[SceneRun, ...]:
        """The scenes that were asked for."""
        return tuple(choose_scenes(self.scenes, full=self.full, maps=self.maps))

    def items_of(self, scenes: Sequence[SceneRun]) -> list[SceneItem]:
        """The runs of some scenes, by weather, point, scene and seed."""
        return study_runs(self.points, scenes, self.preset, self.weather, self.seeds, self.common)

    def items(self, folder: Path) -> list[SceneItem]:
        """The runs of all scenes that were asked for."""
        return self.items_of(self.chosen_scenes())

    @staticmethod
    def job(item: SceneItem) -> tuple[RunMeasures, FrameTime]:
        """Carry out one of them."""
        return measure(item)

    def write(self, folder: Path, items: Sequence[SceneItem], finished: Finished[RunMeasures]) -> list[Path]:
        """Write tables and figures; all but `times.md` are the same bytes for the same comparison."""
        return compared(self, items, finished).write(folder)


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What a comparison came to.

    Args:
        study: what was compared.
        scenes: in which it was.
        runs: measures of the runs.
        spent: processor times, in the same order.
        rows: a summary per weather, strategy and settings.
        differences: between the points: of an ablation against the preset, else against the usual points.
    """

    study: SceneStudy
    scenes: tuple[SceneRun, ...]
    runs: list[RunMeasures]
    spent: list[FrameTime]
    rows: list[Summary]
    differences: list[Difference]

    @property
    def title(self) -> str:
        """Of tables and figures."""
        seeds = f"{self.study.seeds} seed{'s' if self.study.seeds > 1 else ''}"
        parts = [f"{len(self.scenes)} scene variants, {seeds}, preset {self.study.preset}"]
        return ", ".join(parts + [settings_text(self.study.common)] * bool(self.study.common))

    @property
    def shown_differences(self) -> list[Difference]:
        """Those that are shown as text: of an ablation all, else those between usual points."""
        points = self.study.points
        usual = points if self.study.ablation else usual_points(points, self.study.preset)
        return [difference for difference in self.differences if difference.point in usual]

    def told(self) -> list[str]:
        """The answer in sentences: widths, what the intervals mean, which differences are clear; notes."""
        lines = [] if self.study.ablation else answer(self.rows, self.study.points)
        lines.append(told_intervals(self.rows))
        shown = self.shown_differences
        return [*lines, *([told_differences(shown)] if shown else []), *told_measures(self.runs)]

    def write(self, out: Path) -> list[Path]:
        """Write tables and figures.

        Raises:
            ResultsError: the folder cannot be written.
        """
        contents = {
            "runs.csv": runs_csv(self.runs),
            "table.csv": summary_csv(self.rows),
            "differences.csv": differences_csv(self.differences),
            "table.md": self._text().encode(),
            "compare.json": _configuration(self.study, self.scenes, out),
            "times.md": markdown_table(time_table(self.runs, self.spent)).encode(),
        }
        return [*write_files(out, contents), *self._draw(out)]

    def _text(self) -> str:
        """Everything that is shown as text, as Markdown."""
        usual = usual_points(self.study.points, self.study.preset)
        parts = [markdown_table(summary_table(self.rows)), *(f"{line}\n" for line in self.told())]
        if self.study.seeds > 1:
            parts += ["## Over the seeds\n", markdown_table(seed_table(self.rows))]
        different = difference_table(self.shown_differences)
        if different.rows:
            parts += ["## Differences\n", markdown_table(different)]
        return "\n".join([*parts, "## By scene\n", markdown_table(scene_table(self.runs, usual))])

    def _draw(self, out: Path) -> list[Path]:
        """A figure per weather."""
        drawn: list[Path] = []
        study = self.study
        for weather in study.weather if study.formats else ():
            rows = [row for row in self.rows if row.weather == weather]
            several = f"_{weather}" if len(study.weather) > 1 else ""
            if study.ablation:
                figure = figures.ablation(rows, f"One choice changed: {self.title}, {weather}")
                drawn += figures.save(figure, out / f"ablation{several}", study.formats)
            elif any(row.avoided.count for row in rows) and any(row.false_activations.count for row in rows):
                figure = figures.frontier(rows, study.points, f"{self.title}, {weather}")
                drawn += figures.save(figure, out / f"frontier{several}", study.formats)
        return drawn


def compared(study: SceneStudy, items: Sequence[SceneItem], finished: Finished[RunMeasures]) -> Compared:
    """Finished runs, summarised and set against one another.

    A run is kept once, whether the preset's own values were asked for by name or not; in the tables it is
    called as it was asked for.
    """
    runs = [
        dataclasses.replace(finished[item.key][0], settings=settings_text(study.own(item.spec.settings)))
        for item in items
    ]
    spent = [finished[item.key][1] for item in items]
    scenes = tuple(dict.fromkeys(item.label for item in items))
    points = study.points
    pairs = (
        pairs_with_bases(points) if study.ablation else pairs_with(points, usual_points(points, study.preset))
    )
    return Compared(study, scenes, runs, spent, summaries(runs), differences(runs, pairs))


def usual_points(points: Sequence[Point], preset: str) -> list[Point]:
    """Points whose numbers are as the preset has them, names apart; of a strategy without one its first."""
    usual = [
        point
        for point in points
        if all(
            PARAMETERS[k].choices or PARAMETERS[k].of(named_preset(preset)) == v for k, v in point.settings
        )
    ]
    has = {point.strategy for point in usual}
    first = {point.strategy: point for point in reversed(points) if point.strategy not in has}
    return [point for point in points if point in usual or first.get(point.strategy) == point]


def time_table(runs: Sequence[RunMeasures], spent: Sequence[FrameTime]) -> Table:
    """Processor time per frame of each strategy and settings: medians over its runs."""
    import numpy as np

    groups: dict[tuple[str, str], list[FrameTime]] = {}
    for run, time in zip(runs, spent, strict=True):
        if time.frames:
            groups.setdefault((run.strategy, run.settings), []).append(time)
    lines = []
    for (strategy, settings), times in groups.items():
        median, high = (
            float(np.median([getattr(time, name) for time in times])) for name in ("median_ms", "p95_ms")
        )
        name = shown_settings(settings) or AS_PRESET
        lines.append((strategy, name, str(len(times)), f"{median:.2f}", f"{high:.2f}"))
    header = ("strategy", "settings", "runs", "median per frame (ms)", "95th percentile (ms)")
    caption = "Processor time of perception and decision; medians over the runs."
    return Table(header, tuple(lines), (), caption)


def _configuration(study: SceneStudy, scenes: Sequence[SceneRun], out: Path) -> bytes:
    """Everything that determines the results, as JSON."""
    preset = named_preset(study.preset)
    folder = out.resolve()
    full = {point: joined(study.common, point.settings) for point in study.points}
    digests = {
        run: digests_of_files(load(scenario_path(run.file), dict(run.parameters)).files, folder)
        for run in scenes
    }
    values = {
        "schema": SCHEMA,
        "version": version(),
        "versions": versions(),
        "preset": study.preset,
        "seeds": study.seeds,
        "common": dict(study.common),
        "points": [
            {"strategy": point.strategy, "settings": dict(point.settings)}
            | {"path_from": path_source(point.strategy, preset_with(preset, full[point]))}
            for point in study.points
        ],
        "scenes": [
            {"scene": run.scene, "variant": run.variant, "must": run.must, "file": Path(run.file).name}
            | {"parameters": {k: v for k, v in run.parameters if k != "Map"}}
            | {"files": sorted(digests[run])}
            for run in scenes
        ],
        "presets": {
            f"{point.strategy} {point.text} {name}": preset_with(
                preset_in_weather(preset, named_weather(name)), full[point]
            )
            for name in study.weather
            for point in study.points
        },
        "files": {name: digest for of_scene in digests.values() for name, digest in of_scene.items()},
    }
    return json_bytes(values, indent=1)
