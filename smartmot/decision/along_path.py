"""What the rules share that look along the ego's path: their targets, and how long a braking lasts.

They do not look at where an object will be. A pedestrian who crosses becomes their target when entering the
width that the ego sweeps, however long that was foreseeable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.rules import STANDING_MPS, Assessment
from smartmot.types import BoolArray, FloatArray

HOLD_M = 12.0
"""At standstill the brake is held while a target is nearer than this: what is near for the paper's rule. The
sources say nothing of it (assumed); a car that let go would creep into what it has just stopped for."""

CLEAR_S = 0.15
"""Time without a reason to brake before the brake is let go: that of the paper's rule."""


def targets(now: Assessment, margin_m: float = 0.0) -> BoolArray:
    """(M,) which objects count, are in front of the ego's centre, and overlap the width that it sweeps.

    Args:
        now: the frame.
        margin_m: by which the width grows on either side.
    """
    if not np.count_nonzero(now.counts):
        return np.zeros(len(now.tracks), dtype=np.bool_)
    return now.counts & in_front(now) & (now.path_aside_m <= margin_m)


def in_front(now: Assessment) -> BoolArray:
    """(M,) whose near face is in front of the ego's centre."""
    return now.path_gap_m > -now.ego.length_m / 2


def closing_times(now: Assessment) -> FloatArray:
    """(M,) times until the gaps along the path are closed at present speeds; infinite where they are not."""
    closing = now.ego.speed_mps - now.path_speed_mps
    gap = np.maximum(now.path_gap_m, 0.0)
    time = np.full(len(gap), np.inf)
    np.divide(gap, closing, out=time, where=closing > 0.0)
    return time


def stands(now: Assessment) -> bool:
    """Whether the ego stands still."""
    return now.ego.speed_mps < STANDING_MPS


def is_held(now: Assessment) -> bool:
    """Whether the ego stands, and a target is so near that it must not drive on."""
    return stands(now) and bool(np.count_nonzero(targets(now) & (now.path_gap_m < HOLD_M)))


def until_standstill(now: Assessment) -> bool:
    """Whether a braking goes on: it does until the ego stands, and then as long as it is held."""
    return not stands(now) or is_held(now)


@dataclass(frozen=True, slots=True)
class Braking:
    """Memory of a rule; `Braking()` before the first frame.

    Args:
        started: whether there has been a frame.
        warned: whether it warns.
        stage: of the brake; 0: none.
        clear_since_s: since when there is no reason to brake; None: there is one.
        begun_s: since when it brakes; None: it does not.
    """

    started: bool = False
    warned: bool = False
    stage: int = 0
    clear_since_s: float | None = None
    begun_s: float | None = None


def next_braking(
    state: Braking,
    now: Assessment,
    stage: int,
    goes_on: bool,
    warned: bool = False,
    clear_s: float = CLEAR_S,
) -> tuple[Braking, tuple[Event, ...]]:
    """What becomes of a braking; the stage rises until it is let go.

    Args:
        state: of the frame before.
        now: the frame.
        stage: that the present frame asks for; 0: none.
        goes_on: whether a braking goes on although the frame asks for none.
        warned: whether the frame asks for a warning; while it brakes a rule that warns goes on to do so.
        clear_s: time without a reason to brake before it is let go.

    Returns:
        The next state, and the events of the frame, named as those of the paper's rule.
    """
    stamp = now.ego.stamp_s
    names: list[tuple[str, str]] = []
    if not state.started:
        names += [("start", "run_start"), ("selector", "follow_path")]
    since: float | None = None
    if not stage and state.stage and not goes_on:
        since = stamp if state.clear_since_s is None else state.clear_since_s
    released = since is not None and stamp - since >= clear_s - 1e-9
    held = 0 if released else max(stage, state.stage)
    if warned and not state.warned:
        names.append(("monitors", "warning"))
    if held and not state.stage:
        names += [
            ("selector", "unexpected"),
            ("monitors", "collision"),
            ("unexpected", "predicted_collision"),
        ]
    if released:
        names += [("monitors", "free_lane"), ("unexpected", "end_unexpected"), ("selector", "follow_path")]
    warns = warned or (state.warned and held > 0)
    events = tuple(Event(stamp, layer, name) for layer, name in names)
    begun = None if not held else stamp if state.begun_s is None else state.begun_s
    return Braking(True, warns, held, None if released else since, begun), events
