"""Limits of UN Regulation No. 152 (AEBS of M1 vehicles): pass or fail per test speed.

Sources: original series (R152e.pdf, in force 2020) with Amendment 1 of 2020-11-04, pedestrian and car tables;
the pedestrian limits of the 01 series as drafted in GRVA/2019/5 (second step, from 2024), where the values
from 45 km/h on stood in brackets.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from evaluation.protocols.assessment import Assessment, Protocol, Total, invalid_notes, score_block, summed
from evaluation.protocols.bands import round_half_up
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.grid import Block, Cell, Measurement, labelled, matrix
from evaluation.protocols.marks import FAILED, PASSED, UNRATED


class Series(StrEnum):
    """Series of amendments."""

    ORIGINAL = "00"
    FIRST = "01"


class Load(StrEnum):
    """Mass of the car in the car-to-car test."""

    LADEN = "laden"
    UNLADEN = "unladen"


class Target(StrEnum):
    """What the car must not hit too fast."""

    PEDESTRIAN = "pedestrian"
    CAR = "car"


_PEDESTRIAN_KMH: dict[Series, dict[float, float]] = {
    Series.ORIGINAL: {20: 0, 25: 0, 30: 0, 35: 20, 40: 25, 45: 30, 50: 35, 55: 40, 60: 45},
    Series.FIRST: {20: 0, 25: 0, 30: 0, 35: 0, 40: 0, 42: 10, 45: 15, 50: 25, 55: 30, 60: 35},
}
_CAR_KMH: dict[Load, dict[float, float]] = {
    Load.LADEN: {10: 0, 20: 0, 30: 0, 40: 0, 42: 10, 45: 15, 50: 25, 55: 30, 60: 35},
    Load.UNLADEN: {10: 0, 20: 0, 30: 0, 40: 0, 42: 0, 45: 15, 50: 25, 55: 30, 60: 35},
}

_MARKS = {True: PASSED, False: FAILED, None: UNRATED}

UNKNOWN = (
    "Between two listed speeds with different limits no source at hand gives the rule: no verdict there.",
    "Pedestrian, series 01: limits from 45 km/h on are those of the draft GRVA/2019/5, in brackets there.",
    "The regulation's pedestrian is a child of six years, crossing at 5 km/h to the middle of the car; CPNA "
    "at 50 % has an adult.",
    "Warning times, repetitions, N1 vehicles and bicycles (02 series) are not assessed.",
)


def limits_kmh(
    target: Target, series: Series = Series.FIRST, load: Load = Load.LADEN
) -> Mapping[float, float]:
    """Fastest impact allowed, by test speed, both in km/h; for cars the relative speeds.

    The car limits are the same in both series; the pedestrian limits are for both loads.
    """
    return _PEDESTRIAN_KMH[series] if target is Target.PEDESTRIAN else _CAR_KMH[load]


def limit_kmh(
    target: Target, speed_kmh: float, series: Series = Series.FIRST, load: Load = Load.LADEN
) -> float | None:
    """Fastest impact allowed at a test speed.

    Returns:
        The limit in km/h; between two listed speeds theirs if both have the same, else None; None outside the
        listed speeds, where the regulation requires nothing.

    Raises:
        ProtocolError: the speed is not positive.
    """
    if not speed_kmh > 0:
        raise ProtocolError(f"R152: test speed {speed_kmh!r} km/h; give a positive number")
    table = limits_kmh(target, series, load)
    if speed_kmh in table:
        return table[speed_kmh]
    for low, high in pairwise(table):
        if low < speed_kmh < high:
            return table[low] if table[low] == table[high] else None
    return None


def verdict(
    target: Target,
    speed_kmh: float,
    impact_kmh: float,
    series: Series = Series.FIRST,
    load: Load = Load.LADEN,
) -> bool | None:
    """Whether a run passes: contact not faster than the limit; None where there is no limit.

    Raises:
        ProtocolError: the speed is not positive.
    """
    limit = limit_kmh(target, speed_kmh, series, load)
    return None if limit is None else round_half_up(impact_kmh) <= limit


@dataclass(frozen=True, slots=True)
class R152(Protocol):
    """The regulation's limits over the harness's scenarios.

    Args:
        series: of amendments.
        load: mass of the car in the car tests.
    """

    series: Series = Series.FIRST
    load: Load = Load.LADEN

    unknown = UNKNOWN

    @property
    def title(self) -> str:
        """Name, series and load."""
        return f"UN R152, {self.series} series, {self.load}"

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Pedestrian crossing to the middle of the car, and a standing and a moving car straight ahead."""
        walk = limits_kmh(Target.PEDESTRIAN, self.series, self.load)
        car = limits_kmh(Target.CAR, self.series, self.load)
        return (
            _block("CPNA", walk, 5.0),
            _block("CCRs", car, 0.0),
            _block("CCRm", (speed + 20.0 for speed in car), 20.0),
        )

    def verdict(self, cell: Cell, measured: Measurement) -> bool | None:
        """Whether a valid run of a cell passes; None where there is no limit."""
        walks = cell.scenario.startswith("CP")
        target = Target.PEDESTRIAN if walks else Target.CAR
        if measured.false_activation:
            return False
        speed = cell.speed_kmh - (0.0 if walks else cell.target_speed_kmh or 0.0)
        return verdict(target, speed, measured.impact_speed_kmh, self.series, self.load)

    def assess(self, results: Mapping[Cell, Measurement]) -> Assessment:
        """Pass or fail of every run; the totals count passed tests, of those that are valid."""
        valid, scored = self.valid_results(results), []
        for block in self.blocks:
            verdicts = [self.verdict(cell, valid[cell]) for cell in block.cells if cell in valid]
            total = Total(block.name, sum(map(bool, verdicts)), len(verdicts), "tests passed")
            scored.append(score_block(block, results, lambda c, run: _MARKS[self.verdict(c, run)], (total,)))
        totals = [total for score in scored for total in score.totals]
        together = summed([("together", total.won, total.most) for total in totals], "tests passed")
        notes = (*invalid_notes(results), *UNKNOWN)
        return Assessment(self.title, tuple(scored), (*totals, *together), (), notes)


def _block(scenario: str, speeds: Iterable[float], target_kmh: float) -> Block:
    """All of them meet the target with the middle of the car."""
    headers = ("VUT (km/h)", "impact location (%)")
    return matrix(
        scenario,
        headers,
        labelled(speeds),
        labelled((50.0,)),
        lambda v, p: Cell(scenario, float(v), p, target_kmh),
    )
