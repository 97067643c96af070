"""What a bag holds: topics, and messages as they were stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic with one type.

    Args:
        name: the topic.
        type_name: its type as `package/msg/Name`.
        encoding: how messages are serialised: cdr (ROS 2), ros1, or what the bag says.
        definition: the type as the bag defines it, with all types in it; "": it does not.
        definition_form: msg or idl.
        type_hash: hash of the type (REP 2016); "": not given.
    """

    name: str
    type_name: str
    encoding: str
    definition: str = ""
    definition_form: str = "msg"
    type_hash: str = ""


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A message as it was stored.

    Args:
        topic: its topic.
        received_ns: when it was received.
        data: the serialised message.
    """

    topic: Topic
    received_ns: int
    data: bytes


Choice = Collection[str] | None
"""Names of topics; None: all."""


@dataclass(frozen=True, slots=True)
class BagFile:
    """One file of a bag.

    Args:
        topics: what is in it.
        read: messages of the topics chosen, in the order of the file.
        counts: messages by topic, as the file's own index says; None: it does not.
        notes: what a user should know about the file.
    """

    topics: tuple[Topic, ...]
    read: Callable[[Choice], Iterator[RawMessage]]
    counts: Counter[str] | None = None
    notes: tuple[str, ...] = ()


def normalised_type(name: str) -> str:
    """The name of a type as `package/msg/Name`, also of ROS 1 and of early ROS 2, which left `msg` out."""
    package, *middle, last = name.split("/")
    return f"{package}/msg/{last}" if package and last and not middle else name
