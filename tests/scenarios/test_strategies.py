"""Strategies that are given the same way and the same forecast differ in their area alone."""

import pytest

from scenarios.presets import PHYSICAL
from scenarios.scenes.scenes import all_scenes
from scenarios.settings import PARAMETERS, Settings, preset_with
from scenarios.spec import RunSpec, simulation_of
from scenarios.strategies import STRATEGIES, path_source
from smartmot.maps.faulty import FaultyMap

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


def frames_of(
    strategy: str, settings: Settings, scene: str = "runs across, 12 km/h, 50 km/h"
) -> dict[str, str]:
    """The log of a run, with what perception and decision came to in every frame.

    Without which detections the area would keep, where it filters none.
    """
    run = next(run for run in all_scenes() if run.name.startswith(scene))
    spec = RunSpec(
        run.name, run.file, run.parameters, strategy, "physical", "dry", run.speed_kmh, settings=settings,
        must=run.must,
    )  # fmt: skip
    table = simulation_of(spec).run().log.table()
    return {name: repr(column.tolist()).replace("dropped", "kept") for name, column in table.items()}


ERRORS: Settings = (
    ("localisation_lateral_m", 0.6),
    ("localisation_heading_deg", 1.0),
    ("map_lane_m", 0.3),
    ("path_from", "map"),
)
"""The map's path is then wrong, for all alike."""


@pytest.mark.parametrize("errors", [(), ERRORS], ids=["planner", "map"])
@pytest.mark.parametrize(
    ("strategy", "settings"),
    [("path", ()), ("map", (("filter", "none"),)), ("tests.scenarios.own_area:make", ())],
    ids=["path", "map without filter", "own"],
)
def test_with_the_same_factors_areas_that_let_everything_count_are_one(
    strategy: str, settings: Settings, errors: Settings
) -> None:
    """In every frame: `all` has no knowledge that the others lack, nor they any that it lacks."""
    fair = (("ego_forecast", "path"), ("way", "path"), ("standing", "path"), *errors)
    assert frames_of(strategy, (*settings, *fair)) == frames_of("all", fair)


def test_an_area_of_ones_own_is_given_what_the_shipped_ones_are() -> None:
    """The faulty map and route, the pose that the ego believes in, and the planned path in the same frame."""
    from tests.scenarios import own_area

    own_area.TOLD.clear()
    frames_of("tests.scenarios.own_area:make", (*SAME_WAY, *ERRORS))
    (view, told), *_ = own_area.TOLD.values()
    assert isinstance(view.network, FaultyMap)
    assert view.route is view.network.route
    for ego, path in told:
        assert path is not None
        # believed 0.6 m to the left of the lane's middle, which the map has 0.3 m to the left
        assert path.project(ego.x_m, ego.y_m)[1] == pytest.approx(0.3, abs=1e-6)


@pytest.mark.parametrize(
    ("strategy", "settings", "source"),
    [
        ("all", (), ""),
        ("map", (("path_from", "map"),), ""),
        ("map", (("way", "path"),), "planner"),
        ("rectangular", (("standing", "path"), ("path_from", "map")), "map"),
        ("path", (), "planner"),
        ("my_area:make", (), "planner"),
    ],
)
def test_where_the_path_comes_from_is_said_of_whatever_looks_along_it(
    strategy: str, settings: Settings, source: str
) -> None:
    assert path_source(strategy, preset_with(PHYSICAL, settings)) == source
