"""What a run came to and why, in plain words: every number is read from its log or from its settings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evaluation.plots.style import MPS_TO_KMH
from evaluation.report.folder import Run, Setting
from evaluation.report.scene import Scene, boxes_in
from scenarios.presets import Preset
from smartmot.forecast import forecast_ego
from smartmot.geometry import signed_gap
from smartmot.monitored_area import MonitoredLanes, ego_extent, ego_frame
from smartmot.pipeline import STANDING_MPS
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

NO_BRAKING = "none"
"""Strategy of runs without perception, in which nobody brakes."""

_SAME_OBJECT_M = 2.0
"""A track belongs to the actor of its category that is nearest and no farther than this."""

_LATE_S = 0.25
"""An object first tracked this short before the brake request was not late by the decision's fault."""

_STEADY_MPS2 = 0.05
"""A change of speed smaller than this is not told: it would read 0.0."""

_AHEAD_S = np.arange(0.0, 6.01, 0.05)
_OFF_COURSE_M = 1.0
"""An error of the ego's forecast smaller than this is not told."""

_SLOWING = (
    "Slows down to keep its distance to who is taken to be in its way, as adaptive cruise control does."
)

_BEHIND = "Stands behind who is taken to be in its way, without an emergency."

_LONG_STOP_S = 60.0
"""Longer than any car brakes: `BrakeConfig.travel` over this time is the whole way to standstill."""

_LANE_WORDS = {
    "driving": "in another lane",
    "bidirectional": "in another lane",
    "sidewalk": "on the sidewalk",
    "walking": "on the sidewalk",
    "shoulder": "on the shoulder",
    "parking": "in a parking lane",
    "biking": "on the cycle lane",
    "border": "at the border of the road",
    "median": "on the median",
    "restricted": "on a closed lane",
}
"""Where an object is, by the lane type of OpenDRIVE, the first that applies."""


