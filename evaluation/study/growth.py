"""Growth: what more participants around the ego cost each strategy, in time per frame and at the flag."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rich.console
import rich.progress

from evaluation.plots.style import SMALL_PT, new_figure, set_style, set_title
from evaluation.results import ResultsError, Table, markdown_table, rich_table
from evaluation.study.figures import COLOURS, MARKERS, save
from evaluation.study.intervals import Estimate, mean_t
from evaluation.study.measures import FrameTime, TimedSimulation
from scenarios.bystanders import ADULT_LENGTH_M, ADULT_WIDTH_M, CAR_LENGTH_M, CAR_WIDTH_M
from scenarios.library import shipped_scenario
from scenarios.openscenario.model import (
    Action,
    EntityDefinition,
    ScenarioDefinition,
    SpeedAction,
    TeleportAction,
    WorldPosition,
)
from scenarios.openscenario.reader import load
from scenarios.places import Scene
from scenarios.presets import Preset, named_preset, named_weather, preset_in_weather
from scenarios.simulation import Outcome
from scenarios.strategies import make_strategy
from smartmot.monitored_area import MonitoredAreaStrategy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUNTS = (0, 25, 50, 100, 150, 200)
SCENARIO = "crossing"
SPEED_KMH = 50.0
NEAR_KERB_M, FAR_KERB_M, FAR_LANE_M = -1.75, 5.25, 3.5
"""Across the ego's lane on the shipped urban street: its kerbs and the middle of the other lane."""
REACH_M = 65.0
"""Others are within so many metres along the road before and behind the crossing."""


@dataclass(frozen=True, slots=True)
class GrowthRun:
    """One run among others.

    Args:
        strategy, others, seed: who, among how many.
        tracks_mean: per frame.
        flag_time_s: first emergency request; None without one.
        false_stop: whether it came before the pedestrian set off.
        v_impact_kmh: speed at contact, 0 without.
        spent: processor time of perception and decision.
    """

    strategy: str
    others: int
    seed: int
    tracks_mean: float
    flag_time_s: float | None
    false_stop: bool
    v_impact_kmh: float
    spent: FrameTime


def with_others(definition: ScenarioDefinition, count: int, seed: int) -> ScenarioDefinition:
    """A crossing with others who keep out of the ego's way.

    Of ten, nine are people on the sidewalks, at least 0.5 m from the kerb, five of them standing and four
    walking along it; one is a car that comes towards the ego in its own lane, one car behind the other.

    Args:
        definition: that has the parameters Line_x, Line_y and Line_yaw 0.
        count: how many.
        seed: of their places.
    """
    rng = np.random.default_rng((seed, 7))
    x0, y0 = (float(definition.parameters[name]) for name in ("Line_x", "Line_y"))
    entities: list[EntityDefinition] = []
    init: list[tuple[str | None, Action]] = []

    def put(
        category: str, x_m: float, y_m: float, yaw: float, size: tuple[float, float], speed: float
    ) -> None:
        name = f"other {len(entities) + 1}"
        entities.append(EntityDefinition(name, category, category, *size, 1.6, 0.0, 0.0))
        init.append((name, TeleportAction(WorldPosition(x0 + x_m, y0 + y_m, yaw))))
        if speed:
            init.append((name, SpeedAction("step", "time", 0.0, speed)))

    cars = 0
    for k in range(count):
        if k % 10 == 9:
            # one after the other, 9 m apart from 30 m behind the line on
            put("car", -30.0 + 9.0 * cars, FAR_LANE_M, np.pi, (CAR_LENGTH_M, CAR_WIDTH_M), SPEED_KMH / 3.6)
            cars += 1
            continue
        side = -1 if rng.random() < 0.5 else 1
        kerb = NEAR_KERB_M if side < 0 else FAR_KERB_M
        along, beyond = rng.uniform(-REACH_M, REACH_M), rng.uniform(0.5, 2.3)
        walks = k % 10 >= 5
        yaw = (0.0 if rng.random() < 0.5 else np.pi) if walks else -side * np.pi / 2
        speed = 5 / 3.6 if walks else 0.0
        put("pedestrian", along, kerb + side * beyond, yaw, (ADULT_LENGTH_M, ADULT_WIDTH_M), speed)
    return replace(definition, entities=(*definition.entities, *entities), init=(*definition.init, *init))


def grow(strategy: str, others: int, seed: int, preset: Preset) -> GrowthRun:
    """One run."""
    definition = with_others(load(shipped_scenario(SCENARIO), {"Ego_speed_kmh": SPEED_KMH}), others, seed)

    def maker(scene: Scene) -> MonitoredAreaStrategy:
        return make_strategy(strategy, preset, scene)

    # all are seen: what grows is the number of objects, not of those hidden behind others
    open_view = replace(preset, sensor=replace(preset.sensor, min_visible=0.0))
    simulation = TimedSimulation(definition, open_view, maker, seed)
    outcome: Outcome = simulation.run()
    spent = simulation.frame_time
    tracks = int(np.count_nonzero(outcome.log.table()["kind"] == "track"))
    return GrowthRun(
        strategy=strategy,
        others=others,
        seed=seed,
        tracks_mean=tracks / max(spent.frames, 1),
        flag_time_s=outcome.flag_time_s,
        false_stop=outcome.false_stop,
        v_impact_kmh=outcome.impact_speed_mps * 3.6,
        spent=spent,
    )


