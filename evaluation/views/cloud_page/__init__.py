"""Labelled clouds as one HTML page, to turn, zoom and step through; it needs no network."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from smartmot.arrays import IntArray, StrArray
from smartmot.pointcloud import Boxes3D, PointCloud

TEMPLATE = Path(__file__).with_name("cloud.html")

UNITS_PER_M = 100
"""Places are whole centimetres in 16 bits: up to 327 m."""

_FARTHEST = 32_767


@dataclass(frozen=True, slots=True, eq=False)
class ShownCloud:
    """A cloud with its labels.

    Args:
        title: of the frame.
        cloud: sensor's frame.
        boxes: K boxes in that frame.
        category: (K,) names.
        points: (K,) points in each box.
    """

    title: str
    cloud: PointCloud
    boxes: Boxes3D
    category: StrArray
    points: IntArray


def cloud_page(clouds: Iterable[ShownCloud], title: str) -> str:
    """The page of clouds.

    Args:
        clouds: in the order in which they are stepped through.
        title: shown above them.
    """
    content = {"units": UNITS_PER_M, "frames": [_payload(shown) for shown in clouds]}
    data = json.dumps(content, separators=(",", ":"), allow_nan=False)
    page = TEMPLATE.read_text(encoding="utf-8")
    # names may hold anything; within a script no "<" may begin a tag
    return page.replace("@TITLE@", html.escape(title)).replace("@DATA@", data.replace("<", "\\u003c"))


def _payload(shown: ShownCloud) -> dict[str, Any]:
    places = np.rint(UNITS_PER_M * shown.cloud.xyz_m)
    near = (np.abs(places) <= _FARTHEST).all(axis=1)
    boxes = np.column_stack((shown.boxes.center_m, shown.boxes.size_m, shown.boxes.yaw_rad)).round(3)
    return {
        "title": shown.title,
        "points": base64.b64encode(places[near].astype("<i2").tobytes()).decode(),
        "boxes": boxes.tolist(),
        "category": shown.category.tolist(),
        "counts": shown.points.tolist(),
    }
