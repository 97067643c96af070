"""Data sets of labelled clouds, made scene by scene."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from evaluation.errors import ArgumentError
from evaluation.results.files import write_bytes
from evaluation.runs.workers import execute_all
from evaluation.studies.datasets.frames import LabelledFrame, empty_scene, with_frames
from evaluation.studies.datasets.layouts import LAYOUTS
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.layouts.scenes import SPLITS, ScenePlace, scene_places
from scenarios.sensors.lidar import LidarConfig
from smartmot.pointcloud import PointCloud

DATASET_JSON = "dataset.json"
"""What a data set was made with, and what is in it."""


class FrameMaker(Protocol):
    """Where the frames of a data set come from; the same for the same values."""

    @property
    def config(self) -> LidarConfig:
        """The LiDAR on its mount."""

    @property
    def frames_per_scene(self) -> int:
        """The most frames of a scene."""

    def frames(self, place: ScenePlace, count: int) -> Iterator[LabelledFrame]:
        """The first frames of a scene."""

    def require(self, split: str) -> None:
        """See that there is something to make a split of; raises what `frames` would."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """What a data set is made with.

    Args:
        maker: where its frames come from.
        layout: one of `LAYOUTS`.
        frame_count: how many frames it has.
        seed: of the splits.
        least_points: labels with fewer points are left out.
        values: what else `dataset.json` says.
    """

    maker: FrameMaker
    layout: str
    frame_count: int
    seed: int
    least_points: int
    values: dict[str, object]


@dataclass(frozen=True, slots=True)
class Made:
    """What has been made.

    Args:
        frames: by split.
        labels: by category.
        hidden: labels left out for having too few points.
    """

    frames: dict[str, int]
    labels: dict[str, int]
    hidden: int


def make_dataset(
    recipe: Recipe, out: Path, workers: int = 1, done: Callable[[int, int | None], None] = lambda k, n: None
) -> Made:
    """Write a data set; the same bytes for any number of workers.

    Args:
        recipe: what it is made with.
        out: its folder.
        workers: processes.
        done: takes how many of how many scenes are there.

    Raises:
        ArgumentError: the folder has a data set already.
        ResultsError: a file cannot be written.
    """
    layout = LAYOUTS[recipe.layout]
    for there in (out / layout.folder, out / DATASET_JSON):
        if there.exists():
            raise ArgumentError(f"--out: {there} is there already; name another folder or remove it")
    per_scene = recipe.maker.frames_per_scene
    full_scenes, last_frames = divmod(recipe.frame_count, per_scene)
    places = scene_places(full_scenes * [per_scene] + ([last_frames] if last_frames else []), recipe.seed)
    counts = [min(per_scene, recipe.frame_count - place.first_frame) for place in places]
    # before anything is written
    for split in sorted({place.split for place in places}):
        recipe.maker.require(split)
    job = partial(_write_scene, recipe, out)
    sequences, hidden, labels = [], 0, Counter[str]()
    for sequence, left_out in execute_all(job, list(zip(places, counts, strict=True)), workers):
        sequences.append(sequence)
        hidden += left_out
        assert sequence.labels is not None
        labels.update(sequence.labels.category.tolist())
        done(len(sequences), len(places))
    for path, content in layout.files(sequences, recipe.seed):
        write_bytes(out / path, content)
    frames = dict.fromkeys(SPLITS, 0)
    for place, count in zip(places, counts, strict=True):
        frames[place.split] += count
    made = Made(frames, dict(sorted(labels.items())), hidden)
    _write_summary(recipe, made, out)
    return made


def _write_scene(recipe: Recipe, out: Path, place_count: tuple[ScenePlace, int]) -> tuple[Sequence, int]:
    """Write the clouds of a scene; gives its labels, and how many were left out."""
    (place, count), sweeps = place_count, LAYOUTS[recipe.layout].sweeps
    scene = empty_scene(f"scene_{place.number:04d}", count)

    def write(frame: int, cloud: PointCloud) -> None:
        write_bytes(out / sweeps.path(place, scene, frame), sweeps.content(cloud))

    frames = recipe.maker.frames(place, count)
    return with_frames(scene, frames, recipe.maker.config, recipe.least_points, write)


def _write_summary(recipe: Recipe, made: Made, out: Path) -> None:
    summary = {
        "layout": recipe.layout,
        **recipe.values,
        "seed": recipe.seed,
        "min_points": recipe.least_points,
        "sensor_height_m": recipe.maker.config.mount.height_m,
        "frames": made.frames,
        "labels": made.labels,
        "labels_left_out": made.hidden,
    }
    write_bytes(out / DATASET_JSON, (json.dumps(summary, indent=1) + "\n").encode())
