"""Several detectors of one stream: laws of arrival, the tracker of files as a peer, and hostile clocks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import ScenarioError
from scenarios.live.counts import OK, WARN, Diagnostics
from scenarios.live.detectors import LiveDetector, read_detectors
from scenarios.live.outputs import CUBE, FrameOutput
from scenarios.live.perception import LATE_LIMIT, LivePerception, Output
from scenarios.live.settings import LiveSettings
from scenarios.ros.messages import DetectionMessage, Message
from smartmot import DetectorProfile, FusedTracker, tracker_config
from smartmot.detection_input import detections_from_arrays
from smartmot.plugins import name_for
from smartmot.tracking.profile import CategoryProfile
from tests.scenarios.live.streams_made import Row, boxes, ns, odometry

CONFIG = tracker_config("default")
HERE = (0.0, 0.0, 0.0, 0.0)
SURE = {"car": CategoryProfile(100, 0.9), "pedestrian": CategoryProfile(100, 0.9)}
LIDAR = LiveDetector("lidar", "/lidar", profile=DetectorProfile("lidar", 10.0, SURE), sensor_pose=HERE)
CAMERA = LiveDetector(
    "camera", "/camera", profile=DetectorProfile("camera", 5.0, SURE, delay_s=0.3), sensor_pose=HERE
)
SETTINGS = LiveSettings(preset="physical", strategy="all", detectors=(LIDAR, CAMERA))
Seen = tuple[str, Message]


def car(x: float, y: float, score: float = 0.9) -> Row:
    return "car", x, y, 0.0, 4.5, 1.8, score


def walker(x: float, y: float) -> Row:
    return "pedestrian", x, y, math.pi / 2, 0.5, 0.5, 0.9


def drive(delay_s: float, seconds: float = 3.0, speed_mps: float = 0.0) -> list[Seen]:
    """A car that passes, seen by both; the camera at 5 Hz arrives late and alone sees a parked one."""
    made: list[Seen] = []
    for k in range(round(20 * seconds)):
        t = 0.05 * k
        made.append(("", odometry(t, (speed_mps * t, 0.0, 0.0), speed_mps)))
        rows = [car(30.0 - 6.0 * t - speed_mps * t, 4.0)]
        if k % 2 == 0:
            made.append(("lidar", boxes(t, rows)))
        if k % 4 == 1:
            parked = car(20.0 - speed_mps * t, -6.0)
            made.append(("camera", boxes(t, [*rows, parked], after_s=delay_s)))
    return in_order(made)


def in_order(messages: Iterable[Seen]) -> list[Seen]:
    """As they are received; at equal times poses first."""
    return sorted(messages, key=lambda m: (m[1].received_ns, isinstance(m[1], DetectionMessage)))


def seen(
    messages: Iterable[Seen], asked: LiveSettings = SETTINGS
) -> tuple[list[FrameOutput], LivePerception, list[Output]]:
    perception = LivePerception(asked)
    outputs: list[Output] = []
    for detector, message in messages:
        outputs += perception.take(message, detector=detector)
    outputs += perception.finish()
    return [each for each in outputs if isinstance(each, FrameOutput)], perception, outputs


def same_tracks(a: FrameOutput, b: FrameOutput) -> None:
    assert a.stamp_ns == b.stamp_ns
    for name in ("track_id", "category", "score", "center_m", "size_m", "yaw_rad", "velocity_mps"):
        np.testing.assert_array_equal(getattr(a.tracks, name), getattr(b.tracks, name), err_msg=name)


def test_late_frames_lead_to_the_tracks_of_those_in_order() -> None:
    prompt, _, _ = seen(drive(0.0))
    late, perception, _ = seen(drive(0.3))
    same_tracks(late[-1], prompt[-1])
    assert len(late[-1].tracks) == 2
    assert perception.counts_of["camera"].behind == 15
    assert perception.counts_of["lidar"].behind == 0
    # each frame has an answer, and answers do not go back in time
    assert len(late) == 30 + 15
    stamps = [each.stamp_ns for each in late]
    assert stamps == sorted(stamps)


@settings(max_examples=5, deadline=None)
@given(delays=st.lists(st.floats(0.0, 0.9), min_size=45, max_size=45))
def test_any_order_of_arrival_ends_where_the_order_of_time_ends(delays: list[float]) -> None:
    frames = [each for each in drive(0.0) if each[0]]
    poses = [each for each in drive(0.0) if not each[0]]
    arriving = [
        (name, replace(message, received_ns=message.received_ns + round(delay * 1e9)))
        for (name, message), delay in zip(frames, delays, strict=True)
    ]
    expected, _, _ = seen(drive(0.0))
    shuffled, perception, _ = seen(in_order([*poses, *arriving]))
    same_tracks(shuffled[-1], expected[-1])
    assert perception.counts.late == perception.counts.repeated == perception.counts.early == 0


def test_tracks_are_those_of_the_tracker_of_files() -> None:
    """Without poses beside it: the tracker that `mot` gives the measurements of a file to."""
    outputs, perception, _ = seen(drive(0.3))
    tracker = FusedTracker(
        perception._ways.config.tracker,  # type: ignore[arg-type]
        {"lidar": LIDAR.profile, "camera": CAMERA.profile},
    )
    answers = iter(outputs)
    for name, message in drive(0.3):
        if not isinstance(message, DetectionMessage):
            continue
        count = len(message)
        detections, rejected = detections_from_arrays(
            message.time_ns * 1e-9,
            message.position_m[:, :2],
            message.size_m[:, :2],
            [0.0] * count,
            message.score,
            message.class_name,
            detector=name,
        )
        assert rejected == 0
        tracks, answer = tracker.update(detections), next(answers)
        shown = tracks[tracks.confirmed]
        np.testing.assert_array_equal(answer.tracks.track_id, shown.track_id)
        np.testing.assert_array_equal(answer.tracks.center_m[:, :2], shown.boxes.center_m)
        np.testing.assert_array_equal(answer.tracks.velocity_mps, shown.velocity_mps)


def test_who_is_seen_by_a_late_camera_alone_is_braked_for() -> None:
    """A walker crosses in front of an ego at 10 m/s; the lidar is blind for it."""
    made: list[Seen] = []
    for k in range(80):
        t = 0.05 * k
        made.append(("", odometry(t, (10.0 * t, 0.0, 0.0), 10.0)))
        made.append(("lidar", boxes(t, [])))
        made.append(("camera", boxes(t, [walker(40.0 - 10.0 * t, 1.4 * (t - 4.0))], after_s=0.1)))
    outputs, perception, _ = seen(in_order(made))
    (request,) = [r for each in outputs if each.decision for r in each.decision.requests]
    assert (request.category, perception.counts.requests) == ("pedestrian", 1)
    alone, without, _ = seen([each for each in in_order(made) if each[0] != "camera"])
    assert without.counts.requests == 0
    assert all(each.decision and not each.decision.predicted_collision for each in alone)
    # the answer that asks for it is that to the camera's frame, not the next one of the lidar
    first = next(each for each in outputs if each.decision and each.decision.predicted_collision)
    assert first.received_ns == max(
        m.received_ns for name, m in made if name == "camera" and m.received_ns <= first.received_ns
    )
    assert (first.received_ns - ns(0)) % 50_000_000 == 0


def test_each_sensor_is_where_its_table_says() -> None:
    behind = replace(CAMERA, sensor_pose=(-1.0, 0.0, 1.5, math.pi))
    asked = replace(SETTINGS, detectors=(LIDAR, behind))
    made: list[Seen] = []
    for k in range(10):
        t = 0.1 * k
        made += [("", odometry(t, (0.0, 0.0, 0.0))), ("lidar", boxes(t, [car(10.0, 2.0)]))]
        made.append(("camera", boxes(t + 0.05, [car(10.0, 2.0)])))
        made.append(("", odometry(t + 0.05, (0.0, 0.0, 0.0))))
    outputs, perception, _ = seen(in_order(made), asked)
    places = sorted(outputs[-1].tracks.center_m[:, :2].tolist())
    np.testing.assert_allclose(places, [[-11.0, -2.0], [10.0, 2.0]], atol=0.01)
    assert not perception.counts.without_transform


def test_counts_are_of_each_detector() -> None:
    made = drive(0.0)
    wrong = boxes(2.0, [("unicorn", 1.0, 1.0, 0.0, 1.0, 1.0, 0.9), car(5.0, 5.0, score=math.nan)])
    made += [
        ("camera", wrong),
        ("camera", replace(wrong, received_ns=wrong.received_ns + 1)),
        ("lidar", boxes(0.5, [car(1.0, 1.0)], after_s=2.4)),
    ]
    _, perception, _ = seen(in_order(made))
    lidar, camera = (perception.counts_of[name] for name in ("lidar", "camera"))
    assert (lidar.late, lidar.repeated, lidar.rejected, dict(lidar.unknown_classes)) == (1, 0, 0, {})
    assert (camera.late, camera.repeated, camera.without_score) == (0, 1, 2)
    assert dict(camera.unknown_classes) == {"unicorn": 2}
    total = perception.counts
    assert (total.frames, total.late, total.repeated) == (lidar.frames + camera.frames, 1, 1)
    assert total.boxes == lidar.boxes + camera.boxes


@pytest.mark.parametrize("offset_s", [-5.0, 3600.0])
def test_a_detector_with_a_wrong_clock_neither_stops_nor_restarts_the_others(offset_s: float) -> None:
    made = [each for each in drive(0.0) if each[0] != "camera"]
    right, _, _ = seen(made)
    for k in range(60):
        t = 0.05 * k
        wrong = boxes(t, [car(5.0, 0.0)])
        assert wrong.stamp_ns is not None
        made.append(("camera", replace(wrong, stamp_ns=wrong.stamp_ns + round(offset_s * 1e9))))
    outputs, perception, _ = seen(in_order(made))
    counts = perception.counts_of["camera"]
    assert perception.counts.restarts == 0
    assert (counts.tracked, perception.counts_of["lidar"].tracked) == (0, 30)
    assert counts.late + counts.without_pose == 60
    same_tracks(outputs[-1], right[-1])


def test_time_that_goes_back_for_all_begins_anew() -> None:
    first = drive(0.0)
    later_ns = ns(10.0) - ns(0.0)
    again = [
        (name, replace(message, received_ns=message.received_ns + later_ns)) for name, message in drive(0.0)
    ]
    outputs, perception, _ = seen([*first, *again])
    assert perception.counts.restarts == 1
    assert perception.counts.late >= LATE_LIMIT
    assert outputs[-1].stamp_ns == ns(2.9)
    assert outputs[-1].tracks.track_id.min() > 2  # ids are not given again


def test_a_silent_detector_is_named_in_the_status() -> None:
    made = [each for each in drive(0.0) if each[0] != "camera" or each[1].received_ns < ns(1.0)]
    _, _, outputs = seen(made)
    states = [each for each in outputs if isinstance(each, Diagnostics)]
    assert [each.level for each in states[:1]] == [OK]
    assert (states[-1].level, states[-1].message) == (WARN, "no frames of camera")
    values = dict(states[-1].values)
    assert (values["lidar: frames"], values["camera: frames"]) == ("30", "5")


def test_markers_live_for_two_frames_of_the_quickest_detector_however_near_others_are_to_it() -> None:
    made: list[Seen] = []
    for k in range(15):
        t = 0.1 * k
        for name, after in (("lidar", 0.0), ("camera", 0.005)):
            made.append(("", odometry(t + after, (0.0, 0.0, 0.0))))
            made.append((name, boxes(t + after, [car(10.0, 2.0)])))
    outputs, _, _ = seen(in_order(made))
    (lifetime_s,) = {marker.lifetime_s for marker in outputs[-1].markers if marker.kind == CUBE}
    assert lifetime_s == pytest.approx(0.2)


def test_without_poses_tracks_are_in_the_vehicles_frame() -> None:
    turned = replace(CAMERA, sensor_pose=(0.0, 0.0, 1.0, math.pi / 2))
    made: list[Seen] = [
        each
        for k in range(8)
        for each in (
            ("lidar", boxes(0.1 * k, [car(10.0, 2.0)])),
            ("camera", boxes(0.1 * k + 0.03, [walker(3.0, -7.0)])),
        )
    ]
    outputs, _, _ = seen(made, replace(SETTINGS, detectors=(LIDAR, turned)))
    assert {each.frame_id for each in outputs} == {"base_link"}
    assert outputs[-1].decision is None
    places = {
        str(c): xy.tolist()
        for c, xy in zip(outputs[-1].tracks.category, outputs[-1].tracks.center_m[:, :2], strict=True)
    }
    np.testing.assert_allclose(places["car"], [10.0, 2.0], atol=0.01)
    np.testing.assert_allclose(places["pedestrian"], [7.0, 3.0], atol=0.01)


GOOD = """
[lidar]
topic = "/lidar/boxes"
profile = "lidar.json"
trust = 0.8
sensor_pose = [1, 0, 1.8, 0.1]

