"""Scenes that ask for braking must have a conflict; those without one are in no rate."""

from dataclasses import replace

from evaluation.studies.compare.valid_scenes import told_invalid_scenes, valid_scenes
from scenarios.scenes.scenes import choose_scenes


def test_every_shipped_scene_that_asks_for_braking_has_a_conflict_with_its_target() -> None:
    scenes = choose_scenes((), full=True)
    kept, reasons = valid_scenes(scenes)
    assert reasons == {}
    assert kept == tuple(scenes)
    assert told_invalid_scenes(reasons, 79) == []


def test_a_scene_without_a_conflict_is_named_counted_and_left_out() -> None:
    """Somebody who keeps walking on the sidewalk, called a scene in which the ego must brake."""
    every = choose_scenes((), full=False)
    nothing = next(scene for scene in every if scene.must == "nothing")
    brake = next(scene for scene in every if scene.must == "brake")
    wrong = replace(nothing, must="brake")
    kept, reasons = valid_scenes([wrong, brake])
    assert kept == (brake,)
    assert told_invalid_scenes(reasons, 2) == [
        f"{wrong.name}: no conflict without braking: the ego touches no road user",
        "1 of 2 scenes that ask for braking is invalid, and in no rate",
    ]
    assert valid_scenes([nothing]) == ((nothing,), {})  # a test of no reaction needs no contact
