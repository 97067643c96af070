"""Defects of a map that only show once its geometry is evaluated."""

from collections.abc import Iterator

import numpy as np

from opendrive.arrays import FloatArray, run_starts, until_next, wrapped
from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.geometry.curves import CUBIC
from opendrive.roads.geometry import NetworkGeometry

GAP_M = 0.05
"""Two pieces of a reference line that are further apart are reported."""

HEADING_GAP_RAD = 0.02
"""A greater kink in a reference line is reported."""

LENGTH_ERROR_M = 0.01
"""A curve whose length differs from what the file says by more than this is reported."""

NEGATIVE_WIDTH_M = 1e-3
"""Widths down to this much below 0 pass: cubics that end at 0 are rounded in files."""


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
                f"at s = {s_m[k]:.6g} m, expected within {limit:.4g}; check its {records}",
                "",
            )


def curve_warnings(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield what is wrong with reference lines and widths of lanes."""
    curves, roads = geometry.curves, geometry.roads
    every, end_m = np.arange(len(curves.road)), curves.start_m + curves.length_m
    starts, ends = curves.evaluate_pieces(every, curves.start_m), curves.evaluate_pieces(every, end_m)
    same_road = curves.road[1:] == curves.road[:-1]
    gap_m = np.hypot(ends.x_m[:-1] - curves.x_m[1:], ends.y_m[:-1] - curves.y_m[1:])
    # a cubic may start at an angle to its own frame
    turn_rad = wrapped(starts.heading_rad[1:] - ends.heading_rad[:-1])
    apart_m = curves.start_m[1:] - end_m[:-1]
    last = np.append(~same_road, True)
    excess_m = end_m - roads.length_m[curves.road]
    cubic = np.flatnonzero(curves.kind == CUBIC)
    short_m = np.zeros(len(curves.road))
    short_m[cubic] = curves.length_m[cubic] - curves.cubics.length_at[curves.cubic[cubic], -1]
    # A poly3 has no end of its own, which its length could miss.
    short_m[curves.is_poly3] = 0.0
    next_m = np.append(curves.start_m[1:], 0.0)

    def at(
        piece: int,
        message: str,
        kind: WarningKind,
        s_m: float,
        amount: float,
        unit: str = "m",
        rule: str = "",
    ) -> MapWarning:
        road_id = roads.id[int(curves.road[piece])]
        excess = abs(float(amount))
        return MapWarning(road_id, "planView/geometry", message, kind, float(s_m), None, excess, unit, rule)

    first = run_starts(curves.road)
    for piece in first[curves.start_m[first] > GAP_M].tolist():
        start_m = curves.start_m[piece]
        message = f"the reference line starts at s = {start_m:.6g} m; its first piece is continued before"
        yield at(piece, message, WarningKind.LATE_RECORD, start_m, start_m)
    for piece in np.flatnonzero(same_road & (gap_m > GAP_M)).tolist():
        message = f"gap of {gap_m[piece]:.3g} m before the piece at s = {next_m[piece]:.6g} m; left as it is"
        yield at(piece, message, WarningKind.GAP, next_m[piece], gap_m[piece])
    for piece in np.flatnonzero(same_road & (np.abs(turn_rad) > HEADING_GAP_RAD)).tolist():
        message = f"turn by {turn_rad[piece]:.3g} rad on the spot at s = {next_m[piece]:.6g} m; left as it is"
        yield at(piece, message, WarningKind.HEADING_GAP, next_m[piece], turn_rad[piece], "rad")
    for piece in np.flatnonzero(same_road & (np.abs(apart_m) > GAP_M)).tolist():
        message = (
            f"the piece at s = {curves.start_m[piece]:.6g} m ends {apart_m[piece]:+.3g} m before the next "
            "one starts; the s of the next holds"
        )
        yield at(piece, message, WarningKind.CURVE_LENGTH, curves.start_m[piece], apart_m[piece])
    for piece in np.flatnonzero(np.abs(short_m) > LENGTH_ERROR_M).tolist():
        message = (
            f"the curve at s = {curves.start_m[piece]:.6g} m is {abs(short_m[piece]):.3g} m "
            + ("shorter than its length says; held at its end" if short_m[piece] > 0.0 else
               "longer than its length says; cut off there")
        )  # fmt: skip
        rule = "length_match" if curves.is_normalized[piece] else "arclength_range"
        rule = f"asam.net:xodr:1.7.0:road.geometry.parampoly3.{rule}"
        s_m = curves.start_m[piece]
        yield at(piece, message, WarningKind.CURVE_LENGTH, s_m, short_m[piece], rule=rule)
    for piece in np.flatnonzero(last & (np.abs(excess_m) > GAP_M)).tolist():
        message = f"the line ends {excess_m[piece]:+.3g} m past the road's length; the road's length holds"
        yield at(piece, message, WarningKind.ROAD_LENGTH, curves.start_m[piece], excess_m[piece])
    yield from _width_warnings(geometry)


def _width_warnings(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield lanes whose width is negative somewhere."""
    lanes, table = geometry.lanes, geometry.lanes.profiles
    owner = np.repeat(np.arange(len(lanes)), np.diff(table.first))
    rows = np.flatnonzero(~lanes.is_border[owner])
    end_m = until_next(owner, table.start_m, lanes.s_end_m[owner])
    least_m = least_value(table.coefficients[rows], np.maximum(end_m - table.start_m, 0.0)[rows])
    for k in np.flatnonzero(least_m < -NEGATIVE_WIDTH_M).tolist():
        row = rows[k]
        lane = int(owner[row])
        key, s_m = lanes.key[lane], float(table.start_m[row])
        message = (
            f"lane {key.lane_id} of the section at s = {lanes.s_start_m[lane]:.6g} m is "
            f"{-least_m[k]:.3g} m below 0 wide; its borders cross"
        )
        excess_m = float(-least_m[k])
        yield MapWarning(
            key.road_id, "lane/width", message, WarningKind.NEGATIVE_WIDTH, s_m, key.lane_id, excess_m, "m"
        )


def least_value(coefficients: FloatArray, span: FloatArray) -> FloatArray:
    """Return the least value (N,) of cubics (N, 4) over 0 to `span` (N,)."""
    a, b, c, d = coefficients.T
    # The least value of a cubic is at an end or where its slope is 0: the two roots, in a form without
    # cancellation.
    root = np.sqrt(np.maximum(c**2 - 3.0 * b * d, 0.0))
    q = -(c + np.where(c < 0.0, -root, root))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        at = np.nan_to_num(np.stack([np.zeros_like(a), span, q / (3.0 * d), b / q]), posinf=0.0, neginf=0.0)
    at = np.clip(at, 0.0, span)
    least: FloatArray = (a + at * (b + at * (c + at * d))).min(axis=0)
    return least
