"""Limits of UN R152 against its tables."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Cell, Measurement
from evaluation.protocols.unece_r152 import R152, Load, Series, Target, limit_kmh, limits_kmh, verdict

# Regulation, original series: car to pedestrian; the June 2019 presentation of the draft prints the same row
ORIGINAL = {20: 0, 25: 0, 30: 0, 35: 20, 40: 25, 45: 30, 50: 35, 55: 40, 60: 45}
# 01 series, draft GRVA/2019/5
FIRST = {20: 0, 25: 0, 30: 0, 35: 0, 40: 0, 42: 10, 45: 15, 50: 25, 55: 30, 60: 35}
CAR = {40: 0, 42: 10, 45: 15, 50: 25, 55: 30, 60: 35}


@pytest.mark.parametrize(("series", "table"), [(Series.ORIGINAL, ORIGINAL), (Series.FIRST, FIRST)])
def test_pedestrian_limits(series: Series, table: dict[int, int]) -> None:
    for load in Load:
        assert dict(limits_kmh(Target.PEDESTRIAN, series, load)) == table


def test_the_two_steps_as_they_were_presented() -> None:
    """Step one: avoid below 35 km/h, then 15 km/h less. Step two: 32 less at 42, 30 at 45, 25 from 50."""
    for speed, limit in limits_kmh(Target.PEDESTRIAN, Series.ORIGINAL).items():
        assert limit == (0 if speed < 35 else speed - 15)
    for speed, limit in limits_kmh(Target.PEDESTRIAN, Series.FIRST).items():
        assert limit == (0 if speed < 42 else speed - {42: 32, 45: 30}.get(int(speed), 25))


def test_car_limits_are_those_of_both_series() -> None:
    for series in Series:
        laden = limits_kmh(Target.CAR, series, Load.LADEN)
        unladen = limits_kmh(Target.CAR, series, Load.UNLADEN)
        assert {v: laden[v] for v in CAR} == CAR
        assert {v: unladen[v] for v in CAR} == {**CAR, 42: 0}


def test_between_listed_speeds_only_equal_neighbours_decide() -> None:
    assert limit_kmh(Target.PEDESTRIAN, 22.0) == 0.0
    assert limit_kmh(Target.CAR, 33.0) == 0.0
    assert limit_kmh(Target.PEDESTRIAN, 53.0) is None
    assert limit_kmh(Target.PEDESTRIAN, 32.0, Series.ORIGINAL) is None
    assert limit_kmh(Target.PEDESTRIAN, 15.0) is None
    assert limit_kmh(Target.PEDESTRIAN, 61.0) is None
    assert verdict(Target.PEDESTRIAN, 61.0, 0.0) is None


@pytest.mark.parametrize(
    ("speed_kmh", "impact_kmh", "original", "first"),
    [
        (30.0, 0.0, True, True),
        (30.0, 0.01, False, False),
        (35.0, 20.0, True, False),
        (40.0, 25.01, False, False),
        (50.0, 25.0, True, True),
        (60.0, 35.01, True, False),
        (60.0, 45.0, True, False),
        (60.0, 45.01, False, False),
    ],
)
def test_verdicts(speed_kmh: float, impact_kmh: float, original: bool, first: bool) -> None:
    assert verdict(Target.PEDESTRIAN, speed_kmh, impact_kmh, Series.ORIGINAL) is original
    assert verdict(Target.PEDESTRIAN, speed_kmh, impact_kmh, Series.FIRST) is first


@given(
    st.sampled_from(list(Target)),
    st.sampled_from(list(Series)),
    st.sampled_from(list(Load)),
    st.sampled_from([20.0, 25.0, 40.0, 42.0, 45.0, 60.0]),
    st.floats(0, 60),
    st.floats(0, 60),
)
def test_a_slower_impact_never_fails_where_a_faster_one_passes(
    target: Target, series: Series, load: Load, speed_kmh: float, a: float, b: float
) -> None:
    slow, fast = sorted((a, b))
    if verdict(target, speed_kmh, fast, series, load):
        assert verdict(target, speed_kmh, slow, series, load)


def test_the_first_series_is_never_milder() -> None:
    for speed, limit in limits_kmh(Target.PEDESTRIAN, Series.FIRST).items():
        before = limit_kmh(Target.PEDESTRIAN, speed, Series.ORIGINAL)
        assert before is None or limit <= before


def test_assessment_counts_passed_tests() -> None:
    protocol = R152()
    runs = {
        Cell("CPNA", 60.0, 50.0, 5.0): Measurement(35.0),
        Cell("CPNA", 50.0, 50.0, 5.0): Measurement(25.5),
        Cell("CCRm", 62.0, 50.0, 20.0): Measurement(10.0),  # 42 km/h relative
        Cell("CCRs", 40.0, 50.0, 0.0): Measurement(0.0),
    }
    assessment = protocol.assess(runs)
    assert [(t.name, t.won, t.most) for t in assessment.totals] == [
        ("CPNA", 1, 2),
        ("CCRs", 1, 1),
        ("CCRm", 1, 1),
        ("together", 3, 4),
    ]
    letters = {c: s.mark.letter for b in assessment.blocks for c, s in b.scores.items() if c in runs}
    assert list(letters.values()) == ["F", "P", "P", "P"]
    unladen = R152(load=Load.UNLADEN).assess(runs)
    assert unladen.total("CCRm").won == 0


def test_bad_input_is_named() -> None:
    with pytest.raises(ProtocolError, match="positive"):
        limit_kmh(Target.CAR, -5.0)
    with pytest.raises(ProtocolError, match="positive"):
        limit_kmh(Target.CAR, float("nan"))
    with pytest.raises(ProtocolError, match="has no cell"):
        R152().assess({Cell("CPNA", 10.0, 50.0, 5.0): Measurement(0.0)})


def test_invalid_tests_are_neither_passed_nor_counted() -> None:
    walked = [Cell("CPNA", speed, 50.0, 5.0) for speed in (20.0, 25.0, 30.0)]
    assessment = R152().assess(
        {
            walked[0]: Measurement(0.0),
            walked[1]: Measurement(0.0, invalid="no conflict without braking"),
            walked[2]: Measurement(0.0, false_activation=True),
        }
    )
    (block, *_) = assessment.blocks
    assert [block.scores[cell].mark.letter for cell in walked] == ["P", "×", "FA"]
    assert (block.totals[0].won, block.totals[0].most) == (1, 2)
