"""metadata.yaml of a bag of ROS 2: which files it has, and how many messages there must be."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from scenarios.reading import ReadError, read_text, shown

METADATA = "metadata.yaml"

_MAX_CHARACTERS = 2 * 2**20
"""A topic takes a kilobyte."""

_MAX_DEPTH = 32
"""Brackets in brackets; the parser's time grows with the square of their number."""

_DEEP_LINE = re.compile(r"^[ \t?:-]{200}", re.MULTILINE)
"""A line so far to the right that it is nested too deeply."""


@dataclass(frozen=True, slots=True)
class Metadata:
    """What metadata.yaml says.

    Args:
        files: names of the bag's files, relative to its folder, in the order of time.
        counts: messages by topic.
        type_hashes: hash of the type by topic, where it is given.
    """

    files: tuple[str, ...]
    counts: Counter[str]
    type_hashes: dict[str, str]


def read_metadata(path: Path) -> Metadata:
    """Read metadata.yaml of any version.

    Raises:
        ReadError: it cannot be read, says something impossible, or names a file outside of the bag's folder.
    """
    content = _yaml(read_text(path))
    try:
        content = content["rosbag2_bagfile_information"]
        topics = [_topic(row) for row in content["topics_with_message_count"] or ()]
        total = _whole(content["message_count"])
        files = tuple(_inside(name) for name in content["relative_file_paths"] or ())
        compression = str(content.get("compression_format") or "")
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise ReadError(f"not as rosbag2 writes it: {error!r}") from None
    if compression not in ("", "none", "zstd"):
        raise ReadError(f"compression_format {shown(compression)} is not read: only zstd is")
    counts: Counter[str] = Counter()
    for name, count, _ in topics:
        counts[name] += count
    if sum(counts.values()) != total:
        raise ReadError(f"message_count is {total}, those of the topics make {sum(counts.values())}")
    return Metadata(files, counts, {name: text for name, _, text in topics if text})


def _topic(row: Any) -> tuple[str, int, str]:
    """Name, number of messages and type hash of a topic."""
    topic = row["topic_metadata"]
    return str(topic["name"]), _whole(row["message_count"]), str(topic.get("type_description_hash") or "")


def _whole(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ReadError(f"message_count must be a whole number from 0 on, got {shown(value)}")
    return value


def _inside(name: object) -> str:
    """A file's name, if it leads nowhere else."""
    text = str(name)
    leads_out = any(
        kind(text).is_absolute() or kind(text).drive or ".." in kind(text).parts
        for kind in (PurePosixPath, PureWindowsPath)
    )
    if leads_out or not text or "\0" in text:
        raise ReadError(f"relative_file_paths: {shown(text)} is not a file in the bag's folder")
    return text


def _yaml(text: str) -> Any:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if len(text) > _MAX_CHARACTERS:
        raise ReadError(f"{len(text)} characters: more than {_MAX_CHARACTERS} are not read")
    depth = accumulate((c in "[{") - (c in "]}") for c in text if c in "[]{}")
    if max(depth, default=0) > _MAX_DEPTH or _DEEP_LINE.search(text):
        raise ReadError("nested too deeply")
    load: Callable[[str], Any] = YAML(typ="safe", pure=True).load
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of anchors that are used twice
            return load(text)
    except (YAMLError, ValueError, RecursionError) as error:
        reason = getattr(error, "problem", None) or str(error).split("\n")[0]
        raise ReadError(f"not YAML ({reason})") from None