[camera]
topic = "/camera/boxes"
type = "bevfusion_msgs/PredictionArray"
rate_hz = 15
delay_s = 0.2
dataset = "nuscenes"
velocity_frame = "sensor"
reliable = true
depth = 3
"""


def test_a_file_says_all_of_each(tmp_path: Path) -> None:
    DetectorProfile("measured", 10.0, SURE, delay_s=0.05).save(tmp_path / "lidar.json")
    file = tmp_path / "detectors.toml"
    file.write_text(GOOD)
    lidar, camera = read_detectors(file)
    assert lidar == LiveDetector(
        "lidar",
        "/lidar/boxes",
        profile=DetectorProfile("measured", 10.0, SURE, delay_s=0.05, trust=0.8),
        sensor_pose=(1.0, 0.0, 1.8, 0.1),
    )
    assert camera == LiveDetector(
        "camera",
        "/camera/boxes",
        "bevfusion_msgs/msg/PredictionArray",
        DetectorProfile("camera", 15.0, delay_s=0.2),
        velocity_frame="sensor",
        dataset="nuscenes",
        reliable=True,
        depth=3,
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no detectors; a table each"),
        ("topic = 3", "topic stands in no table"),
        ("[a", "no TOML"),
        ("[a]\nrate_hz = 3", r"\[a\]: topic is missing"),
        ('[a]\ntopic = "boxes"', "begins with /"),
        ('[a]\ntopic = "/b"\nspeed = 1', "unknown key 'speed'"),
        ('[a]\ntopic = "/b"\n[c]\ntopic = "/b"', r"\[c\]: topic /b is that of a too"),
        ('[a]\ntopic = "/b"\ntype = "std_msgs/String"', "type: unknown 'std_msgs/msg/String'"),
        ('[a]\ntopic = "/b"\ntrust = 0.5', "trust needs rate_hz, or a profile"),
        ('[a]\ntopic = "/b"\nrate_hz = 10\ntrust = 2', "trust must be over 0 and at most 1"),
        ('[a]\ntopic = "/b"\nrate_hz = true', "rate_hz must be positive"),
        ('[a]\ntopic = "/b"\nprofile = "no.json"', "no.json"),
        ('[a]\ntopic = "/b"\nprofile = 3', "profile: expected the name of a file, got 3"),
        ('[a]\ntopic = "/b"\nsensor_pose = [1, 2]', r"expected \[x, y, z, yaw\] in m and rad"),
        ('[a]\ntopic = "/b"\nsensor_pose = [1, 2, 3, nan]', r"expected \[x, y, z, yaw\]"),
        ('[a]\ntopic = "/b"\ndepth = 0', "depth: expected a number of messages from 1 on"),
        ('[a]\ntopic = "/b"\nreliable = "yes"', "reliable: expected true or false"),
        ('[a]\ntopic = "/b"\nvelocity_frame = "map"', "velocity_frame: unknown 'map'"),
    ],
)
def test_wrong_files_are_named_with_detector_and_key(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "detectors.toml"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=message) as error:
        read_detectors(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.toml: No such file"):
        read_detectors(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("max_age", 3),
        ("detection_th", 0.3),
        ("sensor_pose", (0.0, 0.0, 0.0, 0.0)),
        ("velocity_frame", "world"),
        ("output_frame", "sensor"),
    ],
)
def test_what_one_detector_alone_can_mean_is_refused(name: str, value: object) -> None:
    with pytest.raises(ScenarioError, match=f"{name}: not with several detectors"):
        replace(SETTINGS, **{name: value})  # type: ignore[arg-type]


def test_unknown_classes_and_a_tracker_of_ones_own_are_refused() -> None:
    with pytest.raises(ScenarioError, match="detector lidar: dataset: unknown 'kitti'"):
        LiveSettings(detectors=(replace(LIDAR, dataset="kitti"),))
    own = name_for(FusedTracker(CONFIG, {"lidar": None}), "update")
    with pytest.raises(ScenarioError, match="one of your own takes one topic"):
        LivePerception(replace(SETTINGS, settings=(("tracker", own),)))
