"""`smartmot-eval scenes`: what it writes, on the shipped maps and on those of a folder."""

import csv
import shutil
import sys
from pathlib import Path

import pytest

from evaluation.cli import main
from evaluation.studies.compare.valid_scenes import valid_scenes
from scenarios.catalogue.maps import shipped_map
from scenarios.drawn.draw import drawn_scenes


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def test_scenes_are_written_with_their_manifest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("scenes", "--split", "train", "--count", 2, "--seed", 3, "--out", tmp_path) == 0
    written = capsys.readouterr()
    assert written.out.split() == [str(tmp_path / "manifest.csv"), str(tmp_path / "rejected.csv")]
    assert "4 scenes drawn" in written.err
    with (tmp_path / "manifest.csv").open(newline="") as file:
        names = [row["scene"] for row in csv.DictReader(file)]
    assert names == [f"train-3-{kind}-000{number}" for kind in ("brake", "nothing") for number in (0, 1)]
    assert sorted(path.stem for path in tmp_path.glob("*.xosc")) == sorted(names)


def test_what_a_map_has_no_room_for_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A street without crosswalk, junction, bend and parking."""
    maps = tmp_path / "maps"
    maps.mkdir()
    shutil.copy(shipped_map("euro_ncap_street"), maps)
    (maps / "euro_ncap_street.xodr").write_text(
        shipped_map("euro_ncap_street").read_text().replace('type="crosswalk"', 'type="none"')
    )
    assert call("scenes", "--count", 6, "--maps", maps, "--out", tmp_path / "scenes", "-q") == 0
    assert "no map has room for" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "scenes" / "maps").iterdir()} == {"euro_ncap_street.xodr"}


def test_the_comparison_takes_them_as_valid(tmp_path: Path) -> None:
    """Its own judgement of an unbraked run agrees with the proof."""
    scenes = drawn_scenes("test", 6, 5, tmp_path)
    valid, reasons = valid_scenes(scenes)
    assert reasons == {}
    assert valid == scenes


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--split", "dev"], "expected one of train, test"), (["--maps", "."], "no OpenDRIVE file")],
)
def test_mistakes_end_in_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("scenes", *arguments, "--out", tmp_path / "scenes") == 2
    assert message in capsys.readouterr().err