def compare_growth(
    strategies: Sequence[str], preset: str, weather: str, seeds: int, out: Path, quiet: bool
) -> list[GrowthRun]:
    """Run every strategy among more and more others, one after the other, and write table and figure.

    Raises:
        ResultsError: the folder cannot be written.
    """
    chosen = preset_in_weather(named_preset(preset), named_weather(weather))
    console = rich.console.Console(quiet=quiet)
    # strategies take turns, so that what else the machine does strikes all of them
    todo = [(strategy, others, seed) for seed in range(seeds) for others in COUNTS for strategy in strategies]
    runs: list[GrowthRun] = []
    with rich.progress.Progress(console=console, transient=True, disable=quiet) as progress:
        for strategy, others, seed in progress.track(todo, description="growing"):
            runs.append(grow(strategy, others, seed, chosen))
    table = growth_table(runs)
    try:
        (out / "growth.md").write_text(markdown_table(table))
        (out / "growth.csv").write_bytes(growth_csv(runs))
        (out / "growth_times.csv").write_bytes(times_csv(runs))
        written = save(growth_figure(runs), out / "growth")
    except OSError as error:
        raise ResultsError(f"{out}: cannot be written ({error.strerror}); choose another folder") from None
    console.print(rich_table(table, f"{SCENARIO} at {SPEED_KMH:g} km/h, preset {preset}, {weather}"))
    names = ["growth.md", "growth.csv", "growth_times.csv", *(path.name for path in written)]
    console.print(f"{len(runs)} runs; in {out}: {', '.join(names)}", highlight=False)
    return runs


def _cell(runs: Sequence[GrowthRun], strategy: str, others: int) -> list[GrowthRun]:
    return [run for run in runs if run.strategy == strategy and run.others == others]


def _median_ms(runs: Sequence[GrowthRun]) -> Estimate:
    return mean_t([run.spent.median_ms for run in runs])


def _flag_s(runs: Sequence[GrowthRun]) -> Estimate:
    """Over the runs whose flag is for the pedestrian."""
    return mean_t([run.flag_time_s for run in runs if run.flag_time_s is not None and not run.false_stop])


def growth_table(runs: Sequence[GrowthRun]) -> Table:
    """A line per number of others, columns per strategy."""
    strategies = list(dict.fromkeys(run.strategy for run in runs))
    header = ["others"]
    for strategy in strategies:
        header += [f"{strategy} ms/frame", "tracks", "flag (s)", "false", "v_impact (km/h)"]
    lines = []
    for others in dict.fromkeys(run.others for run in runs):
        line = [str(others)]
        for strategy in strategies:
            mine = _cell(runs, strategy, others)
            flag = _flag_s(mine)
            line += [
                f"{_median_ms(mine).value:.2f}",
                f"{np.mean([run.tracks_mean for run in mine]):.1f}",
                f"{flag.value:.2f}" if flag.count else "–",
                f"{sum(run.false_stop for run in mine)}/{len(mine)}",
                f"{np.mean([run.v_impact_kmh for run in mine]):.1f}",
            ]
        lines.append(tuple(line))
    caption = (
        "Median processor time of perception and decision per frame, mean over the seeds; flags for the "
        "pedestrian, and flags before the pedestrian sets off (false)."
    )
    return Table(tuple(header), tuple(lines), (), caption)


def growth_csv(runs: Sequence[GrowthRun]) -> bytes:
    """One line per run, without times."""
    names = ("strategy", "others", "seed", "tracks_mean", "flag_time_s", "false_stop", "v_impact_kmh")
    return _csv(names, [[getattr(run, name) for name in names] for run in runs])


def times_csv(runs: Sequence[GrowthRun]) -> bytes:
    """Processor times, which are different in every run."""
    names = ("strategy", "others", "seed", "frames", "median_ms", "p95_ms")
    rows = [[r.strategy, r.others, r.seed, r.spent.frames, r.spent.median_ms, r.spent.p95_ms] for r in runs]
    return _csv(names, rows)


def _csv(names: Sequence[str], rows: Sequence[Sequence[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([["" if value is None else value for value in row] for row in rows])
    return text.getvalue().encode()


def growth_figure(runs: Sequence[GrowthRun]) -> Figure:
    """Time per frame, tracks and time of the flag over the number of others, a curve per strategy."""
    figure = new_figure(2.7)
    panels = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.07, right=0.985, bottom=0.37, top=0.9, wspace=0.33)
    counts = list(dict.fromkeys(run.others for run in runs))
    summaries: tuple[tuple[str, Callable[[Sequence[GrowthRun]], Estimate]], ...] = (
        ("time per frame (ms)", _median_ms),
        ("tracks", lambda some: mean_t([run.tracks_mean for run in some])),
        ("first request (s)", _flag_s),
    )
    for axes, (title, summary) in zip(panels, summaries, strict=True):
        set_style(axes)
        set_title(axes, title, room=26)
        axes.set_xlabel("other participants", fontsize=SMALL_PT)
        for rank, strategy in enumerate(dict.fromkeys(run.strategy for run in runs)):
            axes.plot(
                counts,
                [summary(_cell(runs, strategy, others)).value for others in counts],
                color=COLOURS[strategy],
                marker=MARKERS[strategy],
                markersize=5.5 - 1.2 * rank,  # those that fall on one another stay visible
                linewidth=1.2,
                label=strategy if axes is panels[0] else None,
            )
    panels[0].set_ylim(bottom=0.0)
    figure.legend(loc="lower center", ncols=3, fontsize=SMALL_PT, frameon=False, bbox_to_anchor=(0.5, 0.1))
    figure.text(
        0.5, 0.015,
        f"Crossing at {SPEED_KMH:g} km/h; processor time, medians per frame; means over the seeds.\n"
        "No point: no emergency request for the pedestrian.",
        ha="center", fontsize=SMALL_PT - 1.5, color="#444444",
    )  # fmt: skip
    return figure
