"""Frames that the shipped pillar network learns from, and fresh ones that it is measured on.

LiDARs of `SOURCES` at heights from 1.4 to 2.1 m, pitched by up to 1.5 degrees, on the maps of `TRAINED_ON`.
No recording is looked at.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from evaluation.runs.workers import execute_all
from evaluation.studies.detectors.quality import Truth
from evaluation.studies.lidar.drawn import FRAMES_PER_STREET, drawn_frames
from evaluation.studies.training.samples import LabelledFrame, labelled_frame
from scenarios.sensors.lidar import Spinning, lidar_config
from smartmot.lidar.learned import PillarGrid
from smartmot.pointcloud import Boxes3D

ROOT = Path(__file__).parents[1]
DRAWN_MAPS = ROOT / "scenarios" / "drawn" / "maps"
TRAINED_ON = (
    *sorted((ROOT / "scenarios" / "maps").glob("*.xodr")),
    *(DRAWN_MAPS / f"{name}.xodr" for name in ("country_road", "cycle_bend", "straight_street")),
)
FRESH = tuple(path for path in sorted(DRAWN_MAPS.glob("*.xodr")) if path not in TRAINED_ON)
"""For tests."""


@dataclass(frozen=True, slots=True)
class Source:
    """Frames of one sensor.

    Args:
        sensor: its name.
        field_deg: horizontal field of view ahead, of spinning sensors.
        count: of frames, a multiple of `FRAMES_PER_STREET`.
        rough: crowded streets and poor sensors, see `drawn_frames`.
    """

    sensor: str
    field_deg: float
    count: int
    rough: bool = False


SOURCES = (
    Source("hdl64", 180.0, 800), Source("hdl64", 85.0, 480), Source("hdl32", 180.0, 400),
    Source("mid70", 70.4, 160),
    Source("hdl64", 180.0, 600, rough=True), Source("hdl64", 85.0, 920, rough=True),
    Source("hdl32", 180.0, 240, rough=True), Source("mid70", 70.4, 80, rough=True),
)  # fmt: skip
"""What is learned from. 85 degrees are the field of a camera's lens: clouds are often cut to it."""

HELD_OUT = (Source("hdl64", 180.0, 80), Source("hdl64", 85.0, 40), Source("hdl64", 85.0, 80, rough=True))
"""For the curves and for calibrating the scores, from other streets on the same maps."""


def street_frames(source: Source, seed: int, number: int) -> list[LabelledFrame]:
    """The labelled frames of a street."""
    grid, config = PillarGrid(), lidar_config(source.sensor)
    pattern = config.pattern
    if isinstance(pattern, Spinning):
        config = replace(config, pattern=replace(pattern, field_rad=math.radians(source.field_deg)))
    reach = math.hypot(grid.ahead_m[1], max(map(abs, grid.left_m)))
    first = FRAMES_PER_STREET * number
    frames = drawn_frames(
        TRAINED_ON,
        config,
        FRAMES_PER_STREET,
        seed,
        first=first,
        in_turn=True,
        varied=True,
        rough=source.rough,
    )
    kind = f"{source.sensor}_{source.field_deg:g}{'_rough' if source.rough else ''}"
    return [
        labelled_frame(
            f"{kind}_{first + k}",
            frame.cloud,
            frame.boxes,
            frame.category,
            reach,
        )
        for k, frame in enumerate(frames)
    ]


def drawn(source: Source, seed: int, workers: int) -> list[LabelledFrame]:
    """The frames of a source."""
    streets = list(range(source.count // FRAMES_PER_STREET))
    return [
        frame
        for street in execute_all(partial(street_frames, source, seed), streets, workers)
        for frame in street
    ]


_COLUMNS = ("points", "line", "center_m", "size_m", "yaw_rad", "category", "counts")


def packed(frames: list[LabelledFrame]) -> dict[str, np.ndarray]:
    """Frames as a few long arrays."""
    boxes = [frame.boxes for frame in frames]
    columns = {
        name: np.concatenate(
            [getattr(b if hasattr(b, name) else f, name) for f, b in zip(frames, boxes, strict=True)]
        )
        for name in _COLUMNS
    }
    columns["line"] = columns["line"].astype(np.uint8)
    columns["name"] = np.array([frame.name for frame in frames])
    columns["of_points"] = np.array([len(frame.points) for frame in frames])
    columns["of_boxes"] = np.array([len(frame.boxes) for frame in frames])
    return columns


def unpacked(columns: dict[str, np.ndarray]) -> list[LabelledFrame]:
    """Frames from the arrays of `packed`."""
    points, boxes = (np.cumsum(columns[key])[:-1] for key in ("of_points", "of_boxes"))
    parts = {
        name: np.split(columns[name], points if name in ("points", "line") else boxes) for name in _COLUMNS
    }
    return [
        LabelledFrame(
            str(name),
            parts["points"][k],
            parts["line"][k],
            Boxes3D(parts["center_m"][k], parts["size_m"][k], parts["yaw_rad"][k]),
            parts["category"][k],
            parts["counts"][k],
        )
        for k, name in enumerate(columns["name"])
    ]


def train_frames(out: Path, seed: int, workers: int) -> list[LabelledFrame]:
    """Frames to learn from."""
    return _frames(out, "train", SOURCES, 100_000 + seed, workers)


def held_out_frames(out: Path, seed: int, workers: int) -> list[LabelledFrame]:
    """Frames that only score a training."""
    return _frames(out, "held_out", HELD_OUT, 200_000 + seed, workers)


def _frames(
    out: Path, name: str, sources: tuple[Source, ...], seed: int, workers: int
) -> list[LabelledFrame]:
    """Those of some sources, each with a seed of its own."""
    return [
        frame
        for number, source in enumerate(sources)
        for frame in _kept_or_drawn(
            out / f"frames_{name}_{number}.npz", source, seed + 1000 * number, workers
        )
    ]


def _kept_or_drawn(path: Path, source: Source, seed: int, workers: int) -> list[LabelledFrame]:
    """The frames of a source, drawn, or as they were kept."""
    recipe = json.dumps([seed, asdict(source)])
    if not path.is_file():
        start_s = time.perf_counter()
        frames = drawn(source, seed, workers)
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part.npz")
        np.savez(unfinished, recipe=np.array(recipe), **packed(frames))
        unfinished.replace(path)
        print(f"{source}: drawn in {time.perf_counter() - start_s:.0f} s", flush=True)
    with np.load(path) as content:
        columns = {name: content[name] for name in content.files}
    if str(columns.pop("recipe")) != recipe:
        raise SystemExit(f"{path}: was drawn for another source or seed; delete it or name another folder")
    return unpacked(columns)


def fresh_streets(count: int, seed: int = 300_001) -> Iterator[Truth]:
    """Frames of a camera's field of a 64-line LiDAR on maps that are not learned from, heights drawn."""
    config = lidar_config("hdl64")
    assert isinstance(config.pattern, Spinning)
    config = replace(config, pattern=replace(config.pattern, field_rad=math.radians(90.0)))
    for frame in drawn_frames(FRESH, config, count, seed, varied=True):
        yield Truth(frame.cloud, frame.boxes, frame.category)
