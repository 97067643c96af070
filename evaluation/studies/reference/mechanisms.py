"""Which condition makes which published number: the paper's test with one condition changed at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from pathlib import Path

from evaluation.protocols.paper import PUBLISHED
from evaluation.results.files import ResultsError, configuration_json, write_files
from evaluation.results.tables import Table, csv_bytes, markdown_table
from evaluation.runs.configuration import configuration_of
from evaluation.runs.cpna import CpnaSuite
from evaluation.runs.execution import FrameTime, execute
from evaluation.runs.specs import Conditions
from evaluation.studies.compare.grid import seeded_phase_s
from evaluation.studies.study import Finished, LabelledRun, Study
from scenarios.catalogue.cpna import find_site
from scenarios.catalogue.maps import DEFAULT_MAP
from scenarios.presets import PAPER
from scenarios.settings import Settings, settings_text
from scenarios.spec import load_named_map

REACH_M = 22.2
"""Front limit of the authors' detections, as in the preset `paper`."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition and the speeds at which it is tried.

    Args:
        text: what it is.
        strategy: monitored area.
        settings: what departs from the preset `paper`.
        speeds_kmh: test speeds.
    """

    text: str
    strategy: str
    settings: Settings
    speeds_kmh: tuple[float, ...]


CONDITIONS = (
    Condition("as in preset paper", "rectangular", (), (40.0, 50.0, 60.0)),
    Condition("as in preset paper", "map", (), (60.0, 70.0, 80.0)),
    Condition(
        "rectangle 12..30 m, the authors' clamps",
        "rectangular",
        (("length_m", 30.0),),
        (40.0, 50.0, 60.0, 70.0, 80.0),
    ),
    Condition(
        "map, 22.2 m limits the sensor, not the count",
        "map",
        (("range_m", REACH_M), ("reach_m", math.inf)),
        (60.0, 70.0, 80.0),
    ),
    Condition("map, no limit on the reach", "map", (("reach_m", math.inf),), (60.0, 70.0, 80.0)),
)


@dataclass(frozen=True, slots=True)
class MechanismRun:
    """What one run came to; a line of the table.

    Args:
        strategy, settings, v_test_kmh, seed, phase_s: what was run.
        v_impact_kmh: speed at contact, 0 without.
    """

    strategy: str
    settings: str
    v_test_kmh: float
    seed: int
    phase_s: float
    v_impact_kmh: float


MechanismItem = LabelledRun[Condition]
"""One run, and the condition that it belongs to."""


@dataclass(frozen=True, slots=True)
class MechanismStudy(Study[MechanismItem, MechanismRun]):
    """The paper's test under the conditions, over frame phases and noise seeds.

    Args:
        name: of the folder.
        seeds: repetitions; seed k has the k-th frame phase, and noise of its own.
    """

    name: str
    seeds: int
    journal = "mechanisms_"
    table = "runs.csv"
    kind = MechanismRun

    def items(self, folder: Path) -> list[MechanismItem]:
        """The runs, by condition, speed and seed."""
        fastest = max(speed for condition in CONDITIONS for speed in condition.speeds_kmh)
        site = find_site(load_named_map(DEFAULT_MAP), fastest)
        items = []
        for condition in CONDITIONS:
            conditions = Conditions((condition.strategy,), PAPER.name, ("dry",), DEFAULT_MAP)
            for spec in CpnaSuite(condition.speeds_kmh, conditions).specs(site):
                items += [
                    LabelledRun(
                        replace(spec, settings=condition.settings, seed=seed, phase_s=seeded_phase_s(seed)),
                        condition,
                    )
                    for seed in range(self.seeds)
                ]
        return items

    @staticmethod
    def job(item: MechanismItem) -> tuple[MechanismRun, FrameTime]:
        """Carry out one of them."""
        spec = item.spec
        record = execute(spec, keep_log=False)
        impact = record.row.v_impact_kmh
        if impact is None:
            raise ResultsError(
                f"{spec.scenario}, {spec.strategy}: cut off by the time limit; it has no impact speed"
            )
        text = settings_text(spec.settings)
        run = MechanismRun(spec.strategy, text, spec.v_test_kmh, spec.seed, spec.phase_s, impact)
        return run, record.spent

    def write(
        self, folder: Path, items: Sequence[MechanismItem], finished: Finished[MechanismRun]
    ) -> list[Path]:
        """Write runs, table and conditions."""
        runs = [finished[item.key][0] for item in items]
        more = {
            "conditions": [
                asdict(condition) | {"settings": settings_text(condition.settings)}
                for condition in CONDITIONS
            ],
            "seeds": self.seeds,
            "phases_s": sorted({run.phase_s for run in runs}),
        }
        configuration = configuration_of([item.spec for item in items], folder, published=True, more=more)
        contents = {
            "runs.csv": csv_bytes([entry.name for entry in fields(MechanismRun)], map(astuple, runs)),
            "mechanisms.json": configuration_json(configuration),
            "table.md": markdown_table(mechanism_table(runs)).encode(),
        }
        return write_files(folder, contents)


def mechanism_table(runs: Sequence[MechanismRun]) -> Table:
    """Impact speeds per condition and test speed: in phase, the spread, and what the paper printed."""
    header = (
        "condition", "strategy", "v_test (km/h)", "in phase (km/h)", "least", "greatest", "published (km/h)",
    )  # fmt: skip
    lines = []
    for condition in CONDITIONS:
        for speed in condition.speeds_kmh:
            same = (condition.strategy, settings_text(condition.settings), speed)
            of_cell = [run for run in runs if (run.strategy, run.settings, run.v_test_kmh) == same]
            impacts = [run.v_impact_kmh for run in of_cell]
            published = PUBLISHED[condition.strategy].get(speed)
            lines.append(
                (
                    condition.text,
                    condition.strategy,
                    f"{speed:g}",
                    f"{impacts[0]:.2f}",
                    f"{min(impacts):.2f}",
                    f"{max(impacts):.2f}",
                    f"{published[0]:.2f}" if published else "–",
                )
            )
    seeds = len({run.seed for run in runs})
    caption = (
        f"Impact speeds. In phase: a frame falls on the pedestrian's start. Least and greatest: over {seeds} "
        "seeds, each with its own sensor noise and with frames 10 ms later than the one before."
    )
    return Table(header, tuple(lines), (), caption)
