"""Trains the shipped pillar network on simulated streets and writes it with its card.

    python -m benchmarks.train_lidar [--steps N ...] [--seed N] [--out DIR] [--ship]
    python -m benchmarks.train_lidar --check [--check-frames N]

All frames are drawn here: LiDARs of `SOURCES` at heights from 1.4 to 2.1 m, pitched by up to 1.5 degrees, on
the maps of `TRAINED_ON`. No recording is looked at. `frames_*.npz` in the folder keep what was drawn, and a
second run goes on where a training was stopped. `--ship` copies network and card into
`smartmot/lidar/learned/weights`. The result depends on the kind of processor, on the number of threads
(`OMP_NUM_THREADS`), which the card says, and on the version of PyTorch. `--check` measures the shipped
network on streets of other maps and another seed, which needs neither PyTorch nor what was drawn.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from evaluation.runs.workers import available_cores, execute_all
from evaluation.studies.detectors.quality import QualityOptions, Truth, measured_quality
from evaluation.studies.lidar.drawn import FRAMES_PER_STREET, drawn_frames
from evaluation.studies.training.samples import LabelledFrame, labelled_frame
from scenarios.sensors.lidar import Spinning, lidar_config
from smartmot.lidar.learned import Decoder, PillarGrid, shipped_network
from smartmot.pointcloud import Boxes3D

ROOT = Path(__file__).parents[1]
SHIPPED = ROOT / "smartmot" / "lidar" / "learned" / "weights"
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

SEED = 1
STEPS = (1300,)
"""Of each cycle: the rate of learning rises and falls anew in each, from the network of the one before
(Loshchilov, Hutter, "SGDR: Stochastic gradient descent with warm restarts", ICLR 2017)."""


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
            parts["line"][k].astype(np.int64),
            Boxes3D(parts["center_m"][k], parts["size_m"][k], parts["yaw_rad"][k]),
            parts["category"][k],
            parts["counts"][k],
        )
        for k, name in enumerate(columns["name"])
    ]


def frames_in(out: Path, seed: int, workers: int) -> tuple[list[LabelledFrame], list[LabelledFrame]]:
    """Frames to learn from and held out ones; each source has a seed of its own."""
    train, held_out = (
        [
            frame
            for number, source in enumerate(sources)
            for frame in _kept_or_drawn(
                out / f"frames_{name}_{number}.npz", source, first + seed + 1000 * number, workers
            )
        ]
        for name, first, sources in (("train", 100_000, SOURCES), ("held_out", 200_000, HELD_OUT))
    )
    return train, held_out


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


def check(count: int) -> None:
    """Print right and false boxes of the shipped network on fresh streets."""
    frames = list(fresh_streets(count))
    for asked in (
        QualityOptions(10),
        QualityOptions(10, (0.0, 20.0)),
        QualityOptions(10, (20.0, 40.0)),
        QualityOptions(50),
    ):
        boxes, _ = measured_quality(frames, shipped_network(least_score=0.05), asked)
        for name, each in boxes.items():
            counts = each.counts(0.3)
            right, false = counts.true_positives, counts.false_positives
            best, at = each.best()
            low, high = asked.range_m
            print(
                f"{low:2.0f} to {high:.0f} m, {asked.least_points} points: {name:10} labels {each.labels:4} "
                f"right {right:4} false {false:4} F1 {each.f1(0.3):.3f}, best {best:.3f} at {at:g}",
                flush=True,
            )


def main() -> None:
    """Draw, train, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="of each cycle")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "shipped_network")
    parser.add_argument("--workers", type=int, default=available_cores())
    parser.add_argument("--draw-only", action="store_true", help="draw the frames and stop")
    parser.add_argument("--check", action="store_true", help="only measure the shipped network")
    parser.add_argument("--check-frames", type=int, default=100)
    parser.add_argument("--ship", action="store_true", help="copy network and card into the package")
    options = parser.parse_args()
    if options.check:
        check(options.check_frames)
        return
    train, held_out = frames_in(options.out, options.seed, options.workers)
    if options.draw_only:
        return
    from evaluation.studies.training.fit import Progress, Training, TrainingOptions
    from evaluation.studies.training.study import CARD, CLASSES, NETWORK, Frames
    from evaluation.studies.training.study import train as trained

    def report(progress: Progress, share: float) -> None:
        row = progress.rows[-1]
        if "loss_held_out" in row or progress.step % 20 == 0:
            values = " ".join(f"{name} {value:.3g}" for name, value in row.items())
            print(f"{100 * share:.0f} %: {values}", flush=True)

    frames, start = Frames(train, held_out, ()), None
    for number, steps in enumerate(options.steps, 1):
        folder = options.out / f"cycle_{number}"
        folder.mkdir(exist_ok=True)
        asked = TrainingOptions(steps=steps, seed=options.seed + 1000 * (number - 1))
        if number == len(options.steps):
            trained(folder, frames, asked, report, start)
        else:
            training = Training(folder, Decoder(PillarGrid(), CLASSES), asked, train, held_out, start)
            training.run(report)
            start = training.network.state_dict()
    print((folder / CARD).read_text())
    if options.ship:
        SHIPPED.mkdir(exist_ok=True)
        card = json.loads((folder / CARD).read_text()) | {
            "made_by": "python -m benchmarks.train_lidar --ship --steps " + " ".join(map(str, options.steps)),
            "cycles": list(options.steps),
            "sources": [asdict(source) for source in SOURCES],
            "maps": [path.name for path in TRAINED_ON],
            "versions": {name: version(name) for name in ("torch", "numpy", "onnx")},
        }
        shutil.copyfile(folder / NETWORK, SHIPPED / "pillars.onnx")
        (SHIPPED / "pillars.json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
