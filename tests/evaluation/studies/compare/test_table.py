"""Summaries: every seed gives one value of a measure, and the interval over the seeds is Student's."""

import csv
import dataclasses
import io
import math

import pytest
from scipy import stats

from evaluation.studies.compare.answer import told_intervals
from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.measures import RunMeasures, told_measures
from evaluation.studies.compare.table import (
    MEASURES,
    Summary,
    scene_table,
    seed_table,
    summaries,
    summarise,
    summary_csv,
    summary_table,
)


def run(scene: str, must: str, seed: int, **changes: object) -> RunMeasures:
    made = RunMeasures(
        scene=scene, variant="v", must=must, strategy="map", settings="", preset="physical", weather="dry",
        seed=seed, v_test_kmh=50.0, collided=False, v_impact_kmh=0.0, score=2.0, band="green",
        flag_time_s=1.0, flag_distance_m=10.0, flag_ttc_s=1.0, end_reason="passed",
        false_activation=False, needless_stop=False,
        speed_loss_kmh=5.0, delay_s=1.0, distance_m=250.0, duration_s=10.0, detections_mean=2.0,
        tracks_mean=1.0, dropped_share=0.0, min_ttc_s=1.0, max_btn=0.5,
    )  # fmt: skip
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


def three_seeds() -> list[RunMeasures]:
    """Two scenes of each kind; of the seeds 0, 1 and 2 contacts, and mean impacts of 4, 5 and 6 km/h."""
    runs = []
    for seed in range(3):
        for k, scene in enumerate(("a", "b")):
            hit = k < seed
            runs.append(run(scene, "brake", seed, collided=hit, v_impact_kmh=4.0 + seed + (-1) ** k))
        runs.append(
            run("c", "nothing", seed, delay_s=1.0 + seed, false_activation=seed == 2, needless_stop=True)
        )
        runs.append(run("d", "nothing", seed, delay_s=1.0 + seed, needless_stop=True))
    return runs


def test_seeds_give_one_value_each() -> None:
    over = summarise(three_seeds()).over_seeds
    t = stats.t.ppf(0.975, 2)
    impact = over["v_impact_kmh"]
    half = t * 1.0 / math.sqrt(3)  # of 4, 5 and 6 the standard deviation is 1
    assert (impact.value, impact.low, impact.high) == pytest.approx((5.0, 5.0 - half, 5.0 + half))
    assert impact.count == 3
    delay = over["delay_s"]
    assert (delay.value, delay.low, delay.high) == pytest.approx((2.0, 2.0 - half, 2.0 + half))
    # stops per km: 0, 0 and 1 in 2 x 250 m
    stops = over["false_activations_per_km"]
    half = t * (2 / math.sqrt(3)) / math.sqrt(3)
    assert (stops.value, stops.low, stops.high) == pytest.approx((2 / 3, 2 / 3 - half, 2 / 3 + half))


def test_shares_stay_between_0_and_1_and_what_never_changes_has_no_width() -> None:
    over = summarise(three_seeds()).over_seeds
    avoided = over["avoided"]  # 1, 1/2, 0
    assert (avoided.value, avoided.low, avoided.high) == (0.5, 0.0, 1.0)
    stops = over["needless_stops"]
    assert (stops.value, stops.low, stops.high) == (1.0, 1.0, 1.0)


def test_agrees_with_scipy() -> None:
    impacts = [3.0, 4.5, 4.0, 7.0, 5.5]
    runs = [run("a", "brake", seed, v_impact_kmh=v) for seed, v in enumerate(impacts)]
    over = summarise(runs).over_seeds["v_impact_kmh"]
    reference = stats.ttest_1samp(impacts, 0.0).confidence_interval(0.95)
    assert (over.low, over.high) == pytest.approx((reference.low, reference.high), rel=1e-12)


def table_of(rows: list[Summary]) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(summary_csv(rows).decode())))


