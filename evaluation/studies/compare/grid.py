"""Which runs a comparison consists of."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evaluation.studies.study import LabelledRun
from scenarios.presets import named_preset
from scenarios.scenes.scenes import SceneRun
from scenarios.sensing import meaningful
from scenarios.settings import PARAMETERS, Setting, Settings, preset_with, settings_text
from scenarios.spec import RunSpec
from scenarios.weather import named_weather

PHASES = 5
"""Frames come every 50 ms; seeds shift them by 0 to 40 ms, so that a seed has noise and phase of its own."""
PHASE_STEP_S = 0.01

FAIR: Settings = (("ego_forecast", "path"), ("way", "path"), ("standing", "path"))
"""Every planner knows its path: the ego is forecast along it, speed adaptation looks along it, and what
stands counts where it leads. Strategies that share this differ by their area alone."""

COMPARED = ("rectangular", "map", "all", "path")
"""The strategies of a comparison unless the user says otherwise: the paper's two, and the two that bound what
any area can gain."""

FRONTIER: Mapping[str, tuple[Setting, ...]] = {
    "margin_m": (0.0, 0.5, 1.8, 4.0),
    "half_width_m": (0.9, 2.6, 4.0),
}
"""What is varied unless the user says otherwise: the width of each strategy's area (1.8 m is the paper's
margin, 2.6 m its rectangle, 0.9 m the ego's half width)."""

ABLATION: Mapping[str, tuple[Setting, ...]] = {
    "filter": ("none", "detections", "tracks", "both"),
    "motion": ("cv", "ctrv"),
    "ego_forecast": ("ctrv", "path"),
    "way": ("area", "path"),
    "standing": ("area", "path"),
    "margin_m": (0.0, 1.0, 1.8, 3.0),
    "iou_threshold": (0.001, 0.01, 0.1),
    "horizon_s": (2.0, 3.0, 5.0),
}
"""The paper's choices, one of them changed at a time, for every strategy that it means anything for."""


@dataclass(frozen=True, slots=True)
class Point:
    """A strategy with settings: one row of the table, one point of the figure.

    Args:
        strategy: monitored area.
        settings: parameters that depart from the preset, or were asked for.
    """

    strategy: str
    settings: Settings = ()

    @property
    def text(self) -> str:
        """The settings as they are typed."""
        return settings_text(self.settings)

    @property
    def name(self) -> str:
        """Strategy and settings as tables show them."""
        return f"{self.strategy} {shown_settings(self.text)}".strip()


def shown_settings(text: str) -> str:
    """Settings as tables show them: those of `FAIR` in one word."""
    return text.replace(settings_text(FAIR), "fair")


def joined(common: Settings, own: Settings) -> Settings:
    """Common settings with those of one side in their place, without what means nothing beside them."""
    return meaningful((dict(common) | dict(own)).items()) if common else own


SceneItem = LabelledRun[SceneRun]
"""One run of a comparison, and its scene."""


def seeded_phase_s(seed: int) -> float:
    """Time of the first sensor frame of the runs with a seed."""
    return round(PHASE_STEP_S * (seed % PHASES), 3)


def points_of(strategies: Sequence[str], vary: Mapping[str, Sequence[Setting]]) -> tuple[Point, ...]:
    """Every strategy with every combination of the varied parameters that mean anything for it.

    Args:
        strategies: monitored areas.
        vary: values by the name of the parameter.
    """
    points: list[Point] = []
    for strategy in strategies:
        varied = varied_of(strategy, vary)
        combinations = itertools.product(*varied.values())
        points += [Point(strategy, tuple(zip(varied, values, strict=True))) for values in combinations]
    return tuple(points)


def varied_of(strategy: str, vary: Mapping[str, Sequence[Setting]]) -> dict[str, Sequence[Setting]]:
    """Values by parameter of those that one strategy varies; see `points_of`."""
    return {name: values for name, values in vary.items() if PARAMETERS[name].changes(strategy)}


def varied_points(strategies: Sequence[str], vary: Mapping[str, Sequence[Setting]]) -> tuple[Point, ...]:
    """Every strategy with every combination of what is varied, and with `FAIR` where that is not varied."""
    fair = tuple((name, value) for name, value in FAIR if name not in vary)
    return tuple(Point(p.strategy, (*p.settings, *fair)) for p in points_of(strategies, vary))


def fair_points(
    strategies: Sequence[str], widths: Mapping[str, Sequence[Setting]] = FRONTIER
) -> tuple[Point, ...]:
    """Every width of every area, alike in all else; then every strategy as the preset has it.

    Args:
        strategies: monitored areas.
        widths: values by the name of the parameter that is the width of an area.
    """
    return (*varied_points(strategies, widths), *map(Point, strategies))


def ablation_points(strategies: Sequence[str], preset: str) -> tuple[Point, ...]:
    """Every strategy as the preset has it, and with one of the paper's choices changed."""
    points: list[Point] = []
    for strategy in strategies:
        points.append(Point(strategy))
        for name, values in varied_of(strategy, ABLATION).items():
            usual = PARAMETERS[name].of(named_preset(preset))
            points += [Point(strategy, ((name, value),)) for value in values if value != usual]
    return tuple(points)


def study_runs(
    points: Sequence[Point],
    scenes: Sequence[SceneRun],
    preset: str,
    weather: Sequence[str],
    seeds: int,
    common: Settings = (),
) -> list[SceneItem]:
    """The runs: by weather, point, scene and seed. Every point meets the same scenes and the same noise.

    Args:
        points: strategies and settings.
        scenes: in which they are run.
        preset: conditions.
        weather: names.
        seeds: runs of each.
        common: settings of all points that do not have others; see `joined`.

    Raises:
        ScenarioError: an unknown preset or weather.
        smartmot.errors.ConfigError: a setting is out of range.
    """
    for point in points:  # checked here, before the first run starts
        preset_with(named_preset(preset), joined(common, point.settings))
    for name in weather:
        named_weather(name)
    return [
        LabelledRun(
            RunSpec(
                scenario=scene.name,
                file=scene.file,
                parameters=scene.parameters,
                strategy=point.strategy,
                preset=preset,
                weather=name,
                v_test_kmh=scene.speed_kmh,
                seed=seed,
                phase_s=seeded_phase_s(seed),
                paper_points=scene.must == "brake",
                must=scene.must,
                settings=joined(common, point.settings),
            ),
            scene,
        )
        for name, point, scene, seed in itertools.product(weather, points, scenes, range(seeds))
    ]
