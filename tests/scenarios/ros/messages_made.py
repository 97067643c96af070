"""Messages by name with the fields of rclpy's objects: attributes and nothing else."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np


def header(time_ns: int = 0, frame_id: str = "") -> Any:
    sec, nanosec = divmod(time_ns, 1_000_000_000)
    return SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec), frame_id=frame_id)


def xyz(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    return SimpleNamespace(x=x, y=y, z=z)


def wxyz(w: float = 1.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    return SimpleNamespace(w=w, x=x, y=y, z=z)


def prediction(**fields: Any) -> Any:
    values = {
        "id": 0,
        "class_name": "car",
        "position": xyz(),
        "size": xyz(1.8, 4.4, 1.6),
        "velocity": xyz(),
        "z_rotation": 0.0,
        "score": 0.9,
    }
    return SimpleNamespace(**values | fields)


def predictions(*rows: Any, time_ns: int = 0, frame_id: str = "") -> Any:
    return SimpleNamespace(header=header(time_ns, frame_id), predictions=list(rows))


def hypothesis(class_id: str, score: float) -> Any:
    pose = SimpleNamespace(position=xyz(), orientation=wxyz())
    return SimpleNamespace(
        hypothesis=SimpleNamespace(class_id=class_id, score=score),
        pose=SimpleNamespace(pose=pose, covariance=np.zeros(36)),
    )


def detection_3d(position: Any, orientation: Any, size: Any, *results: Any, frame_id: str = "") -> Any:
    center = SimpleNamespace(position=position, orientation=orientation)
    return SimpleNamespace(
        header=header(0, frame_id),
        results=list(results),
        bbox=SimpleNamespace(center=center, size=size),
        id="",
    )


def detections_3d(*rows: Any, time_ns: int = 0, frame_id: str = "") -> Any:
    return SimpleNamespace(header=header(time_ns, frame_id), detections=list(rows))


def about_z(angle_rad: float) -> Any:
    return wxyz(math.cos(0.5 * angle_rad), 0.0, 0.0, math.sin(0.5 * angle_rad))


def odometry(
    time_ns: int,
    position: Any,
    orientation: Any,
    linear: Any | None = None,
    frame_id: str = "map",
    child_frame_id: str = "base_link",
) -> Any:
    pose = SimpleNamespace(position=position, orientation=orientation)
    twist = SimpleNamespace(linear=linear or xyz(), angular=xyz())
    return SimpleNamespace(
        header=header(time_ns, frame_id),
        child_frame_id=child_frame_id,
        pose=SimpleNamespace(pose=pose, covariance=np.zeros(36)),
        twist=SimpleNamespace(twist=twist, covariance=np.zeros(36)),
    )


def transform(time_ns: int, parent: str, child: str, translation: Any, rotation: Any) -> Any:
    return SimpleNamespace(
        header=header(time_ns, parent),
        child_frame_id=child,
        transform=SimpleNamespace(translation=translation, rotation=rotation),
    )


def transforms(*rows: Any) -> Any:
    return SimpleNamespace(transforms=list(rows))
