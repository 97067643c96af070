"""Several detectors of one stream into one tracker: what belongs to each, and the tracks of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from scenarios.errors import ScenarioError
from scenarios.live.counts import Counts
from scenarios.live.detectors import LiveDetector
from smartmot.path import PlannedPath
from smartmot.pipeline import Pipeline, PipelineConfig
from smartmot.tracking.fusion.fused import FusedTracker, LeftOut
from smartmot.tracking.settings import TrackerConfig
from smartmot.types import Detections, EgoState, Tracks

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class MadeTracks:
    """Tracks that are made already, in the place of a tracker (`smartmot.tracking.own.ObjectTracker`).

    Args:
        tracks: what it returns for the detections of their time.
    """

    tracks: Tracks

    def update(self, detections: Detections, /) -> Tracks:
        """The tracks."""
        return self.tracks


class Fusion:
    """The tracker of several detectors, in a stream.

    Args:
        detectors: each with a name of its own.
        config: whose tracker it is.

    Raises:
        ScenarioError: the tracker is the user's own.
        smartmot.errors.ConfigError: a setting is out of range.

    Attributes:
        buffer_ns: a measurement that is older than the newest by more is too late.
    """

    def __init__(self, detectors: Sequence[LiveDetector], config: PipelineConfig) -> None:
        if not isinstance(config.tracker, TrackerConfig):
            raise ScenarioError("detectors: several go into our tracker; one of your own takes one topic")
        self._tracker = FusedTracker(config.tracker, {each.name: each.profile for each in detectors})
        self._counted = {each.name: LeftOut() for each in detectors}
        self.buffer_ns = round(self._tracker.buffer_s / _NS)

    def begin(self, next_id: int) -> None:
        """Forget all tracks; identifiers go on with a number."""
        self._tracker.reset(next_id)
        self._counted = {name: LeftOut() for name in self._counted}

    @property
    def next_id(self) -> int:
        """Identifier of the next track."""
        return self._tracker.state.tracker.next_id

    @property
    def is_waiting(self) -> bool:
        """Whether measurements far ahead of all others wait for another one to confirm their time."""
        return self._tracker.waiting > 0

    def at(self, stamp_s: float) -> Tracks | None:
        """The tracks as they are now known to have been at a measurement's time."""
        return self._tracker.at(stamp_s)

    def track(
        self,
        pipeline: Pipeline,
        detections: Detections,
        ego: EgoState,
        path: PlannedPath | None,
        counts: Mapping[str, Counts],
    ) -> Tracks | None:
        """Take in a measurement, and count what is left out.

        Args:
            pipeline: whose monitored area holds.
            detections: of one of the detectors, with its name.
            ego: the vehicle at their time.
            path: where it goes, as for `Pipeline.step`.
            counts: by detector, where to count.

        Returns:
            The tracks at the newest time of all measurements; None: this one is left out, or it waits until
            another one confirms its time.
        """
        area, waiting = pipeline.area(ego, path), self._tracker.waiting
        if pipeline.config.filter_detections:
            detections = detections[area.kept(detections.boxes, detections.category)]
        kept = area.kept if pipeline.config.filter_tracks else None
        tracks = self._tracker.update(detections, kept)
        is_taken = self._tracker.waiting <= waiting
        for name, now in self._tracker.left_out.items():
            before, number = self._counted[name], counts[name]
            number.late += now.too_late - before.too_late
            number.repeated += now.repeated - before.repeated
            number.early += now.too_early - before.too_early
            number.under_threshold += now.dropped - before.dropped
            if (
                name == detections.detector
                and now.repeated + now.too_late > before.repeated + before.too_late
            ):
                is_taken = False
            self._counted[name] = replace(now)
        return tracks if is_taken else None
