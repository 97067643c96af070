"""`smartmot-eval lidar score`: tables, what is said, and the exit status."""

import csv
import sys
from pathlib import Path

import pytest

from evaluation.cli import main

DATA = Path(__file__).parents[3] / "data" / "lidar" / "nuscenes_small"
Capture = pytest.CaptureFixture[str]


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", "lidar", "score", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def rows_of(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text().splitlines()))


@pytest.mark.parametrize(
    ("protocol", "header", "rows"),
    [("kitti", "R40 easy", 9), ("thesis", "untouched", 3), ("nuscenes", "ATE (m)", 4)],
)
def test_tables_are_written(tmp_path: Path, protocol: str, header: str, rows: int) -> None:
    labels, results = DATA / "labels", DATA / "results"
    assert call(labels, results, "--protocol", protocol, "--by", "range,occlusion", "--out", tmp_path) == 0
    table = rows_of(tmp_path / f"{protocol}.csv")
    assert header in table[0]
    assert len(table) == 1 + rows
    assert {row[0] for row in rows_of(tmp_path / "by_range.csv")} == {
        "class", "Car", "Pedestrian", "Cyclist",
    }  # fmt: skip
    page = (tmp_path / "scores.md").read_text()
    assert page.count("## ") == 3


def test_labels_scored_against_themselves_are_all_right(tmp_path: Path, capsys: Capture) -> None:
    assert call(DATA / "labels", DATA / "labels", "--protocol", "thesis", "--out", tmp_path) == 0
    header, *rows = rows_of(tmp_path / "thesis.csv")
    columns = [header.index(name) for name in ("FP", "missed", "F1")]
    assert {tuple(row[k] for k in columns) for row in rows} == {("0", "0", "1.0000")}
    assert "8 frames" in capsys.readouterr().out


def test_detections_that_kittis_rule_cannot_see_are_said(tmp_path: Path, capsys: Capture) -> None:
    text = (DATA / "results" / "000000.txt").read_text()
    (tmp_path / "000000.txt").write_text(text.replace("100 100 200 200", "-1 -1 -1 -1"))
    assert call(DATA / "labels", tmp_path) == 0
    output = capsys.readouterr().out
    assert f"{len(text.splitlines())} detections have image boxes without height" in output
    assert "7 of 8 frames with labels have no detections" in output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--protocol", "coco"), "--protocol: unknown 'coco'"),
        (("--by", "colour"), "--by: unknown 'colour'"),
        (("--by", "points"), "--by points: needs --clouds and --calib"),
        (("--classes", "Tram"), "no labels of Tram"),
        (("--protocol", "nuscenes", "--iou", "0.5"), "--iou"),
    ],
)
def test_mistakes_are_one_line(capsys: Capture, arguments: tuple[str, ...], message: str) -> None:
    assert call(DATA / "labels", DATA / "results", *arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_no_such_files_are_one_line(tmp_path: Path, capsys: Capture) -> None:
    assert call(tmp_path / "nothing", DATA / "results") == 2
    assert capsys.readouterr().err.count("\n") == 1
