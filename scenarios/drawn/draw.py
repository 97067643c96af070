"""Scenes drawn at random: which situation, on which map, where, how fast; each proved before it is kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from scenarios.drawn.actors import Actor
from scenarios.drawn.avoidance import avoidance
from scenarios.drawn.files import scene_bytes
from scenarios.drawn.manifest import GIVEN_UP, MANIFEST, REJECTED, DrawnScene, write_manifest, write_rejected
from scenarios.drawn.map_set import MAPS
from scenarios.drawn.proof import unbraked
from scenarios.drawn.situations.bystanders import bystanders
from scenarios.drawn.situations.must_brake import MUST_BRAKE
from scenarios.drawn.situations.must_not import NOTHING
from scenarios.drawn.situations.situation import Situation
from scenarios.drawn.stage import Ground, choose_stage
from scenarios.drawn.timeline import CLEAR_M, Timeline
from scenarios.drawn.values import Draw, Given, RejectedDraw, data, weighted
from scenarios.errors import ScenarioError
from scenarios.openscenario.errors import RunError
from scenarios.scenes.scenes import SceneRun

MOST_TRIES = 400
"""Draws of one scene; then another situation is drawn: no map has room for the first."""
SPLITS = ("train", "test")
KINDS = {"brake": MUST_BRAKE, "nothing": NOTHING}


def drawn_scenes(
    split: str,
    count: int,
    seed: int,
    folder: Path,
    maps: Path | None = None,
    done: Callable[[int, int], object] = lambda drawn, wanted: None,
) -> tuple[SceneRun, ...]:
    """Draw scenes, and write each as an OpenSCENARIO file of its own.

    The folder then holds the files, the maps that they use, `manifest.csv` with all drawn values and
    `rejected.csv` with the draws that were rejected, by reason. The same arguments give the same bytes.

    Args:
        split: train or test: which of the own maps are used; their scenes also differ on maps of the user's.
        count: of each kind: scenes in which the ego must brake, and in which it must do nothing.
        seed: of the draws.
        folder: to write to; made if it is missing.
        maps: folder of OpenDRIVE files to place them on, in place of the own maps.
        done: called after each scene with how many of how many there are.

    Raises:
        ScenarioError: unknown split, no maps or unreadable ones, or no scene of a kind can be placed on them.
    """
    folder = Path(folder)
    grounds = grounds_of(split, maps)
    scenes: list[DrawnScene] = []
    for scene in draw_all(split, count, seed, folder, grounds):
        scenes.append(scene)
        done(len(scenes), count * len(KINDS))
    write_manifest(folder / MANIFEST, scenes)
    write_rejected(folder / REJECTED, scenes)
    return tuple(scene.run for scene in scenes)


def grounds_of(split: str, maps: Path | None) -> list[Ground]:
    """The maps to place scenes on.

    Raises:
        ScenarioError: unknown split, a folder without OpenDRIVE files, or maps that cannot be read.
    """
    if split not in SPLITS:
        raise ScenarioError(f"split {split!r}: expected one of {', '.join(SPLITS)}")
    paths = [MAPS / f"{name}.xodr" for name in data()["maps"][split]]
    if maps is not None:
        paths = sorted(maps.glob("*.xodr"))
    if not paths:
        raise ScenarioError(f"{maps}: no OpenDRIVE file (*.xodr)")
    grounds, faults = [], []
    for path in paths:
        try:
            grounds.append(Ground(path))
        except RunError as error:
            faults.append(str(error))
    if faults:
        unread = f"{len(faults)} of {len(paths)} maps cannot be read: " if len(faults) > 1 else ""
        raise ScenarioError(unread + "; ".join(faults))
    return grounds


def draw_all(split: str, count: int, seed: int, folder: Path, grounds: list[Ground]) -> Iterator[DrawnScene]:
    """Draw the scenes one after the other."""
    copy_maps(folder, grounds)
    for kind in KINDS:
        for number in range(count):
            yield draw_one(split, seed, kind, number, folder, grounds)


def copy_maps(folder: Path, grounds: list[Ground]) -> None:
    """Put the maps where the scenes' files look for them."""
    (folder / "maps").mkdir(parents=True, exist_ok=True)
    for ground in grounds:
        (folder / "maps" / f"{ground.name}.xodr").write_bytes(ground.path.read_bytes())


