"""The core that bag and node share: closed forms, laws of arrival, and hostile streams."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import load_map
from scenarios.errors import ScenarioError
from scenarios.live import perception as core
from scenarios.live.counts import ERROR, OK, WARN, Diagnostics
from scenarios.live.outputs import ADD, ARROW, CUBE, DELETE, LINE_STRIP, TEXT, FrameOutput
from scenarios.live.perception import LATE_LIMIT, LivePerception
from scenarios.live.placing import PlacedFrame, place
from scenarios.live.settings import DATASETS, LiveSettings, class_names
from scenarios.presets import PHYSICAL
from scenarios.recorded.bags.reader import CLASSES, read_bag
from scenarios.recorded.vehicles import Vehicle
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.messages import DetectionMessage, LaneMessage, Message, OdometryMessage
from tests.scenarios.live.streams_made import (
    BASE,
    LIDAR,
    MAP,
    Row,
    boxes,
    frames_of,
    later,
    ns,
    odometry,
    outputs_of,
    received,
    straight,
    transform,
)
from tests.scenarios.ros.bags_made import DATA, MCAP

STREET = Path(__file__).parents[3] / "scenarios" / "maps" / "urban_street.xodr"
SETTINGS = LiveSettings(preset="physical", strategy="all")


def car(x: float, y: float, yaw: float = 0.0, score: float = 0.9) -> Row:
    return "car", x, y, yaw, 4.5, 1.8, score


def walker(x: float, y: float, score: float = 0.9) -> Row:
    return "pedestrian", x, y, math.pi / 2, 0.5, 0.5, score


def crossing(time_s: float) -> list[Row]:
    """Somebody walks with 1.4 m/s, and is in the middle of the way at 40 m when the ego's centre is there."""
    return [walker(40.0, 1.4 * (time_s - 4.0))]


def test_a_crossing_walker_is_braked_for_when_nearer_than_the_braking_distance() -> None:
    frames, perception = frames_of(straight(90, crossing), SETTINGS)
    # the paper's rule: predicted collision, and nearer than the braking distance, from the ego's centre
    distance_m = PHYSICAL.pipeline.braking_distance.at(10.0)
    assert distance_m > 12.0
    expected_s = (40.0 - 0.25 - distance_m) / 10.0
    first = next(f for f in frames if f.decision is not None and f.decision.predicted_collision)
    assert 0.0 <= (first.stamp_ns - ns(0.0)) * 1e-9 - expected_s <= 0.05 + 1e-6
    (request,) = first.decision.requests if first.decision else ()
    assert (request.category, request.track_id) == ("pedestrian", 1)
    assert first.decision is not None
    assert first.decision.nearest_m == pytest.approx(request.gap_m)
    # the free distance is that from the front to the box
    assert request.gap_m == pytest.approx(40.0 - 0.25 - 2.2 - 10.0 * (request.time_s - ns(0) * 1e-9), abs=0.1)
    assert perception.counts.requests == 1


@pytest.mark.parametrize("strategy", ["all", "rectangular", "path"])
def test_the_nearest_object_is_known_in_the_first_frame_that_shows_it(strategy: str) -> None:
    beside = car(10.0, 30.0)
    frames, _ = frames_of(
        straight(3, lambda t: [car(20.0, 0.0), beside]), replace(SETTINGS, strategy=strategy)
    )
    # from the front, 2.2 m ahead of the vehicle's middle, to the rear of the box
    expected = [20.0 - 4.5 / 2 - 2.2 - 10.0 * 0.05 * k for k in range(3)]
    assert [f.decision.nearest_m for f in frames if f.decision] == pytest.approx(expected)


def test_who_walks_away_is_not_braked_for() -> None:
    frames, perception = frames_of(straight(90, lambda t: [walker(40.0, 5.0 + 1.4 * t)]), SETTINGS)
    assert not any(f.decision.predicted_collision for f in frames if f.decision)
    assert perception.counts.requests == 0


