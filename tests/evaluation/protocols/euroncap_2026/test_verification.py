"""Drawn cells, and predictions that a test confirms or not."""

from __future__ import annotations

import pytest

from evaluation.protocols.bands import Colour
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.grid import blocks
from evaluation.protocols.euroncap_2026.verification import (
    Outcome,
    Source,
    corner_case,
    draw_cells,
    share_kept,
    verify_colour,
    verify_impact,
)
from evaluation.protocols.grid import Layer

BLOCKS = {scored.block.name: scored for scored in blocks()}


def test_three_standard_and_two_extended_cells_are_drawn_never_red() -> None:
    scored = BLOCKS["CPNA day"]
    predicted = {c: Colour.RED if c.speed_kmh > 30 else Colour.GREEN for c in scored.block.cells}
    for seed in range(20):
        drawn = draw_cells(scored, predicted, seed)
        assert [c.layer for c in drawn].count(Layer.STANDARD) == 3
        assert [c.layer for c in drawn].count(Layer.EXTENDED) == 2
        assert len(set(drawn)) == 5
        assert all(c.speed_kmh <= 30 for c in drawn)
    assert draw_cells(scored, predicted, 7) == draw_cells(scored, predicted, 7)
    assert len({draw_cells(scored, predicted, seed) for seed in range(20)}) > 10
    assert draw_cells(scored, {}, 0) == ()


def test_cells_with_a_fast_target_are_never_drawn() -> None:
    for name in ("CCRb", "CCFtap", "CCCscp"):
        predicted = dict.fromkeys(BLOCKS[name].block.cells, Colour.GREEN)
        assert not any(
            corner_case(c) for seed in range(20) for c in draw_cells(BLOCKS[name], predicted, seed)
        )
        assert any(corner_case(c) for c in predicted)
    head_on = dict.fromkeys(BLOCKS["CCFhos"].block.cells, Colour.GREEN)
    (only,) = draw_cells(BLOCKS["CCFhos"], head_on, 0)
    assert (only.speed_kmh, only.impact_percent) == (30.0, 50.0)
    assert draw_cells(BLOCKS["CCFhol"], dict.fromkeys(BLOCKS["CCFhol"].block.cells, Colour.GREEN), 0) == ()


def test_outcomes() -> None:
    assert verify_impact(60.0, Colour.YELLOW, 5.0) == (Outcome.CORRECT, Colour.YELLOW)
    assert verify_impact(60.0, Colour.YELLOW, 11.0) == (Outcome.IN_TOLERANCE, Colour.YELLOW)
    assert verify_impact(60.0, Colour.ORANGE, 9.0) == (Outcome.IN_TOLERANCE, Colour.ORANGE)
    assert verify_impact(60.0, Colour.ORANGE, 0.0) == (Outcome.BETTER, Colour.GREEN)
    assert verify_impact(60.0, Colour.GREEN, 2.0) == (Outcome.WORSE, Colour.YELLOW)
    assert verify_colour(Colour.RED, Colour.GREEN) is Outcome.BETTER
    assert verify_colour(Colour.GREEN, Colour.RED) is Outcome.WORSE


def test_shares_of_three_cells() -> None:
    assert [share_kept(Source.SELF_CLAIMED, Layer.STANDARD, 3, n) for n in range(4)] == [0, 0, 0.67, 1]
    assert [share_kept(Source.VIRTUAL, Layer.STANDARD, 3, n) for n in range(4)] == [0, 0.33, 0.67, 1]


@pytest.mark.parametrize(
    ("layer", "tested", "confirmed"),
    [
        (Layer.STANDARD, 6, 6),
        (Layer.EXTENDED, 3, 3),
        (Layer.STANDARD, 3, 4),
        (Layer.STANDARD, 3, -1),
        (Layer.ROBUSTNESS, 1, 1),
    ],
)
def test_numbers_without_a_rule_are_refused(layer: Layer, tested: int, confirmed: int) -> None:
    with pytest.raises(ProtocolError, match="the protocol has shares for"):
        share_kept(Source.VIRTUAL, layer, tested, confirmed)
