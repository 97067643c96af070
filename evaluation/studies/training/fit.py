"""Training of the pillar network on the processor, for so many steps or minutes; it can be taken up again."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from evaluation.errors import ArgumentError
from evaluation.metrics.detection.from_above import ScoredBoxes, joined
from evaluation.results.files import write_bytes
from evaluation.studies.training.network import PillarNetwork, loss_of
from evaluation.studies.training.quality import match_frame
from evaluation.studies.training.samples import (
    LEAST_POINTS,
    Batch,
    Changes,
    LabelledFrame,
    batch,
    changed_window,
)
from smartmot.lidar.learned import Decoder

CHECKPOINT, CURVES = "checkpoint.pt", "training.csv"

WARM_UP = 0.1
"""Share of the training in which the rate of learning rises; then it falls as a cosine (Smith, 2018)."""

LEAST_RATE = 0.01
"""Share of the greatest rate at the end."""

GREATEST_GRADIENT = 10.0
"""Norm to which larger gradients are cut."""

VALIDATIONS = 10
"""Times in a training that held-out frames are looked at."""

CURVE_FRAMES = 40
"""Of the held-out frames, at most as many are looked at before the end: each takes half as long as a step."""


@dataclass(frozen=True, slots=True)
class TrainingOptions:
    """How a network is trained.

    Args:
        steps: of so many frames each; None: as many as fit into the minutes.
        minutes: of wall time, where steps are not given.
        frames_per_step: of which a window each is in a batch.
        rate: greatest rate of learning.
        seed: of weights, order and changes.
        least_points: labels with fewer points are neither learned nor scored.
    """

    steps: int | None = None
    minutes: float = 20.0
    frames_per_step: int = 4
    rate: float = 3e-3
    seed: int = 1
    least_points: int = LEAST_POINTS

    def __post_init__(self) -> None:
        if (self.steps is not None and self.steps < 1) or not 0.0 < self.minutes < math.inf:
            raise ArgumentError("--steps and --minutes must be positive")
        if not 0.0 < self.rate < 1.0:
            raise ArgumentError(f"--rate must lie in (0, 1), got {self.rate:g}")


@dataclass(slots=True)
class Progress:
    """What a training has behind it.

    Args:
        step: taken.
        elapsed_s: wall time of them.
        rows: of the curves: step, elapsed seconds, rate, losses, and at validations F1 by class.
    """

    step: int = 0
    elapsed_s: float = 0.0
    rows: list[dict[str, float]] = field(default_factory=list)


class Training:
    """A training that can be taken up again.

    Args:
        folder: of checkpoint and curves.
        decoder: grid and classes.
        options: how it is trained.
        train: frames learned from.
        held_out: frames that only score it.
        start: weights that it starts with; None: drawn.

    Raises:
        ArgumentError: there is no frame to learn from, or the folder holds a training of other frames or
            with other options.
    """

    def __init__(
        self,
        folder: Path,
        decoder: Decoder,
        options: TrainingOptions,
        train: Sequence[LabelledFrame],
        held_out: Sequence[LabelledFrame],
        start: Mapping[str, torch.Tensor] | None = None,
    ) -> None:
        if not train:
            raise ArgumentError("nothing to learn from: the split 'train' has no frame")
        self.folder, self.decoder, self.options = folder, decoder, options
        self.train, self.held_out = train, held_out
        torch.manual_seed(options.seed)
        self.network = PillarNetwork(decoder)
        if start is not None:
            self.network.load_state_dict(start)
        self.optimizer = torch.optim.AdamW(self.network.parameters(), options.rate, weight_decay=0.01)
        self.progress = Progress()
        self.key = self._key(start)
        self._take_up()

    @property
    def share(self) -> float:
        """How much of the training is done, in [0, 1]."""
        if self.options.steps is not None:
            return min(self.progress.step / self.options.steps, 1.0)
        return min(self.progress.elapsed_s / (60.0 * self.options.minutes), 1.0)

    def run(self, report: Callable[[Progress, float], None]) -> None:
        """Train to the end; the checkpoint is written at each validation.

        Args:
            report: called after each step.

        Raises:
            TrainingError: a loss is not finite; the last checkpoint stays as it is.
        """
        # a thread makes the batch of the next step meanwhile
        with ThreadPoolExecutor(1) as maker:
            self._run(report, maker)

    def _run(self, report: Callable[[Progress, float], None], maker: ThreadPoolExecutor) -> None:
        validated = math.floor(self.share * VALIDATIONS)
        made = maker.submit(self._batch, self.progress.step)
        while self.share < 1.0:
            start_s = time.perf_counter()
            now, made = made.result(), maker.submit(self._batch, self.progress.step + 1)
            row = self._step(now)
            self.progress.step += 1
            self.progress.elapsed_s += time.perf_counter() - start_s
            row = {"step": self.progress.step, "elapsed_s": round(self.progress.elapsed_s, 3), **row}
            if math.floor(self.share * VALIDATIONS) > validated or self.share >= 1.0:
                validated = math.floor(self.share * VALIDATIONS)
                row |= self._validation()
                self.progress.rows.append(row)
                self._save()
            else:
                self.progress.rows.append(row)
            report(self.progress, self.share)

    def boxes(self, frames: Sequence[LabelledFrame], least_score: float = 0.05) -> dict[str, ScoredBoxes]:
        """By class, the boxes of frames against their labels."""
        return self._looked_at(frames, least_score)[0]

    def _looked_at(
        self, frames: Sequence[LabelledFrame], least_score: float
    ) -> tuple[dict[str, ScoredBoxes], list[float]]:
        """By class, the boxes of frames against their labels; and the loss of each frame."""
        parts: dict[str, list[ScoredBoxes]] = {name: [] for name in self.decoder.classes}
        losses = []
        least_points = self.options.least_points
        self.network.eval()
        with torch.no_grad():
            for frame in frames:
                made = batch([frame], [self.decoder], least_points)
                output = self._output(made)
                losses.append(sum(map(float, loss_of(output, made.targets, len(self.decoder.classes)))))
                boxes, score, category = self.decoder.decode(output[0].numpy(), least_score)
                for name, part in parts.items():
                    part.append(
                        match_frame(
                            name,
                            boxes,
                            score,
                            category,
                            frame.boxes,
                            frame.category,
                            frame.counts,
                            least_points,
                            self.decoder.grid,
                        )
                    )
        self.network.train()
        return {name: joined(part) for name, part in parts.items()}, losses

    def _output(self, made: Batch) -> torch.Tensor:
        """What the network says of some frames."""
        features, cell = torch.from_numpy(made.seen.features), torch.from_numpy(made.seen.cell)
        output: torch.Tensor = self.network(features, cell, len(made.names), made.shape)
        return output

    def _batch(self, step: int) -> Batch:
        """Changed windows of frames drawn for a step."""
        options = self.options
        # of the step alone, so that a training that is taken up again goes on as it would have
        rng = np.random.default_rng((options.seed, step))
        chosen = [self.train[k] for k in rng.integers(0, len(self.train), options.frames_per_step).tolist()]
        pairs = [
            changed_window(frame, Changes(), rng, self.decoder, options.least_points) for frame in chosen
        ]
        return batch([part for part, _ in pairs], [own for _, own in pairs], options.least_points)

    def _step(self, made: Batch) -> dict[str, float]:
        """Learn from a batch."""
        options = self.options
        rate = _rate(self.share, options.rate)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.network.train()
        output = self._output(made)
        of_scores, of_boxes = loss_of(output, made.targets, len(self.decoder.classes))
        loss = of_scores + of_boxes
        if not bool(torch.isfinite(loss)):
            raise TrainingError(
                f"step {self.progress.step + 1}: the loss is not finite; frames {', '.join(made.names)}. "
                f"Look at them (lidar dataset show), or learn more slowly: --rate {0.3 * options.rate:g}. "
                f"{CHECKPOINT} holds the state of the last validation"
            )
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), GREATEST_GRADIENT)
        self.optimizer.step()
        return {
            "rate": rate,
            "loss_scores": float(of_scores.detach()),
            "loss_boxes": float(of_boxes.detach()),
        }

    def _validation(self) -> dict[str, float]:
        if not self.held_out:
            return {}
        step = math.ceil(len(self.held_out) / CURVE_FRAMES)
        by_class, losses = self._looked_at(self.held_out[::step], 0.05)
        return {"loss_held_out": float(np.mean(losses))} | {
            f"f1_{name}": boxes.best()[0] for name, boxes in by_class.items()
        }

    def _key(self, start: Mapping[str, torch.Tensor] | None) -> str:
        """Hash of all that the result depends on."""
        options = asdict(self.options) | {"minutes": None if self.options.steps else self.options.minutes}
        hashed = hashlib.sha256(repr((options, self.decoder)).encode())
        for name, value in sorted((start or {}).items()):
            hashed.update(name.encode() + value.numpy().tobytes())
        for split, frames in (("train", self.train), ("val", self.held_out)):
            for frame in frames:
                boxes = frame.boxes
                hashed.update(repr((split, frame.name, frame.category.tolist(), frame.points.shape)).encode())
                hashed.update(frame.points.tobytes() + frame.line.tobytes() + frame.counts.tobytes())
                hashed.update(boxes.center_m.tobytes() + boxes.size_m.tobytes() + boxes.yaw_rad.tobytes())
        return hashed.hexdigest()

    def _save(self) -> None:
        state = {
            "key": self.key,
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.progress.step,
            "elapsed_s": self.progress.elapsed_s,
            "rows": self.progress.rows,
        }
        path = self.folder / CHECKPOINT
        unfinished = path.with_suffix(".part")
        torch.save(state, unfinished)
        unfinished.replace(path)
        columns = ["step", "elapsed_s", "rate", "loss_scores", "loss_boxes", "loss_held_out"]
        columns += [f"f1_{name}" for name in self.decoder.classes]
        lines = [",".join(columns)]
        lines += [
            ",".join(f"{row[name]:.6g}" if name in row else "" for name in columns)
            for row in self.progress.rows
        ]
        write_bytes(self.folder / CURVES, ("\n".join(lines) + "\n").encode())

    def _take_up(self) -> None:
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        state = read_checkpoint(path)
        if state["key"] != self.key:
            raise ArgumentError(
                f"{self.folder}: holds a training of other frames or with other options; "
                "name another folder, or delete it"
            )
        self.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.progress = Progress(state["step"], state["elapsed_s"], state["rows"])


class TrainingError(ArgumentError):
    """A training cannot go on."""


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The state of a training; nothing but tensors and plain values is loaded.

    Raises:
        ArgumentError: the file is damaged, or holds something else.
    """
    try:
        state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        missing = {"key", "network", "optimizer", "step", "elapsed_s", "rows"} - set(state)
    except Exception as error:  # torch raises whatever its readers do
        line = (str(error).splitlines() or [""])[0][:160]
        raise ArgumentError(f"{path}: is no checkpoint of a training, or damaged: {line}") from None
    if missing:
        raise ArgumentError(f"{path}: is no checkpoint of a training: {', '.join(sorted(missing))} missing")
    return state


def _rate(share: float, greatest: float) -> float:
    """The rate of learning at a share of the training."""
    if share < WARM_UP:
        return greatest * max(share / WARM_UP, 0.05)
    fall = 0.5 * (1.0 + math.cos(math.pi * (share - WARM_UP) / (1.0 - WARM_UP)))
    return greatest * (LEAST_RATE + (1.0 - LEAST_RATE) * fall)
