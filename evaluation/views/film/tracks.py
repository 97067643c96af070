"""Films of tracks from above: histories, identities, forecasts and labels, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from evaluation.views.film.maker import Film, Image, pixels
from evaluation.views.plots.ground import draw_map
from evaluation.views.plots.objects import EGO_COLOUR
from evaluation.views.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SMALL_PT,
    VERMILLION,
    WINE,
    plain_figure,
    set_style,
)
from scenarios.recorded.dataset import Objects
from scenarios.recorded.dataset import Sequence as Recording
from smartmot.geometry import corners, to_frame
from smartmot.types import FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.collections import Collection
    from PIL import Image as Pillow

    from scenarios.recorded.maps.drive_map import DriveMap

C = TypeVar("C", bound="Collection")

Forecast = Callable[[IntArray, FloatArray], FloatArray]
"""Of rows of tracks (N,) and times ahead (N,) in seconds: centres (N, 2) then, in the tracks' frame."""

HISTORY_S = 2.0
FORECAST_S = 2.0
FORECAST_STEPS = 4
TRACK_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, WINE)
"""Colour of a track: its identity, modulo their number."""

_SIZE_IN, _DPI = (8.0, 5.2), 100
_AXES = (0.075, 0.15, 0.915, 0.79)
_SHARE = (1.0, 99.0)
"""Percentiles of the tracks' places that the picture shows; single far objects would shrink all others."""
_MARGIN_M = 5.0
_LEAST_M = 30.0
_EGO_SIZE_M = (4.4, 1.8)
_FADED = 0.25
"""Opacity of the boxes of tracks."""
_COLOURS = 128
"""Size of each picture's palette in a GIF."""
_GIF_STEP_S = 0.01
_GIF_LEAST_S = 0.02


def film_of(drawing: TracksDrawing, frames: Sequence[int], stamp_s: FloatArray) -> Film:
    """Frames of a recording in real time; as MP4 at their mean rate.

    Args:
        drawing: of the recording.
        frames: one after the other.
        stamp_s: their stamps.
    """
    steps = np.diff(stamp_s)
    last = np.median(steps) if len(steps) else 0.1
    # in steps that the clock of a GIF knows
    shown_s = np.maximum(np.round(np.append(steps, last) / _GIF_STEP_S) * _GIF_STEP_S, _GIF_LEAST_S)
    durations_ms = [round(1000 * step_s) for step_s in shown_s.tolist()]
    return Film(drawing.picture, _reduced, frames, durations_ms, 1.0 / float(np.mean(shown_s)))


def _reduced(image: Image) -> Pillow.Image:
    """A picture with a palette of its own."""
    from PIL import Image as Pillow

    return Pillow.fromarray(image).quantize(
        colors=_COLOURS, method=Pillow.Quantize.FASTOCTREE, dither=Pillow.Dither.NONE
    )


