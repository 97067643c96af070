"""Bags of what is published: every row of the interface, both storages alike, read back by rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

from scenarios.errors import DatasetError
from scenarios.live.bag_writer import BagWriter
from scenarios.live.counts import Diagnostics
from scenarios.live.outputs import CUBE, FrameOutput
from scenarios.live.perception import Output
from scenarios.live.published import DIAGNOSTIC_NAME, NO_OBJECT_M
from scenarios.live.settings import LiveSettings
from scenarios.live.topics import AREA, COLLISION, DIAGNOSTICS, MARKERS, NEAREST, PUBLISHED, TRACKS
from scenarios.ros.definitions import ros2_types
from tests.scenarios.live.streams_made import Row, outputs_of, straight

DEPTHS = {TRACKS.name: 10, MARKERS.name: 10, COLLISION.name: 20, NEAREST.name: 20, AREA.name: 20}
"""Of the interface."""


def objects(time_s: float) -> list[Row]:
    rows: list[Row] = [("car", 40.0, 0.0, 0.0, 4.5, 1.8, 0.9)]
    return rows + [("pedestrian", 30.0, -6.0 + 1.4 * time_s, 1.5, 0.5, 0.5, 0.8)] * (time_s < 1.0)


@pytest.fixture(scope="module")
def outputs() -> list[Output]:
    return outputs_of(straight(40, objects), LiveSettings(preset="physical", strategy="rectangular"))[0]


def written(path: Path, outputs: list[Output], storage: str | None = None) -> Path:
    with BagWriter(path, storage) as bag:
        for output in outputs:
            bag.write(output)
    return path


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Times and messages by topic."""
    types = ros2_types()
    rows: dict[str, list[tuple[int, Any]]] = {}
    with Reader(path) as reader:
        for connection, time_ns, data in reader.messages():
            message = types.deserialize_cdr(data, connection.msgtype)
            rows.setdefault(connection.topic, []).append((time_ns, message))
    return rows


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_every_topic_comes_back_as_it_was_published(
    tmp_path: Path, outputs: list[Output], storage: str
) -> None:
    rows = read(written(tmp_path / "bag", outputs, storage))
    frames = [output for output in outputs if isinstance(output, FrameOutput)]
    assert set(rows) == {topic.name for topic in PUBLISHED}
    by_topic = [rows[topic.name] for topic in (MARKERS, TRACKS, COLLISION, NEAREST, AREA)]
    assert {len(messages) for messages in by_topic} == {len(frames)}
    for frame, *published in zip(frames, *by_topic, strict=True):
        assert {time_ns for time_ns, _ in published} == {frame.received_ns}
        markers, tracks, collision, nearest, area = (message for _, message in published)
        header = tracks.header
        assert (header.stamp.sec * 10**9 + header.stamp.nanosec, header.frame_id) == (frame.stamp_ns, "map")
        assert [int(detection.id) for detection in tracks.detections] == frame.tracks.track_id.tolist()
        for k, detection in enumerate(tracks.detections):
            center, size = detection.bbox.center.position, detection.bbox.size
            assert np.array_equal((center.x, center.y, center.z), frame.tracks.center_m[k])
            assert np.array_equal((size.x, size.y, size.z), frame.tracks.size_m[k])
            hypothesis = detection.results[0].hypothesis
            assert (hypothesis.class_id, hypothesis.score) == (
                frame.tracks.category[k],
                frame.tracks.score[k],
            )
            turn = detection.bbox.center.orientation
            assert 2.0 * np.arctan2(turn.z, turn.w) == pytest.approx(frame.tracks.yaw_rad[k])
        assert [(m.ns, m.id, m.type, m.action) for m in markers.markers] == [
            (m.ns, m.marker_id, m.kind, m.action) for m in frame.markers
        ]
        cubes = [m for m in markers.markers if m.type == CUBE and m.action == 0]
        assert all(m.header.frame_id == "map" and m.lifetime.nanosec > 0 and m.color.a > 0 for m in cubes)
        assert frame.decision is not None
        assert collision.data == frame.decision.predicted_collision
        assert nearest.data == (frame.decision.nearest_m or NO_OBJECT_M)
        assert len(area.markers) == len(frame.area_markers) > 0
    statuses = [output for output in outputs if isinstance(output, Diagnostics)]
    told = [message.status[0] for _, message in rows[DIAGNOSTICS.name]]
    assert [(s.level, s.message) for s in told] == [(s.level, s.message) for s in statuses]
    assert {s.name for s in told} == {DIAGNOSTIC_NAME}
    assert [(pair.key, pair.value) for pair in told[-1].values] == list(statuses[-1].values)


def test_metadata_has_counts_and_quality_of_service(tmp_path: Path, outputs: list[Output]) -> None:
    written(tmp_path / "bag", outputs)
    content = YAML(typ="safe").load((tmp_path / "bag" / "metadata.yaml").read_text())
    info = content["rosbag2_bagfile_information"]
    counted = {t["topic_metadata"]["name"]: t["message_count"] for t in info["topics_with_message_count"]}
    assert counted == {name: len(messages) for name, messages in read(tmp_path / "bag").items()}
    assert info["message_count"] == sum(counted.values())
    for topic in info["topics_with_message_count"]:
        (quality,) = topic["topic_metadata"]["offered_qos_profiles"]
        assert (quality["reliability"], quality["durability"]) == ("reliable", "volatile")
        assert quality["depth"] == DEPTHS.get(topic["topic_metadata"]["name"], 10)


def test_equal_outputs_give_equal_bytes(tmp_path: Path, outputs: list[Output]) -> None:
    first, second = (written(tmp_path / name / "bag", outputs) for name in "ab")
    files = sorted(path.name for path in first.iterdir())
    assert files == ["bag.mcap", "metadata.yaml"]
    assert all((first / name).read_bytes() == (second / name).read_bytes() for name in files)


@pytest.mark.parametrize("name", ["seen.mcap", "seen.db3"])
def test_a_suffix_asks_for_a_single_file(tmp_path: Path, outputs: list[Output], name: str) -> None:
    from scenarios.ros.bags.bag import open_bag

    path = written(tmp_path / name, outputs)
    assert path.is_file()
    assert [p.name for p in tmp_path.iterdir()] == [name]
    with open_bag(path) as bag:
        assert len(bag.messages(TRACKS.name)) == 40


def test_what_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(DatasetError, match="is there already; name another one or remove it"):
        BagWriter(tmp_path / "bag")


def test_the_suffix_and_the_storage_agree(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"a file \.db3 is of storage sqlite3, not mcap"):
        BagWriter(tmp_path / "bag.db3", "mcap")
    with pytest.raises(DatasetError, match="unknown 'tape'"):
        BagWriter(tmp_path / "bag", "tape")


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_after_an_error_nothing_stays(tmp_path: Path, outputs: list[Output], storage: str) -> None:
    def broken() -> list[Output]:
        raise ValueError("halfway")

    bag = BagWriter(tmp_path / "bag", storage)
    with pytest.raises(ValueError, match="halfway"), bag:
        any(map(bag.write, (*outputs[:3], *broken())))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DatasetError, match="cannot be written"):
        BagWriter(tmp_path / "file" / "bag")
