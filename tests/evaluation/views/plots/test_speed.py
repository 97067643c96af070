"""Speed curves: panels, curves, flags and contacts."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgba

from evaluation.results.files import ResultsError
from evaluation.views.plots import speed_curves, speed_style
from evaluation.views.plots.fitting import SMALLEST_PT
from evaluation.views.plots.strategies import strategy_colour
from tests.figures import text_faults


def test_curves_one_panel_per_strategy_and_curve_per_speed(look: Any, sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    figure = speed_curves(runs, logs)
    first, second = figure.axes
    assert [first.get_title(), second.get_title()] == ["(a) rectangular", "(b) map"]
    assert len(look.by_gid(figure, "curve")) == 2 * len(sweep.speeds_kmh)
    assert first.get_ylim() == second.get_ylim()
    assert first.get_xlabel() == "Time to T0 (s)"
    assert first.get_ylabel() == "Vehicle speed (km/h)"
    assert text_faults(figure) == []
    legend = look.legend(figure)
    assert legend == [*(f"{speed:g} km/h" for speed in sweep.speeds_kmh), "brake requested", "contact"]


def test_curves_end_at_the_impact_speed_with_a_circle(look: Any, sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    rectangular, by_map = speed_curves(runs, logs).axes
    ends = [[tuple(curve[-1]) for curve in look.points_of(axes, "curve")] for axes in (rectangular, by_map)]
    assert ends == [[(0.0, v) for v in (0.0, 0.0, 0.0, 0.0, 23.0, 44.3)], [(0.0, 0.0)] * 6]
    circles = [tuple(circle[0]) for circle in look.points_of(rectangular, "contact")]
    assert circles == [(0.0, 23.0), (0.0, 44.3)]
    assert look.points_of(by_map, "contact") == []


def test_curves_mark_the_flag(look: Any, sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    axes = speed_curves(runs, logs).axes[1]
    marks = [cross[0] for cross in look.points_of(axes, "flag")]
    expected = [(-speed / 3.6 / sweep.brakes_mps2, speed) for speed in sweep.speeds_kmh]
    assert np.allclose(marks, expected)


def test_curves_reach_back_before_the_earliest_flag(sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    assert speed_curves(runs, logs).axes[0].get_xlim() == (-1.5, 0.0)
    early = runs.assign(flag_time_s=runs["t0_s"] - 2.0)
    assert speed_curves(early, logs).axes[0].get_xlim() == pytest.approx((-2.3, 0.0))


def test_curves_of_runs_with_others_get_their_own_panels(sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    both = pd.concat([runs, runs.assign(adversaries="static")], ignore_index=True)
    titles = [axes.get_title() for axes in speed_curves(both, logs).axes]
    assert titles == [
        "(a) rectangular, alone",
        "(b) map, alone",
        "(c) rectangular, with others",
        "(d) map, with others",
    ]


def test_curves_of_three_strategies_in_two_weathers_stand_in_two_lines(sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    everywhere = runs[runs["strategy"] == "map"].assign(strategy="all")
    dry = pd.concat([runs, everywhere], ignore_index=True)
    figure = speed_curves(pd.concat([dry, dry.assign(weather="rain")], ignore_index=True), logs)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0] == "(a) rectangular, clear"
    assert titles[5] == "(f) all, rain"
    assert figure.axes[0].get_subplotspec().get_gridspec().get_geometry() == (2, 3)
    assert text_faults(figure) == []


def test_no_runs_say_so(sweep: Any) -> None:
    with pytest.raises(ResultsError, match="table of runs is empty"):
        speed_curves(sweep.runs.iloc[:0], {})


def test_curves_name_runs_without_t0(look: Any, sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    runs.loc[runs["v_test_kmh"] == 60.0, ["t0_s", "flag_time_s"]] = np.nan
    figure = speed_curves(runs, logs)
    assert len(look.by_gid(figure, "curve")) == 10
    assert any(
        text.startswith("no emergency stop, no contact") and "60 km/h" in text for text in look.texts(figure)
    )


def test_a_speed_keeps_its_colour() -> None:
    styles = [speed_style(speed) for speed in (10, 20, 30, 40, 50, 60, 70, 80)]
    assert len({colour for colour, _ in styles}) == 8
    assert speed_style(15)[0] == speed_style(10)[0]
    assert speed_style(15)[1] != speed_style(10)[1]


def test_figures_are_saved(tmp_path: Path, sweep: Any) -> None:
    runs, logs = sweep.runs, sweep.logs
    figure = speed_curves(runs, logs)
    figure.savefig(tmp_path / "curves.png")
    figure.savefig(tmp_path / "curves.pdf")
    assert (tmp_path / "curves.png").stat().st_size > 10_000


@pytest.mark.parametrize("speeds", [1, 6, 11, 24])
def test_a_legend_of_many_speeds_grows_above_the_titles(sweep: Any, speeds: int) -> None:
    """The speeds of Euro NCAP's tests are 5 km/h apart: the legend has three lines, or more."""
    one = sweep.runs.iloc[[0]]
    many = pd.concat([one.assign(v_test_kmh=10.0 + 5.0 * k) for k in range(speeds)], ignore_index=True)
    assert text_faults(speed_curves(many, sweep.logs)) == []


