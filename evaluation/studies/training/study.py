"""A training of a data set in a folder: frames in, a checkpoint, curves and a network's file out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from evaluation.errors import ArgumentError
from evaluation.metrics.detection.from_above import LEAST_OVERLAP, ScoredBoxes
from evaluation.results.tables import Table, fixed
from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.training import NETWORK
from evaluation.studies.training.export import greatest_difference, onnx_bytes
from evaluation.studies.training.fit import CHECKPOINT, Progress, Training, TrainingOptions
from evaluation.studies.training.graphs import write_network
from evaluation.studies.training.quality import calibrated, rescored
from evaluation.studies.training.samples import LabelledFrame, labelled_frame
from smartmot.lidar.learned import Decoder, PillarGrid
from smartmot.lidar.learned.network_file import LEAST_SCORE

CARD = "card.json"

CLASSES = ("car", "pedestrian", "cyclist")

TOLERANCE = 1e-4
"""Greatest difference between a network and its file."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The frames of a data set by what they are for.

    Args:
        train: learned from.
        held_out: frames of the validation split.
        notes: what the reader has to know.
    """

    train: list[LabelledFrame]
    held_out: list[LabelledFrame]
    notes: tuple[str, ...]


def read_labelled(folder: Path, decoder: Decoder, done: Callable[[int, int | None], None]) -> Frames:
    """Frames of the splits "train" and "val"; those of "test" are never looked at.

    Raises:
        DatasetError: the data set is in no known layout, or damaged.
        ArgumentError: a split has no frame.
    """
    reach = math.hypot(decoder.grid.ahead_m[1], max(map(abs, decoder.grid.left_m)))
    frames: dict[str, list[LabelledFrame]] = {"train": [], "val": []}
    others = 0
    dropped = 0
    for number, frame in enumerate(read_frames(folder), 1):
        if frame.split in frames:
            dropped += frame.dropped
            frames[frame.split].append(
                labelled_frame(frame.name, frame.cloud, frame.boxes, frame.labels.category, reach)
            )
        else:
            others += 1
        done(number, None)
    for split, members in frames.items():
        if not members:
            raise ArgumentError(f"{folder}: the split {split!r} has no frame")
    notes = [f"{len(frames['train'])} frames to learn from, {len(frames['val'])} held out"]
    if others:
        notes.append(f"{others} frames of other splits not looked at")
    if dropped:
        notes.append(f"{dropped} points with a value that is not finite dropped")
    unknown = sum(
        int((~np.isin(f.category, decoder.classes)).sum()) for part in frames.values() for f in part
    )
    if unknown:
        notes.append(f"{unknown} labels of other classes than {', '.join(decoder.classes)} are background")
    return Frames(frames["train"], frames["val"], tuple(notes))


def train(
    folder: Path,
    frames: Frames,
    options: TrainingOptions,
    report: Callable[[Progress, float], None],
    start: Mapping[str, torch.Tensor] | None = None,
) -> tuple[Training, dict[str, ScoredBoxes]]:
    """Train to the end, or go on where a training of the same frames and options stopped; write the network.

    Returns:
        The training, and by class the boxes of the held-out frames with calibrated scores.
    """
    decoder = Decoder(PillarGrid(), CLASSES)
    training = Training(folder, decoder, options, frames.train, frames.held_out, start)
    training.run(report)
    return training, write_card(folder, training, training.boxes(frames.held_out))


def write_card(folder: Path, training: Training, raw: dict[str, ScoredBoxes]) -> dict[str, ScoredBoxes]:
    """Write the network as ONNX, with what the held-out frames say of its scores, and what is known of it.

    Returns:
        By class, the boxes of the held-out frames with calibrated scores.
    """
    pairs = [calibrated(each.score, each.is_true) for each in raw.values()]
    scale, offset = [a for a, _ in pairs], [b for _, b in pairs]
    boxes = {name: rescored(each, *pair) for (name, each), pair in zip(raw.items(), pairs, strict=True)}
    least_score = [each.best()[1] if each.labels else LEAST_SCORE for each in boxes.values()]
    origin = {
        "training": training.key,
        "steps": training.progress.step,
        "frames": len(training.train),
        "seed": training.options.seed,
    }
    content = onnx_bytes(training.network, training.decoder, scale, offset, least_score, origin)
    difference = greatest_difference(training.network, content, training.held_out[:10], training.decoder)
    if not difference <= TOLERANCE:
        raise ArgumentError(
            f"{folder / NETWORK}: not written: it differs from the trained network by {difference:.2g}; "
            f"at most {TOLERANCE:g} is rounding"
        )
    digest = write_network(folder / NETWORK, content)
    card: dict[str, Any] = {
        "sha256": digest,
        "bytes": len(content),
        "classes": list(training.decoder.classes),
        **origin,
        "threads": torch.get_num_threads(),
        "score_scale": scale,
        "score_offset": offset,
        "greatest_difference": difference,
        "held_out": {name: _best(each) for name, each in boxes.items()},
    }
    (folder / CARD).write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
    return boxes


def _best(boxes: ScoredBoxes) -> dict[str, float]:
    """The greatest F1 over least scores, and at which score."""
    f1, least = boxes.best()
    return {"labels": boxes.labels, "f1": round(f1, 4), "least_score": least}


def quality_table(boxes: dict[str, ScoredBoxes]) -> Table:
    """F1 of each class at the least score that is best for it."""
    rows = []
    for name, each in boxes.items():
        best = _best(each)
        rows.append(
            (
                name,
                f"{LEAST_OVERLAP[name]:g}",
                str(each.labels),
                fixed(best["f1"], 3),
                fixed(best["least_score"], 2),
            )
        )
    caption = (
        "Held-out frames, to 40 m in the cells of the network, overlap from above; "
        "the least score is chosen on the same frames."
    )
    return Table(("class", "IoU", "labels", "F1", "least score"), tuple(rows), (), caption)


__all__ = ["CHECKPOINT", "Frames", "quality_table", "read_labelled", "train"]
