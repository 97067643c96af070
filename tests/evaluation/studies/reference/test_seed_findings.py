"""What other seeds change is told from the runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.study import SceneStudy
from evaluation.studies.reference.findings import seeds
from evaluation.studies.reference.findings.scenes import SHOWN
from evaluation.studies.reference.parts import PARTS

NAMES = ("the rectangle", "the map", "the path", "the rectangle as published", "the map as published")


def measured(name: str, must: str, variant: str, seed: int, bad: bool) -> RunMeasures:
    point = SHOWN[name]
    return RunMeasures(
        scene=f"scene to {must}", variant=variant, must=must, strategy=point.strategy, settings=point.text,
        preset="physical", weather="dry", seed=seed, v_test_kmh=50.0, collided=bad and must == "brake",
        v_impact_kmh=0.0, score=None, band=None, flag_time_s=None, flag_distance_m=None, flag_ttc_s=None,
        end_reason="passed", false_activation=False, needless_stop=bad and must == "nothing",
        speed_loss_kmh=0.0, delay_s=0.0, distance_m=100.0, duration_s=10.0, detections_mean=1.0,
        tracks_mean=1.0, dropped_share=0.0, min_ttc_s=None, max_btn=0.0,
    )  # fmt: skip


def runs(bad: Mapping[tuple[str, str], tuple[int, ...]]) -> list[RunMeasures]:
    """Two variants of each kind and three seeds; the first variant is bad for the seeds that are given."""
    return [
        measured(name, must, variant, seed, variant == "a" and seed in bad.get((name, must), ()))
        for name in NAMES
        for must in ("brake", "nothing")
        for variant in ("a", "b")
        for seed in range(3)
    ]


def test_counts_by_seed_and_both_intervals() -> None:
    table = seeds.seed_table(runs({("the rectangle", "brake"): (0, 1), ("the map", "nothing"): (0, 1, 2)}))
    rectangle, the_map, *_ = table.rows
    assert rectangle[:2] == ("the rectangle", "1, 1 and 2 of 2")
    # 1/2, 1/2, 1: mean 2/3, standard error 1/6, Student's quantile 4.30
    assert rectangle[2] == "0 to 100"
    assert the_map[4:6] == ("1, 1 and 1 of 2", "50 to 50")


def test_outcomes_that_differ_are_counted_and_named() -> None:
    told = seeds.told_seeds(runs({("the rectangle", "brake"): (2,), ("the map", "nothing"): (0, 1, 2)}))
    assert told[0] == (
        "1 of 20 outcomes are not the same for all 3 seeds (the rectangle: scene to brake at 50 km/h)."
    )
    assert "over the 3 seeds" in told[1]
    assert told[3] == (
        "Seed by seed, the map less the rectangle is 0, 0 and +1 of 2 collisions avoided and +1, +1 and +1 "
        "of 2 unnecessary stops."
    )
    assert seeds.told_changed(runs({})) == "None of 20 outcomes are not the same for all 3 seeds."


def test_the_part_repeats_what_the_page_shows_and_shares_a_seed_with_the_curves() -> None:
    parts = {part.name: part for part in PARTS}
    part, curves = parts["seeds"], parts["frontier_physical"]
    assert isinstance(part, SceneStudy)
    assert [*(SHOWN[name] for name in NAMES), Point("path")] == list(part.points)
    assert part.journal == curves.journal
    items = part.items(Path())
    shared = {item.key for item in items} & {item.key for item in curves.items(Path())}
    assert len(shared) * part.seeds == len(items)
