"""Map-aware perception for automatic emergency braking: filter, track, forecast, decide.

All positions are in the map frame (OpenDRIVE's inertial frame), SI units and radians.
"""

import _smartmot

_smartmot.check(__name__)  # said at the first import: maps of `opendrive`, which may be another, come later

from smartmot.area import (
    EverythingArea,
    MapArea,
    MapAreaConfig,
    MonitoredArea,
    MonitoredAreaStrategy,
    PathArea,
    PathAreaConfig,
    RectangularArea,
    RectangularConfig,
)
from smartmot.decision.aeb import AebConfig, Event
from smartmot.decision.rules import Assessment, BrakeRule, Command, LeadObject, PaperRule
from smartmot.detection_input import detections_from_arrays, to_map
from smartmot.errors import ConfigError, PluginError, ShapeError, SmartMotError, StampError, TimeOrderError
from smartmot.filters.existence import ExistenceConfig
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    PerCategory,
)
from smartmot.forecast import ForecastConfig, forecast_tracks
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.regulatory import RegulatoryElement, regulatory_elements
from smartmot.maps.route import Route, route_ahead, route_from_lanes
from smartmot.overlap import bev_iou
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.tracking.association import AssociationConfig
from smartmot.tracking.configs import TRACKER_CONFIGS, forecast_config, tracker_config
from smartmot.tracking.fusion.fused import FusedTracker
from smartmot.tracking.lifecycle import LifecycleConfig
from smartmot.tracking.own import ObjectTracker, tracks_from_arrays
from smartmot.tracking.profile import DetectorProfile
from smartmot.tracking.state import TrackerState
from smartmot.tracking.tracker import ReportConfig, Tracker, TrackerConfig
from smartmot.types import Boxes, Detections, Dropped, EgoState, Forecast, Threats, Tracks

__all__ = [
    "TRACKER_CONFIGS",
    "AebConfig",
    "Assessment",
    "AssociationConfig",
    "BevFilterConfig",
    "Boxes",
    "BrakeRule",
    "Command",
    "ConfigError",
    "ConstantAcceleration",
    "ConstantTurnRate",
    "ConstantVelocity",
    "Detections",
    "DetectorProfile",
    "Dropped",
    "EgoState",
    "Event",
    "EverythingArea",
    "ExistenceConfig",
    "Forecast",
    "ForecastConfig",
    "FrameResult",
    "FusedTracker",
    "LaneMap",
    "LeadObject",
    "LifecycleConfig",
    "MapArea",
    "MapAreaConfig",
    "MonitoredArea",
    "MonitoredAreaStrategy",
    "ObjectTracker",
    "PaperRule",
    "PathArea",
    "PathAreaConfig",
    "PerCategory",
    "Pipeline",
    "PipelineConfig",
    "PipelineState",
    "PlannedPath",
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
