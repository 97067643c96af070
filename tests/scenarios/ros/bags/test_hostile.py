"""Damaged and hostile bags: read as far as they say, or refused in one line with topic and reason."""

from __future__ import annotations

import random
import shutil
import sqlite3
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import DatasetError
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.bags.compression import MAX_PART_BYTES
from scenarios.ros.definitions import DETECTION_3D_ARRAY, ODOMETRY, PREDICTION_ARRAY, ros2_types
from scenarios.ros.messages import DetectionMessage, Message
from tests.scenarios.ros import bags_made as made

COUNTS = {made.DETECTIONS: 40, made.POSE: 40}
NOTHING = bytes.fromhex("00010000 0000000000000000 01000000 00000000 00000000")
"""CDR of an array message: stamp 0, frame '', no boxes."""
MAGIC = b"\x89MCAP0\r\n"


def messages(path: Path, *topics: str) -> list[Message]:
    with open_bag(path) as bag:
        return [message for _, message in bag.messages(*(topics or COUNTS))]


def refusal(path: Path, *topics: str) -> str:
    """What is said of a bag that cannot be read: one line that begins with a path."""
    with pytest.raises(DatasetError) as caught:
        messages(path, *topics)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    return text


def changed(path: Path, index: int, change: Callable[[bytes], bytes], topic: str = made.DETECTIONS) -> Path:
    """A SQLite bag with one message of a topic changed."""
    rows = made.stored()
    place = [n for n, row in enumerate(rows) if row.topic == topic][index]
    rows[place] = replace(rows[place], data=change(rows[place].data))
    return made.write_sqlite(path, rows)


@pytest.mark.parametrize("time_ns", [-1, 2**31 * 10**9])
def test_times_that_no_stamp_can_hold_are_refused(tmp_path: Path, time_ns: int) -> None:
    """An answer to an empty header would have such a stamp, whose seconds are int32."""
    rows = made.stored()
    path = made.write_sqlite(tmp_path / "a.db3", [replace(rows[0], received_ns=time_ns)])
    text = refusal(path, rows[0].topic)
    assert f"topic {rows[0].topic}, message received at {time_ns} ns" in text
    assert "2038" in text
    path = made.write_sqlite(tmp_path / "b.db3", [replace(rows[0], received_ns=2**31 * 10**9 - 1)])
    assert messages(path, rows[0].topic)[0].received_ns == 2**31 * 10**9 - 1


# files that are cut off, or longer than they say


def test_a_file_that_was_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    whole = made.write_mcap(tmp_path / "w.mcap", made.stored(), chunk_size=3000).read_bytes()
    read = []
    for share in (0.9, 0.6, 0.3, 0.05):
        path = tmp_path / "a.mcap"
        path.write_bytes(whole[: int(share * len(whole))])
        with open_bag(path) as bag:
            count = sum(1 for _ in bag.raw())
            assert bag.notes == (f"a.mcap: cut off; its {count} whole messages are read",)
        read.append(count)
    assert read == sorted(read, reverse=True)
    assert read[1] > 20


