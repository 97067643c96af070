"""The command as a whole: version, names, groups, what was perhaps meant, the same options everywhere."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from evaluation.cli import app, main

ROOT = Path(__file__).parents[3]


def told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str
) -> tuple[int, str, str]:
    """Status, output and error output of a call."""
    monkeypatch.setattr("sys.argv", ["smartmot-eval", *words])
    with pytest.raises(SystemExit) as stop:
        main()
    output = capsys.readouterr()
    return int(stop.value.code or 0), output.out, output.err


def commands() -> dict[str, Callable[..., Any]]:
    return {str(command.name): command.callback for command in app.registered_commands if command.callback}


@pytest.mark.parametrize("module", ["smartmot", "evaluation"])
def test_python_runs_the_packages(module: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", module, "--version"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    version = sys.version.split()[0]
    assert done.stdout == f"smartmot {metadata.version('smartmot')}, Python {version}\n"


def test_every_command_has_a_heading(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _, help_text, _ = told(monkeypatch, capsys, "--help")
    panels = dict(re.findall(r"╭─ ([^─]+) ─+╮\n(.*?)╰", help_text, flags=re.DOTALL))
    assert list(panels) == [
        "Options", "Run tests and scenarios", "Look at results", "Studies over many scenes", "Recorded data",
        "Scenarios, maps, point clouds",
    ]  # fmt: skip
    listed = [name for panel in panels.values() for name in re.findall(r"^│ ([a-z]+) ", panel, re.MULTILINE)]
    assert sorted(listed) == sorted([*commands(), "lidar"])


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("cpn",), "Did you mean 'cpna'?"),
        (("lidar", "scor"), "Did you mean 'score'?"),
        (("cpna", "--speedz", "30"), "--speeds"),
        (("run", "cpfaa"), "no file and no shipped scenario 'cpfaa' (did you mean 'cpfa'?)"),
        (("list", "crosing"), "(did you mean 'crossing'?)"),
        (
            ("cpna", "--strategy", "mpa"),
            "--strategy: unknown 'mpa' (did you mean 'map'?); use one or more of",
        ),
        (("cpna", "--preset", "phisical"), "(did you mean 'physical'?)"),
        (("cpna", "--tracker", "centrepoint"), "(did you mean 'centerpoint'?)"),
        (("compare", "--vary", "margin=1"), "(did you mean 'margin_m'?)"),
        (("ncap", "--protocol", "2032"), "(did you mean '2023'?)"),
    ],
)
def test_a_slip_is_answered_with_what_was_perhaps_meant(
    words: tuple[str, ...], meant: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    status, output, error = told(monkeypatch, capsys, *words)
    assert status == 2
    assert meant in error
    assert output == ""
    assert len(error.splitlines()) == 1


def test_an_old_name_is_understood_with_a_notice(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "reports" not in commands()
    status, _, error = told(monkeypatch, capsys, "reports", "--only", "nothing")
    first, second = error.splitlines()
    assert first == "smartmot-eval: reports is now called reference; the old name goes with the next version"
    assert second.startswith("smartmot-eval: --only: no part 'nothing'")
    assert status == 2


def test_the_number_of_processes_has_one_default() -> None:
    """One per core, with the same words, wherever there is such an option."""
    from evaluation.cli.options import Workers

    having = {
        name: inspect.signature(callback, eval_str=True).parameters["workers"]
        for name, callback in commands().items()
        if "workers" in inspect.signature(callback).parameters
    }
    assert {"cpna", "run", "ncap", "compare", "study", "reference"} <= set(having)
    assert {name for name, option in having.items() if option.default is not None} == set()
    assert {name for name, option in having.items() if option.annotation != Workers} == set()


def test_default_folders_hold_one_call_each(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The same call goes into the same folder; another gets one of its own, and says so."""
    monkeypatch.chdir(tmp_path)
    run = ("run", "crossing", "--strategy", "map", "--no-pictures", "-q", "--workers", "1")
    for words in (("--param", "Ego_speed_kmh=20"), ("--param", "Ego_speed_kmh=20", "--workers", "2")):
        assert told(monkeypatch, capsys, *run, *words) == (0, "", "")
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["run"]
    first = (tmp_path / "results/run/runs.csv").read_bytes()

    status, _, error = told(monkeypatch, capsys, *run, "--param", "Ego_speed_kmh=30")
    folders = Path("results/run"), Path("results/run-2")
    assert (status, error) == (
        0,
        f"smartmot-eval: {folders[0]} holds results of another call; these go to {folders[1]}\n",
    )
    assert folders[0].joinpath("runs.csv").read_bytes() == first
    assert len(list(folders[1].glob("logs/*.parquet"))) == 1

    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "notes.txt").write_text("of the user")
    replaced = "smartmot-eval: results of another call in mine are replaced\n"
    for speed, line in (("20", ""), ("30", replaced)):  # what is asked for by name is used, as a whole
        words = ("--param", f"Ego_speed_kmh={speed}", "--out", "mine")
        assert told(monkeypatch, capsys, *run, *words) == (0, "", line)
        (log,) = mine.glob("logs/*.parquet")
        assert f"_{speed}kmh_" in log.name
    assert (mine / "notes.txt").read_text() == "of the user"
    assert not (tmp_path / "mine-2").exists()
    (mine / ".smartmot-call").unlink()
    status, _, error = told(monkeypatch, capsys, *run, "--out", "mine")
    assert (status, error) == (
        2,
        "smartmot-eval: mine: has runs.csv of a call that is not known; remove it, or name another folder "
        "(--out)\n",
    )
