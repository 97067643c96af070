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
import shutil
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from benchmarks.training_frames import ROOT, SOURCES, TRAINED_ON, frames_in, fresh_streets
from evaluation.runs.workers import available_cores
from evaluation.studies.detectors.quality import QualityOptions, measured_quality
from smartmot.lidar.learned import Decoder, PillarGrid, shipped_network

SHIPPED = ROOT / "smartmot" / "lidar" / "learned" / "weights"

SEED = 1
STEPS = (1300,)
"""Of each cycle: the rate of learning rises and falls anew in each, from the network of the one before
(Loshchilov, Hutter, "SGDR: Stochastic gradient descent with warm restarts", ICLR 2017)."""


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
