"""How well anything that carries on a state can forecast: the labels' own motion, carried on by physics.

    python -m benchmarks.forecast_bound [--kitti DIR] [--argoverse2 DIR]

No detector, no tracker: the state at a time is a parabola through the exact labels around it, so that
velocity, acceleration and turn rate are those that the object has at that moment. `past` takes the labels of
the second before, which is what a perfect detector shows; `known` takes those of half a second on both sides,
half a second of the future among them, which no forecaster has. It is carried on over 3 s with constant
velocity (cv), with an acceleration and a turn rate that fade over some time, with constant ones (ca, ctra),
and with the best of all these for each forecast, chosen by the true place (`best`).

Printed: mean distance at 3 s of objects that move 0.5 m/s or more on average, as `smartmot-eval mot` counts
them, over all labels that are known 3 s later (`all`) and over those a second or more after their object's
first (`followed`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evaluation.metrics.forecast_quality import FOLLOWED_S, HORIZONS_S, MOVING_MPS
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.formats import read_dataset
from smartmot.filters.motion_models import fading_positions
from smartmot.types import BoolArray, FloatArray

SHARED = Path(__file__).parents[2] / "shared"
CATEGORIES = ("car", "pedestrian", "cyclist")
HORIZON_S = HORIZONS_S[-1]
WINDOWS_S = {"past": (-FOLLOWED_S, 0.0), "known": (-0.5, 0.5)}
"""Labels that a state is taken from, around its time."""

MEMORIES_S = (0.25, 0.5, 1.0, 2.0, 1e6)
"""Times over which accelerations and turn rates fade; the last stands for never."""

MODELS = {"cv": (0.0, 0.0), "fading": (0.5, 1.0), "ca": (1e6, 0.0), "ctra": (1e6, 1e6)}
"""Memory of the acceleration and of the turn rate; `fading` is the shipped forecast by category."""

_LEAST_MEMORY_S = 1e-9


def states(
    stamp_s: FloatArray, center_m: FloatArray, window_s: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States of one object at the times of which its place 3 s later is known.

    Args:
        stamp_s: (L,) times, ascending.
        center_m: (L, 2) places.
        window_s: Labels that the state is taken from.

    Returns:
        (R,) ages since the first label, (R, 3, 2) velocities, accelerations and true ways over the 3 s, and
        (R,) the time that these took.
    """
    tolerance_s = 0.5 * float(np.median(np.diff(stamp_s))) if len(stamp_s) > 1 else 0.0
    age_s, motion, elapsed_s = [], [], []
    for k, now in enumerate(stamp_s.tolist()):
        then = int(np.argmin(np.abs(stamp_s - now - HORIZON_S)))
        near = (stamp_s >= now + window_s[0] - tolerance_s) & (stamp_s <= now + window_s[1] + tolerance_s)
        if abs(stamp_s[then] - now - HORIZON_S) > tolerance_s:
            continue
        time = stamp_s[near] - now
        # Through the place itself: velocity and half the acceleration remain. Two labels tell a velocity, one
        # tells nothing, as the first detection of a track.
        terms = time[:, None] ** np.arange(1, min(3, len(time)))
        fit = np.zeros((2, 2))
        fit[: terms.shape[1]] = np.linalg.lstsq(terms, center_m[near] - center_m[k], rcond=None)[0]
        age_s.append(now - stamp_s[0])
        motion.append((fit[0], 2.0 * fit[1], center_m[then] - center_m[k]))
        elapsed_s.append(stamp_s[then] - now)
    return np.array(age_s), np.reshape(motion, (-1, 3, 2)), np.array(elapsed_s)


def errors_m(motion: FloatArray, elapsed_s: FloatArray, memories_s: tuple[float, float]) -> FloatArray:
    """(R,) distances at 3 s of states (R, 3, 2) carried on; memories of acceleration and turn rate."""
    velocity, acceleration, true = motion[:, 0], motion[:, 1], motion[:, 2]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    course = velocity / np.maximum(speed, 1e-9)[:, None]
    along = (acceleration * course).sum(axis=1)
    across = course[:, 0] * acceleration[:, 1] - course[:, 1] * acceleration[:, 0]
    origin, fade_s, turn_s = np.zeros(len(motion)), *memories_s
    moved, _ = fading_positions(
        origin,
        origin,
        np.arctan2(velocity[:, 1], velocity[:, 0]),
        speed,
        across / np.maximum(speed, 0.5),
        along if fade_s else origin,
        np.full(len(motion), turn_s),
        max(fade_s, _LEAST_MEMORY_S),
        elapsed_s[:, None],
    )
    return np.asarray(np.linalg.norm(moved[:, 0] - true, axis=1))


def objects(sequence: Sequence, category: str) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Times and places of each labelled object of a category."""
    labels = sequence.labels
    assert labels is not None
    labels = labels[labels.category == category]
    for identity in np.unique(labels.object_id).tolist():
        own = labels[labels.object_id == identity]
        order = np.argsort(own.frame)
        yield sequence.stamp_s[own.frame[order]], own.center_m[order]


def bounds(folder: Path) -> Iterator[str]:
    """Lines of the table of a data set."""
    data = read_dataset(folder)
    for category in CATEGORIES:
        for window, window_s in WINDOWS_S.items():
            parts = [
                states(stamp_s, center_m, window_s)
                for sequence in data.sequences
                for stamp_s, center_m in objects(sequence, category)
            ]
            age_s, motion, elapsed_s = (np.concatenate(column) for column in zip(*parts, strict=True))
            # the nearest label to 3 s may be half a frame off, as in `evaluation.metrics.forecast_quality`
            moving = np.linalg.norm(motion[:, 2], axis=1) >= MOVING_MPS * elapsed_s
            followed = moving & (age_s >= FOLLOWED_S - 0.05)
            by_model = {name: errors_m(motion, elapsed_s, memories) for name, memories in MODELS.items()}
            choices = [(a, t) for a in (0.0, *MEMORIES_S) for t in (0.0, *MEMORIES_S)]
            by_model["best"] = np.min([errors_m(motion, elapsed_s, each) for each in choices], axis=0)
            for name, rows in (("all", moving), ("followed", followed)):
                if not rows.any():
                    continue
                yield _line(category, window, name, rows, by_model)


def _line(
    category: str, window: str, rows_name: str, rows: BoolArray, by_model: dict[str, FloatArray]
) -> str:
    values = "".join(f"{name:>9} {error[rows].mean():5.2f}" for name, error in by_model.items())
    return f"  {category:<11}{window:<6}{rows_name:<9}{np.count_nonzero(rows):>6}{values}"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=SHARED / "kitti")
    parser.add_argument("--argoverse2", type=Path, default=SHARED / "argoverse2" / "detections_2hz")
    arguments = parser.parse_args()
    print("FDE at 3 s of moving objects, m: labels carried on")
    for name, folder in (("KITTI", arguments.kitti), ("Argoverse 2", arguments.argoverse2)):
        print(f"{name}\n  category   state of rows  forecasts")
        for line in bounds(folder):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
