"""One frame of perception and decision, as a pure function of its inputs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from smartmot.area.monitored_area import (
    MonitoredArea,
    MonitoredAreaStrategy,
    ego_extent,
    is_vulnerable,
    overhang_m,
)
from smartmot.decision.aeb import AebConfig, AebState, BrakeCommand, Event, Situation, decide
from smartmot.decision.braking import BrakingDistance, horizon_s
from smartmot.decision.collision import IOU_THRESHOLD, NO_THREATS, collision_times, threats
from smartmot.errors import ConfigError, TimeOrderError
from smartmot.forecast import (
    ForecastConfig,
    forecast_ego,
    forecast_ego_along,
    forecast_times,
    forecast_tracks,
)
from smartmot.maps.route import Route
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
    Threats,
    Tracks,
    unchecked,
)

STANDING_MPS = 0.1
"""Below this the ego counts as standing still."""


@dataclass(frozen=True, slots=True)
class PipelineConfig:
    """Settings of perception and decision.

    Args:
        tracker: settings of the tracker, or what makes one of your own (`smartmot.tracking.own`).
        forecast, aeb, braking_distance: settings of the other parts.
        iou_threshold: overlap of forecast boxes that predicts a collision (paper: 0.01).
        filter_detections: only track what the monitored area keeps (the paper's first use of the map).
        filter_tracks: delete tracks that left the monitored area (its second use). Those of a tracker of
            your own are left out while they are outside; the tracker is not told.
    """

    tracker: TrackerConfig | Callable[[], ObjectTracker] = field(default_factory=TrackerConfig)
    forecast: ForecastConfig = field(default_factory=ForecastConfig)
    aeb: AebConfig = field(default_factory=AebConfig)
    braking_distance: BrakingDistance = field(default_factory=BrakingDistance)
    iou_threshold: float = IOU_THRESHOLD
    filter_detections: bool = True
    filter_tracks: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.iou_threshold < 1:
            raise ConfigError(f"iou_threshold must lie in [0, 1), got {self.iou_threshold}")


@dataclass(frozen=True, slots=True, eq=False)
class PipelineState:
    """Memory between frames; a tracker of your own is its own memory, not a value that could be kept."""

    tracker: TrackerState | ObjectTracker
    aeb: AebState


@dataclass(frozen=True, slots=True)
class LeadObject:
    """The object on the route that the speed is adapted to.

    Args:
        track_id: its track.
        gap_m: free distance from the ego's front.
        speed_mps: its speed along the ego's heading.
    """

    track_id: int
    gap_m: float
    speed_mps: float


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
        lead: what the speed is adapted to, if anything.
        command: brake command.
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
    lead: LeadObject | None
    command: BrakeCommand
    events: tuple[Event, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """What the decision knows of M tracks.

    Args:
        tracks, forecast: of the frame.
        ahead_m: (M,) distance along the ego's heading from its centre to each box; negative behind it.
        on_way: (M,) known to be in the ego's way.
        threatening: (M,) on a collision course, and counting.
        vulnerable: (M,) vulnerable road users.
    """

    tracks: Tracks
    forecast: Forecast
    ahead_m: FloatArray
    on_way: BoolArray
    threatening: BoolArray
    vulnerable: BoolArray


class Pipeline:
    """Perception and decision around one monitored-area strategy.

    Args:
        strategy: which objects matter. If it has a `route`, the ego can be forecast along it.
        config: settings.
    """

    def __init__(self, strategy: MonitoredAreaStrategy, config: PipelineConfig) -> None:
        self.strategy, self.config = strategy, config
        self._tracker = Tracker(config.tracker) if isinstance(config.tracker, TrackerConfig) else None

    def initial(self) -> PipelineState:
        """State before the first frame.

        Raises:
            PluginError: a tracker of the user's own cannot be made.
        """
        made = self.config.tracker
        return PipelineState(
            TrackerState.empty() if isinstance(made, TrackerConfig) else own(made), AebState()
        )

    def step(
        self, state: PipelineState, detections: Detections, ego: EgoState
    ) -> tuple[PipelineState, FrameResult]:
        """Process one frame.

        Args:
            state: from `initial` or the step before.
            detections: what the sensor delivered; may be older than `ego` by the sensor's latency.
            ego: odometry now.

        Raises:
            TimeOrderError: the detections are newer than the ego's state, or not newer than those before.
            PluginError: a tracker of the user's own fails.
        """
        config = self.config
        if detections.stamp_s > ego.stamp_s + 1e-9:
            raise TimeOrderError(
                f"pipeline: detections of {detections.stamp_s:g} s are newer than the ego's state of "
                f"{ego.stamp_s:g} s; give the odometry of now"
            )
        area = self.strategy.at(ego)
        kept = area.kept(detections.boxes, detections.category)
        dropped = config.filter_detections and np.count_nonzero(kept) < len(kept)
        relevant = detections[kept] if dropped else detections
        tracker_state, tracks = self._track(state.tracker, relevant, area)
        horizon = horizon_s(
            ego.speed_mps,
            config.braking_distance,
            config.forecast.min_horizon_s,
            config.forecast.max_horizon_s,
        )
        time = forecast_times(horizon, config.forecast.step_s)
        forecast = forecast_tracks(tracks, time, config.forecast, ego.stamp_s - tracks.stamp_s)
        route: Route | None = (
            getattr(self.strategy, "route", None) if config.forecast.ego == "route" else None
        )
        ego_forecast = forecast_ego_along(ego, route, time) if route else forecast_ego(ego, time)
        found, lead, scene = NO_THREATS, None, None
        if len(tracks):
            scene, ttc = self._scene(area, tracks, forecast, ego_forecast, ego)
            gap = scene.ahead_m - ego.length_m / 2
            found = threats(tracks, ttc, scene.threatening, gap, ego.speed_mps)
            lead = _lead(scene, gap, ego)
        situation = self._situation(area, scene, ego)
        aeb, command, events = decide(state.aeb, situation, config.aeb)
        lost, trackable = self._used(state.tracker, detections)
        result = FrameResult(
            detections, lost, trackable, kept, tracks, forecast, ego_forecast, found, lead, command, events
        )
        return PipelineState(tracker_state, aeb), result

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

    def _scene(
        self, area: MonitoredArea, tracks: Tracks, forecast: Forecast, ego_forecast: Forecast, ego: EgoState
    ) -> tuple[_Scene, FloatArray]:
        """What the decision knows of the tracks, and their (M,) times to collision."""
        now = unchecked(Boxes, forecast.center_m[:, 0], forecast.size_m, forecast.yaw_rad[:, 0])
        relevance = area.relevance(now, tracks.category)
        # one detection shows no velocity: a track just born is not known to stand, it may drive like the ego
        known = tracks.confirmed & (tracks.age_s > 0.0)
        counts = np.where(
            tracks.dynamic, relevance.within_reach & tracks.confirmed, relevance.in_route & known
        )
        ttc = np.full(len(tracks), np.inf)
        if np.count_nonzero(counts):
            ttc = collision_times(ego_forecast, forecast, self.config.iou_threshold)
        scene = _Scene(
            tracks=tracks,
            forecast=forecast,
            ahead_m=ego_extent(now, ego)[0],
            on_way=relevance.on_way & known,
            threatening=counts & np.isfinite(ttc),
            vulnerable=is_vulnerable(tracks.category),
        )
        return scene, ttc

    def _situation(self, area: MonitoredArea, scene: _Scene | None, ego: EgoState) -> Situation:
        """What the decision looks at; `scene` is None where there is no track."""
        braking_distance = self.config.braking_distance.at(ego.speed_mps)
        predicted = entering = occupied = False
        nearest = math.inf
        if scene is not None:
            ahead, on_way = scene.ahead_m, scene.on_way
            distance = ahead - overhang_m(ego)
            relevant = on_way | scene.threatening
            near = distance < max(braking_distance, self.config.aeb.near_m)
            predicted = bool(np.count_nonzero(scene.threatening))
            occupied = bool(np.count_nonzero(on_way & (near | scene.vulnerable)))
            if np.count_nonzero(relevant):
                nearest = max(float(distance[relevant].min()), 0.0)
            walking = (scene.tracks.dynamic & scene.vulnerable & (ahead > 0.0) & ~on_way).nonzero()[0]
            if len(walking):
                # twice a second is enough: half a second of walking is less than a lane's width
                every = max(1, int(0.5 / self.config.forecast.step_s + 1e-9))
                path = scene.forecast.center_m[walking, ::every]
                entering = bool(np.count_nonzero(area.on_lane(path.reshape(-1, 2))))
        return Situation(
            stamp_s=ego.stamp_s,
            collision_predicted=predicted,
            nearest_m=nearest,
            braking_distance_m=braking_distance,
            vru_entering=entering,
            standing=ego.speed_mps < STANDING_MPS,
            way_occupied=occupied,
        )


def _lead(scene: _Scene, gap_m: FloatArray, ego: EgoState) -> LeadObject | None:
    """Nearest object on the route ahead, for adapting the speed.

    VRUs on a collision course are the emergency decision's; a vehicle ahead is followed even then.
    """
    candidates = (scene.on_way & ~(scene.vulnerable & scene.threatening) & (gap_m > 0)).nonzero()[0]
    if len(candidates) == 0:
        return None
    k = int(candidates[np.argmin(gap_m[candidates])])
    tracks = scene.tracks
    vx, vy = tracks.velocity_mps[k] if tracks.dynamic[k] else (0.0, 0.0)
    along = float(vx * np.cos(ego.yaw_rad) + vy * np.sin(ego.yaw_rad))
    return LeadObject(int(tracks.track_id[k]), float(gap_m[k]), along)
