"""Temporal diagram: events, states and causes at their times, speed with stop and contact."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from evaluation.views.plots import temporal_diagram
from evaluation.views.plots.fitting import SMALLEST_PT
from tests.figures import text_faults


def with_events(log: pd.DataFrame, events: list[tuple[float, str, str]]) -> pd.DataFrame:
    """A log and events of time, layer and name."""
    rows = [{"time_s": t, "kind": "event", "category": layer, "label": name} for t, layer, name in events]
    return pd.DataFrame([*log.to_dict("records"), *rows], columns=log.columns)


def paper_events(forecast_s: float, collision_s: float, end_s: float | None) -> list[tuple[float, str, str]]:
    events = [
        (0.0, "start", "run_start"),
        (0.0, "selector", "follow_path"),
        (forecast_s, "unexpected", "forecasted_pedestrian"),
        (forecast_s, "selector", "unexpected"),
        (collision_s, "monitors", "collision"),
        (collision_s, "unexpected", "predicted_collision"),
    ]
    if end_s is not None:
        events += [
            (end_s, "monitors", "free_lane"),
            (end_s, "unexpected", "end_unexpected"),
            (end_s, "selector", "follow_path"),
        ]
    return events


@pytest.mark.parametrize(
    ("forecast_s", "collision_s", "end_s"),
    [(1.0, 2.0, 2.7), (1.95, 2.0, 2.7), (2.0, 2.0, 2.7), (0.0, 0.05, 0.1), (2.6, 2.7, 2.7), (1.2, 2.0, None)],
)
def test_no_text_stands_over_another(
    forecast_s: float, collision_s: float, end_s: float | None, look: Any, braking_log: Any
) -> None:
    log, _ = braking_log(40.0)
    figure = temporal_diagram(with_events(log, paper_events(forecast_s, collision_s, end_s)), "CPNA")
    assert text_faults(figure) == []
    assert look.labels_off_page(figure) == []
    written = look.texts(figure)
    for name in {event[2] for event in paper_events(forecast_s, collision_s, end_s)}:
        assert ("collision predicted" if name == "collision" else name) in written


def test_draws_events_states_and_causes_at_their_times(look: Any, braking_log: Any) -> None:
    log, t0 = braking_log(40.0)
    figure = temporal_diagram(with_events(log, paper_events(1.0, 2.0, 2.7)))
    assert len(look.by_gid(figure, "event")) == 9
    arrows = {(a.xyann, a.xy) for a in look.by_gid(figure, "cause")}
    assert arrows == {
        ((1.0, 2.0), (1.0, 1.0)),
        ((2.0, 3.0), (2.0, 2.0)),
        ((2.7, 3.0), (2.7, 2.0)),
        ((2.7, 2.0), (2.7, 1.0)),
    }
    spans = {tuple(np.round(line.get_xdata(), 6)) for line in look.by_gid(figure, "state")}
    assert {(1.0, 2.0), (2.0, 2.7), (0.0, 1.0), (1.0, 2.7)} <= spans
    (stop,) = look.by_gid(figure, "stop")
    assert stop.get_xdata()[0] == pytest.approx(t0)
    assert look.by_gid(figure, "contact") == []


def test_finds_the_contact_in_the_log(look: Any, braking_log: Any) -> None:
    log, t0 = braking_log(60.0, 44.3)
    figure = temporal_diagram(with_events(log, paper_events(1.9, 2.0, None)), "contact")
    (contact,) = look.by_gid(figure, "contact")
    assert contact.get_xdata()[0] == pytest.approx(t0)
    assert contact.get_ydata()[0] == pytest.approx(44.3 / 3.6)
    assert "contact 44.3 km/h" in look.texts(figure)
    assert look.by_gid(figure, "stop") == []
    assert text_faults(figure) == []


def test_shares_time_and_names_units(look: Any, braking_log: Any) -> None:
    log, _ = braking_log(30.0)
    figure = temporal_diagram(with_events(log, paper_events(1.0, 2.0, 2.5)))
    above, below = figure.axes
    assert above.get_xlim() == below.get_xlim()
    labels = look.texts(figure)
    for label in ("Time (s)", "Ego speed (m/s)", "Ego speed (km/h)"):
        assert label in labels
    assert [text.get_text() for text in above.get_yticklabels()] == [
        "Monitors",
        "Unexpected",
        "Selector",
        "Start",
    ]


def test_survives_flickering_events(look: Any, braking_log: Any) -> None:
    log, _ = braking_log(40.0)
    times = 1.0 + 0.05 * np.arange(25)
    events = [(0.0, "start", "run_start"), (0.0, "selector", "follow_path")]
    for time in times.tolist():
        events += [(time, "monitors", "collision"), (time, "unexpected", "predicted_collision")]
    figure = temporal_diagram(with_events(log, events), "flicker")
    assert text_faults(figure) == []
    assert len(look.by_gid(figure, "event")) == 2 + 2 * len(times)


def test_without_events_or_ego(look: Any, braking_log: Any, empty_log: pd.DataFrame) -> None:
    assert look.by_gid(temporal_diagram(empty_log), "event") == []
    log, _ = braking_log(10.0)
    assert look.by_gid(temporal_diagram(log), "event") == []


@pytest.mark.parametrize("count", [1, 7, 30])
@pytest.mark.parametrize("spread_s", [0.0, 0.4, 4.0])
def test_however_many_events_fall_together(braking_log: Any, count: int, spread_s: float) -> None:
    log, _ = braking_log(50.0)
    names = [
        ("monitors", "collision"), ("unexpected", "forecasted_pedestrian"), ("selector", "unexpected"),
        ("unexpected", "predicted_collision"), ("monitors", "free_lane"), ("unexpected", "end_unexpected"),
        ("selector", "follow_path"),
    ]  # fmt: skip
    events = [(1.0 + spread_s * k / count, *names[k % len(names)]) for k in range(count)]
    title = "my_package.monitored.areas:variant_00_wide, a scenario with a long name, 50 km/h, preset paper"
    figure = temporal_diagram(with_events(log, events), title)
    assert text_faults(figure) == []
    assert figure.axes[0].title.get_fontsize() >= SMALLEST_PT