@pytest.mark.parametrize("earliest_s", [0.4, 6.0, 40.0])
def test_times_stand_apart_however_long_the_braking_takes(sweep: Any, earliest_s: float) -> None:
    """On snow the request comes six seconds before the stop."""
    runs = sweep.runs
    weathers = pd.concat(
        [
            runs.assign(weather=name, flag_time_s=runs["t0_s"] - earliest_s)
            for name in ("dry", "snow", "rain")
        ],
        ignore_index=True,
    )
    assert text_faults(speed_curves(weathers, sweep.logs)) == []


LONG_NAMES = tuple(f"my_package.monitored.areas:variant_{k}_wide" for k in range(6))


@pytest.mark.parametrize(("strategies", "weathers"), [(1, 1), (3, 4), (6, 2)])
def test_long_names_get_lines_of_their_own(sweep: Any, strategies: int, weathers: int) -> None:
    """Names of plug-ins have 40 characters, and users name weathers as they like."""
    one = sweep.runs[sweep.runs["strategy"] == "map"]
    names = [("dry", "snow", "night", "a_weather_of_my_own_with_a_long_name")[k] for k in range(weathers)]
    runs = [one.assign(strategy=s, weather=w) for s in LONG_NAMES[:strategies] for w in names]
    figure = speed_curves(pd.concat(runs, ignore_index=True), sweep.logs)
    assert text_faults(figure) == []
    assert all(axes.title.get_fontsize() >= SMALLEST_PT for axes in figure.axes)


def test_many_speeds_without_t0_are_named_within_their_panel(look: Any, sweep: Any) -> None:
    one = sweep.runs.iloc[[0]].assign(t0_s=np.nan, flag_time_s=np.nan)
    many = [one.assign(v_test_kmh=5.0 + 5.0 * k) for k in range(25)]
    figure = speed_curves(pd.concat([sweep.runs, *many], ignore_index=True), sweep.logs)
    assert text_faults(figure) == []
    (note,) = [text for text in look.texts(figure) if text.startswith("no emergency stop")]
    assert note.replace("\n", " ").endswith("115, 120, 125 km/h")


def test_the_top_of_a_panel_has_its_strategys_colour(sweep: Any) -> None:
    own = sweep.runs.assign(strategy="mine:make")
    for runs in (sweep.runs, own, pd.concat([sweep.runs, own])):
        for axes in speed_curves(runs, sweep.logs).axes:
            name = axes.get_title().split(") ")[-1]
            if name:
                assert axes.spines["top"].get_edgecolor() == to_rgba(strategy_colour(name))
