"""KITTI's, the thesis' and nuScenes' measures against other programs' values and cases by hand."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.errors import ArgumentError
from evaluation.metrics.detection.counts import DetectionCounts, match_detections
from evaluation.metrics.detection.frames import in_same_frames
from evaluation.metrics.detection.groups import occlusion_groups, range_groups
from evaluation.metrics.detection.kitti import average_precision
from evaluation.metrics.detection.nuscenes import class_scores, matched_at
from evaluation.metrics.detection.pairs import frame_pairs
from scenarios.recorded.kitti_objects.labels import ObjectLines, read_objects

ROOT = Path(__file__).parents[4]
ORACLE = ROOT.parent / "shared" / "lidar" / "oracle" / "pointrcnn_ap.json"
NUSCENES = ROOT / "tests" / "data" / "lidar" / "nuscenes_small"
ALL = np.ones(1000, dtype=np.bool_)


def lines(*rows: tuple[Any, ...], frames: int = 1, **changes: list[Any]) -> ObjectLines:
    """Cars of 4 x 2 x 1.5 m from frame, camera x, z and score; image boxes 100 px wide and 60 px high."""
    table = np.array([row[1:4] for row in rows], dtype=np.float64).reshape(-1, 3)
    count = len(rows)
    left = 100 + 20 * table[:, 0]
    names = np.array([f"{frame:06d}" for frame, *_ in rows], dtype=np.str_)
    values: dict[str, Any] = {
        "frame": names,
        "type_name": np.full(count, "Car"),
        "truncated": np.zeros(count),
        "occluded": np.zeros(count),
        "alpha_rad": np.zeros(count),
        "image_box_px": np.column_stack((left, np.full(count, 100), left + 100, np.full(count, 160))),
        "camera_box": np.column_stack(
            (
                np.tile((1.5, 2.0, 4.0), (count, 1)),
                table[:, 0],
                np.full(count, 1.6),
                table[:, 1],
                np.zeros(count),
            )
        ),
        "score": table[:, 2],
        "frames": np.array([f"{k:06d}" for k in range(frames)]),
    }
    values |= {name: np.array(value) for name, value in changes.items()}
    values["frames"] = tuple(values["frames"].tolist())
    return ObjectLines(**values)


@pytest.mark.parametrize("sequence", ["0012", "0006"])
def test_values_of_openpcdets_copy_of_kittis_program(kitti: Path, sequence: str) -> None:
    if not ORACLE.is_file():
        pytest.skip("no reference values in ../shared/lidar/oracle")
    reference = json.loads(ORACLE.read_text())["sequences"][sequence]
    labels, detections, _ = in_same_frames(
        read_objects(kitti / "label_02" / f"{sequence}.txt"), read_objects(kitti / "detections")
    )
    results = average_precision(labels, detections, list(reference))
    matched = match_detections(labels, detections.chosen(detections.score >= 2.0))
    for name, values in reference.items():
        for view, key in (("bev", "bev"), ("3d", "d3")):
            own = [each for each in results if (each.type_name, each.view) == (name, view)]
            np.testing.assert_allclose([each.r11 for each in own], values["ap"][f"{key}_R11"], atol=1e-3)
            np.testing.assert_allclose([each.r40 for each in own], values["ap"][f"{key}_R40"], atol=1e-3)
        counts = matched.counts(matched.labels.type_name == name, matched.detections.type_name == name)
        expected = [values["f1_3d_050"][key] for key in ("TP", "FP", "FN", "FN_untouched")]
        assert counts == DetectionCounts(*expected)


def test_values_of_the_nuscenes_devkit() -> None:
    reference = json.loads((NUSCENES / "devkit.json").read_text())
    results = class_scores(
        read_objects(NUSCENES / "labels"), read_objects(NUSCENES / "results"), list(reference)
    )
    for each in results:
        values = reference[each.type_name]
        np.testing.assert_allclose(each.ap, values["ap"], atol=1e-9)
        errors = [each.translation_m, each.scale, each.orientation_rad]
        expected = [values[key] for key in ("trans_err", "scale_err", "orient_err")]
        np.testing.assert_allclose(errors, expected, atol=1e-9)


def ap_40(labels: ObjectLines, detections: ObjectLines, level: int = 0) -> float:
    return average_precision(labels, detections, ["Car"])[6 + level].r40  # in space


TRUTH = [(0, 0, 10, 1), (0, 8, 10, 1), (1, 0, 20, 1), (1, 9, 20, 1)]


def test_all_found_is_100_and_half_found_is_50() -> None:
    rows = [(frame, 0, 20, 1.0 - 0.01 * frame) for frame in range(80)]
    labels = lines(*rows, frames=80)
    assert ap_40(labels, labels) == pytest.approx(100.0)
    assert ap_40(labels, lines(*rows[:40], frames=80)) == pytest.approx(50.0, abs=2.5)


@pytest.mark.parametrize("count", [1, 4, 40, 41])
def test_few_labels_reach_few_recalls(count: int) -> None:
    # as evaluate_object.cpp has it: every threshold is the score of a true positive
    labels = lines(*[(frame, 0, 20, 1.0) for frame in range(count)], frames=count)
    assert ap_40(labels, labels) == pytest.approx(100.0 * (count - 1) / 40)


def test_neighbours_and_hard_labels_are_neither_missed_nor_right() -> None:
    types = ["Car", "Van", "Car", "Car"]
    labels = lines(*TRUTH, frames=2, type_name=types, occluded=[0, 0, 3, 0], truncated=[0, 0, 0, 0.4])
    detections = lines(*TRUTH, frames=2)
    easy, _, hard = average_precision(labels, detections, ["Car"])[6:]
    assert (easy.labels, hard.labels) == (1, 2)
    assert (easy.r11, hard.r40) == (pytest.approx(100 / 11), pytest.approx(100.0 * 1 / 40))


def test_low_detections_are_no_false_positives() -> None:
    labels = lines(*TRUTH, frames=2)
    ghost = [(1, -20, 30, 9.0)]
    low = np.vstack((labels.image_box_px, [[0, 100, 100, 139.5]])).tolist()
    tall = np.vstack((labels.image_box_px, [[0, 100, 100, 140.5]])).tolist()
    assert ap_40(labels, lines(*TRUTH, *ghost, frames=2, image_box_px=low)) == pytest.approx(
        ap_40(labels, labels)
    )
    assert ap_40(labels, lines(*TRUTH, *ghost, frames=2, image_box_px=tall)) < 0.9 * ap_40(labels, labels)


def test_regions_that_are_not_labelled_count_in_the_image_alone() -> None:
    car, region = (0, 0, 10, 1.0), (0, 30, 30, 1.0)
    labels = lines(car, region, type_name=["Car", "DontCare"])
    detections = lines(car, (0, 30, 30, 2.0))
    image, bev, space = (average_precision(labels, detections, ["Car"])[k].r11 for k in (0, 3, 6))
    assert image == pytest.approx(100 / 11)
    assert bev == space == pytest.approx(50 / 11)


def test_thesis_counts_by_hand() -> None:
    # a duplicate, a box beside its car (IoU 1/3: shifted by half its length), a ghost, and a car without any
    labels = lines((0, 0, 10, 1), (0, 10, 10, 1), (0, 20, 10, 1))
    detections = lines((0, 0, 10, 0.9), (0, 0.1, 10, 0.95), (0, 12, 10, 0.8), (0, 0, 40, 0.7))
    matched = match_detections(labels, detections)
    assert matched.is_true.tolist() == [False, True, False, False]
    counts = matched.counts(ALL[:3], ALL[:4])
    assert counts == DetectionCounts(true_positives=1, false_positives=3, missed=2, untouched=1)
    assert (counts.precision, counts.recall(), counts.recall(thesis=True)) == (0.25, 1 / 3, 0.5)
    assert counts.f1() == pytest.approx(2 / 7)
    assert counts.f1(thesis=True) == pytest.approx(2 / 6)


def test_the_thesis_own_table() -> None:
    # Ten composed scenes: PointPillars 7 true positives, 80 false, none untouched; F1 0.149
    counts = DetectionCounts(7, 80, 3, 0)
    assert (round(counts.precision, 2), counts.recall(thesis=True), round(counts.f1(thesis=True), 3)) == (
        0.08,
        1,
        0.149,
    )
    assert counts.recall() == 0.7


def test_a_detection_of_another_class_is_false() -> None:
    matched = match_detections(lines((0, 0, 10, 1)), lines((0, 0, 10, 1), type_name=["Pedestrian"]))
    assert matched.counts(ALL[:1], ALL[:1]) == DetectionCounts(0, 1, 1, 1)


@pytest.mark.parametrize("measure", ["kitti", "thesis", "nuscenes"])
def test_nothing_detected_is_nothing(measure: str) -> None:
    labels, none = lines(*TRUTH, frames=2), lines(frames=2)
    if measure == "kitti":
        assert {(each.r11, each.r40) for each in average_precision(labels, none, ["Car"])} == {(0.0, 0.0)}
    elif measure == "thesis":
        assert match_detections(labels, none).counts(ALL[:4], ALL[:0]) == DetectionCounts(0, 0, 4, 4)
    else:
        (score,) = class_scores(labels, none, ["Car"])
        assert (score.mean_ap, score.translation_m) == (0.0, 1.0)
        assert matched_at(labels, none, 2.0).counts(ALL[:4], ALL[:0]) == DetectionCounts(0, 0, 4, 4)


def test_pairs_are_those_of_the_same_frame() -> None:
    rng = np.random.default_rng(2)
    a, b = (rng.choice(["x", "y", "z"], count) for count in (7, 9))
    i, j = frame_pairs(a, b)
    expected = [(k, m) for k in range(7) for m in range(9) if a[k] == b[m]]
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == expected


def test_groups_share_out_what_there_is() -> None:
    labels = lines(*TRUTH, frames=2, occluded=[0, 1, 2, 3])
    groups = range_groups(labels, labels)
    assert sum(group.labels for group in groups).tolist() == [1] * 4  # type: ignore[union-attr]
    assert [group.name for group in groups if group.labels.any()] == ["10 to 20 m", "20 to 30 m"]
    assert [int(group.labels.sum()) for group in occlusion_groups(labels)] == [1, 1, 1, 1]


def test_frames_without_labels_are_left_out_and_said() -> None:
    labels = lines((0, 0, 10, 1), frames=2)
    detections = lines((0, 0, 10, 1), (5, 0, 10, 1), frames=6)
    _, kept, notes = in_same_frames(labels, detections)
    assert len(kept) == 1
    assert notes == ["1 detections in 4 frames without labels left out"]
    with pytest.raises(ArgumentError, match="no frame in common"):
        in_same_frames(labels, lines((3, 0, 10, 1)))
