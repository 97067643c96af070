"""Damaged folders and recordings: read, or refused in one line; never a traceback."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.fuzz_inputs import BAD, BASES, HANGS, READ, carry_out, fuzz, make_bases
from evaluation.cli import main
from scenarios.reading import ReadError, parse_json, shown

FIELD = Path(__file__).parents[1] / "data" / "field" / "runs"


@pytest.mark.filterwarnings("default")
def test_damaged_inputs_give_no_traceback() -> None:
    told: list[str] = []
    counts = fuzz(80, 7, told.append)
    assert told == []
    assert sum(counts.values()) == 80
    assert not any(kind in (BAD, HANGS) for _, kind in counts)
    assert {base for base, _ in counts} == {base.name for base in BASES}


def test_it_runs_as_a_script(tmp_path: Path) -> None:
    """Beside it lies a module that has the name of a package of ours."""
    script = Path(__file__).parents[2] / "benchmarks" / "fuzz_inputs.py"
    run = subprocess.run(
        [sys.executable, script, "--cases", "1"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "\n1 cases: " in run.stdout


@pytest.mark.filterwarnings("default")
def test_the_same_case_is_the_same_again(tmp_path: Path) -> None:
    (tmp_path / "bases").mkdir()
    bases = make_bases(tmp_path / "bases")
    results = []
    for _ in range(2):
        (tmp_path / "case").mkdir()
        results.append(carry_out(11, 7, bases, tmp_path / "case"))
        shutil.rmtree(tmp_path / "case")
    assert results[0] == results[1]


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("number", range(len(BASES)))
def test_what_is_damaged_is_sound_before(
    tmp_path: Path, number: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    base = BASES[number]
    if any(words[0] == "mot" for words in base.commands):
        pytest.importorskip("trackeval", reason="trackeval is not installed (extra mot)")
    (inputs := tmp_path / "inputs").mkdir()
    base.make(inputs)
    for words in base.commands:
        filled = [word.replace("DIR", str(inputs)).replace("OUT", str(tmp_path)) for word in words]
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *filled])
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code, capsys.readouterr().err
    assert READ == "read"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nuscenes_no_score", "sample 't0': field 'detection_score' must be a number"),
        ("nuscenes_huge_int", "detections.json: number out of range: "),
        ("nuscenes_deep", "detections.json: nested too deeply"),
    ],
)
def test_recordings_of_the_field_are_refused_in_one_line(
    tmp_path: Path,
    name: str,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["mot", FIELD / name, "--format", "nuscenes", "--out", tmp_path]
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"a": 1' + "0" * 400 + "}", "number out of range"),
        ('{"a": 1e999}', "number out of range"),
        ('{"a": 1, "b": {"c": 1, "c": 2}}', "key 'c' is there twice"),
        ('["\\ud800"]', "half a character"),
        ('{"\\uDC00": 1}', "half a character"),
        ("{\n'a': 1}", "line 2: not JSON"),
    ],
)
def test_json_that_no_value_can_be_made_of_is_refused(text: str, message: str) -> None:
    with pytest.raises(ReadError, match=message) as error:
        parse_json(text)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 200


def test_json_keeps_what_it_can_hold() -> None:
    found = parse_json('[123456789012345678, 12345678901234567890, "\\ud83d\\ude97", 0.1, null, true]')
    assert found == [123456789012345678, 1.2345678901234567e19, "\N{AUTOMOBILE}", 0.1, None, True]


def test_a_value_is_shown_in_one_short_line() -> None:
    deep: list[object] = []
    for _ in range(900):
        deep = [deep]
    for value in (deep, "a\nb" * 1000, {str(k): deep for k in range(100)}):
        assert "\n" not in shown(value)
        assert len(shown(value)) < 400
