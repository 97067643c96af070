"""What a drawn scene is about: a name, what must happen, where it can be, and who takes part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scenarios.drawn.actors import Actor
from scenarios.drawn.stage import Stage
from scenarios.drawn.values import Draw
from scenarios.scenes.scenes import Must

Cast = Callable[[Stage, Draw], tuple[Stage, list[Actor]]]
"""Makes those who take part, the target first, and the stage with the line at what it is about."""


@dataclass(frozen=True, slots=True)
class Situation:
    """One kind of scene.

    Args:
        name: in tables.
        must: what the ego must do.
        place: kind of place; see `scenarios.drawn.stage.choose_stage`.
        cast: who takes part.
    """

    name: str
    must: Must
    place: str
    cast: Cast
