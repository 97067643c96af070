"""The page of a comparison: points, intervals and runs as the tables have them; its replays."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from evaluation.metrics.intervals import Estimate
from evaluation.results.files import ResultsError
from evaluation.studies.answers.command import ask
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.study import Sample
from evaluation.studies.comparison_page import page as comparison_page
from evaluation.studies.comparison_page.page import comparison_content
from evaluation.studies.logged import most_telling
from evaluation.views.page.comparison import HEIGHT, WIDTH, PointView, chart

REPORTS = Path(__file__).parents[4] / "reports"


@pytest.mark.parametrize("name", ["frontier_physical", "ablation", "gain", "drives/kitti", "trigger", "tune"])
def test_every_side_is_a_point_with_its_runs(name: str) -> None:
    content = comparison_content(REPORTS / name)
    compared = content.comparison
    assert compared is not None
    assert compared.sentences
    if name in ("frontier_physical", "ablation", "drives/kitti"):
        with (REPORTS / name / "table.csv").open() as file:
            assert len(compared.points) == len(list(csv.DictReader(file)))
    drawn = {number for one in compared.charts for mark in one.marks for number, _ in mark.numbers}
    left_out = {number for one in compared.charts for number in one.left_out}
    assert drawn | left_out == {point.number for point in compared.points}
    assert content.runs == []
    assert "logs" in content.notes[0]


@pytest.mark.parametrize("name", ["break-even", "sensor"])
def test_a_page_counts_no_sides_and_promises_no_logs_where_it_has_no_points(name: str) -> None:
    content = comparison_content(REPORTS / name)
    assert content.comparison is not None
    assert content.comparison.sentences
    has_points = bool(content.comparison.points)
    assert ("Sides" in content.facts) == ("Runs" in content.facts) == has_points
    assert any("--logs" in note for note in content.notes) == has_points
    assert content.facts.get("Runs") != "0"


def test_runs_behind_a_point_are_those_that_its_rate_counts() -> None:
    folder = REPORTS / "frontier_physical"
    content = comparison_content(folder)
    assert content.comparison is not None
    with (folder / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row, point in zip(rows, content.comparison.points, strict=True):
        assert point.left_out == ""
        assert len(point.lines) == 55  # a seed each
        avoided = sum(line.outcome == "avoided" for line in point.lines)
        assert avoided == round(float(row["avoided"]) * int(row["avoided_count"]))
        false = sum(line.outcome == "false activation" for line in point.lines)
        assert false == round(float(row["false_activations"]) * int(row["false_activations_count"]))
        assert f"collisions avoided {100 * float(row['avoided']):.3g} [" in "; ".join(point.numbers)


def test_replays_are_those_of_the_runs_behind_the_points(logged: Path) -> None:
    content = comparison_content(logged)
    assert content.comparison is not None
    views = {view.log: view for view in content.runs}
    lines = [line for point in content.comparison.points for line in point.lines]
    assert len(content.comparison.points) == 2
    assert lines
    assert {line.log for line in lines} == set(views)
    for line in lines:
        assert views[line.log].account.collided == (line.outcome == "contact")
    # the two widths differ, so that a replay of the other would be seen
    assert len({line.outcome for line in lines}) > 1


def test_points_of_a_study_open_their_own_runs(tmp_path: Path) -> None:
    question = Gain(Sample(count=2), (), presets=("physical",), rules=("paper",))
    results = ask(question, tmp_path, quiet=True, logs=True)
    content = comparison_content(tmp_path / question.name)
    assert content.comparison is not None
    views = {view.log: view for view in content.runs}
    points = content.comparison.points
    assert len(points) == len(results.runs)
    assert len(views) == 4 * len(points)
    for point, (arm, runs) in zip(points, results.runs.items(), strict=True):
        names = (scene.name.split(", ")[0] for scene in results.scenes)
        by_scene = dict(zip(names, runs, strict=True))
        assert len(point.lines) == 4
        for line in point.lines:
            scene = line.title.rpartition(", ")[2]
            assert scene in line.log
            assert views[line.log].strategy == arm.strategy
            assert views[line.log].title.startswith(f"{point.name.split(', preset')[0]}, ")
            assert views[line.log].account.collided == by_scene[scene].collided
    # the rivals differ, so that a replay of another would be seen
    assert (
        len(
            {
                tuple(run.collided for run in runs) + tuple(run.unnecessary_stop for run in runs)
                for runs in results.runs.values()
            }
        )
        > 1
    )


def test_what_is_too_much_for_a_page_is_said(logged: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison_page, "most_telling", lambda sides: most_telling(sides, 2))
    content = comparison_content(logged)
    assert content.comparison is not None
    kept = [line for point in content.comparison.points for line in point.lines if line.log]
    assert len(content.runs) == len(kept) == 2
    assert any(line.kind == "bad" for line in kept)
    assert [note for note in content.notes if note.startswith("Replays of 2 of ")]


def test_every_side_has_its_share_and_what_ended_badly_comes_first() -> None:
    good, bad = ("avoided",), ("contact",)
    sides = [
        {"a": good, "b": bad, "c": good},
        {"a": good, "b": good, "c": good},
        {"a": bad, "b": bad, "c": bad},
    ]
    assert most_telling(sides, 4) == [(0, "b"), (0, "a"), (1, "a"), (2, "a")]
    assert most_telling(sides, 3) == [(0, "b"), (1, "a"), (2, "a")]
    assert len(most_telling(sides, 100)) == 9
    assert most_telling([], 5) == []


def test_marks_stand_where_their_values_are() -> None:
    points = [
        (PointView(k, str(k), "", (), ()), Estimate(x, x - 5, x + 5, 9), Estimate(y, float("nan"), y, 9))
        for k, (x, y) in enumerate([(10.0, 0.0), (45.0, 50.0), (45.5, 50.0), (float("nan"), 1.0)])
    ]
    made = chart("title", "x", "y", points, is_share=True)
    left, top, right, bottom = made.frame
    assert (0 < left < right < WIDTH, 0 < top < bottom < HEIGHT) == (True, True)
    assert [[number for number, _ in mark.numbers] for mark in made.marks] == [[0], [1, 2]]
    assert made.left_out == (3,)
    first, second = made.marks
    # the axis ends where the last interval does, at 50.5
    assert first.x == pytest.approx(left + (right - left) * 10.0 / 50.5, abs=0.06)
    assert (first.y, second.y) == (bottom, pytest.approx((top + bottom) / 2, abs=0.06))
    assert first.bars[0][::2] == pytest.approx([left + (right - left) * v / 50.5 for v in (5, 15)], abs=0.06)


@pytest.mark.parametrize(
    ("name", "text"), [("compare.json", "{"), ("table.csv", "a,b\n1,2\n"), ("table.md", "")]
)
def test_damaged_folders_are_refused_in_a_line(tmp_path: Path, name: str, text: str) -> None:
    for source in (REPORTS / "frontier_paper").iterdir():
        (tmp_path / source.name).write_bytes(source.read_bytes())
    if text:
        (tmp_path / name).write_text(text)
    else:
        (tmp_path / name).unlink()
    with pytest.raises(ResultsError, match=name.replace(".", r"\.")):
        comparison_content(tmp_path)
