"""Paired differences by hand, against SciPy, and their laws."""

import csv
import dataclasses
import io
import math

import pytest
from scipy import stats

from evaluation.studies.compare.differences import (
    COMPARED,
    Difference,
    difference_table,
    differences,
    differences_csv,
    pairs_with,
    pairs_with_bases,
    told_differences,
)
from evaluation.studies.compare.grid import FAIR, Point
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.table import MEASURES

MAP, RECTANGLE = Point("map"), Point("rectangular", (("half_width_m", 2.6),))


def run(point: Point, scene: str, variant: int, must: str = "brake", **changes: object) -> RunMeasures:
    made = RunMeasures(
        scene=scene, variant=f"{variant}", must=must, strategy=point.strategy, settings=point.text,
        preset="physical", weather="dry", seed=0, v_test_kmh=50.0, collided=False, v_impact_kmh=0.0,
        score=2.0, band="green", flag_time_s=1.0, flag_distance_m=10.0, flag_ttc_s=1.0, end_reason="passed",
        false_activation=False,
        needless_stop=False, speed_loss_kmh=5.0, delay_s=1.0, distance_m=250.0, duration_s=10.0,
        detections_mean=2.0, tracks_mean=1.0, dropped_share=0.0, min_ttc_s=1.0, max_btn=0.5,
    )  # fmt: skip
    return dataclasses.replace(made, **changes)  # type: ignore[arg-type]


def contacts(point: Point, hits: dict[str, list[bool]]) -> list[RunMeasures]:
    return [
        run(point, scene, k, collided=hit, v_impact_kmh=30.0 * hit)
        for scene, group in hits.items()
        for k, hit in enumerate(group)
    ]


OURS = contacts(MAP, {"a": [False, False], "b": [False], "c": [True], "d": [False], "e": [False, True]})
THEIRS = contacts(RECTANGLE, {"a": [True, False], "b": [True], "c": [True], "d": [True], "e": [True, False]})
"""The map is better in a, b and d; in e once better and once worse; in c both hit."""


def one(found: list[Difference], measure: str) -> Difference:
    (difference,) = (d for d in found if d.measure == measure)
    return difference


def test_contacts_by_hand() -> None:
    found = one(differences(OURS + THEIRS, [(MAP, RECTANGLE)]), "avoided")
    assert found.estimate.value == pytest.approx(3 / 7)  # 5 of 7 avoided against 2 of 7
    assert found.estimate.count == 7
    assert (found.better, found.worse, found.equal) == (4, 1, 2)
    assert (found.scenes_better, found.scenes_worse) == (3, 0)  # in e they are even
    assert found.p_value == pytest.approx(2 * 0.5**3)


def test_impact_speeds_are_a_mean_over_clusters_by_hand() -> None:
    found = one(differences(OURS + THEIRS, [(MAP, RECTANGLE)]), "v_impact_kmh")
    # differences -30, 0 | -30 | 0 | -30 | -30, +30; mean -90 / 7; sums off the mean by scene
    mean = -90 / 7
    off = [-30 - 2 * mean, -30 - mean, -mean, -30 - mean, -2 * mean]
    error = math.sqrt(5 / 4 * sum(x * x for x in off)) / 7
    half = stats.t.ppf(0.975, 4) * error
    assert found.estimate.value == pytest.approx(mean)
    assert (found.estimate.low, found.estimate.high) == pytest.approx((mean - half, mean + half))
    assert (found.better, found.worse) == (4, 1)


def test_swapping_the_strategies_swaps_the_signs() -> None:
    there = differences(OURS + THEIRS, [(MAP, RECTANGLE)])
    back = differences(OURS + THEIRS, [(RECTANGLE, MAP)])
    assert [d.measure for d in there] == [d.measure for d in back]
    for a, b in zip(there, back, strict=True):
        assert a.estimate.value == pytest.approx(-b.estimate.value)
        assert (a.better, a.worse, a.equal) == (b.worse, b.better, b.equal)
        assert (a.scenes_better, a.scenes_worse, a.p_value) == (b.scenes_worse, b.scenes_better, b.p_value)
        if not math.isnan(a.estimate.low):
            assert (a.estimate.low, a.estimate.high) == pytest.approx((-b.estimate.high, -b.estimate.low))


def test_a_strategy_against_its_like_shows_nothing() -> None:
    twin = [dataclasses.replace(r, strategy="rectangular", settings=RECTANGLE.text) for r in OURS]
    found = differences(OURS + twin, [(MAP, RECTANGLE)])
    assert all((d.estimate.value, d.better, d.worse, d.p_value) == (0.0, 0, 0, 1.0) for d in found)
    avoided, impact = one(found, "avoided"), one(found, "v_impact_kmh")
    assert avoided.estimate.low == pytest.approx(-avoided.estimate.high)
    assert avoided.estimate.high > 0.1  # five scenes without a difference do not show that there is none
    assert math.isnan(impact.estimate.low)
    assert difference_table(found).rows == ()
    assert told_differences(found).endswith("the strategies do not differ.")