@given(
    delays=st.lists(st.integers(0, 40_000_000), min_size=80, max_size=80),
    strategy=st.sampled_from(["all", "path"]),
)
@settings(max_examples=5, deadline=None)
def test_jitter_of_arrival_changes_nothing(delays: list[int], strategy: str) -> None:
    """Messages of a topic stay in order, and none is later than a frame waits."""
    chosen = replace(SETTINGS, strategy=strategy)
    on_time = straight(40, lambda t: [*crossing(t), car(30.0 + 8.0 * t, 3.5)])
    messages: list[Message] = []
    for kind in (OdometryMessage, DetectionMessage):
        last = 0
        for message, delay in zip([m for m in on_time if isinstance(m, kind)], delays, strict=False):
            last = max(last, message.received_ns + delay)
            messages.append(replace(message, received_ns=last))
    expected, _ = frames_of(on_time, chosen)
    jittered, perception = frames_of(sorted(messages, key=lambda m: m.received_ns), chosen)
    assert perception.counts.carried == perception.counts.late == 0
    assert [f.stamp_ns for f in jittered] == [f.stamp_ns for f in expected]
    for a, b in zip(expected, jittered, strict=True):
        for name in ("track_id", "center_m", "size_m", "yaw_rad", "velocity_mps", "score", "dynamic"):
            assert np.array_equal(getattr(a.tracks, name), getattr(b.tracks, name))
        assert a.decision is not None
        assert b.decision is not None
        assert a.decision.predicted_collision == b.decision.predicted_collision
        assert a.decision.nearest_m == b.decision.nearest_m


@given(ticks=st.lists(st.floats(0.0, 1.2), max_size=30))
@settings(max_examples=5, deadline=None)
def test_a_timer_between_the_messages_changes_nothing(ticks: list[float]) -> None:
    """Frames that wait in vain are answered as they would be with the next message."""
    messages = [
        message
        for message in straight(24, crossing)
        if isinstance(message, DetectionMessage) or not ns(0.4) < message.received_ns < ns(0.8)
    ]
    expected, _ = outputs_of(messages, SETTINGS)
    perception = LivePerception(SETTINGS)
    outputs: list[object] = []
    times = sorted(ns(tick) for tick in ticks)
    for message in messages:
        while times and times[0] < message.received_ns:
            outputs += perception.advance(times.pop(0))
        outputs += perception.take(message)
    outputs += perception.finish()
    assert perception.counts.carried > 0 < perception.counts.without_pose
    a, b = ([o for o in each if isinstance(o, FrameOutput)] for each in (expected, outputs))
    assert [f.stamp_ns for f in a] == [f.stamp_ns for f in b]
    assert all(np.array_equal(x.tracks.center_m, y.tracks.center_m) for x, y in zip(a, b, strict=True))


def test_a_frame_waits_for_a_pose_that_is_not_older_and_then_carries_the_last_one_on() -> None:
    perception = LivePerception(SETTINGS)
    assert perception.take(odometry(0.0, (0.0, 0.0, 0.0), 10.0)) == []
    frame = boxes(0.03, [car(20.0, 0.0)])
    assert perception.take(frame) == []
    assert perception.advance(ns(0.079)) == []
    (output,) = perception.advance(ns(0.08))
    assert isinstance(output, FrameOutput)
    assert output.tracks.center_m[0, 0] == pytest.approx(20.3)
    assert perception.counts.carried == 1
    # nothing newer comes: after a fifth of a second frames have no pose
    assert perception.take(boxes(0.3, [car(20.0, 0.0)])) == []
    assert perception.advance(ns(0.4)) == []
    assert (perception.counts.without_pose, perception.counts.tracked) == (1, 1)


def test_a_pose_is_interpolated_on_its_way() -> None:
    messages: list[Message] = [odometry(k * 0.1, (k * 1.0, 0.0, 0.0), 10.0) for k in range(4)]
    messages += [boxes(0.125, [car(20.0, 0.0)], after_s=0.01)]
    (frame,), _ = frames_of(received(messages), SETTINGS)
    assert frame.tracks.center_m[0] == pytest.approx([21.25, 0.0, 0.8])


def test_shown_markers_are_the_tracks_and_each_end_is_deleted_once() -> None:
    def objects(time_s: float) -> list[Row]:
        rows = [car(30.0, 4.0), walker(15.0, -8.0 + 1.4 * time_s)]
        return rows if time_s < 0.5 else rows[:1] if time_s < 1.0 else []

    frames, _ = frames_of(straight(40, objects, speed_mps=0.0), SETTINGS)
    shown: dict[tuple[str, int], int] = {}
    deleted: list[tuple[str, int]] = []
    for frame in frames:
        for marker in frame.markers:
            key = marker.ns, marker.marker_id
            if marker.action == DELETE:
                deleted.append(key)
                assert shown.pop(key) == marker.kind
            else:
                assert marker.action == ADD
                assert marker.lifetime_s == pytest.approx(0.1)
                shown[key] = marker.kind
        tracks = frame.tracks
        cubes = {key for key, kind in shown.items() if kind == CUBE}
        assert cubes == set(zip(tracks.category.tolist(), tracks.track_id.tolist(), strict=True))
        assert sum(kind == TEXT for kind in shown.values()) == len(tracks)
        assert sum(kind == ARROW for kind in shown.values()) == np.count_nonzero(tracks.dynamic)
    assert len(frames) == 40
    assert shown == {}
    assert sorted(key for key in deleted if "/" not in key[0]) == [("car", 1), ("pedestrian", 2)]


