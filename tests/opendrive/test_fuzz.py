import random
from collections import Counter

import pytest

from benchmarks.fuzz_opendrive import SHIPPED, damaged, outcome

PARTS = 4


@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize(("first_seed", "count", "with_queries"), [(0, 400, True), (10_000, 1600, False)])
def test_a_damaged_map_gives_finite_numbers_or_a_named_error(tmp_path, first_seed, count, with_queries, part):
    sources = [file.read_bytes() for file in SHIPPED]
    file = tmp_path / "damaged.xodr"
    outcomes: Counter[str] = Counter()
    for seed in range(first_seed + part, first_seed + count, PARTS):
        # Whole turns through the maps, whatever the part.
        file.write_bytes(damaged(sources[seed // PARTS % len(sources)], random.Random(seed)))
        outcomes[outcome(file, seed, with_queries)] += 1
    assert outcomes["loaded"] > count // PARTS // 5
    assert outcomes["MapContentError"] > count // PARTS // 10
    assert outcomes["MapReadError"] > count // PARTS // 20
