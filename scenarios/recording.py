"""Run log: everything that happened in a run, as one long table (see docs/run-log.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.actors import Actors
from smartmot.pipeline import FrameResult
from smartmot.types import Boxes, EgoState, FloatArray

TEXT_COLUMNS = ("kind", "category", "label")
COLUMNS = (
    "time_s", "kind", "id", "category", "label", "x_m", "y_m", "yaw_rad", "length_m", "width_m", "speed_mps",
    "accel_mps2", "horizon_s",
)  # fmt: skip
FORECAST_STRIDE = 5
"""Every fifth forecast box is logged: 0.5 s apart at the default step of 0.1 s."""


class RunLog:
    """Collects rows while a run goes on; `table()` gives them as columns."""

    def __init__(self, actors: Actors) -> None:
        self._actors = actors
        self._labels = np.array([a.label for a in actors.actors], dtype=np.str_)
        self._parts: list[tuple[int, dict[str, Any]]] = []

    def _add(self, count: int, **columns: Any) -> None:
        if count:
            self._parts.append((count, columns))

    def frame(self, ego: EgoState, boxes: Boxes, speed_mps: FloatArray) -> None:
        """Ground truth at one time."""
        self._add(
            1,
            kind="ego",
            time_s=ego.stamp_s,
            x_m=ego.x_m,
            y_m=ego.y_m,
            yaw_rad=ego.yaw_rad,
            length_m=ego.length_m,
            width_m=ego.width_m,
            speed_mps=ego.speed_mps,
            accel_mps2=ego.accel_mps2,
        )
        self._add(
            len(boxes),
            kind="actor",
            time_s=ego.stamp_s,
            id=np.arange(len(boxes)),
            category=self._actors.category,
            label=self._labels,
            speed_mps=speed_mps,
            **_box_columns(boxes.center_m, boxes.size_m, boxes.yaw_rad),
        )

    def perception(self, ego: EgoState, result: FrameResult) -> None:
        """What perception and decision made of one frame."""
        stamp = ego.stamp_s
        seen = result.detections
        self._add(
            len(seen),
            kind="detection",
            time_s=stamp,
            category=seen.category,
            label=np.where(result.kept, "kept", "dropped"),
            **_box_columns(seen.boxes.center_m, seen.boxes.size_m, seen.boxes.yaw_rad),
        )
        tracks, boxes = result.tracks, result.tracks.boxes
        threatening = (tracks.track_id[:, None] == result.threats.track_id).any(axis=1)
        self._add(
            len(tracks),
            kind="track",
            time_s=stamp,
            id=tracks.track_id,
            category=tracks.category,
            label=np.where(threatening, "threat", np.where(tracks.dynamic, "dynamic", "static")),
            speed_mps=np.hypot(tracks.velocity_mps[:, 0], tracks.velocity_mps[:, 1]),
            **_box_columns(boxes.center_m, boxes.size_m, boxes.yaw_rad),
        )
        moving = np.flatnonzero(tracks.dynamic)
        later = slice(FORECAST_STRIDE, None, FORECAST_STRIDE)
        horizon = result.forecast.time_s[later]
        for kind, forecast, rows in (
            ("forecast", result.forecast, moving),
            ("ego_forecast", result.ego_forecast, np.arange(1)),
        ):
            t = len(horizon)
            own: dict[str, Any] = {}
            if kind == "forecast":
                own = {
                    "id": np.repeat(tracks.track_id[rows], t),
                    "category": np.repeat(tracks.category[rows], t),
                }
            self._add(
                len(rows) * t,
                kind=kind,
                time_s=stamp,
                horizon_s=np.tile(horizon, len(rows)),
                **own,
                **_box_columns(
                    forecast.center_m[rows][:, later].reshape(-1, 2),
                    np.repeat(forecast.size_m[rows], t, axis=0),
                    forecast.yaw_rad[rows][:, later].reshape(-1),
                ),
            )
        for event in result.events:
            self._add(1, kind="event", time_s=event.stamp_s, category=event.layer, label=event.name)

    def table(self) -> dict[str, NDArray[Any]]:
        """Columns of equal length: text columns as str ('' where empty), the others as float64 (NaN)."""
        counts = [count for count, _ in self._parts]
        ends = np.cumsum(counts)
        total = int(ends[-1]) if counts else 0
        table: dict[str, NDArray[Any]] = {
            name: np.full(total, "", dtype="<U24") if name in TEXT_COLUMNS else np.full(total, np.nan)
            for name in COLUMNS
        }
        for end, (count, columns) in zip(ends, self._parts, strict=True):
            for name, value in columns.items():
                table[name][end - count : end] = value
        return table


def _box_columns(center: FloatArray, size: FloatArray, yaw: FloatArray) -> dict[str, FloatArray]:
    return {
        "x_m": center[:, 0],
        "y_m": center[:, 1],
        "length_m": size[:, 0],
        "width_m": size[:, 1],
        "yaw_rad": yaw,
    }
