"""Map-aware perception for automatic emergency braking: filter, track, forecast, decide.

All positions are in the map frame (OpenDRIVE's inertial frame), SI units and radians.
"""

from smartmot.errors import ConfigError, ShapeError, SmartMotError, TimeOrderError
from smartmot.monitored_area import (
    EverythingArea,
    MapArea,
    MapAreaConfig,
    MonitoredArea,
    MonitoredAreaStrategy,
    RectangularArea,
    RectangularConfig,
)
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.regulatory import RegulatoryElement, regulatory_elements
from smartmot.route import Route, route_ahead, route_from_lanes
from smartmot.tracker import Tracker, TrackerConfig, TrackerState
from smartmot.types import Boxes, Detections, EgoState, Forecast, Threats, Tracks

__all__ = [
    "Boxes",
    "ConfigError",
    "Detections",
    "EgoState",
    "EverythingArea",
    "Forecast",
    "FrameResult",
    "MapArea",
    "MapAreaConfig",
    "MonitoredArea",
    "MonitoredAreaStrategy",
    "Pipeline",
    "PipelineConfig",
    "PipelineState",
    "RectangularArea",
    "RectangularConfig",
    "RegulatoryElement",
    "Route",
    "ShapeError",
    "SmartMotError",
    "Threats",
    "TimeOrderError",
    "Tracker",
    "TrackerConfig",
    "TrackerState",
    "Tracks",
    "regulatory_elements",
    "route_ahead",
    "route_from_lanes",
]
