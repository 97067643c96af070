"""Bird's-eye view and map: what is drawn where."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from evaluation.results.files import ResultsError
from evaluation.views.plots import birdseye, map_picture
from evaluation.views.plots.fitting import SMALLEST_PT
from evaluation.views.plots.ground import AREA_COLOURS
from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from tests.figures import text_faults


def test_birdseye_turns_the_scene_into_the_ego_frame(
    look: Any, road: Any, scene_log: pd.DataFrame, scene_areas: list[Any]
) -> None:
    figure = birdseye(road, scene_log, 1.5, scene_areas)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Ahead of ego (m)", "Left of ego (m)")
    assert axes.get_aspect() == 1.0
    (ego,) = look.by_gid(figure, "ego")
    corners = ego.get_paths()[0].vertices[:4]
    assert np.allclose(corners, [(2.2, 0.9), (-2.2, 0.9), (-2.2, -0.9), (2.2, -0.9)])
    (threat,) = look.by_gid(figure, "track, threat")
    assert np.allclose(threat.get_paths()[0].vertices[:4].mean(axis=0), (20.0, -2.6))
    (dropped,) = look.by_gid(figure, "detection dropped")
    assert len(dropped.get_paths()) == 3
    assert len(look.by_gid(figure, "forecast")) == 2 * 4
    assert len(look.by_gid(figure, "velocity")) == 3


def test_birdseye_draws_only_lanes_in_view(
    look: Any, road: Any, scene_log: pd.DataFrame, scene_areas: list[Any]
) -> None:
    figure = birdseye(road, scene_log, 1.5, scene_areas)
    (driving,) = look.by_gid(figure, "driving lane")
    assert len(driving.get_paths()) == 2
    assert look.by_gid(figure, "parking lane") == []
    assert len(look.by_gid(figure, "crosswalk")) == 1


def test_birdseye_texts_do_not_cover_each_other(
    look: Any, road: Any, scene_log: pd.DataFrame, scene_areas: list[Any]
) -> None:
    figure = birdseye(road, scene_log, 1.5, scene_areas)
    assert text_faults(figure) == []
    assert {"pedestrian 3", "car 4", "car 5"} <= set(look.texts(figure))
    legend = look.legend(figure)
    for name in ("driving lane", "crosswalk", "monitored: vru margin", "track, threat", "detection dropped"):
        assert name in legend


def test_birdseye_shows_the_nearest_frame(road: Any, scene_log: pd.DataFrame) -> None:
    figure = birdseye(road, scene_log, 1.52, [])
    assert figure.axes[0].get_title().startswith("t = 1.50 s")


def test_birdseye_without_ego_says_so(road: Any, empty_log: pd.DataFrame) -> None:
    with pytest.raises(ResultsError, match="without rows of kind 'ego'"):
        birdseye(road, empty_log, 0.0, [])


def test_birdseye_of_a_frame_with_nothing_but_the_ego(look: Any, road: Any, braking_log: Any) -> None:
    log, _ = braking_log(10.0)
    figure = birdseye(road, log, 0.0, [])
    assert len(look.by_gid(figure, "ego")) == 1


def test_map_picture_shows_the_whole_map(look: Any, road: Any) -> None:
    figure = map_picture(road, title="Map")
    (axes,) = figure.axes
    legend = look.legend(figure)
    assert legend[:3] == ["driving lane", "sidewalk lane", "parking lane"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, east (m)", "y, north (m)")
    assert axes.get_ylim()[1] > 850.0
    assert text_faults(figure) == []


def test_map_picture_shows_the_ego_at_its_pose(look: Any, road: Any) -> None:
    figure = map_picture(road, ego_pose=(100.0, 50.0, 0.3))
    (ego,) = look.by_gid(figure, "ego")
    corners = ego.get_paths()[0].vertices[:4]
    assert np.allclose(corners.mean(axis=0), (100.0, 50.0))
    length, width = np.linalg.norm(np.diff(corners[:3], axis=0), axis=1)
    assert width == pytest.approx(0.41 * length)


def test_map_picture_shows_the_surroundings_of_the_areas(
    look: Any, road: Any, scene_areas: list[Any]
) -> None:
    figure = map_picture(road, scene_areas)
    (axes,) = figure.axes
    assert -10.0 < axes.get_xlim()[0] < axes.get_xlim()[1] < 80.0
    assert look.by_gid(figure, "monitored: current")


def test_a_long_title_gets_lines_of_its_own(
    road: Any, scene_log: pd.DataFrame, scene_areas: list[Any]
) -> None:
    title = "my_package.monitored.areas:variant_00_wide, " * 4
    everything = [(role, ring + 0.3 * k) for k, role in enumerate(AREA_COLOURS) for _, ring in scene_areas]
    for figure in (
        birdseye(road, scene_log, 1.5, everything, title),
        map_picture(road, everything, (20.0, 5.0, 0.3), title),
    ):
        assert text_faults(figure) == []
        assert figure.axes[0].title.get_fontsize() >= SMALLEST_PT


def test_ids_are_written_where_they_fit() -> None:
    network = load_map(shipped_map("urban_intersection"))
    whole = map_picture(network, ids=True)
    (axes,) = whole.axes
    names = [text.get_text() for text in axes.texts if text.get_gid() == "id"]
    long_roads = [road_id for road_id, road in network.roads.items() if road.length_m > 100.0]
    assert set(long_roads) <= set(names)  # lanes of 3.5 m on 440 m are narrower than a text
    area_m = np.array([[-60.0, 0.0], [-30.0, 0.0], [-30.0, 8.0], [-60.0, 8.0]])
    around = map_picture(network, [("current", area_m)], ids=True)
    (axes,) = around.axes
    assert {"1", "-1", "2", "-2"} <= {text.get_text() for text in axes.texts if text.get_gid() == "id"}
    for figure in (whole, around):
        (axes,) = figure.axes
        boxes = [text.get_window_extent() for text in axes.texts if text.get_gid() == "id"]
        assert len(boxes) > 3
        digit_px = min(box.width for box in boxes)
        apart = [box.padded(0.8 * digit_px, 0.0) for box in boxes]  # side by side they would read as one
        assert not any(a.overlaps(b) for k, a in enumerate(apart) for b in boxes[:k])
