"""Grids that are run: their files, what is left out, and the logs of single runs."""

import io
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from evaluation.protocols.assessment import CellScore
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.results.logs import read_logs
from evaluation.results.rows import read_runs
from evaluation.runs.execution import execute
from evaluation.runs.specs import Conditions
from evaluation.studies.ncap.grid import grid_of_shipped
from evaluation.studies.ncap.run import assess, run_grid, specs_of
from scenarios.catalogue.library import DEFINITIONS

HELD = Conditions(("map",), adapts=False)


@pytest.fixture
def cpna(tmp_path: Path) -> Path:
    """CPNA at 25 % with 40, 45 and 50 km/h; the protocol of 2026 has no 45 km/h."""
    file = tmp_path / "cpna.xosc"
    text = (DEFINITIONS / "cpna.xosc").read_text()
    for old, new in (
        ('filepath="crossing.xosc"', f'filepath="{DEFINITIONS}/crossing.xosc"'),
        ('<Element value="75"/>', ""),
        ('lowerLimit="10" upperLimit="60"', 'lowerLimit="40" upperLimit="50"'),
    ):
        assert old in text
        text = text.replace(old, new)
    file.write_text(text)
    return file


def run(*arguments: object, **options: object) -> str:
    """What a grid prints."""
    console = Console(file=io.StringIO(), width=200)
    run_grid(*arguments, 1, console, **options)  # type: ignore[arg-type]
    return console.file.getvalue()  # type: ignore[attr-defined,no-any-return]


