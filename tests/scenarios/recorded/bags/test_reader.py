"""Bags as recordings: against truth from outside, and by hand for each way that poses and topics come."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.bags.reader import BagReading, read_bag
from scenarios.recorded.dataset import Dataset, Objects
from scenarios.recorded.formats import FORMATS, read_dataset
from scenarios.ros.definitions import (
    DETECTION_3D_ARRAY,
    ODOMETRY,
    PREDICTION_ARRAY,
    TRANSFORMS,
    ros2_types,
)
from tests.scenarios.ros import bags_made
from tests.scenarios.ros import messages_made as made

TRUTH = json.loads((bags_made.DATA / "truth.json").read_text())
AHEAD = -math.pi / 2
"""z_rotation of a box that looks along x."""
S = 1_000_000_000

Row = tuple[str, str, int, Any]


def bag(path: Path, *rows: Row) -> Path:
    """A SQLite bag of messages: topic, type, time of receipt and message."""
    store = ros2_types()
    stored = [
        bags_made.Stored(topic, type_name, received_ns, bytes(store.serialize_cdr(message, type_name)))
        for topic, type_name, received_ns, message in rows
    ]
    return bags_made.write_sqlite(path / "a.db3", stored)


def boxes(time_ns: int, *rows: Any, frame_id: str = "lidar", received_ns: int | None = None) -> Row:
    message = made.predictions(*rows, time_ns=time_ns, frame_id=frame_id)
    return "/boxes", PREDICTION_ARRAY, time_ns if received_ns is None else received_ns, message


def pose(time_ns: int, x: float, y: float = 0.0, yaw: float = 0.0, topic: str = "/odom") -> Row:
    return topic, ODOMETRY, time_ns, made.odometry(time_ns, made.xyz(x, y), made.about_z(yaw))


def car(x: float = 10.0, y: float = 0.0, **fields: Any) -> Any:
    return made.prediction(position=made.xyz(x, y, -1.0), z_rotation=AHEAD, **fields)


def only(data: Dataset) -> tuple[Any, Objects]:
    [sequence] = data.sequences
    return sequence, sequence.detections


def noted(data: Dataset, text: str) -> bool:
    return any(text in note for note in data.notes)


# the bag that ROS 2 serialised


@pytest.mark.parametrize("path", [bags_made.SQLITE, bags_made.MCAP])
def test_every_box_is_where_it_was(path: Path) -> None:
    data = read_dataset(path)
    sequence, objects = only(data)
    assert data.kind == "bag"
    assert len(sequence) == len(TRUTH) == 40
    truth = [(k, *box.values()) for k, frame in enumerate(TRUTH) for box in frame["objects"]]
    assert len(objects) == len(truth) == 80
    assert objects.category.tolist() == [row[1] for row in truth]
    read = np.column_stack((objects.frame, objects.center_m, objects.size_m, objects.yaw_rad))
    expected = np.array([(row[0], *row[2:7]) for row in truth])
    np.testing.assert_allclose(read, expected, rtol=0.0, atol=1e-6)
    ego = np.array([frame["ego"] for frame in TRUTH])
    np.testing.assert_allclose(sequence.ego_xy_yaw(), ego, rtol=0.0, atol=1e-6)


def test_a_frame_without_header_has_the_time_of_receipt() -> None:
    data = read_dataset(bags_made.MCAP)
    stamps = [int(name) for name in only(data)[0].frame_name]
    expected = [frame["stamp_ns"] for frame in TRUTH]
    expected[7] = 1_700_000_000_703_000_000
    assert stamps == expected
    assert noted(data, "1 frames with an empty header")


def test_both_storages_are_the_same_recording() -> None:
    (first, a), (second, b) = only(read_dataset(bags_made.SQLITE)), only(read_dataset(bags_made.MCAP))
    np.testing.assert_array_equal(first.world_SE3_ego, second.world_SE3_ego)
    np.testing.assert_array_equal(first.stamp_s, second.stamp_s)
    for name in Objects.__slots__:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_velocities_are_used_where_their_axes_are_named() -> None:
    for axes in ("sensor", "world"):  # the vehicle looks along x
        _, objects = only(read_dataset(bags_made.MCAP, columns=BagReading(velocity_frame=axes)))
        np.testing.assert_allclose(objects.velocity_mps[:2], [(-5.0, 0.0), (0.0, 1.4)])
    _, objects = only(read_dataset(bags_made.MCAP))
    assert np.isnan(objects.velocity_mps).all()


# poses


def test_poses_are_interpolated_between_their_stamps(tmp_path: Path) -> None:
    path = bag(
        tmp_path, pose(10 * S, 0.0), pose(11 * S, 8.0, 2.0, math.pi / 2), boxes(10 * S + S // 4, car())
    )
    sequence, objects = only(read_bag(path))
    yaw = math.pi / 8
    np.testing.assert_allclose(sequence.ego_xy_yaw(), [(2.0, 0.5, yaw)])
    np.testing.assert_allclose(objects.center_m, [(2.0 + 10 * math.cos(yaw), 0.5 + 10 * math.sin(yaw))])
    np.testing.assert_allclose(objects.yaw_rad, [yaw], atol=1e-7)


def test_velocities_turn_with_the_sensor_or_do_not(tmp_path: Path) -> None:
    row = car(velocity=made.xyz(3.0, 1.0))
    path = bag(tmp_path, pose(10 * S, 0.0, 0.0, math.pi / 2), boxes(10 * S, row))
    for axes, expected in (("sensor", (-1.0, 3.0)), ("world", (3.0, 1.0))):
        _, objects = only(read_bag(path, BagReading(velocity_frame=axes)))
        np.testing.assert_allclose(objects.velocity_mps, [expected], atol=1e-12)


def test_the_sensor_is_where_the_transforms_have_it(tmp_path: Path) -> None:
    mounted = made.transforms(made.transform(0, "base_link", "roof", made.xyz(1.0, 0.0, 1.8), made.wxyz()))
    turned = made.transforms(made.transform(0, "roof", "lidar", made.xyz(), made.about_z(-math.pi / 2)))
    path = bag(
        tmp_path,
        ("/tf_static", TRANSFORMS, 9 * S, mounted),
        ("/tf_static", TRANSFORMS, 9 * S, turned),
        pose(10 * S, 100.0, 50.0, math.pi / 2),
        boxes(10 * S, car(10.0, 2.0)),
    )
    data = read_bag(path)
    _, objects = only(data)
    # the lidar looks to the right of a vehicle that looks along y: along x, from 1 m ahead
    np.testing.assert_allclose(objects.center_m, [(110.0, 53.0)])
    np.testing.assert_allclose(objects.yaw_rad, [0.0], atol=1e-7)  # z_rotation has single precision
    # its underside is 1 m below the lidar
    np.testing.assert_allclose(objects.bottom_m, [0.8])
    assert not noted(data, "no transform")


def test_transforms_alone_have_the_poses(tmp_path: Path) -> None:
    def step(time_ns: int, parent: str, child: str, x: float, yaw: float = 0.0) -> Row:
        row = made.transform(time_ns, parent, child, made.xyz(x), made.about_z(yaw))
        return "/tf", TRANSFORMS, time_ns, made.transforms(row)

    static = made.transforms(made.transform(0, "base_link", "lidar", made.xyz(2.0), made.wxyz()))
    path = bag(
        tmp_path,
        ("/tf_static", TRANSFORMS, S, static),
        step(10 * S, "map", "odom", 100.0),
        step(10 * S, "odom", "base_link", 0.0),
        step(10 * S + S // 2, "odom", "base_link", 5.0),
        step(11 * S, "map", "odom", 100.0),
        boxes(10 * S + S // 4, car()),
    )
    sequence, objects = only(read_bag(path))
    np.testing.assert_allclose(sequence.ego_xy_yaw(), [(102.5, 0.0, 0.0)])
    np.testing.assert_allclose(objects.center_m, [(114.5, 0.0)])


def test_a_sensor_without_transform_is_named(tmp_path: Path) -> None:
    other = made.transforms(made.transform(0, "base_link", "camera", made.xyz(), made.wxyz()))
    path = bag(tmp_path, ("/tf_static", TRANSFORMS, S, other), pose(10 * S, 0.0), boxes(10 * S, car()))
    assert noted(read_bag(path), "no transform from lidar to base_link (transforms of: base_link, camera)")


def test_frames_far_from_every_pose_are_left_out(tmp_path: Path) -> None:
    frames = [boxes(10 * S + k * S // 10, car()) for k in range(10)]
    path = bag(tmp_path, pose(10 * S, 0.0), pose(10 * S + S // 10, 1.0), *frames)
    data = read_bag(path)
    sequence, _ = only(data)
    # the last pose is carried on for 0.2 s at its speed of 10 m/s
    np.testing.assert_allclose(sequence.ego_xy_yaw()[:, 0], [0.0, 1.0, 2.0, 3.0])
    assert noted(data, "6 frames left out, for no pose of the vehicle is near enough")


def test_without_poses_boxes_stay_with_the_sensor(tmp_path: Path) -> None:
    data = read_bag(bag(tmp_path, boxes(10 * S, car(10.0, 3.0))))
    sequence, objects = only(data)
    assert sequence.world_SE3_ego is None
    np.testing.assert_allclose(objects.center_m, [(10.0, 3.0)])
    assert noted(data, "no poses of the vehicle: boxes stay in the frame lidar")


def test_impossible_poses_are_counted(tmp_path: Path) -> None:
    unset = ("/odom", ODOMETRY, 10 * S, made.odometry(10 * S, made.xyz(), made.wxyz(0.0)))
    path = bag(tmp_path, unset, pose(10 * S, math.nan), pose(10 * S, 4.0), boxes(10 * S, car()))
    data = read_bag(path)
    assert noted(data, "2 poses left out")
    assert only(data)[0].ego_xy_yaw()[0, 0] == 4.0


# times


def test_frames_that_were_overtaken_are_sorted_in(tmp_path: Path) -> None:
    times = (0, 2, 1, 3)
    rows = [boxes(10 * S + t * S // 10, car(), received_ns=11 * S + k) for k, t in enumerate(times)]
    data = read_bag(bag(tmp_path, *rows))
    np.testing.assert_allclose(only(data)[0].stamp_s, (10.0, 10.1, 10.2, 10.3))
    assert noted(data, "1 frames received after later ones")


def test_a_stamp_that_is_there_already_is_left_out(tmp_path: Path) -> None:
    rows = [boxes(10 * S, car(x), received_ns=10 * S + int(x)) for x in (5.0, 6.0)]
    data = read_bag(bag(tmp_path, *rows))
    np.testing.assert_allclose(only(data)[1].center_m, [(5.0, 0.0)])
    assert noted(data, "1 frames left out, for their stamps are there already")


def test_time_does_not_begin_anew(tmp_path: Path) -> None:
    rows = [boxes(t * S, car(), received_ns=100 * S + k) for k, t in enumerate((10, 11, 5))]
    with pytest.raises(
        DatasetError, match="time goes back by 6 s with the boxes received at 100000000002 ns"
    ):
        read_bag(bag(tmp_path, *rows))


# topics


def detections_3d(time_ns: int, *rows: Any, topic: str = "/vision") -> Row:
    return topic, DETECTION_3D_ARRAY, time_ns, made.detections_3d(*rows, time_ns=time_ns, frame_id="lidar")


def test_several_topics_with_boxes_are_named(tmp_path: Path) -> None:
    box = made.detection_3d(
        made.xyz(7.0, 1.0), made.wxyz(), made.xyz(4.0, 2.0, 1.5), made.hypothesis("Car", 0.7)
    )
    path = bag(tmp_path, boxes(10 * S, car()), detections_3d(10 * S, box))
    with pytest.raises(DatasetError, match=r"several topics with boxes: /boxes .*, /vision .*--topic"):
        read_bag(path)
    _, objects = only(read_bag(path, BagReading(topic="/vision")))
    np.testing.assert_allclose(objects.center_m, [(7.0, 1.0)])
    assert (objects.category.tolist(), objects.kind.tolist()) == (["car"], ["Car"])
    with pytest.raises(
        DatasetError, match=r"--topic /other: not a topic with boxes; there are: /boxes, /vis"
    ):
        read_bag(path, BagReading(topic="/other"))


def test_several_odometries_are_named(tmp_path: Path) -> None:
    path = bag(tmp_path, pose(10 * S, 1.0), pose(10 * S, 2.0, topic="/gps"), boxes(10 * S, car()))
    with pytest.raises(DatasetError, match=r"several topics with odometry: /gps .*, /odom .*--odometry"):
        read_bag(path)
    sequence, _ = only(read_bag(path, BagReading(odometry="/gps")))
    assert sequence.ego_xy_yaw()[0, 0] == 2.0


def test_a_bag_without_boxes_says_what_it_has(tmp_path: Path) -> None:
    with pytest.raises(
        DatasetError, match=r"no topic of .*PredictionArray.*; it has /odom \(nav_msgs/msg/Od"
    ):
        read_bag(bag(tmp_path, pose(10 * S, 1.0)))


def test_axes_have_names() -> None:
    with pytest.raises(DatasetError, match="--velocity-frame: unknown 'ego'"):
        BagReading(velocity_frame="ego")


# boxes


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    unset = made.detection_3d(
        made.xyz(), made.wxyz(0.0), made.xyz(4.0, 2.0, 1.5), made.hypothesis("car", 0.7)
    )
    rows = [
        made.detection_3d(made.xyz(x), made.wxyz(), made.xyz(4.0, 2.0, 1.5), *results)
        for x, results in (
            (5.0, [made.hypothesis("car", 0.7)]),
            (math.nan, [made.hypothesis("car", 0.7)]),
            (5.0, [made.hypothesis("dragon", 0.7)]),
            (5.0, [made.hypothesis("traffic_cone", 0.7)]),
            (5.0, []),
        )
    ]
    data = read_bag(bag(tmp_path, detections_3d(10 * S, *rows, unset)))
    _, objects = only(data)
    assert len(objects) == 1
    assert data.rejected == 2
    assert noted(data, "not known (classes.csv can say what they are): 1 without a class, 1 dragon")
    assert noted(data, "that are no road users: 1 traffic_cone")


def test_classes_of_the_users_own_count(tmp_path: Path) -> None:
    (tmp_path / "classes.csv").write_text("class,category\nDragon,truck\ncar,\n")
    path = bag(tmp_path, boxes(10 * S, car(), car(class_name="dragon")))
    assert only(read_bag(path))[1].category.tolist() == ["truck"]


def test_bags_of_ros1_are_recordings(tmp_path: Path) -> None:
    path = bags_made.write_ros1(tmp_path / "drive.bag", bags_made.ros1_rows())
    data = read_dataset(path)
    sequence, objects = only(data)
    assert sequence.name == "drive"
    assert np.bincount(objects.frame, minlength=5).tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(objects.center_m[0], (20.0, 3.0))
    np.testing.assert_allclose(objects.yaw_rad, 0.0, atol=1e-12)
    assert noted(data, "monitored lanes of /lanes are not used")


def test_options_of_bags_are_for_bags(tmp_path: Path) -> None:
    (tmp_path / "detections.csv").write_text("x_m\n")
    with pytest.raises(DatasetError, match="are for ROS bags, not for csv"):
        read_dataset(tmp_path, columns=BagReading(topic="/a"))
    assert "bag" in FORMATS


def test_an_empty_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no topic of"):
        read_bag(bag(tmp_path))
