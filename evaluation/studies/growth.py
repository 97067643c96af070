"""Growth: what more participants around the ego cost each strategy, in time per frame and at the flag."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rich.console

from evaluation.results.files import configuration_json, write_files
from evaluation.results.tables import EMPTY, Table, csv_bytes, markdown_table, rich_table
from evaluation.runs.configuration import configuration_of
from evaluation.runs.execution import FrameTime, frame_time, impact_speed_kmh
from evaluation.runs.workers import Workers
from evaluation.studies.compare.figures import FORMATS, save
from evaluation.studies.study import Finished, LabelledRun, Study, done_line
from evaluation.views.plots.panels import draw_band, hidden_by, panel_page
from evaluation.views.plots.strategies import strategy_looks
from evaluation.views.plots.style import FONT_PT, SMALL_PT
from scenarios.catalogue.bystanders import Bystander, add_bystanders
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.motion.paths import Pose
from scenarios.places import MapView
from scenarios.simulation.simulation import Simulation
from scenarios.spec import RunSpec, definition_of, preset_of
from scenarios.strategies import make_strategy
from smartmot.area import MonitoredAreaStrategy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUNTS = (0, 25, 50, 100, 150, 200)
SCENARIO = "crossing"
SPEED_KMH = 50.0
NEAR_KERB_M, FAR_KERB_M, FAR_LANE_M = -1.75, 5.25, 3.5
"""Across the ego's lane on the shipped urban street: its kerbs and the middle of the other lane."""
MIN_VISIBLE = 0.0
"""All others are seen, whoever stands before them."""
REACH_M = 65.0
"""Others are within so many metres along the road before and behind the crossing."""
QUICK_OTHERS = 50
"""A run among at most so many others takes a second or so."""


@dataclass(frozen=True, slots=True)
class GrowthRun:
    """What one run among others came to.

    Args:
        strategy, others, seed: who, among how many.
        tracks_mean: per frame.
        flag_time_s: first emergency request; None without one.
        false_activation: whether it came before the pedestrian set off.
        v_impact_kmh: speed at contact, 0 without; None of a run that the time limit cut off.
    """

    strategy: str
    others: int
    seed: int
    tracks_mean: float
    flag_time_s: float | None
    false_activation: bool
    v_impact_kmh: float | None


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
    bystanders: list[Bystander] = []
    cars = 0
    for k in range(count):
        if k % 10 == 9:
            # one after the other, 9 m apart from 30 m behind the line on
            pose = Pose(x0 + (-30.0 + 9.0 * cars), y0 + FAR_LANE_M, np.pi)
            bystanders.append(Bystander("car", pose, SPEED_KMH / 3.6))
            cars += 1
            continue
        side = -1 if rng.random() < 0.5 else 1
        kerb = NEAR_KERB_M if side < 0 else FAR_KERB_M
        along, beyond = rng.uniform(-REACH_M, REACH_M), rng.uniform(0.5, 2.3)
        walks = k % 10 >= 5
        yaw = (0.0 if rng.random() < 0.5 else np.pi) if walks else -side * np.pi / 2
        pose = Pose(x0 + along, y0 + (kerb + side * beyond), yaw)
        bystanders.append(Bystander("pedestrian", pose, 5 / 3.6 if walks else 0.0))
    return add_bystanders(definition, bystanders, "other")


GrowthItem = LabelledRun[int]
"""A crossing, and how many others there are."""


