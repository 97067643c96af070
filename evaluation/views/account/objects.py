"""Objects in words: whose track it is, what it is called, and where it is or stayed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evaluation.runs.folder import RunSetup
from evaluation.views.frames import LogFrames, boxes_in
from smartmot.area import is_vulnerable
from smartmot.geometry import signed_gap
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

SAME_OBJECT_M = 2.0
"""A track belongs to the actor of its category that is nearest and no farther than this."""

IN_LANE = "in the ego's lane"

STAYED_EVERY = 10
"""Frames from one look at where an object is to the next: half a second."""

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


def centers_of(rows: pd.DataFrame) -> FloatArray:
    """(N, 2) centres in rows of a log, map frame, metres."""
    centers: FloatArray = rows[["x_m", "y_m"]].to_numpy(np.float64)
    return centers


def center_of(row: pd.Series[float]) -> FloatArray:
    """(1, 2) centre in one row of a log, map frame, metres."""
    return np.array([[row["x_m"], row["y_m"]]], dtype=np.float64)


def place_of(setup: RunSetup, center_m: FloatArray) -> str:
    """Where a point (1, 2) is, in words; nothing without a map."""
    if setup.network is None or setup.route is None:
        return ""
    lanes = setup.network.locate(center_m).lane.tolist()
    if set(lanes) & set(setup.route.lanes):
        return IN_LANE
    types = {str(setup.network.lanes.lane_type[lane]) for lane in lanes}
    return next((words for name, words in _LANE_WORDS.items() if name in types), "off the road")


def actor_of(frames: LogFrames, frame: int, track: pd.Series[float]) -> pd.Series[float] | None:
    """The actor that a track is of; None where there is none near."""
    actors = frames.rows("actor", frame)
    actors = actors[actors["category"] == track["category"]]
    distance = np.hypot(*(centers_of(actors) - center_of(track)).T)
    if not len(distance) or distance.min() > SAME_OBJECT_M:
        return None
    return actors.iloc[int(np.argmin(distance))]


def name_of_track(frames: LogFrames, frame: int, track: pd.Series[float]) -> str:
    """The object of a track: that of the test, or another."""
    actor = actor_of(frames, frame, track)
    return f"something taken for a {track['category']}" if actor is None else name_of_actor(actor)


def name_of_actor(actor: pd.Series[float]) -> str:
    """An actor in words."""
    owner = "the target" if str(actor["label"]) == "target" else "another"
    return f"{owner} {actor['category']}"


def nearest_at_end(frames: LogFrames) -> str:
    """The actor nearest to the ego at the end, in words."""
    last = len(frames) - 1
    actors = frames.rows("actor", last)
    if actors.empty:
        return "an object"
    ego, boxes = boxes_in(frames.ego.iloc[[last]]), boxes_in(actors)
    gaps = signed_gap(ego.center_m, ego.size_m, ego.yaw_rad, boxes.center_m, boxes.size_m, boxes.yaw_rad)
    return name_of_actor(actors.iloc[int(np.argmin(gaps))])


def stay_of(frames: LogFrames, frame: int, track: pd.Series[float], setup: RunSetup) -> str:
    """Where the object of a track stayed, or where it was then if it was elsewhere at other times."""
    actor = actor_of(frames, frame, track)
    now = "" if actor is None else place_of(setup, center_of(actor))
    if actor is None or not now:
        return ""
    pronoun = "who" if is_vulnerable(np.array([str(actor["category"])], dtype=np.str_))[0] else "which"
    actors = frames.objects["actor"]
    centers = centers_of(actors[(actors["id"] == actor["id"]) & (actors["frame"] % STAYED_EVERY == 0)])
    places = {place_of(setup, center[None]) for center in centers}
    return f"{pronoun} stayed {now}" if places == {now} else f"{pronoun} was {now} then"
