"""What a detector makes of a cloud: boxes with scores, and the stages on the way there."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import FloatArray, IntArray, StrArray, frozen
from smartmot.errors import ShapeError
from smartmot.pointcloud import Boxes3D
from smartmot.types import CATEGORIES

OUT_OF_REACH, OFF_AREA, GROUND, LOOSE = -4, -3, -2, -1
"""What becomes of a point that is in no cluster: too far away or too high, off the monitored area, of the
ground, or with too few neighbours."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of a detector.

    Args:
        name: of the step.
        count: of what it hands on.
        unit: what that is.
        elapsed_s: processor time that it took.
    """

    name: str
    count: int
    unit: str
    elapsed_s: float


@dataclass(frozen=True, slots=True, eq=False)
class BoxDetections:
    """Boxes found in a cloud, in its frame.

    Args:
        boxes: N boxes.
        score: (N,) confidences in [0, 1].
        category: (N,) names out of `smartmot.types.CATEGORIES`.
        stages: steps in their order.
        point_cluster: (P,) number of each point's cluster; `OUT_OF_REACH`, `OFF_AREA`, `GROUND` or `LOOSE`
            where it is in none.
        box_cluster: (N,) number of the cluster of each box.

    Raises:
        ShapeError: shapes disagree, a score is not in [0, 1], or a category is unknown.
    """

    boxes: Boxes3D
    score: FloatArray
    category: StrArray
    stages: tuple[Stage, ...]
    point_cluster: IntArray
    box_cluster: IntArray

    def __post_init__(self) -> None:
        count = (len(self.boxes),)
        object.__setattr__(self, "score", frozen(self.score, np.float64, count, "score"))
        object.__setattr__(self, "box_cluster", frozen(self.box_cluster, np.int64, count, "box_cluster"))
        object.__setattr__(
            self, "point_cluster", frozen(self.point_cluster, np.int64, (None,), "point_cluster")
        )
        category = np.array(self.category, dtype=np.str_).reshape(-1)
        if category.shape != count or not set(category.tolist()) <= set(CATEGORIES):
            raise ShapeError(f"category: expected {count[0]} names out of {', '.join(CATEGORIES)}")
        category.flags.writeable = False
        object.__setattr__(self, "category", category)
        if not ((self.score >= 0.0) & (self.score <= 1.0)).all():
            raise ShapeError("score: must lie in [0, 1]")

    def __len__(self) -> int:
        return len(self.score)

    @property
    def distance_m(self) -> FloatArray:
        """(N,) horizontal distances from the sensor to the nearest points of the boxes; 0 inside of one."""
        return distance_to(self.boxes)


def distance_to(boxes: Boxes3D) -> FloatArray:
    """(N,) horizontal distances from the sensor to the nearest points of boxes; 0 inside of one."""
    center, size, yaw = boxes.center_m, boxes.size_m, boxes.yaw_rad
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = c * center[:, 0] + s * center[:, 1], c * center[:, 1] - s * center[:, 0]
    beyond = np.maximum(np.abs(np.column_stack((along, across))) - 0.5 * size[:, :2], 0.0)
    distance: FloatArray = np.hypot(beyond[:, 0], beyond[:, 1])
    return distance


class StageClock:
    """Notes each stage with the processor time since the one before."""

    def __init__(self) -> None:
        self._stages: list[Stage] = []
        self._start_s = time.thread_time()

    def note(self, name: str, count: int, unit: str) -> None:
        """End a stage."""
        now_s = time.thread_time()
        self._stages.append(Stage(name, count, unit, now_s - self._start_s))
        self._start_s = now_s

    @property
    def stages(self) -> tuple[Stage, ...]:
        """All that have ended."""
        return tuple(self._stages)
