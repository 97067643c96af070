"""Detectors side by side: what counts, and that the numbers are those of the clouds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluation.studies.detectors import clouds as cloud_sets
from evaluation.studies.detectors.clouds import (
    ComposedClouds,
    DrawnClouds,
    KittiDrive,
    KittiObjects,
    LabelledCloud,
    all_clouds,
)
from evaluation.studies.detectors.comparison import (
    FARTHEST_M,
    LEAST_OVERLAP,
    DetectorComparison,
    match_cloud,
    scores_of,
)
from smartmot.lidar import BoxDetections
from smartmot.pointcloud import Boxes3D, PointCloud

LIDAR = Path(__file__).parents[5] / "shared" / "lidar"


def detections(boxes: Boxes3D, category: str) -> BoxDetections:
    count = len(boxes)
    return BoxDetections(
        boxes, np.full(count, 0.9), np.full(count, category), (), np.zeros(0, np.int64), np.arange(count)
    )


def cloud_of(x_y_points: list[tuple[float, float, int]]) -> LabelledCloud:
    """Cars on the ground, each with so many points in its middle."""
    center = np.array([(x, y, 0.75) for x, y, _ in x_y_points])
    boxes = Boxes3D(center, np.tile([4.0, 1.8, 1.5], (len(center), 1)), np.zeros(len(center)))
    points = np.repeat(center, [count for *_, count in x_y_points], axis=0)
    nobody = np.zeros(len(center), dtype=np.bool_)
    return LabelledCloud(PointCloud(points), boxes, np.full(len(center), "car"), nobody)


def test_labels_off_the_field_and_with_few_points_neither_count_nor_make_boxes_wrong() -> None:
    labelled = cloud_of([(20.0, 0.0, 10), (20.0, 9.0, 9), (FARTHEST_M + 1.0, 0.0, 50), (10.0, 9.0, 50)])
    matched, distance_m, points = match_cloud(labelled, detections(labelled.boxes, "car"), "car")
    assert distance_m.tolist() == [20.0]
    assert points.tolist() == [10.0]
    counts = matched.counts(0.3)
    assert (counts.true_positives, counts.false_positives, counts.missed) == (1, 0, 0)


def test_a_box_on_a_van_is_no_mistake_for_cars() -> None:
    labelled = cloud_of([(20.0, 0.0, 50)])
    van = LabelledCloud(labelled.cloud, labelled.boxes, labelled.category, np.array([True]))
    matched, distance_m, _ = match_cloud(van, detections(van.boxes, "car"), "car")
    assert len(distance_m) == 0
    assert matched.counts(0.3).false_positives == 0


@pytest.mark.parametrize(
    "clouds", [DrawnClouds("hdl32", 1.9, 4, 5), ComposedClouds("hdl32", 1.9, 8, 5)], ids=lambda c: c.name
)
def test_truth_as_detections_is_right_everywhere(
    clouds: DrawnClouds | ComposedClouds, monkeypatch: pytest.MonkeyPatch
) -> None:
    def truth(cloud: PointCloud, config: object) -> BoxDetections:
        labelled = next(each for each in all_clouds(clouds) if each.cloud is cloud)
        count = len(labelled.boxes)
        return BoxDetections(
            labelled.boxes,
            np.full(count, 0.9),
            labelled.category,
            (),
            np.zeros(0, np.int64),
            np.arange(count),
        )

    monkeypatch.setattr("evaluation.studies.detectors.comparison.detect", truth)
    monkeypatch.setattr("evaluation.studies.detectors.comparison._detected", _uncached())
    labels = 0
    for category in LEAST_OVERLAP:
        scores, spent = scores_of(clouds, "plain", category)
        assert spent.frames == scores.frames == clouds.count
        assert (scores.false_positives, scores.missed, scores.untouched) == (0, 0, 0)
        if scores.labels:
            assert (scores.average_precision, scores.best_f1) == (1.0, 1.0)
        assert scores.labels == scores.near_labels + scores.mid_labels + scores.far_labels
        assert scores.labels == scores.few_labels + scores.some_labels + scores.many_labels
        labels += scores.labels
    assert labels >= 5


def _uncached() -> object:
    from evaluation.studies.detectors import comparison

    return comparison._detected.__wrapped__


def test_the_study_is_resumed_and_writes_a_line_per_class(tmp_path: Path) -> None:
    study = DetectorComparison("detectors", (DrawnClouds("hdl32", 1.9, 2, 6),), ("plain",))
    items = study.items(tmp_path)
    assert len({item.key for item in items}) == len(items) == len(LEAST_OVERLAP)
    finished, before = study.carry_out(items, tmp_path, "", 1)
    assert before == 0
    written = study.write(tmp_path, items, finished)
    assert {path.name for path in written} == {
        "runs.csv", "times.csv", "detectors.json", "table.md", "groups.md"
    }  # fmt: skip
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 1 + len(items)
    again, before = study.carry_out(items, tmp_path, "", 1)
    assert before == len(items)
    assert [again[item.key][0] for item in items] == [finished[item.key][0] for item in items]


def test_another_seed_height_or_file_is_another_item(tmp_path: Path) -> None:
    sets = [DrawnClouds("hdl32", 1.9, 2, 6), DrawnClouds("hdl32", 1.8, 2, 6), DrawnClouds("hdl32", 1.9, 2, 7)]
    keys = {DetectorComparison("d", (each,), ("plain",)).items(tmp_path)[0].key for each in sets}
    (tmp_path / "a.txt").write_text("1")
    first = KittiDrive(tmp_path).digest
    (tmp_path / "a.txt").write_text("2")
    assert len(keys) == len(sets)
    assert KittiDrive(tmp_path).digest != first


@pytest.mark.skipif(not LIDAR.is_dir(), reason="real clouds are not in ../shared/lidar")
def test_labels_of_kitti_hold_their_points() -> None:
    """Of the labels near the sensor nearly all: a wrong frame or time would leave them empty."""
    for clouds, count in (
        (KittiObjects(LIDAR / "kitti_object"), 4),
        (KittiDrive(LIDAR / "kitti_sequence_0000"), 20),
    ):
        frames = list(clouds.clouds())
        assert len(frames) == count
        held = [
            labelled.boxes.point_counts(labelled.cloud.xyz_m, cloud_sets.AROUND_M)[
                np.hypot(*labelled.boxes.center_m[:, :2].T) < 30.0
            ]
            for labelled in frames
        ]
        points = np.concatenate(held)
        assert (points >= 5).mean() > 0.95
