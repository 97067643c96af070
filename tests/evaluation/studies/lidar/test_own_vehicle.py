"""Boxes around the sensor itself, of clouds that were recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluation.studies.lidar.detect import detected_cloud
from scenarios.recorded.clouds.fields import NamedCloud
from smartmot.lidar import LearnedConfig, detect
from smartmot.lidar.learned import Decoder, PillarGrid
from smartmot.pointcloud import PointCloud
from tests.networks import upright_network


def test_the_vehicle_that_carries_the_sensor_is_not_detected(tmp_path: Path) -> None:
    """Points of its roof or bonnet make a box around the sensor, such as in raw sweeps of nuScenes."""
    pytest.importorskip("onnxruntime")
    path = tmp_path / "upright.onnx"
    path.write_bytes(upright_network(Decoder(PillarGrid(), ("car", "pedestrian"))))
    own, other = ([[x, 0.05, z] for z in np.linspace(-1.6, 0.1, 20)] for x in (0.05, 7.5))
    ground = [[x, y, -1.7] for x in np.arange(1.0, 20.0) for y in np.arange(-6.0, 7.0)]
    cloud = PointCloud(np.array(own + other + ground))
    assert len(detect(cloud, LearnedConfig(path))) == 2
    detected = detected_cloud(NamedCloud("cloud", cloud), LearnedConfig(path))
    boxes = detected.detections.boxes
    assert boxes.center_m[:, 0].tolist() == pytest.approx([7.4], abs=0.3)
    assert len(detected.detections.box_cluster) == 1
