"""The LiDAR that is cast along a run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.errors import ArgumentError
from evaluation.runs.recordings import recording_of_log, recording_of_run
from evaluation.studies.datasets.sweeps import LidarChoice, sweeps_of
from scenarios.openscenario.motion.roads import load_roads
from scenarios.openscenario.reading.reader import load
from scenarios.presets import named_preset
from scenarios.sensors.interfaces import SensorChain
from scenarios.sensors.lidar import BARE, HDL32, HDL64, MID70, LidarMeasurement, LidarSensor
from scenarios.sensors.lidar.patterns import Spinning
from scenarios.sensors.lidar.recording import RecordedSweeps
from scenarios.sensors.world import MapSurface
from scenarios.settings import preset_with
from scenarios.simulation.simulation import Simulation
from scenarios.strategies import NamedStrategy
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import Detections

RUN = Path(__file__).parents[3] / "data/field/runs/good/cpna_paper_map_dry_none_50kmh_seed0"


def test_a_run_with_a_lidar_is_cast_with_its_own_on_its_own_street() -> None:
    recording = recording_of_run(RUN)
    assert recording.setup is not None
    plain = sweeps_of(recording, LidarChoice())
    assert plain.config == HDL32
    assert plain.street is BARE
    stored, definition = recording.setup
    settings = (("sensor", "mid70"), ("street", "furnished"), ("street_density", 20.0), ("street_seed", 3.0))
    preset = preset_with(stored.preset, settings)
    own = replace(recording, setup=(replace(stored, preset=preset), definition))
    assert sweeps_of(own, LidarChoice()).config == MID70
    # the street is that of the run, and the same when it is asked for
    street = sweeps_of(own, LidarChoice("hdl64")).street
    assert len(street.kind) > 50
    assert sweeps_of(recording, LidarChoice("hdl64", settings[1:])).street.digest == street.digest
    assert sweeps_of(own, LidarChoice("hdl64", (("street", "bare"),))).street is BARE
    assert sweeps_of(own, LidarChoice("hdl64")).config == HDL64


def test_of_a_log_alone_there_is_a_plane() -> None:
    alone = replace(recording_of_run(RUN), setup=None)
    sweeps = sweeps_of(alone, LidarChoice())
    assert len(sweeps) == 157
    assert len(next(iter(sweeps))) > 10_000
    with pytest.raises(ArgumentError, match="--street: the map of cpna_paper"):
        sweeps_of(alone, LidarChoice(street=(("street", "furnished"),)))


class Keeper:
    """A detector that keeps the clouds and sees nothing."""

    latency_s = 0.0
    rate_hz = None

    def __init__(self) -> None:
        self.clouds: list[PointCloud] = []

    def detect(self, measurement: LidarMeasurement) -> Detections:
        self.clouds.append(measurement.cloud)
        return measurement.detections(Boxes3D.empty(), np.zeros(0), np.zeros(0, dtype=np.str_))


def test_clouds_are_those_that_the_loop_had() -> None:
    """Of a pedestrian who crosses and an ego that brakes: the shutter sees the motion of both."""
    definition = load(RUN.parent / "cpna_paper.xosc", {})
    config = replace(HDL32, pattern=Spinning(tuple(range(-10, 2)), 20.0, 0.0002))
    keeper, preset = Keeper(), named_preset("physical")
    chain = SensorChain(LidarSensor(config, 5), keeper, "lidar")
    outcome = Simulation(definition, preset, NamedStrategy("all", preset), 5, sensors=[chain]).run()
    others = tuple(entity for entity in definition.entities if entity.name != "Ego")
    log = pd.DataFrame(outcome.log.table())
    recording = recording_of_log(log, "run", definition.map_path, others)
    surface = MapSurface(load_roads(definition.map_path).network)
    sweeps = RecordedSweeps(recording.sequence, recording.ego_speed_mps, config, 5, surface=surface)
    clouds = list(sweeps)
    assert len(clouds) >= 40
    for cloud, in_loop in zip(clouds, keeper.clouds, strict=False):
        assert cloud.stamp_s == pytest.approx(in_loop.stamp_s, abs=1e-9)
        assert cloud.xyz_m.shape == in_loop.xyz_m.shape
        assert np.abs(cloud.xyz_m - in_loop.xyz_m).max() < 1e-5
        assert cloud.intensity is not None
        assert in_loop.intensity is not None
        assert np.abs(cloud.intensity - in_loop.intensity).max() < 1e-6
