"""Proofs by hand: an unbraked run of a file with one pedestrian on a straight street."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scenarios.drawn.actors import Actor, standing
from scenarios.drawn.files import scene_bytes
from scenarios.drawn.map_set import MAPS
from scenarios.drawn.proof import Proof, unbraked
from scenarios.drawn.situations.motions import crossing
from scenarios.drawn.stage import Ground, Stage, way_over


@pytest.fixture(scope="module")
def stage() -> Stage:
    """The ego drives eastwards at 10 m/s and y = -1.625, and would be at x = 300 after 5 s."""
    ground = Ground(MAPS / "straight_street.xodr")
    lane = ground.network.lane_index_of(("1", 0, -1))
    route, line = way_over(ground.network, [lane], 300.0, 50.0)
    return Stage(ground, route, line, 10.0, 5.0, "straight")


def proof_of(stage: Stage, actors: list[Actor], folder: Path) -> Proof:
    (folder / "maps").mkdir()
    shutil.copy(stage.ground.path, folder / "maps")
    file = folder / "scene.xosc"
    file.write_bytes(scene_bytes(stage, "maps/straight_street.xodr", "a test", actors))
    return unbraked(file)


def test_a_pedestrian_that_crosses_is_hit_when_its_near_face_is_reached(stage: Stage, tmp_path: Path) -> None:
    proof = proof_of(stage, [crossing(stage, "adult", -1, 50.0, 1.5, from_m=3.0)], tmp_path)
    assert (proof.entity, proof.with_front, proof.gap_m) == ("Target", True, 0.0)
    assert proof.contact_s == pytest.approx((50.0 - 2.2 - 0.25) / 10.0, abs=1e-3)
    assert proof.fault("brake") == ""
    assert proof.fault("nothing") == "unbraked the ego touches a road user"


def test_the_gap_to_who_stands_beside_is_that_of_the_outlines(stage: Stage, tmp_path: Path) -> None:
    pose = stage.pose(stage.line_m, -2.0)
    proof = proof_of(stage, [standing("Target", "adult", pose)], tmp_path)
    # half of 1.8 m and half of 0.5 m of the 2 m are covered
    assert proof.gap_m == pytest.approx(2.0 - 0.9 - 0.25, abs=1e-3)
    assert (proof.fault("nothing"), proof.entity) == ("", "")
    assert proof.fault("brake") == "unbraked the ego touches no road user"


def test_another_that_is_hit_first_voids_the_scene(stage: Stage, tmp_path: Path) -> None:
    target = standing("Target", "adult", stage.pose(stage.line_m, 0.0))
    proof = proof_of(
        stage, [target, standing("Other", "adult", stage.pose(stage.line_m - 5.0, 0.3))], tmp_path
    )
    assert proof.entity == "Other"
    assert proof.fault("brake") == "unbraked the ego touches another than the target first"


def test_the_run_goes_on_after_the_first_has_been_passed(stage: Stage, tmp_path: Path) -> None:
    """Someone stands in the way 13 m beyond the line; the first is passed 20 m before it."""
    first = standing("Target", "adult", stage.pose(stage.line_m - 20.0, -3.0))
    proof = proof_of(stage, [first, standing("Other", "adult", stage.pose(stage.line_m + 13.0))], tmp_path)
    assert proof.entity == "Other"
    assert proof.fault("nothing") == "unbraked the ego touches a road user"