@dataclass(frozen=True, slots=True)
class Trigger:
    """What an emergency brake was requested for.

    Args:
        time_s: when.
        frame: the scene's frame.
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


@dataclass(frozen=True, slots=True)
class Account:
    """A run in words.

    Args:
        outcome: what came out, in a few words.
        kind: hit, false (stop for nobody), stop, or pass.
        finding: what came out, one sentence.
        why: what made it so; may be empty.
        for_nobody: whether it stopped for nobody, with an emergency brake or by adapting its speed.
        frame: the one that shows why: of the first brake request, else where it stands or touches somebody.
        story: (F,) what is happening, for each frame.
        status: (F,) speed and what perception holds, for each frame.
    """

    outcome: str
    kind: str
    finding: str
    why: str
    for_nobody: bool
    frame: int
    story: tuple[str, ...]
    status: tuple[str, ...]


def explain(scene: Scene, run: Run, setting: Setting | None) -> Account:
    """Tell what happened in a run.

    Args:
        scene: the run.
        run: its row in the table of runs.
        setting: map and conditions; without them there are fewer reasons.
    """
    preset = setting.preset if setting else None
    requests = scene.events.loc[scene.events["label"] == "predicted_collision", "time_s"].tolist()
    triggers = [_trigger(scene, float(time), setting, preset) for time in requests]
    hit = _who_was_hit(scene) if run["collided"] else ""
    stands = _stands(scene)
    idle = setting is not None and setting.must == "nothing" and not triggers and stands is not None
    for_nobody = bool(run["false_activation"]) or idle
    kind = "hit" if run["collided"] else "false" if for_nobody else "stop" if triggers else "pass"
    outcome = "waits for nobody" if idle and not run["collided"] else _outcome(run, kind)
    told = _finding(scene, run, triggers, hit, preset)
    if stands is not None and not triggers and not run["collided"]:
        told = _waiting(scene, stands, setting)
    if triggers:
        shown = triggers[0].frame
    elif run["collided"]:
        shown = len(scene) - 1
    else:
        shown = stands or 0
    return Account(
        outcome,
        kind,
        *told,
        for_nobody,
        shown,
        _story(scene, run, triggers, hit),
        _status(scene),
    )


def _outcome(run: Run, kind: str) -> str:
    if kind == "hit":
        return f"hit, {run['v_impact_kmh']:.1f} km/h"
    if kind == "false":
        return "false stop"
    if kind == "stop":
        return "slowed" if math.isnan(run["t0_s"]) else "stopped"
    return "no braking"


def _finding(
    scene: Scene, run: Run, triggers: list[Trigger], hit: str, preset: Preset | None
) -> tuple[str, str]:
    """What came out, and why."""
    impact = f"{run['v_impact_kmh']:.1f} km/h"
    if not triggers:
        if run["collided"]:
            return f"Hits {hit} at {impact} without braking.", _why_never(scene, run)
        return "Never brakes, and touches nobody.", ""
    first = triggers[0]
    request = f"The brake was requested for {first.who}"
    if not math.isnan(first.gap_m):
        request = (
            f"The brake was requested {first.gap_m:.1f} m before {'it' if first.who == hit else first.who}"
        )
    if run["false_activation"]:
        what = f"Brakes for nobody in its way{f', and hits {hit} at {impact}' if hit else ''}."
        request += f", {first.how}"
    elif run["collided"]:
        what = f"Hits {hit} at {impact}."
        if preset is not None:
            need_m = preset.brakes.travel(first.speed_mps, 0.0, _LONG_STOP_S)[0]
            request += f"; from {first.speed_mps * MPS_TO_KMH:.0f} km/h these brakes need {need_m:.1f} m"
    elif math.isnan(run["t0_s"]):
        what = "Brakes, and passes without contact or standstill."
    elif math.isnan(run["stop_gap_m"]):
        what = "Stops without contact."
    elif run["stop_gap_m"] > 0:
        what = f"Stops with {run['stop_gap_m']:.1f} m left."
    else:
        what = "Stops without contact, but only beside the target or past it: it had walked on."
    return what, f"{request}. {first.why}".strip()


def _why_never(scene: Scene, run: Run) -> str:
    """Why an ego that hits somebody has not braked."""
    if run["strategy"] == NO_BRAKING:
        return "In this run nobody watches and nobody brakes."
    detections, tracks = scene.objects["detection"], scene.objects["track"]
    if detections.empty:
        return "Nothing was ever detected."
    if not (detections["label"] == "kept").any():
        return "The monitored area dropped every detection."
    if not (tracks["label"] == "threat").any():
        return "What was tracked never counted as being on a collision course."
    return "The threat was never near enough to count."


def _trigger(scene: Scene, time_s: float, setting: Setting | None, preset: Preset | None) -> Trigger:
    """What the brake request at a time was meant for: the nearest track on a collision course."""
    frame = scene.frame_at(time_s)
    ego = scene.ego_state(frame)
    threats = scene.rows("track", frame)
    threats = threats[threats["label"] == "threat"]
    if threats.empty:
        return Trigger(time_s, frame, ego.speed_mps, math.nan, "an object", "no longer tracked", "", "")
    ahead = ego_extent(boxes_in(threats), ego)[0] - ego.length_m / 2
    nearest = int(np.argmin(ahead))
    track = threats.iloc[nearest]
    moving = bool((scene.rows("forecast", frame)["id"] == track["id"]).any())
    center = threats[["x_m", "y_m"]].to_numpy(np.float64)[[nearest]]
    across = float(ego_frame(center, ego)[1][0])
    motion = f"moving at {track['speed_mps'] * MPS_TO_KMH:.1f} km/h" if moving else "standing"
    place = _place(setting, center)
    side = f"{abs(across):.1f} m to the {'left' if across > 0 else 'right'} of the ego's axis"
    because = (_because(scene, frame, track, moving, preset), _off_course(scene, frame, center, setting))
    return Trigger(
        time_s,
        frame,
        ego.speed_mps,
        max(float(ahead[nearest]), 0.0),
        _name(scene, frame, track),
        " ".join(text for text in (motion, place) if text) + f", {side}",
        " ".join(text for text in because if text),
        _until(scene, frame, track, preset),
    )


def _off_course(scene: Scene, frame: int, center_m: FloatArray, setting: Setting | None) -> str:
    """Whether the ego was expected off its lane: its forecast keeps the turn rate, a bend does not."""
    if setting is None or setting.strategy is None:
        return ""
    if setting.preset.pipeline.forecast.ego == "route" and hasattr(setting.strategy, "route"):
        return ""
    ego = scene.ego_state(frame)
    way = forecast_ego(ego, _AHEAD_S).center_m[0]
    meets = way[[int(np.argmin(np.hypot(*(way - center_m).T)))]]
    offset = float(
        setting.route.place(meets)[1][0] - setting.route.place(np.array([[ego.x_m, ego.y_m]]))[1][0]
    )
    if abs(offset) < _OFF_COURSE_M:
        return ""
    return (
        "The forecast keeps the ego's present turn rate and does not know the road: there it is "
        f"{abs(offset):.1f} m to the {'left' if offset > 0 else 'right'} of where the ego will drive."
    )


def _place(setting: Setting | None, center_m: FloatArray) -> str:
    """Where a point is, in words; nothing without a map."""
    if setting is None:
        return ""
    lanes = setting.network.locate(center_m).lane.tolist()
    if set(lanes) & set(setting.route.lanes):
        return "in the ego's lane"
    types = {str(setting.network.lanes.lane_type[lane]) for lane in lanes}
    return next((words for name, words in _LANE_WORDS.items() if name in types), "off the road")


def _name(scene: Scene, frame: int, track: pd.Series[float]) -> str:
    """The object of a track: that of the test, or another."""
    category = str(track["category"])
    actors = scene.rows("actor", frame)
    actors = actors[actors["category"] == category]
    here = np.array([track["x_m"], track["y_m"]], dtype=np.float64)
    distance = np.hypot(*(actors[["x_m", "y_m"]].to_numpy(np.float64) - here).T)
    if not len(distance) or distance.min() > _SAME_OBJECT_M:
        return f"something taken for a {category}"
    return _called(actors.iloc[int(np.argmin(distance))])


def _because(scene: Scene, frame: int, track: pd.Series[float], moving: bool, preset: Preset | None) -> str:
    """Why an object on a collision course counts, in the terms of the strategy."""
    if scene.strategy is None or preset is None:
        return ""
    area = scene.strategy.at(scene.ego_state(frame))
    name = scene.strategy.name
    if name == "rectangular":
        length, half = _reach_m(scene, frame), preset.rectangular.half_width_m
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
    if name == "all":
        return "Without a monitored area everything ahead counts, wherever it is."
    return ""


def _reach_m(scene: Scene, frame: int) -> float:
    """How far ahead of the ego's centre the outlines of the area reach."""
    points = np.concatenate([ring for _, ring in scene.areas(frame)])
    return float(ego_frame(points, scene.ego_state(frame))[0].max())


