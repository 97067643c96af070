"""Messages as arrays: each trap of the interface, by hand and with three peers' objects."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from scenarios.errors import DatasetError
from scenarios.ros.definitions import PREDICTION_ARRAY, ros2_types
from scenarios.ros.frames.transforms import ground_covariance
from scenarios.ros.messages import (
    DETECTION_TYPES,
    NO_CLASS_ID,
    READERS,
    DetectionMessage,
    read_bev_detections,
    read_detections_3d,
    read_lanes,
    read_odometry,
    read_predictions,
    read_transforms,
)
from smartmot.errors import ShapeError
from tests.scenarios.ros import messages_made as made

BAG = Path(__file__).parents[2] / "data" / "ros2" / "bevfusion" / "tracker_input_mcap"


def test_width_comes_before_length_and_the_position_is_the_underside() -> None:
    row = made.prediction(
        id=8,
        class_name="pedestrian",
        position=made.xyz(25.0, -7.0, -1.0),
        size=made.xyz(0.7, 0.6, 1.6),
        velocity=made.xyz(0.0, 1.4, 0.0),
        score=0.8,
    )
    read = read_predictions(made.predictions(row, time_ns=1_700_000_000_000_000_003, frame_id="lidar"), 5)
    assert (read.stamp_ns, read.frame_id, read.received_ns) == (1_700_000_000_000_000_003, "lidar", 5)
    np.testing.assert_allclose(read.position_m, [[25.0, -7.0, -0.2]])
    np.testing.assert_allclose(read.size_m, [[0.6, 0.7, 1.6]])
    np.testing.assert_allclose(read.velocity_mps, [[0.0, 1.4, 0.0]])
    assert (read.class_id.tolist(), read.class_name.tolist(), read.score.tolist()) == (
        [8],
        ["pedestrian"],
        [0.8],
    )


# mmdetection3d before 1.0: yaw 0 looks along -y, and yaw turns clockwise
@pytest.mark.parametrize(
    ("z_rotation", "ahead"),
    [
        (0.0, (0.0, -1.0)),
        (-math.pi / 2, (1.0, 0.0)),
        (math.pi / 2, (-1.0, 0.0)),
        (math.pi, (0.0, 1.0)),
        (-math.pi, (0.0, 1.0)),
    ],
)
def test_headings_turn_clockwise_from_the_right(z_rotation: float, ahead: tuple[float, float]) -> None:
    heading = read_predictions(made.predictions(made.prediction(z_rotation=z_rotation)), 0).heading_rad
    np.testing.assert_allclose([*np.cos(heading), *np.sin(heading)], ahead, atol=1e-12)


@given(st.floats(-1e3, 1e3))
def test_heading_and_rotation_say_the_same(z_rotation: float) -> None:
    [heading] = read_predictions(made.predictions(made.prediction(z_rotation=z_rotation)), 0).heading_rad
    assert math.remainder(heading + z_rotation + math.pi / 2, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_an_empty_header_leaves_the_time_of_receipt() -> None:
    read = read_predictions(made.predictions(made.prediction()), 42)
    assert (read.stamp_ns, read.frame_id, read.time_ns) == (None, "", 42)


def test_a_message_without_boxes_has_arrays_of_no_rows() -> None:
    for read in (
        read_predictions(made.predictions(), 0),
        read_detections_3d(made.detections_3d(), 0),
        read_bev_detections(SimpleNamespace(header=made.header(), bev_detections_list=[]), 0),
    ):
        assert len(read) == 0
        assert read.position_m.shape == (0, 3)
        assert read.quaternion.shape == (0, 4)
        assert read.heading_rad.shape == (0,)


def test_arrays_are_read_only() -> None:
    read = read_predictions(made.predictions(made.prediction()), 0)
    with pytest.raises(ValueError, match="read-only"):
        read.position_m[0, 0] = 1.0


def test_shapes_must_agree() -> None:
    read = read_predictions(made.predictions(made.prediction()), 0)
    values = {name: getattr(read, name) for name in DetectionMessage.__slots__}
    with pytest.raises(ShapeError, match="size_m"):
        DetectionMessage(**values | {"size_m": np.zeros((1, 2))})


def test_the_likeliest_class_of_a_3d_detection_counts() -> None:
    row = made.detection_3d(
        made.xyz(1.0, 2.0, 3.0),
        made.wxyz(math.cos(0.5), 0.0, 0.0, math.sin(0.5)),
        made.xyz(4.0, 2.0, 1.5),
        made.hypothesis("truck", 0.2),
        made.hypothesis("car", 0.7),
        made.hypothesis("bus", 0.1),
    )
    bare = made.detection_3d(made.xyz(), made.wxyz(0.0), made.xyz(1.0, 1.0, 1.0))
    read = read_detections_3d(made.detections_3d(row, bare, frame_id="/lidar"), 0)
    assert read.frame_id == "lidar"
    assert read.class_name.tolist() == ["car", ""]
    assert read.class_id.tolist() == [NO_CLASS_ID, NO_CLASS_ID]
    np.testing.assert_array_equal(read.score, [0.7, np.nan])
    np.testing.assert_allclose(read.position_m[0], (1.0, 2.0, 3.0))
    np.testing.assert_allclose(read.size_m[0], (4.0, 2.0, 1.5))
    # of a rotation that was never set there is no heading
    np.testing.assert_allclose(read.heading_rad, [1.0, np.nan], atol=1e-12)


def test_results_of_vision_msgs_before_4_are_read() -> None:
    row = made.detection_3d(
        made.xyz(), made.wxyz(), made.xyz(1.0, 1.0, 1.0), SimpleNamespace(id="car", score=0.5)
    )
    assert read_detections_3d(made.detections_3d(row), 0).class_name.tolist() == ["car"]


def test_boxes_of_one_message_are_in_one_frame() -> None:
    def rows(*frames: str) -> list[Any]:
        return [made.detection_3d(made.xyz(), made.wxyz(), made.xyz(), frame_id=f) for f in frames]

    assert read_detections_3d(made.detections_3d(*rows("cam", "")), 0).frame_id == "cam"
    with pytest.raises(DatasetError, match="several frames: cam, lidar"):
        read_detections_3d(made.detections_3d(*rows("cam"), frame_id="lidar"), 0)


def test_the_picture_of_the_authors_becomes_the_frame_of_the_lidar() -> None:
    # 20 m ahead and 3 m to the left, looking ahead: up in the picture, where y points down
    row = SimpleNamespace(type="Car", score=0.6, x=-3.0, y=-20.0, l=4.0, w=2.0, o=-math.pi / 2)
    # 5 m to the right, looking to the right: along x of the picture
    right = SimpleNamespace(type="Pedestrian", score=0.5, x=5.0, y=0.0, l=0.6, w=0.7, o=0.0)
    message = SimpleNamespace(header=made.header(7, "lidar"), bev_detections_list=[row, right])
    read = read_bev_detections(message, 0)
    np.testing.assert_allclose(read.position_m[:, :2], [(20.0, 3.0), (0.0, -5.0)])
    np.testing.assert_allclose(read.heading_rad, [0.0, -math.pi / 2], atol=1e-12)
    np.testing.assert_allclose(read.size_m[:, :2], [(4.0, 2.0), (0.6, 0.7)])
    assert np.isnan(read.velocity_mps).all()


def test_lanes_turn_from_carla_to_the_map() -> None:
    def way(*points: tuple[float, float, float]) -> Any:
        return SimpleNamespace(way=[made.xyz(*point) for point in points])

    lane = SimpleNamespace(
        left=way((0.0, -2.0, 0.5), (9.0, -2.0, 0.5)), right=way((0.0, 1.5, 0.0)), role="current"
    )
    read = read_lanes(SimpleNamespace(header=made.header(3, "map"), lanes=[lane]), 9)
    assert (read.stamp_ns, read.received_ns, read.lanes[0].role) == (3, 9, "current")
    np.testing.assert_allclose(read.lanes[0].left_m, [(0.0, 2.0, 0.5), (9.0, 2.0, 0.5)])
    np.testing.assert_allclose(read.lanes[0].right_m, [(0.0, -1.5, 0.0)])


def test_odometry_and_transforms_keep_names_and_order() -> None:
    pose = SimpleNamespace(position=made.xyz(1.0, 2.0, 3.0), orientation=made.wxyz(0.5, -0.5, 0.5, -0.5))
    twist = SimpleNamespace(linear=made.xyz(4.0), angular=made.xyz(z=0.1))
    odometry = read_odometry(
        SimpleNamespace(
            header=made.header(11, "map"),
            child_frame_id="base_link",
            pose=SimpleNamespace(pose=pose),
            twist=SimpleNamespace(twist=twist),
        ),
        12,
    )
    assert (odometry.frame_id, odometry.child_frame_id, odometry.time_ns) == ("map", "base_link", 11)
    assert odometry.quaternion.tolist() == [0.5, -0.5, 0.5, -0.5]
    assert odometry.linear_mps.tolist() == [4.0, 0.0, 0.0]
    assert odometry.angular_radps.tolist() == [0.0, 0.0, 0.1]
    row = SimpleNamespace(
        header=made.header(13, "/base_link"),
        child_frame_id="lidar",
        transform=SimpleNamespace(translation=made.xyz(1.0, 0.0, 1.8), rotation=made.wxyz()),
    )
    read = read_transforms(SimpleNamespace(transforms=[row]), 14)
    assert (read.frame_id, read.child_frame_id, read.stamp_ns.tolist()) == (("base_link",), ("lidar",), [13])
    assert read.position_m.tolist() == [[1.0, 0.0, 1.8]]


def test_objects_of_rosbags_and_of_mcap_read_alike() -> None:
    """Of messages that ROS 2 itself serialised."""
    store, count = ros2_types(), 0
    with (BAG / "tracker_input_mcap.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, _, message, theirs in reader.iter_decoded_messages():
            assert schema is not None
            read, ours = READERS[schema.name], store.deserialize_cdr(message.data, schema.name)
            first, second = read(ours, message.log_time), read(theirs, message.log_time)
            for name in type(first).__slots__:
                np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
            count += 1
    assert count == 80


def test_every_type_has_a_reader() -> None:
    assert set(DETECTION_TYPES) < set(READERS)
    assert PREDICTION_ARRAY in ros2_types().fielddefs


def test_the_covariance_of_the_likeliest_result_counts() -> None:
    unlikely, likely = made.hypothesis("car", 0.2), made.hypothesis("cyclist", 0.7)
    unlikely.pose.covariance[:] = 5.0
    likely.pose.covariance[:] = np.diag([0.4, 0.1, 0.2, 9.0, 9.0, 0.03]).ravel()
    likely.pose.covariance[[1, 6]] = 0.05
    row = made.detection_3d(made.xyz(1.0), made.wxyz(), made.xyz(2.0, 0.7, 1.7), unlikely, likely)
    silent = made.detection_3d(made.xyz(1.0), made.wxyz(), made.xyz(2.0, 0.7, 1.7))
    read = read_detections_3d(made.detections_3d(row, silent), 0)
    assert read.pose_covariance is not None
    np.testing.assert_array_equal(read.pose_covariance[0].ravel(), likely.pose.covariance)
    np.testing.assert_array_equal(read.pose_covariance[1], 0.0)


def test_a_covariance_is_seen_on_the_ground_of_the_map() -> None:
    """A camera looks along x of the map: its z is ahead, its x to the right, its y down."""
    camera = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    sent = np.zeros((1, 6, 6))
    sent[0, range(6), range(6)] = [
        0.01,
        0.02,
        4.0,
        0.5,
        0.03,
        0.6,
    ]  # 2 m in depth, turns about y are headings
    sent[0, 0, 2] = sent[0, 2, 0] = 0.1
    np.testing.assert_allclose(
        ground_covariance(camera, sent)[0],
        [[4.0, -0.1, 0.0], [-0.1, 0.01, 0.0], [0.0, 0.0, 0.03]],
        atol=1e-15,
    )
