"""Makes the boxes of this folder and what nuscenes-devkit 1.2.0 says of them.

python make_values.py, with nuscenes-devkit==1.2.0 and pyquaternion installed, from the project's root.
"""

import json
from pathlib import Path

import numpy as np
from nuscenes.eval.common.data_classes import EvalBoxes
from nuscenes.eval.common.utils import center_distance
from nuscenes.eval.detection.algo import accumulate, calc_ap, calc_tp
from nuscenes.eval.detection.data_classes import DetectionBox
from pyquaternion import Quaternion

from scenarios.recorded.kitti_objects.labels import read_objects

FOLDER = Path(__file__).parent
SIZES = {"Car": (1.5, 1.8, 4.2), "Pedestrian": (1.75, 0.6, 0.8), "Cyclist": (1.7, 0.6, 1.8)}
NAMES = {"Car": "car", "Pedestrian": "pedestrian", "Cyclist": "bicycle"}


def line(name: str, box: np.ndarray, score: float | None = None) -> str:
    numbers = " ".join(f"{value:.4f}" for value in box)
    return f"{name} 0 0 0 100 100 200 200 {numbers}" + ("" if score is None else f" {score:.2f}")


def make_lines() -> None:
    rng = np.random.default_rng(7)
    for frame in range(8):
        labels, results = [], []
        for name, size in SIZES.items():
            for _ in range(rng.integers(2, 6)):
                place = (rng.uniform(-15, 15), 1.6, rng.uniform(5, 45), rng.uniform(-3.1, 3.1))
                box = np.array([*size, *place])
                labels.append(line(name, box))
                for _ in range(rng.choice((0, 1, 1, 1, 2))):
                    spread = np.array([0.1, 0.1, 0.2, 0.6, 0.1, 0.6, 0.3])
                    noisy = np.maximum(box + rng.normal(0, spread), [0.2, 0.2, 0.2, -99, -99, -99, -99])
                    results.append(line(name, noisy, rng.choice((0.9, 0.8, 0.8, rng.random()))))
            for _ in range(2):
                ghost = np.array([*size, rng.uniform(-15, 15), 1.6, rng.uniform(5, 45), 0.0])
                results.append(line(name, ghost, 0.6 * rng.random()))
        for kind, lines in (("labels", labels), ("results", results)):
            (FOLDER / kind).mkdir(exist_ok=True)
            (FOLDER / kind / f"{frame:06d}.txt").write_text("\n".join(lines) + "\n")


def eval_boxes(kind: str) -> EvalBoxes:
    lines = read_objects(FOLDER / kind)
    boxes = EvalBoxes()
    for frame in lines.frames:
        boxes.add_boxes(frame, [])
    for k in range(len(lines)):
        center, (length, width, height) = lines.boxes.center_m[k], lines.boxes.size_m[k]
        turn = Quaternion(axis=[0, 0, 1], radians=float(lines.boxes.yaw_rad[k]))
        box = DetectionBox(
            sample_token=str(lines.frame[k]),
            translation=tuple(map(float, center)),
            size=(float(width), float(length), float(height)),
            rotation=tuple(map(float, turn)),
            velocity=(0.0, 0.0),
            num_pts=1,
            detection_name=NAMES[str(lines.type_name[k])],
            detection_score=float(lines.score[k]) if kind == "results" else -1.0,
            attribute_name="",
        )
        boxes.add_boxes(str(lines.frame[k]), [box])
    return boxes


def main() -> None:
    make_lines()
    truth, results = eval_boxes("labels"), eval_boxes("results")
    values = {}
    for name, theirs in NAMES.items():
        curves = {d: accumulate(truth, results, theirs, center_distance, d) for d in (0.5, 1.0, 2.0, 4.0)}
        errors = {key: calc_tp(curves[2.0], 0.1, key) for key in ("trans_err", "scale_err", "orient_err")}
        values[name] = {"ap": [float(calc_ap(curve, 0.1, 0.1)) for curve in curves.values()], **errors}
    (FOLDER / "devkit.json").write_text(json.dumps(values, indent=1) + "\n")


if __name__ == "__main__":
    main()
