"""Scores of the SmartMOT paper (section IV, equations 1 to 4) and the results it published."""

from __future__ import annotations

PAPER_SCORE_MAX = {10.0: 1.0, 20.0: 1.0, 30.0: 2.0, 40.0: 3.0, 50.0: 2.0, 60.0: 1.0}
"""Points to be won at each test speed in km/h (table I, column score_max); none at other speeds."""

PROPORTIONAL_UP_TO_KMH = 40.0
REQUIRED_REDUCTION_KMH = 20.0

PUBLISHED: dict[str, dict[float, tuple[float, float | None]]] = {
    # table I: test speed -> (impact speed km/h, score)
    "rectangular": {
        10.0: (0.0, 1.0),
        20.0: (0.0, 1.0),
        30.0: (0.0, 2.0),
        40.0: (0.0, 3.0),
        50.0: (23.82, 2.0),
        60.0: (44.23, 0.0),
    },
    "map": {
        10.0: (0.0, 1.0),
        20.0: (0.0, 1.0),
        30.0: (0.0, 2.0),
        40.0: (0.0, 3.0),
        50.0: (0.0, 2.0),
        60.0: (0.0, 1.0),
        # section V and figure 5b; beyond the table, without a score
        70.0: (0.0, None),
        80.0: (39.78, None),
    },
}
"""What the paper printed, by strategy. Shown beside results, never used in a computation."""


def paper_score_max(v_test_kmh: float) -> float | None:
    """Points to be won at a test speed; None where the paper gives none."""
    return PAPER_SCORE_MAX.get(v_test_kmh)


def paper_score(v_test_kmh: float, v_impact_kmh: float) -> float | None:
    """Points of one test.

    Up to 40 km/h the share of the speed that was taken off before contact (equations 1 and 2); above, all or
    nothing for taking off 20 km/h (equations 3 and 4).

    Args:
        v_test_kmh: test speed.
        v_impact_kmh: speed at contact; 0 without contact.

    Returns:
        Points; None where the paper gives none for the speed.
    """
    most = paper_score_max(v_test_kmh)
    if most is None:
        return None
    if v_test_kmh <= PROPORTIONAL_UP_TO_KMH:
        return (v_test_kmh - v_impact_kmh) / v_test_kmh * most
    return most if v_impact_kmh <= v_test_kmh - REQUIRED_REDUCTION_KMH else 0.0
