"""Pickles of arrays and plain values; hostile ones are made here."""

import io
import os
import pickle
import struct
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.reading import ReadError
from scenarios.recorded.simbev.safe_pickle import PickledArray, read_npy_list, read_pickle

LABEL = {
    "id": 100,
    "type": "vehicle.x",
    "big": 2**63 + 1,
    "negative": -(2**40),
    "is_alive": True,
    "parent": None,
    "attributes": {"role_name": "é"},
    "tags": [14, 13],
    "pair": (1, 2.5),
    "raw": b"\x00\xff",
}
ARRAYS = {
    "box": np.arange(24.0).reshape(8, 3),
    "fortran": np.asfortranarray(np.arange(6, dtype=np.int32).reshape(2, 3)),
    "big endian": np.arange(3, dtype=">f4"),
    "truth": np.array([True, False]),
    "text": np.array(["ab", "c"]),
    "empty": np.zeros((0, 3)),
}


def plain(value: Any) -> Any:
    return value.value if isinstance(value, PickledArray) else value


def saved(values: Any) -> bytes:
    sink = io.BytesIO()
    np.save(sink, values, allow_pickle=True)
    return sink.getvalue()


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_plain_values_and_arrays_are_those_that_were_written(protocol: int) -> None:
    assert read_pickle(pickle.dumps(LABEL, protocol)) == LABEL
    read = read_pickle(pickle.dumps(ARRAYS, protocol))
    assert list(read) == list(ARRAYS)
    for name, array in ARRAYS.items():
        value = plain(read[name])
        assert value.dtype == array.dtype, name
        assert np.array_equal(value, array), name
    scalars = [np.float32(0.5), np.int64(-3), np.bool_(True), np.str_("x")]
    read = read_pickle(pickle.dumps(scalars, protocol))
    assert read == scalars
    assert [type(value) for value in read] == [type(value) for value in scalars]


def test_lists_that_numpy_saved_and_bare_pickles() -> None:
    assert read_npy_list(saved(np.array([LABEL, {}], dtype=object))) == [LABEL, {}]
    assert read_npy_list(pickle.dumps([LABEL])) == [LABEL]
    assert read_npy_list(saved(np.array([]))) == []  # no label: an array of numbers
    shared = {"a": 1}
    first, second = read_npy_list(saved(np.array([shared, shared], dtype=object)))
    assert first is second


def test_numpy_1_and_2_name_their_functions_differently() -> None:
    content = pickle.dumps(np.arange(3.0), 4)
    other = content.replace(b"\x16numpy._core.multiarray", b"\x15numpy.core.multiarray")
    assert other != content
    for each in (content, other.replace(content[2:11], b"")):  # without the frame, whose length has changed
        assert plain(read_pickle(each)).tolist() == [0.0, 1.0, 2.0]


