"""What moves: ground truth, detections, tracks, forecasts and the ego of one frame."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.views.plots.labels import place_labels
from evaluation.views.plots.log_rows import boxes_of, of_kind
from evaluation.views.plots.polygons import Pose, draw_polygons
from evaluation.views.plots.style import BLACK, BLUE, GREEN, GREY, SMALL_PT, VERMILLION
from smartmot.geometry import corners, to_frame
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

EGO_COLOUR = "#4d4d4d"
DETECTION_COLOURS = {"kept": ("#ffffff", BLACK), "dropped": ("#c9c9c9", GREY)}
"""Fill and edge of detections by what the monitored area did with them."""
TRACK_COLOURS = {"static": BLUE, "dynamic": GREEN, "threat": VERMILLION}
"""Colours of tracks by state."""
SIGNAL_COLOURS = {"red": "#e0342b", "yellow": "#f5c400", "green": "#1fb35b", "off": "#8c8c8c"}
"""Colours of the lamps of traffic signals, the strictest first."""
HOUSING_COLOUR = "#1d2328"
"""Around the lamp of a traffic signal."""
_LAMPS = {2: ("red", "green"), 3: ("red", "yellow", "green")}
"""Lamps of signals whose state is a list of what each shows, from above."""
_LAMP_WORDS = {
    "red": ("red", "stop"),
    "yellow": ("yellow", "amber"),
    "green": ("green", "go"),
    "off": ("off",),
}
"""Words of states that name a lamp."""


def signal_lamp(state: str) -> str:
    """The strictest lamp that is lit in a state of a traffic signal, one of `SIGNAL_COLOURS`; else the state.

    The standard leaves the words of states open. Known are those that name a lamp (`red`, `TrafficLightRed`,
    `STOP`), and lists of what every lamp shows (`off;off;on`), as esmini has them.
    """
    parts = [part.strip().lower() for part in state.split(";")]
    if len(parts) in _LAMPS and {"on", "off", "flashing"}.issuperset(parts):
        lit = [lamp for lamp, part in zip(_LAMPS[len(parts)], parts, strict=True) if part != "off"]
        return lit[0] if lit else "off"
    if len(parts) > 1:
        return state
    words = [word.lower() for word in re.findall("[A-Z]?[a-z]+|[A-Z]+", state)]
    return next((lamp for lamp, known in _LAMP_WORDS.items() if any(word in known for word in words)), state)


def draw_signals(axes: Axes, signals: pd.DataFrame, pose: Pose) -> None:
    """A lamp and a word where each traffic signal stands, one below the other where several have one pole.

    Args:
        axes: in the frame of the pose, metres.
        signals: rows of the log that hold, one per signal.
        pose: of that frame on the map.
    """
    from matplotlib.transforms import ScaledTranslation

    places: dict[tuple[float, float], int] = {}
    for signal, state, x_m, y_m in signals[["category", "label", "x_m", "y_m"]].itertuples(index=False):
        above = places[x_m, y_m] = places.get((x_m, y_m), -1) + 1
        ahead, left = to_frame(np.array([x_m, y_m]), *pose).tolist()
        at, beside = (
            axes.transData + ScaledTranslation(right_pt / 72, -above * 9 / 72, axes.figure.dpi_scale_trans)
            for right_pt in (0, 5)
        )
        lamp = signal_lamp(state)
        axes.plot([ahead], [left], "o", markersize=6, markeredgewidth=1.5, zorder=6.5, transform=at,
            markeredgecolor=HOUSING_COLOUR, gid=f"signal {signal}",
            markerfacecolor=SIGNAL_COLOURS.get(lamp, SIGNAL_COLOURS["off"]))  # fmt: skip
        axes.text(ahead, left, f"{signal}: {lamp}", fontsize=SMALL_PT, va="center", zorder=6.5, clip_on=True,
            transform=beside)  # fmt: skip


def draw_objects(axes: Axes, frame: pd.DataFrame, pose: Pose) -> list[Patch]:
    """Ground truth, detections, tracks, forecasts and the ego of one frame; returns what the legend shows."""
    from matplotlib.patches import Patch

    ego, actors, detections, tracks, ego_forecast, forecasts = (
        of_kind(frame, kind) for kind in ("ego", "actor", "detection", "track", "ego_forecast", "forecast")
    )
    handles = _draw_boxes(axes, ego.iloc[-1:], pose, "ego", face=EGO_COLOUR, edge=BLACK, zorder=6.0)
    _draw_fading(axes, ego_forecast, pose, "ego forecast", EGO_COLOUR)
    if len(ego_forecast):
        handles.append(Patch(facecolor="none", edgecolor=EGO_COLOUR, label="ego forecast"))
    handles += _draw_boxes(axes, actors, pose, "ground truth", face="none", edge=BLACK, line=":", zorder=5.5)
    for label, (face, edge) in DETECTION_COLOURS.items():
        rows = detections[detections["label"] == label]
        handles += _draw_boxes(axes, rows, pose, f"detection {label}", face=face, edge=edge, zorder=4.0)
    for state, colour in TRACK_COLOURS.items():
        rows = tracks[tracks["label"] == state]
        style = {"face": "none", "edge": colour, "width": 2.2 if state == "threat" else 1.3}
        handles += _draw_boxes(axes, rows, pose, f"track, {state}", **style, zorder=5.0)
        _draw_velocities(axes, rows, pose, colour)
        _draw_fading(axes, forecasts[forecasts["id"].isin(rows["id"])], pose, "forecast", colour)
    _ring_threats(axes, tracks[tracks["label"] == "threat"], pose)
    if len(forecasts):
        handles.append(Patch(facecolor="none", edgecolor=GREY, label="forecast"))
    everything = [ego, ego_forecast, actors, detections, tracks]
    _label_tracks(axes, tracks, np.concatenate([_corners(rows, pose) for rows in everything]), pose)
    return handles


def _corners(rows: pd.DataFrame, pose: Pose) -> FloatArray:
    """(N, 4, 2) corners of the boxes in rows, seen from a pose."""
    return to_frame(corners(*boxes_of(rows)), *pose)


def _draw_boxes(axes: Axes, rows: pd.DataFrame, pose: Pose, label: str, **style: Any) -> list[Patch]:
    """Boxes of rows, if there are any; returns what the legend shows."""
    return [draw_polygons(axes, _corners(rows, pose), label, **style)] if len(rows) else []


def _draw_fading(axes: Axes, rows: pd.DataFrame, pose: Pose, label: str, colour: str) -> None:
    """Forecast boxes, paler the further ahead in time."""
    horizons = rows.groupby("horizon_s")
    for alpha, (_, chosen) in zip(np.linspace(0.75, 0.2, len(horizons)), horizons, strict=True):
        _draw_boxes(axes, chosen, pose, label, face="none", edge=(colour, alpha), width=0.8, zorder=3.0)


def _draw_velocities(axes: Axes, rows: pd.DataFrame, pose: Pose, colour: str) -> None:
    """Arrow from each moving track to where it is in one second."""
    moving = rows[rows["speed_mps"] > 0.2]
    tails = to_frame(moving[["x_m", "y_m"]].to_numpy(float), *pose)
    yaw = moving["yaw_rad"].to_numpy(float) - pose[2]
    steps = moving["speed_mps"].to_numpy(float)[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    style = {
        "arrowstyle": "-|>", "color": colour, "linewidth": 1.0, "mutation_scale": 6.0, "shrinkA": 0.0,
        "shrinkB": 0.0,
    }  # fmt: skip
    for tail, head in zip(tails.tolist(), (tails + steps).tolist(), strict=True):
        arrow = axes.annotate("", xy=head, xytext=tail, arrowprops=style, zorder=6.0, gid="velocity")
        arrow.set_clip_on(True)
        arrow.set_annotation_clip(True)


def _ring_threats(axes: Axes, threats: pd.DataFrame, pose: Pose) -> None:
    """A ring around each threat: a pedestrian's box is tiny at this scale."""
    centres = to_frame(threats[["x_m", "y_m"]].to_numpy(float), *pose)
    axes.plot(
        centres[:, 0], centres[:, 1], marker="o", markersize=15.0, markerfacecolor="none", linestyle="none",
        color=TRACK_COLOURS["threat"], gid="threat", zorder=5.5,
    )  # fmt: skip


def _label_tracks(axes: Axes, tracks: pd.DataFrame, boxes: FloatArray, pose: Pose) -> None:
    """Category and number of each track in view, clear of all boxes; threats choose their places first.

    Args:
        axes: where to write.
        tracks: rows of the tracks.
        boxes: (N, 4, 2) corners of all boxes, seen from the pose.
        pose: origin and direction of the picture.
    """
    ordered = tracks.sort_values("label", key=lambda label: label != "threat", kind="stable")
    points = to_frame(ordered[["x_m", "y_m"]].to_numpy(float), *pose)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    texts = [
        (x, y, f"{category} {number:.0f}")
        for (x, y), category, number in zip(points.tolist(), ordered["category"], ordered["id"], strict=True)
        if left < x < right and low < y < high
    ]
    sides = np.stack([boxes, np.roll(boxes, -1, axis=1)], axis=2)
    place_labels(axes, texts, sides, offsets_pt=(9.0, 18.0, 27.0, 36.0), leaders=True)
