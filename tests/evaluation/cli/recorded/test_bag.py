"""`smartmot-eval bag`: from a bag to a bag, with what would have been braked for."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from evaluation.cli.entry import main
from scenarios.live.topics import COLLISION, TRACKS
from scenarios.presets import PHYSICAL
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.definitions import (
    BEV_DETECTIONS,
    ODOMETRY,
    OLD_TRANSFORMS,
    PREDICTION_ARRAY,
    TRANSFORMS,
    ros1_types,
    ros2_types,
)
from scenarios.ros.making import rosbags_make

DATA = Path(__file__).parents[3] / "data" / "ros2" / "bevfusion"
START_NS = 1_700_000_000_000_000_000
Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Runs `smartmot-eval bag`: status, output, errors."""

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", "bag", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return run


def write_drive(
    path: Path, frames: int, walks: bool = True, poses: bool = True, boxes: bool = True, back: int = 0
) -> Path:
    """A vehicle with 10 m/s and a walker who is in the middle of its way at 40 m when it is there.

    The last frames come again at the end if time goes back.
    """
    types = ros2_types()
    make = rosbags_make(types)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        names = (("/bevfusion_detections", PREDICTION_ARRAY), ("/odom", ODOMETRY))
        topics = {kind: bag.add_connection(name, kind, typestore=types) for name, kind in names}

        def write(kind: str, time_ns: int, stamp_ns: int, **fields: Any) -> None:
            sec, nanosec = divmod(START_NS + stamp_ns, 10**9)
            stamp = make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
            header = make("std_msgs/msg/Header", stamp=stamp, frame_id="map" if kind == ODOMETRY else "lidar")
            message = make(kind, header=header, **fields)
            bag.write(topics[kind], START_NS + time_ns, types.serialize_cdr(message, kind))

        for k in [*range(frames), *range(frames - back, frames)]:
            stamp_ns = k * 50_000_000
            time_ns = stamp_ns + 10_000_000
            x_m = 10.0 * k * 0.05
            if poses:
                pose = make(
                    "geometry_msgs/msg/Pose",
                    position=make("geometry_msgs/msg/Point", x=x_m),
                    orientation=make("geometry_msgs/msg/Quaternion", w=1.0),
                )
                twist = make("geometry_msgs/msg/Twist", linear=make("geometry_msgs/msg/Vector3", x=10.0))
                write(
                    ODOMETRY,
                    time_ns,
                    stamp_ns,
                    child_frame_id="base_link",
                    pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose),
                    twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist),
                )
            if boxes:
                walker = make(
                    "bevfusion_msgs/msg/Prediction",
                    class_name="pedestrian",
                    position=make("geometry_msgs/msg/Point", x=40.0 - x_m, y=1.4 * (k * 0.05 - 4.0)),
                    size=make("geometry_msgs/msg/Vector3", x=0.5, y=0.5, z=1.7),
                    z_rotation=-np.pi,
                    score=0.9,
                )
                write(PREDICTION_ARRAY, time_ns, stamp_ns, predictions=[walker] * walks)
    return path


def published(path: Path, topic: str) -> list[tuple[int, Any]]:
    types = ros2_types()
    with Reader(path) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        return [(t, types.deserialize_cdr(d, c.msgtype)) for c, t, d in reader.messages(connections)]


def row_of(text: str) -> list[str]:
    """The last line of the table of counts."""
    return [line for line in text.splitlines() if line.split() and line.split()[0].isdigit()][-1].split()


def test_the_shared_bags_give_the_same_tracks_in_both_storages(tmp_path: Path, command: Command) -> None:
    tracks = []
    for storage in ("mcap", "sqlite3"):
        out = tmp_path / storage
        status, text, _ = command(DATA / f"tracker_input_{storage}", "--out", out, "--strategy", "all")
        assert status == 0
        assert row_of(text) == ["40", "80", "2", "0", "0", "0", "0"]
        assert "frames with an empty header: 1" in text
        tracks.append(published(out, TRACKS.name))
    assert [repr(message) for _, message in tracks[0]] == [repr(message) for _, message in tracks[1]]
    truth = json.loads((DATA / "truth.json").read_text())
    for (_, message), frame in zip(tracks[0], truth, strict=True):
        for detection, labelled in zip(message.detections, frame["objects"], strict=True):
            center = detection.bbox.center.position
            assert np.hypot(center.x - labelled["x_m"], center.y - labelled["y_m"]) < 0.12
            assert detection.results[0].hypothesis.class_id == labelled["category"]
            assert (detection.bbox.size.x, detection.bbox.size.y) == pytest.approx(
                (labelled["length_m"], labelled["width_m"]), abs=0.02
            )


