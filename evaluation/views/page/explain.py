"""What a run came to and why, in plain words: every number is read from its log or from its settings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evaluation.views.page.folder import Run, Setting
from evaluation.views.page.scene import Scene, boxes_in
from evaluation.views.plots.style import MPS_TO_KMH
from scenarios.presets import Preset
from scenarios.simulation.ends import CUT_OFF, EndReason
from smartmot.area import MonitoredLanes, ego_extent, ego_frame, is_vulnerable
from smartmot.decision.rules import STANDING_MPS
from smartmot.forecast import forecast_ego
from smartmot.geometry import signed_gap
from smartmot.types import BoolArray, FloatArray

if TYPE_CHECKING:
    import pandas as pd

NO_BRAKING = "none"
"""Strategy of runs without perception, in which nothing brakes."""

SLOWED_KMH = 1.0
"""An ego that is never slower than before by more than this has kept its speed: Euro NCAP allows as much to
the speed of a test (AEB protocols, tolerance of the vehicle under test)."""

BRAKING_MPS2 = 1.0
"""Deceleration from which on a car brakes: Euro NCAP takes the crossing of -1 m/s2 for the beginning of
braking (T_AEB). Less is what a car does that is let roll."""

KINDS = ("hit", "mitigated", "false", "unnecessary", "cut", "invalid", "stop", "pass")
"""Kinds of outcome, the worst first: a collision; one at a speed that braking has reduced; a false
activation; unnecessary braking by speed adaptation where nothing should happen; cut off by the time limit; a
test without conflict; stopped or slowed without contact; passed without braking."""

_SAME_OBJECT_M = 2.0
"""A track belongs to the actor of its category that is nearest and no farther than this."""

_LATE_S = 0.25
"""An object first tracked this short before the brake request was not late by the decision's fault."""

_STEADY_MPS2 = 0.05
"""A smaller change of speed is left out: it would read 0.0."""

_STAYED_EVERY = 10
"""Frames from one look at where an object is to the next: half a second."""

_AHEAD_S = np.arange(0.0, 6.01, 0.05)
_OFF_COURSE_M = 1.0
"""A smaller error of the ego's forecast is left out."""

_LONG_STOP_S = 60.0
"""Longer than any car brakes: `BrakeConfig.travel` over this time is the whole way to standstill."""

