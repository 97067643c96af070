from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SHARED_MAPS = ROOT.parent / "shared" / "opendrive" / "maps"
PEERS = os.environ.get("SMARTMOT_EXPORT_PEERS")
"""Folder of one environment for each peer, as `.ci/exports` makes them."""

OWN_MAPS = [
    ROOT / "scenarios" / "maps" / "urban_intersection.xodr",
    *(
        ROOT / "scenarios" / "drawn" / "maps" / f"{name}.xodr"
        for name in ("left_hand_crossing", "one_way_street", "roundabout", "winding_street")
    ),
    *(
        ROOT / "tests" / "data" / "field" / "opendrive" / f"{name}.xodr"
        for name in ("opening_lane_polygon", "bridge_two_levels", "contradicting_lane_links")
    ),
]


def every_map() -> list[Path]:
    """Maps of the project; where the peers are, also the reference maps."""
    return [*OWN_MAPS, *(sorted(SHARED_MAPS.glob("*.xodr")) if PEERS else [])]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests that ask for `map_file` on every map."""
    if "map_file" in metafunc.fixturenames:
        # Without peers one line that says so is enough.
        maps = every_map() if PEERS or "peer" not in metafunc.fixturenames else OWN_MAPS[:1]
        metafunc.parametrize("map_file", maps, ids=lambda path: path.stem)


@pytest.fixture
def peer(request: pytest.FixtureRequest) -> Path:
    """Python of a peer's environment."""
    if PEERS is None:
        pytest.skip("the environments of the peers are not here: .ci/exports makes them")
    return Path(PEERS) / request.param / "bin" / "python"