def test_a_request_is_listed_with_its_time_and_written(tmp_path: Path, command: Command) -> None:
    bag = write_drive(tmp_path / "bag", 80)
    options = ("--preset", "physical", "--strategy", "all", "--out", tmp_path / "seen")
    status, text, _ = command(bag, *options)
    assert status == 0
    # nearer than the braking distance, from the middle of the vehicle: `test_perception` has the same
    expected_s = (40.0 - 0.25 - PHYSICAL.pipeline.braking_distance.at(10.0)) / 10.0
    row = next(line.split() for line in text.splitlines() if "emergency" in line)
    assert 0.0 <= float(row[0]) - expected_s <= 0.05 + 1e-6
    assert row[2:5] == ["36.0", "1", "pedestrian"]
    assert float(row[5]) == pytest.approx((40.0 - 2.2 - 0.25) / 10.0 - float(row[0]), abs=0.15)
    assert float(row[6]) == pytest.approx(40.0 - 2.2 - 0.25 - 10.0 * float(row[0]), abs=0.1)
    flags = published(tmp_path / "seen", COLLISION.name)
    first_ns = next(time_ns for time_ns, message in flags if message.data)
    assert first_ns == START_NS + round(float(row[0]) * 1e9) + 10_000_000
    # a gate counts the same requests, and names their times
    gate = ("--fail-on", "requests>0,frames<80,all/warnings>0", "--junit", tmp_path / "bag.xml")
    status, _, errors = command(bag, *options[:-1], tmp_path / "again", *gate)
    listed = sum("emergency" in line for line in text.splitlines())
    line = f"smartmot-eval: failed: all: requests {listed}, fails if > 0: pedestrian at {row[0]} s"
    assert (status, errors.splitlines()[0][: len(line)], len(errors.splitlines())) == (3, line, 1)


def test_what_was_written_can_be_read_again(tmp_path: Path, command: Command) -> None:
    bag = write_drive(tmp_path / "bag", 20)
    assert command(bag, "--out", tmp_path / "seen.mcap", "--quiet")[:2] == (0, "")
    status, text, _ = command(tmp_path / "seen.mcap", "--out", tmp_path / "again", "--dataset", "nuscenes")
    assert status == 0
    assert "no pose of the vehicle: tracks are in the sensor's frame, and nothing is decided" in text
    assert row_of(text) == ["20", "20", "1", "0", "0", "0", "20"]
    with open_bag(tmp_path / "again") as again:
        assert len(again.messages(TRACKS.name)) == 20


def test_frames_back_in_time_are_counted(tmp_path: Path, command: Command) -> None:
    status, text, _ = command(write_drive(tmp_path / "bag", 20, back=5), "--out", tmp_path / "seen")
    assert status == 0
    assert "frames not newer than the one before: 5; they are left out" in text
    assert row_of(text)[5] == "5"


def test_messages_are_taken_as_they_were_received_whatever_their_order_in_the_file(
    tmp_path: Path, command: Command
) -> None:
    bag, types = write_drive(tmp_path / "bag", 60), ros2_types()
    with Reader(bag) as reader:
        stored = [(c.topic, c.msgtype, t, d) for c, t, d in reader.messages()]
    by_topic = tmp_path / "by_topic"
    with Writer(by_topic, version=9, storage_plugin=StoragePlugin.MCAP) as written:
        for topic, kind in {(topic, kind): None for topic, kind, *_ in stored}:
            connection = written.add_connection(topic, kind, typestore=types)
            for name, _, time_ns, data in stored:
                if name == topic:
                    written.write(connection, time_ns, data)
    answers = []
    for path in (bag, by_topic):
        status, text, _ = command(path, "--out", tmp_path / f"seen {path.name}")
        assert status == 0
        answers.append((row_of(text), published(tmp_path / f"seen {path.name}", TRACKS.name)))
    (row, tracks), (other_row, other_tracks) = answers
    assert row == other_row
    assert [t for t, _ in tracks] == [t for t, _ in other_tracks]
    assert all(
        [d.bbox.center.position.x for d in a.detections] == [d.bbox.center.position.x for d in b.detections]
        for (_, a), (_, b) in zip(tracks, other_tracks, strict=True)
    )


