"""A family of scenes, and what one of them comes to: how near it is to a contact."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from evaluation.errors import ArgumentError
from evaluation.runs.execution import FrameTime, frame_time, impact_speed_kmh
from evaluation.runs.fingerprint import digest_of, file_digest, library_versions, version
from evaluation.studies.answers.arms import Arm, spec_of
from scenarios.drawn.draw import KINDS, copy_maps, grounds_of, scene_of
from scenarios.drawn.manifest import DrawnScene
from scenarios.drawn.situations.situation import Situation
from scenarios.drawn.stage import Ground
from scenarios.drawn.values import RejectedDraw
from scenarios.settings import Settings
from scenarios.simulation.ends import CUT_OFF
from scenarios.simulation.outcome import Outcome
from scenarios.spec import RunSpec, simulation_of
from smartmot.geometry import signed_gap
from smartmot.types import FloatArray

FAMILIES = tuple(situation.name for situation in KINDS["brake"])
"""Situations in which the ego must brake, by name."""

NUMBERS = 192
"""Uniform numbers of a scene, more than most draws ask for; the last of a sample is the seed of the noise."""

CUT_OFF_RUN = "the run was cut off"
EARLY_RUN = "the ego braked before the target set off"
"""Why there is no margin of a scene that can be: an ego that braked early never met the target, which the
other questions do not take for a collision avoided either."""

_SEEDS = 10**9


@cache
def _grounds(split: str, maps: Path | None) -> list[Ground]:
    """The maps of a family, read once in a process."""
    return grounds_of(split, maps)


@dataclass(frozen=True, slots=True)
class Case:
    """One scene of a family, by its uniform numbers, and who is run in it.

    Args:
        family: name of the situation.
        split, maps: where; see `scenarios.drawn.draw.grounds_of`.
        arm: who.
        common: settings of the conditions.
        numbers: of [0, 1), with which the scene is drawn.
        noise: seed of the sensor's.
    """

    family: str
    split: str
    maps: Path | None
    arm: Arm
    common: Settings
    numbers: tuple[float, ...]
    noise: int

    @property
    def name(self) -> str:
        """Of its scene."""
        text = f"{self.family}-{digest_of([self.split, self.maps is None, self.numbers, self.noise])[:10]}"
        return text.replace(" ", "-")

    @property
    def key(self) -> str:
        """Hash of everything that determines the run."""
        arm = [self.arm.strategy, self.arm.preset, self.arm.settings, self.common]
        own = sorted(self.maps.glob("*.xodr")) if self.maps else []
        maps = [[path.name, file_digest(path)] for path in own]
        code = [version(), library_versions()]
        return digest_of([code, self.family, self.split, maps, arm, self.numbers, self.noise])

    @property
    def situation(self) -> Situation:
        """What it is about."""
        return next(s for s in KINDS["brake"] if s.name == self.family)

    def draw(self, folder: Path) -> DrawnScene:
        """Its scene, as a file in a folder with the maps.

        Raises:
            RejectedDraw: it would not come to pass.
        """
        grounds = _grounds(self.split, self.maps)
        copy_maps(folder, grounds)
        return scene_of(self.name, self.situation, self.numbers, folder, grounds)

    def spec(self, scene: DrawnScene) -> RunSpec:
        """The run in the scene."""
        return spec_of(self.arm, scene.run, self.noise, self.common)


@dataclass(frozen=True, slots=True)
class Came:
    """What a case came to; a scene that cannot be has no margin.

    Args:
        margin: least gap to the target, m; of a contact the impact speed, km/h, negative. One number that
            falls as things get worse; None: no scene, or a run that says nothing.
        rejected: why there is no margin; empty if there is one.
        collided: whether the ego touched another.
        v_impact_kmh: its speed then; 0 without contact.
        gap_m: least distance between the outlines of ego and target.
        variant: the scene in words.
        values: what was drawn, as JSON.
    """

    margin: float | None
    rejected: str
    collided: bool
    v_impact_kmh: float
    gap_m: float
    variant: str
    values: str


def come(case: Case) -> tuple[Came, FrameTime]:
    """Carry out one case."""
    with tempfile.TemporaryDirectory(prefix="smartmot-") as folder:
        try:
            scene = case.draw(Path(folder))
        except RejectedDraw as reason:
            return Came(None, str(reason), False, 0.0, 0.0, "", "{}"), FrameTime(0, 0.0, 0.0)
        outcome = simulation_of(case.spec(scene)).run()
        collided = outcome.contact is not None
        v_impact = impact_speed_kmh(outcome) or 0.0
        gap = 0.0 if collided else least_gap_m(outcome)
        says_nothing = why_no_margin(outcome)
        came = Came(
            None if says_nothing else (-max(v_impact, 1e-9) if collided else gap),
            says_nothing,
            collided,
            v_impact,
            gap,
            scene.run.variant,
            json.dumps(dict(scene.values), sort_keys=True),
        )
        return came, frame_time(outcome.frame_time_ms)


def why_no_margin(outcome: Outcome) -> str:
    """Why a run says nothing of its scene; empty if it does. A contact always does."""
    if outcome.contact is not None or outcome.avoided:
        return ""
    return CUT_OFF_RUN if outcome.end_reason in CUT_OFF else EARLY_RUN


def least_gap_m(outcome: Outcome) -> float:
    """Least distance between ego and target over the times of a run's log, m; 0 where they touch."""
    log = outcome.log.table()
    of_ego = log["kind"] == "ego"
    time_s, first = np.unique(log["time_s"][of_ego], return_index=True)
    ego = np.flatnonzero(of_ego)[first]
    target = np.flatnonzero((log["kind"] == "actor") & (log["label"] == "target"))
    target = target[np.isin(log["time_s"][target], time_s)]
    then = ego[np.searchsorted(time_s, log["time_s"][target])]

    def boxes(rows: NDArray[np.integer[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        center = np.column_stack((log["x_m"][rows], log["y_m"][rows]))
        size = np.column_stack((log["length_m"][rows], log["width_m"][rows]))
        return center, size, log["yaw_rad"][rows]

    gaps = signed_gap(*boxes(then), *boxes(target))
    return max(0.0, float(gaps.min()))


@dataclass(frozen=True, slots=True)
class Family:
    """Scenes of one situation, as they are drawn, with one who decides in them.

    Args:
        name: of the situation, out of `FAMILIES`.
        arm: who decides.
        split, maps: where they take place.
        common: settings of the conditions.

    Raises:
        ArgumentError: there is no such family.
    """

    name: str
    arm: Arm
    split: str = "test"
    maps: Path | None = None
    common: Settings = ()

    def __post_init__(self) -> None:
        if self.name not in FAMILIES:
            raise ArgumentError(f"family {self.name!r}: expected one of {', '.join(FAMILIES)}")

    @property
    def dimension(self) -> int:
        """Numbers of a sample: those of the scene, and the seed of the noise."""
        return NUMBERS + 1

    def cases(self, sample: FloatArray) -> list[Case]:
        """The cases of (N, D) samples of standard normal numbers."""
        uniform = np.minimum(ndtr(sample), np.nextafter(1.0, 0.0))
        return [
            Case(
                self.name,
                self.split,
                self.maps,
                self.arm,
                self.common,
                tuple(row[:-1].tolist()),
                int(row[-1] * _SEEDS),
            )
            for row in uniform
        ]
