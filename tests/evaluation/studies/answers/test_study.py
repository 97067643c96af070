"""A question carried out: drawn scenes, the same bytes for any number of workers, going on where it was."""

from __future__ import annotations

import csv
import dataclasses
import gzip
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.break_even import BreakEven, Sweep
from evaluation.studies.answers.command import ask
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.study import Sample
from scenarios.errors import ScenarioError
from smartmot.errors import PluginError

TINY = BreakEven(Sample(count=1), ("svg",), sweeps=(Sweep("margin_m", (1.0,)),), named=())


FOUR = dataclasses.replace(TINY, sample=Sample(count=2))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


def test_a_question_gives_the_same_bytes_for_any_number_of_workers_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tmp_path / "one", tmp_path / "two"
    ask(TINY, first, workers=1, quiet=True)
    ask(TINY, second, workers=2, quiet=True)
    written = contents(first / "break-even")
    assert written == contents(second / "break-even")
    assert b"](break_even.svg)" in written["answer.md"]
    assert {"answer.md", "runs.csv.gz", "study.json", "break_even.csv"} <= set(written)
    lines = gzip.decompress(written["runs.csv.gz"]).decode().splitlines()
    assert len(lines) == 1 + 3 * 2
    # every result says where its path comes from
    assert {row["path_from"] for row in csv.DictReader(lines)} == {"planner"}
    assert {arm["path_from"] for arm in json.loads(written["study.json"])["arms"]} == {"planner"}
    assert "Planned path: from the planner, exact relative to the ego" in written["answer.md"].decode()

    def fail(item: object) -> None:
        raise AssertionError("a finished run was carried out again")

    monkeypatch.setattr("evaluation.studies.answers.study.decide", fail)
    monkeypatch.setattr("evaluation.studies.answers.study.drawn_scenes", fail)
    ask(TINY, first, workers=1, quiet=True)
    assert contents(first / "break-even") == written


def test_mistakes_in_what_is_the_users_own_come_before_the_scenes_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(
        "class Area:\n    def __init__(self, view, preset):\n        self.name = 'area'\n\n"
        "    def at(self, ego):\n        raise RuntimeError('not today')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for own, message in (("mine:Area", "not today"), ("mine:Gone", "no 'Gone'"), ("gone:Area", "no module")):
        with pytest.raises(PluginError, match=message):
            ask(Gain(Sample(count=1), own=(own,)), tmp_path / "out", quiet=True)
    with pytest.raises(PluginError, match="no 'Gone'"):
        ask(Gain(Sample(count=1), rules=("mine:Gone",)), tmp_path / "out", quiet=True)
    assert not (tmp_path / "out").exists()
    sys.modules.pop("mine", None)


def test_a_setting_out_of_range_comes_before_the_scenes_are_drawn(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="margin_m"):
        ask(dataclasses.replace(TINY, sweeps=(Sweep("margin_m", (-1.0,)),)), tmp_path / "out", quiet=True)
    assert not (tmp_path / "out").exists()


def test_scenes_are_drawn_again_where_one_is_missing(tmp_path: Path) -> None:
    sample = Sample(count=1, seed=3)
    scenes = sample.draw(tmp_path)
    assert [scene.must for scene in scenes] == ["brake", "nothing"]
    Path(scenes[0].file).unlink()
    assert sample.draw(tmp_path) == scenes
    assert Path(scenes[0].file).is_file()


def test_a_draw_that_was_killed_leaves_no_list_beside_the_files_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files have the names of those that were there."""
    sample = Sample(count=1, seed=3)
    scenes = sample.draw(tmp_path / "out")
    written = Path(scenes[0].file).read_bytes()

    def killed(*_: object) -> None:
        Path(scenes[0].file).write_bytes(b"another scene")
        raise KeyboardInterrupt

    (tmp_path / "maps").mkdir()
    others = dataclasses.replace(sample, maps=tmp_path / "maps")
    with pytest.raises(ScenarioError, match="no OpenDRIVE file"):
        others.draw(tmp_path / "out")
    assert sample.draw(tmp_path / "out") == scenes
    with monkeypatch.context() as patch:
        patch.setattr("evaluation.studies.answers.study.drawn_scenes", killed)
        with pytest.raises(KeyboardInterrupt):
            others.draw(tmp_path / "out")
    assert sample.draw(tmp_path / "out") == scenes
    assert Path(scenes[0].file).read_bytes() == written


def test_a_killed_question_goes_on_with_the_same_bytes(tmp_path: Path) -> None:
    """Killed after a few runs with two workers, finished with one: as if it had never been stopped."""
    whole, resumed = tmp_path / "whole", tmp_path / "resumed"
    code = (
        "import sys; from pathlib import Path; from evaluation.studies.answers.command import ask; "
        "from tests.evaluation.studies.answers.test_study import FOUR; "
        "ask(FOUR, Path(sys.argv[1]), 2, True) if __name__ == '__main__' else None"
    )
    ask(FOUR, whole, workers=1, quiet=True)
    process = subprocess.Popen([sys.executable, "-c", code, str(resumed)], cwd=Path(__file__).parents[4])
    journal = resumed / "study_runs.jsonl"
    try:
        while process.poll() is None and not (journal.is_file() and journal.read_bytes().count(b"\n") >= 3):
            time.sleep(0.02)
    finally:
        process.kill()
        process.wait()
    kept = journal.read_bytes().count(b"\n")
    assert 3 <= kept <= 12
    ask(FOUR, resumed, workers=1, quiet=True)
    assert contents(resumed / "break-even") == contents(whole / "break-even")
    assert len(journal.read_bytes().splitlines()) == 3 * 4
