"""The shipped network with integers of 8 bits against itself in float32: F1 by class, and times.

    python -m benchmarks.lidar_int8 [--frames 300] [--kitti DIR] [--network FILE.onnx [--calibrate 300]]

The ranges of values of a file's network are found on streets of `lidar export --int8`; F1 is counted on
streets of other maps and another seed (those of `benchmarks.train_lidar --check`), at the least scores that
each network says, of labels with 10 points or more.
Both networks see the same frames: the interval is that of the difference, by drawing frames with replacement.
Ends with 1 where the F1 of a class differs by more than 0.02, or integers are no quicker.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.training_frames import fresh_streets
from evaluation.metrics.detection.from_above import LEAST_OVERLAP, ScoredBoxes, joined
from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.detectors.quality import QualityOptions, Truth, least_scores, matched_frame
from evaluation.studies.training.calibration import drawn_clouds, export_integers
from smartmot.lidar import BoxDetections, LearnedConfig, detect
from smartmot.lidar.learned import shipped_network

GREATEST_LOSS = 0.02
"""Of F1."""

RESAMPLES = 2000


class Side:
    """One of the two networks, and what it makes of the frames.

    Args:
        config: the network.
    """

    def __init__(self, config: LearnedConfig) -> None:
        self.config, self.least = replace(config, least_score=0.05), least_scores(config)
        self.parts: dict[str, list[ScoredBoxes]] = {name: [] for name in LEAST_OVERLAP}
        self.spent_ms: list[float] = []
        self.network_ms: list[float] = []

    def add(self, frame: Truth, asked: QualityOptions) -> None:
        """Detect and match a frame."""
        start_s = time.thread_time()
        made: BoxDetections = detect(frame.cloud, self.config)
        self.spent_ms.append(1e3 * (time.thread_time() - start_s))
        self.network_ms += [1e3 * stage.elapsed_s for stage in made.stages if stage.name == "network"]
        for name, matched in matched_frame(frame, made, asked).items():
            self.parts[name].append(matched)

    def counts(self, name: str) -> np.ndarray:
        """(F, 3) right and false boxes and labels of each frame."""
        rows = []
        for part in self.parts[name]:
            each = part.counts(self.least[name])
            rows.append((each.true_positives, each.false_positives, part.labels))
        return np.array(rows, dtype=np.float64)


def f1(counts: np.ndarray) -> float:
    """Of counts of frames."""
    right, false, labels = counts.sum(axis=0)
    return float(2.0 * right / max(right + false + labels, 1.0))


def compare(title: str, frames: Iterable[Truth], sides: tuple[Side, Side], asked: QualityOptions) -> float:
    """Print both networks on some frames; the greatest difference of F1 of a class."""
    for frame in frames:
        for side in sides:
            side.add(frame, asked)
    count = len(sides[0].spent_ms)
    print(f"{title}: {count} frames", flush=True)
    rng, greatest = np.random.default_rng(1), 0.0
    for name in LEAST_OVERLAP:
        plain, small = (side.counts(name) for side in sides)
        if not plain[:, 2].any():
            continue
        chosen = rng.integers(0, count, (RESAMPLES, count))
        drawn = [f1(small[rows]) - f1(plain[rows]) for rows in chosen]
        low, high = np.percentile(drawn, [2.5, 97.5])
        difference = f1(small) - f1(plain)
        best = [joined(side.parts[name]).best()[0] for side in sides]
        greatest = max(greatest, abs(difference))
        print(
            f"  {name:10} labels {int(plain[:, 2].sum()):5}  F1 float {f1(plain):.3f}, int8 {f1(small):.3f}: "
            f"{difference:+.3f} [{low:+.3f}, {high:+.3f}]; best F1 {best[0]:.3f}, {best[1]:.3f}",
            flush=True,
        )
    for word in ("spent_ms", "network_ms"):
        plain_ms, small_ms = (statistics.median(getattr(side, word)) for side in sides)
        name = {"spent_ms": "all", "network_ms": "network"}[word]
        print(f"  {name:10} float {plain_ms:.1f} ms, int8 {small_ms:.1f} ms: {small_ms / plain_ms:.2f}")
    return greatest


def main() -> int:
    """Make the network with integers, compare, judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--calibrate", type=int, default=300)
    parser.add_argument("--kitti", type=Path, help="KITTI object data, only told, not judged")
    parser.add_argument("--network", type=Path, help="another network than the shipped one")
    options = parser.parse_args()
    plain, small = shipped_network(), shipped_network("pillars_int8")
    with tempfile.TemporaryDirectory() as folder:
        if options.network is not None:
            path = Path(folder) / "int8.onnx"
            plain = LearnedConfig(options.network)
            export_integers(plain, drawn_clouds(options.calibrate), path)
            small = LearnedConfig(path)
        print(f"{plain.path.stat().st_size} bytes in float32, {small.path.stat().st_size} with integers")
        sides = Side(plain), Side(small)
        greatest = compare("fresh streets", fresh_streets(options.frames), sides, QualityOptions(10))
        quicker = statistics.median(sides[1].network_ms) < statistics.median(sides[0].network_ms)
        if options.kitti is not None:
            frames = (
                Truth(f.cloud, f.boxes, f.labels.category, f.unlabelled.covers if f.unlabelled else None)
                for f in read_frames(options.kitti)
            )
            compare("recorded", frames, (Side(plain), Side(small)), QualityOptions(5))
    passed = greatest <= GREATEST_LOSS and quicker
    print(f"greatest difference {greatest:.3f}: {'passed' if passed else 'missed'}")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
