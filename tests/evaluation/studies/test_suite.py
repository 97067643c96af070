"""Tests for runs with their files and their table."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
import rich.console

from evaluation.errors import ArgumentError
from evaluation.results.rows import avoided, read_runs
from evaluation.studies.suite import compare_files
from evaluation.views import pictures
from scenarios.catalogue.library import scenario_path
from scenarios.spec import RunSpec

LEAD = '<TraveledDistanceCondition value="$_Lead"/>'


def cpna(tmp_path: Path, speed_kmh: float, lead: str) -> RunSpec:
    """The paper's test, with another distance after which the pedestrian sets off."""
    shipped = scenario_path("cpna_paper")
    text = shipped.read_text()
    assert text.count(LEAD) == 1
    text = text.replace(LEAD, LEAD.replace("$_Lead", lead)).replace(
        '"catalogs/', f'"{shipped.parent}/catalogs/'
    )
    file = tmp_path / f"cpna_{speed_kmh:g}.xosc"
    file.write_text(text.replace('"../maps/', f'"{shipped.parent.parent}/maps/'))
    parameters = (("Ego_speed_kmh", speed_kmh),)
    return RunSpec("CPNA", str(file), parameters, "map", "paper", "dry", speed_kmh, paper_points=True)


def test_a_speed_without_conflict_wins_no_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At 40 km/h the pedestrian never sets off: the ego, which nobody meets, has avoided nothing."""
    specs = [cpna(tmp_path, 30.0, "$_Lead"), cpna(tmp_path, 40.0, "99999")]
    compare_files(specs, tmp_path / "out", None)
    runs = read_runs(tmp_path / "out")
    assert runs["score"].fillna(-1.0).tolist() == [2.0, -1.0]
    assert runs["score_max"].tolist() == [2.0, 3.0]
    assert avoided(runs).tolist() == [True, False]
    table = (tmp_path / "out" / "table.md").read_text().splitlines()
    assert table[2:] == [
        "| 30 | 0.00 | 2.00 |",
        "| 40 | no conflict | – |",
        "| **total** |  | **2.00/2** |",
        "| **no conflict** | **1 of 2** |  |",
    ]
    assert "CPNA, 40 km/h: no conflict without braking" in capsys.readouterr().out


def test_the_table_does_not_wait_for_the_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is drawn may fail: then the table has been shown, and its files are there."""

    def fails(*arguments: object, **options: object) -> list[Path]:
        raise ArgumentError("no room for pictures")

    monkeypatch.setattr(pictures, "save_pictures", fails)
    console = rich.console.Console(file=io.StringIO(), width=100)
    with pytest.raises(ArgumentError, match="no room"):
        compare_files([cpna(tmp_path, 30.0, "$_Lead")], tmp_path / "out", "png", console=console)
    assert isinstance(console.file, io.StringIO)
    assert "2.00" in console.file.getvalue()
    assert (tmp_path / "out" / "table.md").is_file()
