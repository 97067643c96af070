"""The detectors on 20 real frames of a drive of KITTI, beside the plain chain; nothing was fitted to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarios.recorded.clouds.files import read_cloud
from scenarios.recorded.kitti_objects.calibration import read_calibration
from scenarios.recorded.kitti_objects.labels import read_objects
from smartmot.lidar import METHODS, detect
from smartmot.pointcloud.boxes import overlaps

DRIVE = next(
    (
        folder
        for above in Path(__file__).resolve().parents
        if (folder := above / "shared" / "lidar" / "kitti_sequence_0000").is_dir()
    ),
    None,
)
REACH_M, LEAST_OVERLAP, IMAGE_PX = 40.0, 0.3, (1242.0, 375.0)


@pytest.fixture(scope="module")
def counts() -> dict[str, dict[str, float]]:
    """False pedestrians a frame and recall of cyclists, by method: in the image, up to 40 m, from above."""
    if DRIVE is None:
        pytest.skip("the frames of KITTI are not beside the project")
    calibration = read_calibration(DRIVE / "calib_2011_09_26.txt")
    labels = read_objects(DRIVE / "label_02_0000.txt")
    result = {}
    for method, config in METHODS.items():
        false, hits, cyclists, frames = 0, 0, 0, 0
        for path in sorted((DRIVE / "velodyne").glob("*.bin")):
            detections = detect(read_cloud(path).cloud, config())
            center = detections.boxes.center_m
            camera = calibration.to_camera(center)
            pixel = camera @ calibration.projection[2][:, :3].T + calibration.projection[2][:, 3]
            u, v = pixel[:, 0] / pixel[:, 2], pixel[:, 1] / pixel[:, 2]
            seen = (camera[:, 2] > 0.0) & (u >= 0.0) & (u < IMAGE_PX[0]) & (v >= 0.0) & (v < IMAGE_PX[1])
            seen &= np.hypot(center[:, 0], center[:, 1]) <= REACH_M
            in_frame = np.char.endswith(labels.frame, path.stem)
            for category, kind in (("pedestrian", "Pedestrian"), ("cyclist", "Cyclist")):
                own = labels.chosen(in_frame & (labels.type_name == kind))
                truth = calibration.boxes_to_lidar(own.camera_box)
                boxes = detections.boxes[seen & (detections.category == category)]
                overlap = overlaps(truth, boxes)[0]
                if category == "pedestrian":
                    false += int((overlap.max(axis=0, initial=0.0) <= LEAST_OVERLAP).sum())
                else:
                    hits += int((overlap.max(axis=1, initial=0.0) > LEAST_OVERLAP).sum())
                    cyclists += len(truth)
            frames += 1
        result[method] = {"false pedestrians": false / frames, "cyclist recall": hits / cyclists}
    return result


def test_false_pedestrians_are_few(counts: dict[str, dict[str, float]]) -> None:
    assert counts["classical"]["false pedestrians"] <= 3.0
    assert counts["plain"]["false pedestrians"] > counts["classical"]["false pedestrians"]


def test_the_cyclist_is_found(counts: dict[str, dict[str, float]]) -> None:
    assert counts["classical"]["cyclist recall"] >= 0.9
