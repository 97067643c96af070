"""Networks with integers of 8 bits: the clouds by which the ranges of values are found, and the file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.lidar.drawn import drawn_frames
from evaluation.studies.training.graphs import is_quantised, quantised, write_network
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map
from scenarios.sensors.lidar import lidar_config
from smartmot.lidar.learned import LearnedConfig, Pillars
from smartmot.lidar.learned.detector import seen_in
from smartmot.pointcloud import PointCloud

SENSOR, SEED = "hdl64", 500_001
"""Of clouds that are drawn for it. The seed is that of no training or test."""


def drawn_clouds(count: int) -> Iterator[PointCloud]:
    """Clouds of streets drawn at random on the shipped maps."""
    maps = tuple(map(shipped_map, SHIPPED_MAPS))
    for frame in drawn_frames(maps, lidar_config(SENSOR), count, SEED, varied=True):
        yield frame.cloud


def dataset_clouds(folder: Path, count: int) -> Iterator[PointCloud]:
    """The first clouds of a data set's split "train".

    Raises:
        DatasetError: the data set is in no known layout, or damaged.
        ArgumentError: the split has no frame.
    """
    frames = (frame.cloud for frame in read_frames(folder) if frame.split == "train")
    first = next(frames, None)
    if first is None:
        raise ArgumentError(f"{folder}: the split 'train' has no frame")
    yield first
    yield from islice(frames, count - 1)


def export_integers(
    source: LearnedConfig,
    clouds: Iterable[PointCloud],
    out: Path,
    done: Callable[[int], None] = lambda number: None,
) -> str:
    """Write a network with integers of 8 bits.

    Args:
        source: the network.
        clouds: by which the ranges of values are found.
        out: the file.
        done: called after each cloud with its number.

    Returns:
        The SHA-256 of the file.

    Raises:
        ArgumentError: there is no cloud, or the network has integers already.
        ConfigError: the network cannot be loaded.
    """
    grid, content = source.network.grid, source.path.read_bytes()
    if is_quantised(content):
        raise ArgumentError(f"{source.path}: has integers of 8 bits already; name the network it was made of")

    def seen() -> Iterator[Pillars]:
        for number, cloud in enumerate(clouds, 1):
            pillars = seen_in(cloud, grid)
            done(number)
            if len(pillars):
                yield pillars

    return write_network(out, quantised(content, seen()))
