"""Monitored areas: which objects count."""

from smartmot.area.adaptive import AdaptiveArea, AdaptiveAreaConfig
from smartmot.area.everything import EverythingArea
from smartmot.area.lanes import MapArea, MapAreaConfig, MonitoredLane, MonitoredLanes
from smartmot.area.monitored import (
    MonitoredArea,
    MonitoredAreaStrategy,
    Relevance,
    ego_extent,
    ego_frame,
    ego_span,
    is_vulnerable,
    known_path,
    outline_points,
    reaching,
    uses_path,
)
from smartmot.area.path import PathArea, PathAreaConfig
from smartmot.area.rectangle import RectangularArea, RectangularConfig
from smartmot.area.way import WAYS, with_way

__all__ = [
    "WAYS",
    "AdaptiveArea",
    "AdaptiveAreaConfig",
    "EverythingArea",
    "MapArea",
    "MapAreaConfig",
    "MonitoredArea",
    "MonitoredAreaStrategy",
    "MonitoredLane",
    "MonitoredLanes",
    "PathArea",
    "PathAreaConfig",
    "RectangularArea",
    "RectangularConfig",
    "Relevance",
    "ego_extent",
    "ego_frame",
    "ego_span",
    "is_vulnerable",
    "known_path",
    "outline_points",
    "reaching",
    "uses_path",
    "with_way",
]
