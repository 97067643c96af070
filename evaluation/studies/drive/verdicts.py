"""What can be said of a request on a recorded drive, which went on as it was driven.

The vehicle was not braked, so that only the recording's own future can judge. A request is a *false
activation* where until the horizon's end the driver did not brake hard and no labelled road user entered the
way that the vehicle was yet to sweep. All else is *undecided*: a collision may have been avoided by who was
there, and what is not recorded is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from scenarios.brakes import BrakeConfig, stop_time_s
from scenarios.recorded.motion import ObjectMotion, RecordedMotion, boxes_at
from smartmot.area import is_vulnerable
from smartmot.decision.rules import STANDING_MPS
from smartmot.geometry import corners, to_frame
from smartmot.types import BoolArray, Boxes, FloatArray

FALSE, UNDECIDED, STANDING = "false activation", "undecided", "standing"
"""Verdicts. Of a vehicle that stands or reverses a request asks nothing."""

HARD_MPS2 = 3.0
"""Who brakes harder may do so for danger: nine of ten drivers brake with more than 3.4 m/s2 for an unexpected
object (D. B. Fambro et al., NCHRP report 400, 1997; AASHTO, Geometric Design of Highways and Streets)."""

WALKS_MPS = 1.4
"""A person whose labels end may go anywhere at this speed: comfortable gait of adults, 1.27 to 1.46 m/s (R.
W. Bohannon, Age and Ageing 26 (1997) 15)."""

STEP_S = 0.05
"""Outlines are laid so densely: at 60 m/s a car's still overlap."""

GONE_S = 1.0
"""Objects whose labels ended so shortly before a request may still be what it is for: sensors have a latency,
and tracks are carried on where nothing is seen any more (assumed)."""

_SAME_S, _SAME_MPS2 = 1e-6, 1e-6

Polygons = NDArray[np.object_]


class _Swept(NamedTuple):
    """T outlines that the vehicle was yet to cover.

    Attributes:
        outlines: (T,) polygons.
        bounds_m: (4,) what bounds them: left, low, right, high.
        tree: of the outlines.
    """

    outlines: Polygons
    bounds_m: FloatArray
    tree: shapely.STRtree


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the recording says of a request.

    Args:
        verdict: `FALSE`, `UNDECIDED` or `STANDING`.
        reason: why it is not the first.
        object_id: label that entered, or that ends too early; None: none did.
        category: of it.
        decel_mps2: hardest braking of the recorded vehicle until the horizon's end; None: too short to say.
        gap_recorded_m: least distance to a labelled object that is not behind, as driven; None without.
        gap_braked_m: the same if the vehicle had braked, the others as recorded.
        gap_behind_m: least distance to those behind if it had braked.
        stop_s: time that the brakes need to standstill.
        covers_stop: whether the recording goes on until then.
    """

    verdict: str
    reason: str
    object_id: int | None
    category: str
    decel_mps2: float | None
    gap_recorded_m: float | None
    gap_braked_m: float | None
    gap_behind_m: float | None
    stop_s: float
    covers_stop: bool


def judge(
    motion: RecordedMotion,
    time_s: float,
    speed_mps: float,
    horizon_s: float,
    brakes: BrakeConfig,
    decel_mps2: float | None = None,
) -> Verdict:
    """The verdict on a request.

    Args:
        motion: the recording.
        time_s: when the request came.
        speed_mps: of the vehicle then, negative in reverse.
        horizon_s: how far ahead the decision looked.
        brakes: that would have braked.
        decel_mps2: of a partial brake; None: full.
    """
    if speed_mps < STANDING_MPS:
        return Verdict(STANDING, "the ego stands", None, "", None, None, None, None, 0.0, True)
    ego, end_s = motion.ego, time_s + horizon_s
    known_s = min(end_s, ego.end_s)
    times = _grid(time_s, known_s)
    braked = ego.accel_mps2(times)
    hardest = None if np.isnan(braked).all() else max(-float(np.nanmin(braked)), 0.0)
    stop_s = stop_time_s(brakes, speed_mps, decel_mps2)
    covers_stop = time_s + stop_s <= ego.end_s + _SAME_S
    last_s = max(known_s, min(time_s + stop_s, ego.end_s))
    around = [] if motion.labels is None else motion.labels.between(time_s, last_s)
    gone = [] if motion.labels is None else motion.labels.between(time_s - GONE_S, last_s)
    driven = ego.boxes(times)
    outlines = _polygons(driven)
    swept = _Swept(outlines, shapely.total_bounds(outlines), shapely.STRtree(outlines))
    entered = next((o for o in around if _enters(o, times, swept)), None)
    vanished = next((o for o in gone if _may_enter(o, times, swept)), None) if entered is None else None
    reason = ""
    if motion.labels is None:
        reason = "no labels"
    elif entered is not None:
        reason = "entered"
    elif hardest is not None and hardest >= HARD_MPS2 - _SAME_MPS2:
        reason = "driver braked"
    elif ego.end_s < end_s - _SAME_S:
        reason = "recording ends"
    elif vanished is not None:
        reason = "labels end"
    at, distance_m = _braked(brakes, time_s, speed_mps, stop_s, ego.end_s, decel_mps2)
    ahead, behind = _sides(around, driven, time_s)
    would_be = ego.ahead(time_s, distance_m)
    who = {"entered": entered, "labels end": vanished}.get(reason)
    return Verdict(
        UNDECIDED if reason else FALSE,
        reason,
        None if who is None else who.object_id,
        "" if who is None else who.category,
        hardest,
        _least_gap(ahead, times, driven),
        _least_gap(ahead, at, would_be),
        _least_gap(behind, at, would_be),
        stop_s,
        covers_stop,
    )


def _grid(first_s: float, last_s: float) -> FloatArray:
    """(T,) times of a span, both ends included, at most `STEP_S` apart."""
    return np.linspace(first_s, last_s, max(math.ceil((last_s - first_s) / STEP_S - _SAME_S), 1) + 1)


def _polygons(boxes: Boxes) -> Polygons:
    """(N,) polygons of boxes."""
    made: Any = shapely.polygons(corners(boxes.center_m, boxes.size_m, boxes.yaw_rad))
    polygons: Polygons = made
    return polygons


def _labelled(o: ObjectMotion, times: FloatArray) -> BoolArray:
    """(T,) times between the first and the last label."""
    inside: BoolArray = (times >= o.time_s[0] - _SAME_S) & (times <= o.time_s[-1] + _SAME_S)
    return inside


def _enters(o: ObjectMotion, times: FloatArray, swept: _Swept) -> bool:
    """Whether an object is at some time where the vehicle's outline is then or later."""
    if _apart(o.bounds_m, swept.bounds_m) > 0.0:
        return False
    inside = np.flatnonzero(_labelled(o, times))
    if not len(inside):
        return False
    boxes = o.boxes(times[inside])
    if not _comes_near(boxes, swept, 0.0):
        return False
    place, outline = swept.tree.query(_polygons(boxes), predicate="intersects")
    return bool((outline >= inside[place]).any())


