"""Frames of scenarios that run unbraked, past a LiDAR."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd

from evaluation.errors import ArgumentError
from evaluation.runs.execution import execute
from evaluation.runs.recordings import RunRecording, recording_of_log
from evaluation.runs.specs import Conditions, scenario_specs
from evaluation.studies.datasets.frames import LabelledFrame
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.motion.roads import load_roads
from scenarios.recorded.layouts.kitti import boxes_in_lidar
from scenarios.recorded.layouts.scenes import ScenePlace, split_of_scenes
from scenarios.recorded.poses import heading
from scenarios.sensors.lidar import BARE, LidarConfig
from scenarios.sensors.lidar.recording import RecordedSweeps
from scenarios.sensors.lidar.street import Furnished, Street
from scenarios.sensors.world import FlatGround, MapSurface
from scenarios.simulation.motion_actions import ego_of
from scenarios.simulation.street import RunStreet
from scenarios.spec import NO_AEB, RunSpec, definition_of, load_named_map, perception_map

FRAMES_PER_SCENE = 4
"""As of streets: instants of one run, drawn at random."""


def unbraked_runs(names: tuple[str, ...]) -> tuple[RunSpec, ...]:
    """The runs of scenarios, all their variations, by turns of the scenarios.

    Args:
        names: of shipped scenarios, or paths of files.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: a file cannot be read.
    """
    runs = [scenario_specs(name, {}, Conditions((NO_AEB,))) for name in names]
    most = max(map(len, runs))
    return tuple(runs_of_one[k] for k in range(most) for runs_of_one in runs if k < len(runs_of_one))


@dataclass(frozen=True, slots=True)
class ScenarioFrames:
    """Instants of unbraked runs on furnished streets; each scene is a run, with a street of its own.

    Runs are dealt out to the splits, so that none is in two.

    Args:
        runs: taken by turns.
        config: the LiDAR on its mount.
        seed: of instants, streets and noise.
    """

    runs: tuple[RunSpec, ...]
    config: LidarConfig
    seed: int

    @property
    def frames_per_scene(self) -> int:
        """See `FRAMES_PER_SCENE`."""
        return FRAMES_PER_SCENE

    def frames(self, place: ScenePlace, count: int) -> Iterator[LabelledFrame]:
        """The frames of a scene, in the order of their times."""
        rng = np.random.default_rng((self.seed, place.number))
        runs = self._runs(place.split)
        spec = runs[place.number_in_split % len(runs)]
        recording, definition = _recorded(spec)
        roads = load_roads(definition.map_path)
        street: Street = BARE
        surface = FlatGround() if definition.map_path is None else MapSurface(roads.network)
        street_seed, noise_seed = rng.integers(2**31, size=2).tolist()
        if definition.map_path is not None:
            name = perception_map(definition, spec.map_name)
            network = load_named_map(name) if name else roads.network
            street = RunStreet(Furnished(seed=street_seed), network, definition, roads)()
        sweeps = RecordedSweeps(
            recording.sequence, recording.ego_speed_mps, self.config, noise_seed, street, surface
        )
        labels, poses = sweeps.sequence.labels, sweeps.sequence.world_SE3_ego
        assert labels is not None
        assert poses is not None
        rows = labels.frame_rows(len(sweeps))
        # a run with fewer instants shows some again
        for k in np.sort(rng.choice(len(sweeps), count, replace=len(sweeps) < count)).tolist():
            boxes = boxes_in_lidar(labels[rows[k]], poses[k] @ sweeps.ego_SE3_lidar)
            x, y, z = poses[k, :3, 3].tolist()
            pose = (x, y, z, float(heading(poses[k][None])[0]))
            yield LabelledFrame(sweeps.cloud(k), boxes, labels.category[rows[k]], pose, sweeps.scan(k))

    def require(self, split: str) -> None:
        """See that the split has runs.

        Raises:
            ArgumentError: there are too few to hold some back.
        """
        self._runs(split)

    def _runs(self, split: str) -> list[RunSpec]:
        """The runs of a split, which no other split has."""
        splits = split_of_scenes(len(self.runs), self.seed)
        own = [run for run, dealt in zip(self.runs, splits, strict=True) if dealt == split]
        if not own:
            raise ArgumentError(
                f"--scenario: {len(self.runs)} runs are too few for the split {split}: each run is in one "
                "split only; name more scenarios, or make fewer frames"
            )
        return own


@lru_cache(maxsize=64)
def _recorded(spec: RunSpec) -> tuple[RunRecording, ScenarioDefinition]:
    """What everybody did in a run."""
    definition = definition_of(spec)
    ego = ego_of(definition)
    others = tuple(entity for entity in definition.entities if entity.name != ego.name)
    log = execute(spec).log
    recording = recording_of_log(pd.DataFrame(log), spec.log, definition.map_path, others)
    return recording, definition
