"""What does the map gain when detections come from a LiDAR?"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.runs.execution import FrameTime
from evaluation.runs.specs import UPPER_BOUND
from evaluation.runs.workers import Workers
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm, ArmRun
from evaluation.studies.answers.lidar import tables
from evaluation.studies.answers.lidar.figures import rates_by_chain
from evaluation.studies.answers.lidar.runs import LidarDecision, decide
from evaluation.studies.answers.measures import DECISIVE, Decision
from evaluation.studies.answers.results import Results, decisive_differences
from evaluation.studies.answers.rivals import MAP, PATH, RIVALS, Rival
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import arms_table, differences_csv, differences_table, estimates_csv
from scenarios.presets import named_preset
from scenarios.sensing import TRUTH
from scenarios.sensors.lidar.chain import DEFAULT_PERCEPTION, PERCEPTIONS, lidar_of
from scenarios.settings import Settings, preset_with
from smartmot.lidar.learned import SHIPPED, shipped_card

RECTANGLE = next(rival for rival in RIVALS if rival.name == "rectangle")
ALL = next(rival for rival in RIVALS if rival.strategy == "all")
AREAS: tuple[Rival, ...] = (PATH, MAP, RECTANGLE, ALL)


@dataclass(frozen=True, slots=True)
class Chain:
    """Where detections come from.

    Args:
        name: in tables and figures.
        settings: sensor, perception and street.
        rules: brake rules that are run with it.
    """

    name: str
    settings: Settings
    rules: tuple[str, ...] = ("paper",)


def lidar(sensor: str, perception: str, street: str = "furnished") -> Settings:
    """A LiDAR on a street of its own in each scene."""
    return (("sensor", sensor), ("perception", perception), ("street", street))


def _ladder(sensor: str) -> tuple[Chain, ...]:
    """From truth to a detector, one step at a time, on furnished streets."""
    both = ("paper", "cascade")
    unscored = f"{DEFAULT_PERCEPTION}_unscored"
    steps = [Chain("truth", (), both)]
    steps += [Chain(f"{sensor}, {name}", lidar(sensor, name)) for name in ("labels", "cutout")]
    if unscored in PERCEPTIONS:
        steps.append(Chain(f"{sensor}, {DEFAULT_PERCEPTION}, all scores 1", lidar(sensor, unscored)))
    steps.append(Chain(f"{sensor}, {DEFAULT_PERCEPTION}", lidar(sensor, DEFAULT_PERCEPTION), both))
    return tuple(steps)


LADDER = _ladder("hdl32")
OTHERS = (
    Chain(f"hdl32, {DEFAULT_PERCEPTION}, bare street", lidar("hdl32", DEFAULT_PERCEPTION, "bare")),
    Chain(f"hdl64, {DEFAULT_PERCEPTION}", lidar("hdl64", DEFAULT_PERCEPTION)),
    Chain(f"mid70, {DEFAULT_PERCEPTION}", lidar("mid70", DEFAULT_PERCEPTION)),
)

NOTES = (
    "Every scene has a street of its own: kerbs, furniture and parked cars along the map's lanes, drawn with "
    "the scene's seed. What a road user of the scenario would touch on its way is left out, and nothing "
    "else. The ego can touch no furniture: to stop for it is unnecessary.",
    "Labels: true boxes of all who have a point. Cutout: boxes fitted to points that truth cuts out. All "
    "scores 1: the detector's boxes, of which the tracker drops none for its score.",
    "Everything, as published: its ego is forecast by its turn rate; along the planned path it would be the "
    "path's area again.",
    f"This is {UPPER_BOUND}.",
)


@dataclass(frozen=True, slots=True)
class LidarGain(Question):
    """Every area with every chain of sensor and detector.

    Args:
        preset: conditions.
        chains: where detections come from; the first are a ladder, of which each has one error more.
        areas: monitored areas; the first is what the others are compared with.
    """

    preset: str = "physical"
    chains: tuple[Chain, ...] = (*LADDER, *OTHERS)
    areas: tuple[Rival, ...] = AREAS
    name = "lidar"
    journal = "lidar_"
    kind = LidarDecision  # type: ignore[assignment]  # a decision, and more

    @staticmethod
    def job(item: ArmRun) -> tuple[LidarDecision, FrameTime]:
        """Carry out one run."""
        return decide(item)

    def arm(self, chain: Chain, area: Rival, rule: str = "paper") -> Arm:
        """An area with a chain and a rule."""
        named = f"{chain.name}: {area.name}" + ("" if rule == "paper" else f", {rule}")
        return replace(area.arm(self.preset, rule).having(*chain.settings), name=named)

    def areas_with(self, rule: str) -> tuple[Rival, ...]:
        """The areas that a rule is run with: what is the paper's as published has the paper's rule."""
        return tuple(area for area in self.areas if rule == "paper" or not area.is_as_published)

    @property
    def groups(self) -> dict[tuple[Chain, str], list[Arm]]:
        """The arms by chain and rule; the first of each is what the others are compared with."""
        return {
            (chain, rule): [self.arm(chain, area, rule) for area in self.areas_with(rule)]
            for chain in self.chains
            for rule in chain.rules
        }

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All of them."""
        return tuple(arm for group in self.groups.values() for arm in group)

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """The map against the other areas of the same chain and rule."""
        pairs = []
        for chain, rule in self.groups:
            areas = {area.name: area for area in self.areas_with(rule)}
            if MAP.name in areas:
                own = self.arm(chain, areas[MAP.name], rule)
                pairs += [
                    (own, self.arm(chain, area, rule)) for area in areas.values() if area.name != MAP.name
                ]
        return pairs

    @property
    def steps(self) -> list[tuple[Arm, Arm]]:
        """Each step of the ladder against the one before, by area."""
        ladder = [chain for chain in self.chains if chain in LADDER]
        return [
            (self.arm(chain, area), self.arm(before, area))
            for area in self.areas
            for before, chain in itertools.pairwise(ladder)
        ]

    @property
    def questions(self) -> int:
        """Differences that are tested."""
        return len(self.pairs) * len(DECISIVE)

    def carry_out(
        self,
        items: Sequence[ArmRun],
        folder: Path,
        prefix: str,
        workers: Workers,
        done: Callable[[int], None] = lambda count: None,
    ) -> tuple[dict[str, tuple[Decision, FrameTime]], int]:
        """See `Study.carry_out`; scene by scene: runs of one share the frames until their egos part."""
        by_scene = sorted(items, key=lambda item: item.label[1].name)  # stable: chains stay in their order
        return Question.carry_out(self, by_scene, folder, prefix, workers, done)

    def answer(self, results: Results) -> Answer:
        """What the map gains with each chain, and what each step of the ladder costs."""
        differences = decisive_differences(results, self.pairs)
        against_path = [d for d in differences if d.against.name.endswith(f": {self.areas[0].name}")]
        return Answer(
            "What does the map gain when detections come from a LiDAR?",
            tables.findings(self, results, differences),
            {
                "What the map gains": differences_table(differences, len(differences)),
                "When the request comes: the map against the others": tables.flag_table(results, self.pairs),
                "What each step costs, area by area": tables.steps_table(results, self.steps),
                "Each by itself": tables.chain_table(results, self.groups),
                "Unnecessary stops by place": tables.place_table(results, self.groups),
                "Who is who": arms_table(self.arms),
            },
            {
                "gain": figures.gain(
                    against_path, "the planned path", f"preset {self.preset}, an upper bound for the LiDARs"
                ),
                "chains": rates_by_chain(self, results),
            },
            {"gain.csv": differences_csv(differences), "table.csv": estimates_csv(results)},
            (self._rates(), *NOTES),
        )

    def _rates(self) -> str:
        """How often and how far each sensor sees, in a sentence."""
        conditions = {str(dict(chain.settings).get("sensor", TRUTH)): chain.settings for chain in self.chains}
        parts = []
        for name, settings in conditions.items():
            preset = preset_with(named_preset(self.preset), settings)
            reach_m = lidar_of(preset.lidar, preset.sensor).range_m if preset.lidar else preset.sensor.range_m
            parts.append(f"{name} {preset.sensor.rate_hz:g} frames per second, {reach_m:g} m")
        return f"Sensors: {'; '.join(parts)}."


