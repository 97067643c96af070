"""Monitored-area strategies by name."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.places import MapView
from scenarios.presets import Preset
from smartmot.area import (
    AdaptiveArea,
    EverythingArea,
    MapArea,
    MonitoredAreaStrategy,
    PathArea,
    RectangularArea,
)
from smartmot.area.way import ALONG_PATH
from smartmot.errors import suggestion
from smartmot.plugins import is_plugin, plugin, require

STRATEGIES = ("rectangular", "map", "all", "path", "adaptive")
"""Shipped ones; one of the user's own is named `package.module:name`."""


def make_strategy(name: str, preset: Preset, view: MapView) -> MonitoredAreaStrategy:
    """Build a monitored-area strategy.

    Args:
        name: one of `STRATEGIES`, or `package.module:name` of what makes one from a `MapView` and a preset.
        preset: its settings.
        view: map and route of perception.

    Raises:
        ScenarioError: there is none of that name.
        smartmot.errors.PluginError: the user's own cannot be loaded or made.
    """
    if is_plugin(name):
        own: MonitoredAreaStrategy = require(plugin(name)(view, preset), "at", name)
        return own
    if name == "rectangular":
        return RectangularArea(preset.rectangular, preset.pipeline.braking_distance)
    if name == "map":
        return MapArea(view.network, view.route, preset.map_area)
    if name == "all":
        return EverythingArea()
    if name == "path":
        return PathArea(preset.path_area)
    if name == "adaptive":
        return AdaptiveArea(view.lane_map, preset.adaptive_area)
    raise ScenarioError(
        f"unknown strategy {name!r}{suggestion(name, STRATEGIES)}; use one of: {', '.join(STRATEGIES)}"
    )


def path_source(name: str, preset: Preset) -> str:
    """Where the planned path of a run comes from, one of `PATHS_FROM`; empty: nothing looks along one.

    Args:
        name: of the strategy; of one of the user's own it is not known whether it does.
        preset: its settings.
    """
    pipeline = preset.pipeline
    looks = ALONG_PATH in (pipeline.forecast.ego, pipeline.way, pipeline.standing)
    return preset.path_from if looks or name in (PathArea.name, AdaptiveArea.name) or is_plugin(name) else ""


@dataclass(frozen=True, slots=True)
class NamedStrategy:
    """Makes the strategy of a name for any map and route; a value, so that it can be sent to other processes.

    Args:
        name: see `make_strategy`.
        preset: its settings.
    """

    name: str
    preset: Preset

    def __call__(self, view: MapView) -> MonitoredAreaStrategy:
        """The strategy for a map and route; see `make_strategy` for what it raises."""
        return make_strategy(self.name, self.preset, view)
