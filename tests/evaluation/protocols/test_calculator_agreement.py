"""Euro NCAP 2026 against Euro NCAP's own calculator, `euroncap-rating-2026`, wherever that is right."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from evaluation.protocols.bands import Colour, impact_bands, impact_colour, round_half_up, within_tolerance
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.grid import Criterion, ScoredBlock, blocks
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.euroncap_2026.verification import Source, share_kept, verify_impact
from evaluation.protocols.grid import Cell, Function, Layer, Measurement
from evaluation.protocols.marks import MARKS
from evaluation.protocols.robustness import CONDITIONS, LAYERS
from evaluation.runs.execution import execute
from evaluation.runs.specs import Conditions
from evaluation.studies.ncap.grid import grid_of_shipped
from evaluation.studies.ncap.run import assess, specs_of

pytest.importorskip("euroncap_rating_2026", reason="the calculator is a development dependency")

import pandas as pd
from euroncap_rating_2026 import common, numeric
from euroncap_rating_2026.crash_avoidance import (
    compute_score,
    data_model,
    matrix_processing,
    robustness_layer,
    test_info,
)

PROTOCOL = EuroNcap2026()
SHEETS = ("FC - Car & PTW pred.", "FC - Ped & Cyc pred.")
KEY = data_model.StageSubelementKey.FC
BLOCKS = {scored.block.name: scored for scored in blocks()}


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@cache
def template() -> dict[str, pd.DataFrame]:
    path = Path(str(files("euroncap_rating_2026"))).parent / "data" / "ca_template.xlsx"
    return pd.read_excel(path, sheet_name=[*SHEETS, "Test Scores", "Category Scores", "Scenario Scores"])


@cache
def points_of(name: str) -> tuple[Any, ...]:
    """The calculator's cells of one matrix, in its order; a row without a function is declared FCW."""
    for sheet in SHEETS:
        points = matrix_processing.get_test_matrix(template()[sheet], name, KEY)
        if points:
            for point in points:
                if "Function" not in point.attributes and name in ("CPLA day", "CPLA night", "CBLA"):
                    point.attributes["Function"] = "FCW"
            return tuple(points)
    raise AssertionError(f"the template has no matrix {name}")


def number(text: str) -> float:
    return float(text.replace(" km/h", "").replace("%", ""))


def cell_of(scored: ScoredBlock, point: Any) -> Cell:
    """Our cell with the attributes of the calculator's; there must be exactly one."""
    attributes = point.attributes
    found = []
    for cell in scored.block.cells:
        same = cell.speed_kmh == number(attributes["VUT speed"])
        if "Impact location" in attributes:
            same &= cell.impact_percent == number(attributes["Impact location"])
        if "Target speed" in attributes:
            same &= cell.target_speed_kmh == number(attributes["Target speed"])
        if "Function" in attributes:
            same &= str(cell.function) == attributes["Function"]
        if "Turn" in attributes:
            same &= cell.scenario[4] == attributes["Turn"][0].lower()
        found += [cell] if same else []
    assert len(found) == 1, (attributes, found)
    return found[0]


@pytest.mark.parametrize("name", BLOCKS)
def test_every_cell_and_its_range(name: str) -> None:
    scored = BLOCKS[name]
    theirs = {cell_of(scored, point): point.test_range.value.lower() for point in points_of(name)}
    assert theirs == {cell: str(cell.layer) for cell in scored.block.cells}


@pytest.mark.parametrize("name", BLOCKS)
def test_points_and_number_of_drawn_cells(name: str) -> None:
    scored = BLOCKS[name]
    most = data_model.TOTAL_SCORES[name]
    ours = (scored.points.standard, scored.points.extended, scored.points.robustness)
    assert ours == (most["Standard"], most["Extended"], most["Robustness"] or 0.0)
    assert scored.drawn == data_model.STANDARD_RANGE_VERIFICATION_TEST_NUM[name]


