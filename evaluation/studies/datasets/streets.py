"""Frames of simulated streets drawn at random."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from evaluation.studies.datasets.frames import LabelledFrame
from evaluation.studies.lidar.drawn import FRAMES_PER_STREET, drawn_frames
from scenarios.recorded.layouts.scenes import ScenePlace
from scenarios.sensors.lidar import LidarConfig


@dataclass(frozen=True, slots=True)
class Streets:
    """Streets with furniture, clutter and road users; each is a scene.

    Args:
        maps: OpenDRIVE files, taken by turns.
        config: the LiDAR on its mount.
        seed: of all that is drawn.
    """

    maps: tuple[Path, ...]
    config: LidarConfig
    seed: int

    @property
    def frames_per_scene(self) -> int:
        """The same street is seen from so many places, with other road users."""
        return FRAMES_PER_STREET

    def require(self, split: str) -> None:
        """Streets are drawn for any split."""

    def frames(self, place: ScenePlace, count: int) -> Iterator[LabelledFrame]:
        """The first frames of a scene."""
        first = FRAMES_PER_STREET * place.number
        drawn = drawn_frames(
            self.maps,
            self.config,
            count,
            self.seed,
            first=first,
            mount=self.config.mount,
            in_turn=True,
            varied=True,
        )
        for scan, frame in enumerate(drawn, first):
            ego = frame.ego
            yield LabelledFrame(
                frame.cloud, frame.boxes, frame.category, (ego.x_m, ego.y_m, 0.0, ego.yaw_rad), scan
            )