def test_runs_without_a_cell_are_counted_and_listed(cpna: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shown = run([str(cpna)], "2026", HELD, out)
    assert "Runs that belong to no cell and are left out (all in left_out.txt): CPNA 1." in shown
    (line,) = (out / "left_out.txt").read_text().splitlines()
    assert line.startswith("cpna.xosc: run 0 (scenario CPNA, v_test_kmh 45.0")
    assert "the protocol tests CPNA at 10, 20, 30, 40, 50, 60 km/h" in line
    runs = read_runs(out)
    # two cells, each with five conditions
    assert len(runs) == 2 + 2 * 5
    assert runs["log"].isna().all()
    assert not (out / "logs").exists()
    assert (out / "matrix_2026.png").read_bytes().startswith(b"\x89PNG")
    assert "CPNA day, robustness" in shown
    assert "Robustness, not run and without points, because nothing here can simulate it: driver" in shown


def test_robustness_can_be_left_out(cpna: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shown = run([str(cpna)], "2026", HELD, out, robustness=False)
    assert len(read_runs(out)) == 2
    assert "Robustness was left out as asked (--no-robustness), and has no points." in shown
    assert "CPNA day, robustness" not in shown
    assert "robustness 0 of 0.125" in shown


def test_logs_are_kept_for_the_report_and_the_film(cpna: Path, tmp_path: Path) -> None:
    from evaluation.views.page.page import write_page

    out = tmp_path / "out"
    shown = run([str(cpna)], "2023", HELD, out, keep_logs=True, form="svg")
    assert "<svg" in (out / "matrix_2023.svg").read_text()
    runs = read_runs(out)
    assert len(runs) == runs["log"].nunique() == 3
    logs = read_logs(out, runs)
    assert set(logs) == set(runs["log"])
    assert "logs/" in shown
    page, _ = write_page(out, None, lambda done, total: None)
    text = page.read_text()
    assert all(log in text for log in runs["log"])


def test_the_fastest_contact_is_named_with_what_shows_it(cpna: Path, tmp_path: Path) -> None:
    """On snow, with 2.2 m/s2, nobody stops in time."""
    out = tmp_path / "out"
    shown = run([str(cpna)], "2023", Conditions(("rectangular",), weather=("snow",), adapts=False), out)
    worst = read_runs(out).sort_values("v_impact_kmh").iloc[-1]
    assert worst["v_impact_kmh"] > 0
    text = (
        f"{worst['v_test_kmh']:g} km/h, contact at {worst['v_impact_kmh']:.1f} km/h. To see it: give --logs"
    )
    assert text in shown


NO_CONFLICT = Path(__file__).parents[3] / "data" / "field" / "runs" / "ncap_no_conflict"


def test_a_target_that_never_moves_is_no_test(tmp_path: Path) -> None:
    """CPNA whose pedestrian never sets off: nobody brakes, nobody is hit, and nothing is won."""
    out = tmp_path / "out"
    shown = run([str(NO_CONFLICT)], "2026", HELD, out, robustness=False)
    last = shown.splitlines()[-1]
    assert last.endswith("7 of 7 cells are invalid and score nothing: 7 no conflict without braking")
    assert "standard 0 of 0.5, extended 0 of 0.0625" in shown
    assert (
        "No points, because this is required and not so: CPNA-75 at 10 km/h is green by day (not shown: a "
        "test is invalid); CPNA-75 at 20 km/h slows down by 5 km/h for a pedestrian of 3 km/h by day (not"
        in shown
    )
    assert " G" not in shown
    table = pd.read_csv(out / "cells.csv")
    assert len(table) == 7  # six speeds, and the slow pedestrian
    assert set(table["state"]) == {"invalid"}
    assert set(table["reason"]) == {"no conflict without braking: the ego touches no road user"}
    assert "the ego touches no road user" in (out / "matrix_2026.html").read_text()


def test_a_shifted_target_is_off_the_place_asked_for(tmp_path: Path) -> None:
    """Set off 0.3 s late it is met 23 % of the width further to the right, as in the cells of 50 %."""
    scenario = (DEFINITIONS / "crossing.xosc").read_text()
    for old, new in (
        ("../maps/", f"{DEFINITIONS.parent}/maps/"),
        ('path="catalogs/', f'path="{DEFINITIONS}/catalogs/'),
        ('value="$_Lead"/>', 'value="${$_Lead+0.3*$Ego_speed_kmh/3.6}"/>'),
    ):
        assert old in scenario
        scenario = scenario.replace(old, new)
    (tmp_path / "crossing.xosc").write_text(scenario)
    file = tmp_path / "cpna.xosc"
    text = (DEFINITIONS / "cpna.xosc").read_text()
    file.write_text(text.replace('<Element value="25"/>', ""))
    shown = run([str(file)], "2023", HELD, tmp_path / "out")
    assert shown.splitlines()[-1].endswith(
        "11 of 11 cells are invalid and score nothing: 11 target off the place asked for"
    )
    assert "avoided 0 of 0 valid cells" in shown
    table = pd.read_csv(tmp_path / "out" / "cells.csv")
    # 75 + 100 (0.06 - 0.3 5 / 3.6) / 1.8
    assert table["reason"].str.contains("it is met at 55 % of the ego's width, not between").all()


def test_cut_off_runs_and_false_activations_of_a_grid_are_not_avoided() -> None:
    """The same run, which avoids the collision, as if it had ended otherwise."""
    protocol = EuroNcap2023()
    grid = grid_of_shipped(protocol, "2023")
    run, spec = next(
        (run, spec)
        for run, spec in specs_of(grid, HELD, "2023")
        if ("scenario", "CPNA") in run.label and spec.v_test_kmh == 30.0
    )
    record = execute(spec, keep_log=False)
    assert record.row.avoided
    assert record.slowest_kmh < 30.0

    def score(**changes: object) -> CellScore:
        changed = replace(record, row=replace(record.row, **changes))  # type: ignore[arg-type]
        (block,) = (b for b in assess(protocol, [(run, changed)])["map"].blocks if b.cells_run)
        assert block.totals[0].won == (not changes)
        (found,) = (score for score in block.scores.values() if score.measurement)
        return found

    assert score().mark.name == "avoided"
    cut = score(end_reason="time_limit")
    assert cut.mark.name == "invalid test, scores nothing"
    assert cut.measurement is not None
    assert cut.measurement.invalid.startswith("cut off by the time limit")
    assert score(false_activation=True).mark.name == "false activation, failed"


def test_the_speed_reduction_is_that_against_the_run_without_braking() -> None:
    """It decides the requirement of the slow pedestrian, and the head-on tests."""
    protocol = EuroNcap2026()
    grid = grid_of_shipped(protocol, "2026", robustness=False)
    slow = [
        (run, execute(spec, keep_log=False))
        for run, spec in specs_of(grid, HELD, "2026")
        if ("condition", "general requirement") in run.label
    ]
    assert len(slow) == 2
    matrix = assess(protocol, slow)["map"].block("CPNA-75, pedestrian 3 km/h")
    for (_, record), score in zip(slow, matrix.scores.values(), strict=True):
        assert score.measurement is not None
        assert score.measurement.speed_reduction_kmh == pytest.approx(20.0 - record.slowest_kmh)
        assert (score.mark.name == "pass") is (record.slowest_kmh <= 15.0)
    # what was slowed and let go again before the contact is no reduction
    run, record = slow[0]
    hit = replace(record, slowest_kmh=2.0, row=replace(record.row, collided=True, v_impact_kmh=18.0))
    (score, *_) = assess(protocol, [(run, hit)])["map"].block("CPNA-75, pedestrian 3 km/h").scores.values()
    assert score.measurement is not None
    assert score.measurement.speed_reduction_kmh == pytest.approx(2.0)
    assert score.mark.name == "fail"