class TracksDrawing:
    """The artists of a film, moved from frame to frame.

    With ego poses the picture moves and turns with the vehicle, which looks to the right.

    Args:
        recording: stamps, detections, labels and ego poses.
        tracks: what a tracker made of it.
        forecast: where tracks will be.
        network: the map, drawn below everything; or None.
    """

    def __init__(
        self, recording: Recording, tracks: Objects, forecast: Forecast, network: DriveMap | None = None
    ) -> None:
        self.figure = plain_figure(_SIZE_IN, _DPI)
        self._axes = self.figure.add_axes(_AXES)
        canvas: Any = self.figure.canvas
        self._canvas = canvas
        self._recording, self._forecast_of, self._network = recording, forecast, network
        self._with_ego = recording.world_SE3_ego is not None
        self._ego = recording.ego_xy_yaw()
        self._tracks = _ByFrame(tracks, len(recording))
        self._detections = _ByFrame(recording.detections, len(recording))
        self._labels = None if recording.labels is None else _ByFrame(recording.labels, len(recording))
        self._view = _view(tracks if len(tracks) else recording.detections, self._ego)
        self._place_axes()
        self._add_legend()
        self._add_artists()
        # all that stays is drawn once and copied under every frame
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self.figure.bbox)

    def picture(self, frame: int) -> Image:
        """The picture of one frame."""
        self._move_to(frame)
        self._canvas.restore_region(self._background)
        for artist in [*self._ground, *self._layers, *self._texts, self._title]:
            self._axes.draw_artist(artist)
        return pixels(self.figure)

    def _add_artists(self) -> None:
        """The vehicle, and what moves: animated artists, which the canvas itself does not draw."""
        from matplotlib.collections import LineCollection, PathCollection, PolyCollection

        def add(collection: C) -> C:
            self._axes.add_collection(collection)
            return collection

        ego: list[Collection] = []
        if self._with_ego:  # it stays where it is, but above the map, which moves
            half_x, half_y = (0.5 * edge for edge in _EGO_SIZE_M)
            outline = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]
            ego = [add(PolyCollection([outline], facecolors=EGO_COLOUR, edgecolors=BLACK, animated=True))]
        open_box: dict[str, Any] = {"facecolors": "none", "animated": True}
        self._found = add(PolyCollection([], edgecolors=GREY, linewidths=0.7, **open_box))
        self._true = add(PolyCollection([], edgecolors=BLACK, linewidths=0.9, linestyles="--", **open_box))
        self._boxes = add(PolyCollection([], linewidths=1.3, animated=True))
        self._noses = add(LineCollection([], linewidths=1.3, animated=True))
        self._history = add(LineCollection([], linewidths=1.2, animated=True))
        self._forecast = add(LineCollection([], linewidths=1.2, linestyles=":", animated=True))
        self._points: PathCollection = self._axes.scatter([], [], s=9.0, linewidths=0.0, animated=True)
        self._layers = [
            *ego, self._found, self._true, self._boxes, self._noses, self._history, self._forecast,
            self._points,
        ]  # fmt: skip
        self._title = self._axes.set_title("", fontsize=SMALL_PT + 1, animated=True)
        self._texts: list[Any] = []
        self._ground: list[Any] = []

    def _place_axes(self) -> None:
        axes = self._axes
        axes.set_xlim(self._view[0], self._view[2])
        axes.set_ylim(self._view[1], self._view[3])
        axes.set_aspect("equal")
        set_style(axes)
        axes.set_xlabel("ahead of the vehicle (m)" if self._with_ego else "x (m)", fontsize=SMALL_PT)
        axes.set_ylabel("to its left (m)" if self._with_ego else "y (m)", fontsize=SMALL_PT)

    def _add_legend(self) -> None:
        """Say what the lines are."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        ahead = f"next {FORECAST_S:g} s"
        handles: list[Any] = [
            Patch(facecolor="#b3d4e8", edgecolor=BLUE, label="track with its id"),
            Line2D([], [], color=BLUE, label=f"last {HISTORY_S:g} s"),
            Line2D([], [], color=BLUE, linestyle=":", marker="o", markersize=3, label=ahead),
            Patch(facecolor="none", edgecolor=GREY, label="detection"),
        ]
        if self._labels is not None:
            handles.append(Patch(facecolor="none", edgecolor=BLACK, linestyle="--", label="label"))
        if self._with_ego:
            handles.append(Patch(facecolor=EGO_COLOUR, edgecolor=BLACK, label="vehicle"))
        self.figure.legend(
            handles=handles, loc="lower center", ncols=len(handles), frameon=False, fontsize=SMALL_PT,
            handlelength=1.6,
        )  # fmt: skip

    def _move_to(self, frame: int) -> None:
        """Put every artist where it belongs in a frame."""
        recording, pose = self._recording, self._ego[frame]
        self._found.set_verts(list(_outlines(self._detections.at(frame), pose)))
        if self._labels is not None:
            self._true.set_verts(list(_outlines(self._labels.at(frame), pose)))
        rows = self._tracks.rows(frame)
        tracks = self._tracks.objects[rows]
        colours = [TRACK_COLOURS[i % len(TRACK_COLOURS)] for i in tracks.object_id.tolist()]
        outlines = _outlines(tracks, pose)
        self._boxes.set_verts(list(outlines))
        self._boxes.set_edgecolor(colours)
        self._boxes.set_facecolor([(colour, _FADED) for colour in colours])
        center = to_frame(tracks.center_m, *pose)
        turn = tracks.yaw_rad - pose[2]
        front = center + 0.5 * tracks.size_m[:, :1] * np.column_stack((np.cos(turn), np.sin(turn)))
        self._noses.set_segments(list(np.stack((center, front), axis=1)))
        self._noses.set_color(colours)
        self._history.set_segments(self._past(frame, tracks, pose))
        self._history.set_color(colours)
        ways = self._future(np.arange(rows.start, rows.stop), pose)
        self._forecast.set_segments(list(ways))
        self._forecast.set_color(colours)
        self._points.set_offsets(ways[:, 1:].reshape(-1, 2))
        self._points.set_color([c for c in colours for _ in range(FORECAST_STEPS)])
        self._name(tracks, outlines, colours)
        self._draw_ground(pose)
        elapsed_s = recording.stamp_s[frame] - recording.stamp_s[0]
        self._title.set_text(f"{recording.name}, frame {frame}, {elapsed_s:.1f} s")

    def _past(self, frame: int, tracks: Objects, pose: FloatArray) -> list[FloatArray]:
        """Where each track has been."""
        stamp_s = self._recording.stamp_s
        first = int(np.searchsorted(stamp_s, stamp_s[frame] - HISTORY_S - 1e-6))
        before = self._tracks.objects[self._tracks.start[first] : self._tracks.start[frame + 1]]
        place = to_frame(before.center_m, *pose)
        return [place[before.object_id == i] for i in tracks.object_id.tolist()]

    def _future(self, rows: IntArray, pose: FloatArray) -> FloatArray:
        """(N, steps + 1, 2) where each track will be."""
        times = np.linspace(0.0, FORECAST_S, FORECAST_STEPS + 1)
        ways = [self._forecast_of(rows, np.full(len(rows), t)) for t in times.tolist()]
        return to_frame(np.stack(ways, axis=1), *pose)

    def _name(self, tracks: Objects, outlines: FloatArray, colours: list[str]) -> None:
        """Identities beside the boxes, inside the picture only."""
        for text in self._texts:
            text.remove()
        low_x, high_x = self._axes.get_xlim()
        low_y, high_y = self._axes.get_ylim()
        self._texts = []
        for identity, outline, colour in zip(tracks.object_id.tolist(), outlines, colours, strict=True):
            x, y = outline[:, 0].max() + 0.3, outline[:, 1].max() + 0.3
            if low_x < x < high_x - 1.0 and low_y < y < high_y - 1.0:
                text = self._axes.text(
                    x, y, str(identity), color=colour, fontsize=SMALL_PT, clip_on=True, animated=True
                )
                self._texts.append(text)

    def _draw_ground(self, pose: FloatArray) -> None:
        """The map around the vehicle."""
        if self._network is None:
            return
        for artist in self._ground:
            artist.remove()
        axes = self._axes
        before = set(axes.get_children())
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        draw_map(axes, self._network, tuple(pose.tolist()), (left, low, right, high))
        self._ground = [artist for artist in axes.get_children() if artist not in before]
        for artist in self._ground:
            artist.set_animated(True)


class _ByFrame:
    """Objects of a recording by frame."""

    def __init__(self, objects: Objects, frame_count: int) -> None:
        self.objects = objects
        self.start = objects.frame_starts(frame_count)

    def rows(self, frame: int) -> slice:
        """Rows of a frame."""
        return slice(int(self.start[frame]), int(self.start[frame + 1]))

    def at(self, frame: int) -> Objects:
        """Objects of a frame."""
        return self.objects[self.rows(frame)]


def _outlines(objects: Objects, pose: FloatArray) -> FloatArray:
    """(N, 4, 2) corners in the picture's frame."""
    return to_frame(corners(objects.center_m, objects.size_m, objects.yaw_rad), *pose)


