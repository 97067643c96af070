"""Monitored areas: which objects count."""

from smartmot.area.everything import EverythingArea
from smartmot.area.lanes import MapArea, MapAreaConfig, MonitoredLane, MonitoredLanes
from smartmot.area.monitored import (
    MonitoredArea,
    MonitoredAreaStrategy,
    Relevance,
    ego_extent,
    ego_frame,
    is_vulnerable,
    known_path,
    outline_points,
    uses_path,
)
from smartmot.area.rectangle import RectangularArea, RectangularConfig

__all__ = [
    "EverythingArea",
    "MapArea",
    "MapAreaConfig",
    "MonitoredArea",
    "MonitoredAreaStrategy",
    "MonitoredLane",
    "MonitoredLanes",
    "RectangularArea",
    "RectangularConfig",
    "Relevance",
    "ego_extent",
    "ego_frame",
    "is_vulnerable",
    "known_path",
    "outline_points",
    "uses_path",
]
