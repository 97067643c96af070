"""The account of a run, and the kinds of outcome that there are."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = ("hit", "mitigated", "false", "unnecessary", "cut", "invalid", "stop", "pass")
"""Kinds of outcome, the worst first: a collision; one at a speed that braking has reduced; a false
activation; unnecessary braking by speed adaptation where nothing should happen; cut off by the time limit; a
test without conflict; stopped or slowed without contact; passed without braking."""

NO_BRAKING = "none"
"""Strategy of runs without perception, in which nothing brakes."""


@dataclass(frozen=True, slots=True)
class Account:
    """A run in words.

    Args:
        outcome: what came out, in a few words.
        kind: one of `KINDS`.
        must: what the ego had to do, brake or nothing; empty where that is not known.
        finding: what came out, one sentence.
        why: what made it so; may be empty.
        false_activation: whether the emergency brake was requested for nothing; None where that cannot be.
        unnecessary: whether the ego braked where nothing should happen, in an emergency or not.
        frame: the one that shows why: of the first brake request, of the strongest slowing, or of the
            contact.
        story: (F,) what is happening, for each frame.
        status: (F,) speed and what perception holds, for each frame.
    """

    outcome: str
    kind: str
    must: str
    finding: str
    why: str
    false_activation: bool | None
    unnecessary: bool
    frame: int
    story: tuple[str, ...]
    status: tuple[str, ...]

    @property
    def collided(self) -> bool:
        """Whether the run ended in a collision, at a reduced speed or not."""
        return self.kind in ("hit", "mitigated")