def _view(objects: Objects, ego: FloatArray) -> tuple[float, float, float, float]:
    """Left, low, right and high of what shows nearly all objects, and the vehicle.

    Args:
        objects: whatever is to be seen.
        ego: (F, 3) x, y and yaw of the vehicle in each frame; zeros without poses.
    """
    x, y, yaw = ego[objects.frame].T
    dx, dy = objects.center_m[:, 0] - x, objects.center_m[:, 1] - y
    place = np.column_stack((np.cos(yaw) * dx + np.sin(yaw) * dy, np.cos(yaw) * dy - np.sin(yaw) * dx))
    if not len(place):
        return (-_LEAST_M, -_LEAST_M, _LEAST_M, _LEAST_M)
    low, high = np.percentile(place, _SHARE, axis=0)
    if ego.any():
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    short = np.maximum(_LEAST_M - (high - low), 0.0) / 2
    low, high = low - short - _MARGIN_M, high + short + _MARGIN_M
    # the shorter side is made longer until the picture is full
    wanted = _SIZE_IN[0] * _AXES[2] / (_SIZE_IN[1] * _AXES[3])
    width, height = high - low
    grow = np.array([max(wanted * height - width, 0.0), max(width / wanted - height, 0.0)]) / 2
    low, high = low - grow, high + grow
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