def test_a_cut_file_with_metadata_lacks_messages(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    shutil.copytree(made.MCAP, folder)
    [file] = folder.glob("*.mcap")
    file.write_bytes(
        made.write_mcap(tmp_path / "w.mcap", made.stored(), chunk_size=3000).read_bytes()[:20_000]
    )
    assert "messages, 40 in metadata.yaml" in refusal(folder)


@pytest.mark.parametrize(("count", "said"), [(39, "40 messages, 39"), (41, "40 messages, 41")])
def test_counts_of_the_metadata_hold(tmp_path: Path, count: int, said: str) -> None:
    made.write_sqlite(tmp_path / "a.db3", made.stored())
    made.write_metadata(tmp_path, ["a.db3"], COUNTS | {made.POSE: count})
    assert f"topic {made.POSE}: {said}" in refusal(tmp_path)
    # what is wrong with other topics is no fault of this
    assert len(messages(tmp_path, made.DETECTIONS)) == 40


def test_counts_of_the_statistics_hold(tmp_path: Path) -> None:
    content = made.write_mcap(tmp_path / "a.mcap", made.stored()).read_bytes()
    counts = struct.pack("<IHQHQ", 20, 1, 40, 2, 40)
    assert content.count(counts) == 1
    (tmp_path / "a.mcap").write_bytes(content.replace(counts, struct.pack("<IHQHQ", 20, 1, 40, 2, 41)))
    assert "40 messages, 41 in the file's statistics" in refusal(tmp_path / "a.mcap")


def test_metadata_agree_with_themselves(tmp_path: Path) -> None:
    made.write_sqlite(tmp_path / "a.db3", made.stored())
    made.write_metadata(tmp_path, ["a.db3"], COUNTS, message_count=79)
    assert "message_count is 79, those of the topics make 80" in refusal(tmp_path)


@pytest.mark.parametrize(
    "name", ["../a.db3", "/etc/passwd", "sub/../../a.db3", "..\\a.db3", "C:\\a.db3", "", "\0.db3"]
)
def test_metadata_name_files_of_the_folder_only(tmp_path: Path, name: str) -> None:
    made.write_sqlite(tmp_path / "a.db3", made.stored())
    (tmp_path / "bag").mkdir()
    made.write_metadata(tmp_path / "bag", [name], COUNTS)
    assert "is not a file in the bag's folder" in refusal(tmp_path / "bag")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not as rosbag2 writes it"),
        ("a: [", "not YAML"),
        ("rosbag2_bagfile_information: {message_count: -1}", "not as rosbag2"),
        ("rosbag2_bagfile_information: [1, 2]", "not as rosbag2"),
        ("[" * 5000, "nested too deeply"),
        ("- " * 5000, "nested too deeply"),
        ("!!python/object:os.system {}", "not YAML"),
        ("a: &a [x]\n" * 3, "not YAML"),
        ("\x80", "not"),
    ],
)
def test_metadata_that_are_none(tmp_path: Path, text: str, said: str) -> None:
    made.write_sqlite(tmp_path / "a.db3", made.stored())
    (tmp_path / "metadata.yaml").write_bytes(text.encode("latin-1"))
    assert said in refusal(tmp_path)


def test_files_that_metadata_name_are_there(tmp_path: Path) -> None:
    made.write_metadata(tmp_path, ["a.db3"], COUNTS)
    assert "no such file, but metadata.yaml names it" in refusal(tmp_path)


def test_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    made.write_sqlite(tmp_path / "a.db3", made.stored())
    made.write_metadata(tmp_path, ["a.db3"], COUNTS, compression_format="brotli")
    assert "compression_format 'brotli' is not read" in refusal(tmp_path)


# damaged files


def outcome(path: Path) -> str:
    """What comes of a bag: read, or refused in one line; anything else is an error of ours."""
    try:
        with open_bag(path) as bag:
            bag.messages(*(topic.name for topic in bag.topics if "_msgs/" in topic.type_name))
    except DatasetError as error:
        return f"refused in {len(str(error).splitlines())}"
    return "read"


@pytest.mark.parametrize("source", ["mcap", "db3", "chunks"])
def test_flipped_bits_never_end_in_a_traceback(tmp_path: Path, source: str) -> None:
    path = tmp_path / f"a.{source.replace('chunks', 'mcap')}"
    rows = made.stored()[:12]
    if source == "db3":
        made.write_sqlite(path, rows)
    else:
        made.write_mcap(path, rows, chunk_size=3000, use_chunking=source == "chunks", enable_crcs=False)
    whole, random_bits = path.read_bytes(), random.Random(5)
    outcomes = set()
    for _ in range(60):
        content = bytearray(whole)
        for _ in range(random_bits.randrange(1, 4)):
            content[random_bits.randrange(len(content))] ^= 1 << random_bits.randrange(8)
        path.write_bytes(content)
        outcomes.add(outcome(path))
    assert "refused in 1" in outcomes
    assert outcomes <= {"read", "refused in 1"}


