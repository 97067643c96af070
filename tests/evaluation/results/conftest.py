"""Runs and a log that the tests of results are made of."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pandas as pd

from evaluation.results.logs import LOG_COLUMNS
from evaluation.results.rows import RUN_COLUMNS, RunRow

STOPPED = RunRow(
    scenario="cpna",
    strategy="map",
    preset="paper",
    weather="clear",
    adversaries="none",
    seed=1,
    v_test_kmh=50.0,
    v_impact_kmh=0.0,
    collided=False,
    score=2.0,
    score_max=2.0,
    flag_time_s=0.1 + 0.2,
    flag_distance_m=17.25,
    stop_gap_m=1.5,
    contact_time_s=None,
    t0_s=4.25,
    end_reason="stopped",
    end_time_s=6.5,
    false_activation=False,
    detections=120,
    dropped_score=0,
    dropped_category=0,
    dropped_box=0,
    target_start_time_s=2.0,
    target_steady_time_s=None,
    ego_speed_at_contact_kmh=None,
    target_speed_at_contact_kmh=None,
    impact_location_percent=None,
    log="cpna-map-50",
)


HIT = replace(
    STOPPED,
    strategy="rectangular",
    v_impact_kmh=23.0,
    collided=True,
    score=0.0,
    stop_gap_m=None,
    contact_time_s=4.1,
    t0_s=4.1,
    end_reason="contact",
    end_time_s=4.1,
    target_steady_time_s=2.5,
    ego_speed_at_contact_kmh=23.0,
    target_speed_at_contact_kmh=5.0,
    impact_location_percent=48.3,
    log=None,
)
PUBLISHED: dict[str, dict[float, tuple[float, float | None]]] = {
    "rectangular": {50.0: (23.82, 2.0), 60.0: (44.23, 0.0)},
    "map": {50.0: (0.0, 2.0), 70.0: (0.0, None)},
}


def runs_of(*rows: RunRow) -> pd.DataFrame:
    values = [[getattr(row, field.name) for field in fields(RunRow)] for row in rows]
    return pd.DataFrame(values, columns=list(RUN_COLUMNS))


def some_log(count: int = 3) -> dict[str, np.ndarray[Any, Any]]:
    table: dict[str, np.ndarray[Any, Any]] = {name: np.arange(count) / 7.0 for name in LOG_COLUMNS}
    table["kind"] = np.array(["ego", "track", "event"][:count])
    table["category"] = np.array(["", "pedestrian", "start"][:count])
    table["label"] = np.array([None, "threat", "run_start"][:count], dtype=object)
    table["id"] = np.array([np.nan, 7.0, np.nan][:count])
    table["horizon_s"] = np.full(count, np.nan)
    return table


CUT_OFF = replace(STOPPED, score=None, end_reason="time_limit", end_time_s=60.0, false_activation=None)
