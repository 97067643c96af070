"""Defects of a map that only show once its geometry is evaluated."""

from collections.abc import Iterator, Sequence

import numpy as np

from opendrive.curves import CUBIC, CurveTable
from opendrive.errors import MapContentError, MapWarning
from opendrive.model import Road
from opendrive.road_geometry import NetworkGeometry

GAP_M = 0.05
"""Two pieces of a reference line that are further apart are reported."""

LENGTH_ERROR_M = 0.01
"""A curve that is shorter than the file says by more than this is reported."""


MAX_T_M = 1000.0
"""A lane that lies further from its reference line is refused."""

MAX_ROLL_RAD = 0.5 * np.pi
"""A road that is rolled further is refused."""

_SAMPLES = np.linspace(0.0, 1.0, 5)


def refuse_impossible_lanes(geometry: NetworkGeometry) -> None:
    """Check that lanes and superelevation stay within what a road can be, at five places along every lane.

    Raises:
        MapContentError: a lane is too far from its road, or the road stands on its edge.
    """
    lanes = geometry.lanes
    lane = np.repeat(np.arange(len(lanes)), len(_SAMPLES))
    low_m, high_m = lanes.s_start_m[lane], lanes.s_end_m[lane]
    s_m = low_m + np.tile(_SAMPLES, len(lanes)) * (high_m - low_m)
    t_m = lanes.offsets_and_slopes(lane, s_m)[1]
    roll_rad = geometry.superelevation.value(lanes.road[lane], s_m)
    for value, limit, what, records in (
        (t_m, MAX_T_M, "lies {:.3g} m from the reference line", "width, border and laneOffset"),
        (roll_rad, MAX_ROLL_RAD, "is rolled by {:.3g} rad", "superelevation"),
    ):
        wrong = np.flatnonzero(np.abs(value) > limit)
        if wrong.size:
            k = int(wrong[0])
            key = lanes.key[lane[k]]
            raise MapContentError(
                f"road {key.road_id!r}, lane {key.lane_id} of section {key.section}: {what.format(value[k])} "
                f"at s = {s_m[k]:.6g} m, expected within {limit:.4g}; check its {records}"
            )


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
