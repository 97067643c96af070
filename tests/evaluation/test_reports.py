"""The kept reference results are what the program gives today."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.runner import choose_site, read_suite, run_suite
from evaluation.runs import load_named_map

REPORTS = Path(__file__).parents[2] / "reports"


@pytest.mark.parametrize(
    ("folder", "speeds_kmh", "strategies"),
    [
        ("paper", (60.0, 80.0), ("rectangular", "map")),
        ("static", (50.0,), ("rectangular",)),
        ("physical", (70.0,), ("rectangular", "map")),
        ("weather", (30.0,), ("map",)),
    ],
)
def test_reports_do_not_drift(
    folder: str, speeds_kmh: tuple[float, ...], strategies: tuple[str, ...]
) -> None:
    whole = read_suite(REPORTS / folder)
    weather = whole.weather[-1]
    with (REPORTS / folder / "runs.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["weather"] == weather]
    kept = {(row["strategy"], float(row["v_test_kmh"])): row for row in rows}
    part = replace(whole, speeds_kmh=speeds_kmh, strategies=strategies, weather=(weather,))
    # the same place as for the whole suite, which its fastest run decides
    site = choose_site(load_named_map(whole.map_name), whole.place, max(whole.speeds_kmh))
    for record in run_suite(part, site):
        row = kept[record.row.strategy, record.row.v_test_kmh]
        assert record.row.v_impact_kmh == pytest.approx(float(row["v_impact_kmh"]), abs=1e-6)
        assert record.row.flag_time_s == pytest.approx(float(row["flag_time_s"]), abs=1e-9)
