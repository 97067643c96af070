"""Metrics of cases small enough to count by hand, and parity with an independent evaluation."""

import importlib.util
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.metrics import mot as metrics
from evaluation.metrics.matching import compare
from evaluation.metrics.mot import MotScore, evaluate
from evaluation.studies.mot.run import (
    labelled_categories,
    score_tracks,
    track_dataset,
)
from evaluation.studies.mot.tables import write_tracks
from scenarios.recorded.dataset import Camera, Objects
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.kitti import read_tracks
from smartmot.tracking.configs import tracker_config

needs_trackeval = pytest.mark.skipif(
    importlib.util.find_spec("trackeval") is None, reason="trackeval is not installed (extra mot)"
)

PROJECTION = np.array([[700.0, 0.0, 621.0, 0.0], [0.0, 700.0, 187.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def score(sequence: Any, tracks: Objects, similarity: str = "distance", best: bool = False) -> MotScore:
    compared = {"s": compare(sequence, tracks, "car", similarity)}
    return evaluate(compared, "car", similarity, best)[0]


@needs_trackeval
def test_perfect_tracking_is_a_hundred(objects: Any, sequence: Any) -> None:
    rows = [(k, i, 2.0 * k, 5.0 * i) for k in range(5) for i in range(3)]
    found = score(sequence(5, objects(rows)), objects(rows))
    ratios = (
        found.hota,
        found.deta,
        found.assa,
        found.mota,
        found.motp,
        found.idf1,
        found.samota,
        found.amota,
    )
    assert ratios == pytest.approx([100.0] * 8)
    assert (found.id_switches, found.fragmentations, found.false_positives, found.misses) == (0, 0, 0, 0)
    assert (found.matches, found.labels) == (15, 15)


@needs_trackeval
def test_one_id_switch(objects: Any, sequence: Any) -> None:
    """One object over four frames, two tracks of two frames each.

    MOTA 1 - 1/4. Identity: one track explains 2 of 4 labels, IDF1 = 2*2 / (2*2 + 2 + 2). Association: each
    match shares 2 frames out of 4 labelled and 2 tracked, 2/4; HOTA = sqrt(1 * 1/2).
    """
    truth = objects([(k, 7, float(k), 0.0) for k in range(4)])
    tracks = objects([(k, 1 + k // 2, float(k), 0.0) for k in range(4)])
    found = score(sequence(4, truth), tracks)
    assert found.id_switches == 1
    assert found.mota == pytest.approx(75.0)
    assert found.idf1 == pytest.approx(50.0)
    assert found.assa == pytest.approx(50.0)
    assert found.deta == pytest.approx(100.0)
    assert found.hota == pytest.approx(100.0 * math.sqrt(0.5))


@needs_trackeval
def test_a_gap_is_a_fragmentation_and_misses(objects: Any, sequence: Any) -> None:
    truth = objects([(k, 1, 0.0, 0.0) for k in range(6)])
    tracks = objects([(k, 1, 0.0, 0.0) for k in (0, 1, 4, 5)])
    others = objects([(k, 2, 30.0, 0.0) for k in range(6)])
    both = Objects.of(
        **{
            name: np.concatenate((getattr(truth, name), getattr(others, name)))
            for name in ("frame", "center_m", "size_m", "yaw_rad", "object_id", "category")
        }
    )
    found = score(sequence(6, both), tracks)
    assert (found.fragmentations, found.misses, found.id_switches) == (0, 8, 0)
    # trackeval forgets who was tracked only in frames in which something is; with the other object tracked it
    # sees the gap
    tracks = Objects.of(
        **{
            name: np.concatenate((getattr(tracks, name), getattr(others, name)))
            for name in ("frame", "center_m", "size_m", "yaw_rad", "object_id", "category")
        }
    )
    found = score(sequence(6, both), tracks)
    assert (found.fragmentations, found.misses, found.id_switches) == (1, 2, 0)


@needs_trackeval
def test_distance_becomes_similarity(objects: Any, sequence: Any) -> None:
    """0.9 m off: similarity 1 - 0.9/4 = 0.775, over 15 of HOTA's 19 thresholds 0.05, 0.10 ... 0.95."""
    truth = objects([(k, 1, 0.0, 0.0) for k in range(3)])
    found = score(sequence(3, truth), objects([(k, 1, 0.9, 0.0) for k in range(3)]))
    assert found.motp == pytest.approx(77.5)
    assert found.hota == pytest.approx(100.0 * 15 / 19)


@needs_trackeval
@pytest.mark.parametrize(("off_m", "matches"), [(1.999, 3), (2.001, 0)])
def test_a_match_ends_at_two_metres(objects: Any, sequence: Any, off_m: float, matches: int) -> None:
    truth = objects([(k, 1, 0.0, 0.0) for k in range(3)])
    assert score(sequence(3, truth), objects([(k, 1, 0.0, off_m) for k in range(3)])).matches == matches


@needs_trackeval
@pytest.mark.parametrize(("off_m", "matches"), [(1.33, 3), (1.34, 0)])
def test_overlap_of_shifted_boxes(objects: Any, sequence: Any, off_m: float, matches: int) -> None:
    """Boxes of 4 m shifted along by d overlap by (4 - d) / (4 + d), which is 1/2 at 4/3 m."""
    truth = objects([(k, 1, 0.0, 0.0) for k in range(3)])
    assert (
        score(sequence(3, truth), objects([(k, 1, off_m, 0.0) for k in range(3)]), "iou").matches == matches
    )


@needs_trackeval
def test_ignored_labels_cost_nothing_and_give_nothing(objects: Any, sequence: Any) -> None:
    rows = [(k, i, 0.0, 10.0 * i) for k in range(4) for i in range(3)]
    ignored = [i > 0 for _, i, _, _ in rows]
    tracks = objects([(k, i, 0.0, 10.0 * i) for k in range(4) for i in range(2)])  # the third is missed
    found = score(sequence(4, objects(rows, ignored=ignored)), tracks)
    assert (found.matches, found.misses, found.false_positives, found.labels) == (4, 0, 0, 4)


@needs_trackeval
def test_false_tracks_that_the_camera_excuses(objects: Any, sequence: Any) -> None:
    """With f = 700 px, a box 1.5 m high is over 35 px high at 30 m and under 22 px at 50 m."""
    frames = range(4)
    truth = objects([(k, 1, 20.0, 0.0) for k in frames])
    seen = [(k, 1, 20.0, 0.0) for k in frames]
    near, far = [(k, 2, 30.0, 5.0) for k in frames], [(k, 3, 50.0, -5.0) for k in frames]
    beside = [(k, 4, 20.0, 40.0) for k in frames]
    none = Camera(PROJECTION, np.zeros(0, dtype=np.int64), np.zeros((0, 4)))
    tracks = objects([*seen, *near, *far, *beside])
    assert score(sequence(4, truth), tracks).false_positives == 12
    assert score(sequence(4, truth, none), tracks).false_positives == 4
    # the near one is 5 m to the left, 117 px left of the image's centre at 30 m; a region there excuses it
    region = Camera(PROJECTION, np.arange(4), np.tile((430.0, 100.0, 600.0, 300.0), (4, 1)))
    assert score(sequence(4, truth, region), tracks).false_positives == 0
    # half of the frames
    region = Camera(PROJECTION, np.arange(2), np.tile((430.0, 100.0, 600.0, 300.0), (2, 1)))
    assert score(sequence(4, truth, region), tracks).false_positives == 2


@needs_trackeval
def test_a_region_does_not_excuse_what_matches(objects: Any, sequence: Any) -> None:
    rows = [(k, 1, 20.0, 0.0) for k in range(4)]
    region = Camera(PROJECTION, np.arange(4), np.tile((0.0, 0.0, 1242.0, 375.0), (4, 1)))
    found = score(sequence(4, objects(rows), region), objects(rows))
    assert (found.matches, found.misses) == (4, 0)


@needs_trackeval
def test_averages_over_recall(objects: Any, sequence: Any) -> None:
    """Two objects, tracked perfectly with scores 0.9 and 0.3.

    Up to recall 1/2 only the first counts: MOTA 1/2, scaled 1. Above it both: MOTA 1. So AMOTA is 3/4.
    """
    rows = [(k, i, 0.0, 10.0 * i) for k in range(4) for i in range(2)]
    tracks = objects(rows, score=[0.9 if i == 0 else 0.3 for _, i, _, _ in rows])
    found = score(sequence(4, objects(rows)), tracks)
    assert found.samota == pytest.approx(100.0)
    assert found.amota == pytest.approx(75.0)


@needs_trackeval
def test_best_threshold_leaves_out_unsure_false_tracks(objects: Any, sequence: Any) -> None:
    rows = [(k, 1, 0.0, 0.0) for k in range(4)]
    tracks = objects([*rows, *((k, 2, 0.0, 20.0) for k in range(4))], score=[0.8] * 4 + [0.2] * 4)
    everything, best = (score(sequence(4, objects(rows)), tracks, best=b) for b in (False, True))
    assert (everything.false_positives, everything.mota) == (4, pytest.approx(0.0))
    assert (best.false_positives, best.mota) == (0, pytest.approx(100.0))
    assert best.score_threshold == pytest.approx(0.8)


@needs_trackeval
def test_nothing_tracked(objects: Any, sequence: Any) -> None:
    found = score(sequence(2, objects([(0, 1, 0.0, 0.0), (1, 1, 0.0, 0.0)])), Objects.empty(), best=True)
    assert (found.misses, found.matches, found.hota, found.samota) == (2, 0, 0.0, 0.0)


def test_missing_trackeval_is_one_clear_error(
    monkeypatch: pytest.MonkeyPatch, objects: Any, sequence: Any
) -> None:
    monkeypatch.setitem(sys.modules, "trackeval.metrics", None)
    monkeypatch.setitem(sys.modules, "trackeval", None)
    with pytest.raises(metrics.MetricsUnavailableError, match=r"pip install 'smartmot\[metrics\]'$"):
        score(sequence(1, objects([(0, 1, 0.0, 0.0)])), Objects.empty())


@needs_trackeval
@pytest.mark.parametrize("threshold", ["best", "none"])
def test_equal_to_an_independent_evaluation_of_kitti(kitti: Path, tmp_path: Path, threshold: str) -> None:
    """The same tracks, as written to files, through both: within 0.01 points, counts equal."""
    names = ("0006", "0012")
    root = tmp_path / "data"
    root.mkdir()
    for folder in ("detections", "calib", "ego_pose", "label_02"):
        (root / folder).symlink_to(kitti / folder)
    lines = (kitti / "seqmap.txt").read_text().splitlines()
    (root / "seqmap.txt").write_text("".join(f"{line}\n" for line in lines if line.startswith(names)))
    data = read_dataset(root)
    assert [s.name for s in data.sequences] == list(names)
    tracked = track_dataset(data, tracker_config("default"))
    write_tracks(tmp_path / "tracks", data, tracked, ("kitti",))
    ours = {
        (s.category, s.similarity): s
        for s in score_tracks(tracked, ("distance", "iou"), threshold == "best")
        if s.sequence == "all"
    }
    report = tmp_path / "theirs.json"
    options = ("--root", root, "--score", threshold, "--json", report)
    subprocess.run(
        [sys.executable, kitti / "bev_mot_eval.py", tmp_path / "tracks", *options],
        check=True,
        capture_output=True,
    )
    theirs = json.loads(report.read_text())
    assert len(theirs) == len(ours) == 6
    for row in theirs:
        own = ours[row["cls"].lower(), {"dist": "distance", "iou": "iou"}[row["sim"]]]
        ratios = {"HOTA": own.hota, "DetA": own.deta, "AssA": own.assa, "MOTA": own.mota}
        ratios |= {"MOTP": own.motp, "IDF1": own.idf1}
        if threshold == "best":
            ratios |= {"sAMOTA": own.samota, "AMOTA": own.amota}
        for name, value in ratios.items():
            assert value == pytest.approx(100.0 * row[name], abs=0.01), (row["cls"], row["sim"], name)
        counts = (
            own.id_switches,
            own.fragmentations,
            own.false_positives,
            own.misses,
            own.matches,
            own.labels,
        )
        assert counts == tuple(row[name] for name in ("IDSW", "Frag", "FP", "FN", "TP", "GT"))


@needs_trackeval
@pytest.mark.parametrize("category", ["car", "pedestrian", "cyclist"])
def test_the_short_search_finds_the_same_threshold(kitti: Path, category: str) -> None:
    """Without averages over recall, only thresholds that can have the best MOTA are tried."""
    data = read_dataset(kitti)
    sequences = tuple(s for s in data.sequences if s.name in ("0012", "0014", "0016"))
    tracked = track_dataset(type(data)("kitti", sequences, log_odds=True), tracker_config("default"))
    compared = {t.sequence.name: compare(t.sequence, t.tracks, category, "distance") for t in tracked}
    whole = evaluate(compared, category, "distance")
    short = evaluate(compared, category, "distance", averages=False)
    assert np.isfinite(whole[0].samota)
    assert np.isnan([short[0].samota, short[0].amota]).all()
    for a, b in zip(whole, short, strict=True):
        assert replace(a, samota=0.0, amota=0.0) == replace(b, samota=0.0, amota=0.0)


@needs_trackeval
def test_tracks_read_back_from_a_file_score_the_same(kitti: Path, tmp_path: Path) -> None:
    data = read_dataset(kitti)
    [sequence] = [s for s in data.sequences if s.name == "0012"]
    [tracked] = track_dataset(type(data)("kitti", (sequence,), log_odds=True), tracker_config("default"))
    write_tracks(tmp_path, data, [tracked], ("kitti",))
    again = read_tracks(tmp_path / "0012.txt", len(sequence), sequence.world_SE3_ego)
    assert labelled_categories([tracked]) == ["car", "pedestrian", "cyclist"]
    assert np.abs(again.center_m - tracked.tracks.center_m).max() < 2e-6
    a, b = (
        evaluate({"0012": compare(sequence, tracks, "car", "distance")}, "car", "distance")[0]
        for tracks in (tracked.tracks, again)
    )
    assert (a.id_switches, a.misses, a.false_positives) == (b.id_switches, b.misses, b.false_positives)
    assert b.hota == pytest.approx(a.hota, abs=1e-3)
