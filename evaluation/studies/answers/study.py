"""What all questions share: drawn scenes, arms, a journal, and a page that answers in words first."""

from __future__ import annotations

import dataclasses
import gzip
import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from evaluation.results.files import SCHEMA, STUDY_JSON, json_bytes, write_bytes, write_files
from evaluation.results.tables import Table, csv_bytes, markdown_table
from evaluation.runs.configuration import versions
from evaluation.runs.execution import FrameTime
from evaluation.runs.fingerprint import digest_of, file_digest, library_versions, version
from evaluation.runs.specs import lidar_notes
from evaluation.studies.answers.arms import Arm, ArmRun, arm_runs
from evaluation.studies.answers.measures import Decision, decide
from evaluation.studies.answers.results import Results, power_lines
from evaluation.studies.answers.tables import path_note
from evaluation.studies.compare.figures import FORMATS, save
from evaluation.studies.study import JOURNAL, Finished, Study, evenly
from scenarios import drawn
from scenarios.drawn.draw import KINDS, copy_maps, draw_one, drawn_scenes, grounds_of
from scenarios.presets import named_preset
from scenarios.scenes.scenes import SceneRun
from scenarios.settings import Settings, preset_with

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENES = "scenes"
"""Folder of the drawn scenes."""
LIST = "list.json"
"""What was drawn into a folder."""
NOW: Mapping[str, object] = MappingProxyType({})
"""Of runs that this version has carried out."""
PREFIX = "study_"
"""Of the journal, which all questions of a folder share."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Which scenes are drawn.

    Args:
        split: train or test; their maps are others.
        count: scenes of each kind.
        seed: of scenes and sensor noise.
        maps: folder of further maps.
    """

    split: str = "test"
    count: int = 300
    seed: int = 0
    maps: Path | None = None

    def draw(self, folder: Path) -> tuple[SceneRun, ...]:
        """The scenes, their files in a folder; those that this version has drawn before are read again.

        Raises:
            ScenarioError: there is no such split, or no map that can be read.
            ResultsError: the folder cannot be written.
        """
        target = folder / SCENES / f"{self.split}_{self.seed}_{self.count}"
        listed, key = target / LIST, self._key()
        known = _read_list(listed, key)
        if known is None:
            listed.unlink(missing_ok=True)  # it must not stand beside the files of an unfinished draw
            known = drawn_scenes(self.split, self.count, self.seed, target, self.maps)
            scenes = [dataclasses.asdict(scene) | {"file": Path(scene.file).name} for scene in known]
            write_bytes(listed, json_bytes({"key": key, "scenes": scenes}, indent=1))
        return known

    def draw_one(self, number: int, folder: Path) -> SceneRun:
        """The scene that `draw` has in a place, without the others."""
        kind, number = divmod(number, self.count)
        grounds = grounds_of(self.split, self.maps)
        copy_maps(folder, grounds)
        return draw_one(self.split, self.seed, list(KINDS)[kind], number, folder, grounds).run

    def _key(self) -> str:
        """Hash of everything that determines the scenes."""
        files = sorted(
            path for path in Path(drawn.__path__[0]).rglob("*") if path.suffix in (".py", ".toml", ".xodr")
        )
        own = sorted(self.maps.glob("*.xodr")) if self.maps else []
        known = [[path.name, file_digest(path)] for path in (*files, *own)]
        code = [version(), library_versions()]
        return digest_of([code, self.split, self.count, self.seed, self.maps is None, known])


