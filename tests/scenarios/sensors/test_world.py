"""Ground truth for sensors: velocities, heights over the road's surface, checked columns."""

import math
from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario.reading.reader import load
from scenarios.presets import PHYSICAL
from scenarios.sensors import FlatGround, MapSurface, World
from scenarios.simulation.simulation import Simulation
from smartmot.errors import ShapeError
from smartmot.types import Boxes, FloatArray

HILL = """<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="1" length="200" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="3" b="0.05" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road>
<road id="2" length="100" junction="-1"><planView>
<geometry s="0" x="102" y="-50" hdg="1.5707963267948966" length="100"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="20" b="0" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road></OpenDRIVE>"""
"""A road that climbs by 5 % from 3 m, and a bridge over it at 20 m that runs north at x = 102 to 106 m."""


@pytest.fixture
def surface(tmp_path: Path) -> MapSurface:
    (tmp_path / "hill.xodr").write_text(HILL)
    return MapSurface(load_map(tmp_path / "hill.xodr"))


def world(yaw_rad: FloatArray, speed_mps: FloatArray, **columns: object) -> World:
    n = len(yaw_rad)
    boxes = Boxes(np.column_stack((10.0 * np.arange(n), np.full(n, -2.0))), np.full((n, 2), 1.0), yaw_rad)
    values: dict[str, object] = {
        "height_m": np.full(n, 1.5),
        "object_id": np.arange(n),
        "category": np.full(n, "car"),
        "exists": np.full(n, True),
        "seen": np.full(n, True),
    } | columns
    return World(1.0, boxes, speed_mps, **values)  # type: ignore[arg-type]


def test_velocities_are_along_the_headings_also_in_reverse() -> None:
    made = world(np.array([0.0, math.pi / 2, math.pi]), np.array([3.0, 2.0, -1.0]))
    assert made.velocity_mps == pytest.approx(np.array([[3.0, 0.0], [0.0, 2.0], [1.0, 0.0]]), abs=1e-12)
    assert len(made) == 3
    assert made.bottom_m.tolist() == [0.0, 0.0, 0.0]
    assert FlatGround(-2.0).elevation_m(np.zeros((2, 2)), np.zeros(2)).tolist() == [-2.0, -2.0]


def test_the_ground_is_the_road_s_surface(surface: MapSurface) -> None:
    points = np.array([[0.0, -1.0], [100.0, -2.0], [150.0, -3.9]])
    assert surface.elevation_m(points, np.zeros(3)) == pytest.approx([3.0, 8.0, 10.5])
    made = world(np.zeros(3), np.zeros(3), surface=surface)
    assert made.bottom_m == pytest.approx([3.0, 3.5, 4.0])


def test_beside_the_road_the_ground_goes_on_as_at_its_edge(surface: MapSurface) -> None:
    points = np.array([[40.0, 30.0], [40.0, -30.0]])
    assert surface.elevation_m(points, np.zeros(2)) == pytest.approx([5.0, 5.0])
    assert surface.elevation_m(np.zeros((0, 2)), np.zeros(0)).shape == (0,)


def test_where_roads_cross_the_one_counts_along_which_somebody_heads(surface: MapSurface) -> None:
    points = np.array([[104.0, -2.0]] * 2)
    assert surface.elevation_m(points, np.array([0.0, math.pi / 2])) == pytest.approx([8.2, 20.0])


@pytest.mark.parametrize(
    "wrong",
    [
        {"height_m": [1.0]},
        {"height_m": [1.0, 0.0]},
        {"height_m": [1.0, math.nan]},
        {"seen": [True, 2]},
        {"category": ["car"]},
    ],
)
def test_impossible_worlds_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ShapeError):
        world(np.zeros(2), np.zeros(2), **wrong)


def test_a_simulated_world_has_the_heights_and_numbers_of_the_scenario_s_entities() -> None:
    definition = load(shipped_scenario("crossing"), {})
    simulation = Simulation(definition, PHYSICAL, None)
    made = simulation._truth.world(0.0)
    others = [entity for entity in definition.entities if entity.name != "Ego"]
    assert made.height_m.tolist() == [entity.height_m for entity in others]
    assert made.object_id.tolist() == list(range(len(others)))
    assert made.category.tolist() == [entity.category for entity in others]
    assert made.exists.all()
    assert np.isfinite(made.bottom_m).all()
    assert made.velocity_mps.shape == (len(others), 2)
