"""A log by frames: the ego, what is around it, and the area that was monitored then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import _smartmot
from evaluation.results.files import ResultsError
from evaluation.views.plots.ground import Area
from evaluation.views.plots.log_rows import boxes_of, of_kind, placed_signals
from smartmot.area import MonitoredAreaStrategy
from smartmot.geometry import wrap_angle
from smartmot.types import Boxes, EgoState, FloatArray

if TYPE_CHECKING:
    import pandas as pd

TRUTH = ("actor",)
SEEN = ("detection", "track", "forecast", "ego_forecast")
"""Kinds of rows that perception writes."""


_ODOMETRY = [
    "time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "accel_mps2", "yaw_rate_radps", "length_m", "width_m",
]  # fmt: skip
"""Columns with the fields of `EgoState`, in their order."""


@dataclass(frozen=True, slots=True, eq=False)
class LogFrames:
    """A run as F frames: one per decision, and the end of the run.

    Args:
        ego: F rows of kind `ego`.
        odometry: (F, 9) fields of `EgoState`; the yaw rate, which logs do not hold, comes from the headings.
        objects: rows of every other kind but events, in the order of the frames, with the frame's number
            as `frame`.
        starts: (F + 1,) per kind, where each frame begins in these rows.
        events: rows of kind `event`.
        signals: rows of kind `signal` by time, with the frame from which on they hold as `frame`.
        strategy: what makes the monitored area; None where it is not known.
    """

    ego: pd.DataFrame
    odometry: FloatArray
    objects: Mapping[str, pd.DataFrame]
    starts: Mapping[str, np.ndarray[tuple[int], np.dtype[np.int64]]]
    events: pd.DataFrame
    signals: pd.DataFrame
    strategy: MonitoredAreaStrategy | None

    def __len__(self) -> int:
        return len(self.ego)

    @property
    def time_s(self) -> FloatArray:
        """(F,) times."""
        return self.ego["time_s"].to_numpy(np.float64)

    def frame_at(self, time_s: float) -> int:
        """The last frame that is not after a time."""
        return max(int(np.searchsorted(self.time_s, time_s + 1e-6, side="right")) - 1, 0)

    def rows(self, kind: str, frame: int) -> pd.DataFrame:
        """Rows of one kind in one frame."""
        first, last = self.starts[kind][frame : frame + 2]
        return self.objects[kind].iloc[int(first) : int(last)]

    def signals_at(self, frame: int) -> pd.DataFrame:
        """The last row of every traffic signal that holds in a frame."""
        return self.signals[self.signals["frame"] <= frame].drop_duplicates("category", keep="last")

    def ego_state(self, frame: int) -> EgoState:
        """Odometry in one frame, as the area asks for it."""
        return EgoState(*self.odometry[frame].tolist())

    def areas(self, frame: int) -> list[Area]:
        """Outlines of the monitored area in one frame: role and (P, 2) ring, map frame."""
        return [] if self.strategy is None else self.strategy.at(self.ego_state(frame)).polygons()


def boxes_in(rows: pd.DataFrame) -> Boxes:
    """Boxes of rows, map frame."""
    return Boxes(*boxes_of(rows))


def frames_of(log: pd.DataFrame, strategy: MonitoredAreaStrategy | None = None) -> LogFrames:
    """Arrange a log by frames.

    Frames without a decision are left out, but for the last. There, what was perceived before still stands.

    Args:
        log: as from `results.read_log`.
        strategy: makes the monitored area; None where it is not known.

    Raises:
        ResultsError: the log holds no ego.
    """
    ego = of_kind(log, "ego").sort_values("time_s").drop_duplicates("time_s", keep="last")
    if ego.empty:
        raise ResultsError("log without rows of kind 'ego': nothing to show; see docs/run-log.md")
    rate_radps = yaw_rate_radps(ego["time_s"].to_numpy(np.float64), ego["yaw_rad"].to_numpy(np.float64))
    ego = ego.assign(yaw_rate_radps=rate_radps)
    # a copy: pandas 3 hands out read-only views
    decided = ego["time_s"].isin(log.loc[log["kind"].isin(SEEN), "time_s"]).to_numpy(dtype=bool, copy=True)
    if not decided.any():
        decided[:] = True
    decided[-1] = True
    ego = ego[decided].reset_index(drop=True)
    time = ego["time_s"].to_numpy(np.float64)
    objects, starts = {}, {}
    for kind in (*TRUTH, *SEEN):
        rows = of_kind(log, kind)
        rows = rows[rows["time_s"].isin(time)]
        rows = rows.assign(frame=np.searchsorted(time, rows["time_s"].to_numpy(np.float64)))
        objects[kind] = rows.sort_values("frame", kind="stable", ignore_index=True)
    if len(time) > 1 and not any((objects[kind]["frame"] == len(time) - 1).any() for kind in SEEN):
        for kind in SEEN:
            objects[kind] = _held(objects[kind], len(time) - 1)
    for kind, rows in objects.items():
        starts[kind] = np.searchsorted(rows["frame"].to_numpy(), np.arange(len(time) + 1))
    return LogFrames(
        ego,
        ego[_ODOMETRY].to_numpy(np.float64),
        objects,
        starts,
        of_kind(log, "event").reset_index(drop=True),
        _signals_of(log, time),
        strategy,
    )


def _signals_of(log: pd.DataFrame, time_s: FloatArray) -> pd.DataFrame:
    """Rows of traffic signals that have a place, by time, with the frame from which on each holds."""
    rows = placed_signals(log)
    frame = np.searchsorted(time_s, rows["time_s"].to_numpy(np.float64) - 1e-6)
    return rows.assign(frame=frame)[frame < len(time_s)].reset_index(drop=True)


def _held(rows: pd.DataFrame, frame: int) -> pd.DataFrame:
    """Rows with those of the frame before repeated in this one."""
    import pandas as pd

    before = rows[rows["frame"] == frame - 1]
    return pd.concat([rows, before.assign(frame=frame)], ignore_index=True) if len(before) else rows


def yaw_rate_radps(time_s: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """(N,) yaw rates since the value before: logs hold none, and the rectangle depends on them."""
    turn = wrap_angle(np.diff(yaw_rad))
    rate: FloatArray = np.concatenate(([0.0], turn / np.diff(time_s)))
    return rate


__getattr__ = _smartmot.renamed(
    __name__,
    {"Scene": "evaluation.views.frames.LogFrames", "read_scene": "evaluation.views.frames.frames_of"},
)