def _read_list(path: Path, key: str) -> tuple[SceneRun, ...] | None:
    """Scenes that were drawn before; None if they are others, or a file is missing."""
    try:
        content = json.loads(path.read_bytes())
        scenes = tuple(
            SceneRun(**scene | {"file": str(path.parent / scene["file"]), "parameters": ()})
            for scene in content["scenes"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return scenes if content["key"] == key and all(Path(scene.file).is_file() for scene in scenes) else None


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What a question came to.

    Args:
        title: the question.
        sentences: the answer in words.
        tables: by heading; each is shown as text.
        figures: by file name.
        files: further files by name.
        notes: what is assumed, and how to read it.
    """

    title: str
    sentences: list[str]
    tables: Mapping[str, Table] = field(default_factory=dict)
    figures: Mapping[str, Figure] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def markdown(self, first: Sequence[str] = (), form: str = FORMATS[0]) -> bytes:
        """The page: words, figures, tables, notes.

        Args:
            first: notes before its own: what the scenes can decide, where the planned path comes from.
            form: of the figures.
        """
        parts = [f"# {self.title}\n", *(f"- {line}" for line in self.sentences), ""]
        parts += [f"![{name}]({name}.{form})\n" for name in self.figures]
        for heading, table in self.tables.items():
            parts += [f"## {heading}\n", markdown_table(table)]
        notes = (*first, *self.notes)
        if notes:
            parts += ["## How to read it\n", *(f"- {note}" for note in notes), ""]
        return "\n".join(parts).encode()


@dataclass(frozen=True, slots=True)
class Question(Study[ArmRun, Decision]):
    """A question over drawn scenes; subclasses say which arms it takes, and what the runs answer."""

    sample: Sample = Sample()
    formats: tuple[str, ...] = FORMATS
    common: Settings = ()
    journal = PREFIX
    table = "runs.csv.gz"
    kind = Decision

    @property
    @abstractmethod
    def arms(self) -> tuple[Arm, ...]:
        """Who is run."""

    @property
    @abstractmethod
    def questions(self) -> int:
        """How many differences are tested."""

    @abstractmethod
    def answer(self, results: Results) -> Answer:
        """What the runs say."""

    def items_of(self, scenes: Sequence[SceneRun]) -> list[ArmRun]:
        """The runs over some scenes, by arm and scene.

        Raises:
            ArgumentError: a setting is out of range.
        """
        for arm in self.arms:
            arm.having(*self.common).check()
        return arm_runs(self.arms, scenes, self.sample.seed, self.common)

    def place(self, out: Path) -> Path:
        """The scenes are drawn for all questions once, and not kept."""
        return out / JOURNAL

    def items(self, folder: Path) -> list[ArmRun]:
        """The runs over the drawn scenes; what can be said of the arms is said before these are drawn.

        Raises:
            ArgumentError: a setting is out of range.
            smartmot.errors.PluginError: what is the user's own cannot be made, or fails.
        """
        self.check()
        return self.items_of(self.sample.draw(folder))

    def check(self) -> None:
        """See that all arms can be run; see `items` for what it raises."""
        arms = [arm.having(*self.common) for arm in self.arms]
        for arm in arms:
            arm.check()
        own = {arm.plugins: arm for arm in arms if arm.plugins}
        for arm in own.values():
            arm.try_out()

    def some(self, count: int, folder: Path) -> tuple[int, dict[int, ArmRun]]:
        """A few runs; only their scenes are drawn."""
        arms, scenes = self.arms, len(KINDS) * self.sample.count
        total = len(arms) * scenes
        chosen = {}
        for k in evenly(count, total):
            arm, number = divmod(k, scenes)
            scenes_of_run = [self.sample.draw_one(number, folder)]
            (chosen[k],) = arm_runs([arms[arm]], scenes_of_run, self.sample.seed, self.common)
        return total, chosen

    @staticmethod
    def job(item: ArmRun) -> tuple[Decision, FrameTime]:
        """Carry out one of them."""
        return decide(item)

    def power(self, scenes: Sequence[SceneRun]) -> list[str]:
        """Which differences the scenes can decide."""
        return power_lines(scenes, self.questions)

    def write(self, folder: Path, items: Sequence[ArmRun], finished: Finished[Decision]) -> list[Path]:
        """Write page, tables and figures; the same bytes for the same question."""
        results = results_of(items, finished)
        return self.write_answer(folder, results, self.answer(results))

    def write_answer(
        self, folder: Path, results: Results, answer: Answer, made_by: Mapping[str, object] = NOW
    ) -> list[Path]:
        """Write an answer.

        Args:
            folder: where.
            results: its runs.
            answer: what they say.
            made_by: versions that carried the runs out, if they are not today's.

        Raises:
            ResultsError: the folder cannot be written.
        """
        sensing = preset_with(named_preset("physical"), self.common)
        sensor_lines = lidar_notes(sensing, "street_seed" not in dict(self.common))
        notes = (*self.power(results.scenes), path_note(self.arms), *sensor_lines)
        contents = {
            "answer.md": answer.markdown(notes, *self.formats[:1]),
            self.table: gzip.compress(runs_csv(results, self.kind), mtime=0),
            STUDY_JSON: json_bytes(self._configuration(results.scenes) | dict(made_by), indent=1),
            **answer.files,
        }
        paths = write_files(folder, contents)
        for name, figure in answer.figures.items() if self.formats else ():
            paths += save(figure, folder / name, self.formats)
        return paths

    def _configuration(self, scenes: Sequence[SceneRun]) -> dict[str, object]:
        """What was asked."""
        sample = {"split": self.sample.split, "count": self.sample.count, "seed": self.sample.seed}
        return {
            "schema": SCHEMA,
            "version": version(),
            "versions": versions(),
            "question": self.name,
            "sample": sample,
            "common": dict(self.common),
            "scenes": {must: sum(s.must == must for s in scenes) for must in ("brake", "nothing")},
            "arms": [
                {"name": arm.name, "preset": arm.preset, "strategy": arm.strategy}
                | {"settings": dict(arm.settings), "coins": list(arm.coins), "path_from": arm.path_from}
                for arm in self.arms
            ],
        }


def results_of(items: Sequence[ArmRun], finished: Finished[Decision]) -> Results:
    """Finished runs by arm."""
    runs: dict[Arm, list[Decision]] = {}
    for item in items:
        runs.setdefault(item.label[0], []).append(finished[item.key][0])
    scenes = tuple(dict.fromkeys(item.label[1] for item in items))
    return Results(scenes, {arm: tuple(decisions) for arm, decisions in runs.items()})


def runs_csv(results: Results, kind: type[Decision] = Decision) -> bytes:
    """One line per run.

    Args:
        results: the runs.
        kind: what is kept of each.
    """
    names = [entry.name for entry in dataclasses.fields(kind)]
    header = ("scene", "variant", "must", "name", "preset", "settings", "path_from", *names)
    path_from = {arm: arm.path_from for arm in results.runs}
    rows = (
        [
            *(scene.scene, scene.variant, scene.must, arm.name, arm.preset, arm.text, path_from[arm]),
            *dataclasses.astuple(run),
        ]
        for arm, runs in results.runs.items()
        for scene, run in zip(results.scenes, runs, strict=True)
    )
    return csv_bytes(header, rows)
