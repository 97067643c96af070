"""What is happening in a run, frame by frame, in words."""

from __future__ import annotations

import math

import numpy as np

from evaluation.runs.folder import Run
from evaluation.views.account.braking import BrakeRequest
from evaluation.views.account.slowing import Slowing
from evaluation.views.frames import LogFrames
from evaluation.views.plots.log_rows import events_of
from evaluation.views.plots.style import MPS_TO_KMH
from smartmot.decision.rules import STANDING_MPS

_STEADY_MPS2 = 0.05
"""A smaller change of speed is left out: it would read 0.0."""


def story_of(
    frames: LogFrames, run: Run, requests: list[BrakeRequest], slowing: Slowing | None, hit: str
) -> tuple[str, ...]:
    """(F,) what is happening, frame by frame."""
    by_frame: dict[int, list[str]] = {}
    for time, _, label in events_of(frames.events):
        by_frame.setdefault(frames.frame_at(time), []).append(label)
    waiting = iter(requests)
    request: BrakeRequest | None = None
    alert = False
    idle = "Follows its lane."
    cause = slowing.cause if slowing else ""
    adapts = "Slows without an emergency" + (f" for {cause}." if cause else ".")
    waits = "Stands without an emergency" + (f" behind {cause}." if cause else ".")
    texts: list[str] = []
    for frame, (speed, accel) in enumerate(
        zip(frames.ego["speed_mps"].tolist(), frames.ego["accel_mps2"].tolist(), strict=True)
    ):
        for label in by_frame.get(frame, ()):
            if label == "predicted_collision":
                request = next(waiting)
            elif label in ("forecasted_pedestrian", "unexpected"):
                alert = True
            elif label == "end_unexpected":
                request, alert, idle = None, False, "The way is free: drives on."
        if request is not None and speed < STANDING_MPS:
            texts.append("Stands and holds the brake: the way has not been free for long enough.")
        elif request is not None:
            ahead = "" if math.isnan(request.gap_m) else f", {request.gap_m:.1f} m ahead then"
            texts.append(
                f"Emergency brake since t = {request.time_s:.2f} s for {request.who}, {request.how}{ahead}. "
                f"{request.why}".strip()
            )
        elif alert:
            texts.append("Alert, not braking: the forecast of a pedestrian or cyclist enters the ego's way.")
        elif abs(speed) < STANDING_MPS and texts and texts[-1] in (adapts, waits):
            texts.append(waits)
        elif accel * math.copysign(1.0, speed) < -_STEADY_MPS2:
            texts.append(adapts)
        else:
            texts.append(idle)
    if run["collided"]:
        asked = "No brake was requested." if request is None else (
            f"Brake requested at t = {request.time_s:.2f} s."
        )  # fmt: skip
        texts[-1] = f"Contact: hits {hit} at {run['v_impact_kmh']:.1f} km/h. {asked}"
    return tuple(texts)


def status_of(frames: LogFrames) -> tuple[str, ...]:
    """(F,) speed, and what perception holds, frame by frame."""

    def count(kind: str, label: str | None = None) -> list[int]:
        rows = frames.objects[kind]
        rows = rows if label is None else rows[rows["label"] == label]
        counts: list[int] = np.bincount(rows["frame"].to_numpy(np.int64), minlength=len(frames)).tolist()
        return counts

    texts = []
    for speed, accel, kept, seen, tracked, threats in zip(
        frames.ego["speed_mps"].tolist(),
        frames.ego["accel_mps2"].tolist(),
        count("detection", "kept"),
        count("detection"),
        count("track"),
        count("track", "threat"),
        strict=True,
    ):
        change = ""
        if abs(accel) >= _STEADY_MPS2:
            change = f", {'braking' if accel < 0 else 'speeding up'} at {abs(accel):.1f} m/s²"
        texts.append(
            f"{speed * MPS_TO_KMH:.1f} km/h{change} · {kept} of {seen} detections kept · "
            f"{tracked} tracked, {threats} on a collision course"
        )
    return tuple(texts)
