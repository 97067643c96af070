"""Why the emergency brake was requested: for which object, why it counts, and why not earlier."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evaluation.runs.folder import RunSetup
from evaluation.views.account.objects import SAME_OBJECT_M, centers_of, name_of_track, place_of
from evaluation.views.frames import LogFrames, boxes_in
from evaluation.views.plots.style import MPS_TO_KMH
from smartmot.area import MonitoredLanes, ego_extent, ego_frame
from smartmot.decision.aeb import AebConfig
from smartmot.forecast import forecast_ego
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_LATE_S = 0.25
"""An object first tracked this short before the brake request was not late by the decision's fault."""

_AHEAD_S = np.arange(0.0, 6.01, 0.05)
_OFF_COURSE_M = 1.0
"""A smaller error of the ego's forecast is left out."""


@dataclass(frozen=True, slots=True)
class BrakeRequest:
    """What an emergency brake was requested for.

    Args:
        time_s: when.
        frame: the frame of that time.
        speed_mps: of the ego then.
        gap_m: from the ego's front to the object, along the ego's heading; NaN without an object.
        who: the object.
        how: its motion and place.
        because: why it counts, one sentence or none.
        until: why it did not count earlier, one sentence or none.
    """

    time_s: float
    frame: int
    speed_mps: float
    gap_m: float
    who: str
    how: str
    because: str
    until: str

    @property
    def why(self) -> str:
        """The reasons, as far as known."""
        return " ".join(text for text in (self.because, self.until) if text)


def brake_requests(frames: LogFrames, setup: RunSetup) -> list[BrakeRequest]:
    """Every request of the emergency brake, with the nearest track on a collision course then."""
    times = frames.events.loc[frames.events["label"] == "predicted_collision", "time_s"]
    return [_request(frames, float(time), setup) for time in times.tolist()]


def _request(frames: LogFrames, time_s: float, setup: RunSetup) -> BrakeRequest:
    frame = frames.frame_at(time_s)
    ego = frames.ego_state(frame)
    threats = frames.rows("track", frame)
    threats = threats[threats["label"] == "threat"]
    if threats.empty:
        return BrakeRequest(time_s, frame, ego.speed_mps, math.nan, "an object", "no longer tracked", "", "")
    ahead = ego_extent(boxes_in(threats), ego)[0] - ego.length_m / 2
    nearest = int(np.argmin(ahead))
    track = threats.iloc[nearest]
    moving = bool((frames.rows("forecast", frame)["id"] == track["id"]).any())
    center = centers_of(threats)[[nearest]]
    across = float(ego_frame(center, ego)[1][0])
    motion = f"moving at {track['speed_mps'] * MPS_TO_KMH:.1f} km/h" if moving else "standing"
    side = f"{abs(across):.1f} m to the {'left' if across > 0 else 'right'} of the ego's axis"
    because = (_because(frames, frame, track, moving, setup), _off_course(frames, frame, center, setup))
    return BrakeRequest(
        time_s=time_s,
        frame=frame,
        speed_mps=ego.speed_mps,
        gap_m=max(float(ahead[nearest]), 0.0),
        who=name_of_track(frames, frame, track),
        how=" ".join(text for text in (motion, place_of(setup, center)) if text) + f", {side}",
        because=" ".join(text for text in because if text),
        until=_until(frames, frame, track, setup),
    )


def _off_course(frames: LogFrames, frame: int, center_m: FloatArray, setup: RunSetup) -> str:
    """Whether the ego was expected off its lane: its forecast keeps the turn rate, a bend does not."""
    if setup.strategy is None or setup.route is None or setup.preset is None:
        return ""
    if setup.preset.pipeline.forecast.ego == "path":
        return ""
    ego = frames.ego_state(frame)
    forecast = forecast_ego(ego, _AHEAD_S).center_m[0]
    # where the forecast comes nearest to the object; there it may be beside the route, where the ego is not
    closest = forecast[[int(np.argmin(np.hypot(*(forecast - center_m).T)))]]
    route = setup.route
    offset = float(route.place(closest)[1][0] - route.place(np.array([[ego.x_m, ego.y_m]]))[1][0])
    if abs(offset) < _OFF_COURSE_M:
        return ""
    return (
        "The forecast keeps the ego's present turn rate and does not know the road: there it is "
        f"{abs(offset):.1f} m to the {'left' if offset > 0 else 'right'} of where the ego will drive."
    )


