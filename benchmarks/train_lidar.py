"""Trains the shipped pillar network on simulated streets and writes it with its card.

    python -m benchmarks.train_lidar [--steps N ...] [--seed N] [--out DIR] [--ship]
    python -m benchmarks.train_lidar --ship-integers [--out DIR]
    python -m benchmarks.train_lidar --check [--check-frames N]

All frames are those of `benchmarks.training_frames`. `frames_*.npz` in the folder keep what was drawn, and a
second run goes on where a training was stopped. `--ship` copies network and card into
`smartmot/lidar/learned/weights` and does what `--ship-integers` does alone: it makes the network of 8 bits of
the shipped one, and writes into both cards what the held-out frames say of their scores. The result depends
on the kind of processor, on the number of threads (`OMP_NUM_THREADS`), which the card says, and on the
version of PyTorch. `--check` measures the shipped network on streets of other maps and another seed. Neither
it nor `--ship-integers` needs PyTorch.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from benchmarks.training_frames import (
    ROOT,
    SOURCES,
    TRAINED_ON,
    fresh_streets,
    held_out_frames,
    train_frames,
)
from evaluation.metrics.detection.from_above import ScoredBoxes, joined
from evaluation.runs.workers import available_cores
from evaluation.studies.detectors.quality import QualityOptions, least_scores, measured_quality
from evaluation.studies.training import CALIBRATION_CLOUDS
from evaluation.studies.training.calibration import drawn_clouds, export_integers
from evaluation.studies.training.quality import match_frame
from evaluation.studies.training.samples import LEAST_POINTS, LabelledFrame
from smartmot.lidar.learned import (
    Decoder,
    LearnedConfig,
    PillarGrid,
    pillars_of,
    shipped_card,
    shipped_network,
    shipped_path,
)

FLOAT, INTEGERS = "pillars", "pillars_int8"

LEAST_BOX_SCORE = 0.05
"""Of boxes that are looked at for the best F1."""

SHIPPED = ROOT / "smartmot" / "lidar" / "learned" / "weights"

SEED = 1
STEPS = (1300,)
"""Of each cycle: the rate of learning rises and falls anew in each, from the network of the one before
(Loshchilov, Hutter, "SGDR: Stochastic gradient descent with warm restarts", ICLR 2017)."""


def held_out_quality(config: LearnedConfig, frames: Sequence[LabelledFrame]) -> dict[str, ScoredBoxes]:
    """By class, boxes of a network's file against the labels of held-out frames, as in a training."""
    network = config.network
    parts: dict[str, list[ScoredBoxes]] = {name: [] for name in network.decoder.classes}
    for frame in frames:
        seen = pillars_of(frame.points[:, :2], frame.points[:, 2], network.grid)
        boxes, score, category = network.decoder.decode(network.run(seen), LEAST_BOX_SCORE)
        for name, part in parts.items():
            part.append(
                match_frame(
                    name, boxes, score, category, frame.boxes, frame.category, frame.counts, LEAST_POINTS,
                    network.grid,
                )
            )  # fmt: skip
    return {name: joined(part) for name, part in parts.items()}


def ship_integers(held_out: Sequence[LabelledFrame]) -> None:
    """Write the network of 8 bits and the cards of both."""
    path = shipped_path(INTEGERS)
    export_integers(LearnedConfig(shipped_path(FLOAT)), drawn_clouds(CALIBRATION_CLOUDS), path)
    cards = {FLOAT: shipped_card(FLOAT)}
    cards[INTEGERS] = {
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "bytes": path.stat().st_size,
        "classes": cards[FLOAT]["classes"],
        "training": cards[FLOAT]["training"],
        "maps": cards[FLOAT]["maps"],
        "made_of": cards[FLOAT]["sha256"],
        "made_by": "python -m benchmarks.train_lidar --ship-integers",
        "calibration_clouds": CALIBRATION_CLOUDS,
    }
    for name, card in cards.items():
        best = {
            kind: {"labels": each.labels, "f1": round(each.best()[0], 4), "least_score": each.best()[1]}
            for kind, each in held_out_quality(LearnedConfig(shipped_path(name)), held_out).items()
        }
        card |= {"least_score": [each["least_score"] for each in best.values()], "held_out": best}
        (SHIPPED / f"{name}.json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def check(count: int) -> None:
    """Print right and false boxes of the shipped network on fresh streets."""
    frames, least = list(fresh_streets(count)), least_scores(shipped_network())
    for asked in (
        QualityOptions(10),
        QualityOptions(10, (0.0, 20.0)),
        QualityOptions(10, (20.0, 40.0)),
        QualityOptions(50),
    ):
        boxes, _ = measured_quality(frames, shipped_network(least_score=LEAST_BOX_SCORE), asked)
        for name, each in boxes.items():
            counts = each.counts(least[name])
            right, false = counts.true_positives, counts.false_positives
            best, at = each.best()
            low, high = asked.range_m
            print(
                f"{low:2.0f} to {high:.0f} m, {asked.least_points} points: {name:10} labels {each.labels:4} "
                f"right {right:4} false {false:4} F1 {each.f1(least[name]):.3f} at {least[name]:g}, best "
                f"{best:.3f} at {at:g}",
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
    parser.add_argument("--ship-integers", action="store_true", help="of the shipped network, of 8 bits")
    parser.add_argument("--check", action="store_true", help="only measure the shipped network")
    parser.add_argument("--check-frames", type=int, default=100)
    parser.add_argument("--ship", action="store_true", help="copy network and card into the package")
    options = parser.parse_args()
    if options.check:
        check(options.check_frames)
        return
    if options.ship_integers:
        ship_integers(held_out_frames(options.out, options.seed, options.workers))
        return
    train = train_frames(options.out, options.seed, options.workers)
    held_out = held_out_frames(options.out, options.seed, options.workers)
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
        shutil.copyfile(folder / NETWORK, shipped_path(FLOAT))
        (SHIPPED / f"{FLOAT}.json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
        ship_integers(held_out)


if __name__ == "__main__":
    main()
