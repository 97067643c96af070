"""One tracker for several detectors, each with its own rate, delay, score scale, noise and trust.

Measurements are taken in at their own time. One that arrives late is put in its place in a bounded buffer,
and those after it are processed again: the result is that of all measurements in order.

How to use it::

    tracker = smartmot.FusedTracker(
        smartmot.tracker_config("default"),
        {"lidar": DetectorProfile("lidar", 10.0), "camera": DetectorProfile("camera", 30.0, trust=0.5)},
    )
    tracks = tracker.update(detections)  # of either; Detections.detector names it
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from smartmot.errors import ConfigError, ShapeError
from smartmot.filters.motion_models import PerCategory, Setting, table
from smartmot.tracking.fusion.weighing import Weighing
from smartmot.tracking.lifecycle import LONGEST_GAP_S
from smartmot.tracking.profile import DetectorProfile
from smartmot.tracking.scores import ScoreScale
from smartmot.tracking.state import TrackerState
from smartmot.tracking.tracker import Monitored, Tracker, TrackerConfig
from smartmot.types import Detections, Tracks

LEAST_BUFFER_S = 1.0
"""Longer than networks, queues and detectors take together; at 30 Hz 30 frames to process again at worst."""

LEAST_AHEAD_S = LONGEST_GAP_S
"""After a pause so long tracks begin anew in any case: waiting for a second measurement then costs little."""

MOST_MEASUREMENTS = 1000
"""Kept at most, whatever their stamps say: 10 s of three detectors at 30 Hz."""


@dataclass(slots=True)
class LeftOut:
    """Of one detector, what was left out, and why.

    Args:
        too_late: Measurements that arrived later than the buffer reaches.
        too_early: Measurements so far ahead of all others that a wrong clock must have stamped them: those
            that came next were of the time before.
        repeated: Measurements that it had already reported for that time.
        dropped: Boxes whose score, relative to its sure ones and times its trust, was under the tracker's
            threshold when they arrived.
        weak: Boxes whose score was too low to start a track that is shown, those dropped included; the others
            follow tracks.
    """

    too_late: int = 0
    too_early: int = 0
    repeated: int = 0
    dropped: int = 0
    weak: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class FusedState:
    """What is known after a measurement.

    Args:
        tracker: Of the tracker.
        scales: Score scales of the detectors that have reported.
    """

    tracker: TrackerState
    scales: Mapping[str, ScoreScale]


@dataclass(slots=True, eq=False)
class _Measurement:
    """A measurement in its place, and what was known after it."""

    stamp_s: float
    place: int
    detections: Detections
    monitored: Monitored | None
    after: FusedState
    tracks: Tracks
    dropped: int
    weak: int

    @property
    def key(self) -> tuple[float, int]:
        """Time, then the detector's place: measurements of one time have one order, however they arrive."""
        return self.stamp_s, self.place


