"""The reference results: kept ones are what the program gives today, and a stopped command goes on."""

from __future__ import annotations

import csv
import gzip
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.results.rows import RunRow
from evaluation.runs.cpna import CpnaSuite
from evaluation.runs.specs import Conditions
from evaluation.studies.answers.break_even import BreakEven, Sweep
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.study import Sample
from evaluation.studies.reference import command
from evaluation.studies.reference.article.article import ARTICLE
from evaluation.studies.reference.cpna import CpnaStudy
from evaluation.studies.reference.findings import drives
from evaluation.studies.reference.findings.answers import read
from evaluation.studies.reference.kept import read_json, read_records, read_rows
from evaluation.studies.reference.outside import drives_part
from evaluation.studies.reference.parts import PARTS
from evaluation.studies.reference.readme import README
from evaluation.studies.study import Study
from scenarios.scenes.scenes import SceneRun

REPORTS = Path(__file__).parents[4] / "reports"
TINY = CpnaStudy("tiny", CpnaSuite((20.0, 30.0), Conditions(("map",), "paper", ("dry",), "urban_street")))


OUTSIDE = Path(__file__).parents[5] / "shared"


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_kept_results_do_not_drift(part: Study[Any, Any]) -> None:
    if part.needs and not (REPORTS / part.name).is_dir():
        pytest.skip(f"{part.name} is made with data of others, and is not kept here yet")
    parts, lacks = command.with_data([part], OUTSIDE if OUTSIDE.is_dir() else None)
    if lacks:
        pytest.skip(f"data of others are not in ../shared: {lacks[part.name]}")
    assert command.drift(parts[0], REPORTS, count=2) == []


def test_the_pages_are_what_their_tables_give() -> None:
    for name, text in command.pages(REPORTS).items():
        assert (REPORTS / name).read_text(encoding="utf-8") == text, name


def test_every_picture_and_table_that_the_page_shows_is_there() -> None:
    pages = [(REPORTS / name).read_text(encoding="utf-8") for name in (README, ARTICLE)]
    links = [link for page in pages for link in re.findall(r"\]\(([^)]+)\)", page)]
    assert len(links) > 10
    files = {link.partition("#")[0] for link in links}
    assert sorted(file for file in files if not (REPORTS / file).is_file()) == []


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a part of two runs, just made."""
    monkeypatch.setattr(command, "PARTS", (TINY,))
    monkeypatch.setattr(command, "pages", lambda reports: {README: "page"})
    command.make_reports(tmp_path, (), 1, quiet=True)
    return tmp_path


def test_a_finished_part_is_not_run_again_and_what_is_missing_is(
    tiny: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = (tiny / "tiny" / "runs.csv").read_bytes()
    journal = tiny / command.JOURNAL / "tiny_runs.jsonl"
    first, _ = journal.read_bytes().splitlines(keepends=True)
    logs = sorted((tiny / "tiny" / "logs").iterdir())
    ran = []
    job = TINY.job

    def counted(task: object) -> object:
        ran.append(task)
        return job(task)  # type: ignore[arg-type]

    monkeypatch.setattr(CpnaStudy, "job", staticmethod(counted))
    command.make_reports(tiny, (), 1, quiet=True)
    assert ran == []
    journal.write_bytes(first + b'{"key": "torn')  # as a kill leaves it
    command.make_reports(tiny, (), 1, quiet=True)
    assert len(ran) == 1
    logs[0].unlink()
    command.make_reports(tiny, (), 1, quiet=True)
    assert len(ran) == 2
    assert sorted((tiny / "tiny" / "logs").iterdir()) == logs
    assert (tiny / "tiny" / "runs.csv").read_bytes() == table
    assert len(read_records(tiny / "tiny" / "runs.csv", RunRow)) == 2


def test_drift_is_told(tiny: Path) -> None:
    assert command.check_reports(tiny, ()) == []
    path = tiny / "tiny" / "runs.csv"
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    column = rows[0].index("flag_time_s")
    kept, rows[1][column] = rows[1][column], "1.0"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    assert command.check_reports(tiny, ()) == [f"tiny, run 1, flag_time_s: 1.0 is kept, {kept} comes out"]
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows[:2])
    assert command.check_reports(tiny, ()) == ["tiny: 1 runs are kept, 2 belong to it today"]
    (tiny / README).write_text("stale")
    assert any(README in line for line in command.check_reports(tiny, ()))


def test_parts_without_their_data_are_left_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drives = drives_part("drives/street", "street", ("path",))
    monkeypatch.setattr(command, "PARTS", (TINY, drives))
    monkeypatch.setattr(command, "pages", lambda reports: {README: "page"})
    command.make_reports(tmp_path / "out", (), 1, quiet=False)
    printed = " ".join(capsys.readouterr().out.split())
    assert "drives/street is left as it is: its data are not in this project; give --outside DIR" in printed
    assert (tmp_path / "out" / README).read_text() == "page"  # the page can do without
    assert command.check_reports(tmp_path / "out", ()) == []
    command.make_reports(tmp_path / "out", ["drives"], 1, quiet=False, outside=tmp_path)
    assert f"{tmp_path} has no street" in " ".join(capsys.readouterr().out.split()).replace("- ", "-")
    assert not (tmp_path / "out" / "drives").exists()


def write_street(folder: Path) -> None:
    """An ego at 10 m/s for 5 s, and a labelled person 40 m ahead."""
    folder.mkdir(parents=True)
    times = [k / 10 for k in range(51)]
    header = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,category,score"
    rows = [f"{t},40,0,0.6,0.6,0,pedestrian,0.9" for t in times]
    (folder / "detections.csv").write_text("\n".join([header, *rows, ""]))
    (folder / "labels.csv").write_text("\n".join([f"{header},track_id", *(f"{row},0" for row in rows), ""]))
    ego = [f"{t},{10 * t},0,0" for t in times]
    (folder / "ego.csv").write_text("\n".join(["stamp_s,x_m,y_m,yaw_rad", *ego, ""]))


def test_a_part_is_made_from_data_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, out = tmp_path / "outside" / "street", tmp_path / "out"
    write_street(data)
    part = drives_part("drives/street", "street", ("path", "all"))
    part = replace(part, options=replace(part.options, rules=("paper", "rss")))
    monkeypatch.setattr(command, "PARTS", (part,))
    monkeypatch.setattr(command, "pages", lambda reports: {README: "page"})
    command.make_reports(out, (), 1, quiet=True, outside=tmp_path / "outside")
    assert command.check_reports(out, (), outside=tmp_path / "outside") == []
    monkeypatch.setitem(drives.TITLES, "street", "A street")
    [kept] = drives.read([part], out)
    assert [line[0] for line in drives.rules_table(kept).rows] == ["paper", "rss"]
    assert drives.findings(kept)[0] == "1 drive, 0.05 km, 0.1 minutes, 1 pedestrian met."
    assert "Which area is quieter, so few drives do not decide." in drives.told_in_short([kept])
    table = out / part.name / part.table
    text = table.read_text()
    table.write_text(text.replace(",51,", ",52,", 1))
    [line] = command.check_reports(out, (), outside=tmp_path / "outside")[:1]
    assert line.startswith("drives/street, run 1, frames: 52 is kept, 51 comes out")


QUESTION = BreakEven(Sample(count=3), ("png",), sweeps=(Sweep("map_kerb_m", (1.0,)),), named=())


@pytest.fixture
def question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a small question, made with a side more than it has today."""
    before = replace(QUESTION, sweeps=(Sweep("map_kerb_m", (1.0, 2.0)),))
    rows = [
        Decision(k % 2 == 0, 5.0 * (k % 2), k % 3 == 0, k % 3 == 1, None, None, 1.0 * k, 2.0, "stopped")
        for k in range(6)
    ]
    scenes = tuple(
        SceneRun(f"{must} {k}", "drawn", must, "", (), 0.0)  # type: ignore[arg-type]
        for must in ("brake", "nothing")
        for k in range(3)
    )
    results = Results(scenes, {arm: tuple(rows[k:] + rows[:k]) for k, arm in enumerate(before.arms)})
    (tmp_path / QUESTION.name).mkdir()
    before.write_answer(tmp_path / QUESTION.name, results, before.answer(results), {"version": "of old"})
    monkeypatch.setattr(BreakEven, "given", lambda question, out: question)
    monkeypatch.setattr(command, "PARTS", (QUESTION, TINY))
    monkeypatch.setattr(command, "QUESTIONS", (QUESTION,))
    monkeypatch.setattr(command, "pages", lambda reports: {README: "page"})
    return tmp_path


