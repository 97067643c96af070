"""Detections of a run: how many there were, what became of them, and whether perception could use any."""

from __future__ import annotations

from dataclasses import dataclass

from smartmot.errors import PluginError
from smartmot.pipeline import FrameResult
from smartmot.tracking.tracker import ScoreLimits
from smartmot.types import NOTHING_DROPPED, Detections, Dropped

SOME_DETECTIONS = 5
"""A quarter of a second of one object at 20 Hz: if none of so many detections has the score that the tracker
asks for, the fault is the detector's or the threshold's and not that of a single weak detection."""


@dataclass(slots=True)
class DetectionCounts:
    """Detections of a run so far.

    Args:
        kept: those that reached perception.
        before: those that the detector itself had dropped.
        dropped: by the detector and the tracker.
        trackable: those with which a track can start.
        highest: score, as long as no track can start.
    """

    kept: int = 0
    before: Dropped = NOTHING_DROPPED
    dropped: Dropped = NOTHING_DROPPED
    trackable: int = 0
    highest: float = 0.0

    @property
    def reported(self) -> int:
        """All detections that the detector made."""
        return self.kept + self.before.total

    def add(self, detections: Detections, result: FrameResult | None) -> None:
        """Count a frame, and what a pipeline made of it, if one did.

        Args:
            detections: what reached perception.
            result: of a pipeline, which counts its own detections and drops.
        """
        if result is not None:
            detections = result.detections
        self.kept += len(detections)
        if detections.dropped is not NOTHING_DROPPED:
            self.before += detections.dropped
        dropped = detections.dropped if result is None else result.dropped
        if dropped is not NOTHING_DROPPED:
            self.dropped += dropped
        if result is None:
            return
        self.trackable += result.trackable
        if not self.trackable:  # the message names it where there is none
            self.highest = max(self.highest, float(detections.score.max(initial=0.0)))

    def require_scores(self, detector: str, limits: ScoreLimits | None) -> None:
        """Refuse a run in which no detection could start a track: the ego was blind.

        Args:
            detector: its name, for the message.
            limits: scores that the tracker asks for, if it tells them.

        Raises:
            PluginError: so it was.
        """
        outside = self.before.score
        if self.trackable or self.kept + outside < SOME_DETECTIONS:
            return
        least = "" if limits is None else f" of {float(limits.start.min()):g}"
        scores = [f"highest: {self.highest:.3g}"] if self.kept else []
        scores += [f"{outside} outside [0, 1]"] if outside else []
        raise PluginError(
            f"{detector}: none of {self.reported} detections has the score"
            f"{least} that the tracker needs to start a track ({', '.join(scores)}), so that "
            "no object would be seen; scale the detector's scores, or give a tracker with a lower threshold "
            "(--tracker package.module:name)"
        )