def draw_one(
    split: str, seed: int, kind: str, number: int, folder: Path, grounds: list[Ground]
) -> DrawnScene:
    """Draw a scene; it depends on split, seed, kind and its number alone, and on the maps."""
    rng = np.random.default_rng([seed, SPLITS.index(split), list(KINDS).index(kind), number])
    return _draw_scene(f"{split}-{seed}-{kind}-{number:04d}", KINDS[kind], rng, folder, grounds)


def scene_of(
    name: str, situation: Situation, numbers: Sequence[float], folder: Path, grounds: list[Ground]
) -> DrawnScene:
    """The scene of a situation that some uniform numbers draw; they take the places of a generator's.

    Over independent numbers, and without those that are rejected, such scenes are distributed as `draw_one`
    draws them.

    Raises:
        RejectedDraw: it would not come to pass.
    """
    draw = Draw(Given(numbers))
    ground = grounds[weighted([1.0] * len(grounds), draw.uniform())]
    return _try_scene(name, situation, ground, draw, folder, Counter())


def _draw_scene(
    name: str,
    situations: tuple[Situation, ...],
    rng: np.random.Generator,
    folder: Path,
    grounds: list[Ground],
) -> DrawnScene:
    """One scene: of a situation drawn first, on the first map, place and values that make it come to pass."""
    rejected: Counter[tuple[str, str]] = Counter()
    left = list(situations)
    while left:
        situation = left.pop(weighted([1.0] * len(left), float(rng.random())))
        for _ in range(MOST_TRIES):
            draw = Draw(rng)
            ground = grounds[weighted([1.0] * len(grounds), draw.uniform())]
            try:
                return _try_scene(name, situation, ground, draw, folder, rejected)
            except RejectedDraw as reason:
                rejected[(situation.name, str(reason))] += 1
        rejected[(situation.name, GIVEN_UP)] += 1
    reasons: Counter[str] = Counter()
    for (_, why), times in rejected.items():
        reasons[why] += times
    raise ScenarioError(
        f"{name}: no situation can be placed on {', '.join(g.name for g in grounds)}; "
        f"most often: {reasons.most_common(1)[0][0]}"
    )


def _try_scene(
    name: str,
    situation: Situation,
    ground: Ground,
    draw: Draw,
    folder: Path,
    rejected: Counter[tuple[str, str]],
) -> DrawnScene:
    """A scene on a map.

    Raises:
        RejectedDraw: it would not come to pass.
    """
    stage, actors = situation.cast(choose_stage(ground, situation.place, draw), draw)
    timeline = Timeline(stage)
    _check(situation, timeline, actors)
    actors += bystanders(stage, draw, timeline)
    kmh = round(stage.speed_mps * 3.6, 3)
    file = folder / f"{name}.xosc"
    description = f"{situation.name}, {ground.name}, {kmh:g} km/h"
    file.write_bytes(scene_bytes(stage, f"maps/{ground.name}.xodr", description, actors))
    proof = unbraked(file)
    if fault := proof.fault(situation.must):
        file.unlink()
        raise RejectedDraw(fault)
    run = SceneRun(name, description, situation.must, str(file.resolve()), (), kmh)
    left = avoidance(stage, actors, proof.contact_s) if situation.must == "brake" else None
    return DrawnScene(run, situation, stage, tuple(actors), draw.values, proof, left, rejected)


def _check(situation: Situation, timeline: Timeline, actors: list[Actor]) -> None:
    """Reject what the clock shows not to come to pass, before it is run.

    Raises:
        RejectedDraw: with the reason.
    """
    for actor in actors:
        gap = timeline.gap_m(actor)
        if situation.must == "nothing" and float(gap.min()) < CLEAR_M:
            raise RejectedDraw("unbraked the ego passes too near")
        if situation.must == "nothing" and timeline.is_braked_for(actor):
            raise RejectedDraw("an attentive driver would brake")
        if situation.must == "brake" and actor.name == "Target" and float(gap.min()) > 0.0:
            raise RejectedDraw("unbraked the ego touches no road user")
        if float(gap[0]) < CLEAR_M:
            raise RejectedDraw("a road user is beside the ego at the start")
        if not timeline.keeps_to_its_ground(actor):
            raise RejectedDraw("a person would be in a lane, or a vehicle off its lane")
        if not timeline.is_apart(actor):
            raise RejectedDraw("two road users would touch each other")
        timeline.add(actor)
