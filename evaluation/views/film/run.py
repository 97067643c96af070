"""A run as a film for slides: the scene from above, moving with the ego, with what happens in words."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.views.account.explain import Account
from evaluation.views.film import maker
from evaluation.views.film.maker import Image, pixels
from evaluation.views.frames import LogFrames
from evaluation.views.plots.ground import (
    AREA_COLOURS,
    LANE_COLOURS,
    LANE_EDGE_COLOUR,
    area_paths,
    area_style,
    draw_map,
    lane_outlines,
)
from evaluation.views.plots.log_rows import boxes_of
from evaluation.views.plots.objects import (
    DETECTION_COLOURS,
    EGO_COLOUR,
    HOUSING_COLOUR,
    SIGNAL_COLOURS,
    TRACK_COLOURS,
    signal_lamp,
)
from evaluation.views.plots.polygons import draw_polygons
from evaluation.views.plots.style import BLACK, GREY, SMALL_PT, plain_figure
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.geometry import corners
from smartmot.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from matplotlib.transforms import Affine2D, Transform
    from PIL import Image as Pillow

HOLD_S = 1.5
"""The last picture stays this long, so that the outcome can be read."""

_SIZE_IN, _DPI = (6.4, 4.8), 150
"""960 x 720 pixels: fills half a slide and suits video codecs, which want even numbers."""
_VIEW = (-10.0, 40.0, -12.5, 12.5)
"""Left, right, low and high of the view in the ego's frame, metres."""
_COLOURS = 96
"""Size of the one palette of a GIF: flat fills and smoothed edges need no more."""
_TEXT_WIDTH = 0.97
"""Of a picture's width, for one line of text."""
_STATUS_GAP = 0.02
"""Of a picture's width, between speed and what perception holds."""
_STORY_TOP, _STORY_GAP = 0.06, 0.01
"""Of a picture's height: where the story begins below the view, and what stays free above the legend."""
_LEGEND_COLUMNS = 6
_MOVING_TEXTS = ("speed", "seen", "story")
_SMALLEST_PT, _STEP_PT = 5.5, 0.5
"""Texts that are too long become smaller, to this size."""


@dataclass(frozen=True, slots=True)
class FilmTimes:
    """Which frames of a run a film shows.

    Args:
        frame: (N,) frame of the run for each picture.
        fps: pictures per second.
    """

    frame: NDArray[np.int64]
    fps: float

    def durations_ms(self) -> list[int]:
        """How long each picture of a GIF stays, in hundredths of a second that add up; the last is held."""
        edges = np.rint(np.arange(len(self.frame) + 1) * 100.0 / self.fps).astype(np.int64) * 10
        stay: list[int] = np.diff(edges).tolist()
        stay[-1] = round(HOLD_S * 1000)
        return stay


def film_times(frames: LogFrames, fps: float, speed: float) -> FilmTimes:
    """Choose the frames of a film.

    Args:
        frames: the run.
        fps: pictures per second, 1 to 50 (a GIF's clock counts hundredths of a second).
        speed: 1 for real time, 0.5 for half of it.

    Raises:
        ArgumentError: a number is out of range.
    """
    if not 1 <= fps <= 50:
        raise ArgumentError(f"--fps: must lie in 1..50, got {fps:g}")
    if not 0.05 <= speed <= 20:
        raise ArgumentError(f"--speed: must lie in 0.05..20, got {speed:g}")
    start, end = float(frames.time_s[0]), float(frames.time_s[-1])
    times = start + np.arange(int(np.floor((end - start) * fps / speed + 1e-6)) + 1) * speed / fps
    shown = [frames.frame_at(float(time)) for time in times]
    if shown[-1] != len(frames) - 1:
        shown.append(len(frames) - 1)
    return FilmTimes(np.array(shown, dtype=np.int64), fps)


