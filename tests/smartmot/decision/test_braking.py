import pytest

from smartmot.decision.braking import BrakingDistance, horizon_s
from smartmot.errors import ConfigError


@pytest.mark.parametrize(
    ("kmh", "metres"),
    [(40, 18.62), (50, 26.49), (60, 35.65), (70, 46.09), (80, 57.82), (90, 70.83), (100, 85.13)],
)
def test_published_table(kmh: float, metres: float) -> None:
    assert BrakingDistance().at(kmh / 3.6) == pytest.approx(metres, rel=1e-3)


def test_standing_and_reversing_need_next_to_nothing() -> None:
    assert BrakingDistance().at(0.0) == pytest.approx(0.04)
    assert BrakingDistance().at(-3.0) == pytest.approx(0.04)


def test_more_speed_needs_more_distance() -> None:
    distances = [BrakingDistance().at(0.5 * k) for k in range(100)]
    assert distances == sorted(distances)


def test_negative_coefficients_are_refused() -> None:
    with pytest.raises(ConfigError):
        BrakingDistance(per_kmh_m=-0.1)


def test_horizon() -> None:
    table = BrakingDistance()
    assert horizon_s(50 / 3.6, table, 3.0, 6.0) == 3.0  # 26.49 m / 13.89 m/s = 1.9 s
    assert horizon_s(100 / 3.6, table, 3.0, 6.0) == pytest.approx(85.13 / (100 / 3.6), abs=0.01)
    assert horizon_s(300 / 3.6, table, 3.0, 6.0) == 6.0  # 642 m / 83.3 m/s = 7.7 s
    assert horizon_s(0.0, table, 3.0, 6.0) == 3.0
    slow = BrakingDistance(0.0, 0.0, 2.0)  # 2 m at any speed
    assert horizon_s(0.5, slow, 3.0, 6.0) == pytest.approx(4.0)
    assert horizon_s(0.2, slow, 3.0, 6.0) == 6.0
