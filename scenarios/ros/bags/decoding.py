"""Serialised messages as values: types as the bag defines them, else ours, checked by their hash."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from scenarios.errors import DatasetError
from scenarios.reading import ReadError
from scenarios.ros.bags.compression import ZSTD_MAGIC, expand
from scenarios.ros.bags.topics import RawMessage, Topic
from scenarios.ros.definitions import ros1_types, ros2_types
from scenarios.ros.messages import READERS, Message

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_ENCODINGS = ("cdr", "ros1")

_PLAIN_CDR = (b"\x00\x00", b"\x00\x01")
"""Big and little endian (OMG DDS-RTPS 2.5, 10.2.1.2)."""

_XCDR2 = range(0x06, 0x0C)
"""Representation identifiers of XCDR version 2 (OMG DDS-XTypes 1.3, 7.6.2.1.2)."""

_END_NS = 2**31 * 1_000_000_000
"""End of the times that a stamp can hold: seconds are int32 (builtin_interfaces/Time)."""

_MAX_ARRAY = 10_000
"""Elements of a fixed array; rosbags writes code for each."""


def decoded(message: RawMessage) -> Message:
    """A stored message as a value.

    Raises:
        ReadError: it is of no type that is read, serialised in another way, damaged, or of no possible time.
    """
    from rosbags.serde import SerdeError

    topic = message.topic
    types = _types(topic)
    data = message.data
    try:
        if not 0 <= message.received_ns < _END_NS:
            raise ReadError("a time before 1970 or after 2038, which stamps of ROS 2 cannot hold")
        if data.startswith(ZSTD_MAGIC):  # no CDR begins so: messages compressed one by one
            data = expand(data, "zstd")
        return READERS[topic.type_name](_deserialised(types, topic, data), message.received_ns)
    except (ReadError, DatasetError) as error:
        reason = str(error)
    except SerdeError as error:
        reason = f"damaged, or of another type ({_line(error)})"
    except _OTHER_FIELDS as error:
        reason = f"its type is not the {topic.type_name} that is read ({_line(error)})"
    raise ReadError(f"topic {topic.name}, message received at {message.received_ns} ns: {reason}") from None


_OTHER_FIELDS = (AttributeError, TypeError, ValueError, OverflowError)
"""What reading raises where the bag's own definition lacks a field, or has it as something else."""


def require_readable(topic: Topic) -> None:
    """Demand that a topic's messages can be read.

    Raises:
        ReadError: its type or serialisation is none that is read, or its hash is another type's.
    """
    if topic.type_name not in READERS:
        raise ReadError(f"topic {topic.name}: type {topic.type_name or 'without a name'} is not read")
    _types(topic)


def _deserialised(types: Typestore, topic: Topic, data: bytes) -> Any:
    if topic.encoding == "ros1":
        return types.deserialize_ros1(data, topic.type_name)
    if data[:2] not in _PLAIN_CDR:
        if data[:1] == b"\x00" and data[1:2] and data[1] in _XCDR2:
            raise ReadError("XCDR2 is not read; record with the default representation XCDR1")
        raise ReadError(f"no CDR: it begins with {data[:4].hex() or 'nothing'}")
    return types.deserialize_cdr(data, topic.type_name)


@lru_cache(maxsize=64)
def _types(topic: Topic) -> Typestore:
    """Types that a topic's messages are read with."""
    if topic.encoding not in _ENCODINGS:
        raise ReadError(
            f"topic {topic.name}: serialisation {topic.encoding!r} is not read, only {', '.join(_ENCODINGS)}"
        )
    if topic.definition.strip():
        types, whose = _defined(topic), "the bag's definition"
    else:
        types, whose = ros1_types() if topic.encoding == "ros1" else ros2_types(), "ours"
    if topic.type_hash.startswith("RIHS01_") and types.hash_rihs01(topic.type_name) != topic.type_hash:
        raise ReadError(
            f"topic {topic.name}: its {topic.type_name} has the hash {topic.type_hash}, {whose} another: "
            "it is another version of the type"
        )
    return types


def _defined(topic: Topic) -> Typestore:
    """Types as a bag defines them."""
    from rosbags.interfaces import Nodetype
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

    try:
        if topic.definition_form == "idl":
            types = get_types_from_idl(topic.definition)
        else:
            types = get_types_from_msg(topic.definition, topic.type_name)
        for _, fields in types.values():
            for _, (kind, what) in fields:
                if kind == Nodetype.ARRAY and int(what[1]) > _MAX_ARRAY:
                    raise ReadError(f"an array of {what[1]} elements")
        store = get_typestore(Stores.EMPTY)
        # what the syntax of ROS 1 knows as time and duration
        built_in = {name: fields for name, fields in ros2_types().fielddefs.items() if name in _BUILT_IN}
        store.register({**built_in, **types})
        store.get_msgdef(topic.type_name)
    except KeyError as error:
        reason = f"it does not define {error.args[0]}"
    except RecursionError:
        reason = "a type in it holds itself"
    except (TypesysError, SerdeError, ReadError, *_NO_CODE) as error:
        reason = _line(error)
    else:
        return store
    raise ReadError(f"topic {topic.name}: its definition cannot be used ({reason})") from None


_NO_CODE = (SyntaxError, NameError, TypeError, ValueError, OverflowError)
"""What making code of a definition raises: names that are none in Python, numbers out of range."""


def _line(error: Exception) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


_BUILT_IN = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
