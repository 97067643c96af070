"""What comes to pass in a scene without brakes, on the engine that runs it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.drawn.timeline import CLEAR_M
from scenarios.scenes.scenes import Must
from scenarios.simulation.ends import THROUGH
from scenarios.spec import NO_AEB, RunSpec, simulation_of
from smartmot.geometry import signed_gap, signed_gap_scalar

TOUCH_M = 1e-3
"""Outlines that are nearer touch."""
_EVERY = 2


@dataclass(frozen=True, slots=True)
class Proof:
    """An unbraked run.

    Args:
        entity: whom the ego touches first; empty: nobody.
        contact_s: when.
        with_front: whether with its front.
        gap_m: least distance to anybody; 0 after a contact.
    """

    entity: str
    contact_s: float
    with_front: bool
    gap_m: float

    def fault(self, must: Must) -> str:
        """Why the scene is not what it is to be; empty if it is."""
        if must == "nothing":
            if self.entity:
                return "unbraked the ego touches a road user"
            return "" if self.gap_m >= CLEAR_M else "unbraked the ego passes too near"
        if not self.entity:
            return "unbraked the ego touches no road user"
        if self.entity != "Target":
            return "unbraked the ego touches another than the target first"
        return "" if self.with_front else "the ego is not touched at its front"


def unbraked(file: Path) -> Proof:
    """Carry out a scene without perception and brakes.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: it cannot be run.
    """
    spec = RunSpec(
        scenario=file.stem,
        file=str(file),
        parameters=(),
        strategy=NO_AEB,
        preset="physical",
        weather="dry",
        v_test_kmh=0.0,
        adapts=False,
    )
    # to the end of the scene: others may come after the first has been passed
    simulation = simulation_of(spec, THROUGH)
    contact = simulation.run().contact
    engine = simulation.engine
    world = engine.entities
    names = [entity.name for entity in engine.definition.entities]
    own = names.index(engine.ego.name)
    size = world.boxes.size_m
    if contact is not None:
        other = names.index(contact.entity)
        (x, y), heading = world.boxes.center_m[own].tolist(), float(world.boxes.yaw_rad[own])
        half = float(size[own, 0]) / 2
        front = (
            x + half * math.cos(heading),
            y + half * math.sin(heading),
            0.0,
            float(size[own, 1]),
            heading,
        )
        box = (
            *world.boxes.center_m[other].tolist(),
            *size[other].tolist(),
            float(world.boxes.yaw_rad[other]),
        )
        return Proof(contact.entity, contact.time_s, signed_gap_scalar(front, box) <= TOUCH_M, 0.0)
    run = engine.result()
    # reference points are the middles of the boxes
    center = np.stack((run.x_m, run.y_m), axis=-1)[::_EVERY]
    yaw = run.yaw_rad[::_EVERY]
    others = [k for k in range(len(names)) if k != own]
    gaps = signed_gap(
        center[:, [own]], size[own], yaw[:, [own]], center[:, others], size[others], yaw[:, others]
    )
    return Proof("", math.inf, False, float(gaps.min()) if gaps.size else math.inf)