@dataclass(slots=True, eq=False)
class RunDrawing:
    """Draws frames of one run onto one figure whose artists are moved, not made again.

    What stays is drawn once; a picture is a copy of that, with what moves drawn over it.

    Args:
        frames: the run.
        account: what happens, in words.
        network: the map; None: without lanes.
        title: heading.
        colour: of the strategy, a bar above the heading; empty: none.
    """

    frames: LogFrames
    account: Account
    network: DriveMap | None
    title: str
    colour: str = ""
    figure: Figure = field(init=False)
    _legend_top: float = field(init=False, default=0.0)
    _axes: Axes = field(init=False)
    _ego_SE2_map: Affine2D = field(init=False)  # noqa: N815
    _areas: dict[str, PathCollection] = field(init=False, default_factory=dict)
    _layers: dict[str, PolyCollection] = field(init=False, default_factory=dict)
    _texts: dict[str, Any] = field(init=False, default_factory=dict)
    _lamps: dict[str, tuple[Any, Any]] = field(init=False, default_factory=dict)
    _boxes: dict[str, _LayerBoxes] = field(init=False, default_factory=dict)
    _story: str = field(init=False, default="")
    _still: Any = field(init=False, default=None)
    _told: tuple[tuple[str, ...], Any] = field(init=False, default=((), None))

    def __post_init__(self) -> None:
        from matplotlib.transforms import Affine2D

        self.figure = plain_figure(_SIZE_IN, _DPI)
        left, right, low, high = _VIEW
        height = (high - low) / (right - left) * _SIZE_IN[0] / _SIZE_IN[1]
        axes = self.figure.add_axes((0.0, 0.935 - height, 1.0, height))
        axes.set_xlim(left, right)
        axes.set_ylim(low, high)
        axes.xaxis.set_visible(False)
        axes.yaxis.set_visible(False)
        axes.spines[["left", "right"]].set_visible(False)
        self._axes, self._ego_SE2_map = axes, Affine2D()
        self._add_ground()
        self._add_layers()
        self._add_texts(0.935 - height)
        self._boxes = _boxes_by_layer(self.frames)
        # animated artists are those that the canvas itself does not draw
        for artist in (axes, *(self._texts[name] for name in _MOVING_TEXTS)):
            artist.set_animated(True)

    def picture(self, frame: int) -> Image:
        """The picture of one frame."""
        self._move_to(frame)
        canvas: Any = self.figure.canvas
        canvas.restore_region(self._background())
        for artist in (self._axes, self._texts["speed"]):
            self.figure.draw_artist(artist)
        return pixels(self.figure)

    def _background(self) -> Any:
        """Heading and legend, drawn once, with the words that last for several pictures."""
        canvas: Any = self.figure.canvas
        if self._still is None:
            canvas.draw()
            self._still = canvas.copy_from_bbox(self.figure.bbox)
        lasting = self._texts["story"], self._texts["seen"]
        state = tuple(f"{text.get_fontsize()} {text.get_text()}" for text in lasting)
        if self._told[0] != state:
            canvas.restore_region(self._still)
            for text in lasting:
                self.figure.draw_artist(text)
            self._told = state, canvas.copy_from_bbox(self.figure.bbox)
        return self._told[1]

    @property
    def _map_frame(self) -> Transform:
        """From the map frame to pixels: artists stay as they are in the map, and this alone moves them."""
        return self._ego_SE2_map + self._axes.transData

    def _add_ground(self) -> None:
        """Lanes and the way of the ego."""
        transform = self._map_frame
        way = self.frames.ego[["x_m", "y_m"]].to_numpy(np.float64)
        if self.network is not None and len(lane_outlines(self.network)):
            margin = max(abs(v) for v in _VIEW)
            (left, low), (right, high) = (
                (way.min(axis=0) - margin).tolist(),
                (way.max(axis=0) + margin).tolist(),
            )
            draw_map(self._axes, self.network, (0.0, 0.0, 0.0), (left, low, right, high))
            for collection in self._axes.collections:
                collection.set_transform(transform)
        self._axes.plot(way[:, 0], way[:, 1], color="#555555", linewidth=0.8, dashes=(6, 4), zorder=2.5,
                        transform=transform)  # fmt: skip
        x = _VIEW[0] + 1.0
        self._axes.plot([x, x + 10.0], [_VIEW[2] + 0.8] * 2, color=BLACK, linewidth=1.5, zorder=9)
        self._axes.text(x, _VIEW[2] + 1.1, "10 m", fontsize=SMALL_PT, zorder=9)

    def _add_layers(self) -> None:
        from matplotlib.collections import PathCollection

        for role in AREA_COLOURS:
            area = PathCollection([], gid=f"monitored: {role}", zorder=2.0, **area_style(role))
            area.set_transform(self._map_frame)
            self._axes.add_collection(area, autolim=False)
            self._areas[role] = area
        for label, (face, edge) in DETECTION_COLOURS.items():
            self._layer(f"detection {label}", face=face, edge=edge, zorder=4.0)
        for state, colour in TRACK_COLOURS.items():
            self._layer(f"forecast {state}", face="none", edge=(colour, 0.5), width=0.7, zorder=3.0)
            self._layer(f"track {state}", face="none", edge=colour, width=1.8, zorder=5.0)
        self._layer("ego forecast", face="none", edge=(EGO_COLOUR, 0.45), width=0.7, zorder=3.0)
        self._layer("ground truth", face="none", edge=BLACK, line=":", width=0.8, zorder=5.5)
        self._layer("ego", face=EGO_COLOUR, edge=BLACK, zorder=6.0)
        self._add_signals()
        (self._texts["ring"],) = self._axes.plot([], [], "o", markersize=17, markerfacecolor="none",
            markeredgewidth=2, color=TRACK_COLOURS["threat"], zorder=5.6,
            transform=self._map_frame)  # fmt: skip

    def _add_signals(self) -> None:
        """A lamp and a word where each traffic signal stands."""
        from matplotlib.transforms import ScaledTranslation

        rows = self.frames.signals.drop_duplicates("category")
        places: dict[tuple[float, float], int] = {}
        for signal, x_m, y_m in rows[["category", "x_m", "y_m"]].itertuples(index=False):
            # one below the other where several stand on one pole
            above = places[x_m, y_m] = places.get((x_m, y_m), -1) + 1
            size = self.figure.dpi_scale_trans
            at, beside = (ScaledTranslation(right_pt / 72, -above * 11 / 72, size) for right_pt in (0, 7))
            (lamp,) = self._axes.plot([x_m], [y_m], "o", markersize=8, markeredgewidth=2, zorder=6.5,
                markeredgecolor=HOUSING_COLOUR, transform=self._map_frame + at)  # fmt: skip
            word = self._axes.text(x_m, y_m, "", fontsize=SMALL_PT, va="center", zorder=6.5, clip_on=True,
                transform=self._map_frame + beside)  # fmt: skip
            self._lamps[str(signal)] = lamp, word

    def _layer(self, name: str, **style: Any) -> None:
        draw_polygons(self._axes, [], name, **style)
        collection: Any = self._axes.collections[-1]
        collection.set_transform(self._map_frame)
        self._layers[name] = collection

    def _add_texts(self, below: float) -> None:
        from matplotlib.patches import Patch, Rectangle

        if self.colour:
            self.figure.add_artist(Rectangle((0.01, 0.99), 0.98, 0.01, color=self.colour))
        write = self.figure.text
        size = 10.0
        title = write(0.5, 0.963, self.title, ha="center", va="center", fontsize=size, weight="bold")
        while self._share(title)[0] > _TEXT_WIDTH and size > _SMALLEST_PT:
            size -= _STEP_PT
            title.set_fontsize(size)
        self._texts["speed"] = write(0.015, below - 0.015, "", va="top", fontsize=SMALL_PT + 1, weight="bold")
        self._texts["seen"] = write(0.985, below - 0.015, "", va="top", ha="right", fontsize=SMALL_PT)
        self._texts["story"] = write(0.015, below - _STORY_TOP, "", va="top", fontsize=SMALL_PT)
        shown = {role for frame in range(len(self.frames)) for role, _ in self.frames.areas(frame)}
        types = {kind for kind, _ in lane_outlines(self.network)} if self.network is not None else set()
        handles = [Patch(facecolor=c, edgecolor=LANE_EDGE_COLOUR, label=f"{t} lane")
                   for t, c in LANE_COLOURS.items() if t in types & {"driving", "sidewalk"}]  # fmt: skip
        handles += [Patch(label=f"monitored: {role.replace('_', ' ')}", **area_style(role))
                    for role in AREA_COLOURS if role in shown]  # fmt: skip
        handles += [Patch(facecolor=face, edgecolor=edge, label=f"detection {label}")
                    for label, (face, edge) in DETECTION_COLOURS.items()]  # fmt: skip
        handles += [Patch(facecolor="none", edgecolor=colour, label=f"track, {state}")
                    for state, colour in TRACK_COLOURS.items()]  # fmt: skip
        handles.append(Patch(facecolor="none", edgecolor=GREY, label="forecast"))
        self._add_legend(handles)

    def _add_legend(self, handles: Sequence[Patch]) -> None:
        """Legend at the foot, in as many columns as fit; the story keeps above it."""
        canvas: Any = self.figure.canvas
        for columns in range(_LEGEND_COLUMNS, 0, -1):
            legend = self.figure.legend(
                handles=handles, loc="lower center", ncols=columns, fontsize=6.5, frameon=False,
                columnspacing=1.2, handlelength=1.4, borderaxespad=0.2,
            )  # fmt: skip
            box = legend.get_window_extent(canvas.get_renderer())
            if box.width <= _TEXT_WIDTH * self.figure.bbox.width or columns == 1:
                break
            legend.remove()
        self._legend_top = box.y1 / self.figure.bbox.height

    def _move_to(self, frame: int) -> None:
        """Put every artist where it belongs in a frame."""
        frames = self.frames
        ego = frames.ego_state(frame)
        self._ego_SE2_map.clear().translate(-ego.x_m, -ego.y_m).rotate(-ego.yaw_rad)
        paths = area_paths(frames.areas(frame))
        for role, area in self._areas.items():
            area.set_paths([paths[role]] if role in paths else [])
            area.set_visible(role in paths)
        for name, layer in self._layers.items():
            outlines = self._boxes[name].at(frame)
            layer.set_verts(list(outlines))
            layer.set_visible(len(outlines) > 0)
        now = frames.signals_at(frame)
        lit = dict(zip(now["category"], map(signal_lamp, now["label"]), strict=True))
        for signal, (lamp, word) in self._lamps.items():
            state = lit.get(signal, "")
            lamp.set_visible(bool(state))
            lamp.set_markerfacecolor(SIGNAL_COLOURS.get(state, SIGNAL_COLOURS["off"]))
            word.set_text(f"{signal}: {state}" if state else "")
        # between opposite corners
        self._texts["ring"].set_data(*self._boxes["track threat"].at(frame)[:, ::2].mean(axis=1).T)
        speed, _, seen = self.account.status[frame].partition(" · ")
        self._texts["speed"].set_text(f"t = {ego.stamp_s:.2f} s, {speed}")
        self._texts["seen"].set_text(seen)
        self._fit_status()
        if self._story != self.account.story[frame]:
            self._story = self.account.story[frame]
            self._tell(self._story)

    def _fit_status(self) -> None:
        """Write speed and perception side by side, as large as they fit on their line."""
        texts = self._texts["speed"], self._texts["seen"]
        for smaller in np.arange(0.0, SMALL_PT, _STEP_PT).tolist():
            for text, size in zip(texts, (SMALL_PT + 1, SMALL_PT), strict=True):
                text.set_fontsize(size - smaller)
            if sum(self._share(text)[0] for text in texts) <= _TEXT_WIDTH - _STATUS_GAP:
                return

    def _tell(self, text: str) -> None:
        """Write the story below the view, as large as it fits between the view and the legend."""
        story = self._texts["story"]
        room = float(story.get_position()[1]) - self._legend_top - _STORY_GAP
        size = SMALL_PT
        # wrapped by the mean width of its letters first, then narrower until no line sticks out
        while True:
            story.set_fontsize(size)
            story.set_text(text)
            columns = max(int(len(text) * _TEXT_WIDTH / max(self._share(story)[0], _TEXT_WIDTH)), 20)
            story.set_text(textwrap.fill(text, columns))
            while self._share(story)[0] > _TEXT_WIDTH:
                columns -= 2
                story.set_text(textwrap.fill(text, columns))
            if self._share(story)[1] <= room or size <= _SMALLEST_PT:
                return
            size -= _STEP_PT

    def _share(self, text: Any) -> tuple[float, float]:
        """Width and height of a text as shares of the picture's."""
        canvas: Any = self.figure.canvas
        box = text.get_window_extent(canvas.get_renderer())
        return box.width / self.figure.bbox.width, box.height / self.figure.bbox.height