def test_columns_over_the_seeds_are_filled_with_two_seeds_and_empty_with_one() -> None:
    runs = three_seeds()
    (many,) = table_of(summaries(runs))
    (one,) = table_of(summaries([r for r in runs if r.seed == 0]))
    ends = [f"{name}_seed_{end}" for name in MEASURES for end in ("low", "high")]
    assert list(many) == list(one)
    assert len(ends) == 2 * 14
    assert all(many[name] for name in ends)
    assert not any(one[name] for name in ends)
    assert float(many["v_impact_kmh_seed_high"]) == pytest.approx(5.0 + 4.3026527 / math.sqrt(3))
    assert one["avoided_low"]  # over the scenes there is one


def test_the_table_over_the_seeds() -> None:
    table = seed_table(summaries(three_seeds()))
    assert table.header[2:4] == ("avoided (%)", "impact (km/h)")
    assert table.header[4:6] == ("early activations (%)", "false activations (%)")
    assert table.rows[0][2:4] == ("50 [0, 100]", "5.0 ±2.5")


def test_what_the_intervals_mean_is_told_for_one_seed_and_for_several() -> None:
    runs = three_seeds()
    told = told_intervals(summaries(runs))
    assert "over the scenes say what another choice of scenes" in told
    assert "over the 3 seeds" in told
    assert "100 points of collisions avoided and 0 points of unnecessary stops" in told
    told = told_intervals(summaries([r for r in runs if r.seed == 0]))
    assert told.endswith("With one seed there are none over the seeds.")


def must_brake(seed: int, **values: object) -> RunMeasures:
    return run("c", "brake", seed, **values)  # type: ignore[arg-type]


def test_rates_have_their_own_denominators() -> None:
    """Of six must-brake runs one was cut off, one braked early, one hit; two have a target that stands."""
    runs = [
        must_brake(0, end_reason="time_limit", false_activation=None, score=None),
        must_brake(1, false_activation=True, score=0.0, flag_distance_m=90.0),
        must_brake(2, collided=True, v_impact_kmh=20.0, end_reason="contact", score=1.0),
        must_brake(3),
        must_brake(4, false_activation=None),
        must_brake(5, false_activation=None),
        run("n", "nothing", 0, score=None, band=None),
        run("n", "nothing", 1, score=None, band=None, end_reason="time_limit"),
    ]
    row = summarise(runs)
    stood = run("n", "nothing", 2, score=None, band=None, end_reason="not_begun", needless_stop=True)
    assert summarise([*runs, stood]).needless_stops.value == 1 / 2  # what it did is known
    assert (row.avoided.value, row.avoided.count) == (3 / 5, 5)
    # one of the three whose target sets off and that were not cut off
    assert (row.early_activations.value, row.early_activations.count) == (pytest.approx(1 / 3), 3)
    assert (row.false_activations.value, row.false_activations.count) == (0.0, 1)
    assert (row.cut_off.value, row.cut_off.count) == (2 / 8, 8)
    # the early one has neither an impact nor a flag for the target
    assert (row.v_impact_kmh.value, row.v_impact_kmh.count) == (20.0 / 4, 4)
    assert row.flag_distance_m.value == 10.0
    assert row.score_share == pytest.approx((0.0 + 1.0 + 2.0 * 3) / (2.0 * 5))
    (line,) = summary_table([row]).rows
    cells = dict(zip(summary_table([row]).header, line, strict=True))
    assert cells["early activations (%)"].startswith("33 [")
    assert cells["cut off (%)"].startswith("25 [")
    assert "Per line 5 runs where the ego must brake, in 3 of them for a target that sets off" in (
        summary_table([row]).caption
    )
    assert "2 runs were cut off" in summary_table([row]).caption
    assert told_measures(runs) == ["2 of 8 runs were cut off at 60 s, and are in no rate"]
    brake, nothing = scene_table(runs, [Point("map")]).rows
    assert (brake[2], nothing[2]) == ("3/5 avoided, 1 early", "0/1 false activations")


def test_dropped_detections_are_said() -> None:
    runs = [must_brake(0), must_brake(1, dropped_share=0.4), must_brake(2, dropped_share=0.1)]
    (line,) = told_measures(runs)
    assert line.startswith("in 1 of 3 runs more than a tenth of the detections were dropped (up to 40 %)")
