"""Points, gates, robustness and totals of Euro NCAP 2026, computed by hand."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluation.protocols.assessment import Assessment
from evaluation.protocols.bands import Version
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026, extended_share
from evaluation.protocols.euroncap_2026.verification import Source, Verification
from evaluation.protocols.grid import Cell, Function, Layer, Lighting, Measurement

PROTOCOL = EuroNcap2026()


def avoided(*scenarios: str, protocol: EuroNcap2026 = PROTOCOL) -> dict[Cell, Measurement]:
    """Runs in which every collision is avoided and every warning early."""
    return {
        cell: Measurement(0.0, warning_ttc_s=3.0, speed_reduction_kmh=25.0)
        for scenario in scenarios
        for cell in protocol.cells(scenario)
    }


def points(assessment: Assessment, block: str, layer: str) -> float:
    (total,) = [t for t in assessment.block(block).totals if t.name == layer]
    return total.won


def hit(
    runs: dict[Cell, Measurement], impact_kmh: float, speeds: tuple[float, ...], percent: tuple[float, ...]
) -> dict[Cell, Measurement]:
    """The same runs with a contact in the named cells by day."""
    return {
        cell: Measurement(impact_kmh)
        if cell.speed_kmh in speeds and cell.impact_percent in percent and cell.lighting is Lighting.DAY
        else measured
        for cell, measured in runs.items()
    }


def test_everything_avoided_wins_everything_but_robustness() -> None:
    assessment = PROTOCOL.assess(avoided(*{block.scenario for block in PROTOCOL.blocks}))
    assert assessment.total("Frontal Collisions").most == pytest.approx(60.0)
    robustness = sum(
        total.most for block in assessment.blocks for total in block.totals if total.name == "robustness"
    )
    assert assessment.total("Frontal Collisions").won == pytest.approx(60.0 - robustness)
    assert assessment.total("CPNA").won == pytest.approx(1.0 + 0.125)
    assert assessment.total("Pedestrian & cyclist").most == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("impact_kmh", "speeds", "percent", "total"),
    [
        # all else green; the same values were measured through the calculator's command line
        (30.0, (10.0,), (25.0,), 0.972),  # 1 of 18 red by day: 1 - 0.5 / 18
        (25.0, (60.0,), (25.0, 50.0, 75.0), 0.938),  # 3 brown: 1 - 0.5 * 3 * 0.75 / 18
        (5.0, (50.0, 60.0), (25.0, 50.0, 75.0), 0.958),  # 6 yellow: 1 - 0.5 * 6 * 0.25 / 18
        (15.0, (60.0,), (50.0,), 1 - 0.5 * 0.5 / 18),  # 1 orange
    ],
)
def test_standard_points_of_cpna(
    impact_kmh: float, speeds: tuple[float, ...], percent: tuple[float, ...], total: float
) -> None:
    assessment = PROTOCOL.assess(hit(avoided("CPNA"), impact_kmh, speeds, percent))
    won = points(assessment, "CPNA day", "standard") + points(assessment, "CPNA night", "standard")
    assert won == pytest.approx(total, abs=6e-4)


@pytest.mark.parametrize(
    ("not_red", "share"), [(0, 0), (5, 0), (6, 0.5), (8, 0.5), (9, 0.75), (11, 0.75), (12, 1.0)]
)
def test_extended_points_come_in_steps(not_red: int, share: float) -> None:
    assert extended_share(not_red / 12) == share
    runs = avoided("CPNA")
    far = [
        cell for cell in runs if cell.layer is Layer.EXTENDED and cell.lighting is Lighting.DAY
    ]  # 6 speeds at 90 and at 10 %
    assert len(far) == 12
    for cell in far[not_red:]:
        runs[cell] = Measurement(cell.speed_kmh)
    assert points(PROTOCOL.assess(runs), "CPNA day", "extended") == pytest.approx(share * 0.0625)


def test_cells_that_were_not_run_win_nothing_and_are_named() -> None:
    runs = {cell: m for cell, m in avoided("CPNA").items() if cell.speed_kmh < 60}
    assessment = PROTOCOL.assess(runs)
    assert points(assessment, "CPNA day", "standard") == pytest.approx(0.5 * 15 / 18)
    assert "CPNA day: 25 of 30 cells run" in assessment.notes
    assert any(note.startswith("not run") and "CBFA" in note for note in assessment.notes)


def test_red_at_75_percent_and_10_kmh_takes_everything() -> None:
    runs = avoided("CPNA", "CPFA")
    gate = next(
        c
        for c in runs
        if (c.scenario, c.speed_kmh, c.impact_percent, c.lighting) == ("CPNA", 10, 75, Lighting.NIGHT)
    )
    runs[gate] = Measurement(0.5)
    assessment = PROTOCOL.assess(runs)
    assert all(total.won == 0.0 for total in assessment.totals)
    assert all(total.won == 0.0 for block in assessment.blocks for total in block.totals)
    assert assessment.total("CPFA").before_gate == pytest.approx(1.125)
    assert [gate.name for gate in assessment.gates if gate.passed is False] == [
        "CPNA-75 at 10 km/h is green by night"
    ]


def test_other_gates() -> None:
    rear = avoided("CCRs")
    assert PROTOCOL.assess(rear).gates[-1].passed is True
    slow = Cell("CCRs", 20.0, 0.0, 0.0)
    assert PROTOCOL.assess({**rear, slow: Measurement(1.0)}).gates[-1].passed is False
    fast = Cell("CCRs", 30.0, 0.0, 0.0)
    assert PROTOCOL.assess({**rear, fast: Measurement(1.0)}).gates[-1].passed is True
    some = {cell: m for cell, m in rear.items() if cell.speed_kmh != 10.0}
    assert PROTOCOL.assess(some).gates[-1].passed is None  # not all of it was run
    day, night = PROTOCOL.requirement_cells()
    gates = PROTOCOL.assess({day: Measurement(15.0), night: Measurement(15.1)}).gates
    assert [gate.passed for gate in gates[2:4]] == [True, False]


@pytest.mark.parametrize(
    ("measured", "passed"),
    [
        (Measurement(0.0, speed_reduction_kmh=5.0), True),
        (Measurement(0.0, speed_reduction_kmh=4.99), False),  # it went by, but hardly braked
        (Measurement(14.9, speed_reduction_kmh=5.1), True),
        (Measurement(20.0, speed_reduction_kmh=0.0), False),
        (Measurement(0.0, speed_reduction_kmh=20.0, invalid="no conflict without braking"), False),
        (Measurement(0.0, speed_reduction_kmh=20.0, false_activation=True), False),
    ],
)
def test_slowing_down_for_a_slow_pedestrian_is_measured(measured: Measurement, passed: bool) -> None:
    """From 5 km/h on, at which the test protocols take it that the brake acts."""
    day, _ = PROTOCOL.requirement_cells()
    assert PROTOCOL.assess({day: measured}).gates[2].passed is passed


def test_an_invalid_cell_scores_nothing_and_stays_in_the_maximum() -> None:
    runs = avoided("CPNA")
    bad = next(c for c in runs if (c.speed_kmh, c.impact_percent, c.lighting) == (40, 25, Lighting.DAY))
    runs[bad] = Measurement(0.0, invalid="no conflict without braking: the ego touches no road user")
    assessment = PROTOCOL.assess(runs)
    assert points(assessment, "CPNA day", "standard") == pytest.approx(0.5 * 17 / 18)
    shown = assessment.block("CPNA day").scores[bad]
    assert (shown.mark.letter, shown.text) == ("×", "")
    assert "1 cell is invalid and scores nothing (reasons: cells.csv)" in assessment.notes
    assert all(gate.passed is not False for gate in assessment.gates)  # 40 km/h is no requirement


def test_what_an_invalid_test_requires_is_not_shown() -> None:
    nothing = Measurement(0.0, invalid="no conflict without braking: the ego touches no road user")
    runs = avoided("CPNA", "CCRs")
    ten = Cell("CPNA", 10.0, 75.0, 5.0)
    rear = Cell("CCRs", 20.0, 100.0, 0.0)
    assert ten in runs
    assert rear in runs
    for cell, number in ((ten, 0), (rear, 4)):
        assessment = PROTOCOL.assess({**runs, cell: nothing})
        gate = assessment.gates[number]
        assert gate.passed is False
        assert gate.name.endswith("(not shown: a test is invalid)")
        assert assessment.total("Frontal Collisions").won == 0.0


def test_a_false_activation_fails_the_test_whatever_came_out() -> None:
    """Also of a warning, which then comes early enough for its limit."""
    early = Measurement(0.0, warning_ttc_s=9.0, speed_reduction_kmh=60.0, false_activation=True)
    runs = dict.fromkeys([*PROTOCOL.cells("CPNA"), *PROTOCOL.cells("CPLA"), *PROTOCOL.cells("CCFhos")], early)
    assessment = PROTOCOL.assess(runs)
    assert all(total.won == 0.0 and not total.before_gate for total in assessment.totals)
    assert {assessment.block(name).scores[c].mark.letter for name in ("CPNA day", "CPLA night", "CCFhos")
            for c in assessment.block(name).scores} == {"FA"}  # fmt: skip


def test_a_layer_with_an_invalid_run_wins_nothing() -> None:
    runs = avoided("CPNA")
    robust = {cell: Measurement(0.0) for cell in PROTOCOL.robustness_cells("CPNA")}
    faster = next(c for c in robust if "+3" in c.condition and c.speed_kmh == 10.0)
    invalid = Measurement(0.0, invalid="no conflict without braking")
    won = points(PROTOCOL.assess({**runs, **robust, faster: invalid}), "CPNA day", "robustness")
    assert won == pytest.approx(0.125 * 2 / 10)  # the two other layers
    base = next(c for c in runs if (c.speed_kmh, c.impact_percent, c.lighting) == (40, 25, Lighting.DAY))
    assessment = PROTOCOL.assess({**runs, **robust, base: invalid})
    assert points(assessment, "CPNA day", "robustness") == 0.0  # nothing to compare its conditions with
    assert assessment.block("CPNA day, robustness").cells_run == 18 * 5


def test_gates_that_nothing_tests_take_nothing() -> None:
    assessment = PROTOCOL.assess(avoided("CPFA"))
    assert {gate.passed for gate in assessment.gates} == {None}
    assert assessment.total("CPFA").won == pytest.approx(1.125)


def test_robustness_counts_layers_that_hold() -> None:
    runs = avoided("CPNA")
    robust = {cell: Measurement(0.0) for cell in PROTOCOL.robustness_cells("CPNA")}
    assert len(robust) == 18 * 5  # by day; speed +3 and -2, position, heading -10 and +20
    won = points(PROTOCOL.assess({**runs, **robust}), "CPNA day", "robustness")
    assert won == pytest.approx(0.125 * 3 / 10)  # 3 of the 10 layers that apply
    broken = next(c for c in robust if "+3" in c.condition and c.speed_kmh == 10.0)
    won = points(PROTOCOL.assess({**runs, **robust, broken: Measurement(9.0)}), "CPNA day", "robustness")
    assert won == pytest.approx(0.125 * 2 / 10)
    part = {cell: found for cell, found in robust.items() if cell is not broken}  # one cell was not run
    assert points(PROTOCOL.assess({**runs, **part}), "CPNA day", "robustness") == pytest.approx(
        0.125 * 2 / 10
    )


def test_robustness_compares_with_the_cell_itself() -> None:
    base = next(c for c in PROTOCOL.cells("CPNA") if (c.speed_kmh, c.impact_percent) == (60, 25))
    runs = {**avoided("CPNA"), base: Measurement(12.0)}
    slower = next(
        c
        for c in PROTOCOL.robustness_cells("CPNA")
        if "-2" in c.condition and (c.speed_kmh, c.impact_percent, c.lighting) == (60, 25, base.lighting)
    )
    speeds = {
        c: Measurement(0.0) for c in PROTOCOL.robustness_cells("CPNA") if c.condition.startswith("Speed")
    }
    for impact, holds in ((0.0, 1), (19.9, 1), (21.9, 1), (22.0, 0)):  # orange, and 2 km/h of tolerance
        assessment = PROTOCOL.assess({**runs, **speeds, slower: Measurement(impact)})
        assert points(assessment, "CPNA day", "robustness") == pytest.approx(0.125 * holds / 10), impact
        shown = assessment.block("CPNA day, robustness").scores[slower]
        assert shown.text == f"{impact:.1f}".replace("0.0", "0") + ("" if holds else "!")
    with pytest.raises(ProtocolError, match="run that too"):
        PROTOCOL.assess({slower: Measurement(0.0)})


def test_conditions_and_requirements_have_matrices_of_their_own() -> None:
    base = avoided("CPNA", "CPTA")
    names = [b.block.name for b in PROTOCOL.assess(base).blocks]
    assert not [name for name in names if "robustness" in name or "pedestrian of" in name]
    faster = {
        c: Measurement(4.0)
        for c in PROTOCOL.robustness_cells("CPNA")
        if c.condition == "Speed: target +3 km/h"
    }
    day, night = PROTOCOL.requirement_cells()
    assessment = PROTOCOL.assess({**base, **faster, day: Measurement(0.0), night: Measurement(20.0)})
    matrix = assessment.block("CPNA day, robustness")
    assert matrix.block.columns == ("10", "20", "30", "40", "50", "60")
    assert [row.label for row in matrix.block.rows[:3]] == [f"target +3 km/h, {p}" for p in (75, 50, 25)]
    assert len(matrix.block.rows) == 5 * 3
    assert matrix.cells_run == 18
    marks = [matrix.scores[cell].mark.letter for cell in matrix.block.rows[0].cells if cell]
    texts = [matrix.scores[cell].text for cell in matrix.block.rows[0].cells if cell]
    assert "".join(marks) == "RRBOYY"  # bands of section 5.2 at 4 km/h
    assert texts == ["4.0!", "4.0!", "4.0", "4.0", "4.0", "4.0"]  # red is not enough
    assert any("! marks a cell" in note for note in assessment.notes)
    assert not any("! marks a cell" in note for note in PROTOCOL.assess(base).notes)
    required = assessment.block("CPNA-75, pedestrian 3 km/h")
    assert [required.scores[cell].mark.letter for cell in (day, night)] == ["P", "F"]
    (turning,) = [b for b in PROTOCOL.blocks if b.name == "CPTAfs & CPTAns"]
    nearside = next(c for c in PROTOCOL.robustness_cells("CPTA") if c.scenario == "CPTAns")
    rows = (
        PROTOCOL.assess({**base, nearside: Measurement(0.0)}).block(f"{turning.name}, robustness").block.rows
    )
    assert [sum(c is not None for c in row.cells) for row in rows] == [
        4,
        4,
        4,
    ]  # 10, 15, 20 farside, 10 nearside


def test_robustness_shows_only_the_speeds_of_standard_cells() -> None:
    """CCRb is standard up to 80 km/h, its matrix goes on to 130 km/h."""
    runs = avoided("CCRb")
    harder = next(cell for cell in PROTOCOL.robustness_cells("CCRb"))
    block = PROTOCOL.assess({**runs, harder: Measurement(0.0)}).block("CCRb, robustness").block
    assert block.columns == ("30", "40", "50", "60", "70", "80")
    assert all(len(row.cells) == 6 and None not in row.cells for row in block.rows)


def test_untested_requirements_are_named() -> None:
    (line,) = [n for n in PROTOCOL.assess(avoided("CPNA")).notes if n.startswith("required, but")]
    assert "pedestrian of 3 km/h by night" in line
    assert "CCRs" in line
    assert "CPNA-75 at 10 km/h" not in line


def test_robustness_needs_half_of_the_standard_points() -> None:
    robust = {
        c: Measurement(0.0) for c in PROTOCOL.robustness_cells("CPFA") if "speed" in c.condition.lower()
    }
    for impact, wins in ((0.0, True), (60.0, False)):
        runs = {c: Measurement(min(impact, c.speed_kmh)) for c in PROTOCOL.cells("CPFA")}
        won = points(PROTOCOL.assess({**runs, **robust}), "CPFA day", "robustness")
        assert (won > 0.0) is wins


def test_a_layer_that_fails_twice_fails_for_the_collision_partner() -> None:
    runs = avoided("CPNA", "CPFA", "CPNCO", "CBNA")
    robust = {
        cell: Measurement(0.0)
        for name in ("CPNA", "CPFA", "CPNCO", "CBNA")
        for cell in PROTOCOL.robustness_cells(name)
        if cell.condition.startswith("Initial position")
    }
    for name in ("CPNA", "CPFA"):
        robust[next(c for c in robust if c.scenario == name and c.speed_kmh == 60)] = Measurement(50.0)
    assessment = PROTOCOL.assess({**runs, **robust})
    assert points(assessment, "CPNCO day", "robustness") == 0.0  # pedestrian too, though nothing failed there
    assert points(assessment, "CBNA", "robustness") == pytest.approx(0.125 / 10)  # cyclist


def test_verification_takes_a_share_of_the_predicted_points() -> None:
    runs = avoided("CPNA")
    checks = {"CPNA day": Verification(Source.SELF_CLAIMED, 3, 2, 2, 1)}
    assessment = PROTOCOL.assess(runs, checks)
    assert points(assessment, "CPNA day", "standard") == pytest.approx(0.5 * 0.67)
    assert points(assessment, "CPNA day", "extended") == 0.0
    assert points(assessment, "CPNA night", "standard") == pytest.approx(0.5)
    with pytest.raises(ProtocolError, match="no such matrix"):
        PROTOCOL.assess(runs, {"CPNA": checks["CPNA day"]})


def test_versions_differ_at_a_limit() -> None:
    runs = hit(avoided("CPNA"), 10.0, (60.0,), (25.0,))
    older = EuroNcap2026(Version.V1_1).assess(runs)
    assert points(older, "CPNA day", "standard") == pytest.approx(0.5 * (17 + 0.75) / 18)
    assert points(PROTOCOL.assess(runs), "CPNA day", "standard") == pytest.approx(0.5 * (17 + 0.5) / 18)


def test_warnings_decide_rows_declared_fcw() -> None:
    runs = avoided("CBLA")
    late = {
        cell: Measurement(0.0, warning_ttc_s=1.6) if cell.function is Function.FCW else measured
        for cell, measured in runs.items()
    }
    assert points(PROTOCOL.assess(late), "CBLA", "standard") == pytest.approx(2.0 * 5 / 9)


def test_rows_declared_aeb_must_avoid() -> None:
    protocol = EuroNcap2026(choice=Function.AEB)
    runs = {c: m for c, m in avoided("CPLA", protocol=protocol).items() if c.lighting is Lighting.DAY}
    standard = [cell for cell in runs if cell.layer is Layer.STANDARD]
    assert len(standard) == 10  # 6 at 50 %, and 50, 60, 70, 80 km/h at 25 %
    runs[Cell("CPLA", 80.0, 25.0, 5.0)] = Measurement(1.0)  # would be yellow on the scale of the AEB rows
    assert points(protocol.assess(runs), "CPLA day", "standard") == pytest.approx(0.9)
    runs[Cell("CPLA", 60.0, 25.0, 5.0)] = Measurement(1.0)
    assert points(protocol.assess(runs), "CPLA day", "standard") == pytest.approx(0.9 - 0.025)


def test_a_hundredth_of_a_kilometre_per_hour_is_the_finest_that_counts() -> None:
    runs = {cell: Measurement(0.004) for cell in PROTOCOL.cells("CPNA")}
    assert points(PROTOCOL.assess(runs), "CPNA day", "standard") == pytest.approx(0.5)


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_points_fall_with_impact_speed_and_never_exceed_the_maximum(data: st.DataObject) -> None:
    cells = [*PROTOCOL.cells("CPNA"), *PROTOCOL.cells("CBNAO")]
    worse: dict[Cell, Measurement] = {}
    better: dict[Cell, Measurement] = {}
    for cell in cells:
        share = data.draw(st.sampled_from([0.0, 0.05, 0.2, 0.5, 0.8, 1.0]))
        worse[cell] = Measurement(cell.speed_kmh * share)
        better[cell] = Measurement(cell.speed_kmh * share * 0.5)
    low, high = _before_gates(worse), _before_gates(better)
    for name, (won, most) in low.items():
        assert 0.0 <= won <= high[name][0] <= most + 1e-9


def _before_gates(runs: Mapping[Cell, Measurement]) -> dict[str, tuple[float, float]]:
    totals = PROTOCOL.assess(runs).totals
    return {t.name: (t.won if t.before_gate is None else t.before_gate, t.most) for t in totals}


def test_bad_input_is_named() -> None:
    with pytest.raises(ProtocolError, match=r"has no cell CPNA AEB at 15 km/h, 50 %, target 5 km/h, day"):
        PROTOCOL.assess({Cell("CPNA", 15.0, 50.0, 5.0): Measurement(0.0)})
    with pytest.raises(ProtocolError, match="no scenario 'CPXX'"):
        PROTOCOL.cells("CPXX")
    with pytest.raises(ProtocolError, match="speed reduction"):
        PROTOCOL.assess({Cell("CCFhos", 30.0, 50.0, 50.0): Measurement(5.0)})
    with pytest.raises(ProtocolError, match="impact speed"):
        Measurement(-1.0)
    with pytest.raises(ProtocolError, match="impact speed"):
        Measurement(float("nan"))
    with pytest.raises(ProtocolError, match="warning time to collision"):
        Measurement(0.0, warning_ttc_s=float("inf"))
    with pytest.raises(ProtocolError, match="no total 'x'"):
        PROTOCOL.assess({}).total("x")
    with pytest.raises(ProtocolError, match="no matrix 'CPNA'"):
        PROTOCOL.assess({}).block("CPNA")
