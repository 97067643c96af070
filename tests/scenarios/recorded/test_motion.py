"""Where vehicle and objects of a recording were between its frames."""

import numpy as np
import pytest

from scenarios.recorded.dataset import Objects
from scenarios.recorded.motion import EgoMotion, LabelMotion, boxes_at
from smartmot.geometry import corners

TIME_S = np.arange(41) / 10.0


def circle(radius_m: float, speed_mps: float) -> EgoMotion:
    angle = speed_mps / radius_m * TIME_S
    pose = np.column_stack((radius_m * np.sin(angle), radius_m * (1 - np.cos(angle)), angle))
    return EgoMotion(TIME_S, pose, 4.0, 2.0)


def test_poses_lie_between_those_of_the_frames_also_over_half_a_turn() -> None:
    yaw = np.array([np.pi - 0.1, -np.pi + 0.1])
    ego = EgoMotion(np.array([0.0, 1.0]), np.column_stack((np.array([0.0, 2.0]), np.zeros(2), yaw)), 4.0, 2.0)
    assert ego.pose(np.array([0.5]))[0] == pytest.approx([1.0, 0.0, np.pi])


def test_way_and_acceleration_of_a_vehicle_that_slows_and_reverses() -> None:
    x = 2.0 * TIME_S - 0.5 * TIME_S**2  # at its farthest after 2 s
    ego = EgoMotion(TIME_S, np.column_stack((x, np.zeros((len(x), 2)))), 4.0, 2.0)
    assert ego.driven_m == pytest.approx(4.0)
    assert ego.accel_mps2(np.array([0.5, 2.0, 3.5])) == pytest.approx(np.full(3, -1.0))
    assert np.isnan(ego.accel_mps2(np.array([0.4, 3.6]))).all()  # half a second is missing on one side


def test_ahead_follows_the_bend_and_goes_straight_on_beyond_its_end() -> None:
    ego = circle(20.0, 5.0)
    boxes = ego.ahead(1.0, np.array([0.0, 5.0, 15.0, 18.0]))
    assert boxes.center_m[:3] == pytest.approx(ego.pose(np.array([1.0, 2.0, 4.0]))[:, :2], abs=1e-2)
    last = ego.pose(np.array([4.0]))[0]
    assert boxes.center_m[3] == pytest.approx(
        last[:2] + 3.0 * np.array([np.cos(last[2]), np.sin(last[2])]), abs=1e-2
    )


def labels(rows: list[tuple[int, int, float]]) -> Objects:
    table = np.array(rows, dtype=np.float64)
    return Objects.of(
        table[:, 0].astype(np.int64),
        np.column_stack((table[:, 2], np.zeros(len(table)))),
        object_id=table[:, 1].astype(np.int64),
        size_m=np.ones((len(table), 2)),
        yaw_rad=np.full(len(table), np.pi),
    )


def test_objects_move_from_label_to_label_and_their_speeds_are_those_of_half_a_second() -> None:
    rows = [(k, 7, 0.3 * k) for k in range(11) if k != 5] + [(3, 2, 1.0), (3, 2, 9.0)]
    motion = LabelMotion(labels(rows), TIME_S)
    assert len(motion.labels) == 11  # the second label of an object in a frame says nothing new
    assert [o.object_id for o in motion.objects] == [2, 7]
    walker = motion.objects[1]
    assert walker.boxes(np.array([0.5])).center_m[0] == pytest.approx([1.5, 0.0])
    assert walker.velocity_mps == pytest.approx([3.0, 0.0])
    of_walker = motion.speed_mps[motion.index == 1]
    assert of_walker == pytest.approx(np.full(10, -3.0))  # against its heading
    assert motion.speed_mps[motion.index == 0] == pytest.approx([0.0])
    assert [o.object_id for o in motion.between(0.35, 0.9)] == [7]
    assert motion.between(1.1, 2.0) == []


def test_velocities_are_those_of_each_object_on_its_own() -> None:
    rng = np.random.default_rng(5)
    rows = [(f, o, float(rng.normal())) for o in range(6) for f in range(len(TIME_S)) if rng.random() < 0.6]
    together = LabelMotion(labels(rows), TIME_S)
    for k, o in enumerate(together.objects):
        alone = LabelMotion(labels([row for row in rows if row[1] == o.object_id]), TIME_S)
        assert (together.velocity_mps[together.index == k] == alone.velocity_mps).all()
        for j, (time_s, center_m) in enumerate(zip(o.time_s, o.center_m, strict=True)):
            # from the first label of the half second before, or from the one before
            since = min(int(np.argmax(o.time_s >= time_s - 0.5 - 1e-6)), max(j - 1, 0))
            if j:
                expected = (center_m - o.center_m[since]) / (time_s - o.time_s[since])
                assert alone.velocity_mps[j] == pytest.approx(expected, rel=1e-12)


def test_bounds_hold_an_object_at_every_time_and_its_boxes_are_those_of_all_at_once() -> None:
    rng = np.random.default_rng(6)
    yaw = rng.uniform(-3.1, 3.1, 60)
    given = Objects.of(
        np.repeat(np.arange(20), 3),
        rng.normal(scale=9.0, size=(60, 2)),
        object_id=np.tile([4, 8, 9], 20),
        size_m=rng.uniform(0.5, 9.0, (60, 2)),
        yaw_rad=yaw,
    )
    motion = LabelMotion(given, TIME_S)
    for o, of_object in zip(motion.objects, (yaw[k::3] for k in range(3)), strict=True):
        assert (o.yaw_rad == np.unwrap(of_object)).all()
        boxes = o.boxes(np.linspace(-1.0, 5.0, 200))
        ring = corners(boxes.center_m, boxes.size_m, boxes.yaw_rad)
        assert (ring.min(axis=(0, 1)) >= o.bounds_m[:2]).all()
        assert (ring.max(axis=(0, 1)) <= o.bounds_m[2:]).all()
    for time_s in (-1.0, 0.73, 1.2, 9.0):
        together = boxes_at(list(motion.objects), time_s)
        for k, o in enumerate(motion.objects):
            alone = o.boxes(np.array([time_s]))
            assert (together.center_m[k] == alone.center_m[0]).all()
            assert (together.size_m[k] == alone.size_m[0]).all()
            assert together.yaw_rad[k] == alone.yaw_rad[0]
    assert len(boxes_at([], 0.0)) == 0


def test_no_labels_at_all() -> None:
    motion = LabelMotion(Objects.empty(), TIME_S)
    assert motion.objects == ()
    assert len(motion.rows) == len(TIME_S)
    assert motion.between(0.0, 4.0) == []
