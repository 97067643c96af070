"""`smartmot-eval map FILE --check`: what is listed, and the exit status."""

import sys
from pathlib import Path

import pytest

from evaluation.cli import main
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


@pytest.fixture
def faulty(tmp_path: Path) -> Path:
    """A shipped map with one unknown lane type."""
    file = tmp_path / "faulty.xodr"
    text = shipped_map("urban_street").read_text(encoding="utf-8")
    assert 'type="sidewalk"' in text
    file.write_text(text.replace('type="sidewalk"', 'type="hyperloop"', 1), encoding="utf-8")
    return file


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_shipped_maps_are_clean(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", name, "--check", "--strict") == 0
    assert capsys.readouterr().out.splitlines() == ["0 defects"]


def test_a_faulty_map_is_listed_and_fails_only_if_strict(
    faulty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("map", faulty, "--check") == 0
    listed = capsys.readouterr().out
    assert "unknown lane type" in listed
    assert "'hyperloop'" in listed
    assert listed.splitlines()[-1] == "1 defects"
    assert call("map", faulty, "--check", "--strict") == 1
    assert capsys.readouterr().out == listed


def test_a_map_that_cannot_be_read_gives_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "broken.xodr"
    file.write_text(shipped_map("urban_street").read_text(encoding="utf-8")[:500], encoding="utf-8")
    assert call("map", file, "--check", "--strict") != 0
    answer = capsys.readouterr()
    assert answer.out == ""
    assert len(answer.err.splitlines()) == 1
    assert "not well-formed XML" in answer.err
