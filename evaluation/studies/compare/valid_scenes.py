"""Scenes in which the ego must brake, and would touch the target if it did not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evaluation.runs.conflict import conflicts, unbraked
from evaluation.runs.workers import Workers
from scenarios.scenes.scenes import SceneRun
from scenarios.spec import NO_AEB, RunSpec


def valid_scenes(
    scenes: Sequence[SceneRun], workers: Workers = 1
) -> tuple[tuple[SceneRun, ...], dict[str, str]]:
    """The scenes that test what they are about.

    A scene in which nothing should happen needs no conflict.

    Args:
        scenes: to be judged.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.

    Returns:
        The valid ones, and the reason by the name of each of the others.
    """
    specs = {
        scene.name: RunSpec(
            scenario=scene.name,
            file=scene.file,
            parameters=scene.parameters,
            strategy=NO_AEB,
            preset="physical",
            weather="dry",
            v_test_kmh=scene.speed_kmh,
        )
        for scene in scenes
        if scene.must == "brake"
    }
    known = conflicts(specs.values(), workers)
    missing = {name: known[unbraked(spec)].missing for name, spec in specs.items()}
    reasons = {name: reason for name, reason in missing.items() if reason}
    return tuple(scene for scene in scenes if scene.name not in reasons), reasons


def told_invalid_scenes(reasons: Mapping[str, str], must_brake: int) -> list[str]:
    """Each scene that is left out with its reason, and at last how many; nothing if none is.

    Args:
        reasons: by name, of `valid_scenes`.
        must_brake: how many scenes ask for braking, these included.
    """
    if not reasons:
        return []
    verb = "is" if len(reasons) == 1 else "are"
    count_line = f"{len(reasons)} of {must_brake} scenes that ask for braking {verb} invalid, and in no rate"
    return [*(f"{name}: {reason}" for name, reason in reasons.items()), count_line]
