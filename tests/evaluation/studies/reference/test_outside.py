"""Parts made from data of others: what they take from a folder, and what towns say of an answer."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import Results
from evaluation.studies.answers.study import Sample
from evaluation.studies.reference.findings.answers import Kept, told_confirmation
from evaluation.studies.reference.outside import MAPS, TOWNS, TownsPart, without_data
from scenarios.drawn.draw import MAPS as SHIPPED
from scenarios.scenes.scenes import SceneRun

COUNT = 40
FILTERS = ("map, preset physical", "map, preset real")


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    assert without_data((), None) == ""
    assert "give --outside DIR, a folder with kitti" in without_data(("kitti",), None)
    assert without_data(("kitti", "more"), tmp_path) == f"{tmp_path} has no kitti"
    (tmp_path / "kitti").mkdir()
    assert without_data(("kitti",), tmp_path) == ""


def test_scenes_are_drawn_on_the_towns_alone(tmp_path: Path) -> None:
    maps = tmp_path / "outside" / MAPS
    maps.mkdir(parents=True)
    shipped = sorted(SHIPPED.glob("*.xodr"))[0]
    for town in TOWNS:
        shutil.copyfile(shipped, maps / f"{town}.xodr")
    alone = tmp_path / "alone"
    shutil.copytree(maps, alone)
    (maps / "another.xodr").write_text("no map")
    part = TownsPart(Sample(count=2), ("png",), presets=("physical",))
    with pytest.raises(ArgumentError, match="towns: made with maps of others; give --outside DIR"):
        part.some(1, tmp_path / "out")
    total, runs = part.with_outside(tmp_path / "outside").some(1, tmp_path / "out")
    same = Gain(replace(part.sample, maps=alone), ("png",), presets=("physical",))
    expected, others = same.some(1, tmp_path / "again")
    assert total == expected == 4 * len(part.arms)
    assert [run.key for run in runs.values()] == [run.key for run in others.values()]


def kept(physical: float, real: float) -> Kept[Gain]:
    """A map filter that avoids so much more than the planned path, which avoids half, in two presets."""
    question = Gain(Sample(count=COUNT), presets=("physical", "real"))
    more = {"physical": physical, "real": real}
    scenes = tuple(
        SceneRun(f"{must} {k}", "drawn", must, "", (), 0.0)  # type: ignore[arg-type]
        for must in ("brake", "nothing")
        for k in range(COUNT)
    )

    def decision(arm: Arm, scene: SceneRun) -> Decision:
        share = 0.5 + (more[arm.preset] if arm.name == "map" else 0.0)
        avoided = int(scene.scene.split()[1]) < share * COUNT
        collided = scene.must == "brake" and not avoided
        return Decision(collided, 20.0 * collided, False, False, None, None, 0.0, 0.0, "passed")

    runs = {arm: tuple(decision(arm, scene) for scene in scenes) for arm in question.arms}
    return Kept(question, Results(scenes, runs))


@pytest.mark.parametrize(
    ("here", "there", "text"),
    [
        ((0.4, -0.4), (0.3, -0.3), "confirmed for every filter and preset. Avoided less stopped:"),
        ((0.4, 0.0), (0.4, 0.4), "the same answer for 1 of 2 filters and presets, the opposite for none."),
        (
            (0.4, 0.4),
            (0.4, -0.4),
            "the same answer for 1 of 2 filters and presets, the opposite for map, preset real.",
        ),
    ],
)
def test_towns_confirm_an_answer_or_not(
    here: tuple[float, float], there: tuple[float, float], text: str
) -> None:
    sentence = told_confirmation(kept(*here), kept(*there))
    assert text in sentence
    assert sentence.startswith("**And in CARLA's towns?** 40 scenes of each kind: ")
    words_of = {0: "neither is decided", 1: "the filter gains", -1: "the filter loses"}
    for name, gain in zip(FILTERS, there, strict=True):
        words = words_of[(gain > 0) - (gain < 0)]
        assert f"{name}: {100 * gain:+.1f} [".replace("+0.0", "0.0") in sentence
        assert words in sentence
