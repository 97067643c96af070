"""Bags of every kind against what their own metadata says, and against rosbags and mcap."""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from rosbags.rosbag1.writer import Writer as Ros1Writer

from scenarios.errors import DatasetError
from scenarios.ros.bags.bag import is_bag, open_bag
from scenarios.ros.definitions import (
    BEV_DETECTIONS,
    MONITORED_LANES,
    ODOMETRY,
    PREDICTION_ARRAY,
)
from scenarios.ros.messages import DetectionMessage, LaneMessage, Message, OdometryMessage
from tests.scenarios.ros import bags_made as made

SHARED = Path(__file__).parents[4].parent / "shared" / "ros2" / "rosbag2"
ROS2_BAGS = (
    "cdr_mcap", "no_definitions_sqlite3", "services_mcap", "services_sqlite3", "split_mcap",
    "talker_mcap", "talker_sqlite3", "wrong_encoding_mcap",
)  # fmt: skip


def counts(path: Path) -> Counter[str]:
    with open_bag(path) as bag:
        return Counter(message.topic.name for message in bag.raw())


def values(path: Path) -> list[Message]:
    with open_bag(path) as bag:
        return [message for _, message in bag.messages(made.DETECTIONS, made.POSE)]


def require_same(first: list[Message], second: list[Message]) -> None:
    assert len(first) == len(second)
    for one_message, other in zip(first, second, strict=True):
        assert type(one_message) is type(other)
        for name in type(one_message).__slots__:
            np.testing.assert_array_equal(getattr(one_message, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("name", ROS2_BAGS)
def test_bags_of_ros2_hold_what_their_metadata_say(name: str) -> None:
    """Counts out of metadata.yaml, which is read here as text."""
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip("bags of ROS 2's tests are not in ../shared/ros2/rosbag2")
    [total, *_] = [
        int(line.split(":")[1])
        for line in (folder / "metadata.yaml").read_text().splitlines()
        if line.startswith("  message_count:")
    ]
    counted = counts(folder)
    assert counted.total() == total
    with open_bag(folder) as bag:
        assert bag.counts is not None
        assert counted == +bag.counts


def test_an_unknown_serialisation_is_refused_by_topic(tmp_path: Path) -> None:
    odd = [replace(row, encoding="wrong_format") if row.topic == made.POSE else row for row in made.stored()]
    with open_bag(made.write_mcap(tmp_path / "a.mcap", odd)) as bag:
        assert len(bag.messages(made.DETECTIONS)) == 40
        with pytest.raises(DatasetError, match=r"topic /localization/pose: serialisation 'wrong_format'"):
            bag.messages(made.POSE)


def test_both_storages_hold_the_same_messages() -> None:
    read = values(made.SQLITE)
    assert Counter(map(type, read)) == {DetectionMessage: 40, OdometryMessage: 40}
    require_same(read, values(made.MCAP))
    assert [m.received_ns for m in read] == sorted(m.received_ns for m in read)


def test_topics_are_known_by_type() -> None:
    with open_bag(made.MCAP) as bag:
        assert [topic.name for topic in bag.of_type(PREDICTION_ARRAY)] == [made.DETECTIONS]
        assert [topic.name for topic in bag.of_type(ODOMETRY)] == [made.POSE]
        assert bag.of_type("std_msgs/msg/String") == ()


@pytest.mark.parametrize("compression", list(made.CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_chunks_are_expanded(tmp_path: Path, compression: made.CompressionType, chunked: bool) -> None:
    path = made.write_mcap(
        tmp_path / "a.mcap", made.stored(), compression, chunk_size=4000, use_chunking=chunked
    )
    require_same(values(path), values(made.MCAP))
    with path.open("rb") as stream:  # the library of the format's authors
        assert sum(1 for _ in make_reader(stream).iter_messages()) == 80


@pytest.mark.parametrize(
    "options",
    [
        {"use_statistics": False},
        {"use_summary_offsets": False, "index_types": made.IndexType.NONE},
        {"repeat_channels": False},
        {"repeat_schemas": False},
        {"repeat_channels": False, "repeat_schemas": False, "use_statistics": False},
        {"enable_crcs": False},
    ],
    ids=lambda options: "-".join(options),
)
def test_files_with_less_of_an_index_are_read(tmp_path: Path, options: dict[str, object]) -> None:
    path = made.write_mcap(tmp_path / "a.mcap", made.stored(), chunk_size=3000, **options)
    require_same(values(path), values(made.MCAP))


def test_chunks_without_the_topic_are_passed_over(tmp_path: Path) -> None:
    """One topic after the other, and the chunks of the first damaged: only they are not read."""
    rows = sorted(made.stored(), key=lambda row: row.topic)
    path = made.write_mcap(tmp_path / "a.mcap", rows, chunk_size=3000)
    content = bytearray(path.read_bytes())
    first = content.index(rows[0].data)
    content[first + 60] ^= 0xFF
    path.write_bytes(content)
    with open_bag(path) as bag:
        assert len(bag.messages(made.POSE)) == 40
        with pytest.raises(DatasetError, match="checksum of a chunk"):
            bag.messages(made.DETECTIONS)


@pytest.mark.parametrize("source", [made.SQLITE, made.MCAP])
@pytest.mark.parametrize("suffix", [".zstd", ".zst"])
def test_compressed_files_are_expanded(tmp_path: Path, source: Path, suffix: str) -> None:
    [file] = [f for f in source.iterdir() if f.name != "metadata.yaml"]
    packed = tmp_path / f"{file.name}{suffix}"
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    made.write_metadata(
        tmp_path, [packed.name], {made.DETECTIONS: 40, made.POSE: 40}, compression_format="zstd",
        compression_mode="FILE",
    )  # fmt: skip
    require_same(values(tmp_path), values(made.MCAP))
    require_same(values(packed), values(made.MCAP))


def test_messages_compressed_one_by_one_are_expanded(tmp_path: Path) -> None:
    compressed = [
        made.Stored(row.topic, row.type_name, row.received_ns, zstandard.compress(row.data))
        for row in made.stored()
    ]
    require_same(values(made.write_sqlite(tmp_path / "a.db3", compressed)), values(made.MCAP))


def test_definitions_of_our_own_stand_in(tmp_path: Path) -> None:
    bare = [made.Stored(row.topic, row.type_name, row.received_ns, row.data) for row in made.stored()]
    require_same(values(made.write_mcap(tmp_path / "a.mcap", bare)), values(made.MCAP))


def test_types_of_early_ros2_have_no_msg_in_their_names(tmp_path: Path) -> None:
    early = [
        made.Stored(row.topic, row.type_name.replace("/msg/", "/"), row.received_ns, row.data)
        for row in made.stored()
    ]
    require_same(values(made.write_sqlite(tmp_path / "a.db3", early)), values(made.MCAP))


def test_the_first_schema_of_sqlite_has_no_serialisation(tmp_path: Path) -> None:
    path = made.write_sqlite(tmp_path / "a.db3", made.stored())
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE old AS SELECT id, name, type FROM topics")
        database.execute("DROP TABLE topics")
        database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        database.execute("INSERT INTO topics SELECT * FROM old")
        database.commit()
    require_same(values(path), values(made.MCAP))


def test_split_files_are_read_in_order_and_counted_together(tmp_path: Path) -> None:
    rows = made.stored()
    names = [f"bag_{n}.db3" for n in range(12)]
    for n, name in enumerate(names):
        made.write_sqlite(tmp_path / name, rows[7 * n : 7 * n + 7])
    require_same(values(tmp_path), values(made.MCAP))
    # paths before version 4 begin with the folder
    made.write_metadata(tmp_path, [f"bag/{n}" for n in names], {made.DETECTIONS: 40, made.POSE: 40})
    require_same(values(tmp_path), values(made.MCAP))
    require_same(values(tmp_path / "metadata.yaml"), values(made.MCAP))


def test_messages_are_sorted_by_receipt(tmp_path: Path) -> None:
    rows = made.stored()
    require_same(values(made.write_sqlite(tmp_path / "a.db3", rows[::-1])), values(made.MCAP))


def test_a_log_beside_the_database_is_read(tmp_path: Path) -> None:
    """Messages that a recorder did not bring into the main file before it was killed."""
    path = made.write_sqlite(tmp_path / "a.db3", made.stored()[:-1])
    last = made.stored()[-1]
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute(
            "INSERT INTO messages(topic_id, timestamp, data) "
            "SELECT id, ?, ? FROM topics WHERE name = ?", (last.received_ns, last.data, last.topic),
        )  # fmt: skip
        database.commit()
        for file in tmp_path.glob("a.db3*"):
            shutil.copy(file, tmp_path / file.name.replace("a.db3", "b.db3"))
    require_same(values(tmp_path / "b.db3"), values(made.MCAP))


def test_reading_leaves_nothing_behind(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    shutil.copytree(made.SQLITE, folder)
    before = sorted(folder.iterdir())
    values(folder)
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_bags_of_ros1_are_read(tmp_path: Path, compression: object) -> None:
    path = made.write_ros1(tmp_path / "a.bag", made.ros1_rows(), compression)
    with open_bag(path) as bag:
        assert {t.name: t.type_name for t in bag.topics} == {
            "/merged": BEV_DETECTIONS,
            "/lanes": MONITORED_LANES,
        }
        read = [message for _, message in bag.messages("/merged", "/lanes")]
    boxes = [message for message in read if isinstance(message, DetectionMessage)]
    lanes = [message for message in read if isinstance(message, LaneMessage)]
    assert [len(message) for message in boxes] == [0, 1, 2, 3, 4]
    assert boxes[3].stamp_ns == 1_600_000_000_150_000_000
    assert boxes[3].received_ns == 1_600_000_000_150_001_000
    np.testing.assert_allclose(boxes[1].position_m[:, :2], [(20.0, 3.0)])
    assert len(lanes) == 5
    np.testing.assert_allclose(lanes[0].lanes[0].left_m[:, 1], [2.0, 2.0])


def test_what_is_a_bag(tmp_path: Path) -> None:
    assert is_bag(made.SQLITE)
    assert is_bag(made.MCAP / "metadata.yaml")
    assert all(is_bag(Path(name)) for name in ("a.bag", "a.db3", "a.mcap", "a.mcap.zstd"))
    assert not any(is_bag(Path(name)) for name in ("a.csv", "a.json.zst", "bag"))
    assert not is_bag(tmp_path)
