"""Monitored areas that overlap are seen as one layer: one colour at every place."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from evaluation.views.plots.ground import AREA_COLOURS, area_paths, area_style, draw_areas
from evaluation.views.plots.style import new_figure


def box(left: float, low: float, right: float, high: float) -> Any:
    return np.array([(left, low), (right, low), (right, high), (left, high)])


def roles_at(areas: list[tuple[str, Any]], x: float, y: float) -> list[str]:
    """Roles whose path covers a point."""
    return [role for role, path in area_paths(areas).items() if path.contains_point((x, y))]


def test_where_roles_overlap_the_first_of_the_palette_is_seen() -> None:
    crossing = [
        ("vru_margin", box(-4, -4, 4, 4)),
        ("cross", box(-1, -9, 1, 9)),
        ("current", box(-9, -1, 9, 1)),
    ]
    for areas in itertools.permutations(crossing):
        assert roles_at(list(areas), 0.0, 0.0) == ["current"]
        assert roles_at(list(areas), 0.0, 3.0) == ["cross"]
        assert roles_at(list(areas), 3.0, 3.0) == ["vru_margin"]
        assert roles_at(list(areas), 8.0, 8.0) == []


def test_a_hole_stays_open() -> None:
    """A lane inside a margin leaves a hole in it, whose outline runs the other way round."""
    paths = area_paths([("vru_margin", box(0, 0, 9, 9)), ("current", box(3, 3, 6, 6))])
    areas = {role: [signed_area(ring) for ring in path.to_polygons()] for role, path in paths.items()}
    assert areas == {"current": [9.0], "vru_margin": [81.0, -9.0]}


def signed_area(ring: Any) -> float:
    """Area of a closed ring, positive where it runs counter-clockwise (shoelace formula)."""
    x, y = ring[:-1].T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def test_areas_of_one_role_are_one_layer() -> None:
    areas = [("cross", box(k, -3.0, k + 5.0, 3.0)) for k in range(4)]
    [(role, path)] = area_paths(areas).items()
    assert role == "cross"
    # the rectangle from 0 to 8, closed
    assert sorted({tuple(point) for point in path.vertices.tolist()} - {(0.0, 0.0)})[0] == (0.0, -3.0)
    assert path.get_extents().bounds == (0.0, -3.0, 8.0, 6.0)


def test_a_role_that_is_covered_is_left_out() -> None:
    assert set(area_paths([("current", box(0, 0, 9, 9)), ("merge", box(1, 1, 2, 2))])) == {"current"}


@pytest.mark.parametrize("count", [1, 6])
def test_a_place_has_the_same_colour_however_many_lanes_cross_there(count: int) -> None:
    """Six lanes of an intersection on one another, each turned a little: no brown in the middle."""
    angles = np.linspace(0.0, 1.0, count)
    turns = [np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in angles]
    figure = new_figure(3.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-2, 2), ylim=(-1.2, 1.2))
    axes.set_axis_off()
    draw_areas(axes, [("cross", box(-9, -1, 9, 1) @ turn) for turn in turns], (0.0, 0.0, 0.0))
    figure.canvas.draw()
    image: Any = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
    middle = image[image.shape[0] // 2, image.shape[1] // 2, :3]
    colour, alpha = area_style("cross")["facecolor"]
    wanted = 255 * (alpha * np.array(to_rgba(colour)[:3]) + 1 - alpha)
    assert np.abs(middle - wanted).max() <= 1.5


def test_every_role_has_a_style_with_an_edge_stronger_than_its_fill() -> None:
    for role in (*AREA_COLOURS, "of a plug-in"):
        style = area_style(role)
        assert style["edgecolor"][1] > style["facecolor"][1]
