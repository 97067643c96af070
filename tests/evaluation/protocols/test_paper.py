"""Equations 1 to 4 and table I of the SmartMOT paper."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Cell, Measurement
from evaluation.protocols.paper import (
    PAPER_SCORE_MAX,
    PUBLISHED,
    PaperProtocol,
    paper_score,
    paper_score_max,
)

SPEEDS = tuple(PAPER_SCORE_MAX)


def test_points_to_be_won_are_those_of_table_one() -> None:
    assert [paper_score_max(v) for v in (10, 20, 30, 40, 50, 60)] == [1, 1, 2, 3, 2, 1]
    assert sum(PAPER_SCORE_MAX.values()) == 10


@pytest.mark.parametrize("v_test", SPEEDS)
def test_no_contact_wins_every_point(v_test: float) -> None:
    assert paper_score(v_test, 0.0) == PAPER_SCORE_MAX[v_test]


@pytest.mark.parametrize(
    ("v_test", "v_impact", "points"),
    [
        (10.0, 5.0, 0.5),
        (20.0, 15.0, 0.25),
        (30.0, 10.0, 4 / 3),
        (40.0, 20.0, 1.5),
        (40.0, 40.0, 0.0),
        (50.0, 30.0, 2.0),  # a reduction of exactly 20 km/h is enough
        (50.0, 30.01, 0.0),
        (50.0, 23.82, 2.0),
        (60.0, 40.0, 1.0),
        (60.0, 40.01, 0.0),
        (60.0, 44.23, 0.0),
    ],
)
def test_scores_computed_by_hand(v_test: float, v_impact: float, points: float) -> None:
    assert paper_score(v_test, v_impact) == pytest.approx(points)


@given(st.sampled_from(SPEEDS), st.floats(0, 1), st.floats(0, 1))
def test_a_faster_impact_never_wins_more(v_test: float, a: float, b: float) -> None:
    slow, fast = sorted((a * v_test, b * v_test))
    low, high = paper_score(v_test, fast), paper_score(v_test, slow)
    assert low is not None
    assert high is not None
    assert 0.0 <= low <= high <= PAPER_SCORE_MAX[v_test]


@pytest.mark.parametrize("v_test", [5.0, 25.0, 70.0, 80.0])
def test_no_points_at_other_speeds(v_test: float) -> None:
    assert paper_score_max(v_test) is None
    assert paper_score(v_test, 0.0) is None


@pytest.mark.parametrize(("strategy", "total"), [("rectangular", 9.0), ("map", 10.0)])
def test_published_impact_speeds_give_the_published_scores(strategy: str, total: float) -> None:
    printed = {v: PUBLISHED[strategy][v] for v in SPEEDS}
    for v_test, (v_impact, points) in printed.items():
        assert paper_score(v_test, v_impact) == points
    assert sum(points for _, points in printed.values() if points is not None) == total


def test_the_final_score_is_the_mean_over_the_weather() -> None:
    protocol = PaperProtocol(("dry", "rain"))
    runs = {cell: Measurement(0.0) for cell in protocol.cells()}
    runs[Cell("CPNA", 40.0, condition="rain")] = Measurement(20.0)  # 1.5 of 3
    runs[Cell("CPNA", 60.0, condition="rain")] = Measurement(41.0)  # 0 of 1
    assessment = protocol.assess(runs)
    assert [(t.name, t.won, t.most) for t in assessment.totals] == [
        ("dry", 10.0, 10.0),
        ("rain", 7.5, 10.0),
        ("mean", 8.75, 10.0),
    ]
    marks = {cell: score.mark.letter for cell, score in assessment.block("CPNA").scores.items()}
    assert marks[Cell("CPNA", 40.0, condition="rain")] == "P"
    assert marks[Cell("CPNA", 60.0, condition="rain")] == "N"
    assert marks[Cell("CPNA", 60.0, condition="dry")] == "A"


def test_published_speeds_through_the_protocol() -> None:
    for strategy, total in (("rectangular", 9.0), ("map", 10.0)):
        runs = {cell: Measurement(PUBLISHED[strategy][cell.speed_kmh][0]) for cell in PaperProtocol().cells()}
        assert PaperProtocol().assess(runs).total("mean").won == total


def test_bad_input_is_named() -> None:
    with pytest.raises(ProtocolError, match="weather"):
        PaperProtocol(())
    with pytest.raises(ProtocolError, match="has no cell CPNA AEB at 70 km/h"):
        PaperProtocol().assess({Cell("CPNA", 70.0, condition="dry"): Measurement(0.0)})
    with pytest.raises(ProtocolError, match="faster than the test"):
        PaperProtocol().assess({Cell("CPNA", 10.0, condition="dry"): Measurement(11.0)})


def test_invalid_runs_and_false_activations_have_no_points() -> None:
    protocol = PaperProtocol()
    runs = {cell: Measurement(0.0) for cell in protocol.cells()}
    invalid, early = Cell("CPNA", 40.0, condition="dry"), Cell("CPNA", 30.0, condition="dry")
    runs[invalid] = Measurement(0.0, invalid="no conflict without braking")
    runs[early] = Measurement(0.0, false_activation=True)
    assessment = protocol.assess(runs)
    assert assessment.total("mean").won == 10.0 - 3.0 - 2.0
    assert assessment.total("mean").most == 10.0
    scores = assessment.blocks[0].scores
    assert [scores[cell].mark.letter for cell in (invalid, early)] == ["×", "FA"]