@dataclass(frozen=True, slots=True)
class GrowthStudy(Study[GrowthItem, GrowthRun]):
    """Every strategy among every number of others.

    Args:
        strategies, preset, weather: what is run.
        seeds: repetitions.
        counts: numbers of others.
        formats: of the figure.
        name: of the folder.
    """

    strategies: tuple[str, ...]
    preset: str
    weather: str
    seeds: int
    counts: tuple[int, ...] = COUNTS
    formats: tuple[str, ...] = FORMATS
    name: str = "growth"
    journal = "growth_"
    table = "growth.csv"
    kind = GrowthRun

    def items(self, folder: Path) -> list[GrowthItem]:
        """The runs; strategies take turns, so that what else the machine does strikes all of them."""
        return [
            LabelledRun(
                RunSpec(
                    scenario=SCENARIO,
                    file=SCENARIO,
                    parameters=(("Ego_speed_kmh", SPEED_KMH),),
                    strategy=strategy,
                    preset=self.preset,
                    weather=self.weather,
                    v_test_kmh=SPEED_KMH,
                    seed=seed,
                ),
                others,
                more=("growth", others),
            )
            for seed, others, strategy in itertools.product(range(self.seeds), self.counts, self.strategies)
        ]

    @staticmethod
    def job(item: GrowthItem) -> tuple[GrowthRun, FrameTime]:
        """Carry out one of them."""
        return grow(item)

    def is_quick(self, item: GrowthItem) -> bool:
        """Those among few others."""
        return item.label <= QUICK_OTHERS

    def write(self, folder: Path, items: Sequence[GrowthItem], finished: Finished[GrowthRun]) -> list[Path]:
        """Write table, figure and settings; all that holds times is different in every run.

        Raises:
            ResultsError: the folder cannot be written.
        """
        runs, spent = zip(*(finished[item.key] for item in items), strict=True)
        # a run is named once for all numbers of others
        specs = list(dict.fromkeys(item.spec for item in items))
        more = {"others": sorted({item.label for item in items}), "min_visible": MIN_VISIBLE}
        contents = {
            "growth.md": markdown_table(growth_table(runs, spent)).encode(),
            "growth.csv": growth_csv(runs),
            "growth_times.csv": times_csv(runs, spent),
            "growth.json": configuration_json(configuration_of(specs, folder, more=more)),
        }
        figure = growth_figure(runs, spent)
        return [*write_files(folder, contents), *save(figure, folder / "growth", self.formats)]


def grow(item: GrowthItem) -> tuple[GrowthRun, FrameTime]:
    """Carry out one run."""
    spec, others = item.spec, item.label
    definition = with_others(definition_of(spec), others, spec.seed)
    preset = preset_of(spec, definition)

    def maker(view: MapView) -> MonitoredAreaStrategy:
        return make_strategy(spec.strategy, preset, view)

    # all are seen: what grows is the number of objects, not of those hidden behind others
    open_view = replace(preset, sensor=replace(preset.sensor, min_visible=MIN_VISIBLE))
    outcome = Simulation(definition, open_view, maker, spec.seed).run()
    spent = frame_time(outcome.frame_time_ms)
    tracks = int(np.count_nonzero(outcome.log.table()["kind"] == "track"))
    measured = GrowthRun(
        strategy=spec.strategy,
        others=others,
        seed=spec.seed,
        tracks_mean=tracks / max(spent.frames, 1),
        flag_time_s=outcome.flag_time_s,
        false_activation=outcome.false_activation is True,
        v_impact_kmh=impact_speed_kmh(outcome),
    )
    return measured, spent


def compare_growth(study: GrowthStudy, out: Path, workers: Workers, quiet: bool) -> list[GrowthRun]:
    """Run every strategy among more and more others, or go on with it; write table and figure.

    Raises:
        ResultsError: the folder cannot be written.
    """
    console = rich.console.Console(quiet=quiet)
    items = study.items(out)
    finished, before = study.carry_out_behind_bar(items, out, study.journal, workers, console, "growing")
    written = study.write(out, items, finished)
    runs, spent = zip(*(finished[item.key] for item in items), strict=True)
    title = f"{SCENARIO} at {SPEED_KMH:g} km/h, preset {study.preset}, {study.weather}"
    console.print(rich_table(growth_table(runs, spent), title))
    console.print(done_line(len(runs), before, out, [path.name for path in written]), highlight=False)
    return list(runs)


Timed = tuple[GrowthRun, FrameTime]


def _cell(pairs: Sequence[Timed], strategy: str, others: int) -> list[Timed]:
    return [pair for pair in pairs if (pair[0].strategy, pair[0].others) == (strategy, others)]


@dataclass(frozen=True, slots=True)
class _OverSeeds:
    """A measure over the seeds: mean, least and greatest; NaN if no seed has it."""

    value: float
    low: float
    high: float
    count: int

    @classmethod
    def of(cls, sample: Sequence[float]) -> _OverSeeds:
        if not sample:
            return cls(math.nan, math.nan, math.nan, 0)
        return cls(math.fsum(sample) / len(sample), min(sample), max(sample), len(sample))


def _median_ms(pairs: Sequence[Timed]) -> _OverSeeds:
    return _OverSeeds.of([spent.median_ms for _, spent in pairs])


def _tracks(pairs: Sequence[Timed]) -> _OverSeeds:
    return _OverSeeds.of([run.tracks_mean for run, _ in pairs])


def _flag_s(pairs: Sequence[Timed]) -> _OverSeeds:
    """Over the runs whose flag is for the pedestrian."""
    return _OverSeeds.of(
        [run.flag_time_s for run, _ in pairs if run.flag_time_s is not None and not run.false_activation]
    )