def test_seeds_of_a_variant_count_as_one() -> None:
    runs = OURS + THEIRS
    again = [dataclasses.replace(r, seed=1) for r in runs]
    once, twice = (one(differences(r, [(MAP, RECTANGLE)]), "avoided") for r in (runs, runs + again))
    assert (once.better, once.worse, once.equal) == (twice.better, twice.worse, twice.equal)
    assert twice.estimate.count == 2 * once.estimate.count
    assert (once.estimate.low, once.estimate.high) == pytest.approx((twice.estimate.low, twice.estimate.high))
    # a variant that is once better and once worse is equal on balance
    even = [run(MAP, "a", 0, collided=False), dataclasses.replace(run(MAP, "a", 0, collided=True), seed=1)]
    other = [run(RECTANGLE, "a", 0, collided=True), dataclasses.replace(run(RECTANGLE, "a", 0), seed=1)]
    found = one(differences(even + other, [(MAP, RECTANGLE)]), "avoided")
    assert (found.better, found.worse, found.equal) == (0, 0, 1)


def test_flags_are_compared_where_both_have_one() -> None:
    ours = [run(MAP, s, 0, flag_time_s=t) for s, t in (("a", 2.0), ("b", None), ("c", 3.0))]
    theirs = [run(RECTANGLE, s, 0, flag_time_s=t) for s, t in (("a", 2.5), ("b", 1.0), ("c", 3.004))]
    found = one(differences(ours + theirs, [(MAP, RECTANGLE)]), "flag_time_s")
    assert found.estimate.count == 2
    assert found.estimate.value == pytest.approx(-0.252)
    assert (found.better, found.worse, found.equal) == (1, 0, 1)  # 4 ms are none


def test_less_is_better_where_nothing_should_happen() -> None:
    runs = [run(MAP, "a", 0, "nothing", needless_stop=False, delay_s=0.5),
            run(RECTANGLE, "a", 0, "nothing", needless_stop=True, delay_s=1.5)]  # fmt: skip
    found = differences(runs, [(MAP, RECTANGLE)])
    stops = one(found, "needless_stops")
    assert (stops.estimate.value, stops.estimate.low, stops.estimate.high) == (-1.0, -1.0, 1.0)
    assert stops.better == one(found, "delay_s").better == 1
    assert [d.measure for d in found if COMPARED[d.measure].must == "brake"] == []


def test_measures_are_those_of_the_summaries() -> None:
    assert set(COMPARED) - set(MEASURES) == {"flag_time_s"}


def test_pairs() -> None:
    narrow, wide = (Point("map", (("margin_m", m),)) for m in (0.0, 1.8))
    assert pairs_with([narrow, wide, RECTANGLE], [wide, RECTANGLE]) == [
        (narrow, wide),
        (narrow, RECTANGLE),
        (RECTANGLE, wide),
    ]
    assert pairs_with_bases([MAP, narrow, Point("all")]) == [(narrow, MAP)]


def test_pairs_differ_in_the_area_alone_or_in_settings_alone() -> None:
    fair_map, fair_path = Point("map", (("margin_m", 0.5), *FAIR)), Point("path", FAIR)
    points = [fair_map, fair_path, MAP, RECTANGLE]
    assert pairs_with(points, points) == [(fair_path, fair_map), (MAP, fair_map), (RECTANGLE, MAP)]


def test_table_and_sentence() -> None:
    hits = {scene: [scene != "k"] for scene in "abcdefghijk"}
    runs = contacts(MAP, {scene: [False] for scene in hits}) + contacts(RECTANGLE, hits)
    found = differences(runs, [(MAP, RECTANGLE)])
    (row,) = csv.DictReader(io.StringIO(differences_csv([one(found, "avoided")]).decode()))
    assert (row["strategy"], row["against"], row["against_settings"]) == (
        "map",
        "rectangular",
        "half_width_m=2.6",
    )
    assert (row["better"], row["worse"], row["equal"]) == ("10", "0", "1")
    assert float(row["p_value"]) == stats.binomtest(10, 10, 0.5).pvalue
    assert float(row["difference_low"]) > 0.0
    (line,) = difference_table(found).rows
    assert line[:2] == ("map", "rectangular half_width_m=2.6")
    assert line[2].startswith("+91 [+")
    assert line[2].endswith("10:0, p 0.002")
    told = told_differences(found)
    assert "2 of 2 differences" in told
    assert "map against rectangular half_width_m=2.6: collisions avoided +91 [" in told
    assert "mean impact -27.3 [" in told
    assert "do not decide" not in told
    assert "none of 2 differences" in told_differences(differences(OURS + THEIRS, [(MAP, RECTANGLE)]))