def _because(frames: LogFrames, frame: int, track: pd.Series[float], moving: bool, setup: RunSetup) -> str:
    """Why an object on a collision course counts, in the terms of the strategy."""
    strategy, preset = frames.strategy, setup.preset
    if strategy is None or preset is None:
        return ""
    area = strategy.at(frames.ego_state(frame))
    if strategy.name == "rectangular":
        length, half = _length_ahead_m(frames, frame), preset.rectangular.half_width_m
        if moving:
            return f"What moves counts inside the rectangle, which ends {length:.1f} m from the ego's centre."
        return (
            f"It does not move, but it is inside the rectangle ({length:.1f} m long, up to {half:g} m to "
            "each side), which knows no lanes, and the ego's forecast passes over it: that counts, on the "
            "sidewalk as well."
        )
    if isinstance(area, MonitoredLanes):
        margin = preset.map_area.vru_margin_m
        if moving:
            within = "" if area.reach_m is None else f"within {area.reach_m:g} m of the ego's centre, "
            return f"With the map, what moves counts {within}in the lane and {margin:g} m over the sidewalk."
        box = boxes_in(track.to_frame().T)
        on_way = bool(area.relevance(box, np.array([track["category"]], dtype=np.str_)).on_way[0])
        where = "on the ego's way" if on_way else f"in the margin of {margin:g} m beside the lane"
        return f"It does not move, but it is {where}, and the ego's forecast passes over it."
    if strategy.name == "all":
        return "Without a monitored area everything ahead counts, wherever it is."
    return ""


def _length_ahead_m(frames: LogFrames, frame: int) -> float:
    """How far ahead of the ego's centre the outlines of the area reach."""
    points = np.concatenate([ring for _, ring in frames.areas(frame)])
    return float(ego_frame(points, frames.ego_state(frame))[0].max())


def _until(frames: LogFrames, frame: int, track: pd.Series[float], setup: RunSetup) -> str:
    """Why an object did not count a frame earlier; nothing where its course had not met the ego's yet."""
    tracks = frames.objects["track"]
    history = tracks[tracks["id"] == track["id"]]
    first, now = float(history["time_s"].min()), float(track["time_s"])
    before = history[history["frame"] == frame - 1]
    if before.empty or now - first < _LATE_S:
        dropped = _dropped_before(frames, history.iloc[0])
        reason = ": the monitored area had dropped it before" if dropped else ""
        return f"It had been tracked for only {now - first:.2f} s{reason}." if frame > 0 else ""
    threat_since = _start_of_last(history.loc[history["label"] == "threat", "frame"], frame)
    if threat_since < frame and setup.preset is not None:
        pipeline, since_s = setup.preset.pipeline, frames.time_s[threat_since]
        collision_course = f"It had been on a collision course since t = {since_s:.2f} s"
        if not isinstance(pipeline.aeb, AebConfig):
            return f"{collision_course}; the brake rule {getattr(pipeline.aeb, 'name', '')} waited."
        planned_m = pipeline.braking_distance.at(frames.ego_state(frame).speed_mps)
        near = max(pipeline.aeb.near_m, pipeline.aeb.braking_factor * planned_m)
        return f"{collision_course}; the brake waits until it is nearer than {near:.1f} m."
    if frames.strategy is None:
        return ""
    area = frames.strategy.at(frames.ego_state(frame - 1))
    if not area.relevance(boxes_in(before), before["category"].to_numpy(np.str_)).within_reach[0]:
        return f"It had been tracked since t = {first:.2f} s, but was out of reach until then."
    return ""


def _dropped_before(frames: LogFrames, born: pd.Series[float]) -> bool:
    """Whether the monitored area dropped the object of a track in the frame before the track's first."""
    frame = int(born["frame"])
    rows = frames.rows("detection", frame - 1) if frame > 0 else frames.objects["detection"].iloc[:0]
    rows = rows[(rows["label"] == "dropped") & (rows["category"] == born["category"])]
    distance = np.hypot(rows["x_m"] - born["x_m"], rows["y_m"] - born["y_m"])
    return bool((distance < SAME_OBJECT_M).any())


def _start_of_last(frames: pd.Series[int], until: int) -> int:
    """First of the unbroken frames that end with `until`."""
    known = set(frames.tolist())
    while until - 1 in known:
        until -= 1
    return until
