"""Verification of predicted colours by tests drawn at random (Euro NCAP 2026, sections 4.2 and 5.2).

A manufacturer predicts the colour of every cell; the laboratory drives a few. In a simulation every cell can
be run, so that the measured colours stand for themselves; verification is for predictions from elsewhere:
another strategy, another seed, a simulation against a track.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from evaluation.protocols.bands import NEWEST, WEIGHT, Colour, Version, impact_colour, within_tolerance
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.grid import EXTENDED_DRAWN, ScoredBlock
from evaluation.protocols.grid import Cell, Layer, layer_cells


class Source(StrEnum):
    """Where the predictions come from."""

    SELF_CLAIMED = "self claimed"
    VIRTUAL = "virtual testing"


class Outcome(StrEnum):
    """A measured cell against its prediction."""

    CORRECT = "correct"
    IN_TOLERANCE = "within tolerance"
    BETTER = "better than predicted"
    WORSE = "worse than predicted"


_STANDARD: dict[Source, dict[int, tuple[int, ...]]] = {
    # cells tested -> percent of the predicted points for 0, 1, 2 ... confirmed cells
    Source.VIRTUAL: {
        0: (100,),
        1: (0, 100),
        2: (0, 50, 100),
        3: (0, 33, 67, 100),
        4: (0, 25, 50, 75, 100),
        5: (0, 20, 40, 60, 80, 100),
    },
    Source.SELF_CLAIMED: {
        0: (100,),
        1: (0, 100),
        2: (0, 50, 100),
        3: (0, 0, 67, 100),
        4: (0, 0, 0, 75, 100),
        5: (0, 0, 0, 0, 80, 100),
    },
}
_EXTENDED: dict[Source, dict[int, tuple[int, ...]]] = {
    Source.VIRTUAL: {0: (100,), 1: (0, 100), 2: (0, 50, 100)},
    Source.SELF_CLAIMED: {0: (100,), 1: (0, 100), 2: (0, 0, 100)},
}


def share_kept(source: Source, layer: Layer, tested: int, confirmed: int) -> float:
    """Share of the predicted points that verification leaves.

    Args:
        source: where the predictions come from.
        layer: standard (0 to 5 cells) or extended (0 to 2).
        tested: cells driven.
        confirmed: of them, cells as predicted, within tolerance or better.

    Raises:
        ProtocolError: the protocol has no rule for these numbers.
    """
    tables = {Layer.STANDARD: _STANDARD, Layer.EXTENDED: _EXTENDED}
    shares = tables[layer][source].get(tested) if layer in tables else None
    if shares is None or not 0 <= confirmed <= tested:
        raise ProtocolError(
            f"verification with {confirmed} of {tested} {layer} cells: the protocol has shares for 0 to 5 "
            "standard and 0 to 2 extended cells"
        )
    return shares[confirmed] / 100.0


def verify_impact(
    speed_kmh: float, predicted: Colour, impact_kmh: float, version: Version = NEWEST
) -> tuple[Outcome, Colour]:
    """Compare an impact speed with the predicted colour.

    Args:
        speed_kmh: test speed of the VUT.
        predicted: colour claimed.
        impact_kmh: relative impact speed measured.
        version: edition of the protocol.

    Returns:
        The outcome, and the colour that is applied: within the tolerance of 2 km/h the predicted one, whether
        the measured one is better or worse.

    Raises:
        ProtocolError: the protocol has no bands for this speed, or not this colour.
    """
    tolerated = within_tolerance(speed_kmh, predicted, impact_kmh, version)
    measured = impact_colour(speed_kmh, impact_kmh, version)
    if measured is predicted:
        return Outcome.CORRECT, measured
    if tolerated:
        return Outcome.IN_TOLERANCE, predicted
    return verify_colour(predicted, measured), measured


def verify_colour(predicted: Colour, measured: Colour) -> Outcome:
    """Compare colours where no tolerance exists: avoidance, warning and speed-reduction tests."""
    if measured is predicted:
        return Outcome.CORRECT
    return Outcome.BETTER if WEIGHT[measured] > WEIGHT[predicted] else Outcome.WORSE


@dataclass(frozen=True, slots=True)
class Verification:
    """Result of verifying one matrix.

    Args:
        source: where the predictions came from.
        standard_tested, standard_confirmed: standard cells.
        extended_tested, extended_confirmed: extended cells.
    """

    source: Source
    standard_tested: int = 0
    standard_confirmed: int = 0
    extended_tested: int = 0
    extended_confirmed: int = 0

    def share(self, layer: Layer) -> float:
        """Share of the predicted points of a layer that is left; all for robustness, which has its own rule.

        Raises:
            ProtocolError: the protocol has no rule for these numbers.
        """
        if layer is Layer.STANDARD:
            return share_kept(self.source, layer, self.standard_tested, self.standard_confirmed)
        if layer is Layer.EXTENDED:
            return share_kept(self.source, layer, self.extended_tested, self.extended_confirmed)
        return 1.0


def draw_cells(block: ScoredBlock, predicted: Mapping[Cell, Colour], seed: int) -> tuple[Cell, ...]:
    """Draw the cells that a laboratory would drive: standard ones, then two extended ones; never red ones.

    Args:
        block: matrix to verify.
        predicted: colours claimed; cells without one are not drawn.
        seed: of the draw.
    """
    generator = random.Random(seed)
    drawn: list[Cell] = []
    for layer, count in ((Layer.STANDARD, block.drawn), (Layer.EXTENDED, EXTENDED_DRAWN)):
        pool = [
            cell
            for cell in layer_cells(block.block, layer)
            if predicted.get(cell, Colour.RED) is not Colour.RED and not corner_case(cell)
        ]
        drawn += generator.sample(pool, min(count, len(pool)))
    return tuple(drawn)


_CORNER_ABOVE_KMH = {"CCRb": 100, "CMRb": 80, "CCFtap": 60, "CMFtap": 60, "CCCscp": 60, "CMCscp": 60}


def corner_case(cell: Cell) -> bool:
    """Whether a laboratory never draws the cell, because the target is too fast (section 4.1.3).

    Of the head-on tests it drives only CCFhos at 30 km/h and 50 %.
    """
    if cell.scenario == "CCFhol":
        return True
    if cell.scenario == "CCFhos":
        return (cell.speed_kmh, cell.impact_percent) != (30.0, 50.0)
    limit = _CORNER_ABOVE_KMH.get(cell.scenario)
    return limit is not None and cell.target_speed_kmh is not None and cell.target_speed_kmh > limit
