"""Defects of a map that only its geometry shows."""

from collections.abc import Iterator, Sequence

import numpy as np

from opendrive.curves import CUBIC, CurveTable
from opendrive.errors import MapWarning
from opendrive.model import Road

GAP_M = 0.05
"""Two pieces of a reference line that are further apart are reported."""

LENGTH_ERROR_M = 0.01
"""A curve that is shorter than the file says by more than this is reported."""


def curve_warnings(curves: CurveTable, roads: Sequence[Road]) -> Iterator[MapWarning]:
    """Yield gaps in reference lines, and cubic curves that end before their stated length."""
    ends = curves.evaluate_pieces(np.arange(len(curves.road)), curves.start_m + curves.length_m)
    same_road = curves.road[1:] == curves.road[:-1]
    gap_m = np.hypot(ends.x_m[:-1] - curves.x_m[1:], ends.y_m[:-1] - curves.y_m[1:])
    for k in np.flatnonzero(same_road & (gap_m > GAP_M)).tolist():
        message = (
            f"gap of {gap_m[k]:.3g} m before the piece at s = {curves.start_m[k + 1]:.6g} m; left as it is"
        )
        yield MapWarning(roads[int(curves.road[k])].id, "planView/geometry", message)
    cubic = np.flatnonzero(curves.kind == CUBIC)
    short_m = curves.length_m[cubic] - curves.cubics.length_at[curves.cubic[cubic], -1]
    for k, missing_m in zip(cubic.tolist(), short_m.tolist(), strict=True):
        if missing_m > LENGTH_ERROR_M:
            message = (
                f"the curve at s = {curves.start_m[k]:.6g} m is {missing_m:.3g} m shorter than its "
                "length says; held at its end"
            )
            yield MapWarning(roads[int(curves.road[k])].id, "planView/geometry", message)
