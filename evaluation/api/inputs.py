"""What a user gives in Python, as the runs have it: names in place of objects, settings, processes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evaluation.errors import ArgumentError
from evaluation.runs.configuration import configuration_of
from evaluation.runs.cpna import CpnaSuite, is_published, load_site
from evaluation.runs.specs import Conditions, perception_notes, scenario_specs
from evaluation.runs.workers import available_cores
from evaluation.studies.suite import suite_configuration
from opendrive import RoadNetwork
from scenarios.catalogue.library import SHIPPED_SCENARIOS, ScenarioDescription, describe, describe_all
from scenarios.catalogue.maps import DEFAULT_MAP, SHIPPED_MAPS
from scenarios.places import Place
from scenarios.sensing import TRUTH
from scenarios.settings import PARAMETERS, Setting, Settings
from scenarios.spec import NO_AEB, RunSpec, load_named_map
from scenarios.strategies import STRATEGIES
from scenarios.weather import WEATHER
from smartmot.errors import suggestion
from smartmot.plugins import is_of_process, is_plugin, name_for

CPNA = "cpna"
"""The paper's test: what the command `cpna` runs."""
SPEEDS_KMH = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Of the paper's test."""
METHODS = {
    "strategy": "at",
    "tracker": "update",
    "detector": "observe",
    "rule": "decide",
    "perception": "detect",
}
"""What an object of the user's own must have, by the parameter that takes it."""

_EGO_SPEED = re.compile(r"ego_?speed_?k(m_?h|ph)", re.IGNORECASE)
"""Parameters of scenario files that are the test speed in km/h."""


def load_map(source: str | Path) -> RoadNetwork:
    """Load an OpenDRIVE file, or a shipped map by its name.

    Args:
        source: a file (.xodr), or one of `scenarios.catalogue.maps.SHIPPED_MAPS`: urban_street,
            urban_street_parking, urban_bend, euro_ncap_street, urban_intersection.

    Returns:
        The road network: geometry, lanes, topology and spatial queries, on arrays; map frame, SI units.

    Raises:
        ArgumentError: there is neither a file nor a shipped map of that name.
        opendrive.OpenDriveError: the file cannot be read.
    """
    name = str(source)
    if name not in SHIPPED_MAPS and not Path(name).exists():
        raise ArgumentError(
            f"load_map: no file and no shipped map {name!r}{suggestion(name, SHIPPED_MAPS)}; shipped are: "
            f"{', '.join(SHIPPED_MAPS)}"
        )
    return load_named_map(name)


def scenarios(file: str | Path | None = None) -> tuple[ScenarioDescription, ...]:
    """The shipped scenarios with their parameters, or what a file holds.

    Args:
        file: an OpenSCENARIO file (.xosc), or the name of a shipped one; None: all shipped ones.

    Raises:
        ArgumentError: neither a shipped scenario nor a file.
        scenarios.openscenario.errors.OpenScenarioError: the file cannot be read.
    """
    return describe_all() if file is None else (describe(scenario_name_of(file)),)