class Calls:
    """Calls a function when it is read."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = function, arguments

    def __reduce__(self) -> Any:
        return self.call


HOSTILE = {
    "system": (lambda path: Calls(os.system, f"touch {path}"), r"names \w+\.system"),
    "eval": (lambda path: Calls(eval, f"open({str(path)!r}, 'w')"), r"names \w+\.eval"),
    "open": (lambda path: Calls(open, str(path), "w"), r"names _?io\.open"),
    "getattr": (lambda path: Calls(getattr, os, "system"), "names "),
    "in a label": (lambda path: [{"id": Calls(os.mkdir, str(path))}], r"names \w+\.mkdir"),
    "a class": (lambda path: path, r"names pathlib"),
    "a set": (lambda path: {1}, r"opcode|names \w+\.set"),
    "objects in an array": (lambda path: np.array([Calls(os.mkdir, str(path))], dtype=object), "names "),
    "dates": (lambda path: np.array(["2020-01-01"], dtype="M8[D]"), "dtype 'M8'"),
    "records": (lambda path: np.zeros(2, dtype=[("a", "f8")]), "dtype 'V8'"),
    "memory map": (lambda path: Calls(np.memmap, str(path), "f8", "w+", 0, (9,)), r"names numpy\.memmap"),
    "load": (lambda path: Calls(np.load, str(path), None, True), r"names numpy"),
}


@pytest.mark.parametrize("protocol", [2, 4, 5])
@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_not_on_the_list_is_refused_by_name_and_never_run(
    name: str, protocol: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "getattr":
        monkeypatch.setattr(os, "__reduce__", lambda: "os", raising=False)
    make, complaint = HOSTILE[name]
    target = tmp_path / "made"
    try:
        content = pickle.dumps(make(target), protocol)
    except TypeError:  # a module is no value of a pickle
        content = b"cbuiltins\ngetattr\n."
    known = set(sys.modules)
    with pytest.raises(ReadError, match=f"pickle refused: .*({complaint})"):
        read_pickle(content)
    assert not target.exists()
    assert set(sys.modules) == known


def global_of(module: str, name: str) -> bytes:
    return f"c{module}\n{name}\n".encode()


def text(value: str) -> bytes:
    return b"X" + struct.pack("<I", len(value)) + value.encode()


EMPTY_ARRAY = (
    global_of("numpy.core.multiarray", "_reconstruct")
    + global_of("numpy", "ndarray")
    + b"K\x00\x85C\x01b\x87R"
)
FLOATS = (
    global_of("numpy", "dtype") + text("f8") + b"\x89\x88\x87R(K\x03" + text("<") + b"NNNJ\xff\xff\xff\xff"
)
FLOATS += b"J\xff\xff\xff\xffK\x00tb"
OBJECTS = global_of("numpy", "dtype") + text("O8") + b"\x89\x88\x87R"
HUGE = b"\x8a\x08" + struct.pack("<q", 10**12)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        # an array of 8 TB in 8 bytes, of numbers and of objects
        (EMPTY_ARRAY + b"(K\x01" + HUGE + b"\x85" + FLOATS + b"\x89C\x0812345678tb.", "an array of shape"),
        (EMPTY_ARRAY + b"(K\x01" + HUGE + b"\x85" + OBJECTS + b"\x89]tb.", "an object array of shape"),
        (EMPTY_ARRAY + b"(K\x01(" + 99 * b"K\x01" + b"t" + FLOATS + b"\x89C\x0812345678tb.", "of shape"),
        # a number of dtype object, whose bytes would be read as an address
        (global_of("numpy.core.multiarray", "scalar") + OBJECTS + b"C\x0812345678\x86R.", "dtype object"),
        # texts, bytes and numbers of a length that is not there
        (b"\x8d" + struct.pack("<Q", 2**60) + b"a.", "cut off"),
        (b"\x8e" + struct.pack("<Q", 2**60) + b"a.", "cut off"),
        (b"\x96" + struct.pack("<Q", 2**60) + b"a.", "cut off"),
        (b"\x8b" + struct.pack("<I", 2**31 - 1) + b"a.", "cut off"),
        # what stands for a name has no state, takes no call of something else, and is not made anew
        (global_of("numpy", "dtype") + b"}" + text("make") + b"Nsb.", "a state of"),
        (b"K\x01)R.", "a call of"),
        (global_of("numpy", "ndarray") + b"K\x03\x85R.", "numpy.ndarray is called"),
        (global_of("numpy", "ndarray") + b")\x81.", "opcode NEWOBJ"),
        (b"(" + text("ls") + global_of("os", "system") + b"o.", "names os.system"),
        (b"(" + text("ls") + b"ios\nsystem\n.", "opcode INST"),
        (b"Pfile\n.", "opcode PERSID"),
        (b"\x82\x01.", "opcode EXT1"),
        # the hash of a tuple in a tuple in a tuple would overflow the stack
        (b"})" + 10**5 * b"\x85" + b"Ns.", "a key that is no text"),
        (text("numpy") + b"K\x01\x93.", "a name that is no text"),
    ],
)
def test_bombs_and_damage_by_hand(content: bytes, complaint: str) -> None:
    with pytest.raises(ReadError, match=complaint):
        read_pickle(b"\x80\x04" + content)


SCALAR = global_of("numpy.core.multiarray", "scalar")
LONG = text(10**5 * "a")
"""A text that is named again and again."""
WHOLE = b"\x8b" + struct.pack("<I", 10**5) + 10**5 * b"\x7f"
"""A whole number of 240,000 digits."""


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        # copies of a text as bytes, or of bytes as values of NumPy: each takes 10 bytes and makes 100,000
        (b"(" + LONG + b"\x94" + 99 * (global_of("_codecs", "encode") + b"h\x00" + text("latin1") + b"\x86R")
         + b"l.", "copies that are longer than the pickle"),
        (b"(B" + struct.pack("<I", 10**5) + 10**5 * b"a" + b"\x94" + global_of("numpy", "dtype")
         + text("S100000") + b"\x89\x88\x87R\x94" + 99 * (SCALAR + b"h\x01h\x00\x86R") + b"t.",
         "copies that are longer than the pickle"),
        # numbers of one hash, each of which a dictionary would compare with all before it
        (b"}(" + b"".join(b"\x8a\x0a" + (k * (2**61 - 1)).to_bytes(10, "little") + b"N" for k in range(1, 9))
         + b"u.", "a key that is no text"),
        # a shape whose product takes hours
        (WHOLE + b"\x94" + EMPTY_ARRAY + b"(K\x01(" + 60 * b"h\x00" + b"t" + FLOATS + b"\x89C\x0812345678tb.",
         "an array of shape .* a number of too many digits"),
        (EMPTY_ARRAY + b"(K\x01J\xff\xff\xff\xff\x85" + FLOATS + b"\x89C\x0812345678tb.", r"shape \(-1,\)"),
    ],
)  # fmt: skip
def test_bombs_that_are_small_files(content: bytes, complaint: str) -> None:
    began_s = time.process_time()
    with pytest.raises(ReadError, match=complaint):
        read_pickle(b"\x80\x04" + content)
    assert time.process_time() - began_s < 1.0


@pytest.mark.parametrize("protocol", [0, 1])
def test_pickles_of_the_oldest_protocols_are_refused_by_opcode(protocol: int) -> None:
    with pytest.raises(ReadError, match=r"refused: opcode (UNICODE|LONG|INT|DICT|LIST)"):
        read_pickle(pickle.dumps([LABEL], protocol))


def test_arrays_out_of_band_are_refused() -> None:
    buffers: list[pickle.PickleBuffer] = []
    content = pickle.dumps(np.arange(3.0), 5, buffer_callback=buffers.append)
    assert len(buffers) == 1
    with pytest.raises(ReadError, match="opcode NEXT_BUFFER"):
        read_pickle(content)


def test_a_memo_of_a_great_number_takes_no_memory() -> None:
    assert read_pickle(b"\x80\x02K\x01r\xff\xff\xff\xff.") == 1


def test_every_damaged_copy_is_refused_or_read() -> None:
    content = saved(np.array([LABEL | ARRAYS], dtype=object))
    for end in range(0, len(content), 7):
        with pytest.raises(ReadError):
            read_npy_list(content[:end])
    random = np.random.default_rng(1)
    for place in random.integers(0, len(content), 2000).tolist():
        damaged = bytearray(content)
        damaged[place] = random.integers(256)
        with suppress(ReadError):
            read_npy_list(bytes(damaged))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "cut off"),
        (b"\x93NUMPY\x01\x00", "its header is damaged"),
        (saved(np.zeros(3)), "expected a list of labels"),
        (saved(np.zeros((2, 2), dtype=object)), "expected a list of labels"),
        (pickle.dumps({"a": 1}), "expected a list of labels, got 'dict'"),
        (pickle.dumps(np.zeros(3), 4), "expected a list of labels, got 'ndarray'"),
    ],
)
def test_files_without_a_list(content: bytes, complaint: str) -> None:
    with pytest.raises(ReadError, match=complaint):
        read_npy_list(content)