def test_cut_and_flipped_bags_of_ros1_never_end_in_a_traceback(tmp_path: Path) -> None:
    whole = made.write_ros1(tmp_path / "w.bag", made.ros1_rows()).read_bytes()
    path, random_bits, outcomes = tmp_path / "a.bag", random.Random(6), set()
    for k in range(60):
        content = bytearray(whole)
        if k % 3:
            content[random_bits.randrange(len(content))] ^= 1 << random_bits.randrange(8)
        else:
            del content[random_bits.randrange(len(content)) :]
        path.write_bytes(content)
        outcomes.add(outcome(path))
    assert outcomes == {"read", "refused in 1"}


@pytest.mark.parametrize("suffix", [".db3", ".mcap", ".bag"])
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 100, b"SQLite format 3\0", MAGIC, MAGIC * 9, b"#ROSBAG V2.0\n"]
)
def test_files_that_are_no_bags(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    refusal(path)


def test_a_bag_compressed_by_halves(tmp_path: Path) -> None:
    [file] = made.SQLITE.glob("*.db3")
    path = tmp_path / "a.db3.zstd"
    path.write_bytes(zstandard.compress(file.read_bytes())[:-500])
    refusal(path)
    path.write_bytes(b"no zstd")
    assert "zstd: damaged data" in refusal(path)


# SQLite


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("DROP TABLE messages", "table messages is missing"),
        ("DROP TABLE topics", "table topics is missing"),
        ("ALTER TABLE messages RENAME COLUMN data TO what", "no column data"),
        ("UPDATE messages SET data = NULL WHERE id = 3", "no time or no data"),
        ("UPDATE messages SET timestamp = 'noon' WHERE id = 3", "no time or no data"),
        ("DELETE FROM topics WHERE id = 2", "messages of topic 2, which table topics does not have"),
        ("UPDATE topics SET name = CAST(X'2fff' AS TEXT)", "no UTF-8"),
    ],
)
def test_tables_of_another_shape(tmp_path: Path, statement: str, said: str) -> None:
    path = made.write_sqlite(tmp_path / "a.db3", made.stored())
    with closing(sqlite3.connect(path)) as database:
        sql = "SELECT sql FROM sqlite_master WHERE name = 'messages'"
        [(text,)] = database.execute(sql).fetchall()
        loose = text.replace("NOT NULL", "").replace("messages", "loose")
        database.executescript(
            f"{loose}; INSERT INTO loose SELECT * FROM messages; DROP TABLE messages; "
            f"ALTER TABLE loose RENAME TO messages; {statement};"
        )
    assert said in refusal(path, made.POSE)


def test_a_view_in_place_of_a_table_is_not_run(tmp_path: Path) -> None:
    """It would never end."""
    path = made.write_sqlite(tmp_path / "a.db3", made.stored())
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) AS "
            "(SELECT 1 UNION ALL SELECT id + 1 FROM n) "
            "SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n"
        )
    assert "table messages is missing" in refusal(path)


# serialised messages


def test_big_endian_messages_are_read(tmp_path: Path) -> None:
    store = ros2_types()

    def swapped(row: made.Stored) -> made.Stored:
        message = store.deserialize_cdr(row.data, row.type_name)
        return replace(row, data=bytes(store.serialize_cdr(message, row.type_name, little_endian=False)))

    path = made.write_mcap(tmp_path / "a.mcap", [swapped(row) for row in made.stored()])
    for first, second in zip(messages(path), messages(made.MCAP), strict=True):
        for name in type(first).__slots__:
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.parametrize("identifier", range(6, 12))
def test_xcdr2_is_refused_by_name(tmp_path: Path, identifier: int) -> None:
    path = changed(tmp_path / "a.db3", 3, lambda data: bytes((0, identifier)) + data[2:])
    assert f"topic {made.DETECTIONS}, message received at 1700000000303000000 ns: XCDR2" in refusal(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: b"",
        lambda data: data[:3],
        lambda data: data[:-40],
        lambda data: data + bytes(40),
        lambda data: b"\xff" + data[1:],
        lambda data: data[:16] + data[17:],
    ],
)
def test_damaged_messages_are_refused_by_topic(tmp_path: Path, change: Callable[[bytes], bytes]) -> None:
    assert f"topic {made.DETECTIONS}, message received at" in refusal(changed(tmp_path / "a.db3", 5, change))


