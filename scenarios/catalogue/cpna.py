"""Euro NCAP CPNA: an adult steps out from the near side, as in figure 3 of the SmartMOT paper."""

from __future__ import annotations

from dataclasses import dataclass

from opendrive import RoadNetwork
from scenarios import places
from scenarios.catalogue.bystanders import with_bystanders
from scenarios.catalogue.library import shipped_scenario
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.reading.reader import load
from scenarios.places import Place, Site
from scenarios.presets import Preset
from scenarios.simulation.ends import StopRule
from scenarios.simulation.simulation import Simulation
from scenarios.strategies import STRATEGIES, make_strategy
from smartmot.area import MonitoredAreaStrategy

__all__ = ["ADVERSARIES", "STRATEGIES", "CpnaTest", "Site", "build", "find_site", "make_strategy"]

ADVERSARIES = ("none", "static")
MAX_SPEED_KMH = 140.0

LEAD_S = 2.0
"""The ego drives this long before the pedestrian starts (parameter `Lead_s` of the scenarios)."""
LONGEST_WALK_S = (4.0 + 1.0 + 1.0) / (5 / 3.6)
"""Start offset, half an ego's width and run-up, at 5 km/h."""


@dataclass(frozen=True, slots=True)
class CpnaTest:
    """Parameters of one test.

    Args:
        speed_kmh: test speed of the ego.
        impact_point_percent: Euro NCAP impact location across the ego's width (0: right edge, 100: left
            edge), with the pedestrian's run-up; None: the paper's test, meeting at the lane centre.
        adversaries: none, or static: parked cars and standing pedestrians (figure 5c, d).
        seed: of the sensor noise.
    """

    speed_kmh: float
    impact_point_percent: float | None = None
    adversaries: str = "none"
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.speed_kmh <= MAX_SPEED_KMH:
            raise ScenarioError(f"test speed must lie in (0, {MAX_SPEED_KMH:g}] km/h, got {self.speed_kmh:g}")
        if self.impact_point_percent is not None and not 0 <= self.impact_point_percent <= 100:
            raise ScenarioError(f"impact point must lie in 0..100 %, got {self.impact_point_percent:g}")
        if self.adversaries not in ADVERSARIES:
            raise ScenarioError(
                f"unknown adversaries {self.adversaries!r}; use one of: {', '.join(ADVERSARIES)}"
            )

    @property
    def name(self) -> str:
        """Scenario name for the results."""
        return "CPNA" if self.impact_point_percent is None else f"CPNA-{self.impact_point_percent:g}"

    @property
    def scenario(self) -> str:
        """Name of the shipped scenario that carries it out."""
        return "cpna_paper" if self.impact_point_percent is None else "crossing"


def approach_m(speed_kmh: float) -> float:
    """Straight length that a test needs before the pedestrian's line."""
    return speed_kmh / 3.6 * (LEAD_S + LONGEST_WALK_S) + 10.0


def find_site(network: RoadNetwork, max_speed_kmh: float, place: Place | None = None) -> Site:
    """The place of the test on a map.

    Args:
        network: the map.
        max_speed_kmh: the highest test speed.
        place: of the pedestrian's line; None: chosen.

    Raises:
        ScenarioError: there is no such place, or no lane is straight for long enough.
    """
    needed = approach_m(max_speed_kmh)
    if place is None:
        return places.find_site(network, needed)
    return places.site_at(network, places.lane_at(network, place), place.s_m, needed)


def scenario_parameters(test: CpnaTest, site: Site, preset: Preset) -> dict[str, Value]:
    """Values of the shipped scenario's parameters, apart from the map."""
    line = site.line
    values: dict[str, Value] = {
        "Line_x": line.x_m,
        "Line_y": line.y_m,
        "Line_yaw": line.yaw_rad,
        "Side": float(site.near_side),
        "Ego_speed_kmh": test.speed_kmh,
        "Ego_length": preset.ego_length_m,
        "Ego_width": preset.ego_width_m,
    }
    if test.impact_point_percent is not None:
        values["Impact_percent"] = test.impact_point_percent
    return values


def build(
    test: CpnaTest,
    site: Site,
    preset: Preset,
    strategy: MonitoredAreaStrategy | None,
    rule: StopRule | None = None,
) -> Simulation:
    """Set up a run on a map in memory.

    Args:
        test: parameters.
        site: where.
        preset: vehicle, sensor, perception.
        strategy: monitored area; None: no perception and no braking.
        rule: when to end.

    Raises:
        ScenarioError: the ego would have to start before the route's beginning.
    """
    needed = approach_m(test.speed_kmh) - 5.0
    if site.line_m < needed:
        raise ScenarioError(
            f"{test.speed_kmh:g} km/h needs {needed:.0f} m of road before the pedestrian's line; "
            f"the route offers {site.line_m:.0f} m"
        )
    definition = load(shipped_scenario(test.scenario), scenario_parameters(test, site, preset))
    if test.adversaries == "static":
        definition = with_bystanders(definition, site.network)
    maker = None if strategy is None else lambda scene: strategy
    return Simulation(definition, preset, maker, test.seed, rule=rule, roads=Roads(site.network))
