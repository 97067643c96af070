"""Labels and detections brought to the same names of frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evaluation.errors import ArgumentError
from scenarios.recorded.kitti_objects.labels import ObjectLines
from smartmot.types import StrArray


def in_same_frames(
    labels: ObjectLines, detections: ObjectLines
) -> tuple[ObjectLines, ObjectLines, list[str]]:
    """Detections in the frames of the labels.

    Frames of one sequence are matched whatever the files are named. A sequence's frames without labels count:
    what is detected there is false. Single frames without a label file do not, and the notes say how many.

    Raises:
        ArgumentError: no detection is in any frame or sequence of the labels, although there are some.
    """
    label_sequences, own_sequences = (_sequences(lines.frames) for lines in (labels, detections))
    if len(label_sequences) == len(own_sequences) == 1 and None not in label_sequences | own_sequences:
        labels, detections = _without_sequence(labels), _without_sequence(detections)
        label_sequences = {""}
    frames = set(labels.frames)
    known = {
        frame
        for frame in detections.frames
        if frame in frames or (_sequence(frame) is not None and _sequence(frame) in label_sequences)
    }
    chosen = np.isin(detections.frame, sorted(known))
    if len(detections) and not chosen.any():
        raise ArgumentError(
            f"labels and detections have no frame in common: {labels.frames[0] if frames else 'none'} "
            f"and {detections.frames[0]}"
        )
    notes = []
    if not chosen.all():
        outside = len(set(detections.frames) - known)
        notes.append(f"{np.count_nonzero(~chosen)} detections in {outside} frames without labels left out")
    absent = len(frames - set(detections.frames))
    if absent:
        notes.append(f"{absent} of {len(frames)} frames with labels have no detections")
    return labels, detections.chosen(chosen), notes


def _sequence(frame: str) -> str | None:
    """Sequence of a frame; "": one without a name; None: the frame stands alone."""
    name, slash, _ = frame.rpartition("/")
    return name if slash else None


def _sequences(frames: tuple[str, ...]) -> set[str | None]:
    return {_sequence(frame) for frame in frames}


def _without_sequence(lines: ObjectLines) -> ObjectLines:
    """Lines whose frames have lost the names of their sequence."""
    frames = _bare(np.array(lines.frames, dtype=np.str_)).tolist()
    return replace(lines, frame=_bare(lines.frame), frames=tuple(frames))


def _bare(frames: StrArray) -> StrArray:
    return np.array([f"/{frame.rpartition('/')[2]}" for frame in frames.tolist()], dtype=np.str_)
