"""Rows of a log as foxglove's messages; imported only where foxglove-sdk is installed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np
from foxglove.messages import (
    Color,
    CubePrimitive,
    FrameTransform,
    KeyValuePair,
    LinePrimitive,
    LinePrimitiveLineType,
    Log,
    LogLevel,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from evaluation.views.plots.ground import (
    AREA_COLOURS,
    LANE_COLOURS,
    OTHER_LANE_COLOUR,
    Area,
)
from evaluation.views.plots.objects import SIGNAL_COLOURS, TRACK_COLOURS, signal_lamp
from evaluation.views.plots.style import GREY
from evaluation.views.traces.lanes import NearLanes
from evaluation.views.traces.run import HEIGHTS_M, NANOSECONDS, TimedRows
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.types import FloatArray

MAP, BASE_LINK = "map", "base_link"
"""Frames: that of the map, and the middle of the ego's box on the ground, x ahead."""

EGO_COLOUR, TEXT_COLOUR = "#b98cff", "#a8a8a8"
ACTOR_COLOURS = {"target": "#e8d44d", "other": "#d8d8d8"}
DETECTION_COLOURS = {"kept": "#ffffff", "dropped": "#8c8c8c"}
"""Colours for dark grounds, which viewers have by default; those of tracks are those of pages and films."""
_FOOTPRINT_M = 0.02
"""Height of boxes of forecasts, which lie on the ground."""
_LINE_PX, _TEXT_PX = 2.0, 13.0
_ABOVE_M = 0.4
"""Of texts, over the box."""
_AREA_M = 0.03
"""Height of the monitored area over the ground, so that lanes do not hide it."""

EVENT_TEXTS = {
    "run_start": "run starts",
    "follow_path": "path followed",
    "forecasted_pedestrian": "pedestrian forecast to enter the way",
    "collision": "collision predicted",
    "predicted_collision": "collision course",
    "unexpected": "emergency brake requested",
    "warning": "warning",
    "free_lane": "way free",
    "end_unexpected": "emergency brake released",
    "contact": "contact",
}
"""Events of a log in words."""

_LEVELS = {
    "contact": LogLevel.Fatal,
    "unexpected": LogLevel.Error,
    "collision": LogLevel.Warning,
    "predicted_collision": LogLevel.Warning,
    "forecasted_pedestrian": LogLevel.Warning,
    "warning": LogLevel.Warning,
}

_LAMP_M = 0.6
"""Side of the plate where a traffic signal stands, about as wide as a housing is high: seen from above."""

Signal = tuple[str, str, float, float]
"""Id and state of a traffic signal, and its place on the map, metres."""

Entities = Callable[[slice, Timestamp], list[SceneEntity]]
"""Makes the entities of some rows at their time."""


