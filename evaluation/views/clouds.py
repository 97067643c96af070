"""Clouds from above, and what a detector made of them: pictures and arrays."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evaluation.results.files import write_bytes
from evaluation.views.pictures import save_picture
from smartmot.arrays import IntArray, StrArray
from smartmot.geometry import corners
from smartmot.lidar import BoxDetections
from smartmot.lidar.detections import GROUND, LOOSE, OFF_AREA, OUT_OF_REACH
from smartmot.pointcloud import Boxes3D, PointCloud

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FATES = {
    OUT_OF_REACH: ("out of reach, overhead", "#d9d9d9"),
    GROUND: ("ground", "#c8b48c"),
    OFF_AREA: ("off the monitored area", "#b8c9dd"),
    LOOSE: ("in no cluster", "#888888"),
}
"""What a picture calls the points that are in no cluster, and their colours."""

BOX_COLORS = {"car": "#0b5fa5", "pedestrian": "#c1272d", "cyclist": "#1a7f37"}
CLUSTER_COLOR = "#333333"


def write_stages(folder: Path, name: str, cloud: PointCloud, detections: BoxDetections) -> None:
    """Write `NAME.png` and `NAME.npz`: points with their clusters, and boxes.

    The arrays are `xyz_m`, `point_cluster`, `center_m`, `size_m`, `yaw_rad`, `score`, `category` and
    `box_cluster`.
    """
    content = io.BytesIO()
    boxes = detections.boxes
    np.savez(
        content,
        xyz_m=cloud.xyz_m,
        point_cluster=detections.point_cluster,
        center_m=boxes.center_m,
        size_m=boxes.size_m,
        yaw_rad=boxes.yaw_rad,
        score=detections.score,
        category=detections.category,
        box_cluster=detections.box_cluster,
    )
    write_bytes(folder / f"{name}.npz", content.getvalue())
    save_picture(cloud_picture(name, cloud, detections), folder / f"{name}.png", "--stages")


def cloud_picture(title: str, cloud: PointCloud, detections: BoxDetections) -> Figure:
    """A cloud from above, x ahead upwards, with its boxes, their scores and distances."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    axes = figure.add_subplot()
    x, y = cloud.xyz_m[:, 0], cloud.xyz_m[:, 1]
    fate = detections.point_cluster
    for code, (fate_name, color) in FATES.items():
        chosen = fate == code
        if chosen.any():
            axes.plot(y[chosen], x[chosen], ".", markersize=1, color=color, label=fate_name, rasterized=True)
    axes.plot(y[fate >= 0], x[fate >= 0], ".", markersize=1.5, color=CLUSTER_COLOR, label="clusters")
    outline, distance_m = detections.boxes.on_ground, detections.distance_m
    named = set()
    for row, points in enumerate(corners(outline.center_m, outline.size_m, outline.yaw_rad)):
        category = str(detections.category[row])
        ring = np.concatenate((points, points[:1]))
        label = None if category in named else category
        named.add(category)
        color = BOX_COLORS.get(category, CLUSTER_COLOR)
        axes.plot(ring[:, 1], ring[:, 0], "-", linewidth=1.2, color=color, label=label)
        text = f"{detections.score[row]:.2f}, {distance_m[row]:.1f} m"
        axes.annotate(text, (points[:, 1].min(), points[:, 0].max()), fontsize=6, color=color)
    shown = fate != OUT_OF_REACH
    if shown.any():
        axes.set_xlim(float(y[shown].max()) + 1.0, float(y[shown].min()) - 1.0)
        axes.set_ylim(float(x[shown].min()) - 1.0, float(x[shown].max()) + 1.0)
    axes.set(xlabel="left (m)", ylabel="ahead (m)", title=title, aspect="equal")
    axes.legend(loc="upper right", fontsize=7, markerscale=6)
    return figure


def labelled_picture(
    title: str, cloud: PointCloud, boxes: Boxes3D, category: StrArray, points: IntArray
) -> Figure:
    """A cloud from above, x ahead upwards, coloured by height, with labels and the points in each.

    Args:
        title: of the picture.
        cloud: sensor's frame.
        boxes: K boxes in that frame.
        category: (K,) names.
        points: (K,) points in each box.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    axes = figure.add_subplot()
    x, y, z = cloud.xyz_m.T
    dots = axes.scatter(
        y, x, c=z, s=0.6, cmap="viridis", vmin=-2.2, vmax=2.3, linewidths=0.0, rasterized=True
    )
    figure.colorbar(dots, label="height over the sensor (m)", shrink=0.6)
    outline = boxes.on_ground
    for row, corner in enumerate(corners(outline.center_m, outline.size_m, outline.yaw_rad)):
        color = BOX_COLORS.get(str(category[row]), CLUSTER_COLOR)
        ring = np.concatenate((corner, corner[:1]))
        axes.plot(ring[:, 1], ring[:, 0], "-", linewidth=1.2, color=color)
        front = np.stack((corner.mean(axis=0), 0.5 * (corner[0] + corner[3])))
        axes.plot(front[:, 1], front[:, 0], "-", linewidth=1.0, color=color)
        axes.annotate(str(points[row]), (corner[:, 1].min(), corner[:, 0].max()), fontsize=6, color=color)
    reach = float(np.abs(outline.center_m).max(initial=20.0)) + 5.0
    axes.set_xlim(reach, -reach)
    axes.set_ylim(-reach, reach)
    axes.set(xlabel="left (m)", ylabel="ahead (m)", title=title, aspect="equal")
    return figure
