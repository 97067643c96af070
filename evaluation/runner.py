"""Runs every combination that a comparison asks for, on one place of one map."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.arguments import DEFAULT_MAP
from evaluation.protocols.paper import paper_score, paper_score_max
from evaluation.results import RUNS_JSON, ResultsError, RunRow
from opendrive import RoadNetwork, load_map
from scenarios.cpna import CpnaTest, Site, build, find_site, make_strategy, near_side, site_at
from scenarios.errors import ScenarioError
from scenarios.map_builder import SHIPPED_MAPS, shipped_map
from scenarios.presets import Preset, named_preset, named_weather, preset_in_weather
from scenarios.simulation import Outcome
from smartmot.regulatory import regulatory_elements
from smartmot.route import route_ahead


@dataclass(frozen=True, slots=True)
class Place:
    """A place on a map as the user names it.

    Args:
        road_id: id of the road.
        lane_id: id of the lane on it.
        s_m: road coordinate.
    """

    road_id: str
    lane_id: int
    s_m: float


@dataclass(frozen=True, slots=True)
class CpnaSuite:
    """A comparison: every strategy at every speed, in every weather.

    Args:
        speeds_kmh: test speeds.
        strategies: names of monitored-area strategies.
        preset: name of the preset.
        weather: names of weather conditions.
        map_name: OpenDRIVE file, or name of a shipped map.
        place: where the pedestrian's line is; None: chosen by itself.
        impact_point_percent: see `CpnaTest`.
        adversaries: see `CpnaTest`.
        seed: of the sensor noise; the same for every strategy.
        phase_s: time of the first sensor frame.
    """

    speeds_kmh: tuple[float, ...]
    strategies: tuple[str, ...]
    preset: str
    weather: tuple[str, ...]
    map_name: str
    place: Place | None = None
    impact_point_percent: float | None = None
    adversaries: str = "none"
    seed: int = 0
    phase_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.speeds_kmh or not self.strategies or not self.weather:
            raise ScenarioError("nothing to run: give at least one speed, one strategy and one weather")
        # every name and value is checked here, before the first run starts
        named_preset(self.preset)
        for weather in self.weather:
            named_weather(weather)
        for speed in self.speeds_kmh:
            self.test(speed)

    def preset_in(self, weather: str) -> Preset:
        """The preset as it is in one weather."""
        preset = preset_in_weather(named_preset(self.preset), named_weather(weather))
        return replace(preset, sensor=replace(preset.sensor, phase_s=self.phase_s))

    def test(self, speed_kmh: float) -> CpnaTest:
        """The test at one speed."""
        return CpnaTest(speed_kmh, self.impact_point_percent, self.adversaries, self.seed)


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """One finished run.

    Args:
        row: its line in `runs.csv`.
        outcome: what came out.
        log: its log as columns.
    """

    row: RunRow
    outcome: Outcome
    log: dict[str, NDArray[Any]]


def lane_at(network: RoadNetwork, place: Place) -> int:
    """Index of the lane at a place.

    Raises:
        ScenarioError: there is no such road, lane or s; the message lists what there is.
    """
    roads = {key.road_id for key in network.lanes.key}
    if place.road_id not in roads:
        some = ", ".join(sorted(roads, key=lambda r: (len(r), r))[:12])
        raise ScenarioError(f"the map has no road {place.road_id!r}; it has {len(roads)} roads: {some} ...")
    found: list[str] = []
    for index, key in enumerate(network.lanes.key):
        if key.road_id != place.road_id:
            continue
        low, high = float(network.lanes.s_start_m[index]), float(network.lanes.s_end_m[index])
        if key.lane_id == place.lane_id and low <= place.s_m <= high:
            return index
        found.append(f"{key.lane_id} ({network.lanes.lane_type[index]!s}, s {low:g}..{high:g})")
    raise ScenarioError(
        f"road {place.road_id} has no lane {place.lane_id} at s = {place.s_m:g} m; "
        f"it has: {'; '.join(found[:12])}"
    )


def choose_site(network: RoadNetwork, place: Place | None, max_speed_kmh: float) -> Site:
    """The place of the test, given or found."""
    if place is None:
        return find_site(network, max_speed_kmh)
    return site_at(network, lane_at(network, place), place.s_m, max_speed_kmh)


def load_named_map(name: str) -> RoadNetwork:
    """Load a shipped map by its name, or any OpenDRIVE file.

    Raises:
        opendrive.OpenDriveError: the file cannot be read.
    """
    return load_map(shipped_map(name) if name in SHIPPED_MAPS else Path(name))


def load_site(suite: CpnaSuite) -> Site:
    """Load the suite's map and take its place.

    Raises:
        ScenarioError: the place does not exist or is not straight.
        opendrive.OpenDriveError: the file cannot be read.
    """
    return choose_site(load_named_map(suite.map_name), suite.place, max(suite.speeds_kmh))


def pose_site(network: RoadNetwork, place: Place) -> Site:
    """A place to look at, which need not be straight."""
    lane = lane_at(network, place)
    if network.lanes.lane_type[lane] != "driving":
        raise ScenarioError(
            f"lane {place.lane_id} of road {place.road_id} is of type {network.lanes.lane_type[lane]!s}; "
            "choose a driving lane"
        )
    route = route_ahead(network, lane, place.s_m, ahead_m=200.0, behind_m=100.0)
    station = float(route.entry_m[route.lanes.index(lane)]) + route.strips[
        route.lanes.index(lane)
    ].station_at(place.s_m)
    return Site(network, route, station, near_side(network, lane))


def describe_map(network: RoadNetwork, site: Site | None, speed_kmh: float) -> list[str]:
    """What a map holds, and what the law says on the route ahead of a place, line by line."""
    types, counts = np.unique(network.lanes.lane_type, return_counts=True)
    lines = [
        f"map: {network.name or '(unnamed)'}, {len(network.roads)} roads, {len(network.lanes.key)} lanes: "
        + ", ".join(f"{n} {t}" for t, n in zip(types, counts, strict=True)),
        f"crosswalks: {len(network.crosswalks)}, warnings: {len(network.warnings)}",
    ]
    lines += [f"  warning: {warning}" for warning in network.warnings[:20]]
    if site is not None:
        lines.append(
            f"route: {len(site.route.strips)} lanes, {site.route.length_m - site.line_m:.0f} m ahead"
        )
        elements = regulatory_elements(network, site.route, site.line_m, 200.0)
        for element in elements:
            value = "" if element.value is None else f" {element.value:g}"
            lines.append(f"  {element.kind}{value} in {element.distance_m:.1f} m (road {element.road_id})")
        if not elements:
            lines.append("  no regulatory element within 200 m")
    return lines


def is_published(suite: CpnaSuite) -> bool:
    """Whether the paper printed results for these conditions."""
    return (
        suite.preset == "paper"
        and suite.impact_point_percent is None
        and suite.adversaries == "none"
        and suite.weather == ("dry",)
        and suite.map_name == DEFAULT_MAP
        and suite.place is None
    )


def count(suite: CpnaSuite) -> int:
    """How many runs a suite has."""
    return len(suite.speeds_kmh) * len(suite.strategies) * len(suite.weather)


def run_suite(suite: CpnaSuite, site: Site | None = None) -> Iterator[RunRecord]:
    """Run a suite, one record after the other: by weather, then strategy, then speed.

    Args:
        suite: what to run.
        site: the place, when the caller has loaded the map already.

    Raises:
        ScenarioError: a test cannot be set up.
        opendrive.OpenDriveError: the map cannot be read.
    """
    if site is None:
        site = load_site(suite)
    for name in suite.weather:
        preset = suite.preset_in(name)
        for strategy_name in suite.strategies:
            strategy = make_strategy(strategy_name, preset, site)
            for speed in suite.speeds_kmh:
                outcome = build(suite.test(speed), site, preset, strategy).run()
                yield _record(suite, name, strategy_name, speed, outcome)


def _record(suite: CpnaSuite, weather: str, strategy: str, speed: float, outcome: Outcome) -> RunRecord:
    test = suite.test(speed)
    impact = outcome.impact_speed_mps * 3.6
    collided = outcome.contact_time_s is not None
    row = RunRow(
        scenario=test.name,
        strategy=strategy,
        preset=suite.preset,
        weather=weather,
        adversaries=suite.adversaries,
        seed=suite.seed,
        v_test_kmh=speed,
        v_impact_kmh=impact,
        collided=collided,
        score=paper_score(speed, impact),
        score_max=paper_score_max(speed),
        flag_time_s=outcome.flag_time_s,
        flag_distance_m=outcome.flag_distance_m,
        stop_gap_m=outcome.stop_gap_m,
        contact_time_s=outcome.contact_time_s,
        t0_s=outcome.contact_time_s if collided else outcome.stop_time_s,
        # a request before the pedestrian has started can only be meant for nobody
        false_stop=outcome.flag_time_s is not None
        and (outcome.trigger_time_s is None or outcome.flag_time_s < outcome.trigger_time_s),
        log=f"{test.name}_{strategy}_{weather}_{suite.adversaries}_{speed:.10g}kmh_seed{suite.seed}",
    )
    return RunRecord(row, outcome, outcome.log.table())


def suite_configuration(suite: CpnaSuite, site: Site) -> dict[str, object]:
    """Everything that determines the results of a suite, as plain values."""
    key = site.network.lanes.key[site.route.lanes[0]]
    return {
        "suite": {
            "speeds_kmh": list(suite.speeds_kmh),
            "strategies": list(suite.strategies),
            "preset": suite.preset,
            "weather": [named_weather(name) for name in suite.weather],
            "map": suite.map_name,
            "place": suite.place,
            "impact_point_percent": suite.impact_point_percent,
            "adversaries": suite.adversaries,
            "seed": suite.seed,
            "phase_s": suite.phase_s,
        },
        "site": {
            "first_lane": list(key),
            "lanes": [list(site.network.lanes.key[i]) for i in site.route.lanes],
            "line_m": site.line_m,
            "line_xy_m": list(site.route.pose(site.line_m)[:2]),
        },
        "presets": {name: suite.preset_in(name) for name in suite.weather},
    }


def read_suite(directory: Path) -> CpnaSuite:
    """The suite that made a folder of results.

    Raises:
        ResultsError: `runs.json` is missing or was not written by this program.
    """
    try:
        values = dict(json.loads((directory / RUNS_JSON).read_text())["configuration"]["suite"])
        place = values.pop("place")
        return CpnaSuite(
            speeds_kmh=tuple(values["speeds_kmh"]),
            strategies=tuple(values["strategies"]),
            preset=values["preset"],
            weather=tuple(w["name"] for w in values["weather"]),
            map_name=values["map"],
            place=Place(**place) if place else None,
            impact_point_percent=values["impact_point_percent"],
            adversaries=values["adversaries"],
            seed=values["seed"],
            phase_s=values["phase_s"],
        )
    except OSError as error:
        raise ResultsError(
            f"{directory / RUNS_JSON}: {error.strerror}; run `smartmot-eval cpna` first"
        ) from None
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(
            f"{directory / RUNS_JSON}: not a configuration of this program ({error!r}); run the test again"
        ) from None
