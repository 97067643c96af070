"""The LiDAR of a run that is written as a data set: the run's own, or another."""

from __future__ import annotations

from dataclasses import dataclass, replace

from evaluation.errors import ArgumentError
from evaluation.runs.recordings import RunRecording
from scenarios.openscenario.motion.roads import load_roads
from scenarios.sensors.lidar import BARE, lidar_config
from scenarios.sensors.lidar.recording import RecordedSweeps
from scenarios.sensors.lidar.street import Street
from scenarios.sensors.world import FlatGround, MapSurface
from scenarios.settings import Settings, preset_with
from scenarios.simulation.street import RunStreet
from scenarios.spec import load_named_map, perception_map

DEFAULT_SENSOR = "hdl32"
"""Of runs without a LiDAR: as many lines as the LiDAR of the sibling data sets has (docs/lidar.md)."""


@dataclass(frozen=True, slots=True)
class LidarChoice:
    """Which LiDAR is cast along runs, and what stands along their roads.

    Args:
        sensor: its name; None: that of the run, else `DEFAULT_SENSOR`.
        street: settings of the street; empty: that of the run.
        least_points: labels with fewer points are left out.
    """

    sensor: str | None = None
    street: Settings = ()
    least_points: int = 1


def sweeps_of(recording: RunRecording, choice: LidarChoice) -> RecordedSweeps:
    """The clouds that a LiDAR has along a run: the whole turn and range of its manual, in any weather.

    Raises:
        ArgumentError: furniture is asked for where the map is not known.
        ScenarioError: the scenario has no map, along which furniture could stand.
    """
    if recording.setup is None:
        if choice.street:
            raise ArgumentError(f"--street: the map of {recording.sequence.name} is not known; leave it out")
        config = lidar_config(choice.sensor or DEFAULT_SENSOR)
        return RecordedSweeps(recording.sequence, recording.ego_speed_mps, config)
    stored, definition = recording.setup
    lidar = stored.preset.lidar
    sensor = choice.sensor or (DEFAULT_SENSOR if lidar is None else lidar.sensor)
    furnished = preset_with(replace(stored.preset, lidar=None), (("sensor", sensor), *choice.street)).street
    roads = load_roads(definition.map_path)
    name = perception_map(definition, stored.spec.map_name)
    street: Street = BARE
    if furnished is not None:
        network = load_named_map(name) if name else roads.network
        street = RunStreet(furnished, network, definition, roads)()
    surface = FlatGround() if definition.map_path is None else MapSurface(roads.network)
    return RecordedSweeps(
        recording.sequence, recording.ego_speed_mps, lidar_config(sensor), stored.spec.seed, street, surface
    )
