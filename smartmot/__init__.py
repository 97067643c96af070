"""Map-aware perception for automatic emergency braking: filter, track, forecast, decide.

All positions are in the map frame (OpenDRIVE's inertial frame), SI units and radians.
"""

import _smartmot

_smartmot.check(__name__)  # before `opendrive` is imported, which may be another

from smartmot.association import AssociationConfig
from smartmot.detection_input import detections_from_arrays, to_map
from smartmot.errors import ConfigError, PluginError, ShapeError, SmartMotError, StampError, TimeOrderError
from smartmot.forecast import ForecastConfig, forecast_tracks
from smartmot.geometry import bev_iou
from smartmot.kalman import BevFilterConfig
from smartmot.lifecycle import LifecycleConfig
from smartmot.monitored_area import (
    EverythingArea,
    MapArea,
    MapAreaConfig,
    MonitoredArea,
    MonitoredAreaStrategy,
    RectangularArea,
    RectangularConfig,
)
from smartmot.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    PerCategory,
)
from smartmot.own_tracker import ObjectTracker, tracks_from_arrays
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.regulatory import RegulatoryElement, regulatory_elements
from smartmot.route import Route, route_ahead, route_from_lanes
from smartmot.tracker import ReportConfig, Tracker, TrackerConfig
from smartmot.tracker_configs import TRACKER_CONFIGS, forecast_config, tracker_config
from smartmot.tracker_state import TrackerState
from smartmot.types import Boxes, Detections, Dropped, EgoState, Forecast, Threats, Tracks

__all__ = [
    "TRACKER_CONFIGS",
    "AssociationConfig",
    "BevFilterConfig",
    "Boxes",
    "ConfigError",
    "ConstantAcceleration",
    "ConstantTurnRate",
    "ConstantVelocity",
    "Detections",
    "Dropped",
    "EgoState",
    "EverythingArea",
    "Forecast",
    "ForecastConfig",
    "FrameResult",
    "LifecycleConfig",
    "MapArea",
    "MapAreaConfig",
    "MonitoredArea",
    "MonitoredAreaStrategy",
    "ObjectTracker",
    "PerCategory",
    "Pipeline",
    "PipelineConfig",
    "PipelineState",
    "PluginError",
    "RectangularArea",
    "RectangularConfig",
    "RegulatoryElement",
    "ReportConfig",
    "Route",
    "ShapeError",
    "SmartMotError",
    "StampError",
    "Threats",
    "TimeOrderError",
    "Tracker",
    "TrackerConfig",
    "TrackerState",
    "Tracks",
    "bev_iou",
    "detections_from_arrays",
    "forecast_config",
    "forecast_tracks",
    "regulatory_elements",
    "route_ahead",
    "route_from_lanes",
    "to_map",
    "tracker_config",
    "tracks_from_arrays",
]