def several(given: Any) -> tuple[Any, ...]:
    """One value, or all of a sequence."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        return (given,)
    return tuple(given)


def strategy_name(given: object) -> str:
    """A monitored area by its name, or one of the user's own.

    Raises:
        ArgumentError: an unknown name.
        smartmot.errors.PluginError: no monitored area.
    """
    if not isinstance(given, str):
        return name_for(given, METHODS["strategy"])
    if given not in (*STRATEGIES, NO_AEB) and not is_plugin(given):
        raise ArgumentError(
            f"strategy: unknown {given!r}{suggestion(given, STRATEGIES)}; use {', '.join(STRATEGIES)}, "
            f"{NO_AEB}, package.module:name, or an object with at()"
        )
    return given


def setting(name: str, value: object) -> Setting:
    """The value of a parameter; an object of the user's own has a name.

    Raises:
        ArgumentError: no such parameter, or no value of it.
        smartmot.errors.SmartMotError: an object that cannot be used, or a file that is missing.
    """
    if name not in PARAMETERS:
        raise ArgumentError(
            f"settings: unknown {name!r}{suggestion(name, PARAMETERS)}; use one of: {', '.join(PARAMETERS)}"
        )
    parameter = PARAMETERS[name]
    if isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if parameter.own and not isinstance(value, (str, float)):
        value = name_for(value, METHODS[name])
    if not isinstance(value, (str, float)) or not parameter.admits(value):
        asked = f"one of: {', '.join(parameter.names)}" if parameter.choices else "a number"
        close = suggestion(value, parameter.names) if isinstance(value, str) else ""
        raise ArgumentError(f"{name}: unknown {value!r}{close}; use {asked}")
    return parameter.known_as(value) if isinstance(value, str) else value


def settings_of(*given: Mapping[str, object]) -> Settings:
    """Parameters that depart from the preset, without those that say what the preset has anyway.

    Args:
        given: values by name, the last holds; None: as the preset has it.
    """
    values = {
        name: setting(name, value) for part in given for name, value in part.items() if value is not None
    }
    beside = next((name for name in ("perception", "street") if name in values), None)
    if beside is not None and values.get("sensor", TRUTH) == TRUTH:
        raise ArgumentError(f"{beside}: for a LiDAR; add sensor='hdl32', 'hdl64' or 'mid70'")
    plugged = ("tracker", "detector", "rule", "sensor")
    return tuple(
        (name, value)
        for name, value in values.items()
        if name not in plugged or value != PARAMETERS[name].choices[0]
    )


def varied_settings(given: Mapping[str, object] | None) -> dict[str, tuple[Setting, ...]]:
    """Values by parameter, one or several of each; see `setting`."""
    return {
        name: tuple(setting(name, value) for value in several(values))
        for name, values in (given or {}).items()
    }


def weather_names(given: str | Sequence[str]) -> tuple[str, ...]:
    """Weather by name.

    Raises:
        ArgumentError: an unknown name.
    """
    for name in several(given):
        if name not in WEATHER:
            close = suggestion(str(name), WEATHER)
            raise ArgumentError(f"weather: unknown {name!r}{close}; use one of: {', '.join(WEATHER)}")
    return several(given)


def place_of(given: str | Place | tuple[str, int, float] | None) -> Place | None:
    """A place on a map: `"ROAD,LANE,S"` as on the command line, or the three of them.

    Raises:
        ArgumentError: not of that form.
    """
    if given is None or isinstance(given, Place):
        return given
    parts = given.rsplit(",", 2) if isinstance(given, str) else given
    try:
        road, lane, s_m = parts
        return Place(str(road).strip(), int(lane), float(s_m))
    except (TypeError, ValueError):
        raise ArgumentError(f"at: expected ROAD,LANE,S such as '1,-1,250.0'; got {given!r}") from None


@dataclass(frozen=True, slots=True)
class Asked:
    """Runs that a user asks for.

    Args:
        specs: the runs.
        suite: of the paper's test; None: runs of a scenario.
        notes: what is left out of them, one line each.
    """

    specs: tuple[RunSpec, ...]
    suite: CpnaSuite | None = None
    notes: tuple[str, ...] = ()

    @property
    def published(self) -> bool:
        """Whether the paper printed results for these conditions."""
        return self.suite is not None and is_published(self.suite)

    def configuration(self, out: Path) -> dict[str, object]:
        """Everything that determines the runs, for `runs.json` in a folder."""
        if self.suite is not None:
            return suite_configuration(self.suite, load_site(self.suite), out)
        return configuration_of(self.specs, out, perception_notes(self.specs))


def asked_runs(
    scenario: str | Path,
    conditions: Conditions,
    speeds_kmh: Sequence[float],
    parameters: Mapping[str, object],
    place: Place | None,
) -> Asked:
    """The runs of a scenario in conditions.

    Args:
        scenario: `CPNA`, the name of a shipped scenario, or a file.
        conditions: strategies, weather and what all runs have in common.
        speeds_kmh: test speeds; none: what the scenario asks for.
        parameters: values in place of the declared ones.
        place: of the pedestrian's line of `CPNA`; None: chosen by itself.

    Raises:
        ArgumentError: an argument that the scenario does not have.
        scenarios.errors.ScenarioError: there is no such scenario, or a value does not fit.
        opendrive.OpenDriveError: a map cannot be read.
    """
    if str(scenario) == CPNA:
        return _cpna(conditions, speeds_kmh or SPEEDS_KMH, parameters, place)
    if place is not None:
        raise ArgumentError(f"at: places the line of {CPNA}; {scenario} has a place of its own")
    if conditions.adversaries != "none":
        raise ArgumentError(
            f"adversaries: stand beside the road of {CPNA}; {scenario} has its own road users"
        )
    values = {str(name): str(value) for name, value in parameters.items()}
    named = scenario_name_of(scenario)
    sets: list[dict[str, str]] = [values]
    if speeds_kmh:
        parameter = speed_parameter(named)
        if parameter in values:
            raise ArgumentError(f"speed_kmh: parameters has {parameter} as well; leave one out")
        sets = [values | {parameter: f"{speed:.10g}"} for speed in speeds_kmh]
    notes: list[str] = []
    specs = [spec for given in sets for spec in scenario_specs(named, given, conditions, notes)]
    ranks = [(name, strategy) for name in conditions.weather for strategy in conditions.strategies]
    specs.sort(key=lambda spec: ranks.index((spec.weather, spec.strategy)))  # as the command has them
    return Asked(tuple(specs), None, tuple(dict.fromkeys(notes)))


def _cpna(
    conditions: Conditions,
    speeds_kmh: Sequence[float],
    parameters: Mapping[str, object],
    place: Place | None,
) -> Asked:
    """The paper's test, or that of Euro NCAP if an impact location is given."""
    unknown = [name for name in parameters if name != "Impact_percent"]
    if unknown:
        raise ArgumentError(
            f"parameters: {CPNA} takes Impact_percent alone, not {unknown[0]}; run 'crossing' for all others"
        )
    impact = parameters.get("Impact_percent")
    try:
        percent = None if impact is None else float(str(impact))
    except ValueError:
        raise ArgumentError(f"parameters: Impact_percent must be a number, got {impact!r}") from None
    conditions = replace(conditions, map_name=conditions.map_name or DEFAULT_MAP)
    suite = CpnaSuite(tuple(sorted({float(v) for v in speeds_kmh})), conditions, place, percent)
    return Asked(tuple(suite.specs(load_site(suite))), suite)


