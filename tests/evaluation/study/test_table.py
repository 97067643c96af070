"""Summaries: every seed gives one value of a measure, and the interval over the seeds is Student's."""

import csv
import dataclasses
import io
import math

import pytest
from scipy import stats

from evaluation.study.answer import told_intervals
from evaluation.study.measures import RunMeasures
from evaluation.study.table import MEASURES, Summary, seed_table, summaries, summarise, summary_csv


def run(scene: str, must: str, seed: int, **changes: object) -> RunMeasures:
    made = RunMeasures(
        scene=scene, variant="v", must=must, strategy="map", settings="", preset="physical", weather="dry",
        seed=seed, v_test_kmh=50.0, collided=False, v_impact_kmh=0.0, score=2.0, band="green",
        flag_time_s=1.0, flag_distance_m=10.0, flag_ttc_s=1.0, end_reason="passed",
        false_activation=False, needless_stop=False,
        speed_loss_kmh=5.0, delay_s=1.0, distance_m=250.0, duration_s=10.0, detections_mean=2.0,
        tracks_mean=1.0, min_ttc_s=1.0, max_btn=0.5,
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
    assert table.header[2:5] == ("avoided (%)", "impact (km/h)", "false activations (%)")
    assert table.rows[0][2:4] == ("50 [0, 100]", "5.0 ±2.5")


def test_what_the_intervals_mean_is_told_for_one_seed_and_for_several() -> None:
    runs = three_seeds()
    told = told_intervals(summaries(runs))
    assert "over the scenes say what another choice of scenes" in told
    assert "over the 3 seeds" in told
    assert "100 points of collisions avoided and 0 points of unnecessary stops" in told
    told = told_intervals(summaries([r for r in runs if r.seed == 0]))
    assert told.endswith("With one seed there are none over the seeds.")
