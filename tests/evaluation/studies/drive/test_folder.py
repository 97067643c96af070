"""Folders of drives, shown: page, films and pictures; and what is said of broken ones."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from evaluation.results.files import ResultsError
from evaluation.studies.drive.folder import is_drive_folder, read_drive_folder
from evaluation.studies.drive.page import drive_content


def with_first(text: str, column: str, value: str) -> str:
    """A table with another value in its first row."""
    header, first, *others = csv.reader(io.StringIO(text))
    first[header.index(column)] = value
    changed = io.StringIO()
    csv.writer(changed, lineterminator="\n").writerows((header, first, *others))
    return changed.getvalue()


@pytest.fixture
def folder(driven: Path, tmp_path: Path) -> Path:
    """A copy of `driven`, to be changed at will."""
    shutil.copytree(driven / "data", tmp_path / "data")
    return shutil.copytree(driven / "out", tmp_path / "out")


def test_the_page_says_what_was_asked_and_on_which_way(folder: Path) -> None:
    assert is_drive_folder(folder)
    page = (folder / "report.html").read_text()
    for text in (
        "Recorded drives, 1 sequence: when each strategy would brake",
        "which no planner knows",
        "0 of 1 requests false activations, 1 undecided, on 0.06 km (6 s), 1 pedestrian met.",
        "a road user entered the way that the ego was yet to sweep",
        "Requests and exposure",
    ):
        assert text in page
    assert "Points won" not in page


def test_films_are_made_on_request_and_pages_of_few_drives(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    data, out, film = write([(50.0, 0.0)], seconds=0.4), tmp_path / "out", tmp_path / "new.gif"
    done = run("drive", data, "--out", out, "--strategy", "path", "--gif", film, "--no-page")
    assert done.status == 0, done.err
    assert f"film: {film}" in done.out
    assert not (out / "report.html").exists()
    with Image.open(film) as pictures:
        assert pictures.n_frames == 5


def test_areas_are_drawn_from_the_data(folder: Path) -> None:
    read = read_drive_folder(folder)
    assert read.notes == ()
    by_map, by_path = (read.view(row["log"]) for row in read.drives)
    for view in (by_map, by_path):
        assert view.network is not None
        assert any("Emergency brake requested" in text for text in view.account.story)
        assert view.account.outcome == "1 undecided"
    assert "current" in {role for role, _ in by_map.frames.areas(20)}


def test_replay_plot_and_report_show_a_folder_of_drives(
    folder: Path, run: Callable[..., Any], tmp_path: Path
) -> None:
    log = next(iter(sorted((folder / "logs").glob("*.parquet")))).stem
    done = run("replay", folder / log, "--gif", tmp_path / "one.gif", "--fps", "1", "--speed", "3")
    assert (done.status, done.out.strip()) == (0, str(tmp_path / "one.gif"))
    done = run("plot", folder, "--run", log, "--format", "svg")
    assert done.status == 0
    assert {path.name for path in folder.glob("*.svg")} == {"temporal_diagram.svg", "birdseye.svg"}
    done = run("report", folder, "--out", tmp_path / "page.html")
    assert done.status == 0
    assert (tmp_path / "page.html").read_bytes() == (folder / "report.html").read_bytes()
    done = run("replay", folder / "another")
    assert done.status == 2
    assert "no drive 'another'; it has: " in done.err


def test_without_the_data_only_the_log_is_drawn(folder: Path, tmp_path: Path) -> None:
    shutil.rmtree(tmp_path / "data")
    read = read_drive_folder(folder)
    [note] = read.notes
    assert note.startswith("Lanes and monitored areas are not drawn:")
    assert "no such folder or file" in note
    view = read.view(read.drives[0]["log"])
    assert view.network is None
    assert view.frames.areas(20) == []
    assert drive_content(read).packed_maps == []


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("drives.csv", lambda text: text.replace("km", "miles", 1), "columns missing: km"),
        ("drives.csv", lambda text: text.splitlines()[0] + "\n", "no drives"),
        ("drives.csv", lambda text: with_first(text, "km", "far"), "column 'km': expected a number"),
        ("drives.csv", lambda text: text.replace("0_map", "../map", 1), "no name of a log"),
        ("events.csv", lambda text: text.replace("emergency,", "emergency,x", 1), "column 'time_s'"),
        ("events.csv", lambda text: text + "1,2\n", "fields expected"),
    ],
)
def test_broken_tables_are_one_line(
    folder: Path, name: str, change: Callable[[str], str], message: str
) -> None:
    path = folder / name
    path.write_text(change(path.read_text()))
    with pytest.raises(ResultsError, match=message) as error:
        read_drive_folder(folder)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change",
    [
        {"specs": "all"},
        {"specs": [{"strategy": "path"}]},
        {"recordings": [7]},
        {"format": "paper"},
        {"data": 7},
        {"vehicle": None},
        {"map": "nowhere.xodr"},
    ],
)
def test_a_broken_configuration_leaves_the_logs(folder: Path, change: dict[str, object]) -> None:
    path = folder / "drives.json"
    content = json.loads(path.read_text())
    stored = content["configuration"]
    if change.keys() <= stored.keys():
        stored |= change
    else:
        stored["recordings"][0] |= change
    path.write_text(json.dumps(content))
    read = read_drive_folder(folder)
    assert len(read.notes) == 1
    assert read.view(read.drives[0]["log"]).frames.strategy is None
