"""Speed lost without an emergency brake, and what the ego slowed for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evaluation.runs.folder import Run, RunSetup
from evaluation.views.account.account import NO_BRAKING
from evaluation.views.account.objects import IN_LANE, STAYED_EVERY, name_of_track, place_of, stay_of
from evaluation.views.frames import LogFrames, boxes_in
from evaluation.views.plots.log_rows import events_of
from evaluation.views.plots.style import MPS_TO_KMH
from smartmot.area import ego_extent, is_vulnerable
from smartmot.decision.rules import STANDING_MPS
from smartmot.types import BoolArray

SLOWED_KMH = 1.0
"""An ego that is never slower than before by more than this has kept its speed: Euro NCAP allows as much to
the speed of a test (AEB protocols, tolerance of the vehicle under test)."""

BRAKING_MPS2 = 1.0
"""Deceleration from which on a car brakes: Euro NCAP takes the crossing of -1 m/s2 for the beginning of
braking (T_AEB). Less is what a car does that is let roll."""


@dataclass(frozen=True, slots=True)
class Slowing:
    """Speed lost without an emergency brake, by speed adaptation or because the scenario asks for it.

    Args:
        first, last: the frames of the greatest and of the least speed.
        from_mps, to_mps: these speeds.
        decel_mps2: greatest deceleration between them.
        cause: the object that the speed was adapted to, and where it was; empty where none is known.
        why: why it counts as being in the way; may be empty.
        in_lane: whether it was in the ego's lane then, so that slowing for it was called for.
    """

    first: int
    last: int
    from_mps: float
    to_mps: float
    decel_mps2: float
    cause: str
    why: str
    in_lane: bool

    @property
    def depth(self) -> str:
        """`from 50 to 12 km/h at up to 2.5 m/s²`."""
        start = f"{self.from_mps * MPS_TO_KMH:.0f}{' km/h' if self.stands else ''}"
        return f"from {start}{self.end} at up to {self.decel_mps2:.1f} m/s²"

    @property
    def end(self) -> str:
        """Speed at the end, with a space before it."""
        return down_to(self.to_mps)

    @property
    def text(self) -> str:
        """Depth and cause."""
        return f"{self.depth}{f' for {self.cause}' if self.cause else ''}"

    @property
    def stands(self) -> bool:
        """Whether it ends in a standstill."""
        return self.to_mps < STANDING_MPS

    @property
    def adapts(self) -> bool:
        """Whether the ego brakes because it adapts its speed to an object that is not in its lane."""
        brakes = self.stands or self.decel_mps2 > BRAKING_MPS2  # rather than lets itself roll
        return brakes and bool(self.cause) and not self.in_lane


def down_to(speed_mps: float) -> str:
    """` to 12 km/h`, or ` to a standstill`."""
    return " to a standstill" if speed_mps < STANDING_MPS else f" to {speed_mps * MPS_TO_KMH:.0f} km/h"


def slowing_of(frames: LogFrames, run: Run, setup: RunSetup) -> Slowing | None:
    """The greatest loss of speed between two frames without an emergency brake; None where it is none."""
    speed = frames.ego["speed_mps"].abs().to_numpy(np.float64, copy=True)
    emergency = _in_emergency(frames)
    if run["collided"]:  # the instant of the contact may see the other push the ego
        speed[-1] = speed[max(len(speed) - 2, 0)]
    # in one pass: `start` is the fastest frame since the last emergency, or since the last one as fast
    greatest_drop, first, last, start = SLOWED_KMH / MPS_TO_KMH, -1, -1, 0
    for frame in range(len(frames)):
        if (frame and emergency[frame - 1]) or speed[frame] >= speed[start]:
            start = frame
        if (drop := float(speed[start] - speed[frame])) > greatest_drop:
            greatest_drop, first, last = drop, start, frame
    if first < 0:
        return None
    if speed[last] < STANDING_MPS:
        last = first + int(np.argmax(speed[first:] < STANDING_MPS))
    ego = frames.ego.iloc[first : last + 1]
    backwards = ego["speed_mps"].to_numpy(np.float64) < 0.0
    decel = np.nan_to_num(np.where(backwards, 1.0, -1.0) * ego["accel_mps2"].to_numpy(np.float64))
    hardest = first + int(np.argmax(decel))
    # whatever it stands behind in the end; else what it braked for the hardest
    meant = last if speed[last] < STANDING_MPS else hardest
    order = sorted(range(first, last + 1), key=lambda frame: abs(frame - meant))
    leads = (_lead(frames, frame, run, setup) for frame in order[:STAYED_EVERY])
    cause, why, in_lane = next((lead for lead in leads if lead[0]), ("", "", False))
    return Slowing(
        first, last, float(speed[first]), float(speed[last]), float(decel.max()), cause, why, in_lane
    )


def _in_emergency(frames: LogFrames) -> BoolArray:
    """(F,) frames in which the emergency brake is on, from each request to its end."""
    on = np.zeros(len(frames), dtype=np.bool_)
    since: int | None = None
    for time, _, label in events_of(frames.events):
        frame = frames.frame_at(time)
        if label == "predicted_collision" and since is None:
            since = frame
        elif label == "end_unexpected" and since is not None:
            on[since:frame], since = True, None
    if since is not None:
        on[since:] = True
    return on


def _lead(frames: LogFrames, frame: int, run: Run, setup: RunSetup) -> tuple[str, str, bool]:
    """What the speed is adapted to in a frame: object and place, why it counts, whether it is in the lane.

    The texts are empty where there is no such object. Without the strategy it is the nearest track ahead.
    """
    tracks = frames.rows("track", frame)
    if run["strategy"] == NO_BRAKING or tracks.empty:
        return "", "", False
    ego = frames.ego_state(frame)
    boxes, category = boxes_in(tracks), tracks["category"].to_numpy(np.str_)
    ahead = ego_extent(boxes, ego)[0] - ego.length_m / 2
    counts = ahead > 0.0
    if frames.strategy is not None:
        threat = (tracks["label"] == "threat").to_numpy()
        counts &= frames.strategy.at(ego).relevance(boxes, category).on_way
        counts &= ~(threat & is_vulnerable(category))
    if not counts.any():
        return "", "", False
    nearest = int(np.argmin(np.where(counts, ahead, math.inf)))
    track = tracks.iloc[nearest]
    place = place_of(setup, boxes.center_m[[nearest]])
    stay = stay_of(frames, frame, track, setup) or place
    cause = name_of_track(frames, frame, track) + (f", {stay}" if stay else "")
    why = f"The ego keeps its distance to it, {ahead[nearest]:.1f} m ahead"
    if place == IN_LANE:
        return cause, f"{why}.", True
    why += ", as if it were in its way." if frames.strategy is not None else ", or to another object."
    if setup.preset is not None and frames.strategy is not None and frames.strategy.name == "rectangular":
        half = setup.preset.rectangular.half_width_m
        why += f" It is inside the rectangle, up to {half:g} m to each side, which knows no lanes."
    return cause, why, False