def test_families_and_categories_have_the_calculators_maxima() -> None:
    assessment = PROTOCOL.assess({})
    for sheet, unit in (("Test Scores", "Stage subelement"), ("Category Scores", "Category")):
        table = template()[sheet].copy()
        for column in ("Stage element", "Stage subelement"):
            table[column] = table[column].ffill()
        for _, row in table[table["Stage element"] == "Frontal Collisions"].iterrows():
            name = (
                row["Stage subelement"]
                if unit != "Category"
                else f"{row['Stage subelement']} / {row['Category']}"
            )
            assert assessment.total(name).most == pytest.approx(row["Max score"]), name


def values_kmh(speed_kmh: float) -> list[float]:
    """Impact speeds from 0 to the test speed: every half km/h, and 0.01 km/h about every limit."""
    grid = {i / 2 for i in range(int(2 * speed_kmh) + 1)}
    edges = {edge + step for edge in (0, 2, 8, 10, 12, 18, 20, 22, 28, 30, 32) for step in (-0.01, 0.0, 0.01)}
    return sorted(round(v, 2) for v in grid | edges if 0 <= v <= speed_kmh)


@pytest.mark.parametrize("name", BLOCKS)
def test_colour_of_every_cell_at_every_value(name: str) -> None:
    scored = BLOCKS[name]
    for point in points_of(name):
        cell = cell_of(scored, point)
        point.color = common.PredictionColor.GREEN
        warned = cell.function is Function.FCW and scored.warning
        grid = [i / 20 for i in range(80)] if warned else values_kmh(cell.speed_kmh)
        for value in grid:
            theirs = matrix_processing.ComputedTestPoint(point, name, value).measured_color
            if warned:
                measured = Measurement(0.0, warning_ttc_s=value)
            else:
                measured = Measurement(value, speed_reduction_kmh=value)
            assert PROTOCOL.colour(scored, cell, measured) == theirs.value, (cell, value)


@pytest.mark.parametrize("speed_kmh", [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 130.0])
def test_tolerance_and_applied_colour_for_every_prediction(speed_kmh: float) -> None:
    correct = (matrix_processing.PredictionResult.CORRECT, matrix_processing.PredictionResult.IN_TOLERANCE)
    name = "CCRm" if speed_kmh > 60 else "CPNA day"
    for band in impact_bands(speed_kmh):
        point = matrix_processing.TestPoint(
            0,
            0,
            common.PredictionColor(band.colour.value),
            matrix_processing.TestRange.STANDARD,
            {"VUT speed": f"{speed_kmh:g} km/h"},
        )
        for value in values_kmh(speed_kmh):
            theirs = matrix_processing.ComputedTestPoint(point, name, value)
            assert within_tolerance(speed_kmh, band.colour, value) == (theirs.prediction_result in correct)
            _, applied = verify_impact(speed_kmh, band.colour, value)
            assert applied == theirs.computed_color.value, (speed_kmh, band, value)


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("deceleration_mps2", [0.0, 2.0, 5.0, 8.8])
def test_assessed_runs_win_the_calculators_points(name: str, deceleration_mps2: float) -> None:
    """Runs with the closed form sqrt(v^2 - 2 a D), braking over 5 to 15 m, through our whole assessment."""
    scored = BLOCKS[name]
    runs = {}
    for index, cell in enumerate(scored.block.cells):
        braked_m = 5.0 + index % 11
        square = (cell.speed_kmh / 3.6) ** 2 - 2 * deceleration_mps2 * braked_m
        impact = max(square, 0.0) ** 0.5 * 3.6
        runs[cell] = Measurement(impact, 1.0 + cell.speed_kmh / 100, cell.speed_kmh - impact)
    for point in points_of(name):
        cell = cell_of(scored, point)
        value = runs[cell].impact_speed_kmh
        if cell.function is Function.FCW and scored.warning:
            value = runs[cell].warning_ttc_s or 0.0
        elif scored.criterion is Criterion.REDUCTION:
            value = runs[cell].speed_reduction_kmh or 0.0
        point.color = common.PredictionColor.GREEN
        computed = matrix_processing.ComputedTestPoint(point, name, numeric.round_half_up(value, 2))
        point.color = computed.measured_color
    standard, extended = test_info.compute_predicted_score(name, points_of(name))
    totals = {t.name: t for t in PROTOCOL.assess(runs).block(name).totals}
    won = {key: t.won if t.before_gate is None else t.before_gate for key, t in totals.items()}
    assert won["standard"] == pytest.approx(standard)
    assert won["extended"] == pytest.approx(extended)


