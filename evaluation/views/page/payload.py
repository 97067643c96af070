"""What the page's script gets to draw: a map once, and each run packed on its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evaluation.views.account.explain import Account
from evaluation.views.frames import SEEN, TRUTH, LogFrames
from evaluation.views.page.codec import (
    PER_METRE,
    PER_RADIAN,
    PER_SECOND,
    deltas,
    pack,
    restored,
    restored_ring,
    ring,
    unpack,
)
from evaluation.views.plots.ground import lane_outlines
from evaluation.views.plots.log_rows import events_of
from evaluation.views.plots.objects import signal_lamp
from evaluation.views.plots.temporal import event_text
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

AROUND_M = 90.0
"""Lanes nearer than this to the way of an ego are on the page: farther than any zoom shows."""

_UNITS = {
    "x": ("x_m", PER_METRE),
    "y": ("y_m", PER_METRE),
    "a": ("yaw_rad", PER_RADIAN),
    "l": ("length_m", PER_METRE),
    "w": ("width_m", PER_METRE),
    "v": ("speed_mps", PER_METRE),
    "h": ("horizon_s", PER_SECOND),
    "i": ("id", 1.0),
}
"""Short name, column of the log and unit of what is kept of an object."""


def pack_map(network: DriveMap, ways_m: Sequence[FloatArray], origin_m: FloatArray) -> str:
    """Lanes and crosswalks around the ways of the egos.

    Args:
        network: the map.
        ways_m: (F, 2) positions of each ego, map frame.
        origin_m: (2,) what the page's coordinates count from.
    """
    near = shapely.MultiPoint(np.concatenate(ways_m)).convex_hull.buffer(AROUND_M)
    lanes = [
        (kind, outline)
        for kind, outline in lane_outlines(network)
        if shapely.box(*outline.min(axis=0), *outline.max(axis=0)).intersects(near)
    ]
    crossings = [c.polygon for c in network.crosswalks if shapely.Polygon(c.polygon).intersects(near)]
    return pack(
        {
            "lanes": [[kind, ring(outline, origin_m)] for kind, outline in lanes],
            "crosswalks": [ring(np.asarray(outline), origin_m) for outline in crossings],
        }
    )


def pack_run(frames: LogFrames, account: Account, origin_m: FloatArray, diagram: Mapping[str, object]) -> str:
    """A run: its frames, what was in them, what was monitored, and its temporal diagram."""
    roles: list[str] = []
    areas = []
    for frame in range(len(frames)):
        outlines = frames.areas(frame)
        roles += [role for role, _ in dict(outlines).items() if role not in roles]
        areas.append([[roles.index(role), *ring(points, origin_m)] for role, points in outlines])
    stories = list(dict.fromkeys(account.story))
    return pack(
        {
            "t": deltas(frames.time_s, PER_SECOND),
            "first": account.frame,
            "ego": _columns(frames.ego, origin_m) | {"b": deltas(frames.ego["accel_mps2"], PER_METRE)},
            "objects": {kind: _objects(frames.objects[kind], origin_m) for kind in (*TRUTH, *SEEN)},
            "roles": roles,
            "areas": areas,
            "stories": stories,
            "story": deltas([stories.index(text) for text in account.story]),
            "status": list(account.status),
            "events": [
                [frames.frame_at(time), round(time, 3), layer, event_text(name)]
                for time, layer, name in events_of(frames.events)
            ],
            "signals": _signals(frames, origin_m),
            "diagram": diagram,
        }
    )


def _signals(frames: LogFrames, origin_m: FloatArray) -> list[list[Any]]:
    """Changes of traffic signals in the order of time: frame, id, what is lit, and where it stands."""
    rows = frames.signals
    at = np.rint((rows[["x_m", "y_m"]].to_numpy(np.float64) - origin_m) * PER_METRE).astype(int)
    named = zip(rows["frame"].tolist(), rows["category"], map(signal_lamp, rows["label"]), strict=True)
    return [
        [frame, str(signal), lamp, *place]
        for (frame, signal, lamp), place in zip(named, at.tolist(), strict=True)
    ]


def _objects(rows: pd.DataFrame, origin_m: FloatArray) -> dict[str, Any]:
    """Rows of one kind, object by object: an object that stands then costs nothing."""
    rank = rows.groupby("frame").cumcount() if rows["id"].isna().all() else rows["id"]
    rows = rows.assign(rank=rank).sort_values(["rank", "horizon_s", "frame"], kind="stable")
    labels, label = np.unique(rows["label"].fillna("").to_numpy(np.str_), return_inverse=True)
    categories, category = np.unique(rows["category"].fillna("").to_numpy(np.str_), return_inverse=True)
    return _columns(rows, origin_m) | {
        "f": deltas(rows["frame"]),
        "labels": labels.tolist(),
        "label": deltas(label),
        "categories": categories.tolist(),
        "category": deltas(category),
    }


def _columns(rows: pd.DataFrame, origin_m: FloatArray) -> dict[str, list[int]]:
    """Numbers of rows; positions count from the origin. Columns without any value are left out."""
    values = {short: rows[name].to_numpy(np.float64) for short, (name, _) in _UNITS.items()}
    values["x"], values["y"] = values["x"] - origin_m[0], values["y"] - origin_m[1]
    return {
        short: deltas(np.nan_to_num(column), _UNITS[short][1])
        for short, column in values.items()
        if np.isfinite(column).any()
    }


def read_run(packed: str, origin_m: FloatArray) -> dict[str, Any]:
    """What the page's script reads from a packed run, for tests and other programs.

    Returns:
        `time_s` (F,); `ego` and, in `objects`, each kind as columns of the log, map frame, in the order in
        which they are stored; `areas` per frame as role and (P, 2) ring; `signals`, each change as frame, id,
        lamp and (2,) place.
    """
    content = unpack(packed)

    def columns(table: Mapping[str, Any]) -> dict[str, Any]:
        read = {_UNITS[k][0]: restored(v, _UNITS[k][1]) for k, v in table.items() if k in _UNITS}
        read["x_m"], read["y_m"] = (
            read.get(name, np.zeros(0)) + origin_m[k] for k, name in enumerate(("x_m", "y_m"))
        )
        for name, texts in (("label", "labels"), ("category", "categories")):
            if name in table:
                read[name] = np.array(table[texts], dtype=np.str_)[restored(table[name]).astype(int)]
        if "f" in table:
            read["frame"] = restored(table["f"]).astype(int)
        return read

    return {
        "time_s": restored(content["t"], PER_SECOND),
        "ego": columns(content["ego"]),
        "objects": {kind: columns(table) for kind, table in content["objects"].items()},
        "areas": [
            [(content["roles"][role], restored_ring(steps, origin_m)) for role, *steps in frame]
            for frame in content["areas"]
        ],
        "signals": [
            (frame, signal, lamp, np.array(place) / PER_METRE + origin_m)
            for frame, signal, lamp, *place in content["signals"]
        ],
    }
