"""`smartmot-eval lidar convert`: what is written, what is said, and the exit status."""

import sys
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main

Capture = pytest.CaptureFixture[str]


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", "lidar", "convert", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


@pytest.fixture
def velodyne(tmp_path: Path) -> Path:
    """Three clouds of KITTI, the second of no points."""
    folder = tmp_path / "velodyne"
    folder.mkdir()
    for number, count in enumerate((30, 0, 20)):
        rows = np.random.default_rng(number).normal(0, 20, (count, 4)).astype("<f4")
        (folder / f"{number:06d}.bin").write_bytes(rows.tobytes())
    return folder


@pytest.mark.parametrize("between", ["pcd", "npz", "pcd.bin", "bag"])
def test_folders_come_back_byte_by_byte(velodyne: Path, tmp_path: Path, between: str) -> None:
    if between == "bag":
        pytest.importorskip("rosbags")
    assert call(velodyne, tmp_path / "between", "--to", between) == 0
    assert call(tmp_path / "between", tmp_path / "back", "--to", "bin") == 0
    for path in velodyne.iterdir():
        assert (tmp_path / "back" / path.name).read_bytes() == path.read_bytes()


def test_what_is_lost_is_said_once(velodyne: Path, tmp_path: Path, capsys: Capture) -> None:
    assert call(velodyne, tmp_path / "sweeps", "--to", "pcd.bin") == 0
    capsys.readouterr()
    assert call(tmp_path / "sweeps", tmp_path / "back", "--to", "bin") == 0
    output = capsys.readouterr()
    assert output.out.split(": ")[1] == "3 clouds, 50 points\n"
    assert output.err.splitlines() == [
        "smartmot-eval: 1 of 3 clouds have no points",
        "smartmot-eval: axes of nuScenes kept: x right, y ahead (3 clouds)",
        "smartmot-eval: bin does not hold: ring (3 clouds)",
        "smartmot-eval: intensities kept, some over 1: in bin they are from 0 to 1, as a rule (2 clouds)",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("velodyne", "one.bin"), "several clouds"),
        (("velodyne", "out"), "--to: needed"),
        (("velodyne", "out", "--to", "las"), "--to: unknown 'las'"),
        (("velodyne", "a.pcd", "--to", "bin"), "--to: bin, but"),
        (("velodyne", "velodyne", "--to", "bin"), "is what is read"),
        (("nothing.bin", "a.pcd"), "no such file"),
        (("velodyne/000000.bin", "a.pcd", "--encoding", "zip"), "--encoding: unknown 'zip'"),
        (("text.txt", "a.pcd"), "no file with a cloud"),
    ],
)
def test_mistakes_are_one_line(
    velodyne: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, arguments: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(velodyne.parent)
    Path("text.txt").write_text("hello")
    assert call(*arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not Path("one.bin").exists()


def test_rows_of_eight_numbers_are_read_with_the_names_of_their_columns(
    tmp_path: Path, capsys: Capture
) -> None:
    rng = np.random.default_rng(1)
    rows = np.column_stack((rng.normal(0.0, 20.0, (300, 3)), rng.random(300), np.zeros((300, 4))))
    path = tmp_path / "radar.bin"
    path.write_bytes(rows.astype("<f4").tobytes())
    assert call(path, tmp_path / "radar.npz") == 2
    error = capsys.readouterr().err
    assert "rows of 8 numbers" in error
    assert "--columns" in error
    assert len(error.splitlines()) == 1
    assert call(path, tmp_path / "radar.npz", "--columns", "x,y,z,intensity,_,_,_,_") == 0
    assert "1 cloud, 300 points" in capsys.readouterr().out
    with np.load(tmp_path / "radar.npz") as archive:
        np.testing.assert_array_equal(archive["xyz_m"], rows[:, :3].astype("<f4"))
    assert call(path, tmp_path / "other.npz", "--columns", "x,y,intensity") == 2
    assert "--columns: expected x, y and z among the names" in capsys.readouterr().err
