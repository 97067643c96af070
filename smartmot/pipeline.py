"""One frame of perception and decision, as a pure function of its inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from inspect import signature
from typing import Any

import numpy as np

import _smartmot
from smartmot.area import (
    WAYS,
    MonitoredArea,
    MonitoredAreaStrategy,
    ego_span,
    is_vulnerable,
    known_path,
    reaching,
    uses_path,
    with_way,
)
from smartmot.area.localised import Alignment, LocalisedArea
from smartmot.decision.aeb import AebConfig, Event
from smartmot.decision.braking import BrakingDistance, horizon_s
from smartmot.decision.collision import IOU_THRESHOLD, NO_THREATS, collision_times, threats
from smartmot.decision.own import decide_own, is_rule, own_rule
from smartmot.decision.rules import Assessment, BrakeRule, Command, LeadObject, PaperRule
from smartmot.decision.shipped import ShippedRule
from smartmot.errors import ConfigError, TimeOrderError
from smartmot.forecast import (
    ForecastConfig,
    forecast_ego,
    forecast_ego_along,
    forecast_times,
    forecast_tracks,
)
from smartmot.forecast.uncertain import UncertainMotion
from smartmot.path import PlannedPath
from smartmot.tracking.own import ObjectTracker, limits_of_own, own, update_own
from smartmot.tracking.tracker import ScoreLimits, Tracker, TrackerConfig, TrackerState
from smartmot.types import (
    BoolArray,
    Boxes,
    Detections,
    Dropped,
    EgoState,
    FloatArray,
    Forecast,
    IntArray,
    Threats,
    Tracks,
    unchecked,
)


@dataclass(frozen=True, slots=True)
class PipelineConfig:
    """Settings of perception and decision.

    Args:
        tracker: settings of the tracker, or what makes one of your own (`smartmot.tracking.own`).
        forecast, braking_distance: settings of the other parts.
        aeb: settings of the paper's brake rule; another rule, shipped (`smartmot.decision.shipped`) or your
            own (`smartmot.decision.rules`); or what makes one of your own.
        iou_threshold: overlap of forecast boxes that predicts a collision (paper: 0.01).
        filter_detections: only track what the monitored area keeps (the paper's first use of the map).
        filter_tracks: delete tracks that left the monitored area (its second use). Those of a tracker of
            your own are left out while they are outside; the tracker is not told.
        way: what speed adaptation and the way that must be free look at, one of `smartmot.area.WAYS`: as the
            monitored area says (paper), the way straight ahead, or along the planned path.
        standing: which standing objects count, of the same names.

    Raises:
        ConfigError: a value is outside its range.
    """

    tracker: TrackerConfig | Callable[[], ObjectTracker] = field(default_factory=TrackerConfig)
    forecast: ForecastConfig = field(default_factory=ForecastConfig)
    aeb: ShippedRule | BrakeRule | Callable[[], BrakeRule] = field(default_factory=AebConfig)
    braking_distance: BrakingDistance = field(default_factory=BrakingDistance)
    iou_threshold: float = IOU_THRESHOLD
    filter_detections: bool = True
    filter_tracks: bool = True
    way: str = "area"
    standing: str = "area"

    def __post_init__(self) -> None:
        for name in ("way", "standing"):
            if getattr(self, name) not in WAYS:
                raise ConfigError(f"{name} must be one of {', '.join(WAYS)}, got {getattr(self, name)!r}")
        if not 0 <= self.iou_threshold < 1:
            raise ConfigError(f"iou_threshold must lie in [0, 1), got {self.iou_threshold}")
        if not (isinstance(self.aeb, AebConfig) or is_rule(self.aeb) or callable(self.aeb)):
            raise ConfigError(
                "aeb: expected settings of the paper's rule, an object with decide(), or what makes one, got "
                f"{self.aeb!r}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class PipelineState:
    """Memory between frames; a tracker of your own is its own memory, not a value that could be kept.

    Args:
        tracker: of the tracker.
        rule: of the brake rule, of its own type; None before the first frame.
    """

    tracker: TrackerState | ObjectTracker
    rule: Any


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Everything one frame produced, in the order in which it was made.

    Args:
        detections: all detections of the frame.
        dropped: how many detections were dropped, by the detector and by the tracker.
        trackable: how many have a score with which a track can start.
        kept: (N,) which of them the monitored area kept.
        tracks: M tracks at the detections' time.
        forecast: of the tracks, from the ego's time on.
        ego_forecast: of the ego.
        time_to_collision_s: see `threats`.
        threats: tracks on a collision course that count.
        command: what the ego is asked for.
        events: events of this frame.
    """

    detections: Detections
    dropped: Dropped
    trackable: int
    kept: BoolArray
    tracks: Tracks
    forecast: Forecast
    ego_forecast: Forecast
    threats: Threats
    command: Command
    events: tuple[Event, ...]

    @property
    def lead(self) -> LeadObject | None:
        """What the speed is adapted to, if anything."""
        return self.command.lead


class Pipeline:
    """Perception and decision around one monitored-area strategy.

    Args:
        strategy: which objects matter.
        config: settings.
        map_path: the planned path as the map has it, map frame; it is followed in place of those given to
            `step`, and moves against the world with every error of the localisation. The ego is expected on
            it, not beside it. None: those are.

    Raises:
        PluginError: a brake rule of the user's own cannot be made.
    """

    def __init__(
        self,
        strategy: MonitoredAreaStrategy,
        config: PipelineConfig,
        map_path: PlannedPath | None = None,
    ) -> None:
        self.strategy, self.config = strategy, config
        self._tracker = Tracker(config.tracker) if isinstance(config.tracker, TrackerConfig) else None
        self._rule = PaperRule(config.aeb) if isinstance(config.aeb, AebConfig) else own_rule(config.aeb)
        self._area_along_path = uses_path(strategy) and "path" in signature(strategy.at).parameters
        # a map's route is planned where the area is made, so that callers need not give it a second time
        self._known_path = map_path or known_path(strategy)
        self._follows_map = map_path is not None

    def initial(self) -> PipelineState:
        """State before the first frame.

        Raises:
            PluginError: a tracker of the user's own cannot be made.
        """
        made = self.config.tracker
        return PipelineState(TrackerState.empty() if isinstance(made, TrackerConfig) else own(made), None)

    def step(
        self,
        state: PipelineState,
        detections: Detections,
        ego: EgoState,
        path: PlannedPath | None = None,
        localised: EgoState | None = None,
    ) -> tuple[PipelineState, FrameResult]:
        """Process one frame.

        Args:
            state: from `initial` or the step before.
            detections: what the sensor delivered; may be older than `ego` by the sensor's latency.
            ego: odometry now, in the frame of the detections.
            path: where the ego is going to go, in that frame; None: not known, unless the strategy was made
                for a route.
            localised: the ego as it is localised on the map, map frame: there the monitored area is asked.
                None: the frame of the detections is the map frame.

        Raises:
            TimeOrderError: the detections are newer than the ego's state, or not newer than those before.
            PluginError: a tracker or brake rule of the user's own fails.
        """
        config = self.config
        if detections.stamp_s > ego.stamp_s + 1e-9:
            raise TimeOrderError(
                f"pipeline: detections of {detections.stamp_s:g} s are newer than the ego's state of "
                f"{ego.stamp_s:g} s; give the odometry of now"
            )
        on_map = None if localised is None else Alignment(ego, localised)
        path = self._followed(path, on_map)
        area = self._area(ego, path, on_map)
        kept = area.kept(detections.boxes, detections.category)
        kept_count = np.count_nonzero(kept)
        dropped = config.filter_detections and kept_count < len(kept)
        relevant = detections[kept if kept_count else _NO_ROWS] if dropped else detections
        tracker_state, tracks = self._track(state.tracker, relevant, area)
        horizon = horizon_s(
            ego.speed_mps,
            config.braking_distance,
            config.forecast.min_horizon_s,
            config.forecast.max_horizon_s,
        )
        time = forecast_times(horizon, config.forecast.step_s)
        forecast = forecast_tracks(tracks, time, config.forecast, ego.stamp_s - tracks.stamp_s)
        followed = path if config.forecast.ego == "path" else None
        ego_forecast = forecast_ego(ego, time) if followed is None else self._along(followed, ego, time)
        now = self._assess(area, tracks, forecast, ego_forecast, ego, followed)
        if type(self._rule) is PaperRule:  # one derived from it is the user's: asked and checked as such
            rule_state, command, events = self._rule.decide(state.rule, now)
        else:
            rule_state, command, events = decide_own(self._rule, state.rule, now)
        lost, trackable = self._used(state.tracker, detections)
        result = unchecked(
            FrameResult,
            detections,
            lost,
            trackable,
            kept,
            tracks,
            forecast,
            ego_forecast,
            now.threats,
            command,
            events,
        )
        return unchecked(PipelineState, tracker_state, rule_state), result

    def area(
        self, ego: EgoState, path: PlannedPath | None = None, localised: EgoState | None = None
    ) -> MonitoredArea:
        """The monitored area of a frame, in the frame of the detections; arguments as for `step`."""
        on_map = None if localised is None else Alignment(ego, localised)
        return self._area(ego, self._followed(path, on_map), on_map)

    def _followed(self, path: PlannedPath | None, on_map: Alignment | None) -> PlannedPath | None:
        """The planned path in the frame of the detections."""
        if path is not None and not self._follows_map:
            return path
        of_map = self._known_path
        return of_map if of_map is None or on_map is None else on_map.inverse.path(of_map)

    def _along(self, path: PlannedPath, ego: EgoState, time_s: FloatArray) -> Forecast:
        """The ego's forecast along the planned path.

        How far a map's path lies beside the ego is the error of map and localisation, which a planner takes
        for its own deviation and steers out: forecast, way and standing objects look along the same path.
        """
        return forecast_ego_along(ego, path, time_s, keeps_offset=not self._follows_map)

    def _area(self, ego: EgoState, path: PlannedPath | None, on_map: Alignment | None) -> MonitoredArea:
        """The monitored area, bent along the planned path where the strategy does that."""
        along: dict[str, PlannedPath | None] = {}
        if self._area_along_path:  # a parameter of its own
            along["path"] = path if path is None or on_map is None else on_map.path(path)
        if on_map is None:
            area = self.strategy.at(ego, **along)
        else:
            area = LocalisedArea(self.strategy.at(on_map.dst, **along), on_map)
        return with_way(area, ego, path, self.config.way, self.config.standing)

    def score_limits(self, tracker: TrackerState | ObjectTracker) -> ScoreLimits | None:
        """Scores that the tracker asks for; None: one of the user's own that tells none."""
        return limits_of_own(tracker) if self._tracker is None else self._tracker.score_limits

    def _used(self, tracker: TrackerState | ObjectTracker, detections: Detections) -> tuple[Dropped, int]:
        """What is dropped of a frame, and how many detections can start a track."""
        limits = self.score_limits(tracker)
        dropped, trackable = limits.counts(detections) if limits is not None else (0, len(detections))
        if not dropped:
            return detections.dropped, trackable
        return detections.dropped + Dropped(score=dropped), trackable

    def _track(
        self, tracker: TrackerState | ObjectTracker, detections: Detections, area: MonitoredArea
    ) -> tuple[TrackerState | ObjectTracker, Tracks]:
        """One frame of the tracker, ours or the user's."""
        if isinstance(tracker, TrackerState):
            assert self._tracker is not None
            return self._tracker.step(tracker, detections, area.kept if self.config.filter_tracks else None)
        tracks = update_own(tracker, detections)
        return tracker, tracks[
            area.kept(tracks.boxes, tracks.category)
        ] if self.config.filter_tracks else tracks

    def _assess(
        self,
        area: MonitoredArea,
        tracks: Tracks,
        forecast: Forecast,
        ego_forecast: Forecast,
        ego: EgoState,
        followed: PlannedPath | None,
    ) -> Assessment:
        """How the tracks relate to the ego's way."""
        braking_distance = self.config.braking_distance.at(ego.speed_mps)
        if not len(tracks):
            of_none = (NO_THREATS, *_NO_COLUMNS, None, braking_distance, _NOTHING, followed, None)
            return unchecked(Assessment, ego, tracks, forecast, ego_forecast, *of_none)
        boxes = unchecked(Boxes, forecast.center_m[:, 0], forecast.size_m, forecast.yaw_rad[:, 0])
        relevance = area.relevance(boxes, tracks.category)
        # One detection shows no velocity, however long ago it was: what was seen once is not known to stand,
        # it may drive like the ego. The last match was the first where both times are equal.
        known = tracks.confirmed & (tracks.age_s > tracks.coasted_s)
        counts = np.where(
            tracks.dynamic, relevance.within_reach & tracks.confirmed, relevance.in_route & known
        )
        delay = ego.stamp_s - tracks.stamp_s
        going = reaching(area, lambda: UncertainMotion.of(tracks, forecast, delay))
        if going is not None:
            counts &= going
        ttc, counting = np.full(len(tracks), np.inf), counts.nonzero()[0]
        if len(counting):
            of_counting = forecast if len(counting) == len(tracks) else _rows(forecast, counting)
            ttc[counting] = collision_times(ego_forecast, of_counting, self.config.iou_threshold)
        ahead, on_way = ego_span(boxes, ego)[0], relevance.on_way & known
        threatening, vulnerable = np.isfinite(ttc), is_vulnerable(tracks.category)
        gap = ahead - ego.length_m / 2
        return unchecked(
            Assessment,
            ego,
            tracks,
            forecast,
            ego_forecast,
            threats(tracks, ttc, threatening, gap, ego.speed_mps),
            ttc,
            ahead,
            on_way,
            self._entering(area, forecast, tracks.dynamic & vulnerable & (ahead > 0.0) & ~on_way),
            threatening,
            vulnerable,
            _lead(tracks, on_way & ~(vulnerable & threatening) & (gap > 0), gap, ego),
            braking_distance,
            counts,
            followed,
            None,
        )

    def _entering(self, area: MonitoredArea, forecast: Forecast, walking: BoolArray) -> BoolArray:
        """(M,) which of the objects that walk beside the ego's way are forecast to enter it."""
        entering, rows = np.zeros(len(walking), dtype=np.bool_), walking.nonzero()[0]
        if len(rows):
            # twice a second is enough: half a second of walking is less than a lane's width
            every = max(1, int(0.5 / self.config.forecast.step_s + 1e-9))
            path = forecast.center_m[rows, ::every]
            entering[rows] = area.on_lane(path.reshape(-1, 2)).reshape(len(rows), -1).any(axis=1)
        return entering


def _rows(forecast: Forecast, rows: IntArray) -> Forecast:
    """The forecast of some objects; without covariance, which no collision asks for."""
    return unchecked(
        Forecast,
        forecast.time_s,
        forecast.center_m.take(rows, axis=0),
        forecast.yaw_rad.take(rows, axis=0),
        forecast.size_m.take(rows, axis=0),
        forecast.valid.take(rows, axis=0),
        None,
    )


_NO_ROWS = slice(0)
"""A slice takes less time than positions."""
_NOTHING = np.zeros(0, dtype=np.bool_)
_NO_COLUMNS = (*(np.zeros(0) for _ in range(2)), *(_NOTHING for _ in range(4)))
"""What is known of no tracks."""


def _lead(tracks: Tracks, candidate: BoolArray, gap_m: FloatArray, ego: EgoState) -> LeadObject | None:
    """Nearest object on the route ahead, for adapting the speed.

    Args:
        tracks: M tracks.
        candidate: (M,) what is on the ego's way and in front of it. VRUs on a collision course are the
            emergency decision's; a vehicle ahead is followed even then.
        gap_m: (M,) free distance from the ego's front.
        ego: odometry now.
    """
    rows = candidate.nonzero()[0]
    if len(rows) == 0:
        return None
    k = int(rows[np.argmin(gap_m[rows])])
    vx, vy = tracks.velocity_mps[k] if tracks.dynamic[k] else (0.0, 0.0)
    along = float(vx * np.cos(ego.yaw_rad) + vy * np.sin(ego.yaw_rad))
    return LeadObject(int(tracks.track_id[k]), float(gap_m[k]), along)


__getattr__ = _smartmot.renamed(__name__, {"STANDING_MPS": "smartmot.decision.rules.STANDING_MPS"})