@dataclass(frozen=True, slots=True, eq=False)
class _LayerBoxes:
    """Outlines of one layer of a film, by frame.

    Args:
        outlines_m: (N, 4, 2) corners, map frame, in the order of the frames.
        starts: (F + 1,) where each frame begins.
    """

    outlines_m: FloatArray
    starts: NDArray[np.int64]

    def at(self, frame: int) -> FloatArray:
        """(M, 4, 2) corners in one frame."""
        return self.outlines_m[self.starts[frame] : self.starts[frame + 1]]


def _boxes_by_layer(frames: LogFrames) -> dict[str, _LayerBoxes]:
    """What each layer of boxes shows, over the run."""
    objects, ends = frames.objects, np.arange(len(frames) + 1)
    detections, tracks, forecasts = objects["detection"], objects["track"], objects["forecast"]
    rows = {f"detection {label}": detections[detections["label"] == label] for label in DETECTION_COLOURS}
    # a forecast has the state of its track in the same frame
    forecast_of = forecasts.set_index(["frame", "id"]).index
    for state in TRACK_COLOURS:
        rows[f"track {state}"] = own = tracks[tracks["label"] == state]
        rows[f"forecast {state}"] = forecasts[forecast_of.isin(own.set_index(["frame", "id"]).index)]
    rows |= {
        "ego forecast": objects["ego_forecast"],
        "ground truth": objects["actor"],
        "ego": frames.ego.assign(frame=ends[:-1]),
    }
    return {
        name: _LayerBoxes(corners(*boxes_of(own)), np.searchsorted(own["frame"].to_numpy(), ends))
        for name, own in rows.items()
    }