_IN_LANE = "in the ego's lane"

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
class Slowing:
    """Speed lost without an emergency brake, by speed adaptation or because the scenario asks for it.

    Args:
        first, last: the scene's frames of the greatest and of the least speed.
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
        return _down_to(self.to_mps)

    @property
    def text(self) -> str:
        """Depth and cause."""
        return f"{self.depth}{f' for {self.cause}' if self.cause else ''}"

    @property
    def stands(self) -> bool:
        """Whether it ends in a standstill."""
        return self.to_mps < STANDING_MPS

    @property
    def brakes(self) -> bool:
        """Whether the ego brakes, rather than lets itself roll."""
        return self.stands or self.decel_mps2 > BRAKING_MPS2


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
        contact. story: (F,) what is happening, for each frame. status: (F,) speed and what perception holds,
        for each frame.
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


def explain(scene: Scene, run: Run, setting: Setting | None) -> Account:
    """Say what happened in a run.

    Args:
        scene: the run.
        run: its row in the table of runs.
        setting: map and conditions; without them there are fewer reasons.
    """
    preset = setting.preset if setting else None
    must = setting.must if setting else ""
    requests = scene.events.loc[scene.events["label"] == "predicted_collision", "time_s"].tolist()
    triggers = [_trigger(scene, float(time), setting, preset) for time in requests]
    slowing = _slowing(scene, run, setting)
    hit = _who_was_hit(scene) if run["collided"] else ""
    kind = _kind(scene, run, must, triggers, slowing)
    finding, why = _finding(scene, run, kind, triggers, slowing, hit, must, preset)
    if triggers:
        shown = triggers[0].frame
    elif run["collided"]:
        shown = len(scene) - 1
    else:
        shown = slowing.last if slowing else 0
    false_activation = _false_activation(run)
    return Account(
        outcome=_outcome(scene, run, kind, triggers, slowing),
        kind=kind,
        must=must,
        finding=finding,
        why=why,
        false_activation=false_activation,
        unnecessary=must == "nothing" and (bool(false_activation) or _adapts(slowing)),
        frame=shown,
        story=_story(scene, run, triggers, slowing, hit),
        status=_status(scene),
    )


def _false_activation(run: Run) -> bool | None:
    """Whether the run has one; None where it cannot have any."""
    value = run["false_activation"]
    return None if value is None or value != value else bool(value)  # NaN where the column is empty


def _cut_off(run: Run) -> bool:
    """Whether the time limit ended the run; folders of version 0.1.0 do not say."""
    return bool(run["end_reason"] in CUT_OFF)


def _adapts(slowing: Slowing | None) -> bool:
    """Whether the ego brakes because it adapts its speed to an object that is not in its lane."""
    return slowing is not None and slowing.brakes and bool(slowing.cause) and not slowing.in_lane


def _kind(scene: Scene, run: Run, must: str, triggers: list[Trigger], slowing: Slowing | None) -> str:
    if run["collided"]:
        before = float(scene.ego["speed_mps"].abs().max()) * MPS_TO_KMH
        braked = bool(triggers or (slowing and slowing.cause)) and run["v_impact_kmh"] < before - SLOWED_KMH
        return "mitigated" if braked else "hit"
    if _false_activation(run):
        return "false"
    if must == "nothing" and _adapts(slowing):
        return "unnecessary"
    if _cut_off(run):
        return "cut"
    if not math.isnan(run["score_max"]) and math.isnan(run["score"]):
        return "invalid"  # the command has found that without any brake there is no contact
    asked = must == "brake" or not math.isnan(run["score_max"]) or run["strategy"] == NO_BRAKING
    if asked and must != "nothing" and not triggers and not (slowing and slowing.cause):
        return "invalid"  # nothing has braked: without any brake there is no contact either
    return "stop" if triggers or slowing else "pass"


def _outcome(scene: Scene, run: Run, kind: str, triggers: list[Trigger], slowing: Slowing | None) -> str:
    if kind in ("hit", "mitigated"):
        return f"{kind}, {run['v_impact_kmh']:.1f} km/h"
    words = {
        "false": "false activation",
        "cut": "cut off",
        "invalid": "no conflict",
        "pass": "no braking",
    }
    if kind in words:
        return words[kind]
    if kind == "unnecessary" and slowing is not None:
        return f"unnecessary braking{slowing.end}"
    if not math.isnan(run["t0_s"]):
        return "stopped"
    ends = [_least_mps(scene, trigger.frame) for trigger in triggers[:1]]
    ends += [slowing.to_mps] if slowing else []
    return "stopped" if min(ends) < STANDING_MPS else f"slowed{_down_to(min(ends))}"


def _least_mps(scene: Scene, frame: int) -> float:
    """Least speed from a frame on."""
    return float(scene.ego["speed_mps"].abs().iloc[frame:].min())


def _down_to(speed_mps: float) -> str:
    """` to 12 km/h`, or ` to a standstill`."""
    return " to a standstill" if speed_mps < STANDING_MPS else f" to {speed_mps * MPS_TO_KMH:.0f} km/h"


def _finding(
    scene: Scene,
    run: Run,
    kind: str,
    triggers: list[Trigger],
    slowing: Slowing | None,
    hit: str,
    must: str,
    preset: Preset | None,
) -> tuple[str, str]:
    """What came out, and why."""
    if triggers:
        what, why = _emergency(scene, run, triggers[0], hit, preset)
        if slowing is not None and slowing.first < triggers[0].frame:
            why += f" Before that, the ego had slowed {slowing.text}."
    elif run["collided"]:
        what, why = _unbraked_contact(scene, run, slowing, hit)
    elif slowing is not None:
        begin = "Unnecessary braking: slows" if kind == "unnecessary" else "Slows"
        what, why = f"{begin} {slowing.text}, without an emergency.", slowing.why
        if not slowing.cause:
            why = "Nothing that it tracks is in its way then." if run["strategy"] != NO_BRAKING else (
                "Nothing watches in this run: the scenario slows the ego."
            )  # fmt: skip
    else:
        what, why = f"Keeps its speed within {SLOWED_KMH:g} km/h, and passes without contact.", ""
    if kind == "invalid":
        why = f"{why} There was nothing to avoid: a test without conflict, which counts in no rate."
    if must == "brake" and kind == "stop":
        what = f"Collision avoided. {what}"
    if _cut_off(run) and not run["collided"]:
        who = "time limit" if run["end_reason"] == EndReason.TIME_LIMIT else "scenario's stop trigger"
        what += f" The {who} ended the run at t = {scene.time_s[-1]:.1f} s."
    return what, why.strip()


def _unbraked_contact(scene: Scene, run: Run, slowing: Slowing | None, hit: str) -> tuple[str, str]:
    """What came out, and why, where a contact came without any emergency request."""
    if run["v_impact_kmh"] < STANDING_MPS * MPS_TO_KMH:
        return f"Is hit by {hit} while it stands.", ""
    what = f"Hits {hit} at {run['v_impact_kmh']:.1f} km/h"
    if slowing is None:
        return f"{what} without braking.", _why_never(scene, run)
    return f"{what}, slowed {slowing.text}, but without an emergency brake.", _why_never(scene, run)


def _emergency(scene: Scene, run: Run, first: Trigger, hit: str, preset: Preset | None) -> tuple[str, str]:
    """What came out, and why, where the emergency brake was requested."""
    impact = f"{run['v_impact_kmh']:.1f} km/h"
    request = f"The brake was requested for {first.who}"
    if not math.isnan(first.gap_m):
        request = (
            f"The brake was requested {first.gap_m:.1f} m before {'it' if first.who == hit else first.who}"
        )
    if _false_activation(run):
        until = _down_to(_least_mps(scene, first.frame))
        what = (
            f"False activation: emergency braking from {first.speed_mps * MPS_TO_KMH:.0f} km/h{until} for "
            f"{first.who}{f', then hits {hit} at {impact}' if hit else ''}."
        )
        request += f", {first.how}"
    elif run["collided"]:
        what = f"Hits {hit} at {impact}."
        if preset is not None:
            need_m = preset.brakes.travel(first.speed_mps, 0.0, _LONG_STOP_S)[0]
            request += f"; from {first.speed_mps * MPS_TO_KMH:.0f} km/h these brakes need {need_m:.1f} m"
    elif math.isnan(run["t0_s"]):
        least = _down_to(_least_mps(scene, first.frame))
        what = f"Slows{least} in an emergency, and passes without contact."
    elif math.isnan(run["stop_gap_m"]):
        what = "Stops without contact."
    elif run["stop_gap_m"] > 0:
        what = f"Stops with {run['stop_gap_m']:.1f} m left."
    else:
        what = "Stops without contact, but only beside the target or past it: it had walked on."
    return what, f"{request}. {first.why}".strip()


def _why_never(scene: Scene, run: Run) -> str:
    """Why an ego that hits an object has not braked."""
    if run["strategy"] == NO_BRAKING:
        return "Nothing watches and nothing brakes in this run."
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
        return _IN_LANE
    types = {str(setting.network.lanes.lane_type[lane]) for lane in lanes}
    return next((words for name, words in _LANE_WORDS.items() if name in types), "off the road")


def _name(scene: Scene, frame: int, track: pd.Series[float]) -> str:
    """The object of a track: that of the test, or another."""
    category = str(track["category"])
    actor = _actor(scene, frame, track)
    return f"something taken for a {category}" if actor is None else _called(actor)


def _actor(scene: Scene, frame: int, track: pd.Series[float]) -> pd.Series[float] | None:
    """The actor that a track is of; None where there is none near."""
    actors = scene.rows("actor", frame)
    actors = actors[actors["category"] == track["category"]]
    here = np.array([track["x_m"], track["y_m"]], dtype=np.float64)
    distance = np.hypot(*(actors[["x_m", "y_m"]].to_numpy(np.float64) - here).T)
    if not len(distance) or distance.min() > _SAME_OBJECT_M:
        return None
    return actors.iloc[int(np.argmin(distance))]


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


def _in_emergency(scene: Scene) -> BoolArray:
    """(F,) frames in which the emergency brake is on, from each request to its end."""
    on = np.zeros(len(scene), dtype=np.bool_)
    since: int | None = None
    for time, label in zip(scene.events["time_s"], scene.events["label"], strict=True):
        frame = scene.frame_at(float(time))
        if label == "predicted_collision" and since is None:
            since = frame
        elif label == "end_unexpected" and since is not None:
            on[since:frame], since = True, None
    if since is not None:
        on[since:] = True
    return on


def _slowing(scene: Scene, run: Run, setting: Setting | None) -> Slowing | None:
    """The greatest loss of speed between two frames without an emergency brake; None where it is none."""
    speed = scene.ego["speed_mps"].abs().to_numpy(np.float64, copy=True)
    emergency = _in_emergency(scene)
    if run["collided"]:  # the instant of the contact may see the other push the ego
        speed[-1] = speed[max(len(speed) - 2, 0)]
    best = (SLOWED_KMH / MPS_TO_KMH, -1, -1)
    start = 0
    for frame in range(len(scene)):
        if frame and emergency[frame - 1]:
            start = frame
        if speed[frame] >= speed[start]:
            start = frame
        if (drop := float(speed[start] - speed[frame])) > best[0]:
            best = (drop, start, frame)
    _, first, last = best
    if first < 0:
        return None
    if speed[last] < STANDING_MPS:
        last = first + int(np.argmax(speed[first:] < STANDING_MPS))
    ego = scene.ego.iloc[first : last + 1]
    backwards = ego["speed_mps"].to_numpy(np.float64) < 0.0
    decel = np.nan_to_num(np.where(backwards, 1.0, -1.0) * ego["accel_mps2"].to_numpy(np.float64))
    hardest = first + int(np.argmax(decel))
    # whatever it stands behind in the end; else what it braked for the hardest
    meant = last if speed[last] < STANDING_MPS else hardest
    order = sorted(range(first, last + 1), key=lambda frame: abs(frame - meant))
    leads = (_lead(scene, frame, run, setting) for frame in order[:_STAYED_EVERY])
    cause, why, in_lane = next((lead for lead in leads if lead[0]), ("", "", False))
    return Slowing(
        first, last, float(speed[first]), float(speed[last]), float(decel.max()), cause, why, in_lane
    )


def _lead(scene: Scene, frame: int, run: Run, setting: Setting | None) -> tuple[str, str, bool]:
    """What the speed is adapted to in a frame: object and place, why it counts, whether it is in the lane.

    The texts are empty where there is no such object. Without the strategy it is the nearest track ahead.
    """
    tracks = scene.rows("track", frame)
    if run["strategy"] == NO_BRAKING or tracks.empty:
        return "", "", False
    ego = scene.ego_state(frame)
    boxes, category = boxes_in(tracks), tracks["category"].to_numpy(np.str_)
    ahead = ego_extent(boxes, ego)[0] - ego.length_m / 2
    counts = ahead > 0.0
    if scene.strategy is not None:
        threat = (tracks["label"] == "threat").to_numpy()
        counts &= scene.strategy.at(ego).relevance(boxes, category).on_way
        counts &= ~(threat & is_vulnerable(category))
    if not counts.any():
        return "", "", False
    nearest = int(np.argmin(np.where(counts, ahead, math.inf)))
    track = tracks.iloc[nearest]
    place = _place(setting, boxes.center_m[[nearest]])
    stay = _stay(scene, frame, track, setting) or place
    cause = _name(scene, frame, track) + (f", {stay}" if stay else "")
    why = f"The ego keeps its distance to it, {ahead[nearest]:.1f} m ahead"
    if place == _IN_LANE:
        return cause, f"{why}.", True
    why += ", as if it were in its way." if scene.strategy is not None else ", or to another object."
    if setting is not None and scene.strategy is not None and scene.strategy.name == "rectangular":
        half = setting.preset.rectangular.half_width_m
        why += f" It is inside the rectangle, up to {half:g} m to each side, which knows no lanes."
    return cause, why, False


def _stay(scene: Scene, frame: int, track: pd.Series[float], setting: Setting | None) -> str:
    """Where the object of a track stayed, or where it was then if it was elsewhere at other times."""
    actor = _actor(scene, frame, track)
    if setting is None or actor is None:
        return ""
    here = np.array([[actor["x_m"], actor["y_m"]]], dtype=np.float64)
    who = "who" if is_vulnerable(np.array([str(actor["category"])], dtype=np.str_))[0] else "which"
    own = scene.objects["actor"]
    own = own[(own["id"] == actor["id"]) & (own["frame"] % _STAYED_EVERY == 0)]
    centers: FloatArray = own[["x_m", "y_m"]].to_numpy(np.float64)
    places = {_place(setting, centers[[k]]) for k in range(len(centers))}
    now = _place(setting, here)
    return f"{who} stayed {now}" if places == {now} else f"{who} was {now} then"


def _who_was_hit(scene: Scene) -> str:
    """The actor nearest to the ego at the end."""
    last = len(scene) - 1
    actors = scene.rows("actor", last)
    if actors.empty:
        return "an object"
    ego, boxes = boxes_in(scene.ego.iloc[[last]]), boxes_in(actors)
    gaps = signed_gap(ego.center_m, ego.size_m, ego.yaw_rad, boxes.center_m, boxes.size_m, boxes.yaw_rad)
    return _called(actors.iloc[int(np.argmin(gaps))])


def _called(actor: pd.Series[float]) -> str:
    """An actor in words."""
    owner = "the target" if str(actor["label"]) == "target" else "another"
    return f"{owner} {actor['category']}"


def _story(
    scene: Scene, run: Run, triggers: list[Trigger], slowing: Slowing | None, hit: str
) -> tuple[str, ...]:
    """What is happening, frame by frame."""
    by_frame: dict[int, list[str]] = {}
    for time, label in zip(scene.events["time_s"], scene.events["label"], strict=True):
        by_frame.setdefault(scene.frame_at(float(time)), []).append(str(label))
    waiting = iter(triggers)
    trigger: Trigger | None = None
    alert = False
    idle = "Follows its lane."
    object_ahead = slowing.cause if slowing and slowing.cause else ""
    adapts = "Slows without an emergency" + (f" for {object_ahead}." if object_ahead else ".")
    waits = "Stands without an emergency" + (f" behind {object_ahead}." if object_ahead else ".")
    texts: list[str] = []
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
            texts.append("Alert, not braking: the forecast of a pedestrian or cyclist enters the ego's way.")
        elif abs(speed) < STANDING_MPS and texts and texts[-1] in (adapts, waits):
            texts.append(waits)
        elif accel * math.copysign(1.0, speed) < -_STEADY_MPS2:
            texts.append(adapts)
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