def test_arrows_end_where_a_mover_is_in_two_seconds() -> None:
    frames, _ = frames_of(straight(30, lambda t: [car(30.0 + 8.0 * t, 3.5), car(50.0, -4.0)]), SETTINGS)
    last = frames[-1]
    (arrow,) = (m for m in last.markers if m.kind == ARROW)
    start, end = np.array(arrow.points_m)
    assert arrow.marker_id == 1
    assert start == pytest.approx([30.0 + 8.0 * 29 * 0.05, 3.5, 0.8], abs=0.1)
    assert end - start == pytest.approx([16.0, 0.0, 0.0], abs=0.3)
    (cube,) = (m for m in last.markers if m.kind == CUBE and m.marker_id == 2)
    assert cube.scale_m == pytest.approx((4.5, 1.8, 1.6))
    assert cube.position_m == pytest.approx((50.0, -4.0, 0.8), abs=0.05)
    texts = {m.text for m in last.markers if m.kind == TEXT}
    assert texts == {"car 0.90 #1", "car 0.90 #2"}


@pytest.mark.parametrize("output_frame", ["map", "sensor"])
def test_texts_tell_the_existence_where_the_tracker_does(output_frame: str) -> None:
    seen = replace(SETTINGS, settings=(("tracker", "default"),), output_frame=output_frame)
    frames, _ = frames_of(straight(10, lambda t: [car(50.0, -4.0)]), seen)
    shown = [frame.tracks.existence for frame in frames]
    probable = [float(existence[0]) for existence in shown if existence is not None]
    assert len(probable) == 10
    assert probable[0] == pytest.approx(0.5)  # a new track: the share of births that are true
    assert min(probable[2:]) > 0.99
    (text,) = (m.text for m in frames[0].markers if m.kind == TEXT)
    assert text == "car 0.90 p 0.50 #1"


def test_without_odometry_tracks_are_in_the_sensors_frame_and_nothing_is_decided() -> None:
    messages = [boxes(k * 0.05, [car(20.0 - k * 0.5, 0.0)]) for k in range(20)]
    outputs, perception = outputs_of(messages, SETTINGS)
    frames = [o for o in outputs if isinstance(o, FrameOutput)]
    assert len(frames) == perception.counts.without_pose == 20
    assert {f.frame_id for f in frames} == {LIDAR}
    assert {len(f.tracks) for f in frames} == {1}
    assert all(f.decision is None and f.area_markers == () for f in frames)
    assert [o.level for o in outputs if isinstance(o, Diagnostics)] == [ERROR]
    # only the first frame waits: nobody knows then that nothing comes
    perception = LivePerception(SETTINGS)
    assert perception.take(messages[0]) == []
    assert len(perception.take(messages[1])) == 2
    assert len(perception.take(messages[2])) == 1


def test_odometry_that_begins_later_begins_the_tracks_anew_with_other_numbers() -> None:
    messages: list[Message] = [boxes(k * 0.05, [car(20.0, 0.0)]) for k in range(20)]
    messages += [odometry(k * 0.05, (100.0, 0.0, 0.0)) for k in range(10, 20)]
    frames, _ = frames_of(received(messages), SETTINGS)
    assert [f.frame_id for f in frames] == [LIDAR] * 10 + [MAP] * 10
    assert [f.tracks.track_id.tolist() for f in (frames[9], frames[10])] == [[1], [2]]
    actions = [(m.marker_id, m.action) for m in frames[10].markers if m.kind == CUBE]
    assert actions == [(1, DELETE), (2, ADD)]


