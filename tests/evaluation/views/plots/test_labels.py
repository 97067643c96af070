"""Placing texts beside points."""

from typing import Any

import numpy as np
import pytest

from evaluation.views.plots.labels import place_labels
from evaluation.views.plots.style import new_figure
from tests.figures import text_faults


@pytest.fixture
def axes() -> Any:
    axes = new_figure(4.0).add_subplot()
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, 10.0)
    return axes


def test_texts_of_one_point_do_not_cover_each_other(look: Any, axes: Any) -> None:
    place_labels(
        axes, [(5.0, 5.0, name) for name in ("north", "east", "south", "west")], [], offsets_pt=(8, 16)
    )
    assert len(look.by_gid(axes.figure, "label")) == 4
    assert text_faults(axes.figure) == []


def test_text_keeps_clear_of_a_line(look: Any, axes: Any) -> None:
    place_labels(axes, [(5.0, 5.0, "text")], [], offsets_pt=(8,))
    (free,) = look.by_gid(axes.figure, "label")
    assert free.xyann[1] > 0.0
    free.remove()
    place_labels(axes, [(5.0, 5.0, "text")], [((0.0, 5.3), (10.0, 5.3))], offsets_pt=(8,))
    (moved,) = look.by_gid(axes.figure, "label")
    assert moved.xyann[1] < 0.0


def test_text_stays_within_the_axes(look: Any, axes: Any) -> None:
    place_labels(axes, [(9.9, 9.9, "a rather long text")], [], offsets_pt=(8,))
    (label,) = look.by_gid(axes.figure, "label")
    box = label.get_window_extent()
    assert box.x1 <= axes.bbox.x1
    assert box.y1 <= axes.bbox.y1


def test_repeated_text_is_left_out_where_there_is_no_room(look: Any, axes: Any) -> None:
    crowd = [(5.0 + 0.01 * step, 5.0, "again") for step in range(20)]
    place_labels(axes, [*crowd, (1.0, 1.0, "again"), (5.0, 5.0, "other")], [], offsets_pt=(8, 16))
    texts = [label.get_text() for label in look.by_gid(axes.figure, "label")]
    assert "other" in texts
    assert 2 <= texts.count("again") < 20
    assert text_faults(axes.figure) == []


@pytest.mark.parametrize("leaders", [False, True])
def test_text_away_from_its_point_gets_a_leader(look: Any, axes: Any, leaders: bool) -> None:
    texts = [(5.0, 5.0, name) for name in ("one", "two", "three", "four", "five", "six", "seven")]
    place_labels(axes, texts, [], offsets_pt=(8, 16), leaders=leaders)
    lines = look.points_of(axes, "leader")
    assert bool(lines) == leaders
    assert all(np.allclose(line[0], (5.0, 5.0)) for line in lines)


def test_nothing_to_write(look: Any, axes: Any) -> None:
    place_labels(axes, [], [], offsets_pt=(8,))
    assert look.by_gid(axes.figure, "label") == []
