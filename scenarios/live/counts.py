"""What a stream brought, counted; nothing is lost silently."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields


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
        late: frames not newer than the one before; of several detectors those older than the newest by more
            than the tracker waits. The tracker did not see them.
        behind: frames of several detectors that came after a newer one; taken in at their time.
        repeated: frames of a time that the same one of several detectors had reported already; left out.
        early: frames of several detectors, far ahead of all others, as by a wrong clock; left out.
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
    behind: int = 0
    repeated: int = 0
    early: int = 0
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


def summed(parts: Iterable[Counts]) -> Counts:
    """All numbers of several parts, such as detectors, together."""
    total = Counts()
    for part in parts:
        for item in fields(Counts):
            setattr(total, item.name, getattr(total, item.name) + getattr(part, item.name))
    return total


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
        self._frames_before: dict[str, int] = {}

    def status(self, counts: Counts, stamp_ns: int, detectors: Mapping[str, Counts]) -> Diagnostics:
        """The status now.

        Args:
            counts: of all together.
            stamp_ns: now.
            detectors: of each of several detectors, by name; empty: there is one.
        """
        before = self._before
        unknown = counts.unknown_classes.total()
        frames = counts.frames - before.frames
        missing = counts.without_pose - before.without_pose
        new = (
            ("frames late", counts.late - before.late),
            ("frames without pose", missing),
            ("frames with a pose carried on", counts.carried - before.carried),
            ("frames off the map", counts.off_map - before.off_map),
            ("frames repeated", counts.repeated - before.repeated),
            ("frames far ahead of all others", counts.early - before.early),
            ("boxes rejected", counts.rejected - before.rejected),
            ("boxes of unknown classes", unknown - before.unknown_classes.total()),
            ("times time went back", counts.restarts - before.restarts),
        )
        wrong = [f"{what}: {number}" for what, number in new if number]
        silent = [name for name, own in detectors.items() if own.frames == self._frames_before.get(name, 0)]
        wrong += [f"no frames of {name}" for name in silent]
        if counts.nowhere_on_map:
            wrong.append("no frame so far is on the map; is it in the frame of the odometry?")
        failed = counts.nowhere_on_map or (frames and missing == frames)
        level = ERROR if failed else WARN if wrong or not frames else OK
        values = _values(counts) | {
            f"{name}: {what}": number
            for name, own in detectors.items()
            for what, number in _values_of_detector(own).items()
        }
        self._before = summed([counts])
        self._frames_before = {name: own.frames for name, own in detectors.items()}
        text = "no frames" if not frames else ", ".join(wrong) or "all well"
        return Diagnostics(
            stamp_ns, level, text, tuple((name, str(number)) for name, number in values.items())
        )


def _values(counts: Counts) -> dict[str, int]:
    """Names and numbers of a status."""
    return {
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
        "boxes of unknown classes": counts.unknown_classes.total(),
        "boxes of other classes": counts.other_classes,
        "boxes under the score threshold": counts.under_threshold,
        "tracks": counts.tracks,
        "emergency requests": counts.requests,
    }


def _values_of_detector(counts: Counts) -> dict[str, int]:
    """Names and numbers of one of several detectors."""
    return {
        "frames": counts.frames,
        "frames tracked": counts.tracked,
        "frames behind a newer one": counts.behind,
        "frames late": counts.late,
        "frames repeated": counts.repeated,
        "frames far ahead of all others": counts.early,
        "frames without pose": counts.without_pose,
        "boxes": counts.boxes,
        "boxes rejected": counts.rejected,
        "boxes of unknown classes": counts.unknown_classes.total(),
        "boxes of other classes": counts.other_classes,
        "boxes under the score threshold": counts.under_threshold,
    }
