"""What a stream brought, counted; nothing is lost silently."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace


@dataclass(slots=True)
class Counts:
    """Numbers since the start.

    Args:
        frames: messages of detections.
        tracked: frames that the tracker saw.
        decided: frames with a decision, that is with a pose.
        boxes: boxes of all frames.
        tracks: tracks so far.
        requests: emergency requests so far.
        rejected: boxes that are impossible or have no score in [0, 1].
        without_score: those of them that have no score in [0, 1] and are possible.
        other_classes: boxes of classes that are no road users.
        unknown_classes: boxes of classes that the data set does not have, by name.
        under_threshold: boxes with a score under the tracker's threshold.
        late: frames not newer than the one before; the tracker did not see them.
        without_pose: frames without a pose of the vehicle near enough.
        carried: frames with the last pose carried on.
        unstamped: frames with an empty header; their time of receipt counted.
        unnamed: frames of a sensor that no header has named.
        without_transform: frames whose sensor was taken to be at the vehicle's origin, by its name.
        off_map: frames more than a lane's width beside the map's driving lanes.
        restarts: how often time went back, and all was begun anew.
        other_messages: messages that perception has no use for.
    """

    frames: int = 0
    tracked: int = 0
    decided: int = 0
    boxes: int = 0
    tracks: int = 0
    requests: int = 0
    rejected: int = 0
    without_score: int = 0
    other_classes: int = 0
    unknown_classes: Counter[str] = field(default_factory=Counter)
    under_threshold: int = 0
    late: int = 0
    without_pose: int = 0
    carried: int = 0
    unstamped: int = 0
    unnamed: int = 0
    without_transform: Counter[str] = field(default_factory=Counter)
    off_map: int = 0
    restarts: int = 0
    other_messages: int = 0

    @property
    def nowhere_on_map(self) -> bool:
        """Whether frames were decided on, and all of them were off the map."""
        return 0 < self.decided == self.off_map


OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""


@dataclass(frozen=True, slots=True)
class Diagnostics:
    """One diagnostic_msgs/DiagnosticStatus.

    Args:
        stamp_ns: when.
        level: `OK`, `WARN` or `ERROR`.
        message: what is wrong since the status before.
        values: names and numbers since the start.
    """

    stamp_ns: int
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class DiagnosticWatch:
    """Makes a status from the counts: what has changed for the worse since the last one decides the level."""

    def __init__(self) -> None:
        self._before = Counts()

    def status(self, counts: Counts, stamp_ns: int) -> Diagnostics:
        """The status now."""
        before = self._before
        unknown = sum(counts.unknown_classes.values())
        frames = counts.frames - before.frames
        missing = counts.without_pose - before.without_pose
        new = (
            ("frames late", counts.late - before.late),
            ("frames without pose", missing),
            ("frames with a pose carried on", counts.carried - before.carried),
            ("frames off the map", counts.off_map - before.off_map),
            ("boxes rejected", counts.rejected - before.rejected),
            ("boxes of unknown classes", unknown - sum(before.unknown_classes.values())),
            ("times time went back", counts.restarts - before.restarts),
        )
        wrong = [f"{what}: {number}" for what, number in new if number]
        if counts.nowhere_on_map:
            wrong.append("no frame so far is on the map; is it in the frame of the odometry?")
        failed = counts.nowhere_on_map or (frames and missing == frames)
        level = ERROR if failed else WARN if wrong or not frames else OK
        values = {
            "frames": counts.frames,
            "frames tracked": counts.tracked,
            "frames decided on": counts.decided,
            "frames late": counts.late,
            "frames without pose": counts.without_pose,
            "frames with a pose carried on": counts.carried,
            "frames without stamp": counts.unstamped,
            "frames of a sensor without a name": counts.unnamed,
            "frames off the map": counts.off_map,
            "times time went back": counts.restarts,
            "boxes": counts.boxes,
            "frames of a sensor without a transform": counts.without_transform.total(),
            "boxes rejected": counts.rejected,
            "boxes of unknown classes": unknown,
            "boxes of other classes": counts.other_classes,
            "boxes under the score threshold": counts.under_threshold,
            "tracks": counts.tracks,
            "emergency requests": counts.requests,
        }
        self._before = _copied(counts)
        text = "no frames" if not frames else ", ".join(wrong) or "all well"
        return Diagnostics(
            stamp_ns, level, text, tuple((name, str(number)) for name, number in values.items())
        )


def _copied(counts: Counts) -> Counts:
    return replace(counts, unknown_classes=Counter(counts.unknown_classes))
