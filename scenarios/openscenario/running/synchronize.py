"""Speed profiles that bring an entity to a place at a time with a speed.

The approach has two parts: first the speed changes to the final one, then (the steady state) it is kept for
the rest of the way. In the first part the entity changes its speed with accelerations of one size: to an
extreme and back, or, where that would mean driving backwards, to a standstill, a wait, and on.
"""

from __future__ import annotations

import math

from scenarios.openscenario.motion.profiles import Piece

_SMALL = 1e-9


def approach(
    speed_mps: float, final_mps: float, distance_m: float, time_s: float
) -> tuple[Piece, ...] | None:
    """Pieces of the first part.

    Args:
        speed_mps: speed now, not negative.
        final_mps: speed at its end, not negative.
        distance_m: way until its end.
        time_s: time until its end.

    Returns:
        Pieces that cover the way in the time and end with the final speed; None if there is no way or no time
        left, or the place cannot be reached by a finite speed.
    """
    if distance_m <= _SMALL or time_s <= _SMALL:
        return None
    v0, v1, d, t = speed_mps, final_mps, distance_m, time_s
    if abs(0.5 * (v0 + v1) * t - d) <= _SMALL * max(1.0, d):
        return (Piece(t, v0, v1),)
    # Two pieces with accelerations of one size: speed v0 -> vx in x, vx -> v1 in t - x, where
    # (vx - v0) / x = (vx - v1) / (t - x) and the mean speeds cover the distance.
    root = math.sqrt(max(2.0 * (2.0 * d * d - 2.0 * (v0 + v1) * t * d + (v0 * v0 + v1 * v1) * t * t), 0.0))
    faster = 0.5 * (v0 + v1) * t < d
    extreme = (2.0 * d + root if faster else 2.0 * d - root) / (2.0 * t)
    if extreme >= 0.0:
        away, back = abs(extreme - v0), abs(extreme - v1)
        first = t * away / (away + back)
        return (Piece(first, v0, extreme), Piece(t - first, extreme, v1))
    # To a standstill, a wait, and on, again with accelerations of one size.
    size = (v0 * v0 + v1 * v1) / (2.0 * d)
    stop, start = v0 / size, v1 / size
    return (Piece(stop, v0, 0.0), Piece(t - stop - start, 0.0, 0.0), Piece(start, 0.0, v1))


def final_speed_without_wish(speed_mps: float, distance_m: float, time_s: float) -> float:
    """Speed at the place if no final speed is asked for: constant acceleration, never backwards."""
    return max(2.0 * distance_m / time_s - speed_mps, 0.0) if time_s > _SMALL else speed_mps
