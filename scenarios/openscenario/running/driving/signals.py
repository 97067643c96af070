"""Traffic signals: what they show, by actions and by the phases of their controllers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import SignalController, SignalPhase

BOUNDARY_S = 1e-9
"""A phase begins this much early, so that rounding does not hide it at its first instant."""


@dataclass(slots=True)
class _Cycle:
    """A controller, and since when its cycle runs."""

    controller: SignalController
    start_s: float

    @property
    def length_s(self) -> float:
        return sum(phase.duration_s for phase in self.controller.phases)

    def at(self, time_s: float) -> tuple[SignalPhase, float, float] | None:
        """The phase at a time, since when, and until when; None if it has no phases that last."""
        length = self.length_s
        if length <= 0.0:
            return None
        begun = self.start_s + length * math.floor((time_s + BOUNDARY_S - self.start_s) / length)
        for phase in self.controller.phases:
            if time_s + BOUNDARY_S < begun + phase.duration_s:
                return phase, begun, begun + phase.duration_s
            begun += phase.duration_s
        return None


class Signals:
    """Traffic signals of a run.

    The first phase of a controller starts after its delay, counted from the start of the controller that it
    refers to, or of the run; its cycle runs before and after that, as the standard has it.

    Args:
        controllers: as read.
    """

    def __init__(self, controllers: Sequence[SignalController] = ()) -> None:
        by_name = {controller.name: controller for controller in controllers}
        self._cycles: dict[str, _Cycle] = {}
        for controller in controllers:
            start_s, seen, next_one = 0.0, set[str](), controller
            while next_one.name not in seen:
                seen.add(next_one.name)
                start_s += next_one.delay_s
                if next_one.reference is None:
                    break
                next_one = by_name[next_one.reference]
            self._cycles[controller.name] = _Cycle(controller, start_s)
        self._set: dict[str, tuple[float, str]] = {}

    def set_state(self, signal: str, state: str, time_s: float) -> None:
        """Let a signal show a state, until an action or the next phase of its controller changes it."""
        self._set[signal] = time_s, state

    def set_phase(self, name: str, phase: str, time_s: float) -> None:
        """Put a controller into a phase, from which its cycle goes on.

        Raises:
            RunError: there is no such controller or phase.
        """
        cycle = self._cycles.get(name)
        if cycle is None:
            raise RunError(
                f"no controller of traffic signals '{name}'; there are: {', '.join(self._cycles) or 'none'}"
            )
        before = 0.0
        for known in cycle.controller.phases:
            if known.name == phase:
                cycle.start_s = time_s - before
                return
            before += known.duration_s
        raise RunError(f"controller '{name}' has no phase '{phase}'")

    def state(self, signal: str, time_s: float) -> str | None:
        """What a signal shows; None if nothing has said so."""
        since, state = self._set.get(signal, (-math.inf, None))
        for cycle in self._cycles.values():
            now = cycle.at(time_s)
            if now is not None and now[1] > since:
                state = dict(now[0].states).get(signal, state)
        return state

    def states(self, time_s: float) -> dict[str, str]:
        """What every signal shows that something has been said of, by its id."""
        named = {
            signal
            for cycle in self._cycles.values()
            for p in cycle.controller.phases
            for signal, _ in p.states
        }
        shown = {signal: self.state(signal, time_s) for signal in sorted(named.union(self._set))}
        return {signal: state for signal, state in shown.items() if state is not None}

    def phase(self, name: str, time_s: float) -> str | None:
        """The phase of a controller; None if there is none."""
        cycle = self._cycles.get(name)
        now = None if cycle is None else cycle.at(time_s)
        return None if now is None else now[0].name

    def next_change_s(self, time_s: float) -> float:
        """When a phase ends next; infinite if none does."""
        ends = [now[2] for cycle in self._cycles.values() if (now := cycle.at(time_s)) is not None]
        return min(ends, default=math.inf)
