"""The present frame from above, as an array of pixels, in a few milliseconds."""

from __future__ import annotations

import numpy as np
import PIL.Image
import PIL.ImageDraw
from numpy.typing import NDArray

from evaluation.views.plots.ground import LANE_COLOURS, OTHER_LANE_COLOUR, lane_outlines
from evaluation.views.plots.objects import EGO_COLOUR, TRACK_COLOURS
from opendrive import RoadNetwork
from scenarios.sensors.world import World
from smartmot.geometry import corners
from smartmot.pipeline import FrameResult
from smartmot.types import Boxes, FloatArray

SIDE_PX = 480
SHOWN_M = 60.0
"""Width and height of what is shown; the ego is a quarter above the lower edge and drives upwards."""
_TRUTH_COLOUR = "#b0b0b0"


class Picture:
    """Draws frames of a run.

    Args:
        network: the map.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._lanes = [
            (LANE_COLOURS.get(kind, OTHER_LANE_COLOUR), outline) for kind, outline in lane_outlines(network)
        ]
        self._low = np.array([outline.min(axis=0) for _, outline in self._lanes]).reshape(-1, 2)
        self._high = np.array([outline.max(axis=0) for _, outline in self._lanes]).reshape(-1, 2)

    def draw(self, ego: Boxes, world: World, result: FrameResult | None) -> NDArray[np.uint8]:
        """(H, W, 3) pixels.

        Args:
            ego: its box.
            world: every other object, filled in grey.
            result: tracks of perception, as outlines in the colours of all our pictures; None: none.
        """
        image = PIL.Image.new("RGB", (SIDE_PX, SIDE_PX), "white")
        draw = PIL.ImageDraw.Draw(image)
        center, yaw = ego.center_m[0], float(ego.yaw_rad[0])
        right = np.array([np.sin(yaw), -np.cos(yaw)])
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        scale = SIDE_PX / SHOWN_M
        axes = np.column_stack((right, -ahead)) * scale
        origin = np.array([0.5, 0.75]) * SIDE_PX

        def polygon(
            outline_m: FloatArray, fill: str | None = None, outline: str | None = None, width: int = 1
        ) -> None:
            points = (outline_m - center) @ axes + origin
            draw.polygon([(x, y) for x, y in points.tolist()], fill, outline, width)

        near = ((self._low < center + SHOWN_M) & (self._high > center - SHOWN_M)).all(axis=1)
        for k in np.flatnonzero(near).tolist():
            colour, outline = self._lanes[k]
            polygon(outline, fill=colour, outline="#d9d9d9")
        for outline in _outlines(world.boxes[world.exists]):
            polygon(outline, fill=_TRUTH_COLOUR)
        polygon(_outlines(ego)[0], fill=EGO_COLOUR)
        if result is not None:
            tracks = result.tracks
            threats = np.isin(tracks.track_id, result.threats.track_id)
            names = np.where(threats, "threat", np.where(tracks.dynamic, "dynamic", "static"))
            for name, outline in zip(names.tolist(), _outlines(tracks.boxes), strict=True):
                polygon(outline, outline=TRACK_COLOURS[name], width=3 if name == "threat" else 2)
        return np.asarray(image)


def _outlines(boxes: Boxes) -> FloatArray:
    return corners(boxes.center_m, boxes.size_m, boxes.yaw_rad)