def test_real_runs_win_the_calculators_points() -> None:
    """CPNA by day in the closed loop, on a wet road, from the shipped scenario to the points."""
    name = "CPNA day"
    scored = BLOCKS[name]
    conditions = Conditions(("rectangular",), weather=("rain",), adapts=False)
    grid = grid_of_shipped(PROTOCOL, "2026", robustness=False)
    wanted = {("scenario", "CPNA"), ("lighting", "day")}
    runs = tuple(run for run in grid.runs if wanted <= set(run.label) and run.spec.v_test_kmh >= 40.0)
    records = [
        (run, execute(spec, keep_log=False))
        for run, spec in specs_of(replace(grid, runs=runs), conditions, "2026")
    ]
    block = assess(PROTOCOL, records)["rectangular"].block(name)
    impact = {
        (r.spec.v_test_kmh, dict(run.label)["impact_location_percent"]): r.row.v_impact_kmh
        for run, r in records
    }
    colours = set()
    for point in points_of(name):
        cell = cell_of(scored, point)
        point.color = common.PredictionColor.RED
        value = impact.get((cell.speed_kmh, cell.impact_percent))
        assert (value is None) == (cell.speed_kmh < 40.0)
        if value is not None:
            computed = matrix_processing.ComputedTestPoint(point, name, numeric.round_half_up(value, 2))
            point.color = computed.measured_color
            colours.add(point.color)
            assert block.scores[cell].mark == MARKS[Colour(point.color.value)]
    assert len(colours) >= 3
    standard, extended = test_info.compute_predicted_score(name, points_of(name))
    totals = {total.name: total for total in block.totals}
    assert totals["standard"].won == pytest.approx(standard)
    assert totals["extended"].won == pytest.approx(extended)
    assert 0.0 < standard < totals["standard"].most


def test_share_kept_after_verification() -> None:
    sources = {"VTA": Source.VIRTUAL, "Self claimed": Source.SELF_CLAIMED}
    for layer, tables in data_model.SCORE_FROM_VERIFICATION_TEST_OUTCOME.items():
        for source, table in tables.items():
            for tested, shares in table.items():
                for confirmed, percent in shares.items():
                    ours = share_kept(sources[source], Layer(layer.lower()), tested, confirmed)
                    assert ours == percent / 100, (layer, source, tested, confirmed)


def test_robustness_conditions_are_the_calculators() -> None:
    for scenario, conditions in CONDITIONS.items():
        for layer in {condition.layer for condition in conditions}:
            key = robustness_layer.RobustnessLayer(layer)
            theirs = robustness_layer.ROBUSTNESS_LAYER_TO_VERIFICATION_CONDITION[key][scenario]
            bars = [bar.value for _, bar in (theirs if isinstance(theirs, list) else [theirs])]
            ours = [str(c.bar) for c in conditions if c.layer == layer]
            renamed = {"Same or better than predicted": "same colour or better", "Not red": "not red"}
            assert sorted(ours) == sorted(renamed[bar] for bar in bars), (scenario, layer)


def test_robustness_conditions_are_complete() -> None:
    numbers = (
        "Speed",
        "Acceleration",
        "Initial position offset",
        "Trajectory/Heading",
        "Illumination (Night)",
    )
    for scenario in LAYERS:
        theirs = {
            layer
            for layer in numbers
            if scenario
            in robustness_layer.ROBUSTNESS_LAYER_TO_VERIFICATION_CONDITION[
                robustness_layer.RobustnessLayer(layer)
            ]
        }
        assert theirs == {condition.layer for condition in CONDITIONS.get(scenario, ())}, scenario