@pytest.mark.parametrize("count", [2**31, 2**32 - 1, 2**31 - 1, 1000])
def test_more_boxes_than_there_are_bytes(tmp_path: Path, count: int) -> None:
    # encapsulation 4, stamp 8, length of "lidar" 4, "lidar" and zero 6, padding 2: the number of boxes
    def grown(data: bytes) -> bytes:
        assert struct.unpack("<I", data[24:28]) == (2,)
        return data[:24] + struct.pack("<I", count) + data[28:]

    path = changed(tmp_path / "a.db3", 2, grown)
    tracemalloc.start()
    text = refusal(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert f"topic {made.DETECTIONS}" in text
    assert peak < 100e6


def test_names_that_are_no_text(tmp_path: Path) -> None:
    path = changed(tmp_path / "a.db3", 1, lambda data: data.replace(b"lidar", b"\xff\xfelid"[:5]))
    assert f"topic {made.DETECTIONS}, message received at" in refusal(path)


def test_names_of_topics_that_are_no_text(tmp_path: Path) -> None:
    path = made.write_mcap(tmp_path / "a.mcap", made.stored())
    path.write_bytes(path.read_bytes().replace(b"/localization/pose", b"/localization/\xff\xfe\xff\xfe"))
    assert "a name is no UTF-8" in refusal(path)


def test_boxes_that_are_none_are_left_for_the_count(tmp_path: Path) -> None:
    store = ros2_types()

    def emptied(data: bytes) -> bytes:
        message = store.deserialize_cdr(data, PREDICTION_ARRAY)
        message.predictions[0].position.x = float("nan")  # type: ignore[attr-defined]
        message.predictions[1].size.y = float("inf")  # type: ignore[attr-defined]
        return bytes(store.serialize_cdr(message, PREDICTION_ARRAY))

    read = messages(changed(tmp_path / "a.db3", 0, emptied), made.DETECTIONS)[0]
    assert isinstance(read, DetectionMessage)
    assert np.isnan(read.position_m[0, 0])
    assert np.isinf(read.size_m[1, 0])


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300), st.sampled_from([PREDICTION_ARRAY, DETECTION_3D_ARRAY, ODOMETRY]))
def test_any_bytes_are_read_or_refused(data: bytes, type_name: str) -> None:
    from scenarios.reading import ReadError
    from scenarios.ros.bags.decoding import decoded
    from scenarios.ros.bags.topics import RawMessage, Topic

    message = RawMessage(Topic("/t", type_name, "cdr"), 1, b"\0\1\0\0" + data)
    try:
        said = f"topic /t {decoded(message).received_ns}"
    except ReadError as error:
        said = str(error)
    assert said.startswith("topic /t")


# types


def test_another_version_of_a_type_is_refused_by_its_hash(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    shutil.copytree(made.MCAP, folder)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("RIHS01_0819", "RIHS01_0818"))
    assert f"topic {made.DETECTIONS}: its {PREDICTION_ARRAY} has the hash RIHS01_0818" in refusal(folder)
    assert len(messages(folder, made.POSE)) == 40


def test_a_type_with_further_fields_is_read_by_its_own_definition(tmp_path: Path) -> None:
    row = made.stored()[1]
    parts = row.definition.split("float32 score")
    extended = "float32 score\nstring[] remarks".join(parts)
    path = made.write_mcap(
        tmp_path / "a.mcap",
        [replace(row, definition=extended, data=NOTHING)],
    )
    [message] = messages(path, made.DETECTIONS)
    assert isinstance(message, DetectionMessage)
    assert len(message) == 0


