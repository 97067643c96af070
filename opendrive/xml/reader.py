"""OpenDRIVE XML to records.

What places roads and lanes is read at once; a wrong value there is an error with file, road, element and
line. Junctions, road marks, signals, objects and the like are read when first asked for; there, what is wrong
is left out with a `MapWarning`. To ask for the warnings reads everything.
"""

from collections.abc import Iterable, Iterator
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.model import Deferred, DeferredRecords, Header, MapModel
from opendrive.roads.road_records import RoadRecords
from opendrive.xml.columns import read_geometry
from opendrive.xml.document import parse, read_bytes
from opendrive.xml.file import CONTENT, HEADER
from opendrive.xml.lanes import read_remaining
from opendrive.xml.layers import PERMANENT, choose_layer
from opendrive.xml.roads import ROAD, read_known_road
from opendrive.xml.tables import Table
from opendrive.xml.values import Element, Values, children, first

_Record = TypeVar("_Record")


def read_map(path: str | PathLike[str], layer: str = PERMANENT) -> MapModel:
    """Read an OpenDRIVE file (ASAM OpenDRIVE 1.4 to 1.8, and lane layers of 1.9).

    Args:
        path: the ``.xodr`` file.
        layer: lane layer to read, where a road has lanes of it: ``permanent`` or ``temporary``.

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value.
    """
    values = Values(str(Path(path)))
    data = read_bytes(Path(path))
    root = parse(Path(path), data)
    # A file of two bytes per letter has zeros.
    if layer != PERMANENT or b"layer" in data or b"\0" in data:
        choose_layer(values, root, layer)
    header: Header | None = None
    roads: dict[str, Element] = {}
    by_id: dict[str, list[Element]] = {"junctions": [], "controllers": []}
    listed: dict[str, list[Any]] = {"junction_groups": [], "stations": []}
    extra: list[str] = []
    for element in root:
        name, table = CONTENT.get(str(element.tag), ("", HEADER))
        if name == "roads":
            _add(values, element, roads, values.text(element, "id"), element)
        elif name in by_id:
            by_id[name].append(element)
        elif name:
            listed[name] += values.each(table.read, [element])
        elif element.tag == "header" and header is None:
            header = HEADER.read(values, element)
        else:
            extra.extend(values.extra([element]))
    if header is None:
        raise MapContentError(
            f"{path}: <header> is missing; it may be truncated or not OpenDRIVE",
            "asam.net:xodr:1.0.0:xml.fileheader_is_present",
        )
    if not roads:
        raise MapContentError(f"{path}: the map has no <road>; it may be truncated")
    geometry, odd = read_geometry(values, root, list(roads.values()))
    records = RoadRecords(
        roads, partial(read_known_road, values), partial(ROAD.details, values), geometry, odd
    )
    deferred: dict[str, DeferredRecords[Any]] = {
        name: DeferredRecords(partial(_by_id, values, table, by_id[name]))
        for name, table in CONTENT.values()
        if name in by_id
    }
    return MapModel(
        header=header,
        roads=records,
        junctions=deferred["junctions"],
        noted=Deferred(partial(_all_warnings, values, roads, deferred.values())),
        controllers=deferred["controllers"],
        junction_groups=tuple(listed["junction_groups"]),
        stations=tuple(listed["stations"]),
        extra=tuple(extra),
    )


def _add(values: Values, element: Element, records: dict[str, _Record], name: str, record: _Record) -> None:
    if name in records:
        message = f"{element.tag} id {name!r:.80} is used twice; the first is kept"
        values.warn(WarningKind.DUPLICATE_ID, element, message)
    else:
        records[name] = record


def _by_id(values: Values, table: Table[Any], elements: list[Element]) -> dict[str, Any]:
    records: dict[str, Any] = {}
    for element in elements:
        for record in values.each(table.read, [element]):
            _add(values, element, records, record.id, record)
    return records


def _all_warnings(
    values: Values, roads: dict[str, Element], deferred: Iterable[DeferredRecords[Any]]
) -> tuple[MapWarning, ...]:
    """Read what is left as far as it can be warned of, and return what was tolerated."""
    for records in deferred:
        len(records)
    used: set[tuple[str, str]] = set()
    for road_id, element in roads.items():
        for tag, record_id, s_m in _signals_and_objects(values, element):
            if (tag, record_id) in used:
                message = f"{tag} id {record_id!r:.80} is used twice; both are kept"
                values.warnings.append(MapWarning(road_id, tag, message, WarningKind.DUPLICATE_ID, s_m))
            used.add((tag, record_id))
        read_remaining(values, element)
    return tuple(values.warnings)


def _signals_and_objects(values: Values, road: Element) -> Iterator[tuple[str, str, float]]:
    """Yield kind, id and s of the signals and objects of a road; read them if they can be warned of."""
    if values.is_plain(road, ROAD.names):
        for part, tag in (("signals", "signal"), ("objects", "object")):
            for element in children(first(road, part), tag):
                yield tag, element.get("id", ""), values.number(element, "s")
    else:
        details = ROAD.details(values, road)()
        for tag, records in (("signal", details.signals), ("object", details.objects)):
            for record in records:
                yield tag, record.id, record.s_m
