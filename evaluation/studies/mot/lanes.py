"""Forecasts along the lanes of a map."""

from __future__ import annotations

import numpy as np

from evaluation.studies.mot.forecasts import Carry, Hypotheses, motion_of
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.errors import DatasetError
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.forecast.lanes import MOST_WAYS, LaneForecaster, Ways
from smartmot.forecast.motion import Motion, codes
from smartmot.types import FloatArray, IntArray

HORIZON_S = 3.0
"""Ways are told apart up to the longest horizon that is scored."""


class LaneForecast:
    """Moves what drives in a lane along it (`smartmot.forecast.lanes`), the rest as without the map.

    Args:
        network: The map, in the frame of the data.
    """

    def __init__(self, network: DriveMap) -> None:
        self._forecaster = LaneForecaster(network)

    def along_lanes(self, free: Carry) -> Hypotheses:
        """The hypotheses along lanes beside the forecast `free`, the most likely first."""
        known: dict[int, tuple[TrackedSequence, Ways, Motion, IntArray]] = {}

        def hypotheses(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
            if id(tracked) not in known:  # the entry keeps the sequence, so its id stays its own
                known[id(tracked)] = (tracked, *self._ways(tracked))
            _, ways, motion, first = known[id(tracked)]
            # an object with fewer hypotheses has its most likely one several times
            count = np.diff(np.append(first, len(ways.row)))[rows]
            number = np.arange(MOST_WAYS)
            chosen = first[rows, None] + np.where(number < count[:, None], number, 0)
            used, place = np.unique(chosen * len(rows) + np.arange(len(rows))[:, None], return_inverse=True)
            way, row = used // max(len(rows), 1), used % max(len(rows), 1)
            part = Ways(
                ways.row[way],
                ways.probability[way],
                tuple(ways.routes[k] for k in way.tolist()),
                ways.station_m[way],
                ways.offset_m[way],
                ways.drift_mps[way],
            )
            moved = free(tracked, rows, time_s)[row]
            center, _ = self._forecaster.along(part, motion, moved[:, None], time_s[row, None])
            places = np.asarray(center[:, 0])
            of_rows: FloatArray = places[place.reshape(len(rows), MOST_WAYS)]
            return of_rows

        return hypotheses

    def first(self, free: Carry) -> Carry:
        """The most likely hypothesis alone."""
        hypotheses = self.along_lanes(free)
        return lambda tracked, rows, time_s: hypotheses(tracked, rows, time_s)[:, 0]

    def _ways(self, tracked: TrackedSequence) -> tuple[Ways, Motion, IntArray]:
        """Ways of all track rows, their motion, and (K,) the place of each row's first way."""
        rows = np.arange(len(tracked.tracks))
        motion = motion_of(tracked, rows)
        code = codes(tracked.tracks.category)
        ways = self._forecaster.ways(tracked.tracks.center_m, motion, code, HORIZON_S)
        return ways, motion, np.searchsorted(ways.row, rows)


def require_cover(network: DriveMap, points_m: FloatArray, what: str) -> None:
    """See that a map and data lie in the same place.

    Args:
        network: The map.
        points_m: (K, 2) positions in the data.
        what: What the positions are, for the message.

    Raises:
        DatasetError: No position lies within the map's bounds.
    """
    low_x, low_y, high_x, high_y = network.bounds
    inside = (points_m >= (low_x, low_y)) & (points_m <= (high_x, high_y))
    if len(points_m) and not inside.all(axis=1).any():
        (x0, y0), (x1, y1) = points_m.min(axis=0), points_m.max(axis=0)
        raise DatasetError(
            f"--map: does not cover the data: map x {low_x:.0f}..{high_x:.0f} m, "
            f"y {low_y:.0f}..{high_y:.0f} m; {what} x {x0:.0f}..{x1:.0f} m, y {y0:.0f}..{y1:.0f} m"
        )
