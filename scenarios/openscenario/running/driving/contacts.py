"""Whom the ego can touch before a time: the others wait until they can be near, so that most are not asked.

What counts is a way, not a time: the circles around two entities cannot meet before both together have gone
the distance between them, whatever they do meanwhile. One number, the way that two can have gone at most
since the beginning, serves all pairs; each waits for its own value of it.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.conditions import Observed
from scenarios.openscenario.running.holding import HORIZON_S
from scenarios.openscenario.running.relative import Touching
from scenarios.openscenario.running.world import Instant


class Contacts:
    """The ego's contacts with all others, under observation.

    Args:
        ego: the ego.
        others: all entities.
    """

    def __init__(self, ego: Actor, others: Sequence[Actor]) -> None:
        self._ego = ego
        self._others = [other for other in others if other is not ego and not other.definition.flat]
        self._watches = [Observed(Touching(ego, other)) for other in self._others]
        self._waiting: list[tuple[float, int]] = []
        self._unbounded: list[int] = []
        self._gone_m = self._fastest_mps = 0.0
        self._bounded_until_s = -math.inf

    def touched(self, instant: Instant) -> Actor | None:
        """Whom the ego touches at an instant."""
        for other, watch in zip(self._others, self._watches, strict=True):
            if other.exists and watch.holding.holds(instant):
                return other
        return None

    def begin(self, now: Instant) -> None:
        """Take note of who is touched, after a change that may have put somebody elsewhere."""
        self._waiting = [(-math.inf, k) for k, other in enumerate(self._others) if other.exists]
        for _, k in self._waiting:
            self._watches[k].begin(now)
        self.unsettle()

    def unsettle(self) -> None:
        """Forget how fast everybody can be: somebody moves in another way than before."""
        self._bounded_until_s = -math.inf

    def quiet_until_s(self, now: Instant, until_s: float) -> float:
        """Until when no contact can begin or end, as far as a time; the instant itself if one can."""
        if until_s > self._bounded_until_s:
            self._bound(now)
        left_m = self._waiting[0][0] - self._gone_m if self._waiting else math.inf
        if self._unbounded or left_m <= 0.0:
            return now.time_s
        in_s = left_m / self._fastest_mps if self._fastest_mps > 0.0 else math.inf
        return min(now.time_s + in_s, self._bounded_until_s, until_s)

    def wait(self, now: Instant, until_s: float) -> None:
        """Let a time pass in which no contact can begin or end."""
        self._gone_m += self._fastest_mps * (until_s - now.time_s)

    def may_change(self, now: Instant, until_s: float) -> list[Observed]:
        """Contacts that can begin or end before a time."""
        if until_s > self._bounded_until_s:
            self._bound(now)
        begun_m = self._gone_m
        self._gone_m += self._fastest_mps * (until_s - now.time_s)
        near: list[tuple[float, int]] = []
        waiting = self._waiting
        while waiting and waiting[0][0] <= self._gone_m:
            _, k = heapq.heappop(waiting)
            gap_m = now.circle_gap_m(self._ego.name, self._others[k].name)
            if begun_m + gap_m > self._gone_m:
                heapq.heappush(waiting, (begun_m + gap_m, k))
            else:
                near.append((begun_m, k))
        for entry in near:
            heapq.heappush(waiting, entry)
        return [self._watches[k] for k in sorted({*self._unbounded, *(k for _, k in near)})]

    def _bound(self, now: Instant) -> None:
        """Find the greatest speed at which the ego and another can approach or part within the next second.

        Of some others no speed is known; they do not count, and do not wait.
        """
        ego_mps = self._ego.fastest_mps(now.time_s)
        others_mps = [other.fastest_mps(now.time_s) for other in self._others]
        known = [speed for speed in others_mps if math.isfinite(speed)]
        self._unbounded = [
            k
            for k, speed in enumerate(others_mps)
            if not math.isfinite(ego_mps + speed) and self._others[k].exists
        ]
        self._fastest_mps = (ego_mps if math.isfinite(ego_mps) else 0.0) + max(known, default=0.0)
        self._bounded_until_s = now.time_s + HORIZON_S
