"""What a page prints of one's own file is enough to run its command."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.documents.blocks import blocks
from tests.documents.inputs import run_command, write_scenario


def test_the_table_of_the_page_about_tracking_is_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A car at 8 m/s: one track; labels with the same columns and `track_id` are read beside it."""
    (table,) = (block.code for block in blocks("docs/howto/tracking.md") if block.language == "text")
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "my_csv_folder"
    folder.mkdir()
    (folder / "detections.csv").write_text(table, encoding="utf-8")
    assert run_command(monkeypatch, ["mot", "my_csv_folder", "--out", "plain"]) == 0
    with (tmp_path / "plain" / "tracks.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["track_id"] for row in rows} == {"1"}
    assert [float(row["x_m"]) for row in rows] == pytest.approx([20.0, 20.8, 21.6], abs=0.2)
    head, *lines = table.splitlines()
    labels = "\n".join([f"{head},track_id", *(f"{line},1" for line in lines)])
    (folder / "labels.csv").write_text(labels, encoding="utf-8")
    pytest.importorskip("trackeval", reason="trackeval is not installed (extra metrics)")
    assert run_command(monkeypatch, ["mot", "my_csv_folder", "--out", "scored"]) == 0
    assert "hota" in capsys.readouterr().out.lower()


def test_the_scenario_of_the_page_runs_and_the_child_is_met_when_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By hand: the front starts 22.2 m from the start of the road, and meets the box at 82.2 m."""
    monkeypatch.chdir(tmp_path)
    write_scenario(tmp_path)
    assert run_command(monkeypatch, ["run", "child.xosc", "--check"]) == 0
    assert run_command(monkeypatch, ["run", "child.xosc", "--no-aeb", "--out", "plain"]) == 0
    with (tmp_path / "plain" / "runs.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["v_impact_kmh"]) == pytest.approx(40.0)
    assert float(row["contact_time_s"]) == pytest.approx((82.2 - 22.2) / (40 / 3.6), abs=1e-3)
    assert run_command(monkeypatch, ["run", "child.xosc", "--strategy", "path", "--out", "seen"]) == 0
    with (tmp_path / "seen" / "runs.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["v_impact_kmh"]) == 0.0
