"""One SQLite file of a bag of ROS 2, of any version of its schema."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from scenarios.reading import ReadError, shown
from scenarios.ros.bags.topics import BagFile, Choice, RawMessage, Topic, normalised_type

_DEFINITION_FORMS = {"ros2msg": "msg", "ros2idl": "idl"}


def open_sqlite(path: Path) -> BagFile:
    """A SQLite file.

    Raises:
        ReadError: it is damaged, or no bag.
    """
    with closing(_connection(path)) as database:
        topics = _topics(database)

    def read(choice: Choice) -> Iterator[RawMessage]:
        chosen = {n: t for n, t in topics.items() if choice is None or t.name in choice}
        return _messages(path, topics, chosen)

    return BagFile(tuple(dict.fromkeys(topics.values())), read)


def _connection(path: Path) -> sqlite3.Connection:
    """The file, opened without writing anything, unless its last messages are in a file beside it."""
    path = path.absolute()
    log = path.with_name(f"{path.name}-wal")
    immutable = "" if log.is_file() and log.stat().st_size else "&immutable=1"
    try:
        database = sqlite3.connect(f"{path.as_uri()}?mode=ro{immutable}", uri=True)
    except sqlite3.Error as error:
        raise ReadError(str(error)) from None
    database.text_factory = bytes  # texts may be anything; see _text
    return database


def _topics(database: sqlite3.Connection) -> dict[int, Topic]:
    """Topics by their numbers."""
    columns = _columns(database, "topics", ("id", "name", "type"))
    _columns(database, "messages", ("topic_id", "timestamp", "data"))
    definitions = _definitions(database)
    # before schema version 2 all was CDR
    encoding = "serialization_format" if "serialization_format" in columns else "'cdr'"
    type_hash = "type_description_hash" if "type_description_hash" in columns else "''"
    topics = {}
    for row in _rows(database, f"SELECT id, name, type, {encoding}, {type_hash} FROM topics"):
        number, texts = row[0], [_text(value) for value in row[1:]]
        if not isinstance(number, int) or number in topics:
            raise ReadError(f"table topics: id {shown(number)} is no number or there twice")
        name, type_name, form, hash_of_type = texts
        kind, definition = definitions.get(type_name, ("msg", ""))
        topics[number] = Topic(name, normalised_type(type_name), form, definition, kind, hash_of_type)
    return topics


def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Form and text of the definition of each type, which early schemas do not have."""
    if not _is_table(database, "message_definitions"):
        return {}
    _columns(database, "message_definitions", ("topic_type", "encoding", "encoded_message_definition"))
    rows = _rows(database, "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
    texts = ([_text(value) for value in row] for row in rows)
    return {name: (_DEFINITION_FORMS[form], text) for name, form, text in texts if form in _DEFINITION_FORMS}


def _messages(path: Path, topics: dict[int, Topic], chosen: dict[int, Topic]) -> Iterator[RawMessage]:
    with closing(_connection(path)) as database:
        for (number,) in _rows(database, "SELECT DISTINCT topic_id FROM messages"):
            if number not in topics:
                raise ReadError(f"messages of topic {shown(number)}, which table topics does not have")
        marks = ",".join("?" * len(chosen))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
        if "id" not in _columns(database, "messages", ()):
            query = query.replace("ORDER BY id", "ORDER BY rowid")
        for number, received_ns, data in _rows(database, query, tuple(chosen)):
            if not isinstance(received_ns, int) or not isinstance(data, bytes):
                raise ReadError(f"topic {chosen[number].name}: a message has no time or no data")
            yield RawMessage(chosen[number], received_ns, data)


def _is_table(database: sqlite3.Connection, name: str) -> bool:
    """Whether there is an ordinary table of a name: views and virtual tables can run anything."""
    rows = _rows(database, "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?", (name,))
    return any(isinstance(sql, bytes) and sql.upper().startswith(b"CREATE TABLE") for (sql,) in rows)


def _columns(database: sqlite3.Connection, table: str, needed: tuple[str, ...]) -> set[str]:
    if not _is_table(database, table):
        raise ReadError(f"no bag of ROS 2: table {table} is missing")
    names = {_text(row[1]) for row in _rows(database, f"PRAGMA table_info({table})")}
    missing = [name for name in needed if name not in names]
    if missing:
        raise ReadError(f"no bag of ROS 2: table {table} has no column {', '.join(missing)}")
    return names


def _rows(
    database: sqlite3.Connection, query: str, values: tuple[object, ...] = ()
) -> Iterator[tuple[Any, ...]]:
    try:
        yield from database.execute(query, values)
    except (sqlite3.Error, OverflowError) as error:
        raise ReadError(f"damaged, or no SQLite file ({error})") from None


def _text(value: object) -> str:
    try:
        return value.decode() if isinstance(value, bytes) else str(value)
    except UnicodeDecodeError:
        raise ReadError(f"a name is no UTF-8: {shown(value)}") from None
