"""One run, in Python."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.api.inputs import CPNA, Asked, asked_runs, place_of, settings_of, strategy_name, weather_names
from evaluation.api.results import Results
from evaluation.errors import ArgumentError
from evaluation.protocols.paper import PUBLISHED
from evaluation.results.files import log_path
from evaluation.results.logs import read_log, write_log
from evaluation.results.rows import RunRow
from evaluation.runs.conflict import conflict_of, scored, unbraked
from evaluation.runs.execution import outcome_of, record_of
from evaluation.runs.specs import Conditions
from evaluation.studies.suite import write_folder
from scenarios.simulation.outcome import Outcome
from scenarios.spec import RunSpec

if TYPE_CHECKING:
    import pandas as pd

    from scenarios.places import Place


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run:
    """A finished run.

    Args:
        outcome: what it came to.
        row: its line in `runs.csv`, with the points that it is worth.
        asked: everything that determined it.
    """

    outcome: Outcome
    row: RunRow
    asked: Asked

    @property
    def spec(self) -> RunSpec:
        """What was run."""
        return self.asked.specs[0]

    def frame(self) -> pd.DataFrame:
        """The log: a row per object, track, event ... and frame; docs/run-log.md has the columns."""
        with tempfile.TemporaryDirectory() as folder:
            path = log_path(Path(folder), self.spec.log)
            write_log(path, self.outcome.log.table())
            return read_log(path)

    def save(self, folder: str | Path) -> Results:
        """Write a folder of results with this run alone, as the commands write them, without pictures.

        Raises:
            ArgumentError: the folder holds something already.
            ResultsError: it cannot be written.
        """
        target = Path(folder)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise ArgumentError(f"save: {target} holds something already; name a new folder")
        return self._written(target)

    def report(self, file: str | Path) -> Path:
        """Write the run as an HTML page; see `Results.report`."""
        with tempfile.TemporaryDirectory() as folder:
            return self._written(Path(folder)).report(file)

    def replay(self, file: str | Path) -> Path:
        """Write a film of the run, GIF or MP4 by its ending; see `Results.replay`."""
        with tempfile.TemporaryDirectory() as folder:
            return self._written(Path(folder)).replay(self.spec.log, file)

    def to_dict(self) -> dict[str, Any]:
        """Its line in `runs.csv`, and the outcome, as plain values."""
        return {"row": asdict(self.row), "outcome": self.outcome.to_dict()}

    def __repr__(self) -> str:
        conditions = (self.row.strategy, f"{self.row.v_test_kmh:g} km/h", self.row.preset, self.row.weather)
        return f"Run({', '.join((self.row.scenario, *conditions))}: {self.outcome.text})"

    def _written(self, folder: Path) -> Results:
        configuration = self.asked.configuration(folder)
        write_log(log_path(folder, self.spec.log), self.outcome.log.table())
        published = PUBLISHED if self.asked.published else None
        write_folder(folder, [self.spec], [self.row], configuration, None, published)
        return Results(folder)


def run(
    scenario: str | Path = CPNA,
    *,
    speed_kmh: float | None = None,
    strategy: str | object = "map",
    preset: str | None = None,
    weather: str = "dry",
    tracker: str | object | None = None,
    detector: str | object | None = None,
    rule: str | object | None = None,
    sensor: str | None = None,
    perception: str | object | None = None,
    map_name: str | Path | None = None,
    at: str | Place | tuple[str, int, float] | None = None,
    parameters: Mapping[str, object] | None = None,
    settings: Mapping[str, object] | None = None,
    adversaries: str = "none",
    hold_speed: bool = False,
    seed: int = 0,
) -> Run:
    """Carry out one run in this process.

        >>> import smartmot
        >>> smartmot.run("cpna", speed_kmh=40, strategy="map").outcome.contact is None
        True

    Own objects: a class or function that makes them, as docs/plugins.md has it, or the objects themselves.

    Args:
        scenario: `cpna`, the paper's test as the command `cpna` runs it; the name of a shipped scenario (see
            `smartmot.scenarios`); or an OpenSCENARIO file.
        speed_kmh: test speed; None: what the scenario declares.
        strategy: monitored area: rectangular, map, all, path, adaptive, an own one with `at`; or none, for no
            brake.
        preset: paper, physical or real; None: paper for `cpna` and physical for all others, as the commands.
        weather: dry, wet, rain or snow.
        tracker: name of a configuration, or an own one with `update`; None: the preset's.
        detector: an own one with `observe`; None: the preset's sensor.
        rule: name of a brake rule, or an own one with `decide`; None: the paper's.
        sensor: a LiDAR, hdl32, hdl64 or mid70; None: boxes of the ground truth with the preset's errors.
        perception: what makes detections of its clouds, by name, or an own one with `detect`.
        map_name: of `cpna` the map where it takes place; else the map of perception; a file or shipped map.
        at: of `cpna` the place of the pedestrian's line, `ROAD,LANE,S`; None: chosen by itself.
        parameters: values of the scenario's parameters; of `cpna` Impact_percent alone.
        settings: parameters of perception that depart from the preset: `scenarios.settings.PARAMETERS`.
        adversaries: of `cpna`: none, or static: parked cars and standing people.
        hold_speed: as in tests of Euro NCAP: no ACC, and the run ends when the ego stands.
        seed: of the errors of sensor and localisation.

    Raises:
        ArgumentError: an unknown name, or an argument that the scenario does not have.
        scenarios.errors.ScenarioError: the scenario cannot be read or run.
        smartmot.SmartMotError: an object of the user's own fails, or a setting is out of range.
        opendrive.OpenDriveError: a map cannot be read.
    """
    conditions = Conditions(
        strategies=(strategy_name(strategy),),
        preset=preset or default_preset(scenario),
        weather=weather_names(weather),
        map_name=None if map_name is None else str(map_name),
        adversaries=adversaries,
        seed=seed,
        adapts=not hold_speed,
        settings=settings_of(
            {"tracker": tracker, "detector": detector, "rule": rule, "sensor": sensor},
            {"perception": perception, **(settings or {})},
        ),
    )
    speeds = () if speed_kmh is None else (speed_kmh,)
    if str(scenario) == CPNA and speed_kmh is None:
        raise ArgumentError(f"speed_kmh: {CPNA} is a test at several speeds; give one, or call sweep")
    asked = asked_runs(scenario, conditions, speeds, parameters or {}, place_of(at))
    if len(asked.specs) != 1:
        names = ", ".join(dict.fromkeys(f"{s.scenario}, {s.v_test_kmh:g} km/h" for s in asked.specs[:3]))
        raise ArgumentError(
            f"{scenario}: {len(asked.specs)} runs ({names} ...); choose one by speed_kmh and parameters, or "
            "call sweep"
        )
    spec = asked.specs[0]
    outcome = outcome_of(spec)
    row = scored(record_of(spec, outcome).row, conflict_of(unbraked(spec)))
    return Run(outcome, row, asked)


def default_preset(scenario: str | Path) -> str:
    """The preset that the command for a scenario has unless another is asked for."""
    return "paper" if str(scenario) == CPNA else "physical"
