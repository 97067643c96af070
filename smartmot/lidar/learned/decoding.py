"""Boxes from what a network says of each cell: how likely a centre is there, and the box around it.

Yin, Zhou, Krähenbühl, "Center-based 3D object detection and tracking", CVPR 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.errors import ShapeError
from smartmot.lidar.learned.pillars import PillarGrid
from smartmot.overlap import bev_iou
from smartmot.pointcloud import Boxes3D

CHANNELS = (
    "offset_ahead", "offset_left", "height", "log_length", "log_width", "log_height",
    "sin_2_yaw", "cos_2_yaw", "sin_yaw", "cos_yaw",
)  # fmt: skip
"""Of each cell, after the classes' scores: the centre's offset from the middle of the cell in cells of the
output, its height over the ground in metres, logarithms of sizes in metres, and the heading, once without
and once with its direction: most bodies look alike from both ends, so that the axis is surer than the
direction."""

STRIDE = 2
"""Cells of the grid in a cell of the output."""

GREATEST_LOG = 3.5
"""Of a size in metres: 33 m. Beyond it a network has said nonsense."""


@dataclass(frozen=True, slots=True)
class Decoder:
    """How boxes are made of a network's output.

    Args:
        grid: of the pillars.
        classes: names out of `smartmot.types.CATEGORIES`, one for each map of scores.
        most_boxes: of a frame; the surest are kept.
        overlap: boxes that overlap a surer one of any class by more, seen from above, are left out.
    """

    grid: PillarGrid
    classes: tuple[str, ...]
    most_boxes: int = 100
    overlap: float = 0.1

    @property
    def shape(self) -> tuple[int, int, int]:
        """Channels, cells ahead and cells to the left of the output."""
        rows, columns = self.grid.shape
        return len(self.classes) + len(CHANNELS), rows // STRIDE, columns // STRIDE

    def decode(
        self, output: NDArray[np.float32], least_score: float | FloatArray
    ) -> tuple[Boxes3D, FloatArray, StrArray]:
        """Boxes, centres' heights over the ground, with scores and classes, the surest first.

        Args:
            output: (C, R, L) logits of the classes' scores, then `CHANNELS`.
            least_score: boxes of lower scores are left out; of all classes, or (C,) of each.

        Raises:
            ShapeError: the output has another shape.
        """
        if output.shape != self.shape:
            raise ShapeError(f"network: expected an output of shape {self.shape}, got {output.shape}")
        which, row, column, logit = _peaks(output[: len(self.classes)], least_score)
        score = 1.0 / (1.0 + np.exp(-logit))
        order = np.lexsort((column, row, which, -score))[: 2 * self.most_boxes]
        which, row, column, score = which[order], row[order], column[order], score[order]
        value = output[len(self.classes) :, row, column].astype(np.float64)
        usable = np.isfinite(value).all(axis=0) & (np.abs(value[3:6]) <= GREATEST_LOG).all(axis=0)
        which, row, column, score, value = (
            which[usable], row[usable], column[usable], score[usable], value[:, usable],
        )  # fmt: skip
        edge = STRIDE * self.grid.cell_m
        center = np.column_stack(
            (
                self.grid.ahead_m[0] + (row + 0.5 + value[0]) * edge,
                self.grid.left_m[0] + (column + 0.5 + value[1]) * edge,
                value[2],
            )
        )
        boxes = Boxes3D(center, np.exp(value[3:6].T), _heading(value[6:]))
        kept = _apart(boxes, self.overlap)[: self.most_boxes]
        category = np.array(self.classes, dtype=np.str_)[which[kept]]
        return boxes[kept], score[kept], category


def _peaks(
    maps: NDArray[np.float32], least_score: float | FloatArray
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Map, row, column and logit of each cell that is high enough and as high as the four beside it.

    Cells at its corners may be higher: two people of a group are often in such cells. Where both are of one
    body their boxes overlap.
    """
    score = np.broadcast_to(np.asarray(least_score, dtype=np.float64), len(maps))
    least = np.log(np.maximum(score, 1e-6) / np.maximum(1.0 - score, 1e-9))
    which, row, column = np.nonzero(maps >= least[:, None, None])
    logit = maps[which, row, column]
    is_peak = np.ones(len(logit), dtype=np.bool_)
    for i, j in ((0, -1), (-1, 0), (1, 0), (0, 1)):
        # beyond an edge is the cell itself
        next_row, next_column = (
            np.clip(at + by, 0, size - 1)
            for at, by, size in ((row, i, maps.shape[1]), (column, j, maps.shape[2]))
        )
        is_peak &= logit >= maps[which, next_row, next_column]
    value = np.clip(logit[is_peak].astype(np.float64), -500.0, 500.0)
    return which[is_peak], row[is_peak], column[is_peak], value


def _heading(value: FloatArray) -> FloatArray:
    """(N,) headings from (4, N) values: the axis, turned to where the direction points."""
    axis = 0.5 * np.arctan2(value[0], value[1])
    against = np.cos(axis) * value[3] + np.sin(axis) * value[2] < 0.0
    heading: FloatArray = np.where(against, axis + np.where(axis > 0.0, -np.pi, np.pi), axis)
    return heading


def _apart(boxes: Boxes3D, overlap: float) -> IntArray:
    """Rows that no surer row overlaps too much; boxes are in the order of their scores."""
    kept: BoolArray = np.ones(len(boxes), dtype=np.bool_)
    close = np.triu(bev_iou(boxes.on_ground, boxes.on_ground) > overlap, 1)
    for row in np.flatnonzero(close.any(axis=1)).tolist():
        if kept[row]:
            kept &= ~close[row]
    return np.flatnonzero(kept)
