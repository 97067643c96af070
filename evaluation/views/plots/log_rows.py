"""What the pictures read from a run log."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

from evaluation.results.files import ResultsError
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

TIME_TOLERANCE_S = 1e-6

Event = tuple[float, str, str]
"""Time, layer and name."""


def of_kind(log: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Rows of one kind."""
    return log[log["kind"] == kind]


def events_of(rows: pd.DataFrame, layers: Container[str] | None = None) -> list[Event]:
    """Rows of kind `event` as time, layer and name.

    Args:
        rows: of that kind.
        layers: only events of these; None: of all.
    """
    events = zip(rows["time_s"], rows["category"], rows["label"], strict=True)
    return [
        (float(time), str(layer), str(name))
        for time, layer, name in events
        if layers is None or layer in layers
    ]


def placed_signals(log: pd.DataFrame) -> pd.DataFrame:
    """Rows of traffic signals that have a place, by time."""
    return of_kind(log, "signal").dropna(subset=["x_m", "y_m"]).sort_values("time_s", kind="stable")


def signals_at(rows: pd.DataFrame, time_s: float) -> pd.DataFrame:
    """Of rows of traffic signals by time, for each signal the last one up to a time."""
    return rows[rows["time_s"] <= time_s + TIME_TOLERANCE_S].drop_duplicates("category", keep="last")


def boxes_of(rows: pd.DataFrame, suffix: str = "") -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres (N, 2), lengths and widths (N, 2) and headings (N,) in rows, map frame, metres and radians.

    Args:
        rows: rows of a log.
        suffix: ending of the names of the columns.
    """
    x, y, length, width, yaw = (
        f"{name}{suffix}" for name in ("x_m", "y_m", "length_m", "width_m", "yaw_rad")
    )
    return rows[[x, y]].to_numpy(float), rows[[length, width]].to_numpy(float), rows[yaw].to_numpy(float)


def frame_at(log: pd.DataFrame, time_s: float) -> pd.DataFrame:
    """Rows of the frame nearest to a time, among those with an ego and, if there are any, with perception.

    Raises:
        ResultsError: the log holds no ego.
    """
    with_ego = set(of_kind(log, "ego")["time_s"])
    if not with_ego:
        raise ResultsError("log without rows of kind 'ego': nothing to show; see docs/run-log.md")
    seen = log.loc[log["kind"].isin(["detection", "track", "ego_forecast"]), "time_s"]
    times = sorted(with_ego & set(seen)) or sorted(with_ego)
    nearest = min(times, key=lambda time: abs(time - time_s))
    rows: pd.DataFrame = log[(log["time_s"] - nearest).abs() <= TIME_TOLERANCE_S]
    return rows
