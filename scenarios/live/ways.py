"""Pipelines for the way that the vehicle is on, found from its poses."""

from __future__ import annotations

import math

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.live.settings import LiveSettings
from scenarios.places import MapView
from scenarios.presets import pipeline_of
from scenarios.sources.frames import Frame
from scenarios.sources.perception import frame_view
from scenarios.strategies import STRATEGIES, make_strategy
from smartmot.area import AdaptiveArea, EverythingArea, MapArea, RectangularArea
from smartmot.maps.follow import RouteFollower
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import Route, RouteError
from smartmot.path import PlannedPath
from smartmot.pipeline import Pipeline
from smartmot.types import Detections, EgoState

PATH_M, PATH_STEP_M = 100.0, 1.0
"""The arc ahead is so long, as far as any monitored area looks, and has points so densely."""
LEAST_SPEED_MPS = 1.0
"""At a lower speed the turn rate says nothing of where the vehicle goes: straight on."""
MOST_CURVATURE_PM = 0.2
"""No car turns in less than 5 m, half its turning circle of 10 to 12 m."""
MOST_TURN_RAD = 0.5 * math.pi
"""Beyond a right angle the arc goes straight on: nobody keeps turning on the spot."""

_NEW_ROUTE_FACTOR, _NEW_ROUTE_MPS = 2.0, 20.0
"""A new route goes on for twice what is monitored at this speed, or at a greater one of the vehicle."""


class Ways:
    """Makes the pipeline of a frame; the same one as long as the way does not change.

    Args:
        settings: strategy, preset and its parameters.
        lane_map: the map, frame of the odometry; None: there is none.

    Raises:
        ScenarioError, smartmot.errors.SmartMotError: a setting is wrong, or the strategy needs a map.

    Attributes:
        preset: in force.
        config: of the pipelines.
        strategy: name of the monitored area.
        without_pose: the pipeline of frames without a pose: tracks everything.
    """

    def __init__(self, settings: LiveSettings, lane_map: LaneMap | None) -> None:
        self.strategy = settings.strategy or ("path" if lane_map is None else MapArea.name)
        if self.strategy == MapArea.name and lane_map is None:
            raise ScenarioError("strategy map: needs a map; give one (--map FILE), or take another strategy")
        self._settings, self._map = settings, lane_map
        self.preset = settings.preset_at(1.0 / settings.preset_at(1.0).sensor.rate_hz)
        shipped_without = self.strategy in STRATEGIES and self.strategy not in (
            MapArea.name,
            AdaptiveArea.name,
        )
        self._follows = lane_map is not None and not shipped_without
        self._make()
        if not self._follows:
            self._made(None)  # mistakes are told before the first frame

    def _make(self) -> None:
        """Begin with the preset in force."""
        config = pipeline_of(self.preset)
        self.config = config
        self.without_pose = Pipeline(EverythingArea(), config)
        self._off_map = Pipeline(RectangularArea(self.preset.rectangular, config.braking_distance), config)
        self._pipeline: Pipeline | None = None
        self._route: Route | None = None
        self._follower = (
            None if self._map is None else RouteFollower(self._map, self.preset.map_area.vru_margin_m)
        )

    def frames_every(self, interval_s: float) -> None:
        """Take the interval of the frames, in which `max_age` counts."""
        if self._settings.max_age is not None:
            self.preset = self._settings.preset_at(interval_s)
            self._make()

    def pipeline(self, ego: EgoState) -> tuple[Pipeline, bool]:
        """The pipeline of a frame, and whether the vehicle is on the map, where that matters."""
        if not self._follows:
            self._pipeline = self._pipeline or self._made(None)
            return self._pipeline, True
        route = self._route_at(ego)
        if route is None:
            return self._off_map, False
        if self._pipeline is None or route is not self._route:
            self._pipeline, self._route = self._made(route), route
        return self._pipeline, True

    def path(self, ego: EgoState) -> PlannedPath | None:
        """Where the vehicle goes: along its route if it has one, else on with its turn rate.

        No planned path is among the messages. The arc of the present turn rate is what the forecast of the
        vehicle assumes too.
        """
        return None if self._follows else arc_ahead(ego)

    def _made(self, route: Route | None) -> Pipeline:
        if route is None or self._map is None:
            # areas that ask for map or route are told that there is none
            nowhere = EgoState(0.0, 0.0, 0.0, 0.0, 0.0)
            view: MapView = frame_view(Frame(0.0, nowhere, Detections.empty(0.0), lane_map=self._map))
        else:
            view = MapView(self._map, route)
        area = make_strategy(self.strategy, self.preset, view)
        return Pipeline(area, self.config, route if self.preset.path_from == "map" else None)

    def _route_at(self, ego: EgoState) -> Route | None:
        assert self._follower is not None
        area, speed = self.preset.map_area, abs(ego.speed_mps)
        least_m = max(area.min_front_m, area.front_time_s * speed)
        new_m = area.min_front_m + _NEW_ROUTE_FACTOR * area.front_time_s * max(speed, _NEW_ROUTE_MPS)
        try:
            return self._follower.at(ego.x_m, ego.y_m, least_m, new_m)
        except RouteError:
            return None


def arc_ahead(ego: EgoState) -> PlannedPath:
    """The path of a vehicle that keeps its turn rate, up to a right angle; straight on where it is slow."""
    curvature = 0.0
    if ego.speed_mps >= LEAST_SPEED_MPS:
        curvature = ego.yaw_rate_radps / ego.speed_mps
        curvature = min(max(curvature, -MOST_CURVATURE_PM), MOST_CURVATURE_PM)
    station = np.arange(0.0, PATH_M + PATH_STEP_M, PATH_STEP_M)
    # chords of an arc have the direction of its middle
    middle = np.clip((station[1:] - 0.5 * PATH_STEP_M) * curvature, -MOST_TURN_RAD, MOST_TURN_RAD)
    heading = ego.yaw_rad + middle
    step = PATH_STEP_M * np.column_stack((np.cos(heading), np.sin(heading)))
    start = np.array([[ego.x_m, ego.y_m]])
    return PlannedPath(np.concatenate((start, start + np.cumsum(step, axis=0))), station)