def test_measured_values_are_rounded_alike() -> None:
    for i in range(0, 6000):
        value = i / 200  # every second one is a tie
        assert round_half_up(value) == numeric.round_half_up(value, 2), value


@pytest.mark.parametrize("name", ["CPLA day", "CPLA night"])
def test_rows_declared_aeb_fall_together_as_in_the_calculator(name: str) -> None:
    (scored,) = [s for s in blocks(Function.AEB) if s.block.name == name]
    speeds = [row.label for row in scored.block.rows]
    theirs = matrix_processing.classify_cpla_rows([f"{v} km/h" for v in speeds])
    for index, row in enumerate(scored.block.rows):
        standard = {
            f"{c.impact_percent:g}%" for c in row.cells if c is not None and c.layer is Layer.STANDARD
        }
        assert standard == theirs[index].standard_ils, row.label


def test_defect_a_speed_between_two_rows_is_refused_by_name_and_not_by_index() -> None:
    """The calculator stops with an IndexError at 15 km/h; the protocol has no such row, and ours says so."""
    point = matrix_processing.TestPoint(
        0, 0, common.PredictionColor.GREEN, matrix_processing.TestRange.STANDARD, {"VUT speed": "15 km/h"}
    )
    with pytest.raises(IndexError):
        matrix_processing.ComputedTestPoint(point, "CPNA day", 3.0)
    with pytest.raises(ProtocolError, match="no bands for a test speed of 15 km/h"):
        impact_colour(15.0, 3.0)


def test_defect_without_robustness_entries_the_layer_wins_nothing() -> None:
    """The calculator divides by zero on a blank sheet; nothing claimed wins nothing, as with NO in it."""
    blank = pd.DataFrame({"Robustness layer": ["Speed"], "CPNA": [float("nan")]})
    with pytest.raises(ZeroDivisionError):
        test_info.compute_robustness_layer_score(blank, "CPNA", "CPNA day")
    declined = pd.DataFrame({"Robustness layer": ["Speed"], "CPNA": ["NO"]})
    theirs = test_info.compute_robustness_layer_score(declined, "CPNA", "CPNA day")
    runs = {cell: Measurement(0.0, warning_ttc_s=3.0) for cell in PROTOCOL.cells("CPNA")}
    (robustness,) = [t for t in PROTOCOL.assess(runs).block("CPNA day").totals if t.name == "robustness"]
    assert robustness.won == theirs.total_score == 0.0


def test_defect_the_gate_fires() -> None:
    """The calculator looks for the colours in a sheet without row names, so that its gate never fires.

    The requirement is CPNA with the impact at 75 %: red there at 10 km/h takes every point, red at 25 % (the
    column that the calculator would read) does not.
    """
    colours = {f"{sheet} (bg)": pd.DataFrame([["Red"] * 12] * 151) for sheet in SHEETS}
    score = test_info.LoadcaseScore("CPNA", 1.0, 0.125, 0.0, 1.125)
    scores = {"Frontal Collisions": {"Ped & Cyc": {"CPNA": score}}}
    table = template()["Scenario Scores"].assign(Score=1.0)
    sys.modules[compute_score.callback.__module__].check_general_requirements_rules(colours, scores, table)
    assert score.total_score == 1.125  # every cell is red, and nothing is taken away
    columns = [p.attributes["Impact location"] for p in points_of("CPNA day") if p.row == 0]
    assert columns[3] == "25%"  # column 3 is where it would look
    for percent, passes in ((75.0, False), (25.0, True)):
        runs = {
            cell: Measurement(float(cell.speed_kmh == 10.0 and cell.impact_percent == percent))
            for cell in PROTOCOL.cells("CPNA")
        }
        assessment = PROTOCOL.assess(runs)
        assert all(gate.passed is not False for gate in assessment.gates) is passes
        assert (assessment.total("CPNA").won > 0.0) is passes
