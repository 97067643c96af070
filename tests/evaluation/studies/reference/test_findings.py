"""Sentences of the reference results follow the numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from evaluation.protocols.paper import PUBLISHED, PUBLISHED_FLAG_S, paper_score, paper_score_max
from evaluation.results.rows import RunRow
from evaluation.runs.execution import FrameTime
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.growth import GrowthRun
from evaluation.studies.reference.findings import cpna, crowds, scenes
from evaluation.studies.reference.mechanisms import CONDITIONS, MechanismRun
from evaluation.studies.reference.words import counted, listed, span
from scenarios.settings import settings_text


def row(strategy: str, v_test: float, v_impact: float, weather: str = "dry") -> RunRow:
    flag = PUBLISHED_FLAG_S[v_test]
    return RunRow(
        scenario="CPNA", strategy=strategy, preset="paper", weather=weather, adversaries="none", seed=0,
        v_test_kmh=v_test, v_impact_kmh=v_impact, collided=v_impact > 0, score=paper_score(v_test, v_impact),
        score_max=paper_score_max(v_test), flag_time_s=3.0, flag_distance_m=None, stop_gap_m=None,
        contact_time_s=None, t0_s=3.0 + flag + 0.1, end_reason="contact" if v_impact else "stopped",
        end_time_s=9.0, false_activation=False,
        detections=120, dropped_score=0, dropped_category=0, dropped_box=0, target_start_time_s=None,
        target_steady_time_s=None, ego_speed_at_contact_kmh=None, target_speed_at_contact_kmh=None,
        impact_location_percent=None, log=None,
    )  # fmt: skip


AS_PUBLISHED = [
    row(name, v, impact) for name, column in PUBLISHED.items() for v, (impact, _) in column.items()
]


def test_words() -> None:
    assert listed([10.0]) == "10"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert (span([1.0, 2.26], 1), span([1.04, 1.0], 1)) == ("1.0 to 2.3", "1.0")
    assert (counted(2, 2), counted(0, 2), counted(1, 2)) == ("all 2", "none of 2", "1 of 2")


def test_the_published_numbers_agree_with_themselves() -> None:
    told = cpna.told_table_one(AS_PUBLISHED)
    assert told[0] == (
        "Contact or none agrees with the paper in all 14 published cells. The scores are 9 of 10 "
        "(rectangular) and 10 of 10 (map); the paper has 9 and 10."
    )
    assert told[1].startswith("The 3 impact speeds that both have are 0.0 km/h")
    assert "At all 8 speeds" in told[2]
    assert told[2].endswith("0.10 s.")


def test_a_cell_that_differs_is_named() -> None:
    rows = [
        replace(r, v_impact_kmh=5.0) if (r.strategy, r.v_test_kmh) == ("map", 60.0) else r
        for r in AS_PUBLISHED
    ]
    assert "differs from the paper in 1 of 14 cells: map at 60 km/h." in cpna.told_table_one(rows)[0]


def test_others_that_change_nothing_contradict_the_paper_and_those_that_do_not() -> None:
    urban = [r for r in AS_PUBLISHED if r.v_test_kmh in (30.0, 40.0, 50.0)]
    assert "change no impact speed" in cpna.told_others(AS_PUBLISHED, urban)[0]
    worse = [
        replace(r, v_impact_kmh=r.v_impact_kmh + 10.0) if r.strategy == "rectangular" else r for r in urban
    ]
    assert "rectangular at 50 km/h from 23.8 to 33.8" in cpna.told_others(AS_PUBLISHED, worse)[0]
    calm, loud = (
        cpna.contradictions(AS_PUBLISHED, others, mechanisms(), AS_PUBLISHED) for others in (urban, worse)
    )
    assert sum("when others are around" in line for line in calm) == 1
    assert sum("when others are around" in line for line in loud) == 0


def mechanisms(clamps_hit: float = 0.0) -> list[MechanismRun]:
    """Runs as the explanation has them: a hit with the short rectangle, none with the long one."""
    hit = {0: 20.0, 2: clamps_hit}
    return [
        MechanismRun(c.strategy, settings_text(c.settings), v, seed, 0.01 * seed, hit.get(k, 0.0))
        for k, c in enumerate(CONDITIONS)
        for v in c.speeds_kmh
        for seed in range(2)
    ]


def test_reach_explains_the_table_only_if_the_long_rectangle_never_hits() -> None:
    assert cpna.is_reach(mechanisms())
    assert not cpna.is_reach(mechanisms(clamps_hit=1.0))
    assert not any("clamps" in line for line in cpna.told_mechanisms(mechanisms(clamps_hit=1.0)))


def test_where_a_real_car_gains() -> None:
    rows = [row(name, v, 12.0 if (name, v) == ("rectangular", 70.0) else 0.0)
            for name in ("rectangular", "map") for v in (60.0, 70.0)]  # fmt: skip
    assert cpna.told_physical(rows) == [
        "The map helps at 70 km/h: with the rectangle impacts are at 12.0 km/h, the map avoids the "
        "collision.",
        "At 60 km/h both end alike.",
        "Both score 1 of 1: the score, which ends at 60 km/h, sees no difference.",
    ]


@pytest.mark.parametrize(("hits", "odd"), [((30.0,), ["rain"]), ((50.0, 60.0), []), ((), [])])
def test_weather_in_which_a_slower_run_hits(hits: tuple[float, ...], odd: list[str]) -> None:
    rows = [row(name, v, 5.0 if v in hits else 0.0, "rain")
            for name in ("rectangular", "map") for v in (30.0, 50.0, 60.0)]  # fmt: skip
    assert cpna.odd_weathers(rows) == odd


def measured(name: str, must: str, bad: bool) -> RunMeasures:
    point = scenes.SHOWN[name]
    return RunMeasures(
        scene=f"scene to {must}", variant="v", must=must, strategy=point.strategy, settings=point.text,
        preset="physical", weather="dry", seed=0, v_test_kmh=50.0, collided=bad and must == "brake",
        v_impact_kmh=0.0, score=None, band=None, flag_time_s=None, flag_distance_m=None, flag_ttc_s=None,
        end_reason="passed", false_activation=False, needless_stop=bad and must == "nothing",
        speed_loss_kmh=0.0, delay_s=0.0, distance_m=100.0, duration_s=10.0, detections_mean=1.0,
        tracks_mean=1.0, dropped_share=0.0, min_ttc_s=None, max_btn=0.0,
    )  # fmt: skip


def test_pairs_are_compared_both_ways() -> None:
    runs = [measured(name, must, (name, must) in {("the rectangle", "brake"), ("the map", "nothing")})
            for name in scenes.SHOWN for must in ("brake", "nothing")]  # fmt: skip
    assert scenes.told_pair(runs, "the map", "the rectangle") == (
        "The map avoids 1 collision (scene to brake at 50 km/h) that the rectangle does not; the other way "
        "round no collision. It avoids no unnecessary stop that the rectangle does not; the other way round "
        "1 unnecessary stop (scene to nothing at 50 km/h)."
    )
    assert [r[1] for r in scenes.different_scenes(runs).rows] == ["scene to brake", "scene to nothing"]
    assert scenes.told_alike(runs) == [
        "Alike, all along the planned path, collisions avoided and unnecessary stops are 0 of 1 and 0 of 1 "
        "with the rectangle, 1 of 1 and 1 of 1 with the map, 1 of 1 and 0 of 1 with the path and 1 of 1 and "
        "0 of 1 with everything.",
        "As published, collisions avoided and unnecessary stops are 1 of 1 and 0 of 1 with the rectangle, 1 "
        "of 1 and 0 of 1 with the map and 1 of 1 and 0 of 1 with everything.",
        "Everything alike is the path again: every run ends as with the path.",
    ]
    assert scenes.short_table(runs, runs).rows[0][1:4] == ("0 of 1", "0 of 1", "0 of 1")


@pytest.mark.parametrize(("power", "in_proportion"), [(1, True), (2, False)])
def test_growth_in_proportion(power: int, in_proportion: bool) -> None:
    runs = [GrowthRun("all", n, 0, float(n), 3.0, False, 0.0) for n in (0, 50, 100)]
    spent = [FrameTime(10, 1.0 + 0.1 * run.others**power, 0.0) for run in runs]
    assert crowds.grows_in_proportion(runs, spent) == in_proportion
    assert "the flag comes no later" in crowds.told_growth(runs, spent)[0]
