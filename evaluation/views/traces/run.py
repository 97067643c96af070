"""A logged run with what its log alone does not hold, and rows of the log by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evaluation.results.files import ResultsError
from evaluation.views.frames import SEEN, yaw_rate_radps
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.area import MonitoredAreaStrategy
from smartmot.types import EgoState, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

NANOSECONDS = 1_000_000_000
ROUNDING_NS = 1000
"""Logs have seconds from the first frame on. Differences of doubles of today's date, which are 240 ns apart,
are off by less than that; no recorder takes two frames within it."""
LAST_S = 2.0**32 - 1
"""Stamps of foxglove's messages count seconds since 1970 in 32 bits."""

HEIGHTS_M = {
    "car": 1.5,
    "pedestrian": 1.8,
    "cyclist": 1.8,
    "truck": 3.5,
    "motorcycle": 1.5,
    "unknown": 1.5,
}
"""Nominal heights by category: logs have none. Values: catalogs/ of `scenarios/definitions`, and the height
that readers of recordings give to boxes without one."""


@dataclass(frozen=True, slots=True, eq=False)
class LoggedRun:
    """A logged run.

    Args:
        name: of its log.
        log: as from `results.read_log`.
        network: the map; None: there is none, or it is not known.
        strategy: makes the monitored area; None where it is not known.
        start_s: stamp of the log's time 0, seconds since 1970; 0 of a simulated run.
        contact_time_s: when the ego touched another road user; None: never, or not known.
        height_m: heights of road users by their identity in the log, as far as known.
        frame_ns: (F,) ascending stamps of the recording's frames, ns since 1970, where it has whole ones.
    """

    name: str
    log: pd.DataFrame
    network: DriveMap | None = None
    strategy: MonitoredAreaStrategy | None = None
    start_s: float = 0.0
    contact_time_s: float | None = None
    height_m: Mapping[int, float] = field(default_factory=dict)
    frame_ns: IntArray | None = None

    @property
    def start_ns(self) -> int:
        """Stamp of the log's time 0, ns since 1970; 0 where the recording's stamps do not fit.

        Raises:
            ResultsError: times of the log lie before 1970 or after 2106, which stamps cannot hold.
        """
        if self._fits(self.start_s):
            return round(self.start_s * NANOSECONDS)
        if not self._fits(0.0):
            raise ResultsError(f"{self.name}: times must lie in 0 s to 2^32 s, counted from 1970")
        return 0

    def stamps_ns(self, time_s: FloatArray) -> list[int]:
        """(T,) times of the log as stamps, ns since 1970; those of frames are the recording's own.

        Raises:
            ResultsError: see `start_ns`.
        """
        start_ns = self.start_ns
        stamps = np.rint(time_s * NANOSECONDS).astype(np.int64) + start_ns
        frames = self.frame_ns
        if start_ns and frames is not None and len(frames):
            after = np.searchsorted(frames, stamps).clip(max=len(frames) - 1)
            before = (after - 1).clip(min=0)
            nearest = frames[np.where(stamps - frames[before] < frames[after] - stamps, before, after)]
            stamps = np.where(np.abs(nearest - stamps) <= ROUNDING_NS, nearest, stamps)
        return [int(stamp) for stamp in stamps.tolist()]

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of the stamps, a line each."""
        if self._fits(self.start_s):
            return ()
        return (f"{self.name}: stamps of the recording begin at {self.start_s:.6g} s; times count from 0",)

    def _fits(self, start_s: float) -> bool:
        first, last = (start_s + float(t) for t in (self.log["time_s"].min(), self.log["time_s"].max()))
        return first >= 0.0 and last <= LAST_S


@dataclass(frozen=True, slots=True, eq=False)
class TimedRows:
    """N rows of one kind, by T times.

    Args:
        time_s: (T,) ascending times.
        starts: (T + 1,) row at which each begins, and N.
        columns: (N,) each.
    """

    time_s: FloatArray
    starts: IntArray
    columns: Mapping[str, NDArray[Any]]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def __len__(self) -> int:
        return int(self.starts[-1])

    @property
    def slices(self) -> list[slice]:
        """The rows of each time."""
        bounds = self.starts.tolist()
        return list(map(slice, bounds[:-1], bounds[1:]))

    @property
    def text(self) -> list[str]:
        """(N,) category, `unknown` where there is none."""
        return [value if isinstance(value, str) and value else "unknown" for value in self["category"]]


def ego_times(log: pd.DataFrame) -> FloatArray:
    """(T,) times at which the log has an ego.

    Raises:
        ResultsError: it has none.
    """
    times = np.unique(log.loc[log["kind"] == "ego", "time_s"].to_numpy(np.float64))
    if not len(times):
        raise ResultsError("log without rows of kind 'ego': nothing to show; see docs/run-log.md")
    return times


def decision_times(log: pd.DataFrame) -> FloatArray:
    """(T,) times at which perception decided; none where nothing perceives."""
    return np.unique(log.loc[log["kind"].isin(SEEN), "time_s"].to_numpy(np.float64))


def rows_of(log: pd.DataFrame, kind: str, time_s: FloatArray, one_per: Sequence[str] = ()) -> TimedRows:
    """Rows of one kind at some times.

    Args:
        log: as from `results.read_log`.
        kind: of the rows.
        time_s: (T,) ascending; rows at other times are left out.
        one_per: columns that name an object: of several rows of it at one time, the last counts.
    """
    rows = log[log["kind"] == kind]
    if one_per:
        rows = rows.drop_duplicates(["time_s", *one_per], keep="last")
    at = np.searchsorted(time_s, stamps := rows["time_s"].to_numpy(np.float64))
    known = at < len(time_s)
    known[known] = time_s[at[known]] == stamps[known]
    order = np.flatnonzero(known)[np.argsort(at[known], kind="stable")]
    columns = {str(name): rows[name].to_numpy()[order] for name in rows.columns}
    return TimedRows(time_s, np.searchsorted(at[order], np.arange(len(time_s) + 1)), columns)


def ego_rows(log: pd.DataFrame) -> TimedRows:
    """The ego, one row per time; of several the last.

    Raises:
        ResultsError: the log has none.
    """
    return rows_of(log, "ego", ego_times(log), ("kind",))


def actor_rows(log: pd.DataFrame) -> TimedRows:
    """All others at the ego's times, each once."""
    return rows_of(log, "actor", ego_times(log), ("id",))


_STATE = ("x_m", "y_m", "yaw_rad", "speed_mps", "accel_mps2")


def ego_states(ego: TimedRows) -> list[EgoState]:
    """T states of the ego, as monitored areas ask for them; yaw rates come from the headings."""
    rate = yaw_rate_radps(ego.time_s, ego["yaw_rad"])
    columns = [ego.time_s, *(ego[name] for name in _STATE), rate, ego["length_m"], ego["width_m"]]
    return [EgoState(*values) for values in zip(*(column.tolist() for column in columns), strict=True)]
