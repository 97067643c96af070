"""Folders of results to report on: real runs, and one whose every number is known."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.results.logs import LOG_COLUMNS

Command = Callable[..., int]


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        try:
            main()
        except SystemExit as stop:
            return int(stop.code or 0)
    return 0


@pytest.fixture(scope="session")
def command() -> Command:
    return call


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """CPNA at two speeds with two strategies and bystanders: one of the four runs ends in a contact."""
    path = tmp_path_factory.mktemp("report") / "results"
    arguments = ["--speeds", "30,60", "--adversaries", "static", "--no-pictures", "--quiet", "--out", path]
    assert call("cpna", *arguments) == 0
    return path


@dataclass(frozen=True)
class Drive:
    """A car at constant speed; what it sees is added row by row.

    Args:
        speed_mps: of the car.
        yaw_rate_radps: of the car; 0: along x.
        frames: how many, 50 ms apart.
    """

    speed_mps: float = 10.0
    yaw_rate_radps: float = 0.0
    frames: int = 21

    @property
    def time_s(self) -> Any:
        return np.arange(self.frames) * 0.05

    def log(self, *more: dict[str, Any]) -> pd.DataFrame:
        """Log of the drive with more rows."""
        rows: list[dict[str, Any]] = []
        for time in self.time_s:
            yaw = self.yaw_rate_radps * time
            if self.yaw_rate_radps:
                radius = self.speed_mps / self.yaw_rate_radps
                x, y = radius * np.sin(yaw), radius * (1 - np.cos(yaw))
            else:
                x, y = self.speed_mps * time, 0.0
            rows.append(
                {"time_s": time, "kind": "ego", "x_m": x, "y_m": y, "yaw_rad": yaw, "length_m": 4.4,
                 "width_m": 1.8, "speed_mps": self.speed_mps, "accel_mps2": 0.0}
            )  # fmt: skip
        return pd.DataFrame([*rows, *more], columns=list(LOG_COLUMNS))


@pytest.fixture
def drive() -> type[Drive]:
    return Drive


def _row(**values: Any) -> dict[str, Any]:
    """A row of a table of runs."""
    return {
        "scenario": "street", "strategy": "rectangular", "preset": "physical", "weather": "dry",
        "adversaries": "none", "seed": 0, "v_test_kmh": 36.0, "v_impact_kmh": 0.0, "collided": False,
        "score": np.nan, "score_max": np.nan, "flag_time_s": np.nan, "flag_distance_m": np.nan,
        "stop_gap_m": np.nan, "contact_time_s": np.nan, "t0_s": np.nan, "end_reason": "passed",
        "end_time_s": 2.0, "false_activation": False, "log": "one",
    } | values  # fmt: skip


@pytest.fixture
def run_row() -> Callable[..., dict[str, Any]]:
    return _row