def test_tables_are_written_again_from_kept_runs_as_new_runs_would_give_them(
    question: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = question / QUESTION.name
    kept = read_rows(folder / QUESTION.table)
    with pytest.raises(ResultsError, match="not the runs of today's break-even"):
        read(QUESTION, question)
    command.write_again(question, (), quiet=False)
    assert "runs of 2 sides that it has no more are left out" in capsys.readouterr().out.replace("\n", " ")
    # by hand: map and path without the error, then both with 1 m; the last two had 2 m
    assert read_rows(folder / QUESTION.table) == kept[: 4 * 6]
    assert read_json(folder / "study.json")["version"] == "of old"
    again = {path.name: path.read_bytes() for path in folder.iterdir()}
    results = read(QUESTION, question).results
    for path in folder.iterdir():
        path.unlink()
    QUESTION.write_answer(folder, results, QUESTION.answer(results), {"version": "of old"})
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == again
    assert (question / README).read_text() == "page"


def test_kept_runs_of_other_sides_are_refused(question: Path) -> None:
    path = question / QUESTION.name / QUESTION.table
    lines = gzip.decompress(path.read_bytes()).decode().splitlines(keepends=True)
    for wrong in ([lines[0], *lines[7:]], [*lines[:3], *lines[8:9], *lines[4:]], lines[:20]):
        path.write_bytes(gzip.compress("".join(wrong).encode()))
        with pytest.raises(ResultsError, match="not the runs of today's"):
            command.write_again(question, (), quiet=True)
    with pytest.raises(ArgumentError, match="--tables: tiny is written from its runs alone"):
        command.write_again(question, ["tiny"], quiet=True)


def test_mistakes_are_named(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="--only: no part 'all'; there are: tune, gain"):
        command.choose_parts(["all"])
    with pytest.raises(ResultsError, match="make it with smartmot-eval reference"):
        command.check_reports(tmp_path, ["paper"])
    (tmp_path / "runs.csv").write_text("strategy,others\nmap,2\n")
    with pytest.raises(ResultsError, match="not a table of this version"):
        read_records(tmp_path / "runs.csv", RunRow)
