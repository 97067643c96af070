"""What ends a run, and what that end says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # results know the reasons without the engine
    from scenarios.simulation.truth import Truth

WALKS_ALONG_MPS = 0.5
"""A target that goes along the ego's way at less than that crosses it, or stands."""

SAME_SPEED_MPS, SLOWED_MPS = 0.1, 1.0
"""The ego follows a target if it is as fast as that one and so much slower than it was at first."""

TIME_LIMIT_S = 60.0
"""A run that nothing else has ended is cut off then."""

STANDS_MPS = 0.1
"""Slower is standing still; a car that adapts its speed to one that stands comes to 0 ever more slowly."""


class EndReason(StrEnum):
    """Why a run ended. All but the last two say that what was to come has come.

    Attributes:
        CONTACT: the ego touched somebody.
        STOPPED: the ego stood, or drove on from a stop, and nothing more was to come.
        PASSED: the target, once ahead, is behind the ego.
        FOLLOWED: the ego drives behind the target, no faster than that.
        STORYBOARD: the scenario's own stop trigger.
        NOT_BEGUN: the scenario's own stop trigger, before any event of the target began and without an
            emergency request; what would have come is not known.
        TIME_LIMIT: the time limit; what would have come is not known.
    """

    CONTACT = "contact"
    STOPPED = "stopped"
    PASSED = "passed"
    FOLLOWED = "followed"
    STORYBOARD = "storyboard"
    NOT_BEGUN = "not_begun"
    TIME_LIMIT = "time_limit"


CUT_OFF = frozenset({EndReason.NOT_BEGUN, EndReason.TIME_LIMIT})
"""Ends of runs that count nowhere as avoided."""


def is_avoided(collided: bool, end_reason: str, false_activation: bool | None) -> bool:
    """Whether a run in which the ego must brake counts as a collision avoided.

    Not if it was cut off before anything could happen, nor if the ego braked for something else than the
    target before that had set off: then it never met the target as the test has it.

    Args:
        collided: whether the ego touched anybody.
        end_reason: an `EndReason`; empty where it is not known, as of runs of version 0.1.0.
        false_activation: see `scenarios.simulation.outcome.Outcome`.
    """
    return not collided and end_reason not in CUT_OFF and not false_activation


@dataclass(frozen=True, slots=True)
class StopRule:
    """When a run ends, unless the scenario ends it before; a contact always ends it.

    Args:
        time_limit_s: at the latest; such a run is cut off, and counts nowhere as avoided.
        after_resume_s: this long after the ego drives on from a stop.
        after_pass_m: once the ego's centre is this far beyond the target's.
        after_following_s: this long behind a target to whose speed the ego has adapted its own, unless an
            event is left that would change the target's.
        after_standstill_s: once the ego has stood so long while the target does not come nearer and the
            scenario is not to change its speed any more, nor to set the ego off. 3 s is what the stop
            triggers of the shipped scenes wait.
        at_standstill: as soon as the ego has braked to a standstill, as tests of Euro NCAP do.
        at_level: as soon as the ego has braked to the speed of a target that goes the same way.
    """

    time_limit_s: float = TIME_LIMIT_S
    after_resume_s: float = 1.5
    after_pass_m: float = 10.0
    after_following_s: float = 3.0
    after_standstill_s: float = 3.0
    at_standstill: bool = False
    at_level: bool = True


THROUGH = StopRule(after_resume_s=math.inf, after_pass_m=math.inf, after_standstill_s=math.inf)
"""A scene in which nothing should happen is driven to its end."""


class EndWatch:
    """Looks at each frame whether the run is finished, by its stop rule.

    Args:
        truth: of the run.
        rule: when it ends.
    """

    def __init__(self, truth: Truth, rule: StopRule) -> None:
        self._truth, self._rule = truth, rule
        self._following_since_s: float | None = None
        self._standing_since_s: float | None = None
        self._was_ahead = False

    def reason(self, time_s: float, flagged: bool, resumed_s: float | None) -> EndReason | None:
        """Why the run is finished; None: it is not.

        Args:
            time_s: now.
            flagged: whether there has been an emergency request.
            resumed_s: when the ego drove on from a stop.
        """
        if resumed_s is not None:
            return EndReason.STOPPED if time_s >= resumed_s + self._rule.after_resume_s else None
        if self._rests(time_s):
            return EndReason.STOPPED
        truth = self._truth
        if truth.target is None:
            return None
        ego, center = truth.course(time_s), truth.entities.boxes.center_m[truth.target]
        target_mps = truth.target_along_mps(time_s)
        if self._rule.at_level and flagged and max(ego.speed_mps, WALKS_ALONG_MPS) <= target_mps:
            return EndReason.FOLLOWED
        follows = (
            target_mps > WALKS_ALONG_MPS
            and abs(ego.speed_mps - target_mps) < SAME_SPEED_MPS
            and ego.speed_mps < abs(truth.asked(time_s).speed_mps) - SLOWED_MPS
        )
        if not follows or self._target_waits(time_s):
            self._following_since_s = None
        elif self._following_since_s is None:
            self._following_since_s = time_s
        elif time_s >= self._following_since_s + self._rule.after_following_s:
            return EndReason.FOLLOWED
        along = math.cos(ego.yaw_rad) * (center[0] - ego.x_m) + math.sin(ego.yaw_rad) * (center[1] - ego.y_m)
        self._was_ahead |= float(along) > 0.0
        return EndReason.PASSED if self._was_ahead and float(along) < -self._rule.after_pass_m else None

    def _rests(self, time_s: float) -> bool:
        """Whether the ego has stood for long enough while nothing changes any more."""
        truth = self._truth
        if abs(truth.ego_speed_mps) >= STANDS_MPS or self._target_comes() or self._target_waits(time_s):
            self._standing_since_s = None
        elif abs(truth.asked(time_s).speed_mps) < STANDS_MPS and truth.is_to_change(
            truth.engine.ego.name, time_s
        ):
            self._standing_since_s = None  # it waits as the scenario wants
        elif self._standing_since_s is None:
            self._standing_since_s = time_s
        else:
            return time_s >= self._standing_since_s + self._rule.after_standstill_s
        return False

    def _target_comes(self) -> bool:
        """Whether the target moves towards the ego."""
        truth = self._truth
        if truth.target is None:
            return False
        entities, k = truth.entities, truth.target
        yaw, speed = float(entities.boxes.yaw_rad[k]), float(entities.speed_mps[k])
        dx, dy = entities.boxes.center_m[k] - entities.boxes.center_m[truth.own]
        comes = speed * (math.cos(yaw) * dx + math.sin(yaw) * dy) < 0.0
        return bool(entities.exists[k]) and abs(speed) >= STANDS_MPS and comes

    def _target_waits(self, time_s: float) -> bool:
        """Whether the scenario is still to change the target's speed."""
        target = self._truth.engine.target
        return target is not None and self._truth.is_to_change(target, time_s)