def timestamps(stamps_ns: Sequence[int]) -> list[Timestamp]:
    """Stamps as foxglove has them."""
    return [Timestamp(sec=ns // NANOSECONDS, nsec=ns % NANOSECONDS) for ns in stamps_ns]


def transforms(ego: TimedRows, stamps: Sequence[Timestamp]) -> list[FrameTransform]:
    """Where the ego is on the map, one message per time."""
    return [
        FrameTransform(
            timestamp=stamp,
            parent_frame_id=MAP,
            child_frame_id=BASE_LINK,
            translation=Vector3(x=x, y=y, z=0.0),
            rotation=Quaternion(x=0.0, y=0.0, z=sine, w=cosine),
        )
        for stamp, x, y, sine, cosine in zip(stamps, *_pose_columns(ego), strict=True)
    ]


def ego_scene(ego: TimedRows, stamps: Sequence[Timestamp]) -> list[SceneUpdate]:
    """The ego's box."""
    cubes = _cubes(ego, [HEIGHTS_M["car"]] * len(ego), [_colour(EGO_COLOUR, 0.9)] * len(ego))
    return _updates(ego, stamps, _grouped(["ego"] * len(ego), cubes))


def actor_scene(actors: TimedRows, stamps: Sequence[Timestamp]) -> list[SceneUpdate]:
    """Ground truth: one entity per road user, by its identity."""
    labels = _texts(actors["label"])
    colours = [_colour(ACTOR_COLOURS.get(label, ACTOR_COLOURS["other"]), 0.8) for label in labels]
    heights = _heights(actors)
    ids = _identities(actors)
    metadata = [
        [_pair("class", category), _pair("part", label)]
        for category, label in zip(actors.text, labels, strict=True)
    ]
    return _updates(actors, stamps, _objects(actors, heights, ids, colours, metadata))


def detection_scene(detections: TimedRows, stamps: Sequence[Timestamp]) -> list[SceneUpdate]:
    """Detections, which have no identity: one entity for those kept by the monitored area, one for others."""
    labels = _texts(detections["label"])
    colours = [_colour(DETECTION_COLOURS.get(label, GREY), 0.5) for label in labels]
    return _updates(detections, stamps, _grouped(labels, _cubes(detections, _heights(detections), colours)))


def track_scene(tracks: TimedRows, stamps: Sequence[Timestamp]) -> list[SceneUpdate]:
    """Tracks: one entity each, by the track's id, with class and id as text."""
    states = _texts(tracks["label"])
    colours = [_colour(TRACK_COLOURS.get(state, GREY), 0.6) for state in states]
    heights, ids = _heights(tracks), _identities(tracks)
    metadata = [
        [_pair("class", category), _pair("state", state)]
        for category, state in zip(tracks.text, states, strict=True)
    ]
    texts = [f"{category} {name}" for category, name in zip(tracks.text, ids, strict=True)]
    return _updates(tracks, stamps, _objects(tracks, heights, ids, colours, metadata, texts))


def forecast_scene(
    forecasts: TimedRows, stamps: Sequence[Timestamp], name: str | None = None
) -> list[SceneUpdate]:
    """Forecasts of movers: one entity per track, a flat box per time ahead; of the ego: one of this name."""
    colour = _colour(TRACK_COLOURS["dynamic"] if name is None else EGO_COLOUR, 0.35)
    cubes = _cubes(forecasts, [_FOOTPRINT_M] * len(forecasts), [colour] * len(forecasts))
    names = _identities(forecasts) if name is None else [name] * len(forecasts)
    return _updates(forecasts, stamps, _grouped(names, cubes))


def area_scene(areas: Sequence[Sequence[Area]], stamps: Sequence[Timestamp]) -> list[SceneUpdate]:
    """The monitored area: one entity per role, with its outlines."""
    updates = []
    for outlines, stamp in zip(areas, stamps, strict=True):
        lines: dict[str, list[LinePrimitive]] = {}
        for role, ring in outlines:
            lines.setdefault(role, []).append(
                _loop(ring, _colour(AREA_COLOURS.get(role, GREY), 0.9), _AREA_M)
            )
        entities = [
            SceneEntity(timestamp=stamp, frame_id=MAP, id=role, lines=loops) for role, loops in lines.items()
        ]
        updates.append(SceneUpdate(deletions=[_everything_before(stamp)], entities=entities))
    return updates


def map_scene(network: DriveMap, near: NearLanes, stamp: Timestamp) -> SceneUpdate:
    """Lanes and crosswalks: one entity each, with its outline."""
    lanes = network.lanes
    entities = []
    for lane, outlines_m in zip(near.lane.tolist(), near.outlines_m, strict=True):
        road, section, number = lanes.key[lane]
        lane_type = str(lanes.lane_type[lane])
        colour = _colour(LANE_COLOURS.get(lane_type, OTHER_LANE_COLOUR), 1.0)
        entities.append(
            SceneEntity(
                timestamp=stamp,
                frame_id=MAP,
                id=f"lane {road}/{section}/{number}",
                metadata=[_pair("type", lane_type)],
                lines=[_loop(outline_m, colour) for outline_m in outlines_m],
            )
        )
    for crosswalk in network.crosswalks:
        line = _loop(np.asarray(crosswalk.polygon), _colour("#ffffff", 1.0))
        entities.append(
            SceneEntity(
                timestamp=stamp, frame_id=MAP, id=f"crosswalk {len(entities)} ({crosswalk.id})", lines=[line]
            )
        )
    return SceneUpdate(entities=entities)


def signal_scene(signals: Sequence[Signal], stamp: Timestamp) -> SceneUpdate:
    """What traffic signals show from a time on: one entity each, a plate on the ground with a word above."""
    entities = []
    for name, state, x_m, y_m in signals:
        lamp = signal_lamp(state)
        plate = CubePrimitive(
            pose=Pose(position=Vector3(x=x_m, y=y_m, z=0.5 * _FOOTPRINT_M), orientation=_LEVEL),
            size=Vector3(x=_LAMP_M, y=_LAMP_M, z=_FOOTPRINT_M),
            color=_colour(SIGNAL_COLOURS.get(lamp, SIGNAL_COLOURS["off"]), 1.0),
        )
        entities.append(
            SceneEntity(
                timestamp=stamp,
                frame_id=MAP,
                id=f"signal {name}",
                metadata=[_pair("state", state)],
                cubes=[plate],
                texts=[_text(x_m, y_m, _ABOVE_M, f"{name}: {lamp}")],
            )
        )
    return SceneUpdate(deletions=[_everything_before(stamp)], entities=entities)


def event_log(stamp: Timestamp, layer: str, name: str) -> Log:
    """An event of the log; its layer is the name of who reports it."""
    return Log(
        timestamp=stamp,
        level=_LEVELS.get(name, LogLevel.Info),
        message=f"{name}: {EVENT_TEXTS.get(name, name)}",
        name=layer,
    )


def _updates(rows: TimedRows, stamps: Sequence[Timestamp], make: Entities) -> list[SceneUpdate]:
    """One message per time that says all: whatever its topic showed before is deleted."""
    return [
        SceneUpdate(deletions=[_everything_before(stamp)], entities=make(part, stamp))
        for part, stamp in zip(rows.slices, stamps, strict=True)
    ]


def _everything_before(stamp: Timestamp) -> SceneEntityDeletion:
    return SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)


def _objects(
    rows: TimedRows,
    heights: Sequence[float],
    ids: Sequence[str],
    colours: Sequence[Color],
    metadata: Sequence[list[KeyValuePair]],
    texts: Sequence[str] | None = None,
) -> Entities:
    """Entities of rows with an identity."""
    cubes = _cubes(rows, heights, colours)
    labels: list[list[TextPrimitive]] = [[] for _ in ids]
    if texts is not None:
        places = zip(rows["x_m"].tolist(), rows["y_m"].tolist(), heights, texts, strict=True)
        labels = [[_text(x, y, height + _ABOVE_M, text)] for x, y, height, text in places]

    def make(part: slice, stamp: Timestamp) -> list[SceneEntity]:
        return [
            SceneEntity(
                timestamp=stamp,
                frame_id=MAP,
                id=ids[k],
                metadata=metadata[k],
                cubes=[cubes[k]],
                texts=labels[k],
            )
            for k in range(part.start, part.stop)
        ]

    return make


def _grouped(names: Sequence[str], cubes: Sequence[CubePrimitive]) -> Entities:
    """One entity for all rows of one name."""

    def make(part: slice, stamp: Timestamp) -> list[SceneEntity]:
        groups: dict[str, list[CubePrimitive]] = {}
        for k in range(part.start, part.stop):
            groups.setdefault(names[k], []).append(cubes[k])
        return [
            SceneEntity(timestamp=stamp, frame_id=MAP, id=name, cubes=boxes) for name, boxes in groups.items()
        ]

    return make


def _cubes(rows: TimedRows, heights: Sequence[float], colours: Sequence[Color]) -> list[CubePrimitive]:
    """Boxes that stand on the ground."""
    sizes = rows["length_m"].tolist(), rows["width_m"].tolist()
    return [
        CubePrimitive(
            pose=Pose(
                position=Vector3(x=x, y=y, z=0.5 * height),
                orientation=Quaternion(x=0.0, y=0.0, z=sine, w=cosine),
            ),
            size=Vector3(x=length, y=width, z=height),
            color=colour,
        )
        for x, y, sine, cosine, length, width, height, colour in zip(
            *_pose_columns(rows), *sizes, heights, colours, strict=True
        )
    ]


def _pose_columns(rows: TimedRows) -> tuple[list[float], list[float], list[float], list[float]]:
    """x, y, and the two parts of the quaternion of a turn about z that are not 0."""
    half = 0.5 * rows["yaw_rad"].astype(np.float64)
    return rows["x_m"].tolist(), rows["y_m"].tolist(), np.sin(half).tolist(), np.cos(half).tolist()


def _loop(ring_m: FloatArray, colour: Color, z_m: float = 0.0) -> LinePrimitive:
    """A closed outline (P, 2)."""
    return LinePrimitive(
        type=LinePrimitiveLineType.LineLoop,
        thickness=_LINE_PX,
        scale_invariant=True,
        points=[Point3(x=x, y=y, z=z_m) for x, y in ring_m.tolist()],
        color=colour,
    )


def _text(x_m: float, y_m: float, z_m: float, text: str) -> TextPrimitive:
    return TextPrimitive(
        pose=Pose(position=Vector3(x=x_m, y=y_m, z=z_m), orientation=_LEVEL),
        billboard=True,
        font_size=_TEXT_PX,
        scale_invariant=True,
        color=_colour(TEXT_COLOUR, 1.0),
        text=text,
    )


def _heights(rows: TimedRows) -> list[float]:
    return [HEIGHTS_M.get(category, HEIGHTS_M["unknown"]) for category in rows.text]


def _identities(rows: TimedRows) -> list[str]:
    return [str(int(value)) for value in rows["id"].tolist()]


def _texts(column: np.ndarray) -> list[str]:
    return [value if isinstance(value, str) else "" for value in column.tolist()]


@functools.cache
def _colour(name: str, alpha: float) -> Color:
    """A colour written #rrggbb."""
    red, green, blue = (int(name[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return Color(r=red, g=green, b=blue, a=alpha)


@functools.cache
def _pair(key: str, value: str) -> KeyValuePair:
    return KeyValuePair(key=key, value=value)


_LEVEL = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
