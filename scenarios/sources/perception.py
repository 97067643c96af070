"""Perception of a run: a pipeline for the way that the ego is on, fed with frames of any source."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.places import MapView
from scenarios.sources.frames import Frame
from smartmot.area import MonitoredArea, MonitoredAreaStrategy
from smartmot.maps.faulty import NO_MAP_ERRORS, FaultyMap, MapErrors
from smartmot.maps.follow import route_along
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import Route, RouteError
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.tracking.tracker import ScoreLimits
from smartmot.types import EgoState, FloatArray

ROUTE_AHEAD_M, ROUTE_BEHIND_M = 100.0, 50.0
"""The route goes on beyond the ego's way, so that the monitored area does not end with it."""

StrategyMaker = Callable[[MapView], MonitoredAreaStrategy]
PATHS_FROM = ("planner", "map")
PipelineMaker = Callable[[Frame], Pipeline]


def map_view(lane_map: LaneMap, path: PlannedPath) -> MapView:
    """Map and route of perception for the ego's planned path.

    Raises:
        smartmot.maps.route.RouteError: the path runs on no driving lane of the map.
    """
    if isinstance(lane_map, FaultyMap):
        return MapView(lane_map, lane_map.route)
    route = route_along(lane_map, path.center_m, ROUTE_AHEAD_M, ROUTE_BEHIND_M, z_m=path.height_m)
    return MapView(lane_map, route)


def faulty_map(lane_map: LaneMap, path: PlannedPath, errors: MapErrors) -> LaneMap:
    """A map with errors about the ego's way; itself where there are none, or no driving lane on that way."""
    if errors == NO_MAP_ERRORS:
        return lane_map
    try:
        route = map_view(lane_map, path).route
    except RouteError:
        return lane_map
    return FaultyMap(lane_map, route, path.center_m, errors, ROUTE_AHEAD_M, ROUTE_BEHIND_M)


class _FrameView(MapView):
    """Map and route of a frame, looked for when they are asked for: most areas need neither."""

    __slots__ = ("_frame", "_laid_route")
    _frame: Frame
    _laid_route: Route | None

    def __init__(self, frame: Frame) -> None:
        object.__setattr__(self, "_frame", frame)  # a map view is frozen
        object.__setattr__(self, "_laid_route", None)

    @property
    def network(self) -> LaneMap:
        if self._frame.lane_map is None:
            raise self._missing()
        return self._frame.lane_map

    @property
    def lane_map(self) -> LaneMap | None:
        return self._frame.lane_map

    @property
    def route(self) -> Route:
        mission = self._frame.mission or self._frame.path
        if mission is None:
            raise self._missing()
        route = self._laid_route or map_view(self.network, mission).route
        object.__setattr__(self, "_laid_route", route)
        return route

    def _missing(self) -> ScenarioError:
        return ScenarioError(
            f"frame of {self._frame.stamp_s:g} s: this monitored area needs a lane map and a path"
        )


def frame_view(frame: Frame) -> MapView:
    """Map and route of a frame, looked for when they are asked for; `ScenarioError` where it has none."""
    return _FrameView(frame)


@dataclass(frozen=True, slots=True, eq=False)
class AreaPipelines:
    """Makes pipelines around one kind of monitored area.

    Args:
        strategy: makes the area for the map and the ego's route on it.
        config: settings of the pipelines.
        path_from: where the planned path comes from, one of `PATHS_FROM`, for every strategy alike: from the
            planner, which knows it relative to the ego, or from the map, as the middle of the route's lanes.

    Raises:
        ScenarioError: there is no such source of paths.
    """

    strategy: StrategyMaker
    config: PipelineConfig
    path_from: str = "planner"

    def __post_init__(self) -> None:
        if self.path_from not in PATHS_FROM:
            raise ScenarioError(f"path_from must be one of {', '.join(PATHS_FROM)}, got {self.path_from!r}")

    def __call__(self, frame: Frame) -> Pipeline:
        """The pipeline for the way that the ego is on in a frame.

        Raises:
            ScenarioError: the area needs a map or a path, and the frame has none.
            smartmot.maps.route.RouteError: the area needs a route, and the path runs on no driving lane of
                the map.
        """
        view = frame_view(frame)
        strategy = self.strategy(view)
        return Pipeline(strategy, self.config, view.route if self.path_from == "map" else None)


class Perception:
    """Turns frames into results, one after the other.

    Args:
        pipeline_of: makes the pipeline; called at the first frame, and whenever the mission (the planned path
            where there is none) is another.
        course_of: the state of the ego in the heading in which it drives, from its odometry; None: it drives
            ahead.
    """

    def __init__(
        self, pipeline_of: PipelineMaker, course_of: Callable[[EgoState], EgoState] | None = None
    ) -> None:
        self._pipeline_of, self._course_of = pipeline_of, course_of
        self._pipeline: Pipeline | None = None
        self._state: PipelineState | None = None
        self._mission: PlannedPath | None = None
        self._spent_ns: list[int] = []

    def __deepcopy__(self, memo: dict[int, Any]) -> Perception:
        """A perception that goes on for itself; its pipeline, which remembers nothing, is shared."""
        copied = Perception(self._pipeline_of, self._course_of)
        copied._pipeline, copied._mission = self._pipeline, self._mission
        copied._state = copy.deepcopy(self._state, memo)
        copied._spent_ns = list(self._spent_ns)
        return copied

    def __getstate__(self) -> dict[str, object]:
        """All but the pipeline, which is made again for the same path."""
        return self.__dict__ | {"_pipeline": None}

    @property
    def frame_time_ms(self) -> FloatArray:
        """(F,) processor time of each frame so far, without that of making a pipeline."""
        return np.array(self._spent_ns, dtype=np.float64) / 1e6

    @property
    def score_limits(self) -> ScoreLimits | None:
        """Scores that the tracker asks for; None before the first frame, and if the tracker tells none."""
        if self._pipeline is None or self._state is None:
            return None
        return self._pipeline.score_limits(self._state.tracker)

    def begin_anew(self) -> None:
        """Let the brake rule forget what it holds, as before its first frame; tracks stay."""
        if self._state is not None:
            self._state = replace(self._state, rule=None)

    def step(self, frame: Frame) -> FrameResult:
        """Process the next frame; see `Pipeline.step` for what it raises."""
        pipeline = self._pipeline_at(frame)
        state = self._state or pipeline.initial()
        ego, localised = self._courses(frame)
        start_ns = time.thread_time_ns()
        # pipelines of the user's own, derived from ours, may know nothing of a localisation
        given = (frame.path,) if localised is None else (frame.path, localised)
        self._state, result = pipeline.step(state, frame.detections, ego, *given)
        self._spent_ns.append(time.thread_time_ns() - start_ns)
        return result

    def area(self, frame: Frame) -> tuple[MonitoredArea, EgoState]:
        """The monitored area of a frame that is not processed, and the ego in its frame."""
        pipeline = self._pipeline_at(frame)
        ego, localised = self._courses(frame)
        return pipeline.area(ego, frame.path, localised), ego

    def _pipeline_at(self, frame: Frame) -> Pipeline:
        mission = frame.mission or frame.path
        if self._pipeline is None or mission is not self._mission:
            self._pipeline, self._mission = self._pipeline_of(frame), mission
        return self._pipeline

    def _courses(self, frame: Frame) -> tuple[EgoState, EgoState | None]:
        """The ego, and the ego on the map, in the heading in which it drives."""
        ego, localised, course_of = frame.ego, frame.localised, self._course_of
        if course_of is None:
            return ego, localised
        return course_of(ego), None if localised is None else course_of(localised)
