"""Strategies that are given the same way and the same forecast differ in their area alone."""

import pytest

from scenarios.scenes.scenes import all_scenes
from scenarios.settings import PARAMETERS, Settings
from scenarios.spec import RunSpec, simulation_of
from scenarios.strategies import STRATEGIES

SAME_WAY: Settings = (("ego_forecast", "path"),)
STRAIGHT: Settings = (("standing", "straight"), ("way", "straight"))
WIDE: Settings = (("half_width_m", 4.0), ("length_m", 60.0), *STRAIGHT)


def brakes(name: str, strategy: str, settings: Settings = ()) -> tuple[bool, bool]:
    """Whether the ego asks for an emergency brake in a scene, and whether it touches anybody."""
    scene = next(run for run in all_scenes() if run.name.startswith(name))
    outcome = simulation_of(
        RunSpec(
            scene.name, scene.file, scene.parameters, strategy, "physical", "dry", scene.speed_kmh,
            settings=settings, must=scene.must,
        )
    ).run()  # fmt: skip
    return outcome.flag_time_s is not None, outcome.contact is not None


@pytest.mark.parametrize(
    ("scene", "strategy", "settings", "flag", "contact"),
    [
        # a runner at 12 km/h is behind the map's margin, and beside the rectangle, for too long
        ("runs across, 12 km/h, 50 km/h", "path", SAME_WAY, True, False),
        ("runs across, 12 km/h, 50 km/h", "all", SAME_WAY, True, False),
        ("runs across, 12 km/h, 50 km/h", "map", SAME_WAY, True, True),
        ("runs across, 12 km/h, 50 km/h", "rectangular", STRAIGHT, True, True),
        ("runs across, 12 km/h, 50 km/h", "rectangular", WIDE, True, False),
        # in a bend only the forecast along the path tells a cyclist beside the road from one on it
        ("cyclist on a cycle lane, 60 m bend left", "all", (), True, False),
        ("cyclist on a cycle lane, 60 m bend left", "rectangular", STRAIGHT, True, False),
        ("cyclist on a cycle lane, 60 m bend left", "all", SAME_WAY, False, False),
        ("cyclist on a cycle lane, 60 m bend left", "path", SAME_WAY, False, False),
        ("cyclist on a cycle lane, 60 m bend left", "rectangular", (*SAME_WAY, *STRAIGHT), False, False),
    ],
)  # fmt: skip
def test_what_the_area_and_what_the_path_is_worth(
    scene: str, strategy: str, settings: Settings, flag: bool, contact: bool
) -> None:
    assert brakes(scene, strategy, settings) == (flag, contact)


@pytest.mark.parametrize("name", ["ego_forecast", "way", "standing"])
def test_the_factors_mean_something_for_every_strategy(name: str) -> None:
    assert all(PARAMETERS[name].changes(strategy) for strategy in (*STRATEGIES, "my_area:make"))
