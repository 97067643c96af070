"""Messages by name with the fields of rclpy's objects: attributes and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


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
    return SimpleNamespace(hypothesis=SimpleNamespace(class_id=class_id, score=score))


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
