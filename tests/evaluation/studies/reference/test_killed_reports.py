"""The reference report killed in the middle goes on: nothing is lost, nothing is counted twice."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.studies.compare.study import SceneStudy
from evaluation.studies.reference import command
from evaluation.studies.reference.parts import PARTS

NARROW = {"half_width_m": (0.9,)}


def small(name: str, strategies: tuple[str, ...]) -> SceneStudy:
    """A comparison of the reference on one variant, three times."""
    (whole,) = (part for part in PARTS if part.name == "seeds")
    assert isinstance(whole, SceneStudy)
    scenes = ("oncoming car in a bend",)
    return replace(whole, name=name, strategies=strategies, vary=NARROW, scenes=scenes, seeds=3)


SMALL = (
    small("control", ("all",)),
    small("several", ("rectangular", "all")),  # the control's runs belong to it, too
)
RUNS = 3 + 3
TABLES = [
    f"{part.name}/{name}"
    for part in SMALL
    for name in ("runs.csv", "table.csv", "table.md", "differences.csv", "compare.json")
]


def make(folder: Path) -> None:
    """The small report."""
    command.PARTS = SMALL  # type: ignore[misc]
    command.pages = lambda reports: {"README.md": "page"}  # type: ignore[assignment]
    command.make_reports(folder, (), 1, quiet=True)


def keys(journal: Path) -> list[str]:
    """Keys of the whole lines."""
    whole = journal.read_bytes().rpartition(b"\n")[0]
    return [json.loads(line)["key"] for line in whole.splitlines()]


def test_killed_in_the_second_part_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    code = "import sys, pathlib, test_killed_reports as t; t.make(pathlib.Path(sys.argv[1]))"
    journal = killed / command.JOURNAL / "scenes_runs.jsonl"
    killed.mkdir()
    with subprocess.Popen([sys.executable, "-c", code, str(killed)], cwd=Path(__file__).parent) as first:
        deadline = time.monotonic() + 60.0
        while not journal.exists() or journal.read_bytes().count(b"\n") < 4:
            assert time.monotonic() < deadline
            assert first.poll() is None
            time.sleep(0.005)
        os.kill(first.pid, signal.SIGKILL)
    assert first.returncode == -signal.SIGKILL
    before, times = keys(journal), journal.with_name("scenes_times.jsonl")
    lines = times.read_bytes().rpartition(b"\n")[0].splitlines()
    measured = {line for line in lines if json.loads(line)["key"] in before}
    assert not (killed / "README.md").exists()
    monkeypatch.setattr(command, "PARTS", SMALL)
    monkeypatch.setattr(command, "pages", lambda reports: {"README.md": "page"})
    for folder in (killed, whole):
        command.make_reports(folder, (), 1, quiet=True)
    found, usual = (keys(folder / command.JOURNAL / journal.name) for folder in (killed, whole))
    assert 4 <= len(before) < len(found) == len(set(found)) == RUNS
    # what was there has not been made again: its times, which are others in every run, are still there
    assert len(measured) == len(before)
    assert measured <= set(times.read_bytes().splitlines())
    assert sorted(found) == sorted(usual)
    for name in TABLES:
        assert (killed / name).read_bytes() == (whole / name).read_bytes(), name
    assert (killed / "README.md").read_text() == "page"