@pytest.mark.parametrize(
    ("definition", "said"),
    [
        ("std_msgs/Header header\nint32 nothing", "definition cannot be used"),
        ("not a definition at all {", "definition cannot be used"),
        ("float64[100000000] x", "an array of 100000000 elements"),
        ("float64 a\nfloat64 b\nint32 c", "its type is not the"),
        ("std_msgs/Header header\nstring predictions", "it does not define std_msgs/msg/Header"),
        ("bevfusion_msgs/PredictionArray header", "a type in it holds itself"),
    ],
)
def test_definitions_that_are_none(tmp_path: Path, definition: str, said: str) -> None:
    row = replace(made.stored()[1], definition=definition, data=NOTHING)
    assert said in refusal(made.write_mcap(tmp_path / "a.mcap", [row]), made.DETECTIONS)


_LINE = st.sampled_from(
    (
        *("string predictions", "int32[] predictions", "float64 header", "uint64 id", "string position"),
        *("geometry_msgs/Point size", "bevfusion_msgs/PredictionArray[] predictions", "wstring x"),
        *("int32 class", "int32 __x", "int32 A=99999999999999", "string[<=2] class_name"),
        *("float64[0] z_rotation", "=" * 80, "MSG: a/B", "#", "\x00["),
    )
)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 60), _LINE, st.booleans()), min_size=1, max_size=4))
def test_any_definition_is_used_or_refused(changes: list[tuple[int, str, bool]]) -> None:
    from scenarios.reading import ReadError
    from scenarios.ros.bags.decoding import decoded
    from scenarios.ros.bags.topics import RawMessage, Topic

    row = made.stored()[1]
    lines = row.definition.splitlines()
    for number, line, instead in changes:
        at = number % (len(lines) + 1)
        lines[at : at + instead] = [line]
    topic = Topic("/t", row.type_name, "cdr", "\n".join(lines))
    for data in (row.data, b"\0\1\0\0" + bytes(40)):
        try:
            said = f"topic /t {decoded(RawMessage(topic, 1, data)).received_ns}"
        except ReadError as error:
            said = str(error)
        assert said.startswith("topic /t")
        assert len(said.splitlines()) == 1


def test_a_topic_with_two_types_is_refused(tmp_path: Path) -> None:
    rows = [replace(row, topic="/both") for row in made.stored()]
    assert "topic /both has the types" in refusal(made.write_mcap(tmp_path / "a.mcap", rows), "/both")


def test_a_topic_that_is_not_there(tmp_path: Path) -> None:
    assert "topic /none has no messages" in refusal(made.MCAP, "/none")


# bombs


def chunk(compression: str, data: bytes, size: int) -> bytes:
    """An MCAP file of one chunk."""
    name = compression.encode()
    content = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(name)) + name
    content += struct.pack("<Q", len(data)) + data
    return MAGIC + struct.pack("<BQ", 6, len(content)) + content


@pytest.mark.parametrize("said", [2**40, 1000], ids=["huge", "small"])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "streamed zstd"])
def test_chunks_take_no_more_memory_than_they_may(tmp_path: Path, compression: str, said: int) -> None:
    zeros = bytes(40 * 2**20)
    if compression == "streamed zstd":
        packer = zstandard.ZstdCompressor().compressobj()
        data = packer.compress(zeros) + packer.flush()
    else:
        data = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    del zeros
    path = tmp_path / "a.mcap"
    path.write_bytes(chunk(compression.split()[-1], data, said))
    tracemalloc.start()
    refusal(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(data) < 10**6
    assert peak < 8 * 2**20
    assert said < MAX_PART_BYTES or said == 2**40


def test_compressed_files_do_not_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenarios.ros.bags.compression._LEAST_FILE_BYTES", 2**20)
    path = tmp_path / "a.db3.zstd"
    path.write_bytes(zstandard.compress(bytes(20 * 2**20)))
    assert "grows beyond" in refusal(path)
