"""Commands on damaged recordings and with damaged options: one line and status 2, or a line that counts."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from benchmarks.fuzz_inputs import BASES
from evaluation.cli.entry import main
from evaluation.errors import ArgumentError
from evaluation.studies.drive.recordings import Source
from evaluation.studies.drive.study import Options, prepare
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import DatasetError

Command = Callable[..., tuple[int, str, list[str]]]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Runs `smartmot-eval`: status, output, lines of errors."""

    def run(*words: object) -> tuple[int, str, list[str]]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err.splitlines()

    return run


@pytest.fixture
def recording(tmp_path: Path) -> Callable[[str], Path]:
    """A sound recording of a format."""

    def make(name: str) -> Path:
        folder = tmp_path / name.replace(" ", "_")
        folder.mkdir()
        next(base for base in BASES if base.name == name).make(folder)
        return folder

    return make


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize("word", ["drive", "mot"])
@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("CSV", "ego.csv"),
        ("Parquet", "detections.parquet"),
        ("KITTI", "calib/0000.txt"),
        ("nuScenes tables", "ego_pose.json"),
        ("Argoverse 2", "map/log_map_archive_here.json"),
        ("SimBEV", "simbev/infos/simbev_infos_val.json"),
    ],
)
def test_a_damaged_file_is_one_line(
    word: str, name: str, file: str, recording: Callable[[str], Path], command: Command, tmp_path: Path
) -> None:
    folder = recording(name)
    cut(folder / file)
    status, _, errors = command(word, folder, "--out", tmp_path / "out", "--quiet")
    assert status == 2
    (line,) = errors
    assert line.startswith(f"smartmot-eval: {folder / file}:")
    assert not any((tmp_path / "out").glob("*.csv"))


@pytest.mark.parametrize("word", ["drive", "mot"])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--sequence", "nowhere"], "--sequence: no 'nowhere'; there are: s"),
        (["--format", "kitti"], "no detections/*/<seq>.txt or detections/<seq>.txt"),
        (["--format", "paper"], "--format: unknown 'paper'"),
        (["--map", "nowhere.xodr"], "nowhere.xodr: "),
        (["--map", "FOLDER/ego.csv"], "ego.csv: "),
        (["--map", "FOLDER"], "no map/log_map_archive_*.json in it"),
        (["--map", "FAR"], "--map: does not cover the data: map x 1000"),
        (["--columns", "nonsense"], "--columns: "),
        (["--columns", "x_m=nowhere"], "no column 'nowhere' for x_m"),
        (["--frame-rate", "0"], "frame-rate"),
    ],
)
def test_options_that_cannot_be_meant(
    word: str,
    options: list[str],
    message: str,
    recording: Callable[[str], Path],
    command: Command,
    tmp_path: Path,
) -> None:
    folder = recording("CSV")
    far = tmp_path / "far.xodr"
    street = shipped_map("urban_street").read_text()
    far.write_text(re.sub(r'(<geometry [^>]*\bx=)"[^"]*"', r'\1"10000"', street))
    words = [option.replace("FOLDER", str(folder)).replace("FAR", str(far)) for option in options]
    status, _, errors = command(word, folder, "--out", tmp_path / "out", "--quiet", *words)
    assert status == 2
    (line,) = errors
    assert line.startswith("smartmot-eval: ")
    assert message in line


@pytest.mark.parametrize("ego", ["4", "4,2,1,1", "long,wide", "nan,2", "4,inf", "4,2,9", "", ",", "-4,2"])
def test_a_vehicle_that_is_none(
    ego: str, recording: Callable[[str], Path], command: Command, tmp_path: Path
) -> None:
    status, _, errors = command("drive", recording("CSV"), "--out", tmp_path / "out", f"--ego={ego}")
    assert status == 2
    (line,) = errors
    assert line.startswith("smartmot-eval: --ego: ")


def changed(path: Path, column: str, row: int, value: object) -> None:
    table = pd.read_csv(path, dtype=str)
    table.loc[row, column] = str(value)
    table.to_csv(path, index=False)


@pytest.mark.parametrize(
    ("row", "column", "value", "message"),
    [
        (3, "x_m", "900000", r"sequence s: frame 0\.300 s is reached at 9e\+06 m/s"),
        (3, "stamp_s", "20", r"sequence s: frame 20\.000 s is 19\.8 s later than the one before; split"),
    ],
)
def test_no_vehicle_leaps(
    row: int, column: str, value: str, message: str, recording: Callable[[str], Path]
) -> None:
    folder = recording("CSV")
    for name in ("ego.csv", *(("detections.csv", "labels.csv") if column == "stamp_s" else ())):
        changed(folder / name, column, row, value)
    with pytest.raises(DatasetError, match=message):
        prepare(Options(Source(folder)))


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("a b", "a-b"), "2 drives would be called a-b_rectangular_paper_seed0: two sequences"),
        (("all", "b"), "sequence 'all': the name stands for all sequences together"),
    ],
)
def test_names_that_tables_and_logs_cannot_tell_apart(
    names: tuple[str, str], message: str, recording: Callable[[str], Path]
) -> None:
    folder = recording("CSV")
    for path in folder.glob("*.csv"):
        table = pd.read_csv(path)
        pd.concat([table.assign(sequence=name) for name in names]).to_csv(path, index=False)
    with pytest.raises((ArgumentError, DatasetError), match=message):
        prepare(Options(Source(folder)))
    assert len(prepare(Options(Source(folder, sequences=names[1]))).recordings) == 1


def test_detections_that_cannot_be_are_counted(
    recording: Callable[[str], Path], command: Command, tmp_path: Path
) -> None:
    folder = recording("CSV")
    changed(folder / "detections.csv", "length_m", 1, "-4")
    status, out, _ = command("drive", folder, "--out", tmp_path / "out", "--no-page", "--strategy", "path")
    assert status == 0
    assert "note: 1 impossible detections left out" in out
