"""Made-up runs: what a question answers follows from them alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import Results
from scenarios.scenes.scenes import SceneRun

Made = Callable[..., Results]


def scenes_of(count: int) -> tuple[SceneRun, ...]:
    """So many of each kind."""
    return tuple(
        SceneRun(f"{must} {k}", "drawn", must, "file.xosc", (), 50.0)  # type: ignore[arg-type]
        for must in ("brake", "nothing")
        for k in range(count)
    )


def decision(must: str, is_so: bool) -> Decision:
    """A run that avoids its collision, or stops unnecessarily."""
    if must == "brake":
        return Decision(
            not is_so,
            0.0 if is_so else 20.0,
            False,
            False,
            1.5,
            None,
            30.0,
            8.0,
            "stopped" if is_so else "contact",
        )
    return Decision(False, 0.0, is_so, is_so, None, None, 30.0 * is_so, 8.0 * is_so, "passed")


def made(arms: Sequence[Arm], count: int, rates: Callable[[Arm], tuple[float, float]]) -> Results:
    """Results in which each arm avoids and stops in the first scenes of each kind, as many as its rates say.

    Args:
        arms: who is run.
        count: scenes of each kind.
        rates: of an arm: collisions avoided and unnecessary stops.
    """
    scenes = scenes_of(count)
    runs = {}
    for arm in arms:
        numbers = dict(zip(("brake", "nothing"), (np.array(rates(arm)) * count).round(), strict=True))
        runs[arm] = tuple(decision(s.must, int(s.scene.split()[1]) < numbers[s.must]) for s in scenes)
    return Results(scenes, runs)


@pytest.fixture
def make() -> Made:
    """What makes results."""
    return made
