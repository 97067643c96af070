"""The comparison in the paper's test: CPNA at several speeds, on one place of one map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.runs.specs import Conditions, bare_run
from scenarios.catalogue.cpna import CpnaTest, find_site, scenario_parameters
from scenarios.catalogue.maps import DEFAULT_MAP, SHIPPED_MAPS
from scenarios.errors import ScenarioError
from scenarios.places import Place, Site
from scenarios.presets import named_preset
from scenarios.spec import RunSpec, load_named_map


@dataclass(frozen=True, slots=True)
class CpnaSuite:
    """A comparison: every strategy at every speed, in every weather.

    Args:
        speeds_kmh: test speeds.
        conditions: of all runs; the map is an OpenDRIVE file, or the name of a shipped map.
        place: where the pedestrian's line is; None: chosen by itself.
        impact_point_percent: see `CpnaTest`.

    Raises:
        ScenarioError: there is nothing to run, or a test that does not exist.
    """

    speeds_kmh: tuple[float, ...]
    conditions: Conditions
    place: Place | None = None
    impact_point_percent: float | None = None

    def __post_init__(self) -> None:
        if not self.speeds_kmh or not self.conditions.strategies or not self.conditions.weather:
            raise ScenarioError("nothing to run: give at least one speed, one strategy and one weather")
        _ = self.tests  # every value is checked here, before the first run starts

    @property
    def map_name(self) -> str:
        """Map that the test takes place on."""
        return self.conditions.map_name or DEFAULT_MAP

    @property
    def tests(self) -> list[CpnaTest]:
        """The test at each speed."""
        adversaries, seed = self.conditions.adversaries, self.conditions.seed
        return [CpnaTest(v, self.impact_point_percent, adversaries, seed) for v in self.speeds_kmh]

    def specs(self, site: Site) -> list[RunSpec]:
        """The runs: by weather, then strategy, then speed.

        Args:
            site: the suite's place.
        """
        conditions = replace(self.conditions, map_name=self.map_name)
        return conditions.specs(cpna_runs(self.tests, site, self.map_name, conditions.preset))


def cpna_runs(tests: Iterable[CpnaTest], site: Site, map_name: str, preset: str) -> list[RunSpec]:
    """Tests on a place as runs that have no conditions yet.

    Args:
        tests: the tests.
        site: the place.
        map_name: the map of the place.
        preset: its name; it decides where the ego starts.

    Raises:
        ScenarioError: an unknown preset.
    """
    # from the folder of the shipped scenarios
    file = f"../maps/{map_name}.xodr" if map_name in SHIPPED_MAPS else str(Path(map_name).resolve())
    conditions = named_preset(preset)
    return [
        replace(
            bare_run(
                test.scenario,
                {"Map": file, **scenario_parameters(test, site, conditions)},
                test.name,
                test.speed_kmh,
            ),
            paper_points=True,
        )
        for test in tests
    ]


def load_site(suite: CpnaSuite) -> Site:
    """Load the suite's map and take its place.

    Raises:
        ScenarioError: the place does not exist or is not straight.
        opendrive.OpenDriveError: the file cannot be read.
    """
    return find_site(load_named_map(suite.map_name), max(suite.speeds_kmh), suite.place)


def is_published(suite: CpnaSuite) -> bool:
    """Whether the paper printed results for these conditions."""
    conditions = suite.conditions
    usual = conditions.preset == "paper" and conditions.adversaries == "none" and not conditions.settings
    on_place = suite.map_name == DEFAULT_MAP and suite.place is None and suite.impact_point_percent is None
    return usual and on_place and conditions.weather == ("dry",)
