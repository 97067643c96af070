"""HD maps, tracking and automatic emergency braking, evaluated in closed loop.

    >>> import smartmot
    >>> smartmot.run("cpna", speed_kmh=40, strategy="map")      # doctest: +SKIP
    >>> smartmot.sweep("cpna", speed_kmh=(40, 60)).frame()      # doctest: +SKIP

Maps, scenarios, runs, studies and results (`evaluation.api`), and the parts of perception: filter, track,
forecast, decide. Each is loaded when it is first used. All positions are in the map frame (OpenDRIVE's
inertial frame), SI units and radians.
"""

import _smartmot

_smartmot.check(__name__)  # said at the first import: maps of `opendrive`, which may be another, come later

TYPE_CHECKING = False
if TYPE_CHECKING:  # for type checkers and editors; at run time `__getattr__` loads what `_HOMES` says
    from evaluation.api import (
        Results,
        Run,
        compare,
        drive,
        load_map,
        load_results,
        ncap,
        run,
        scenarios,
        sweep,
    )
    from smartmot.area import (
        AdaptiveArea,
        AdaptiveAreaConfig,
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
    from smartmot.errors import (
        ConfigError,
        PluginError,
        ShapeError,
        SmartMotError,
        StampError,
        TimeOrderError,
    )
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

_HOMES = {
    "evaluation.api": "Results Run compare drive load_map load_results ncap run scenarios sweep",
    "smartmot.area": (
        "AdaptiveArea AdaptiveAreaConfig EverythingArea MapArea MapAreaConfig MonitoredArea "
        "MonitoredAreaStrategy PathArea PathAreaConfig RectangularArea RectangularConfig"
    ),
    "smartmot.decision.aeb": "AebConfig Event",
    "smartmot.decision.rules": "Assessment BrakeRule Command LeadObject PaperRule",
    "smartmot.detection_input": "detections_from_arrays to_map",
    "smartmot.errors": "ConfigError PluginError ShapeError SmartMotError StampError TimeOrderError",
    "smartmot.filters.existence": "ExistenceConfig",
    "smartmot.filters.kalman": "BevFilterConfig",
    "smartmot.filters.motion_models": "ConstantAcceleration ConstantTurnRate ConstantVelocity PerCategory",
    "smartmot.forecast": "ForecastConfig forecast_tracks",
    "smartmot.maps.lane_map": "LaneMap",
    "smartmot.maps.regulatory": "RegulatoryElement regulatory_elements",
    "smartmot.maps.route": "Route route_ahead route_from_lanes",
    "smartmot.overlap": "bev_iou",
    "smartmot.path": "PlannedPath",
    "smartmot.pipeline": "FrameResult Pipeline PipelineConfig PipelineState",
    "smartmot.tracking.association": "AssociationConfig",
    "smartmot.tracking.configs": "TRACKER_CONFIGS forecast_config tracker_config",
    "smartmot.tracking.fusion.fused": "FusedTracker",
    "smartmot.tracking.lifecycle": "LifecycleConfig",
    "smartmot.tracking.own": "ObjectTracker tracks_from_arrays",
    "smartmot.tracking.profile": "DetectorProfile",
    "smartmot.tracking.state": "TrackerState",
    "smartmot.tracking.tracker": "ReportConfig Tracker TrackerConfig",
    "smartmot.types": "Boxes Detections Dropped EgoState Forecast Threats Tracks",
}
"""Names by the module that they are loaded from."""

__all__ = [
    "TRACKER_CONFIGS",
    "AdaptiveArea",
    "AdaptiveAreaConfig",
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
    "Results",
    "Route",
    "Run",
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
    "compare",
    "detections_from_arrays",
    "drive",
    "forecast_config",
    "forecast_tracks",
    "load_map",
    "load_results",
    "ncap",
    "regulatory_elements",
    "route_ahead",
    "route_from_lanes",
    "run",
    "scenarios",
    "sweep",
    "to_map",
    "tracker_config",
    "tracks_from_arrays",
]


def __getattr__(name: str) -> object:
    """A name of `__all__`, or a module of this package, loaded when it is first used."""
    import importlib

    for module, names in _HOMES.items():
        if name in names.split():
            value = getattr(importlib.import_module(module), name)
            globals()[name] = value
            return value
    if not name.startswith("_"):
        try:
            return importlib.import_module(f"{__name__}.{name}")
        except ModuleNotFoundError as error:
            if error.name != f"{__name__}.{name}":
                raise
    raise AttributeError(
        f"module {__name__!r} has no attribute {name!r}", name=name, obj=importlib.import_module(__name__)
    )


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