def scenario_name_of(scenario: str | Path) -> str:
    """A scenario as runs name it.

    Raises:
        ArgumentError: neither a shipped scenario nor a file.
    """
    name = str(scenario)
    if name in SHIPPED_SCENARIOS or Path(name).is_file():
        return name
    close = suggestion(name, SHIPPED_SCENARIOS)
    raise ArgumentError(
        f"scenario: no shipped scenario and no file {name!r}{close}; see smartmot.scenarios()"
    )


def speed_parameter(scenario: str) -> str:
    """Name of the parameter that is the test speed in km/h.

    Raises:
        ArgumentError: the scenario has none, or several.
    """
    declared = [parameter.name for parameter in describe(scenario).parameters]
    speeds = [name for name in declared if _EGO_SPEED.fullmatch(name)]
    if len(speeds) != 1:
        raise ArgumentError(
            f"speed_kmh: {scenario} declares no single parameter such as Ego_speed_kmh; give it in "
            f"parameters, which are: {', '.join(declared)}"
        )
    return speeds[0]


def processes_for(workers: int | None, names: Iterable[str]) -> int:
    """Processes for runs with objects of the user's own.

    Args:
        workers: that were asked for; None: one per core.
        names: of the objects; see `smartmot.plugins.name_for`.

    Raises:
        ArgumentError: several processes for an object that this one alone has.
    """
    if workers is not None and workers < 1:
        raise ArgumentError(f"workers: at least 1, got {workers}")
    own = next((name for name in names if is_of_process(name)), None)
    if own is None:
        return workers or available_cores()
    if workers is not None and workers > 1:
        raise ArgumentError(
            f"workers: {own} is an object of this process, which {workers} processes cannot share; leave "
            "workers out, or put its class or function into a module that can be imported"
        )
    return 1