def network_chain(sensor: str, network: str = SHIPPED[0]) -> Chain:
    """A LiDAR with a shipped network, known by its hash."""
    digest = shipped_card(network)["sha256"]
    return Chain(f"{sensor}, {network}", lidar(sensor, f"{network}@{digest[:12]}"))


@dataclass(frozen=True, slots=True)
class LearnedGain(LidarGain):
    """A network in the place of the classical chain, in the same scenes."""

    chains: tuple[Chain, ...] = (
        Chain(f"hdl64, {DEFAULT_PERCEPTION}", lidar("hdl64", DEFAULT_PERCEPTION)),
        network_chain("hdl64"),
    )
    areas: tuple[Rival, ...] = (PATH, MAP)
    name = "learned"

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """Every other chain against the first, area by area."""
        return [
            (self.arm(chain, area), self.arm(self.chains[0], area))
            for chain in self.chains[1:]
            for area in self.areas
        ]

    def answer(self, results: Results) -> Answer:
        """What the network changes."""
        differences = decisive_differences(results, self.pairs)
        return Answer(
            "What does a network change in the closed loop?",
            tables.pair_findings(results, self.pairs, differences),
            {
                "Network against classical chain": differences_table(differences, len(differences)),
                "When the request comes": tables.flag_table(results, self.pairs),
                "Each by itself": tables.chain_table(results, self.groups),
                "Unnecessary stops by place": tables.place_table(results, self.groups),
                "Who is who": arms_table(self.arms),
            },
            {"chains": rates_by_chain(self, results)},
            {"gain.csv": differences_csv(differences), "table.csv": estimates_csv(results)},
            (self._rates(), NOTES[0], f"This is {UPPER_BOUND}."),
        )
