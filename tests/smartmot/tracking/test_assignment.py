from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from smartmot.tracking import assignment
from smartmot.tracking.assignment import contested, solve
from smartmot.types import FloatArray


def _best_total(affinity: FloatArray) -> float:
    a = affinity if affinity.shape[0] <= affinity.shape[1] else affinity.T
    rows = range(len(a))
    return max(float(sum(a[i, p[i]] for i in rows)) for p in permutations(range(a.shape[1]), len(a)))


@pytest.mark.parametrize("shape", [(1, 1), (2, 5), (5, 2), (4, 4), (6, 5)])
@pytest.mark.parametrize("seed", range(5))
def test_small_assignments_are_optimal(shape: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    affinity = np.where(rng.random(shape) < 0.4, 0.0, rng.random(shape))
    i, j = np.indices(shape).reshape(2, -1)
    won = solve(i, j, affinity.ravel())
    assert affinity[i[won], j[won]].sum() == pytest.approx(_best_total(affinity))
    assert (affinity[i[won], j[won]] > 0.0).all()
    assert len(set(i[won])) == len(set(j[won])) == len(won)


@pytest.mark.parametrize("density", [0.003, 0.01, 0.03])
def test_components_give_the_total_of_the_whole_table(density: float) -> None:
    rng, shape = np.random.default_rng(1), (200, 180)
    affinity = np.where(rng.random(shape) < density, rng.random(shape), 0.0)
    i, j = affinity.nonzero()
    won = solve(i, j, affinity[i, j])
    best = affinity[linear_sum_assignment(affinity, maximize=True)].sum()
    assert affinity[i[won], j[won]].sum() == pytest.approx(best)
    assert len(set(i[won])) == len(set(j[won])) == len(won)


def test_order_of_the_pairs_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    affinity = np.where(rng.random((30, 30)) < 0.1, rng.random((30, 30)), 0.0)
    i, j = affinity.nonzero()
    order = rng.permutation(len(i))
    for cells in (assignment._TABLE_CELLS, 0):
        monkeypatch.setattr(assignment, "_TABLE_CELLS", cells)
        for method in ("hungarian", "greedy"):
            plain = solve(i, j, affinity[i, j], method)
            mixed = solve(i[order], j[order], affinity[i, j][order], method)
            assert set(order[mixed].tolist()) == set(plain.tolist())


def test_greedy_totals_at_least_half_of_the_best() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        affinity = rng.random((6, 6))
        i, j = np.indices((6, 6)).reshape(2, -1)
        won = solve(i, j, affinity.ravel(), "greedy")
        assert len(won) == 6
        assert affinity[i[won], j[won]].sum() >= 0.5 * _best_total(affinity)
        assert affinity[i[won], j[won]].max() == affinity.max()


def test_a_pair_is_contested_if_another_has_its_row_or_column() -> None:
    rng, seen = np.random.default_rng(4), set()
    for _ in range(200):
        pairs = np.unique(rng.integers(0, 9, (rng.integers(1, 5), 2)), axis=0)
        i, j = pairs[:, 0], pairs[:, 1]
        expected = [bool(((i == a).sum() > 1) | ((j == b).sum() > 1)) for a, b in pairs.tolist()]
        shared = contested(i, j)
        assert (shared is None) == (not any(expected))
        assert shared is None or shared.tolist() == expected
        seen.add(shared is None)
    assert seen == {True, False}


def test_nothing_to_match() -> None:
    none = np.zeros(0, dtype=np.int64)
    assert len(solve(none, none, np.zeros(0))) == 0
    assert len(solve(np.array([0, 1]), np.array([0, 0]), np.array([0.0, -1.0]))) == 0