class FusedTracker:
    """Multi-object tracker for several detectors.

    Args:
        config: Settings of the tracker. Its thresholds on scores hold for scores relative to each detector's
            own, times its trust. Times without a match grow by how much longer the slowest detector leaves
            its objects without news than the quickest does.
        detectors: What is known of each, by name; None: nothing, its scores are estimated as they come.
        buffer_s: How late a measurement may arrive, against the newest. None: twice the longest delay, at
            least `LEAST_BUFFER_S`.

    Raises:
        ConfigError: `config` is no `TrackerConfig`, there is no detector, or the buffer is no time.

    Attributes:
        delays_s: Time from measurement to arrival, by detector, as the profiles say.
        left_out: What was left out of each detector, by name.
    """

    def __init__(
        self,
        config: TrackerConfig,
        detectors: Mapping[str, DetectorProfile | None],
        buffer_s: float | None = None,
    ) -> None:
        if not detectors:
            raise ConfigError("FusedTracker: expected one detector or more")
        if not isinstance(config, TrackerConfig):
            raise ConfigError(f"FusedTracker: expected a TrackerConfig, got {config!r}")
        self._weighings = {name: Weighing(profile) for name, profile in detectors.items()}
        self._places = {name: place for place, name in enumerate(detectors)}
        if buffer_s is None:
            longest_s = max(weighing.delay_s for weighing in self._weighings.values())
            buffer_s = max(2.0 * longest_s, LEAST_BUFFER_S)
        if not 0.0 <= buffer_s < math.inf:
            raise ConfigError(f"FusedTracker: buffer_s must be 0 or more, got {buffer_s!r}")
        self.buffer_s = buffer_s
        self.delays_s = {name: weighing.delay_s for name, weighing in self._weighings.items()}
        self.config = _waiting_longer(replace(config, score_reference=1.0), _slack_s(detectors))
        self._tracker = Tracker(self.config)
        self.reset()

    def reset(self, next_id: int = 1) -> None:
        """Forget everything; identifiers start at 1 again, or at another number."""
        self.left_out = {name: LeftOut() for name in self._weighings}
        self._ahead: list[tuple[Detections, Monitored | None]] = []
        self._before = FusedState(replace(TrackerState.empty(), next_id=next_id), {})
        self._measurements: list[_Measurement] = []

    @property
    def state(self) -> FusedState:
        """What is known after the newest measurement."""
        return self._measurements[-1].after if self._measurements else self._before

    def update(self, detections: Detections, monitored: Monitored | None = None) -> Tracks:
        """Take in a measurement.

        One that is further ahead of the newest than the buffer reaches, and than `LEAST_AHEAD_S`, would make
        all others too late. It waits until a second one, of another detector where there are several, is as
        far ahead, or until its own detector has gone on for as long as the buffer reaches while the others
        were silent; a measurement of the time before shows that it was stamped by a wrong clock. Meanwhile
        the tracks are those of before.

        Identities that were given out after the time of a late measurement may change by it.

        Args:
            detections: Of one of the detectors, with its name and the time of the measurement; map frame.
            monitored: The monitored area then; None when everything is monitored.

        Returns:
            The tracks at the newest time of all measurements.

        Raises:
            ConfigError: The detector is unknown.
            ShapeError: `detections` are no `Detections`.
        """
        if not isinstance(detections, Detections):
            raise ShapeError(
                f"FusedTracker.update: expected smartmot.Detections, got {type(detections).__name__}"
            )
        place = self._places.get(detections.detector)
        if place is None:
            raise ConfigError(
                f"FusedTracker: detections of {detections.detector!r}; the detectors are "
                f"{', '.join(self._places)}"
            )
        if self._measurements:
            if detections.stamp_s - self._measurements[-1].stamp_s > max(self.buffer_s, LEAST_AHEAD_S):
                return self._wait(detections, monitored)
            self._refuse_ahead()
        return self._taken(detections, place, monitored)

    @property
    def waiting(self) -> int:
        """Measurements far ahead of all others that wait for another one to confirm their time."""
        return len(self._ahead)

    def finish(self) -> dict[str, LeftOut]:
        """What was left out of each detector, when no measurement comes any more: what waits is too early."""
        self._refuse_ahead()
        return self.left_out

    def _refuse_ahead(self) -> None:
        for each, _ in self._ahead:
            self.left_out[each.detector].too_early += 1
        self._ahead.clear()

    def _wait(self, detections: Detections, monitored: Monitored | None) -> Tracks:
        """Keep a measurement that is far ahead, or take in all such if their time is confirmed."""
        ahead, tracks = self._ahead, self._measurements[-1].tracks
        ahead.append((detections, monitored))
        near = [each for each, _ in ahead if abs(each.stamp_s - detections.stamp_s) <= self.buffer_s]
        confirmed = len(near) > 1 and len({each.detector for each in near}) >= min(2, len(self._places))
        alone_s = max(each.stamp_s for each, _ in ahead) - min(each.stamp_s for each, _ in ahead)
        if not confirmed and not (len(near) > 1 and alone_s >= self.buffer_s):
            if len(ahead) > MOST_MEASUREMENTS:
                self.left_out[ahead.pop(0)[0].detector].too_early += 1
            return tracks
        ahead.sort(key=lambda each: (each[0].stamp_s, self._places[each[0].detector]))
        for each, area in ahead:
            tracks = self._taken(each, self._places[each.detector], area)
        ahead.clear()
        return tracks

    def _taken(self, detections: Detections, place: int, monitored: Monitored | None) -> Tracks:
        """The tracks at the newest time, with one more measurement in its place."""
        key, kept = (detections.stamp_s, place), self._measurements
        at = bisect.bisect_left(kept, key, key=lambda each: each.key)
        base_s = self._before.tracker.stamp_s
        forgotten = at == 0 and base_s is not None and detections.stamp_s <= base_s
        if kept and (forgotten or detections.stamp_s < kept[-1].stamp_s - self.buffer_s):
            self.left_out[detections.detector].too_late += 1
            return kept[-1].tracks
        if at < len(kept) and kept[at].key == key:
            self.left_out[detections.detector].repeated += 1
            return kept[-1].tracks
        before = kept[at - 1].after if at else self._before
        kept.insert(at, self._processed(before, detections, place, monitored))
        of_detector = self.left_out[detections.detector]
        of_detector.dropped += kept[at].dropped
        of_detector.weak += kept[at].weak
        for k in range(at + 1, len(kept)):
            later = kept[k]
            kept[k] = self._processed(kept[k - 1].after, later.detections, later.place, later.monitored)
        self._forget()
        return kept[-1].tracks

    def at(self, stamp_s: float) -> Tracks | None:
        """The tracks as they are now known to have been at a measurement's time; None: none in the buffer."""
        last = bisect.bisect_right(self._measurements, stamp_s, key=lambda each: each.stamp_s) - 1
        if last < 0 or self._measurements[last].stamp_s != stamp_s:
            return None
        return self._measurements[last].tracks

    def _processed(
        self, before: FusedState, detections: Detections, place: int, monitored: Monitored | None
    ) -> _Measurement:
        """A measurement after those before it."""
        name = detections.detector
        weighing = self._weighings[name]
        weighed, scale = weighing.weighed(detections, before.scales.get(name))
        state, tracks = self._tracker.step(before.tracker, weighed, monitored, True, weighing.trust)
        scales = before.scales if scale is None else {**before.scales, name: scale}
        dropped, sure = self._tracker.score_limits.counts(weighed)
        after, weak = FusedState(state, scales), len(weighed) - sure
        return _Measurement(detections.stamp_s, place, detections, monitored, after, tracks, dropped, weak)

    def _forget(self) -> None:
        """Drop what no measurement can come before any more."""
        kept = self._measurements
        oldest_s = kept[-1].stamp_s - self.buffer_s
        count = bisect.bisect_left(kept, oldest_s, key=lambda each: each.stamp_s)
        count = min(max(count, len(kept) - MOST_MEASUREMENTS), len(kept) - 1)
        if count:
            self._before = kept[count - 1].after
            del kept[:count]


def _slack_s(detectors: Mapping[str, DetectorProfile | None]) -> float:
    """How much later the slowest detector tells of an object again than the quickest, interval and delay."""
    known = [profile for profile in detectors.values() if profile is not None]
    waits_s = [1.0 / profile.rate_hz + profile.delay_s for profile in known]
    return max(waits_s) - min(waits_s) if waits_s else 0.0


def _waiting_longer(config: TrackerConfig, slack_s: float) -> TrackerConfig:
    """A configuration whose tracks live, and are shown, so much longer without a match."""
    if slack_s == 0.0:
        return config

    def longer(setting: Setting) -> PerCategory:
        return PerCategory(*(table(setting) + slack_s).tolist())

    life, report = config.lifecycle, config.report
    tentative_s, rest_s, coasted_s = life.tentative_max_age_s, life.rest_max_age_s, report.coasted_s
    return replace(
        config,
        lifecycle=replace(
            life,
            max_age_s=longer(life.max_age_s),
            tentative_max_age_s=None if tentative_s is None else longer(tentative_s),
            rest_max_age_s=None if rest_s is None else longer(rest_s),
        ),
        report=replace(report, coasted_s=None if coasted_s is None else longer(coasted_s)),
    )