def test_only_odometry_gives_statuses_and_nothing_else() -> None:
    outputs, _ = outputs_of([odometry(k * 0.1, (0.0, 0.0, 0.0)) for k in range(32)], SETTINGS)
    statuses = [o for o in outputs if isinstance(o, Diagnostics)]
    assert len(statuses) == len(outputs) == 4
    assert [(s.stamp_ns - ns(0)) // 10**8 for s in statuses] == [10, 20, 30, 31]
    assert {s.message for s in statuses} == {"no frames"}


def test_a_stream_without_messages_gives_nothing() -> None:
    assert outputs_of([], SETTINGS)[0] == []


def test_late_and_repeated_frames_are_counted_and_not_tracked() -> None:
    on_time = straight(20, lambda t: [car(40.0, 0.0)])
    frame = next(m for m in on_time if isinstance(m, DetectionMessage) and m.stamp_ns == ns(0.5))
    late = [later(frame, 100_000_000), later(frame, 0), later(frame, 200_000_000)]
    expected, _ = frames_of(on_time, SETTINGS)
    frames, perception = frames_of(received([*on_time, *late]), SETTINGS)
    assert perception.counts.late == 3
    assert (perception.counts.frames, perception.counts.tracked) == (23, 20)
    assert [f.stamp_ns for f in frames] == [f.stamp_ns for f in expected]
    assert all(
        np.array_equal(a.tracks.center_m, b.tracks.center_m) for a, b in zip(frames, expected, strict=True)
    )


def test_after_time_went_back_all_begins_anew() -> None:
    first = straight(40, lambda t: [car(40.0, 0.0)])
    again = [later(m, 3_000_000_000) for m in first]
    frames, perception = frames_of([*first, *again], SETTINGS)
    counts = perception.counts
    assert (counts.restarts, counts.late) == (1, LATE_LIMIT - 1)
    assert counts.tracked == 40 + 40 - (LATE_LIMIT - 1) == len(frames)
    assert frames[40].tracks.track_id.tolist() == [2]


def test_a_clock_that_is_set_back_is_followed() -> None:
    """A simulation begins anew: a status each second, and frames wait for poses that come after them."""
    drive = straight(80, lambda t: [car(40.0, 0.0)])
    drive = received([later(m, 20_000_000) if isinstance(m, OdometryMessage) else m for m in drive])
    outputs, perception = outputs_of([*drive, *drive], SETTINGS)
    statuses = [output.stamp_ns for output in outputs if isinstance(output, Diagnostics)]
    assert [stamp - ns(0.0) for stamp in statuses[:3]] == [1_000_000_000, 2_000_000_000, 3_000_000_000]
    assert statuses[3:6] == pytest.approx(statuses[:3], rel=0.0, abs=1)
    assert perception.counts.restarts == 1
    assert perception.counts.carried == 0


def test_a_single_stamp_of_the_future_blocks_nothing() -> None:
    messages = straight(20, lambda t: [car(40.0, 0.0)])
    wrong = replace(boxes(0.5, [car(20.0, 0.0)]), stamp_ns=ns(1000.0))
    frames, perception = frames_of(received([*messages, wrong]), SETTINGS)
    assert len(frames) == 20
    assert (perception.counts.without_pose, perception.counts.late) == (1, 0)


def test_an_empty_header_counts_as_received_and_in_the_last_frame_that_was_named() -> None:
    messages = straight(10, lambda t: [car(40.0, 0.0)], after_s=0.004)
    fifth = [m for m in messages if isinstance(m, DetectionMessage)][5]
    messages = [replace(m, stamp_ns=None, frame_id="") if m is fifth else m for m in messages]
    frames, perception = frames_of(messages, replace(SETTINGS, output_frame="sensor"))
    assert perception.counts.unstamped == 1
    assert frames[5].stamp_ns == fifth.received_ns
    assert {f.frame_id for f in frames} == {LIDAR}


def test_boxes_are_placed_where_they_were_and_where_the_reader_of_bags_has_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Frame 7 has no header and comes 3 ms after its stamp: the pose is the newest, as with tf2's stamp 0."""
    frames: list[PlacedFrame] = []

    def seen(*arguments: Any) -> PlacedFrame:
        frames.append(place(*arguments))
        return frames[-1]

    monkeypatch.setattr(core, "place", seen)
    with open_bag(MCAP) as bag:
        names = [topic.name for topic in bag.topics]
        perception = LivePerception(SETTINGS)
        for topic, message in bag.messages(*names):
            perception.take(message, topic.name == "/tf_static")
        perception.finish()
    assert perception.counts.unstamped == 1
    truth = json.loads((DATA / "truth.json").read_text())
    expected = [[(b["x_m"], b["y_m"], b["yaw_rad"]) for b in frame["objects"]] for frame in truth]
    center = np.array([frame.detections.boxes.center_m for frame in frames])
    yaw = np.array([frame.detections.boxes.yaw_rad for frame in frames])
    np.testing.assert_allclose(center, np.array(expected)[:, :, :2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(yaw, np.array(expected)[:, :, 2], rtol=0, atol=1e-6)
    recorded = read_bag(MCAP).sequences[0].detections
    np.testing.assert_array_equal(np.concatenate(center), recorded.center_m)


@pytest.mark.parametrize(
    ("newest_s", "clock_s", "pose_x_m"),
    [
        (0.9, 0.0, 9.0),  # the newest pose, not carried on to 1.0 s
        (0.9, 500.0, 9.0),  # stamps of a simulation, receipt by another clock
        (0.7, 0.0, None),  # no pose came for 0.3 s: there is none at the time of receipt
    ],
)
def test_without_a_header_the_newest_pose_counts_as_long_as_poses_come(
    newest_s: float, clock_s: float, pose_x_m: float | None
) -> None:
    poses = [odometry(t, (10.0 * t, 0.0, 0.0), 10.0, after_s=clock_s) for t in (0.5, 0.6, newest_s)]
    frame = replace(boxes(1.0, [car(20.0, 0.0)], after_s=clock_s), stamp_ns=None)
    sensor = replace(SETTINGS, sensor_pose=(0.0, 0.0, 0.0, 0.0))
    frames, perception = frames_of([*poses, frame], sensor)
    assert perception.counts.without_pose == (pose_x_m is None)
    assert perception.counts.carried == 0
    if pose_x_m is not None:
        assert frames[0].tracks.center_m[0, 0] == pytest.approx(pose_x_m + 20.0)


def test_classes_are_those_of_recordings_unless_a_data_set_is_named() -> None:
    assert class_names(LiveSettings().dataset) == CLASSES
    rows = [(name, 20.0, 3.0 * k, 0.0, 4.0, 1.8, 0.9) for k, name in enumerate(("trailer", "rider", "car"))]
    unknown = {
        name: frames_of([boxes(1.0, rows)], replace(SETTINGS, dataset=name))[1].counts.unknown_classes
        for name in DATASETS
    }
    assert unknown == {"any": {}, "simbev": {"trailer": 1}, "nuscenes": {"rider": 1}}


def test_without_any_name_of_the_sensor_the_vehicles_frame_stands_in() -> None:
    unnamed = boxes(0.0, [car(20.0, 1.0)], frame_id="")
    (alone,), perception = frames_of([unnamed], SETTINGS)
    assert (alone.frame_id, perception.counts.unnamed) == (BASE, 1)
    # a sensor that looks to the left, 2 m ahead of the vehicle's origin
    turned = replace(SETTINGS, sensor_pose=(2.0, 0.0, 1.0, math.pi / 2), output_frame="sensor")
    (alone,), _ = frames_of([unnamed], turned)
    (posed,), _ = frames_of([odometry(0.0, (50.0, 7.0, 0.4)), unnamed], turned)
    named = boxes(0.0, [car(20.0, 1.0)])
    (of_sensor,), perception = frames_of([odometry(0.0, (50.0, 7.0, 0.4)), named], turned)
    assert (of_sensor.frame_id, perception.counts.unnamed) == (LIDAR, 0)
    for frame in (alone, posed):
        assert frame.frame_id == BASE
        assert frame.tracks.center_m[0] == pytest.approx([2.0 - 1.0, 20.0, 1.8])
        assert frame.tracks.yaw_rad == pytest.approx(math.pi / 2)
    assert of_sensor.tracks.center_m[0] == pytest.approx([20.0, 1.0, 0.8])


def test_impossible_boxes_and_unknown_classes_are_counted() -> None:
    rows: list[Row] = [
        car(20.0, 0.0),
        car(math.nan, 0.0),
        car(20.0, 5.0, score=math.nan),
        car(20.0, 9.0, score=0.1),
        ("traffic_cone", 20.0, 0.0, 0.0, 0.3, 0.3, 0.9),
        ("Pedestrian", 10.0, 8.0, 0.0, 0.5, 0.5, 0.9),
        ("dragon", 20.0, 0.0, 0.0, 9.0, 2.0, 0.9),
    ]
    frames, perception = frames_of([odometry(0.0, (0.0, 0.0, 0.0)), boxes(0.0, rows)], SETTINGS)
    counts = perception.counts
    assert (counts.boxes, counts.rejected, counts.under_threshold) == (7, 2, 1)
    assert (counts.other_classes, dict(counts.unknown_classes)) == (1, {"dragon": 1})
    assert sorted(frames[0].tracks.category.tolist()) == ["car", "pedestrian"]


@pytest.mark.parametrize("count", [0, 500])
def test_frames_of_any_size(count: int) -> None:
    rows = [car(20.0 + 6.0 * (k % 25), 4.0 * (k // 25) - 40.0) for k in range(count)]
    messages = [m for k in range(3) for m in (odometry(k * 0.05, (0, 0, 0)), boxes(k * 0.05, rows))]
    frames, _ = frames_of(messages, SETTINGS)
    assert [len(f.tracks) for f in frames] == [count] * 3


def test_transforms_place_the_sensor() -> None:
    mounted = transform(0.0, BASE, LIDAR, 1.5, 0.2, math.pi / 2)
    (frame,), perception = frames_of(
        [odometry(0.0, (10.0, 0.0, 0.0)), mounted, boxes(0.0, [car(0.2, -20.0, -math.pi / 2)])], SETTINGS
    )
    assert frame.tracks.center_m[0] == pytest.approx([31.5, 0.4, 0.8])
    assert frame.tracks.yaw_rad[0] == pytest.approx(0.0, abs=1e-9)
    assert perception.counts.without_transform == {}
    given_pose = replace(SETTINGS, sensor_pose=(1.5, 0.2, 0.0, math.pi / 2))
    (same,), _ = frames_of(
        [odometry(0.0, (10.0, 0.0, 0.0)), boxes(0.0, [car(0.2, -20.0, -math.pi / 2)])], given_pose
    )
    assert same.tracks.center_m == pytest.approx(frame.tracks.center_m)


def test_an_unknown_sensor_is_taken_to_be_at_the_vehicles_origin_and_counted() -> None:
    _, perception = frames_of(straight(10, lambda t: [car(40.0, 0.0)]), SETTINGS)
    assert perception.counts.without_transform == {LIDAR: 10}
    assert perception.localisation.assumed == {LIDAR}


def test_frames_before_the_transform_of_their_sensor_came_are_counted_by_its_name() -> None:
    messages = straight(10, lambda t: [car(40.0, 0.0)])
    late = later(transform(0.0, BASE, LIDAR, 1.0, 0.0, 0.0), 220_000_000)
    _, perception = frames_of(received([*messages, late]), SETTINGS)
    assert perception.localisation.assumed == set()
    # the frames of 0 s to 0.2 s: when the first has waited in vain, the next ones do not
    assert perception.counts.without_transform == {LIDAR: 5}


def test_scores_out_of_range_are_counted_apart() -> None:
    rows = [car(20.0, 0.0, score=3.0), car(30.0, 0.0, score=math.nan), car(math.nan, 0.0)]
    _, perception = frames_of([boxes(0.0, rows)], SETTINGS)
    assert (perception.counts.rejected, perception.counts.without_score) == (3, 2)


def test_transforms_alone_tell_the_pose() -> None:
    by_odometry = straight(30, crossing)
    by_transforms: list[Message] = [transform(0.0, "odom", BASE, 0.0, 0.0, 0.0)]
    for k in range(30):
        time_s = k * 0.05
        by_transforms.append(transform(time_s, "odom", BASE, 10.0 * time_s - 3.0, 1.0, 0.0))
        by_transforms.append(transform(time_s, MAP, "odom", 3.0, -1.0, 0.0))
    by_transforms = by_transforms[1:] + [m for m in by_odometry if isinstance(m, DetectionMessage)]
    expected, _ = frames_of(by_odometry, SETTINGS)
    frames, _ = frames_of(received(by_transforms), SETTINGS)
    assert {f.frame_id for f in frames} == {MAP}
    for a, b in zip(frames, expected, strict=True):
        assert a.tracks.center_m == pytest.approx(b.tracks.center_m, abs=1e-9)
    # speeds are differences of poses, so that decisions are the same from the second frame on
    a, b = frames[-1].decision, expected[-1].decision
    assert a is not None
    assert b is not None
    assert a.predicted_collision == b.predicted_collision
    assert a.nearest_m == b.nearest_m


def test_tracks_in_the_sensors_frame_lie_where_the_boxes_lie() -> None:
    chosen = replace(SETTINGS, output_frame="sensor")
    frames, _ = frames_of(straight(10, lambda t: [car(40.0, 3.0, 0.3)]), chosen)
    assert [f.frame_id for f in frames] == [LIDAR] * 10
    for k, frame in enumerate(frames):
        assert frame.tracks.center_m[0] == pytest.approx([40.0 - 0.5 * k, 3.0, 0.8], abs=0.05)
        assert frame.tracks.yaw_rad[0] == pytest.approx(0.3, abs=0.05)
        # over ground, although the sensor moves
        assert np.hypot(*frame.tracks.velocity_mps[0]) < 0.5


def test_max_age_counts_frames_of_the_stream() -> None:
    def lived(max_age: int) -> int:
        chosen = replace(SETTINGS, max_age=max_age)
        messages = straight(40, lambda t: [car(30.0, 4.0)] if t < 1.95 else [], interval_s=0.1)
        frames, _ = frames_of(messages, chosen)
        return sum(len(f.tracks) for f in frames) - 20

    assert [lived(age) for age in (0, 2, 5)] == [0, 2, 5]


@pytest.mark.parametrize("max_age", [0, 1, 3])
def test_max_age_counts_frames_whose_stamps_are_not_even(max_age: int) -> None:
    """Each is up to 4 ms off, so that three intervals are 150 +- 8 ms."""
    rng = np.random.default_rng(max_age)
    messages: list[Message] = []
    for k in range(40):
        time_s = 0.05 * k + rng.uniform(-0.004, 0.004)
        messages += [odometry(time_s, (0.0, 0.0, 0.0)), boxes(time_s, [car(30.0, 4.0)] if k < 20 else [])]
    frames, _ = frames_of(messages, replace(SETTINGS, max_age=max_age))
    assert [len(f.tracks) for f in frames] == [1] * (20 + max_age) + [0] * (20 - max_age)


def test_a_single_pose_of_the_future_hides_none_of_the_next() -> None:
    messages = straight(40, lambda t: [car(40.0, 4.0)])
    wrong = replace(odometry(0.0, (0.0, 0.0, 0.0)), stamp_ns=ns(1000.0), received_ns=ns(1.0))
    frames, perception = frames_of(received([*messages, wrong]), SETTINGS)
    assert perception.counts.without_pose <= 1
    assert frames[-1].stamp_ns == ns(1.95)
    assert frames[-1].tracks.center_m[0] == pytest.approx([40.0, 4.0, 0.8], abs=0.05)


def test_detections_under_the_threshold_are_dropped() -> None:
    messages = straight(5, lambda t: [car(30.0, 4.0, score=0.4)])
    assert [len(f.tracks) for f in frames_of(messages, SETTINGS)[0]] == [1] * 5
    frames, perception = frames_of(messages, replace(SETTINGS, detection_th=0.5))
    assert [len(f.tracks) for f in frames] == [0] * 5
    assert perception.counts.under_threshold == 5


def turning(velocities: str) -> list[Message]:
    """A vehicle that heads north; a car crosses it eastwards, with velocities in the axes that are named."""
    messages: list[Message] = []
    for k in range(40):
        time_s = k * 0.1
        sent = (5.0, 0.0, 0.0) if velocities == "world" else (0.0, -5.0, 0.0)
        messages.append(odometry(time_s, (0.0, 2.0 * time_s, math.pi / 2), 2.0))
        row = car(30.0 - 2.0 * time_s, 10.0 - 5.0 * time_s, -math.pi / 2)
        messages.append(boxes(time_s, [row], [sent]))
    return messages


@pytest.mark.parametrize("axes", ["sensor", "world"])
def test_the_axes_of_velocities_are_told_by_displacements(axes: str) -> None:
    other = "world" if axes == "sensor" else "sensor"
    _, perception = frames_of(turning(axes), SETTINGS)
    assert perception.velocities[""].agreeing() == (axes,)
    note = perception.velocities[""].note("ignore")
    assert note is not None
    assert f"axes of: {axes}" in note
    assert perception.velocities[""].note(axes) is None
    assert f"velocity_frame is {other}" in str(perception.velocities[""].note(other))


def test_velocities_are_used_in_the_axes_that_are_chosen() -> None:
    for axes in ("sensor", "world"):
        frames, _ = frames_of(turning(axes)[:2], replace(SETTINGS, velocity_frame=axes))
        assert frames[0].tracks.velocity_mps[0] == pytest.approx([5.0, 0.0], abs=0.3)
    frames, _ = frames_of(turning("world")[:2], SETTINGS)
    assert frames[0].tracks.velocity_mps[0] == pytest.approx([0.0, 0.0])


def test_with_a_map_the_area_lies_along_the_lanes() -> None:
    network, (x, y, yaw) = load_map(STREET), (100.0, -1.75, 0.0)
    messages: list[Message] = []
    for k in range(5):
        messages.append(odometry(k * 0.05, (x, y, yaw), 10.0))
        messages.append(boxes(k * 0.05, [car(20.0, 0.0), car(20.0, 60.0)]))
    frames, perception = frames_of(messages, replace(SETTINGS, strategy=None), network)
    assert perception.strategy == "map"
    assert perception.counts.off_map == 0
    assert len(frames[-1].tracks) == 1  # what is far from every monitored lane is not tracked
    lines = [m for m in frames[-1].area_markers if m.action == ADD]
    assert lines
    assert {m.kind for m in lines} == {LINE_STRIP}
    assert all(m.points_m[0] == m.points_m[-1] for m in lines)
    far, perception = frames_of([odometry(0.0, (x, y + 500.0, yaw), 10.0), boxes(0.0, [])], None, network)
    assert perception.counts.off_map == len(far) == 1


def test_a_status_is_an_error_as_long_as_no_frame_is_on_the_map() -> None:
    def drive(y_m: tuple[float, ...]) -> list[Diagnostics]:
        messages: list[Message] = []
        for k, y in enumerate(y_m):
            messages += [odometry(k * 0.4, (100.0 + 4.0 * k, y, 0.0), 10.0), boxes(k * 0.4, [])]
        outputs, _ = outputs_of(messages, None, load_map(STREET))
        return [o for o in outputs if isinstance(o, Diagnostics)]

    lane, field = -1.75, 500.0
    assert [s.level for s in drive((field,) * 5)] == [ERROR, ERROR]
    assert "is it in the frame of the odometry?" in drive((field,) * 5)[-1].message
    assert [s.level for s in drive((lane,) * 5)] == [OK, OK]
    beside = drive((lane, lane, lane, field, field))
    assert [s.level for s in beside] == [OK, WARN]
    assert beside[-1].message == "frames off the map: 2"


def test_the_outline_is_measured_from_the_vehicles_frame() -> None:
    """With the rear axle as the vehicle's frame, the front is nearer to the object."""
    ahead = replace(SETTINGS, vehicle=Vehicle(4.4, 1.8, 1.4))
    messages = straight(60, lambda t: [car(35.0, 0.0)])
    (a, _), (b, _) = frames_of(messages, SETTINGS), frames_of(messages, ahead)
    gaps = [[f.decision.nearest_m for f in frames if f.decision][30] for frames in (a, b)]
    assert gaps[0] is not None
    assert gaps[1] is not None
    assert gaps[0] - gaps[1] == pytest.approx(1.4, abs=1e-6)


def test_statuses_tell_what_has_changed_for_the_worse() -> None:
    messages = straight(60, lambda t: [car(40.0, 0.0)])
    bad = later(boxes(0.1, [car(20.0, 0.0)]), 1_200_000_000)
    outputs, _ = outputs_of(received([*messages, bad]), SETTINGS)
    statuses = [o for o in outputs if isinstance(o, Diagnostics)]
    assert [s.level for s in statuses] == [OK, WARN, OK]
    assert statuses[1].message == "frames late: 1"
    assert dict(statuses[-1].values)["frames tracked"] == "60"


def test_messages_of_no_use_are_counted() -> None:
    _, perception = outputs_of([LaneMessage(None, ns(0), ())], SETTINGS)
    assert perception.counts.other_messages == 1


def test_mistakes_in_settings_are_told_before_the_first_message() -> None:
    with pytest.raises(ScenarioError, match="needs a map"):
        LivePerception(replace(SETTINGS, strategy="map"))
    with pytest.raises(ScenarioError, match="unknown strategy 'lanes'"):
        LivePerception(replace(SETTINGS, strategy="lanes"))
    with pytest.raises(ScenarioError, match="unknown preset"):
        LivePerception(LiveSettings(preset="sunny"))
    for wrong in ({"dataset": "x"}, {"velocity_frame": "x"}, {"max_age": -1}, {"detection_th": 2.0}):
        with pytest.raises(ScenarioError, match=next(iter(wrong))):
            LiveSettings(**wrong)  # type: ignore[arg-type]
