"""What perception publishes, as values: tracks, decision, and markers to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.ros.frames.transforms import placed
from scenarios.sources.requests import Request
from smartmot.area.monitored import MonitoredArea, ego_extent
from smartmot.types import BoolArray, EgoState, FloatArray, IntArray, StrArray, Tracks

AHEAD_S = 2.0
"""Arrows end where a mover is after this time at constant velocity (PREMOVE, section 4.1)."""
LIFETIME_FRAMES = 2
"""Markers vanish after so many frames without news."""
LABEL_ABOVE_M = 0.5
"""Text stands so far above its box (ours)."""
LABEL_HEIGHT_M = 0.8
ARROW_M = (0.15, 0.35, 0.4)
"""Diameters of an arrow's shaft and head, and length of the head (ours)."""
LINE_M = 0.1
"""Width of the lines around a monitored area (ours)."""

CUBE, ARROW, LINE_STRIP, TEXT = 1, 0, 4, 9
"""Types of visualization_msgs/Marker."""
ADD, DELETE = 0, 2
"""Actions of visualization_msgs/Marker."""

_COLOURS = {
    "car": (0.12, 0.47, 0.71),
    "pedestrian": (0.84, 0.15, 0.16),
    "cyclist": (1.0, 0.5, 0.05),
    "truck": (0.17, 0.63, 0.17),
    "motorcycle": (0.58, 0.4, 0.74),
    "unknown": (0.5, 0.5, 0.5),
}
_WHITE, _AREA = (1.0, 1.0, 1.0), (0.1, 0.7, 0.3)
_SOLID, _BOX = 1.0, 0.6
"""Opacity of lines, arrows and text, and of boxes, through which the cloud is seen (ours)."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedBoxes:
    """M tracks as boxes with height, in the frame that they are published in.

    Args:
        track_id: (M,) identifiers.
        category: (M,) names out of `smartmot.types.CATEGORIES`.
        score: (M,) of the last matched detection.
        center_m: (M, 3) middles.
        size_m: (M, 3) length, width and height.
        yaw_rad: (M,) headings about z.
        velocity_mps: (M, 2) over ground, along the frame's axes.
        dynamic: (M,) whether they move.
        existence: (M,) probability that there is an object; None: the tracker does not tell.
    """

    track_id: IntArray
    category: StrArray
    score: FloatArray
    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    dynamic: BoolArray
    existence: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.track_id)

    def seen_from(self, dst_SE3_src: FloatArray) -> TrackedBoxes:
        """The same boxes in another frame."""
        turn = dst_SE3_src[:3, :3]
        ahead = np.column_stack((np.cos(self.yaw_rad), np.sin(self.yaw_rad)))
        ahead = ahead @ turn[:2, :2].T
        return TrackedBoxes(
            self.track_id,
            self.category,
            self.score,
            placed(dst_SE3_src, self.center_m),
            self.size_m,
            np.arctan2(ahead[:, 1], ahead[:, 0]),
            self.velocity_mps @ turn[:2, :2].T,
            self.dynamic,
            self.existence,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What is decided on a frame; there is none without a pose of the vehicle.

    Args:
        predicted_collision: whether the emergency brake is requested.
        nearest_m: free distance from the vehicle's front to the nearest object in its way or on a collision
            course with it; None: there is none.
        area: outlines of the monitored area: roles, and (P, 3) rings in the frame of the tracks.
        requests: emergency requests and warnings that begin with this frame.
    """

    predicted_collision: bool
    nearest_m: float | None
    area: tuple[tuple[str, FloatArray], ...]
    requests: tuple[Request, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """One visualization_msgs/Marker.

    Args:
        ns: namespace; with `marker_id` the identity of what is shown.
        marker_id: number in it.
        kind: `CUBE`, `ARROW`, `LINE_STRIP` or `TEXT`.
        action: `ADD`, which changes it as well, or `DELETE`.
        position_m: (3,) of its middle.
        yaw_rad: about z.
        scale_m: (3,) as the kind has it.
        colour: red, green, blue and opacity, 0 to 1.
        points_m: (P, 3) of arrows and lines.
        text: of text.
        lifetime_s: after which it vanishes without news.
    """

    ns: str
    marker_id: int
    kind: int
    action: int = ADD
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    scale_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    points_m: tuple[tuple[float, float, float], ...] = ()
    text: str = ""
    lifetime_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class FrameOutput:
    """What is published for one frame of detections.

    Args:
        stamp_ns: of the detections; the time of receipt where their header had none.
        received_ns: when the detections were received.
        frame_id: frame of tracks, markers and area.
        tracks: all that are alive.
        markers: of the tracks.
        decision: None without a pose of the vehicle.
        area_markers: of the monitored area; empty without a decision.
    """

    stamp_ns: int
    received_ns: int
    frame_id: str
    tracks: TrackedBoxes
    markers: tuple[Marker, ...]
    decision: Decision | None
    area_markers: tuple[Marker, ...]


class MarkerBoard:
    """Remembers what is shown, so that what is shown no longer is deleted once and at once."""

    def __init__(self) -> None:
        self._shown: dict[tuple[str, int], int] = {}

    def show(self, markers: Iterable[Marker]) -> tuple[Marker, ...]:
        """The markers, and the deletion of those shown before that are not among them."""
        now = tuple(markers)
        shown = {(marker.ns, marker.marker_id): marker.kind for marker in now}
        gone = [
            Marker(ns, number, kind, DELETE)
            for (ns, number), kind in self._shown.items()
            if (ns, number) not in shown
        ]
        self._shown = shown
        return (*gone, *now)


def track_markers(tracks: TrackedBoxes, lifetime_s: float) -> list[Marker]:
    """A box and a text of every track, and an arrow of those that move.

    The namespace of a box is the track's class; arrows and texts have namespaces of their own, because a
    namespace and a number name one marker. The text has class, score, the probability that there is an object
    where the tracker tells it, and number.
    """
    end = tracks.center_m.copy()
    end[:, :2] += AHEAD_S * tracks.velocity_mps
    top = tracks.center_m[:, 2] + 0.5 * tracks.size_m[:, 2] + LABEL_ABOVE_M
    markers = []
    existence = [""] * len(tracks)
    if tracks.existence is not None:
        existence = [f" p {probability:.2f}" for probability in tracks.existence.tolist()]
    rows = zip(
        tracks.track_id.tolist(),
        tracks.category.tolist(),
        tracks.score.tolist(),
        tracks.center_m.tolist(),
        tracks.size_m.tolist(),
        tracks.yaw_rad.tolist(),
        end.tolist(),
        top.tolist(),
        tracks.dynamic.tolist(),
        existence,
        strict=True,
    )
    for number, name, score, center, size, yaw, tip, label_z, moves, exists in rows:
        colour = _COLOURS[name]
        markers.append(
            Marker(
                name,
                number,
                CUBE,
                position_m=tuple(center),
                yaw_rad=yaw,
                scale_m=tuple(size),
                colour=(*colour, _BOX),
                lifetime_s=lifetime_s,
            )
        )
        markers.append(
            Marker(
                f"{name}/text",
                number,
                TEXT,
                position_m=(center[0], center[1], label_z),
                scale_m=(0.0, 0.0, LABEL_HEIGHT_M),
                colour=(*_WHITE, _SOLID),
                text=f"{name} {score:.2f}{exists} #{number}",
                lifetime_s=lifetime_s,
            )
        )
        if moves:
            markers.append(
                Marker(
                    f"{name}/arrow",
                    number,
                    ARROW,
                    scale_m=ARROW_M,
                    colour=(*colour, _SOLID),
                    points_m=(tuple(center), tuple(tip)),
                    lifetime_s=lifetime_s,
                )
            )
    return markers


def area_markers(area: Sequence[tuple[str, FloatArray]], lifetime_s: float) -> list[Marker]:
    """A closed line around each part of a monitored area; the namespace is its role."""
    return [
        Marker(
            role,
            number,
            LINE_STRIP,
            scale_m=(LINE_M, 0.0, 0.0),
            colour=(*_AREA, _SOLID),
            points_m=tuple(map(tuple, [*ring.tolist(), ring[0].tolist()])),
            lifetime_s=lifetime_s,
        )
        for number, (role, ring) in enumerate(area)
    ]


def new_gaps_m(area: MonitoredArea, tracks: Tracks, ego: EgoState) -> list[float]:
    """Free distances from the vehicle's front to what is in its way and was seen once.

    Of these no motion is known yet, so that no decision rests on them; where they are is known.
    """
    new = (tracks.confirmed & (tracks.age_s <= tracks.coasted_s)).nonzero()[0]
    if not len(new):
        return []
    boxes = tracks.boxes[new]
    gap_m = ego_extent(boxes, ego)[0] - 0.5 * ego.length_m
    shown: list[float] = gap_m[area.relevance(boxes, tracks.category[new]).on_way & (gap_m > 0.0)].tolist()
    return shown