def _until(scene: Scene, frame: int, track: pd.Series[float], preset: Preset | None) -> str:
    """Why an object did not count a frame earlier; nothing where its course had not met the ego's yet."""
    tracks = scene.objects["track"]
    own = tracks[tracks["id"] == track["id"]]
    first = float(own["time_s"].min())
    since = float(track["time_s"])
    before = own[own["frame"] == frame - 1]
    if before.empty or since - first < _LATE_S:
        dropped = _dropped_before(scene, own.iloc[0])
        reason = ": the monitored area had dropped it before" if dropped else ""
        return f"It had been tracked for only {since - first:.2f} s{reason}." if frame > 0 else ""
    threat_since = _start_of_last(own.loc[own["label"] == "threat", "frame"], frame)
    if threat_since < frame and preset is not None:
        near = max(
            preset.pipeline.aeb.near_m,
            preset.pipeline.braking_distance.at(scene.ego_state(frame).speed_mps),
        )
        return (
            f"It had been on a collision course since t = {scene.time_s[threat_since]:.2f} s; the brake "
            f"waits until it is nearer than {near:.1f} m."
        )
    if scene.strategy is None:
        return ""
    area = scene.strategy.at(scene.ego_state(frame - 1))
    category = before["category"].to_numpy(np.str_)
    if not area.relevance(boxes_in(before), category).within_reach[0]:
        return f"It had been tracked since t = {first:.2f} s, but was out of reach until then."
    return ""


def _dropped_before(scene: Scene, born: pd.Series[float]) -> bool:
    """Whether the monitored area dropped the object of a track in the frame before the track's first."""
    frame = int(born["frame"])
    rows = scene.rows("detection", frame - 1) if frame > 0 else scene.objects["detection"].iloc[:0]
    rows = rows[(rows["label"] == "dropped") & (rows["category"] == born["category"])]
    distance = np.hypot(rows["x_m"] - born["x_m"], rows["y_m"] - born["y_m"])
    return bool((distance < _SAME_OBJECT_M).any())


def _start_of_last(frames: pd.Series[int], until: int) -> int:
    """First of the unbroken frames that end with `until`."""
    known = set(frames.tolist())
    while until - 1 in known:
        until -= 1
    return until


def _stands(scene: Scene) -> int | None:
    """The first frame in which the ego stands, if it ever does after having driven."""
    speed = scene.ego["speed_mps"].to_numpy(np.float64)
    frames = np.flatnonzero((speed < STANDING_MPS) & (np.maximum.accumulate(speed) > STANDING_MPS))
    return int(frames[0]) if len(frames) else None


