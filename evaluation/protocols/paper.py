"""Scores of the SmartMOT paper (section IV, equations 1 to 4) and the results it published."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from evaluation.protocols.assessment import Assessment, Protocol, Total, invalid_notes, score_block
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Block, Cell, Measurement, labelled, matrix
from evaluation.protocols.marks import ALL_POINTS, NO_POINTS, SOME_POINTS, Mark

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

PUBLISHED_FLAG_S = {
    10.0: 0.45, 20.0: 0.50, 30.0: 0.80, 40.0: 1.00, 50.0: 1.20, 60.0: 1.35, 70.0: 1.50, 80.0: 0.90,
}  # fmt: skip
"""Time from the flag to T0 in s by test speed in km/h, strategy map: the crosses of figure 5b, read off."""


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


UNKNOWN = (
    "The paper gives no points above 60 km/h, and no impact location: the runs decide where it is hit.",
)


@dataclass(frozen=True, slots=True)
class PaperProtocol(Protocol):
    """The paper's points: CPNA at 10 to 60 km/h, and their mean over the weather.

    Args:
        weather: names of the weather conditions that were run.

    Raises:
        ProtocolError: there is no weather.
    """

    weather: tuple[str, ...] = ("dry",)

    title = "SmartMOT paper, equations 1 to 4"
    unknown = UNKNOWN

    def __post_init__(self) -> None:
        if not self.weather or len(set(self.weather)) < len(self.weather):
            raise ProtocolError(f"weather {self.weather!r}: give at least one name, each once")

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One matrix, speed x weather."""
        speeds, weathers = labelled(PAPER_SCORE_MAX), {name: name for name in self.weather}
        headers = ("VUT (km/h)", "weather")
        return (matrix("CPNA", headers, speeds, weathers, lambda v, name: Cell("CPNA", v, condition=name)),)

    def assess(self, results: Mapping[Cell, Measurement]) -> Assessment:
        """Points per weather, and their mean."""
        (block,) = self.blocks
        points = {cell: _points(cell, measured) for cell, measured in self.valid_results(results).items()}
        most = sum(PAPER_SCORE_MAX.values())
        totals = tuple(
            Total(name, sum(won for cell, won in points.items() if cell.condition == name), most)
            for name in self.weather
        )
        score = score_block(block, results, lambda cell, _: _mark(cell, points[cell]), totals)
        mean = Total("mean", sum(total.won for total in totals) / len(totals), most)
        missing = len(block.cells) - len(results)
        notes = (f"{missing} cells not run, counted as no points",) if missing else ()
        return Assessment(
            self.title, (score,), (*totals, mean), (), (*invalid_notes(results), *notes, *UNKNOWN)
        )


def _points(cell: Cell, measured: Measurement) -> float:
    if measured.impact_speed_kmh > cell.speed_kmh:
        raise ProtocolError(f"{cell}: impact at {measured.impact_speed_kmh:g} km/h is faster than the test")
    points = paper_score(cell.speed_kmh, measured.impact_speed_kmh)
    assert points is not None  # every row is a speed with points
    return 0.0 if measured.false_activation else points


def _mark(cell: Cell, points: float) -> Mark:
    most = PAPER_SCORE_MAX[cell.speed_kmh]
    return ALL_POINTS if points == most else SOME_POINTS if points > 0 else NO_POINTS