def test_frames_without_boxes(tmp_path: Path, command: Command) -> None:
    status, text, _ = command(write_drive(tmp_path / "bag", 10, walks=False), "--out", tmp_path / "seen")
    assert status == 0
    assert row_of(text) == ["10", "0", "0", "0", "0", "0", "0"]


def test_a_map_of_another_place_is_refused_as_by_drive(tmp_path: Path, command: Command) -> None:
    bag = write_drive(tmp_path / "bag", 3)
    street = (Path(__file__).parents[4] / "scenarios" / "maps" / "urban_street.xodr").read_text()
    network = tmp_path / "elsewhere.xodr"
    network.write_text(re.sub(r'(<geometry s="[^"]*" x=")[^"]*(" y=")[^"]*', r"\g<1>5000\g<2>5000", street))
    status, _, error = command(bag, "--out", tmp_path / "seen", "--map", network)
    assert (status, len(error.splitlines())) == (2, 1)
    assert f"{network}: the vehicle of {bag} is in no frame within 3 m of a driving lane" in error
    assert not (tmp_path / "seen").exists()
    # another monitored area does not ask where the lanes are
    assert command(bag, "--out", tmp_path / "path", "--map", network, "--strategy", "path")[0] == 0


@pytest.mark.parametrize(
    ("drive", "words", "says"),
    [
        ({"boxes": False}, (), "topic /bevfusion_detections has no messages"),
        ({"boxes": False, "poses": False}, (), "topic /bevfusion_detections has no messages"),
        (
            {},
            ("--topic", "/boxes"),
            "{bag}: --topic /boxes: not a topic with boxes; there are: /bevfusion_detections",
        ),
        ({}, ("--odometry", "/tf"), "{bag}: --odometry /tf: not a topic with odometry; there are: /odom"),
        ({}, ("--strategy", "map"), "strategy map: needs a map"),
        ({}, ("--strategy", "map,all"), "--strategy: expected one, got 2"),
        ({}, ("--velocity-frame", "ego"), "--velocity-frame: unknown 'ego'"),
        ({}, ("--sensor", "1,2"), "--sensor: expected X,Y,Z"),
        ({}, ("--rule", "nobody"), "--rule: unknown 'nobody'"),
        ({}, ("--map", "none.xodr"), "none.xodr"),
        ({}, ("--storage", "tape"), "--storage: unknown 'tape'"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    tmp_path: Path, command: Command, drive: dict[str, bool], words: tuple[str, ...], says: str
) -> None:
    bag = write_drive(tmp_path / "bag", 3, **drive)  # type: ignore[arg-type]
    status, _, error = command(bag, "--out", tmp_path / "seen", *words)
    assert status == 2
    assert len(error.splitlines()) == 1
    assert says.format(bag=bag) in error
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_classes_of_the_users_own_count(tmp_path: Path, command: Command) -> None:
    bag = write_drive(tmp_path / "bag", 20)
    (bag / "classes.csv").write_text("class,category\nPedestrian,cyclist\n")
    assert command(bag, "--out", tmp_path / "seen")[0] == 0
    _, last = published(tmp_path / "seen", TRACKS.name)[-1]
    assert [d.results[0].hypothesis.class_id for d in last.detections] == ["cyclist"]


@pytest.mark.parametrize("subcommand", ["bag", "mot", "drive"])
def test_topics_are_chosen_alike(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    subcommand: str,
) -> None:
    """Usual names do not decide, and topics without messages do not compete."""
    types = ros2_types()
    make = rosbags_make(types)

    def write(path: Path, *filled: str) -> Path:
        with Writer(path, version=9) as bag:
            for name in ("/bevfusion_detections", "/near", "/far"):
                topic = bag.add_connection(name, PREDICTION_ARRAY, typestore=types)
                stamp = make("builtin_interfaces/msg/Time", sec=START_NS // 10**9)
                header = make("std_msgs/msg/Header", stamp=stamp, frame_id="lidar")
                message = types.serialize_cdr(make(PREDICTION_ARRAY, header=header), PREDICTION_ARRAY)
                if name in filled:
                    bag.write(topic, START_NS, message)
        return path

    def run(*words: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", subcommand, *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            main()
        return int(stop.value.code or 0), capsys.readouterr().err

    bag = write(tmp_path / "several", "/bevfusion_detections", "/near")
    kind = f"({PREDICTION_ARRAY})"
    status, error = run(bag, "--out", tmp_path / "refused")
    assert status == 2
    assert error == (
        f"smartmot-eval: {bag}: several topics with boxes: /bevfusion_detections {kind}, /near {kind}; "
        "name one with --topic\n"
    )
    for number, words in enumerate(((bag, "--topic", "/near"), (write(tmp_path / "single", "/near"),))):
        assert "topic" not in run(*words, "--out", tmp_path / f"out{number}")[1]


def test_an_output_that_is_there_stays(tmp_path: Path, command: Command) -> None:
    bag = write_drive(tmp_path / "bag", 3)
    status, _, error = command(bag, "--out", bag)
    assert (status, "is there already" in error) == (2, True)


@pytest.mark.parametrize("name", ["seen", "seen.mcap", "deep/seen"])
def test_an_output_in_the_bag_that_is_read_is_refused(tmp_path: Path, command: Command, name: str) -> None:
    """Without metadata.yaml it would be a file of that bag from then on."""
    bag = write_drive(tmp_path / "bag", 3)
    files = sorted(path.name for path in bag.iterdir())
    status, _, error = command(bag, "--out", bag / name)
    assert (status, "lies in the bag that is read" in error) == (2, True)
    assert sorted(path.name for path in bag.iterdir()) == files


def write_ros1_drive(path: Path, transforms: str) -> Path:
    """The paper's boxes of a standing car, 30 m ahead at first; poses of a vehicle with 10 m/s in /tf."""
    types = ros1_types()
    make = rosbags_make(types)
    with Ros1Writer(path) as bag:
        names = (("/merged_obstacles", BEV_DETECTIONS), ("/tf", transforms), ("/tf_static", transforms))
        topics = {name: bag.add_connection(name, kind, typestore=types) for name, kind in names}

        def header(time_ns: int, frame_id: str) -> Any:
            stamp = make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
            return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

        def write_transform(topic: str, time_ns: int, parent: str, child: str, x_m: float) -> None:
            moved = make(
                "geometry_msgs/msg/Transform",
                translation=make("geometry_msgs/msg/Vector3", x=x_m),
                rotation=make("geometry_msgs/msg/Quaternion", w=1.0),
            )
            stamped = make(
                "geometry_msgs/msg/TransformStamped",
                header=header(time_ns, parent),
                child_frame_id=child,
                transform=moved,
            )
            message = make(transforms, transforms=[stamped])
            bag.write(topics[topic], time_ns, types.serialize_ros1(message, transforms))

        write_transform("/tf_static", START_NS, "/base_link", "/lidar", 1.5)
        for k in range(20):
            time_ns, x_m = START_NS + k * 50_000_000, 0.5 * k
            write_transform("/tf", time_ns, "/map", "/base_link", x_m)
            box = make(
                "t4ac_msgs/msg/BEV_detection", type="Car", score=0.9, x=-4.0, y=x_m - 30.0, l=4.5, w=1.8
            )
            boxes = make(BEV_DETECTIONS, header=header(time_ns, "/lidar"), bev_detections_list=[box])
            bag.write(topics["/merged_obstacles"], time_ns, types.serialize_ros1(boxes, BEV_DETECTIONS))
    return path


@pytest.mark.parametrize("transforms", [TRANSFORMS, OLD_TRANSFORMS])
def test_poses_of_a_bag_of_ros_1_come_from_transforms_old_and_new(
    tmp_path: Path, command: Command, transforms: str
) -> None:
    bag = write_ros1_drive(tmp_path / "drive.bag", transforms)
    status, text, _ = command(bag, "--out", tmp_path / "seen")
    assert status == 0
    assert row_of(text) == ["20", "20", "1", "0", "0", "0", "0"]
    _, message = published(tmp_path / "seen", TRACKS.name)[-1]
    assert message.header.frame_id == "map"
    # 30 m ahead of the lidar, 4 m to its left
    center = message.detections[0].bbox.center.position
    assert (center.x, center.y) == pytest.approx((31.5, 4.0), abs=0.01)


def test_a_bag_without_boxes_tells_what_there_is(tmp_path: Path, command: Command) -> None:
    types = ros2_types()
    with Writer(tmp_path / "bag", version=9) as bag:
        topic = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=types)
        text = types.types["std_msgs/msg/String"](data="hello")
        bag.write(topic, START_NS, types.serialize_cdr(text, "std_msgs/msg/String"))
    status, _, error = command(tmp_path / "bag", "--out", tmp_path / "seen")
    assert status == 2
    assert "no topic of bevfusion_msgs/msg/PredictionArray or" in error
    assert "it has /chatter (std_msgs/msg/String)" in error


DETECTORS = """
[lidar]
topic = "/lidar"
rate_hz = 10
sensor_pose = [0, 0, 0, 0]
type = "bevfusion_msgs/PredictionArray"

[camera]
topic = "/camera"
rate_hz = 10
delay_s = 0.12
trust = 0.9
sensor_pose = [0, 0, 0, 0]
type = "bevfusion_msgs/msg/PredictionArray"
"""


def write_by_two(path: Path, source: Path, late_ns: int) -> Path:
    """The boxes of a drive on two topics in turns, those of the second received later."""
    types = ros2_types()
    rows: list[tuple[int, str, str, bytes]] = []
    with Reader(source) as reader:
        frame = 0
        for connection, time_ns, data in reader.messages():
            name = connection.topic
            if connection.msgtype == PREDICTION_ARRAY:
                name = ("/lidar", "/camera")[frame % 2]
                time_ns += late_ns * (frame % 2)
                frame += 1
            rows.append((time_ns, name, connection.msgtype, bytes(data)))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {name: kind for _, name, kind, _ in rows}
        connections = {name: bag.add_connection(name, kind, typestore=types) for name, kind in topics.items()}
        for time_ns, name, _, data in sorted(rows, key=lambda row: row[:2]):
            bag.write(connections[name], time_ns, data)
    return path


def test_several_detectors_go_into_one_tracker_late_ones_too(tmp_path: Path, command: Command) -> None:
    source = write_drive(tmp_path / "drive", 90)
    detectors = tmp_path / "detectors.toml"
    detectors.write_text(DETECTORS)
    ends = []
    for late_ns in (0, 120_000_000):
        bag = write_by_two(tmp_path / f"by_two_{late_ns}", source, late_ns)
        out = tmp_path / f"out_{late_ns}"
        status, text, errors = command(bag, "--out", out, "--detectors", detectors, "--preset", "physical")
        assert (status, errors) == (0, "")
        assert "note: detector lidar: 45 frames with 45 boxes, trust 1" in text
        assert "note: detector camera: 45 frames with 45 boxes, trust 0.9, 0.12 s late by its profile" in text
        behind = "note: detector camera: frames behind a newer one of another detector: 44"
        assert (behind in text) == bool(late_ns)
        assert sum(message.data for _, message in published(out, COLLISION.name))
        tracks = published(out, TRACKS.name)
        assert len(tracks) == 90
        ends.append([(box.id, box.bbox.center.position) for box in tracks[-1][1].detections])
        assert [number for number, _ in ends[-1]] == ["1"]
    # the last frame of all is the camera's: in both cases everything is known then
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("words", "text", "message"),
    [
        (("--topic", "/lidar"), DETECTORS, "--topic and --detectors both name topics of boxes"),
        (("--max-age", "3"), DETECTORS, "max_age: not with several detectors"),
        ((), DETECTORS.replace("/camera", "/radar"), "/radar is no topic with boxes; there are: "),
        (
            (),
            DETECTORS.replace("bevfusion_msgs/msg/PredictionArray", "vision_msgs/msg/Detection3DArray"),
            "is of type bevfusion_msgs/msg/PredictionArray, and the file says vision_msgs/msg/Detection3D",
        ),
        ((), DETECTORS + "speed = 3", "[camera]: unknown key 'speed'"),
    ],
)
def test_mistakes_about_detectors_are_one_line(
    tmp_path: Path, command: Command, words: tuple[str, ...], text: str, message: str
) -> None:
    bag = write_by_two(tmp_path / "by_two", write_drive(tmp_path / "drive", 4), 0)
    detectors = tmp_path / "detectors.toml"
    detectors.write_text(text)
    status, _, errors = command(bag, "--out", tmp_path / "out", "--detectors", detectors, *words)
    assert status == 2
    assert message in errors
    assert len(errors.splitlines()) == 1
    assert not (tmp_path / "out").exists()
