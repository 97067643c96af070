"""Synthetic runs whose every number is known, and what to look for in a figure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from evaluation.results.logs import LOG_COLUMNS
from evaluation.results.rows import RunRow

BRAKES_MPS2 = 14.5
FRAME_S = 0.05
SPEEDS_KMH = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
FLAG_S = 2.0


@dataclass(frozen=True)
class Lanes:
    lane_type: tuple[str, ...]
    s_start_m: tuple[float, ...]
    s_end_m: tuple[float, ...]


@dataclass(frozen=True)
class Crosswalk:
    polygon: Any


@dataclass(eq=False)
class StraightRoad:
    """A straight road turned by its angle: lane, lane, sidewalk, and a lane far away."""

    yaw_rad: float = 0.3
    lanes: Lanes = field(
        default_factory=lambda: Lanes(
            ("driving", "driving", "sidewalk", "none", "parking"), (0.0,) * 5, (300.0,) * 4 + (5.0,)
        )
    )
    left_m: tuple[float, ...] = (0.0, 3.5, -3.5, 0.0, 900.0)
    right_m: tuple[float, ...] = (-3.5, 0.0, -6.0, 0.0, 897.0)

    def turned(self, points: Any) -> Any:
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.asarray(points, float) @ np.array([[cos, sin], [-sin, cos]])

    def lane_polygon(self, lane: int, s0_m: float, s1_m: float, /) -> Any:
        left, right = self.left_m[lane], self.right_m[lane]
        return self.turned([(s0_m, right), (s1_m, right), (s1_m, left), (s0_m, left)])

    @property
    def crosswalks(self) -> tuple[Crosswalk, ...]:
        return (Crosswalk(self.turned([(45, -6), (49, -6), (49, 3.5), (45, 3.5)])),)


@dataclass(frozen=True)
class Sweep:
    """Two strategies at six speeds with the flag at 2 s; the rectangle hits at 50 and 60 km/h."""

    runs: pd.DataFrame
    logs: dict[str, pd.DataFrame]
    speeds_kmh: tuple[float, ...] = SPEEDS_KMH
    brakes_mps2: float = BRAKES_MPS2


class Look:
    """What is to be found in a figure."""

    @staticmethod
    def by_gid(figure: Figure, gid: str) -> list[Any]:
        return figure.findobj(lambda artist: artist.get_gid() == gid)

    @staticmethod
    def points_of(axes: Any, gid: str) -> list[Any]:
        """(P, 2) points of each line of that name."""
        return [np.asarray(line.get_xydata(), dtype=float) for line in axes.lines if line.get_gid() == gid]

    @staticmethod
    def texts(figure: Figure) -> list[str]:
        return [artist.get_text() for artist in figure.findobj(Text)]

    @staticmethod
    def legend(figure: Figure) -> list[str]:
        return [text.get_text() for text in figure.legends[0].get_texts()]

    @staticmethod
    def labels_off_page(figure: Figure) -> list[str]:
        page = figure.bbox
        boxes = [(label, Text.get_window_extent(label)) for label in Look.by_gid(figure, "label")]
        return [
            label.get_text()
            for label, box in boxes
            if box.x0 < page.x0 or box.x1 > page.x1 or box.y0 < page.y0 or box.y1 > page.y1
        ]


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(LOG_COLUMNS))


def _braking_log(v_test_kmh: float, v_impact_kmh: float = 0.0) -> tuple[pd.DataFrame, float]:
    speed, final = v_test_kmh / 3.6, v_impact_kmh / 3.6
    t0 = FLAG_S + (speed - final) / BRAKES_MPS2
    times = np.unique(np.append(np.arange(0.0, t0, FRAME_S), t0))
    if v_impact_kmh == 0.0:
        times = np.append(times, t0 + FRAME_S * np.arange(1, 8))
    braking = np.clip(times - FLAG_S, 0.0, None)
    speeds = np.maximum(speed - BRAKES_MPS2 * braking, final)
    along = np.concatenate([[0.0], np.cumsum(np.diff(times) * (speeds[1:] + speeds[:-1]) / 2)])
    road = StraightRoad()
    x, y = road.turned(np.column_stack([along, np.full(len(along), -1.75)])).T
    rows = [
        {
            "time_s": t,
            "kind": "ego",
            "x_m": a,
            "y_m": b,
            "yaw_rad": road.yaw_rad,
            "length_m": 4.4,
            "width_m": 1.8,
            "speed_mps": v,
        }
        for t, a, b, v in zip(times, x, y, speeds, strict=True)
    ]
    touch = along[times == t0][0] + 2.2 + 0.3 + (0.0 if v_impact_kmh else 2.0)
    tx, ty = road.turned([(touch, -1.75)])[0]
    rows += [
        {
            "time_s": t,
            "kind": "actor",
            "label": "target",
            "category": "pedestrian",
            "x_m": tx,
            "y_m": ty,
            "yaw_rad": road.yaw_rad + math.pi / 2,
            "length_m": 0.6,
            "width_m": 0.6,
            "speed_mps": 0.0,
        }
        for t in times
    ]
    return _table(rows), t0


def _run_row(strategy: str, v_test: float, v_impact: float, t0: float) -> RunRow:
    return RunRow(
        scenario="cpna",
        strategy=strategy,
        preset="paper",
        weather="clear",
        adversaries="none",
        seed=1,
        v_test_kmh=v_test,
        v_impact_kmh=v_impact,
        collided=v_impact > 0.0,
        score=1.0,
        score_max=1.0,
        flag_time_s=FLAG_S,
        flag_distance_m=12.0,
        stop_gap_m=None if v_impact else 2.0,
        contact_time_s=t0 if v_impact else None,
        t0_s=t0,
        end_reason="contact" if v_impact else "stopped",
        end_time_s=t0,
        false_activation=False,
        detections=120,
        dropped_score=0,
        dropped_category=0,
        dropped_box=0,
        target_start_time_s=None,
        target_steady_time_s=None,
        ego_speed_at_contact_kmh=v_impact if v_impact else None,
        target_speed_at_contact_kmh=5.0 if v_impact else None,
        impact_location_percent=50.0 if v_impact else None,
        log=f"{strategy}-{v_test:g}",
    )


@pytest.fixture
def look() -> type[Look]:
    return Look


@pytest.fixture
def road() -> StraightRoad:
    return StraightRoad()


@pytest.fixture
def empty_log() -> pd.DataFrame:
    return _table([])


@pytest.fixture
def braking_log() -> Callable[..., tuple[pd.DataFrame, float]]:
    """Ego along the road that brakes fully at the flag, down to rest or to the impact; log and T0."""
    return _braking_log


@pytest.fixture
def sweep() -> Sweep:
    rows, logs = [], {}
    for strategy, speed in itertools.product(("map", "rectangular"), SPEEDS_KMH):
        impact = {50.0: 23.0, 60.0: 44.3}.get(speed, 0.0) if strategy == "rectangular" else 0.0
        log, t0 = _braking_log(speed, impact)
        rows.append(_run_row(strategy, speed, impact, t0))
        logs[f"{strategy}-{speed:g}"] = log
    return Sweep(pd.DataFrame(rows), logs)


@pytest.fixture
def scene_log() -> pd.DataFrame:
    """One frame: ego, a threat, a standing and a moving track, a dropped pedestrian, forecasts."""
    log, _ = _braking_log(40.0)
    ego = log[log["kind"] == "ego"].iloc[30]
    yaw = ego["yaw_rad"]
    rows: list[dict[str, Any]] = []

    def put(kind: str, ahead: float, left: float, **more: Any) -> None:
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = ego["x_m"] + ahead * cos - left * sin, ego["y_m"] + ahead * sin + left * cos
        rows.append({"time_s": ego["time_s"], "kind": kind, "x_m": x, "y_m": y, "yaw_rad": yaw, **more})

    person, car = {"length_m": 0.6, "width_m": 0.6}, {"length_m": 4.5, "width_m": 1.8}
    for ahead, left, number, state, speed, turn in (
        (20.0, -2.6, 3, "threat", 1.4, 1.5),
        (21.5, -2.9, 7, "dynamic", 1.2, 1.5),
        (30.0, 3.6, 4, "dynamic", 8.0, math.pi),
        (11.0, 3.4, 5, "static", 0.0, 0.0),
    ):
        size, category = (person, "pedestrian") if number in (3, 7) else (car, "car")
        more = {"category": category, "yaw_rad": yaw + turn, **size}
        put("detection", ahead, left, label="kept", **more)
        put("track", ahead, left, label=state, id=number, speed_mps=speed, **more)
        for horizon in (0.5, 1.0, 1.5, 2.0) if state != "static" else ():
            reach = speed * horizon
            there = (ahead + reach * math.cos(turn), left + reach * math.sin(turn))
            put("forecast", *there, id=number, horizon_s=horizon, **more)
    for ahead in (8.0, 16.0, 24.0):
        put("detection", ahead, -5.0, label="dropped", category="pedestrian", **person)
    for horizon in (0.5, 1.0, 1.5, 2.0):
        put("ego_forecast", horizon * 40 / 3.6, 0.0, horizon_s=horizon, length_m=4.4, width_m=1.8)
    return _table([*log.to_dict("records"), *rows])


@pytest.fixture
def scene_areas(road: StraightRoad) -> list[tuple[str, Any]]:
    outlines = {
        "current": [(12, -3.5), (60, -3.5), (60, 0), (12, 0)],
        "left": [(12, 0), (60, 0), (60, 3.5), (12, 3.5)],
        "vru_margin": [(12, -4.5), (60, -4.5), (60, -3.5), (12, -3.5)],
    }
    return [(role, road.turned(outline)) for role, outline in outlines.items()]
