"""Drawn scenes: the same bytes again, each proved, and values that follow their laws."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from opendrive.building.reference_line import Piece
from opendrive.xml.writer import map_bytes
from scenarios.drawn.draw import drawn_scenes
from scenarios.drawn.map_set import MAPS, STREET, street
from scenarios.drawn.proof import unbraked
from scenarios.drawn.situations.must_not import cyclist_beside
from scenarios.drawn.stage import Ground, Stage, way_over
from scenarios.drawn.values import Draw, RejectedDraw, data
from scenarios.errors import ScenarioError
from scenarios.scenes.scenes import SceneRun, all_scenes

COUNT = 20


@pytest.fixture(scope="module", params=["train", "test"])
def drawn(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path, tuple[SceneRun, ...]]:
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, folder, drawn_scenes(request.param, COUNT, 7, folder)


def manifest(folder: Path) -> list[dict[str, str]]:
    with (folder / "manifest.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_as_many_of_each_kind_as_are_asked_for(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    _, folder, scenes = drawn
    assert [scene.must for scene in scenes] == ["brake"] * COUNT + ["nothing"] * COUNT
    assert len({scene.scene for scene in scenes}) == len({scene.file for scene in scenes}) == 2 * COUNT
    assert [row["scene"] for row in manifest(folder)] == [scene.scene for scene in scenes]


def test_each_is_proved(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    for scene in drawn[2]:
        proof = unbraked(Path(scene.file))
        if scene.must == "brake":
            assert (proof.entity, proof.with_front) == ("Target", True), scene.name
        else:
            assert proof.entity == "", scene.name
            assert proof.gap_m >= 0.3, scene.name


def test_maps_are_those_of_the_split(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    split, folder, _ = drawn
    assert {row["map"] for row in manifest(folder)} <= set(data()["maps"][split])


def test_the_contact_comes_within_the_lead(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    """The front is before the middle, and a target that comes askew is touched at most a little earlier."""
    for row in manifest(drawn[1]):
        if row["must"] == "brake":
            assert 2.0 < float(row["contact_s"]) <= float(row["lead_s"]), row["scene"]


def test_what_can_be_avoided_at_best_is_known(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    for row in manifest(drawn[1]):
        if row["must"] == "brake":
            assert row["avoidable"] in ("yes", "no")
            assert 0.0 <= float(row["notice_s"]) <= float(row["contact_s"]), row["scene"]
        else:
            assert row["notice_s"] == row["avoidable"] == "", row["scene"]


def test_no_scene_is_one_of_the_comparison(drawn: tuple[str, Path, tuple[SceneRun, ...]]) -> None:
    kept = {Path(scene.file).resolve() for scene in all_scenes()}
    assert not kept & {Path(scene.file) for scene in drawn[2]}


def test_the_same_bytes_again(drawn: tuple[str, Path, tuple[SceneRun, ...]], tmp_path: Path) -> None:
    split, folder, _ = drawn
    drawn_scenes(split, 3, 7, tmp_path)
    files = sorted(tmp_path.glob("*.xosc"))
    assert len(files) == 6
    assert [file.name for file in files if file.read_bytes() != (folder / file.name).read_bytes()] == []


def test_another_seed_draws_others(drawn: tuple[str, Path, tuple[SceneRun, ...]], tmp_path: Path) -> None:
    split, _, scenes = drawn
    others = drawn_scenes(split, 2, 8, tmp_path)
    assert not {scene.variant for scene in others} & {scene.variant for scene in scenes}


def test_unknown_splits_and_empty_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="expected one of train, test"):
        drawn_scenes("dev", 1, 0, tmp_path)
    with pytest.raises(ScenarioError, match="no OpenDRIVE file"):
        drawn_scenes("test", 1, 0, tmp_path, tmp_path)


def test_all_maps_that_cannot_be_read_are_named_at_once(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.xodr").write_text("<OpenDRIVE>")
    with pytest.raises(ScenarioError, match=r"(?s)2 of 2 maps cannot be read: .*a\.xodr.*; .*b\.xodr"):
        drawn_scenes("test", 1, 0, tmp_path, tmp_path)


def test_a_map_too_small_for_any_scene_says_why(tmp_path: Path) -> None:
    """At 10 km/h and 3.5 s the ego needs 10 m before the line, and 12 m of its lane behind it."""
    short = street("short", STREET, [Piece(20.0)])
    (tmp_path / "short.xodr").write_bytes(map_bytes(short))
    with pytest.raises(
        ScenarioError, match=r"placed on short; most often: the ego's lane (begins|ends) too near"
    ):
        drawn_scenes("test", 1, 0, tmp_path / "out", tmp_path)


@pytest.mark.parametrize("kmh", [14.0, 40.0])
def test_cyclists_in_the_lane_are_overtaken_at_10_kmh_more_or_not_at_all(kmh: float) -> None:
    """The slowest cyclist rides at 9 km/h."""
    ground = Ground(MAPS / "country_bends.xodr")
    lane = ground.network.lane_index_of(("1", 0, -1))
    route, line = way_over(ground.network, [lane], 150.0, kmh / 3.6 * 5.0)
    stage = Stage(ground, route, line, kmh / 3.6, 5.0, "any")
    speeds = []
    for seed in range(40):
        try:
            speeds.append(cyclist_beside(stage, Draw(np.random.default_rng(seed)))[1][0].motion.speed_mps)
        except RejectedDraw:
            continue
    assert all(kmh / 3.6 - speed >= 10.0 / 3.6 for speed in speeds)
    assert bool(speeds) == (kmh > 19.0)
