"""Small folders of version 0.1.0: read as they were written."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from evaluation.views.frames import frames_of

FIELD = Path(__file__).parents[3] / "data" / "field" / "runs"
LOG = "cpna_paper_map_dry_none_50kmh_seed0"


def test_reading_runs_warns_of_nothing_and_keeps_every_digit() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        row = read_runs(FIELD / "good").iloc[0]
    assert row["flag_distance_m"] == float("23.777777777778102")


def test_columns_that_are_read_only_arrays_are_arranged_by_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pandas 3 hands out read-only arrays; here every version does."""
    plain = pd.Series.to_numpy

    def read_only(series: pd.Series, dtype: object = None, copy: bool = False) -> np.ndarray:
        values = plain(series, dtype=dtype, copy=copy)
        if not copy:
            values = values.view()
            values.flags.writeable = False
        return values

    monkeypatch.setattr(pd.Series, "to_numpy", read_only)
    log = read_log(FIELD / "good" / "logs" / f"{LOG}.parquet")
    # frames at 20 Hz from 0 to 7.80 s
    assert len(frames_of(log, None)) == 157
