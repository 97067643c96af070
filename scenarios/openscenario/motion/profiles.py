"""Speed over time as a chain of pieces, integrated in closed form."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from scenarios.openscenario.elements import Immutable
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import Performance, SpeedShape

NEVER_S = math.inf

PieceShape: TypeAlias = Literal["step", "linear", "cubic", "sinusoidal", "rising", "falling"]
"""The shapes of files; or the rate of change rises from zero, or falls to zero, by a constant jerk."""

SLOPES = {"linear": 1.0, "cubic": 1.5, "sinusoidal": math.pi / 2, "rising": 2.0, "falling": 2.0}
"""The greatest slope of a shape, in units of change / duration."""

SHARES = dict.fromkeys(("step", "linear", "cubic", "sinusoidal"), 0.5) | {
    "rising": 1.0 / 3.0,
    "falling": 2.0 / 3.0,
}
"""How much of a change counts on average over its duration."""


@dataclass(frozen=True, slots=True)
class Piece(Immutable):
    """Change from one speed to another; shapes of files cover the mean of both speeds times the duration."""

    duration_s: float
    start_mps: float
    end_mps: float
    shape: PieceShape = "linear"

    @property
    def length_m(self) -> float:
        """Distance covered."""
        return (self.start_mps + SHARES[self.shape] * (self.end_mps - self.start_mps)) * self.duration_s

    def after(self, time_s: float) -> tuple[float, float]:
        """Distance and speed after a time within the piece."""
        span, change = self.duration_s, self.end_mps - self.start_mps
        part = time_s / span
        if self.shape == "cubic":
            return (
                self.start_mps * time_s + change * span * part**3 * (1.0 - 0.5 * part),
                self.start_mps + change * part**2 * (3.0 - 2.0 * part),
            )
        if self.shape == "sinusoidal":
            turn = math.pi * part
            return (
                self.start_mps * time_s + 0.5 * change * (time_s - span / math.pi * math.sin(turn)),
                self.start_mps + 0.5 * change * (1.0 - math.cos(turn)),
            )
        if self.shape == "rising":
            return (
                self.start_mps * time_s + change * part**2 * time_s / 3.0,
                self.start_mps + change * part**2,
            )
        if self.shape == "falling":
            gone = change * part * (1.0 - part / 3.0) * time_s
            return self.start_mps * time_s + gone, self.start_mps + change * part * (2.0 - part)
        return self.start_mps * time_s + 0.5 * change * part * time_s, self.start_mps + change * part


class SpeedProfile(Immutable):
    """Speed from a time on: pieces one after the other, then the last speed for ever.

    Args:
        start_s: time of the run at which it begins.
        speed_mps: speed from then on if there are no pieces.
        pieces: changes of speed.
    """

    __slots__ = (
        "_pieces",
        "_starts",
        "end_s",
        "fastest_mps",
        "final_mps",
        "goes_back",
        "length_m",
        "start_s",
    )

    def __init__(self, start_s: float, speed_mps: float, pieces: Iterable[Piece] = ()) -> None:
        self.start_s = start_s
        self._pieces = tuple(piece for piece in pieces if piece.duration_s > 0.0)
        self._starts: list[tuple[float, float]] = []
        time_s, distance_m = start_s, 0.0
        for piece in self._pieces:
            self._starts.append((time_s, distance_m))
            time_s += piece.duration_s
            distance_m += piece.length_m
        self.end_s = time_s
        self.length_m = distance_m
        self.final_mps = self._pieces[-1].end_mps if self._pieces else speed_mps
        speeds = [speed for piece in self._pieces for speed in (piece.start_mps, piece.end_mps)]
        self.fastest_mps = max(map(abs, speeds), default=abs(self.final_mps))
        """Greatest speed, as an amount."""
        self.goes_back = self.final_mps < 0.0 or min(speeds, default=0.0) < 0.0
        """Whether a speed of it is negative."""

    def at(self, time_s: float) -> tuple[float, float]:
        """Distance since the beginning, and speed."""
        if time_s >= self.end_s:
            return self.length_m + self.final_mps * (time_s - self.end_s), self.final_mps
        k = bisect_right(self._starts, (time_s, math.inf)) - 1
        if k < 0:
            return 0.0, self._pieces[0].start_mps
        start, before = self._starts[k]
        distance, speed = self._pieces[k].after(time_s - start)
        return before + distance, speed

    def scaled(self, factor: float, plus_mps: float) -> SpeedProfile:
        """The same changes of a speed that is a multiple of this one, plus a constant."""
        pieces = [
            Piece(p.duration_s, factor * p.start_mps + plus_mps, factor * p.end_mps + plus_mps, p.shape)
            for p in self._pieces
        ]
        return SpeedProfile(self.start_s, factor * self.final_mps + plus_mps, pieces)

    def next_kink_s(self, after_s: float) -> float:
        """The next time at which speed or acceleration stop to grow or to fall; infinite if there is none."""
        if after_s >= self.end_s:
            return NEVER_S
        k = bisect_right(self._starts, (after_s, math.inf))
        if k > 0:
            piece, middle = self._pieces[k - 1], self._starts[k - 1][0] + 0.5 * self._pieces[k - 1].duration_s
            if middle > after_s and piece.shape in ("cubic", "sinusoidal"):
                return middle
        return self._starts[k][0] if k < len(self._starts) else self.end_s

    def demands(self) -> tuple[float, float, float]:
        """Greatest speed, acceleration and deceleration, as amounts; changes at once do not count."""
        up = down = 0.0
        for piece in self._pieces:
            rate = SLOPES[piece.shape] * abs(piece.end_mps - piece.start_mps) / piece.duration_s
            if abs(piece.end_mps) > abs(piece.start_mps) or piece.start_mps * piece.end_mps < 0.0:
                up = max(up, rate)
            if abs(piece.end_mps) < abs(piece.start_mps) or piece.start_mps * piece.end_mps < 0.0:
                down = max(down, rate)
        return self.fastest_mps, up, down

    def limited(self, limits: Performance) -> SpeedProfile:
        """The same speeds as far as limits allow, reached later where they ask for a slower change."""

        def within(speed_mps: float) -> float:
            return min(max(speed_mps, -limits.max_speed_mps), limits.max_speed_mps)

        pieces: list[Piece] = []
        for piece in self._pieces:
            start, end = within(piece.start_mps), within(piece.end_mps)
            rates = [limits.max_acceleration_mps2] if abs(end) > abs(start) or start * end < 0.0 else []
            rates += [limits.max_deceleration_mps2] if abs(end) < abs(start) or start * end < 0.0 else []
            change = SLOPES[piece.shape] * abs(end - start)
            rate = min(rates, default=math.inf)
            if change > 0.0 and rate <= 0.0:  # it cannot change its speed
                return SpeedProfile(self.start_s, start, pieces)
            pieces.append(Piece(max(piece.duration_s, change / rate), start, end, piece.shape))
        return SpeedProfile(self.start_s, within(self.final_mps), pieces)

    def covers_s(self, time_s: float, distance_m: float, either_way: bool) -> float:
        """When a distance will be covered from a time on; infinite if it never is.

        Args:
            time_s: from when on.
            distance_m: positive.
            either_way: whether driving in reverse covers it as well.
        """

        def left_m(until_s: float) -> float:
            gone = self.at(until_s)[0] - before
            return distance_m - (abs(gone) if either_way else gone)

        before = self.at(time_s)[0]
        low = time_s
        for high in (*(start for start, _ in self._starts if start > time_s), max(self.end_s, time_s)):
            if left_m(high) <= 0.0:
                # some way is left at low and none at high: 60 halvings leave no more than rounding
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    low, high = (middle, high) if left_m(middle) > 0.0 else (low, middle)
                return high
            low = high
        speed = abs(self.final_mps) if either_way else self.final_mps
        return low + left_m(low) / speed if speed > 0.0 else NEVER_S

    def sets_off_s(self) -> float:
        """Until when the speed is zero at the beginning; infinite if it stays so."""
        for (start, _), piece in zip(self._starts, self._pieces, strict=True):
            if piece.start_mps != 0.0 or piece.end_mps != 0.0:
                return start
        return self.end_s if self.final_mps != 0.0 else NEVER_S


def transition(
    shape: SpeedShape, dimension: str, value: float, start_mps: float, end_mps: float
) -> tuple[Piece, ...]:
    """Pieces of a speed change with given dynamics (none: at once).

    Args:
        shape: of the change.
        dimension: what `value` is: a duration, the greatest rate of change, or a distance.
        value: s, m/s2 or m.
        start_mps: speed before.
        end_mps: speed after.

    Raises:
        RunError: a rate is 0, and the speeds differ.
    """
    change = abs(end_mps - start_mps)
    if shape == "step" or change == 0.0:
        return ()
    if dimension == "rate" and value <= 0.0:
        raise RunError(f"a rate of 0 never leads from {start_mps:.6g} to {end_mps:.6g} m/s")
    if dimension == "rate":
        duration = SLOPES[shape] * change / value
    elif dimension == "distance":
        mean = 0.5 * abs(start_mps + end_mps)
        duration = value / mean if mean > 0.0 else 0.0
    else:
        duration = value
    return (Piece(duration, start_mps, end_mps, shape),) if duration > 0.0 else ()
