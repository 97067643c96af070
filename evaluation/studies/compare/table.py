"""What a comparison came to: per strategy and settings, and per scene."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from evaluation.metrics.intervals import Estimate, clustered_mean, clustered_rate, mean_t
from evaluation.protocols.bands import WEIGHT, Colour
from evaluation.protocols.paper import paper_score_max
from evaluation.results.gates import Side
from evaluation.results.tables import EMPTY, Table, csv_bytes, fixed
from evaluation.studies.compare.grid import Point, shown_settings
from evaluation.studies.compare.measures import RunMeasures, impact_kmh

INTERVALS = (
    "Intervals (95 %) are over the scenes: runs of one scene are alike, whatever variant and seed, so that "
    "scenes and not runs are the sample. Points: of the paper's score. Bands: share of the points that Euro "
    "NCAP 2026 gives for such impact speeds."
)

SHARES = (
    "avoided", "score_share", "band_share", "false_activations", "early_activations", "cut_off",
    "needless_stops",
)  # fmt: skip
"""Measures between 0 and 1."""


@dataclass(frozen=True, slots=True)
class Summary:
    """A strategy with settings in one weather, over all scenes and seeds.

    Args:
        strategy, settings, weather: who and where.
        avoided: share of collisions avoided, of the runs where the ego must brake; one in which it braked
            before the target had set off avoided none.
        v_impact_kmh: mean impact speed of those, 0 for a collision avoided.
        score_share: the paper's points of those over what could be won.
        band_share: mean share of a cell's points that Euro NCAP 2026 gives for the impact speed of those.
        flag_ttc_s: mean time to collision at the flag, of those with a flag on a collision course and not
            before the target had set off.
        flag_distance_m: mean distance to the target at the flag, of those with a flag that is not too early.
        false_activations: share of runs with an emergency request, of those where nothing should happen.
        false_activations_per_km: the same by distance driven.
        early_activations: share of runs with a request before the target had set off, of those where the ego
            must brake for one that stands at first and sets off.
        cut_off: share of all runs that the time limit ended; they are in no other measure.
        needless_stops: share with an emergency request or a standstill.
        speed_loss_kmh, delay_s: means where nothing should happen.
        tracks: mean number of tracks over all runs.
        over_seeds: by name of a measure, the mean of its values in each seed with an interval over the seeds.
    """

    strategy: str
    settings: str
    weather: str
    avoided: Estimate
    v_impact_kmh: Estimate
    score_share: float
    band_share: Estimate
    flag_ttc_s: Estimate
    flag_distance_m: Estimate
    false_activations: Estimate
    false_activations_per_km: float
    early_activations: Estimate
    cut_off: Estimate
    needless_stops: Estimate
    speed_loss_kmh: Estimate
    delay_s: Estimate
    tracks: Estimate
    over_seeds: Mapping[str, Estimate] = field(default_factory=dict)


MEASURES = tuple(entry.name for entry in dataclasses.fields(Summary) if entry.type in ("Estimate", "float"))
"""Names of what a summary measures."""


def summarise(runs: Sequence[RunMeasures]) -> Summary:
    """Summary of the runs of one strategy, settings and weather.

    Raises:
        ValueError: there are none.
    """
    if not runs:
        raise ValueError("summarise: no runs")
    seeds: dict[int, list[RunMeasures]] = {}
    for run in runs:
        seeds.setdefault(run.seed, []).append(run)
    together = _over_scenes(runs)
    single = [_over_scenes(group) for group in seeds.values()] if len(seeds) > 1 else [together]
    return replace(together, over_seeds={name: _over_seeds(single, name) for name in MEASURES})


def _over_seeds(single: Sequence[Summary], name: str) -> Estimate:
    """Mean of a measure's values in each seed with Student's interval; of one seed without (NaN)."""
    mean = mean_t([_value(getattr(row, name)) for row in single])
    if name not in SHARES:
        return mean
    low, high = np.clip((mean.low, mean.high), 0.0, 1.0)
    return replace(mean, low=float(low), high=float(high))


def _value(measured: Estimate | float) -> float:
    return measured.value if isinstance(measured, Estimate) else measured


def _over_scenes(runs: Sequence[RunMeasures]) -> Summary:
    """All measures, with intervals over the scenes where there are any."""
    finished = [run for run in runs if not run.cut_off]
    brake = [run for run in finished if run.must == "brake"]
    nothing = [run for run in finished if run.must == "nothing"]
    km = sum(run.distance_m for run in nothing) / 1000
    activations = sum(run.false_activation is True for run in nothing)
    most = sum(paper_score_max(run.v_test_kmh) or 0.0 for run in brake)
    return Summary(
        strategy=runs[0].strategy,
        settings=runs[0].settings,
        weather=runs[0].weather,
        avoided=_rate_of(brake, lambda run: run.avoided),
        v_impact_kmh=_mean_of(brake, impact_kmh),
        score_share=sum(run.score or 0.0 for run in brake) / most if most else math.nan,
        band_share=_mean_of(brake, lambda run: WEIGHT[Colour(run.band)] if run.band else None),
        flag_ttc_s=_mean_of(brake, lambda run: None if run.false_activation else run.flag_ttc_s),
        flag_distance_m=_mean_of(brake, lambda run: None if run.false_activation else run.flag_distance_m),
        false_activations=_rate_of(nothing, lambda run: run.false_activation is True),
        false_activations_per_km=activations / km if km else math.nan,
        early_activations=_rate_of(
            [run for run in brake if run.false_activation is not None],
            lambda run: run.false_activation is True,
        ),
        cut_off=_rate_of(runs, lambda run: run.cut_off),
        needless_stops=_rate_of(nothing, lambda run: run.needless_stop),
        speed_loss_kmh=_mean_of(nothing, lambda run: run.speed_loss_kmh),
        delay_s=_mean_of(nothing, lambda run: run.delay_s),
        tracks=_mean_of(finished, lambda run: run.tracks_mean),
    )


def _rate_of(runs: Sequence[RunMeasures], is_so: Callable[[RunMeasures], bool]) -> Estimate:
    """Share of runs, with the scenes as clusters."""
    return clustered_rate([is_so(run) for run in runs], [run.scene for run in runs])


def _mean_of(runs: Sequence[RunMeasures], value: Callable[[RunMeasures], float | None]) -> Estimate:
    """Mean over the runs that have a value, with the scenes as clusters."""
    pairs = [(number, run.scene) for run in runs if (number := value(run)) is not None]
    return clustered_mean([number for number, _ in pairs], [scene for _, scene in pairs])


def summaries(runs: Sequence[RunMeasures]) -> list[Summary]:
    """A summary per weather, strategy and settings, in the order of the runs."""
    groups: dict[tuple[str, str, str], list[RunMeasures]] = {}
    for run in runs:
        groups.setdefault((run.weather, run.strategy, run.settings), []).append(run)
    return [summarise(group) for group in groups.values()]


def sides_of_summaries(rows: Sequence[Summary]) -> list[Side]:
    """What each strategy and settings came to, with `MEASURES` as `table.csv` has them."""
    several = len({row.weather for row in rows}) > 1
    return [
        Side(
            row.strategy,
            {name: _value(getattr(row, name)) for name in MEASURES},
            ", ".join(filter(None, (shown_settings(row.settings), row.weather if several else ""))),
        )
        for row in rows
    ]


AS_PRESET = "as the preset has it"
"""In place of settings where there are none."""
_Column = tuple[str, Callable[[Summary], str]]
"""Header and cell of a row."""


def _table(
    rows: Sequence[Summary], columns: Sequence[_Column], caption: str, usual: str = AS_PRESET
) -> Table:
    """A line per summary: its weather where there are several, strategy, settings, and the columns."""
    lead: list[_Column] = [("weather", lambda row: row.weather)] if len({r.weather for r in rows}) > 1 else []
    lead += [
        ("strategy", lambda row: row.strategy),
        ("settings", lambda row: shown_settings(row.settings) or usual),
    ]
    every = (*lead, *columns)
    lines = tuple(tuple(cell(row) for _, cell in every) for row in rows)
    return Table(tuple(header for header, _ in every), lines, (), caption)


def summary_table(rows: Sequence[Summary]) -> Table:
    """The summaries as text."""
    columns: tuple[_Column, ...] = (
        ("avoided (%)", lambda row: _rate(row.avoided)),
        ("impact (km/h)", lambda row: _mean(row.v_impact_kmh, 1)),
        ("points (%)", lambda row: fixed(100 * row.score_share, 0)),
        ("bands (%)", lambda row: fixed(100 * row.band_share.value, 0)),
        ("TTC at flag (s)", lambda row: _mean(row.flag_ttc_s, 2)),
        ("distance at flag (m)", lambda row: _mean(row.flag_distance_m, 1)),
        ("early activations (%)", lambda row: _rate(row.early_activations)),
        ("false activations (%)", lambda row: _rate(row.false_activations)),
        ("per km", lambda row: fixed(row.false_activations_per_km, 2)),
        ("unnecessary stops (%)", lambda row: _rate(row.needless_stops)),
        ("speed loss (km/h)", lambda row: _mean(row.speed_loss_kmh, 1)),
        ("delay (s)", lambda row: _mean(row.delay_s, 2)),
        ("tracks", lambda row: _mean(row.tracks, 1)),
        ("cut off (%)", lambda row: _rate(row.cut_off)),
    )
    return _table(rows, columns, f"{_counts(rows)} {INTERVALS}")


def short_table(rows: Sequence[Summary]) -> Table:
    """The columns of the summaries that decide, for a terminal."""

    def percent(rate: Estimate) -> str:
        return EMPTY if math.isnan(rate.value) else f"{fixed(100 * rate.value, 0)} %"

    columns: tuple[_Column, ...] = (
        ("avoided", lambda row: f"{fixed(100 * row.avoided.value, 0)} %"),
        ("impact (km/h)", lambda row: fixed(row.v_impact_kmh.value, 1)),
        ("early activations", lambda row: percent(row.early_activations)),
        ("false activations", lambda row: percent(row.false_activations)),
        ("unnecessary stops", lambda row: percent(row.needless_stops)),
        ("delay (s)", lambda row: fixed(row.delay_s.value, 2)),
    )
    return _table(rows, columns, _counts(rows), "-")


def seed_table(rows: Sequence[Summary]) -> Table:
    """The measures that decide, with intervals over the seeds."""
    columns: tuple[_Column, ...] = (
        ("avoided (%)", lambda row: _rate(row.over_seeds["avoided"])),
        ("impact (km/h)", lambda row: _mean(row.over_seeds["v_impact_kmh"], 1)),
        ("early activations (%)", lambda row: _rate(row.over_seeds["early_activations"])),
        ("false activations (%)", lambda row: _rate(row.over_seeds["false_activations"])),
        ("unnecessary stops (%)", lambda row: _rate(row.over_seeds["needless_stops"])),
        ("delay (s)", lambda row: _mean(row.over_seeds["delay_s"], 2)),
    )
    caption = (
        "Each seed has noise and frame phase of its own, and gives one value over all scenes; Student's "
        "interval (95 %) of these values. All measures: columns `..._seed_low` and `..._seed_high` of "
        "`table.csv`."
    )
    return _table(rows, columns, caption)


def _counts(rows: Sequence[Summary]) -> str:
    """Runs in each kind of rate; every line of a comparison meets the same."""
    brake, early, nothing = (
        max(rate.count for rate in rates)
        for rates in zip(
            *((row.avoided, row.early_activations, row.false_activations) for row in rows), strict=True
        )
    )
    text = (
        f"Per line {brake} runs where the ego must brake, in {early} of them for a target that sets off "
        f"(early: braked before that), and {nothing} where nothing should happen."
    )
    ended = [row.cut_off.hits for row in rows]
    return text + (
        f" {sum(ended)} runs were cut off, and are in no rate of their line." if any(ended) else ""
    )


def scene_table(runs: Sequence[RunMeasures], points: Sequence[Point]) -> Table:
    """Collisions avoided and false activations per scene, of chosen strategies and settings."""
    chosen = [(point.strategy, point.text) for point in points]
    scenes: dict[tuple[str, str], dict[tuple[str, str], list[RunMeasures]]] = {}
    for run in runs:
        if (run.strategy, run.settings) in chosen:
            scene = scenes.setdefault((run.must, run.scene), {})
            scene.setdefault((run.strategy, run.settings), []).append(run)
    header = ("must", "scene", *(point.name for point in points))
    lines = [
        (must, scene, *(_outcomes(must, group.get(point, [])) for point in chosen))
        for (must, scene), group in sorted(scenes.items(), key=lambda item: item[0][0] != "brake")
    ]
    return Table(header, tuple(lines))


def _outcomes(must: str, runs: Sequence[RunMeasures]) -> str:
    """How the runs of one scene ended."""
    finished = [run for run in runs if not run.cut_off]
    false = sum(run.false_activation is True for run in finished)
    if must == "brake":
        avoided = f"{sum(run.avoided for run in finished)}/{len(finished)} avoided"
        return avoided + (f", {false} early" if false else "")
    still = sum(run.needless_stop for run in finished) - false
    return f"{false}/{len(finished)} false activations" + (f" +{still} standstill" if still > 0 else "")


def runs_csv(runs: Sequence[RunMeasures]) -> bytes:
    """One line per run, all its measures; what does not exist is empty."""
    names = [field.name for field in dataclasses.fields(RunMeasures)]
    return csv_bytes(names, (dataclasses.astuple(run) for run in runs))


def summary_csv(rows: Sequence[Summary]) -> bytes:
    """One line per summary; a measure is up to six columns: value, ends of both intervals, and count."""
    flat: list[dict[str, object]] = []
    for row in rows:
        values: dict[str, object] = {name: getattr(row, name) for name in ("strategy", "settings", "weather")}
        for name in MEASURES:
            value, over = getattr(row, name), row.over_seeds[name]
            values[name] = _value(value)
            if isinstance(value, Estimate):
                values |= {f"{name}_low": value.low, f"{name}_high": value.high, f"{name}_count": value.count}
            values |= {f"{name}_seed_low": over.low, f"{name}_seed_high": over.high}
        flat.append(values)
    return csv_bytes(flat[0] if flat else (), (values.values() for values in flat))


def _rate(rate: Estimate) -> str:
    if math.isnan(rate.value):
        return EMPTY
    return f"{100 * rate.value:.0f} [{100 * rate.low:.0f}, {100 * rate.high:.0f}]"


def _mean(mean: Estimate, digits: int) -> str:
    if math.isnan(mean.value):
        return EMPTY
    half = "" if math.isnan(mean.low) else f" ±{mean.high - mean.value:.{digits}f}"
    return f"{fixed(mean.value, digits)}{half}"