def _apart(a_m: FloatArray, b_m: FloatArray) -> float:
    """Free distance of two upright rectangles, each left, low, right, high; 0 where they meet."""
    (left, low, right, high), (b_left, b_low, b_right, b_high) = a_m.tolist(), b_m.tolist()
    return math.hypot(max(left - b_right, b_left - right, 0.0), max(low - b_high, b_low - high, 0.0))


def _comes_near(boxes: Boxes, swept: _Swept, reach_m: float) -> bool:
    """Whether one of the boxes may be as near to one of the outlines: a quick test that misses none."""
    left, low, right, high = swept.bounds_m.tolist()
    out = np.maximum(np.array([left, low]) - boxes.center_m, boxes.center_m - np.array([right, high]))
    return bool((out.max(axis=1) <= reach_m + 0.5 * np.hypot(*boxes.size_m.T)).any())


def _may_enter(o: ObjectMotion, times: FloatArray, swept: _Swept) -> bool:
    """Whether an object whose labels end may go where the vehicle's outline is later.

    Whoever it is may keep the last velocity; persons may also go anywhere at walking pace.
    """
    last_s = float(o.time_s[-1])
    after = np.flatnonzero(times > last_s + _SAME_S)
    if not len(after):
        return False
    boxes, gone_s = o.boxes(times[after]), times[after] - last_s
    moved = Boxes(boxes.center_m + gone_s[:, None] * o.velocity_mps, boxes.size_m, boxes.yaw_rad)
    vulnerable = bool(is_vulnerable(np.array([o.category]))[0])
    reach_m = WALKS_MPS * gone_s if vulnerable else np.zeros(len(gone_s))
    later = np.arange(len(swept.outlines)) >= after[:, None]

    def reached(places: Boxes) -> bool:
        apart_m = shapely.distance(_polygons(places)[:, None], swept.outlines[None, :])
        return bool((later & (apart_m <= reach_m[:, None])).any())

    # a person may also turn round where they were last seen
    return any(
        _comes_near(places, swept, float(reach_m[-1])) and reached(places)
        for places in ((moved, boxes) if vulnerable else (moved,))
    )


def _braked(
    brakes: BrakeConfig,
    time_s: float,
    speed_mps: float,
    stop_s: float,
    end_s: float,
    decel_mps2: float | None,
) -> tuple[FloatArray, FloatArray]:
    """(T,) times until standstill or the recording's end, and how far the braked vehicle would have come."""
    times = _grid(time_s, max(min(time_s + stop_s, end_s), time_s))
    stage = brakes.requested(decel_mps2)
    distance = [brakes.travel(speed_mps, 0.0, t, stage)[0] for t in (times - time_s).tolist()]
    return times, np.array(distance)


def _sides(
    around: list[ObjectMotion], ego: Boxes, time_s: float
) -> tuple[list[ObjectMotion], list[ObjectMotion]]:
    """Objects that are not behind the vehicle at the request, and those that are."""
    x, y = ego.center_m[0].tolist()
    rear = -0.5 * float(ego.size_m[0, 0])
    boxes = boxes_at(around, time_s)
    rings = corners(boxes.center_m, boxes.size_m, boxes.yaw_rad)
    behind = to_frame(rings, x, y, float(ego.yaw_rad[0]))[..., 0].max(axis=1) < rear
    sides = list(zip(around, behind.tolist(), strict=True))
    return [o for o, is_behind in sides if not is_behind], [o for o, is_behind in sides if is_behind]


def _least_gap(objects: list[ObjectMotion], times: FloatArray, vehicle: Boxes) -> float | None:
    """Least distance between the vehicle's outline and objects at the same times; None without any."""
    outlines = _polygons(vehicle)
    around_m = shapely.total_bounds(outlines)
    bounds_m = [_apart(o.bounds_m, around_m) for o in objects]
    least = math.inf
    for k in np.argsort(bounds_m, kind="stable").tolist():
        if bounds_m[k] >= least:
            break  # nowhere on its way was it as near
        inside = _labelled(objects[k], times)
        if inside.any():
            boxes = objects[k].boxes(times[inside])
            least = min(least, float(shapely.distance(_polygons(boxes), outlines[inside]).min()))
    return None if math.isinf(least) else least
