"""Pictures: what is drawn where, for synthetic runs whose every number is known."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from evaluation import plots
from evaluation.results import LOG_COLUMNS, ResultsError, RunRow

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

BRAKES_MPS2 = 14.5
FRAME_S = 0.05
SPEEDS_KMH = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
FLAG_S = 2.0


@dataclass(frozen=True)
class Lanes:
    lane_type: tuple[str, ...]
    s_start_m: tuple[float, ...]
    s_end_m: tuple[float, ...]


@dataclass(frozen=True)
class Crosswalk:
    polygon: Any


@dataclass(eq=False)
class StraightRoad:
    """A straight road turned by its angle: lane, lane, sidewalk, and a lane far away."""

    yaw_rad: float = 0.3
    lanes: Lanes = field(
        default_factory=lambda: Lanes(
            ("driving", "driving", "sidewalk", "none", "parking"), (0.0,) * 5, (300.0,) * 4 + (5.0,)
        )
    )
    left_m: tuple[float, ...] = (0.0, 3.5, -3.5, 0.0, 900.0)
    right_m: tuple[float, ...] = (-3.5, 0.0, -6.0, 0.0, 897.0)

    def turned(self, points: Any) -> Any:
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.asarray(points, float) @ np.array([[cos, sin], [-sin, cos]])

    def lane_polygon(self, lane: int, s0_m: float, s1_m: float, /) -> Any:
        left, right = self.left_m[lane], self.right_m[lane]
        return self.turned([(s0_m, right), (s1_m, right), (s1_m, left), (s0_m, left)])

    @property
    def crosswalks(self) -> tuple[Crosswalk, ...]:
        return (Crosswalk(self.turned([(45, -6), (49, -6), (49, 3.5), (45, 3.5)])),)


def frame(rows: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(LOG_COLUMNS))


def braking_log(v_test_kmh: float, v_impact_kmh: float = 0.0) -> tuple[pd.DataFrame, float]:
    """Ego along the road that brakes fully at the flag, down to rest or to the impact; log and T0."""
    speed, final = v_test_kmh / 3.6, v_impact_kmh / 3.6
    t0 = FLAG_S + (speed - final) / BRAKES_MPS2
    times = np.unique(np.append(np.arange(0.0, t0, FRAME_S), t0))
    if v_impact_kmh == 0.0:
        times = np.append(times, t0 + FRAME_S * np.arange(1, 8))
    braking = np.clip(times - FLAG_S, 0.0, None)
    speeds = np.maximum(speed - BRAKES_MPS2 * braking, final)
    along = np.concatenate([[0.0], np.cumsum(np.diff(times) * (speeds[1:] + speeds[:-1]) / 2)])
    road = StraightRoad()
    x, y = road.turned(np.column_stack([along, np.full(len(along), -1.75)])).T
    rows = [
        {
            "time_s": t,
            "kind": "ego",
            "x_m": a,
            "y_m": b,
            "yaw_rad": road.yaw_rad,
            "length_m": 4.4,
            "width_m": 1.8,
            "speed_mps": v,
        }
        for t, a, b, v in zip(times, x, y, speeds, strict=True)
    ]
    touch = along[times == t0][0] + 2.2 + 0.3 + (0.0 if v_impact_kmh else 2.0)
    tx, ty = road.turned([(touch, -1.75)])[0]
    rows += [
        {
            "time_s": t,
            "kind": "actor",
            "label": "target",
            "category": "pedestrian",
            "x_m": tx,
            "y_m": ty,
            "yaw_rad": road.yaw_rad + math.pi / 2,
            "length_m": 0.6,
            "width_m": 0.6,
            "speed_mps": 0.0,
        }
        for t in times
    ]
    return frame(rows), t0


def with_events(log: pd.DataFrame, events: list[tuple[float, str, str]]) -> pd.DataFrame:
    rows = [{"time_s": t, "kind": "event", "category": layer, "label": name} for t, layer, name in events]
    return frame([*log.to_dict("records"), *rows])


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


def run_row(strategy: str, v_test: float, v_impact: float, t0: float, **changes: Any) -> RunRow:
    values: dict[str, Any] = {
        "scenario": "cpna",
        "strategy": strategy,
        "preset": "paper",
        "weather": "clear",
        "adversaries": "none",
        "seed": 1,
        "v_test_kmh": v_test,
        "v_impact_kmh": v_impact,
        "collided": v_impact > 0.0,
        "score": 1.0,
        "score_max": 1.0,
        "flag_time_s": FLAG_S,
        "flag_distance_m": 12.0,
        "stop_gap_m": None if v_impact else 2.0,
        "contact_time_s": t0 if v_impact else None,
        "t0_s": t0,
        "false_stop": False,
        "log": f"{strategy}-{v_test:g}",
    }
    return RunRow(**{**values, **changes})


def table_of(rows: list[RunRow]) -> pd.DataFrame:
    names = list(RunRow.__dataclass_fields__)
    return pd.DataFrame([[getattr(row, name) for name in names] for row in rows], columns=names)


def sweep() -> tuple[pd.DataFrame, dict[str, pd.DataFrame]]:
    """Two strategies at six speeds; the rectangle hits at 50 and 60 km/h."""
    rows, logs = [], {}
    for strategy, speed in itertools.product(("map", "rectangular"), SPEEDS_KMH):
        impact = {50.0: 23.0, 60.0: 44.3}.get(speed, 0.0) if strategy == "rectangular" else 0.0
        log, t0 = braking_log(speed, impact)
        rows.append(run_row(strategy, speed, impact, t0))
        logs[f"{strategy}-{speed:g}"] = log
    return table_of(rows), logs


def scene_log() -> pd.DataFrame:
    """One frame: ego, a threat, a standing and a moving track, a dropped pedestrian, forecasts."""
    log, _ = braking_log(40.0)
    time = float(log.loc[log["kind"] == "ego", "time_s"].iloc[30])
    road = StraightRoad()
    ego = log[(log["kind"] == "ego") & (log["time_s"] == time)].iloc[0]
    rows: list[dict[str, Any]] = []

    def put(kind: str, ahead: float, left: float, **more: Any) -> None:
        cos, sin = math.cos(road.yaw_rad), math.sin(road.yaw_rad)
        x, y = ego["x_m"] + ahead * cos - left * sin, ego["y_m"] + ahead * sin + left * cos
        rows.append({"time_s": time, "kind": kind, "x_m": x, "y_m": y, "yaw_rad": road.yaw_rad, **more})

    person, car = {"length_m": 0.6, "width_m": 0.6}, {"length_m": 4.5, "width_m": 1.8}
    for ahead, left, number, state, speed, turn in (
        (20.0, -2.6, 3, "threat", 1.4, 1.5),
        (21.5, -2.9, 7, "dynamic", 1.2, 1.5),
        (30.0, 3.6, 4, "dynamic", 8.0, math.pi),
        (11.0, 3.4, 5, "static", 0.0, 0.0),
    ):
        size, category = (person, "pedestrian") if number in (3, 7) else (car, "car")
        more = {"category": category, "yaw_rad": road.yaw_rad + turn}
        put("detection", ahead, left, label="kept", **size, **more)
        put("track", ahead, left, label=state, id=number, speed_mps=speed, **size, **more)
        for horizon in (0.5, 1.0, 1.5, 2.0):
            reach = speed * horizon
            there = (ahead + reach * math.cos(turn), left + reach * math.sin(turn))
            put("forecast", *there, id=number, horizon_s=horizon, **more)
    for ahead in (8.0, 16.0, 24.0):
        put("detection", ahead, -5.0, label="dropped", category="pedestrian", **person)
    for horizon in (0.5, 1.0, 1.5, 2.0):
        put("ego_forecast", horizon * 40 / 3.6, 0.0, horizon_s=horizon)
    return frame([*log.to_dict("records"), *rows])


def scene_areas() -> list[tuple[str, Any]]:
    road = StraightRoad()
    outlines = {
        "current": [(12, -3.5), (60, -3.5), (60, 0), (12, 0)],
        "left": [(12, 0), (60, 0), (60, 3.5), (12, 3.5)],
        "vru_margin": [(12, -4.5), (60, -4.5), (60, -3.5), (12, -3.5)],
    }
    return [(role, road.turned(outline)) for role, outline in outlines.items()]


def by_gid(figure: Figure, gid: str) -> list[Any]:
    return figure.findobj(lambda artist: artist.get_gid() == gid)


def points_of(axes: Any, gid: str) -> list[Any]:
    """(P, 2) points of each line of that name."""
    return [np.asarray(line.get_xydata(), dtype=float) for line in axes.lines if line.get_gid() == gid]


def texts_of(figure: Figure) -> list[str]:
    from matplotlib.text import Text

    return [artist.get_text() for artist in figure.findobj(Text) if isinstance(artist, Text)]


def in_view(tick: Any) -> bool:
    """Whether a tick lies within the limits of its axis; others exist but are not drawn."""
    from matplotlib.axis import XTick

    low, high = sorted(tick.axes.get_xlim() if isinstance(tick, XTick) else tick.axes.get_ylim())
    return bool(low <= tick.get_loc() <= high)


def overlapping_texts(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of visible texts whose boxes on paper share area."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    ticks = [
        tick for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for tick in axis.get_major_ticks()
    ]
    outside = {id(tick.label1) for tick in ticks if not in_view(tick)}
    boxes = [
        (artist.get_text(), Text.get_window_extent(artist, canvas.get_renderer()))
        for artist in figure.findobj(Text)
        if isinstance(artist, Text)
        and artist.get_visible()
        and artist.get_text().strip()
        and id(artist) not in outside
    ]
    page = figure.bbox
    shown = [one for one in boxes if page.overlaps(one[1])]
    return [
        (a, b)
        for (a, one), (b, two) in itertools.combinations(shown, 2)
        if min(one.x1, two.x1) - max(one.x0, two.x0) > 0.5 and min(one.y1, two.y1) - max(one.y0, two.y0) > 0.5
    ]


def texts_off_page(figure: Figure) -> list[str]:
    from matplotlib.text import Text

    page = figure.bbox
    return [
        artist.get_text()
        for artist in by_gid(figure, "label")
        if not (
            page.x0 <= (box := Text.get_window_extent(artist)).x0
            and box.x1 <= page.x1
            and page.y0 <= box.y0
            and box.y1 <= page.y1
        )
    ]


@pytest.mark.parametrize(
    ("forecast_s", "collision_s", "end_s"),
    [(1.0, 2.0, 2.7), (1.95, 2.0, 2.7), (2.0, 2.0, 2.7), (0.0, 0.05, 0.1), (2.6, 2.7, 2.7), (1.2, 2.0, None)],
)
def test_temporal_diagram_has_no_text_over_another(
    forecast_s: float, collision_s: float, end_s: float | None
) -> None:
    log, _ = braking_log(40.0)
    figure = plots.temporal_diagram(with_events(log, paper_events(forecast_s, collision_s, end_s)), "CPNA")
    assert overlapping_texts(figure) == []
    assert texts_off_page(figure) == []
    written = texts_of(figure)
    for name in {event[2] for event in paper_events(forecast_s, collision_s, end_s)}:
        assert name in written


def test_temporal_diagram_draws_events_states_and_causes_at_their_times() -> None:
    log, t0 = braking_log(40.0)
    figure = plots.temporal_diagram(with_events(log, paper_events(1.0, 2.0, 2.7)))
    assert len(by_gid(figure, "event")) == 9
    arrows = {(a.xyann, a.xy) for a in by_gid(figure, "cause")}
    assert arrows == {
        ((1.0, 2.0), (1.0, 1.0)),
        ((2.0, 3.0), (2.0, 2.0)),
        ((2.7, 3.0), (2.7, 2.0)),
        ((2.7, 2.0), (2.7, 1.0)),
    }
    spans = {tuple(np.round(line.get_xdata(), 6)) for line in by_gid(figure, "state")}
    assert {(1.0, 2.0), (2.0, 2.7), (0.0, 1.0), (1.0, 2.7)} <= spans
    (stop,) = by_gid(figure, "stop")
    assert stop.get_xdata()[0] == pytest.approx(t0)
    assert by_gid(figure, "contact") == []


def test_temporal_diagram_finds_the_contact_in_the_log() -> None:
    log, t0 = braking_log(60.0, 44.3)
    figure = plots.temporal_diagram(with_events(log, paper_events(1.9, 2.0, None)), "contact")
    (contact,) = by_gid(figure, "contact")
    assert contact.get_xdata()[0] == pytest.approx(t0)
    assert contact.get_ydata()[0] == pytest.approx(44.3 / 3.6)
    assert "contact 44.3 km/h" in texts_of(figure)
    assert by_gid(figure, "stop") == []
    assert overlapping_texts(figure) == []


def test_temporal_diagram_takes_a_given_contact_time() -> None:
    log, _ = braking_log(60.0)
    figure = plots.temporal_diagram(log, contact_time_s=1.0)
    assert by_gid(figure, "contact")[0].get_xdata()[0] == 1.0


def test_temporal_diagram_shares_time_and_names_units() -> None:
    log, _ = braking_log(30.0)
    figure = plots.temporal_diagram(with_events(log, paper_events(1.0, 2.0, 2.5)))
    above, below = figure.axes
    assert above.get_xlim() == below.get_xlim()
    labels = texts_of(figure)
    for label in ("Time (s)", "Ego speed (m/s)", "Ego speed (km/h)"):
        assert label in labels
    assert [text.get_text() for text in above.get_yticklabels()] == [
        "Monitors",
        "Unexpected",
        "Selector",
        "Start",
    ]


def test_temporal_diagram_survives_flickering_events() -> None:
    log, _ = braking_log(40.0)
    times = 1.0 + 0.05 * np.arange(25)
    events = [(0.0, "start", "run_start"), (0.0, "selector", "follow_path")]
    for time in times.tolist():
        events += [(time, "monitors", "collision"), (time, "unexpected", "predicted_collision")]
    figure = plots.temporal_diagram(with_events(log, events), "flicker")
    assert overlapping_texts(figure) == []
    assert len(by_gid(figure, "event")) == 2 + 2 * len(times)


def test_temporal_diagram_without_events_or_ego() -> None:
    assert by_gid(plots.temporal_diagram(frame([])), "event") == []
    log, _ = braking_log(10.0)
    assert by_gid(plots.temporal_diagram(log), "event") == []


def test_speed_curves_one_panel_per_strategy_and_curve_per_speed() -> None:
    runs, logs = sweep()
    figure = plots.speed_curves(runs, logs)
    first, second = figure.axes
    assert [first.get_title(), second.get_title()] == ["(a) rectangular", "(b) map"]
    assert len(by_gid(figure, "curve")) == 2 * len(SPEEDS_KMH)
    assert first.get_ylim() == second.get_ylim()
    assert first.get_xlabel() == "Time to T0 (s)"
    assert first.get_ylabel() == "Vehicle speed (km/h)"
    assert overlapping_texts(figure) == []
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == [*(f"{speed:g} km/h" for speed in SPEEDS_KMH), "collision flag", "contact"]


def test_speed_curves_end_at_the_impact_speed_with_a_circle() -> None:
    runs, logs = sweep()
    rectangular, by_map = plots.speed_curves(runs, logs).axes
    ends = [[tuple(curve[-1]) for curve in points_of(axes, "curve")] for axes in (rectangular, by_map)]
    assert ends == [[(0.0, v) for v in (0.0, 0.0, 0.0, 0.0, 23.0, 44.3)], [(0.0, 0.0)] * 6]
    assert [tuple(circle[0]) for circle in points_of(rectangular, "contact")] == [(0.0, 23.0), (0.0, 44.3)]
    assert points_of(by_map, "contact") == []


def test_speed_curves_mark_the_flag() -> None:
    runs, logs = sweep()
    axes = plots.speed_curves(runs, logs).axes[1]
    marks = [cross[0] for cross in points_of(axes, "flag")]
    expected = [(-speed / 3.6 / BRAKES_MPS2, speed) for speed in SPEEDS_KMH]
    assert np.allclose(marks, expected)


def test_speed_curves_reach_back_before_the_earliest_flag() -> None:
    runs, logs = sweep()
    assert plots.speed_curves(runs, logs).axes[0].get_xlim() == (-1.5, 0.0)
    early = runs.assign(flag_time_s=runs["t0_s"] - 2.0)
    assert plots.speed_curves(early, logs).axes[0].get_xlim() == pytest.approx((-2.3, 0.0))


def test_speed_curves_of_runs_with_others_get_their_own_panels() -> None:
    runs, logs = sweep()
    both = pd.concat([runs, runs.assign(adversaries="static")], ignore_index=True)
    titles = [axes.get_title() for axes in plots.speed_curves(both, logs).axes]
    assert titles == [
        "(a) rectangular, alone",
        "(b) map, alone",
        "(c) rectangular, with others",
        "(d) map, with others",
    ]


def test_speed_curves_of_three_strategies_in_two_weathers_stand_in_two_lines() -> None:
    runs, logs = sweep()
    everywhere = runs[runs["strategy"] == "map"].assign(strategy="all")
    dry = pd.concat([runs, everywhere], ignore_index=True)
    figure = plots.speed_curves(pd.concat([dry, dry.assign(weather="rain")], ignore_index=True), logs)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0] == "(a) rectangular, clear"
    assert titles[5] == "(f) all, rain"
    assert figure.axes[0].get_subplotspec().get_gridspec().get_geometry() == (2, 3)
    assert overlapping_texts(figure) == []


def test_speed_curves_of_no_runs_say_so() -> None:
    with pytest.raises(ResultsError, match="table of runs is empty"):
        plots.speed_curves(table_of([]), {})


def test_speed_curves_name_runs_without_t0() -> None:
    runs, logs = sweep()
    runs.loc[runs["v_test_kmh"] == 60.0, ["t0_s", "flag_time_s"]] = np.nan
    figure = plots.speed_curves(runs, logs)
    assert len(by_gid(figure, "curve")) == 10
    assert any(text.startswith("no stop or contact") and "60 km/h" in text for text in texts_of(figure))


def test_a_speed_keeps_its_colour() -> None:
    styles = [plots.speed_style(speed) for speed in (10, 20, 30, 40, 50, 60, 70, 80)]
    assert len({colour for colour, _ in styles}) == 8
    assert plots.speed_style(15)[0] == plots.speed_style(10)[0]
    assert plots.speed_style(15)[1] != plots.speed_style(10)[1]


def test_birdseye_turns_the_scene_into_the_ego_frame() -> None:
    figure = plots.birdseye(StraightRoad(), scene_log(), 1.5, scene_areas())
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Ahead of ego (m)", "Left of ego (m)")
    assert axes.get_aspect() == 1.0
    (ego,) = by_gid(figure, "ego")
    corners = ego.get_paths()[0].vertices[:4]
    assert np.allclose(corners, [(2.2, 0.9), (-2.2, 0.9), (-2.2, -0.9), (2.2, -0.9)])
    (threat,) = by_gid(figure, "track, threat")
    assert np.allclose(threat.get_paths()[0].vertices[:4].mean(axis=0), (20.0, -2.6))
    (dropped,) = by_gid(figure, "detection dropped")
    assert len(dropped.get_paths()) == 3
    assert len(by_gid(figure, "forecast")) == 3 * 4
    assert len(by_gid(figure, "velocity")) == 3


def test_birdseye_draws_only_lanes_in_view() -> None:
    figure = plots.birdseye(StraightRoad(), scene_log(), 1.5, scene_areas())
    (driving,) = by_gid(figure, "driving lane")
    assert len(driving.get_paths()) == 2
    assert by_gid(figure, "parking lane") == []
    assert len(by_gid(figure, "crosswalk")) == 1


def test_birdseye_texts_do_not_cover_each_other() -> None:
    figure = plots.birdseye(StraightRoad(), scene_log(), 1.5, scene_areas())
    assert overlapping_texts(figure) == []
    assert {"pedestrian 3", "car 4", "car 5"} <= set(texts_of(figure))
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    for name in ("driving lane", "crosswalk", "monitored: vru margin", "track, threat", "detection dropped"):
        assert name in legend


def test_birdseye_shows_the_nearest_frame() -> None:
    figure = plots.birdseye(StraightRoad(), scene_log(), 1.52, [])
    assert figure.axes[0].get_title().startswith("t = 1.50 s")


def test_birdseye_without_ego_says_so() -> None:
    with pytest.raises(ResultsError, match="without rows of kind 'ego'"):
        plots.birdseye(StraightRoad(), frame([]), 0.0, [])


def test_birdseye_of_a_frame_with_nothing_but_the_ego() -> None:
    log, _ = braking_log(10.0)
    figure = plots.birdseye(StraightRoad(), log, 0.0, [])
    assert len(by_gid(figure, "ego")) == 1


def test_map_picture_shows_the_whole_map() -> None:
    figure = plots.map_picture(StraightRoad(), title="Map")
    (axes,) = figure.axes
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[:3] == ["driving lane", "sidewalk lane", "parking lane"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, east (m)", "y, north (m)")
    assert axes.get_ylim()[1] > 850.0
    assert overlapping_texts(figure) == []


def test_map_picture_of_the_surroundings() -> None:
    x, y = StraightRoad().turned([(40, -1.75)])[0]
    figure = plots.map_picture(StraightRoad(), scene_areas(), (x, y, 0.3), half_size_m=25.0)
    (axes,) = figure.axes
    assert axes.get_xlim() == pytest.approx((x - 25.0, x + 25.0))
    assert len(by_gid(figure, "ego")) == 1


def test_map_picture_shows_the_surroundings_of_the_areas() -> None:
    figure = plots.map_picture(StraightRoad(), scene_areas())
    (axes,) = figure.axes
    assert -10.0 < axes.get_xlim()[0] < axes.get_xlim()[1] < 80.0
    assert by_gid(figure, "monitored: current")


def test_figures_are_saved(tmp_path: Path) -> None:
    runs, logs = sweep()
    figure = plots.speed_curves(runs, logs)
    figure.savefig(tmp_path / "curves.png")
    figure.savefig(tmp_path / "curves.pdf")
    assert (tmp_path / "curves.png").stat().st_size > 10_000
