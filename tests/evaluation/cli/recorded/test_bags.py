"""Bags on the command line: both storages give the same, and options of bags are kept with the results."""

import json
import sys
from pathlib import Path

import pytest

from evaluation.cli import main
from tests.scenarios.ros.bags_made import MCAP, SQLITE


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def test_both_storages_give_the_same_tracks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = []
    for path in (SQLITE, MCAP):
        assert call(monkeypatch, "mot", path, "--out", tmp_path / path.name, "--quiet") == 0
        text = (tmp_path / path.name / "tracks.csv").read_text()
        tracks.append(text.replace(path.name, "bag"))
    assert tracks[0] == tracks[1]
    assert tracks[0].count("\n") > 70


def test_options_of_bags_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    options = ("--velocity-frame", "sensor", "--topic", "/bevfusion_detections", "--strategy", "path")
    assert call(monkeypatch, "drive", MCAP, "--out", out, "--no-page", "--quiet", *options) == 0
    stored = json.loads((out / "drives.json").read_text())["configuration"]
    assert stored["columns"] == {
        "topic": "/bevfusion_detections",
        "odometry": None,
        "velocity_frame": "sensor",
    }
    assert call(monkeypatch, "report", out) == 0
    assert "are not drawn" not in capsys.readouterr().out


def test_bags_are_no_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for options, said in (
        (("--topic", "/a", "--frame-rate", "10"), "--columns and --frame-rate are for tables"),
        (("--topic", "/a"), "--topic /a: not a topic with boxes; there are: /bevfusion_detections"),
        (("--velocity-frame", "ego"), "--velocity-frame: unknown 'ego'"),
    ):
        assert call(monkeypatch, "mot", MCAP, "--out", tmp_path / "o", *options) != 0
        assert said in capsys.readouterr().err.replace("\n", " ")
