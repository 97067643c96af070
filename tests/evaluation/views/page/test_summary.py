"""Rates count the runs in which their outcome can come; what decides nothing stands apart."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from evaluation.views.account.explain import KINDS, Account
from evaluation.views.page.summary import MARKS, score_matrix, verdicts


def account(kind: str, must: str = "", *, false: bool | None = None, unnecessary: bool = False) -> Account:
    return Account(
        outcome=kind, kind=kind, must=must, finding=f"{kind}.", why="", false_activation=false,
        unnecessary=unnecessary, frame=0, story=(), status=(),
    )  # fmt: skip


def headline(run_row: Any, *accounts: Account) -> str:
    names = [f"log{k}" for k in range(len(accounts))]
    runs = pd.DataFrame([run_row(log=name, scenario=f"scene {name}") for name in names])
    [verdict] = verdicts(runs, dict(zip(names, accounts, strict=True)), {name: name for name in names})
    assert verdict.kind == min((a.kind for a in accounts), key=KINDS.index)
    return verdict.headline


def test_collisions_are_of_must_brake_scenes_and_false_activations_of_nothing_scenes(run_row: Any) -> None:
    """Ten must-brake runs and three others: not a rate over thirteen."""
    told = headline(
        run_row,
        *[account("hit", "brake", false=False)] * 2,
        account("mitigated", "brake"),
        *[account("stop", "brake")] * 7,
        account("false", "nothing", false=True, unnecessary=True),
        account("unnecessary", "nothing", false=False, unnecessary=True),
        account("pass", "nothing", false=False),
    )
    assert told == (
        "Collision in 3 of 10 runs in must-brake scenes, 1 of them mitigated; "
        "false activation in 1 of 3 runs in nothing scenes; "
        "unnecessary braking in 2 of 3 runs in nothing scenes, 1 of them by speed adaptation alone."
    )


def test_runs_that_decide_nothing_are_in_no_rate(run_row: Any) -> None:
    told = headline(
        run_row,
        *[account("cut", "brake")] * 2,
        account("invalid", "brake"),
        account("stop", "brake"),
        account("cut", "nothing", false=False),
        account("pass", "nothing", false=False),
    )
    assert told == (
        "No collision in 1 run in must-brake scenes; no false activation in 1 run in nothing scenes; "
        "no unnecessary braking in 1 run in nothing scenes; 3 runs cut off by the time limit, in no rate; "
        "1 run without conflict, in no rate."
    )


def test_false_activations_of_must_brake_scenes_are_of_those_in_which_the_target_sets_off(
    run_row: Any,
) -> None:
    told = headline(
        run_row,
        account("false", "brake", false=True),
        account("stop", "brake", false=False),
        *[account("stop", "brake", false=None)] * 3,
    )
    assert told == (
        "No collision in 5 runs in must-brake scenes; false activation in 1 of 2 runs in must-brake scenes."
    )


def test_a_run_cut_off_has_no_score_and_a_colour_of_its_own(run_row: Any) -> None:
    runs = pd.DataFrame([run_row(log="one", score=2.0, score_max=2.0)])
    cells = {kind: score_matrix(runs, {"one": account(kind, "brake")}).lines[0][1][0] for kind in KINDS}
    assert all(cell is not None for cell in cells.values())
    for kind in ("cut", "invalid"):
        assert cells[kind].score == ""
        assert cells[kind].colour not in {
            cells[other].colour for other in KINDS if other not in (kind, "cut", "invalid")
        }
    assert cells["stop"].score == "2.00 of 2"
    assert cells["stop"].colour == "#a6cee3"
    assert cells["false"].colour not in ("#a6cee3", cells["cut"].colour)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_mark_of_its_own(kind: str) -> None:
    assert sum(mark == MARKS[kind] for mark in MARKS.values()) == 1


def test_no_braking_is_a_success_only_where_nothing_should_happen(run_row: Any) -> None:
    runs = pd.DataFrame([run_row(log="one")])
    colours = {
        must: score_matrix(runs, {"one": account("pass", must)}).lines[0][1][0].colour
        for must in ("nothing", "")
    }
    assert colours == {"nothing": "#a6cee3", "": "#e4e6e9"}
