"""Protocols that a file describes: the shipped one, what passes, and files that are wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.from_file import FMVSS_127, TableProtocol, named_table, worst_cell
from evaluation.protocols.grid import Cell, Measurement
from evaluation.protocols.registry import named_protocol
from evaluation.protocols.sheet import make_sheet
from evaluation.views.matrix.png import matrix_figure
from tests.figures import text_faults

G_MPS2 = 9.81

MADE_UP = """
title = "Yard rule 1"
source = "made up"
left_out = ["Trucks."]

[drivers.late]
source = "made up"
decel_mps2 = 4.0
ramp_s = 0.2
after_warning_s = 1.0

[[tests]]
name = "standing car"
source = "made up"
scenario = "approach"
parameters = { Start_s = 4.0 }
speeds_kmh = [20, 40]
place_percent = 50
place_tolerance_m = 0.1
pass = { impact_at_most_kmh = [0, 10.0], warning = "before_braking" }
columns = [
    { label = "middle" },
    { label = "edge", parameters = { Impact_percent = 25 }, place_percent = 25, driver = "late" },
]

[[tests]]
name = "nothing there"
source = "made up"
scenario = "pass_through"
speeds_kmh = [30]
meets = false
pass = { added_decel_below_mps2 = 1.0 }
"""


@pytest.fixture
def made_up(tmp_path: Path) -> TableProtocol:
    file = tmp_path / "yard.toml"
    file.write_text(MADE_UP)
    return named_table(file)


def test_a_file_becomes_matrices(made_up: TableProtocol) -> None:
    standing, nothing = made_up.blocks
    assert (standing.name, standing.columns) == ("standing car", ("middle", "edge"))
    assert [row.label for row in standing.rows] == ["20", "40"]
    assert (nothing.columns, len(nothing.cells)) == (("",), 1)
    assert (made_up.title, made_up.unknown) == ("Yard rule 1", ("Trucks.",))
    _, edge = made_up.asked(standing.cells[1])
    assert edge.driver is not None
    assert (edge.driver.decel_mps2, edge.place_percent) == (4.0, 25.0)
    assert named_protocol(str(made_up.table.file)).title == "Yard rule 1"


@pytest.mark.parametrize(
    ("speed_kmh", "run", "letter"),
    [
        (20.0, Measurement(0.0, warning_lead_s=0.3), "P"),
        (20.0, Measurement(0.0, warning_lead_s=math.inf), "P"),  # warned, and never braked
        (20.0, Measurement(0.01, warning_lead_s=0.3), "F"),
        (20.0, Measurement(0.0, warning_lead_s=0.0), "W"),  # at the onset is not before it
        (20.0, Measurement(0.0), "W"),
        (40.0, Measurement(10.0, warning_lead_s=0.3), "P"),  # the second speed has a limit of its own
        (40.0, Measurement(10.01, warning_lead_s=0.3), "F"),
        (20.0, Measurement(0.0, warning_lead_s=0.3, false_activation=True), "FA"),
        (20.0, Measurement(0.0, warning_lead_s=0.3, invalid="no conflict"), "×"),
    ],
)
def test_what_passes(made_up: TableProtocol, speed_kmh: float, run: Measurement, letter: str) -> None:
    cell = Cell("standing car", speed_kmh, condition="middle")
    assessment = made_up.assess({cell: run})
    assert assessment.block("standing car").scores[cell].mark.letter == letter
    total = assessment.total("together")
    assert (total.won, total.most) == (letter == "P", letter != "×")


@pytest.mark.parametrize(("added_mps2", "letter"), [(0.0, "P"), (0.999, "P"), (1.0, "F"), (None, "F")])
def test_what_is_a_false_activation(made_up: TableProtocol, added_mps2: float | None, letter: str) -> None:
    """The limit itself fails; what is not known does not pass."""
    (cell,) = made_up.cells("nothing there")
    score = made_up.assess({cell: Measurement(0.0, added_decel_mps2=added_mps2)}).block("nothing there")
    assert score.scores[cell].mark.letter == letter
    assert score.scores[cell].text == ("" if added_mps2 is None else f"{added_mps2:.1f}")


def test_the_worst_cell_is_the_fastest_impact(made_up: TableProtocol) -> None:
    cells = made_up.cells()
    clean = Measurement(0.0, warning_lead_s=1.0, added_decel_mps2=0.0)
    runs = dict.fromkeys(cells, clean)
    assert worst_cell(made_up.assess(runs)) == "no cell failed"
    runs[cells[0]] = Measurement(0.0)
    assert worst_cell(made_up.assess(runs)) == "standing car, middle, 20 km/h: fail, not warned as asked"
    runs[cells[-1]] = Measurement(0.0, added_decel_mps2=5.0)
    assert worst_cell(made_up.assess(runs)) == "nothing there, 30 km/h: 5.00 m/s2 added"
    runs[cells[2]] = Measurement(12.0)
    runs[cells[3]] = Measurement(11.0)
    assert worst_cell(made_up.assess(runs)) == "standing car, middle, 40 km/h: impact at 12.0 km/h"


LONG = "e" * 61
WRONG = {
    "no TOML": ("title =", "title = =", "Invalid value (at line 2, column 9)"),
    "unknown key": ("source = ", "sauce = 1\nsource = ", "sauce: unknown; there are: title, source"),
    "no title": ('title = "Yard rule 1"', "", "title: missing"),
    "a title of two lines": ('"Yard rule 1"', '"Yard\\nrule"', "title: must be one line of printable"),
    "no source of a test": (
        'name = "standing car"\nsource = "made up"',
        'name = "x"',
        "tests[1].source: missing",
    ),
    "no tests": (MADE_UP[MADE_UP.index("[[tests]]") :], "", "tests: there is none"),
    "tests as a number": (MADE_UP, 'title = "a"\nsource = "b"\ntests = 3', "tests: must be a list of tables"),
    "a test twice": ('"nothing there"', '"standing car"', "tests: 'standing car' is there twice"),
    "a speed twice": ("[20, 40]", "[20, 20.0]", "tests[1].speeds_kmh: 20.0 is there twice"),
    "a speed of 0": ("[20, 40]", "[0, 40]", "tests[1].speeds_kmh: a test speed must be positive"),
    "an infinite speed": (
        "[20, 40]",
        "[20, inf]",
        "tests[1].speeds_kmh[2]: must be a number from 0, got inf",
    ),
    "a speed as text": ("[20, 40]", '["20"]', "tests[1].speeds_kmh[1]: must be a number from 0, got '20'"),
    "a truth value as speed": (
        "[20, 40]",
        "[true]",
        "tests[1].speeds_kmh[1]: must be a number from 0, got True",
    ),
    "no speeds": ("[20, 40]", "[]", "tests[1].speeds_kmh: must be a list of numbers, got []"),
    "a huge number": ("[20, 40]", f"[1{'0' * 400}]", "tests[1].speeds_kmh[1]: must be a number from 0"),
    "too many cells": (
        "speeds_kmh = [30]",
        f"speeds_kmh = {list(range(1, 2001))}",
        "2004 cells; at most 2000",
    ),
    "a long name": ('"edge"', f'"{LONG}"', "tests[1].columns[2].label: 61 characters; at most 60"),
    "limits for other speeds": ("[0, 10.0]", "[0]", "pass.impact_at_most_kmh: 1 limits for 2 test speeds"),
    "no limit": (
        "{ added_decel_below_mps2 = 1.0 }",
        "{}",
        "tests[2].pass: empty; write what a run must reach",
    ),
    "no pass": ("pass = { added_decel_below_mps2 = 1.0 }", "", "tests[2].pass: missing"),
    "another warning": (
        '"before_braking"',
        '"soon"',
        "pass.warning: unknown 'soon'; use one of: given, before",
    ),
    "another driver": (
        'driver = "late"',
        'driver = "x"',
        "tests[1].columns[2].driver: unknown 'x'; there are: late",
    ),
    "a driver without onset": (
        "after_warning_s = 1.0",
        "",
        "drivers.late: driver: give one of after_warning_s",
    ),
    "two onsets": ("ramp_s = 0.2", "ramp_s = 0.2\nat_ttc_s = 1.0", "drivers.late: driver: give one of"),
    "no deceleration": ("decel_mps2 = 4.0", "decel_mps2 = 0", "driver: decel_mps2 must be positive"),
    "a column twice": ('"edge"', '"middle"', "tests[1].columns: 'middle' is there twice"),
    "a place beside": (
        "place_percent = 50",
        "place_percent = 101",
        "place_percent: must be a number from 0 to 100",
    ),
    "no place": (
        "place_percent = 50\n",
        "",
        "tests[1].place_percent: missing, though there is a place_tolerance_m",
    ),
    "the speed twice": ("Start_s = 4.0", "Ego_speed_kmh = 9", "parameters: Ego_speed_kmh is the test speed"),
    "a date": (
        "Start_s = 4.0",
        "Start_s = 2026-11-29",
        "tests[1].parameters.Start_s: must be a number, a text",
    ),
    "a huge parameter": (
        "Start_s = 4.0",
        f"Start_s = 1{'0' * 400}",
        "tests[1].parameters.Start_s: must be a",
    ),
    "a long path": ('"approach"', f'"{LONG * 9}"', "is no file, and no shipped scenario"),
    "no scenario": ('"approach"', '"../approach"', "is no file, and no shipped scenario: smartmot-eval list"),
    "another light": (
        "meets = false",
        'lighting = "dusk"',
        "tests[2].lighting: unknown 'dusk'; use one of: day",
    ),
    "empty columns": (
        "speeds_kmh = [30]",
        "speeds_kmh = [30]\ncolumns = []",
        "tests[2].columns: empty; write at least one, or leave it out",
    ),
    "a place without tolerance": (
        "place_tolerance_m = 0.1\n",
        "",
        "tests[1].place_tolerance_m: missing, though there is a place_percent",
    ),
    "a tolerance wider than a car": (
        "place_tolerance_m = 0.1",
        "place_tolerance_m = 10",
        "tests[1].place_tolerance_m: must be a number from 0 to 2.55, got 10",
    ),
    "a place where nothing is met": (
        "meets = false",
        "meets = false\nplace_percent = 50\nplace_tolerance_m = 0.1",
        "tests[2].place_tolerance_m: has no effect where meets is false",
    ),
    "a relative impact where nothing is met": (
        "meets = false",
        "meets = false\nrelative_impact = true",
        "tests[2].relative_impact: has no effect where meets is false",
    ),
    "a limit that cannot fail": (
        "[0, 10.0]",
        "[0, 40]",
        "tests[1].pass.impact_at_most_kmh: 40 passes whatever happens at 40 km/h",
    ),
    "a limit that cannot be kept": (
        "added_decel_below_mps2 = 1.0",
        "added_decel_below_mps2 = 0",
        "tests[2].pass.added_decel_below_mps2: 0 never passes",
    ),
    "a driver without a test": (', driver = "late"', "", "drivers.late: no test has this driver"),
    "a driver in another unit": (
        "decel_mps2 = 4.0",
        "decel_mps2 = 40",
        "drivers.late.decel_mps2: must be a number from 0 to 20, got 40",
    ),
    "meets as text": ("meets = false", 'meets = "no"', "tests[2].meets: must be true or false, got 'no'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_one_line_with_file_and_key(tmp_path: Path, name: str) -> None:
    old, new, message = WRONG[name]
    assert old in MADE_UP
    file = tmp_path / "yard.toml"
    file.write_text(MADE_UP.replace(old, new, 1))
    with pytest.raises(ProtocolError) as caught:
        named_table(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="No such file or directory"):
        named_table(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ProtocolError, match="not a text file"):
        named_table(tmp_path / "bytes.toml")
    (tmp_path / "deep.toml").write_text(f"a = {'[' * 5000}")
    with pytest.raises(ProtocolError, match=r"deep\.toml: "):
        named_table(tmp_path / "deep.toml")


# ---- FMVSS No. 127, from the tables of the final rule ------------------------------------------------------


def speeds(name: str) -> list[float]:
    """Test speeds of a test, in km/h."""
    return sorted({cell.speed_kmh for cell in named_table(FMVSS_127).cells(name)})


@pytest.mark.parametrize(
    ("name", "low_kmh", "high_kmh"),
    [
        ("Lead vehicle stopped", 10, 80),
        ("Lead vehicle stopped, manual brake", 70, 100),
        ("Lead vehicle slower", 40, 80),
        ("Lead vehicle slower, manual brake", 70, 100),
        ("Lead vehicle decelerating", 50, 80),
        ("Lead vehicle decelerating, manual brake", 50, 80),
        ("Pedestrian crossing from the right, day", 10, 60),
        ("Pedestrian crossing from the right, dark", 10, 60),
        ("Pedestrian crossing from the left, day", 10, 60),
        ("Child crossing from behind parked cars, day", 10, 50),
        ("Pedestrian stationary, day", 10, 55),
        ("Pedestrian stationary, dark", 10, 55),
        ("Pedestrian along the path, day", 10, 65),
        ("Pedestrian along the path, dark", 10, 65),
        ("False activation, steel plate", 80, 80),
        ("False activation, pass-through", 80, 80),
    ],
)
def test_the_ends_of_every_range_of_fmvss_127_are_tested(name: str, low_kmh: float, high_kmh: float) -> None:
    assert (speeds(name)[0], speeds(name)[-1]) == (low_kmh, high_kmh)


def test_numbers_of_fmvss_127() -> None:
    protocol = named_table(FMVSS_127)
    assert "May 2024 text" in protocol.title
    assert len(protocol.table.tests) == 16
    for test in protocol.table.tests:
        false_activation = test.name.startswith("False")
        assert test.meets is not false_activation
        assert test.rule.impact_at_most_kmh == (None if false_activation else (0.0,) * len(test.speeds_kmh))
        limit = test.rule.added_decel_below_mps2
        assert limit == (pytest.approx(0.25 * G_MPS2) if false_activation else None)
        warning = "before_braking" if test.name.startswith("Lead") else None if false_activation else "given"
        assert test.rule.warning == warning
        for column in test.columns:
            manual = "manual brake" in f"{test.name} {column.label}" and column.label != "no manual brake"
            assert (column.driver is not None) == manual
            if column.driver is not None:
                assert column.driver.decel_mps2 == pytest.approx(0.4 * G_MPS2)
                assert column.driver.at_ttc_s == (1.1 if false_activation else None)
                assert column.driver.after_warning_s == (None if false_activation else 1.0)
    decels = {
        float(column.parameters["Target_deceleration"])
        for test in protocol.table.tests
        for column in test.columns
        if "Target_deceleration" in column.parameters
    }
    assert sorted(decels) == pytest.approx([0.3 * G_MPS2, 0.5 * G_MPS2])


def test_texts_of_the_picture_keep_apart() -> None:
    protocol = named_table(FMVSS_127)
    runs = {cell: Measurement(cell.speed_kmh - 0.1, added_decel_mps2=0.0) for cell in protocol.cells()}
    assert text_faults(matrix_figure(make_sheet({"map": protocol.assess(runs)}))) == []
