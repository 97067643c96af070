"""What all layouts ask of recordings, and scenes dealt out to train, val and test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from scipy.spatial.transform import Rotation

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects, Sequence
from smartmot.types import FloatArray

SPLITS = ("train", "val", "test")
HELD_BACK_SHARE = 0.25
"""Of the scenes in val, and in test: SimBEV's own configuration has twice as many in train as in either."""


def split_of_scenes(count: int, seed: int) -> list[str]:
    """The split of each scene, drawn at random: a quarter each in val and test, at least one in train."""
    held_back = round(HELD_BACK_SHARE * count)
    names = held_back * ["val", "test"] + (count - 2 * held_back) * ["train"]
    return [names[k] for k in np.random.default_rng(seed).permutation(count).tolist()]


@dataclass(frozen=True, slots=True)
class ScenePlace:
    """Where a scene is in a data set.

    Args:
        number: of the scene.
        first_frame: how many frames are before it.
        split: out of `SPLITS`.
        number_in_split: of the scene among those of its split.
    """

    number: int
    first_frame: int
    split: str
    number_in_split: int = 0


def scene_places(frame_counts: Iterable[int], seed: int) -> list[ScenePlace]:
    """The place of each scene of a data set, from how many frames each has."""
    counts = list(frame_counts)
    splits = split_of_scenes(len(counts), seed)
    first = accumulate(counts, initial=0)
    places, so_far = [], Counter[str]()
    for number, (frame, split) in enumerate(zip(first, splits, strict=False)):
        places.append(ScenePlace(number, frame, split, so_far[split]))
        so_far[split] += 1
    return places


def truth_of(sequence: Sequence) -> tuple[Objects, FloatArray]:
    """Labels, and (F, 4, 4) poses of the vehicle.

    Raises:
        DatasetError: The recording lacks one of them.
    """
    if sequence.labels is None:
        raise DatasetError(f"sequence {sequence.name} has no labels, which the layout consists of")
    if sequence.world_SE3_ego is None:
        raise DatasetError(f"sequence {sequence.name} has no ego poses, which the layout needs")
    return sequence.labels, sequence.world_SE3_ego


def quaternion_of(pose: FloatArray) -> FloatArray:
    """(F, 4) quaternions w, x, y, z of (F, 4, 4) poses."""
    if not len(pose):
        return np.zeros((0, 4))
    return np.roll(Rotation.from_matrix(pose[:, :3, :3]).as_quat(), 1, axis=1)