def _waiting(scene: Scene, frame: int, setting: Setting | None) -> tuple[str, str]:
    """What came out, and why, where the ego stands without an emergency: it has followed somebody."""
    what = f"Slows down and stands from t = {scene.time_s[frame]:.2f} s on, without an emergency."
    ego, actors = scene.ego_state(frame), scene.rows("actor", frame)
    if actors.empty:
        return what, ""
    boxes = boxes_in(actors)
    ahead = ego_extent(boxes, ego)[0] - ego.length_m / 2
    ahead[ahead < 0.0] = math.inf
    nearest = int(np.argmin(ahead))
    if not math.isfinite(ahead[nearest]):
        return what, ""
    place = _place(setting, boxes.center_m[[nearest]])
    where = f" ({place})" if place else ""
    whom = f"{_called(actors.iloc[nearest])}{where}, {ahead[nearest]:.1f} m ahead"
    why = f"It keeps its distance to {whom}, as if that were in its way."
    if setting is not None and scene.strategy is not None and scene.strategy.name == "rectangular":
        category = actors["category"].to_numpy(np.str_)
        if scene.strategy.at(ego).relevance(boxes, category).on_way[nearest]:
            half = setting.preset.rectangular.half_width_m
            why += f" It is inside the rectangle, up to {half:g} m to each side, which knows no lanes."
    return what, why


def _who_was_hit(scene: Scene) -> str:
    """The actor nearest to the ego at the end."""
    last = len(scene) - 1
    actors = scene.rows("actor", last)
    if actors.empty:
        return "somebody"
    ego, boxes = boxes_in(scene.ego.iloc[[last]]), boxes_in(actors)
    gaps = signed_gap(ego.center_m, ego.size_m, ego.yaw_rad, boxes.center_m, boxes.size_m, boxes.yaw_rad)
    return _called(actors.iloc[int(np.argmin(gaps))])


def _called(actor: pd.Series[float]) -> str:
    """An actor in words."""
    owner = "the test's" if str(actor["label"]) == "target" else "another"
    return f"{owner} {actor['category']}"


def _story(scene: Scene, run: Run, triggers: list[Trigger], hit: str) -> tuple[str, ...]:
    """What is happening, frame by frame."""
    by_frame: dict[int, list[str]] = {}
    for time, label in zip(scene.events["time_s"], scene.events["label"], strict=True):
        by_frame.setdefault(scene.frame_at(float(time)), []).append(str(label))
    waiting = iter(triggers)
    trigger: Trigger | None = None
    alert = False
    idle = "Follows its lane."
    texts = []
    for frame, (speed, accel) in enumerate(
        zip(scene.ego["speed_mps"].tolist(), scene.ego["accel_mps2"].tolist(), strict=True)
    ):
        for label in by_frame.get(frame, ()):
            if label == "predicted_collision":
                trigger = next(waiting)
            elif label in ("forecasted_pedestrian", "unexpected"):
                alert = True
            elif label == "end_unexpected":
                trigger, alert, idle = None, False, "The way is free: drives on."
        if trigger is not None and speed < STANDING_MPS:
            texts.append("Stands and holds the brake: the way has not been free for long enough.")
        elif trigger is not None:
            ahead = "" if math.isnan(trigger.gap_m) else f", {trigger.gap_m:.1f} m ahead then"
            texts.append(
                f"Emergency brake since t = {trigger.time_s:.2f} s for {trigger.who}, {trigger.how}{ahead}. "
                f"{trigger.why}".strip()
            )
        elif alert:
            texts.append(
                "Alert, not braking: the forecast of somebody walking or riding enters the ego's way."
            )
        elif speed < STANDING_MPS and texts and texts[-1] in (_SLOWING, _BEHIND):
            texts.append(_BEHIND)
        elif accel < -_STEADY_MPS2:
            texts.append(_SLOWING)
        else:
            texts.append(idle)
    if run["collided"]:
        texts[-1] = f"Contact: hits {hit} at {run['v_impact_kmh']:.1f} km/h. {_request(trigger)}".strip()
    return tuple(texts)


def _request(trigger: Trigger | None) -> str:
    return "No brake was requested." if trigger is None else f"Brake requested at t = {trigger.time_s:.2f} s."


def _status(scene: Scene) -> tuple[str, ...]:
    """Speed, and what perception holds, frame by frame."""

    def count(kind: str, label: str | None = None) -> list[int]:
        rows = scene.objects[kind]
        rows = rows if label is None else rows[rows["label"] == label]
        found: list[int] = np.bincount(rows["frame"].to_numpy(np.int64), minlength=len(scene)).tolist()
        return found

    texts = []
    for speed, accel, kept, seen, tracked, threats in zip(
        scene.ego["speed_mps"].tolist(),
        scene.ego["accel_mps2"].tolist(),
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
