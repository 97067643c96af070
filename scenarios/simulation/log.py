"""Run log: everything that happened in a run, as one long table (see docs/run-log.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmot.pipeline import FrameResult
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, Forecast, IntArray, StrArray

TEXT_COLUMNS = ("kind", "category", "label")
COLUMNS = (
    "time_s", "kind", "id", "category", "label", "x_m", "y_m", "yaw_rad", "length_m", "width_m", "speed_mps",
    "accel_mps2", "horizon_s",
)  # fmt: skip
LOGGED = slice(5, None, 5)
"""Every fifth forecast box is logged: 0.5 s apart at the default step of 0.1 s."""


class RunLog:
    """Keeps what happens while a run goes on; `table()` turns it into rows, all frames of a kind at once.

    Args:
        category: (N,) of all actors.
        label: (N,) their parts in the test.
    """

    def __init__(self, category: StrArray, label: StrArray) -> None:
        self._category, self._label = category, label
        self._truth: list[tuple[int, EgoState, Boxes, FloatArray, IntArray]] = []
        self._frames: list[tuple[int, EgoState, FrameResult]] = []
        self._signals: list[tuple[int, float, str, str, tuple[float, float]]] = []

    def __deepcopy__(self, memo: dict[int, Any]) -> RunLog:
        """A log that goes on for itself; the entries so far never change and are shared."""
        copied = RunLog(self._category, self._label)
        copied._truth, copied._frames = list(self._truth), list(self._frames)
        copied._signals = list(self._signals)
        return copied

    def _number(self) -> int:
        """Position of the next entry; rows are in this order."""
        return len(self._truth) + len(self._frames) + len(self._signals)

    def frame(self, ego: EgoState, boxes: Boxes, speed_mps: FloatArray, index: IntArray) -> None:
        """Ground truth at one time: boxes and speeds of the actors with these numbers."""
        self._truth.append((self._number(), ego, boxes, speed_mps, index))

    def signal(self, time_s: float, signal: str, state: str, place_m: tuple[float, float]) -> None:
        """What a traffic signal shows from a time on, and where it stands (NaN: not known)."""
        self._signals.append((self._number(), time_s, signal, state, place_m))

    def perception(self, ego: EgoState, result: FrameResult) -> None:
        """What perception and decision made of one frame."""
        self._frames.append((self._number(), ego, result))

    def table(self) -> dict[str, NDArray[Any]]:
        """Columns of equal length: text columns as str ('' where empty), the others as float64 (NaN)."""
        blocks = [
            b
            for b in (*self._truth_blocks(), *self._signal_blocks(), *self._perception_blocks())
            if len(b["order"])
        ]
        ends = np.cumsum([len(b["order"]) for b in blocks])
        total = int(ends[-1]) if blocks else 0
        longest = max(
            (len(text) for *_, signal, state, _ in self._signals for text in (signal, state)), default=0
        )
        text_type = f"<U{max(longest, 24)}"
        table: dict[str, NDArray[Any]] = {
            name: np.full(total, "", dtype=text_type) if name in TEXT_COLUMNS else np.full(total, np.nan)
            for name in COLUMNS
        }
        order = np.zeros(total, dtype=np.int64)
        for end, block in zip(ends.tolist(), blocks, strict=True):
            rows = slice(end - len(block["order"]), end)
            order[rows] = block.pop("order")
            for name, value in block.items():
                table[name][rows] = value
        by_time = np.argsort(order, kind="stable")  # within one entry: in the order of the blocks
        return {name: column[by_time] for name, column in table.items()}

    @property
    def slowest_mps(self) -> float:
        """Least speed of the ego at the entries, forward or in reverse; infinite without any."""
        return min((abs(ego.speed_mps) for _, ego, *_ in self._truth), default=math.inf)

    def _truth_blocks(self) -> list[dict[str, Any]]:
        if not self._truth:
            return []
        order = np.array([number for number, *_ in self._truth])
        fields = ("stamp_s", "x_m", "y_m", "yaw_rad", "length_m", "width_m", "speed_mps", "accel_mps2")
        ego = np.array([[getattr(ego, name) for name in fields] for _, ego, *_ in self._truth]).T
        counts = [len(index) for *_, index in self._truth]
        actor = np.concatenate([index for *_, index in self._truth])
        actors = {
            "order": np.repeat(order, counts),
            "kind": "actor",
            "time_s": np.repeat(ego[0], counts),
            "id": actor,
            "category": self._category[actor],
            "label": self._label[actor],
            "speed_mps": np.concatenate([speed for *_, speed, _ in self._truth]),
            **_box_columns([boxes for _, _, boxes, *_ in self._truth]),
        }
        columns = dict(zip(("time_s", *fields[1:]), ego, strict=True))
        return [{"order": order, "kind": "ego", **columns}, actors]

    def _signal_blocks(self) -> list[dict[str, Any]]:
        if not self._signals:
            return []
        number, time, signal, state, place = zip(*self._signals, strict=True)
        x_m, y_m = np.array(place).T
        return [
            {
                "order": np.array(number),
                "kind": "signal",
                "time_s": np.array(time),
                "category": np.array(signal, dtype=np.str_),
                "label": np.array(state, dtype=np.str_),
                "x_m": x_m,
                "y_m": y_m,
            }
        ]

    def _perception_blocks(self) -> list[dict[str, Any]]:
        if not self._frames:
            return []
        order = np.array([number for number, *_ in self._frames])
        time = np.array([ego.stamp_s for _, ego, _ in self._frames])
        results = [result for *_, result in self._frames]

        def rows(kind: str, counts: list[int]) -> dict[str, Any]:
            return {"order": np.repeat(order, counts), "kind": kind, "time_s": np.repeat(time, counts)}

        kept = np.concatenate([r.kept for r in results])
        detections = rows("detection", [len(r.detections) for r in results]) | {
            "category": np.concatenate([r.detections.category for r in results]),
            "label": np.where(kept, "kept", "dropped"),
            **_box_columns([r.detections.boxes for r in results]),
        }
        velocity = np.concatenate([r.tracks.velocity_mps for r in results])
        dynamic = np.concatenate([r.tracks.dynamic for r in results])
        threat = np.concatenate([_threats(r) for r in results])
        track_id = np.concatenate([r.tracks.track_id for r in results])
        category = np.concatenate([r.tracks.category for r in results])
        counts = [len(r.tracks) for r in results]
        boxes = _box_columns([r.tracks.boxes for r in results])
        tracks = rows("track", counts) | {
            "id": track_id,
            "category": category,
            "label": np.where(threat, "threat", np.where(dynamic, "dynamic", "static")),
            "speed_mps": np.hypot(velocity[:, 0], velocity[:, 1]),
            **boxes,
        }
        # forecasts: only those of moving tracks; every frame has a horizon of its own
        horizons = [r.forecast.time_s[LOGGED] for r in results]
        lengths = np.array([len(h) for h in horizons])
        moving = np.flatnonzero(dynamic)
        steps = np.repeat(lengths, counts)[moving]
        per_frame = [int(r.tracks.dynamic.sum()) for r in results]
        walked = [r for r, n in zip(results, per_frame, strict=True) if n]
        forecasts = rows("forecast", [n * len(h) for n, h in zip(per_frame, horizons, strict=True)]) | {
            "id": np.repeat(track_id[moving], steps),
            "category": np.repeat(category[moving], steps),
            "horizon_s": np.concatenate([np.tile(h, n) for h, n in zip(horizons, per_frame, strict=True)]),
            "length_m": np.repeat(boxes["length_m"][moving], steps),
            "width_m": np.repeat(boxes["width_m"][moving], steps),
            **_path_columns([(r.forecast, r.tracks.dynamic) for r in walked]),
        }
        ego = np.array([(e.length_m, e.width_m) for _, e, _ in self._frames])
        own = rows("ego_forecast", lengths.tolist()) | {
            "horizon_s": np.concatenate(horizons),
            "length_m": np.repeat(ego[:, 0], lengths),
            "width_m": np.repeat(ego[:, 1], lengths),
            **_path_columns([(r.ego_forecast, np.ones(1, dtype=np.bool_)) for r in results]),
        }
        events = [(number, event) for number, _, result in self._frames for event in result.events]
        event_rows = {
            "order": np.array([number for number, _ in events], dtype=np.int64),
            "kind": "event",
            "time_s": np.array([event.stamp_s for _, event in events]),
            "category": np.array([event.layer for _, event in events], dtype=np.str_),
            "label": np.array([event.name for _, event in events], dtype=np.str_),
        }
        return [detections, tracks, forecasts, own, event_rows]


def _threats(result: FrameResult) -> BoolArray:
    """(M,) which tracks of a frame are threats; in most frames none."""
    if not len(result.threats):
        return np.zeros(len(result.tracks), dtype=np.bool_)
    return np.isin(result.tracks.track_id, result.threats.track_id)


def _box_columns(boxes: Sequence[Boxes]) -> dict[str, FloatArray]:
    """Columns of boxes, one value after the other."""
    center = np.concatenate([b.center_m for b in boxes])
    size = np.concatenate([b.size_m for b in boxes])
    return {
        "x_m": center[:, 0],
        "y_m": center[:, 1],
        "length_m": size[:, 0],
        "width_m": size[:, 1],
        "yaw_rad": np.concatenate([b.yaw_rad for b in boxes]),
    }


def _path_columns(forecasts: Sequence[tuple[Forecast, BoolArray]]) -> dict[str, FloatArray]:
    """Columns of the logged poses of chosen objects, object by object."""
    center = [f.center_m[chosen, LOGGED].reshape(-1, 2) for f, chosen in forecasts]
    yaw = [f.yaw_rad[chosen, LOGGED].reshape(-1) for f, chosen in forecasts]
    points = np.concatenate(center) if center else np.zeros((0, 2))
    return {
        "x_m": points[:, 0],
        "y_m": points[:, 1],
        "yaw_rad": np.concatenate(yaw) if yaw else np.zeros(0),
    }