def film_of(drawing: RunDrawing, times: FilmTimes) -> maker.Film:
    """A run as a film; its GIF has one palette, that of the first, the middle and the last picture."""
    from PIL import Image as Pillow

    frames = times.frame.tolist()

    @functools.cache
    def palette() -> Pillow.Image:
        return _palette([drawing.picture(frames[k]) for k in (0, len(frames) // 2, -1)])

    def reduce(image: Image) -> Pillow.Image:
        return Pillow.fromarray(image).quantize(palette=palette(), dither=Pillow.Dither.NONE)

    return maker.Film(
        drawing.picture, reduce, frames, times.durations_ms(), times.fps, repeats=round(HOLD_S * times.fps)
    )


def _palette(key_frames: Sequence[Image]) -> Pillow.Image:
    """One palette for a film: the colours with a meaning as they are, then what else the pictures hold."""
    from matplotlib.colors import to_rgb
    from PIL import Image as Pillow

    named = {*AREA_COLOURS.values(), *TRACK_COLOURS.values(), *LANE_COLOURS.values(), EGO_COLOUR, "white"}
    named |= {*SIGNAL_COLOURS.values(), HOUSING_COLOUR}
    colours = [np.array(to_rgb(name)) for name in sorted(named)]
    # forecasts are half transparent, mostly on the road
    colours += [(np.array(to_rgb(c)) + to_rgb(LANE_COLOURS["driving"])) / 2 for c in TRACK_COLOURS.values()]
    fixed = np.rint(np.array(colours) * 255).astype(np.uint8)
    frequent = Pillow.fromarray(np.concatenate(key_frames)).quantize(_COLOURS).getpalette() or []
    palette = Pillow.new("P", (1, 1))
    palette.putpalette([*fixed.ravel().tolist(), *frequent[: 3 * _COLOURS]])
    return palette


__getattr__ = _smartmot.renamed(__name__, {"Film": "evaluation.views.film.run.RunDrawing"})
