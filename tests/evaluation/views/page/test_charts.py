"""Figures of the page as plotly's specifications."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from evaluation.views.page.charts import _DIAGRAM_PX, _NAME_PX, _events
from evaluation.views.plots.temporal import LAYER_HEIGHTS, event_text

END_S = 10.0
NAMES = ("unexpected", "follow_path", "forecasted_pedestrian", "end_unexpected", "free_lane")


def gaps_of(spec: dict[str, list[str]]) -> list[tuple[float, float, float]]:
    """Gap between layers, begin and end of each name that is shown; s."""
    shown = []
    for x, y, text, place in zip(spec["x"], spec["y"], spec["text"], spec["textposition"], strict=True):
        if text:
            side, way = place.split()
            width = _NAME_PX * len(text) * 1.04 * END_S / _DIAGRAM_PX
            begin = float(x) if way == "right" else float(x) - width
            shown.append((float(y) + (0.5 if side == "top" else -0.5), begin, begin + width))
    return shown


@given(
    st.lists(
        st.tuples(st.floats(0.0, END_S), st.sampled_from(sorted(LAYER_HEIGHTS)), st.sampled_from(NAMES)),
        max_size=12,
    )
)
def test_names_of_events_never_overlap_and_each_is_under_the_pointer(
    events: list[tuple[float, str, str]],
) -> None:
    spec = _events(sorted(events), END_S)
    for (gap, begin, end), (other, low, high) in itertools.combinations(gaps_of(spec), 2):
        assert gap != other or end <= low + 1e-2 or high <= begin + 1e-2
    assert spec["hovertext"] == [event_text(name) for _, _, name in sorted(events)]


def test_names_are_shown_where_there_is_room() -> None:
    spec = _events([(2.6, "unexpected", "unexpected"), (3.0, "unexpected", "end_unexpected")], END_S)
    assert spec["text"] == ["unexpected", "end_unexpected"]
    assert spec["textposition"] == ["top right", "bottom right"]