def growth_table(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> Table:
    """A line per number of others, columns per strategy."""
    pairs = list(zip(runs, spent, strict=True))
    strategies = list(dict.fromkeys(run.strategy for run in runs))
    header = ["others"]
    for strategy in strategies:
        header += [f"{strategy} ms/frame", "tracks", "flag (s)", "false", "v_impact (km/h)"]
    lines = []
    for others in dict.fromkeys(run.others for run in runs):
        line = [str(others)]
        for strategy in strategies:
            cell = _cell(pairs, strategy, others)
            flag = _flag_s(cell)
            impact = _OverSeeds.of([run.v_impact_kmh for run, _ in cell if run.v_impact_kmh is not None])
            line += [
                f"{_median_ms(cell).value:.2f}",
                f"{_tracks(cell).value:.1f}",
                f"{flag.value:.2f}" if flag.count else EMPTY,
                f"{sum(run.false_activation for run, _ in cell)}/{len(cell)}",
                f"{impact.value:.1f}" if impact.count else EMPTY,
            ]
        lines.append(tuple(line))
    caption = (
        "Median processor time of perception and decision per frame, mean over the seeds; flags for the "
        "pedestrian, and flags before the pedestrian sets off (false)."
    )
    return Table(tuple(header), tuple(lines), (), caption)


def growth_csv(runs: Sequence[GrowthRun]) -> bytes:
    """One line per run, without times."""
    # truth values as Python spells them: the format of this file since version 0.1.0
    rows = [[str(v) if isinstance(v, bool) else v for v in dataclasses.astuple(run)] for run in runs]
    return csv_bytes([field.name for field in dataclasses.fields(GrowthRun)], rows)


def times_csv(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> bytes:
    """Processor times, which are different in every run."""
    names = ("strategy", "others", "seed", *(field.name for field in dataclasses.fields(FrameTime)))
    rows = [
        (run.strategy, run.others, run.seed, *dataclasses.astuple(time))
        for run, time in zip(runs, spent, strict=True)
    ]
    return csv_bytes(names, rows)


_MARKER_PT, _LINE_PT, _WIDER_PT = 3.5, 1.2, 1.6
"""Size of markers, width of lines, and how much both grow for each curve that would hide a curve."""
_SAME = 0.01
"""Milliseconds, tracks and seconds nearer than this fall on one another."""


def growth_figure(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> Figure:
    """Time per frame, tracks and time of the flag over the number of others, a curve per strategy.

    Around each curve lies what the seeds have, from the least to the greatest.
    """
    from matplotlib.lines import Line2D

    pairs = list(zip(runs, spent, strict=True))
    looks = strategy_looks(run.strategy for run in runs)
    counts = list(dict.fromkeys(run.others for run in runs))
    page = panel_page(
        1, 3, panel_in=1.95,
        entries=[
            Line2D([], [], color=colour, marker=marker, markersize=4.5, linewidth=1.2, label=name)
            for name, (colour, marker) in looks.items()
        ],
        note=f"Crossing at {SPEED_KMH:g} km/h; processor time, medians per frame; means over the seeds, "
        "shaded from the least to the greatest. No point: no emergency request for the pedestrian.",
    )  # fmt: skip
    summaries: tuple[tuple[str, Callable[[Sequence[Timed]], _OverSeeds]], ...] = (
        ("time per frame (ms)", _median_ms),
        ("tracks per frame", _tracks),
        ("first request (s)", _flag_s),
    )
    for axes, (title, summary) in zip(page.axes, summaries, strict=True):
        axes.set_title(title, fontsize=FONT_PT, pad=4.0)
        axes.set_xlabel("other participants", fontsize=SMALL_PT)
        means = {name: [summary(_cell(pairs, name, others)) for others in counts] for name in looks}
        values = [[(k, mean.value) for k, mean in enumerate(row)] for row in means.values()]
        for (name, (colour, marker)), hiding in zip(looks.items(), hidden_by(values, _SAME), strict=True):
            draw_band(axes, counts, [m.low for m in means[name]], [m.high for m in means[name]], colour)
            # curves that fall on one another stay visible: the lower ones are larger and thicker
            axes.plot(
                counts, [mean.value for mean in means[name]], color=colour, marker=marker, label=name,
                markersize=_MARKER_PT + _WIDER_PT * hiding, linewidth=_LINE_PT + _WIDER_PT * hiding,
            )  # fmt: skip
    page.axes[0].set_ylim(bottom=0.0)
    return page.figure
